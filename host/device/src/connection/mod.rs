//! Where bridges and printers are, and byte pipes to them.
//!
//! A [`Destination`] is a file, a device that takes a job's bytes as they are, or a bridge at an [`Address`], which opens a
//! [pipe](transport) to it. [`find`] lists the bridges at this computer.

mod address;
mod bridge;
pub mod find;
pub mod transport;
pub mod usb;

pub use address::{Address, Destination, NoAddress, NoDestination, OpenError};
pub use bridge::Bridge;
pub(crate) use bridge::{other_version, printable, stranger};
