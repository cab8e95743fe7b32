//! The encodings of a job: passes, bytes in the printer's language, and the pass streams a bridge makes the
//! same bytes of.
//!
//! Only a whole legal job is sent, whatever its [`Content`]: its bytes are [checked](check()) before the first one leaves.
//! [`streams`] codes it for the cable.

mod check;
mod frame_search;
pub mod streams;

pub use check::{Checked, PassPlace, Unsendable, check};
use press::pipeline;

/// What is sent.
#[derive(Clone, Copy, Debug)]
pub enum Content<'a> {
    /// A job that was just made, with its passes and its frame.
    Made(&'a pipeline::Job),
    /// Bytes that come from elsewhere.
    Bytes(&'a [u8]),
}

impl<'a> Content<'a> {
    /// The bytes at the port.
    pub fn bytes(self) -> &'a [u8] {
        match self {
            Content::Made(job) => &job.bytes,
            Content::Bytes(bytes) => bytes,
        }
    }
}
