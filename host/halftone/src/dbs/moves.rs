//! The changes of a cell that keep every stack's dots, and what each makes of the error seen.
//!
//! Problem: of all changes of a cell and its neighbours, the best is to be found.
//! Method: every change moves one or two errors from one place to another ([`Shift`]): a whole cell, a half of a cell, or both
//! halves of one. Cells change places with cells, and halves with halves, a half of a whole cell of a small stack among them;
//! a cell of two stacks may also turn.
//! Where a half may lie in four places, that is taken where the error that leaves or comes is seen most or least. What is seen from all four
//! is one vector for each coordinate. A change costs what its errors have in common, which is never negative: what does not gain
//! enough by what is seen alone is not weighed.
//! Cost: for each of four neighbours up to four pairs of halves.

use super::lines::Around;
use super::{FIXED, NEAR, Part, Place, Point};
use crate::clustered::cell::Cell;

/// No cell.
const NONE: usize = usize::MAX;

/// What rounding, and halves that share a part of a line, may make of a gain: a part of what is seen and of the error itself.
const COARSE: f32 = 1.0 / 128.0;

/// The numbers of the cells of one side around a place, two to each side of it, or [`NONE`].
type Numbers = [[usize; 5]; 5];

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

impl Shift {
    /// The least that half of what it makes of the error may be.
    #[inline(always)]
    fn least(&self) -> f32 {
        let (from, to) = (dot(self.error, self.from.seen), dot(self.error, self.to.seen));
        to - from - COARSE * (from.abs() + to.abs() + dot(self.error, self.error))
    }
}

/// A cell as the search sees it.
#[derive(Clone, Copy)]
struct View {
    number: usize,
    cell: Cell,
    /// Its centre in half dots from that of the cell at work.
    at: (i32, i32),
    /// Of each coordinate what is seen from its halves: the left, the right, the upper and the lower one.
    seen: [Point; 4],
}

/// The best change so far: what it makes of the error, its errors, and the cells after it.
struct Best {
    change: f32,
    shifts: [Option<Shift>; 2],
    cells: [Option<(usize, Cell)>; 2],
}

impl View {
    /// The place of a half that may be changed and from which most of an error is seen: its own, or one of all four if the cell is whole.
    #[inline(always)]
    fn most(&self, half: usize, error: Point) -> usize {
        if self.cell.is_split() {
            return 2 * usize::from(self.cell.stacked) + half;
        }
        let [a, b, c, d] = &self.seen;
        let mut dots = [0.0; 4];
        for at in 0..4 {
            dots[at] = (error[0] * a[at] + error[1] * b[at]) + (error[2] * c[at] + error[3] * d[at]);
        }
        let first = if dots[1] > dots[0] { 1 } else { 0 };
        let last = if dots[3] > dots[2] { 3 } else { 2 };
        if dots[last] > dots[first] { last } else { first }
    }

    /// A half of a cell of this side.
    #[inline(always)]
    fn end(&self, size: usize, half: usize) -> End {
        let quarter = size as i32 / 2;
        let (dx, dy) = [(-quarter, 0), (quarter, 0), (0, -quarter), (0, quarter)][half];
        let [a, b, c, d] = &self.seen;
        End { at: (self.at.0 + dx, self.at.1 + dy), seen: [a[half], b[half], c[half], d[half]] }
    }

    /// The cell with another stack in a half.
    #[inline(always)]
    fn with(&self, half: usize, stack: u8) -> Cell {
        let mut cell = Cell { stacked: half > 1, ..self.cell };
        cell.halves[half % 2] = stack;
        cell
    }
}

#[inline(always)]
pub(super) fn dot(a: Point, b: Point) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

#[inline(always)]
pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

#[inline(always)]
pub(super) fn plus(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
pub(super) fn times(a: f32, b: Point) -> Point {
    [a * b[0], a * b[1], a * b[2], a * b[3]]
}

impl Part<'_> {
    /// Makes the change of a cell that lessens the error most, if any does: by itself, or with one of the neighbours that come after
    /// it, so that each pair is looked at once a round.
    #[inline(always)]
    pub(super) fn improve(&mut self, place: Place) {
        let size = place.zone.size;
        let area = (size * size) as f32;
        let cell = self.cells[place.number()];
        let numbers = self.numbers(place);
        let lines = self.lines.around(place);
        let may_split = self.small[size] != 0;
        let own = may_split.then(|| self.view(&numbers, (0, 0), size, &lines));
        // Differences below what rounding makes of the sums would go round in circles.
        let mut best = Best { change: -1e-5 * area, shifts: [None; 2], cells: [None; 2] };
        if let Some(own) = own.as_ref().filter(|own| own.cell.is_split()) {
            self.arrange(own, size, &mut best);
        }
        for (dx, dy) in [(1, 0), (-1, 1), (0, 1), (1, 1)] {
            let there = numbers[(dy + 2) as usize][(dx + 2) as usize];
            if there == NONE {
                continue;
            }
            let other = self.cells[there];
            if other == FIXED || other == cell {
                continue;
            }
            if !cell.is_split() && !other.is_split() {
                self.exchange(place.number(), (there, (dx, dy)), size, &lines, &mut best);
            }
            let Some(own) = &own else { continue };
            let there = self.view(&numbers, (dx, dy), size, &lines);
            if cell.is_split() != other.is_split() {
                self.exchange_split(own, &there, size, &mut best);
            }
            self.exchange_halves(own, &there, size, &mut best);
        }
        for shift in best.shifts.into_iter().flatten() {
            self.lines.add(place, shift.from.at, times(-1.0, shift.error));
            self.lines.add(place, shift.to.at, shift.error);
            self.around(
                place,
                (NEAR, 0),
                [shift.from.at, shift.to.at],
                #[inline(always)]
                |seen, [from, to]| {
                    for (seen, (from, to)) in seen.iter_mut().zip(from.iter().zip(to)) {
                        *seen = plus(*seen, times(to - from, shift.error));
                    }
                },
            );
        }
        for (number, cell) in best.cells.into_iter().flatten() {
            self.cells[number] = cell;
        }
    }

    /// The cells around a place.
    #[inline(always)]
    fn numbers(&self, place: Place) -> Numbers {
        let (zone, mut numbers) = (place.zone, [[NONE; 5]; 5]);
        let across = place.i > 1 && place.i + 2 < zone.columns;
        for (dy, row) in (-2..).zip(&mut numbers) {
            let j = place.j.wrapping_add_signed(dy);
            let middle = if j < super::BLOCK / zone.size {
                Some(Place { j, ..place })
            } else {
                self.beside(place, 0, dy)
            };
            match middle {
                Some(middle) if across && middle.i > 1 && middle.i + 2 < middle.zone.columns => {
                    let first = middle.number() - 2;
                    for (dx, number) in row.iter_mut().enumerate() {
                        *number = first + dx;
                    }
                }
                _ => {
                    for (dx, number) in (-2..).zip(row) {
                        *number = self.beside(place, dx, dy).map_or(NONE, |place| place.number());
                    }
                }
            }
        }
        numbers
    }

    /// A cell so many cells from the one at work. From its halves an error is seen as the parabola through the
    /// neighbours has it; `lines` adds what the columns and rows of its halves owe.
    #[inline(always)]
    fn view(&self, numbers: &Numbers, (dx, dy): (isize, isize), size: usize, lines: &Around) -> View {
        let at = |x: isize, y: isize| numbers[(dy + y + 2) as usize][(dx + x + 2) as usize];
        let number = at(0, 0);
        let seen = self.seen[number];
        let owed = lines.halves((dx, dy));
        let mut halves = [[0.0; 4]; 4];
        for (first, before, after) in [(0, at(-1, 0), at(1, 0)), (2, at(0, -1), at(0, 1))] {
            let (before, after) = match (before, after) {
                (NONE, NONE) => (seen, seen),
                (before, NONE) => (self.seen[before], minus(times(2.0, seen), self.seen[before])),
                (NONE, after) => (minus(times(2.0, seen), self.seen[after]), self.seen[after]),
                (before, after) => (self.seen[before], self.seen[after]),
            };
            for c in 0..4 {
                let (slope, bend) = (after[c] - before[c], after[c] + before[c] - 2.0 * seen[c]);
                halves[c][first] = seen[c] + -0.125 * slope + bend / 32.0 + owed[first / 2][0][c];
                halves[c][first + 1] = seen[c] + 0.125 * slope + bend / 32.0 + owed[first / 2][1][c];
            }
        }
        let step = 2 * size as i32;
        View { number, cell: self.cells[number], at: (dx as i32 * step, dy as i32 * step), seen: halves }
    }

    #[inline(always)]
    pub(super) fn point(&self, stack: u8, dots: f32) -> Point {
        times(dots, self.points[usize::from(stack)])
    }

    #[inline(always)]
    pub(super) fn allows(&self, number: usize, stack: u8) -> bool {
        self.allowed[number] >> stack & 1 == 1
    }

    #[inline(always)]
    pub(super) fn is_small(&self, size: usize, stack: u8) -> bool {
        self.small[size] >> stack & 1 == 1
    }

    /// Notes a change if it is better than the best so far.
    #[inline(always)]
    fn weigh(
        &self,
        size: usize,
        shifts: [Option<Shift>; 2],
        cells: [Option<(usize, Cell)>; 2],
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
    fn arrange(&self, own: &View, size: usize, best: &mut Best) {
        let half = 0.5 * (size * size) as f32;
        let [a, b] = own.cell.halves;
        let is_at = 2 * usize::from(own.cell.stacked);
        let [from_a, from_b] = [own.end(size, is_at), own.end(size, is_at + 1)];
        let (first, second) = (self.point(a, half), self.point(b, half));
        let swapped = Cell { halves: [b, a], ..own.cell };
        let shift = Shift { error: minus(first, second), from: from_a, to: from_b };
        self.weigh(size, [Some(shift), None], [Some((own.number, swapped)), None], best);
        let stacked = !own.cell.stacked;
        let [one, other] = [own.end(size, 2 - is_at), own.end(size, 3 - is_at)];
        for (halves, to_a, to_b) in [([a, b], one, other), ([b, a], other, one)] {
            let shifts = [
                Some(Shift { error: first, from: from_a, to: to_a }),
                Some(Shift { error: second, from: from_b, to: to_b }),
            ];
            self.weigh(size, shifts, [Some((own.number, Cell { halves, stacked })), None], best);
        }
    }

    /// Two whole cells change places.
    #[inline(always)]
    fn exchange(
        &self,
        number: usize,
        (there, beside): (usize, (isize, isize)),
        size: usize,
        lines: &Around,
        best: &mut Best,
    ) {
        let area = (size * size) as f32;
        let (own, other) = (self.cells[number], self.cells[there]);
        if !self.allows(number, other.halves[0]) || !self.allows(there, own.halves[0]) {
            return;
        }
        let step = 2 * size as i32;
        let error = minus(self.point(own.halves[0], area), self.point(other.halves[0], area));
        let from = End { at: (0, 0), seen: plus(self.seen[number], lines.whole((0, 0))) };
        let at = (beside.0 as i32 * step, beside.1 as i32 * step);
        let to = End { at, seen: plus(self.seen[there], lines.whole(beside)) };
        let cells = [Some((number, other)), Some((there, own))];
        self.weigh(size, [Some(Shift { error, from, to }), None], cells, best);
    }

    /// A whole cell and one that is not change places.
    #[inline(always)]
    fn exchange_split(&self, own: &View, there: &View, size: usize, best: &mut Best) {
        let half = 0.5 * (size * size) as f32;
        let [a, b] = own.cell.halves;
        let [c, d] = there.cell.halves;
        let own_allows = self.allows(own.number, c) && self.allows(own.number, d);
        if !own_allows || !self.allows(there.number, a) || !self.allows(there.number, b) {
            return;
        }
        let first = 2 * usize::from(own.cell.stacked || there.cell.stacked);
        let errors = [
            minus(self.point(a, half), self.point(c, half)),
            minus(self.point(b, half), self.point(d, half)),
        ];
        let one = Shift { error: errors[0], from: own.end(size, first), to: there.end(size, first) };
        let other =
            Shift { error: errors[1], from: own.end(size, first + 1), to: there.end(size, first + 1) };
        if 2.0 * (one.least() + other.least()) > best.change {
            return;
        }
        let cells = [Some((own.number, there.cell)), Some((there.number, own.cell))];
        self.weigh(size, [Some(one), Some(other)], cells, best);
    }

    /// A half changes places with a half of another cell.
    #[inline(always)]
    fn exchange_halves(&self, own: &View, there: &View, size: usize, best: &mut Best) {
        let half = 0.5 * (size * size) as f32;
        for i in 0..=usize::from(own.cell.is_split()) {
            let leaves = own.cell.halves[i];
            if !self.is_small(size, leaves) || !self.allows(there.number, leaves) {
                continue;
            }
            for j in 0..=usize::from(there.cell.is_split()) {
                let comes = there.cell.halves[j];
                if comes == leaves || !self.is_small(size, comes) || !self.allows(own.number, comes) {
                    continue;
                }
                let error = minus(self.point(leaves, half), self.point(comes, half));
                let leaving = own.most(i, error);
                let coming = there.most(j, times(-1.0, error));
                let shift = Shift { error, from: own.end(size, leaving), to: there.end(size, coming) };
                let apart = (shift.from.at.0 - shift.to.at.0, shift.from.at.1 - shift.to.at.1);
                let costs = self.kernel.near(size, (0, 0)) - self.kernel.near(size, apart);
                if 2.0 * (shift.least() + costs * dot(error, error)) > best.change {
                    continue;
                }
                let cells = [
                    Some((own.number, own.with(leaving, comes))),
                    Some((there.number, there.with(coming, leaves))),
                ];
                self.weigh(size, [Some(shift), None], cells, best);
            }
        }
    }
}
