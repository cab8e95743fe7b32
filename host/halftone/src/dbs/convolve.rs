//! What all cells see before the first exchange: their errors, convolved with the [kernel](super::kernel).
//!
//! Problem: each of a million errors is seen from five hundred cells.
//! Method: among cells of one side it is a convolution. Each row of errors, with zeros around it, is added to each row of cells within
//! reach, [`BESIDE`] cells at a time, which stay in the first cache for all taps.
//! Cost: (2 REACH / side)^2 products of four a cell, two of them at once.
//! Limits: the halves of a cell are one error at its centre; cells of different sides are left to [`Part::around`](super::Part::around).

use super::kernel::Kernel;
use super::{BLOCK, Point, REACH, Zone};
use crate::clustered::cell::Cell;

/// Cells of which sums and errors take 8 kB. The loop over them is long enough to be compiled to vectors.
const BESIDE: usize = 256;

/// Adds to what each cell sees the errors of all cells of its side.
#[inline(always)]
pub(super) fn convolve(
    kernel: &Kernel,
    zones: &[Vec<Zone>],
    errors: &[(Cell, [Point; 2])],
    seen: &mut [Point],
) {
    let mut padded: Vec<f32> = Vec::new();
    for (row, here) in zones.iter().enumerate() {
        for &zone in here {
            for j in 0..BLOCK / zone.size {
                let first = zone.start + j * zone.columns;
                let zeros = 2 * (REACH / zone.size);
                padded.clear();
                padded.resize(4 * zeros, 0.0);
                for (_, [one, other]) in &errors[first..first + zone.columns] {
                    padded.extend((0..4).map(|c| one[c] + other[c]));
                }
                padded.resize(4 * (zone.columns + 2 * zeros), 0.0);
                add_row((kernel, zones, seen), (zone, row * BLOCK + j * zone.size), &padded);
            }
        }
    }
}

/// Adds a row of errors, `y` dots from the top, with zeros for twice the reach before and behind it.
#[inline(always)]
fn add_row(
    (kernel, zones, seen): (&Kernel, &[Vec<Zone>], &mut [Point]),
    (zone, y): (Zone, usize),
    padded: &[f32],
) {
    let (size, reach) = (zone.size, REACH / zone.size);
    let column = Kernel::column(size, -2 * (reach * size) as i32);
    let blocks = y.saturating_sub(REACH) / BLOCK..((y + REACH) / BLOCK + 1).min(zones.len());
    for row in blocks {
        for there in zones[row].iter().filter(|there| there.size == size) {
            // From the first error to the first cell, in cells.
            let apart = (there.left / size) as isize - (zone.left / size) as isize;
            let from = (-(reach as isize) - apart).clamp(0, there.columns as isize) as usize;
            let end =
                (zone.columns as isize + reach as isize - apart).clamp(from as isize, there.columns as isize);
            for j in 0..BLOCK / size {
                let down = (row * BLOCK + j * size).abs_diff(y);
                if down > REACH {
                    continue;
                }
                let taps = kernel.row(column, 2 * down as i32, 2 * reach + 1);
                let line = there.start + j * there.columns;
                let cells = seen[line + from..line + end as usize].chunks_mut(BESIDE);
                for (at, cells) in cells.enumerate() {
                    let first = (from + at * BESIDE) as isize + apart + reach as isize;
                    let errors = padded[4 * first as usize..].windows(4 * cells.len()).step_by(4);
                    for (tap, errors) in taps.iter().zip(errors) {
                        for (seen, error) in cells.as_flattened_mut().iter_mut().zip(errors) {
                            *seen += tap * error;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zones of several sides, errors drawn at random: against the sum over all pairs of cells.
    #[test]
    fn what_is_seen_is_the_sum_of_all_errors_within_reach() {
        let sides: [&[(usize, usize)]; 6] = [
            &[(4, 9)],
            &[(4, 2), (3, 3), (4, 4)],
            &[(4, 9)],
            &[(3, 9)],
            &[(4, 1), (3, 2), (4, 6)],
            &[(4, 9)],
        ];
        let kernel = Kernel::new([3, 4].into_iter());
        let (mut zones, mut start) = (Vec::new(), 0);
        for row in sides {
            let (mut all, mut left) = (Vec::new(), 0);
            for &(size, blocks) in row {
                let columns = blocks * BLOCK / size;
                all.push(Zone { size, left, columns, start });
                (start, left) = (start + columns * BLOCK / size, left + blocks * BLOCK);
            }
            zones.push(all);
        }
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut error = || [[0; 4], [0; 4]].map(|half| half.map(|_| random()));
        let errors: Vec<(Cell, [Point; 2])> = (0..start).map(|_| (Cell::whole(0), error())).collect();
        // Side, centre in half dots.
        let mut places = vec![(0, 0, 0); start];
        for (row, zone) in
            zones.iter().enumerate().flat_map(|(row, all)| all.iter().map(move |zone| (row, zone)))
        {
            for at in 0..zone.columns * BLOCK / zone.size {
                let (i, j) = (at % zone.columns, at / zone.columns);
                let centre = |first: usize, at: usize| (2 * first + (2 * at + 1) * zone.size) as isize;
                places[zone.start + at] = (zone.size, centre(zone.left, i), centre(row * BLOCK, j));
            }
        }
        let mut seen = vec![[0.0; 4]; start];
        convolve(&kernel, &zones, &errors, &mut seen);
        for (at, &(size, x, y)) in places.iter().enumerate() {
            let mut wanted = [0.0f64; 4];
            for (from, &(other, u, v)) in places.iter().enumerate() {
                let (across, down) = ((x - u).abs(), (y - v).abs());
                if other == size && across.max(down) <= 2 * REACH as isize {
                    for c in 0..4 {
                        let error = errors[from].1.iter().map(|half| f64::from(half[c])).sum::<f64>();
                        wanted[c] += error * f64::from(Kernel::value(across, down));
                    }
                }
            }
            for c in 0..4 {
                assert!((f64::from(seen[at][c]) - wanted[c]).abs() < 1e-3, "{at}: {:?} {wanted:?}", seen[at]);
            }
        }
    }
}
