//! The surface of the texture workflows that is nearest to a curve.
//!
//! Problem: edits and file formats speak of a body colour, a highlight and its width; a curve is numbers
//! over the half angle.
//! Method: a body and one GGX lobe, `diffuse / pi + f0 lobe(alpha)`. For a given alpha both are linear:
//! least squares, channel by channel, on the metric linearised at the curve, neither below 0. Alpha is the
//! same for all channels and found by a scan of [`STEPS`] widths and a golden-section search between the
//! neighbours of the best; both judge by the metric itself. For pictures, [`Widths`] judges by the
//! linearised metric, among widths whose lobes are prepared. A curve that falls to nothing where others are
//! light, as a basis less some of another may, has infinite slopes there, which would leave black as the
//! nearest surface: where a difference is seen, it is fitted again with what is darker than the mean
//! counting like the mean, and the nearer of both is taken.
//! Cost: some 60 distances, twice that for what is fitted again, or [`Widths`] some 20 sums. A curve that
//! has this form is found to 1e-6.
//! Limits: one lobe. Of two, it is the one that is seen most; [`Nearest::distance`] says what is missing.

use maths::Maths;
use std::f64::consts::PI;

use crate::brdf::Space;
use crate::srgb::luminance;

/// Reflectance of a dielectric at normal incidence, as the metallic workflow has it: index 1.5. Source: glTF
/// 2.0, appendix B.
pub const DIELECTRIC: f64 = 0.04;

/// Factor on [`DIELECTRIC`] up to which a highlight is a dielectric's if a metal explains it as well: in
/// the metric, less than what is barely visible.
const ALSO: f64 = 1.1;

/// The widths of lobes that a document may have.
pub const ALPHA: std::ops::RangeInclusive<f64> = 0.02..=1.0;

/// Distance at which a difference is barely visible, so that a nearer surface is as good.
const BARELY: f64 = 0.01;

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

/// Lobes of some widths, to fit many curves.
pub struct Widths<'a> {
    space: &'a Space,
    /// For each width, the lobe at every angle.
    lobes: Vec<Vec<f64>>,
}

/// The best body and lobe among [`Widths`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Which width.
    pub width: usize,
    /// Diffuse albedo, as in [`Nearest`].
    pub diffuse: [f64; 3],
    /// Specular reflectance at normal incidence, as in [`Nearest`].
    pub f0: [f64; 3],
}

impl Nearest {
    /// The nearest surface to a row (1/sr) of a half-angle space.
    pub fn to(space: &Space, row: &[f64]) -> Nearest {
        let found = Nearest::by(&Target::new(space, row));
        if found.distance < BARELY {
            return found;
        }
        let level = Nearest::by(&Target::above(space, row, mean(space, row)));
        if level.distance < found.distance { level } else { found }
    }

    /// The nearest by the linearised metric of a target.
    fn by(target: &Target) -> Nearest {
        let width =
            |step: f64| ALPHA.start() * (ALPHA.end() / ALPHA.start()).power(step / (STEPS - 1) as f64);
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

    /// Base colour and metalness: those whose luminances of body and highlight are these, with what remains
    /// of the highlight beside a dielectric's own in the base colour.
    pub fn metallic(&self) -> Metallic {
        Metallic::from_colours(&self.diffuse, &self.f0)
    }
}

impl Near {
    /// Base colour and metalness, as of [`Nearest::metallic`].
    pub fn metallic(&self) -> Metallic {
        Metallic::from_colours(&self.diffuse, &self.f0)
    }

    /// The same width with the body and highlight of a base colour.
    pub fn with(&self, surface: &Metallic) -> Near {
        let Metallic { base, metallic: m } = *surface;
        Near {
            diffuse: base.map(|b| b * (1.0 - m) * (1.0 - DIELECTRIC)),
            f0: base.map(|b| DIELECTRIC * (1.0 - m) + b * m),
            ..*self
        }
    }
}

impl Metallic {
    fn from_colours(diffuse: &[f64; 3], f0: &[f64; 3]) -> Metallic {
        let [body, shine] = [diffuse, f0].map(|&c| luminance(c));
        // diffuse = base (1 - m) (1 - q) and f0 = q (1 - m) + base m are q m^2 + b m + (q - shine) = 0.
        let q = DIELECTRIC;
        let b = body / (1.0 - q) - 2.0 * q + shine;
        // Below 0, b is of a base darker than what a metal needs to be told from a black dielectric: as
        // much highlight as a dielectric's has both as its solution, and no metal is so dark.
        let metallic = if shine <= if b < 0.0 { ALSO * q } else { q } {
            0.0
        } else {
            // The form without a difference of near numbers, whatever the sign of b.
            let root = (b * b + 4.0 * q * (shine - q)).sqrt();
            let m = if b >= 0.0 { 2.0 * (shine - q) / (b + root) } else { (root - b) / (2.0 * q) };
            m.clamp(0.0, 1.0)
        };
        let rest = |c: usize| (f0[c] - q * (1.0 - metallic)).max(0.0);
        Metallic { base: std::array::from_fn(|c| diffuse[c] / (1.0 - q) + rest(c)), metallic }
    }
}

impl<'a> Widths<'a> {
    /// Prepares the lobes of these widths, which grow.
    pub fn new(space: &'a Space, alphas: &[f64]) -> Widths<'a> {
        Widths { space, lobes: alphas.iter().map(|&alpha| lobe(space, alpha)).collect() }
    }

    /// The best body and lobe for a row, in the metric linearised there: every sixteenth width, then ever
    /// nearer to the best. `None` without any width.
    pub fn nearest(&self, row: &[f64]) -> Option<Near> {
        let target = Target::new(self.space, row);
        let judged = |width: usize| (target.body_and_lobe(&self.lobes[width]).2, width);
        let best = |a: (f64, usize), b: (f64, usize)| if b.0 < a.0 { b } else { a };
        let mut step = 16;
        let mut found = (0..self.lobes.len()).step_by(step).map(judged).reduce(best)?;
        while step > 1 {
            step /= 2;
            let beside = [found.1.checked_sub(step), Some(found.1 + step)];
            let beside = beside.into_iter().flatten().filter(|&width| width < self.lobes.len());
            found = beside.map(judged).fold(found, best);
        }
        let (diffuse, f0, _) = target.body_and_lobe(&self.lobes[found.1]);
        Some(Near { width: found.1, diffuse, f0 })
    }

    /// The row of a body and a lobe of one of the widths.
    pub fn row(&self, near: &Near) -> Vec<f64> {
        with_lobe(&near.diffuse, &near.f0, &self.lobes[near.width])
    }
}

/// The value (1/sr) whose cube root is the mean of those of a row, as the metric weighs them; above 0.
fn mean(space: &Space, row: &[f64]) -> f64 {
    let weights = || space.weight().iter().zip(space.radiance()).map(|(w, c)| (w * c.cube_root()).squared());
    let sum: f64 = row.iter().zip(weights()).map(|(f, w)| w * f.max(0.0).cube_root()).sum();
    (sum / weights().sum::<f64>().max(f64::MIN_POSITIVE)).cubed() + 1e-12
}

fn lobe(space: &Space, alpha: f64) -> Vec<f64> {
    space.angles().iter().map(|&t| inks::ggx::lobe(t, alpha)).collect()
}

fn with_lobe(diffuse: &[f64; 3], f0: &[f64; 3], lobe: &[f64]) -> Vec<f64> {
    lobe.iter().flat_map(|l| std::array::from_fn::<_, 3, _>(|c| diffuse[c] / PI + f0[c] * l)).collect()
}

impl<'a> Target<'a> {
    fn new(space: &'a Space, row: &'a [f64]) -> Target<'a> {
        // Below a millionth of the peak the slope is that of the millionth.
        Target::above(space, row, row.iter().copied().fold(0.0, f64::max) * 1e-6 + 1e-12)
    }

    /// With the slope of the floor below it.
    fn above(space: &'a Space, row: &'a [f64], floor: f64) -> Target<'a> {
        // The slope of cbrt(f c) is c^(1/3) f^(-2/3) / 3.
        let columns = row.iter().zip(space.weight().iter().zip(space.radiance()));
        let weight = columns
            .map(|(&f, (w, c))| {
                let f = f.max(floor);
                (w * c.cube_root()).squared() / (f * f.cube_root())
            })
            .collect();
        Target { space, row, weight }
    }

    /// The best body and lobe of this width.
    fn fitted(&self, alpha: f64) -> Nearest {
        let lobe = lobe(self.space, alpha);
        let (diffuse, f0, _) = self.body_and_lobe(&lobe);
        let distance = self.space.distance(self.row, &with_lobe(&diffuse, &f0, &lobe));
        Nearest { diffuse, f0, alpha, distance }
    }

    /// The best body and amount of a lobe, and the square of the distance that is left in the linearised
    /// metric, times 9.
    fn body_and_lobe(&self, lobes: &[f64]) -> ([f64; 3], [f64; 3], f64) {
        let (mut diffuse, mut f0, mut rest) = ([0.0; 3], [0.0; 3], 0.0);
        for c in 0..3 {
            let (mut one, mut lobe, mut both) = (0.0, 0.0, 0.0);
            let (mut f_one, mut f_lobe, mut f_both) = (0.0, 0.0, 0.0);
            for (n, l) in lobes.iter().enumerate() {
                let (w, f) = (self.weight[3 * n + c], self.row[3 * n + c]);
                one += w;
                both += w * l;
                lobe += w * l * l;
                f_one += w * f;
                f_lobe += w * f * l;
                f_both += w * f * f;
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
            let (a, b) = (diffuse[c] / PI, f0[c]);
            rest += f_both - 2.0 * (a * f_one + b * f_lobe) + a * (a * one + 2.0 * b * both) + b * b * lobe;
        }
        (diffuse, f0, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::{self, Surface};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(testing::cases(24))]
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
            // A metal as dark as a dielectric's highlight is a dielectric.
            let light = luminance(base.map(f64::from));
            if light < 0.08 && metallic > 0.0 {
                return Ok(());
            }
            prop_assert!((m - f64::from(metallic)).abs() < 0.02, "{m} {metallic}");
            for c in 0..3 {
                prop_assert!((found_base[c] - f64::from(base[c])).abs() < 0.02, "{found_base:?} {base:?}");
            }
        }
    }

    proptest! {
        #![proptest_config(testing::cases(24))]
        /// Among prepared widths is one nearly as good as the best of all, for two surfaces side by side,
        /// too.
        #[test]
        fn prepared_widths_are_nearly_as_good(
            base in prop::array::uniform3(0.02f32..0.98), roughness in prop::array::uniform2(0.2f32..0.9),
            metallic in 0.0f32..=1.0, share in 0.0f64..=1.0,
        ) {
            let space = Space::half_angle(32);
            let alphas: Vec<f64> = (37..=255).map(|i| (f64::from(i) / 255.0).powi(2)).collect();
            let rows = roughness.map(|roughness| {
                space.row(&materials::metallic(base, [DIELECTRIC as f32; 3], roughness, metallic).curve(space.angles()))
            });
            let row: Vec<f64> = rows[0].iter().zip(&rows[1]).map(|(a, b)| share * a + (1.0 - share) * b).collect();
            let best = Nearest::to(&space, &row).distance;
            let widths = Widths::new(&space, &alphas);
            let near = widths.nearest(&row).unwrap();
            let found = space.distance(&row, &widths.row(&near));
            // The linearised metric chooses, which for what no one lobe is near to is not the metric.
            prop_assert!(found <= 1.5 * best + 0.002, "{found} {best}");
            let one = widths.nearest(&rows[0]).unwrap();
            prop_assert!(space.distance(&rows[0], &widths.row(&one)) <= 0.004, "{one:?}");
        }
    }

    /// Over a grid of glTF materials: no dielectric has metal in it, however dark and rough, every metal
    /// has, and what is returned shows the same curve.
    #[test]
    fn dielectrics_are_no_metals() {
        let space = Space::half_angle(32);
        let mut worst = [0.0f64; 3];
        for base in [0.0f32, 0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.08, 0.15, 0.4, 0.9] {
            for roughness in [0.2f32, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0] {
                for colour in [[base; 3], [base, 0.5 * base, 0.1 * base], [0.2 * base, 0.3 * base, base]] {
                    for metal in [0.0f32, 1.0] {
                        // Metals begin where a dielectric's highlight ends.
                        if metal > 0.0 && base < 0.4 {
                            continue;
                        }
                        let surface = materials::metallic(colour, [DIELECTRIC as f32; 3], roughness, metal);
                        // As exactly as documents hold it.
                        let row: Vec<f64> = space
                            .row(&surface.curve(space.angles()))
                            .iter()
                            .map(|&v| f64::from(v as f32))
                            .collect();
                        let found = Nearest::to(&space, &row);
                        let surface = found.metallic();
                        let off = (surface.metallic - f64::from(metal)).abs();
                        worst[metal as usize] = worst[metal as usize].max(off);
                        assert!(off < 0.01, "{colour:?} {roughness} {metal}: {found:?} {surface:?}");
                        let Nearest { diffuse, f0, alpha, .. } = found;
                        let shown = Near { width: 0, diffuse, f0 }.with(&surface);
                        let shown = Widths::new(&space, &[alpha]).row(&shown);
                        worst[2] = worst[2].max(space.distance(&row, &shown));
                    }
                }
            }
        }
        println!(
            "metal of dielectrics {:.4}, dielectric of metals {:.4}, d {:.5}",
            worst[0], worst[1], worst[2]
        );
        assert!(worst[2] < 0.005, "{worst:?}");
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
