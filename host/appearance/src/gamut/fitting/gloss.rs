//! Scaling the gloss of all bases by one factor, as the ladder of figure 5 needs if every step is a basis.
//!
//! Problem: eq. 1 maps each basis on its own, so bases that lie outside the gamut in the same direction are printed alike.
//! Method: the gloss of a basis is its reflectance above the minimum over all configurations, channel by channel. For each
//! basis, the factor on its gloss that fits the printed basis best is computed (least squares in the metric). All gloss is
//! multiplied by the smallest of these factors, so the most extreme basis just reaches the gamut and ratios of gloss
//! survive. Cost: one line search per basis. Limits: a factor cannot narrow a lobe, only lower it.

use crate::brdf::{Space, Table};
use maths::Maths;

/// Two rows differ if their distance exceeds this: three times what is barely visible
/// (decisions/clamp-and-seven-cartridges.md).
pub(crate) const DIFFERENT: f64 = 0.03;
/// Two rows that differ are merged if they are printed at less than this share of their distance
/// (decisions/clamp-and-seven-cartridges.md).
pub(crate) const MERGED: f64 = 0.25;

/// Share of merged pairs of materials up to which nothing need be done about them
/// (decisions/clamp-and-seven-cartridges.md).
pub(crate) const FEW_MERGED: f64 = 0.01;

/// The share of pairs of materials that are different bases printed alike, where each basis has its share of the document.
pub(crate) fn merges(space: &Space, targets: &Table, shares: &[f64], printed: &[Vec<f64>]) -> f64 {
    let mut merged = 0.0;
    for i in 0..targets.len() {
        for j in 0..i {
            let apart = space.distance(targets.row(i), targets.row(j));
            let left = space.distance(&printed[i], &printed[j]);
            if apart > DIFFERENT && left < MERGED * apart {
                merged += 2.0 * shares[i] * shares[j];
            }
        }
    }
    merged
}

/// Rows with their gloss multiplied by `factor`.
pub(crate) fn scaled(rows: &Table, factor: f64) -> Table {
    let mut out = Table::new(rows.columns());
    for row in rows.rows() {
        let base = base(row);
        let scaled: Vec<f64> =
            row.iter().enumerate().map(|(j, &f)| base[j % 3] + factor * (f - base[j % 3])).collect();
        out.push(&scaled);
    }
    out
}

/// The minimum of each channel: the part that is not gloss.
fn base(row: &[f64]) -> [f64; 3] {
    let mut base = [f64::INFINITY; 3];
    for (j, &f) in row.iter().enumerate() {
        base[j % 3] = base[j % 3].min(f);
    }
    base.map(f64::abs)
}

/// The factor (0.02..=1) on the gloss of all bases that brings the most extreme one into the gamut.
pub(crate) fn factor(space: &Space, targets: &Table, printed: &[Vec<f64>]) -> f64 {
    let mut least = 1.0f64;
    for (i, printed) in printed.iter().enumerate() {
        let mut one = Table::new(targets.columns());
        one.push(targets.row(i));
        let miss = |log: f64| space.distance(scaled(&one, log.exponential()).row(0), printed);
        // Golden-section search on the logarithm; the distance has a single minimum along the factor.
        let golden = 0.618_033_988_749_895;
        let (mut low, mut high) = (0.02f64.logarithm(), 0.0);
        let (mut x, mut y) = (high - golden * (high - low), low + golden * (high - low));
        let (mut at_x, mut at_y) = (miss(x), miss(y));
        for _ in 0..40 {
            if at_x <= at_y {
                (high, y, at_y) = (y, x, at_x);
                x = high - golden * (high - low);
                at_x = miss(x);
            } else {
                (low, x, at_x) = (x, y, at_y);
                y = low + golden * (high - low);
                at_y = miss(y);
            }
        }
        // If the minimum lies beyond the end of the range, the gloss is printed in full.
        let found = 0.5 * (low + high);
        let full = miss(0.0);
        if miss(found) < full - 1e-9 {
            least = least.min(found.exponential());
        }
    }
    least
}
