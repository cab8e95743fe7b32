//! Errors summed over whole columns and rows of dots, which the search keeps small.
//!
//! Problem: the eye's response ends after thirty dots. An exchange that lessens what is seen leaves the ink of a column of
//! hundreds of dots to chance, or worse: columns of a tint of 10 % swung by 1.23 of what independent cells do.
//! Method: what is printed beyond what is asked is summed for each column over [`HEIGHT`] block rows, and for each row over the
//! page's width. The squares of these sums have a [`PRICE`]. It adds hardly any error, because it asks one thing of hundreds
//! of cells.
//! Cost: six sums to look at for a cell, twelve if it may be cut, and four lines to change with each exchange. Memory: 16 bytes for each column and row of dots of a part.
//! Limits: two halves that share just a half of a cell's columns or rows count as if they shared all of them when a change is
//! weighed. The sums themselves are exact.

use super::{BLOCK, Place, Point};

/// What the square of a sum over a line of dots costs, where the square of an error of one dot in the same
/// place costs 1. Measured: columns of a tint of 10 % swing by 0.63 of what independent cells do; with 0.003
/// by 0.69. With 0.1 by 0.17, and 2 to 5 % more error is seen.
const PRICE: f32 = 0.005;

/// What two errors in cells of a side, so many half dots apart across the lines, have in common.
pub(super) fn common(size: usize, apart: isize) -> f32 {
    if 2 * apart.unsigned_abs() <= size { PRICE / size as f32 } else { 0.0 }
}

/// Columns are summed over so many block rows.
const HEIGHT: usize = 24;

/// The sums of a part, times [`PRICE`].
pub(super) struct Lines {
    /// Of [`HEIGHT`] block rows, of the next ones and so on.
    columns: Vec<Point>,
    rows: Vec<Point>,
    width: usize,
}

/// What the sums add to the error seen from a cell and its eight neighbours: for three columns and three rows of cells that of
/// the first half, of the second, and of both.
pub(super) struct Around {
    columns: [[Point; 3]; 3],
    rows: [[Point; 3]; 3],
}

#[inline(always)]
fn plus(a: Point, b: Point) -> Point {
    std::array::from_fn(|c| a[c] + b[c])
}

impl Around {
    /// For the neighbour so many cells to the right and below, as a whole.
    #[inline(always)]
    pub(super) fn whole(&self, (dx, dy): (isize, isize)) -> Point {
        plus(self.columns[(dx + 1) as usize][2], self.rows[(dy + 1) as usize][2])
    }

    /// For its halves side by side, then one above the other.
    #[inline(always)]
    pub(super) fn halves(&self, (dx, dy): (isize, isize)) -> [[Point; 2]; 2] {
        let ([left, right, across], [upper, lower, down]) =
            (self.columns[(dx + 1) as usize], self.rows[(dy + 1) as usize]);
        [[plus(left, down), plus(right, down)], [plus(across, upper), plus(across, lower)]]
    }
}

impl Lines {
    /// For a page of so many dots across, and so many rows of blocks.
    pub(super) fn new(width: usize, rows: usize) -> Lines {
        let width = width.next_multiple_of(BLOCK);
        let columns = vec![[0.0; 4]; rows.div_ceil(HEIGHT) * width];
        Lines { columns, rows: vec![[0.0; 4]; rows * BLOCK], width }
    }

    /// Takes the columns as they are for even.
    pub(super) fn accept_columns(&mut self) {
        self.columns.fill([0.0; 4]);
    }

    /// Adds the error of a cell or half, whose centre lies `at` half dots from that of the cell at a place.
    #[inline(always)]
    pub(super) fn add(&mut self, place: Place, at: (i32, i32), error: Point) {
        let size = place.zone.size as i32;
        let (x, y) = place.centre();
        let from = (y + at.1) as usize / (2 * BLOCK * HEIGHT) * self.width;
        let columns = &mut self.columns[from..from + self.width];
        for (sums, at, centre) in [(columns, at.0, x), (&mut self.rows[..], at.1, y)] {
            // Halves lie a quarter of a cell beside its centre, and are half as wide.
            let dots = if at % (2 * size) == 0 { size } else { size / 2 };
            let first = (centre + at - dots) / 2;
            let each = error.map(|error| error * (PRICE / dots as f32));
            for sum in &mut sums[first as usize..(first + dots) as usize] {
                *sum = plus(*sum, each);
            }
        }
    }

    /// What the sums add around a place.
    #[inline(always)]
    pub(super) fn around(&self, place: Place) -> Around {
        let size = place.zone.size;
        let from = place.row / HEIGHT * self.width;
        Around {
            columns: three(&self.columns[from..from + self.width], place.zone.left + place.i * size, size),
            rows: three(&self.rows, place.row * BLOCK + place.j * size, size),
        }
    }
}

/// The sums of the halves of three cells, of which the second begins at `first`, and the mean of both. One dot stands for all: they
/// differ only where cells of another side share the line.
#[inline(always)]
fn three(sums: &[Point], first: usize, size: usize) -> [[Point; 3]; 3] {
    let at = |at: usize| sums.get(at).copied().unwrap_or_default();
    std::array::from_fn(|i| {
        // Before the first line this wraps round to where there is none.
        let start = (first + i * size).wrapping_sub(size);
        let other = at(start.wrapping_add(size / 2));
        if !size.is_multiple_of(2) {
            return [other; 3];
        }
        let one = at(start);
        [one, other, plus(one, other).map(|sum| 0.5 * sum)]
    })
}
