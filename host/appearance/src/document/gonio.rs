//! Goniometer tables: pbrt's `.brdf` files of scattered isotropic measurements.
//!
//! Layout (text): numbers separated by space, `#` to the end of a line is a comment. The number of wavelengths, the wavelengths in nm,
//! then for each measurement theta and phi of the light, theta and phi of the eye (radians), and the reflectance at each wavelength in 1/sr.
//!
//! Method: the half angle of each measurement decides its cell on a square-root grid; a cell's value and angle are the means over its
//! measurements, weighted by `cos_i cos_o`. The difference angle runs over the same range as in [`super::average`]. Spectra become
//! RGB as in [`super::spectrum`].
//! Cost: one pass. Limits: how densely an instrument sampled decides what a cell averages; a table need not be even, so dependence
//! on the difference angle is lost unevenly. Cells without measurements are left out.

use maths::Maths;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use inks::Curve;

use super::average::THETA_D;
use super::content::Document;
use super::curve;
use super::error::DocumentError;
use super::source::Source;
use super::spectrum;
use crate::brdf::Space;

/// The largest file, in bytes: about three million measurements of three wavelengths.
pub(super) const MOST_BYTES: u64 = 1 << 28;
/// The most wavelengths: more than twice as many as a spectrum has from 380 to 780 nm in steps of 1 nm, so
/// that a hostile header asks for no more memory.
const MOST_WAVELENGTHS: usize = 1024;
/// Cells of the half angle.
const CELLS: usize = 64;

pub(super) fn open(path: &Path, space: Space, source: Source<'_>) -> Result<Document, DocumentError> {
    curve::averaged(path, space, source, MOST_BYTES, parse)
}

/// The half-angle curve of a file's bytes; `path` names it in errors.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Curve, DocumentError> {
    let wrong =
        |field: String, problem: String| DocumentError::Field { path: path.to_path_buf(), field, problem };
    let text = std::str::from_utf8(bytes)
        .map_err(|error| wrong("text".into(), format!("byte {} is not text", error.valid_up_to())))?;
    let mut numbers = Numbers::new(text);
    let mut next = |what: &str| -> Result<Option<f64>, DocumentError> {
        match numbers.next() {
            None => Ok(None),
            Some((_, Some(number))) => Ok(Some(number)),
            Some((line, None)) => {
                Err(wrong(format!("line {line}"), format!("not a finite number; expected {what}")))
            }
        }
    };
    let missing = |what: &str| wrong("end of file".into(), format!("{what} is missing"));
    let count = next("the number of wavelengths")?.ok_or_else(|| missing("the number of wavelengths"))?;
    if count.fract() != 0.0 || !(1.0..=MOST_WAVELENGTHS as f64).contains(&count) {
        let problem = format!("{count}; expected a whole number of 1 to {MOST_WAVELENGTHS}");
        return Err(wrong("number of wavelengths".into(), problem));
    }
    let count = count as usize;
    let mut wavelengths = Vec::with_capacity(count);
    for _ in 0..count {
        wavelengths.push(next("a wavelength")?.ok_or_else(|| missing("a wavelength"))? as f32);
    }
    let weights = spectrum::rgb_weights(&wavelengths).ok_or_else(|| {
        let problem = "expected ascending wavelengths that cover 430 to 650 nanometres";
        wrong("wavelengths".into(), problem.into())
    })?;
    let mut cells = vec![Cell::default(); CELLS];
    let mut row = 0u64;
    let mut values = vec![0.0; count];
    while let Some(theta_i) = next("an angle")? {
        row += 1;
        let mut angles = [theta_i, 0.0, 0.0, 0.0];
        for angle in &mut angles[1..] {
            *angle = next("an angle")?.ok_or_else(|| missing(&format!("an angle of measurement {row}")))?;
        }
        if [angles[0], angles[2]].iter().any(|t| !(-1e-6..=FRAC_PI_2 + 1e-3).contains(t)) {
            let problem = format!(
                "theta {} and {}; expected angles from the normal of 0 to pi/2 radians",
                angles[0], angles[2]
            );
            return Err(wrong(format!("measurement {row}"), problem));
        }
        for value in &mut values {
            *value = next("a reflectance")?
                .ok_or_else(|| missing(&format!("a reflectance of measurement {row}")))?;
        }
        let rgb = std::array::from_fn(|c| values.iter().zip(&weights).map(|(v, w)| v * w[c]).sum());
        if let Some((cell, weight, theta_h)) = placed(angles) {
            cells[cell].add(weight, theta_h, rgb);
        }
    }
    let (theta, rgb): (Vec<f64>, Vec<[f64; 3]>) = cells.iter().filter_map(Cell::mean).unzip();
    Curve::new(theta, rgb).map_err(|_| {
        let problem =
            format!("none of {row} has a difference angle between 2.5 and 57.5 degrees above the surface");
        wrong("measurements".into(), problem)
    })
}

/// The numbers of a text, each with its line; no number where a word is not one.
struct Numbers<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    words: std::str::SplitWhitespace<'a>,
    line: usize,
}

impl<'a> Numbers<'a> {
    fn new(text: &'a str) -> Numbers<'a> {
        Numbers { lines: text.lines().enumerate(), words: "".split_whitespace(), line: 0 }
    }
}

impl Iterator for Numbers<'_> {
    type Item = (usize, Option<f64>);

    fn next(&mut self) -> Option<(usize, Option<f64>)> {
        loop {
            if let Some(word) = self.words.next() {
                let number = word.parse::<f64>().ok().filter(|v| v.is_finite());
                return Some((self.line, number));
            }
            let (index, line) = self.lines.next()?;
            self.line = index + 1;
            self.words = line.split('#').next().unwrap_or("").split_whitespace();
        }
    }
}

/// The measurements of a cell.
#[derive(Clone, Copy, Default)]
struct Cell {
    weight: f64,
    theta: f64,
    rgb: [f64; 3],
}

impl Cell {
    fn add(&mut self, weight: f64, theta_h: f64, rgb: [f64; 3]) {
        self.weight += weight;
        self.theta += weight * theta_h;
        (0..3).for_each(|c| self.rgb[c] += weight * rgb[c]);
    }

    /// Angle and value, if anything was measured. Noise below zero is none.
    fn mean(&self) -> Option<(f64, [f64; 3])> {
        (self.weight > 0.0).then(|| (self.theta / self.weight, self.rgb.map(|v| (v / self.weight).max(0.0))))
    }
}

/// Cell, weight and half angle of a measurement; `None` if it is not averaged.
fn placed([theta_i, phi_i, theta_o, phi_o]: [f64; 4]) -> Option<(usize, f64, f64)> {
    let direction =
        |theta: f64, phi: f64| [theta.sine() * phi.cosine(), theta.sine() * phi.sine(), theta.cosine()];
    let (wi, wo) = (direction(theta_i, phi_i), direction(theta_o, phi_o));
    let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let theta_h = sum[0].hypotenuse(sum[1]).arctangent2(sum[2]);
    let cos: f64 = wi.iter().zip(wo).map(|(a, b)| a * b).sum();
    let theta_d = 0.5 * cos.clamp(-1.0, 1.0).arccosine().to_degrees();
    let weight = wi[2] * wo[2];
    if !((THETA_D.0..=THETA_D.1).contains(&theta_d) && wi[2] > 0.0 && wo[2] > 0.0 && weight.is_finite()) {
        return None;
    }
    let cell = ((theta_h / FRAC_PI_2).clamp(0.0, 1.0).sqrt() * CELLS as f64) as usize;
    Some((cell.min(CELLS - 1), weight, theta_h))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A table over a goniometer's angles: light at 0 to 75 degrees, the eye all around.
    pub fn table(f: impl Fn(f64, f64) -> f64) -> String {
        let mut text = "# made by a test\n3 430 550 650 # nm\n".to_owned();
        for i in 0..16 {
            let theta_i = f64::from(i) * 5f64.to_radians();
            for o in 0..60 {
                let theta_o = f64::from(o) * 1.3f64.to_radians();
                for p in 0..12 {
                    let phi = f64::from(p) * 30f64.to_radians();
                    // The half angle by spherical trigonometry: another way than the reader's.
                    let cos_io =
                        theta_i.cosine() * theta_o.cosine() + theta_i.sine() * theta_o.sine() * phi.cosine();
                    let cos_h =
                        (theta_i.cosine() + theta_o.cosine()) / (2.0 + 2.0 * cos_io).max(1e-12).sqrt();
                    let v = f(cos_h.clamp(-1.0, 1.0).arccosine(), 0.5 * cos_io.clamp(-1.0, 1.0).arccosine());
                    text += &format!("{theta_i} 0.5 {theta_o} {} {v} {v} {v}\n", 0.5 + phi);
                }
            }
        }
        text
    }

    #[test]
    fn a_lambertian_table_is_a_flat_curve() {
        let curve = parse(table(|_, _| 0.18).as_bytes(), Path::new("x.brdf")).unwrap();
        assert!(curve.theta().len() > 40);
        for v in curve.rgb().iter().flatten() {
            assert!((v - 0.18).abs() < 1e-6, "{v}");
        }
    }

    #[test]
    fn a_lobe_comes_back() {
        let lobe = |t: f64| 0.05 + 0.3 * inks::ggx::lobe(t, 0.25);
        let curve = parse(table(|h, _| lobe(h)).as_bytes(), Path::new("x.brdf")).unwrap();
        for (&t, v) in curve.theta().iter().zip(curve.rgb()).filter(|(t, _)| **t < 1.0) {
            assert!((v[1] / lobe(t) - 1.0).abs() < 0.03, "{t}: {} {}", v[1], lobe(t));
        }
    }

    /// What the instrument cannot see well, close to its own light and at grazing pairs, does not count.
    #[test]
    fn extreme_difference_angles_are_left_out() {
        let f = |_: f64, d: f64| if (2.5..=57.5).contains(&d.to_degrees()) { 0.1 } else { 9.0 };
        let curve = parse(table(f).as_bytes(), Path::new("x.brdf")).unwrap();
        assert!(curve.rgb().iter().flatten().all(|v| (v - 0.1).abs() < 1e-6));
    }

    /// Red light is red: the wavelengths keep their order.
    #[test]
    fn wavelengths_become_colours() {
        let text = "3 430 550 650\n0.3 0 0.3 3.1415 0 0 1\n0.5 0 0.2 3.1415 0 0 1\n";
        let v = parse(text.as_bytes(), Path::new("x.brdf")).unwrap().rgb()[0];
        assert!(v[0] > 0.5 && v[1] < 0.3 && v[2] < 0.1, "{v:?}");
    }

    #[test]
    fn damage_is_named() {
        for (text, word) in [
            ("", "number of wavelengths is missing"),
            ("2.5 1 2", "number of wavelengths: 2.5"),
            ("1e9 450", "number of wavelengths: 1000000000"),
            ("-1", "number of wavelengths: -1"),
            ("3 450 550", "a wavelength is missing"),
            ("3 650 550 450", "ascending wavelengths"),
            ("3 500 550 600", "cover 430 to 650"),
            ("3 430 550 650\n0.1 0 0.2 0 1 1", "line 2"),
            ("3 430 550 650\n0.1 0 0.2 x 1 1 1", "line 2"),
            ("3 430 550 650\n0.1 0 0.2 0 1 inf 1", "line 2"),
            ("3 430 550 650\n0.1 0 2.2 0 1 1 1", "measurement 1: theta 0.1 and 2.2"),
            ("3 430 550 650\n# nothing\n", "none of 0"),
            ("3 430 550 650\n0 0 0 0 1 1 1", "none of 1"),
        ] {
            let said = parse(text.as_bytes(), Path::new("x.brdf")).unwrap_err().to_string();
            let known = said.contains(word) || (word == "line 2" && said.contains("is missing"));
            assert!(known && said.contains("x.brdf"), "{text}: {said}");
        }
        assert!(parse(&[51, 255, 10], Path::new("x.brdf")).unwrap_err().to_string().contains("byte 1"));
    }
}
