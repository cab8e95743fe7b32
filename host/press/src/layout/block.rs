//! Where the copies go: columns and rows in the room a printer has, and what lies beyond it.

use protocol::paper::LEFT;

use super::length::{Mm, Point};
use super::rect::{Cut, Rect};
use super::settings::{Layout, LayoutError, MOST_REPEATS, Position, Repeat};

/// All copies on the ideal page.
pub(super) struct Block {
    /// What the printer reaches.
    pub room: Rect,
    /// All copies and what is between them.
    pub place: Rect,
    pub grid: (u16, u16),
    /// First and one past the last dot of each column of copies, and of each row.
    pub columns: Vec<(i64, i64)>,
    pub rows: Vec<(i64, i64)>,
    pub cut: Option<Cut>,
}

impl Block {
    pub fn of(size: (usize, usize), layout: &Layout) -> Result<Block, LayoutError> {
        if let Some(problem) = layout.profile.problem() {
            return Err(LayoutError::Setting(format!("printer profile: {problem}")));
        }
        if layout.across() == 0 {
            return Err(LayoutError::Setting("pages are laid out at 600 or 1200 dots an inch".into()));
        }
        let gap = (layout.gap.0.dots(), layout.gap.1.dots());
        if gap.0 < 0 || gap.1 < 0 {
            return Err(LayoutError::Setting("the gap between copies cannot be negative".into()));
        }
        let room = layout.room();
        // Dot maps are held in memory: their sides are far below the limits of i64.
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

impl Layout {
    /// The corner of a copy of so many dots, in dots of the printable area, and what of it lies beyond what the printer reaches.
    ///
    /// # Errors
    /// Settings out of range, and of a layout that does not cut, what is beyond.
    pub fn placed(&self, size: (usize, usize)) -> Result<((i64, i64), Option<Cut>), LayoutError> {
        let block = Block::of(size, self)?;
        Ok(((block.place.left, block.place.top), block.cut))
    }

    /// Width and length in dots of the largest copy that can be printed where the position says and as often as the grid says,
    /// marks not counted.
    pub fn largest(&self) -> (usize, usize) {
        let whole = self.room();
        let (left, top) = start(self, whole);
        // From a corner beyond the room nothing can be printed, which the layout itself refuses.
        let rest = whole.meet(Rect { left, top, ..whole });
        let room = if rest.width() > 0 && rest.length() > 0 { rest } else { whole };
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

/// Columns and rows.
fn grid(layout: &Layout, size: (i64, i64), gap: (i64, i64), room: Rect) -> Result<(u16, u16), LayoutError> {
    match layout.repeat {
        Repeat::Grid(columns, rows) => {
            if !(1..=MOST_REPEATS).contains(&columns) || !(1..=MOST_REPEATS).contains(&rows) {
                let words =
                    format!("{columns} x {rows} copies; columns and rows are 1 to {MOST_REPEATS} each");
                return Err(LayoutError::Setting(words));
            }
            Ok((columns, rows))
        }
        Repeat::Fill => {
            let start = start(layout, room);
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

/// The top left corner of a block that is as large as its room.
fn start(layout: &Layout, room: Rect) -> (i64, i64) {
    match layout.position {
        Position::Centred => (room.left, room.top),
        _ => corner(layout, (0, 0), room),
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
            // In the middle of the paper's own area, as far as the printer reaches.
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
