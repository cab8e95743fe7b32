//! Tones made exact: stacks that print too many dots give cells to those that print too few.
//!
//! Problem: diffusion drops what is owed where tones end. On a sheet of 20 mm that was 0.12 % of a stack, and exchanges keep it.
//! Method: what each stack prints beyond what is asked is counted for a part, dot by dot. Cells are cut into as many stretches as
//! changes are needed. In each, of all changes from one stack to another that differ by much, that one is made which adds least to the
//! error seen. A stack may give what it has to spare to one that shares cells with it, and that one to a third. Later rounds smooth
//! the surroundings.
//! Cost: at most [`PASSES`] looks at each cell, and one update of the errors seen for each change.
//! Limits: tones of stacks without a cell in common stay apart. What is seen from a half is taken for what is seen from its cell.

use std::ops::Range;

use super::moves::{dot, minus, plus, times};
use super::{BLOCK, FIXED, Part, Place, Point, REACH};
use crate::clustered::cell::Cell;

/// How often all cells are looked at: each pass changes stacks that differ by a quarter of the most or more.
const PASSES: usize = 8;

/// Two tones that differ by this part of all dots, or less, are settled: a sixteenth of a step of 8 bits,
/// which cannot be seen.
const SETTLED: f64 = 1.0 / 4096.0;

/// A cell, or a half of one, that is to print another stack.
struct Gift {
    place: Place,
    cell: Cell,
    from: u8,
    to: u8,
    dots: f64,
    /// Where its error lies, in half dots from the cell's centre.
    at: (i32, i32),
    error: Point,
    /// What it adds to the error seen.
    change: f32,
}

impl Part<'_> {
    /// Brings tones to what is asked by changes in these rows of blocks, of which the last part of a page may have none.
    #[inline(always)]
    pub(super) fn correct_tones(&mut self, rows: Range<usize>) {
        if rows.is_empty() {
            return;
        }
        let dots = |zone: &super::Zone| (zone.columns * zone.size * BLOCK) as f64;
        let settled = SETTLED * self.zones.iter().flatten().map(dots).sum::<f64>();
        let here = || rows.clone();
        let cells = |zone: &super::Zone| zone.columns * BLOCK / zone.size;
        let all: usize = self.zones[here()].iter().flatten().map(cells).sum();
        let area = self.zones[rows.start].iter().map(|zone| zone.size.pow(2)).min().unwrap_or(1) as f64;
        for _ in 0..PASSES {
            let (mut least, mut most, mut over) = (0.0f64, 0.0f64, 0.0);
            for &beyond in &self.beyond {
                (least, most, over) = (least.min(beyond), most.max(beyond), over + beyond.max(0.0));
            }
            let apart = (0.25 * (most - least)).max(settled);
            if most - least <= apart {
                return;
            }
            let stretch = (all as f64 * area / over).max(1.0) as usize;
            let (mut looked, mut best, mut given) = (0, None, false);
            self.each_place(
                here(),
                #[inline(always)]
                |part, place| {
                    if part.cells[place.number()] != FIXED {
                        part.look(place, apart, &mut best);
                    }
                    looked += 1;
                    if looked % stretch == 0 || looked == all {
                        given |= best.is_some();
                        best.take().into_iter().for_each(|gift| part.give(gift));
                    }
                },
            );
            if !given {
                return;
            }
        }
    }

    /// Notes the best change of a cell between stacks that are so far apart in dots, if it is better than the best so far.
    #[inline(always)]
    fn look(&self, place: Place, apart: f64, best: &mut Option<Gift>) {
        let (number, size) = (place.number(), place.zone.size);
        let cell = self.cells[number];
        let parts = if cell.is_split() { 2 } else { 1 };
        let dots = (size * size / parts) as f64;
        for half in 0..parts {
            let from = cell.halves[half];
            let gives = self.beyond[usize::from(from)];
            for to in 0..self.points.len().min(64) as u8 {
                let differ = gives - self.beyond[usize::from(to)];
                if differ <= dots.max(apart)
                    || !self.allows(number, to)
                    || parts == 2 && !self.is_small(size, to)
                {
                    continue;
                }
                let error = minus(self.point(to, dots as f32), self.point(from, dots as f32));
                let itself = self.kernel.near(size, (0, 0)) * dot(error, error);
                let change = 2.0 * dot(error, self.seen[number]) + itself;
                if best.as_ref().is_some_and(|best| best.change <= change) {
                    continue;
                }
                let (mut after, mut at) = (Cell::whole(to), (0, 0));
                if parts == 2 {
                    let mut halves = cell.halves;
                    halves[half] = to;
                    at = place.halves(cell.stacked)[half];
                    if halves[0] != halves[1] {
                        after = Cell { halves, ..cell };
                    }
                }
                *best = Some(Gift { place, cell: after, from, to, dots, at, error, change });
            }
        }
    }

    #[inline(always)]
    fn give(&mut self, Gift { place, cell, from, to, dots, at, error, .. }: Gift) {
        self.beyond[usize::from(from)] -= dots;
        self.beyond[usize::from(to)] += dots;
        self.cells[place.number()] = cell;
        self.lines.add(place, at, error);
        self.around(
            place,
            (REACH, 0),
            [at],
            #[inline(always)]
            |seen, [kernel]| {
                for (seen, kernel) in seen.iter_mut().zip(kernel) {
                    *seen = plus(*seen, times(*kernel, error));
                }
            },
        );
    }
}
