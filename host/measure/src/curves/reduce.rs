//! Pixels to a curve over the half angle, with the standard deviation of each sample.
//!
//! Problem: pixels and lamps have an extent, which at a foil's peak is wider than the peak's slope allows; bins do, too; some pixels
//! show dust, shadows or edges. Method: each pixel's radiance is divided by what the present curve predicts for it, averaged over
//! its area and the lamp's disc; the robust mean of these ratios corrects the curve's sample in that bin (the square-root grid), and this
//! repeats, so that neither the slope within a bin nor the blur of pixel and lamp remains. Pixels farther than
//! 3.5 robust deviations are left out. Then ln f is smoothed (see `smooth`). Below the smallest half angle
//! a GGX lobe fitted to the first samples continues the curve, above the largest the last sample; both are marked.
//! Deviations add up: noise, disagreement between parts of the sample, geometry (one standard deviation of each
//! measure), card. Cost: nine views a pixel and round, for at most `MOST` pixels a bin. Limits: peaks narrower than the blur are
//! marked `blurred`, and samples beside them whose pixels mostly see the peak: their height is a guess. Lens flare stays in.

use std::f64::consts::FRAC_PI_2;

use inks::ggx;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::extent::{BINS, Logs, Pixel, angle, place, predicted, share_below, value};
use super::smooth::{falling_then_rising, smooth};
use crate::geometry::scene::{Scene, View};
use crate::linalg::spread;

/// The most pixels of a bin that take part: enough that noise of 2 % averages to 0.04 %, which is far less
/// than the geometry's share.
pub(crate) const MOST: usize = 3000;
/// The fewest pixels of a bin: with fewer a median and a spread would be chance.
const FEWEST: usize = 8;
/// Corrections of the curve, and those that a lens' blur of more than half a pixel needs.
const ROUNDS: usize = 5;
/// Corrections that a lens' blur of more than half a pixel needs: each takes off a part of the blur only.
const BLURRED_ROUNDS: usize = 12;
/// Farther than this many robust deviations a pixel shows something else: of 3,000 pixels of a normal
/// distribution one would be.
const STRANGE: f64 = 3.5;
/// Cosines below this are too near the horizon, where reflectance no longer depends on the half angle only:
/// 81 degrees (decisions/curves-from-photographs.md, limits).
pub const HORIZON: f64 = 0.15;
/// The share of clipped pixels from which a sample is a lower bound.
const CLIPPED: f64 = 0.02;
/// The factor between a pixel's mean and its middle beyond which the peak is not resolved.
const BLURRED: f64 = 1.3;
/// The share of light from blurred samples beyond which pixels say no more than those do
/// (decisions/curves-from-photographs.md, limits).
const FROM_BLURRED: f64 = 0.1;
/// The relative standard deviation of a clipped or blurred sample, beside what else is uncertain of it
/// (decisions/curves-from-photographs.md, limits).
const GUESSED: f64 = 0.5;
/// The largest relative standard deviation: nothing is known.
const UNKNOWN: f64 = 2.0;
/// Half angles above this (radians) are held constant.
const GRAZING: f64 = 1.31;

/// How a sample was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleOrigin {
    /// From pixels.
    Measured,
    /// From pixels, but the peak is narrower than a pixel or the lamp.
    Blurred,
    /// No exposure was short enough: at least this much.
    Clipped,
    /// From the samples beside it.
    Extrapolated,
}

impl SampleOrigin {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            SampleOrigin::Measured => "measured",
            SampleOrigin::Blurred => "blurred",
            SampleOrigin::Clipped => "clipped",
            SampleOrigin::Extrapolated => "extrapolated",
        }
    }
}

/// A sample of a curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CurveRow {
    /// Half angle in degrees.
    pub theta_deg: f64,
    /// Reflectance in 1/sr.
    pub rgb: [f64; 3],
    /// Its standard deviation.
    pub sigma: [f64; 3],
    /// Pixels it is from.
    pub pixels: usize,
    /// How it was obtained.
    pub kind: SampleOrigin,
}

/// A curve from pixels.
pub struct Reduced {
    /// Its samples, from 0 to 90 degrees.
    pub rows: Vec<CurveRow>,
    /// ln f at the middles of the bins, before it is smoothed.
    pub(crate) curve: Logs,
    /// Pixels that took part: x, y, series, and the deviation of ln f from the curve; those left out have none.
    pub used: Vec<(f64, f64, usize, Option<f64>)>,
}

/// Robust weighted mean of ratios: mean, standard deviation of one value, and which belong to it.
fn robust(values: &[(f64, f64)]) -> (f64, f64, Vec<bool>) {
    let plain: Vec<f64> = values.iter().map(|v| v.0).collect();
    let (middle, width) = spread(&plain);
    let belongs: Vec<bool> = values
        .iter()
        .map(|(v, variance)| (v - middle).abs() <= STRANGE * width.max(variance.sqrt()).max(1e-6))
        .collect();
    let (mut sum, mut weight) = (0.0, 0.0);
    for ((v, variance), _) in values.iter().zip(&belongs).filter(|(_, b)| **b) {
        let w = 1.0 / (variance + 1e-4);
        sum += w * v;
        weight += w;
    }
    (if weight > 0.0 { sum / weight } else { middle }, width, belongs)
}

/// A bin's sample before smoothing.
#[derive(Clone, Copy, Default)]
struct Bin {
    pixels: usize,
    /// Variance of ln f for each channel.
    variance: [f64; 3],
    clipped: [bool; 3],
    blurred: bool,
}

/// Pixels with their views, bin by bin, thinned to `MOST`.
fn binned(scene: &Scene, pixels: &[Pixel]) -> Vec<Vec<(Pixel, View)>> {
    let mut bins: Vec<Vec<(Pixel, View)>> = vec![Vec::new(); BINS];
    let seen: Vec<Option<View>> = pixels.par_iter().map(|p| scene.seen(p.x, p.y, p.light, p.first)).collect();
    for (pixel, view) in pixels.iter().zip(seen) {
        if let Some(view) = view.filter(|v| v.cos_i >= HORIZON && v.cos_o >= HORIZON) {
            bins[(place(view.theta) as usize).min(BINS - 1)].push((*pixel, view));
        }
    }
    for bin in &mut bins {
        let step = bin.len().div_ceil(MOST).max(1);
        let mut i = 0;
        bin.retain(|_| {
            i += 1;
            i % step == 0 || step == 1
        });
    }
    bins
}

/// What is uncertain besides the pixels.
#[derive(Clone, Default)]
pub struct Doubts {
    /// Scenes one standard deviation away, with the factor that each puts on the card's scale.
    pub scenes: Vec<(Scene, Vec<f64>)>,
    /// Relative standard deviation of the scale.
    pub card: f64,
    /// Reflectance that light on the card, but not the lamp's, pretends.
    pub card_foreign: [f64; 3],
    /// Radiance that may not be the lamp's, in the units of the pixels.
    pub foreign: [f64; 3],
}

/// Makes a curve.
pub fn reduce(scene: &Scene, pixels: &[Pixel], doubts: &Doubts) -> Reduced {
    let bins = binned(scene, pixels);
    let mut curve: Logs = [[f64::NAN; BINS]; 3];
    for (b, bin) in bins.iter().enumerate().filter(|(_, bin)| bin.len() >= FEWEST) {
        for c in 0..3 {
            let mut ratios: Vec<f64> = bin.iter().map(|(p, v)| p.value[c] / v.irradiance).collect();
            curve[c][b] = crate::linalg::median(&mut ratios).max(1e-7).ln();
        }
    }
    fill(&mut curve);
    let mut found = [Bin::default(); BINS];
    let mut used = Vec::new();
    let rounds = if scene.blur() > 0.5 { BLURRED_ROUNDS } else { ROUNDS };
    for round in 0..rounds {
        let results: Vec<(Bin, [f64; 3], Vec<Option<f64>>)> =
            bins.par_iter().map(|bin| correct(scene, bin, &curve)).collect();
        used.clear();
        for (b, (bin, ratio, deviations)) in results.into_iter().enumerate() {
            found[b] = bin;
            if bin.pixels >= FEWEST && round + 1 < rounds {
                for c in 0..3 {
                    curve[c][b] += ratio[c].clamp(0.2, 5.0).ln();
                }
            } else {
                curve.iter_mut().filter(|_| bin.pixels < FEWEST).for_each(|channel| channel[b] = f64::NAN);
            }
            used.extend(bins[b].iter().zip(deviations).map(|((p, _), d)| (p.x, p.y, p.light, d)));
        }
        fill(&mut curve);
    }
    spread_blur(scene, &bins, &curve, &mut found);
    let mut others = shifts(scene, pixels, &curve, &doubts.scenes);
    for ((b, others), bin) in others.iter_mut().enumerate().zip(&bins) {
        let mut light: Vec<f64> = bin.iter().map(|(_, view)| view.irradiance).collect();
        let light = crate::linalg::median(&mut light).max(1e-30);
        for c in 0..3 {
            let f = curve[c][b].exp().max(1e-9);
            others[c] += doubts.card.powi(2)
                + (doubts.card_foreign[c] / f).powi(2)
                + (doubts.foreign[c] / light / f).powi(2);
        }
    }
    Reduced { rows: rows(&curve, &found, &others), curve, used }
}

/// Marks samples beside a blurred peak, too, as long as their pixels see so much of it that its height decides what they are.
fn spread_blur(scene: &Scene, bins: &[Vec<(Pixel, View)>], curve: &Logs, found: &mut [Bin; BINS]) {
    let Some(last) = found.iter().rposition(|bin| bin.blurred) else { return };
    let edge = FRAC_PI_2 * ((last + 1) as f64 / BINS as f64).powi(2);
    for (bin, found) in bins.iter().zip(found).skip(last + 1).filter(|(bin, _)| bin.len() >= FEWEST) {
        let shares: f64 = bin.iter().map(|(p, _)| share_below(scene, p, curve, edge)).sum();
        found.blurred = shares > FROM_BLURRED * bin.len() as f64;
        if !found.blurred {
            break;
        }
    }
}

/// Ratios of a bin's pixels to the curve: its statistics, its correction, and each pixel's deviation.
fn correct(scene: &Scene, bin: &[(Pixel, View)], curve: &Logs) -> (Bin, [f64; 3], Vec<Option<f64>>) {
    if bin.len() < FEWEST {
        return (Bin { pixels: bin.len(), ..Bin::default() }, [1.0; 3], vec![None; bin.len()]);
    }
    let predictions: Vec<[f64; 3]> = bin.iter().map(|(p, v)| predicted(scene, p, v, curve)).collect();
    let mut result = Bin { pixels: bin.len(), ..Bin::default() };
    let mut ratio = [1.0; 3];
    let mut deviations = vec![None; bin.len()];
    for c in 0..3 {
        let bound = bin.iter().filter(|(p, _)| p.bound & 1 << c != 0).count();
        result.clipped[c] = bound as f64 > CLIPPED * bin.len() as f64;
        let values: Vec<(f64, f64)> = bin
            .iter()
            .zip(&predictions)
            .map(|((p, _), m)| (p.value[c] / m[c], p.variance[c] * (p.value[c] / m[c]).powi(2)))
            .collect();
        let (mean, width, belongs) = robust(&values);
        ratio[c] = mean;
        let kept = belongs.iter().filter(|b| **b).count().max(1);
        let mut variance = (width * width / kept as f64).max(1e-8);
        // Parts of the sample that disagree: four for each lamp, by side and height.
        let mut parts: std::collections::BTreeMap<(usize, bool, bool), (f64, usize)> =
            std::collections::BTreeMap::new();
        for (((p, v), (value, _)), _) in bin.iter().zip(&values).zip(&belongs).filter(|(_, b)| **b) {
            let part = parts.entry((p.light, v.place[0] > 0.0, v.place[1] > 0.0)).or_default();
            part.0 += value;
            part.1 += 1;
        }
        let means: Vec<f64> = parts.values().filter(|p| p.1 >= 4).map(|p| p.0 / p.1 as f64).collect();
        if means.len() >= 2 {
            let n = means.len() as f64;
            let middle = means.iter().sum::<f64>() / n;
            variance = variance.max(means.iter().map(|m| (m - middle).powi(2)).sum::<f64>() / (n - 1.0) / n);
        }
        result.variance[c] = variance / (mean * mean).max(1e-6);
        if c == 1 {
            for (deviation, ((value, _), belongs)) in deviations.iter_mut().zip(values.iter().zip(&belongs)) {
                *deviation = belongs.then(|| (value / mean).max(1e-3).ln());
            }
        }
    }
    let blur =
        bin.iter().zip(&predictions).map(|((_, v), m)| m[1] / (value(curve, v.theta)[1] * v.irradiance));
    let mut blur: Vec<f64> = blur.collect();
    let blur = crate::linalg::median(&mut blur);
    result.blurred = !(1.0 / BLURRED..=BLURRED).contains(&blur);
    (result, ratio, deviations)
}

/// Fills samples that are not numbers: constant outside, straight between, the first ones even about 0 degrees.
fn fill(curve: &mut Logs) {
    for channel in curve {
        let known: Vec<usize> = (0..BINS).filter(|&b| channel[b].is_finite()).collect();
        let (Some(&first), Some(&last)) = (known.first(), known.last()) else {
            channel.fill(-10.0);
            continue;
        };
        // ln f is a parabola in theta near the peak, its curvature that of the first samples.
        let second = known.get(2).copied().unwrap_or(last);
        let (a, b) = (angle(first).powi(2), angle(second).powi(2));
        let slope = if b > a { ((channel[second] - channel[first]) / (b - a)).min(0.0) } else { 0.0 };
        for bin in 0..first {
            channel[bin] = channel[first] + slope * (angle(bin).powi(2) - a);
        }
        let end = channel[last];
        channel[last..].fill(end);
        for pair in known.windows(2) {
            for bin in pair[0] + 1..pair[1] {
                let t = (bin - pair[0]) as f64 / (pair[1] - pair[0]) as f64;
                channel[bin] = channel[pair[0]] * (1.0 - t) + channel[pair[1]] * t;
            }
        }
    }
}

/// Variance of ln f in each bin and channel that the doubts about the geometry bring.
fn shifts(scene: &Scene, pixels: &[Pixel], curve: &Logs, doubts: &[(Scene, Vec<f64>)]) -> Vec<[f64; 3]> {
    let step = (pixels.len() / 60_000).max(1);
    let means = |scene: &Scene, factors: Option<&[f64]>| -> Vec<Option<[f64; 3]>> {
        let mut values: Vec<Vec<[f64; 3]>> = vec![Vec::new(); BINS];
        for p in pixels.iter().step_by(step) {
            let Some(v) =
                scene.seen(p.x, p.y, p.light, p.first).filter(|v| v.cos_i >= HORIZON && v.cos_o >= HORIZON)
            else {
                continue;
            };
            let f = value(curve, v.theta);
            let factor = factors.and_then(|f| f.get(p.light)).copied().unwrap_or(1.0);
            values[(place(v.theta) as usize).min(BINS - 1)]
                .push(std::array::from_fn(|c| factor * p.value[c] / v.irradiance / f[c]));
        }
        values
            .into_iter()
            .map(|values| {
                (values.len() >= FEWEST / 2).then(|| {
                    std::array::from_fn(|c| {
                        let mut channel: Vec<f64> = values.iter().map(|v| v[c]).collect();
                        crate::linalg::median(&mut channel)
                    })
                })
            })
            .collect()
    };
    let base = means(scene, None);
    let mut variance = vec![[0.0; 3]; BINS];
    let moved: Vec<Vec<Option<[f64; 3]>>> =
        doubts.par_iter().map(|(scene, factors)| means(scene, Some(factors))).collect();
    for other in moved {
        for ((variance, base), other) in variance.iter_mut().zip(&base).zip(other) {
            if let (Some(base), Some(other)) = (base, other) {
                for c in 0..3 {
                    let shift = (other[c] / base[c]).clamp(0.1, 10.0).ln();
                    variance[c] += if shift.is_finite() { shift * shift } else { 1.0 };
                }
            }
        }
    }
    variance
}

/// The samples of the curve: smoothed, extended, with their deviations.
fn rows(curve: &Logs, found: &[Bin; BINS], others: &[[f64; 3]]) -> Vec<CurveRow> {
    let measured = |b: usize| found[b].pixels >= FEWEST && angle(b) <= GRAZING;
    let first = (0..BINS).find(|&b| measured(b));
    let last = (0..BINS).rev().find(|&b| measured(b));
    let mut rows: Vec<CurveRow> = (0..BINS)
        .map(|b| {
            let inside = first <= Some(b) && Some(b) <= last;
            let kind = match (measured(b), found[b].blurred) {
                (true, _) if found[b].clipped.contains(&true) => SampleOrigin::Clipped,
                (true, true) => SampleOrigin::Blurred,
                (true, false) => SampleOrigin::Measured,
                // A gap of a bin or two is bridged by the smoother.
                (false, _) if inside && (b > 0 && measured(b - 1) || measured(b + 1)) => {
                    SampleOrigin::Measured
                }
                _ => SampleOrigin::Extrapolated,
            };
            CurveRow {
                theta_deg: angle(b).to_degrees(),
                rgb: [0.0; 3],
                sigma: [0.0; 3],
                pixels: found[b].pixels,
                kind,
            }
        })
        .collect();
    let (Some(_), Some(last)) = (first, last) else { return rows };
    for c in 0..3 {
        let y = curve[c];
        let certain = |b: usize| measured(b) && !found[b].clipped[c];
        let weight: Vec<f64> =
            (0..BINS).map(|b| if certain(b) { 1.0 / found[b].variance[c].max(1e-7) } else { 0.0 }).collect();
        let (z, deviation) = smooth(&y, &weight);
        let z = falling_then_rising(&z, &weight.iter().map(|w| w.max(1e-6)).collect::<Vec<_>>());
        let start = (0..BINS).find(|&b| certain(b)).unwrap_or(last);
        let peak = lobe(&z, start, last);
        for (b, row) in rows.iter_mut().enumerate() {
            let noise = if certain(b) {
                deviation[b].powi(2) + 0.5 * (z[b] - y[b]).powi(2)
            } else {
                deviation[b].powi(2)
            };
            let mut variance = noise + others[b][c];
            let mut ln = z[b];
            if b < start {
                ln = peak(angle(b)).max(z[start]);
                // Below what was seen a peak may be as much higher again as the lobe makes it.
                variance =
                    others[start][c] + deviation[start].powi(2) + (0.1 + 0.5 * (ln - z[start])).powi(2);
                if found[start].blurred {
                    // Nothing says how high a peak is of which no pixel sees a part alone.
                    variance = UNKNOWN * UNKNOWN;
                }
            } else if b > last {
                ln = z[last];
                variance = 0.09 + deviation[last].powi(2);
            }
            if measured(b) && found[b].clipped[c] {
                // What the sensor's limit shows is a lower bound.
                ln = ln.max(y[b]);
                variance += GUESSED * GUESSED;
            } else if measured(b) && found[b].blurred {
                variance += GUESSED * GUESSED;
            }
            row.rgb[c] = ln.exp();
            row.sigma[c] = row.rgb[c] * variance.sqrt().min(UNKNOWN);
        }
    }
    rows
}

/// ln of a GGX lobe on a constant, fitted to the samples from `start` on: the angle's width by a search, the rest by least squares.
fn lobe(z: &[f64], start: usize, last: usize) -> impl Fn(f64) -> f64 {
    let end = (start + 14).min(last);
    let samples: Vec<(f64, f64)> = (start..=end).map(|b| (angle(b), z[b].exp())).collect();
    let mut best = (f64::INFINITY, 0.3, [0.0, z[start].exp()]);
    for step in 0..80 {
        let alpha = 0.01 * 70f64.powf(f64::from(step) / 79.0);
        // Relative errors: each equation is divided by its sample.
        let (mut a, mut b) = ([[1e-12, 0.0], [0.0, 1e-12]], [0.0; 2]);
        for (theta, f) in &samples {
            let row = [ggx::lobe(*theta, alpha) / f, 1.0 / f];
            for i in 0..2 {
                for j in 0..2 {
                    a[i][j] += row[i] * row[j];
                }
                b[i] += row[i];
            }
        }
        let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        let mut x = [(b[0] * a[1][1] - b[1] * a[0][1]) / det, (a[0][0] * b[1] - a[1][0] * b[0]) / det];
        if x[0].is_nan() || x[0] < 0.0 {
            x = [0.0, b[1] / a[1][1]];
        } else if x[1] < 0.0 {
            x = [b[0] / a[0][0], 0.0];
        }
        let cost: f64 =
            samples.iter().map(|(t, f)| ((x[0] * ggx::lobe(*t, alpha) + x[1]) / f - 1.0).powi(2)).sum();
        if cost < best.0 {
            best = (cost, alpha, x);
        }
    }
    let (_, alpha, x) = best;
    move |theta| (x[0] * ggx::lobe(theta, alpha) + x[1]).max(1e-9).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of independent values the mean of least variance weighs each by the inverse of its variance; 1e-4 is what no pixel knows of itself.
    #[test]
    fn what_is_noisy_counts_least() {
        let values: Vec<(f64, f64)> =
            (0..100).map(|i| if i % 2 == 0 { (1.0, 1e-6) } else { (1.05, 0.01) }).collect();
        let (mean, _, belongs) = robust(&values);
        assert!(belongs.iter().all(|belongs| *belongs));
        assert!((mean - 1.0).abs() < 0.05 * 0.02, "{mean}");
    }
}
