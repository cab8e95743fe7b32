//! The columns that factoring works in, each divided by its mean over the document.
//!
//! Problem: reflectance spans six decades between the columns of a tabulation. That harms single precision, and no floor or
//! damping constant suits all columns.
//! Method: with `x_j = f_j / mean f_j` the metric of [`Space`] becomes
//! `d^2 = sum_j omega_j^2 (cbrt x_j - cbrt x'_j)^2`, `omega_j = W_j cbrt(c_j mean f_j)`: the same numbers, all of
//! order one. The tangent of the metric at the mean material is then `z_j = omega_j x_j / 3`, a space in which distances are
//! Euclidean and mixing is still linear.
//! Limits: rows are `f32`, padded with zeros to a multiple of eight. Targets and mixtures below 1e-12 of the mean of their
//! column count as that much, which changes a distance by at most 1e-4 of its size.

use crate::brdf::Space;
use maths::Maths;

use super::cbrt::cbrt;

/// Values of a column are kept above this share of its mean, for at 0 the cube root's slope is infinite.
const FLOOR: f32 = 1e-12;
/// Rows are padded to a multiple of this, and sums use this many lanes on every processor, so that they are
/// equal on all. Eight single numbers are a register of AVX2.
pub(super) const LANES: usize = 8;

/// Scale and weight of each column. See the module documentation.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// Columns of the tabulation.
    pub real: usize,
    /// Length of a row, a multiple of [`LANES`].
    pub padded: usize,
    /// Mean reflectance of the document in each column (1/sr); 1 where it is 0.
    mean: Vec<f64>,
    /// `1 / mean`, 0 in the padding.
    scale: Vec<f32>,
    /// The weight of each column in the metric; 0 in the padding and in columns that the metric ignores.
    pub omega: Vec<f32>,
}

impl Columns {
    /// The columns of a space for a document with the given mean reflectance (1/sr, one value per column).
    pub fn new(space: &Space, mean: &[f64]) -> Columns {
        let real = space.columns();
        let padded = real.next_multiple_of(LANES);
        let mean: Vec<f64> = mean.iter().map(|&m| if m > 0.0 { m } else { 1.0 }).collect();
        let (mut scale, mut omega) = (vec![0.0; padded], vec![0.0; padded]);
        for j in 0..real {
            scale[j] = (1.0 / mean[j]) as f32;
            omega[j] = (space.weight()[j] * (space.radiance()[j] * mean[j]).cube_root()) as f32;
        }
        Columns { real, padded, mean, scale, omega }
    }

    /// Converts reflectance to a row of this space; `x` has `padded` places.
    pub fn scale(&self, reflectance: &[f32], x: &mut [f32]) {
        for ((x, &f), &s) in x.iter_mut().zip(reflectance).zip(&self.scale) {
            *x = f.max(0.0) * s;
        }
        x[self.real..].fill(0.0);
    }

    /// Converts a row of this space to reflectance in 1/sr.
    pub fn reflectance(&self, x: &[f32]) -> Vec<f64> {
        self.mean.iter().zip(x).map(|(&m, &x)| f64::from(x) * m).collect()
    }

    /// The perceptual response to a row, `t_j = omega_j cbrt x_j`: a space with Euclidean distances.
    pub fn respond(&self, x: &[f32], t: &mut [f32]) {
        for ((t, &x), &omega) in t.iter_mut().zip(x).zip(&self.omega) {
            *t = omega * cbrt(x.max(FLOOR));
        }
    }

    /// Compares the response of a mixture with that of a target: `root_j = cbrt x_j` and `residual_j = omega_j root_j -
    /// t_j`. Returns the squared distance.
    pub fn compare(&self, x: &[f32], t: &[f32], root: &mut [f32], residual: &mut [f32]) -> f64 {
        let n = self.padded;
        let (x, t, omega) = (&x[..n], &t[..n], &self.omega[..n]);
        let (root, residual) = (&mut root[..n], &mut residual[..n]);
        for j in 0..n {
            root[j] = cbrt(x[j].max(FLOOR));
            residual[j] = omega[j] * root[j] - t[j];
        }
        f64::from(dot(residual, residual))
    }

    /// The squared distance between a mixture and the response of a target, without intermediate results.
    pub fn distance2(&self, x: &[f32], t: &[f32]) -> f64 {
        let mut sums = [0.0f32; LANES];
        let blocks = x.chunks_exact(LANES).zip(t.chunks_exact(LANES)).zip(self.omega.chunks_exact(LANES));
        for ((x, t), omega) in blocks {
            for lane in 0..LANES {
                let r = omega[lane] * cbrt(x[lane].max(FLOOR)) - t[lane];
                sums[lane] += r * r;
            }
        }
        f64::from(fold(sums))
    }

    /// The slope of the response at a row with the cube roots `root`: `D_j = omega_j / (3 root_j^2)`.
    pub fn slope(&self, root: &[f32], slope: &mut [f32]) {
        for ((d, &root), &omega) in slope.iter_mut().zip(root).zip(&self.omega) {
            *d = omega / (3.0 * root * root);
        }
    }
}

#[inline(always)]
fn fold([a, b, c, d, e, f, g, h]: [f32; LANES]) -> f32 {
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

/// The inner product of two padded rows, in [`LANES`] running sums.
#[inline]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    fold(sums)
}

/// `out = sum_l a_l rows_l` for rows of `out`'s length.
#[inline]
pub(super) fn mix(rows: &[f32], a: &[f64], out: &mut [f32]) {
    out.fill(0.0);
    for (row, &a) in rows.chunks_exact(out.len()).zip(a) {
        if a != 0.0 {
            let a = a as f32;
            for (out, &row) in out.iter_mut().zip(row) {
                *out += a * row;
            }
        }
    }
}

/// `sum += s row`.
#[inline]
pub(super) fn accumulate(sum: &mut [f32], s: f32, row: &[f32]) {
    for (sum, &v) in sum.iter_mut().zip(row) {
        *sum += s * v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_are_those_of_the_space(
            a in prop::collection::vec(1e-4f32..5.0, 30), b in prop::collection::vec(1e-4f32..5.0, 30)
        ) {
            let space = Space::half_angle(10);
            let double = |v: &[f32]| v.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
            let mean: Vec<f64> = a.iter().zip(&b).map(|(&a, &b)| f64::from(a + b) / 2.0).collect();
            let columns = Columns::new(&space, &mean);
            let mut x = vec![vec![0.0; columns.padded]; 2];
            columns.scale(&a, &mut x[0]);
            columns.scale(&b, &mut x[1]);
            let mut t = vec![0.0; columns.padded];
            columns.respond(&x[1], &mut t);
            let expected = space.distance(&double(&a), &double(&b));
            let (mut root, mut residual) = (t.clone(), t.clone());
            for d2 in [columns.distance2(&x[0], &t), columns.compare(&x[0], &t, &mut root, &mut residual)] {
                prop_assert!((d2.sqrt() - expected).abs() < 1e-6 * (1.0 + expected), "{} {expected}", d2.sqrt());
            }
        }

        #[test]
        fn the_slope_is_the_derivative_of_the_response(x in prop::collection::vec(1e-2f32..50.0, 24)) {
            let columns = Columns::new(&Space::half_angle(8), &[0.3; 24]);
            let (mut at, mut root) = (vec![0.0; 24], vec![0.0; 24]);
            columns.compare(&x, &at.clone(), &mut root, &mut at);
            let mut slope = vec![0.0; 24];
            columns.slope(&root, &mut slope);
            for j in 0..24 {
                let (v, omega) = (f64::from(x[j]), f64::from(columns.omega[j]));
                let h = 1e-4 * v;
                let difference = omega * ((v + h).cbrt() - (v - h).cbrt()) / (2.0 * h);
                prop_assert!((f64::from(slope[j]) / difference - 1.0).abs() < 1e-5);
            }
        }
    }
}
