//! Mean profiles across the sides of camera marks: what a lens, a scanner or its program made of edges that were sharp.
//!
//! Method: in the plane of each mark, lines across a side, from the frame into the bare paper; their mean has little noise. Cost: some thousand reads a
//! mark. Limits: sides are as sharp as other ink; marks of which a side lies outside of the picture are left out.

use press::layout::camera::CELLS;

use super::grey::Grey;
use super::marks::Mark;

/// How far profiles reach on both sides, in cells: into the frame and into the bare paper.
pub(crate) const REACH: f64 = 0.6;
/// Steps of a profile on either side.
pub(crate) const STEPS: i32 = 24;
/// Profiles across each side.
const PROFILES: i32 = 80;
/// Steps at either end that tell how dark and how bright it is.
const ENDS: usize = 4;

/// For each side of a mark that can be told: whether it runs across (0: upright, 1: level), and its profile, 0 in the frame and 1 on the paper.
pub(crate) fn profiles(picture: &Grey, mark: &Mark) -> Vec<(usize, Vec<f64>)> {
    let side = CELLS as f64;
    let Some(plane) = mark.plane() else { return Vec::new() };
    let sides = [(0, 0.0, -1.0), (0, side, 1.0), (1, 0.0, -1.0), (1, side, 1.0)];
    let profile = |(axis, edge, out): (usize, f64, f64)| {
        let mut sums = vec![0.0; 2 * STEPS as usize + 1];
        for k in 0..PROFILES {
            let along = side * (0.1 + 0.8 * (f64::from(k) + 0.5) / f64::from(PROFILES));
            for (sum, step) in sums.iter_mut().zip(-STEPS..=STEPS) {
                let across = edge + out * REACH * f64::from(step) / f64::from(STEPS);
                *sum += picture.at(plane.at(if axis == 0 { [across, along] } else { [along, across] }))?;
            }
        }
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (dark, bright) = (mean(&sums[..ENDS]), mean(&sums[sums.len() - ENDS..]));
        let told = bright - dark > 0.2 * bright.abs();
        told.then(|| (axis, sums.iter().map(|v| (v - dark) / (bright - dark)).collect()))
    };
    sides.into_iter().filter_map(profile).collect()
}
