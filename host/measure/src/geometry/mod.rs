//! Where everything was: what each pixel of a photograph sees, and where cameras, lamps and sheets stood.
//!
//! [`scene`] gives pixels of a sample their half angle and irradiance, and `correction` corrects what was measured with a tape.
//! [`marks`] finds camera marks in a picture, `sheet_marks` those of the sheet as printed; [`pose`] solves for the camera
//! that saw them, `homography` maps one plane to another.

pub(crate) mod correction;
pub(crate) mod homography;
pub mod marks;
pub mod pose;
pub mod scene;
pub(crate) mod sheet_marks;
