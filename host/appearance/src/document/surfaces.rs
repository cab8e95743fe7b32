//! Documents as [`Materials`]: a surface for every pixel, one material everywhere, or bases and weights.
//!
//! Problem: the factor stage asks for millions of rows `diffuse / pi + f0 lobe(theta_n; alpha)`.
//! Method: lobes are tabulated over ln(alpha) at the angles of the space; a row is two table rows mixed and
//! three multiply-adds a sample. The mix is off by `h^2 / 8` of the lobe's second derivative in ln(alpha) (at most 4
//! times the lobe), `h = ln(1 / 0.02) / 255`: about 1e-4 of the lobe.
//! Cost: 28 bytes a pixel; 8 operations a sample, no root, no trigonometry.

use std::path::Path;

use inks::Curve;
use rayon::prelude::*;

use super::error::DocumentError;
use super::materials::{Materials, Surface};
use super::source::Source;
use super::{Content, Document, SWATCH_MM, stem};
use crate::brdf::Space;
use crate::factor::Factored;

/// The narrowest lobe that is kept: below it the peak is finer than any printable foil shows.
pub const LEAST_ALPHA: f32 = 0.02;

/// The most pixels of a document. The largest page has 38 million dots; more is never seen.
pub const MOST_PIXELS: u64 = 1 << 26;

/// The largest reflectance that is read, in 1/sr: a mirror's peak as a laser sees it; more is damage.
pub const MOST_REFLECTANCE: f64 = 1e9;

const LEVELS: usize = 256;

/// Pixels handed to a thread at a time.
const CHUNK: usize = 1 << 14;

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
                let alpha = f64::from(LEAST_ALPHA).powf(1.0 - s);
                space.angles().iter().map(move |&t| inks::ggx::lobe(t, alpha) as f32)
            })
            .collect();
        Lobes { samples: space.angles().len(), table }
    }

    /// Where an alpha lies in the table, 0 to LEVELS - 1.
    fn position(alpha: f32) -> f32 {
        let s = 1.0 - alpha.ln() / LEAST_ALPHA.ln();
        (s * (LEVELS - 1) as f32).clamp(0.0, (LEVELS - 1) as f32)
    }

    fn alpha(position: f32) -> f32 {
        LEAST_ALPHA.powf(1.0 - position / (LEVELS - 1) as f32)
    }

    /// The two table rows around a position and the share of the second.
    fn around(&self, position: f32) -> (&[f32], &[f32], f32) {
        let level = (position as usize).min(LEVELS - 2);
        let below = &self.table[level * self.samples..][..self.samples];
        let above = &self.table[(level + 1) * self.samples..][..self.samples];
        (below, above, position - level as f32)
    }
}

/// A surface as its row needs it: diffuse over pi, f0, and the place in the table of lobes.
#[derive(Clone, Copy, Debug)]
struct Packed {
    base: [f32; 3],
    f0: [f32; 3],
    position: f32,
}

/// A surface for every pixel. See the module text.
#[derive(Clone, Debug)]
pub struct Surfaces {
    width: usize,
    height: usize,
    space: Space,
    lobes: Lobes,
    pixels: Vec<Packed>,
}

impl Surfaces {
    /// Surfaces made pixel by pixel, rows from the top, on all cores; values are clamped to their ranges, NaN to
    /// the lowest. `width` and `height` at least 1.
    #[expect(clippy::manual_clamp, reason = "clamp would keep NaN, max drops it")]
    pub fn build(
        width: usize,
        height: usize,
        space: Space,
        surface: impl Fn(usize) -> Surface + Sync,
    ) -> Surfaces {
        let mut pixels = vec![Packed { base: [0.0; 3], f0: [0.0; 3], position: 0.0 }; width * height];
        pixels.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (i, out) in out.iter_mut().enumerate() {
                let surface = surface(chunk * CHUNK + i);
                // `max` before `min`: NaN becomes 0.
                let unit = |v: f32| v.max(0.0).min(1.0);
                *out = Packed {
                    base: surface.diffuse.map(|v| unit(v) * std::f32::consts::FRAC_1_PI),
                    f0: surface.f0.map(unit),
                    position: Lobes::position(surface.alpha.max(LEAST_ALPHA).min(1.0)),
                };
            }
        });
        let lobes = Lobes::new(&space);
        Surfaces { width, height, space, lobes, pixels }
    }

    /// The surface of pixel `y * width + x`.
    pub fn surface(&self, pixel: usize) -> Surface {
        let packed = self.pixels[pixel];
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
        let Packed { base, f0, position } = self.pixels[pixel];
        let (below, above, s) = self.lobes.around(position);
        for ((out, &below), &above) in out.chunks_exact_mut(3).zip(below).zip(above) {
            let lobe = below + s * (above - below);
            out[0] = base[0] + f0[0] * lobe;
            out[1] = base[1] + f0[1] * lobe;
            out[2] = base[2] + f0[2] * lobe;
        }
    }
}

/// One material everywhere: a document of a single pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Uniform {
    space: Space,
    row: Vec<f32>,
}

impl Uniform {
    /// A curve (1/sr), sampled at the angles of the space; `path` names it in the error when a value is beyond
    /// [`MOST_REFLECTANCE`].
    pub fn new(space: Space, curve: &Curve, path: &Path) -> Result<Uniform, DocumentError> {
        let row = space.row(curve);
        check_reflectance(&row).map_err(|problem| DocumentError::Field {
            path: path.to_path_buf(),
            field: "reflectance".into(),
            problem,
        })?;
        Ok(Uniform { space, row: row.into_iter().map(|v| v as f32).collect() })
    }

    /// As a document `SWATCH_MM` on a side.
    pub(super) fn document(self, path: &Path, source: Source<'_>) -> Document {
        let (notes, digest) = source.finish();
        Document {
            name: stem(path),
            content: Content::Uniform(self),
            size_mm: Some((SWATCH_MM, SWATCH_MM)),
            notes,
            digest,
        }
    }
}

impl Materials for Uniform {
    fn width(&self) -> usize {
        1
    }

    fn height(&self) -> usize {
        1
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, _pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.row);
    }
}

impl Materials for Factored {
    fn width(&self) -> usize {
        self.maps.width()
    }

    fn height(&self) -> usize {
        self.maps.height()
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.fill(0.0);
        for (&weight, basis) in self.maps.at(pixel).iter().zip(self.bases.rows()) {
            if weight > 0 {
                let weight = f32::from(weight) / f32::from(crate::weights::ONE);
                for (out, &value) in out.iter_mut().zip(basis) {
                    *out += weight * value as f32;
                }
            }
        }
    }
}

/// Whether all values can be reflectances.
pub(super) fn check_reflectance(row: &[f64]) -> Result<(), String> {
    match row.iter().find(|v| !(0.0..=MOST_REFLECTANCE).contains(*v)) {
        Some(v) => Err(format!("{v:e} is no reflectance; expected 0 to {MOST_REFLECTANCE:e} per steradian")),
        None => Ok(()),
    }
}

/// Opens a curve file as a document of one material.
pub(super) fn open_curve(
    path: &Path,
    space: Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let bytes = source.read(path, 16 << 20)?;
    let curve = Curve::from_csv(&bytes[..], path)?;
    Ok(Uniform::new(space, &curve, path)?.document(path, source))
}

/// The surface of the metallic workflow: `f0 = mix(dielectric, base, metallic)`, `diffuse = base (1 - metallic)
/// (1 - dielectric)`, `alpha = roughness^2`; all linear, 0 to 1.
pub fn metallic(base: [f32; 3], dielectric: [f32; 3], roughness: f32, metallic: f32) -> Surface {
    Surface {
        diffuse: std::array::from_fn(|c| base[c] * (1.0 - metallic) * (1.0 - dielectric[c])),
        f0: std::array::from_fn(|c| dielectric[c] + (base[c] - dielectric[c]) * metallic),
        alpha: roughness * roughness,
    }
}

/// The surface of the specular workflow: f0 as given, the diffuse part dimmed by its largest channel as glTF's
/// extension has it, `alpha = (1 - glossiness)^2`.
pub fn specular(diffuse: [f32; 3], f0: [f32; 3], glossiness: f32) -> Surface {
    let left = 1.0 - f0.into_iter().fold(0.0, f32::max);
    Surface { diffuse: diffuse.map(|v| v * left), f0, alpha: (1.0 - glossiness) * (1.0 - glossiness) }
}

/// Reflectance at normal incidence of a dielectric with the given index of refraction.
pub fn dielectric(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
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
            let surfaces = Surfaces::build(1, 1, space.clone(), |_| surface);
            let mut row = vec![0.0; space.columns()];
            surfaces.reflectance(0, &mut row);
            let expected = space.row(&surface.curve(space.angles()));
            for (&found, &expected) in row.iter().zip(&expected) {
                let found = f64::from(found);
                prop_assert!((found - expected).abs() <= 2e-4 * expected + 1e-6, "{} {}", found, expected);
            }
            prop_assert!((surfaces.surface(0).alpha / alpha - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn the_workflows_agree_where_they_mean_the_same_metal() {
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

    #[test]
    fn wild_values_become_legal_ones() {
        let space = Space::half_angle(8);
        let wild =
            Surface { diffuse: [f32::NAN, -3.0, 9.0], f0: [f32::INFINITY, f32::NAN, -1.0], alpha: f32::NAN };
        let surfaces = Surfaces::build(1, 1, space.clone(), |_| wild);
        let mut row = vec![f32::NAN; space.columns()];
        surfaces.reflectance(0, &mut row);
        assert!(row.iter().all(|v| v.is_finite() && *v >= 0.0), "{row:?}");
    }
}
