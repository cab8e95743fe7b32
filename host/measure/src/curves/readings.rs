//! A curve from a gloss meter and a spectrophotometer.
//!
//! Problem: these instruments give a few numbers, not a curve; the numbers are better than none.
//! Method: one GGX lobe on a diffuse body. CIELAB at 45 degrees with the eye at the normal is the
//! reflectance at a half angle of 22.5 degrees; the body is what the lobe leaves of it there. The width of
//! the lobe is the one that reads the same gloss ([`inks::gloss`]). Samples carry the standard deviation
//! that follows from a unit of CIELAB and from how well the readings agree. Cost: some hundred gloss
//! integrals, milliseconds.
//! Limits: the shape is assumed, so such a curve is predicted, not measured. Spectrophotometers with a
//! sphere include the gloss; their values are too light. Metal needs its reflectance from elsewhere: gloss
//! cannot tell it from the width.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_8, PI};
use std::path::Path;

use inks::gloss::{self, Geometry, Width};
use inks::{Curve, Lobe, Lobes, ggx};
use serde::Deserialize;

use crate::MeasureError;

/// The largest file of readings, in bytes: people write them by hand; few enough for hostile files.
const MOST_BYTES: u64 = 1 << 16;
/// Samples of the curve: enough that a cubic between them is exact to far below the readings' error.
const SAMPLES: u32 = 96;
/// The uncertainty of the body, as a share: a unit of CIELAB.
const BODY: f64 = 0.03;
/// Reflectance at normal incidence of a clear surface: index 1.5, as varnish has. Source: Fresnel's equation,
/// ((1.5 - 1) / (1.5 + 1))^2.
const CLEAR: f64 = 0.04;
/// The share of light that the surface takes before it reaches the body, as in the model of the library.
const INTERFACE: f64 = 0.04;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    lab: [f64; 3],
    f0: Option<F0>,
    gloss_20: Option<f64>,
    gloss_60: Option<f64>,
    gloss_85: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum F0 {
    Grey(f64),
    Colour([f64; 3]),
}

/// The curve of a stack from readings.
#[derive(Clone, Debug, PartialEq)]
pub struct FromReadings {
    /// The curve.
    pub curve: Curve,
    /// The standard deviation of each sample, in 1/sr.
    pub sigma: Vec<[f64; 3]>,
    /// The width of the lobe.
    pub width: Width,
    /// What was read, in words, for the provenance.
    pub words: String,
}

/// Reads a file of readings: `format = 1`, `lab`, at least one of `gloss_20`, `gloss_60` and `gloss_85`,
/// and `f0` for metals.
///
/// # Errors
/// Files that cannot be read, unknown keys, and readings out of range.
pub fn read(path: &Path) -> Result<FromReadings, MeasureError> {
    let io = |source| MeasureError::Io { path: path.to_path_buf(), source };
    let found = std::fs::metadata(path).map_err(io)?;
    if !found.is_file() {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    let length = found.len();
    if length > MOST_BYTES {
        return Err(wrong(path, format!("{length} bytes; a file of readings has at most {MOST_BYTES}")));
    }
    parse(&std::fs::read_to_string(path).map_err(io)?, path)
}

fn wrong(path: &Path, problem: String) -> MeasureError {
    MeasureError::Setup { path: path.to_path_buf(), problem }
}

fn parse(text: &str, path: &Path) -> Result<FromReadings, MeasureError> {
    let file: File = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count());
        wrong(path, format!("line {}: {}", line + 1, error.message()))
    })?;
    if file.format != 1 {
        return Err(wrong(path, format!("format: version {}; expected version 1", file.format)));
    }
    let [l, a, b] = file.lab;
    if !(0.0..=100.0).contains(&l) || ![a, b].iter().all(|v| (-150.0..=150.0).contains(v)) {
        return Err(wrong(
            path,
            format!("lab: {l}, {a}, {b}; expected L* of 0 to 100, a* and b* of -150 to 150"),
        ));
    }
    let f0 = match file.f0 {
        None => [CLEAR; 3],
        Some(F0::Grey(v)) => [v; 3],
        Some(F0::Colour(v)) => v,
    };
    if !f0.iter().all(|v| (0.001..=1.0).contains(v)) {
        return Err(wrong(path, format!("f0: {f0:?}; expected reflectances of 0.001 to 1")));
    }
    let mut readings = Vec::new();
    for (name, geometry, read) in [
        ("gloss_20", Geometry::TWENTY, file.gloss_20),
        ("gloss_60", Geometry::SIXTY, file.gloss_60),
        ("gloss_85", Geometry::EIGHTY_FIVE, file.gloss_85),
    ] {
        let Some(read) = read else { continue };
        if !(0.05..=2000.0).contains(&read) {
            return Err(wrong(path, format!("{name}: {read}; expected 0.05 to 2000 gloss units")));
        }
        readings.push((geometry, read));
    }
    let rgb = inks::lab::to_linear_rgb(file.lab).map(|v| v.max(0.0));
    // The body is what the lobe leaves of the reflectance at 22.5 degrees.
    let surface = |alpha: f64| {
        let lobe = Lobe { f0, alpha };
        let shape = ggx::lobe(FRAC_PI_8, alpha);
        let kd = std::array::from_fn(|c| (PI * (rgb[c] / PI - f0[c] * shape) / (1.0 - INTERFACE)).max(0.0));
        Lobes { kd, entering: 1.0 - INTERFACE, lobes: vec![lobe] }
    };
    let width = gloss::width(&readings, surface).ok_or_else(|| {
        wrong(path, "gloss_60: missing; give at least one of gloss_20, gloss_60 and gloss_85".into())
    })?;
    // Two deviations are half of what a reading may be off before it says something else.
    if width.misfit > 1.0 {
        let problem = format!(
            "the gloss readings do not belong together: the nearest lobe (alpha {:.3}) misses one by a factor of {:.1}; \
             for metal, give its reflectance as f0",
            width.alpha,
            width.misfit.exp()
        );
        return Err(wrong(path, problem));
    }
    let theta: Vec<f64> =
        (0..SAMPLES).map(|n| FRAC_PI_2 * (f64::from(n) / f64::from(SAMPLES)).powi(2)).collect();
    let lobes = surface(width.alpha);
    let curve = lobes.curve(&theta);
    let by = width.uncertainty.min(1.0);
    let (wider, narrower) = (
        surface((width.alpha * by.exp()).min(1.0)).curve(&theta),
        surface(width.alpha * (-by).exp()).curve(&theta),
    );
    let sigma = (0..theta.len())
        .map(|k| {
            std::array::from_fn(|c| {
                let body = BODY * lobes.entering * lobes.kd[c] / PI;
                body.hypot(0.5 * (wider.rgb()[k][c] - narrower.rgb()[k][c]))
            })
        })
        .collect();
    let read: Vec<String> = readings
        .iter()
        .map(|(geometry, read)| format!("{read} GU at {} degrees", geometry.degrees))
        .collect();
    let words = format!(
        "{}, CIELAB {l}/{a}/{b}: one GGX lobe of alpha {:.4} (within {:.0} %) and F0 {:.2}, on a diffuse body",
        read.join(", "),
        width.alpha,
        100.0 * width.uncertainty,
        appearance::srgb::luminance(f0)
    );
    Ok(FromReadings { curve, sigma, width, words })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Result<FromReadings, String> {
        parse(text, Path::new("k.toml")).map_err(|error| error.to_string())
    }

    /// What the instruments would read of a curve gives that curve again.
    #[test]
    fn readings_of_a_known_surface_give_its_curve() {
        for (f0, alpha, kd) in [(0.04, 0.12, 0.6), (0.04, 0.3, 0.02), (0.85, 0.06, 0.01)] {
            let surface = Lobes { kd: [kd; 3], entering: 0.96, lobes: vec![Lobe { f0: [f0; 3], alpha }] };
            let seen = PI * surface.at(22.5f64.to_radians())[0];
            // L* of a grey, from the definition.
            let l = if seen > 216.0 / 24389.0 { 116.0 * seen.cbrt() - 16.0 } else { seen * 24389.0 / 27.0 };
            let read = |geometry| gloss::reading(geometry, &surface);
            let text = format!(
                "format = 1\nlab = [{l}, 0, 0]\nf0 = {f0}\ngloss_20 = {}\ngloss_60 = {}\ngloss_85 = {}\n",
                read(Geometry::TWENTY),
                read(Geometry::SIXTY),
                read(Geometry::EIGHTY_FIVE)
            );
            let found = file(&text).unwrap();
            assert!((found.width.alpha / alpha - 1.0).abs() < 0.01, "{found:?}");
            for (k, &t) in found.curve.theta().iter().enumerate().filter(|(_, t)| **t < 1.4) {
                let exact = surface.at(t);
                for c in 0..3 {
                    let off = (found.curve.rgb()[k][c] / exact[c] - 1.0).abs();
                    assert!(off < 0.04, "{f0} {alpha} at {t}: {} {}", found.curve.rgb()[k][c], exact[c]);
                }
            }
        }
    }

    /// The reflectance at 45/0 is that of the CIELAB values, whatever the gloss.
    #[test]
    fn the_colour_is_what_the_spectrophotometer_saw() {
        for gloss in [5.0, 40.0, 80.0] {
            let found = file(&format!("format = 1\nlab = [55, 10, 20]\ngloss_60 = {gloss}\n")).unwrap();
            let rgb = inks::lab::to_linear_rgb([55.0, 10.0, 20.0]);
            let seen = found.curve.at(22.5f64.to_radians());
            assert!((0..3).all(|c| (PI * seen[c] / rgb[c] - 1.0).abs() < 0.005), "{seen:?} {rgb:?}");
        }
    }

    #[test]
    fn the_readings_of_the_guide_are_readings() {
        let guide = include_str!("../../../../docs/measuring-inks.md");
        let example = guide.split("```toml readings\n").nth(1).unwrap().split("```").next().unwrap();
        let found = file(example).unwrap();
        assert!((0.1..0.14).contains(&found.width.alpha) && found.width.misfit < 0.15, "{:?}", found.width);
    }

    #[test]
    fn what_is_missing_or_impossible_is_named() {
        for (text, word) in [
            ("format = 1\nlab = [50, 0, 0]\n", "gloss_20, gloss_60 and gloss_85"),
            ("format = 1\ngloss_60 = 30\n", "lab"),
            ("format = 2\nlab = [50, 0, 0]\ngloss_60 = 30\n", "version 2"),
            ("format = 1\nlab = [150, 0, 0]\ngloss_60 = 30\n", "L* of 0 to 100"),
            ("format = 1\nlab = [50, 0, 0]\ngloss_60 = nan\n", "gloss_60"),
            ("format = 1\nlab = [50, 0, 0]\ngloss_60 = -1\n", "gloss_60"),
            ("format = 1\nlab = [50, 0, 0]\ngloss_45 = 30\n", "line 3: unknown field `gloss_45`"),
            ("format = 1\nlab = [50, 0, 0]\nf0 = 2\ngloss_60 = 30\n", "f0"),
            ("format = 1\nlab = [10, 0, 0]\ngloss_20 = 300\ngloss_60 = 250\n", "give its reflectance as f0"),
            ("", "missing field"),
            ("\u{0}", "k.toml"),
        ] {
            let said = file(text).unwrap_err();
            assert!(said.contains(word) && said.contains("k.toml"), "{text}: {said}");
        }
    }
}
