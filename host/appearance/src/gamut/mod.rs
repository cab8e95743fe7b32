//! Mapping the bases of a document to mixtures of printable stacks.
//!
//! Problem: most materials of a document cannot be printed exactly; each must become a mixture of stacks
//! that looks like it, and materials that differ should still differ.
//! Method: by intent. [`Intent::Basis`] maps the document's few bases by eq. 1 and keeps the weight maps
//! (section 4.1 of the 2009 paper: convex combinations of convex combinations are printable);
//! [`Intent::Clamp`] maps every pixel by eq. 1; [`Intent::Blend`] changes smoothly from clamping, where the
//! material is in the gamut, to the mapped bases, where it is far outside; [`Intent::Contrast`] clamps in
//! the gamut and outside it keeps differences between neighbours. [`Intent::Auto`] clamps unless that
//! merges materials that differ and blending keeps clearly more of them apart. [`Intent::Shine`] clamps,
//! and lets light count more for materials that are sharper than the inks; [`Intent::Auto`] does so where
//! their balls look clearly better.
//! Cost: a millisecond per basis; 7 to 10 microseconds per pixel and core for clamp and blend, three times
//! that for contrast. Limits: the mixture is exact only for light that does not scatter sideways in the
//! paper.

mod balls;
mod candidates;
mod error;
mod fitting;
mod map;
mod notes;
mod rare;
mod result;
mod sample;
mod selection;
mod settings;
mod shine;
#[cfg(test)]
mod tests;
mod things;

pub use candidates::Printable;
pub use error::GamutError;
pub use map::{Choice, Gain, choose, clamped, gain, map};
pub use result::files;
pub use result::mix::{InkMix, MixError};
pub use result::report::{GamutReport, Judged, Mapped, MaterialReport, PixelReport, Worth};
pub use result::uncertainty::{DistanceUncertainty, distance_uncertainty};
pub use selection::redundancy::{LeftOut, redundancy};
pub use settings::{GamutSettings, Gloss, Intent, LIGHT};
