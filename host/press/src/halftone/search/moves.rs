//! The changes of a cell that keep every stack's dots, and what each makes of the error seen.
//!
//! Problem: of all changes of a cell and its neighbours, the best is to be found.
//! Method: every change moves one or two errors from one place to another ([`Shift`]): a whole cell, a half of a cell, or both
//! halves of one. Cells change places with cells, and halves with halves, a half of a whole cell of a small stack among them;
//! a cell of two stacks may also turn.
//! Where a half may lie in four places, that is taken where the error that leaves or comes is seen most or least.
//! Cost: for each neighbour up to four pairs of halves.

use super::lines::Around;
use super::{FIXED, NEAR, Part, Place, Point};
use crate::halftone::cells::cell::Cell;

/// A place in a cell, in half dots from the centre of the cell at work, and the error seen from there.
#[derive(Clone, Copy)]
struct End {
    at: (i32, i32),
    seen: Point,
}

/// An error that goes from one place to another.
#[derive(Clone, Copy)]
struct Shift {
    error: Point,
    from: End,
    to: End,
}

/// A cell as the search sees it.
#[derive(Clone, Copy)]
struct View {
    place: Place,
    cell: Cell,
    /// Halves side by side, then one above the other.
    halves: [[End; 2]; 2],
}

/// The best change so far: what it makes of the error, its errors, and the cells after it.
struct Best {
    change: f32,
    shifts: [Option<Shift>; 2],
    cells: [Option<(Place, Cell)>; 2],
}

impl View {
    /// Places of a half that may be changed: its own, or all four if the cell is whole.
    #[inline(always)]
    fn places(&self, half: usize) -> impl Iterator<Item = (bool, usize)> + use<> {
        let (split, stacked) = (self.cell.is_split(), self.cell.stacked);
        let all = [(false, 0), (false, 1), (true, 0), (true, 1)];
        all.into_iter().filter(move |&place| !split || place == (stacked, half))
    }

    /// The place of a half where most of an error is seen.
    #[inline(always)]
    fn most(&self, half: usize, error: Point) -> (bool, usize) {
        let seen = |(stacked, half): (bool, usize)| dot(error, self.halves[usize::from(stacked)][half].seen);
        let most = |a: (bool, usize), b| if seen(b) > seen(a) { b } else { a };
        self.places(half).reduce(most).unwrap_or_default()
    }

    /// The cell with another stack in a half.
    fn with(&self, (stacked, half): (bool, usize), stack: u8) -> Cell {
        let mut cell = Cell { stacked, ..self.cell };
        cell.halves[half] = stack;
        cell
    }
}

#[inline(always)]
fn dot(a: Point, b: Point) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

#[inline(always)]
fn minus(a: Point, b: Point) -> Point {
    std::array::from_fn(|c| a[c] - b[c])
}

#[inline(always)]
fn plus(a: Point, b: Point) -> Point {
    std::array::from_fn(|c| a[c] + b[c])
}

impl Part<'_> {
    /// Makes the change of a cell that lessens the error most, if any does.
    #[inline(always)]
    pub(super) fn improve(&mut self, place: Place) {
        let size = place.zone.size;
        let area = (size * size) as f32;
        let inner = place.i > 1
            && place.i + 2 < place.zone.columns
            && place.j > 1
            && (place.j + 2) * size < super::BLOCK;
        let cell = self.cells[place.number()];
        let lines = self.lines.around(place);
        let own = (self.small[size] != 0).then(|| self.view(place, (0, 0), inner, &lines.halves((0, 0))));
        // Differences below what rounding makes of the sums would go round in circles.
        let mut best = Best { change: -1e-5 * area, shifts: [None; 2], cells: [None; 2] };
        if let Some(own) = own.as_ref().filter(|own| own.cell.is_split()) {
            self.arrange(own, &mut best);
        }
        let step = 2 * size as i32;
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let Some(there) = self.next_to(place, dx, dy, inner) else { continue };
            let other = self.cells[there.number()];
            if other == FIXED || other == cell {
                continue;
            }
            let at = (dx as i32 * step, dy as i32 * step);
            if !cell.is_split() && !other.is_split() {
                self.exchange(place, (there, at, (dx, dy)), &lines, &mut best);
            }
            let Some(own) = &own else { continue };
            let there = self.view(there, at, inner, &lines.halves((dx, dy)));
            if cell.is_split() != other.is_split() {
                self.exchange_split(own, &there, &mut best);
            }
            self.exchange_halves(own, &there, &mut best);
        }
        for shift in best.shifts.into_iter().flatten() {
            self.lines.add(place, shift.from.at, shift.error.map(|error| -error));
            self.lines.add(place, shift.to.at, shift.error);
            self.around(
                place,
                NEAR,
                [shift.from.at, shift.to.at],
                #[inline(always)]
                |seen, from, to| {
                    for (seen, (from, to)) in seen.iter_mut().zip(from.iter().zip(to)) {
                        for c in 0..4 {
                            seen[c] += (to[c] - from[c]) * shift.error[c];
                        }
                    }
                },
            );
        }
        for (place, cell) in best.cells.into_iter().flatten() {
            self.cells[place.number()] = cell;
        }
    }

    /// The place one cell to a side; `inner` says that it is in the same zone.
    #[inline(always)]
    fn next_to(&self, place: Place, dx: isize, dy: isize, inner: bool) -> Option<Place> {
        if !inner {
            return self.beside(place, dx, dy);
        }
        let (i, j) = (place.i.wrapping_add_signed(dx), place.j.wrapping_add_signed(dy));
        Some(Place { i, j, ..place })
    }

    /// A cell `at` so many half dots from the one at work. From its halves an error is seen as the parabola through the
    /// neighbours has it; `lines` adds what the columns and rows of its halves owe.
    #[inline(always)]
    fn view(&self, place: Place, at: (i32, i32), inner: bool, lines: &[[Point; 2]; 2]) -> View {
        let cell = self.cells[place.number()];
        let seen = self.seen[place.number()];
        let mut halves = [[End { at, seen }; 2]; 2];
        for (stacked, (dx, dy)) in [(false, (1, 0)), (true, (0, 1))] {
            let near = |dx, dy| self.next_to(place, dx, dy, inner).map(|place| self.seen[place.number()]);
            let (before, after) = match (near(-dx, -dy), near(dx, dy)) {
                (Some(before), Some(after)) => (before, after),
                (Some(before), None) => (before, std::array::from_fn(|c| 2.0 * seen[c] - before[c])),
                (None, Some(after)) => (std::array::from_fn(|c| 2.0 * seen[c] - after[c]), after),
                (None, None) => (seen, seen),
            };
            let ends = place.halves(stacked);
            for (half, sign) in [(0, -0.125), (1, 0.125)] {
                let seen = std::array::from_fn(|c| {
                    let (slope, bend) = (after[c] - before[c], after[c] + before[c] - 2.0 * seen[c]);
                    seen[c] + sign * slope + bend / 32.0 + lines[usize::from(stacked)][half][c]
                });
                let at = (at.0 + ends[half].0, at.1 + ends[half].1);
                halves[usize::from(stacked)][half] = End { at, seen };
            }
        }
        View { place, cell, halves }
    }

    fn point(&self, stack: u8, dots: f32) -> Point {
        self.points[usize::from(stack)].map(|coordinate| dots * coordinate)
    }

    fn allows(&self, view: &View, stack: u8) -> bool {
        self.allowed[view.place.number()] >> stack & 1 == 1
    }

    fn is_small(&self, size: usize, stack: u8) -> bool {
        self.small[size] >> stack & 1 == 1
    }

    /// Notes a change if it is better than the best so far.
    #[inline(always)]
    fn weigh(
        &self,
        size: usize,
        shifts: [Option<Shift>; 2],
        cells: [Option<(Place, Cell)>; 2],
        best: &mut Best,
    ) {
        let near = |a: End, b: End| self.kernel.near(size, (a.at.0 - b.at.0, a.at.1 - b.at.1));
        let mut change = 0.0;
        for &Shift { error, from, to } in shifts.iter().flatten() {
            change += 2.0 * dot(error, minus(to.seen, from.seen));
            change += 2.0 * dot(error, error) * (self.kernel.near(size, (0, 0)) - near(from, to));
        }
        if let [Some(a), Some(b)] = shifts {
            let common = near(a.to, b.to) + near(a.from, b.from) - near(a.to, b.from) - near(a.from, b.to);
            change += 2.0 * dot(a.error, b.error) * common;
        }
        if change < best.change {
            *best = Best { change, shifts, cells };
        }
    }

    /// Other arrangements of a cell's halves.
    #[inline(always)]
    fn arrange(&self, own: &View, best: &mut Best) {
        let size = own.place.zone.size;
        let half = 0.5 * (size * size) as f32;
        let [a, b] = own.cell.halves;
        let [from_a, from_b] = own.halves[usize::from(own.cell.stacked)];
        let (first, second) = (self.point(a, half), self.point(b, half));
        let swapped = Cell { halves: [b, a], ..own.cell };
        let shift = Shift { error: minus(first, second), from: from_a, to: from_b };
        self.weigh(size, [Some(shift), None], [Some((own.place, swapped)), None], best);
        let stacked = !own.cell.stacked;
        let [one, other] = own.halves[usize::from(stacked)];
        for (halves, to_a, to_b) in [([a, b], one, other), ([b, a], other, one)] {
            let shifts = [
                Some(Shift { error: first, from: from_a, to: to_a }),
                Some(Shift { error: second, from: from_b, to: to_b }),
            ];
            self.weigh(size, shifts, [Some((own.place, Cell { halves, stacked })), None], best);
        }
    }

    /// Two whole cells change places.
    #[inline(always)]
    fn exchange(
        &self,
        place: Place,
        (there, at, beside): (Place, (i32, i32), (isize, isize)),
        lines: &Around,
        best: &mut Best,
    ) {
        let size = place.zone.size;
        let area = (size * size) as f32;
        let (a, b) = (place.number(), there.number());
        let (own, other) = (self.cells[a], self.cells[b]);
        if self.allowed[a] >> other.halves[0] & self.allowed[b] >> own.halves[0] & 1 == 0 {
            return;
        }
        let error = minus(self.point(own.halves[0], area), self.point(other.halves[0], area));
        let from = End { at: (0, 0), seen: plus(self.seen[a], lines.whole((0, 0))) };
        let to = End { at, seen: plus(self.seen[b], lines.whole(beside)) };
        let cells = [Some((place, other)), Some((there, own))];
        self.weigh(size, [Some(Shift { error, from, to }), None], cells, best);
    }

    /// A whole cell and one that is not change places.
    #[inline(always)]
    fn exchange_split(&self, own: &View, there: &View, best: &mut Best) {
        let size = own.place.zone.size;
        let half = 0.5 * (size * size) as f32;
        let stays = own.cell.halves.iter().all(|&stack| self.allows(there, stack));
        if !stays || !there.cell.halves.iter().all(|&stack| self.allows(own, stack)) {
            return;
        }
        let stacked = usize::from(own.cell.stacked || there.cell.stacked);
        let shifts = [0, 1].map(|i| {
            let (leaves, comes) = (own.cell.halves[i], there.cell.halves[i]);
            let error = minus(self.point(leaves, half), self.point(comes, half));
            Some(Shift { error, from: own.halves[stacked][i], to: there.halves[stacked][i] })
        });
        let cells = [Some((own.place, there.cell)), Some((there.place, own.cell))];
        self.weigh(size, shifts, cells, best);
    }

    /// A half changes places with a half of another cell.
    #[inline(always)]
    fn exchange_halves(&self, own: &View, there: &View, best: &mut Best) {
        let size = own.place.zone.size;
        let half = 0.5 * (size * size) as f32;
        for i in 0..=usize::from(own.cell.is_split()) {
            let leaves = own.cell.halves[i];
            if !self.is_small(size, leaves) || !self.allows(there, leaves) {
                continue;
            }
            for j in 0..=usize::from(there.cell.is_split()) {
                let comes = there.cell.halves[j];
                if comes == leaves || !self.is_small(size, comes) || !self.allows(own, comes) {
                    continue;
                }
                let error = minus(self.point(leaves, half), self.point(comes, half));
                let leaving = own.most(i, error);
                let coming = there.most(j, error.map(|coordinate| -coordinate));
                let from = own.halves[usize::from(leaving.0)][leaving.1];
                let to = there.halves[usize::from(coming.0)][coming.1];
                let cells = [
                    Some((own.place, own.with(leaving, comes))),
                    Some((there.place, there.with(coming, leaves))),
                ];
                self.weigh(size, [Some(Shift { error, from, to }), None], cells, best);
            }
        }
    }
}
