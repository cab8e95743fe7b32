//! Targets fitted to sets of stacks: what cartridges and stacks are chosen by.

use inks::InkSet;
use rayon::prelude::*;

use crate::gamut::candidates::Candidates;
use crate::solve::{Hull, Mixer, MixtureError, Target};

/// Gap in squared distance that decides nothing: a hundredth of what is barely visible, squared.
const ENOUGH: f64 = 1e-8;

/// The weight that must be left of a mixture for it to be a start; the tangent start costs a product of every two stacks.
const ENOUGH_LEFT: f64 = 0.05;

/// Targets, and the importance of each.
pub(crate) struct Targets {
    pub rows: Vec<Target>,
    pub importance: Vec<f64>,
}

/// A target's best mixture of some of the candidates.
#[derive(Clone)]
struct Mixture {
    /// One weight per candidate.
    weights: Vec<f64>,
    distance: f64,
}

/// Every target's best mixture of some of the candidates.
#[derive(Clone)]
pub(crate) struct Fitted {
    mixtures: Vec<Mixture>,
    /// Mean squared distance by importance, in the metric of the candidates.
    pub loss: f64,
}

impl Targets {
    /// The best mixtures of the stacks `allowed`. Mixtures of `before` that use allowed stacks only are kept: those stacks
    /// must be among the ones it was fitted to.
    pub fn fit(
        &self,
        candidates: &Candidates,
        allowed: &[usize],
        before: Option<&Fitted>,
    ) -> Result<Fitted, MixtureError> {
        let hull: Hull = candidates.priced.subset(allowed);
        let mut may = vec![false; candidates.len()];
        allowed.iter().for_each(|&k| may[k] = true);
        let mixtures: Result<Vec<Mixture>, MixtureError> = self
            .rows
            .par_iter()
            .enumerate()
            .map_init(Mixer::new, |mixer, (i, target)| {
                let kept = before.map(|before| &before.mixtures[i]);
                if let Some(kept) =
                    kept.filter(|m| m.weights.iter().zip(&may).all(|(&w, &may)| w <= 0.0 || may))
                {
                    return Ok(kept.clone());
                }
                let mut a = vec![0.0; allowed.len()];
                let left: f64 = kept.map_or(0.0, |m| allowed.iter().map(|&k| m.weights[k]).sum());
                match kept.filter(|_| left > ENOUGH_LEFT) {
                    Some(m) => a.iter_mut().zip(allowed).for_each(|(a, &k)| *a = m.weights[k] / left),
                    None => mixer.tangent(&hull, target, &mut a)?,
                }
                let distance = mixer.refine(&hull, target, &mut a, ENOUGH)?.distance;
                let mut weights = vec![0.0; candidates.len()];
                allowed.iter().zip(&a).for_each(|(&k, &w)| weights[k] = w);
                Ok(Mixture { weights, distance })
            })
            .collect();
        let mixtures = mixtures?;
        let total: f64 = self.importance.iter().sum();
        let sum: f64 = mixtures.iter().zip(&self.importance).map(|(m, w)| w * m.distance * m.distance).sum();
        Ok(Fitted { mixtures, loss: if total > 0.0 { sum / total } else { 0.0 } })
    }

    /// The share of each candidate in all mixtures, by importance.
    pub fn shares(&self, fitted: &Fitted) -> Vec<f64> {
        let total: f64 = self.importance.iter().sum();
        let mut shares = vec![0.0; fitted.mixtures.first().map_or(0, |m| m.weights.len())];
        for (mixture, importance) in fitted.mixtures.iter().zip(&self.importance) {
            let part = importance / total.max(f64::MIN_POSITIVE);
            shares.iter_mut().zip(&mixture.weights).for_each(|(share, w)| *share += part * w);
        }
        shares
    }
}

impl Fitted {
    /// The inks that a mixture has at least this weight of, and more than none.
    pub fn inks(&self, candidates: &Candidates, least: f64) -> InkSet {
        let mut used = vec![false; candidates.len()];
        for mixture in &self.mixtures {
            used.iter_mut().zip(&mixture.weights).for_each(|(used, &w)| *used |= w > 0.0 && w >= least);
        }
        let stacks = (0..candidates.len()).filter(|&k| used[k]);
        InkSet::of(stacks.flat_map(|k| candidates.inks[k].iter()))
    }
}
