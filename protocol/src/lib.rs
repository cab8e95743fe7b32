//! What the workstation and the microcontroller share.
//!
//! Everything here is `no_std`, allocates nothing and does no input or output: borrowed slices in, borrowed slices out.
//! The encoder that writes a file on a workstation also feeds the parallel port. Bounded collections are `heapless`'s; a
//! module that keeps one of its own says why.
//!
//! A conversion with `as` loses no bits, or says at the place why none can be lost. It may change the sign: the walk's
//! directions are signed, and the printer's language puts signed numbers in bytes.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]

pub mod ink;
pub mod link;
pub mod packbits;
pub mod paper;
pub mod rgl;
pub mod runs;
mod scan;
pub mod status;
pub mod walk;

/// Vendor and product number of the bridge on USB: a test number of pid.codes, so the maker's name has to fit too. How to get one of
/// our own: `packaging/usb-id.md`.
pub const USB: (u16, u16) = (0x1209, 0x0001);
