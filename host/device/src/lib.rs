//! Everything that talks to a bridge or a printer.
//!
//! [`deliver`] takes a job to a printer, whoever has it sent. It stands on [`connection`], the pipes to a bridge or a printer,
//! [`questions`] to them, [`encodings`] of a job, and a job in [`transit`].
//! [`printers`] keeps which printers need a reset, [`ledger`] the ribbon that was used, and [`flash`] puts firmware on a bridge.
#![forbid(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "lengths are bounded before they are cast: jobs by `encodings::check`, frames by their size; figures for people may be rounded"
)]

pub mod connection;
pub mod deliver;
pub mod encodings;
pub mod flash;
pub mod ledger;
pub mod printers;
pub mod questions;
pub mod transit;
