//! Print queues: the parts of the program that CUPS starts, and what makes them a queue.
//!
//! ```text
//! lp file.pdf ─▶ cupsd ─▶ pdftopdf ─▶ [filter] ─▶ jobs in the printer's language ─▶ [backend] ─▶ bridge ─▶ printer
//! lp job.rgl  ─▶ cupsd ──────────────────────────────────────────────────────────▶ [backend]
//! ```
//! `filter` makes one job of every page, with the `options` of the print dialog, which [`ppd`] declares from the same
//! tables. `backend` sends the jobs one after the other, keeps them in a journal so that none is printed twice, and reports
//! the states of printer and job to the print system as `messages`. A queue leads to a `uri`.
//! Source: the man pages backend(7) and filter(7), and the specifications of PPD and PWG raster files.

pub(crate) mod backend;
pub(crate) mod call;
pub(crate) mod filter;
pub mod install;
pub(crate) mod listing;
pub(crate) mod messages;
pub(crate) mod options;
pub mod ppd;
pub(crate) mod raster;
pub(crate) mod uri;
