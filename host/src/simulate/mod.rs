//! The printer, simulated: bytes in, sheet out.
