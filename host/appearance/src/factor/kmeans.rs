//! Convex-hull k-means: cluster centres pushed out to the corners of the document.
//!
//! Problem: cluster means lie inside the document, and mixtures of them cannot reach the materials outside.
//! Method: section 3.1 of the paper, made robust. After each Lloyd step, materials that mixtures of the centres already
//! represent stop attracting them, so the centres drift to the hull. Real documents never lie exactly in the affine hull of
//! k points, so representation is tested in the first k - 1 principal coordinates and within [`TOLERANCE`] of their spread.
//! Every material is tested again in each iteration and can become active again. An empty cluster restarts at the worst
//! represented material, the best of [`STARTS`] k-means++ starts is kept, and a centre becomes the mean of the nearest real
//! materials that resemble each other: the few coordinates tell lightness and gloss but not always an orange beak from a green twig.
//! Cost: `O(materials k^2)` per iteration, at most [`ITERATIONS`]. Limits: centres stay slightly inside by design.

use maths::Maths;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::solve::vector::dot;
use crate::solve::{Gram, Simplex};

use super::parts;
use super::pca::Pca;
use super::sample::Sample;

const STARTS: u64 = 4;
/// The most iterations, so that one that does not settle ends.
const ITERATIONS: usize = 40;
/// Iterations without a better hull after which the search ends.
const IDLE: usize = 5;
/// A material is represented if its distance to a mixture of the centres is below this share of the document's spread.
const TOLERANCE: f64 = 0.07;
/// Number of materials that place the centres. All materials take part in lifting.
const PLACING: usize = 5000;
/// Number of real materials whose mean is a basis.
const LIFTED: usize = 12;
/// So many times as many of the nearest are looked at, to find the ones that resemble each other.
const LOOKED_AT: usize = 8;

/// `k` bases, as rows of the sample's columns. There should be at least `k - 1` axes.
pub(super) fn bases(sample: &Sample, pca: &Pca, k: usize, seed: u64) -> Vec<f32> {
    let d = pca.dimensions.min(k - 1);
    let coordinates: Vec<f64> = if d == pca.dimensions {
        pca.coordinates(sample)
    } else {
        pca.coordinates(sample).chunks_exact(pca.dimensions).flat_map(|c| c[..d].iter().copied()).collect()
    };
    let placing = sample.len().min(PLACING);
    let cloud = Cloud { d, points: &coordinates[..placing * d], weight: &sample.weight[..placing] };
    let mut best: Option<(f64, Vec<f64>)> = None;
    for start in 0..STARTS {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(start);
        let (left, centres) = cloud.run(k, &mut random);
        if best.as_ref().is_none_or(|(least, _)| left < *least) {
            best = Some((left, centres));
        }
    }
    let centres = best.map_or_else(|| vec![0.0; k * d], |(_, centres)| centres);
    lift(sample, &coordinates, &centres, d, k)
}

/// Weighted points in few dimensions.
struct Cloud<'a> {
    d: usize,
    points: &'a [f64],
    weight: &'a [f64],
}

impl Cloud<'_> {
    fn len(&self) -> usize {
        self.weight.len()
    }

    fn point(&self, i: usize) -> &[f64] {
        &self.points[i * self.d..][..self.d]
    }

    /// One start. Returns the smallest weighted sum of squared distances of all points from the hull of the centres, and the
    /// centres of that iteration.
    fn run(&self, k: usize, random: &mut ChaCha8Rng) -> (f64, Vec<f64>) {
        let (n, d) = (self.len(), self.d);
        let mut centres = self.plus_plus(k, random);
        let total: f64 = self.weight.iter().sum();
        let spread2: f64 =
            (0..n).map(|i| self.weight[i] * dot(self.point(i), self.point(i))).sum::<f64>() / total;
        let represented = TOLERANCE * TOLERANCE * spread2;
        let few = (4 * k).max(n / 2000);
        let mut weights = vec![1.0 / k as f64; n * k];
        let mut left = self.outside(&centres, k, &mut weights);
        let mut best = (self.sum(&left), centres.clone());
        let mut active = vec![true; n];
        let mut idle = 0;
        for _ in 0..ITERATIONS {
            self.lloyd(&mut centres, k, &active, &left);
            left = self.outside(&centres, k, &mut weights);
            let sum = self.sum(&left);
            idle += 1;
            if sum < best.0 {
                best = (sum, centres.clone());
                idle = 0;
            }
            let now: Vec<bool> = left.iter().map(|&left| left > represented).collect();
            // Points that become active as others become inactive can do so forever.
            let stable = now == active || idle >= IDLE;
            if stable || now.iter().filter(|&&a| a).count() < few || d == 0 {
                break;
            }
            active = now;
        }
        best
    }

    fn sum(&self, left: &[f64]) -> f64 {
        left.iter().zip(self.weight).map(|(l, w)| l * w).sum()
    }

    /// k-means++: each centre is a point drawn with probability proportional to weight and squared distance.
    fn plus_plus(&self, k: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut centres = Vec::with_capacity(k * self.d);
        let mut chance = self.weight.to_vec();
        let mut nearest = vec![f64::INFINITY; self.len()];
        for _ in 0..k {
            let i = draw(&chance, random);
            let centre = self.point(i);
            centres.extend_from_slice(centre);
            for (i, nearest) in nearest.iter_mut().enumerate() {
                *nearest = nearest.min(distance2(self.point(i), centre));
                chance[i] = self.weight[i] * *nearest;
            }
        }
        centres
    }

    /// Moves each centre to the mean of its active points, and a centre without any to the point farthest outside.
    fn lloyd(&self, centres: &mut [f64], k: usize, active: &[bool], left: &[f64]) {
        let d = self.d;
        let mut sums = vec![0.0; k * d];
        let mut mass = vec![0.0; k];
        for i in (0..self.len()).filter(|&i| active[i]) {
            let point = self.point(i);
            let mut best = (f64::INFINITY, 0);
            for c in 0..k {
                let away = distance2(point, &centres[c * d..][..d]);
                if away < best.0 {
                    best = (away, c);
                }
            }
            mass[best.1] += self.weight[i];
            for (sum, p) in sums[best.1 * d..][..d].iter_mut().zip(point) {
                *sum += self.weight[i] * p;
            }
        }
        let mut worst: Vec<usize> = Vec::new();
        for c in 0..k {
            let centre = &mut centres[c * d..][..d];
            if mass[c] > 0.0 {
                centre.iter_mut().zip(&sums[c * d..]).for_each(|(centre, sum)| *centre = sum / mass[c]);
            } else {
                let fresh = (0..self.len()).filter(|i| !worst.contains(i));
                if let Some(i) = fresh.max_by(|&a, &b| left[a].total_cmp(&left[b])) {
                    worst.push(i);
                    centre.copy_from_slice(self.point(i));
                }
            }
        }
    }

    /// The squared distance of every point from the hull of the centres. `weights` are the warm start and are updated.
    fn outside(&self, centres: &[f64], k: usize, weights: &mut [f64]) -> Vec<f64> {
        let d = self.d;
        let mut gram = Gram::empty();
        gram.refill(k, |i| &centres[i * d..][..d]);
        let gram = &gram;
        parts::each_mut(self.len(), weights, k, |range, weights| {
            let mut simplex = Simplex::new();
            let mut h = vec![0.0; k];
            let mut mixture = vec![0.0; d];
            let mut left = Vec::with_capacity(range.len());
            for (i, a) in range.zip(weights.chunks_exact_mut(k)) {
                let point = self.point(i);
                h.iter_mut().enumerate().for_each(|(c, h)| *h = dot(&centres[c * d..][..d], point));
                // Sizes agree and numbers are finite, so there is a solution.
                let _ = simplex.solve(gram, &h, a);
                mixture.fill(0.0);
                for (c, &a) in a.iter().enumerate() {
                    mixture.iter_mut().zip(&centres[c * d..]).for_each(|(m, centre)| *m += a * centre);
                }
                left.push(distance2(point, &mixture));
            }
            left
        })
        .concat()
    }
}

/// Replaces each centre by the mean of the nearest real materials that resemble each other: the one that is nearest to all others
/// of its surroundings, and its neighbours.
fn lift(sample: &Sample, coordinates: &[f64], centres: &[f64], d: usize, k: usize) -> Vec<f32> {
    let n = sample.len();
    let padded = sample.columns.padded;
    // In a document with few materials, this many neighbours would include different materials.
    let count = LIFTED.min(n / (16 * k)).max(1);
    // Half of an equal share, or the surroundings of two centres would be the same.
    let some = (LOOKED_AT * count).min(n / (2 * k)).max(count);
    let mut bases = Vec::with_capacity(k * padded);
    for c in 0..k {
        let centre = &centres[c * d..][..d];
        let mut order: Vec<(f64, usize)> =
            (0..n).map(|i| (distance2(&coordinates[i * d..][..d], centre), i)).collect();
        order.select_nth_unstable_by(some - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.truncate(some);
        order.sort_by_key(|&(_, i)| i);
        let apart = |i: usize, j: usize| -> f64 {
            let pairs = sample.row(i).iter().zip(sample.row(j)).zip(&sample.columns.omega);
            f64::from(pairs.map(|((a, b), w)| (w * (a - b)).squared()).sum::<f32>()).sqrt()
        };
        let near = |i: usize| order.iter().map(|&(_, j)| apart(i, j)).sum::<f64>();
        let most =
            order.iter().map(|&(_, i)| (near(i), i)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if let Some((_, middle)) = most {
            order.iter_mut().for_each(|(away, i)| *away = apart(middle, *i));
            order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        let mut mean = vec![0.0f64; padded];
        order.truncate(count);
        order.sort_by_key(|&(_, i)| i);
        for &(_, i) in &order {
            mean.iter_mut().zip(sample.row(i)).for_each(|(mean, &x)| *mean += f64::from(x));
        }
        bases.extend(mean.iter().map(|&m| (m / count as f64) as f32));
    }
    bases
}

/// Draws an index with the given relative probabilities; the last possible one if rounding passes the end.
pub(super) fn draw(chance: &[f64], random: &mut ChaCha8Rng) -> usize {
    let total: f64 = chance.iter().sum();
    let mut left = random.random::<f64>() * total;
    let mut last = 0;
    for (i, &c) in chance.iter().enumerate().filter(|(_, c)| **c > 0.0) {
        last = i;
        left -= c;
        if left < 0.0 {
            break;
        }
    }
    last
}

fn distance2(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
