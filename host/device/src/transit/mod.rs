//! A job on its way to the printer, once, whatever happens to cable, bridge or this computer.
//!
//! The job is [kept on disk](journal) first. A [`session`](session::Session) sees to it that the bytes at the printer are
//! those of the job, [`run()`] moves its bytes over real links, and [`finish`] waits for the sheet. A device without a bridge takes the
//! bytes as they are ([`raw`]). *Queued is not printed*: positions shown to the user count bytes that crossed the printer's port.

pub mod finish;
pub mod journal;
pub mod raw;
mod record;
mod run;
pub mod session;
pub mod words;

pub use run::{Event, RunError, Wish, run, run_at, run_while};
