//! Print queues: the parts of the program that CUPS starts, and what makes them a queue.
//!
//! ```text
//! lp file.pdf ─▶ cupsd ─▶ pdftopdf ─▶ [filter] ─▶ jobs in the printer's language ─▶ [backend] ─▶ bridge ─▶ printer
//! lp job.rgl  ─▶ cupsd ──────────────────────────────────────────────────────────▶ [backend]
//! ```
//! The [`filter`] makes one job of every page, by the [`options`] of the print dialog, which the [`ppd`] declares from the
//! same tables. The [`backend`] sends them one after the other, keeps them in a journal so that none is printed twice, and
//! tells the print system in its own [`messages`] how printer and job are. A queue leads to an [`uri`].
//! Source: the man pages backend(7) and filter(7), and the specifications of PPD and PWG raster files.

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
