//! Sums over materials that do not depend on the number of threads.
//!
//! Materials are divided into a fixed number of parts. The parts run in parallel, and their results are added in order, so
//! floating-point sums depend on the data alone.

use rayon::prelude::*;
use std::ops::Range;

/// Number of parts: enough to balance the load of the threads, and few enough to keep their results in memory.
const PARTS: usize = 32;

/// The ranges of the parts.
fn ranges(n: usize) -> Vec<Range<usize>> {
    (0..PARTS).map(|p| p * n / PARTS..(p + 1) * n / PARTS).filter(|r| !r.is_empty()).collect()
}

/// Runs `work` on every part of `0..n`, and returns the results in the order of the parts.
pub(super) fn each<T: Send>(n: usize, work: impl Fn(Range<usize>) -> T + Sync + Send) -> Vec<T> {
    ranges(n).into_par_iter().map(work).collect()
}

/// Like [`each`], with a mutable slice of `data` for each part, `stride` values per item.
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

/// Adds lists of equal length, in order.
pub(super) fn add<T: Copy + Into<f64>>(lists: impl IntoIterator<Item = Vec<T>>, sum: &mut [f64]) {
    for list in lists {
        for (sum, v) in sum.iter_mut().zip(list) {
            *sum += v.into();
        }
    }
}
