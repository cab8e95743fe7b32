//! The usual formulas, sampled to half-angle curves.
//!
//! Problem: textures and tests speak of Lambert, Phong, Ward and GGX; the pipeline speaks of curves.
//! Method: each lobe in the co-located convention theta_i = theta_o = theta_h = t, in 1/sr:
//!
//! | lobe | f(t) | normalised so that |
//! |---|---|---|
//! | Lambert | `rho / pi` | the albedo is rho |
//! | Phong (in the half angle, after Blinn) | `rho (n + 2)(n + 4) / (8 pi (2^(-n/2) + n)) cos^n t` | the albedo for light along the normal is rho |
//! | Ward 1992 | `rho exp(-tan^2 t / a^2) / (4 pi a^2 cos t)` | its microfacet distribution covers the unit disc once |
//! | GGX | `F0 D G / (4 cos^2 t)`, see [`inks::ggx`] | the same |
//!
//! Cost: a few operations a sample. Limits: isotropic; no Fresnel rise, since light and eye are in one place. A lobe
//! narrower than alpha 0.02 (Phong: an exponent above 5000) falls between the samples of a 32-sample space.

use std::f64::consts::PI;

use inks::{Curve, ggx};

type Rgb = [f64; 3];

/// One term of a reflectance. Colours are linear Rec. 709.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// A perfect diffuser.
    Lambert {
        /// Albedo, 0..=1.
        albedo: Rgb,
    },
    /// A power of the cosine of the half angle.
    Phong {
        /// Albedo for light along the normal, 0..=1.
        albedo: Rgb,
        /// Exponent n, more than 0.
        exponent: f64,
    },
    /// A Gaussian of slopes.
    Ward {
        /// Strength rho, 0..=1.
        strength: Rgb,
        /// Root mean square slope, more than 0.
        alpha: f64,
    },
    /// Microfacets after Trowbridge and Reitz with Smith's shadowing.
    Ggx {
        /// Reflectance at normal incidence, 0..=1.
        f0: Rgb,
        /// Microfacet width, 0 < alpha <= 1.
        alpha: f64,
    },
}

impl Term {
    /// Reflectance in 1/sr at half angle `t`, in radians from 0 to pi/2.
    pub fn at(&self, t: f64) -> Rgb {
        let (colour, shape) = match *self {
            Term::Lambert { albedo } => (albedo, 1.0 / PI),
            Term::Phong { albedo, exponent: n } => {
                let norm = (n + 2.0) * (n + 4.0) / (8.0 * PI * ((-n / 2.0).exp2() + n));
                (albedo, norm * t.cos().max(0.0).powf(n))
            }
            Term::Ward { strength, alpha } => {
                // The Gaussian vanishes faster than the cosine long before this bound.
                let cos = t.cos().max(1e-6);
                let slope = t.sin() / cos / alpha;
                (strength, (-slope * slope).exp() / (4.0 * PI * alpha * alpha * cos))
            }
            Term::Ggx { f0, alpha } => (f0, ggx::lobe(t, alpha)),
        };
        colour.map(|v| v * shape)
    }
}

/// The sum of terms as a curve at the given angles (radians, ascending).
pub fn curve(terms: &[Term], theta: &[f64]) -> Curve {
    Curve::sampled(theta, |t| {
        let mut sum = [0.0; 3];
        for term in terms {
            for (sum, v) in sum.iter_mut().zip(term.at(t)) {
                *sum += v;
            }
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::albedo::Albedo;
    use std::f64::consts::FRAC_PI_2;

    /// Integral of `f(t)` over the hemisphere of half vectors, by the midpoint rule.
    fn over_half_vectors(f: impl Fn(f64) -> f64) -> f64 {
        let n = 200_000;
        let h = FRAC_PI_2 / f64::from(n);
        (0..n).map(|i| (f64::from(i) + 0.5) * h).map(|t| f(t) * 2.0 * PI * t.sin() * h).sum()
    }

    #[test]
    fn lambert_and_phong_have_the_albedo_they_are_given() {
        let head_on = Albedo::new(0.0);
        let albedo = [0.1, 0.5, 0.9];
        let mut terms = vec![Term::Lambert { albedo }];
        terms.extend([0.5, 2.0, 10.0, 80.0, 700.0].map(|exponent| Term::Phong { albedo, exponent }));
        for term in terms {
            let found = head_on.sum(|t| term.at(t));
            for c in 0..3 {
                assert!((found[c] / albedo[c] - 1.0).abs() < 1e-4, "{term:?}: {found:?}");
            }
        }
    }

    /// Behind f stand microfacets D with f = rho D cos^3 / 4 (Ward) and F0 D G / (4 cos^2) (GGX); the
    /// projected area of all microfacets is that of the surface: the integral of D cos is 1.
    #[test]
    fn microfacets_cover_the_surface_once() {
        for alpha in [0.05, 0.15, 0.4] {
            let ward = Term::Ward { strength: [0.3; 3], alpha };
            let area = over_half_vectors(|t| 4.0 * ward.at(t)[0] / (0.3 * t.cos().powi(3)) * t.cos());
            assert!((area - 1.0).abs() < 1e-6, "Ward {alpha}: {area}");
            let lobe = Term::Ggx { f0: [0.3; 3], alpha };
            let area = over_half_vectors(|t| {
                let g = ggx::shadowing(t.cos(), alpha);
                4.0 * lobe.at(t)[0] * t.cos().powi(2) / (0.3 * g) * t.cos()
            });
            assert!((area - 1.0).abs() < 1e-6, "GGX {alpha}: {area}");
        }
    }

    #[test]
    fn no_term_makes_light_at_any_incidence() {
        for quadrature in inks::albedo::standard() {
            for alpha in [0.02, 0.1, 0.3] {
                for term in [
                    Term::Ward { strength: [1.0; 3], alpha },
                    Term::Ggx { f0: [1.0; 3], alpha },
                    Term::Phong { albedo: [1.0; 3], exponent: 2.0 / (alpha * alpha) - 2.0 },
                ] {
                    let share = quadrature.sum(|t| term.at(t))[0];
                    assert!(share < 1.0 + 1e-4, "{term:?}: {share}");
                }
            }
        }
    }

    /// Near the peak all three are the same Gaussian of slopes when the exponent is 2 / alpha^2.
    #[test]
    fn narrow_lobes_agree_at_their_peak() {
        let alpha = 0.03;
        let peak = 0.5 / (4.0 * PI * alpha * alpha);
        for term in [
            Term::Ward { strength: [0.5; 3], alpha },
            Term::Ggx { f0: [0.5; 3], alpha },
            Term::Phong { albedo: [0.5; 3], exponent: 2.0 / (alpha * alpha) },
        ] {
            assert!((term.at(0.0)[0] / peak - 1.0).abs() < 5e-3, "{term:?}");
        }
    }

    #[test]
    fn terms_add_up() {
        let terms = [
            Term::Lambert { albedo: [0.2, 0.3, 0.4] },
            Term::Ggx { f0: [0.04; 3], alpha: 0.1 },
            Term::Ward { strength: [0.1; 3], alpha: 0.3 },
        ];
        let theta: Vec<f64> = (0..64).map(|i| f64::from(i) * FRAC_PI_2 / 64.0).collect();
        let curve = curve(&terms, &theta);
        for (&t, value) in theta.iter().zip(curve.rgb()) {
            for (c, v) in value.iter().enumerate() {
                let sum: f64 = terms.iter().map(|term| term.at(t)[c]).sum();
                assert!((v - sum).abs() < 1e-12);
            }
        }
    }
}
