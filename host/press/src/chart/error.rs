//! Why there is no chart.

use inks::Stack;

use crate::layout::{Cut, LayoutError};
use appearance::weights::WeightError;
use halftone::HalftoneError;
use sheet::SheetError;

/// Why a chart cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ChartError {
    /// Nothing to show a difference of.
    #[error("a {chart} needs two different stacks; both are `{stack}`")]
    Same {
        /// Name of the chart.
        chart: &'static str,
        /// The stack.
        stack: Stack,
    },
    /// Too few inks.
    #[error("registration compares passes, so at least two inks are needed")]
    OneInk,
    /// More than a chart shows.
    #[error("{found} {what}, but this paper has room for {most}; choose fewer inks or a larger paper")]
    TooMany {
        /// What.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many there can be.
        most: usize,
    },
    /// More stacks than go round a can.
    #[error(
        "{found} stacks, but a can of this height has room for {most}; choose fewer inks, or glue two such cans on each other"
    )]
    Can {
        /// How many.
        found: usize,
        /// How many there can be.
        most: usize,
    },
    /// The paper is too small.
    #[error(
        "the {chart} chart needs a printable area of {width:.0} x {length:.0} mm, and {paper} has less; choose a4 or letter"
    )]
    Paper {
        /// Name of the chart.
        chart: &'static str,
        /// Width needed in mm.
        width: u32,
        /// Length needed in mm.
        length: u32,
        /// Name of the paper.
        paper: &'static str,
    },
    /// It does not lie wholly on its page, though the paper is large enough.
    #[error(
        "{cut} of {width:.1} x {length:.1} mm would be cut off; the printable area of {paper} is {most_width:.1} x \
         {most_length:.1} mm"
    )]
    Beyond {
        /// What would be cut.
        cut: Cut,
        /// Width of all copies together in mm.
        width: f64,
        /// Their length.
        length: f64,
        /// Name of the paper.
        paper: &'static str,
        /// Width that can be printed in mm.
        most_width: f64,
        /// Length that can be printed.
        most_length: f64,
    },
    /// It cannot be laid on its page.
    #[error(transparent)]
    Layout(LayoutError),
    /// A ramp without places. A bug if it is ever seen.
    #[error(transparent)]
    Weights(#[from] WeightError),
    /// Halftoning.
    #[error(transparent)]
    Halftone(#[from] HalftoneError),
    /// What was drawn is no dot map. A bug if it is ever seen.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}
