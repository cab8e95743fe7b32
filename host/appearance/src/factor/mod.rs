//! A document's materials as a few bases and their weight maps.
//!
//! Problem: gamut mapping moves a handful of extreme materials and carries everything else along as mixtures of
//! them (sections 3.1 and 4.1 of the paper); the document has to be taken apart into such materials first.
//! Method: sample distinct materials; learn bases from them by one of three [`Method`]s; then weigh every pixel
//! over the bases in the perceptual metric (equation 1), whatever the bases were learnt with.
//! Cost: learning is bounded by the sample, weighing is a few microseconds a pixel on all cores. Curves are made
//! pixel by pixel and thrown away. Results depend on the document and the settings, not on machine or threads.
//! Limits: what covers less than a hundred-thousandth of the document may not be seen while learning; the report
//! says how far the worst pixel is off.

mod archetypes;
mod cbrt;
mod code;
mod columns;
mod grow;
mod hull;
mod kmeans;
mod parts;
mod pca;
mod sacls;
mod sample;
#[cfg(test)]
mod tests;
mod weigh;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::brdf::{Space, Table};
use crate::document::Materials;
use crate::weights::{WeightError, WeightMaps};
use observe::Observer;

use archetypes::Fit;
use hull::Hull;
use pca::Pca;
use sample::Sample;

/// Most bases that can be asked for: twice what a document was ever given.
pub const MOST_BASES: usize = 32;

/// A factored document: at each pixel the reflectance is the weighted sum of the bases (section 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct Factored {
    /// The tabulation the bases are in.
    pub space: Space,
    /// The bases, reflectance in 1/sr, one a row.
    pub bases: Table,
    /// Their weights; as many channels as bases.
    pub maps: WeightMaps,
}

/// How bases are learnt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Corners of the document fitted in the metric. Reproduces the document nearly as well as bases that are no
    /// real materials, and prints best.
    #[default]
    Archetypes,
    /// The paper's convex-hull k-means: real materials, robust, but inside the corners.
    Kmeans,
    /// Sparse alternating constrained least squares, the paper's other method: reproduces the document best, with
    /// bases that may be far from any real material.
    Sacls,
}

/// How to factor. The default suits every document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How bases are learnt.
    pub method: Method,
    /// How many bases, 1..=[`MOST_BASES`]; as many as the document needs (15 at most) when not told.
    pub bases: Option<usize>,
    /// Where chance starts.
    pub seed: u64,
    /// Archetypes only: how far a basis may lie outside the document's hull, in the document's spread (the root
    /// mean square distance from its mean), 0..=10.
    pub delta: f64,
    /// SACLS only: the weight of the penalty on all but the dominant basis of a pixel, 0..=10.
    pub lambda: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { method: Method::default(), bases: None, seed: 0, delta: 0.05, lambda: 0.02 }
    }
}

/// How well it went. Distances are in the metric: about 0.01 is hard to see, 0.05 is plain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// How bases were learnt.
    pub method: Method,
    /// How many there are. Fewer than asked for when the document has fewer materials.
    pub bases: usize,
    /// How many were asked for.
    pub asked: Option<usize>,
    /// Where chance started.
    pub seed: u64,
    /// Distinct materials the bases were learnt from.
    pub materials: usize,
    /// Root mean square distance of a pixel from its mixture of bases, weights rounded as they are stored.
    pub rmse: f64,
    /// 95 of 100 pixels are nearer than this.
    pub p95: f64,
    /// The worst pixel.
    pub max: f64,
    /// Share of the pixels whose distance from the hull of the bases exceeds 0.01.
    pub uncovered: f64,
    /// For each basis its distance from the hull of the document's materials, in the document's spread.
    pub excursion: Vec<f64>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} basis material{}; pixels are d = {:.4} from their mixture on average (95 % below {:.4}, worst {:.4})",
            self.bases,
            if self.bases == 1 { "" } else { "s" },
            self.rmse,
            self.p95,
            self.max
        )?;
        match 100.0 * self.uncovered {
            few if few < 0.05 => Ok(()),
            share => {
                write!(f, "; {share:.1} % of them lie more than 0.01 outside all that the bases can mix")
            }
        }
    }
}

/// What factoring gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Factoring {
    /// Bases and weights.
    pub factored: Factored,
    /// How well it went.
    pub report: Report,
}

/// Why a document cannot be factored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// No pixels, or more than can be counted.
    #[error("a document of {width} x {height} pixels cannot be factored; both sides must be at least 1")]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A setting is out of its range.
    #[error("setting `{name}` is {value}; choose a number from {least} to {most}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value that makes sense.
        least: f64,
        /// Largest value that makes sense.
        most: f64,
    },
    /// A pixel's reflectance is no reflectance.
    #[error(
        "pixel ({x}, {y}) has the reflectance {value} in column {column}; a finite number up to {} per steradian was \
         expected: check the texture or curve it comes from",
        sample::BRIGHTEST
    )]
    Reflectance {
        /// Column of the pixel.
        x: usize,
        /// Row of the pixel.
        y: usize,
        /// Column of the tabulation.
        column: usize,
        /// The value found.
        value: f32,
    },
    /// The weights are no weight maps: a bug, reported instead of printed.
    #[error("the weights found are not a partition of unity")]
    Weights(#[from] WeightError),
}

/// Factors a document: bases, weight maps of the document's size, and how well they reproduce it.
pub fn factor(
    document: &dyn Materials,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Factoring, FactorError> {
    check(document, settings)?;
    let sample = Sample::draw(document, settings.seed)?;
    let (pca, bases) = learn(&sample, settings, observer);
    let columns = &sample.columns;
    let excursion = hull::excursions(&sample, &pca, &bases);
    let (maps, errors) = weigh::weigh(document, columns, &bases, observer)?;
    let mut table = Table::new(columns.real);
    bases.chunks_exact(columns.padded).for_each(|row| table.push(&columns.reflectance(row)));
    let report = Report {
        method: settings.method,
        bases: table.len(),
        asked: settings.bases,
        seed: settings.seed,
        materials: sample.len(),
        rmse: errors.rmse,
        p95: errors.p95,
        max: errors.max,
        uncovered: errors.uncovered,
        excursion,
    };
    Ok(Factoring { factored: Factored { space: document.space().clone(), bases: table, maps }, report })
}

fn check(document: &dyn Materials, settings: &Settings) -> Result<(), FactorError> {
    let (width, height) = (document.width(), document.height());
    let values = width.checked_mul(height).and_then(|n| n.checked_mul(2 * MOST_BASES));
    if values.is_none_or(|n| n == 0 || n > isize::MAX as usize) {
        return Err(FactorError::Size { width, height });
    }
    let ranges = [
        ("bases", settings.bases.map_or(1.0, |k| k as f64), 1.0, MOST_BASES as f64),
        ("delta", settings.delta, 0.0, 10.0),
        ("lambda", settings.lambda, 0.0, 10.0),
    ];
    for (name, value, least, most) in ranges {
        if !(least..=most).contains(&value) {
            return Err(FactorError::Setting { name, value, least, most });
        }
    }
    Ok(())
}

/// Sweeps of metric archetypes; most of the gain comes in the first ten.
const SWEEPS: usize = 20;
/// Relative fall of the mean squared distance in a sweep that counts as settled.
const SETTLED: f64 = 1e-3;
/// Axes in which corners are looked for.
const CORNER_AXES: usize = 10;

/// Bases for a sample, as rows of its columns, and its principal axes.
fn learn(sample: &Sample, settings: &Settings, observer: &dyn Observer) -> (Pca, Vec<f32>) {
    let axes = settings.bases.unwrap_or(grow::MOST).max(CORNER_AXES + 1) - 1;
    let pca = Pca::of(sample, axes, settings.seed);
    let most = sample.len();
    if most == 1 || settings.bases.is_some_and(|k| k >= most) {
        if let Some(k) = settings.bases.filter(|&k| k > most) {
            observer.note(&format!(
                "{k} bases were asked for, but the document has only {most} distinct material{}",
                if most == 1 { "" } else { "s" }
            ));
        }
        return (pca, sample.x.clone());
    }
    let corners = Hull::of_corners(sample, &pca, settings.seed);
    let slack = settings.delta * pca.spread;
    let grown = match settings.bases {
        Some(_) => None,
        None => Some(grow::grow(sample, &corners, slack, settings.seed, observer)),
    };
    let k = settings.bases.or(grown.as_ref().map(|g| g.len() / sample.columns.padded)).unwrap_or(1);
    let mut bases = if k == 1 { sample.mean() } else { kmeans::bases(sample, &pca, k, settings.seed) };
    let steps = match settings.method {
        Method::Kmeans => 0,
        Method::Sacls => sacls::ITERATIONS,
        Method::Archetypes => SWEEPS,
    };
    observer.begin("learning bases", steps as u64);
    match settings.method {
        Method::Kmeans => {}
        Method::Sacls => sacls::refine(sample, &mut bases, settings.lambda, |_| observer.advance(1)),
        Method::Archetypes => {
            let mut fit = Fit::new(sample, &corners, slack, &bases);
            let mut last = f64::INFINITY;
            for _ in 0..SWEEPS {
                let total = fit.sweep();
                observer.advance(1);
                if total > (1.0 - SETTLED) * last {
                    break;
                }
                last = total;
            }
            bases = fit.bases;
        }
    }
    observer.end();
    (pca, bases)
}
