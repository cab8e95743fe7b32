//! The directions in which the materials of a document differ most, in the tangent of the metric at their mean.
//!
//! Method: orthogonal iteration on the covariance without forming it, then Jacobi rotations of the small projected matrix.
//! Cost: `O(materials columns axes)` per iteration. Limits: the number of iterations is limited; axes with nearly equal
//! variances may stay mixed, which does not matter here.
//! Source: Golub & Van Loan, Matrix Computations, sections 8.2 and 8.5.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::parts;
use super::sample::Sample;

/// The most iterations, so that one that does not settle ends.
const MOST_ITERATIONS: usize = 40;

/// Principal axes of a sample.
#[derive(Clone, Debug)]
pub(super) struct Pca {
    /// Length of a row of the sample.
    padded: usize,
    /// Number of axes; fewer than requested if the materials span fewer dimensions.
    pub dimensions: usize,
    /// Factor of each column from sample row to tangent, `omega / 3`.
    tangent: Vec<f64>,
    /// The mean material (a sample row).
    mean: Vec<f64>,
    /// Orthonormal rows in the tangent.
    axes: Vec<f64>,
    /// Variance along each axis, in descending order.
    pub variance: Vec<f64>,
    /// Root of the total variance over all columns: the spread of the document.
    pub spread: f64,
}

impl Pca {
    /// The first `wanted` axes.
    pub fn fit(sample: &Sample, wanted: usize, seed: u64) -> Pca {
        let padded = sample.columns.padded;
        let tangent: Vec<f64> = sample.columns.omega.iter().map(|&o| f64::from(o) / 3.0).collect();
        let mut mean = vec![0.0; padded];
        for (i, &w) in sample.weight.iter().enumerate() {
            for (mean, &x) in mean.iter_mut().zip(sample.row(i)) {
                *mean += w * f64::from(x);
            }
        }
        let mut pca =
            Pca { padded, dimensions: 0, tangent, mean, axes: Vec::new(), variance: Vec::new(), spread: 0.0 };
        let total: f64 = parts::each(sample.len(), |range| {
            range
                .map(|i| sample.weight[i] * pca.centred(sample.row(i)).map(|z| z * z).sum::<f64>())
                .sum::<f64>()
        })
        .iter()
        .sum();
        pca.spread = total.sqrt();
        // Two extra axes make the others converge faster.
        let most = (wanted + 2).min(sample.columns.real).min(sample.len() - 1);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut axes: Vec<f64> = (0..most * padded).map(|_| random.random::<f64>() - 0.5).collect();
        let mut found = 0.0;
        for _ in 0..MOST_ITERATIONS {
            orthonormalise(&mut axes, padded);
            let image = pca.covariance_times(sample, &axes);
            // The trace of the projected covariance grows toward the sum of the largest variances.
            let trace: f64 = axes.iter().zip(&image).map(|(a, b)| a * b).sum();
            let settled = trace - found <= 1e-7 * total;
            found = trace;
            if settled {
                break;
            }
            axes = image;
        }
        orthonormalise(&mut axes, padded);
        pca.rotate(sample, axes, wanted, total);
        pca
    }

    /// The position of a material, one coordinate per axis.
    pub fn project(&self, row: &[f32], out: &mut [f64]) {
        out.fill(0.0);
        for (out, axis) in out.iter_mut().zip(self.axes.chunks_exact(self.padded)) {
            *out = self.centred(row).zip(axis).map(|(z, a)| z * a).sum();
        }
    }

    /// The coordinates of every material of a sample.
    pub fn coordinates(&self, sample: &Sample) -> Vec<f64> {
        let d = self.dimensions;
        let mut out = vec![0.0; sample.len() * d];
        parts::each_mut(sample.len(), &mut out, d, |range, out| {
            for (i, out) in range.zip(out.chunks_exact_mut(d.max(1))) {
                self.project(sample.row(i), out);
            }
        });
        out
    }

    fn centred(&self, row: &[f32]) -> impl Iterator<Item = f64> {
        row.iter().zip(&self.mean).zip(&self.tangent).map(|((&x, &m), &t)| (f64::from(x) - m) * t)
    }

    fn covariance_times(&self, sample: &Sample, axes: &[f64]) -> Vec<f64> {
        let partial = parts::each(sample.len(), |range| {
            let mut sum = vec![0.0; axes.len()];
            let mut z = vec![0.0; self.padded];
            for i in range {
                z.iter_mut().zip(self.centred(sample.row(i))).for_each(|(z, c)| *z = c);
                for (sum, axis) in sum.chunks_exact_mut(self.padded).zip(axes.chunks_exact(self.padded)) {
                    let along = sample.weight[i] * crate::solve::vector::dot(axis, &z);
                    crate::solve::vector::add_scaled(sum, along, &z);
                }
            }
            sum
        });
        let mut out = vec![0.0; axes.len()];
        parts::add(partial, &mut out);
        out
    }

    /// Rotates an invariant subspace into axes of descending variance, and keeps those with any variance.
    fn rotate(&mut self, sample: &Sample, subspace: Vec<f64>, wanted: usize, total: f64) {
        let padded = self.padded;
        let m = subspace.len() / padded;
        let image = self.covariance_times(sample, &subspace);
        let mut matrix = vec![0.0; m * m];
        for i in 0..m {
            for j in 0..m {
                matrix[i * m + j] = crate::solve::vector::dot(
                    &subspace[i * padded..][..padded],
                    &image[j * padded..][..padded],
                );
            }
        }
        let (variances, vectors) = jacobi(matrix, m);
        let mut order: Vec<usize> = (0..m).collect();
        order.sort_by(|&a, &b| variances[b].total_cmp(&variances[a]));
        for &v in order.iter().take(wanted) {
            // Below this, single-precision rows contain only rounding errors.
            if variances[v] <= 1e-11 * total || variances[v] <= 0.0 {
                break;
            }
            let mut axis = vec![0.0; padded];
            for (i, row) in subspace.chunks_exact(padded).enumerate() {
                crate::solve::vector::add_scaled(&mut axis, vectors[i * m + v], row);
            }
            self.axes.extend_from_slice(&axis);
            self.variance.push(variances[v]);
        }
        self.dimensions = self.variance.len();
    }
}

/// Gram-Schmidt orthonormalisation, twice for each row; rows that vanish become zero.
fn orthonormalise(rows: &mut [f64], length: usize) {
    use crate::solve::vector::{add_scaled, dot};
    for i in 0..rows.len() / length {
        let (done, rest) = rows.split_at_mut(i * length);
        let row = &mut rest[..length];
        let before = dot(row, row);
        for _ in 0..2 {
            for other in done.chunks_exact(length) {
                let along = dot(other, row);
                add_scaled(row, -along, other);
            }
        }
        let left = dot(row, row);
        let scale = if left > 1e-24 * before && left > 0.0 { 1.0 / left.sqrt() } else { 0.0 };
        row.iter_mut().for_each(|v| *v *= scale);
    }
}

/// Eigenvalues and eigenvectors (in columns) of a symmetric `n x n` matrix by cyclic Jacobi rotations.
fn jacobi(mut a: Vec<f64>, n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut v = vec![0.0; n * n];
    (0..n).for_each(|i| v[i * n + i] = 1.0);
    let scale: f64 = a.iter().map(|x| x * x).sum();
    // Convergence is quadratic; thirty sweeps are several times as many as any matrix needs.
    for _ in 0..30 {
        let mut off = 0.0;
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                off += apq * apq;
                if apq == 0.0 {
                    continue;
                }
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for i in 0..n {
                    let (x, y) = (a[i * n + p], a[i * n + q]);
                    a[i * n + p] = c * x - s * y;
                    a[i * n + q] = s * x + c * y;
                }
                for i in 0..n {
                    let (x, y) = (a[p * n + i], a[q * n + i]);
                    a[p * n + i] = c * x - s * y;
                    a[q * n + i] = s * x + c * y;
                    let (x, y) = (v[i * n + p], v[i * n + q]);
                    v[i * n + p] = c * x - s * y;
                    v[i * n + q] = s * x + c * y;
                }
            }
        }
        if off <= 1e-30 * scale {
            break;
        }
    }
    ((0..n).map(|i| a[i * n + i]).collect(), v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Space;
    use crate::factor::columns::Columns;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_are_turned_into_multiples(values in prop::collection::vec(-1.0f64..1.0, 25)) {
            let matrix: Vec<f64> = (0..25).map(|i| values[i] + values[i % 5 * 5 + i / 5]).collect();
            let (eigenvalues, vectors) = jacobi(matrix.clone(), 5);
            for v in 0..5 {
                for i in 0..5 {
                    let image: f64 = (0..5).map(|j| matrix[i * 5 + j] * vectors[j * 5 + v]).sum();
                    prop_assert!((image - eigenvalues[v] * vectors[i * 5 + v]).abs() < 1e-12);
                }
            }
        }
    }

    /// Materials on a plane have two axes, and distances in their coordinates equal those in the tangent.
    #[test]
    fn axes_of_a_plane_keep_its_distances() {
        let columns = Columns::new(&Space::half_angle(8), &[1.0; 24]);
        let n = 50;
        let x: Vec<f32> = (0..n)
            .flat_map(|i| {
                let (a, b) = ((i * 7 % 50) as f32 / 50.0, (i * 31 % 50) as f32 / 50.0);
                (0..24).map(move |j| 1.0 + a * (j % 3) as f32 + b * (j % 5) as f32)
            })
            .collect();
        let sample = Sample { t: x.clone(), x, weight: vec![1.0 / n as f64; n], columns };
        let pca = Pca::fit(&sample, 6, 1);
        assert_eq!(pca.dimensions, 2);
        let variance: f64 = pca.variance.iter().sum();
        assert!((variance.sqrt() / pca.spread - 1.0).abs() < 1e-6);
        let c = pca.coordinates(&sample);
        for (i, j) in [(0, 1), (3, 40), (17, 29)] {
            let direct: f64 = (0..24)
                .map(|l| {
                    let d = f64::from(sample.row(i)[l] - sample.row(j)[l]);
                    (d * f64::from(sample.columns.omega[l]) / 3.0).powi(2)
                })
                .sum();
            let projected = (c[2 * i] - c[2 * j]).powi(2) + (c[2 * i + 1] - c[2 * j + 1]).powi(2);
            assert!((projected / direct - 1.0).abs() < 1e-4, "{projected} {direct}");
        }
    }
}
