//! A document's materials as a few bases and their weight maps.
//!
//! Problem: gamut mapping moves a handful of extreme materials and carries everything else along as mixtures of them
//! (sections 3.1 and 4.1 of the paper), so a document must first be decomposed into such materials.
//! Method: sample distinct materials; learn bases from them by one of three [`Method`]s; then weight every pixel over
//! the bases in the perceptual metric (equation 1), whichever method learnt the bases.
//! Cost: learning is bounded by the sample size; weighting takes a few microseconds per pixel, on all cores. Curves are
//! computed pixel by pixel and not kept. Results depend on the document and the settings, not on the machine or the number
//! of threads.
//! Limits: learning may miss a material that covers less than a hundred-thousandth of the document; the report gives the
//! distance of the worst pixel.

mod archetypes;
mod cbrt;
mod code;
mod columns;
mod error;
mod factoring;
mod grow;
mod hull;
mod kmeans;
mod parts;
mod pca;
mod sacls;
mod sample;
mod settings;
#[cfg(test)]
mod tests;
mod weigh;

pub use error::FactorError;
pub use factoring::{FactorReport, Factoring, factor, outline};
pub use settings::{FactorSettings, MOST_BASES, Method};

pub use crate::materials::Factored;
