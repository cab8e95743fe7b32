//! Metric archetypes: bases at the corners of the document, fitted in the metric itself.
//!
//! Problem: minimise the mean squared perceptual distance between materials and mixtures of k bases, each within `delta`
//! document spreads of the hull of the document. With `delta = 0` this is archetypal analysis in the metric of the paper's
//! appendix.
//! Method: weights by Gauss-Newton on the simplex ([`super::code`]); then all bases by one Gauss-Newton model of the total,
//! whose normal matrix couples bases only within a column. The model is minimised basis by basis. For one basis it is a
//! weighted distance, column by column, from the best unconstrained position, so the constrained minimum is a projection:
//! onto the hull of the document's corners, plus an excess limited by `delta`. Both sets are convex, so any part of the
//! step is feasible too, and the step is halved until the total falls; the total never rises. A basis without users
//! restarts at the worst represented material.
//! Cost: `O(materials k^2 columns)` per sweep. Limits: a local minimum near the start.
//! Source: Cutler & Breiman 1994 for the hull constraint; the metric, the slack and the descent are new here.

use super::code::{Coder, Scratch};
use super::columns::{accumulate, mix};
use super::hull::{Combination, Hull, Workspace};
use super::parts;
use super::sample::Sample;
use maths::Maths;

/// Gauss-Newton steps for the weights in each sweep.
const WEIGHT_STEPS: u32 = 2;
/// Rounds over the bases for one model.
const ROUNDS: usize = 3;
/// Levenberg's damping, as a share of the curvature.
const DAMPING: f64 = 1e-3;
/// A basis with less than this share of the document is unused.
const UNUSED: f64 = 1e-6;

/// A fit in progress.
pub(super) struct Fit<'a> {
    sample: &'a Sample,
    hull: &'a Hull,
    /// The largest distance of a basis from the hull, in the tangent.
    slack: f64,
    k: usize,
    /// The bases, as rows of the sample's columns; always in the hull plus slack.
    pub bases: Vec<f32>,
    parts: Vec<Part>,
    weights: Vec<f64>,
}

/// A basis as a mixture of real materials plus an excess.
#[derive(Clone)]
struct Part {
    real: Combination,
    excess: Vec<f64>,
}

/// Sums over the materials: the Gauss-Newton model of the total around the current bases.
struct Model {
    /// For each pair of bases `l >= m` and column: `sum w a_l a_m D^2`.
    curvature: Vec<f64>,
    /// For each basis and column: `sum w a_l D r`.
    gradient: Vec<f64>,
    /// The share of the document of each basis.
    usage: Vec<f64>,
    /// Mean squared distance.
    total: f64,
    /// The worst represented material of each part, with its squared distance.
    worst: Vec<(f64, usize)>,
}

impl<'a> Fit<'a> {
    /// A fit that starts at the feasible points nearest to the given bases.
    pub fn new(sample: &'a Sample, hull: &'a Hull, slack: f64, start: &[f32]) -> Fit<'a> {
        let padded = sample.columns.padded;
        let k = start.len() / padded;
        let mut fit =
            Fit { sample, hull, slack, k, bases: Vec::new(), parts: Vec::new(), weights: Vec::new() };
        for row in start.chunks_exact(padded) {
            let row: Vec<f64> = row.iter().map(|&b| f64::from(b)).collect();
            let (part, basis) =
                fit.allowed(&row, &fit.tangent2(), Combination::default(), &mut Workspace::new());
            fit.parts.push(part);
            fit.bases.extend(basis.iter().map(|&b| b as f32));
        }
        let coder = Coder::new(&sample.columns, &fit.bases);
        let mut weights = vec![0.0; sample.len() * k];
        parts::each_mut(sample.len(), &mut weights, k, |range, weights| {
            let mut scratch = coder.scratch();
            for (i, a) in range.zip(weights.chunks_exact_mut(k)) {
                coder.code(sample.row(i), sample.target(i), a, &mut scratch);
            }
        });
        fit.weights = weights;
        fit
    }

    /// One sweep over weights and bases. Returns the mean squared distance before the bases move, which never exceeds that
    /// after the previous sweep.
    pub fn sweep(&mut self) -> f64 {
        let model = self.improve_weights();
        let unused = model.usage.iter().position(|&u| u < UNUSED);
        if let Some(l) = unused
            && let Some(&(worst, i)) = model.worst.iter().max_by(|a, b| a.0.total_cmp(&b.0))
            && worst > 0.0
        {
            self.restart(l, i);
        }
        let (parts, target) = self.minimise(&model, unused);
        self.search(parts, &target);
        model.total
    }

    /// The weight of each column in squared distances in the tangent of the metric.
    fn tangent2(&self) -> Vec<f64> {
        self.sample.columns.omega.iter().map(|&o| (f64::from(o) / 3.0).squared()).collect()
    }

    /// Improves the weights and sets up the model around them, in one pass.
    fn improve_weights(&mut self) -> Model {
        let (sample, k, padded) = (self.sample, self.k, self.sample.columns.padded);
        let coder = Coder::new(&sample.columns, &self.bases);
        let pairs = k * (k + 1) / 2;
        let partial = parts::each_mut(sample.len(), &mut self.weights, k, |range, weights| {
            let mut scratch = coder.scratch();
            let mut curvature = vec![0.0f32; pairs * padded];
            let mut gradient = vec![0.0f32; k * padded];
            let mut square = vec![0.0f32; padded];
            let mut usage = vec![0.0f64; k];
            let (mut total, mut worst) = (0.0, (0.0, 0));
            for (i, a) in range.zip(weights.chunks_exact_mut(k)) {
                let w = sample.weight[i];
                let d2 = coder.improve(sample.target(i), a, WEIGHT_STEPS, &mut scratch);
                total += w * d2;
                if d2 > worst.0 {
                    worst = (d2, i);
                }
                let Scratch { root, residual, slope, .. } = &mut scratch;
                sample.columns.slope(root, slope);
                for ((square, &d), r) in square.iter_mut().zip(slope.iter()).zip(residual.iter_mut()) {
                    *r *= d;
                    *square = d * d;
                }
                let mut pair = 0;
                for l in 0..k {
                    usage[l] += w * a[l];
                    if a[l] > 0.0 {
                        accumulate(&mut gradient[l * padded..][..padded], (w * a[l]) as f32, residual);
                        for (m, &am) in a[..=l].iter().enumerate() {
                            if am > 0.0 {
                                let place = &mut curvature[(pair + m) * padded..][..padded];
                                accumulate(place, (w * a[l] * am) as f32, &square);
                            }
                        }
                    }
                    pair += l + 1;
                }
            }
            (curvature, gradient, usage, total, worst)
        });
        let mut model = Model {
            curvature: vec![0.0; pairs * padded],
            gradient: vec![0.0; k * padded],
            usage: vec![0.0; k],
            total: 0.0,
            worst: Vec::new(),
        };
        for (curvature, gradient, usage, total, worst) in partial {
            parts::add([curvature], &mut model.curvature);
            parts::add([gradient], &mut model.gradient);
            parts::add([usage], &mut model.usage);
            model.total += total;
            model.worst.push(worst);
        }
        model
    }

    /// Moves an unused basis to a material. No weight depends on it, so the total does not change yet.
    fn restart(&mut self, l: usize, material: usize) {
        let padded = self.sample.columns.padded;
        let row: Vec<f64> = self.sample.row(material).iter().map(|&x| f64::from(x)).collect();
        let (part, basis) =
            self.allowed(&row, &self.tangent2(), Combination::default(), &mut Workspace::new());
        self.parts[l] = part;
        self.bases[l * padded..][..padded].iter_mut().zip(&basis).for_each(|(b, &v)| *b = v as f32);
        for a in self.weights.chunks_exact_mut(self.k) {
            let rest = 1.0 - a[l];
            if rest > 0.5 {
                a[l] = 0.0;
                a.iter_mut().for_each(|a| *a /= rest);
            }
        }
    }

    /// The constrained minimum of the model, basis by basis.
    fn minimise(&self, model: &Model, skip: Option<usize>) -> (Vec<Part>, Vec<f64>) {
        let (k, padded) = (self.k, self.sample.columns.padded);
        let mut bases: Vec<f64> = self.bases.iter().map(|&b| f64::from(b)).collect();
        let mut parts = self.parts.clone();
        let mut gradient = model.gradient.clone();
        let curvature = |l: usize, m: usize| {
            let (l, m) = (l.max(m), l.min(m));
            &model.curvature[(l * (l + 1) / 2 + m) * padded..][..padded]
        };
        let mut workspace = Workspace::new();
        for _ in 0..ROUNDS {
            for l in (0..k).filter(|&l| Some(l) != skip) {
                let own = curvature(l, l);
                // Columns without weight in the metric have no curvature and no gradient; they follow the others.
                let weight: Vec<f64> = own.iter().map(|c| c * (1.0 + DAMPING)).collect();
                let here = &bases[l * padded..][..padded];
                let free: Vec<f64> = (0..padded)
                    .map(|j| {
                        let step = if weight[j] > 0.0 { gradient[l * padded + j] / weight[j] } else { 0.0 };
                        (here[j] - step).max(0.0)
                    })
                    .collect();
                // The real part with the excess fixed, then the excess: each step only lowers the model.
                let aim: Vec<f64> = free.iter().zip(&parts[l].excess).map(|(f, e)| f - e).collect();
                let (part, next) = self.allowed_from(&free, &aim, &weight, parts[l].clone(), &mut workspace);
                let away = |b: &[f64]| -> f64 {
                    b.iter().zip(&free).zip(&weight).map(|((b, f), w)| w * (b - f) * (b - f)).sum()
                };
                if away(&next) >= away(here) {
                    continue;
                }
                for m in 0..k {
                    let coupling = curvature(l, m);
                    for j in 0..padded {
                        gradient[m * padded + j] += coupling[j] * (next[j] - here[j]);
                    }
                }
                bases[l * padded..][..padded].copy_from_slice(&next);
                parts[l] = part;
            }
        }
        (parts, bases)
    }

    /// The feasible point nearest to `free`: the nearest real point, plus as much of the rest as the slack allows.
    fn allowed(
        &self,
        free: &[f64],
        weight: &[f64],
        real: Combination,
        workspace: &mut Workspace,
    ) -> (Part, Vec<f64>) {
        let part = Part { real, excess: vec![0.0; free.len()] };
        self.allowed_from(free, free, weight, part, workspace)
    }

    fn allowed_from(
        &self,
        free: &[f64],
        aim: &[f64],
        weight: &[f64],
        mut part: Part,
        workspace: &mut Workspace,
    ) -> (Part, Vec<f64>) {
        let mut point = vec![0.0; free.len()];
        self.hull.project(aim, weight, &mut part.real, &mut point, workspace);
        let tangent2 = self.tangent2();
        let excess: Vec<f64> = free.iter().zip(&point).map(|(f, p)| f - p).collect();
        let length = excess.iter().zip(&tangent2).map(|(e, t)| t * e * e).sum::<f64>().sqrt();
        let share = if length > self.slack { self.slack / length } else { 1.0 };
        // `free` and the real point are not negative, so no point between them is.
        part.excess.iter_mut().zip(&excess).for_each(|(e, v)| *e = share * v);
        point.iter_mut().zip(&part.excess).for_each(|(p, e)| *p = (*p + e).max(0.0));
        (part, point)
    }

    /// Moves toward the minimum of the model, halving the step until the total falls.
    fn search(&mut self, parts: Vec<Part>, target: &[f64]) {
        let start = self.bases.clone();
        let total = self.total();
        let mut share = 1.0;
        while share > 0.01 {
            for ((b, &from), &to) in self.bases.iter_mut().zip(&start).zip(target) {
                *b = (f64::from(from) + share * (to - f64::from(from))) as f32;
            }
            if self.total() < total {
                let old = std::mem::replace(&mut self.parts, parts);
                if share < 1.0 {
                    self.move_parts(&old, share);
                }
                return;
            }
            share *= 0.5;
        }
        self.bases = start;
    }

    /// Adjusts the parts of bases that moved only `share` of the way.
    fn move_parts(&mut self, old: &[Part], share: f64) {
        for (part, old) in self.parts.iter_mut().zip(old) {
            part.real = old.real.towards(&part.real, share);
            part.excess.iter_mut().zip(&old.excess).for_each(|(e, o)| *e = o + share * (*e - o));
        }
    }

    /// The mean squared distance of the current weights and bases.
    pub fn total(&self) -> f64 {
        let (sample, k) = (self.sample, self.k);
        parts::each(sample.len(), |range| {
            let mut model = vec![0.0; sample.columns.padded];
            range
                .map(|i| {
                    mix(&self.bases, &self.weights[i * k..][..k], &mut model);
                    sample.weight[i] * sample.columns.distance2(&model, sample.target(i))
                })
                .sum::<f64>()
        })
        .iter()
        .sum()
    }

    /// The squared distance of each material.
    pub fn distances2(&self) -> Vec<f64> {
        let (sample, k) = (self.sample, self.k);
        parts::each(sample.len(), |range| {
            let mut model = vec![0.0; sample.columns.padded];
            range
                .map(|i| {
                    mix(&self.bases, &self.weights[i * k..][..k], &mut model);
                    sample.columns.distance2(&model, sample.target(i))
                })
                .collect::<Vec<f64>>()
        })
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::factor::pca::Pca;
    use crate::factor::tests::noisy_mixtures;

    #[test]
    fn the_total_never_rises_and_bases_stay_within_the_slack() {
        let sample = Sample::draw(&noisy_mixtures(2500), 1).unwrap();
        let pca = Pca::fit(&sample, 10, 1);
        let hull = Hull::of_corners(&sample, &pca, 1);
        for delta in [0.0, 0.05, 0.5] {
            // A bad start: five neighbours in one corner.
            let start = sample.x[..5 * sample.columns.padded].to_vec();
            let mut fit = Fit::new(&sample, &hull, delta * pca.spread, &start);
            let first = fit.total();
            let mut last = first;
            for sweep in 0..25 {
                let total = fit.sweep();
                assert!(total <= last * (1.0 + 1e-6), "sweep {sweep}: {last} then {total}");
                let moved = fit.total();
                assert!(moved <= total * (1.0 + 1e-6), "sweep {sweep}: {total} then {moved}");
                last = moved;
            }
            assert!(last < 0.5 * first, "{first} {last}");
            let excursions = crate::factor::hull::excursions(&sample, &pca, &fit.bases);
            assert!(excursions.iter().all(|&e| e < delta + 1e-3), "delta {delta}: {excursions:?}");
        }
    }

    /// The gradient of the model against finite differences of the total.
    #[test]
    fn the_gradient_is_that_of_the_total() {
        let sample = Sample::draw(&noisy_mixtures(400), 2).unwrap();
        let pca = Pca::fit(&sample, 10, 1);
        let hull = Hull::of_corners(&sample, &pca, 1);
        let padded = sample.columns.padded;
        let mut fit = Fit::new(&sample, &hull, 0.0, &sample.x[..3 * padded]);
        let model = fit.improve_weights();
        let size = model.gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
        for place in (0..3 * padded).step_by(5) {
            let at = fit.bases[place];
            // Single precision needs a coarse difference and tolerance.
            let h = 0.02 * at.max(0.05);
            let mut total = |v: f32| {
                fit.bases[place] = v;
                let total = fit.total();
                fit.bases[place] = at;
                total
            };
            let difference = (total(at + h) - total(at - h)) / (4.0 * f64::from(h));
            assert!(
                (difference - model.gradient[place]).abs() < 0.01 * size,
                "{difference} {}",
                model.gradient[place]
            );
        }
    }
}
