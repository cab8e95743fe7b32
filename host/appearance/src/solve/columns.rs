//! Rows stored by column, for inner products with all of them at once.
//!
//! Problem: the gradient of every stack costs an inner product each, most of the work of a step; the sum at the end of each
//! keeps vector units from being full.
//! Method: blocks of 16 rows, each stored column by column. A block's sums are one lane a row, and no lane needs another.
//! Cost: one multiplication and one addition a number, about the rate of the processor's vectors from 16 rows on.
//! The order of additions is that of the columns, whatever the width of the vectors, and so is the result.

use crate::brdf::Table;

use crate::wide::wide;

/// Rows of a block: four of the widest vectors that are used, which hides the time an addition takes.
const LANES: usize = 16;

/// Rows stored by column.
#[derive(Clone, Debug)]
pub struct Columns {
    rows: usize,
    /// Block after block, of `columns` x [`LANES`] numbers; rows after the last are 0.
    values: Vec<f64>,
    columns: usize,
}

impl Columns {
    /// The rows of a table.
    pub fn of_rows(table: &Table) -> Columns {
        let (rows, columns) = (table.len(), table.columns());
        let mut values = vec![0.0; rows.next_multiple_of(LANES) * columns];
        for (i, row) in table.rows().enumerate() {
            let block = &mut values[i / LANES * LANES * columns..];
            for (place, &value) in block[i % LANES..].iter_mut().step_by(LANES).zip(row) {
                *place = value;
            }
        }
        Columns { rows, values, columns }
    }

    /// Inner products `h_i = a_i . x` of all rows with `x`, which is as long as a row; `h` has one number a row.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn products(&self, x: &[f64], h: &mut [f64]) {
        wide(
            #[inline(always)]
            || self.multiply(x, h),
        );
    }

    /// [`Columns::products`], to be inlined where wide vectors are in use already.
    #[inline(always)]
    pub(super) fn multiply(&self, x: &[f64], h: &mut [f64]) {
        assert!(x.len() == self.columns && h.len() == self.rows, "one number a column, one a row");
        for (h, block) in h.chunks_mut(LANES).zip(self.values.chunks_exact(LANES * self.columns)) {
            let mut sums = [0.0; LANES];
            for (x, values) in x.iter().zip(block.as_chunks::<LANES>().0) {
                for lane in 0..LANES {
                    sums[lane] += x * values[lane];
                }
            }
            h.copy_from_slice(&sums[..h.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::vector::dot;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn products_are_those_of_the_rows_and_alike_for_any_vectors(
            columns in 1usize..130,
            rows in 1usize..40,
            seed in any::<u64>(),
        ) {
            let mut state = seed;
            let mut number = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            };
            let mut table = Table::new(columns);
            for _ in 0..rows {
                table.push(&(0..columns).map(|_| number()).collect::<Vec<_>>());
            }
            let x: Vec<f64> = (0..columns).map(|_| number()).collect();
            let by_column = Columns::of_rows(&table);
            let (mut plain, mut widest) = (vec![0.0; rows], vec![0.0; rows]);
            by_column.multiply(&x, &mut plain);
            by_column.products(&x, &mut widest);
            prop_assert_eq!(&plain, &widest);
            for (row, h) in table.rows().zip(&plain) {
                prop_assert!((dot(row, &x) - h).abs() < 1e-13);
            }
        }
    }
}
