//! The ink library: cartridges, the reflectance of each stack of layers, and the source of each number.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![forbid(unsafe_code)]
#![warn(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![allow(
    clippy::cast_precision_loss,
    reason = "only numbers of samples become floating point, far below 2^52"
)]

pub mod albedo;
pub mod archive;
mod cartridges;
mod combine;
mod curve;
mod format;
pub mod ggx;
pub mod gloss;
mod judge;
pub mod lab;
mod library;
pub mod linalg;
mod lobes;
pub mod model;
pub mod names;
mod open;
pub mod own;
pub mod predict;
mod problem;
pub mod provenance;
mod read;
mod rule;
pub mod set;
mod stack;
mod uncertainty;

pub use curve::{Curve, CurveError, KnotPosition, Knots};
pub use format::{Caution, FILE_NAME};
pub use library::{Cartridge, Dots, Entry, Library, Origins};
pub use lobes::{Lobe, Lobes};
pub use open::LibraryError;
pub use problem::Problem;
pub use provenance::{Provenance, Source, Trust};
pub use rule::{Certainty, Rule, Severity};
pub use set::{InkSet, InkSetError};
pub use stack::{Stack, StackError};
pub use uncertainty::{SampleKind, Uncertainty};
