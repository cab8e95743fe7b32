//! Passes: one ink over the whole page each, as dots and as numbers.

use protocol::ink::Ink;

/// Cartridges the printer holds.
pub const MOST_CARTRIDGES: usize = 7;

/// Most passes over one sheet. The longest job known on hardware had 7.
pub(crate) const MOST_PASSES: usize = 16;

/// Most layers in a stack.
pub(crate) const MOST_LAYERS: usize = 16;

/// One bit for each dot of the printable area, 8 dots to a byte, most significant bit left, 1 = ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Dots across.
    pub width: usize,
    /// Rows.
    pub length: usize,
    /// Bytes a row, `width / 8` rounded up; the spare bits at the right are 0.
    pub stride: usize,
    /// The rows from the top.
    pub bits: Vec<u8>,
}

impl Plane {
    /// How many dots have ink.
    pub fn dots(&self) -> u64 {
        self.bits.iter().map(|byte| u64::from(byte.count_ones())).sum()
    }
}

/// One pass of the carriage over the whole page with one ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The ink.
    pub ink: Ink,
    /// Where it goes.
    pub plane: Plane,
}

/// One pass in the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planned {
    /// The ink.
    pub ink: Ink,
    /// Dots with ink.
    pub dots: u64,
}

/// What is printed in which order, and what must be in the printer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The passes, first printed (lowest) first.
    pub passes: Vec<Planned>,
    /// The cartridges, in the order of their first use.
    pub cartridges: Vec<Ink>,
    /// Whether it is certain that fewer passes cannot do.
    pub fewest: bool,
}
