//! Leaving out stacks that are rare and seen.
//!
//! Problem: a stack with a share of a percent may bring a mixture nearer on the mean and stand out as dust:
//! bare paper in black, foil in skin. Others with next to no share bring nothing.
//! Method: a stack is looked at if its share is below [`RARE`] and it is more than [`BRIGHT`] times as
//! bright as the mixture over some range of half angles ([`EDGES`]), or if its share is below [`LEAST`].
//! First all of the latter at once, then one after another, the smallest share first, are removed and the
//! rest solved again; the mixture that is better stays, with grain as an eye sees it
//! ([`Mixer::exactly`](crate::solve::Mixer)).
//! Cost: two or three steps of the solver for each such stack. Limits: greedy.

use crate::brdf::{Space, Table};
use crate::solve::{Fit, Hull, Mixer, MixtureError, Target};
use crate::srgb::luminance;

/// Shares below this bring a stack no cartridge. Source: a choice; a dot in two hundred, which is left out
/// unless it is worth it.
pub(super) const LEAST: f64 = 0.005;
/// Shares below this are rare. Source: dots of three with this share lie .57 mm apart, a contrast of which
/// an eye at .5 m sees a twentieth; more of them are a tone.
const RARE: f64 = 0.05;
/// How many times as bright as the mixture a rare stack is that is looked at; whether it stays, the objective
/// says. Source: a choice. At the share below which it is rare, such a stack adds a tenth to the mean.
const BRIGHT: f64 = 3.0;
/// Half angles in degrees that end a range in which brightness is compared: the middle of a sharp
/// reflection, that of satin, its flanks, and the dark.
const EDGES: [f64; 5] = [1.5, 4.0, 9.0, 20.0, 90.0];

/// The luminance over each range of half angles.
type Bright = [f64; EDGES.len()];

/// How bright each of some stacks is.
#[derive(Clone, Debug)]
pub(super) struct Brightness(Vec<Bright>);

impl Brightness {
    /// Of rows of reflectance.
    pub fn new(space: &Space, curves: &Table) -> Brightness {
        let of = |row: &[f64]| {
            let mut bright = [0.0; EDGES.len()];
            let samples = row.chunks_exact(3).zip(space.weight().chunks_exact(3)).zip(space.angles());
            let mut all = bright;
            for ((f, weight), angle) in samples {
                let range =
                    EDGES.iter().position(|edge| angle.to_degrees() <= *edge).unwrap_or(EDGES.len() - 1);
                let measure = weight[0] * weight[0];
                bright[range] += measure * luminance([f[0], f[1], f[2]]);
                all[range] += measure;
            }
            bright.iter_mut().zip(all).for_each(|(bright, all)| *bright /= f64::max(all, f64::MIN_POSITIVE));
            bright
        };
        Brightness(curves.rows().map(of).collect())
    }

    /// Of some of the stacks.
    pub fn subset(&self, keep: &[usize]) -> Brightness {
        Brightness(keep.iter().map(|&k| self.0[k]).collect())
    }

    /// The stack of a mixture with the smallest share that is to be looked at, among those that may be.
    fn rarest(&self, weights: &[f64], may: impl Fn(usize) -> bool) -> Option<usize> {
        let is_small = |w: f64| w > 0.0 && w < RARE;
        if !weights.iter().any(|&w| is_small(w)) {
            return None;
        }
        let mut mixture = [0.0; EDGES.len()];
        for (bright, &w) in self.0.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
            mixture.iter_mut().zip(bright).for_each(|(sum, b)| *sum += w * b);
        }
        let stands_out = |k: usize| self.0[k].iter().zip(&mixture).any(|(own, all)| *own > BRIGHT * all);
        let looked_at = |&k: &usize| is_small(weights[k]) && (weights[k] < LEAST || stands_out(k)) && may(k);
        (0..weights.len()).filter(looked_at).min_by(|&a, &b| weights[a].total_cmp(&weights[b]))
    }

    /// Leaves out of a mixture what is rare and not worth being seen. `fit` is that of the weights; returns
    /// that of what they become.
    pub fn settle(
        &self,
        mixer: &mut Mixer,
        hull: &Hull,
        target: &Target,
        weights: &mut Vec<f64>,
        mut fit: Fit,
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        let mut kept: Vec<usize> = Vec::new();
        let mut own = None;
        let mut next: Vec<usize> =
            (0..weights.len()).filter(|&k| weights[k] > 0.0 && weights[k] < LEAST).collect();
        if next.len() < 2 {
            next = self.rarest(weights, |_| true).into_iter().collect();
        }
        while !next.is_empty() {
            let mut without = weights.clone();
            next.iter().for_each(|&k| without[k] = 0.0);
            let rest: f64 = without.iter().sum();
            without.iter_mut().for_each(|w| *w /= rest);
            let other = mixer.polish(hull, target, &mut without, enough)?;
            let before = *own.get_or_insert_with(|| mixer.exactly(hull, target, weights));
            let after = mixer.exactly(hull, target, &without);
            if after <= before {
                (*weights, fit, own) = (without, other, Some(after));
            } else if let [rare] = next[..] {
                kept.push(rare);
            }
            next = self.rarest(weights, |k| !kept.contains(&k)).into_iter().collect();
        }
        Ok(fit)
    }
}
