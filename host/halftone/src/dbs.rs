//! Direct binary search on cells: neighbours change places while that lessens the error the eye sees.
//!
//! Problem: error diffusion decides each cell once and never looks back.
//! Method: stacks are points whose distances are those of what they reflect ([`super::contrast_sensitivity::Tangent`]). The error of all
//! cells, convolved with the autocorrelation of the eye's response ([`Kernel`]), gives what a change would make of it in a
//! few products (Analoui and Allebach 1992). The best change of a cell is made if it lessens the error: it or a half of it
//! changes places with one of its eight neighbours or a half of that, or its own halves are arranged in another way
//! ([`moves`]); each pair is looked at once a round. So every stack keeps its dots, and tones need no term of their own: what the
//! diffusion dropped is brought back after the first round ([`correct_tones`]).
//! Whole columns and rows are kept even by a small price on their sums ([`lines`]).
//! Parts of at most [`PART`] block rows are searched at the same time, each but for its [`MARGIN`] rows at either end, which are
//! only looked at; then parts that lie over the ends of these. The dots do not depend on the number of threads.
//! Cost: (2 REACH / 3)^2 vectors of four a cell of 3 x 3 dots to begin with ([`convolve`]), and two fifths of that for each change, of which
//! there is about one for four cells. Memory: 63 bytes a cell of the parts at work, 37 MB a thread for A4 in cells of 3 x 3.
//! Limits: four coordinates, those in which stacks differ most, about the page's mean mixture; cells beside edges stay
//! as they are, and so do all stacks after the 64th. What is seen from a half is interpolated between cells.

mod convolve;
mod correct_tones;
mod kernel;
mod lines;
mod moves;

use std::ops::Range;

use rayon::prelude::*;

use appearance::wide::wide;

use super::clustered::cell::{Cell, fits_half};
use super::clustered::field::{Field, Row};
use super::clustered::mask::BLOCK;
use super::clustered::plan::Plan;

use kernel::Kernel;
use lines::Lines;

/// Where a stack lies among all others.
pub(super) type Point = [f32; 4];

/// Rounds over a part, as measured: three more change less than 1 %.
const ROUNDS: usize = 5;

/// How far an error reaches, in dots to each side: less leaves means unseen, and the search makes worse of them.
const REACH: usize = 47;

/// How far an exchange reaches: its two errors cancel from afar, so that beyond it nothing would change.
const NEAR: usize = 30;

/// How far the halves of a cell are two errors; beyond they are one at its centre, for a half of a cell of 4
/// x 4 is seen there as its centre is, but for two hundredths of itself.
const CLOSE: usize = 16;

/// The most block rows in a part, and how many at each end belong to its neighbours: more than an error reaches.
const PART: usize = 48;
const MARGIN: usize = 2;

/// No stack that is searched.
const UNKNOWN: u8 = u8::MAX;

/// Not to be changed.
const FIXED: Cell = Cell { halves: [UNKNOWN; 2], stacked: false };

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

    /// The centres of its halves in half dots from its own, one above the other or side by side.
    fn halves(&self, stacked: bool) -> [(i32, i32); 2] {
        let half = self.zone.size as i32 / 2;
        if stacked { [(0, -half), (0, half)] } else { [(-half, 0), (half, 0)] }
    }
}

/// The cells of some rows of blocks.
struct Part<'a> {
    kernel: &'a Kernel,
    points: &'a [Point],
    /// By side of cells, the stacks of which half a cell holds the minimum cluster, one bit each.
    small: [u64; BLOCK + 1],
    /// Zones of each row of blocks.
    zones: Vec<Vec<Zone>>,
    /// The error around each cell, as seen from it.
    seen: Vec<Point>,
    /// What each prints, or [`FIXED`].
    cells: Vec<Cell>,
    /// Stacks with weight on each, one bit each.
    allowed: Vec<u64>,
    /// Dots of tones that each stack prints beyond what is asked.
    beyond: Vec<f64>,
    lines: Lines,
}

/// Exchanges cells of a page that was printed by cells. `points` are those of the stacks of the field.
pub(super) fn search(field: &Field, plan: &Plan, points: &[Point], minimum: &[u16], index: &mut [u8]) {
    let all = (0..plan.down()).flat_map(|by| (0..plan.across).map(move |bx| plan.size(bx, by)));
    let kernel = Kernel::new(all);
    let small = std::array::from_fn(|size| {
        let small = |&(_, &minimum): &(usize, &u16)| fits_half(minimum, size);
        minimum.iter().take(64).enumerate().filter(small).fold(0, |all, (q, _)| all | 1u64 << q)
    });
    let down = plan.down();
    // As many for each of two threads.
    let part = down.div_ceil(down.div_ceil(PART).next_multiple_of(2)).max(6 * MARGIN);
    let whole = (0..down).step_by(part).map(|top| top..(top + part).min(down));
    let ends = (part..down).step_by(part).map(|cut| cut - 3 * MARGIN..(cut + 3 * MARGIN).min(down));
    for (parts, again) in [(whole.collect::<Vec<_>>(), false), (ends.collect(), true)] {
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
            wide(
                #[inline(always)]
                || {
                    let mut part = Part::new(field, plan, (points, small), &kernel, rows, dots);
                    if again {
                        // They are even over the whole parts, of which these rows are a piece.
                        part.lines.accept_columns();
                    }
                    for round in 0..ROUNDS {
                        for row in first..end {
                            part.block_row(row);
                        }
                        if round == 0 && !again {
                            part.correct_tones(first..end);
                        }
                    }
                    part.print(field, dots);
                },
            );
        });
    }
}

impl<'a> Part<'a> {
    /// The cells of some rows of blocks, whose dots these are.
    #[inline(always)]
    fn new(
        field: &Field,
        plan: &Plan,
        (points, small): (&'a [Point], [u64; BLOCK + 1]),
        kernel: &'a Kernel,
        rows: Range<usize>,
        dots: &[u8],
    ) -> Part<'a> {
        let mut part = Part {
            small,
            kernel,
            points,
            zones: Vec::new(),
            seen: Vec::new(),
            cells: Vec::new(),
            allowed: Vec::new(),
            beyond: vec![0.0; field.lanes],
            lines: Lines::new(field.width, rows.len()),
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
        (part.cells, part.allowed) = (vec![FIXED; start], vec![0; start]);
        let errors = part.errors(field, plan, rows.start, dots);
        part.seen = vec![[0.0; 4]; start];
        convolve::convolve(kernel, &part.zones, &errors, &mut part.seen);
        let mixed = part.zones.iter().flatten().any(|zone| zone.size != part.zones[0][0].size);
        part.each_place(
            0..rows.len(),
            #[inline(always)]
            |part, place| {
                let (cell, errors) = errors[place.number()];
                if errors == [[0.0; 4]; 2] {
                    return;
                }
                let [first, second] = errors;
                let error: Point = std::array::from_fn(|c| first[c] + second[c]);
                if mixed {
                    part.around(
                        place,
                        (REACH, place.zone.size),
                        [(0, 0)],
                        #[inline(always)]
                        |seen, [centre]| {
                            for (seen, centre) in seen.iter_mut().zip(centre) {
                                for c in 0..4 {
                                    seen[c] += centre * error[c];
                                }
                            }
                        },
                    );
                }
                if !cell.is_split() {
                    return part.lines.add(place, (0, 0), error);
                }
                let [one, other] = place.halves(cell.stacked);
                part.lines.add(place, one, first);
                part.lines.add(place, other, second);
                part.around(
                    place,
                    (CLOSE, 0),
                    [one, other, (0, 0)],
                    #[inline(always)]
                    |seen, [one, other, centre]| {
                        let kernels = one.iter().zip(other).zip(centre);
                        for (seen, ((one, other), centre)) in seen.iter_mut().zip(kernels) {
                            for c in 0..4 {
                                seen[c] += (one - centre) * first[c] + (other - centre) * second[c];
                            }
                        }
                    },
                );
            },
        );
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

    /// What each cell prints, and the error of its halves: what they print minus what they ask for. Notes what may be
    /// changed, and the stacks that each may have.
    #[inline(always)]
    fn errors(&mut self, field: &Field, plan: &Plan, top: usize, dots: &[u8]) -> Vec<(Cell, [Point; 2])> {
        let mut number = [UNKNOWN; 256];
        for (q, &stack) in field.stacks.iter().enumerate() {
            number[usize::from(stack)] = q as u8;
        }
        let mut errors = vec![(FIXED, [[0.0; 4]; 2]); self.cells.len()];
        let mut lines: Vec<Row> = (0..=BLOCK).map(|_| Row::default()).collect();
        let (mut want, mut scratch) = (vec![0.0; field.lanes], Vec::new());
        self.each_place(
            0..self.zones.len(),
            #[inline(always)]
            |part, place| {
                let Zone { size, left, .. } = place.zone;
                let (x, y) = (left + place.i * size, (top + place.row) * BLOCK + place.j * size);
                if x >= field.width || y >= field.height {
                    return;
                }
                if !plan.is_whole(x, y) {
                    want.fill(0.0);
                    for y in y..(y + size).min(field.height) {
                        for x in (x..(x + size).min(field.width)).filter(|&x| plan.is_tone(x, y)) {
                            field.add_dot(x, y, &mut scratch, &mut want);
                            part.count(number[usize::from(dots[(y - top * BLOCK) * field.width + x])], 1.0);
                        }
                    }
                    return part.ask(&want);
                }
                field.row(size, y / size, &mut lines[size]);
                field.cell(size, x / size, &mut lines[size], &mut want);
                let corner = (y - top * BLOCK) * field.width + x;
                let cell = Cell::read(&dots[corner..], field.width, size, &number);
                for stack in cell.halves {
                    part.count(stack, 0.5 * (size * size) as f64);
                }
                part.ask(&want);
                let mut halves = cell.halves.map(|q| {
                    part.points[usize::from(q)].map(|coordinate| 0.5 * (size * size) as f32 * coordinate)
                });
                for (point, &want) in part.points.iter().zip(&want) {
                    for c in 0..4 {
                        halves[0][c] -= 0.5 * want * point[c];
                        halves[1][c] -= 0.5 * want * point[c];
                    }
                }
                let at = place.number();
                errors[at] = (cell, halves);
                if cell.halves.iter().all(|&q| q < 64)
                    && plan.owned((y * field.width + x) as u32).next().is_none()
                {
                    part.cells[at] = cell;
                    let here = want.iter().take(64).enumerate().filter(|&(_, &want)| want > 0.0);
                    part.allowed[at] = here.fold(0, |all, (q, _)| all | 1 << q);
                }
            },
        );
        errors
    }

    /// Counts dots that a stack prints.
    #[inline(always)]
    fn count(&mut self, stack: u8, dots: f64) {
        if let Some(beyond) = self.beyond.get_mut(usize::from(stack)) {
            *beyond += dots;
        }
    }

    /// Takes what is asked off what is printed.
    #[inline(always)]
    fn ask(&mut self, want: &[f32]) {
        for (beyond, &want) in self.beyond.iter_mut().zip(want) {
            *beyond -= f64::from(want);
        }
    }

    /// Calls `with` for each row of cells up to `reach` dots from a place: what they see, and the kernel about some points,
    /// which are so many half dots to the right of the place and below. Cells of the side `but` are left out.
    #[inline(always)]
    fn around<const N: usize>(
        &mut self,
        place: Place,
        (reach, but): (usize, usize),
        ends: [(i32, i32); N],
        mut with: impl FnMut(&mut [Point], [&[f32]; N]),
    ) {
        let (cx, cy) = place.centre();
        let (blocks, reach) = (reach.div_ceil(BLOCK), 2 * reach as i32);
        let rows = place.row.saturating_sub(blocks)..(place.row + blocks + 1).min(self.zones.len());
        for row in rows {
            for &zone in self.zones[row].iter().filter(|zone| zone.size != but) {
                // The cells whose centre is within reach on either side.
                let (left, step) = ((2 * zone.left + zone.size) as i32 - cx, 2 * zone.size as i32);
                let from = (-reach - left + step - 1).div_euclid(step).clamp(0, zone.columns as i32);
                let end = ((reach - left).div_euclid(step) + 1).clamp(from, zone.columns as i32);
                if from == end {
                    continue;
                }
                let x = left + from * step;
                let columns = ends.map(|(right, _)| Kernel::column(zone.size, x - right));
                let (top, count) = ((2 * row * BLOCK + zone.size) as i32 - cy, BLOCK / zone.size);
                for j in 0..count {
                    let y = top + step * j as i32;
                    if y.abs() <= reach {
                        let line = zone.start + j * zone.columns;
                        let seen = &mut self.seen[line + from as usize..line + end as usize];
                        let count = seen.len();
                        let row = |end: usize| self.kernel.row(columns[end], y - ends[end].1, count);
                        with(seen, std::array::from_fn(row));
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
        self.each_place(
            row..row + 1,
            #[inline(always)]
            |part, place| {
                if part.cells[place.number()] != FIXED {
                    part.improve(place);
                }
            },
        );
    }

    /// Prints the cells on the rows of the page that they are.
    fn print(&mut self, field: &Field, dots: &mut [u8]) {
        self.each_place(0..self.zones.len(), |part, place| {
            let cell = part.cells[place.number()];
            if cell != FIXED {
                let Zone { size, left, .. } = place.zone;
                let corner = (place.row * BLOCK + place.j * size) * field.width + left + place.i * size;
                cell.print(&mut dots[corner..], field.width, size, &field.stacks);
            }
        });
    }
}
