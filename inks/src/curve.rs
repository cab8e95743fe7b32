//! A measured or modelled BRDF as a curve over the half angle.
//!
//! Angles theta_h ascend from 0 to pi/2 (radians here, degrees in files); values are RGB reflectance in 1/sr,
//! linear Rec. 709 primaries. The curve is linear in theta between angles and constant outside them.
//! File form: CSV with the header `theta_h_deg,r,g,b`.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// The most rows in a curve file: far more than any measurement has, few enough for hostile files.
const MOST_SAMPLES: usize = 65_536;

/// Reflectance in 1/sr over the half angle. See the module documentation for units and interpolation.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    theta: Vec<f64>,
    rgb: Vec<[f64; 3]>,
}

/// Why some numbers are not a curve.
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
    /// Reading or writing failed.
    #[error("{}: cannot be read or written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The file is not CSV with the expected columns.
    #[error(
        "{}: line {line}: {problem}; expected the header `theta_h_deg,r,g,b` and four numbers per line",
        path.display()
    )]
    Csv {
        /// The file.
        path: PathBuf,
        /// Line, counted from one; 0 for the file as a whole.
        line: u64,
        /// What is wrong.
        problem: String,
    },
    /// A sample is invalid.
    #[error("sample {sample}: {problem}")]
    Sample {
        /// Sample, counted from zero.
        sample: usize,
        /// What is wrong.
        problem: String,
    },
}

#[derive(Serialize, Deserialize)]
struct CsvRow {
    theta_h_deg: f64,
    r: f64,
    g: f64,
    b: f64,
}

impl Curve {
    /// A curve from angles (radians, ascending, within 0..=pi/2) and values (1/sr, finite, not negative).
    pub fn new(theta: Vec<f64>, rgb: Vec<[f64; 3]>) -> Result<Curve, CurveError> {
        let wrong = |sample, problem: String| Err(CurveError::Sample { sample, problem });
        if theta.is_empty() || theta.len() != rgb.len() || theta.len() > MOST_SAMPLES {
            return wrong(
                0,
                format!(
                    "{} angles and {} values; expected equal numbers, 1 to {MOST_SAMPLES}",
                    theta.len(),
                    rgb.len()
                ),
            );
        }
        for (i, (&t, value)) in theta.iter().zip(&rgb).enumerate() {
            if !(t.is_finite() && (-1e-9..=FRAC_PI_2 + 1e-6).contains(&t)) {
                return wrong(i, format!("angle {} degrees is outside 0 to 90", t.to_degrees()));
            }
            if i > 0 && t <= theta[i - 1] {
                return wrong(i, format!("angle {} degrees does not ascend", t.to_degrees()));
            }
            if let Some(v) = value.iter().find(|v| !v.is_finite() || **v < 0.0) {
                return wrong(i, format!("value {v} is not a finite reflectance of 0 or more"));
            }
        }
        Ok(Curve { theta, rgb })
    }

    /// Samples `f` at the given angles (radians). Never panics; negative and non-finite results count as 0.
    pub fn sampled(theta: &[f64], mut f: impl FnMut(f64) -> [f64; 3]) -> Curve {
        let clean = |v: f64| if v.is_finite() { v.max(0.0) } else { 0.0 };
        Curve { theta: theta.to_vec(), rgb: theta.iter().map(|&t| f(t).map(clean)).collect() }
    }

    /// Angles in radians, ascending.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Values in 1/sr, one per angle.
    pub fn rgb(&self) -> &[[f64; 3]] {
        &self.rgb
    }

    /// The value at an angle in radians: linear between samples, constant outside.
    pub fn at(&self, theta: f64) -> [f64; 3] {
        let above = self.theta.partition_point(|&t| t <= theta);
        if above == 0 {
            return self.rgb[0];
        }
        if above == self.theta.len() {
            return self.rgb[above - 1];
        }
        let (t0, t1) = (self.theta[above - 1], self.theta[above]);
        let s = (theta - t0) / (t1 - t0);
        std::array::from_fn(|c| self.rgb[above - 1][c] * (1.0 - s) + self.rgb[above][c] * s)
    }

    /// Reads the CSV form.
    pub fn read_csv(path: &Path) -> Result<Curve, CurveError> {
        let file = std::fs::File::open(path)
            .map_err(|source| CurveError::Io { path: path.to_path_buf(), source })?;
        Curve::from_csv(std::io::BufReader::new(file), path)
    }

    /// Reads the CSV form from any input; `path` is used only in errors.
    pub fn from_csv(input: impl std::io::Read, path: &Path) -> Result<Curve, CurveError> {
        let wrong = |line, problem: String| CurveError::Csv { path: path.to_path_buf(), line, problem };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(input);
        let (mut theta, mut rgb) = (Vec::new(), Vec::new());
        for row in reader.deserialize::<CsvRow>() {
            let row = row.map_err(|error| {
                let line = error.position().map_or(1, csv::Position::line);
                wrong(line, error.to_string())
            })?;
            if theta.len() == MOST_SAMPLES {
                return Err(wrong(theta.len() as u64 + 2, format!("more than {MOST_SAMPLES} samples")));
            }
            theta.push(row.theta_h_deg.to_radians());
            rgb.push([row.r, row.g, row.b]);
        }
        Curve::new(theta, rgb).map_err(|error| match error {
            CurveError::Sample { sample, problem } => wrong(sample as u64 + 2, problem),
            other => other,
        })
    }

    /// Writes the CSV form.
    pub fn to_csv(&self, output: impl std::io::Write) -> csv::Result<()> {
        let mut writer = csv::Writer::from_writer(output);
        for (t, &[r, g, b]) in self.theta.iter().zip(&self.rgb) {
            writer.serialize(CsvRow { theta_h_deg: t.to_degrees(), r, g, b })?;
        }
        writer.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_linear_between_angles_and_constant_outside() {
        let curve = Curve::new(vec![0.1, 0.3], vec![[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]]).unwrap();
        assert_eq!(curve.at(0.0), [1.0, 2.0, 3.0]);
        assert_eq!(curve.at(1.5), [3.0, 2.0, 1.0]);
        let middle = curve.at(0.2);
        assert!((middle[0] - 2.0).abs() < 1e-12 && (middle[2] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn csv_gives_back_the_curve() {
        let curve = Curve::sampled(&[0.0, 0.2, 0.7, 1.5], |t| [t, 1.0 / (0.1 + t), 0.25]);
        let mut text = Vec::new();
        curve.to_csv(&mut text).unwrap();
        let again = Curve::from_csv(&text[..], Path::new("curve.csv")).unwrap();
        for (a, b) in curve.theta().iter().zip(again.theta()) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(curve.rgb(), again.rgb());
    }

    #[test]
    fn errors_name_file_and_line() {
        let text = "theta_h_deg,r,g,b\n0,1,1,1\n5,1,nan,1\n";
        let error = Curve::from_csv(text.as_bytes(), Path::new("bad.csv")).unwrap_err().to_string();
        assert!(error.contains("bad.csv") && error.contains("line 3"), "{error}");
        let text = "theta_h_deg,r,g,b\n5,1,1,1\n5,1,1,1\n";
        let error = Curve::from_csv(text.as_bytes(), Path::new("bad.csv")).unwrap_err().to_string();
        assert!(error.contains("line 3") && error.contains("ascend"), "{error}");
    }
}
