//! The bridge between a USB link and the printer's IEEE 1284 port.
//!
//! Every decision of the bridge is made in this library, and tested here without a board, in virtual time:
//!
//! | module | decides |
//! |---|---|
//! | [`engine`] | what becomes of messages and data: printer bytes, answers, the end of a job |
//! | [`turn`] | how long the engine works before others may run |
//! | [`driver`] | who may use the port and when; questions to the printer; faults; what is logged |
//! | [`port`] | levels and times of the port's lines, both directions |
//! | [`store`] | how jobs lie in the flash, whatever the supply does |
//! | [`alone`] | what is stored and printed from the store, and what of it is remembered |
//! | [`button`] | what a press of the button means |
//! | [`standing`] | where the printer stands, and so what may go to it |
//! | [`checkpoint`] | how a reset of the board leaves where a job stands |
//! | [`links`] | which of two ways to the host is answered |
//! | [`log`] | which piece of the log answers a question |
//! | [`printer_class`] | the ordinary printer that operating systems see |
//! | [`lamp`] | what the lamp shows |
//! | [`deaf`] | when a USB controller that hears nothing makes the board restart |
//!
//! A board adds pins, an area of [flash](store::Flash), a [sender](driver::Sender), a clock, packets, memory that survives a reset, and the calls between these.
//! `bridge/firmware` is one. `no_std`, no allocation, no `unsafe`. A conversion with `as` loses no bits, or the place says why.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]

#[cfg(any(test, feature = "simulation"))]
extern crate std;

pub mod alone;
pub mod button;
pub mod checkpoint;
pub mod deaf;
pub mod driver;
pub mod engine;
pub mod lamp;
pub mod links;
pub mod log;
pub mod port;
pub mod printer_class;
mod ring;
#[cfg(any(test, feature = "simulation"))]
#[allow(clippy::cast_possible_truncation, reason = "the simulation counts bytes of tests")]
pub mod simulation;
pub mod standing;
pub mod store;
mod streams;
pub mod turn;
