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
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation, clippy::cast_sign_loss))]

pub mod backend;
pub mod call;
pub mod filter;
pub mod install;
pub mod listing;
pub mod messages;
pub mod options;
pub mod ppd;
pub mod raster;
pub mod uri;
