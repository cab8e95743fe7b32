//! The ink library: what each cartridge is, what each stack of layers reflects, and where each number comes from.
#![forbid(unsafe_code)]

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
