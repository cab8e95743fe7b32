//! Measures how well a halftone keeps the mix and the minimum clusters, and how it looks.
//!
//! Problem: the quality of a halftone depends on its tones, over the page and over a window that the eye averages, and on its
//! smallest clusters, which decide whether foil sticks.
//! Method: the requested weights are summed over the pixels under each dot, bilinear or by area as the halftone reads them, and
//! not rounded. Windows are the walk's tiles of 64 by 64 dots or slightly less. Clusters are 4-connected components, found by
//! joining the runs of neighbouring rows. Cost: a few ns a dot, 20 ns a run for clusters. Memory: 12 bytes for each run of a row.

use inks::Stack;
use maths::Maths;
use protocol::walk::{Tile, Walk};
use rayon::prelude::*;
use serde::Serialize;

use super::clustered::field::Field;
use super::contrast_sensitivity::{self, Eye, Tangent};
use super::hilbert::mix::Lattice;
use super::solids::Solids;
use super::thin;
use super::{HalftoneError, SAMPLES, Settings, TONE, check, clustered};
use appearance::brdf::Space;
use appearance::gamut::InkMix;
use appearance::wide::wide;
use observe::Observer;
use sheet::DotMap;
use sheet::clusters::{Touch, smallest_clusters};

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
    // Asked and printed in dots, window by window.
    let windows: Vec<(Vec<f64>, Vec<u32>)> = tiles
        .par_iter()
        .map(|tile| {
            let mut asked = vec![0.0; stacks];
            let dots = wide(
                #[inline(always)]
                || lattice.asked(tile),
            );
            for (&q, dots) in lattice.stacks.iter().zip(dots) {
                asked[usize::from(q)] = dots;
            }
            let mut printed = vec![0u32; stacks];
            for y in 0..usize::from(tile.h) {
                for &stack in row(tile, y) {
                    printed[usize::from(stack)] += 1;
                }
            }
            observer.advance(u64::from(tile.area()));
            (asked, printed)
        })
        .collect();

    let (runs, clusters) = rayon::join(
        || runs(&lattice, &tiles, stacks, row),
        || smallest_clusters(width, dots.index(), &std::array::from_fn(|stack| stack as u8), Touch::Side),
    );
    let total = f64::from(walk.len());
    let tone = |q: usize| {
        let (mut asked, mut printed, mut worst, mut squares) = (0.0, 0, 0.0f64, 0.0);
        for ((tile, window), weight) in tiles.iter().zip(&windows).zip(tiles.iter().map(Tile::area)) {
            let dots = f64::from(tile.area());
            let error = (f64::from(window.1[q]) - window.0[q]) / dots;
            (asked, printed) = (asked + window.0[q], printed + u64::from(window.1[q]));
            worst = worst.max(error.abs());
            squares += error * error * f64::from(weight);
        }
        let (count, shortest, sum) = runs[q];
        Tone {
            stack: mix.stacks[q].clone(),
            asked: asked / total,
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

/// How a halftone looks, on some windows of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Look {
    /// Distance of the eye in metres, and the error seen from there, root mean square in units of the metric.
    pub seen: Vec<(f64, f64)>,
    /// Share of the dots that are no solids and lie in parts too thin for their stack, 0..=1.
    pub thin: f64,
    /// Of flat windows: the largest autocorrelation of the rarest stack beyond three of its mean spacings.
    pub peak: Option<f64>,
    /// Of flat windows: the spread of that stack's share over rows or columns, in units of independent clusters.
    pub swing: Option<f64>,
}

impl std::fmt::Display for Look {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let seen: Vec<String> =
            self.seen.iter().map(|(eye, error)| format!("d {error:.4} from {eye} m")).collect();
        write!(f, "the eye sees {} of the halftone", seen.join(", "))?;
        write!(f, "; {:.1} % of its tones are in parts too thin for their inks", 100.0 * self.thin)?;
        match self.peak {
            Some(peak) if peak > 0.1 => write!(f, "; a flat area repeats (autocorrelation {peak:.2})"),
            _ => Ok(()),
        }
    }
}

/// Sides of a window, and how many there are along either side of the rectangle.
const WINDOW: usize = 512;
const WINDOWS: usize = 3;

/// From how far one looks, in metres.
const EYES: [f64; 3] = [0.3, 0.5, 1.0];

/// How a halftone of this mix looks, on at most 9 windows of it that lie evenly; `None` without reflectances in the
/// settings, or for a rectangle smaller than an eighth of a window.
///
/// # Errors
/// As [`super::halftone`], or a dot map of other stacks.
pub fn look(mix: &InkMix, dots: &DotMap, settings: &Settings) -> Result<Option<Look>, HalftoneError> {
    let side = |dots: usize| u16::try_from(dots).unwrap_or(u16::MAX);
    let size = (side(dots.width()), side(dots.length()));
    check(mix, size, settings)?;
    if dots.stacks() != mix.stacks {
        return Err(HalftoneError::OtherStacks);
    }
    let Some(table) = &settings.reflectance else { return Ok(None) };
    let wide = (dots.width().min(WINDOW), dots.length().min(WINDOW));
    if wide.0.min(wide.1) < WINDOW / 8 {
        return Ok(None);
    }
    let points = Tangent::of_mix(mix, &Space::half_angle(SAMPLES), table).leading();
    let solids = Solids::new(mix, dots.width(), dots.length(), None);
    let field = Field::new(mix, dots.width(), dots.length(), &[], &solids);
    let starts = |length: usize, window: usize| -> Vec<usize> {
        let count = (length / window).clamp(1, WINDOWS);
        (0..count).map(|i| (length - window) * (2 * i + 1) / (2 * count)).collect()
    };
    let columns = starts(dots.width(), wide.0);
    let corners: Vec<(usize, usize)> = starts(dots.length(), wide.1)
        .into_iter()
        .flat_map(|y| columns.iter().map(move |&x| (x, y)))
        .collect();
    let eye = Eye::new(wide.0, wide.1, &EYES);
    let windows: Vec<Measured> = corners
        .into_par_iter()
        .map(|corner| Window { field: &field, dots, corner, eye: &eye }.measure(&points, &solids, settings))
        .collect();
    let count = windows.len() as f64;
    let mean = |eye: usize| (windows.iter().map(|w| w.seen[eye].squared()).sum::<f64>() / count).sqrt();
    let largest = |of: fn(&Measured) -> Option<f64>| windows.iter().filter_map(of).reduce(f64::max);
    let tones = windows.iter().map(|w| w.tones).sum::<u64>().max(1);
    Ok(Some(Look {
        seen: EYES.iter().enumerate().map(|(i, &eye)| (eye, mean(i))).collect(),
        thin: windows.iter().map(|w| w.thin).sum::<u64>() as f64 / tones as f64,
        peak: largest(|w| w.flat.map(|flat| flat.0)),
        swing: largest(|w| w.flat.map(|flat| flat.1)),
    }))
}

/// A window of a halftone.
struct Window<'a> {
    field: &'a Field<'a>,
    dots: &'a DotMap,
    corner: (usize, usize),
    eye: &'a Eye,
}

/// What was found in a window.
struct Measured {
    seen: Vec<f64>,
    tones: u64,
    thin: u64,
    /// Peak and swing, where the window is flat.
    flat: Option<(f64, f64)>,
}

impl Window<'_> {
    fn measure(&self, points: &[[f32; 4]], solids: &Solids, settings: &Settings) -> Measured {
        let (width, length) = self.eye.window();
        let index: Vec<u8> = (0..length)
            .flat_map(|y| {
                &self.dots.index()[(self.corner.1 + y) * self.dots.width() + self.corner.0..][..width]
            })
            .copied()
            .collect();
        let (planes, shares) = wide(
            #[inline(always)]
            || self.errors(&index, points),
        );
        let side = |stack: u8| clustered::plan::size_of(settings.minimum[usize::from(stack)]);
        let free = |at: usize| solids.at(self.corner.0 + at % width, self.corner.1 + at / width) != TONE;
        let tones = (0..index.len()).filter(|&at| !free(at)).count() as u64;
        let flat = shares.and_then(|shares| {
            let rare = (0..shares.len()).filter(|&q| shares[q] > 0.0 && shares[q] < 1.0);
            let rare = rare.min_by(|&a, &b| shares[a].total_cmp(&shares[b]))?;
            let (stack, side) = (rare as u8, side(rare as u8));
            let near = 3.0 * side as f64 / f64::from(shares[rare]).sqrt();
            let (rows, columns) = contrast_sensitivity::swing(width, &index, stack, side);
            Some((
                contrast_sensitivity::peak(width, &index, stack, near, width.min(length) / 4).0,
                rows.max(columns),
            ))
        });
        Measured {
            seen: contrast_sensitivity::errors_seen(&planes, self.eye),
            tones,
            thin: thin::thin(width, &index, |stack| settings.minimum[usize::from(stack)].into(), free),
            flat,
        }
    }

    /// The error in each coordinate, and the share of each stack if it is the same everywhere. What a dot asks for is exact,
    /// whatever the method has made of it.
    #[inline(always)]
    fn errors(&self, index: &[u8], points: &[[f32; 4]]) -> (Vec<Vec<f64>>, Option<Vec<f32>>) {
        let field = self.field;
        let (wanted, same) = field.points(self.corner, self.eye.window(), points);
        let mut planes = vec![vec![0.0; index.len()]; 4];
        for (c, plane) in planes.iter_mut().enumerate() {
            for ((error, &stack), wanted) in plane.iter_mut().zip(index).zip(&wanted) {
                *error = f64::from(points[usize::from(stack)][c] - wanted[c]);
            }
        }
        let shares = same.then(|| {
            let mut want = vec![0.0; field.lanes];
            field.add_dot(self.corner.0, self.corner.1, &mut Vec::new(), &mut want);
            let mut shares = vec![0.0; self.dots.stacks().len()];
            for (&share, &q) in want.iter().zip(&field.stacks) {
                shares[usize::from(q)] = share;
            }
            shares
        });
        (planes, shares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Method, halftone};
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
            // The first column is solid, so each of the eight bands drops a few dots of debt.
            assert!((tone.printed - tone.asked).abs() < 5e-4, "{tone:?}");
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

    /// A flat patch: the walk repeats and is thin, cells do neither, and less is seen of them.
    #[test]
    fn the_look_tells_the_methods_apart() {
        let stacks: Vec<Stack> = ["substrate", "K"].map(|name| name.parse().unwrap()).to_vec();
        let mut data = vec![0; 2];
        quantise(&[0.9, 0.1], &mut data);
        let whole = appearance::weights::ONE;
        let mix = InkMix {
            stacks,
            maps: WeightMaps::new(1, 1, 2, data).unwrap(),
            matrix: vec![vec![whole, 0], vec![0, whole]],
        };
        let library = inks::Library::builtin();
        let look = |method| {
            let settings = Settings { method, ..Settings::from_library(&mix.stacks, &library) };
            let dots = halftone(&mix, (640, 640), None, &settings, &Silent).unwrap();
            super::look(&mix, &dots, &settings).unwrap().unwrap()
        };
        let (walk, cells, best) = (look(Method::Walk), look(Method::Cells), look(Method::Best));
        assert!(
            walk.peak > Some(0.3) && cells.peak < Some(0.1) && best.peak < Some(0.1),
            "{walk:?} {cells:?}"
        );
        assert!(walk.thin > 0.05 && cells.thin == 0.0 && best.thin == 0.0, "{walk:?} {cells:?} {best:?}");
        for eye in 0..2 {
            let (walk, cells, best) = (walk.seen[eye].1, cells.seen[eye].1, best.seen[eye].1);
            assert!(cells < 0.85 * walk && best < cells, "{walk} {cells} {best}");
        }
        let other = InkMix { stacks: mix.stacks.iter().rev().cloned().collect(), ..mix.clone() };
        let settings = Settings::from_library(&mix.stacks, &library);
        assert!(
            super::look(&other, &DotMap::new(9, 9, mix.stacks.clone(), vec![0; 81]).unwrap(), &settings)
                .is_err()
        );
    }
}
