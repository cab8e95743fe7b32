//! The matrix of inner products of a set of rows: all that least squares on their hull needs to know about them.
//!
//! Cost: `n^2 / 2` inner products to build. Limits: dense and symmetric; meant for up to a few hundred rows.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::brdf::Table;

use super::vector::dot;

/// Inner products `G_ij = a_i . a_j` of `n` rows.
#[derive(Clone, Debug)]
pub struct Gram {
    n: usize,
    values: Vec<f64>,
    largest: f64,
    shift: f64,
    /// Changes with the values; unique in the process.
    edition: u64,
}

impl Gram {
    /// An empty matrix, to be filled by [`Gram::refill`].
    pub(crate) fn empty() -> Gram {
        Gram { n: 0, values: Vec::new(), largest: 0.0, shift: 1.0, edition: 0 }
    }

    /// The inner products of the rows of a table.
    pub fn of_rows(rows: &Table) -> Gram {
        let mut gram = Gram::empty();
        gram.refill(rows.len(), |i| rows.row(i));
        gram
    }

    /// Replaces the matrix by the inner products of `n` rows of equal length. Does not allocate if it has held as many
    /// rows before.
    #[inline(always)]
    pub(crate) fn refill<'a>(&mut self, n: usize, row: impl Fn(usize) -> &'a [f64]) {
        self.n = n;
        self.values.clear();
        self.values.resize(n * n, 0.0);
        for i in 0..n {
            let a = row(i);
            for j in 0..=i {
                let product = dot(a, row(j));
                self.values[i * n + j] = product;
                self.values[j * n + i] = product;
            }
        }
        self.measure();
    }

    /// Replaces the matrix by `n * n` inner products computed elsewhere, for example in single precision. `product(i, j)` is
    /// called for `j <= i` only and must be finite. Allocates no more than [`Gram::refill`].
    pub(crate) fn refill_products(&mut self, n: usize, product: impl Fn(usize, usize) -> f64) {
        self.n = n;
        self.values.clear();
        self.values.resize(n * n, 0.0);
        for i in 0..n {
            for j in 0..=i {
                let value = product(i, j);
                self.values[i * n + j] = value;
                self.values[j * n + i] = value;
            }
        }
        self.measure();
    }

    #[inline(always)]
    fn measure(&mut self) {
        self.largest = (0..self.n).map(|i| self.values[i * self.n + i]).fold(0.0, f64::max);
        self.shift = if self.largest > 0.0 { self.largest } else { 1.0 };
        static EDITIONS: AtomicU64 = AtomicU64::new(1);
        self.edition = EDITIONS.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Row `i` of the matrix.
    #[inline]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.n..][..self.n]
    }

    /// The largest squared length of a row: the scale of rounding errors.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// A number that differs between matrices of different values, so that a solver recognises one it has seen; 0 if there
    /// are no rows.
    pub(super) fn edition(&self) -> u64 {
        self.edition
    }

    /// A constant to add to every entry. It does not change the problem on the simplex, where the weights sum to one, but
    /// turns affinely independent rows into linearly independent ones.
    pub(super) fn shift(&self) -> f64 {
        self.shift
    }
}
