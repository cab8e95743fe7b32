//! Specular gloss at 60 degrees, as a gloss meter reads it.
//!
//! Problem: owners have gloss meters, not gonioreflectometers, and want to compare their readings with curves.
//! Method: the light of each lobe that passes the window of the meter (4.4 degrees in the plane of incidence, 11.7 across
//! it, ISO 2813) for a beam at 60 degrees, relative to polished black glass of index 1.567, which reads 100. Each lobe is
//! evaluated as a full microfacet BRDF with Smith's shadowing; reflectance rises at 60 degrees by Fresnel's equations for a
//! dielectric surface and by Schlick's form for metal.
//! Cost: 4096 evaluations per lobe. Limits: the beam is assumed to be parallel, and the diffuse body is ignored. Because of
//! the long tails of GGX, a lobe reads lower than its visible sharpness suggests.

use std::f64::consts::FRAC_PI_3;

use crate::ggx;
use crate::lobes::{Lobe, Lobes};

/// Index of the glass that reads 100.
const GLASS: f64 = 1.567;
/// Half the window, in degrees: in the plane of incidence and across it.
const WINDOW: [f64; 2] = [2.2, 5.85];
const STEPS: usize = 64;
/// A lobe above this is metal; dielectrics up to index 1.8 reflect less.
const DIELECTRIC: f64 = 0.082;

/// Unpolarised reflectance of a dielectric of index `n` at the angle with cosine `cos`.
fn fresnel(n: f64, cos: f64) -> f64 {
    let inside = (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
    let s = (cos - n * inside) / (cos + n * inside);
    let p = (inside - n * cos) / (inside + n * cos);
    (s * s + p * p) / 2.0
}

fn reflectance(f0: f64, cos: f64) -> f64 {
    if f0 <= 0.0 {
        0.0
    } else if f0 <= DIELECTRIC {
        fresnel((1.0 + f0.sqrt()) / (1.0 - f0.sqrt()), cos)
    } else {
        f0 + (1.0 - f0) * (1.0 - cos).powi(5)
    }
}

/// Relative luminance of a linear Rec. 709 colour.
fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

fn lambda(cos: f64, alpha: f64) -> f64 {
    ((1.0 + alpha * alpha * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0
}

/// The ratio of light through the window to light in the beam, for one lobe.
fn through_window(lobe: &Lobe) -> f64 {
    let (sin_i, cos_i) = FRAC_PI_3.sin_cos();
    let half = WINDOW.map(f64::to_radians);
    // The position and width of a step. Steps are smallest in the centre, where narrow lobes are.
    let at = |i: usize, half: f64| {
        let u = (2 * i + 1) as f64 / STEPS as f64 - 1.0;
        (half * u * u.abs(), half * 2.0 * u.abs() * 2.0 / STEPS as f64)
    };
    let mut sum = 0.0;
    for row in 0..STEPS {
        for column in 0..STEPS {
            let ((along, height), (across, width)) = (at(row, half[0]), at(column, half[1]));
            // The direction through this point of a flat window perpendicular to the mirror direction.
            let (x, y) = (along.tan(), across.tan());
            let length = (1.0 + x * x + y * y).sqrt();
            let o = [(sin_i + cos_i * x) / length, y / length, (cos_i - sin_i * x) / length];
            let solid_angle = (1.0 + x * x) * (1.0 + y * y) / length.powi(3);
            let h = [o[0] - sin_i, o[1], o[2] + cos_i];
            let h_length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let (cos_h, cos_d) = (h[2] / h_length, (cos_i * h[2] - sin_i * h[0]) / h_length);
            let shadowing = 1.0 / (1.0 + lambda(cos_i, lobe.alpha) + lambda(o[2], lobe.alpha));
            let f0 = luminance(lobe.f0);
            // f cos_o, where f = F D G / (4 cos_i cos_o).
            let f = reflectance(f0, cos_d) * ggx::distribution(cos_h, lobe.alpha) * shadowing / (4.0 * cos_i);
            sum += f * solid_angle * height * width;
        }
    }
    sum
}

/// Gloss units at 60 degrees.
pub fn units(lobes: &Lobes) -> f64 {
    let glass = fresnel(GLASS, FRAC_PI_3.cos());
    lobes.lobes.iter().map(|lobe| 100.0 * through_window(lobe) / glass).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lobe(f0: f64, alpha: f64) -> Lobes {
        Lobes { kd: [0.0; 3], entering: 0.96, lobes: vec![Lobe { f0: [f0; 3], alpha }] }
    }

    #[test]
    fn polished_black_glass_reads_a_hundred() {
        let f0 = ((GLASS - 1.0) / (GLASS + 1.0)).powi(2);
        let reading = units(&lobe(f0, 0.002));
        assert!((reading - 100.0).abs() < 1.0, "{reading}");
    }

    /// Published with the model for F0 = 0.04 and for a metal of 0.85, in whole units. The model of the beam was not
    /// published, hence the tolerance of 3 %.
    #[test]
    fn the_published_readings() {
        for (alpha, clear, metal) in [
            (0.05, 31.0, 296.0),
            (0.10, 14.0, 133.0),
            (0.15, 8.0, 73.0),
            (0.20, 5.0, 44.0),
            (0.27, 3.0, 25.0),
            (0.38, 1.0, 12.0),
        ] {
            for (f0, published) in [(0.04, clear), (0.85, metal)] {
                let reading = units(&lobe(f0, alpha));
                assert!(
                    (reading - published).abs() < 0.6 + 0.03 * published,
                    "{f0} {alpha}: {reading} {published}"
                );
            }
        }
    }

    #[test]
    fn a_metal_lobe_brighter_or_narrower_reads_higher() {
        let mut last = f64::INFINITY;
        for alpha in [0.02, 0.05, 0.1, 0.2, 0.4, 0.8] {
            let reading = units(&lobe(0.9, alpha));
            assert!(reading < last && reading > units(&lobe(0.5, alpha)));
            last = reading;
        }
    }
}
