//! From a dot map to a page: size and position, copies side by side, marks, mirror, and the printer's own offset and feed.
//!
//! Method: an ideal page is described by rectangles (copies and marks) in dots of the printable area; each row that is
//! sent asks the ideal page for the row it lands on. So the printer's offset and feed are corrected for everything alike.
//! Cost: one copy of the dots. Limits: one dot map a page, repeated on a grid; no rotation; feed is corrected by leaving out
//! or doubling single rows, evenly.

mod block;
pub mod camera;
mod files;
pub mod fit;
mod length;
mod marks;
mod page;
pub mod paper;
mod profile;
mod rect;
mod settings;
pub mod size;

use inks::Stack;
use protocol::paper::{LEFT, Paper};
use protocol::rgl::Resolution;
use protocol::walk::{EDGE, Frame};

pub use length::{Mm, NoLength, Point};
pub use profile::Profile;
pub use rect::Cut;
pub use settings::{Layout, LayoutError, MOST_REPEATS, Position, Repeat};
pub use size::SizeError;

use block::Block;
use observe::Observer;
use page::IdealPage;
use rect::Rect;
use serde::{Deserialize, Serialize};
use sheet::{Area, DotMap, Sheet, order};

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
    /// What is drawn and was cut off.
    pub cut: Option<Cut>,
}

impl Laid {
    /// One copy that takes this area and nothing else on the page.
    pub fn single(area: Area) -> Laid {
        Laid { grid: (1, 1), marks_left_out: 0, copies: vec![area], area, cut: None }
    }

    /// How many dots of the copies each stack of the sheet has; what marks take does not count.
    pub fn census(&self, sheet: &Sheet) -> [u64; 256] {
        let rows = |copy: &Area| {
            let rows = sheet.index().chunks_exact(sheet.width()).skip(copy.top).take(copy.length);
            let (left, width) = (copy.left, copy.width);
            rows.map(move |row| &row[left..left + width])
        };
        sheet::census(self.copies.iter().flat_map(rows))
    }
}

/// Whether a dot map of this size can be laid so, before it is made.
///
/// # Errors
/// Those of [`arrange`] that follow from sizes.
pub fn check(width: usize, length: usize, layout: &Layout) -> Result<(), LayoutError> {
    Block::of((width, length), layout).map(|_| ())
}

/// Where copies and their registration marks lie on the sheet of paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Places {
    /// The top left corner of each copy, row by row, in millimetres from that of the sheet.
    pub copies: Vec<(f64, f64)>,
    /// The middles of the registration marks.
    pub marks: Vec<(f64, f64)>,
}

/// Where a dot map of this size will be on the sheet, before it is made.
///
/// # Errors
/// Those of [`check`].
pub fn places(width: usize, length: usize, layout: &Layout) -> Result<Places, LayoutError> {
    let block = Block::of((width / layout.across().max(1), length), layout)?;
    let (left, top) = (i64::from(LEFT), i64::from(layout.paper.top()));
    let mm = |dots: f64| dots * 25.4 / 600.0;
    let place = |x: f64, y: f64| (mm(x + left as f64), mm(y + top as f64));
    let corner = |row: i64| block.columns.iter().map(move |&(x, _)| place(x as f64, row as f64));
    let copies = block.rows.iter().flat_map(|&(row, _)| corner(row)).collect();
    let marks = match layout.registration_marks {
        true => marks::registration(block.place, block.room, layout.crop_marks).0,
        false => Vec::new(),
    };
    let middle = |mark: &marks::Mark| {
        let Rect { left, top, right, bottom } = mark.place;
        place((left + right) as f64 / 2.0, (top + bottom) as f64 / 2.0)
    };
    Ok(Places { copies, marks: marks.iter().map(middle).collect() })
}

/// Where the walk along which a dot map of this size was halftoned begins on the page, and how far it reaches: the first copy.
/// If its corner lies beyond the sheet, it begins where the walk is the same again. The curve in a tile is its own mirror image, so
/// that of a mirrored copy begins at the first tile that is whole from the right.
///
/// # Errors
/// Those of [`check`].
pub fn frame(width: usize, length: usize, layout: &Layout) -> Result<Frame, LayoutError> {
    let across = layout.across();
    let block = Block::of((width / across.max(1), length), layout)?;
    let ((left, right), (top, bottom)) = (block.columns[0], block.rows[0]);
    let copy = Rect { left, right, top, bottom };
    let framed = || {
        let visible = page::area(layout, copy.meet(block.room))?;
        let begin = |visible: usize, hidden: i64, period: u16| {
            let begin = visible as i64 - hidden;
            u16::try_from(if begin < 0 { begin.rem_euclid(period.into()) } else { begin }).ok()
        };
        let across = across as i64;
        let cut = if layout.mirror { across * (right - left) % i64::from(EDGE) } else { 0 };
        let x = begin(visible.left, across * (block.room.left - left).max(0) - cut, EDGE)?;
        let y = begin(visible.top, (block.room.top - top).max(0), 2 * EDGE)?;
        let reach =
            |from: usize, length: usize, begin: u16| u16::try_from(from + length).ok()?.checked_sub(begin);
        let width = reach(visible.left, visible.width, x)?;
        let height = reach(visible.top, visible.length, y)?;
        (width > 0 && height > 0).then_some(Frame { x, y, width, height })
    };
    let Layout { paper, resolution, .. } = *layout;
    Ok(framed().unwrap_or(Frame::whole(resolution.across(paper.width()), resolution.along(paper.length()))))
}

/// Lays a dot map on a page. At 1200 x 600 dpi the sheet is one of custom paper, twice as many dots wide.
///
/// # Errors
/// What is beyond the printable area, unless the layout says to cut; settings out of range.
pub fn arrange(dots: &DotMap, layout: &Layout, observer: &dyn Observer) -> Result<Arranged, LayoutError> {
    // Only whole pairs of dots have a place.
    let across = layout.across();
    let block = Block::of((dots.width() / across.max(1), dots.length()), layout)?;
    let mut stacks = dots.stacks().to_vec();
    let marked = layout.crop_marks || layout.registration_marks || layout.camera_marks;
    let in_use = if marked { order::passes_of(&used(dots)) } else { Vec::new() };
    let (marks, marks_left_out) = marks::marks_of(layout, dots, &in_use, &block, &mut stacks)?;
    let page = IdealPage { dots, layout, block: &block, marks: &marks };
    let sheet = Sheet::new(in_dots(layout.paper, layout.resolution), stacks, page.render(observer))?;

    let room = block.room;
    let mut copies = Vec::new();
    for &(top, bottom) in &block.rows {
        for &(left, right) in &block.columns {
            copies.extend(page::area(layout, Rect { left, right, top, bottom }.meet(room)));
        }
    }
    let all = marks.iter().fold(block.place, |all, (mark, _)| Rect {
        left: all.left.min(mark.place.left),
        top: all.top.min(mark.place.top),
        right: all.right.max(mark.place.right),
        bottom: all.bottom.max(mark.place.bottom),
    });
    let nothing = LayoutError::Nothing { paper: layout.paper.name() };
    let area = page::area(layout, all.meet(room)).filter(|_| !copies.is_empty()).ok_or(nothing)?;
    let cut = Cut::of(inked(dots, layout, block.place), room);
    let laid = Laid { grid: block.grid, marks_left_out, copies, area, cut };
    Ok(Arranged { sheet, laid })
}

/// The place of all copies without what is bare at its edges: only what is drawn can be cut off.
fn inked(dots: &DotMap, layout: &Layout, place: Rect) -> Rect {
    let is_inked = |&stack: &u8| !dots.stacks()[usize::from(stack)].layers().is_empty();
    let rows = || dots.index().chunks_exact(dots.width());
    let across = layout.across();
    let first = |row: &[u8]| row.iter().position(is_inked).map(|at| at / across);
    let last = |row: &[u8]| row.iter().rposition(is_inked).map(|at| (row.len() - 1 - at) / across);
    let (left, right) = (rows().filter_map(first).min(), rows().filter_map(last).min());
    let blank = |found: Option<usize>| found.unwrap_or(0) as i64;
    let (left, right) = if layout.mirror { (right, left) } else { (left, right) };
    let top = blank(rows().position(|row| row.iter().any(is_inked)));
    let below = blank(rows().rev().position(|row| row.iter().any(is_inked)));
    Rect {
        left: place.left + blank(left),
        top: place.top + top,
        right: place.right - blank(right),
        bottom: place.bottom - below,
    }
}

/// A paper whose area is counted in the dots of a job of this resolution.
pub(crate) fn in_dots(paper: Paper, resolution: Resolution) -> Paper {
    match resolution {
        Resolution::Dpi600 => paper,
        _ => Paper::Custom {
            width: resolution.across(paper.width()),
            length: resolution.along(paper.length()),
        },
    }
}

/// The stacks that are on a dot.
fn used(dots: &DotMap) -> Vec<Stack> {
    let mut seen = [false; 256];
    dots.index().iter().for_each(|&stack| seen[usize::from(stack)] = true);
    dots.stacks().iter().zip(seen).filter(|(_, seen)| *seen).map(|(stack, _)| stack.clone()).collect()
}

#[cfg(test)]
mod tests;
