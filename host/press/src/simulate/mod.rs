//! A simulated printer: bytes in, sheet out.
//!
//! Problem: a job must be known to be right before it uses up ribbon, because no more ribbons are made.
//! Method: the strict reader of `protocol::rgl` drives a printer with cartridges, a carriage, a sheet of its own size and
//! faults of its own. Every refusal states the byte.
//! Cost: one look at each byte, one bit for each dot and pass, and two walks over the page for the sheet.
//! Limits: stricter than the real printer, which accepts some of what is refused here. Ribbons never run out during a job;
//! heat and adhesion are not modelled. It is unknown what the real printer does with an empty pass; this one fetches the
//! cartridge. Source: observations on the hardware for cartridges, status, paper size and white at 1200 dpi.

mod canvas;
mod carousel;
mod compose;
mod print;
mod printer;
mod printout;
mod status;

#[cfg(test)]
mod tests;

pub(crate) use canvas::Canvas;
pub use carousel::{Carousel, CarouselError, Cartridge, Condition, PLACES};
pub use compose::PrintoutError;
pub use print::{Setup, SimulateError, print, wanted};
pub use printer::{Printer, Refused};
pub use printout::{Difference, Printout, difference};
pub use status::{Lever, STATUS_LENGTH, Trouble};

pub use crate::layout::paper::Stock;
