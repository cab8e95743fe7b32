//! From a dot map to a page: size and position, copies side by side, marks, mirror, and the printer's own offset and feed.
//!
//! Method: an ideal page is described by rectangles (copies and marks) in dots of the printable area; each row that is
//! sent asks the ideal page for the row it lands on. So the printer's offset and feed are corrected for everything alike.
//! Cost: one copy of the dots. Limits: one dot map a page, repeated on a grid; no rotation; feed is corrected by leaving out
//! or doubling single rows, evenly.

mod block;
mod files;
mod length;
mod marks;
mod page;
pub mod paper;
mod profile;
pub mod size;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;

pub use block::Cut;
pub use length::{Mm, NoLength, Point};
pub use profile::Profile;
pub use size::{Size, SizeError};

use crate::sheet::{Area, DotMap, Sheet, SheetError, order};
use block::{Block, Rect};
use observe::Observer;
use page::Page;
use serde::{Deserialize, Serialize};

/// Most copies side by side or below each other.
pub const MOST_REPEATS: u16 = 200;

/// How a dot map is laid on a page.
#[derive(Clone, PartialEq, Debug)]
pub struct Layout {
    /// The paper.
    pub paper: Paper,
    /// Where the block of copies goes.
    pub position: Position,
    /// How many copies.
    pub repeat: Repeat,
    /// Between copies, across and down, in millimetres; not negative.
    pub gap: Point,
    /// Whether each copy is turned left to right, for what is seen from behind.
    pub mirror: bool,
    /// Ticks where to cut.
    pub crop_marks: bool,
    /// Crosses that every pass prints.
    pub registration_marks: bool,
    /// Inks of the marks; empty for those in use: the one that shows best for ticks, all for crosses.
    pub mark_inks: Vec<Ink>,
    /// Whether what lies beyond the printable area is cut off instead of refused.
    pub cut: bool,
    /// The printer's calibration.
    pub profile: Profile,
}

/// Where the block of copies goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Position {
    /// In the middle of the printable area.
    Centred,
    /// Its top left corner this far from the corner of the sheet of paper.
    FromEdge(Point),
    /// Its top left corner this far from the corner of the printable area.
    FromPrintable(Point),
}

/// How many copies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Repeat {
    /// Columns and rows, both at least 1.
    Grid(u16, u16),
    /// As many as the printable area holds.
    Fill,
}

impl Layout {
    /// One copy in the middle of the paper, without marks, on a printer that is exact.
    pub fn centred(paper: Paper) -> Layout {
        Layout {
            paper,
            position: Position::Centred,
            repeat: Repeat::Grid(1, 1),
            gap: Point::default(),
            mirror: false,
            crop_marks: false,
            registration_marks: false,
            mark_inks: Vec::new(),
            cut: false,
            profile: Profile::default(),
        }
    }

    /// The part of the ideal page that this printer reaches, in dots of the printable area.
    fn room(&self) -> Rect {
        let (width, length) = (i64::from(self.paper.width()), i64::from(self.paper.length()));
        let (x, y) = self.profile.offset();
        let reach = Rect { left: x, right: x + width, top: y, bottom: self.profile.lands_on(length - 1) + 1 };
        reach.meet(Rect { left: 0, right: width, top: 0, bottom: length })
    }

    /// Width and length in dots of the largest copy that can be printed as often as the grid says, marks not counted.
    pub fn largest(&self) -> (usize, usize) {
        let room = self.room();
        let (columns, rows) = match self.repeat {
            Repeat::Grid(columns, rows) => (columns.max(1), rows.max(1)),
            Repeat::Fill => (1, 1),
        };
        let share = |room: i64, count: u16, gap: Mm| {
            ((room + gap.dots()) / i64::from(count) - gap.dots()).max(0) as usize
        };
        (share(room.width(), columns, self.gap.0), share(room.length(), rows, self.gap.1))
    }
}

/// A page, and where things are on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Arranged {
    /// The page.
    pub sheet: Sheet,
    /// Where things are.
    pub laid: Laid,
}

/// Where things are on a page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Laid {
    /// Columns and rows of copies.
    pub grid: (u16, u16),
    /// Marks that had no room.
    pub marks_left_out: usize,
    /// The visible part of each copy, row by row, in dots of the sheet.
    pub copies: Vec<Area>,
    /// Everything that was laid out, marks included, in dots of the sheet.
    pub area: Area,
    /// What was cut off.
    pub cut: Option<Cut>,
}

impl Laid {
    /// One copy that takes this area and nothing else on the page.
    pub fn single(area: Area) -> Laid {
        Laid { grid: (1, 1), marks_left_out: 0, copies: vec![area], area, cut: None }
    }

    /// How many dots of the copies each stack of the sheet has; what marks take does not count.
    pub fn census(&self, sheet: &Sheet) -> [u64; 256] {
        let mut census = [0; 256];
        for copy in &self.copies {
            for row in sheet.index().chunks_exact(sheet.width()).skip(copy.top).take(copy.length) {
                for &stack in &row[copy.left..][..copy.width] {
                    census[usize::from(stack)] += 1;
                }
            }
        }
        census
    }
}

/// Why a dot map cannot be laid on a page.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A part lies beyond the printable area.
    #[error(
        "{cut} of {width:.1} x {length:.1} mm would be cut off; the printable area of {paper} is {most_width:.1} x \
         {most_length:.1} mm; {}",
        smaller(*width, *length, *most_width, *most_length)
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
    /// Nothing of it lies on the printable area.
    #[error("nothing lies on the printable area of {paper}; choose another position or size")]
    Nothing {
        /// Name of the paper.
        paper: &'static str,
    },
    /// Not even one copy fits.
    #[error(
        "not one copy of {width:.1} x {length:.1} mm fits; the printable area of {paper} is {most_width:.1} x {most_length:.1} mm"
    )]
    FillsNothing {
        /// Width of a copy in mm.
        width: f64,
        /// Its length.
        length: f64,
        /// Name of the paper.
        paper: &'static str,
        /// Width that can be printed in mm.
        most_width: f64,
        /// Length that can be printed.
        most_length: f64,
    },
    /// Numbers that make no layout.
    #[error("{0}")]
    Setting(String),
    /// No number is left for the marks' stacks.
    #[error("the page would have more than 256 different stacks; print it without marks")]
    Stacks,
    /// The page is no sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

/// What to do about something of this size in too little room: move it, or make it this small.
fn smaller(width: f64, length: f64, most_width: f64, most_length: f64) -> String {
    let scale = (most_width / width).min(most_length / length);
    if scale >= 1.0 {
        return "move it".into();
    }
    // Never more than fits.
    let below = |mm: f64| (10.0 * scale * mm).floor() / 10.0;
    format!("make it smaller ({:.1} x {:.1} mm fits)", below(width), below(length))
}

/// Whether a dot map of this size can be laid so, before it is made.
///
/// # Errors
/// Those of [`arrange`] that follow from sizes.
pub(crate) fn check(width: usize, length: usize, layout: &Layout) -> Result<(), LayoutError> {
    Block::of((width, length), layout).map(|_| ())
}

/// Lays a dot map on a page.
///
/// # Errors
/// What is beyond the printable area, unless the layout says to cut; settings out of range.
pub fn arrange(dots: &DotMap, layout: &Layout, observer: &dyn Observer) -> Result<Arranged, LayoutError> {
    let block = Block::of((dots.width(), dots.length()), layout)?;
    let mut stacks = dots.stacks().to_vec();
    let marked = layout.crop_marks || layout.registration_marks;
    let in_use = if marked { order::passes_of(&used(dots)) } else { Vec::new() };
    let (marks, marks_left_out) = marks::marks_of(layout, &in_use, &block, &mut stacks)?;
    let page = Page { dots, layout, block: &block, marks: &marks };
    let sheet = Sheet::new(layout.paper, stacks, page.render(observer))?;

    let room = block.room;
    let mut copies = Vec::new();
    for &(top, bottom) in &block.rows {
        for &(left, right) in &block.columns {
            copies.extend(page.area(Rect { left, right, top, bottom }.meet(room)));
        }
    }
    let all = marks.iter().fold(block.place, |all, (mark, _)| Rect {
        left: all.left.min(mark.place.left),
        top: all.top.min(mark.place.top),
        right: all.right.max(mark.place.right),
        bottom: all.bottom.max(mark.place.bottom),
    });
    let nothing = LayoutError::Nothing { paper: layout.paper.name() };
    let area = page.area(all.meet(room)).filter(|_| !copies.is_empty()).ok_or(nothing)?;
    let laid = Laid { grid: block.grid, marks_left_out, copies, area, cut: block.cut };
    Ok(Arranged { sheet, laid })
}

/// The stacks that are on a dot.
fn used(dots: &DotMap) -> Vec<Stack> {
    let mut seen = [false; 256];
    dots.index().iter().for_each(|&stack| seen[usize::from(stack)] = true);
    dots.stacks().iter().zip(seen).filter(|(_, seen)| *seen).map(|(stack, _)| stack.clone()).collect()
}

#[cfg(test)]
mod tests;
