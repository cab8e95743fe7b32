//! RGL, the printer's language: one job is one sheet, all its passes, one eject.
//!
//! [`command`] names the commands, [`encode`] writes them, [`parse`](mod@parse) reads them back. [`order`] is the legal
//! order of a job. The strict reader holds jobs to it, and so does [`job`], which alone makes jobs to send, from what
//! [`setup`] allows. [`ending`] is how a job ends early, and [`track`] follows a stream that was made elsewhere, so that
//! it can be ended too. Nothing here does input or output: slices in, slices out.
//!
//! Commands can be encoded one by one for tests and tools. What a printer gets must come from [`job::JobWriter`], which
//! cannot write a job that harms the printer.

pub mod command;
pub mod encode;
pub mod ending;
pub mod fault;
pub mod job;
pub mod order;
pub mod parse;
pub mod setup;
pub mod track;

pub use command::{Cartridges, Command, Compression, Media, Mode, PaperCode, Resolution};
pub use ending::Ending;
pub use fault::{Fault, Refusal};
pub use job::JobWriter;
pub use order::Order;
pub use parse::{Step, parse};
pub use setup::{FoilConsent, JobSetup, Page};
pub use track::Track;
