//! What comes out of the printer: the passes, one upon the other.

use inks::Stack;
use protocol::paper::Paper;
use protocol::rgl::{Media, Resolution};

use super::compose;
use crate::separate::Pass;
use crate::sheet::{Sheet, SheetError};

/// A printed sheet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Printout {
    /// The paper that was declared.
    pub paper: Paper,
    /// Dots per inch.
    pub resolution: Resolution,
    /// The media type that was declared.
    pub media: Media,
    /// Whether the job asks the printer to correct curl.
    pub curl_correction: bool,
    /// The passes in the order of printing, empty ones too. Planes cover the printable area at the job's resolution,
    /// shifts applied.
    pub passes: Vec<Pass>,
    /// Dots that fell beside the sheet and soiled the platen.
    pub platen_dots: u64,
    /// Dots that came out beyond the page because the ink prints wider than the job's resolution.
    pub lost_dots: u64,
    /// Whether the whole job was printed.
    pub complete: bool,
}

/// Why a printout cannot be given as a [`Sheet`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PrintoutError {
    /// Sheets are 600 dpi.
    #[error(
        "a sheet has 600 x 600 dots an inch, this printout {across} x {along}; look at its passes instead"
    )]
    Resolution {
        /// Dots per inch across.
        across: u16,
        /// Dots per inch along.
        along: u16,
    },
    /// More than a sheet can tell apart.
    #[error("the passes make {0} different stacks on this sheet; a sheet tells 256 apart")]
    TooManyStacks(usize),
    /// A dot has a stack that is not in the list given.
    #[error("the printout has dots with stack `{0}`, which is not in the list of stacks")]
    UnknownStack(Stack),
    /// The list of stacks is no sheet's.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

impl Printout {
    /// The sheet, its stacks numbered by the passes they need.
    ///
    /// A dot's stack is the inks of the passes that print it, in order.
    pub fn sheet(&self) -> Result<Sheet, PrintoutError> {
        compose::sheet(self.at_600()?, &self.passes, None)
    }

    /// The sheet with the stacks numbered as in `stacks`, whose first is the substrate.
    ///
    /// Errors: [`PrintoutError::UnknownStack`] when a dot has another stack.
    pub fn sheet_with(&self, stacks: &[Stack]) -> Result<Sheet, PrintoutError> {
        compose::sheet(self.at_600()?, &self.passes, Some(stacks))
    }

    fn at_600(&self) -> Result<Paper, PrintoutError> {
        match self.resolution {
            Resolution::Dpi600 => Ok(self.paper),
            other => Err(PrintoutError::Resolution { across: other.dpi().0, along: other.dpi().1 }),
        }
    }
}

/// Where two sheets differ.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Difference {
    /// They are not of one size.
    #[error("the sheets are {} x {} and {} x {} dots", left.0, left.1, right.0, right.1)]
    Size {
        /// Dots across and rows of the first.
        left: (usize, usize),
        /// Of the second.
        right: (usize, usize),
    },
    /// The first dot, row by row, with different stacks.
    #[error("dot ({x}, {y}) has stack `{left}` on one sheet and `{right}` on the other")]
    Dot {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// Stack on the first.
        left: Stack,
        /// Stack on the second.
        right: Stack,
    },
}

/// The first difference between two sheets, dot for dot; the numbers of the stacks do not matter.
pub fn difference(left: &Sheet, right: &Sheet) -> Option<Difference> {
    let size = |sheet: &Sheet| (sheet.width(), sheet.length());
    if size(left) != size(right) {
        return Some(Difference::Size { left: size(left), right: size(right) });
    }
    // same[l * 256 + r]: whether stack l of one is stack r of the other.
    let mut same = vec![false; 256 * 256];
    for (l, a) in left.stacks().iter().enumerate() {
        for (r, b) in right.stacks().iter().enumerate() {
            same[l * 256 + r] = a == b;
        }
    }
    let mut pairs = left.index().iter().zip(right.index());
    let dot = pairs.position(|(&l, &r)| !same[usize::from(l) * 256 + usize::from(r)])?;
    let stack = |sheet: &Sheet| sheet.stacks()[usize::from(sheet.index()[dot])].clone();
    Some(Difference::Dot {
        x: dot % left.width(),
        y: dot / left.width(),
        left: stack(left),
        right: stack(right),
    })
}
