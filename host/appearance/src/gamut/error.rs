//! Why a document was not mapped.

use inks::Stack;

use super::result::mix::MixError;
use crate::solve::MixtureError;
use crate::weights::WeightError;

/// Why a document was not mapped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GamutError {
    /// No stack can be printed.
    #[error(
        "no stack can be printed with the available inks; add an ink, or keep the bare substrate among the stacks"
    )]
    NothingPrintable,
    /// More stacks than the index of a sheet can hold.
    #[error("{found} stacks; a sheet can hold 255 besides the substrate: choose fewer inks")]
    TooManyStacks {
        /// Stacks given.
        found: usize,
    },
    /// The number of curves differs from the number of stacks.
    #[error("{stacks} stacks have {curves} curves; expected one each")]
    Curves {
        /// Stacks given.
        stacks: usize,
        /// Curves given.
        curves: usize,
    },
    /// A stack is listed twice.
    #[error("stack `{stack}` is listed twice")]
    Twice {
        /// The stack.
        stack: Stack,
    },
    /// Weight maps and bases disagree.
    #[error("the document has {bases} bases, but weights for {channels}")]
    Channels {
        /// Bases.
        bases: usize,
        /// Channels of the weight maps.
        channels: usize,
    },
    /// The materials do not belong to the factored document.
    #[error(
        "the materials have {found_width} x {found_height} pixels, but the weight maps have {width} x {height}"
    )]
    Size {
        /// Pixels across of the maps.
        width: usize,
        /// Pixels down of the maps.
        height: usize,
        /// Pixels across of the materials.
        found_width: usize,
        /// Pixels down of the materials.
        found_height: usize,
    },
    /// The limit excludes all mixtures, and the bare substrate is not among the stacks.
    #[error(
        "no mixture is possible with {most} cartridges; allow more, or keep the bare substrate among the stacks"
    )]
    Cartridges {
        /// The limit.
        most: usize,
    },
    /// Eq. 1 could not be solved.
    #[error("{what} cannot be fitted")]
    Mixture {
        /// The target: a basis or a pixel.
        what: String,
        /// Why.
        source: MixtureError,
    },
    /// The result is not a valid mix, which is a bug.
    #[error(transparent)]
    Mix(#[from] MixError),
    /// The result is not valid weight maps, which is a bug.
    #[error(transparent)]
    Weights(#[from] WeightError),
}
