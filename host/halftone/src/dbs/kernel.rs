//! What errors in two cells have in common for the eye: the autocorrelation of its response, in tables.
//!
//! Problem: a search asks for it some thousand times a cell.
//! Method: for the response exp(-f/k) it is (1 + (r/a)^2)^(-3/2) / a^2 but for a constant, a = 1 / (pi k). The sum of two such
//! looks from two distances at once. Centres of cells and halves lie on half dots.
//! Memory: 100 kB for each side of cells, of which a search in cells of one side reads a quarter.

use super::{REACH, lines};
use crate::clustered::mask::BLOCK;
use maths::Maths;

/// From how far the eye looks, `a` in dots: 0.3 m and 0.5 m.
const SCALES: [f32; 2] = [7.62, 12.7];

/// What the far eye's term is at distance 0, where the near one's is 1. Equal eyes would have (7.62 / 12.7)^2
/// = 0.36. Measured: with more of the far one as much is seen from 0.5 m, and more from 0.3 m.
const FAR: f32 = 0.5;

/// The autocorrelation of the eye's response in rows: for cells of one side, its values at
/// distances of `phase`, `phase` + 2 sides and so on, in half dots.
pub(super) struct Kernel {
    /// By side of the cells that see.
    tables: Vec<Vec<f32>>,
    /// By side, values at distances up to three sides across and down, in half dots, with what columns and rows add.
    near: Vec<Vec<f32>>,
}

impl Kernel {
    /// Distances down: 0 to this, in half dots: as far as an error reaches, from the centre of a half.
    const DOWN: usize = 2 * REACH + BLOCK / 2;

    pub(super) fn new(sizes: impl Iterator<Item = usize>) -> Kernel {
        let mut tables = vec![Vec::new(); BLOCK + 1];
        let mut near = vec![Vec::new(); BLOCK + 1];
        for size in sizes.filter(|&size| size > 0) {
            if tables[size].is_empty() {
                tables[size] = Kernel::table(size);
                let places =
                    (0..=3 * size as isize).flat_map(|y| (0..=3 * size as isize).map(move |x| (x, y)));
                near[size] = places
                    .map(|(x, y)| Kernel::value(x, y) + lines::common(size, x) + lines::common(size, y))
                    .collect();
            }
        }
        Kernel { tables, near }
    }

    /// Distances to either side in steps.
    fn half(size: usize) -> usize {
        REACH / size + 2
    }

    /// The value at a distance in half dots.
    pub(super) fn value(x: isize, y: isize) -> f32 {
        let eye = |scale: f32| {
            let square = |half_dots: isize| (half_dots as f32 / 2.0 / scale).squared();
            let sum = 1.0 + square(x) + square(y);
            // Roots are rounded once on every machine; powers of 3/2 are not.
            1.0 / (sum * sum.sqrt())
        };
        (eye(SCALES[0]) + FAR * eye(SCALES[1])) / (1.0 + FAR)
    }

    fn table(size: usize) -> Vec<f32> {
        let (half, step) = (Kernel::half(size) as isize, 2 * size as isize);
        let mut table = Vec::with_capacity(2 * size * (Kernel::DOWN + 1) * (2 * Kernel::half(size) + 1));
        for phase in 0..step {
            for down in 0..=Kernel::DOWN as isize {
                for i in -half..=half {
                    table.push(Kernel::value(phase + i * step, down));
                }
            }
        }
        table
    }

    /// Where the values begin for cells of a side of which the first lies `x` half dots to the right.
    #[inline(always)]
    pub(super) fn column(size: usize, x: i32) -> Column {
        let (half, step) = (Kernel::half(size), 2 * size as i32);
        let (steps, phase) = (x.div_euclid(step), x.rem_euclid(step) as usize);
        let first = phase * (Kernel::DOWN + 1) * (2 * half + 1);
        Column { size, first: first + (steps + half as i32) as usize, length: 2 * half + 1 }
    }

    /// Values for `count` cells from there, all `y` half dots below.
    #[inline(always)]
    pub(super) fn row(&self, column: Column, y: i32, count: usize) -> &[f32] {
        let first = column.first + y.unsigned_abs() as usize * column.length;
        &self.tables[column.size][first..first + count]
    }

    /// How much two errors so many half dots apart, in neighbouring cells of a side, have in common.
    #[inline(always)]
    pub(super) fn near(&self, size: usize, (x, y): (i32, i32)) -> f32 {
        self.near[size][y.unsigned_abs() as usize * (3 * size + 1) + x.unsigned_abs() as usize]
    }
}

/// A column of a table.
#[derive(Clone, Copy)]
pub(super) struct Column {
    size: usize,
    first: usize,
    length: usize,
}
