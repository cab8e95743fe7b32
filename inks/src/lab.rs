//! CIELAB under D50 to linear Rec. 709.
//!
//! Printed solids are specified in CIELAB under D50 (as in ISO 12647-2); the pipeline computes in linear
//! Rec. 709 under D65. Method: CIE 15 inverse, Bradford adaptation, the Rec. 709 matrix. Limits: the result is
//! not clipped, and inks such as cyan lie outside the gamut, so a channel may be negative. The inverse undoes it to the last digits.

use maths::Maths;

/// White points as XYZ with Y = 1.
const D50: [f64; 3] = [0.96422, 1.0, 0.82521];
const D65: [f64; 3] = [0.95047, 1.0, 1.08883];

/// Sharpened cone responses of the Bradford transform.
const BRADFORD: [[f64; 3]; 3] =
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
const BRADFORD_BACK: [[f64; 3]; 3] = [
    [0.986_992_9, -0.147_054_3, 0.159_962_7],
    [0.432_305_3, 0.518_360_3, 0.049_291_2],
    [-0.008_528_7, 0.040_042_8, 0.968_486_7],
];

/// XYZ under D65 to linear Rec. 709.
const REC709: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| (0..3).map(|column| m[row][column] * v[column]).sum())
}

/// Linear Rec. 709 of a CIELAB colour under D50; L* 0..=100, a* and b* about -128..=128. Not clipped.
pub fn to_linear_rgb([l, a, b]: [f64; 3]) -> [f64; 3] {
    let fy = (l + 16.0) / 116.0;
    let f = [fy + a / 500.0, fy, fy - b / 200.0];
    let delta = 6.0 / 29.0;
    let xyz: [f64; 3] = std::array::from_fn(|i| {
        let v = f[i];
        D50[i] * if v > delta { v * v * v } else { 3.0 * delta * delta * (v - 4.0 / 29.0) }
    });
    let (cone, from, to) = (times(&BRADFORD, xyz), times(&BRADFORD, D50), times(&BRADFORD, D65));
    let adapted = times(&BRADFORD_BACK, std::array::from_fn(|i| cone[i] * to[i] / from[i]));
    times(&REC709, adapted)
}

/// The inverse of a matrix that has one.
fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    std::array::from_fn(|j| std::array::from_fn(|i| minor(i, j) / determinant))
}

/// CIELAB under D50 of a linear Rec. 709 colour: the inverse of [`to_linear_rgb`].
pub fn from_linear_rgb(rgb: [f64; 3]) -> [f64; 3] {
    let (from, to) = (times(&BRADFORD, D50), times(&BRADFORD, D65));
    let cone = times(&inverse(&BRADFORD_BACK), times(&inverse(&REC709), rgb));
    let xyz = times(&inverse(&BRADFORD), std::array::from_fn(|i| cone[i] * from[i] / to[i]));
    let delta: f64 = 6.0 / 29.0;
    let f: [f64; 3] = std::array::from_fn(|i| {
        let v = xyz[i] / D50[i];
        if v > delta.cubed() { v.cube_root() } else { v / (3.0 * delta * delta) + 4.0 / 29.0 }
    });
    [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_paper_white_is_white_and_greys_stay_grey() {
        for l in [5.0, 20.0, 50.0, 77.0, 100.0] {
            let rgb = to_linear_rgb([l, 0.0, 0.0]);
            let y = if l > 8.0 { ((l + 16.0) / 116.0f64).powi(3) } else { l * 27.0 / 24389.0 };
            for v in rgb {
                assert!((v - y).abs() < 2e-4, "L* {l}: {rgb:?}, luminance {y}");
            }
        }
    }

    #[test]
    fn the_two_bradford_matrices_are_inverse() {
        for i in 0..3 {
            let mut unit = [0.0; 3];
            unit[i] = 1.0;
            let back = times(&BRADFORD_BACK, times(&BRADFORD, unit));
            for (j, v) in back.into_iter().enumerate() {
                assert!((v - f64::from(u8::from(i == j))).abs() < 1e-6, "{back:?}");
            }
        }
    }

    proptest! {
        /// Dark channels keep all their digits: the fit of filters depends on it.
        #[test]
        fn colours_come_back(rgb in prop::array::uniform3(-12.0f64..0.0)) {
            let rgb = rgb.map(f64::exp);
            let back = to_linear_rgb(from_linear_rgb(rgb));
            prop_assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12), "{rgb:?} {back:?}");
        }
    }

    /// Offset solids on coated paper and their linear values, as published with the model.
    #[test]
    fn the_anchors_of_the_process_inks() {
        for (lab, expected) in [
            ([94.0, 0.0, -2.0], [0.842, 0.8535, 0.884]),
            ([55.0, -37.0, -50.0], [-0.159, 0.310, 0.701]),
            ([48.0, 74.0, -3.0], [0.690, 0.004, 0.196]),
            ([89.0, -5.0, 93.0], [0.934, 0.747, -0.021]),
            ([16.0, 0.0, 0.0], [0.021, 0.021, 0.021]),
        ] {
            let rgb = to_linear_rgb(lab);
            for c in 0..3 {
                assert!((rgb[c] - expected[c]).abs() < 6e-4, "{lab:?}: {rgb:?} not {expected:?}");
            }
        }
    }
}
