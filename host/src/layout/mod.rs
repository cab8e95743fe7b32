//! From a piece to a page: position, copies side by side, marks, mirror, and what one machine does differently.
//!
//! Method: an ideal page is described by rectangles (pieces and marks) in dots of the printable area; each row that is
//! sent asks the ideal page for the row it lands on. So the machine's offset and feed are corrected for everything alike.
//! Cost: one copy of the dots. Limits: one piece a page, repeated on a grid; no rotation; feed is corrected by leaving out
//! or doubling single rows, evenly.

pub mod length;
mod marks;
pub mod paper;
pub mod profile;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::{LEFT, Paper};
use rayon::prelude::*;

pub use length::{Mm, NoLength, Point};
pub use profile::Profile;

use crate::observe::Observer;
use crate::preview::Area;
use crate::separate;
use crate::sheet::{Piece, Sheet, SheetError};
use marks::Mark;

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

/// A rectangle on the ideal page: dots from the corner of the printable area, `right` and `bottom` one past the last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Rect {
    left: i64,
    top: i64,
    right: i64,
    bottom: i64,
}

impl Rect {
    fn width(&self) -> i64 {
        self.right - self.left
    }

    fn length(&self) -> i64 {
        self.bottom - self.top
    }

    fn meet(&self, other: Rect) -> Rect {
        Rect {
            left: self.left.max(other.left),
            top: self.top.max(other.top),
            right: self.right.min(other.right),
            bottom: self.bottom.min(other.bottom),
        }
    }

    fn contains(&self, x: i64, y: i64) -> bool {
        (self.left..self.right).contains(&x) && (self.top..self.bottom).contains(&y)
    }
}

/// What lies beyond the printable area, in millimetres on each side.
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize)]
pub struct Cut {
    /// At the left.
    pub left: f64,
    /// At the top.
    pub top: f64,
    /// At the right.
    pub right: f64,
    /// At the bottom.
    pub bottom: f64,
}

impl Cut {
    fn of(block: Rect, room: Rect) -> Option<Cut> {
        let beyond = |dots: i64| Mm::of_dots(dots.max(0)).0;
        let cut = Cut {
            left: beyond(room.left - block.left),
            top: beyond(room.top - block.top),
            right: beyond(block.right - room.right),
            bottom: beyond(block.bottom - room.bottom),
        };
        (cut != Cut::default()).then_some(cut)
    }
}

impl std::fmt::Display for Cut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sides = [("left", self.left), ("top", self.top), ("right", self.right), ("bottom", self.bottom)];
        let said: Vec<String> = sides
            .iter()
            .filter(|(_, mm)| *mm > 0.0)
            // A single dot is not nothing.
            .map(|(side, mm)| format!("{:.1} mm at the {side}", mm.max(0.1)))
            .collect();
        f.write_str(&said.join(", "))
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
         move it, make it smaller, take a larger --paper, or give --crop to cut"
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
    let (marks, marks_left_out) = marks_of(layout, &in_use, &block, &mut stacks)?;
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

/// All pieces on the ideal page.
struct Block {
    /// What the machine can print on.
    room: Rect,
    place: Rect,
    grid: (u16, u16),
    /// First and one past the last dot of each column of pieces, and of each row.
    columns: Vec<(i64, i64)>,
    rows: Vec<(i64, i64)>,
    cut: Option<Cut>,
}

impl Block {
    fn of(size: (usize, usize), layout: &Layout) -> Result<Block, LayoutError> {
        if let Some(problem) = layout.profile.problem() {
            return Err(LayoutError::Setting(format!("machine profile: {problem}")));
        }
        let gap = (layout.gap.0.dots(), layout.gap.1.dots());
        if gap.0 < 0 || gap.1 < 0 {
            return Err(LayoutError::Setting("the gap between pieces cannot be negative".into()));
        }
        let room = layout.room();
        // Pieces are held in memory: their sides are far below the limits of i64.
        let size = (size.0 as i64, size.1 as i64);
        let grid = grid(layout, size, gap, room)?;
        let extent = |count: u16, side: i64, gap: i64| i64::from(count) * (side + gap) - gap;
        let (width, length) = (extent(grid.0, size.0, gap.0), extent(grid.1, size.1, gap.1));
        let (left, top) = corner(layout, (width, length), room);
        let place = Rect { left, top, right: left + width, bottom: top + length };
        let cut = Cut::of(place, room);
        if let (Some(cut), false) = (cut, layout.cut) {
            return Err(LayoutError::Beyond {
                cut,
                width: Mm::of_dots(width).0,
                length: Mm::of_dots(length).0,
                paper: layout.paper.name(),
                most_width: Mm::of_dots(room.width()).0,
                most_length: Mm::of_dots(room.length()).0,
            });
        }
        let spans = |count: u16, start: i64, side: i64, gap: i64| -> Vec<(i64, i64)> {
            (0..i64::from(count)).map(|i| start + i * (side + gap)).map(|at| (at, at + side)).collect()
        };
        let columns = spans(grid.0, left, size.0, gap.0);
        let rows = spans(grid.1, top, size.1, gap.1);
        Ok(Block { room, place, grid, columns, rows, cut })
    }
}

/// The stacks that are on a dot.
fn used(piece: &Piece) -> Vec<Stack> {
    let mut seen = [false; 256];
    piece.index().iter().for_each(|&stack| seen[usize::from(stack)] = true);
    piece.stacks().iter().zip(seen).filter(|(_, seen)| *seen).map(|(stack, _)| stack.clone()).collect()
}

/// Columns and rows.
fn grid(layout: &Layout, size: (i64, i64), gap: (i64, i64), room: Rect) -> Result<(u16, u16), LayoutError> {
    match layout.repeat {
        Repeat::Grid(columns, rows) => {
            if !(1..=MOST_REPEATS).contains(&columns) || !(1..=MOST_REPEATS).contains(&rows) {
                let words = format!("{columns} x {rows} pieces; each is 1 to {MOST_REPEATS}");
                return Err(LayoutError::Setting(words));
            }
            Ok((columns, rows))
        }
        Repeat::Fill => {
            let start = match layout.position {
                Position::Centred => (room.left, room.top),
                _ => corner(layout, (0, 0), room),
            };
            let count = |room: i64, side: i64, gap: i64| {
                ((room + gap) / (side + gap)).clamp(0, i64::from(MOST_REPEATS)) as u16
            };
            let (columns, rows) =
                (count(room.right - start.0, size.0, gap.0), count(room.bottom - start.1, size.1, gap.1));
            if columns == 0 || rows == 0 {
                return Err(LayoutError::FillsNothing {
                    width: Mm::of_dots(size.0).0,
                    length: Mm::of_dots(size.1).0,
                    paper: layout.paper.name(),
                    most_width: Mm::of_dots(room.width()).0,
                    most_length: Mm::of_dots(room.length()).0,
                });
            }
            Ok((columns, rows))
        }
    }
}

/// The top left corner of a block of this size.
fn corner(layout: &Layout, (width, length): (i64, i64), room: Rect) -> (i64, i64) {
    match layout.position {
        Position::FromEdge(Point(x, y)) => {
            (x.dots() - i64::from(LEFT), y.dots() - i64::from(layout.paper.top()))
        }
        Position::FromPrintable(Point(x, y)) => (x.dots(), y.dots()),
        Position::Centred => {
            // In the middle of the paper's own area, as far as the machine reaches.
            let middle = |most: u16, size: i64, low: i64, high: i64| {
                let at = (i64::from(most) - size).div_euclid(2);
                if size <= high - low { at.clamp(low, high - size) } else { at }
            };
            (
                middle(layout.paper.width(), width, room.left, room.right),
                middle(layout.paper.length(), length, room.top, room.bottom),
            )
        }
    }
}

/// The ink in use that shows best on most grounds.
fn best(inks: &[Ink]) -> Option<Ink> {
    const ORDER: [Ink; 13] = [
        Ink::Black,
        Ink::MetallicSilver,
        Ink::MetallicGold,
        Ink::MetallicCyan,
        Ink::MetallicMagenta,
        Ink::Magenta,
        Ink::Cyan,
        Ink::White,
        Ink::Yellow,
        Ink::SilverFoil,
        Ink::GoldFoil,
        Ink::Finish,
        Ink::Primer,
    ];
    ORDER.into_iter().find(|ink| inks.contains(ink))
}

/// Chosen inks in the order of the passes they join, those the piece does not have where they customarily go.
fn in_order(chosen: &[Ink], in_use: &[Ink]) -> Vec<Ink> {
    let mut stacks: Vec<Stack> = chosen.iter().map(|&ink| Stack::new([ink])).collect();
    stacks.push(Stack::new(in_use));
    let mut order: Vec<Ink> = Vec::new();
    for ink in separate::passes_of(&stacks) {
        if chosen.contains(&ink) && !order.contains(&ink) {
            order.push(ink);
        }
    }
    order
}

/// The marks, each with the number of its stack, which is added to `stacks`; and how many had no room. `in_use` are the
/// inks of the piece in the order of passes.
fn marks_of(
    layout: &Layout,
    in_use: &[Ink],
    block: &Block,
    stacks: &mut Vec<Stack>,
) -> Result<(Vec<(Mark, u8)>, usize), LayoutError> {
    let (ticks, crosses) = match &layout.mark_inks[..] {
        [] => (best(in_use).into_iter().collect(), in_use.to_vec()),
        chosen => {
            let chosen = in_order(chosen, in_use);
            (chosen.clone(), chosen)
        }
    };
    let mut number = |inks: Vec<Ink>| -> Result<u8, LayoutError> {
        let stack = Stack::new(inks);
        let at = stacks.iter().position(|known| *known == stack).unwrap_or_else(|| {
            stacks.push(stack);
            stacks.len() - 1
        });
        u8::try_from(at).map_err(|_| LayoutError::Stacks)
    };
    let (mut all, mut left_out) = (Vec::new(), 0);
    let mut add = |(marks, missing): (Vec<Mark>, usize), stack: u8| {
        all.extend(marks.into_iter().map(|mark| (mark, stack)));
        left_out += missing;
    };
    if layout.crop_marks {
        add(marks::crop(block.place, &block.columns, &block.rows, block.room), number(ticks)?);
    }
    if layout.registration_marks {
        add(marks::registration(block.place, block.room, layout.crop_marks), number(crosses)?);
    }
    Ok((all, left_out))
}

/// The ideal page.
struct Page<'a> {
    piece: &'a Piece,
    layout: &'a Layout,
    block: &'a Block,
    marks: &'a [(Mark, u8)],
}

impl Page<'_> {
    /// The dots of the sheet, row by row as they are sent.
    fn render(&self, observer: &dyn Observer) -> Vec<u8> {
        let (width, length) = (usize::from(self.layout.paper.width()), self.layout.paper.length());
        observer.begin("layout", length.into());
        let mut index = vec![0; width * usize::from(length)];
        index.par_chunks_exact_mut(width).enumerate().for_each(|(sent, row)| {
            self.row(self.layout.profile.lands_on(sent as i64), row);
            observer.advance(1);
        });
        observer.end();
        index
    }

    /// The row of the ideal page at `y`, as it must be sent.
    fn row(&self, y: i64, row: &mut [u8]) {
        if !(self.block.room.top..self.block.room.bottom).contains(&y) {
            return;
        }
        let offset = self.layout.profile.offset().0;
        let fits = |left: i64, right: i64| (left.max(self.block.room.left), right.min(self.block.room.right));
        if let Some(&(top, _)) = self.block.rows.iter().find(|(top, bottom)| (*top..*bottom).contains(&y)) {
            // Within the piece, by the line above.
            let start = (y - top) as usize * self.piece.width();
            let dots = &self.piece.index()[start..start + self.piece.width()];
            for &(left, right) in &self.block.columns {
                let (from, to) = fits(left, right);
                if from >= to {
                    continue;
                }
                // The room lies within what the offset leaves of the row.
                let target = &mut row[(from - offset) as usize..(to - offset) as usize];
                if self.layout.mirror {
                    let source = &dots[(right - to) as usize..(right - from) as usize];
                    target.iter_mut().zip(source.iter().rev()).for_each(|(dot, &source)| *dot = source);
                } else {
                    target.copy_from_slice(&dots[(from - left) as usize..(to - left) as usize]);
                }
            }
        }
        for (mark, stack) in self.marks {
            if !(mark.place.top..mark.place.bottom).contains(&y) {
                continue;
            }
            let (from, to) = fits(mark.place.left, mark.place.right);
            for x in (from..to).filter(|&x| mark.covers(x, y)) {
                row[(x - offset) as usize] = *stack;
            }
        }
    }

    /// A rectangle within the room, in dots of the sheet.
    fn area(&self, place: Rect) -> Option<Area> {
        if place.width() <= 0 || place.length() <= 0 {
            return None;
        }
        let offset = self.layout.profile.offset().0;
        let sent = i64::from(self.layout.paper.length());
        // Rows land in order, so the first and the last are found by halving.
        let first_at = |y: i64| {
            let (mut low, mut high) = (0, sent);
            while low < high {
                let middle = (low + high) / 2;
                if self.layout.profile.lands_on(middle) < y { low = middle + 1 } else { high = middle }
            }
            low
        };
        let (top, bottom) = (first_at(place.top), first_at(place.bottom));
        (top < bottom).then(|| Area {
            left: (place.left - offset) as usize,
            top: top as usize,
            width: place.width() as usize,
            length: (bottom - top) as usize,
        })
    }
}

#[cfg(test)]
mod tests;
