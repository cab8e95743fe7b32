//! The number of bases that a document needs.
//!
//! Method: adds one basis at a time, on a few thousand materials, until the error is below [`ENOUGH`], another basis would
//! gain less than [`GAIN`], or there are [`MOST`] bases. A new basis starts at the best of a few badly represented
//! materials and all bases are refined together, so the error only falls.
//! Cost: about that of one fit with the final number on all materials. Limits: greedy; always decided by metric archetypes,
//! so that all methods use the same number of bases and can be compared.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use observe::Observer;

use super::archetypes::Fit;
use super::hull::Hull;
use super::kmeans::draw;
use super::sample::Sample;

/// The root mean square distance that is small enough: barely visible.
const ENOUGH: f64 = 0.015;
/// The share of the error that another basis must remove.
const GAIN: f64 = 0.05;
/// The most bases that are chosen automatically: as many as the paper used at most.
pub(super) const MOST: usize = 15;
/// Number of materials that the number of bases is chosen by.
pub(super) const MATERIALS: usize = 4000;
const TRIES: usize = 4;
const SWEEPS: usize = 6;

/// As many bases as the document needs, fitted to a part of the sample.
pub(super) fn grow(sample: &Sample, hull: &Hull, slack: f64, seed: u64, observer: &dyn Observer) -> Vec<f32> {
    let most = MOST.min(sample.len());
    observer.begin("choosing the number of bases", most as u64);
    let sample = sample.thinned(MATERIALS);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut fit = refined(&sample, hull, slack, &sample.mean());
    let mut error = fit.total().sqrt();
    observer.advance(1);
    while error > ENOUGH && fit.bases.len() < most * sample.columns.padded {
        let chance: Vec<f64> = fit.distances2().iter().zip(&sample.weight).map(|(d, w)| d * w).collect();
        let mut best: Option<(f64, Fit)> = None;
        for _ in 0..TRIES {
            let mut start = fit.bases.clone();
            start.extend_from_slice(sample.row(draw(&chance, &mut random)));
            let mut trial = Fit::new(&sample, hull, slack, &start);
            trial.sweep();
            let total = trial.total();
            if best.as_ref().is_none_or(|(least, _)| total < *least) {
                best = Some((total, trial));
            }
        }
        let Some((_, mut next)) = best else { break };
        (1..SWEEPS).for_each(|_| _ = next.sweep());
        observer.advance(1);
        let lower = next.total().sqrt();
        if lower > (1.0 - GAIN) * error {
            break;
        }
        (fit, error) = (next, lower);
    }
    observer.end();
    fit.bases
}

fn refined<'a>(sample: &'a Sample, hull: &'a Hull, slack: f64, start: &[f32]) -> Fit<'a> {
    let mut fit = Fit::new(sample, hull, slack, start);
    (0..SWEEPS).for_each(|_| _ = fit.sweep());
    fit
}
