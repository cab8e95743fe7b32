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

/// A clear coat: a dielectric film over a surface, with a lobe of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coat {
    /// The part of the surface that it covers, 0..=1.
    pub weight: f32,
    /// Its reflectance at normal incidence; glTF fixes 0.04, the index of 1.5.
    pub f0: f32,
    /// Microfacet width of its lobe.
    pub alpha: f32,
}

impl Coat {
    /// A coat of this roughness over a part of the surface; values outside 0 to 1 are clamped.
    pub(crate) fn new(weight: f32, roughness: f32, f0: f32) -> Coat {
        let roughness = roughness.clamp(0.0, 1.0);
        Coat { weight: weight.clamp(0.0, 1.0), f0: f0.clamp(0.0, 1.0), alpha: roughness * roughness }
    }
}

/// A surface under a clear coat: `f = (1 - w + w (1 - F)^2) f_base + w F lobe`, `F` the coat's reflectance at normal incidence.
///
/// Light that reaches the base passes the coat's border twice, and loses `F` each time. What it loses to the coat's colour and
/// by reflections between coat and base is left out, and so is the rise of `F` at grazing angles, as everywhere in curves of
/// the half angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coated {
    /// The surface below, dimmed by the coat.
    pub(crate) base: Surface,
    /// Reflectance of the coat's lobe at normal incidence.
    pub(crate) f0: f32,
    /// Microfacet width of the coat's lobe.
    pub(crate) alpha: f32,
}

impl From<Surface> for Coated {
    fn from(base: Surface) -> Coated {
        Coated { base, f0: 0.0, alpha: 1.0 }
    }
}

impl Surface {
    /// The surface under a coat.
    pub(crate) fn under(self, coat: Coat) -> Coated {
        let through = 1.0 - coat.weight + coat.weight * (1.0 - coat.f0) * (1.0 - coat.f0);
        let base = Surface {
            diffuse: self.diffuse.map(|v| v * through),
            f0: self.f0.map(|v| v * through),
            alpha: self.alpha,
        };
        Coated { base, f0: coat.weight * coat.f0, alpha: coat.alpha }
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
