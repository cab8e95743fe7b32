//! A second board at the printer's end of a bridge's cable, for tests of real boards.
//!
//! Problem: what the emulator cannot show (edges, levels, two clocks that are not the same) needs a printer that can be told when to be
//! busy, out of paper or switched off, and that says what it saw. Method: a Pico with the pins of the bridge, inputs and
//! outputs exchanged. Its PIO block keeps the handshake to 32 ns, counts strobes and samples the lines; what takes its time,
//! faults and negotiations, is the processor's. It takes [`Order`]s and gives [`Report`]s as lines of text, so that a terminal will
//! do. Here is what needs no board; `firmware/` is the rest. `docs/bench.md` says how to build it, `tests/rig.toml` what is tried.
//! Limits: it prints nothing, and takes jobs of [`ROOM`] bytes at most.
#![no_std]

#[cfg(test)]
extern crate std;

mod nibble;
mod order;
mod wave;

/// The checksum of what was taken: CRC-32 as in zip files.
pub use protocol::link::frame::checksum;

pub use nibble::{Host, Nibble, Own, Status};
pub use order::{BadOrder, ID_MAX, LINE_MAX, Order, Report};
pub use wave::{SAMPLE_NS, Shortest, WORDS, samples, shortest};

/// Bytes the rig keeps of what it takes. When they are full it stays busy.
pub const ROOM: usize = 96 << 10;

/// A cycle of the rig's PIO programs, in ns: 125 MHz over 4.
pub const TICK_NS: u32 = 32;
