//! Mapping single materials by eq. 1, without what is rare and with a certificate: the bases, or those
//! shown of a clamped document.

use rayon::prelude::*;

use super::gloss;
use crate::brdf::{Space, Table};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::gamut::result::report::MaterialReport;
use crate::gamut::settings::Gloss;
use crate::solve::{Best, Mixer, MixtureError};
use crate::weights::{ONE, quantise};

/// The mixtures of materials over the candidates.
pub(crate) struct Bases {
    /// One row of weights per material, with sum [`ONE`].
    pub shares: Vec<Vec<u16>>,
    pub reports: Vec<MaterialReport>,
    pub gloss_scale: Option<f64>,
}

struct Mapping {
    best: Best,
    weights: Vec<f64>,
    shares: Vec<u16>,
    printed: Vec<f64>,
    pruning_cost: f64,
}

/// Maps each row of `bases`; `shares` are those of the document that they stand for.
pub(crate) fn map(
    space: &Space,
    bases: &Table,
    shares: &[f64],
    candidates: &Candidates,
    gloss: Gloss,
) -> Result<Bases, GamutError> {
    let plain = map_rows(bases, candidates)?;
    let rows = |m: &[Mapping]| m.iter().map(|m| m.printed.clone()).collect::<Vec<_>>();
    let printed = rows(&plain);
    let merged = gloss::merges(space, bases, shares, &printed);
    let (mut targets, mut mappings, mut gloss_scale) = (bases.clone(), plain, None);
    if gloss == Gloss::Scale || gloss == Gloss::WhereMerged && merged > gloss::FEW_MERGED {
        let factor = gloss::factor(space, bases, &printed);
        if factor < 1.0 {
            let scaled = gloss::scaled(bases, factor);
            let mapped = map_rows(&scaled, candidates)?;
            if gloss == Gloss::Scale || gloss::merges(space, bases, shares, &rows(&mapped)) < merged {
                (targets, mappings, gloss_scale) = (scaled, mapped, Some(factor));
            }
        }
    }
    let reports = mappings
        .iter()
        .enumerate()
        .map(|(i, m)| {
            let mut weights: Vec<_> = candidates
                .stacks
                .iter()
                .zip(&m.weights)
                .filter(|(_, w)| **w > 0.0)
                .map(|(stack, &w)| (stack.clone(), w))
                .collect();
            weights.sort_by(|a, b| b.1.total_cmp(&a.1));
            MaterialReport {
                share: shares[i],
                target: targets.row(i).to_vec(),
                distance: space.distance(targets.row(i), &m.printed),
                unscaled_distance: space.distance(bases.row(i), &m.printed),
                light: space.light_distance(bases.row(i), &m.printed),
                printed: m.printed.clone(),
                weights,
                gap: m.best.fit.gap,
                convex: m.best.fit.convex,
                starts: m.best.starts,
                agreeing: m.best.agreeing,
                pruning_cost: m.pruning_cost,
            }
        })
        .collect();
    Ok(Bases { shares: mappings.into_iter().map(|m| m.shares).collect(), reports, gloss_scale })
}

fn map_rows(rows: &Table, candidates: &Candidates) -> Result<Vec<Mapping>, GamutError> {
    (0..rows.len())
        .into_par_iter()
        .map_init(Mixer::new, |mixer, i| {
            map_row(rows.row(i), candidates, mixer)
                .map_err(|source| GamutError::Mixture { what: format!("material {i}"), source })
        })
        .collect()
}

fn map_row(row: &[f64], candidates: &Candidates, mixer: &mut Mixer) -> Result<Mapping, MixtureError> {
    let target = candidates.target(row)?;
    let best = mixer.best(&candidates.priced, &target)?;
    let mut weights = best.weights.clone();
    // The price has selected the stacks; the final weights minimise the distance alone.
    let all = mixer.polish(&candidates.free, &target, &mut weights, 0.0)?;
    let settled = candidates.brightness.settle(mixer, &candidates.free, &target, &mut weights, all, 0.0)?;
    let mut shares = vec![0; weights.len()];
    quantise(&weights, &mut shares);
    let printed = candidates.reflectance(shares.iter().map(|&s| f64::from(s) / f64::from(ONE)));
    Ok(Mapping { best, weights, shares, printed, pruning_cost: settled.distance - all.distance })
}
