//! Samples: materials drawn by the program, so that there is something to print before there is a document.
//!
//! Each is a set of texture maps at 8 bits. [`crate::document`] opens them from memory or writes them as an ordinary folder, with
//! the same numbers either way. They are deterministic: no clock, and a hash as the only source of noise.

mod canvas;
mod card;
mod catalogue;
mod dove;
mod flange;
mod ladder;
mod leaf;
mod painting;

pub use catalogue::{SAMPLES, Sample, UnknownSample};
pub(crate) use painting::Finish;
