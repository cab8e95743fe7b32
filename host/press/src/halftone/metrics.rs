//! How well a sheet keeps the mix and the minimum clusters.
//!
//! Problem: a halftone is judged by its tones, on the page and in a window the eye averages, and by its smallest
//! clusters, which decide whether foil sticks.
//! Method: what was asked is summed over the same lattice the halftone reads; windows are the walk's tiles of 64 by 64
//! dots or a little less; clusters are 4-connected components, found by joining the runs of neighbouring
//! rows. Cost: about the halftone's own for tones, 20 ns a run for clusters. Memory: 12 bytes a run of a row.

use inks::Stack;
use protocol::walk::{Tile, Walk};
use rayon::prelude::*;
use serde::Serialize;

use super::mix::Lattice;
use super::rule::{LANES, Lanes, Source, UNIT, blocks};
use super::{HalftoneError, Placement, Settings, check};
use crate::sheet::Sheet;
use appearance::gamut::InkMix;
use observe::Observer;

/// One stack on the printed rectangle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tone {
    /// The stack.
    pub stack: Stack,
    /// Share of the rectangle the mix asks for, 0..=1.
    pub asked: f64,
    /// Share printed, 0..=1.
    pub printed: f64,
    /// Largest |printed - asked| of a window, as a share of the window.
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
/// Errors: as [`super::halftone`], or a sheet of another paper or other stacks.
pub fn tones(
    mix: &InkMix,
    place: &Placement,
    sheet: &Sheet,
    observer: &dyn Observer,
) -> Result<Vec<Tone>, HalftoneError> {
    check(mix, place, &Settings::uniform(mix.stacks.len(), 1))?;
    if sheet.paper() != place.paper || sheet.stacks() != mix.stacks {
        return Err(HalftoneError::OtherSheet { sheet: sheet.paper().name(), place: place.paper.name() });
    }
    let walk = Walk::new(place.width, place.height);
    let lattice = Lattice::new(mix, &walk);
    let tiles: Vec<Tile> = walk.bands().flat_map(|band| band.tiles()).collect();
    observer.begin("tones", u64::from(walk.len()));

    let (width, stacks) = (sheet.width(), mix.stacks.len());
    let corner = usize::from(place.y) * width + usize::from(place.x);
    let row = |tile: &Tile, y: usize| {
        let start = corner + (usize::from(tile.y) + y) * width + usize::from(tile.x);
        &sheet.index()[start..start + usize::from(tile.w)]
    };
    // Asked in the rule's unit and printed in dots, window by window.
    let windows: Vec<(Vec<i64>, Vec<i64>)> = tiles
        .par_iter()
        .map(|tile| {
            let (mut asked, mut printed) = (vec![0i64; stacks], vec![0i64; stacks]);
            let mut weights = vec![Lanes::default(); blocks(lattice.stacks.len())];
            let mut along = lattice.along(std::iter::once(*tile));
            let mut dots = 0;
            while dots < u32::from(tile.area()) {
                let stretch = along.stretch(&mut weights);
                for (lane, &q) in lattice.stacks.iter().enumerate() {
                    asked[usize::from(q)] +=
                        i64::from(weights[lane / LANES].0[lane % LANES]) * i64::from(stretch);
                }
                dots += stretch;
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
    let clusters = smallest_clusters(width, sheet.index(), &std::array::from_fn(|stack| stack as u8));
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

/// Number, least and sum of the runs of each stack along the walk.
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

/// How many dots are like the first; `row` is not empty. Eight at a time, as most runs are about that long.
fn run(row: &[u8]) -> usize {
    let first = u64::from_ne_bytes([row[0]; 8]);
    let (words, rest) = row.as_chunks::<8>();
    for (i, &word) in words.iter().enumerate() {
        let differ = u64::from_le_bytes(word) ^ first;
        if differ != 0 {
            return 8 * i + differ.trailing_zeros() as usize / 8;
        }
    }
    8 * words.len() + rest.iter().take_while(|&&dot| dot == row[0]).count()
}

/// Dots of the smallest 4-connected cluster of each label, 0 for a label that does not occur. `label` groups stacks:
/// equal numbers belong together. Rows of `width` dots.
pub fn smallest_clusters(width: usize, index: &[u8], label: &[u8; 256]) -> [u32; 256] {
    struct Run {
        end: u32,
        cluster: u32,
        label: u8,
    }
    let mut parent: Vec<u32> = Vec::new();
    let mut size: Vec<u32> = Vec::new();
    let mut label_of: Vec<u8> = Vec::new();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            // Halving the path keeps the trees flat.
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let (mut above, mut here): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
    let mut row = vec![0; width];
    for dots in index.chunks_exact(width.max(1)) {
        for (own, &dot) in row.iter_mut().zip(dots) {
            *own = label[usize::from(dot)];
        }
        here.clear();
        let (mut start, mut over) = (0, 0);
        while start < row.len() {
            let own = row[start];
            let length = run(&row[start..]);
            let end = start + length;
            let mut cluster = None;
            // Runs above that end before this one starts cannot touch it or any later one.
            while over < above.len() && above[over].end as usize <= start {
                over += 1;
            }
            let mut touching = over;
            while touching < above.len() {
                let run = &above[touching];
                if run.label == own {
                    let other = root(&mut parent, run.cluster);
                    cluster = Some(match cluster {
                        None => other,
                        Some(mine) if mine == other => mine,
                        Some(mine) => {
                            // The older cluster takes the younger.
                            let (old, young) = (other.min(mine), other.max(mine));
                            parent[young as usize] = old;
                            size[old as usize] += std::mem::take(&mut size[young as usize]);
                            old
                        }
                    });
                }
                if run.end as usize >= end {
                    break;
                }
                touching += 1;
            }
            let cluster = cluster.unwrap_or_else(|| {
                parent.push(parent.len() as u32);
                size.push(0);
                label_of.push(own);
                parent.len() as u32 - 1
            });
            size[cluster as usize] += length as u32;
            here.push(Run { end: end as u32, cluster, label: own });
            start = end;
        }
        std::mem::swap(&mut above, &mut here);
    }
    let mut least = [0; 256];
    for (i, &own) in label_of.iter().enumerate() {
        let least = &mut least[usize::from(own)];
        if parent[i] as usize == i && (*least == 0 || size[i] < *least) {
            *least = size[i];
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halftone::halftone;
    use appearance::weights::{WeightMaps, quantise};
    use observe::Silent;
    use proptest::prelude::*;
    use protocol::ink::Ink;
    use protocol::paper::Paper;

    /// Labels spread from dot to neighbour until nothing changes.
    fn by_spreading(width: usize, index: &[u8]) -> [u32; 256] {
        let mut cluster: Vec<usize> = (0..index.len()).collect();
        let mut changed = true;
        while std::mem::take(&mut changed) {
            for dot in 0..index.len() {
                let right = (dot % width + 1 < width).then_some(dot + 1);
                let below = (dot + width < index.len()).then_some(dot + width);
                for next in [right, below].into_iter().flatten().filter(|&n| index[n] == index[dot]) {
                    let least = cluster[dot].min(cluster[next]);
                    changed |= cluster[dot] != least || cluster[next] != least;
                    (cluster[dot], cluster[next]) = (least, least);
                }
            }
        }
        let mut least = [0; 256];
        for (dot, &own) in index.iter().enumerate() {
            let size = cluster.iter().filter(|&&c| c == dot).count() as u32;
            let least = &mut least[usize::from(own)];
            if size > 0 && (*least == 0 || size < *least) {
                *least = size;
            }
        }
        least
    }

    proptest! {
        #[test]
        fn joined_runs_are_the_connected_clusters(width in 1usize..14, index in prop::collection::vec(0u8..3, 1..150)) {
            let index = &index[..index.len() / width * width];
            let least = smallest_clusters(width, index, &std::array::from_fn(|s| s as u8));
            prop_assert_eq!(least, by_spreading(width, index));
        }
    }

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
        let paper = Paper::Custom { width: 700, length: 640 };
        let place = Placement { paper, x: 30, y: 20, width: 600, height: 500 };
        let settings = Settings { minimum: vec![9, 9, 16], ..Default::default() };
        let sheet = halftone(&mix, &place, &settings, &Silent).unwrap();
        let tones = tones(&mix, &place, &sheet, &Silent).unwrap();
        assert_eq!(tones.len(), 3);
        for (tone, (asked, minimum)) in tones.iter().zip([(0.5, 9), (0.125, 9), (0.375, 16)]) {
            assert!((tone.asked - asked).abs() < 1e-3, "{tone:?}");
            assert!((tone.printed - tone.asked).abs() < 1e-4, "{tone:?}");
            assert!(tone.shortest_run >= minimum && tone.smallest_cluster >= minimum, "{tone:?}");
            assert!(tone.mean_run >= f64::from(minimum) && tone.worst_window < 0.02, "{tone:?}");
        }
        let other = Placement { paper: Paper::A4, ..place };
        assert!(super::tones(&mix, &other, &sheet, &Silent).unwrap_err().to_string().contains("on a4"));
        let dots: f64 = tones.iter().map(|tone| tone.runs as f64 * tone.mean_run).sum();
        assert!((dots - 300_000.0).abs() < 1e-3);
    }
}
