//! Direct binary search on cells: neighbours change places while that lessens the error the eye sees.
//!
//! Problem: error diffusion decides each cell once and never looks back, and does not know that black beside white is
//! seen before cyan beside magenta.
//! Method: stacks are points whose distances are those of what they reflect ([`super::eye::Tangent`]). The error of all
//! cells, convolved with the autocorrelation of the eye's response, gives what exchanging two cells would change in a
//! few products (Analoui and Allebach 1992); the best exchange with one of the eight neighbours is made if it lessens
//! the error. Only exchanges, no toggles: every stack keeps its dots, so tones need no term of their own. For the
//! response exp(-f/k) the autocorrelation is known, (1 + (r/a)^2)^(-3/2), a = 1 / (pi k).
//! Strips of block rows are searched at the same time where they do not reach each other, then what lies between them:
//! the dots do not depend on the number of threads.
//! Cost: 4 (2 REACH / 3)^2 products a cell of 3 x 3 dots to begin with, and for each exchange half as many; one
//! exchange for every two cells, [`PASSES`] rounds. Memory: 44 bytes a cell. Limits: four coordinates, those in which
//! stacks differ most, about the page's mean mixture; cells beside edges stay as they are, and so do all stacks after
//! the 64th.

use rayon::prelude::*;

use super::cells::field::{Field, Row};
use super::cells::plan::{BLOCK, Plan};

/// Where a stack lies among all others.
pub(super) type Point = [f32; 4];

/// Rounds over the page; more change little.
const PASSES: usize = 4;

/// How far an error reaches, in dots to each side: less leaves means unseen, and the search makes worse of them.
const REACH: usize = 30;

/// How far an exchange reaches. Its two errors cancel from afar.
const NEAR: usize = 20;

/// From how far the eye looks, in dots: 0.3 m. What is even from near is even from afar.
const SCALE: f32 = 7.62;

/// Block rows in a strip, and how many at each end its neighbours can reach.
const STRIP: usize = 24;
const MARGIN: usize = 2;

/// Not to be exchanged.
const FIXED: u8 = u8::MAX;

/// What the search knows of a cell.
#[derive(Clone, Copy)]
struct Cell {
    /// The error around it, as seen from it.
    seen: Point,
    /// Stacks with weight, one bit each. In halves, to keep a cell at 28 bytes.
    allowed: [u32; 2],
    /// Its stack, or [`FIXED`].
    stack: u8,
}

impl Cell {
    fn allows(&self, stack: u8) -> bool {
        self.allowed[usize::from(stack / 32)] >> (stack % 32) & 1 == 1
    }
}

/// The autocorrelation of the eye's response at distances in half dots.
struct Kernel(Vec<f32>);

impl Kernel {
    const SIDE: usize = 2 * REACH + 1;

    fn new() -> Kernel {
        let square = |half: usize| (half as f32 / 2.0 / SCALE).powi(2);
        let at = |i: usize| {
            let sum = 1.0 + square(i % Kernel::SIDE) + square(i / Kernel::SIDE);
            // Roots are rounded once on every machine; powers of 3/2 are not.
            1.0 / (sum * sum.sqrt())
        };
        Kernel((0..Kernel::SIDE * Kernel::SIDE).map(at).collect())
    }

    fn at(&self, x: isize, y: isize) -> f32 {
        self.0[y.unsigned_abs() * Kernel::SIDE + x.unsigned_abs()]
    }
}

/// The cells of some rows of blocks.
struct Part<'a> {
    plan: &'a Plan,
    kernel: &'a Kernel,
    points: &'a [Point],
    /// First cell of each block of the page.
    start: &'a [usize],
    /// First block row and the one after the last.
    rows: (usize, usize),
    cells: &'a mut [Cell],
}

/// A place for a cell: block across, block down, column and row in it.
type Place = (usize, usize, usize, usize);

/// Calls `with(range of cells, first distance, step of distances, distance down)` for the cells of blocks in `rows`
/// up to `reach` dots from a place; distances in half dots.
fn around(
    plan: &Plan,
    start: &[usize],
    rows: (usize, usize),
    (bx, by, i, j): Place,
    reach: usize,
    mut with: impl FnMut(std::ops::Range<usize>, isize, isize, isize),
) {
    let size = plan.size(bx, by);
    let centre =
        |block: usize, cell: usize, size: usize| (2 * block * BLOCK + (2 * cell + 1) * size) as isize;
    let (cx, cy) = (centre(bx, i, size), centre(by, j, size));
    let blocks = reach.div_ceil(BLOCK);
    let reach = 2 * reach as isize;
    for y in by.saturating_sub(blocks).max(rows.0)..(by + blocks + 1).min(rows.1) {
        for x in bx.saturating_sub(blocks)..(bx + blocks + 1).min(plan.across) {
            let size = plan.size(x, y);
            let count = BLOCK / size;
            // The cells whose centre is within reach on either side.
            let (left, step) = (centre(x, 0, size) - cx, 2 * size as isize);
            let first = (-reach - left + step - 1).div_euclid(step).clamp(0, count as isize);
            let end = ((reach - left).div_euclid(step) + 1).clamp(first, count as isize);
            if first == end {
                continue;
            }
            for row in 0..count {
                let dy = centre(y, row, size) - cy;
                if dy.abs() <= reach {
                    let from = start[y * plan.across + x] + row * count;
                    with(from + first as usize..from + end as usize, left + first * step, step, dy);
                }
            }
        }
    }
}

/// Exchanges cells of a page that was printed by cells. `points` are those of the stacks of the field.
pub(super) fn search(field: &Field, plan: &Plan, points: &[Point], index: &mut [u8]) {
    let kernel = Kernel::new();
    let mut start = vec![0];
    for block in 0..plan.across * plan.down() {
        let count = BLOCK / plan.size(block % plan.across, block / plan.across);
        start.push(start[block] + count * count);
    }
    let mut cells = first_look(field, plan, points, &kernel, &start, index);
    for _ in 0..PASSES {
        let down = plan.down();
        // Strips without their margins, then the margins.
        let strips: Vec<usize> = (STRIP..down.saturating_sub(MARGIN)).step_by(STRIP).collect();
        let cuts: Vec<usize> =
            strips.iter().map(|&row| row.saturating_sub(STRIP / 2)).chain([down]).collect();
        let inner: Vec<usize> = strips.iter().copied().chain([down]).collect();
        let near = |row: usize| strips.iter().any(|&cut| row + MARGIN >= cut && row < cut + MARGIN);
        in_parts(plan, &kernel, points, &start, &inner, &mut cells, |row| !near(row));
        in_parts(plan, &kernel, points, &start, &cuts, &mut cells, near);
    }
    index.par_chunks_mut(BLOCK * field.width).enumerate().for_each(|(by, dots)| {
        for bx in 0..plan.across {
            let size = plan.size(bx, by);
            let count = BLOCK / size;
            for (at, cell) in cells[start[by * plan.across + bx]..][..count * count].iter().enumerate() {
                if cell.stack != FIXED {
                    let corner = at / count * size * field.width + bx * BLOCK + at % count * size;
                    for row in dots[corner..].chunks_mut(field.width).take(size) {
                        row[..size].fill(field.stacks[usize::from(cell.stack)]);
                    }
                }
            }
        }
    });
}

/// Searches the parts that end at these block rows, in those rows that are `mine`.
fn in_parts(
    plan: &Plan,
    kernel: &Kernel,
    points: &[Point],
    start: &[usize],
    ends: &[usize],
    cells: &mut [Cell],
    mine: impl Fn(usize) -> bool + Sync,
) {
    let (mut rest, mut parts, mut top) = (cells, Vec::new(), 0);
    for &end in ends {
        let (cells, below) = rest.split_at_mut(start[end * plan.across] - start[top * plan.across]);
        rest = below;
        parts.push(Part { plan, kernel, points, start, rows: (top, end), cells });
        top = end;
    }
    parts.into_par_iter().for_each(|mut part| {
        for row in part.rows.0..part.rows.1 {
            if mine(row) {
                part.block_row(row);
            }
        }
    });
}

/// The cells as they are, with the error around each.
fn first_look(
    field: &Field,
    plan: &Plan,
    points: &[Point],
    kernel: &Kernel,
    start: &[usize],
    index: &[u8],
) -> Vec<Cell> {
    let number: Vec<u8> = (0..=u8::MAX)
        .map(|stack| field.stacks.iter().position(|&known| known == stack).map_or(FIXED, |q| q as u8))
        .collect();
    let empty = Cell { seen: [0.0; 4], allowed: [0; 2], stack: FIXED };
    let mut cells = vec![empty; start[start.len() - 1]];
    // Errors first, in the place of what is seen.
    by_rows(plan, start, &mut cells).into_par_iter().for_each(|(by, cells)| {
        let mut rows: Vec<Row> = (0..(BLOCK + 1) * BLOCK).map(|_| Row::default()).collect();
        let mut want = vec![0.0; field.lanes];
        for bx in 0..plan.across {
            let size = plan.size(bx, by);
            let count = BLOCK / size;
            let first = start[by * plan.across + bx] - start[by * plan.across];
            for at in 0..count * count {
                let (x, y) = (bx * BLOCK + at % count * size, by * BLOCK + at / count * size);
                if x >= field.width || y >= field.height || !plan.is_whole(x, y) {
                    continue;
                }
                let row = &mut rows[size * BLOCK + at / count];
                field.row(size, y / size, row);
                field.cell(size, x / size, row, &mut want);
                let corner = y * field.width + x;
                let q = number[usize::from(index[corner])];
                let cell = &mut cells[first + at];
                let mut error = points[usize::from(q)].map(|coordinate| (size * size) as f32 * coordinate);
                for (&point, &want) in points.iter().zip(&want) {
                    for (error, coordinate) in error.iter_mut().zip(point) {
                        *error -= want * coordinate;
                    }
                }
                cell.seen = error;
                if q < 64 && plan.owned(corner as u32).next().is_none() {
                    cell.stack = q;
                    for (q, _) in want.iter().take(64).enumerate().filter(|&(_, &want)| want > 0.0) {
                        cell.allowed[q / 32] |= 1 << (q % 32);
                    }
                }
            }
        }
    });
    let errors: Vec<Point> = cells.iter().map(|cell| cell.seen).collect();
    by_rows(plan, start, &mut cells).into_par_iter().for_each(|(by, cells)| {
        for bx in 0..plan.across {
            let count = BLOCK / plan.size(bx, by);
            let first = start[by * plan.across + bx] - start[by * plan.across];
            for at in 0..count * count {
                let mut seen = [0.0; 4];
                let place = (bx, by, at % count, at / count);
                around(plan, start, (0, plan.down()), place, REACH, |range, dx, step, dy| {
                    for (error, i) in errors[range].iter().zip(0..) {
                        let k = kernel.at(dx + i * step, dy);
                        for (seen, error) in seen.iter_mut().zip(error) {
                            *seen += k * error;
                        }
                    }
                });
                cells[first + at].seen = seen;
            }
        }
    });
    cells
}

/// The cells of each block row.
fn by_rows<'a>(plan: &Plan, start: &[usize], cells: &'a mut [Cell]) -> Vec<(usize, &'a mut [Cell])> {
    let (mut rest, mut rows) = (cells, Vec::new());
    for by in 0..plan.down() {
        let (cells, below) = rest.split_at_mut(start[(by + 1) * plan.across] - start[by * plan.across]);
        rest = below;
        rows.push((by, cells));
    }
    rows
}

impl Part<'_> {
    /// The cell at a place, by its number in this part.
    fn number(&self, (bx, by, i, j): Place) -> usize {
        let count = BLOCK / self.plan.size(bx, by);
        self.start[by * self.plan.across + bx] - self.start[self.rows.0 * self.plan.across] + j * count + i
    }

    /// The place one cell to a side, if there are cells of the same size.
    fn beside(&self, (bx, by, i, j): Place, dx: isize, dy: isize) -> Option<Place> {
        let size = self.plan.size(bx, by);
        let count = BLOCK / size;
        let step = |block: usize, cell: usize, d: isize| {
            let at = (block * count + cell).checked_add_signed(d)?;
            Some((at / count, at % count))
        };
        let ((x, i), (y, j)) = (step(bx, i, dx)?, step(by, j, dy)?);
        let here = x < self.plan.across && y >= self.rows.0 && y < self.rows.1;
        (here && self.plan.size(x, y) == size).then_some((x, y, i, j))
    }

    fn block_row(&mut self, by: usize) {
        for bx in 0..self.plan.across {
            let size = self.plan.size(bx, by);
            for j in 0..BLOCK / size {
                for i in 0..BLOCK / size {
                    self.improve((bx, by, i, j), size);
                }
            }
        }
    }

    /// Makes the exchange of a cell with a neighbour that lessens the error most, if any does.
    fn improve(&mut self, place: Place, size: usize) {
        let own = self.cells[self.number(place)];
        if own.stack == FIXED {
            return;
        }
        let (area, step) = ((size * size) as f32, 2 * size as isize);
        let apart = [
            self.kernel.at(0, 0) - self.kernel.at(step, 0),
            self.kernel.at(0, 0) - self.kernel.at(step, step),
        ];
        // Differences below what rounding makes of the sums would go round in circles.
        let (mut least, mut best) = (-1e-5 * area, None);
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let Some(there) = self.beside(place, dx, dy) else { continue };
            let other = &self.cells[self.number(there)];
            if other.stack == own.stack
                || other.stack == FIXED
                || !own.allows(other.stack)
                || !other.allows(own.stack)
            {
                continue;
            }
            let (from, to) = (self.points[usize::from(own.stack)], self.points[usize::from(other.stack)]);
            let (mut linear, mut square) = (0.0, 0.0);
            for c in 0..4 {
                let d = to[c] - from[c];
                linear += d * (own.seen[c] - other.seen[c]);
                square += d * d;
            }
            let change =
                2.0 * area * linear + 2.0 * area * area * square * apart[usize::from(dx != 0 && dy != 0)];
            if change < least {
                (least, best) = (change, Some((there, (dx * step, dy * step))));
            }
        }
        if let Some((there, there_by)) = best {
            let (a, b) = (self.number(place), self.number(there));
            let (from, to) = (own.stack, self.cells[b].stack);
            (self.cells[a].stack, self.cells[b].stack) = (to, from);
            let (from, to) = (self.points[usize::from(from)], self.points[usize::from(to)]);
            let error: Point = std::array::from_fn(|c| area * (to[c] - from[c]));
            self.spread(place, there_by, error);
        }
    }

    /// Adds an error at a place, and its opposite a few half dots from there, to what the cells around see.
    fn spread(&mut self, place: Place, (right, below): (isize, isize), error: Point) {
        let (kernel, first) = (self.kernel, self.start[self.rows.0 * self.plan.across]);
        let cells = &mut *self.cells;
        around(self.plan, self.start, self.rows, place, NEAR, |range, dx, step, dy| {
            for (cell, i) in cells[range.start - first..range.end - first].iter_mut().zip(0..) {
                let x = dx + i * step;
                let k = kernel.at(x, dy) - kernel.at(x - right, dy - below);
                for (seen, error) in cell.seen.iter_mut().zip(error) {
                    *seen += k * error;
                }
            }
        });
    }
}
