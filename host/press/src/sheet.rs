//! What everything printed becomes: a stack for every dot, by itself ([`DotMap`]) or on a page ([`Sheet`]).
//!
//! Halftoned documents, layers and charts are dot maps; the layout repeats, mirrors, marks and places a dot map on a
//! page. Everything after that knows only sheets.

mod area;
pub(crate) mod clusters;
pub(crate) mod colours;
mod dots;
pub(crate) mod files;
pub(crate) mod order;
pub(crate) mod picture;

use inks::Stack;
use protocol::paper::Paper;

pub use area::Area;
pub use dots::DotMap;

/// Dots in a millimetre at 600 dpi, the resolution of every dot map and sheet.
pub const DOTS_PER_MM: f64 = 600.0 / 25.4;

/// One stack for every dot of the printable area of a sheet of paper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sheet {
    paper: Paper,
    dots: DotMap,
}

/// Why numbers are not a sheet.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SheetError {
    /// There are no dots, or the index does not fill the rectangle.
    #[error("a map of {width} x {length} dots needs {} values, not {found}", width.saturating_mul(*length))]
    Size {
        /// Dots across.
        width: usize,
        /// Rows.
        length: usize,
        /// Values given.
        found: usize,
    },
    /// The first stack must be the substrate, stacks must differ, and there can be 256 at most.
    #[error("stack {index} (`{stack}`): the substrate comes first, then at most 255 different stacks")]
    Stacks {
        /// Position in the list.
        index: usize,
        /// The stack.
        stack: Stack,
    },
    /// A dot names a stack that is not in the list.
    #[error("dot ({x}, {y}) has stack number {stack}, but there are only {stacks}")]
    Index {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The number found.
        stack: u8,
        /// How many stacks there are.
        stacks: usize,
    },
}

/// Whether a dot map can have these stacks: the substrate first, at most 256, all different.
pub(crate) fn check_stacks(stacks: &[Stack]) -> Result<(), SheetError> {
    for (i, stack) in stacks.iter().enumerate() {
        if (i == 0) != stack.layers().is_empty() || i > 255 || stacks[..i].contains(stack) {
            return Err(SheetError::Stacks { index: i, stack: stack.clone() });
        }
    }
    if stacks.is_empty() {
        return Err(SheetError::Stacks { index: 0, stack: Stack::SUBSTRATE });
    }
    Ok(())
}

impl Sheet {
    /// A sheet from the stack number of every dot of the printable area, row by row from the top.
    ///
    /// # Errors
    /// Those of [`DotMap::new`].
    pub fn new(paper: Paper, stacks: Vec<Stack>, index: Vec<u8>) -> Result<Sheet, SheetError> {
        let dots = DotMap::new(paper.width().into(), paper.length().into(), stacks, index)?;
        Ok(Sheet { paper, dots })
    }

    /// The paper it is meant for.
    pub fn paper(&self) -> Paper {
        self.paper
    }

    /// Its dots.
    pub fn dots(&self) -> &DotMap {
        &self.dots
    }

    /// Dots across.
    pub fn width(&self) -> usize {
        self.dots.width()
    }

    /// Rows.
    pub fn length(&self) -> usize {
        self.dots.length()
    }

    /// The stacks; number 0 is the bare substrate.
    pub fn stacks(&self) -> &[Stack] {
        self.dots.stacks()
    }

    /// The stack number of every dot, row by row.
    pub fn index(&self) -> &[u8] {
        self.dots.index()
    }

    /// How many dots each stack has.
    pub fn census(&self) -> Vec<u64> {
        self.dots.census()
    }
}
