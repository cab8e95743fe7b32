//! A sheet as the fewest ordered one-bit passes.

use protocol::ink::Ink;

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

/// One pass of the carriage over the whole page with one ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The ink.
    pub ink: Ink,
    /// Where it goes.
    pub plane: Plane,
}
