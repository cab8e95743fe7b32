//! Mapping the bases of a document to mixtures of printable stacks.
//!
//! Problem: most materials of a document cannot be printed exactly; each must become a mixture of stacks that looks like
//! it, and materials that differ should still differ.
//! Method: by intent. [`Intent::Basis`] maps the document's few bases by eq. 1 and keeps the weight maps (section 4.1 of
//! the 2009 paper: convex combinations of convex combinations are printable); [`Intent::Clamp`] maps every pixel by eq. 1;
//! [`Intent::Blend`] changes smoothly from clamping, where the material is in the gamut, to the mapped bases, where it is
//! far outside; [`Intent::Contrast`] clamps in the gamut and outside it keeps differences between neighbours.
//! [`Intent::Auto`] clamps unless that merges materials that differ and blending keeps clearly more of them apart.
//! Cost: a millisecond per basis; 7 to 10 microseconds per pixel and core for clamp and blend, three times that for
//! contrast. Limits: the mixture is exact only for light that does not scatter sideways in the paper.

mod assemble;
mod basis;
mod blend;
mod candidates;
mod cartridges;
mod choice;
mod clamp;
mod doubt;
mod error;
mod eye;
pub mod files;
mod fitted;
mod gloss;
mod local;
mod map;
mod mix;
mod moved;
mod prune;
mod recent;
mod redundancy;
mod report;
mod sample;
mod settings;
#[cfg(test)]
mod tests;
mod typical;

pub use candidates::Printable;
pub use doubt::{Doubt, doubt};
pub use error::GamutError;
pub use map::{Choice, Gain, choose, clamped, gain, map};
pub use mix::{InkMix, MixError};
pub use redundancy::{LeftOut, redundancy};
pub use report::{GivenUp, Judged, Mapped, MaterialReport, PixelReport, Report};
pub use settings::{Gloss, Intent, LIGHT, Settings};
