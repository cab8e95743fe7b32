//! RGL, the printer's language: one job is one sheet, all its passes, one eject.
//!
//! [`command`] names the commands, [`encode`] writes them, [`parse`](mod@parse) reads them back. [`order`] is the legal
//! order of a job, shared by the strict reader and by [`job`], the only thing that makes a job to send, of what
//! [`setup`] allows. Nothing here does input or output: slices in, slices out.
//!
//! Commands can be encoded one by one for tests and tools; what a printer gets must come from
//! [`job::JobWriter`], which cannot be made to write a job that harms the machine.

pub mod command;
pub mod encode;
pub mod fault;
pub mod job;
pub mod order;
pub mod parse;
pub mod setup;

pub use command::{Cassettes, Command, Compression, Media, Mode, PaperCode, Resolution};
pub use fault::{Fault, Refusal};
pub use job::JobWriter;
pub use order::Order;
pub use parse::{Step, parse};
pub use setup::{FoilConsent, JobSetup, Page};
