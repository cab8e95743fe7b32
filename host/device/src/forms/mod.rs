//! The forms of a job: bytes in the printer's language, and the pass streams a bridge makes the same bytes of.
//!
//! Only a whole legal job is sent, [checked](check()) before the first byte leaves. [`streams`] codes it for the cable.

mod check;
mod frame_search;
pub mod streams;

pub use check::{Checked, PassPlace, Unsendable, check};
