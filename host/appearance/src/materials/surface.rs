//! The surface of the usual texture workflows, and how their maps define it.

use inks::Curve;

/// A diffuse albedo and one GGX lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Diffuse albedo, linear Rec. 709, 0..=1.
    pub diffuse: [f32; 3],
    /// Specular reflectance at normal incidence, linear, 0..=1.
    pub f0: [f32; 3],
    /// Microfacet width (roughness squared), clamped to what a curve can hold (0.02..=1).
    pub alpha: f32,
}

impl Surface {
    /// The curve of the surface, `diffuse / pi + f0 D G / (4 cos^2)`, at the given half angles (radians).
    pub fn curve(&self, theta: &[f64]) -> Curve {
        Curve::sampled(theta, |t| {
            let lobe = inks::ggx::lobe(t, f64::from(self.alpha));
            std::array::from_fn(|c| {
                f64::from(self.diffuse[c]) / std::f64::consts::PI + f64::from(self.f0[c]) * lobe
            })
        })
    }
}

/// The surface of the metallic workflow: `f0 = mix(dielectric, base, metallic)`, `diffuse = base (1 - metallic)
/// (1 - dielectric)`, `alpha = roughness^2`; all linear, 0 to 1.
pub(crate) fn metallic(base: [f32; 3], dielectric: [f32; 3], roughness: f32, metallic: f32) -> Surface {
    Surface {
        diffuse: std::array::from_fn(|c| base[c] * (1.0 - metallic) * (1.0 - dielectric[c])),
        f0: std::array::from_fn(|c| dielectric[c] + (base[c] - dielectric[c]) * metallic),
        alpha: roughness * roughness,
    }
}

/// The surface of the specular workflow: f0 as given, the diffuse part dimmed by the largest channel of f0 as in glTF's
/// extension, `alpha = (1 - glossiness)^2`.
pub(crate) fn specular(diffuse: [f32; 3], f0: [f32; 3], glossiness: f32) -> Surface {
    let left = 1.0 - f0.into_iter().fold(0.0, f32::max);
    Surface { diffuse: diffuse.map(|v| v * left), f0, alpha: (1.0 - glossiness) * (1.0 - glossiness) }
}

/// Reflectance at normal incidence of a dielectric with the given index of refraction.
pub(crate) fn dielectric(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_workflows_agree_on_the_same_metal() {
        let base = [0.9, 0.7, 0.3];
        let a = metallic(base, [0.04; 3], 0.3, 1.0);
        let b = specular([0.0; 3], base, 0.7);
        for c in 0..3 {
            assert!((a.f0[c] - b.f0[c]).abs() < 1e-6 && a.diffuse[c].abs() < 1e-6 && b.diffuse[c] == 0.0);
        }
        assert!((a.alpha - b.alpha).abs() < 1e-6 && (a.alpha - 0.09).abs() < 1e-6);
        assert!((dielectric(1.5) - 0.04).abs() < 1e-6);
    }

    #[test]
    fn a_surface_reflects_no_more_than_it_receives() {
        // White furnace at normal incidence, GGX at its widest: diffuse + f0 stays within one.
        for base in [[1.0; 3], [0.2, 0.9, 0.5]] {
            for m in [0.0, 0.3, 1.0] {
                let s = metallic(base, [0.04; 3], 0.5, m);
                assert!((0..3).all(|c| s.diffuse[c] + s.f0[c] <= 1.0 + 1e-6), "{s:?}");
            }
        }
    }
}
