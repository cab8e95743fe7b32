//! The pixels of a stack: those of its region that are lit and seen, thinned to what a curve needs.

use rayon::prelude::*;

use super::extent::{BINS, Pixel, place};
use super::patches::Region;
use super::reduce::{HORIZON, MOST};
use crate::camera::merge::Radiance;
use crate::geometry::scene::Scene;

/// Pixels along the sample's border that are left out.
const BORDER: f64 = 2.5;
/// How far a blur carries light over the border, in its deviations: beyond three it would be 0.1 %.
const CARRIED: f64 = 3.0;

/// Pixels of a region, without the sample's border and what is near the horizon, thinned to what a curve needs.
pub fn pixels(
    radiance: &Radiance,
    scene: &Scene,
    scale: [f64; 3],
    light: usize,
    region: &Region,
) -> Vec<Pixel> {
    let [left, top, right, bottom] = match region {
        Region::All => [0.0, 0.0, radiance.width as f64, radiance.height as f64],
        Region::Pixels(rectangle) => *rectangle,
        Region::Sheet(part) => part.around,
    };
    let inside = |x: f64, y: f64| match region {
        Region::Sheet(part) => scene.unrolled(x, y).is_some_and(|place| part.holds(place)),
        _ => true,
    };
    let whole =
        |from: f64, to: f64, most: usize| (from.ceil().max(0.0) as usize)..(to.floor() as usize).min(most);
    let columns = whole(left, right, radiance.width);
    let lit = |x: f64, y: f64| scene.view(x, y, light).filter(|v| v.cos_i >= HORIZON && v.cos_o >= HORIZON);
    let border = BORDER + CARRIED * scene.blur();
    let row = |y: usize| -> Vec<(u32, u8)> {
        let mut found = Vec::new();
        for x in columns.clone() {
            let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
            let i = y * radiance.width + x;
            let Some(view) = lit(px, py).filter(|_| !radiance.value[3 * i].is_nan()) else { continue };
            let near = [(-border, 0.0), (border, 0.0), (0.0, -border), (0.0, border)];
            if near.iter().all(|(i, j)| lit(px + i, py + j).is_some()) && inside(px, py) {
                found.push((i as u32, (place(view.theta) as usize).min(BINS - 1) as u8));
            }
        }
        found
    };
    let rows: Vec<usize> = whole(top, bottom, radiance.height).collect();
    let all: Vec<(u32, u8)> = rows.into_par_iter().map(row).collect::<Vec<_>>().concat();
    let mut counts = [0usize; BINS];
    all.iter().for_each(|(_, bin)| counts[usize::from(*bin)] += 1);
    let mut passed = [0usize; BINS];
    let kept = all.into_iter().filter(|(_, bin)| {
        let bin = usize::from(*bin);
        passed[bin] += 1;
        // Twice as many as take part: corrections of the geometry move pixels between bins.
        passed[bin] % counts[bin].div_ceil(2 * MOST).max(1) == 0
    });
    kept.map(|(i, _)| {
        let i = i as usize;
        let value = |c: usize| f64::from(radiance.value[3 * i + c]);
        Pixel {
            x: (i % radiance.width) as f64 + 0.5,
            y: (i / radiance.width) as f64 + 0.5,
            light,
            value: std::array::from_fn(|c| scale[c] * value(c)),
            variance: std::array::from_fn(|c| {
                f64::from(radiance.variance[3 * i + c]) / value(c).powi(2).max(1e-30)
            }),
            bound: radiance.bound[i],
            first: radiance.first[i],
        }
    })
    .collect()
}
