//! The three-step grey card: where it is, and the scale it gives to radiance.
//!
//! Problem: a sensor's numbers become reflectance by comparison with something known. Method: the card is three even rectangles in
//! a row whose brightness falls as its reflectances do; regions without edges are grown in a small copy of the picture, and
//! triples of equal rectangles are looked for. Each channel's scale comes from the middle step, `k = (0.18 / pi) E / L` with the
//! irradiance E of the card from the geometry, so the card need not stand where the sample does. The outer steps show flare,
//! saturation and curved responses. Cost: one pass over a small copy. Limits: the steps side by side, level or upright.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::MeasureError;
use crate::camera::merge::Radiance;
use crate::geometry::scene::Scene;
use crate::linalg::spread;
use crate::setup;

/// Pixels across the copy in which the card is looked for.
const ACROSS: usize = 480;
/// A step between neighbours that belongs to one even surface, as a logarithm.
const EVEN: f32 = 0.06;
/// A step between neighbours that is an edge, as a logarithm. Along an edge that is not quite level, pixels go from one surface to the
/// other in steps as small as those of an even surface, so that regions do not grow from there.
const EDGE: f32 = 0.2;
/// The smallest side of a step in pixels of the copy.
const SMALLEST: f64 = 5.0;
/// The part of a step that is left out along each side.
const MARGIN: f64 = 0.2;
/// A deviation of an outer step that is worth a warning: more than the 2 % within which the scale must be
/// (decisions/curves-from-photographs.md).
pub const LINEAR: f64 = 0.03;
/// A deviation that no flare explains: this is not the card.
const NO_CARD: f64 = 0.35;

/// What the card says.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// Left, top, right, bottom of each step in pixels, brightest first.
    pub steps: [[f64; 4]; 3],
    /// Reflectance times irradiance over pi and radiance, for each channel.
    pub scale: [f64; 3],
    /// Relative standard error of the scale.
    pub error: f64,
    /// By how much the brightest and the darkest step deviate, for each channel.
    pub deviation: [[f64; 3]; 2],
    /// The reflectance of the darkest step.
    pub darkest: f64,
}

impl Calibration {
    /// The irradiance of the middle step under a light.
    pub(crate) fn irradiance(&self, scene: &Scene, light: usize) -> f64 {
        let [left, top, right, bottom] = self.steps[1];
        scene.card_irradiance(0.5 * (left + right), 0.5 * (top + bottom), light)
    }

    /// What a second try under lamp `lamp` should do otherwise.
    pub(crate) fn advice(&self, lamp: usize) -> Option<String> {
        let deviations = self.deviation.iter().flatten();
        let worst = deviations.fold(0.0f64, |a, d| if d.abs() > a.abs() { *d } else { a });
        (worst.abs() > LINEAR).then(|| {
            format!(
                "lamp {lamp}: a step of the grey card is off by {:.0} %: keep other light from the card, and bright things out of the \
                 picture; see that the files have no tone curve",
                100.0 * worst
            )
        })
    }
}

type Rectangle = [f64; 4];

/// An even region of the small copy.
struct Region {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
    ln: f64,
}

impl Region {
    fn size(&self) -> [f64; 2] {
        [(self.right - self.left) as f64, (self.bottom - self.top) as f64]
    }

    fn middle(&self) -> [f64; 2] {
        [(self.left + self.right) as f64 / 2.0, (self.top + self.bottom) as f64 / 2.0]
    }
}

/// Finds the card. Returns the rectangles of its steps in pixels, brightest first.
///
/// # Errors
/// No card, or several.
pub fn find(radiance: &Radiance, reflectance: [f64; 3]) -> Result<[[f64; 4]; 3], MeasureError> {
    let factor = radiance.width.div_ceil(ACROSS).max(1);
    let regions = regions(radiance, factor);
    let mut bright = reflectance;
    bright.sort_by(|a, b| b.total_cmp(a));
    let falls = [(bright[0] / bright[1]).ln(), (bright[1] / bright[2]).ln()];
    let near = |found: f64, expected: f64| (found - expected).abs() < 0.3 * expected.max(0.5);
    let follows = |a: &Region, b: &Region, fall: f64| -> Option<usize> {
        let ([aw, ah], [bw, bh]) = (a.size(), b.size());
        let (aside, below) = (b.middle()[0] - a.middle()[0], b.middle()[1] - a.middle()[1]);
        let alike = (aw / bw - 1.0).abs() < 0.3 && (ah / bh - 1.0).abs() < 0.3;
        let level = below.abs() < 0.2 * ah && (0.9..1.5).contains(&(aside.abs() / aw.max(bw)));
        let upright = aside.abs() < 0.2 * aw && (0.9..1.5).contains(&(below.abs() / ah.max(bh)));
        (alike && near(a.ln - b.ln, fall)).then_some(())?;
        match (level, upright) {
            (true, false) => Some(0),
            (false, true) => Some(1),
            _ => None,
        }
    };
    let mut found: Vec<[[f64; 4]; 3]> = Vec::new();
    for a in &regions {
        for b in &regions {
            let Some(way) = follows(a, b, falls[0]) else { continue };
            for c in &regions {
                let same_side = (c.middle()[way] - b.middle()[way]).signum()
                    == (b.middle()[way] - a.middle()[way]).signum();
                if follows(b, c, falls[1]) == Some(way) && same_side {
                    let pixels = |at: usize| (at * factor) as f64;
                    found.push(
                        [a, b, c].map(|r| [pixels(r.left), pixels(r.top), pixels(r.right), pixels(r.bottom)]),
                    );
                }
            }
        }
    }
    match &found[..] {
        [one] => Ok(*one),
        [] => Err(MeasureError::Scene(
            "no grey card is in the picture: three even steps of 90, 18 and 3.6 % side by side were looked for; put the card \
             level beside the sample, or give card.rectangle_px in the setup file"
                .into(),
        )),
        several => {
            let places: Vec<String> =
                several.iter().map(|steps| format!("{:.0}, {:.0}", steps[0][0], steps[0][1])).collect();
            Err(MeasureError::Scene(format!(
                "{} grey cards are in the picture, at {}; take all but one away, or give card.rectangle_px in the setup file",
                several.len(),
                places.join(" and ")
            )))
        }
    }
}

/// Even regions that fill a rectangle.
fn regions(radiance: &Radiance, factor: usize) -> Vec<Region> {
    let (width, height) = (radiance.width / factor, radiance.height / factor);
    let ln: Vec<f32> = (0..width * height)
        .map(|i| {
            let (mut sum, mut variance) = (0.0f32, 0.0f32);
            for y in 0..factor {
                for x in 0..factor {
                    let pixel = (i / width * factor + y) * radiance.width + i % width * factor + x;
                    for c in 3 * pixel..3 * pixel + 3 {
                        sum += radiance.value[c];
                        variance += radiance.variance[c];
                    }
                }
            }
            if sum > 10.0 * variance.sqrt() { sum.ln() } else { f32::NAN }
        })
        .collect();
    let near = |i: usize| {
        let x = i % width;
        let near = [
            (x > 0).then(|| i - 1),
            (x + 1 < width).then_some(i + 1),
            i.checked_sub(width),
            Some(i + width).filter(|&i| i < ln.len()),
        ];
        near.into_iter().flatten()
    };
    let edge = |i: usize| near(i).any(|next| (ln[next] - ln[i]).abs() > EDGE);
    let mut seen = vec![false; ln.len()];
    let mut regions = Vec::new();
    let mut open = Vec::new();
    for start in 0..ln.len() {
        if seen[start] || ln[start].is_nan() || edge(start) {
            continue;
        }
        let (mut count, mut sum) = (0usize, 0.0f64);
        let mut region = Region { left: width, top: height, right: 0, bottom: 0, ln: 0.0 };
        seen[start] = true;
        open.push(start);
        while let Some(i) = open.pop() {
            let (x, y) = (i % width, i / width);
            count += 1;
            sum += f64::from(ln[i]);
            region.left = region.left.min(x);
            region.right = region.right.max(x + 1);
            region.top = region.top.min(y);
            region.bottom = region.bottom.max(y + 1);
            if edge(i) {
                continue;
            }
            for next in near(i) {
                if !seen[next] && (ln[next] - ln[i]).abs() < EVEN {
                    seen[next] = true;
                    open.push(next);
                }
            }
        }
        let [w, h] = region.size();
        region.ln = sum / count as f64;
        if w.min(h) >= SMALLEST && count as f64 > 0.8 * w * h {
            regions.push(region);
        }
    }
    regions
}

/// A rectangle of three steps as its steps, brightest first.
pub fn steps_of(rectangle: [f64; 4], radiance: &Radiance) -> [[f64; 4]; 3] {
    let [left, top, right, bottom] = rectangle;
    let level = right - left >= bottom - top;
    let mut steps: [Rectangle; 3] = std::array::from_fn(|i| {
        let part = |from: f64, to: f64, i: usize| from + (to - from) * i as f64 / 3.0;
        if level {
            [part(left, right, i), top, part(left, right, i + 1), bottom]
        } else {
            [left, part(top, bottom, i), right, part(top, bottom, i + 1)]
        }
    });
    let brightness = |step: &Rectangle| {
        let mut values: Vec<f64> =
            inside(radiance, *step).map(|(_, _, i)| f64::from(radiance.value[3 * i + 1])).collect();
        crate::linalg::median(&mut values)
    };
    if brightness(&steps[0]) < brightness(&steps[2]) {
        steps.reverse();
    }
    steps
}

/// Pixels well inside a step: x, y and number.
pub(crate) fn inside(
    radiance: &Radiance,
    [left, top, right, bottom]: Rectangle,
) -> impl Iterator<Item = (usize, usize, usize)> {
    let (dx, dy) = (MARGIN * (right - left), MARGIN * (bottom - top));
    let whole = |from: f64, to: f64, most: usize| {
        (from.ceil().max(0.0) as usize)..(to.floor().max(0.0) as usize).min(most)
    };
    let (columns, width) = (whole(left + dx, right - dx, radiance.width), radiance.width);
    whole(top + dy, bottom - dy, radiance.height)
        .flat_map(move |y| columns.clone().map(move |x| (x, y, y * width + x)))
}

/// Measures the steps under a light of the scene.
///
/// # Errors
/// Steps that are too small, full in every exposure, or not the card's.
pub fn calibrate(
    radiance: &Radiance,
    steps: [[f64; 4]; 3],
    card: &setup::Card,
    scene: &Scene,
    light: usize,
) -> Result<Calibration, MeasureError> {
    let mut reflectance = card.reflectance;
    reflectance.sort_by(|a, b| b.total_cmp(a));
    // Radiance over irradiance of each step and channel, and its relative standard error.
    let mut levels = [[0.0; 3]; 3];
    let mut error = 0.0f64;
    for (s, step) in steps.iter().enumerate() {
        let percent = 100.0 * reflectance[s];
        let pixels: Vec<(usize, f64)> = inside(radiance, *step)
            .map(|(x, y, i)| (i, scene.card_irradiance(x as f64 + 0.5, y as f64 + 0.5, light)))
            .filter(|(i, irradiance)| *irradiance > 0.0 && !radiance.value[3 * i].is_nan())
            .collect();
        if pixels.len() < 12 {
            return Err(MeasureError::Scene(format!(
                "the card's {percent:.1} % step has {} usable pixels; bring the card nearer to the camera and into the lamp's light, \
                 or check card.rectangle_px",
                pixels.len()
            )));
        }
        if pixels.iter().filter(|(i, _)| radiance.bound[*i] != 0).count() * 50 > pixels.len() {
            return Err(MeasureError::Scene(format!(
                "the card's {percent:.1} % step is clipped in every photograph; add shorter exposures"
            )));
        }
        for c in 0..3 {
            let values: Vec<f64> = pixels
                .iter()
                .map(|(i, irradiance)| f64::from(radiance.value[3 * i + c]) / irradiance)
                .collect();
            let (middle, width) = spread(&values);
            let near: Vec<f64> = values.into_iter().filter(|v| (v - middle).abs() <= 3.0 * width).collect();
            levels[s][c] = near.iter().sum::<f64>() / near.len().max(1) as f64;
            if s == 1 {
                error = error.max(width / middle.abs().max(1e-30) / (near.len() as f64).sqrt());
            }
        }
    }
    let scale: [f64; 3] = std::array::from_fn(|c| reflectance[1] / PI / levels[1][c]);
    let deviation =
        [0, 2].map(|s| std::array::from_fn(|c| levels[s][c] * scale[c] * PI / reflectance[s] - 1.0));
    let worst = deviation
        .iter()
        .flatten()
        .fold(0.0f64, |most, d: &f64| if d.is_finite() { most.max(d.abs()) } else { f64::MAX });
    if scale.iter().any(|k| !k.is_finite() || *k <= 0.0) || worst > NO_CARD {
        return Err(MeasureError::Scene(format!(
            "the steps at {:.0}, {:.0} are not those of a card of {} %: they are off by {:.0} %; check card.rectangle_px and \
             card.reflectance, and that no light but the lamp's falls on the card",
            steps[0][0],
            steps[0][1],
            reflectance.map(|r| format!("{}", (1000.0 * r).round() / 10.0)).join(", "),
            100.0 * worst.min(99.0)
        )));
    }
    Ok(Calibration { steps, scale, error, deviation, darkest: reflectance[2] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::{Setup, tests::CAN};

    /// Cards drawn on a dim ground: left edge, top edge, whether reversed.
    fn scene(cards: &[(usize, usize, bool)], gain: [f32; 3]) -> Radiance {
        let (width, height) = (480, 360);
        let mut value = vec![0.01f32; 3 * width * height];
        for &(left, top, reversed) in cards {
            for y in top..top + 60 {
                for x in left..left + 90 {
                    let step = if reversed { 2 - (x - left) / 30 } else { (x - left) / 30 };
                    for c in 0..3 {
                        value[3 * (y * width + x) + c] = gain[c] * [0.9, 0.18, 0.036][step] / 3.0;
                    }
                }
            }
        }
        let none = vec![0; width * height];
        Radiance { width, height, variance: vec![1e-9; value.len()], bound: none.clone(), first: none, value }
    }

    #[test]
    fn a_card_is_found_either_way_round() {
        for reversed in [false, true] {
            let steps = find(&scene(&[(300, 100, reversed)], [1.0; 3]), [0.9, 0.18, 0.036]).unwrap();
            let left = if reversed { [360.0, 330.0, 300.0] } else { [300.0, 330.0, 360.0] };
            for (step, left) in steps.iter().zip(left) {
                assert_eq!(*step, [left, 100.0, left + 30.0, 160.0]);
            }
        }
    }

    /// Steps of 26 pixels beside a ground that is nearly as dark as the last, turned, with every pixel the mean over its area.
    #[test]
    fn a_card_that_is_not_quite_level_is_found() {
        for turn in 0..=20 {
            let (s, c) = (f64::from(turn) * 0.25).to_radians().sin_cos();
            let mut drawn = scene(&[], [1.0; 3]);
            for (i, rgb) in drawn.value.chunks_exact_mut(3).enumerate() {
                let (mut sum, parts) = (0.0, 8);
                for k in 0..parts * parts {
                    let part = |k: usize| (k as f64 + 0.5) / parts as f64;
                    let (x, y) = (
                        (i % 480) as f64 + part(k % parts) - 240.3,
                        (i / 480) as f64 + part(k / parts) - 180.6,
                    );
                    let (u, v) = ((c * x + s * y) / 26.0 + 1.5, (c * y - s * x) / 26.0 + 0.5);
                    let on = (0.0..3.0).contains(&u) && (0.0..1.0).contains(&v);
                    sum += if on { [0.9, 0.18, 0.036][u as usize] } else { 0.1 } / (parts * parts) as f64;
                }
                rgb.fill(sum as f32);
            }
            let steps = find(&drawn, [0.9, 0.18, 0.036]).unwrap_or_else(|error| panic!("{turn}: {error}"));
            assert!(
                (steps[1][0] - 227.0).abs() < 3.0 && (steps[1][3] - 194.0).abs() < 3.0,
                "{turn}: {steps:?}"
            );
        }
    }

    #[test]
    fn no_card_and_two_cards_are_named() {
        let error = |cards: &[_]| find(&scene(cards, [1.0; 3]), [0.9, 0.18, 0.036]).unwrap_err().to_string();
        assert!(error(&[]).contains("no grey card"), "{}", error(&[]));
        let two = error(&[(300, 100, false), (50, 200, false)]);
        assert!(two.contains("2 grey cards") && two.contains("50, 200"), "{two}");
    }

    #[test]
    fn the_middle_step_sets_each_channel_and_a_clipped_one_is_named() {
        let setup = Setup::parse(CAN).unwrap();
        let geometry = Scene::new(&setup, (480, 360), 14f64.to_radians()).unwrap();
        // The irradiance of the drawn card is even; that of the scene nearly so.
        let gain = [1.7, 1.0, 1.4];
        let mut drawn = scene(&[(300, 100, false)], gain);
        let steps = steps_of([300.0, 100.0, 390.0, 160.0], &drawn);
        let found = calibrate(&drawn, steps, &setup.card, &geometry, 0).unwrap();
        let irradiance = geometry.card_irradiance(345.0, 130.0, 0);
        for c in 0..3 {
            let expected = 0.18 / PI * irradiance / f64::from(gain[c] * 0.18 / 3.0);
            assert!((found.scale[c] / expected - 1.0).abs() < 2e-3, "{found:?}");
        }
        assert!(found.deviation.iter().flatten().all(|d| d.abs() < 0.03), "{found:?}");
        drawn.bound.fill(1);
        let error = calibrate(&drawn, steps, &setup.card, &geometry, 0).unwrap_err().to_string();
        assert!(error.contains("90.0 % step is clipped"), "{error}");
        let elsewhere = steps_of([0.0, 0.0, 90.0, 60.0], &drawn);
        drawn.bound.fill(0);
        let error = calibrate(&drawn, elsewhere, &setup.card, &geometry, 0).unwrap_err().to_string();
        assert!(error.contains("not those of a card"), "{error}");
    }
}
