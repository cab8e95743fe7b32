//! From files of photographs to light: one picture of radiance for each series of exposures.
//!
//! `series` sorts the files by lamp, [`photo`] reads them and [`frames`] corrects them; `probe`, `align`, `files` and `response` find out how exposures
//! compare, and `chain` what that says; [`merge`] joins them, and `residual_shift` says what their alignment left.

pub(crate) mod align;
mod chain;
pub(crate) mod exposure;
mod files;
pub mod frames;
pub mod merge;
pub mod photo;
pub(crate) mod probe;
pub(crate) mod residual_shift;
mod response;
pub(crate) mod series;
