//! The ink library: what each cartridge is, what each stack of layers reflects, and where each number comes from.
#![forbid(unsafe_code)]

pub mod curve;
pub mod ggx;
pub mod stack;

pub use curve::{Curve, CurveError};
pub use stack::{Stack, StackError};
