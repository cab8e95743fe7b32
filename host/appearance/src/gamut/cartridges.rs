//! Choosing cartridges: the printer holds seven, the library has more.
//!
//! Problem: of the inks in the best mixtures, keep as many as fit with the smallest loss.
//! Method: greedy. While there are too many inks, the mixtures are solved again without each of them in turn, and the ink
//! with the smallest loss (mean squared distance) is left out. Cost: targets times inks in use for each ink left out, about
//! 50 microseconds each. Limits: a greedy choice is not optimal. For example, it may leave out both of two inks that can
//! replace each other where leaving out a third ink would have been better.

use inks::InkSet;
use protocol::ink::Ink;
use rayon::prelude::*;

use super::candidates::Candidates;
use super::error::GamutError;
use super::prune::PRUNED;
use super::report::GivenUp;
use crate::solve::{Hull, Mixer, MixtureError, Target};
use observe::Observer;

/// The stacks to mix from so that at most `most` inks are used, and the inks left out.
pub(super) fn choose(
    candidates: &Candidates,
    targets: &[Target],
    importance: &[f64],
    most: usize,
    observer: &dyn Observer,
) -> Result<(Vec<usize>, Vec<GivenUp>), GamutError> {
    let all: Vec<usize> = (0..candidates.len()).collect();
    let inks_of = |stacks: &[usize]| InkSet::of(stacks.iter().flat_map(|&k| candidates.inks[k].iter()));
    let mut given_up = Vec::new();
    if inks_of(&all).len() <= most {
        return Ok((all, given_up));
    }
    let failed = |source| GamutError::Mixture { what: "choosing cartridges".into(), source };
    observer.begin("choosing cartridges", (inks_of(&all).len() - most) as u64);
    let mut allowed = all;
    let mut state = solve_all(candidates, &allowed, targets, None).map_err(failed)?;
    loop {
        let used: Vec<usize> =
            allowed.iter().copied().filter(|&k| state.iter().any(|s| s.weights[k] >= PRUNED)).collect();
        let inks: Vec<Ink> = inks_of(&used).iter().collect();
        if inks.len() <= most {
            observer.end();
            // Only inks in use, so that a pixel outside the sample cannot need another cartridge.
            let inks = InkSet::of(inks);
            allowed.retain(|&k| candidates.inks[k].iter().all(|ink| inks.contains(ink)));
            return if allowed.is_empty() {
                Err(GamutError::Cartridges { most })
            } else {
                Ok((allowed, given_up))
            };
        }
        let mut best: Option<(f64, Ink, Vec<usize>, Vec<Solved>)> = None;
        for ink in inks {
            let without: Vec<usize> =
                allowed.iter().copied().filter(|&k| !candidates.inks[k].contains(ink)).collect();
            if without.is_empty() {
                continue;
            }
            let solved = solve_all(candidates, &without, targets, Some((&state, ink))).map_err(failed)?;
            let loss = mean_square(&solved, importance);
            if best.as_ref().is_none_or(|(least, ..)| loss < *least) {
                best = Some((loss, ink, without, solved));
            }
        }
        let Some((after, ink, without, solved)) = best else {
            return Err(GamutError::Cartridges { most });
        };
        given_up.push(GivenUp { ink, before: mean_square(&state, importance).sqrt(), after: after.sqrt() });
        (allowed, state) = (without, solved);
        observer.advance(1);
    }
}

#[derive(Clone)]
struct Solved {
    /// One weight per candidate.
    weights: Vec<f64>,
    distance: f64,
}

fn mean_square(solved: &[Solved], importance: &[f64]) -> f64 {
    let total: f64 = importance.iter().sum();
    let sum: f64 = solved.iter().zip(importance).map(|(s, w)| w * s.distance * s.distance).sum();
    if total > 0.0 { sum / total } else { 0.0 }
}

/// The best mixture of the allowed stacks for each target. Mixtures that did not use the ink that is left out are kept.
fn solve_all(
    candidates: &Candidates,
    allowed: &[usize],
    targets: &[Target],
    before: Option<(&[Solved], Ink)>,
) -> Result<Vec<Solved>, MixtureError> {
    let hull: Hull = candidates.priced.subset(allowed);
    targets
        .par_iter()
        .enumerate()
        .map_init(Mixer::new, |mixer, (i, target)| {
            if let Some((state, ink)) = before {
                let uses = |(k, w): (usize, &f64)| *w > 0.0 && candidates.inks[k].contains(ink);
                if !state[i].weights.iter().enumerate().any(uses) {
                    return Ok(state[i].clone());
                }
            }
            let mut a = vec![0.0; allowed.len()];
            mixer.tangent(&hull, target, &mut a)?;
            let fit = mixer.refine(&hull, target, &mut a, 1e-8)?;
            let mut weights = vec![0.0; candidates.len()];
            allowed.iter().zip(&a).for_each(|(&k, &w)| weights[k] = w);
            Ok(Solved { weights, distance: fit.distance })
        })
        .collect()
}
