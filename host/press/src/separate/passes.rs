//! Passes: one ink over the whole page each, as dots and as numbers.

use protocol::ink::Ink;

use sheet::Plane;

/// Cartridges the printer holds.
pub const MOST_CARTRIDGES: usize = 7;

/// Most layers in a stack.
pub(crate) const MOST_LAYERS: usize = 16;

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
