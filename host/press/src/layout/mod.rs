//! From a piece to a page: position, copies side by side, marks, mirror, and what one machine does differently.
//!
//! Method: an ideal page is described by rectangles (pieces and marks) in dots of the printable area; each row that is
//! sent asks the ideal page for the row it lands on. So the machine's offset and feed are corrected for everything alike.
//! Cost: one copy of the dots. Limits: one piece a page, repeated on a grid; no rotation; feed is corrected by leaving out
//! or doubling single rows, evenly.

mod block;
pub mod length;
mod marks;
mod page;
pub mod paper;
pub mod profile;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;

pub use block::Cut;
pub use length::{Mm, NoLength, Point};
pub use profile::Profile;

use crate::preview::Area;
use crate::separate;
use crate::sheet::{Piece, Sheet, SheetError};
use block::{Block, Rect};
use observe::Observer;
use page::Page;

/// Most pieces side by side or below each other.
pub const MOST_REPEATS: u16 = 200;

/// How a piece is laid on a page.
#[derive(Clone, PartialEq, Debug)]
pub struct Layout {
    /// The paper.
    pub paper: Paper,
    /// Where the block of pieces goes.
    pub position: Position,
    /// How many pieces.
    pub repeat: Repeat,
    /// Between pieces, across and down, in millimetres; not negative.
    pub gap: Point,
    /// Whether each piece is turned left to right, for what is seen from behind.
    pub mirror: bool,
    /// Ticks where to cut.
    pub crop_marks: bool,
    /// Crosses that every pass prints.
    pub registration_marks: bool,
    /// Inks of the marks; empty for those in use: the one that shows best for ticks, all for crosses.
    pub mark_inks: Vec<Ink>,
    /// Whether what lies beyond the printable area is cut off instead of refused.
    pub cut: bool,
    /// The machine.
    pub profile: Profile,
}

/// Where the block of pieces goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Position {
    /// In the middle of the printable area.
    Centred,
    /// Its top left corner this far from the corner of the sheet of paper.
    FromEdge(Point),
    /// Its top left corner this far from the corner of the printable area.
    FromPrintable(Point),
}

/// How many pieces.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Repeat {
    /// Columns and rows, both at least 1.
    Grid(u16, u16),
    /// As many as the printable area holds.
    Fill,
}

impl Layout {
    /// One piece in the middle of the paper, without marks, on a machine that is exact.
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

    /// The part of the ideal page that this machine can print on, in dots of the printable area.
    fn room(&self) -> Rect {
        let (width, length) = (i64::from(self.paper.width()), i64::from(self.paper.length()));
        let (x, y) = self.profile.offset();
        let reach = Rect { left: x, right: x + width, top: y, bottom: self.profile.lands_on(length - 1) + 1 };
        reach.meet(Rect { left: 0, right: width, top: 0, bottom: length })
    }

    /// Width and length in dots of the largest piece that can be printed as often as the grid says, marks not counted.
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
#[derive(Clone, Debug, PartialEq)]
pub struct Laid {
    /// The visible part of each piece, row by row, in dots of the sheet.
    pub pieces: Vec<Area>,
    /// Everything that was laid out, marks included, in dots of the sheet.
    pub area: Area,
    /// Columns and rows of pieces.
    pub grid: (u16, u16),
    /// What was cut off.
    pub cut: Option<Cut>,
    /// Marks that had no room.
    pub marks_left_out: usize,
}

impl Laid {
    /// How many dots of the pieces each stack of the sheet has; what marks take does not count.
    pub fn census(&self, sheet: &Sheet) -> [u64; 256] {
        let mut census = [0; 256];
        for piece in &self.pieces {
            for row in sheet.index().chunks_exact(sheet.width()).skip(piece.top).take(piece.length) {
                for &stack in &row[piece.left..][..piece.width] {
                    census[usize::from(stack)] += 1;
                }
            }
        }
        census
    }
}

/// Why a piece cannot be laid on a page.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A part lies beyond the printable area.
    #[error(
        "{cut} of {width:.1} x {length:.1} mm would be cut off: {paper} prints {most_width:.1} x {most_length:.1} mm here; \
         {}, take a larger --paper, or give --crop to cut",
        smaller(*width, *length, *most_width, *most_length)
    )]
    Beyond {
        /// What would be cut.
        cut: Cut,
        /// Width of all pieces together in mm.
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
    #[error("nothing lies on the printable area of {paper}; give another position or size")]
    Nothing {
        /// Name of the paper.
        paper: &'static str,
    },
    /// Not even one piece fits.
    #[error(
        "not one piece of {width:.1} x {length:.1} mm fits {paper}, which prints {most_width:.1} x {most_length:.1} mm here"
    )]
    FillsNothing {
        /// Width of a piece in mm.
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
    /// There is no number left for the marks' stacks.
    #[error("the page would have more than 256 different stacks; print it without marks")]
    Stacks,
    /// The page is no sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

/// What to do with something of this size that has more or less room: move it, or make it as small as this.
fn smaller(width: f64, length: f64, most_width: f64, most_length: f64) -> String {
    let scale = (most_width / width).min(most_length / length);
    if scale >= 1.0 {
        return "move it".into();
    }
    // Never more than fits.
    let below = |mm: f64| (10.0 * scale * mm).floor() / 10.0;
    format!("make it smaller ({:.1} x {:.1} mm fits)", below(width), below(length))
}

/// Whether a piece of this size can be laid so, before it is made. Errors: those of [`arrange`].
pub fn check(width: usize, length: usize, layout: &Layout) -> Result<(), LayoutError> {
    Block::of((width, length), layout).map(|_| ())
}

/// Lays a piece on a page.
///
/// Errors: what is beyond the printable area, unless the layout says to cut; settings out of range.
pub fn arrange(piece: &Piece, layout: &Layout, observer: &dyn Observer) -> Result<Arranged, LayoutError> {
    let block = Block::of((piece.width(), piece.length()), layout)?;
    let mut stacks = piece.stacks().to_vec();
    let marked = layout.crop_marks || layout.registration_marks;
    let in_use = if marked { separate::passes_of(&used(piece)) } else { Vec::new() };
    let (marks, marks_left_out) = marks::marks_of(layout, &in_use, &block, &mut stacks)?;
    let page = Page { piece, layout, block: &block, marks: &marks };
    let sheet = Sheet::new(layout.paper, stacks, page.render(observer))?;

    let room = block.room;
    let mut pieces = Vec::new();
    for &(top, bottom) in &block.rows {
        for &(left, right) in &block.columns {
            pieces.extend(page.area(Rect { left, right, top, bottom }.meet(room)));
        }
    }
    let all = marks.iter().fold(block.place, |all, (mark, _)| Rect {
        left: all.left.min(mark.place.left),
        top: all.top.min(mark.place.top),
        right: all.right.max(mark.place.right),
        bottom: all.bottom.max(mark.place.bottom),
    });
    let nothing = LayoutError::Nothing { paper: layout.paper.name() };
    let area = page.area(all.meet(room)).filter(|_| !pieces.is_empty()).ok_or(nothing)?;
    let laid = Laid { pieces, area, grid: block.grid, cut: block.cut, marks_left_out };
    Ok(Arranged { sheet, laid })
}

/// The stacks that are on a dot.
fn used(piece: &Piece) -> Vec<Stack> {
    let mut seen = [false; 256];
    piece.index().iter().for_each(|&stack| seen[usize::from(stack)] = true);
    piece.stacks().iter().zip(seen).filter(|(_, seen)| *seen).map(|(stack, _)| stack.clone()).collect()
}

#[cfg(test)]
mod tests;
