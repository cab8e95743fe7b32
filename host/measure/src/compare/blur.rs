//! How far a photograph carries light across the sheet, from the sides of its camera marks.
//!
//! Problem: a lens, a sensor's pixels and reading between them carry light from dot to dot; where a dark stack lies beside a bright one this looks like a
//! dark stack that is brighter than the library says. Method: the mean profile across all sides of all marks, in mm of the sheet;
//! its second moment is the variance of whatever blurred it, of which nothing else need be known. Cost: some thousand
//! reads. Limits: one blur for the whole picture; sides of marks are as sharp as other ink; a blur beyond 0.3 mm reads as too little.

use press::layout::camera::CELLS;

use crate::geometry::grey::Grey;
use crate::geometry::marks::Mark;
use crate::geometry::sheet_marks::PrintedMark;
use crate::geometry::sides::{self, REACH, STEPS};

/// Standard deviations of the blur across and down the sheet, in mm; 0 where the marks' sides do not tell.
pub(super) fn of_marks(picture: &Grey, marks: &[(Mark, PrintedMark)]) -> [f64; 2] {
    let mut variances: [Vec<f64>; 2] = Default::default();
    for (mark, printed) in marks {
        let cell = (printed.corners[1][0] - printed.corners[0][0]) / CELLS as f64;
        for (axis, profile) in sides::profiles(picture, mark) {
            variances[axis].push(variance(&profile) * cell * cell);
        }
    }
    variances.map(|mut all| crate::linalg::median(&mut all).max(0.0).sqrt())
}

/// The variance of the slope of a profile from 0 to 1, in squared cells.
fn variance(profile: &[f64]) -> f64 {
    let step = REACH / f64::from(STEPS);
    let (mut whole, mut first) = (0.0, 0.0);
    for (light, k) in profile.iter().zip(-STEPS..=STEPS) {
        let weight = if k.abs() == STEPS { 0.5 } else { 1.0 } * step;
        whole += weight * light;
        first += weight * light * f64::from(k) * step;
    }
    // By parts: of the slope, the mean is R - sum and the mean square R² - 2 sum of s.
    REACH * REACH - 2.0 * first - (REACH - whole).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square whose sides are lines of known variance: the sum of a normal blur, a pixel's own side and reading between pixels.
    #[test]
    fn the_blur_of_a_marks_sides_is_found() {
        let (size, left, right) = (240usize, 60.3f64, 156.3f64);
        for sigma in [0.0, 0.7, 1.5, 2.2] {
            let along: Vec<f64> = (0..size)
                .map(|i| {
                    let mut sum = [0.0; 2];
                    for k in 0..1200 {
                        let z = f64::from(k % 60) / 10.0 - 2.95;
                        let at = i as f64 + (f64::from(k / 60) + 0.5) / 20.0 + sigma * z;
                        let weight = (-0.5 * z * z).exp();
                        sum[0] += weight;
                        sum[1] += if at > left && at < right { weight } else { 0.0 };
                    }
                    sum[1] / sum[0]
                })
                .collect();
            let value = |i: usize| (0.8 - 0.7 * along[i % size] * along[i / size]) as f32;
            let picture = Grey { width: size, height: size, values: (0..size * size).map(value).collect() };
            let corners = [[left, left], [right, left], [right, right], [left, right]];
            let name = press::layout::camera::Name { corner: 0, byte: 0 };
            // Twelve pixels are a cell of 1.27 mm.
            let printed =
                PrintedMark { name, corners: [[0.0, 0.0], [10.16, 0.0], [10.16, -10.16], [0.0, -10.16]] };
            let found = of_marks(&picture, &[(Mark { name, corners }, printed)]);
            let truth = (sigma * sigma + 1.0 / 12.0 + 1.0 / 6.0).sqrt() * 1.27 / 12.0;
            for found in found {
                assert!((found / truth - 1.0).abs() < 0.06, "{sigma}: {found} {truth}");
            }
        }
    }
}
