//! The standard deviation of a measured curve, and how each of its samples was obtained.
//!
//! Problem: whether two curves differ can only be said beside what the measurement itself is uncertain by.
//! Method: columns of the curve's file beyond the four that every curve has: `r_sigma,g_sigma,b_sigma` in 1/sr, and `kind`.
//! Files without them are curves of unknown uncertainty. Cost: one more pass over the file.
//! Limits: deviations of neighbouring samples are correlated, which the file does not say.

use std::path::Path;

use serde::Deserialize;

use crate::curve::CurveError;

/// How a sample of a curve was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleKind {
    /// It was seen. Files without the column `kind` mean this.
    #[default]
    Measured,
    /// The peak is narrower than a pixel or the lamp: its height is a guess.
    Blurred,
    /// Brighter than the camera could record: at least this much.
    Clipped,
    /// From the samples beside it.
    Extrapolated,
    /// From other stacks, or from readings of gloss and colour.
    Predicted,
}

/// Standard deviations of a curve's samples, in 1/sr, at their half angles.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    theta: Vec<f64>,
    sigma: Vec<[f64; 3]>,
    kinds: Vec<SampleKind>,
}

#[derive(Deserialize)]
struct CsvRow {
    theta_h_deg: f64,
    r_sigma: Option<f64>,
    g_sigma: Option<f64>,
    b_sigma: Option<f64>,
    kind: Option<SampleKind>,
}

impl Uncertainty {
    /// Reads the columns of a curve's CSV text; `None` if it has no standard deviations. `path` is used only in errors.
    ///
    /// # Errors
    /// Deviations that are incomplete, negative or not numbers, and kinds that nobody knows.
    pub fn from_csv(text: &str, path: &Path) -> Result<Option<Uncertainty>, CurveError> {
        let wrong = |line, problem: String| CurveError::Csv { path: path.to_path_buf(), line, problem };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let mut found = Uncertainty { theta: Vec::new(), sigma: Vec::new(), kinds: Vec::new() };
        let mut without = 0;
        for row in reader.deserialize::<CsvRow>() {
            let row = row
                .map_err(|error| wrong(error.position().map_or(1, csv::Position::line), error.to_string()))?;
            let line = found.theta.len() as u64 + without + 2;
            match [row.r_sigma, row.g_sigma, row.b_sigma] {
                [None, None, None] => without += 1,
                [Some(r), Some(g), Some(b)] if [r, g, b].iter().all(|s| s.is_finite() && *s >= 0.0) => {
                    found.theta.push(row.theta_h_deg.to_radians());
                    found.sigma.push([r, g, b]);
                    found.kinds.push(row.kind.unwrap_or_default());
                }
                _ => {
                    let problem = "r_sigma, g_sigma and b_sigma need each other, as numbers of 0 or more";
                    return Err(wrong(line, problem.into()));
                }
            }
        }
        match (found.theta.is_empty(), without) {
            (true, _) => Ok(None),
            (false, 0) => Ok(Some(found)),
            _ => Err(wrong(0, "some rows have standard deviations and others have none".into())),
        }
    }

    /// Half angles of the samples in radians, ascending.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Standard deviation of each sample, in 1/sr.
    pub fn sigma(&self) -> &[[f64; 3]] {
        &self.sigma
    }

    /// How each sample was obtained.
    pub fn kinds(&self) -> &[SampleKind] {
        &self.kinds
    }

    /// The standard deviation at an angle in radians: linear between samples, constant beyond them.
    pub fn at(&self, theta: f64) -> [f64; 3] {
        let above = self.theta.partition_point(|&t| t < theta);
        if above == 0 || above == self.theta.len() {
            return self.sigma[above.min(self.theta.len() - 1)];
        }
        let (low, high) = (self.theta[above - 1], self.theta[above]);
        let part = (theta - low) / (high - low);
        std::array::from_fn(|c| self.sigma[above - 1][c] * (1.0 - part) + self.sigma[above][c] * part)
    }

    /// Whether the samples on both sides of an angle in radians were seen, or predicted.
    pub fn is_measured(&self, theta: f64) -> bool {
        let above = self.theta.partition_point(|&t| t < theta);
        let inside = above < self.theta.len() && (above > 0 || self.theta[0] == theta);
        let seen = |i: usize| matches!(self.kinds[i], SampleKind::Measured | SampleKind::Predicted);
        inside && seen(above) && (above == 0 || self.theta[above] == theta || seen(above - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma,pixels,kind\n\
        0,9,9,9,1,2,3,5,extrapolated\n2,5,5,5,0.5,0.5,0.5,5,measured\n4,3,3,3,0.1,0.3,0.5,5,measured\n90,1,1,1,0.1,0.1,0.1,0,clipped\n";

    fn read(text: &str) -> Result<Option<Uncertainty>, CurveError> {
        Uncertainty::from_csv(text, Path::new("ms.csv"))
    }

    #[test]
    fn deviations_lie_between_their_neighbours() {
        let some = read(TEXT).unwrap().unwrap();
        let near = |degrees: f64, expected: [f64; 3]| {
            let found = some.at(degrees.to_radians());
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{degrees}: {found:?}");
        };
        near(-1.0, [1.0, 2.0, 3.0]);
        near(1.0, [0.75, 1.25, 1.75]);
        near(3.0, [0.3, 0.4, 0.5]);
        near(91.0, [0.1; 3]);
        for (degrees, seen) in
            [(0.0, false), (1.0, false), (2.0, true), (3.0, true), (4.0, true), (5.0, false)]
        {
            assert_eq!(some.is_measured(f64::to_radians(degrees)), seen, "{degrees}");
        }
    }

    #[test]
    fn files_without_deviations_have_none_and_half_of_them_are_refused() {
        assert_eq!(read("theta_h_deg,r,g,b\n0,1,1,1\n").unwrap(), None);
        for (text, word) in [
            (TEXT.replace("0.5,0.5,0.5", "0.5,-0.5,0.5"), "line 3"),
            (TEXT.replace("0.5,0.5,0.5", "0.5,,0.5"), "line 3"),
            (TEXT.replace("0.5,0.5,0.5", ",,"), "others have none"),
            (TEXT.replace("clipped", "clapped"), "line 5"),
            (TEXT.replace("g_sigma", "g_sig"), "line 2"),
        ] {
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains("ms.csv") && error.contains(word), "{error}");
        }
    }
}
