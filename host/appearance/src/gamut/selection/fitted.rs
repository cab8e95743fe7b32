//! Targets fitted to sets of stacks: what cartridges and stacks are chosen by.

use inks::InkSet;
use rayon::prelude::*;

use crate::gamut::candidates::Candidates;
use crate::solve::{Hull, Mixer, MixtureError, Target};

/// Gap in squared distance that decides nothing: a hundredth of what is barely visible, squared.
const ENOUGH: f64 = 1e-8;

/// The weight that must be left of a mixture for it to be a start.
const ENOUGH_LEFT: f64 = 0.05;

/// The difference that is worth a cartridge, in the unit of the metric: half of what is barely visible.
/// Source: a viewer judges a material, and two steps of half are seen
/// (docs/decisions/clamp-and-seven-cartridges.md).
const BETTER: f64 = 0.005;

/// The share of all targets that are worth a cartridge if they gain as a material would. One that shades
/// off has targets that its mean does not show.
const OF_ALL: f64 = 0.01;

/// Targets, and the importance of each.
pub(crate) struct Targets {
    pub rows: Vec<Target>,
    pub importance: Vec<f64>,
    /// Which of them are materials that count, each by itself, and the share of the document that each
    /// covers.
    pub counted: Vec<(usize, f64)>,
}

/// What some stacks do for the material that they serve most.
#[derive(Clone, Copy)]
pub(crate) struct Service {
    /// The material, by its place among those counted.
    pub counted: usize,
    /// The objective with the stacks and without.
    pub with: f64,
    pub without: f64,
    /// The share of all targets whose hue comes back.
    pub hue: f64,
    /// Whether it is worth a cartridge: the material or so many of all targets are nearer by [`BETTER`], or
    /// their hue comes back.
    pub is_worth_it: bool,
}

/// A target's best mixture of some of the candidates.
#[derive(Clone)]
struct Mixture {
    /// One weight per candidate.
    weights: Vec<f64>,
    objective: f64,
    keeps_hue: bool,
}

/// Every target's best mixture of some of the candidates.
#[derive(Clone)]
pub(crate) struct Fitted {
    mixtures: Vec<Mixture>,
    /// Mean square of the objective by importance.
    pub loss: f64,
    /// The share of the targets whose hue is lost, by importance.
    pub lost_hue: f64,
}

impl Targets {
    /// The best mixtures of the stacks `allowed`. Mixtures of `before` that use allowed stacks only are
    /// kept: those stacks must be among the ones it was fitted to.
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
                let objective = mixer.refine_beyond(&hull, target, &mut a, ENOUGH)?.objective;
                let mut weights = vec![0.0; candidates.len()];
                allowed.iter().zip(&a).for_each(|(&k, &w)| weights[k] = w);
                Ok(Mixture { weights, objective, keeps_hue: hull.keeps_hue(&a, target) })
            })
            .collect();
        let mixtures = mixtures?;
        let total: f64 = self.importance.iter().sum();
        let mean = |of: fn(&Mixture) -> f64| {
            let sum: f64 = mixtures.iter().zip(&self.importance).map(|(m, w)| w * of(m)).sum();
            if total > 0.0 { sum / total } else { 0.0 }
        };
        let loss = mean(|m| m.objective * m.objective);
        let lost_hue = mean(|m| f64::from(u8::from(!m.keeps_hue)));
        Ok(Fitted { mixtures, loss, lost_hue })
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

impl Targets {
    /// What stacks do that are there in `with` and not in `without`; `None` if no material counts.
    pub fn service(&self, with: &Fitted, without: &Fitted) -> Option<Service> {
        let hue = without.lost_hue - with.lost_hue;
        let gains = |with: &Mixture, without: &Mixture| {
            without.objective - with.objective >= BETTER || with.keeps_hue && !without.keeps_hue
        };
        let all = with.mixtures.iter().zip(&without.mixtures).zip(&self.importance);
        let served: f64 =
            all.filter(|((with, without), _)| gains(with, without)).map(|(_, share)| share).sum();
        let are_many = served >= OF_ALL * self.importance.iter().sum::<f64>();
        let each = self.counted.iter().enumerate().map(|(counted, &(row, _))| {
            let (with, without) = (&with.mixtures[row], &without.mixtures[row]);
            let is_worth_it = are_many || gains(with, without);
            Service { counted, with: with.objective, without: without.objective, hue, is_worth_it }
        });
        let key = |service: &Service| (service.is_worth_it, service.without - service.with);
        each.max_by(|a, b| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)))
    }

    /// How badly cartridges serve that are equally good in the mean: how often so many lose their hue, and
    /// the objective of the counted material that is worst served.
    pub fn worst(&self, fitted: &Fitted) -> (u32, f64) {
        let worst = self.counted.iter().map(|&(row, _)| fitted.mixtures[row].objective).fold(0.0, f64::max);
        ((fitted.lost_hue / OF_ALL) as u32, worst)
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
