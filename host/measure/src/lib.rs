//! Photographs of printed stacks to curves over the half angle, each with its provenance and uncertainty.
//!
//! In the order of the data: [`setup`] describes what stood where; [`photo`] reads the files; `probe`, `align` and `response` find
//! out how the exposures compare; [`merge`] makes one picture of radiance from them; [`card`] finds the grey card and gives
//! radiance its scale; [`geometry`] gives every pixel its half angle and irradiance, and `solve` corrects what was measured with a
//! tape; [`reduce`] makes curves; [`library`] writes them; [`report`] shows them. [`measure()`] is all of it.
//! [`readings`] makes a curve from a gloss meter and a spectrophotometer instead.
//!
//! [`compare`](mod@compare) lays photographs of a printed sheet over its prediction: [`marks`] finds the sheet's camera marks, and
//! [`camera`] where the camera was. [`ramp`] reads dot gain and the smallest cluster that holds from scans of the ramp chart,
//! [`registration`] how a printer places and feeds.
#![forbid(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixels and bins are counted in numbers far below 2^31, and positions are checked against the picture"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "channels, bins and pixels are numbered across several arrays at once"
)]

mod align;
pub mod camera;
pub mod card;
pub mod compare;
mod edges;
mod error;
pub mod geometry;
pub mod library;
mod linear;
pub mod marks;
mod measurement;
pub mod merge;
pub mod patches;
pub mod photo;
mod pictures;
mod plane;
mod probe;
pub mod ramp;
pub mod readings;
pub mod reduce;
pub mod registration;
pub mod report;
pub mod resolution;
mod response;
mod scan;
pub mod setup;
mod slips;
mod smooth;
mod solve;

pub use error::MeasureError;
pub use measurement::{Measurement, Taken, measure};
