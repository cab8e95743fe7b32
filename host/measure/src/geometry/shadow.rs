//! What the dark side of a can says of the light: what falls there is not the lamp's, and where the dark begins tells the lamp's width.
//!
//! Problem: a white table, a room or glare in the lens brighten a stack, and a lamp wider than was said widens its highlight; neither shows in the
//! curve. Idea: a can has a side that a single lamp does not reach. Method: the light there, beyond the lamp's own width, is foreign.
//! Toward the lit side light grows as the mean of `max(0, cos)` over the lamp's disc; how much of it there is a little beyond the edge
//! of a point lamp's light gives the disc. Cost: a pass over the sample's outer pixels. Limits: cans whose dark side is in view;
//! light that only the lit side gets is not seen.

use serde::{Deserialize, Serialize};

use super::scene::Scene;
use crate::camera::merge::Radiance;
use crate::linalg::median;

/// Cosines of incidence that are dark under a small lamp, from 3 to 30 degrees beyond the edge, so that a
/// wider one leaves some of them dark.
const DARK: (f64, f64) = (-0.5, -0.05);
/// The part of these that counts, the darkest, which is dark under wider lamps too, so that their penumbra is
/// left out.
const DARKEST: f64 = 0.3;
/// Those just beyond the edge of a point lamp's light: a degree from it, for tape and pixels err by less.
const BEYOND: (f64, f64) = (-0.06, -0.02);
/// Those from which the slope of the lit side comes.
const LIT: (f64, f64) = (0.1, 0.25);
/// Cosines to the camera below this are too near the outline.
const OUTLINE: f64 = 0.12;
/// The blur in pixels from which the edge says nothing of the lamp.
const SHARP: f64 = 0.5;
/// Pixels that tell a level, so that noise of 6 % averages to 1 %.
const FEWEST: usize = 40;
/// The largest lamp that is looked for, as the sine of its half angle.
const WIDEST: f64 = 0.3;

/// What the dark side says.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Shadow {
    /// Radiance where the lamp does not reach, in the units of reflectance times irradiance.
    pub level: [f64; 3],
    /// The lamp's diameter in mm; 0 for one that the picture cannot tell from a point.
    pub lamp_mm: f64,
}

/// Looks at the dark side of a can; None where too little of it is in view.
pub(crate) fn look(scene: &Scene, radiance: &Radiance, scale: [f64; 3], light: usize) -> Option<Shadow> {
    let mut parts: [Vec<(f64, [f64; 3])>; 3] = Default::default();
    for y in 0..radiance.height {
        for x in 0..radiance.width {
            let i = y * radiance.width + x;
            let Some(view) = scene.view(x as f64 + 0.5, y as f64 + 0.5, light) else { continue };
            if view.cos_o < OUTLINE || radiance.value[3 * i].is_nan() || radiance.bound[i] != 0 {
                continue;
            }
            let value = std::array::from_fn(|c| scale[c] * f64::from(radiance.value[3 * i + c]));
            for (part, (from, to)) in parts.iter_mut().zip([DARK, BEYOND, LIT]) {
                if (from..to).contains(&view.cos_i) {
                    part.push((view.cos_i, value));
                }
            }
        }
    }
    let [mut dark, beyond, lit] = parts;
    dark.sort_by(|a, b| a.0.total_cmp(&b.0));
    dark.truncate((DARKEST * dark.len() as f64).ceil() as usize);
    if dark.len() < FEWEST {
        return None;
    }
    let middle =
        |part: &[(f64, [f64; 3])], c: usize| median(&mut part.iter().map(|p| p.1[c]).collect::<Vec<_>>());
    let level = std::array::from_fn(|c| middle(&dark, c).max(0.0));
    let mut lamp_mm = 0.0;
    // A lens that blurs carries light over the edge as well.
    if scene.blur() < SHARP && beyond.len() >= FEWEST && lit.len() >= FEWEST {
        let mut slopes: Vec<f64> = lit.iter().map(|(cos, value)| (value[1] - level[1]) / cos).collect();
        let seen = (middle(&beyond, 1) - level[1]) / median(&mut slopes).max(1e-30);
        let edge = median(&mut beyond.iter().map(|p| p.0).collect::<Vec<_>>());
        // The least disc that sends so much there.
        let step = |k: i32| WIDEST * f64::from(k) / 100.0;
        let sine = (1..=100).map(step).find(|sine| of_disc(edge, *sine) >= seen).unwrap_or(WIDEST);
        lamp_mm =
            if seen > of_disc(edge, -1.5 * edge) { 2.0 * sine * scene.lamp_distance(light) } else { 0.0 };
    }
    Some(Shadow { level, lamp_mm })
}

/// The mean of `max(0, cos)` over a disc whose half angle has this sine, where that of its middle is `cos`.
fn of_disc(cos: f64, sine: f64) -> f64 {
    // Chords of the disc, by the sine of where they are.
    let (mut sum, mut weight) = (0.0, 0.0);
    for k in 0..64 {
        let turn = ((f64::from(k) + 0.5) / 64.0 - 0.5) * std::f64::consts::PI;
        let chord = turn.cos().powi(2);
        sum += chord * (cos + sine * turn.sin()).max(0.0);
        weight += chord;
    }
    sum / weight
}
