//! The weight of the clamped mixture at each pixel, smooth over the document.
//!
//! Problem: clamping is best inside the gamut and loses differences outside; the mapped bases keep
//! differences everywhere and are never exact. Any average of the two is printable.
//! Method: the weight s falls from 1 at an invisible distance to 0 at an obvious one (smoothstep). A guided
//! filter then smooths it within a material and lets it change where the material does, so that no new
//! edges appear.
//! Cost: 20 passes over the pixels, independent of the radius, and a comparison of each pixel with its
//! average.
//! Source: He, Sun & Tang 2010 for the filter; the guide is the mean cube root of the reflected radiance.

use rayon::prelude::*;

use super::clamp::Clamped;
use super::refit::{Solver, in_pixel};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::materials::Materials;
use crate::weights::{ONE, WeightMaps, quantise};

/// The distance up to which a clamped pixel counts as in the gamut, and the one from which it counts as far
/// outside.
const INVISIBLE: f32 = 0.01;
const OBVIOUS: f32 = 0.05;
/// Pixels per parallel task: enough work for a thread, and many tasks so that no thread waits for another.
const RUN: usize = 1024;
/// Half the window of the filter, in pixels, and the difference in brightness that counts as an edge.
const RADIUS: usize = 8;
const EDGE: f64 = 0.02;

/// The weight of the clamped mixture at each pixel, 0..=1, from its distance and brightness.
pub(crate) fn shares(distance: &[f32], brightness: &[f32], width: usize) -> Vec<f32> {
    let near: Vec<f32> = distance
        .iter()
        .map(|&d| {
            let t = ((OBVIOUS - d) / (OBVIOUS - INVISIBLE)).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        })
        .collect();
    guided(&near, brightness, width, RADIUS, EDGE * EDGE)
}

/// Averages the clamped mixture of each pixel with its mixture of the mapped bases; `s` is the weight of
/// the former. The distances become those of the averages.
pub(crate) fn mix(
    candidates: &Candidates,
    pixels: &dyn Materials,
    clamped: &mut Clamped,
    s: &[f32],
    maps: &WeightMaps,
    bases: &[Vec<u16>],
) -> Result<(), GamutError> {
    let k = candidates.len();
    let seen = clamped.distance.par_chunks_mut(RUN).zip(clamped.light.par_chunks_mut(RUN));
    let runs = clamped.shares.par_chunks_mut(k * RUN).zip(seen).enumerate();
    runs.map(|(run, (shares, (distance, light)))| {
        let mut solver = Solver::new(candidates, pixels);
        let mut row = vec![0.0; k];
        for (i, shares) in shares.chunks_exact_mut(k).enumerate() {
            let pixel = run * RUN + i;
            average(shares, s[pixel], maps.at(pixel), bases, &mut row);
            solver.aim(pixel).map_err(in_pixel(pixel, pixels.width()))?;
            solver.start(shares);
            distance[i] = solver.compare() as f32;
            light[i] = solver.light() as f32;
        }
        Ok(())
    })
    .collect()
}

/// The average of a pixel's clamped mixture, with weight `s`, and its mixture of the mapped bases. `row`
/// has room for one number a candidate.
pub(crate) fn average(shares: &mut [u16], s: f32, weights: &[u16], bases: &[Vec<u16>], row: &mut [f64]) {
    let s = f64::from(s);
    row.fill(0.0);
    for (&weight, basis) in weights.iter().zip(bases) {
        if weight > 0 {
            let w = (1.0 - s) * f64::from(weight) / f64::from(ONE);
            row.iter_mut().zip(basis).for_each(|(row, &b)| *row += w * f64::from(b));
        }
    }
    for (row, &share) in row.iter_mut().zip(shares.iter()) {
        *row = (*row + s * f64::from(share)) / f64::from(ONE);
    }
    quantise(row, shares);
}

/// The guided filter, with the result limited to 0..=1.
fn guided(signal: &[f32], guide: &[f32], width: usize, radius: usize, edge: f64) -> Vec<f32> {
    let mean = |values: Vec<f64>| box_mean(&values, width, radius);
    let signal = || signal.iter().map(|&v| f64::from(v));
    let guide = || guide.iter().map(|&v| f64::from(v));
    let mean_guide = mean(guide().collect());
    let mean_signal = mean(signal().collect());
    let mean_square = mean(guide().map(|g| g * g).collect());
    let mean_product = mean(guide().zip(signal()).map(|(g, s)| g * s).collect());
    let slope: Vec<f64> = (0..mean_guide.len())
        .map(|i| {
            let variance = (mean_square[i] - mean_guide[i] * mean_guide[i]).max(0.0);
            (mean_product[i] - mean_guide[i] * mean_signal[i]) / (variance + edge)
        })
        .collect();
    let offset = mean((0..slope.len()).map(|i| mean_signal[i] - slope[i] * mean_guide[i]).collect());
    let slope = mean(slope);
    guide().enumerate().map(|(i, g)| (slope[i] * g + offset[i]).clamp(0.0, 1.0) as f32).collect()
}

/// The mean over a square window of `2 radius + 1` pixels, cut off at the edges.
fn box_mean(values: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let height = values.len() / width;
    let mut across = vec![0.0; values.len()];
    across.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(out, row)| {
        window_means(width, radius, |x| row[x], |x, mean| out[x] = mean);
    });
    // Transposed, so that both passes read memory in order.
    let turned: Vec<f64> = (0..values.len()).map(|i| across[i % height * width + i / height]).collect();
    let mut down = vec![0.0; values.len()];
    down.par_chunks_mut(height).zip(turned.par_chunks(height)).for_each(|(out, column)| {
        window_means(height, radius, |y| column[y], |y, mean| out[y] = mean);
    });
    (0..values.len()).map(|i| down[i % width * height + i / width]).collect()
}

fn window_means(n: usize, radius: usize, value: impl Fn(usize) -> f64, mut put: impl FnMut(usize, f64)) {
    let mut sum: f64 = (0..radius.min(n)).map(&value).sum();
    for i in 0..n {
        if i + radius < n {
            sum += value(i + radius);
        }
        if i > radius {
            sum -= value(i - radius - 1);
        }
        let count = (i + radius).min(n - 1) - i.saturating_sub(radius) + 1;
        put(i, sum / count as f64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(testing::cases(40))]
        #[test]
        fn box_means_are_the_plain_means(
            width in 1usize..20,
            height in 1usize..20,
            radius in 1usize..10,
            seed in prop::collection::vec(-1.0f64..1.0, 400),
        ) {
            let values = &seed[..width * height];
            let means = box_mean(values, width, radius);
            for y in 0..height {
                for x in 0..width {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for v in y.saturating_sub(radius)..=(y + radius).min(height - 1) {
                        for u in x.saturating_sub(radius)..=(x + radius).min(width - 1) {
                            sum += values[v * width + u];
                            count += 1.0;
                        }
                    }
                    prop_assert!((means[y * width + x] - sum / count).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn one_material_has_one_share() {
        let shares = shares(&[0.03; 30 * 20], &[0.4; 600], 30);
        assert!(shares.iter().all(|s| (s - 0.5).abs() < 1e-6), "{:?}", &shares[..4]);
    }

    /// Two flat materials side by side, one printable and one far outside: the weight changes with the
    /// material and is constant on either side.
    #[test]
    fn shares_change_where_the_material_does() {
        let width = 64;
        let left = |i: usize| i % width < width / 2;
        let distance: Vec<f32> = (0..width * 16).map(|i| if left(i) { 0.002 } else { 0.09 }).collect();
        let brightness: Vec<f32> = (0..width * 16).map(|i| if left(i) { 0.3 } else { 0.8 }).collect();
        let shares = shares(&distance, &brightness, width);
        for (i, s) in shares.iter().enumerate() {
            assert!((s - if left(i) { 1.0 } else { 0.0 }).abs() < 0.02, "{i}: {s}");
        }
    }

    /// A noisy distance within one material is evened out.
    #[test]
    fn noise_within_a_material_is_smoothed() {
        let width = 64;
        let distance: Vec<f32> =
            (0..width * 64).map(|i| if (i * 7919) % 13 < 6 { 0.02 } else { 0.04 }).collect();
        let shares = shares(&distance, &vec![0.5; width * 64], width);
        let (low, high) = shares.iter().fold((1f32, 0f32), |(l, h), &s| (l.min(s), h.max(s)));
        assert!(high - low < 0.15, "{low} {high}");
    }
}
