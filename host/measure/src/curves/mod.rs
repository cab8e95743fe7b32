//! From radiance to curves of reflectance over the half angle, their files and their report.
//!
//! [`card`] finds the grey card and gives radiance its scale, and `blur` the lens'; [`patches`] says which pixels show which stack; `gather` takes them, [`reduce`] makes curves
//! of them with what [`extent`] says of pixels and lamps, and `coverage` judges what they lack; [`library`]
//! writes them as an ink library, and [`report`] shows them. [`readings`] makes a curve from a gloss meter
//! and a spectrophotometer instead.

pub(crate) mod blur;
pub mod card;
pub(crate) mod coverage;
pub mod extent;
pub(crate) mod gather;
pub mod library;
pub mod patches;
pub(crate) mod pictures;
pub mod readings;
pub mod reduce;
pub mod report;
mod smooth;
