//! Everything that talks to a bridge or a printer.
//!
//! [`send`] brings a job to a printer, [`flash`] new firmware to a bridge, and [`ledger`] counts the ribbon that was used.
#![forbid(unsafe_code)]

pub mod flash;
pub mod ledger;
pub mod send;
