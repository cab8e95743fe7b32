//! The supports that the pixels of a document have in common, each factored once.
//!
//! Problem: the solutions of thousands of pixels have a few dozen supports among them (52 for 4096 pixels of rusty metal and
//! 15 stacks, 98 for 57 stacks), and factoring the Gram matrix on a support costs more than a solution with the factor.
//! Method: a table of supports with their factors, and from each the way to its neighbours, which have one point more or less.
//! Cost: `O(p^3)` for a new support of p points, one look-up for a known one. Memory: `8 p^2 + 4 n` bytes each.
//! Limits: a support whose points depend on each other, or with more than [`MOST_POINTS`], has no factor.
//! Source: Van Benthem & Keenan 2004, who share factors among non-negative least squares with equal supports.

use std::collections::HashMap;

use super::gram::Gram;
use super::vector::dot_short;

/// The most points of a support that is factored: enough, for mixtures have three to eight.
pub(super) const MOST_POINTS: usize = 24;
/// Squared relative distance to the hull of the others below which a point counts as dependent on them. Here factors have to be
/// good enough for a single solution; a solver that corrects itself does the rest.
const PIVOT_FLOOR: f64 = 1e-12;

/// Not looked up yet, and not factored, in [`Support::next`].
const UNKNOWN: u32 = u32::MAX;
const NONE: u32 = u32::MAX - 1;

/// A support and its factor.
#[derive(Clone, Debug)]
pub(super) struct Support {
    /// The points in ascending order, so that the factor does not depend on the way to it.
    pub points: Vec<u32>,
    /// Lower Cholesky factor of the shifted Gram matrix on the points, row after row, diagonal inverted.
    pub factor: Vec<f64>,
    /// `factor^-1` times the vector of ones, and one over its squared length.
    pub ones: Vec<f64>,
    pub per_ones: f64,
    /// For each point of the hull, the support with it added or removed.
    next: Vec<u32>,
}

/// Row `i` of a factor, with the diagonal.
#[inline(always)]
pub(super) fn row(factor: &[f64], i: usize) -> &[f64] {
    &factor[i * (i + 1) / 2..][..=i]
}

/// The supports met so far. Their numbers count from 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Supports {
    all: Vec<Support>,
    known: HashMap<Vec<u32>, u32>,
}

impl Supports {
    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn get(&self, number: u32) -> &Support {
        &self.all[number as usize]
    }

    /// The number of the support with these points, in ascending order; `None` if it has no factor.
    pub fn index_of(&mut self, gram: &Gram, points: Vec<u32>) -> Option<u32> {
        let number = match self.known.get(&points) {
            Some(&number) => number,
            None => {
                let number = match Support::new(gram, &points) {
                    Some(support) => {
                        self.all.push(support);
                        self.all.len() as u32 - 1
                    }
                    None => NONE,
                };
                self.known.insert(points, number);
                number
            }
        };
        (number != NONE).then_some(number)
    }

    /// The support with point `k` added if it is not there, removed if it is.
    pub fn toggled(&mut self, gram: &Gram, number: u32, k: u32) -> Option<u32> {
        let support = &self.all[number as usize];
        let mut next = support.next[k as usize];
        if next == UNKNOWN {
            let mut points = support.points.clone();
            match points.binary_search(&k) {
                Ok(i) => _ = points.remove(i),
                Err(i) => points.insert(i, k),
            }
            next = self.index_of(gram, points).unwrap_or(NONE);
            self.all[number as usize].next[k as usize] = next;
        }
        (next != NONE).then_some(next)
    }

    /// Forgets all but the first.
    pub fn truncate(&mut self, first: usize) {
        self.all.truncate(first);
        self.known.retain(|_, &mut number| (number as usize) < first);
        for next in self.all.iter_mut().flat_map(|support| &mut support.next) {
            if *next as usize >= first {
                *next = UNKNOWN;
            }
        }
    }
}

impl Support {
    fn new(gram: &Gram, points: &[u32]) -> Option<Support> {
        let p = points.len();
        if p == 0 || p > MOST_POINTS {
            return None;
        }
        let mut factor: Vec<f64> = Vec::with_capacity(p * (p + 1) / 2);
        let mut ones: Vec<f64> = Vec::with_capacity(p);
        for (i, &k) in points.iter().enumerate() {
            let products = gram.row(k as usize);
            let start = factor.len();
            for (j, &other) in points[..i].iter().enumerate() {
                let (above, mine) = factor.split_at(start);
                let above = row(above, j);
                let sum = dot_short(&above[..j], &mine[..j]);
                factor.push((products[other as usize] + gram.shift() - sum) * above[j]);
            }
            let mine = &factor[start..];
            let length = products[k as usize] + gram.shift();
            let pivot = length - dot_short(mine, mine);
            // False also for numbers that have overflowed.
            if !(pivot > PIVOT_FLOOR * length && pivot.is_finite()) {
                return None;
            }
            let inverse = 1.0 / pivot.sqrt();
            ones.push((1.0 - dot_short(mine, &ones)) * inverse);
            factor.push(inverse);
        }
        let per_ones = 1.0 / dot_short(&ones, &ones);
        Some(Support { points: points.to_vec(), factor, ones, per_ones, next: vec![UNKNOWN; gram.len()] })
    }
}
