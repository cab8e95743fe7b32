//! Where everything was: what each pixel of a photograph sees, and where cameras, lamps and sheets stood.
//!
//! [`scene`] gives pixels of a sample their half angle and irradiance, `measures` says what was measured with a tape, and `correction` corrects it;
//! `shadow` says what light there is besides the lamp's.
//! [`marks`] finds camera marks in a [`grey`] picture, `sheet_marks` those of the sheet as printed; [`pose`] solves for the camera
//! that saw them, `homography` maps one plane to another.

pub(crate) mod correction;
pub mod grey;
pub(crate) mod homography;
pub mod marks;
pub(crate) mod measures;
pub mod pose;
pub mod scene;
pub(crate) mod shadow;
pub(crate) mod sheet_marks;
pub(crate) mod sides;
