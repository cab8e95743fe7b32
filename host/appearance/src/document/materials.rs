//! The materials of a document, pixel by pixel, never expanded to curves all at once.

use inks::Curve;

use crate::brdf::Space;

/// Anything that can say what each of its pixels reflects.
pub trait Materials: Sync {
    /// Pixels across.
    fn width(&self) -> usize;
    /// Pixels down.
    fn height(&self) -> usize;
    /// The tabulation its rows are in.
    fn space(&self) -> &Space;
    /// Writes the reflectance (1/sr) of pixel `y * width + x`; `out` has [`Space::columns`] places.
    fn reflectance(&self, pixel: usize, out: &mut [f32]);
}

/// One surface of the usual texture workflows: a diffuse albedo and one GGX lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Diffuse albedo, linear Rec. 709, 0..=1.
    pub diffuse: [f32; 3],
    /// Specular reflectance at normal incidence, linear, 0..=1.
    pub f0: [f32; 3],
    /// Microfacet width, roughness squared, clamped to what a curve can hold (0.02..=1).
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
