//! Sums over materials that come out the same for any number of threads.
//!
//! Materials are cut into a fixed number of parts; parts run in parallel, and what they found is added in their
//! order. Floating-point sums then depend on the data alone.

use rayon::prelude::*;
use std::ops::Range;

/// How many parts. More than threads by enough to balance, few enough that their results fit in memory.
const PARTS: usize = 32;

/// The ranges materials are cut into.
fn ranges(n: usize) -> Vec<Range<usize>> {
    (0..PARTS).map(|p| p * n / PARTS..(p + 1) * n / PARTS).filter(|r| !r.is_empty()).collect()
}

/// Runs `work` on every part of `0..n`; the results in the order of the parts.
pub(super) fn each<T: Send>(n: usize, work: impl Fn(Range<usize>) -> T + Sync + Send) -> Vec<T> {
    ranges(n).into_par_iter().map(work).collect()
}

/// Like [`each`], with the part's slice of `data`, `stride` values an item, to change.
pub(super) fn each_mut<D: Send, T: Send>(
    n: usize,
    data: &mut [D],
    stride: usize,
    work: impl Fn(Range<usize>, &mut [D]) -> T + Sync + Send,
) -> Vec<T> {
    let mut parts = Vec::with_capacity(PARTS);
    let mut rest = data;
    for range in ranges(n) {
        let (part, tail) = rest.split_at_mut(range.len() * stride);
        parts.push((range, part));
        rest = tail;
    }
    parts.into_par_iter().map(|(range, part)| work(range, part)).collect()
}

/// Adds lists of equal length, the first list first.
pub(super) fn add<T: Copy + Into<f64>>(lists: impl IntoIterator<Item = Vec<T>>, sum: &mut [f64]) {
    for list in lists {
        for (sum, v) in sum.iter_mut().zip(list) {
            *sum += v.into();
        }
    }
}
