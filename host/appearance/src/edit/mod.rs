//! Editing a factored document: its bases and where they lie (figure 3 of the 2009 paper).
//!
//! Problem: to change a material of a document, not its pixels, and to be able to take it back.
//! Method: an edit is a [`Step`]; [`apply`] makes a new document of a document and its steps and leaves the old one alone.
//! Steps are kept as TOML beside the edited document ([`Steps`]) and give it again, bit by bit. An edit of a basis changes its
//! curve ([`Surface`], or another document's curve); with a [`Mask`] it splits the basis: the edited curve becomes a new basis, and the
//! mask moves weight to it. Swapping and mixing move weights alone. Weights stay fixed point and every pixel's sum 1, since what one
//! map loses another gains. [`reach`] says how near the inks come to the result.
//! Cost: a pass over the pixels for each masked step. Limits: 256 bases, and 2^30 weights.

mod apply;
mod error;
mod fingerprint;
mod mask;
mod reach;
mod replacement;
mod steps;
mod surface;
#[cfg(test)]
mod tests;

pub use apply::{Change, Edited, Effect, Step, apply};
pub use error::EditError;
pub use fingerprint::fingerprint;
pub use mask::{Mask, Painted};
pub use reach::reach;
pub use replacement::Replacement;
pub use steps::{FILE_NAME, Steps};
pub use surface::{Applied, Surface, Tint};
