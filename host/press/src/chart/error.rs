//! Why there is no chart.

use inks::Stack;

use crate::halftone::HalftoneError;
use crate::sheet::SheetError;
use appearance::weights::WeightError;

/// Why a chart cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
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
    #[error("{found} {what}: this paper has room for {most}; choose fewer inks")]
    TooMany {
        /// What.
        what: &'static str,
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
