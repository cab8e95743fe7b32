//! Sheets of paper as they are sold, margins included.

use protocol::paper::{LEFT, Paper};

/// A sheet of paper, in 1/600 inch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stock {
    /// From its left to its right edge.
    pub width: u16,
    /// From its top to its bottom edge.
    pub length: u16,
}

impl Stock {
    /// The sheet sold under the name of a paper; for a custom size, the printable area with the usual margins.
    pub fn of(paper: Paper) -> Stock {
        let (width, length) = match paper {
            Paper::A4 => (4961, 7016),
            Paper::Letter => (5100, 6600),
            Paper::Legal => (5100, 8400),
            Paper::Executive => (4350, 6300),
            Paper::B5 => (4299, 6071),
            Paper::Postcard => (2362, 3496),
            Paper::Custom { width, length } => {
                (width.saturating_add(2 * LEFT), length.saturating_add(paper.top() + 360))
            }
        };
        Stock { width, length }
    }
}

/// A number of dots at a resolution, in 1/600 inch.
pub(super) fn from_dots(dots: u16, dpi: u16) -> u16 {
    (u32::from(dots) * 600 / u32::from(dpi)).min(u16::MAX.into()) as u16
}
