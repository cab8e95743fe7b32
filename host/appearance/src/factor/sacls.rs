//! Sparse alternating constrained least squares, the paper's first method of factoring.
//!
//! Problem: `min |Z - A B|^2`, the rows of A on the simplex, B not negative, with most of each pixel in one basis.
//! Method: works in the tangent of the metric at the mean material, where distances are Euclidean. Weights by exact simplex
//! least squares with a penalty `lambda s` on all but the dominant weight of each material (s: the mean squared length of
//! Z); bases by non-negative least squares, column by column with one shared matrix. The penalty grows over the first
//! iterations and then stays constant until the objective settles; from then on the objective never rises.
//! Cost: `O(materials k columns)` per iteration. Limits: nothing keeps the bases inside the document, and they leave it,
//! often by more than its spread. Reconstruction is the best of all methods, but prints need not be.
//! Source: Lawrence et al. 2006 for the problem; the growing penalty is new here.

use crate::solve::{Gram, SimplexBatch};
use maths::Maths;

use super::columns::{accumulate, dot, mix};
use super::parts;
use super::sample::Sample;

/// The most iterations, so that one that does not settle ends; the penalty has its full strength after
/// [`RAMP`] of them.
pub(super) const ITERATIONS: usize = 60;
/// Iterations in which the penalty rises, 60 % of all, so that the others settle under the full one.
const RAMP: usize = 36;
/// The relative decrease of the objective below which it has settled.
const SETTLED: f64 = 1e-4;
/// Materials whose weights the others start from in the first round. Later ones start from their own.
const TYPICAL: usize = 64;

/// Improves `bases` (rows of the sample's columns); `lambda` is the sparsity. `done` is called after each iteration, with
/// the objective once the penalty is constant.
pub(super) fn refine(sample: &Sample, bases: &mut [f32], lambda: f64, mut done: impl FnMut(Option<f64>)) {
    let padded = sample.columns.padded;
    let k = bases.len() / padded;
    let tangent2: Vec<f32> = sample.columns.omega.iter().map(|o| (o / 3.0).squared()).collect();
    let scale: f64 = (0..sample.len()).map(|i| sample.weight[i] * length2(sample.row(i), &tangent2)).sum();
    // None are known before the first round.
    let mut weights = vec![0.0; sample.len() * k];
    let mut last: Option<f64> = None;
    for iteration in 0..ITERATIONS {
        let held = iteration >= RAMP;
        let strength = lambda * (iteration.min(RAMP) as f64 / RAMP as f64);
        // The first round has no dominant weights yet: plain least squares.
        let typical = if iteration == 0 { TYPICAL } else { 0 };
        let step = code(sample, bases, &tangent2, &mut weights, 0.5 * strength * scale, typical);
        solve_bases(&step, bases, padded);
        let objective = held.then(|| objective(sample, bases, &tangent2, &weights, strength * scale));
        done(objective);
        if let (Some(last), Some(now)) = (last, objective)
            && last - now <= SETTLED * last
        {
            break;
        }
        last = objective;
    }
}

/// The normal equations of the basis step: `A'A` and `A'X`, weighted by material.
struct Normal {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

/// Computes the weights of every material, with a `bonus` for the dominant one, from those of the last round or of some `typical`
/// materials. Returns their normal equations.
fn code(
    sample: &Sample,
    bases: &[f32],
    tangent2: &[f32],
    weights: &mut [f64],
    bonus: f64,
    typical: usize,
) -> Normal {
    let padded = sample.columns.padded;
    let k = bases.len() / padded;
    let seen: Vec<f32> =
        bases.chunks_exact(padded).flat_map(|row| row.iter().zip(tangent2).map(|(b, t)| b * t)).collect();
    let mut gram = Gram::empty();
    gram.refill_products(k, |i, j| f64::from(dot(&seen[i * padded..][..padded], &bases[j * padded..])));
    let products = |i: usize, h: &mut [f64]| {
        for (h, row) in h.iter_mut().zip(seen.chunks_exact(padded)) {
            *h = f64::from(dot(row, sample.row(i)));
        }
    };
    let typical = typical.min(sample.len());
    let mut some = vec![0.0; typical * k];
    some.chunks_exact_mut(k).enumerate().for_each(|(i, h)| products(i * sample.len() / typical, h));
    // Sizes agree and numbers are finite, so there is a solution, near that of the last round.
    let lanes = SimplexBatch::new(&gram, &some);
    let partial = parts::each_mut(sample.len(), weights, k, |range, weights| {
        let mut matrix = vec![0.0f64; k * k];
        let mut right = vec![0.0f32; k * padded];
        let mut h = vec![0.0; range.len() * k];
        for ((i, h), a) in range.clone().zip(h.chunks_exact_mut(k)).zip(weights.chunks_exact(k)) {
            products(i, h);
            h[dominant(a)] += bonus;
        }
        let _ = lanes.clone().and_then(|mut lanes| lanes.solve_from(&h, weights));
        for (i, a) in range.zip(weights.chunks_exact(k)) {
            let x = sample.row(i);
            let w = sample.weight[i];
            for (l, &al) in a.iter().enumerate().filter(|(_, a)| **a > 0.0) {
                matrix[l * k..][..k].iter_mut().zip(a.iter()).for_each(|(m, &am)| *m += w * al * am);
                accumulate(&mut right[l * padded..][..padded], (w * al) as f32, x);
            }
        }
        (matrix, right)
    });
    let (matrices, rights): (Vec<_>, Vec<_>) = partial.into_iter().unzip();
    let mut normal = Normal { matrix: vec![0.0; k * k], right: vec![0.0; k * padded] };
    parts::add(matrices, &mut normal.matrix);
    parts::add(rights, &mut normal.right);
    normal
}

/// Non-negative least squares for every column, by coordinate descent from the current bases. Each step lowers the
/// objective, and the current bases nearly solve the problem already.
fn solve_bases(normal: &Normal, bases: &mut [f32], padded: usize) {
    let k = bases.len() / padded;
    let mut b = vec![0.0; k];
    for j in 0..padded {
        b.iter_mut().enumerate().for_each(|(l, b)| *b = f64::from(bases[l * padded + j]));
        nnls(&normal.matrix, |l| normal.right[l * padded + j], &mut b);
        b.iter().enumerate().for_each(|(l, &b)| bases[l * padded + j] = b as f32);
    }
}

/// `min 1/2 b'Nb - r'b` over `b >= 0`, from a start.
fn nnls(matrix: &[f64], right: impl Fn(usize) -> f64, b: &mut [f64]) {
    let k = b.len();
    for _ in 0..200 {
        let mut moved = 0.0f64;
        let mut size = 0.0f64;
        for l in 0..k {
            let row = &matrix[l * k..][..k];
            // A basis that no material uses does not move.
            if row[l] <= 1e-12 {
                continue;
            }
            let slope: f64 = row.iter().zip(b.iter()).map(|(m, b)| m * b).sum::<f64>() - right(l);
            let next = (b[l] - slope / row[l]).max(0.0);
            moved = moved.max((next - b[l]).abs());
            size = size.max(next);
            b[l] = next;
        }
        if moved <= 1e-9 * size {
            break;
        }
    }
}

fn dominant(a: &[f64]) -> usize {
    let mut best = 0;
    for (i, &w) in a.iter().enumerate() {
        if w > a[best] {
            best = i;
        }
    }
    best
}

fn length2(x: &[f32], tangent2: &[f32]) -> f64 {
    x.iter().zip(tangent2).map(|(&x, &t)| f64::from(x) * f64::from(x) * f64::from(t)).sum()
}

fn objective(sample: &Sample, bases: &[f32], tangent2: &[f32], weights: &[f64], penalty: f64) -> f64 {
    let k = bases.len() / sample.columns.padded;
    parts::each(sample.len(), |range| {
        let mut model = vec![0.0; sample.columns.padded];
        range
            .map(|i| {
                let a = &weights[i * k..][..k];
                mix(bases, a, &mut model);
                model.iter_mut().zip(sample.row(i)).for_each(|(m, x)| *m -= x);
                sample.weight[i] * (length2(&model, tangent2) + penalty * (1.0 - a[dominant(a)]))
            })
            .sum::<f64>()
    })
    .iter()
    .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Checks the optimality conditions, which do not depend on the method.
        #[test]
        fn non_negative_least_squares_meets_its_optimality_conditions(
            a in prop::collection::vec(-1.0f64..1.0, 20 * 4), y in prop::collection::vec(-1.0f64..1.0, 20)
        ) {
            let mut matrix = [0.0; 16];
            let mut right = [0.0; 4];
            for (row, y) in a.chunks_exact(4).zip(&y) {
                for l in 0..4 {
                    right[l] += row[l] * y;
                    (0..4).for_each(|m| matrix[l * 4 + m] += row[l] * row[m]);
                }
            }
            let mut b = [0.0; 4];
            nnls(&matrix, |l| right[l], &mut b);
            for l in 0..4 {
                let slope: f64 = (0..4).map(|m| matrix[l * 4 + m] * b[m]).sum::<f64>() - right[l];
                prop_assert!(b[l] >= 0.0 && slope > -1e-6 && (b[l] == 0.0 || slope < 1e-6), "{b:?} {slope}");
            }
        }
    }

    #[test]
    fn the_objective_never_rises_while_the_penalty_is_constant() {
        let sample = Sample::draw(&crate::factor::tests::noisy_mixtures(1500), 3).unwrap();
        let mut bases = sample.x[..4 * sample.columns.padded].to_vec();
        let mut held = Vec::new();
        refine(&sample, &mut bases, 0.03, |objective| held.extend(objective));
        assert!(held.len() > 1);
        for pair in held.windows(2) {
            assert!(pair[1] <= pair[0] * (1.0 + 1e-6), "{held:?}");
        }
    }
}
