//! Direct binary search on cells: neighbours change places while that lessens the error the eye sees.
//!
//! Problem: error diffusion decides each cell once and never looks back, and does not know that black beside white is
//! seen before cyan beside magenta.
//! Method: stacks are points whose distances are those of what they reflect ([`super::eye::Tangent`]). The error of all
//! cells, convolved with the autocorrelation of the eye's response, gives what exchanging two cells would change in a
//! few products (Analoui and Allebach 1992); the best exchange with one of the eight neighbours is made if it lessens
//! the error. Only exchanges, no toggles: every stack keeps its dots, so tones need no term of their own. For the
//! response exp(-f/k) the autocorrelation is known, (1 + (r/a)^2)^(-3/2), a = 1 / (pi k).
//! Parts of [`PART`] block rows are searched at the same time, each but for its [`MARGIN`] rows at either end, which are
//! only looked at; then parts that lie over the ends of these. The dots do not depend on the number of threads.
//! Cost: (2 REACH / 3)^2 vectors of four a cell of 3 x 3 dots to begin with, and a third for each exchange, of which there
//! is about one for four cells. Memory: 45 bytes a cell of the parts at work, 13 MB a thread for A4.
//! Limits: four coordinates, those in which stacks differ most, about the page's mean mixture; cells beside edges stay
//! as they are, and so do all stacks after the 64th.

use std::ops::Range;

use rayon::prelude::*;

use super::cells::field::{Field, Row};
use super::cells::plan::{BLOCK, Plan};
use super::wide::wide;

/// Where a stack lies among all others.
pub(super) type Point = [f32; 4];

/// Rounds over a part; more change less than 1 %.
const ROUNDS: usize = 3;

/// How far an error reaches, in dots to each side: less leaves means unseen, and the search makes worse of them.
const REACH: usize = 30;

/// How far an exchange reaches. Its two errors cancel from afar.
const NEAR: usize = 20;

/// From how far the eye looks, in dots: 0.3 m. What is even from near is even from afar.
const SCALE: f32 = 7.62;

/// Block rows in a part, and how many at each end belong to its neighbours: more than an error reaches.
const PART: usize = 24;
const MARGIN: usize = 2;

/// Not to be exchanged.
const FIXED: u8 = u8::MAX;

/// The autocorrelation of the eye's response, in rows as vectors can take them: for cells of one side, its values at
/// distances of `phase`, `phase` + 2 sides and so on, in half dots, four times each.
struct Kernel {
    /// By side of the cells that see.
    tables: Vec<Vec<Point>>,
}

impl Kernel {
    /// Distances down: 0 to this, in half dots.
    const DOWN: usize = 2 * REACH;

    fn new(sizes: impl Iterator<Item = usize>) -> Kernel {
        let mut tables = vec![Vec::new(); BLOCK + 1];
        for size in sizes.filter(|&size| size > 0) {
            if tables[size].is_empty() {
                tables[size] = Kernel::table(size);
            }
        }
        Kernel { tables }
    }

    /// Distances to either side in steps.
    fn half(size: usize) -> usize {
        REACH / size + 2
    }

    fn table(size: usize) -> Vec<Point> {
        let (half, step) = (Kernel::half(size) as isize, 2 * size as isize);
        let square = |half_dots: isize| (half_dots as f32 / 2.0 / SCALE).powi(2);
        let mut table = Vec::with_capacity(2 * size * (Kernel::DOWN + 1) * (2 * Kernel::half(size) + 1));
        for phase in 0..step {
            for down in 0..=Kernel::DOWN as isize {
                for i in -half..=half {
                    let sum = 1.0 + square(phase + i * step) + square(down);
                    // Roots are rounded once on every machine; powers of 3/2 are not.
                    table.push([1.0 / (sum * sum.sqrt()); 4]);
                }
            }
        }
        table
    }

    /// Where the values begin for cells of a side of which the first lies `x` half dots to the right.
    #[inline(always)]
    fn column(size: usize, x: i32) -> Column {
        let (half, step) = (Kernel::half(size), 2 * size as i32);
        let (steps, phase) = (x.div_euclid(step), x.rem_euclid(step) as usize);
        let first = phase * (Kernel::DOWN + 1) * (2 * half + 1);
        Column { size, first: first + (steps + half as i32) as usize, length: 2 * half + 1 }
    }

    /// Values for `count` cells from there, all `y` half dots below.
    #[inline(always)]
    fn row(&self, column: Column, y: i32, count: usize) -> &[Point] {
        let first = column.first + y.unsigned_abs() as usize * column.length;
        &self.tables[column.size][first..first + count]
    }

    /// What two errors in neighbouring cells of a side have less in common than one with itself.
    fn apart(&self, size: usize, x: i32, y: i32) -> f32 {
        let at = |x: i32, y: i32| self.row(Kernel::column(size, x), y, 1)[0][0];
        at(0, 0) - at(x, y)
    }
}

/// A column of a table.
#[derive(Clone, Copy)]
struct Column {
    size: usize,
    first: usize,
    length: usize,
}

/// Cells of one side beside each other in a row of blocks, row by row.
#[derive(Clone, Copy)]
struct Zone {
    size: usize,
    /// First dot from the left, and cells across.
    left: usize,
    columns: usize,
    /// Its first cell in the part.
    start: usize,
}

/// A cell: its row of blocks from the part's first, zone, column and row in the zone.
#[derive(Clone, Copy)]
struct Place {
    row: usize,
    zone: Zone,
    i: usize,
    j: usize,
}

impl Place {
    fn number(&self) -> usize {
        self.zone.start + self.j * self.zone.columns + self.i
    }

    /// Its centre in half dots, from the part's first row.
    fn centre(&self) -> (i32, i32) {
        let Zone { size, left, .. } = self.zone;
        let x = 2 * left + (2 * self.i + 1) * size;
        let y = 2 * self.row * BLOCK + (2 * self.j + 1) * size;
        (x as i32, y as i32)
    }
}

/// The cells of some rows of blocks.
struct Part<'a> {
    kernel: &'a Kernel,
    points: &'a [Point],
    /// By side of cells, [`Kernel::apart`] of neighbours beside each other and of diagonal ones.
    apart: [[f32; 2]; BLOCK + 1],
    /// Zones of each row of blocks.
    zones: Vec<Vec<Zone>>,
    /// The error around each cell, as seen from it.
    seen: Vec<Point>,
    /// The stack of each, or [`FIXED`].
    stack: Vec<u8>,
    /// Stacks with weight on each, one bit each.
    allowed: Vec<u64>,
}

/// Exchanges cells of a page that was printed by cells. `points` are those of the stacks of the field.
pub(super) fn search(field: &Field, plan: &Plan, points: &[Point], index: &mut [u8]) {
    let all = (0..plan.down()).flat_map(|by| (0..plan.across).map(move |bx| plan.size(bx, by)));
    let kernel = Kernel::new(all);
    let down = plan.down();
    let whole = (0..down).step_by(PART).map(|top| top..(top + PART).min(down));
    let ends = (PART..down).step_by(PART).map(|cut| cut - 3 * MARGIN..(cut + 3 * MARGIN).min(down));
    for parts in [whole.collect::<Vec<_>>(), ends.collect()] {
        let (mut rest, mut top, mut tasks) = (&mut *index, 0, Vec::new());
        for rows in parts {
            let row = BLOCK * field.width;
            let (_, below) = rest.split_at_mut((rows.start - top) * row);
            let (dots, below) = below.split_at_mut(((rows.end - rows.start) * row).min(below.len()));
            (rest, top) = (below, rows.end);
            tasks.push((rows, dots));
        }
        tasks.into_par_iter().for_each(|(rows, dots)| {
            let first = if rows.start > 0 { MARGIN } else { 0 };
            let end = rows.len() - if rows.end < down { MARGIN } else { 0 };
            wide(|| {
                let mut part = Part::new(field, plan, points, &kernel, rows, dots);
                for _ in 0..ROUNDS {
                    (first..end).for_each(|row| part.block_row(row));
                }
                part.print(field, dots);
            });
        });
    }
}

impl<'a> Part<'a> {
    /// The cells of some rows of blocks, whose dots these are.
    #[inline(always)]
    fn new(
        field: &Field,
        plan: &Plan,
        points: &'a [Point],
        kernel: &'a Kernel,
        rows: Range<usize>,
        dots: &[u8],
    ) -> Part<'a> {
        let mut apart = [[0.0; 2]; BLOCK + 1];
        for (size, apart) in apart.iter_mut().enumerate().filter(|&(size, _)| !kernel.tables[size].is_empty())
        {
            let step = 2 * size as i32;
            *apart = [kernel.apart(size, step, 0), kernel.apart(size, step, step)];
        }
        let mut part = Part {
            apart,
            kernel,
            points,
            zones: Vec::new(),
            seen: Vec::new(),
            stack: Vec::new(),
            allowed: Vec::new(),
        };
        let mut start = 0;
        for by in rows.clone() {
            let mut zones: Vec<Zone> = Vec::new();
            let mut bx = 0;
            while bx < plan.across {
                let size = plan.size(bx, by);
                let end = (bx..plan.across).find(|&x| plan.size(x, by) != size).unwrap_or(plan.across);
                let columns = (end - bx) * BLOCK / size;
                zones.push(Zone { size, left: bx * BLOCK, columns, start });
                (start, bx) = (start + columns * BLOCK / size, end);
            }
            part.zones.push(zones);
        }
        (part.stack, part.allowed) = (vec![FIXED; start], vec![0; start]);
        let errors = part.errors(field, plan, rows.start, dots);
        part.seen = vec![[0.0; 4]; start];
        part.each_place(0..rows.len(), |part, place| {
            let error = errors[place.number()];
            if error != [0.0; 4] {
                part.around(place, REACH, (0, 0), |seen, own, _| {
                    for (seen, own) in seen.iter_mut().zip(own) {
                        for c in 0..4 {
                            seen[c] += own[c] * error[c];
                        }
                    }
                });
            }
        });
        part
    }

    /// Calls `with` for each cell of these rows of blocks.
    #[inline(always)]
    fn each_place(&mut self, rows: Range<usize>, mut with: impl FnMut(&mut Self, Place)) {
        for row in rows {
            for zone in self.zones[row].clone() {
                for j in 0..BLOCK / zone.size {
                    for i in 0..zone.columns {
                        with(self, Place { row, zone, i, j });
                    }
                }
            }
        }
    }

    /// The error of each cell: what it prints minus what it asks for. Notes its stack and those it may have.
    #[inline(always)]
    fn errors(&mut self, field: &Field, plan: &Plan, top: usize, dots: &[u8]) -> Vec<Point> {
        let number: Vec<u8> = (0..=u8::MAX)
            .map(|stack| field.stacks.iter().position(|&known| known == stack).map_or(FIXED, |q| q as u8))
            .collect();
        let mut errors = vec![[0.0; 4]; self.stack.len()];
        let mut lines: Vec<Row> = (0..=BLOCK).map(|_| Row::default()).collect();
        let mut want = vec![0.0; field.lanes];
        self.each_place(0..self.zones.len(), |part, place| {
            let Zone { size, left, .. } = place.zone;
            let (x, y) = (left + place.i * size, (top + place.row) * BLOCK + place.j * size);
            if x >= field.width || y >= field.height || !plan.is_whole(x, y) {
                return;
            }
            field.row(size, y / size, &mut lines[size]);
            field.cell(size, x / size, &mut lines[size], &mut want);
            let q = number[usize::from(dots[(y - top * BLOCK) * field.width + x])];
            let mut error = part.points[usize::from(q)].map(|coordinate| (size * size) as f32 * coordinate);
            for (point, &want) in part.points.iter().zip(&want) {
                for (error, coordinate) in error.iter_mut().zip(point) {
                    *error -= want * coordinate;
                }
            }
            let at = place.number();
            errors[at] = error;
            if q < 64 && plan.owned((y * field.width + x) as u32).next().is_none() {
                part.stack[at] = q;
                let here = want.iter().take(64).enumerate().filter(|&(_, &want)| want > 0.0);
                part.allowed[at] = here.fold(0, |all, (q, _)| all | 1 << q);
            }
        });
        errors
    }

    /// Calls `with` for each row of cells up to `reach` dots from a place: what they see, the kernel about the place, and
    /// the kernel about one that is `(right, below)` half dots from there.
    #[inline(always)]
    fn around(
        &mut self,
        place: Place,
        reach: usize,
        (right, below): (i32, i32),
        mut with: impl FnMut(&mut [Point], &[Point], &[Point]),
    ) {
        let (cx, cy) = place.centre();
        let (blocks, reach) = (reach.div_ceil(BLOCK), 2 * reach as i32);
        let rows = place.row.saturating_sub(blocks)..(place.row + blocks + 1).min(self.zones.len());
        for row in rows {
            for &zone in &self.zones[row] {
                // The cells whose centre is within reach on either side.
                let (left, step) = ((2 * zone.left + zone.size) as i32 - cx, 2 * zone.size as i32);
                let from = (-reach - left + step - 1).div_euclid(step).clamp(0, zone.columns as i32);
                let end = ((reach - left).div_euclid(step) + 1).clamp(from, zone.columns as i32);
                if from == end {
                    continue;
                }
                let x = left + from * step;
                let own = Kernel::column(zone.size, x);
                let other = Kernel::column(zone.size, x - right);
                let (top, count) = ((2 * row * BLOCK + zone.size) as i32 - cy, BLOCK / zone.size);
                for j in 0..count {
                    let y = top + step * j as i32;
                    if y.abs() <= reach {
                        let line = zone.start + j * zone.columns;
                        let seen = &mut self.seen[line + from as usize..line + end as usize];
                        let count = seen.len();
                        with(seen, self.kernel.row(own, y, count), self.kernel.row(other, y - below, count));
                    }
                }
            }
        }
    }

    /// The place one cell to a side, if there are cells of the same side.
    fn beside(&self, place: Place, dx: isize, dy: isize) -> Option<Place> {
        let (zone, count) = (place.zone, BLOCK / place.zone.size);
        let x = (zone.left / zone.size + place.i).checked_add_signed(dx)?;
        let j = (place.row * count + place.j).checked_add_signed(dy)?;
        let row = j / count;
        let zone = if row == place.row {
            zone
        } else {
            let zones = self.zones.get(row)?;
            let at = zones.partition_point(|zone| zone.left <= x * place.zone.size);
            *zones.get(at.checked_sub(1)?)?
        };
        let i = x.checked_sub(zone.left / zone.size)?;
        (zone.size == place.zone.size && i < zone.columns).then_some(Place { row, zone, i, j: j % count })
    }

    #[inline(always)]
    fn block_row(&mut self, row: usize) {
        self.each_place(row..row + 1, |part, place| {
            if part.stack[place.number()] != FIXED {
                part.improve(place);
            }
        });
    }

    /// Makes the exchange of a cell with a neighbour that lessens the error most, if any does.
    #[inline(always)]
    fn improve(&mut self, place: Place) {
        let (at, size) = (place.number(), place.zone.size);
        let (own, seen, allowed) = (self.stack[at], self.seen[at], self.allowed[at]);
        let (area, step, apart) = ((size * size) as f32, 2 * size as i32, self.apart[size]);
        // Differences below what rounding makes of the sums would go round in circles.
        let (mut least, mut best) = (-1e-5 * area, None);
        let inner =
            place.i > 0 && place.i + 1 < place.zone.columns && place.j > 0 && (place.j + 1) * size < BLOCK;
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let there = if inner {
                let (i, j) = (place.i.wrapping_add_signed(dx), place.j.wrapping_add_signed(dy));
                Place { i, j, ..place }
            } else if let Some(there) = self.beside(place, dx, dy) {
                there
            } else {
                continue;
            };
            let b = there.number();
            let other = self.stack[b];
            if other == own || other == FIXED || allowed >> other & self.allowed[b] >> own & 1 == 0 {
                continue;
            }
            let (from, to) = (self.points[usize::from(own)], self.points[usize::from(other)]);
            let (mut linear, mut square) = (0.0, 0.0);
            for c in 0..4 {
                let d = to[c] - from[c];
                linear += d * (seen[c] - self.seen[b][c]);
                square += d * d;
            }
            let apart = apart[usize::from(dx != 0 && dy != 0)];
            let change = 2.0 * area * linear + 2.0 * area * area * square * apart;
            if change < least {
                (least, best) = (change, Some((there, (dx as i32 * step, dy as i32 * step))));
            }
        }
        if let Some((there, apart)) = best {
            let b = there.number();
            let (from, to) = (self.points[usize::from(own)], self.points[usize::from(self.stack[b])]);
            self.stack.swap(at, b);
            let error: Point = std::array::from_fn(|c| area * (to[c] - from[c]));
            self.around(place, NEAR, apart, |seen, own, other| {
                for ((seen, own), other) in seen.iter_mut().zip(own).zip(other) {
                    for c in 0..4 {
                        seen[c] += (own[c] - other[c]) * error[c];
                    }
                }
            });
        }
    }

    /// Prints the cells on the rows of the page that they are.
    fn print(&mut self, field: &Field, dots: &mut [u8]) {
        self.each_place(0..self.zones.len(), |part, place| {
            let stack = part.stack[place.number()];
            if stack != FIXED {
                let Zone { size, left, .. } = place.zone;
                let corner = (place.row * BLOCK + place.j * size) * field.width + left + place.i * size;
                for row in dots[corner..].chunks_mut(field.width).take(size) {
                    row[..size].fill(field.stacks[usize::from(stack)]);
                }
            }
        });
    }
}
