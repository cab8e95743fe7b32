//! The nearest point in the convex hull of many materials.
//!
//! Problem: bases should stay real, that is, inside the hull of the document's materials, and the corners of that hull are
//! among thousands of points in a hundred dimensions.
//! Method: column generation. Least squares over a few points is solved exactly, and the point that would lower the
//! distance fastest joins, until the Frank-Wolfe gap is negligible; points that lose their weight leave. Distances are
//! weighted by column. Corners are found in advance, as the extremes along random directions of the principal
//! coordinates, raw and whitened.
//! Cost: `O(points columns)` for each point that joins, about ten. Limits: stops after [`MOST_JOINED`] joins with a point
//! in the hull that may not be quite the nearest.

use maths::Maths;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::solve::{Gram, Simplex};

use super::pca::Pca;
use super::sample::Sample;

/// The most joins with a point, so that one that does not settle ends: about ten are needed.
const MOST_JOINED: usize = 100;
/// Directions tried for corners, half of them in whitened coordinates.
const DIRECTIONS: usize = 3000;

/// The points that span the hull, as rows of equal length.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    length: usize,
    points: Vec<f32>,
}

/// A convex combination of the points of a hull.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Combination {
    points: Vec<usize>,
    weights: Vec<f64>,
}

impl Combination {
    /// The combination `share` of the way to another.
    pub fn towards(&self, other: &Combination, share: f64) -> Combination {
        let mut sum = Combination {
            points: self.points.clone(),
            weights: self.weights.iter().map(|w| (1.0 - share) * w).collect(),
        };
        for (&p, &w) in other.points.iter().zip(&other.weights) {
            match sum.points.iter().position(|&q| q == p) {
                Some(i) => sum.weights[i] += share * w,
                None => {
                    sum.points.push(p);
                    sum.weights.push(share * w);
                }
            }
        }
        sum
    }
}

/// Memory for projections.
#[derive(Clone, Debug)]
pub(super) struct Workspace {
    rows: Vec<f64>,
    slope: Vec<f32>,
    gram: Gram,
    simplex: Simplex,
}

impl Workspace {
    pub fn new() -> Workspace {
        Workspace { rows: Vec::new(), slope: Vec::new(), gram: Gram::empty(), simplex: Simplex::new() }
    }
}

impl Hull {
    /// The hull of the given rows; at least one.
    pub fn new(points: Vec<f32>, length: usize) -> Hull {
        Hull { length, points }
    }

    /// The hull of a sample's corners: the extremes along random directions of the principal coordinates.
    pub fn of_corners(sample: &Sample, pca: &Pca, seed: u64) -> Hull {
        let d = pca.dimensions;
        let length = sample.columns.padded;
        if d == 0 {
            return Hull::new(sample.row(0).to_vec(), length);
        }
        let coordinates = pca.coordinates(sample);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let directions: Vec<f64> = (0..DIRECTIONS)
            .flat_map(|i| {
                // The sum of four uniform numbers is close enough to normal for evenly spread directions.
                let bell =
                    |random: &mut ChaCha8Rng| (0..4).map(|_| random.random::<f64>()).sum::<f64>() - 2.0;
                let raw: Vec<f64> = (0..d).map(|_| bell(&mut random)).collect();
                let whiten = i % 2 == 1;
                raw.into_iter().zip(&pca.variance).map(move |(r, v)| if whiten { r / v.sqrt() } else { r })
            })
            .collect();
        let mut corners: Vec<usize> = directions
            .par_chunks_exact(d)
            .map(|direction| {
                let mut best = (f64::NEG_INFINITY, 0);
                for (i, point) in coordinates.chunks_exact(d).enumerate() {
                    let along: f64 = point.iter().zip(direction).map(|(p, d)| p * d).sum();
                    if along > best.0 {
                        best = (along, i);
                    }
                }
                best.1
            })
            .collect();
        corners.sort_unstable();
        corners.dedup();
        Hull::new(corners.into_iter().flat_map(|i| sample.row(i).iter().copied()).collect(), length)
    }

    fn point(&self, i: usize) -> &[f32] {
        &self.points[i * self.length..][..self.length]
    }

    /// The point in the hull nearest to `target`, with the weight `weight_j` for column j. `from` is the combination to start
    /// from (empty for a cold start) and receives the result; `out` receives the point. Returns the squared distance.
    pub fn project(
        &self,
        target: &[f64],
        weight: &[f64],
        from: &mut Combination,
        out: &mut [f64],
        workspace: &mut Workspace,
    ) -> f64 {
        let n = self.length;
        if from.points.is_empty() {
            *from = Combination { points: vec![self.nearest(target, weight)], weights: vec![1.0] };
        }
        let scale: f64 = target.iter().zip(weight).map(|(t, w)| w * t * t).sum();
        let mut last = f64::INFINITY;
        for _ in 0..MOST_JOINED {
            self.settle(target, weight, from, workspace);
            self.combine(from, out);
            // Half the gradient of the squared distance, in single precision for the pass over all points.
            workspace.slope.clear();
            workspace.slope.extend((0..n).map(|j| (weight[j] * (out[j] - target[j])) as f32));
            let distance2: f64 = (0..n).map(|j| weight[j] * (out[j] - target[j]).squared()).sum();
            let here: f64 = (0..n).map(|j| weight[j] * (out[j] - target[j]) * out[j]).sum();
            let (joining, least) = self.steepest(&workspace.slope);
            let gap = here - f64::from(least);
            // Single precision resolves gaps of 1e-6 of the scale; a distance that no longer falls ends the search too.
            if gap <= 1e-3 * distance2 + 1e-9 * scale || distance2 >= last || from.points.contains(&joining) {
                return distance2;
            }
            last = distance2;
            from.points.push(joining);
            from.weights.push(0.0);
        }
        (0..n).map(|j| weight[j] * (out[j] - target[j]).squared()).sum()
    }

    /// Computes the best weights for the points of a combination and drops points without weight.
    fn settle(&self, target: &[f64], weight: &[f64], c: &mut Combination, workspace: &mut Workspace) {
        let (n, m) = (self.length, c.points.len());
        if m == 1 {
            c.weights[0] = 1.0;
            return;
        }
        // Relative to the target, where the numbers are small and the inner products accurate.
        workspace.rows.clear();
        for &p in &c.points {
            let point = self.point(p);
            workspace.rows.extend((0..n).map(|j| weight[j].sqrt() * (f64::from(point[j]) - target[j])));
        }
        let rows = &workspace.rows;
        workspace.gram.refill(m, |i| &rows[i * n..][..n]);
        let zero = vec![0.0; m];
        if workspace.simplex.solve(&workspace.gram, &zero, &mut c.weights).is_err() {
            return;
        }
        let mut keep = c.weights.iter().map(|&w| w > 0.0);
        c.points.retain(|_| keep.next() == Some(true));
        c.weights.retain(|&w| w > 0.0);
    }

    /// The point of a combination.
    pub fn combine(&self, c: &Combination, out: &mut [f64]) {
        out.fill(0.0);
        for (&p, &w) in c.points.iter().zip(&c.weights) {
            for (out, &x) in out.iter_mut().zip(self.point(p)) {
                *out += w * f64::from(x);
            }
        }
    }

    fn nearest(&self, target: &[f64], weight: &[f64]) -> usize {
        let distance = |point: &[f32]| -> f64 {
            point.iter().zip(target).zip(weight).map(|((&p, t), w)| w * (f64::from(p) - t).squared()).sum()
        };
        let all = self.points.chunks_exact(self.length).map(distance).enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
    }

    /// The point with the least inner product with `slope`, and that product.
    fn steepest(&self, slope: &[f32]) -> (usize, f32) {
        let mut best = (0, f32::INFINITY);
        for (i, point) in self.points.chunks_exact(self.length).enumerate() {
            let along = super::columns::dot(point, slope);
            if along < best.1 {
                best = (i, along);
            }
        }
        best
    }
}

/// The distance of each basis from the hull of a sample, in units of its spread: 0 for real materials.
pub(super) fn excursions(sample: &Sample, pca: &Pca, bases: &[f32]) -> Vec<f64> {
    let n = sample.columns.padded;
    let hull = Hull::new(sample.x.clone(), n);
    let weight: Vec<f64> = sample.columns.omega.iter().map(|&o| (f64::from(o) / 3.0).squared()).collect();
    let rows: Vec<&[f32]> = bases.chunks_exact(n).collect();
    rows.par_iter()
        .map(|basis| {
            let target: Vec<f64> = basis.iter().map(|&b| f64::from(b)).collect();
            let mut out = vec![0.0; n];
            let mut from = Combination::default();
            let d2 = hull.project(&target, &weight, &mut from, &mut out, &mut Workspace::new());
            if pca.spread > 0.0 { d2.sqrt() / pca.spread } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Table;
    use proptest::prelude::*;

    proptest! {
        /// Compared with one least-squares problem over all points.
        #[test]
        fn projecting_with_few_points_is_projecting_with_all(
            points in prop::collection::vec(0.0f32..2.0, 40 * 8), target in prop::collection::vec(-0.5f64..2.5, 8),
            weight in prop::collection::vec(0.1f64..3.0, 8)
        ) {
            let hull = Hull::new(points.clone(), 8);
            let mut out = vec![0.0; 8];
            let mut from = Combination::default();
            let few = hull.project(&target, &weight, &mut from, &mut out, &mut Workspace::new());
            let mut rows = Table::new(8);
            for point in points.chunks_exact(8) {
                let row: Vec<f64> =
                    (0..8).map(|j| weight[j].sqrt() * (f64::from(point[j]) - target[j])).collect();
                rows.push(&row);
            }
            let mut a = vec![0.0; 40];
            Simplex::new().solve(&Gram::of_rows(&rows), &[0.0; 40], &mut a).unwrap();
            let all: f64 = (0..8)
                .map(|j| rows.rows().zip(&a).map(|(row, a)| row[j] * a).sum::<f64>().powi(2))
                .sum();
            prop_assert!(few >= all - 1e-9 && few <= all * 1.003 + 1e-6, "{few} {all}");
            prop_assert!((from.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            let mut again = vec![0.0; 8];
            hull.combine(&from, &mut again);
            prop_assert_eq!(again, out);
        }
    }

    #[test]
    fn a_combination_part_way_is_the_point_part_way() {
        let hull = Hull::new((0..24).map(|i| (i * i % 7) as f32).collect(), 8);
        let a = Combination { points: vec![0, 1], weights: vec![0.5, 0.5] };
        let b = Combination { points: vec![1, 2], weights: vec![0.25, 0.75] };
        let at = |c: &Combination| {
            let mut out = vec![0.0; 8];
            hull.combine(c, &mut out);
            out
        };
        for ((a, b), m) in at(&a).iter().zip(at(&b)).zip(at(&a.towards(&b, 0.25))) {
            assert!((m - (0.75 * a + 0.25 * b)).abs() < 1e-12);
        }
    }
}
