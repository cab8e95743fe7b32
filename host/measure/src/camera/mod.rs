//! From files of photographs to light: one picture of radiance for each series of exposures.
//!
//! `series` sorts the files by lamp and [`photo`] reads them; `probe`, `align` and `response` find out how exposures compare; [`merge`] joins them, and
//! `residual_shift` says what their alignment left.

pub(crate) mod align;
pub mod merge;
pub mod photo;
pub(crate) mod probe;
pub(crate) mod residual_shift;
mod response;
pub(crate) mod series;
