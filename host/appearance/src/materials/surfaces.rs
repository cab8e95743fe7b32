//! A surface for every pixel, evaluated through a table of lobes.
//!
//! Problem: the factor stage reads millions of rows `diffuse / pi + f0 lobe(theta_n; alpha)`.
//! Method: lobes are tabulated over ln(alpha) at the angles of the space. A row interpolates between two table rows and
//! takes three multiply-adds per sample. The interpolation error is `h^2 / 8` of the lobe's second derivative in
//! ln(alpha) (at most 4 times the lobe), `h = ln(1 / 0.02) / 255`: about 1e-4 of the lobe.
//! Surfaces are computed from the document's maps whenever they are asked for: the maps, as they were decoded, take a fraction
//! of the memory.
//! Cost: a logarithm and some look-ups per pixel; 8 operations per sample, no root, no trigonometry.

use maths::Maths;
use std::fmt;
use std::sync::Arc;

use super::pixels::{Materials, hash};
use super::surface::Coated;
#[cfg(test)]
use super::surface::Surface;
use crate::brdf::Space;

/// The narrowest lobe that is kept, for the peak of a narrower one is finer than any printable foil shows.
const LEAST_ALPHA: f32 = 0.02;

/// Widths of the table, one for each value of 8 bits, as textures of roughness have them, so that none lies
/// between two.
const LEVELS: usize = 256;

/// Lobes for unit f0 at the angles of a space, over ln(alpha).
#[derive(Clone, Debug)]
struct Lobes {
    samples: usize,
    table: Vec<f32>,
}

impl Lobes {
    fn new(space: &Space) -> Lobes {
        let table = (0..LEVELS)
            .flat_map(|level| {
                let s = level as f64 / (LEVELS - 1) as f64;
                let alpha = f64::from(LEAST_ALPHA).power(1.0 - s);
                space.angles().iter().map(move |&t| inks::ggx::lobe(t, alpha) as f32)
            })
            .collect();
        Lobes { samples: space.angles().len(), table }
    }

    /// The position of an alpha in the table, 0 to LEVELS - 1.
    fn position(alpha: f32) -> f32 {
        let s = 1.0 - alpha.logarithm() / LEAST_ALPHA.logarithm();
        (s * (LEVELS - 1) as f32).clamp(0.0, (LEVELS - 1) as f32)
    }

    #[cfg(test)]
    fn alpha(position: f32) -> f32 {
        LEAST_ALPHA.power(1.0 - position / (LEVELS - 1) as f32)
    }

    /// The two table rows around a position, and the weight of the second.
    fn around(&self, position: f32) -> (&[f32], &[f32], f32) {
        let level = (position as usize).min(LEVELS - 2);
        let below = &self.table[level * self.samples..][..self.samples];
        let above = &self.table[(level + 1) * self.samples..][..self.samples];
        (below, above, position - level as f32)
    }
}

/// A surface in the form a row needs: diffuse over pi, f0, and the position in the table of lobes.
#[derive(Clone, Copy, Debug)]
struct Packed {
    base: [f32; 3],
    f0: [f32; 3],
    position: f32,
    /// The lobe of a clear coat: reflectance and position; a reflectance of 0 without one.
    coat: (f32, f32),
}

/// A surface for every pixel. See the module documentation.
#[derive(Clone)]
pub struct Surfaces {
    width: usize,
    height: usize,
    space: Space,
    lobes: Lobes,
    surface: Arc<dyn Fn(usize) -> Coated + Send + Sync>,
}

impl fmt::Debug for Surfaces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Surfaces({} x {})", self.width, self.height)
    }
}

impl Surfaces {
    /// Surfaces by the number of their pixel, rows from the top. Values are clamped to their ranges, NaN to the lowest value.
    /// `width` and `height` are at least 1.
    pub(crate) fn build<S: Into<Coated>>(
        width: usize,
        height: usize,
        space: Space,
        surface: impl Fn(usize) -> S + Send + Sync + 'static,
    ) -> Surfaces {
        let lobes = Lobes::new(&space);
        Surfaces { width, height, space, lobes, surface: Arc::new(move |pixel| surface(pixel).into()) }
    }

    #[expect(clippy::manual_clamp, reason = "clamp would keep NaN, max drops it")]
    fn packed(&self, pixel: usize) -> Packed {
        let Coated { base: surface, f0: coat, alpha: coat_alpha } = (self.surface)(pixel);
        // `max` before `min`: NaN becomes 0.
        let unit = |v: f32| v.max(0.0).min(1.0);
        Packed {
            base: surface.diffuse.map(|v| unit(v) * std::f32::consts::FRAC_1_PI),
            f0: surface.f0.map(unit),
            position: Lobes::position(surface.alpha.max(LEAST_ALPHA).min(1.0)),
            coat: match unit(coat) {
                0.0 => (0.0, 0.0),
                coat => (coat, Lobes::position(coat_alpha.max(LEAST_ALPHA).min(1.0))),
            },
        }
    }

    /// Adds the lobe of a coat.
    fn add_coat(&self, (f0, position): (f32, f32), out: &mut [f32]) {
        if f0 == 0.0 {
            return;
        }
        let (below, above, s) = self.lobes.around(position);
        for ((out, &below), &above) in out.as_chunks_mut::<3>().0.iter_mut().zip(below).zip(above) {
            let lobe = f0 * (below + s * (above - below));
            out.iter_mut().for_each(|v| *v += lobe);
        }
    }

    /// The surface of pixel `y * width + x`; under a coat, what is left of it.
    #[cfg(test)]
    pub(crate) fn surface(&self, pixel: usize) -> Surface {
        let packed = self.packed(pixel);
        Surface {
            diffuse: packed.base.map(|v| v * std::f32::consts::PI),
            f0: packed.f0,
            alpha: Lobes::alpha(packed.position),
        }
    }
}

impl Materials for Surfaces {
    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.height
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let Packed { base, f0, position, coat } = self.packed(pixel);
        let (below, above, s) = self.lobes.around(position);
        for ((out, &below), &above) in out.as_chunks_mut::<3>().0.iter_mut().zip(below).zip(above) {
            let lobe = below + s * (above - below);
            *out = std::array::from_fn(|c| base[c] + f0[c] * lobe);
        }
        self.add_coat(coat, out);
    }

    fn add(&self, pixel: usize, part: f32, out: &mut [f32]) {
        let Packed { base, f0, position, coat } = self.packed(pixel);
        self.add_coat((part * coat.0, coat.1), out);
        let (base, f0) = (base.map(|v| part * v), f0.map(|v| part * v));
        let (below, above, s) = self.lobes.around(position);
        for ((out, &below), &above) in out.as_chunks_mut::<3>().0.iter_mut().zip(below).zip(above) {
            let lobe = below + s * (above - below);
            (0..3).for_each(|c| out[c] += base[c] + f0[c] * lobe);
        }
    }

    fn key(&self, pixel: usize, _row: &mut [f32]) -> u64 {
        let Packed { base: [a, b, c], f0: [d, e, f], position, coat } = self.packed(pixel);
        match coat {
            (0.0, _) => hash(&[a, b, c, d, e, f, position]),
            (coat, place) => hash(&[a, b, c, d, e, f, position, coat, place]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn table_rows_are_the_curve_of_the_surface(
            diffuse in prop::array::uniform3(0.0f32..1.0), f0 in prop::array::uniform3(0.0f32..1.0),
            alpha in 0.02f32..1.0,
        ) {
            let space = Space::half_angle(48);
            let surface = Surface { diffuse, f0, alpha };
            let surfaces = Surfaces::build(1, 1, space.clone(), move |_| surface);
            let mut row = vec![0.0; space.columns()];
            surfaces.reflectance(0, &mut row);
            let mut twice = row.clone();
            surfaces.add(0, 1.0, &mut twice);
            prop_assert!(twice.iter().zip(&row).all(|(t, r)| (t - 2.0 * r).abs() <= 1e-5 * r));
            let expected = space.row(&surface.curve(space.angles()));
            for (&found, &expected) in row.iter().zip(&expected) {
                let found = f64::from(found);
                prop_assert!((found - expected).abs() <= 2e-4 * expected + 1e-6, "{} {}", found, expected);
            }
            prop_assert!((surfaces.surface(0).alpha / alpha - 1.0).abs() < 1e-4);
        }
    }

    /// The coat by its equation, term by term, in double precision.
    #[test]
    fn a_coat_is_a_second_lobe_over_a_dimmed_base() {
        let space = Space::half_angle(48);
        let base = Surface { diffuse: [0.05, 0.1, 0.4], f0: [0.9, 0.7, 0.3], alpha: 0.3 };
        for (weight, roughness) in [(1.0f32, 0.2f32), (0.5, 0.6), (0.0, 0.1)] {
            let coated = move |_| base.under(crate::materials::Coat::new(weight, roughness, 0.04));
            let surfaces = Surfaces::build(1, 1, space.clone(), coated);
            let mut row = vec![0.0; space.columns()];
            surfaces.reflectance(0, &mut row);
            let mut twice = row.clone();
            surfaces.add(0, 1.0, &mut twice);
            let below = space.row(&base.curve(space.angles()));
            let w = f64::from(weight);
            for (n, &t) in space.angles().iter().enumerate() {
                let lobe = 0.04 * inks::ggx::lobe(t, f64::from(roughness).powi(2));
                for c in 3 * n..3 * n + 3 {
                    let covered = 0.96 * 0.96 * below[c] + lobe;
                    let expected = w * covered + (1.0 - w) * below[c];
                    assert!((f64::from(row[c]) - expected).abs() < 3e-4 * expected + 1e-6, "{weight} {n}");
                    assert!((twice[c] - 2.0 * row[c]).abs() < 1e-5 * row[c]);
                }
            }
        }
    }

    #[test]
    fn wild_values_become_legal_ones() {
        let space = Space::half_angle(8);
        let wild =
            Surface { diffuse: [f32::NAN, -3.0, 9.0], f0: [f32::INFINITY, f32::NAN, -1.0], alpha: f32::NAN };
        let surfaces = Surfaces::build(1, 1, space.clone(), move |_| wild);
        let mut row = vec![f32::NAN; space.columns()];
        surfaces.reflectance(0, &mut row);
        assert!(row.iter().all(|v| v.is_finite() && *v >= 0.0), "{row:?}");
    }
}
