//! Why a document was not mapped.

use inks::Stack;

use super::mix::MixError;
use crate::solve::MixtureError;
use crate::weights::WeightError;

/// Why a document was not mapped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GamutError {
    /// Nothing can be printed.
    #[error(
        "no stack can be printed with the inks at hand; add an ink, or leave the bare substrate among the stacks"
    )]
    NothingPrintable,
    /// More stacks than the index of a sheet holds.
    #[error("{found} stacks are more than the 255 a sheet can hold beside the substrate; choose fewer inks")]
    TooManyStacks {
        /// Stacks given.
        found: usize,
    },
    /// As many curves as stacks are needed.
    #[error("{stacks} stacks come with {curves} curves")]
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
    #[error("the document has {bases} bases and weights for {channels}")]
    Channels {
        /// Bases.
        bases: usize,
        /// Channels of the weight maps.
        channels: usize,
    },
    /// The materials are not those of the factored document.
    #[error("the materials are {found_width} x {found_height} pixels, their weight maps {width} x {height}")]
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
    /// No cartridge may be used, and the bare substrate is not among the stacks.
    #[error(
        "no mixture keeps to {most} cartridges; allow more, or leave the bare substrate among the stacks"
    )]
    Cartridges {
        /// The limit.
        most: usize,
    },
    /// Eq. 1 could not be solved.
    #[error("{what}: {source}")]
    Mixture {
        /// Which target: a basis or a pixel.
        what: String,
        /// Why.
        source: MixtureError,
    },
    /// The result breaks a rule of mixes: a bug.
    #[error(transparent)]
    Mix(#[from] MixError),
    /// The result breaks a rule of weight maps: a bug.
    #[error(transparent)]
    Weights(#[from] WeightError),
}
