//! Why a document cannot be factored.

use crate::weights::WeightError;

/// The largest accepted reflectance (1/sr), beyond which a number would be a mistake: the peak of a mirror as
/// narrow as the sun is a tenth of it.
pub(super) const BRIGHTEST: f32 = 1e6;

/// Why a document cannot be factored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// The document has no pixels, or too many.
    #[error(
        "cannot factor a document of {width} x {height} pixels; it must have at least one pixel and fit in memory"
    )]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A setting is out of range.
    #[error("the setting `{name}` is {value}; expected a number from {least} to {most}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest allowed value.
        least: f64,
        /// Largest allowed value.
        most: f64,
    },
    /// The reflectance of a pixel is too large or not a number.
    #[error(
        "pixel ({x}, {y}) has the reflectance {value} in column {column}; expected a finite number up to {} per \
         steradian: check the texture or curve of this pixel",
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
    /// The weights are not weight maps, which is a bug in this crate.
    #[error("the computed weights are not a partition of unity (this is a bug)")]
    Weights(#[from] WeightError),
}
