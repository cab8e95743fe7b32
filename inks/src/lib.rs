//! The ink library: cartridges, the reflectance of each stack of layers, and the source of each number.
#![forbid(unsafe_code)]
#![warn(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![allow(
    clippy::cast_precision_loss,
    reason = "only numbers of samples become floating point, far below 2^52"
)]

pub mod albedo;
pub mod curve;
pub mod format;
pub mod ggx;
pub mod gloss;
pub mod lab;
pub mod library;
pub mod lobes;
pub mod model;
pub mod problem;
pub mod provenance;
mod read;
pub mod rule;
pub mod set;
pub mod stack;

pub use curve::{Curve, CurveError};
pub use format::{Caution, FILE_NAME};
pub use library::{Cartridge, Entry, Library, LibraryError};
pub use lobes::{Lobe, Lobes};
pub use problem::Problem;
pub use provenance::{Provenance, Source};
pub use rule::{Certainty, Rule, Severity};
pub use set::{InkSet, InkSetError};
pub use stack::{Stack, StackError};
