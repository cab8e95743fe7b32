//! The mapped document as the halftoner reads it.

use inks::Stack;
use protocol::ink::Ink;

use crate::weights::{ONE, WeightMaps};

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

/// Which rule of mixes is broken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MixError {
    /// The substrate is first and only there, no stack comes twice, and there are 256 at most.
    #[error("stack {index} (`{stack}`): a mix has the substrate first, then at most 255 different stacks")]
    Stacks {
        /// Position in the list.
        index: usize,
        /// The stack.
        stack: Stack,
    },
    /// As many rows as weight maps.
    #[error("{rows} rows of shares for {channels} weight maps; one each is needed")]
    Rows {
        /// Rows found.
        rows: usize,
        /// Weight maps.
        channels: usize,
    },
    /// A row has a share for each stack.
    #[error("row {row} has {found} shares for {stacks} stacks; one each is needed")]
    Shares {
        /// The row.
        row: usize,
        /// Shares found.
        found: usize,
        /// Stacks.
        stacks: usize,
    },
    /// The shares of a row sum to one.
    #[error("the shares of row {row} sum to {sum}, not {ONE}")]
    Sum {
        /// The row.
        row: usize,
        /// Their sum, in units of 1/ONE.
        sum: u64,
    },
}

impl InkMix {
    /// A mix from its parts, if they keep the rules.
    pub fn new(stacks: Vec<Stack>, maps: WeightMaps, matrix: Vec<Vec<u16>>) -> Result<InkMix, MixError> {
        let mix = InkMix { stacks, maps, matrix };
        mix.check()?;
        Ok(mix)
    }

    /// Whether the parts keep the rules of a mix.
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

    /// The share of each stack at a pixel, in 0..=1; `out` has a place for each stack. They sum to 1 to rounding.
    pub fn shares(&self, pixel: usize, out: &mut [f64]) {
        out.fill(0.0);
        let unit = 1.0 / (f64::from(ONE) * f64::from(ONE));
        for (&weight, row) in self.maps.at(pixel).iter().zip(&self.matrix) {
            if weight > 0 {
                for (out, &share) in out.iter_mut().zip(row) {
                    // Exact: products of two weights are whole numbers below 2^31, and so are their sums.
                    *out += f64::from(u32::from(weight) * u32::from(share));
                }
            }
        }
        out.iter_mut().for_each(|share| *share *= unit);
    }

    /// The inks of the stacks that have a share anywhere, in the order of the ink codes.
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
