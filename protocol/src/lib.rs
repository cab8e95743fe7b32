//! What the workstation and the microcontroller share.
//!
//! Everything here is `no_std`, allocates nothing and does no input or output: borrowed slices in, borrowed
//! slices out. The encoder that writes a file on a workstation is the one that feeds the parallel port.
#![no_std]
#![forbid(unsafe_code)]

pub mod ink;
pub mod link;
pub mod packbits;
pub mod paper;
pub mod rgl;
pub mod runs;
pub mod status;
pub mod walk;
