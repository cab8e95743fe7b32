//! How far the print is from the document, seen by an eye at a distance.
//!
//! Problem: dot by dot no halftone resembles its document; the eye averages before it compares.
//! Method: both are averaged over the spot the eye averages over, in reflectance, and the distance of the metric
//! (eqs. 2-3 of the 2009 paper's appendix) is taken at every spot. The spot: Nasanen's low-pass
//! `exp(-f / (0.525 ln L + 3.91))`, f in cycles per degree, at L = 11 cd/m^2, passes white noise like a window of
//! effective area `2 / (pi a^2)` square degrees, a = 5.17: 1.35 mm a side at half a metre. We use the window
//! [1 2 1] (x) [1 2 1] over cells of 3/8 of that side (effective side 16/6 cells), which leaks less than a box.
//! Cost: one pass over dots and document pixels; memory of a few lines of cells.
//! Limits: achromatic contrast model on every column alike; nothing is said of detail finer than a cell.

use rayon::prelude::*;

use crate::observe::Observer;

use super::PreviewError;
use super::source::{Lines, Scratch, Source};

/// Dots to a millimetre of every sheet.
const DOTS_PER_MM: f64 = 600.0 / 25.4;

/// Lines of cells to a parallel task; fixed, so that sums are taken in one order on any number of threads.
const CHUNK: usize = 16;

/// Places averaged along each axis of a cell when a document is finer than the cells.
const SAMPLES: usize = 16;

/// Distances between two pictures over all spots the eye resolves. About 0.01 is hard to see, 0.05 is plain.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Mean distance.
    pub mean: f64,
    /// Root of the mean squared distance.
    pub rmse: f64,
    /// Distance 95 % of the spots stay below.
    pub p95: f64,
    /// Greatest distance.
    pub max: f64,
    /// Width of the map of distances.
    pub width: usize,
    /// Height of the map of distances.
    pub height: usize,
    /// The distance at every cell, row by row.
    pub map: Vec<f32>,
}

/// Side in millimetres of the square window the eye averages over at `metres`. See the module text.
pub fn spot_mm(metres: f64) -> f64 {
    let cycles = 0.525 * 11f64.ln() + 3.91;
    let degrees = (2.0 / std::f64::consts::PI).sqrt() / cycles;
    1000.0 * metres * degrees.to_radians()
}

/// Side in dots of the cells the window of an eye at `metres` is made of; 1 or more.
pub fn cell_dots(metres: f64) -> usize {
    // 6/16: the three taps 1/4, 1/2, 1/4 pass noise like a box of 16/6 cells.
    (spot_mm(metres) * DOTS_PER_MM * 6.0 / 16.0).round().max(1.0) as usize
}

/// Compares a print with its target as seen from `metres` (0.5 is arm's length). `length_dots` is the target's
/// printed size across and down, the size of the printed area.
///
/// # Errors
/// When the two are not in the same tabulation, or a table does not fit its source.
pub fn fidelity(
    target: &Source,
    print: &Source,
    length_dots: (usize, usize),
    metres: f64,
    observer: &dyn Observer,
) -> Result<Report, PreviewError> {
    let space = target.space();
    if print.space() != space {
        return Err(PreviewError::Shape {
            what: "columns of the print's tabulation, which must be the target's own",
            expected: space.columns(),
            found: print.space().columns(),
        });
    }
    let cell = cell_dots(metres);
    let (width, height) = ((length_dots.0 / cell).max(1), (length_dots.1 / cell).max(1));
    let target = target.lines(width, height, SAMPLES)?;
    let print = print.lines(width, height, SAMPLES)?;
    observer.begin("comparing print and document", height as u64);
    let mut map = vec![0.0f32; width * height];
    map.par_chunks_mut(width * CHUNK).enumerate().for_each(|(chunk, out)| {
        let first = chunk * CHUNK;
        let count = out.len() / width;
        let a = blurred(&target, first, count);
        let b = blurred(&print, first, count);
        let columns = space.columns();
        for ((out, a), b) in out.iter_mut().zip(a.chunks_exact(columns)).zip(b.chunks_exact(columns)) {
            *out = distance(space.radiance(), space.weight(), a, b) as f32;
        }
        observer.advance(count as u64);
    });
    observer.end();
    let n = map.len() as f64;
    let mean = map.iter().map(|&d| f64::from(d)).sum::<f64>() / n;
    let rmse = (map.iter().map(|&d| f64::from(d).powi(2)).sum::<f64>() / n).sqrt();
    let mut sorted = map.clone();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| f64::from(sorted[((sorted.len() - 1) as f64 * share).round() as usize]);
    Ok(Report { mean, rmse, p95: at(0.95), max: at(1.0), width, height, map })
}

/// [`crate::brdf::Space::distance`] for rows of f32.
fn distance(radiance: &[f64], weight: &[f64], a: &[f32], b: &[f32]) -> f64 {
    let mut sum = 0.0;
    for (((&a, &b), &c), &w) in a.iter().zip(b).zip(radiance).zip(weight) {
        let seen = |f: f32| (f64::from(f).max(0.0) * c).cbrt();
        sum += (w * (seen(a) - seen(b))).powi(2);
    }
    sum.sqrt()
}

/// Lines `first..first + count` after the window [1 2 1] / 4 along both axes; edge cells are repeated outwards.
fn blurred(lines: &Lines, first: usize, count: usize) -> Vec<f32> {
    let (columns, width, last) = (lines.columns(), lines.width(), lines.height() - 1);
    let mut scratch = Scratch::default();
    let mut read = |y: usize| {
        let mut raw = vec![0.0f32; width * columns];
        lines.read(y, &mut scratch, &mut raw);
        let mut out = vec![0.0f32; width * columns];
        for x in 0..width {
            let cell = |x: usize| &raw[x * columns..][..columns];
            let (a, b, c) = (cell(x.saturating_sub(1)), cell(x), cell((x + 1).min(width - 1)));
            let out = &mut out[x * columns..][..columns];
            for (j, out) in out.iter_mut().enumerate() {
                *out = 0.25 * a[j] + 0.5 * b[j] + 0.25 * c[j];
            }
        }
        out
    };
    let mut above = read(first.saturating_sub(1));
    let mut here = if first == 0 { above.clone() } else { read(first) };
    let mut result = Vec::with_capacity(count * width * columns);
    for y in first..first + count {
        let below = if y == last { here.clone() } else { read(y + 1) };
        let three = above.iter().zip(&here).zip(&below);
        result.extend(three.map(|((a, b), c)| 0.25 * a + 0.5 * b + 0.25 * c));
        above = std::mem::replace(&mut here, below);
    }
    result
}
