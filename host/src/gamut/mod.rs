//! Bases to mixtures of printable stacks.

use inks::Stack;

use crate::weights::WeightMaps;

/// What the halftoner reads: at a pixel with weights `a`, stack q has the share `sum_i a_i matrix[i][q]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InkMix {
    /// The stacks in use. The bare substrate is always the first, even where it has no share.
    pub stacks: Vec<Stack>,
    /// Weights over the rows of `matrix`, at the document's own resolution.
    pub maps: WeightMaps,
    /// One row of `stacks.len()` shares for each channel of `maps`; each row sums to [`crate::weights::ONE`].
    pub matrix: Vec<Vec<u16>>,
}
