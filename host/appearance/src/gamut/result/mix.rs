//! The mapped document in the form the halftoner reads.

use inks::Stack;
use protocol::ink::Ink;

use crate::weights::{ONE, WeightMaps};

/// The input of the halftoner: at a pixel with weights `a`, stack q has the weight `sum_i a_i matrix[i][q]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InkMix {
    /// The stacks in use. The bare substrate is always the first, even if it has no weight.
    pub stacks: Vec<Stack>,
    /// Weights over the rows of `matrix`, at the resolution of the document.
    pub maps: WeightMaps,
    /// One row of `stacks.len()` weights per channel of `maps`; each row sums to [`crate::weights::ONE`].
    pub matrix: Vec<Vec<u16>>,
}

/// Why some parts are not a mix.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MixError {
    /// The substrate must come first and only there, no stack may occur twice, and there can be at most 256.
    #[error("stack {index} (`{stack}`): expected the substrate first, then at most 255 different stacks")]
    Stacks {
        /// Position in the list.
        index: usize,
        /// The stack.
        stack: Stack,
    },
    /// The number of rows differs from the number of weight maps.
    #[error("the matrix has {rows} rows for {channels} weight maps; expected one each")]
    Rows {
        /// Rows found.
        rows: usize,
        /// Weight maps.
        channels: usize,
    },
    /// The length of a row differs from the number of stacks.
    #[error("row {row} of the matrix has {found} weights for {stacks} stacks; expected one each")]
    Shares {
        /// The row.
        row: usize,
        /// Weights found.
        found: usize,
        /// Stacks.
        stacks: usize,
    },
    /// The weights of a row do not sum to one.
    #[error("the weights in row {row} of the matrix sum to {sum}, not {ONE}")]
    Sum {
        /// The row.
        row: usize,
        /// Their sum, in units of 1/ONE.
        sum: u64,
    },
}

impl InkMix {
    /// A mix from its parts, if they are valid.
    pub fn new(stacks: Vec<Stack>, maps: WeightMaps, matrix: Vec<Vec<u16>>) -> Result<InkMix, MixError> {
        let mix = InkMix { stacks, maps, matrix };
        mix.check()?;
        Ok(mix)
    }

    /// Takes the mix out and leaves bare substrate of one pixel in its place, for whoever keeps what a mix came with.
    #[must_use]
    pub fn take(&mut self) -> InkMix {
        let bare = InkMix {
            stacks: vec![Stack::SUBSTRATE],
            maps: WeightMaps::uniform(1, 1),
            matrix: vec![vec![ONE]],
        };
        std::mem::replace(self, bare)
    }

    /// Checks that the parts are valid.
    pub fn check(&self) -> Result<(), MixError> {
        if self.stacks.is_empty() {
            return Err(MixError::Stacks { index: 0, stack: Stack::SUBSTRATE });
        }
        for (index, stack) in self.stacks.iter().enumerate() {
            if (index == 0) != stack.layers().is_empty()
                || index > 255
                || self.stacks[..index].contains(stack)
            {
                return Err(MixError::Stacks { index, stack: stack.clone() });
            }
        }
        if self.matrix.len() != self.maps.channels() {
            return Err(MixError::Rows { rows: self.matrix.len(), channels: self.maps.channels() });
        }
        for (row, shares) in self.matrix.iter().enumerate() {
            if shares.len() != self.stacks.len() {
                return Err(MixError::Shares { row, found: shares.len(), stacks: self.stacks.len() });
            }
            let sum = shares.iter().map(|&s| u64::from(s)).sum();
            if sum != u64::from(ONE) {
                return Err(MixError::Sum { row, sum });
            }
        }
        Ok(())
    }

    /// The weight of each stack at a pixel, in 0..=1; `out` has one place per stack. The weights sum to 1 up to rounding.
    pub fn shares(&self, pixel: usize, out: &mut [f64]) {
        out.fill(0.0);
        let unit = 1.0 / (f64::from(ONE) * f64::from(ONE));
        for (&weight, row) in self.maps.at(pixel).iter().zip(&self.matrix) {
            if weight > 0 {
                for (out, &share) in out.iter_mut().zip(row) {
                    // Exact, because products of two weights are integers up to 2^30, and so are their sums.
                    *out += f64::from(u32::from(weight) * u32::from(share));
                }
            }
        }
        out.iter_mut().for_each(|share| *share *= unit);
    }

    /// The inks of the stacks with any weight, in the order of their codes.
    pub fn inks(&self) -> Vec<Ink> {
        let used =
            |q: &usize| self.matrix.iter().any(|row| row[*q] > 0) && !self.stacks[*q].layers().is_empty();
        let mut inks: Vec<Ink> = (0..self.stacks.len())
            .filter(used)
            .flat_map(|q| self.stacks[q].layers().iter().copied())
            .collect();
        inks.sort_unstable();
        inks.dedup();
        inks
    }
}
