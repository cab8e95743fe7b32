//! Why a document cannot be factored.

use crate::weights::WeightError;

/// The largest accepted reflectance (1/sr). The peak of a mirror as narrow as the sun is a tenth of it.
pub(super) const BRIGHTEST: f32 = 1e6;

/// Why a document cannot be factored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// No pixels, or more than can be counted.
    #[error("a document of {width} x {height} pixels cannot be factored; both sides must be at least 1")]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A setting is out of its range.
    #[error("setting `{name}` is {value}; choose a number from {least} to {most}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value that makes sense.
        least: f64,
        /// Largest value that makes sense.
        most: f64,
    },
    /// A pixel's reflectance is no reflectance.
    #[error(
        "pixel ({x}, {y}) has the reflectance {value} in column {column}; a finite number up to {} per steradian was \
         expected: check the texture or curve it comes from",
        BRIGHTEST
    )]
    Reflectance {
        /// Column of the pixel.
        x: usize,
        /// Row of the pixel.
        y: usize,
        /// Column of the tabulation.
        column: usize,
        /// The value found.
        value: f32,
    },
    /// The weights are no weight maps: a bug, reported instead of printed.
    #[error("the weights found are no partition of unity: {0}")]
    Weights(#[from] WeightError),
}
