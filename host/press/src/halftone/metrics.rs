//! Measures how well a sheet keeps the mix and the minimum clusters.
//!
//! Problem: the quality of a halftone depends on its tones, over the page and over a window that the eye averages, and on its
//! smallest clusters, which decide whether foil sticks.
//! Method: the requested weights are summed over the same lattice that the halftone reads. Windows are the walk's tiles of
//! 64 by 64 dots or slightly less. Clusters are 4-connected components, found by joining the runs of neighbouring
//! rows. Cost: about that of the halftone for tones, 20 ns a run for clusters. Memory: 12 bytes for each run of a row.

use inks::Stack;
use protocol::walk::{Tile, Walk};
use rayon::prelude::*;
use serde::Serialize;

use super::mix::Lattice;
use super::rule::{LANES, Lanes, Source, UNIT, blocks};
use super::{HalftoneError, Settings, check};
use crate::sheet::DotMap;
use crate::sheet::clusters::smallest_clusters;
use appearance::gamut::InkMix;
use observe::Observer;

/// Measurements of one stack on the printed rectangle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tone {
    /// The stack.
    pub stack: Stack,
    /// Share of the rectangle that the mix asks for, 0..=1.
    pub asked: f64,
    /// Share printed, 0..=1.
    pub printed: f64,
    /// Largest |printed - asked| of any window, as a share of the window.
    pub worst_window: f64,
    /// Root mean square of printed - asked over the windows.
    pub rms_window: f64,
    /// Runs along the walk.
    pub runs: u64,
    /// Dots of the shortest run; 0 if there is none.
    pub shortest_run: u32,
    /// Mean dots of a run.
    pub mean_run: f64,
    /// Dots of the smallest 4-connected cluster on the page; 0 if there is none.
    pub smallest_cluster: u32,
}

/// The tones and clusters of a halftone, one [`Tone`] for each stack that is asked for or printed.
///
/// # Errors
/// As [`super::halftone`], or a dot map of other stacks.
pub fn tones(mix: &InkMix, dots: &DotMap, observer: &dyn Observer) -> Result<Vec<Tone>, HalftoneError> {
    // What does not fit is larger than any halftone.
    let side = |dots: usize| u16::try_from(dots).unwrap_or(u16::MAX);
    let size = (side(dots.width()), side(dots.length()));
    check(mix, size, &Settings::uniform(mix.stacks.len(), 1))?;
    if dots.stacks() != mix.stacks {
        return Err(HalftoneError::OtherStacks);
    }
    let walk = Walk::new(size.0, size.1);
    let lattice = Lattice::new(mix, &walk);
    let tiles: Vec<Tile> = walk.bands().flat_map(|band| band.tiles()).collect();
    observer.begin("tones", u64::from(walk.len()));

    let (width, stacks) = (dots.width(), mix.stacks.len());
    let row = |tile: &Tile, y: usize| {
        let start = (usize::from(tile.y) + y) * width + usize::from(tile.x);
        &dots.index()[start..start + usize::from(tile.w)]
    };
    // Asked in the rule's unit and printed in dots, window by window.
    let windows: Vec<(Vec<i64>, Vec<i64>)> = tiles
        .par_iter()
        .map(|tile| {
            let (mut asked, mut printed) = (vec![0i64; stacks], vec![0i64; stacks]);
            let mut weights = vec![Lanes::default(); blocks(lattice.stacks.len())];
            let mut along = lattice.along(std::iter::once(*tile));
            let mut walked = 0;
            while walked < u32::from(tile.area()) {
                let stretch = along.stretch(&mut weights);
                for (lane, &q) in lattice.stacks.iter().enumerate() {
                    asked[usize::from(q)] +=
                        i64::from(weights[lane / LANES].0[lane % LANES]) * i64::from(stretch);
                }
                walked += stretch;
            }
            for y in 0..usize::from(tile.h) {
                for &stack in row(tile, y) {
                    printed[usize::from(stack)] += 1;
                }
            }
            observer.advance(u64::from(tile.area()));
            (asked, printed)
        })
        .collect();

    let runs = runs(&lattice, &tiles, stacks, row);
    let clusters = smallest_clusters(width, dots.index(), &std::array::from_fn(|stack| stack as u8));
    let total = f64::from(walk.len());
    let tone = |q: usize| {
        let unit = f64::from(UNIT);
        let (mut asked, mut printed, mut worst, mut squares) = (0, 0, 0.0f64, 0.0);
        for ((tile, window), weight) in tiles.iter().zip(&windows).zip(tiles.iter().map(Tile::area)) {
            let dots = f64::from(tile.area());
            let error = (window.1[q] as f64 - window.0[q] as f64 / unit) / dots;
            (asked, printed) = (asked + window.0[q], printed + window.1[q]);
            worst = worst.max(error.abs());
            squares += error * error * f64::from(weight);
        }
        let (count, shortest, sum) = runs[q];
        Tone {
            stack: mix.stacks[q].clone(),
            asked: asked as f64 / unit / total,
            printed: printed as f64 / total,
            worst_window: worst,
            rms_window: (squares / total).sqrt(),
            runs: count,
            shortest_run: shortest,
            mean_run: if count > 0 { sum as f64 / count as f64 } else { 0.0 },
            smallest_cluster: clusters[q],
        }
    };
    let tones = (0..stacks).map(tone).filter(|tone| tone.asked > 0.0 || tone.printed > 0.0).collect();
    observer.end();
    Ok(tones)
}

/// For each stack the number of its runs along the walk, the length of the shortest, and the sum of their lengths.
fn runs<'s>(
    lattice: &Lattice,
    tiles: &[Tile],
    stacks: usize,
    row: impl Fn(&Tile, usize) -> &'s [u8],
) -> Vec<(u64, u32, u64)> {
    let mut found = vec![(0u64, 0u32, 0u64); stacks];
    let (mut stack, mut length) = (None, 0u32);
    let mut close = |stack: Option<u8>, length: u32| {
        if let Some(q) = stack {
            let (count, least, sum) = &mut found[usize::from(q)];
            *least = if *count == 0 { length } else { length.min(*least) };
            (*count, *sum) = (*count + 1, *sum + u64::from(length));
        }
    };
    let mut line = Vec::new();
    for tile in tiles {
        line.resize(usize::from(tile.area()), 0);
        let order = &lattice.shape(tile).order;
        for (y, order) in order.chunks_exact(usize::from(tile.w)).enumerate() {
            for (&dot, &position) in row(tile, y).iter().zip(order) {
                line[usize::from(position)] = dot;
            }
        }
        for &dot in &line {
            if stack == Some(dot) {
                length += 1;
            } else {
                close(stack, length);
                (stack, length) = (Some(dot), 1);
            }
        }
    }
    close(stack, length);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halftone::{Method, halftone};
    use appearance::weights::{WeightMaps, quantise};
    use observe::Silent;
    use protocol::ink::Ink;

    #[test]
    fn the_report_says_what_was_asked_and_what_was_printed() {
        let (width, height) = (60, 50);
        let mut data = vec![0; width * height * 2];
        for (pixel, out) in data.chunks_exact_mut(2).enumerate() {
            let t = (pixel % width) as f64 / (width - 1) as f64;
            quantise(&[1.0 - t, t], out);
        }
        let matrix = vec![
            vec![appearance::weights::ONE, 0, 0],
            vec![0, appearance::weights::ONE / 4, appearance::weights::ONE / 4 * 3],
        ];
        let stacks = vec![Stack::SUBSTRATE, Stack::new([Ink::Cyan]), Stack::new([Ink::MetallicSilver])];
        let mix = InkMix { stacks, maps: WeightMaps::new(width, height, 2, data).unwrap(), matrix };
        let settings = Settings { method: Method::Walk, minimum: vec![9, 9, 16], reflectance: None };
        let dots = halftone(&mix, (600, 500), None, &settings, &Silent).unwrap();
        let tones = tones(&mix, &dots, &Silent).unwrap();
        assert_eq!(tones.len(), 3);
        for (tone, (asked, minimum)) in tones.iter().zip([(0.5, 9), (0.125, 9), (0.375, 16)]) {
            assert!((tone.asked - asked).abs() < 1e-3, "{tone:?}");
            assert!((tone.printed - tone.asked).abs() < 2e-4, "{tone:?}");
            assert!(tone.shortest_run >= minimum && tone.smallest_cluster >= minimum, "{tone:?}");
            assert!(tone.mean_run >= f64::from(minimum) && tone.worst_window < 0.02, "{tone:?}");
        }
        let other = InkMix { stacks: mix.stacks.iter().rev().cloned().collect(), ..mix.clone() };
        assert!(super::tones(&other, &dots, &Silent).is_err());
        let two = DotMap::new(600, 500, mix.stacks[..2].to_vec(), vec![0; 300_000]).unwrap();
        assert_eq!(super::tones(&mix, &two, &Silent), Err(HalftoneError::OtherStacks));
        let total: f64 = tones.iter().map(|tone| tone.runs as f64 * tone.mean_run).sum();
        assert!((total - 300_000.0).abs() < 1e-3);
    }
}
