//! A printed sheet: its passes, one on another.

use inks::Stack;
use protocol::paper::Paper;
use protocol::rgl::{Media, Resolution};

use super::compose::{self, PrintoutError};
use crate::layout::in_dots;
use crate::separate::Pass;
use sheet::Sheet;

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
    /// Dots that missed the sheet and soiled the platen.
    pub platen_dots: u64,
    /// Dots beyond the page, because the ink prints wider than the job's resolution.
    pub lost_dots: u64,
    /// Whether the whole job was printed.
    pub complete: bool,
}

impl Printout {
    /// The sheet, with stacks numbered in the order of the passes they need.
    ///
    /// A dot's stack is the inks of the passes that print it, in order.
    ///
    /// # Errors
    /// Another resolution than 600 dpi, or more than 256 stacks.
    pub fn sheet(&self) -> Result<Sheet, PrintoutError> {
        compose::sheet(self.at_600()?, &self.passes, None)
    }

    /// The sheet with the stacks numbered as in `stacks`, whose first is the substrate.
    ///
    /// # Errors
    /// [`PrintoutError::UnknownStack`] if a dot has another stack; see also [`PrintoutError`].
    pub fn sheet_with(&self, stacks: &[Stack]) -> Result<Sheet, PrintoutError> {
        compose::sheet(self.at_600()?, &self.passes, Some(stacks))
    }

    /// The sheet in the dots of the job: at 1200 x 600 dpi one of custom paper, twice as many dots wide. With `stacks`, they
    /// are numbered as there.
    ///
    /// # Errors
    /// As for [`Printout::sheet`] and [`Printout::sheet_with`], but for the resolution.
    pub fn sheet_in_dots(&self, stacks: Option<&[Stack]>) -> Result<Sheet, PrintoutError> {
        compose::sheet(in_dots(self.paper, self.resolution), &self.passes, stacks)
    }

    fn at_600(&self) -> Result<Paper, PrintoutError> {
        match self.resolution {
            Resolution::Dpi600 => Ok(self.paper),
            other => Err(PrintoutError::Resolution { across: other.dpi().0, along: other.dpi().1 }),
        }
    }
}

/// A difference between two sheets.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Difference {
    /// Their sizes differ.
    #[error("one sheet is {} x {} dots, the other {} x {}", left.0, left.1, right.0, right.1)]
    Size {
        /// Dots across and rows of the first.
        left: (usize, usize),
        /// Dots across and rows of the second.
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

/// The first difference between two sheets, dot by dot. Stacks are compared by their inks, not by their numbers.
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
