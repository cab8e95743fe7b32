//! RGL, the printer's language: one job is one sheet, all its passes, one eject.
//!
//! [`command`] names the commands, [`encode`] writes them, [`parse`](mod@parse) reads them back. [`order`] is the legal
//! order of a job. The strict reader holds jobs to it, and so does [`job`], which alone makes jobs to send, from what
//! [`setup`] allows. [`ending`] is how a job ends early, and [`track`] follows a stream that was made elsewhere, so that
//! it can be ended too. Nothing here does input or output: slices in, slices out.
//!
//! Commands can be encoded one by one for tests and tools. What a printer gets must come from [`job::JobWriter`], which
//! cannot write a job that harms the printer.
//!
//! # Example
//!
//! A job of one row is written, then read strictly. Cut short or changed, it is refused with the place of the fault:
//!
//! ```
//! use protocol::ink::Ink;
//! use protocol::paper::Paper;
//! use protocol::rgl::{Fault, JobSetup, JobWriter, Order, Page, Refusal, Step, parse};
//!
//! let setup = JobSetup::new(Page::plain(Paper::Postcard), &[Ink::Black], None).unwrap();
//! let mut writer = JobWriter::new(setup, 1).unwrap();
//! let (mut job, mut room) = (Vec::new(), [0; 128]);
//! let length = writer.begin(&mut room).unwrap();
//! job.extend(&room[..length]);
//! let length = writer.next_pass(&mut room).unwrap();
//! job.extend(&room[..length]);
//! let length = writer.row(&[0b1110_0000], &mut room).unwrap();
//! job.extend(&room[..length]);
//! let length = writer.end(&mut room).unwrap();
//! job.extend(&room[..length]);
//!
//! /// Reads a job to its last byte.
//! fn read(job: &[u8]) -> Result<Order, Refusal> {
//!     let (mut order, mut at) = (Order::new(), 0);
//!     let here = |at| move |refusal: Refusal| Refusal { at: at + refusal.at, ..refusal };
//!     while at < job.len() {
//!         let Step::Command(command, length) = parse(&job[at..]).map_err(here(at))? else { break };
//!         order.accept(&command).map_err(here(at))?;
//!         at += length;
//!     }
//!     Ok(order)
//! }
//!
//! assert!(read(&job).unwrap().is_complete());
//! assert!(!read(&job[..job.len() - 3]).unwrap().is_complete());
//! job[4] = b'X';
//! assert_eq!(read(&job).unwrap_err(), Refusal { fault: Fault::UnknownCommand, at: 4 });
//! ```

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
