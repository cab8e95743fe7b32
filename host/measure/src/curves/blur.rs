//! How much the lens blurs, from the grey card's edges.
//!
//! Problem: a lens out of focus makes a foil's peak lower and wider, and nothing in the curve shows it. Method: across an edge of the card light
//! goes from one level to the other; of a sharp one a quarter to three quarters of the step take half a pixel, of one blurred by a normal
//! distribution 1.35 of its deviations. The median of all lines across all edges counts. Cost: some thousand lines of a few
//! pixels. Limits: the card stands in focus where the sample does; blur is taken to be the same everywhere and in all directions.

use crate::camera::merge::Radiance;
use crate::linalg::median;

/// The distance from a quarter to three quarters of a normal distribution, in deviations: 2 x 0.6745, by its
/// definition.
const QUARTERS: f64 = 1.349;
/// The same distance for an edge that only the pixel blurs: the step is a straight line over one pixel, half
/// of which lies between its quarters.
const PIXEL: f64 = 0.5;
/// The least blur that is one: a sharp edge through the middle of a pixel takes a whole pixel, which reads as 0.64.
const LEAST: f64 = 0.65;
/// The least step across an edge, relative to the brighter side.
const STEP: f64 = 0.4;
/// A blur in pixels that is worth a word: below it a foil's peak keeps its height within the band.
const OUT_OF_FOCUS: f64 = 0.8;
/// Lines that tell a blur.
const FEWEST: usize = 12;

/// Standard deviation of the lens' blur in pixels; 0 where the card's edges do not tell.
pub(crate) fn of_card(radiance: &Radiance, steps: &[[f64; 4]; 3]) -> f64 {
    let mut widths = Vec::new();
    for [left, top, right, bottom] in *steps {
        let (wide, high) = (right - left, bottom - top);
        // Across upright edges, then across level ones.
        for (edge, from, to, reach, level) in [
            (left, top + 0.25 * high, bottom - 0.25 * high, 0.45 * wide, false),
            (right, top + 0.25 * high, bottom - 0.25 * high, 0.45 * wide, false),
            (top, left + 0.25 * wide, right - 0.25 * wide, 0.45 * high, true),
            (bottom, left + 0.25 * wide, right - 0.25 * wide, 0.45 * high, true),
        ] {
            for line in from.max(0.0) as usize..to.max(0.0) as usize {
                let value = |at: i64| -> Option<f64> {
                    let (x, y) = if level { (line as i64, at) } else { (at, line as i64) };
                    let inside =
                        x >= 0 && y >= 0 && (x as usize) < radiance.width && (y as usize) < radiance.height;
                    let i = inside.then(|| 3 * (y as usize * radiance.width + x as usize) + 1)?;
                    Some(f64::from(radiance.value[i])).filter(|v| v.is_finite())
                };
                widths.extend(width(value, edge, reach));
            }
        }
    }
    if widths.len() < FEWEST {
        return 0.0;
    }
    let width = median(&mut widths);
    let blur = ((width / QUARTERS).powi(2) - (PIXEL / QUARTERS).powi(2)).max(0.0).sqrt();
    if blur < LEAST { 0.0 } else { blur }
}

/// From a quarter to three quarters of the step at an edge, in pixels.
fn width(value: impl Fn(i64) -> Option<f64>, edge: f64, reach: f64) -> Option<f64> {
    let (from, to) = ((edge - reach).round() as i64, (edge + reach).round() as i64);
    let line: Vec<f64> = (from..=to).map(&value).collect::<Option<_>>()?;
    let ends = (line.len() / 5).max(2);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (a, b) = (mean(&line[..ends]), mean(&line[line.len() - ends..]));
    if (a - b).abs() < STEP * a.max(b) {
        return None;
    }
    let part = |v: f64| (v - a) / (b - a);
    // The first place beyond a quarter, and the last before three quarters.
    let crossing = |level: f64| {
        let i = (1..line.len()).find(|&i| part(line[i]) >= level)?;
        let (before, after) = (part(line[i - 1]), part(line[i]));
        Some(i as f64 - (after - level) / (after - before).max(1e-9))
    };
    Some(crossing(0.75)? - crossing(0.25)?).filter(|width| *width > 0.0)
}

/// What to do about a lens that blurs.
pub fn advice(blur: f64, lamp: usize) -> Option<String> {
    (blur > OUT_OF_FOCUS).then(|| {
        format!(
            "lamp {lamp}: the card's edges are blurred by {blur:.1} pixels, so the lens is out of focus or the camera shook: focus on the card, and \
             close the aperture to f/8"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of 10 to 1 whose light is a sum of normal deviations over parts of a pixel.
    #[test]
    fn a_known_blur_is_found() {
        for sigma in [0.05, 1.0, 1.5, 3.0] {
            let (size, steps) = (120usize, [[40.3, 40.3, 80.3, 80.3]; 3]);
            let inside = |at: f64| {
                let spread = |edge: f64| {
                    (0..60)
                        .map(|k| {
                            let z = (f64::from(k) + 0.5) / 10.0 - 3.0;
                            let weight = (-0.5 * z * z).exp();
                            (weight, if at + sigma * z > edge { weight } else { 0.0 })
                        })
                        .fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
                };
                let (left, right) = (spread(40.3), spread(80.3));
                left.1 / left.0 - right.1 / right.0
            };
            let along: Vec<f64> = (0..size)
                .map(|i| (0..20).map(|k| inside(i as f64 + (f64::from(k) + 0.5) / 20.0)).sum::<f64>() / 20.0)
                .collect();
            let value: Vec<f32> = (0..3 * size * size)
                .map(|i| (0.1 + 0.9 * along[i / 3 % size] * along[i / 3 / size]) as f32)
                .collect();
            let none = vec![0; size * size];
            let radiance = Radiance {
                width: size,
                height: size,
                variance: vec![1e-9; value.len()],
                bound: none.clone(),
                first: none,
                value,
            };
            let found = of_card(&radiance, &steps);
            assert!((found - sigma).abs() < 0.1 + 0.05 * sigma, "{sigma}: {found}");
        }
    }
}
