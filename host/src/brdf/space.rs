//! The tabulation every stage works in, and the perceptual metric on it.
//!
//! Problem: Euclidean distance on raw reflectance overweights highlights nobody notices.
//! Method: a BRDF is a row of columns j = 3 n + channel over configurations n. Each column carries the factor
//! c_j from reflectance to reflected radiance and the root W_j of its quadrature weight; the distance is
//! `d^2 = sum_j W_j^2 (cbrt(f_j c_j) - cbrt(f'_j c_j))^2`, eqs. 2-3 of the 2009 paper's appendix discretised.
//! Nothing but [`Space::half_angle`] knows what a configuration is, so any linear tabulation with its own
//! quadrature goes through the same code.
//! Cost: O(columns) a distance. Limits: values are clamped at 0; `g` is not additive, only reflectance is.

use std::f64::consts::FRAC_PI_2;

use inks::Curve;

/// What the columns of a tabulated BRDF mean. See the module text.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    radiance: Vec<f64>,
    weight: Vec<f64>,
    angles: Vec<f64>,
}

/// Why numbers do not make a tabulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpaceError {
    /// The lists differ in length or are empty.
    #[error("a tabulation needs as many cosines ({cosines}) as quadrature weights ({weights}), at least one")]
    Length {
        /// Number of cosines.
        cosines: usize,
        /// Number of weights.
        weights: usize,
    },
    /// A number is negative, infinite or not a number.
    #[error("configuration {sample}: cosine {cosine} and weight {weight} must be finite and not negative")]
    Value {
        /// Which configuration.
        sample: usize,
        /// Its cosine.
        cosine: f64,
        /// Its weight.
        weight: f64,
    },
}

impl Space {
    /// Half-angle curves on the square-root grid theta_n = (pi/2) u^2, u = (n + 1/2) / samples, with quadrature
    /// weight `dtheta_n sin theta_n cos theta_n`. At least one sample; 32 serve as well as 512 uniform ones.
    pub fn half_angle(samples: usize) -> Space {
        let samples = samples.max(1);
        let (mut cosine, mut measure, mut angles) = (Vec::new(), Vec::new(), Vec::new());
        for n in 0..samples {
            let u = (n as f64 + 0.5) / samples as f64;
            let theta = FRAC_PI_2 * u * u;
            let dtheta = FRAC_PI_2 * 2.0 * u / samples as f64;
            cosine.push(theta.cos());
            measure.push(dtheta * theta.sin() * theta.cos());
            angles.push(theta);
        }
        Space { angles, ..Space::interleave(&cosine, &measure) }
    }

    /// Any tabulation: for each configuration the factor from reflectance to reflected radiance (the cosine at
    /// the light) and the quadrature weight of that configuration in the picture the distance is taken on.
    pub fn tabulated(cosine: &[f64], measure: &[f64]) -> Result<Space, SpaceError> {
        if cosine.len() != measure.len() || cosine.is_empty() {
            return Err(SpaceError::Length { cosines: cosine.len(), weights: measure.len() });
        }
        for (sample, (&cosine, &weight)) in cosine.iter().zip(measure).enumerate() {
            if !(cosine.is_finite() && weight.is_finite() && cosine >= 0.0 && weight >= 0.0) {
                return Err(SpaceError::Value { sample, cosine, weight });
            }
        }
        Ok(Space::interleave(cosine, measure))
    }

    fn interleave(cosine: &[f64], measure: &[f64]) -> Space {
        Space {
            radiance: cosine.iter().flat_map(|&c| [c; 3]).collect(),
            weight: measure.iter().flat_map(|&m| [m.sqrt(); 3]).collect(),
            angles: Vec::new(),
        }
    }

    /// Number of columns, three for each configuration, interleaved R G B.
    pub fn columns(&self) -> usize {
        self.weight.len()
    }

    /// Per column: the factor c_j from reflectance to reflected radiance.
    pub fn radiance(&self) -> &[f64] {
        &self.radiance
    }

    /// Per column: the root W_j of the quadrature weight.
    pub fn weight(&self) -> &[f64] {
        &self.weight
    }

    /// The half angles in radians, one for each configuration; empty for other tabulations.
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// A curve as a row of this space (reflectance in 1/sr). Only for half-angle spaces: others have no angles
    /// and give an empty row.
    pub fn row(&self, curve: &Curve) -> Vec<f64> {
        self.angles.iter().flat_map(|&theta| curve.at(theta)).collect()
    }

    /// A row of a half-angle space as a curve.
    pub fn curve(&self, row: &[f64]) -> Curve {
        let mut samples = row.chunks_exact(3);
        Curve::sampled(&self.angles, |_| samples.next().map_or([0.0; 3], |v| [v[0], v[1], v[2]]))
    }

    /// Distance of two rows of reflectance in 1/sr. About 0.01 is hard to see, 0.05 is plain.
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (j, (&a, &b)) in a.iter().zip(b).enumerate() {
            let c = self.radiance[j];
            let d = self.weight[j] * ((a.max(0.0) * c).cbrt() - (b.max(0.0) * c).cbrt());
            sum += d * d;
        }
        sum.sqrt()
    }
}

/// Rows of equal length in one allocation: bases, stacks, candidates. Reflectance in 1/sr unless said.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    columns: usize,
    values: Vec<f64>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: usize) -> Table {
        Table { columns: columns.max(1), values: Vec::new() }
    }

    /// Adds a row; it must have `columns` values.
    ///
    /// # Panics
    /// When the row has another length: a bug of the caller, never a matter of input.
    pub fn push(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.columns, "a row of another space");
        self.values.extend_from_slice(row);
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..][..self.columns]
    }

    /// Row `i`, to change.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.columns..][..self.columns]
    }

    /// The rows in order.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f64> {
        self.values.chunks_exact(self.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two Lambertians differ by |cbrt a - cbrt b| times the root of three times the integral of
    /// cos^(2/3) sin cos = 3/8, channel by channel.
    #[test]
    fn distance_of_two_lambertians_has_a_closed_form() {
        let space = Space::half_angle(512);
        let lambert = |v: f64| vec![v; space.columns()];
        let expected = (0.3f64.cbrt() - 0.1f64.cbrt()).abs() * (3.0f64 * 3.0 / 8.0).sqrt();
        let d = space.distance(&lambert(0.3), &lambert(0.1));
        assert!((d - expected).abs() < 1e-5, "{d} {expected}");
    }

    #[test]
    fn thirty_two_samples_serve_as_well_as_many() {
        let lobe = |alpha: f64| {
            move |t: f64| [0.9 * inks::ggx::lobe(t, alpha) + 0.005, 0.8 * inks::ggx::lobe(t, alpha), 0.1]
        };
        let distance = |samples| {
            let space = Space::half_angle(samples);
            let row = |alpha| space.row(&Curve::sampled(space.angles(), lobe(alpha)));
            space.distance(&row(0.06), &row(0.27))
        };
        let (few, many) = (distance(32), distance(4096));
        assert!((few / many - 1.0).abs() < 2e-3, "{few} {many}");
    }
}
