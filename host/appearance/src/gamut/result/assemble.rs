//! Turning weights over the candidates into the mix that the halftoner reads.

use inks::Stack;
use rayon::prelude::*;

use super::mix::InkMix;
use crate::brdf::Table;
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::weights::{ONE, RUN, WeightError, WeightMaps};

/// Drops the candidates that no pixel uses. Returns the identity as matrix and the maps of the others.
pub(crate) fn compact(
    mut shares: Vec<u16>,
    k: usize,
    width: usize,
    height: usize,
) -> Result<(Vec<Vec<u16>>, WeightMaps), WeightError> {
    let any = |mut used: Vec<bool>, pixel: &[u16]| {
        used.iter_mut().zip(pixel).for_each(|(used, &w)| *used |= w > 0);
        used
    };
    let either = |mut a: Vec<bool>, b: Vec<bool>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
        a
    };
    let used = shares
        .par_chunks(RUN * k)
        .map(|run| run.chunks_exact(k).fold(vec![false; k], any))
        .reduce(|| vec![false; k], either);
    let kept: Vec<usize> = (0..k).filter(|&q| used[q]).collect();
    // In place: a value never moves to a later position. Each run by itself, then the runs after each other.
    shares.par_chunks_mut(RUN * k).for_each(|run| {
        for pixel in 0..run.len() / k {
            for (channel, &q) in kept.iter().enumerate() {
                run[pixel * kept.len() + channel] = run[pixel * k + q];
            }
        }
    });
    for first in (0..width * height).step_by(RUN) {
        let pixels = RUN.min(width * height - first);
        shares.copy_within(first * k..first * k + pixels * kept.len(), first * kept.len());
    }
    shares.truncate(width * height * kept.len());
    shares.shrink_to_fit();
    let unit = |q: usize| (0..k).map(|r| if r == q { ONE } else { 0 }).collect();
    let maps = WeightMaps::new(width, height, kept.len(), shares)?;
    Ok((kept.into_iter().map(unit).collect(), maps))
}

/// The mix from rows of weights over the candidates, and the curves of its stacks: the substrate first, then the candidates
/// with any weight.
pub(crate) fn assemble(
    candidates: &Candidates,
    shares: Vec<Vec<u16>>,
    maps: WeightMaps,
) -> Result<(InkMix, Table), GamutError> {
    let bare = candidates.stacks.iter().position(|stack| stack.layers().is_empty());
    let mut columns = vec![bare];
    columns.extend(
        (0..candidates.len()).filter(|&q| Some(q) != bare && shares.iter().any(|row| row[q] > 0)).map(Some),
    );
    let mut curves = Table::new(candidates.curves.columns());
    let mut stacks = Vec::new();
    for column in &columns {
        match column {
            Some(q) => {
                curves.push(candidates.curves.row(*q));
                stacks.push(candidates.stacks[*q].clone());
            }
            // A substrate that is not a candidate has no weight and needs no curve.
            None => {
                curves.push(&vec![0.0; candidates.curves.columns()]);
                stacks.push(Stack::SUBSTRATE);
            }
        }
    }
    let matrix = shares
        .iter()
        .map(|row| columns.iter().map(|column| column.map_or(0, |q| row[q])).collect())
        .collect();
    Ok((InkMix::new(stacks, maps, matrix)?, curves))
}
