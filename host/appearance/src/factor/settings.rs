//! The choices in factoring.

use serde::{Deserialize, Serialize};

use super::error::FactorError;

/// The most bases that can be requested: twice what any document has needed.
pub const MOST_BASES: usize = 32;

/// How the bases are learnt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Corners of the document, fitted in the metric and kept near its real materials.
    #[default]
    Archetypes,
    /// The paper's convex-hull k-means: real materials and robust, but slightly inside the corners.
    Kmeans,
    /// Sparse alternating constrained least squares, the paper's other method: its bases may be far from any real material.
    Sacls,
}

/// The settings of factoring. The defaults suit every document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FactorSettings {
    /// How the bases are learnt.
    pub method: Method,
    /// Number of bases, 1..=[`MOST_BASES`]; by default as many as the document needs (15 at most).
    pub bases: Option<usize>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Archetypes only: the largest distance of a basis outside the hull of the document, in units of the document's spread
    /// (the root mean square distance from its mean), 0..=10.
    pub delta: f64,
    /// SACLS only: the weight of the penalty on all but the dominant basis of a pixel, 0..=10.
    pub lambda: f64,
}

impl Default for FactorSettings {
    fn default() -> FactorSettings {
        FactorSettings { method: Method::default(), bases: None, seed: 0, delta: 0.05, lambda: 0.02 }
    }
}

impl FactorSettings {
    /// Checks that every setting is in its range.
    pub(super) fn check(&self) -> Result<(), FactorError> {
        let ranges = [
            ("bases", self.bases.map_or(1.0, |k| k as f64), 1.0, MOST_BASES as f64),
            ("delta", self.delta, 0.0, 10.0),
            ("lambda", self.lambda, 0.0, 10.0),
        ];
        for (name, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                return Err(FactorError::Setting { name, value, least, most });
            }
        }
        Ok(())
    }
}
