//! The surface of the texture workflows that is nearest to a curve.
//!
//! Problem: edits and file formats speak of a body colour, a highlight and its width; a curve is numbers over the half angle.
//! Method: a body and one GGX lobe, `diffuse / pi + f0 lobe(alpha)`. For a given alpha both are linear: least squares,
//! channel by channel, on the metric linearised at the curve, neither below 0. Alpha is the same for all channels and found by
//! a scan of [`STEPS`] widths and a golden-section search between the neighbours of the best; both judge by the metric itself.
//! Cost: some 60 distances. A curve that has this form is found to 1e-6.
//! Limits: one lobe. Of two, it is the one that is seen most; [`Nearest::distance`] says what is missing.

use std::f64::consts::PI;

use crate::brdf::Space;

/// Reflectance of a dielectric at normal incidence, as the metallic workflow has it.
pub const DIELECTRIC: f64 = 0.04;

/// The widths of lobes that a document may have.
pub const ALPHA: std::ops::RangeInclusive<f64> = 0.02..=1.0;

/// Widths in the scan, in equal ratios.
const STEPS: usize = 24;
/// Steps of the search: each leaves 0.618 of the interval.
const NARROWED: usize = 36;

/// The nearest surface to a curve, in the metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Diffuse albedo, linear Rec. 709, 0 or more.
    pub diffuse: [f64; 3],
    /// Specular reflectance at normal incidence, linear, 0 or more.
    pub f0: [f64; 3],
    /// Microfacet width, within [`ALPHA`]; without meaning if f0 is 0.
    pub alpha: f64,
    /// Distance d between the curve and this surface (0.01: barely visible; 0.05: obvious).
    pub distance: f64,
}

/// The same surface in the metallic workflow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metallic {
    /// Base colour, linear, 0 or more; above 1 for what returns more light than it receives.
    pub base: [f64; 3],
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
}

/// The curve prepared for many widths.
struct Target<'a> {
    space: &'a Space,
    row: &'a [f64],
    /// Weight of each column in the linearised metric.
    weight: Vec<f64>,
}

impl Nearest {
    /// The nearest surface to a row (1/sr) of a half-angle space.
    pub fn to(space: &Space, row: &[f64]) -> Nearest {
        // The slope of cbrt(f c) is c^(1/3) f^(-2/3) / 3. Below a millionth of the peak it is that of the millionth.
        let floor = row.iter().copied().fold(0.0, f64::max) * 1e-6 + 1e-12;
        let columns = row.iter().zip(space.weight().iter().zip(space.radiance()));
        let weight =
            columns.map(|(&f, (w, c))| (w * c.cbrt()).powi(2) * f.max(floor).powf(-4.0 / 3.0)).collect();
        let target = Target { space, row, weight };
        let width = |step: f64| ALPHA.start() * (ALPHA.end() / ALPHA.start()).powf(step / (STEPS - 1) as f64);
        let tried = (0..STEPS).map(|step| target.fitted(width(step as f64)));
        let (best, found) = tried
            .enumerate()
            .min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
            .unwrap_or_else(|| (0, target.fitted(*ALPHA.end())));
        let golden = 0.618_033_988_749_895;
        let (mut low, mut high) = (best.saturating_sub(1) as f64, (best + 1).min(STEPS - 1) as f64);
        let at = |step: f64| target.fitted(width(step));
        let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
        let (mut at_left, mut at_right) = (at(left), at(right));
        for _ in 0..NARROWED {
            if at_left.distance <= at_right.distance {
                (high, right, at_right) = (right, left, at_left);
                left = high - golden * (high - low);
                at_left = at(left);
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + golden * (high - low);
                at_right = at(right);
            }
        }
        [at_left, at_right].into_iter().fold(found, |a, b| if b.distance < a.distance { b } else { a })
    }

    /// Base colour and metalness: those whose luminances of body and highlight are these, with what remains of the
    /// highlight beside a dielectric's own in the base colour.
    pub fn metallic(&self) -> Metallic {
        let [body, shine] = [self.diffuse, self.f0].map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]);
        // diffuse = base (1 - m) (1 - q) and f0 = q (1 - m) + base m are q m^2 + b m + (q - shine) = 0.
        let q = DIELECTRIC;
        let b = body / (1.0 - q) - 2.0 * q + shine;
        let metallic = if shine <= q {
            0.0
        } else {
            // The form without a difference of near numbers, whatever the sign of b.
            let root = (b * b + 4.0 * q * (shine - q)).sqrt();
            let m = if b >= 0.0 { 2.0 * (shine - q) / (b + root) } else { (root - b) / (2.0 * q) };
            m.clamp(0.0, 1.0)
        };
        let rest = |c: usize| (self.f0[c] - q * (1.0 - metallic)).max(0.0);
        Metallic { base: std::array::from_fn(|c| self.diffuse[c] / (1.0 - q) + rest(c)), metallic }
    }
}

impl Target<'_> {
    /// The best body and lobe of this width.
    fn fitted(&self, alpha: f64) -> Nearest {
        let lobes: Vec<f64> = self.space.angles().iter().map(|&t| inks::ggx::lobe(t, alpha)).collect();
        let (mut diffuse, mut f0) = ([0.0; 3], [0.0; 3]);
        for c in 0..3 {
            let (mut one, mut lobe, mut both, mut f_one, mut f_lobe) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (n, l) in lobes.iter().enumerate() {
                let (w, f) = (self.weight[3 * n + c], self.row[3 * n + c]);
                one += w;
                both += w * l;
                lobe += w * l * l;
                f_one += w * f;
                f_lobe += w * f * l;
            }
            let determinant = one * lobe - both * both;
            let body = (f_one * lobe - f_lobe * both) / determinant;
            let shine = (f_lobe * one - f_one * both) / determinant;
            (diffuse[c], f0[c]) = match (body >= 0.0, shine >= 0.0) {
                (true, true) => (PI * body, shine),
                (_, true) => (0.0, (f_lobe / lobe).max(0.0)),
                // Also where the lobe is as flat as the body, or the numbers are not.
                _ => (PI * (f_one / one).max(0.0), 0.0),
            };
        }
        let model: Vec<f64> = lobes
            .iter()
            .flat_map(|l| std::array::from_fn::<_, 3, _>(|c| diffuse[c] / PI + f0[c] * l))
            .collect();
        Nearest { diffuse, f0, alpha, distance: self.space.distance(self.row, &model) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::{self, Surface};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// A surface of the workflow comes back from its curve, and so do its base colour and metalness.
        #[test]
        fn surfaces_come_back_from_their_curves(
            base in prop::array::uniform3(0.02f32..0.98), roughness in 0.2f32..0.85, metallic in 0.0f32..=1.0,
        ) {
            let space = Space::half_angle(32);
            let surface = materials::metallic(base, [DIELECTRIC as f32; 3], roughness, metallic);
            let found = Nearest::to(&space, &space.row(&surface.curve(space.angles())));
            prop_assert!(found.distance < 1e-5, "{found:?}");
            prop_assert!((found.alpha / f64::from(surface.alpha) - 1.0).abs() < 1e-3, "{found:?} {surface:?}");
            for c in 0..3 {
                prop_assert!((found.diffuse[c] - f64::from(surface.diffuse[c])).abs() < 1e-3, "{found:?} {surface:?}");
                prop_assert!((found.f0[c] - f64::from(surface.f0[c])).abs() < 1e-3, "{found:?} {surface:?}");
            }
            let Metallic { base: found_base, metallic: m } = found.metallic();
            prop_assert!((m - f64::from(metallic)).abs() < 0.02, "{m} {metallic}");
            for c in 0..3 {
                prop_assert!((found_base[c] - f64::from(base[c])).abs() < 0.02, "{found_base:?} {base:?}");
            }
        }
    }

    #[test]
    fn matt_and_black_materials_have_no_highlight() {
        let space = Space::half_angle(32);
        for level in [0.0, 0.2] {
            let found = Nearest::to(&space, &vec![level; space.columns()]);
            assert!(found.f0.iter().all(|f| *f < 1e-9) && found.distance < 1e-9, "{found:?}");
            assert_eq!(found.metallic().metallic, 0.0);
        }
        let mirror = Surface { diffuse: [0.0; 3], f0: [0.9; 3], alpha: 0.02 };
        let found = Nearest::to(&space, &space.row(&mirror.curve(space.angles())));
        assert!(found.metallic().metallic > 0.999, "{found:?}");
    }
}
