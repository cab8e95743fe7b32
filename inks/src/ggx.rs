//! The GGX lobe along the half angle, in the co-located convention (light and eye in one place).
//!
//! Method: Trowbridge-Reitz distribution with Smith's height-uncorrelated shadowing; with
//! theta_i = theta_o = theta_h = t the lobe is `F0 D(t) G(t) / (4 cos^2 t)`, in 1/sr.
//! Cost: a handful of operations. Limits: isotropic; alpha is the microfacet width (roughness squared).

use maths::Maths;

/// Distribution of microfacet normals, `D(t) = a^2 / (pi (cos^2 t (a^2 - 1) + 1)^2)`, in 1/sr.
pub fn distribution(cos_t: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    let d = cos_t * cos_t * (a2 - 1.0) + 1.0;
    a2 / (core::f64::consts::PI * d * d)
}

/// Smith shadowing for both directions at `t`: `G = 1 / (1 + 2 L)`, `L = (sqrt(1 + a^2 tan^2 t) - 1) / 2`.
pub fn shadowing(cos_t: f64, alpha: f64) -> f64 {
    let c2 = (cos_t * cos_t).max(1e-12);
    let tan2 = (1.0 - c2).max(0.0) / c2;
    1.0 / (1.0 + alpha * alpha * tan2).sqrt()
}

/// The lobe for unit F0, `D G / (4 cos^2 t)`, in 1/sr; multiply by F0. `t` in radians, finite at pi/2.
pub fn lobe(t: f64, alpha: f64) -> f64 {
    let c = t.cosine().max(1e-6);
    distribution(c, alpha) * shadowing(c, alpha) / (4.0 * c * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The distribution's projected area over the hemisphere is one: integral of D cos over solid angle.
    #[test]
    fn the_distribution_covers_the_unit_disc_once() {
        for alpha in [0.05, 0.2, 0.5, 1.0] {
            let n = 200_000;
            let h = core::f64::consts::FRAC_PI_2 / n as f64;
            let sum: f64 = (0..n)
                .map(|i| {
                    let t = (i as f64 + 0.5) * h;
                    distribution(t.cos(), alpha) * t.cos() * 2.0 * core::f64::consts::PI * t.sin() * h
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-6, "alpha {alpha}: {sum}");
        }
    }
}
