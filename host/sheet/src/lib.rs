//! What everything printed becomes: a stack for every dot, by itself ([`DotMap`]) or on a page ([`Sheet`]).
//!
//! Halftoned documents, layers and charts are dot maps; the layout repeats, mirrors, marks and places a dot map on a
//! page. Everything after that knows only sheets.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![deny(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "pixel arithmetic: sides and values are bounded by checks at the input (pages fit in u16, stacks in u8), and \
              checked casts in loops over dots would cost time and hide the arithmetic"
)]

mod area;
pub mod clusters;
pub mod colours;
mod dots;
pub mod files;
pub mod forest;
pub mod order;
pub mod pack;
pub mod picture;
mod plane;
mod size;
mod turn;

use std::borrow::Cow;

use inks::Stack;
use protocol::paper::Paper;

pub use area::Area;
pub use colours::{colours, label};
pub use dots::{DotMap, SheetError, census, check_stacks};
pub use plane::Plane;
pub use size::{NoSize, Size};
pub use turn::Turn;

/// Dots in a millimetre at 600 dpi, the resolution of every dot map and sheet.
pub const DOTS_PER_MM: f64 = 600.0 / 25.4;

/// Most passes over one sheet. The longest job known on hardware had 7.
pub const MOST_PASSES: usize = 16;

/// A number of dots in words.
pub fn dots_in_words(count: u32) -> String {
    format!("{count} dot{}", if count == 1 { "" } else { "s" })
}

/// One stack for every dot of the printable area of a sheet of paper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sheet {
    paper: Paper,
    dots: DotMap,
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

    /// The stack numbers of an area, row by row, each row so many `times`.
    ///
    /// # Panics
    /// If the area leaves the sheet, which is a bug of the caller.
    pub fn index_of(&self, area: Area, times: usize) -> Cow<'_, [u8]> {
        let width = self.width();
        let rows = &self.index()[area.top * width..][..area.length * width];
        if area.width == width && times == 1 {
            return rows.into();
        }
        let rows = rows.chunks_exact(width).map(|row| &row[area.left..][..area.width]);
        rows.flat_map(|row| std::iter::repeat_n(row, times)).collect::<Vec<_>>().concat().into()
    }

    /// All of it.
    pub fn whole(&self) -> Area {
        Area { left: 0, top: 0, width: self.width(), length: self.length() }
    }

    /// How many dots each stack has.
    pub fn census(&self) -> Vec<u64> {
        self.dots.census()
    }
}
