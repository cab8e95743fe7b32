//! A reflectance as a diffuse albedo and a few GGX lobes, the form in which the ink model computes.

use std::f64::consts::PI;

use serde::Serialize;

use crate::Curve;
use crate::ggx;

/// One GGX lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lobe {
    /// Reflectance at normal incidence, linear RGB, 0..=1.
    pub f0: [f64; 3],
    /// Microfacet width, 0 < alpha <= 1.
    pub alpha: f64,
}

/// A diffuse albedo and GGX lobes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lobes {
    /// Diffuse albedo, linear RGB, 0..=1.
    pub kd: [f64; 3],
    /// Share of the light that passes the surface and reaches the diffuse body, 0..=1.
    pub entering: f64,
    /// The lobes, from the deepest layer to the surface.
    pub lobes: Vec<Lobe>,
}

impl Lobes {
    /// Reflectance in 1/sr at half angle `theta` (radians):
    /// `entering kd / pi + sum of F0 D G / (4 cos^2 theta)`, light and eye in one place.
    pub fn at(&self, theta: f64) -> [f64; 3] {
        let mut f = self.kd.map(|kd| self.entering * kd / PI);
        for lobe in &self.lobes {
            let shape = ggx::lobe(theta, lobe.alpha);
            for (f, f0) in f.iter_mut().zip(lobe.f0) {
                *f += f0 * shape;
            }
        }
        f
    }

    /// The curve at the given angles (radians, ascending).
    pub fn curve(&self, theta: &[f64]) -> Curve {
        Curve::sampled(theta, |t| self.at(t))
    }
}
