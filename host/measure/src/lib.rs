//! Photographs of printed stacks to curves over the half angle, each with its provenance and uncertainty.
//!
//! In the order of the data: [`setup`] describes what stood where; [`camera`] reads photographs and makes one picture of radiance
//! from each series of exposures; [`geometry`] gives every pixel its half angle and irradiance, finds camera marks, and solves for what
//! tape and camera left open; [`curves`] scales radiance by the grey card and makes curves, files and a report. [`measure()`] is all of it.
//!
//! [`compare`](mod@compare) lays photographs of a printed sheet over its prediction. [`scans`] reads from scans of charts what dots
//! become and how a printer places and feeds.

#![allow(clippy::disallowed_methods, reason = "a measurement is made once, and its file decides dots")]
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

pub mod camera;
pub mod compare;
pub mod curves;
mod error;
pub mod geometry;
mod linalg;
mod measurement;
pub mod scans;
pub mod setup;

pub use error::MeasureError;
pub use measurement::{Check, Measurement, Taken, check, measure};
