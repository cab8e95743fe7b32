//! Which half of a cut cell goes where.
//!
//! Problem: the halves of a cell lean to one side: a place there looks darker, and one opposite lighter, than the cell.
//! Method: they lean away from the errors of the cells that were decided before: beside it, above, and at both upper corners.
//! Limits: only where the document varies by itself; flat tones would lock into patterns, so there a hash decides, as it does where all
//! cells have the same halves: a ramp had solid columns where it passed 50 %.
//! Cost: as many operations a cell as one pass over its stacks. Memory: a point for each cell across.

use super::cell::Cell;
use super::choose::Metric;
use crate::dbs::Point;

/// What the error of an upper corner counts on either axis, against 1 for the cells beside and above.
const CORNER: f32 = 0.25;

/// The errors of the cells decided before: what they printed beyond what they asked for, as points.
pub(super) struct Errors {
    /// Of the last cell over each slot.
    above: Vec<Point>,
    /// Of the cell before in this row, and the one above that.
    before: Point,
    corner: Point,
}

impl Errors {
    /// For rows of so many slots.
    pub(super) fn new(slots: usize) -> Errors {
        Errors { above: vec![[0.0; 4]; slots], before: [0.0; 4], corner: [0.0; 4] }
    }

    /// What comes next has no neighbour before it.
    pub(super) fn interrupt(&mut self) {
        (self.before, self.corner) = ([0.0; 4], [0.0; 4]);
    }

    /// What comes next over a slot has no neighbour above it.
    #[inline(always)]
    pub(super) fn forget(&mut self, slot: usize) {
        self.above[slot] = [0.0; 4];
        self.interrupt();
    }

    /// Arranges a cell of so many dots that asks for `want`, and notes its error; `back` says that the row goes to the left.
    #[inline(always)]
    pub(super) fn arrange(
        &mut self,
        metric: &Metric,
        (slot, back): (usize, bool),
        (want, area): (&[f32], f32),
        mut cell: Cell,
    ) -> Cell {
        let points = cell.halves.map(|half| metric.point(half));
        let above = self.above[slot];
        if cell.is_split() {
            let ahead = if back { slot.checked_sub(1) } else { Some(slot + 1) };
            let over = ahead.and_then(|ahead| self.above.get(ahead)).copied().unwrap_or_default();
            let difference: Point = std::array::from_fn(|c| points[0][c] - points[1][c]);
            let along = |error: Point| (0..4).map(|c| error[c] * difference[c]).sum::<f32>();
            // How much more of the first half's error lies before the cell than beyond it, and above than below.
            let before = along(self.before) + CORNER * (along(self.corner) - along(over));
            let high = along(above) + CORNER * (along(self.corner) + along(over));
            cell.stacked = high.abs() > before.abs();
            let keep = if cell.stacked { high < 0.0 } else { (before < 0.0) != back };
            if !keep {
                cell.halves.swap(0, 1);
            }
        }
        let asked = metric.seen(want);
        let error = std::array::from_fn(|c| 0.5 * area * (points[0][c] + points[1][c]) - asked[c]);
        (self.above[slot], self.before, self.corner) = (error, error, above);
        cell
    }
}
