//! From a job to the printer, once.
//!
//! A job goes to a [`Destination`]: a file, a device that takes its bytes as they are, or a bridge. Only a whole legal
//! job is sent, checked before the first byte. With a bridge the job is [kept on disk](journal) first, and a
//! [`session`](session::Session) sees to it that the bytes at the printer are those of the job, once, whatever happens to
//! cable, bridge or this computer. *Queued is not printed*: positions shown to the user count bytes that crossed the
//! printer's port.

mod address;
pub mod cartridges;
mod check;
pub mod find;
pub mod finish;
pub mod journal;
pub mod log;
mod picture;
pub mod query;
pub mod raw;
mod record;
mod run;
pub mod session;
pub mod status;
pub mod streams;
pub mod transport;
pub mod usb;
pub mod wiring;
pub mod words;

pub use address::{Address, Destination, NoAddress, NoDestination, OpenError};
pub use check::{Checked, Unsendable, check};
pub use run::{Event, RunError, Wish, run, run_at, run_while};
