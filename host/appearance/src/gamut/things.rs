//! The materials of a document that a viewer sees as one thing each.
//!
//! Problem: a mean over pixels hides what is on 1 % of the sheet, and a viewer judges materials: the red of
//! a cap, the gold of a rim.
//! Method: leader clustering (J. Hartigan 1975) of the pixels on a grid. A pixel joins the nearest material
//! that is at most [`LIKE`] away, or begins one; a material's row is the mean of its pixels. Parts of the
//! grid are clustered side by side, and what they find is clustered in turn. Cost: 3 microseconds a point
//! of the grid, of which there are at most [`GRID`] squared, on all cores.
//! Limits: the order of pixels decides where a smooth shading is divided; materials that are finer than the
//! grid are found by chance.

use std::collections::HashMap;

use rayon::prelude::*;

use super::fitting::gloss::DIFFERENT;
use crate::brdf::{Space, Table};
use crate::materials::Materials;

/// Points of the grid along a side. Source: 4 mm² of an A4 sheet are then four of them.
const GRID: usize = 256;
/// Rows of the grid that are clustered together. Source: sixteen parts, for two to sixteen cores.
const RUN: usize = 16;
/// The distance up to which pixels are one material: what counts as different elsewhere, too.
const LIKE: f64 = DIFFERENT;
/// The most materials. Source: more than a document has that cover a thousandth of the sheet each, but for
/// continuous ones.
const MOST: usize = 64;

/// A material: what it looks like to whom it is compared, the sum of its pixels' rows, and their number.
struct Thing {
    look: Vec<f64>,
    sum: Vec<f64>,
    count: f64,
}

/// Materials with their rows, and the share of the document that each covers, the largest first.
pub(super) struct Things {
    pub rows: Table,
    pub shares: Vec<f64>,
}

fn join(things: &mut Vec<Thing>, look: Vec<f64>, sum: &[f64], count: f64) -> usize {
    let apart = |thing: &Thing| thing.look.iter().zip(&look).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let nearest = things.iter().map(apart).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    match nearest.filter(|(_, squared)| *squared <= LIKE * LIKE || things.len() >= MOST) {
        Some((found, _)) => {
            things[found].sum.iter_mut().zip(sum).for_each(|(sum, f)| *sum += f);
            things[found].count += count;
            found
        }
        None => {
            things.push(Thing { look, sum: sum.to_vec(), count });
            things.len() - 1
        }
    }
}

/// The materials of some rows of the grid.
fn of_rows(pixels: &dyn Materials, rows: &[usize], step: usize) -> Vec<Thing> {
    let space = pixels.space();
    let (mut row, mut wide) = (vec![0f32; space.columns()], vec![0.0; space.columns()]);
    let (mut things, mut known) = (Vec::new(), HashMap::new());
    for pixel in
        rows.iter().flat_map(|y| (0..pixels.width()).step_by(step).map(move |x| y * pixels.width() + x))
    {
        let key = pixels.key(pixel, &mut row);
        pixels.reflectance(pixel, &mut row);
        wide.iter_mut().zip(&row).for_each(|(wide, &f)| *wide = f64::from(f));
        if let Some(&found) = known.get(&key) {
            let thing: &mut Thing = &mut things[found];
            thing.sum.iter_mut().zip(&wide).for_each(|(sum, f)| *sum += f);
            thing.count += 1.0;
            continue;
        }
        known.insert(key, join(&mut things, space.seen(&wide), &wide, 1.0));
    }
    things
}

impl Things {
    /// Finds those of a document.
    pub fn find(pixels: &dyn Materials) -> Things {
        let (width, height, space) = (pixels.width(), pixels.height(), pixels.space());
        let step = width.max(height).div_ceil(GRID).max(1);
        let rows: Vec<usize> = (0..height).step_by(step).collect();
        let parts: Vec<Vec<Thing>> = rows.par_chunks(RUN).map(|rows| of_rows(pixels, rows, step)).collect();
        let mut things = Vec::new();
        for Thing { sum, count, .. } in parts.into_iter().flatten() {
            join(&mut things, space.seen(&mean(&sum, count)), &sum, count);
        }
        things.sort_by(|a, b| b.count.total_cmp(&a.count));
        let all: f64 = things.iter().map(|thing| thing.count).sum();
        let mut found = Things { rows: Table::new(space.columns()), shares: Vec::new() };
        for Thing { sum, count, .. } in &things {
            found.rows.push(&mean(sum, *count));
            found.shares.push(count / all);
        }
        found
    }

    /// Those that stand for the others: greedy k-medoids. The one is added that brings the others nearest
    /// to one that is there, in mean squared distance, until all are near or there are `most`. Each has the
    /// share of the document for which it is the nearest.
    pub fn typical(&self, space: &Space, most: usize, near: f64) -> (Table, Vec<f64>) {
        let seen: Vec<Vec<f64>> = self.rows.rows().map(|row| space.seen(row)).collect();
        let apart = |a: usize, b: usize| {
            let both = seen[a].iter().zip(&seen[b]);
            both.map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
        };
        let mut nearest = vec![(f64::INFINITY, 0); seen.len()];
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < most.min(seen.len()) {
            let left = |new: usize| {
                let all = nearest.iter().zip(&self.shares).enumerate();
                all.map(|(i, (old, share))| share * old.0.min(apart(i, new))).sum::<f64>()
            };
            let sums = (0..seen.len()).map(left);
            let Some((new, left)) = sums.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            for (i, old) in nearest.iter_mut().enumerate() {
                let d = apart(i, new);
                if d < old.0 {
                    *old = (d, chosen.len());
                }
            }
            chosen.push(new);
            if left <= near * near {
                break;
            }
        }
        let mut shares = vec![0.0; chosen.len()];
        nearest.iter().zip(&self.shares).for_each(|(old, share)| shares[old.1] += share);
        let mut order: Vec<usize> = (0..chosen.len()).collect();
        order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
        let mut rows = Table::new(self.rows.columns());
        order.iter().for_each(|&i| rows.push(self.rows.row(chosen[i])));
        (rows, order.iter().map(|&i| shares[i]).collect())
    }
}

fn mean(sum: &[f64], count: f64) -> Vec<f64> {
    sum.iter().map(|sum| sum / count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes of given widths, each with a little noise.
    struct Stripes(Space, Vec<(usize, f64)>);

    impl Materials for Stripes {
        fn width(&self) -> usize {
            self.1.iter().map(|(width, _)| width).sum()
        }
        fn height(&self) -> usize {
            40
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            let mut x = pixel % self.width();
            for &(width, level) in &self.1 {
                if x < width {
                    out.fill((level * (1.0 + 0.002 * (pixel * 37 % 11) as f64)) as f32);
                    return;
                }
                x -= width;
            }
        }
    }

    #[test]
    fn each_material_has_one_row_and_its_share() {
        let document = Stripes(Space::half_angle(4), vec![(60, 0.6), (3, 0.02), (20, 0.1), (17, 0.6)]);
        let found = Things::find(&document);
        let shares: Vec<f64> = found.shares.iter().map(|share| (100.0 * share).round()).collect();
        assert_eq!(shares, [77.0, 20.0, 3.0]);
        for (row, level) in found.rows.rows().zip([0.6, 0.1, 0.02]) {
            assert!((row[0] / level - 1.01).abs() < 0.01, "{row:?}");
        }
        let (rows, shares) = found.typical(&document.0, 2, 0.0);
        assert!((rows.row(0), rows.row(1)) == (found.rows.row(0), found.rows.row(1)), "{rows:?}");
        assert!((shares[0] - 0.77).abs() < 1e-9 && (shares[1] - 0.23).abs() < 1e-9, "{shares:?}");
    }
}
