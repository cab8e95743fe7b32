//! Edits of one curve: rougher or glossier, tinted, lighter or darker.
//!
//! Problem: a basis is a curve over the half angle, without the parameters that people think in.
//! Method: the [nearest](Nearest) body and lobe split the curve `f` into a flat body, or all of `f` where it has less, and gloss `g = f - body`.
//! *Rougher by k* tilts every microfacet k times as steeply: the distribution of slopes, `g cos^6 / G`, is stretched by k
//! along tan theta and lowered by k^2, so it still covers the unit disc once, and what shadowing G takes follows the new
//! width. For a GGX lobe of width alpha this is the lobe of width k alpha. *Tint* and *albedo* multiply the base colour of
//! the metallic workflow: the body, and what exceeds a dielectric's 4 % of the gloss.
//! Cost: one fit and one interpolation per sample. Limits: one width for all of the gloss; widths stay within
//! [`ALPHA`], base colours within 1. `docs/decisions/edits-of-curves.md` has the errors.

use maths::Maths;
use std::fmt;
use std::str::FromStr;

use inks::{Curve, ggx};

use super::error::EditError;
use crate::brdf::Space;
use crate::materials::{ALPHA, DIELECTRIC, Nearest};
use crate::srgb;

/// A colour that multiplies the base colour: sRGB, as in `#c08040`. White changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tint(pub [u8; 3]);

impl Tint {
    /// The tint that changes nothing.
    pub const WHITE: Tint = Tint([255; 3]);

    /// The nearest to a linear colour; channels outside 0 to 1 are clamped.
    pub fn of_linear(colour: [f64; 3]) -> Tint {
        Tint(colour.map(|v| (srgb::encode(v as f32) * 255.0).round() as u8))
    }

    fn linear(self) -> [f64; 3] {
        self.0.map(|v| f64::from(srgb::decode(f32::from(v) / 255.0)))
    }
}

impl FromStr for Tint {
    type Err = EditError;

    fn from_str(text: &str) -> Result<Tint, EditError> {
        let wrong = || EditError::Text {
            text: text.chars().filter(|c| !c.is_control()).collect(),
            expected: "a colour such as #c08040",
        };
        let digits = text
            .strip_prefix('#')
            .filter(|digits| digits.len() == 6 && digits.is_ascii())
            .ok_or_else(wrong)?;
        let mut rgb = [0; 3];
        for (value, pair) in rgb.iter_mut().zip([0, 2, 4]) {
            let pair = &digits[pair..pair + 2];
            // The parser would take a sign.
            if !pair.bytes().all(|b| b.is_ascii_hexdigit()) {
                return Err(wrong());
            }
            *value = u8::from_str_radix(pair, 16).map_err(|_| wrong())?;
        }
        Ok(Tint(rgb))
    }
}

impl fmt::Display for Tint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

/// How a surface is edited. The default changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Factor on the width of the gloss; below 1 it becomes glossier.
    pub rougher: f64,
    /// Factor on the base colour.
    pub tint: Tint,
    /// Factor on the base colour, all channels alike.
    pub albedo: f64,
}

impl Default for Surface {
    fn default() -> Surface {
        Surface { rougher: 1.0, tint: Tint::WHITE, albedo: 1.0 }
    }
}

/// Factors on the width of the gloss.
pub(super) const ROUGHER: std::ops::RangeInclusive<f64> = 0.05..=20.0;
/// Factors on the base colour.
pub(super) const LIGHTER: std::ops::RangeInclusive<f64> = 0.0..=20.0;

impl Surface {
    /// The factor [`Surface::rougher`] of a surface that is so many times as glossy.
    ///
    /// # Errors
    /// A number that is none or out of range.
    pub fn glossier(factor: f64) -> Result<f64, EditError> {
        let (low, high) = (ROUGHER.end().recip(), ROUGHER.start().recip());
        if !(low..=high).contains(&factor) {
            return Err(EditError::Value {
                what: "glossier",
                found: factor,
                expected: format!("{low} to {high}"),
            });
        }
        Ok(factor.recip())
    }

    /// The row (1/sr) of a half-angle space after this edit, and the factors applied to width and base colour within their
    /// limits.
    pub(super) fn edited(&self, space: &Space, row: &[f64]) -> (Vec<f64>, Applied) {
        if *self == Surface::default() {
            return (row.to_vec(), Applied { rougher: 1.0, albedo: 1.0 });
        }
        let found = Nearest::to(space, row);
        let alpha = (found.alpha * self.rougher).clamp(*ALPHA.start(), *ALPHA.end());
        let (metallic, tint) = (found.metallic(), self.tint.linear());
        // No base colour above 1, unless it was there before.
        let lightest = (0..3).map(|c| metallic.base[c] * tint[c]).fold(0.0, f64::max);
        let albedo = if self.albedo > 1.0 && lightest > 0.0 {
            self.albedo.min((1.0 / lightest).max(1.0))
        } else {
            self.albedo
        };
        let mut out = row.to_vec();
        for (c, &tint) in tint.iter().enumerate() {
            let channel: Vec<f64> = row.iter().skip(c).step_by(3).copied().collect();
            // Where there is less than the body, all of it is body.
            let body: Vec<f64> =
                channel.iter().map(|f| f.min(found.diffuse[c] / std::f64::consts::PI)).collect();
            let gloss: Vec<f64> = channel.iter().zip(&body).map(|(f, body)| f - body).collect();
            let gloss = stretched(space.angles(), &gloss, found.alpha, alpha);
            let colour = tint * albedo;
            let own = DIELECTRIC * (1.0 - metallic.metallic);
            let white = if found.f0[c] > own { own / found.f0[c] } else { 1.0 };
            for (out, (g, body)) in out.iter_mut().skip(c).step_by(3).zip(gloss.iter().zip(body)) {
                *out = colour * (body + (1.0 - white) * g) + white * g;
            }
        }
        (out, Applied { rougher: alpha / found.alpha, albedo })
    }
}

/// The factors that an edit came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Applied {
    /// On the width of the gloss.
    pub rougher: f64,
    /// On the base colour, beside the tint.
    pub albedo: f64,
}

/// Gloss over these angles with its width `from` changed to `to`.
fn stretched(angles: &[f64], gloss: &[f64], from: f64, to: f64) -> Vec<f64> {
    if from == to {
        return gloss.to_vec();
    }
    let k = to / from;
    let cos = |theta: f64| theta.cosine().max(1e-6);
    let visible = |theta: f64, alpha: f64| ggx::shadowing(cos(theta), alpha) / cos(theta).whole_power(6);
    let mut samples = gloss.iter().zip(angles).map(|(g, &theta)| g / visible(theta, from));
    let slopes = Curve::sampled(angles, |_| [samples.next().unwrap_or(0.0), 0.0, 0.0]);
    let last = angles.last().copied().unwrap_or(0.0);
    let at = |theta: f64| {
        let tan = theta.tangent() / k;
        let read = tan.arctangent();
        // Beyond the last sample slopes fall with the fourth power, as those of a GGX lobe do.
        slopes.at(read)[0] * if read > last { (last.tangent() / tan).whole_power(4) } else { 1.0 }
    };
    angles.iter().map(|&theta| at(theta) * visible(theta, to) / (k * k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::{Surface as Pbr, metallic};
    use proptest::prelude::*;

    fn row(space: &Space, surface: &Pbr) -> Vec<f64> {
        space.row(&surface.curve(space.angles()))
    }

    /// The greatest distance d and the greatest relative error up to 80 degrees of stretched lobes against the lobes themselves.
    fn errors(factor: f64, widths: &[f32], surface: impl Fn(f32) -> Pbr) -> (f64, f64) {
        let space = Space::half_angle(32);
        let mut worst = (0.0f64, 0.0f64);
        for &alpha in widths {
            let (from, to) = (surface(alpha), surface((f64::from(alpha) * factor) as f32));
            let edit = Surface { rougher: factor, ..Surface::default() };
            let (found, _) = edit.edited(&space, &row(&space, &from));
            let expected = row(&space, &to);
            worst.0 = worst.0.max(space.distance(&found, &expected));
            for (n, &theta) in space.angles().iter().enumerate().filter(|(_, t)| t.to_degrees() < 80.0) {
                let (found, expected) = (found[3 * n + 1], expected[3 * n + 1]);
                worst.1 = worst.1.max((found / expected - 1.0).abs());
                assert!(found.is_finite(), "{theta}");
            }
        }
        worst
    }

    /// Rougher by k of a GGX curve of width alpha against the analytic curve of width k alpha, on a metal and on a varnished
    /// body.
    #[test]
    fn rougher_lobes_are_the_analytic_lobes_of_that_width() {
        let metal = |alpha| Pbr { diffuse: [0.0; 3], f0: [0.9, 0.7, 0.3], alpha };
        let varnish = |alpha| Pbr { diffuse: [0.5, 0.3, 0.1], f0: [0.04; 3], alpha };
        for (factor, widths) in [
            (1.5, &[0.03f32, 0.06, 0.12, 0.25, 0.5][..]),
            (3.0, &[0.03, 0.06, 0.12, 0.25]),
            (0.5, &[0.06, 0.12, 0.25, 0.5, 0.9]),
        ] {
            let (metal, varnish) = (errors(factor, widths, metal), errors(factor, widths, varnish));
            println!("by {factor}: metal {metal:.5?}, varnish {varnish:.5?}");
            assert!(metal.0 < 1.5e-3 && varnish.0 < 1.5e-3, "by {factor}: {metal:?} {varnish:?}");
            assert!(metal.1 < 0.02 && varnish.1 < 0.02, "by {factor}: {metal:?} {varnish:?}");
        }
    }

    proptest! {
        #![proptest_config(testing::cases(16))]
        /// A tint is what a coloured base would have been in the first place: body of a dielectric, highlight of a metal.
        #[test]
        fn tints_multiply_the_base_colour(
            base in prop::array::uniform3(0.05f32..0.95), tint in prop::array::uniform3(90u8..=255),
            m in prop::sample::select(vec![0.0f32, 0.3, 1.0]), roughness in 0.2f32..0.8, albedo in 0.2f64..1.0,
        ) {
            let space = Space::half_angle(32);
            let surface = |base: [f32; 3]| metallic(base, [DIELECTRIC as f32; 3], roughness, m);
            let edit = Surface { tint: Tint(tint), albedo, ..Surface::default() };
            let (found, _) = edit.edited(&space, &row(&space, &surface(base)));
            let coloured = std::array::from_fn(|c| base[c] * Tint(tint).linear()[c] as f32 * albedo as f32);
            let expected = row(&space, &surface(coloured));
            let d = space.distance(&found, &expected);
            prop_assert!(d < 2e-3, "{d}");
        }

        /// Any curve at all: what comes out is a reflectance, and no edit changes nothing.
        #[test]
        fn any_curve_stays_a_reflectance(
            values in prop::collection::vec(0.0f64..1.0, 24), powers in 0i32..8,
            rougher in prop::sample::select(vec![0.05, 0.5, 1.0, 2.0, 20.0]), albedo in 0.0f64..20.0,
        ) {
            let space = Space::half_angle(8);
            let curve: Vec<f64> = values.iter().map(|v| 1e3 * v.powi(powers)).collect();
            prop_assert_eq!(&Surface::default().edited(&space, &curve).0, &curve);
            let edit = Surface { rougher, albedo, tint: Tint([255, 188, 0]) };
            let (found, _) = edit.edited(&space, &curve);
            prop_assert!(found.iter().all(|v| v.is_finite() && *v >= 0.0), "{found:?}");
        }
    }

    #[test]
    fn white_paper_gets_no_lighter_and_mirrors_no_sharper() {
        let space = Space::half_angle(32);
        let paper = Pbr { diffuse: [0.9 * 0.96, 0.45 * 0.96, 0.1], f0: [0.04; 3], alpha: 0.3 };
        let (_, applied) = Surface { albedo: 3.0, ..Surface::default() }.edited(&space, &row(&space, &paper));
        assert!((applied.albedo - 1.0 / 0.9).abs() < 1e-3, "{applied:?}");
        let mirror = Pbr { diffuse: [0.0; 3], f0: [0.9; 3], alpha: 0.03 };
        let (_, applied) =
            Surface { rougher: 0.1, ..Surface::default() }.edited(&space, &row(&space, &mirror));
        assert!((applied.rougher - 2.0 / 3.0).abs() < 1e-3, "{applied:?}");
    }
}
