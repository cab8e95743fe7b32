//! A half-angle curve from a measurement over all directions.
//!
//! Problem: a measured isotropic BRDF depends on theta_h, theta_d and phi_d; documents use theta_h alone.
//! Method: at each theta_h, average the measured cells (both directions above the horizon) over theta_d and phi_d, weighted
//! by `cos_i cos_o sin(theta_d)`. theta_d runs from 2.5 to 57.5 degrees: closer to 0 the instrument blocks its own light and
//! files contain extrapolations; beyond are grazing pairs.
//! Limits: dependence on theta_d is lost (metals: factors up to two at the peak). Angles that no pair of directions
//! reaches are left out; the curve keeps its last value there.

use maths::Maths;
use std::f64::consts::{FRAC_PI_2, PI};

use inks::Curve;

/// The range of theta_d that is averaged, in degrees.
pub const THETA_D: (f64, f64) = (2.5, 57.5);

/// A direction, with z along the normal.
pub type Direction = [f64; 3];

/// The two directions of half-angle coordinates (radians) with phi_h = 0, by symmetry: `wi` is d rotated by theta_h about
/// the y axis, and `wo = 2 (wi . h) h - wi`.
fn directions(theta_h: f64, theta_d: f64, phi_d: f64) -> (Direction, Direction) {
    let (sh, ch) = theta_h.sine_cosine();
    let (sd, cd) = theta_d.sine_cosine();
    let (sp, cp) = phi_d.sine_cosine();
    let d = [sd * cp, sd * sp, cd];
    let wi = [ch * d[0] + sh * d[2], d[1], ch * d[2] - sh * d[0]];
    let h = [sh, 0.0, ch];
    // The angle between wi and h is theta_d.
    let wo = std::array::from_fn(|k| 2.0 * cd * h[k] - wi[k]);
    (wi, wo)
}

/// The mean over theta_d and phi_d at each angle of `theta_h` (radians, ascending), on a grid of cell centres:
/// `theta_d_cells` over 0 to 90 degrees and `phi_d_cells` over 0 to 180. `value` receives the indices of theta_h, theta_d
/// and phi_d and the two directions, and returns the reflectance in 1/sr, or `None` where nothing was measured. Returns
/// `None` if no cell was measured.
pub fn curve(
    theta_h: &[f64],
    theta_d_cells: usize,
    phi_d_cells: usize,
    mut value: impl FnMut([usize; 3], Direction, Direction) -> Option<[f64; 3]>,
) -> Option<Curve> {
    let (mut angles, mut values) = (Vec::new(), Vec::new());
    for (h, &th) in theta_h.iter().enumerate() {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for d in 0..theta_d_cells {
            let td = (d as f64 + 0.5) / theta_d_cells as f64 * FRAC_PI_2;
            if td < THETA_D.0.to_radians() || td > THETA_D.1.to_radians() {
                continue;
            }
            for p in 0..phi_d_cells {
                let (wi, wo) = directions(th, td, (p as f64 + 0.5) / phi_d_cells as f64 * PI);
                let weight = wi[2] * wo[2] * td.sine();
                if wi[2] <= 0.0 || wo[2] <= 0.0 {
                    continue;
                }
                if let Some(f) = value([h, d, p], wi, wo) {
                    (0..3).for_each(|c| sum[c] += weight * f[c]);
                    weights += weight;
                }
            }
        }
        if weights > 0.0 {
            angles.push(th);
            values.push(sum.map(|s| (s / weights).max(0.0)));
        }
    }
    Curve::new(angles, values).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn directions_have_the_half_angles_they_were_made_from(
            th in 0.01f64..1.5, td in 0.01f64..1.5, pd in 0.01f64..3.1,
        ) {
            let (wi, wo) = directions(th, td, pd);
            let dot = |a: Direction, b: Direction| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
            prop_assert!((dot(wi, wi) - 1.0).abs() < 1e-12 && (dot(wo, wo) - 1.0).abs() < 1e-12);
            let sum: Direction = std::array::from_fn(|k| wi[k] + wo[k]);
            let length = dot(sum, sum).sqrt();
            prop_assert!(((sum[2] / length).acos() - th).abs() < 1e-7);
            // Half the angle between the directions is theta_d.
            prop_assert!((dot(wi, wo).clamp(-1.0, 1.0).acos() / 2.0 - td).abs() < 1e-7);
        }
    }

    #[test]
    fn what_depends_on_the_half_angle_alone_is_kept() {
        let theta: Vec<f64> = (0..40).map(|i| f64::from(i) / 40.0 * 1.4).collect();
        let f = |t: f64| [(-3.0 * t).exp(), 0.2, t * t];
        let found = curve(&theta, 90, 90, |[h, ..], _, _| Some(f(theta[h]))).unwrap();
        for (&t, v) in found.theta().iter().zip(found.rgb()) {
            (0..3).for_each(|c| assert!((v[c] - f(t)[c]).abs() < 1e-12));
        }
    }
}
