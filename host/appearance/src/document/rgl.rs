//! RGL `.bsdf`: isotropic measurements in an adaptive parameterisation (Dupuy and Jakob 2018).
//!
//! Problem: the file stores reflectance on a grid that follows the lobe of the surface. Method: for directions wi and wo,
//! the half vector m has the unit coordinates u = sqrt(2 theta_m / pi), v = (phi_m - phi_i + pi) / 2 pi. The table `vndf`
//! at theta_i is the density of visible normals there. Its distribution functions (conditional along u, marginal along v,
//! bilinear patches) map (u, v) to the unit square, where `rgb` (or `spectra`) is interpolated linearly. That value times
//! `ndf(m) / (4 sigma(wi))` is reflectance times the cosine at wo; dividing by the cosine gives 1/sr. A `jacobian` of 0
//! means that the table already contains the factor. [`super::average`] computes the curve.
//! Spectra become RGB as in [`super::spectrum`].
//! Cost: about a million lookups. Limits: isotropic files only (phi_i of at most two entries).

mod tensor;

use maths::Maths;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use super::average;
use super::content::Document;
use super::content::MOST_BYTES;
use super::curve;
use super::error::DocumentError;
use super::source::Source;
use super::spectrum;
use crate::brdf::Space;
use tensor::{Tensor, TensorFile};

/// Samples of theta_h in the curve, on the square-root grid, as many as in MERL's files.
const THETA_H: usize = 90;

/// Cells of theta_d and phi_d in the average: those of theta_d are 2.5 degrees wide, so that the range that
/// is averaged begins and ends between two.
const CELLS: (usize, usize) = (36, 36);

pub(super) fn open(path: &Path, space: Space, source: Source<'_>) -> Result<Document, DocumentError> {
    curve::averaged(path, space, source, MOST_BYTES, parse)
}

/// The half-angle curve of a file's bytes; `path` names it in errors.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<inks::Curve, DocumentError> {
    let file = TensorFile::parse(bytes, path)?;
    let measured = Measured::new(&file)?;
    let theta_h: Vec<f64> =
        (0..THETA_H).map(|i| FRAC_PI_2 * ((i as f64 + 0.5) / THETA_H as f64).squared()).collect();
    average::curve(&theta_h, CELLS.0, CELLS.1, |_, wi, wo| measured.reflectance(wi, wo))
        .ok_or_else(|| file.wrong("theta_i", "no pair of directions within its range can be averaged".into()))
}

/// A table over the unit square: bilinear between `height` x `width` values, the outermost of them on the border.
#[derive(Clone, Copy)]
struct Grid<'a> {
    width: usize,
    height: usize,
    data: &'a [f32],
}

/// A position in a grid: its cell, and the weights of the right and lower neighbours.
#[derive(Clone, Copy)]
struct GridPosition {
    x: usize,
    y: usize,
    s: f64,
    t: f64,
}

impl Grid<'_> {
    fn place(&self, u: f64, v: f64) -> GridPosition {
        let cell = |p: f64, n: usize| {
            let p = p.clamp(0.0, 1.0) * (n - 1) as f64;
            let at = (p as usize).min(n - 2);
            (at, p - at as f64)
        };
        let ((x, s), (y, t)) = (cell(u, self.width), cell(v, self.height));
        GridPosition { x, y, s, t }
    }

    fn value(&self, x: usize, y: usize) -> f64 {
        f64::from(self.data[y * self.width + x])
    }

    fn bilinear(&self, p: GridPosition) -> f64 {
        let row = |y| self.value(p.x, y) * (1.0 - p.s) + self.value(p.x + 1, y) * p.s;
        row(p.y) * (1.0 - p.t) + row(p.y + 1) * p.t
    }

    fn at(&self, u: f64, v: f64) -> f64 {
        self.bilinear(self.place(u, v))
    }
}

/// The density of visible normals at one theta_i and its running integrals: along u in each row, then along v.
struct Density {
    width: usize,
    height: usize,
    values: Vec<f64>,
    /// Integral of each row up to each column, in patch widths.
    along: Vec<f64>,
    /// Integral up to each row, in patch areas.
    down: Vec<f64>,
}

impl Density {
    /// Scales the values to an integral of one. `None` if all are zero.
    fn new(grid: Grid<'_>) -> Option<Density> {
        let (width, height) = (grid.width, grid.height);
        let mut values: Vec<f64> = grid.data.iter().map(|&v| f64::from(v).max(0.0)).collect();
        let mut along = vec![0.0; width * height];
        for y in 0..height {
            for x in 1..width {
                let i = y * width + x;
                along[i] = along[i - 1] + 0.5 * (values[i - 1] + values[i]);
            }
        }
        let mut down = vec![0.0; height];
        for y in 1..height {
            down[y] = down[y - 1] + 0.5 * (along[y * width - 1] + along[(y + 1) * width - 1]);
        }
        let total = down[height - 1];
        if total <= 0.0 {
            return None;
        }
        values.iter_mut().chain(&mut along).chain(&mut down).for_each(|v| *v /= total);
        Some(Density { width, height, values, along, down })
    }
}

/// The tables of a file, ready for lookups.
struct Measured {
    theta_i: Vec<f64>,
    ndf: Tensor,
    sigma: Tensor,
    densities: Vec<Density>,
    /// For each theta_i, three tables over the unit square: red, green and blue.
    rgb: Vec<f32>,
    side: (usize, usize),
    factor_outside: bool,
}

impl Measured {
    fn new(file: &TensorFile<'_>) -> Result<Measured, DocumentError> {
        let theta_i: Vec<f64> = file.tensor("theta_i", 1)?.data.iter().map(|&v| f64::from(v)).collect();
        if theta_i.windows(2).any(|w| w[0] >= w[1]) || theta_i.iter().any(|t| !(-0.01..=1.6).contains(t)) {
            return Err(file.wrong("theta_i", "expected ascending angles from 0 to pi/2 radians".into()));
        }
        let turns = file.tensor("phi_i", 1)?.shape[0];
        if turns > 2 {
            let problem =
                format!("{turns} azimuths: a half-angle curve cannot represent an anisotropic material");
            return Err(file.wrong("phi_i", problem));
        }
        let table = |name: &str| {
            let table = file.tensor(name, 2)?;
            match table.shape[..] {
                [h, w] if h >= 2 && w >= 2 => Ok(table),
                _ => {
                    Err(file.wrong(name, format!("expected at least 2 x 2 values, found {:?}", table.shape)))
                }
            }
        };
        let (ndf, sigma) = (table("ndf")?, table("sigma")?);
        let vndf = file.tensor("vndf", 4)?;
        let [p, n, h, w] = vndf.shape[..] else {
            return Err(file.wrong("vndf", "expected four dimensions".into()));
        };
        if p != turns || n != theta_i.len() || h < 2 || w < 2 {
            let problem = format!(
                "expected {turns} x {} tables of at least 2 x 2, found {:?}",
                theta_i.len(),
                vndf.shape
            );
            return Err(file.wrong("vndf", problem));
        }
        let densities = vndf.data[..n * h * w]
            .chunks_exact(h * w)
            .map(|data| {
                Density::new(Grid { width: w, height: h, data }).ok_or_else(|| {
                    file.wrong("vndf", "the density of visible normals is zero everywhere".into())
                })
            })
            .collect::<Result<_, _>>()?;
        let (rgb, side) = colours(file, turns, n)?;
        // Early files lack the field; they all store the quotient.
        let factor_outside = !file.has("jacobian") || file.tensor("jacobian", 1)?.data[0] != 0.0;
        Ok(Measured { theta_i, ndf, sigma, densities, rgb, side, factor_outside })
    }

    /// Reflectance in 1/sr; `None` beyond the measured angles.
    fn reflectance(&self, wi: average::Direction, wo: average::Direction) -> Option<[f64; 3]> {
        let theta_i = wi[2].clamp(-1.0, 1.0).arccosine();
        let last = *self.theta_i.last()?;
        if theta_i > last.max(1e-6) + 1e-6 && self.theta_i.len() > 1 {
            return None;
        }
        let m: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let theta_m = (m[0] * m[0] + m[1] * m[1]).sqrt().arctangent2(m[2]);
        let phi = m[1].arctangent2(m[0]) - wi[1].arctangent2(wi[0]);
        let u = (2.0 * theta_m / PI).sqrt();
        let v = (phi + PI) / (2.0 * PI);
        let v = v - v.floor();

        let above = self.theta_i.partition_point(|&t| t <= theta_i).clamp(1, self.theta_i.len().max(2) - 1);
        let (below, above) = (above - 1, above.min(self.theta_i.len() - 1));
        let span = self.theta_i[above] - self.theta_i[below];
        let s = if span > 0.0 { ((theta_i - self.theta_i[below]) / span).clamp(0.0, 1.0) } else { 0.0 };
        let (x, y) = self.invert(below, above, s, u, v)?;

        let (h, w) = self.side;
        let scale = if self.factor_outside {
            let grid =
                |t: &Tensor, u, v| Grid { width: t.shape[1], height: t.shape[0], data: &t.data }.at(u, v);
            let phi_i = wi[1].arctangent2(wi[0]);
            let sigma = grid(&self.sigma, (2.0 * theta_i / PI).sqrt(), (phi_i + PI) / (2.0 * PI));
            if sigma <= 0.0 {
                return None;
            }
            grid(&self.ndf, u, v) / (4.0 * sigma)
        } else {
            1.0
        };
        let place = Grid { width: w, height: h, data: &self.rgb }.place(x, y);
        Some(std::array::from_fn(|c| {
            let table = |n: usize| {
                Grid { width: w, height: h, data: &self.rgb[(3 * n + c) * h * w..][..h * w] }.bilinear(place)
            };
            let value = table(below) * (1.0 - s) + table(above) * s;
            (value * scale / wo[2]).max(0.0)
        }))
    }

    /// The sample that the warp of visible normals maps to (u, v): the inverse of bilinear-patch sampling, with all tables
    /// interpolated between two theta_i.
    fn invert(&self, below: usize, above: usize, s: f64, u: f64, v: f64) -> Option<(f64, f64)> {
        let (a, b) = (&self.densities[below], &self.densities[above]);
        let (w, h) = (a.width, a.height);
        let at = |f: fn(&Density) -> &[f64], i: usize| f(a)[i] * (1.0 - s) + f(b)[i] * s;
        let value = |i| at(|d| &d.values, i);
        let along = |i| at(|d| &d.along, i);
        let down = |i| at(|d| &d.down, i);
        let GridPosition { x, y, s: fx, t: fy } = Grid { width: w, height: h, data: &[] }.place(u, v);
        let i = y * w + x;
        // Density along u at this v, at the two ends of the patch.
        let left = value(i) * (1.0 - fy) + value(i + w) * fy;
        let right = value(i + 1) * (1.0 - fy) + value(i + w + 1) * fy;
        let before = along(i) * (1.0 - fy) + along(i + w) * fy;
        let (row, next) = (along((y + 1) * w - 1), along((y + 2) * w - 1));
        let whole = row * (1.0 - fy) + next * fy;
        if whole <= 0.0 {
            return None;
        }
        let sample_u = (before + fx * (left + 0.5 * fx * (right - left))) / whole;
        let sample_v = down(y) + fy * (row + 0.5 * fy * (next - row));
        Some((sample_u, sample_v))
    }
}

/// The colour tables, `[theta_i][3][y][x]`, with their height and width.
fn colours(
    file: &TensorFile<'_>,
    turns: usize,
    n: usize,
) -> Result<(Vec<f32>, (usize, usize)), DocumentError> {
    let name = if file.has("rgb") { "rgb" } else { "spectra" };
    let tables = file.tensor(name, 5)?;
    let [p, found, layers, h, w] = tables.shape[..] else {
        return Err(file.wrong(name, "expected five dimensions".into()));
    };
    if p != turns || found != n || h < 2 || w < 2 {
        let problem =
            format!("expected {turns} x {n} colour tables of at least 2 x 2, found {:?}", tables.shape);
        return Err(file.wrong(name, problem));
    }
    let size = h * w;
    if name == "rgb" {
        return match layers {
            3 => Ok((tables.data[..n * 3 * size].to_vec(), (h, w))),
            _ => Err(file.wrong(name, format!("expected 3 colours, found {layers}"))),
        };
    }
    let wavelengths = file.tensor("wavelengths", 1)?.data;
    if wavelengths.len() != layers {
        let problem = format!(
            "{} wavelengths for {layers} layers of spectra; expected equal numbers",
            wavelengths.len()
        );
        return Err(file.wrong("wavelengths", problem));
    }
    let Some(weights) = spectrum::rgb_weights(&wavelengths) else {
        return Err(file
            .wrong("wavelengths", "expected ascending wavelengths that cover 430 to 650 nanometres".into()));
    };
    let mut rgb = vec![0.0f32; n * 3 * size];
    for i in 0..n {
        for (layer, weights) in weights.iter().enumerate() {
            let from = &tables.data[(i * layers + layer) * size..][..size];
            for (c, &weight) in weights.iter().enumerate() {
                for (out, &v) in rgb[(3 * i + c) * size..][..size].iter_mut().zip(from) {
                    *out += weight as f32 * v;
                }
            }
        }
    }
    Ok((rgb, (h, w)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Writes a tensor file of single-precision fields.
    pub fn tensor_file(fields: &[(&str, Vec<usize>, Vec<f32>)]) -> Vec<u8> {
        let mut header = b"tensor_file\0\x01\x00".to_vec();
        header.extend((fields.len() as u32).to_le_bytes());
        let length: usize = 18 + fields.iter().map(|(n, s, _)| 13 + n.len() + 8 * s.len()).sum::<usize>();
        let mut body = Vec::new();
        for (name, shape, data) in fields {
            header.extend((name.len() as u16).to_le_bytes());
            header.extend(name.as_bytes());
            header.extend((shape.len() as u16).to_le_bytes());
            header.push(10);
            header.extend(((length + body.len()) as u64).to_le_bytes());
            shape.iter().for_each(|&d| header.extend((d as u64).to_le_bytes()));
            data.iter().for_each(|v| body.extend(v.to_le_bytes()));
        }
        assert_eq!(header.len(), length);
        header.extend(body);
        header
    }

    const ALPHA: f64 = 0.35;
    const F0: [f64; 3] = [0.9, 0.6, 0.3];

    fn theta(u: f64) -> f64 {
        u * u * FRAC_PI_2
    }

    /// A synthetic file: GGX facets, and a made-up visible density `1 + 3 u` whose warp has the closed form
    /// `x = (u + 1.5 u^2) / 2.5`, so that every table is filled from formulas.
    fn synthetic(spectral: bool) -> Vec<u8> {
        let (n, side) = (9usize, 64usize);
        let thetas: Vec<f32> = (0..n).map(|i| (i as f64 / (n - 1) as f64 * 1.5) as f32).collect();
        let grid = |h: usize, w: usize, f: &dyn Fn(f64, f64) -> f64| -> Vec<f32> {
            (0..h * w)
                .map(|i| f((i % w) as f64 / (w - 1) as f64, (i / w) as f64 / (h - 1) as f64) as f32)
                .collect()
        };
        let ndf = grid(2, 600, &|u, _| inks::ggx::distribution(theta(u).cosine(), ALPHA));
        // The projected area of Smith's GGX facets, cos / G1.
        let area = |t: f64| 0.5 * t.cosine() * (1.0 + (1.0 + (ALPHA * t.tangent()).squared()).sqrt());
        let sigma = grid(2, 600, &|u, _| area(theta(u).min(1.55)));
        let mut vndf = Vec::new();
        for _ in 0..n {
            vndf.extend(grid(side, side, &|u, _| 1.0 + 3.0 * u));
        }
        // Reflectance times cosine over ndf / (4 sigma): f0 times a slope in u, to see the warp work.
        let table = grid(side, side, &|x, _| {
            let u = (-1.0 + (1.0 + 15.0 * x).sqrt()) / 3.0;
            1.0 - 0.5 * u
        });
        let layers = if spectral { 24 } else { 3 };
        let mut colours = Vec::new();
        for _ in 0..n {
            for level in if spectral { vec![0.7; layers] } else { F0.to_vec() } {
                colours.extend(table.iter().map(|v| v * level as f32));
            }
        }
        let mut fields = vec![
            ("theta_i", vec![n], thetas),
            ("phi_i", vec![1], vec![0.0]),
            ("ndf", vec![2, 600], ndf),
            ("sigma", vec![2, 600], sigma),
            ("vndf", vec![1, n, side, side], vndf),
            (if spectral { "spectra" } else { "rgb" }, vec![1, n, layers, side, side], colours),
        ];
        if spectral {
            fields.push(("wavelengths", vec![24], (0..24).map(|i| 380.0 + 15.0 * i as f32).collect()));
        }
        tensor_file(&fields)
    }

    /// The same average over the closed form.
    fn expected(level: [f64; 3]) -> inks::Curve {
        let theta_h: Vec<f64> = (0..THETA_H).map(|i| theta((i as f64 + 0.5) / THETA_H as f64)).collect();
        average::curve(&theta_h, CELLS.0, CELLS.1, |[h, ..], wi, wo| {
            let t = wi[2].arccosine();
            let area = 0.5 * t.cosine() * (1.0 + (1.0 + (ALPHA * t.tangent()).squared()).sqrt());
            let u = (2.0 * theta_h[h] / PI).sqrt();
            let d = inks::ggx::distribution(theta_h[h].cosine(), ALPHA);
            (t <= 1.5).then(|| level.map(|f0| f0 * (1.0 - 0.5 * u) * d / (4.0 * area * wo[2])))
        })
        .unwrap()
    }

    fn check(bytes: &[u8], level: [f64; 3]) {
        let found = parse(bytes, Path::new("x.bsdf")).unwrap();
        let expected = expected(level);
        for &t in found.theta().iter().filter(|t| t.to_degrees() < 75.0) {
            for c in 0..3 {
                let (a, b) = (found.at(t)[c], expected.at(t)[c]);
                assert!((a / b - 1.0).abs() < 0.01, "{} degrees: {a} {b}", t.to_degrees());
            }
        }
    }

    #[test]
    fn tables_made_from_a_closed_form_give_it_back() {
        check(&synthetic(false), F0);
    }

    #[test]
    fn a_flat_spectrum_is_grey() {
        check(&synthetic(true), [0.7; 3]);
    }

    #[test]
    fn damage_is_named() {
        let good = synthetic(false);
        let says = |bytes: &[u8], text: &str| {
            let error = parse(bytes, Path::new("x.bsdf")).unwrap_err().to_string();
            assert!(error.contains("x.bsdf") && error.contains(text), "{error}");
        };
        says(&good[..10], "ends at byte 10");
        says(&good[..good.len() - 4], "does not fit in the file");
        says(b"something else entirely", "tensor_file");
        let mut anisotropic =
            tensor_file(&[("theta_i", vec![1], vec![0.0]), ("phi_i", vec![3], vec![0.0; 3])]);
        says(&anisotropic, "anisotropic");
        anisotropic.truncate(17);
        says(&anisotropic, "ends at byte 17");
        says(&tensor_file(&[("theta_i", vec![2], vec![0.0, f32::NAN])]), "theta_i: value 1 is NaN");
    }
}
