//! A sample of pixels, by which cartridges and intent are chosen before the whole document is mapped.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::fitting::gloss::{DIFFERENT, MERGED};
use super::result::mix::InkMix;
use crate::brdf::{Space, Table};
use crate::materials::Materials;

/// Number of pairs of pixels that are compared, so that a share of 1 % is known to 0.07 %.
const PAIRS: usize = 20_000;

/// Draws one pixel from each of equal stretches of the document.
pub(super) fn pixels(total: usize, most: usize, seed: u64) -> Vec<usize> {
    let n = most.min(total);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let edge = |i: usize| (i as u128 * total as u128 / n as u128) as usize;
    (0..n).map(|i| random.random_range(edge(i)..edge(i + 1))).collect()
}

/// The reflectance of some pixels, one per row.
pub(super) fn rows(materials: &dyn Materials, pixels: &[usize]) -> Table {
    let columns = materials.space().columns();
    let mut buffer = vec![0f32; columns];
    let mut row = vec![0.0; columns];
    let mut out = Table::new(columns);
    for &pixel in pixels {
        materials.reflectance(pixel, &mut buffer);
        row.iter_mut().zip(&buffer).for_each(|(row, &f)| *row = f64::from(f));
        out.push(&row);
    }
    out
}

/// The printed reflectance of a mix at some pixels, one per row; `curves` are those of its stacks.
pub(super) fn printed(mix: &InkMix, curves: &Table, pixels: &[usize]) -> Table {
    let mut shares = vec![0.0; mix.stacks.len()];
    let mut row = vec![0.0; curves.columns()];
    let mut out = Table::new(curves.columns());
    for &pixel in pixels {
        mix.shares(pixel, &mut shares);
        row.fill(0.0);
        for (curve, &share) in curves.rows().zip(&shares) {
            if share > 0.0 {
                crate::solve::vector::add_scaled(&mut row, share, curve);
            }
        }
        out.push(&row);
    }
    out
}

/// Share of random pairs of rows that differ (d > 0.03) but are printed at less than a quarter of that distance.
///
/// `targets` and `printed` have corresponding rows. The share is 0 for fewer than two rows.
pub(super) fn merged_share(space: &Space, targets: &Table, printed: &Table, seed: u64) -> f64 {
    let n = targets.len().min(printed.len());
    if n < 2 {
        return 0.0;
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // Every row is in many pairs, and its cube roots cost most.
    let seen = |table: &Table| table.rows().map(|row| space.seen(row)).collect::<Vec<_>>();
    let (targets, printed) = (seen(targets), seen(printed));
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let mut merged = 0usize;
    for _ in 0..PAIRS {
        let i = random.random_range(0..n);
        let j = (i + random.random_range(1..n)) % n;
        let apart = distance(&targets[i], &targets[j]);
        if apart > DIFFERENT && distance(&printed[i], &printed[j]) < MERGED * apart {
            merged += 1;
        }
    }
    merged as f64 / PAIRS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_in_order_distinct_and_all_of_a_small_picture() {
        let some = pixels(1_000_003, 1000, 4);
        assert_eq!(some.len(), 1000);
        assert!(some.windows(2).all(|w| w[0] < w[1]) && *some.last().unwrap() < 1_000_003);
        assert_eq!(pixels(7, 1000, 4), (0..7).collect::<Vec<_>>());
    }

    /// Half of the rows are printed alike though they differ. Sampling finds the same share as counting all ordered pairs.
    #[test]
    fn merged_pairs_are_counted() {
        let space = Space::half_angle(8);
        let (mut targets, mut printed) = (Table::new(space.columns()), Table::new(space.columns()));
        for i in 0..40 {
            let value = 0.001 * 1.5f64.powi(i % 20);
            targets.push(&vec![value; space.columns()]);
            printed.push(&vec![if i < 20 { 0.1 } else { value }; space.columns()]);
        }
        let (mut merged, mut pairs) = (0, 0);
        for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let apart = space.distance(targets.row(i), targets.row(j));
            let left = space.distance(printed.row(i), printed.row(j));
            pairs += 1;
            merged += i32::from(apart > 0.03 && left / apart < 0.25);
        }
        let expected = f64::from(merged) / f64::from(pairs);
        assert!(expected > 0.2);
        let share = merged_share(&space, &targets, &printed, 1);
        assert!((share - expected).abs() < 0.015, "{share} {expected}");
    }
}
