//! The weights of every pixel of a document over given bases, and the error of the result.
//!
//! Method: each distinct material is coded in the metric on its own and rounded to fixed point; runs of fixed length go to
//! the threads. Errors are those of the rounded weights. Cost: a few microseconds per distinct material; memory for the
//! maps and a few numbers per pixel.

use rayon::prelude::*;

use crate::materials::{Distinct, Materials};
use crate::weights::{ONE, WeightMaps, quantise};
use observe::Observer;

use super::code::Coder;
use super::columns::Columns;
use super::error::FactorError;
use super::sample::read;

/// Materials per run: enough work for a thread, and many runs so that no thread waits for another.
const RUN: usize = 4096;
/// A distance that would be barely visible: what is nearer is covered.
const COVERED: f32 = 0.01;

/// Distances between pixels and their mixtures, in the metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Errors {
    /// Root mean square.
    pub rmse: f64,
    /// The distance that 95 % of the pixels do not exceed.
    pub p95: f64,
    /// The largest.
    pub max: f64,
    /// Share above 0.01.
    pub uncovered: f64,
}

/// Weight maps of the whole document over `bases` (rows of `columns`).
pub(super) fn weigh(
    document: &dyn Materials,
    columns: &Columns,
    bases: &[f32],
    observer: &dyn Observer,
) -> Result<(WeightMaps, Errors), FactorError> {
    let (width, height) = (document.width(), document.height());
    let k = bases.len() / columns.padded;
    let distinct = Distinct::find(document);
    let mut data = vec![0u16; distinct.first().len() * k];
    let mut distance = vec![0.0f32; distinct.first().len()];
    observer.begin("computing weights", distance.len() as u64);
    let runs: Vec<Result<(), FactorError>> = data
        .par_chunks_mut(RUN * k)
        .zip(distance.par_chunks_mut(RUN))
        .zip(distinct.first().par_chunks(RUN))
        .map(|((data, distance), pixels)| {
            weigh_run(document, columns, bases, pixels, data, distance)?;
            observer.advance(distance.len() as u64);
            Ok(())
        })
        .collect();
    observer.end();
    // Reports the first error in reading order, whichever thread found one first.
    runs.into_iter().collect::<Result<(), _>>()?;
    let maps = WeightMaps::new(width, height, k, distinct.spread(data, k))?;
    Ok((maps, measure(&mut distinct.spread(&distance, 1))))
}

fn weigh_run(
    document: &dyn Materials,
    columns: &Columns,
    bases: &[f32],
    pixels: &[u32],
    data: &mut [u16],
    distance: &mut [f32],
) -> Result<(), FactorError> {
    let coder = Coder::new(columns, bases);
    let mut scratch = coder.scratch();
    let k = bases.len() / columns.padded;
    let mut row = vec![0.0; columns.real];
    let (mut x, mut t) = (vec![0.0; columns.padded], vec![0.0; columns.padded]);
    let mut a = vec![0.0; k];
    for ((&pixel, rounded), distance) in pixels.iter().zip(data.chunks_exact_mut(k)).zip(distance) {
        read(document, pixel as usize, &mut row)?;
        columns.scale(&row, &mut x);
        columns.respond(&x, &mut t);
        coder.code(&x, &t, &mut a, &mut scratch);
        quantise(&a, rounded);
        a.iter_mut().zip(rounded.iter()).for_each(|(a, &r)| *a = f64::from(r) / f64::from(ONE));
        *distance = coder.evaluate(&t, &a, &mut scratch).sqrt() as f32;
    }
    Ok(())
}

/// Adds in runs of fixed length; reorders the distances.
fn measure(distance: &mut [f32]) -> Errors {
    let n = distance.len();
    let squares: f64 =
        distance.chunks(RUN).map(|run| run.iter().map(|&d| f64::from(d) * f64::from(d)).sum::<f64>()).sum();
    let uncovered = distance.iter().filter(|&&d| d > COVERED).count() as f64 / n as f64;
    let max = f64::from(distance.iter().copied().fold(0.0, f32::max));
    // The smallest distance that at least 95 % of the pixels do not exceed.
    let place = (n * 95).div_ceil(100).max(1) - 1;
    let (_, p95, _) = distance.select_nth_unstable_by(place, f32::total_cmp);
    Errors { rmse: (squares / n as f64).sqrt(), p95: f64::from(*p95), max, uncovered }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_p95_of_a_hundred_distances_is_the_ninety_fifth() {
        let mut distance: Vec<f32> = (1..=100).rev().map(|d| d as f32 / 1000.0).collect();
        let errors = measure(&mut distance);
        assert_eq!(errors.p95, f64::from(0.095f32));
        assert_eq!(errors.max, f64::from(0.1f32));
        assert!((errors.uncovered - 0.9).abs() < 1e-12);
        // Root of the mean square of 1..=n is the root of (n + 1)(2n + 1) / 6.
        assert!((errors.rmse - 1e-3 * (101.0f64 * 201.0 / 6.0).sqrt()).abs() < 1e-8);
    }
}
