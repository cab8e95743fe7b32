//! From radiance to curves of reflectance over the half angle, their files and their report.
//!
//! [`card`] finds the grey card and gives radiance its scale; [`patches`] says which pixels show which stack; [`reduce`] makes curves
//! of them, and `coverage` judges what they lack; [`library`] writes them as an ink library, and [`report`] shows them. [`readings`] makes a curve from a gloss meter
//! and a spectrophotometer instead.

pub mod card;
pub(crate) mod coverage;
pub mod library;
pub mod patches;
pub(crate) mod pictures;
pub mod readings;
pub mod reduce;
pub mod report;
mod smooth;
