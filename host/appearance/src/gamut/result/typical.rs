//! Typical materials of a document, to look at.
//!
//! Problem: a clamped document has no bases, yet people want to see what becomes of its materials.
//! Method: greedy k-medoids. Of sampled pixels, the one is added that brings the others nearest to one that is there, in
//! mean squared distance, until all are near or there are enough. Cost: `O(MOST n^2)` distances, on all cores.
//! Limits: a material on less than a few hundredths of the document may not be among them.

use rayon::prelude::*;

use crate::brdf::{Space, Table};

/// The most materials that are shown.
const MOST: usize = 6;
/// Mean squared distance below which nothing more is added: hardly visible.
const NEAR: f64 = 0.015 * 0.015;

/// Rows of a sample that stand for the others, and the share of the rows for which each is the nearest; largest first.
pub(crate) fn rows(space: &Space, sample: &Table) -> (Table, Vec<f64>) {
    let seen: Vec<Vec<f64>> = sample.rows().map(|row| space.seen(row)).collect();
    let apart = |a: usize, b: usize| {
        let both = seen[a].iter().zip(&seen[b]);
        both.map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
    };
    let mut nearest = vec![(f64::INFINITY, 0); seen.len()];
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < MOST.min(seen.len()) {
        let left =
            |new: usize| nearest.iter().enumerate().map(|(i, old)| old.0.min(apart(i, new))).sum::<f64>();
        let sums: Vec<f64> = (0..seen.len()).into_par_iter().map(left).collect();
        let Some(new) = (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b])) else { break };
        for (i, old) in nearest.iter_mut().enumerate() {
            let d = apart(i, new);
            if d < old.0 {
                *old = (d, chosen.len());
            }
        }
        chosen.push(new);
        if nearest.iter().map(|old| old.0).sum::<f64>() <= NEAR * seen.len() as f64 {
            break;
        }
    }
    let mut counts = vec![0usize; chosen.len()];
    nearest.iter().for_each(|old| counts[old.1] += 1);
    let mut order: Vec<usize> = (0..chosen.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(counts[i]), chosen[i]));
    let mut rows = Table::new(sample.columns());
    order.iter().for_each(|&i| rows.push(sample.row(chosen[i])));
    (rows, order.iter().map(|&i| counts[i] as f64 / seen.len() as f64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three materials with a little noise: three rows, one of each, in the order of their area.
    #[test]
    fn each_material_has_one_row_and_its_share() {
        let space = Space::half_angle(4);
        let mut sample = Table::new(space.columns());
        for i in 0..100u32 {
            let level = [0.02, 0.1, 0.6][[0, 1, 1, 2, 2, 2, 2, 2, 2, 2][i as usize % 10]];
            let noise = 1.0 + 0.002 * f64::from(i * 37 % 11);
            sample.push(&vec![level * noise; space.columns()]);
        }
        let (rows, shares) = rows(&space, &sample);
        assert_eq!(shares, [0.7, 0.2, 0.1]);
        for (row, level) in rows.rows().zip([0.6, 0.1, 0.02]) {
            assert!((row[0] / level - 1.0).abs() < 0.03, "{row:?}");
        }
    }

    #[test]
    fn one_pixel_is_a_document() {
        let space = Space::half_angle(4);
        let mut sample = Table::new(space.columns());
        sample.push(&vec![0.1; space.columns()]);
        assert_eq!(rows(&space, &sample), (sample, vec![1.0]));
    }
}
