//! The weights of one material over given bases, in the true metric: equation 1 with bases for stacks.
//!
//! Problem: minimise `E(a) = 1/2 sum_j (omega_j cbrt((aB)_j) - t_j)^2` over the simplex, for every pixel.
//! Method: Gauss-Newton. Around the current mixture the response is linear with slope `D_j`, which gives least squares on
//! the simplex, solved exactly by [`Simplex`]; the step is halved until E falls. The first weights are those of the tangent
//! at the target, so they depend on the pixel alone and not on its neighbours. Where E is convex (no column brighter than
//! eight times its target), the Frank-Wolfe gap `a.q - min q`, with q the gradient, bounds the remaining error. The search
//! ends when that is a small share of E, usually after two steps.
//! Cost: `k^2/2` inner products and `columns` cube roots per step. Limits: where a column exceeds eight times its target,
//! the gap is not a bound, although there is still a single valley; [`STEPS`] limits the search.

use crate::solve::{Gram, Simplex};

use super::columns::{Columns, dot, mix};

/// The most Gauss-Newton steps for one material: five are enough for nearly all
/// (decisions/gauss-newton-on-the-simplex.md).
pub(super) const STEPS: u32 = 12;
/// The share of the squared distance that may remain as error: the distance is then accurate to 1e-3 of itself.
const LEFT: f64 = 2e-3;
/// A squared distance too small to improve: a thousandth of a barely visible distance.
const UNSEEN: f64 = 1e-10;

/// Codes materials over given bases.
#[derive(Clone, Debug)]
pub(super) struct Coder<'a> {
    columns: &'a Columns,
    bases: &'a [f32],
    k: usize,
}

/// The workspace of one thread.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// The current mixture.
    pub model: Vec<f32>,
    /// Its cube roots.
    pub root: Vec<f32>,
    /// Its response minus that of the target.
    pub residual: Vec<f32>,
    /// The slope of the response.
    pub slope: Vec<f32>,
    weighted: Vec<f32>,
    rows: Vec<f32>,
    gradient: Vec<f64>,
    next: Vec<f64>,
    trial: Vec<f64>,
    gram: Gram,
    simplex: Simplex,
}

impl<'a> Coder<'a> {
    /// A coder for bases given as rows of [`Columns`]; at least one.
    pub fn new(columns: &'a Columns, bases: &'a [f32]) -> Coder<'a> {
        Coder { columns, bases, k: bases.len() / columns.padded }
    }

    /// A workspace.
    pub fn scratch(&self) -> Scratch {
        let row = vec![0.0; self.columns.padded];
        Scratch {
            model: row.clone(),
            root: row.clone(),
            residual: row.clone(),
            slope: row.clone(),
            weighted: row,
            rows: vec![0.0; self.k * self.columns.padded],
            gradient: vec![0.0; self.k],
            next: vec![0.0; self.k],
            trial: vec![0.0; self.k],
            gram: Gram::empty(),
            simplex: Simplex::new(),
        }
    }

    /// Codes a material without a start. `x` is its row, `t` its response; `a` receives the weights. Returns the squared
    /// distance; `scratch` contains the mixture.
    pub fn code(&self, x: &[f32], t: &[f32], a: &mut [f64], scratch: &mut Scratch) -> f64 {
        if self.k == 1 {
            a[0] = 1.0;
            return self.evaluate(t, a, scratch);
        }
        // The slope at the target, whose response is omega times its root.
        self.columns.compare(x, t, &mut scratch.root, &mut scratch.residual);
        self.columns.slope(&scratch.root, &mut scratch.slope);
        self.linearise(scratch);
        for (w, (&d, &x)) in scratch.weighted.iter_mut().zip(scratch.slope.iter().zip(x)) {
            *w = d * d * x;
        }
        for (q, row) in scratch.gradient.iter_mut().zip(self.bases.chunks_exact(self.columns.padded)) {
            *q = f64::from(dot(row, &scratch.weighted));
        }
        a.fill(0.0);
        // The only possible error is a number that is not finite. All are: `read` bounds rows, the floor bounds slopes.
        if scratch.simplex.solve(&scratch.gram, &scratch.gradient, a).is_err() {
            a.fill(0.0);
            a[0] = 1.0;
        }
        self.improve(t, a, STEPS, scratch)
    }

    /// Improves weights (a point of the simplex) by at most `steps` steps; the distance never grows. Returns the squared
    /// distance.
    pub fn improve(&self, t: &[f32], a: &mut [f64], steps: u32, scratch: &mut Scratch) -> f64 {
        let mut d2 = self.evaluate(t, a, scratch);
        for _ in 0..steps {
            if self.k == 1 || d2 <= UNSEEN {
                break;
            }
            self.columns.slope(&scratch.root, &mut scratch.slope);
            for (w, (&d, &r)) in scratch.weighted.iter_mut().zip(scratch.slope.iter().zip(&scratch.residual))
            {
                *w = d * r;
            }
            for (q, row) in scratch.gradient.iter_mut().zip(self.bases.chunks_exact(self.columns.padded)) {
                *q = f64::from(dot(row, &scratch.weighted));
            }
            let slope: f64 = scratch.gradient.iter().zip(a.iter()).map(|(q, a)| q * a).sum();
            let least = scratch.gradient.iter().copied().fold(f64::INFINITY, f64::min);
            if 2.0 * (slope - least) <= LEFT * d2 + UNSEEN {
                break;
            }
            self.linearise(scratch);
            let Scratch { next, gradient, gram, simplex, .. } = scratch;
            next.copy_from_slice(a);
            if simplex.descend(gram, gradient, next).is_err() {
                break;
            }
            let Some(lower) = self.search(t, a, d2, scratch) else { break };
            d2 = lower;
        }
        d2
    }

    /// Moves from `a` toward `scratch.next`, halving the step until the distance falls. Returns `None` and changes nothing if
    /// it never does.
    fn search(&self, t: &[f32], a: &mut [f64], d2: f64, scratch: &mut Scratch) -> Option<f64> {
        let mut share = 1.0;
        let mut trial = std::mem::take(&mut scratch.trial);
        let mut found = None;
        while share > 1e-3 && found.is_none() {
            for ((trial, &from), &to) in trial.iter_mut().zip(a.iter()).zip(&scratch.next) {
                *trial = from + share * (to - from);
            }
            found = Some(self.evaluate(t, &trial, scratch)).filter(|&lower| lower < d2);
            share *= 0.5;
        }
        match found {
            Some(_) => a.copy_from_slice(&trial),
            None => _ = self.evaluate(t, a, scratch),
        }
        scratch.trial = trial;
        found
    }

    /// Computes and compares the mixture; returns the squared distance.
    pub fn evaluate(&self, t: &[f32], a: &[f64], scratch: &mut Scratch) -> f64 {
        mix(self.bases, a, &mut scratch.model);
        self.columns.compare(&scratch.model, t, &mut scratch.root, &mut scratch.residual)
    }

    /// The bases scaled by the current slope of the response, and their inner products.
    fn linearise(&self, scratch: &mut Scratch) {
        let padded = self.columns.padded;
        let Scratch { rows, slope, gram, .. } = scratch;
        for (out, row) in rows.chunks_exact_mut(padded).zip(self.bases.chunks_exact(padded)) {
            for ((out, &row), &d) in out.iter_mut().zip(row).zip(slope.iter()) {
                *out = row * d;
            }
        }
        let row = |i: usize| &rows[i * padded..][..padded];
        gram.refill_products(self.k, |i, j| f64::from(dot(row(i), row(j))));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Space;
    use proptest::prelude::*;

    const COLUMNS: usize = 12;

    fn setting(values: &[f32]) -> (Space, Columns) {
        let space = Space::half_angle(COLUMNS / 3);
        let rows = values.len() / COLUMNS;
        let mean: Vec<f64> = (0..COLUMNS)
            .map(|j| (0..rows).map(|i| f64::from(values[i * COLUMNS + j])).sum::<f64>() / rows as f64)
            .collect();
        let columns = Columns::new(&space, &mean);
        (space, columns)
    }

    fn scaled(columns: &Columns, values: &[f32]) -> Vec<f32> {
        let mut rows = vec![0.0; values.len() / COLUMNS * columns.padded];
        for (row, x) in values.chunks_exact(COLUMNS).zip(rows.chunks_exact_mut(columns.padded)) {
            columns.scale(row, x);
        }
        rows
    }

    proptest! {
        /// Compared with every mixture on a grid over the simplex, by the definition of the distance. Where a mixture
        /// exceeds 8 times the target the distance is not convex, and the way down may end a little above the least.
        #[test]
        fn no_mixture_on_a_grid_is_nearer(values in prop::collection::vec(0.01f32..3.0, 4 * COLUMNS)) {
            let (space, columns) = setting(&values);
            let rows = scaled(&columns, &values);
            let (bases, x) = rows.split_at(3 * columns.padded);
            let mut t = vec![0.0; columns.padded];
            columns.respond(x, &mut t);
            let coder = Coder::new(&columns, bases);
            let mut a = [0.0; 3];
            let d = coder.code(x, &t, &mut a, &mut coder.scratch()).sqrt();
            prop_assert!((a.iter().sum::<f64>() - 1.0).abs() < 1e-9 && a.iter().all(|&a| a >= 0.0));
            let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
            let (bases, target) = double.split_at(3 * COLUMNS);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let w = [f64::from(i) / 20.0, f64::from(j) / 20.0, f64::from(20 - i - j) / 20.0];
                    let mixture: Vec<f64> = (0..COLUMNS)
                        .map(|c| (0..3).map(|l| w[l] * bases[l * COLUMNS + c]).sum())
                        .collect();
                    let grid = space.distance(&mixture, target);
                    prop_assert!(d <= grid * 1.005 + 1e-5, "{d} at {a:?}, but {grid} at {w:?}");
                }
            }
        }

        #[test]
        fn a_mixture_of_the_bases_is_found_again(
            values in prop::collection::vec(0.01f32..3.0, 5 * COLUMNS), w in prop::collection::vec(0.0f64..1.0, 5)
        ) {
            let (_, columns) = setting(&values);
            let bases = scaled(&columns, &values);
            let sum: f64 = w.iter().sum::<f64>() + 1e-3;
            let w: Vec<f64> = w.iter().map(|w| (w + 2e-4) / sum).collect();
            let (mut x, mut t) = (vec![0.0; columns.padded], vec![0.0; columns.padded]);
            mix(&bases, &w, &mut x);
            columns.respond(&x, &mut t);
            let coder = Coder::new(&columns, &bases);
            let mut a = [0.0; 5];
            let d2 = coder.code(&x, &t, &mut a, &mut coder.scratch());
            prop_assert!(d2.sqrt() < 2e-5, "{}", d2.sqrt());
        }

        #[test]
        fn improving_never_raises_the_distance(values in prop::collection::vec(0.0f32..3.0, 4 * COLUMNS)) {
            let (_, columns) = setting(&values);
            let rows = scaled(&columns, &values);
            let (bases, x) = rows.split_at(3 * columns.padded);
            let mut t = vec![0.0; columns.padded];
            columns.respond(x, &mut t);
            let coder = Coder::new(&columns, bases);
            let mut scratch = coder.scratch();
            let mut a = [0.2, 0.3, 0.5];
            let mut last = coder.evaluate(&t, &a, &mut scratch);
            for _ in 0..6 {
                let next = coder.improve(&t, &mut a, 1, &mut scratch);
                prop_assert!(next <= last);
                prop_assert_eq!(next, coder.evaluate(&t, &a, &mut scratch));
                last = next;
            }
        }
    }
}
