//! A measured or modelled BRDF as a curve over the half angle.
//!
//! Angles theta_h ascend from 0 to pi/2 (radians here, degrees in files); values are RGB reflectance in 1/sr,
//! linear Rec. 709 primaries. Between angles the curve is interpolated as [`Knots`] says; beyond the last one it is constant.
//! File form: CSV with the header `theta_h_deg,r,g,b`.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

mod knots;

pub use knots::{KnotPosition, Knots};

/// The most rows in a curve file: far more than any measurement has, few enough for hostile files.
const MOST_SAMPLES: usize = 65_536;

/// Reflectance in 1/sr over the half angle. See the module documentation for units and interpolation.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    knots: Knots,
    rgb: Vec<[f64; 3]>,
}

/// Why some numbers are not a curve.
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
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
        Ok(Curve { knots: Knots::new(theta), rgb })
    }

    /// Samples `f` at the given angles (radians). Never panics; negative and non-finite results count as 0.
    pub fn sampled(theta: &[f64], mut f: impl FnMut(f64) -> [f64; 3]) -> Curve {
        let clean = |v: f64| if v.is_finite() { v.max(0.0) } else { 0.0 };
        Curve { knots: Knots::new(theta.to_vec()), rgb: theta.iter().map(|&t| f(t).map(clean)).collect() }
    }

    /// Angles in radians, ascending.
    pub fn theta(&self) -> &[f64] {
        self.knots.theta()
    }

    /// Values in 1/sr, one per angle.
    pub fn rgb(&self) -> &[[f64; 3]] {
        &self.rgb
    }

    /// The value at an angle in radians. See [`Knots`] for values between samples.
    pub fn at(&self, theta: f64) -> [f64; 3] {
        let place = self.knots.place(theta);
        std::array::from_fn(|c| self.knots.value(place, |i| self.rgb[i][c]))
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
        for (t, &[r, g, b]) in self.theta().iter().zip(&self.rgb) {
            writer.serialize(CsvRow { theta_h_deg: t.to_degrees(), r, g, b })?;
        }
        writer.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Samples of the default grid: theta = (pi / 2) ((n + 1/2) / samples)^2.
    fn grid(samples: u32) -> Vec<f64> {
        (0..samples).map(|n| FRAC_PI_2 * ((f64::from(n) + 0.5) / f64::from(samples)).powi(2)).collect()
    }

    /// Half angle of the last but one of 32 samples, in degrees: from here on they are too far apart for what a lobe does.
    const LAST_BUT_ONE: f64 = 81.7;

    /// The largest relative error of 32 samples of `f` between two angles in degrees.
    fn error(f: impl Fn(f64) -> [f64; 3], from: f64, to: f64) -> f64 {
        let curve = Curve::sampled(&grid(32), &f);
        let mut most = 0.0f64;
        for step in 0..=20_000 {
            let t = FRAC_PI_2 * (f64::from(step) / 20_000.0).powi(2);
            if (from.to_radians()..=to.to_radians()).contains(&t) {
                for (found, exact) in curve.at(t).into_iter().zip(f(t)) {
                    most = most.max((found / exact - 1.0).abs());
                }
            }
        }
        most
    }

    /// Every stack of the built-in library, from 0 degrees to the last sample at 87.2.
    #[test]
    fn thirty_two_samples_are_every_modelled_stack() {
        let mut most = [0.0f64; 2];
        for entry in crate::Library::builtin().entries() {
            let lobes = entry.lobes.as_ref().unwrap();
            for (most, (from, to)) in most.iter_mut().zip([(0.0, LAST_BUT_ONE), (LAST_BUT_ONE, 87.2)]) {
                *most = most.max(error(|t| lobes.at(t), from, to));
            }
        }
        println!(
            "greatest error up to {LAST_BUT_ONE} degrees {:.5}, up to 87.2 degrees {:.5}",
            most[0], most[1]
        );
        assert!(most[0] < 0.005 && most[1] < 0.025, "{most:?}");
    }

    /// The narrowest lobe that a document can have, alone and on bodies from black to white.
    #[test]
    fn thirty_two_samples_are_the_narrowest_lobe_of_a_document() {
        let mut most = [0.0f64; 2];
        for (kd, f0) in
            [(0.0, 0.9), (0.01, 0.9), (0.1, 0.9), (0.002, 0.5), (0.02, 0.04), (0.3, 0.04), (0.8, 0.04)]
        {
            let f = |t| [kd / std::f64::consts::PI + f0 * crate::ggx::lobe(t, 0.02); 3];
            for (most, (from, to)) in most.iter_mut().zip([(0.0, LAST_BUT_ONE), (LAST_BUT_ONE, 87.2)]) {
                *most = most.max(error(f, from, to));
            }
        }
        println!(
            "greatest error up to {LAST_BUT_ONE} degrees {:.5}, up to 87.2 degrees {:.5}",
            most[0], most[1]
        );
        assert!(most[0] < 0.005 && most[1] < 0.025, "{most:?}");
    }

    /// Widths between those of the library, with other numbers of samples.
    #[test]
    fn more_samples_are_better() {
        let worst = |samples: u32| {
            let mut most = 0.0f64;
            for alpha in [0.02, 0.035, 0.06, 0.1, 0.2, 0.4, 0.8] {
                let f = |t| 0.1 + 0.5 * crate::ggx::lobe(t, alpha);
                let curve = Curve::sampled(&grid(samples), |t| [f(t); 3]);
                for step in 0..2000 {
                    let t = 80f64.to_radians() * (f64::from(step) / 2000.0).powi(2);
                    most = most.max((curve.at(t)[0] / f(t) - 1.0).abs());
                }
            }
            most
        };
        let errors = [16, 32, 64, 128].map(worst);
        assert!(errors.windows(2).all(|pair| pair[1] < 0.5 * pair[0]), "{errors:?}");
    }

    #[test]
    fn constant_curves_are_constant_and_samples_are_kept() {
        let flat = Curve::sampled(&grid(7), |_| [0.3, 0.0, 1e-9]);
        for step in 0..=900 {
            assert_eq!(flat.at(f64::from(step).to_radians() / 10.0), [0.3, 0.0, 1e-9]);
        }
        let curve = Curve::sampled(&grid(32), |t| [1.0 / (0.01 + t * t), t, 0.0]);
        for (&t, &value) in curve.theta().iter().zip(curve.rgb()) {
            assert_eq!(curve.at(t), value);
        }
        let one = Curve::new(vec![0.5], vec![[1.0, 2.0, 3.0]]).unwrap();
        assert_eq!([one.at(0.0), one.at(1.5)], [[1.0, 2.0, 3.0]; 2]);
    }

    /// Toward 0 degrees a curve goes on as an even function, and never by more than a third of its first step.
    #[test]
    fn the_peak_is_that_of_an_even_function() {
        let f = |t: f64| (-40.0 * t * t).exp();
        let curve = Curve::sampled(&[0.05, 0.15, 0.25, 0.4], |t| [f(t); 3]);
        assert!((curve.at(0.0)[0] - 1.0).abs() < 1e-12 && (curve.at(0.03)[0] - f(0.03)).abs() < 1e-12);
        let late = Curve::new(vec![0.7, 0.71, 0.8], vec![[0.2; 3], [0.1; 3], [0.05; 3]]).unwrap();
        assert!((late.at(0.0)[0] - 0.2 * 2f64.powf(1.0 / 3.0)).abs() < 1e-12);
    }

    /// Angles in ascending order, and samples over six decades with some exact zeros.
    fn noisy() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
        let value = prop_oneof![1 => Just(0.0), 9 => (-4.0f64..2.0).prop_map(|e| 10f64.powf(e))];
        prop::collection::vec((1e-6f64..1.0, value), 1..40).prop_map(|steps| {
            let total: f64 = steps.iter().map(|s| s.0).sum();
            let mut sum = 0.0;
            let angle = |s: &(f64, f64)| {
                sum += s.0;
                FRAC_PI_2 * sum / total
            };
            (steps.iter().map(angle).collect(), steps.iter().map(|s| s.1).collect())
        })
    }

    fn values(theta: &[f64], values: &[f64]) -> Curve {
        Curve::new(theta.to_vec(), values.iter().map(|&v| [v; 3]).collect()).unwrap()
    }

    proptest! {
        #[test]
        fn descending_samples_give_a_descending_curve((theta, mut samples) in noisy()) {
            samples.sort_by(|a, b| b.total_cmp(a));
            let curve = values(&theta, &samples);
            let mut last = f64::INFINITY;
            for step in 0..=2000 {
                let value = curve.at(FRAC_PI_2 * f64::from(step) / 2000.0)[0];
                prop_assert!(value >= 0.0 && value <= last * (1.0 + 1e-12), "{value} after {last}");
                last = value;
            }
        }

        /// Between two samples a curve of noise stays near them: 2/27 of the larger step beyond an extremum.
        #[test]
        fn noise_is_not_amplified((theta, samples) in noisy()) {
            let curve = values(&theta, &samples);
            let step = |i: usize| match samples.get(i..i + 2) {
                Some(&[a, b]) if a > 0.0 && b > 0.0 => (b / a).ln().abs(),
                _ => 0.0,
            };
            for i in 0..theta.len() - 1 {
                let (low, high) = (samples[i].min(samples[i + 1]), samples[i].max(samples[i + 1]));
                let beyond = (step(i.saturating_sub(1)).max(step(i)).max(step(i + 1)) * 2.0 / 27.0 + 1e-9).exp();
                for part in 1..20 {
                    let value = curve.at(theta[i] + (theta[i + 1] - theta[i]) * f64::from(part) / 20.0)[0];
                    prop_assert!(value >= low / beyond && value <= high * beyond, "{i}: {value} not {low}..{high}");
                }
            }
        }

        #[test]
        fn any_samples_give_reflectances(
            (theta, samples) in noisy(), angle in -0.1f64..2.0, scale in prop_oneof![Just(1e-300), Just(1e290)],
        ) {
            let samples: Vec<f64> = samples.iter().map(|v| v * scale).collect();
            let value = values(&theta, &samples).at(angle)[0];
            prop_assert!(value.is_finite() && value >= 0.0, "{value}");
        }
    }

    /// Angles that differ in their last digit only.
    #[test]
    fn angles_that_almost_agree_do_no_harm() {
        let near = |t: f64| f64::from_bits(t.to_bits() + 1);
        let theta =
            vec![-1e-9, 0.0, 1e-300, 0.5, near(0.5), near(near(0.5)), 1.2, FRAC_PI_2, near(FRAC_PI_2)];
        let curve = values(&theta, &[5.0, 4.0, 3.0, 1e-3, 7.0, 2.0, 0.0, 1.0, 2.0]);
        for step in 0..=1000 {
            let value = curve.at(f64::from(step) * 1.6e-3)[0];
            assert!((0.0..=8.0).contains(&value), "{value}");
        }
        for t in theta {
            assert!(curve.at(t)[0].is_finite());
        }
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
