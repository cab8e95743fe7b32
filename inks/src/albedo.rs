//! Directional albedo: the share of light from one direction that a half-angle curve reflects.
//!
//! Problem: a library must not contain a surface that creates light. For incidence theta_i the albedo is the
//! integral of f(theta_h) cos theta_o over outgoing directions.
//! Method: integrate over half vectors instead, `d omega_o = 4 (i.h) d omega_h`. Then f depends on one variable only, and
//! the azimuth integral is a weight that is computed once per incidence. The square-root grid theta_h = (pi/2) u^2 resolves
//! peaks at theta_h = 0.
//! Cost: `RINGS x AZIMUTHS` once, then one product with `RINGS` samples per curve.
//! Limits: exact only for BRDFs that depend on theta_h alone, as curves do.

use maths::Maths;
use std::f64::consts::{FRAC_PI_2, PI};

use crate::Curve;

const RINGS: usize = 512;
const AZIMUTHS: usize = 128;

/// The quadrature for one incidence.
#[derive(Clone, Debug)]
pub struct Albedo {
    theta: Vec<f64>,
    weight: Vec<f64>,
}

impl Albedo {
    /// The quadrature for light that arrives `incidence` radians from the normal, 0..pi/2.
    pub fn new(incidence: f64) -> Albedo {
        let (sin_i, cos_i) = incidence.sine_cosine();
        let (mut theta, mut weight) = (Vec::with_capacity(RINGS), Vec::with_capacity(RINGS));
        for ring in 0..RINGS {
            let u = (ring as f64 + 0.5) / RINGS as f64;
            let t = FRAC_PI_2 * u * u;
            let (sin_h, cos_h) = t.sine_cosine();
            let mut around = 0.0;
            for azimuth in 0..AZIMUTHS {
                let phi = PI * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
                let facing = sin_i * sin_h * phi.cosine() + cos_i * cos_h;
                let cos_o = 2.0 * facing * cos_h - cos_i;
                if facing > 0.0 && cos_o > 0.0 {
                    around += 4.0 * facing * cos_o;
                }
            }
            // The two halves of the azimuth are mirror images, hence 2 pi over AZIMUTHS.
            let dtheta = FRAC_PI_2 * 2.0 * u / RINGS as f64;
            theta.push(t);
            weight.push(around * 2.0 * PI / AZIMUTHS as f64 * sin_h * dtheta);
        }
        Albedo { theta, weight }
    }

    /// The albedo of a curve, channel by channel.
    pub fn of_curve(&self, curve: &Curve) -> [f64; 3] {
        self.sum(|t| curve.at(t))
    }

    /// The albedo of any function of the half angle (radians to 1/sr).
    pub fn sum(&self, f: impl Fn(f64) -> [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (&t, &w) in self.theta.iter().zip(&self.weight) {
            for (sum, f) in sum.iter_mut().zip(f(t)) {
                *sum += w * f;
            }
        }
        sum
    }
}

/// The incidences at which a library is checked, in degrees.
pub const INCIDENCES: [f64; 4] = [0.0, 30.0, 60.0, 75.0];

/// The quadratures of [`INCIDENCES`].
pub fn standard() -> [Albedo; 4] {
    INCIDENCES.map(|degrees| Albedo::new(degrees.to_radians()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ggx;

    #[test]
    fn a_white_lambertian_reflects_everything() {
        for albedo in standard() {
            let sum = albedo.sum(|_| [1.0 / PI; 3]);
            assert!((sum[1] - 1.0).abs() < 2e-4, "{sum:?}");
        }
    }

    /// An independent method: outgoing directions on a polar grid around the mirror direction.
    #[test]
    fn lobes_agree_with_an_integral_over_outgoing_directions() {
        for alpha in [0.12, 0.28] {
            for degrees in [0.0, 30.0, 60.0] {
                let f = |t: f64| ggx::lobe(t, alpha);
                let incidence = f64::to_radians(degrees);
                let (sin_i, cos_i) = incidence.sin_cos();
                let (rings, azimuths) = (1500, 720);
                let mut direct = 0.0;
                for ring in 0..rings {
                    // Polar angle about the mirror direction, dense near it.
                    let u = (ring as f64 + 0.5) / f64::from(rings);
                    let (sin_p, cos_p) = (PI * u * u).sin_cos();
                    let dp = PI * 2.0 * u / f64::from(rings);
                    for azimuth in 0..azimuths {
                        let phi = 2.0 * PI * (azimuth as f64 + 0.5) / f64::from(azimuths);
                        // Frame about the mirror direction (-sin_i, 0, cos_i).
                        let x = cos_i * sin_p * phi.cos() - sin_i * cos_p;
                        let y = sin_p * phi.sin();
                        let z = sin_i * sin_p * phi.cos() + cos_i * cos_p;
                        if z <= 0.0 {
                            continue;
                        }
                        let h = [sin_i + x, y, cos_i + z];
                        let length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
                        let theta = (h[2] / length).clamp(-1.0, 1.0).acos();
                        direct += f(theta) * z * sin_p * dp * 2.0 * PI / f64::from(azimuths);
                    }
                }
                let sum = Albedo::new(incidence).sum(|t| [f(t); 3])[0];
                assert!((sum / direct - 1.0).abs() < 2e-3, "alpha {alpha}, {degrees}: {sum} {direct}");
            }
        }
    }
}
