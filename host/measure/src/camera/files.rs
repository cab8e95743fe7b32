//! What the files of a series say of themselves: whether their values are proportional to light, and whether black is 0.
//!
//! Problem: a tone curve or a black level that was not subtracted makes photographs differ, and reads as a wrong exposure time or another scene.
//! Method: in even places that are not full, a value of the shorter exposure is a straight line over that of the longer: `v' = r v + (1 - r) b`
//! with black b, where r is the ratio of exposures; with a power g it is `r^g v`. The line is fitted with relative weights, robustly.
//! Cost: a pass over the small copies. Limits: even places of one photograph are even in the next, so no alignment is needed.

use super::exposure::Exposure;
use super::probe::{CLIPPED, Probe};
use crate::MeasureError;
use crate::linalg::median;

/// A relative difference between neighbours in an even place.
const EVEN: f32 = 0.05;
/// Even places that tell a line.
const ENOUGH: usize = 300;
/// A black of so many standard errors is one, from this part of the sensor's range on.
const SURE: f64 = 5.0;
const LEAST_BLACK: f64 = 1e-3;
/// How far from 1 an exponent shows a tone curve, and how far pairs may differ about it.
const CURVED: f64 = 0.15;
/// The largest relative standard error of a slope that tells a power.
const SHARP: f64 = 0.03;

/// A photograph's values as a line over those of a longer one.
struct Line {
    slope: f64,
    /// The slope's relative standard error.
    slope_error: f64,
    /// Black in parts of the sensor's range, for the slope that was found, and its standard error.
    black: f64,
    error: f64,
}

/// Checks the files of a series whose values are said to be proportional to light.
///
/// # Errors
/// A tone curve, or black that is not 0.
pub(crate) fn check(
    exposures: &[Exposure],
    probes: &[Probe],
    relative: &[f64],
    white: [f32; 3],
) -> Result<(), MeasureError> {
    let mut powers = Vec::new();
    let mut blacks: Vec<(usize, f64, f64)> = Vec::new();
    for i in 1..probes.len() {
        let expected = relative[i] / relative[i - 1];
        let Some(line) = line(&probes[i - 1], &probes[i], white).filter(|_| expected < 0.8) else { continue };
        if line.slope_error < SHARP {
            powers.push(line.slope.max(1e-6).ln() / expected.ln());
        }
        blacks.push((i, line.black, line.error));
    }
    let power = median(&mut powers.clone());
    // One pair may be a wrong time; several that agree are not.
    let agree = powers.iter().filter(|p| (*p - power).abs() < CURVED).count();
    let is_curved = (power - 1.0).abs() > CURVED;
    if agree >= 2 && 2 * agree > powers.len() && is_curved {
        return Err(MeasureError::photo(
            &exposures[0].path,
            format!(
                "the values of this series are not proportional to light: they go with its power {power:.2}, as a tone curve makes them \
                 (sRGB: about 0.45); develop RAW without one (linear, gamma 1), or set photos.linear = false"
            ),
        ));
    }
    let weight: f64 = blacks.iter().map(|b| b.2.powi(-2)).sum();
    let black = blacks.iter().map(|b| b.1 * b.2.powi(-2)).sum::<f64>() / weight;
    if powers.is_empty() || is_curved || black.abs() < LEAST_BLACK || black.abs() < SURE * weight.powf(-0.5) {
        return Ok(());
    }
    Err(MeasureError::photo(
        &exposures[0].path,
        format!(
            "black is not 0 in this series: {:+.2} % of the sensor's range lies under every value; develop with the camera's black level \
             subtracted, or give photos.dark_frame",
            100.0 * black
        ),
    ))
}

/// The line through even places of two photographs, in green.
fn line(longer: &Probe, shorter: &Probe, white: [f32; 3]) -> Option<Line> {
    let limit = if white[1].is_finite() { white[1] } else { longer.top[1].0.max(shorter.top[1].0) };
    let (width, height) = (longer.width, longer.height);
    let mut places: Vec<(f64, f64)> = Vec::new();
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let i = y * width + x;
            let near = [i - 1, i + 1, i - width, i + width];
            let value = |probe: &Probe| probe.mean[i][1];
            let even = |probe: &Probe| {
                near.iter().all(|&j| (probe.mean[j][1] - value(probe)).abs() <= EVEN * value(probe))
            };
            let full = |probe: &Probe| {
                near.iter().chain(&[i]).any(|&j| (0..3).any(|c| probe.most[j][c] >= CLIPPED * white[c]))
            };
            // The longer one tells what is even; noise and black's own share blur that in the shorter.
            if value(longer) > 0.01 * limit && even(longer) && !full(longer) && !full(shorter) {
                places.push((f64::from(value(longer) / limit), f64::from(value(shorter) / limit)));
            }
        }
    }
    if places.len() < ENOUGH {
        return None;
    }
    let mut weights: Vec<f64> = places.iter().map(|(v, _)| 1.0 / (v * v)).collect();
    let (mut slope, mut at0, mut error, mut slope_error) = (0.0, 0.0, 0.0, 0.0);
    for _ in 0..6 {
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            places.iter().zip(&weights).map(|((v, s), w)| w * f(*v, *s)).sum()
        };
        let (n, v, s) = (sum(&|_, _| 1.0), sum(&|v, _| v), sum(&|_, s| s));
        let (vv, vs) = (sum(&|v, _| v * v), sum(&|v, s| v * s));
        let det = n * vv - v * v;
        if det <= 1e-12 * n * vv {
            return None;
        }
        slope = (n * vs - v * s) / det;
        at0 = (vv * s - v * vs) / det;
        let off: Vec<f64> = places.iter().map(|(v, s)| (s - slope * v - at0) / v).collect();
        let scale = (1.4826 * median(&mut off.iter().map(|o| o.abs()).collect::<Vec<_>>())).max(1e-7);
        error = scale * (vv / det).sqrt();
        slope_error = scale * (n / det).sqrt() / slope.abs();
        weights = places
            .iter()
            .zip(&off)
            .map(|((v, _), off)| 1.0 / (v * v) / (1.0 + (off / scale / 2.0).powi(2)).powi(2))
            .collect();
    }
    (slope > 0.0 && slope < 0.9).then(|| Line {
        slope,
        slope_error,
        black: at0 / (1.0 - slope),
        error: (error / (1.0 - slope)).max(1e-6),
    })
}
