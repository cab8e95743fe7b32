//! The order of the steps: sample, learn, weight, report.

use std::fmt;

use observe::Observer;
use serde::{Deserialize, Serialize};

use super::archetypes::Fit;
use super::error::FactorError;
use super::hull::{self, Hull};
use super::pca::Pca;
use super::sample::Sample;
use super::settings::{FactorSettings, MOST_BASES, Method};
use super::{grow, kmeans, sacls, weigh};
use crate::brdf::Table;
use crate::materials::{Factored, Materials};

/// How well the bases reproduce the document. Distances are in the metric (0.01: barely visible; 0.05: obvious).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FactorReport {
    /// How bases were learnt: [`Method::Kmeans`] also where [`Method::Sacls`] was asked for and left the document's hull.
    pub method: Method,
    /// Number of bases. Fewer than requested if the document has fewer materials.
    pub bases: usize,
    /// Number of bases requested.
    pub asked: Option<usize>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of distinct materials that the bases were learnt from.
    pub materials: usize,
    /// Root mean square distance between a pixel and its mixture of bases, with weights rounded as stored.
    pub rmse: f64,
    /// The distance that 95 % of the pixels do not exceed.
    pub p95: f64,
    /// The distance of the worst pixel.
    pub max: f64,
    /// Share of the pixels whose distance exceeds 0.01.
    pub uncovered: f64,
    /// For each basis, its distance from the hull of the document's materials, in units of the document's spread.
    pub excursion: Vec<f64>,
}

impl fmt::Display for FactorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} basis material{}; root mean square difference d = {:.4} between a pixel and its mixture (95 % below {:.4}, \
             worst {:.4})",
            self.bases,
            if self.bases == 1 { "" } else { "s" },
            self.rmse,
            self.p95,
            self.max
        )?;
        if self.asked.is_some_and(|asked| asked > self.materials) {
            write!(
                f,
                "; {} were asked for, and the document has {} distinct material{}",
                self.asked.unwrap_or_default(),
                self.materials,
                if self.materials == 1 { "" } else { "s" }
            )?;
        }
        match 100.0 * self.uncovered {
            few if few < 0.05 => Ok(()),
            share => {
                write!(f, "; for {share:.1} % of the pixels no mixture of the bases is closer than 0.01")
            }
        }
    }
}

/// The result of factoring.
#[derive(Clone, Debug, PartialEq)]
pub struct Factoring {
    /// Bases and weights.
    pub factored: Factored,
    /// How well they reproduce the document.
    pub report: FactorReport,
}

/// Factors a document into bases and weight maps of the document's size, and measures how well they reproduce it.
pub fn factor(
    document: &dyn Materials,
    settings: &FactorSettings,
    observer: &dyn Observer,
) -> Result<Factoring, FactorError> {
    from_sample(document, settings, |sample| sample, observer)
}

/// The same, with bases learnt from a few thousand materials, for pictures.
///
/// # Errors
/// Those of [`factor`].
pub fn outline(
    document: &dyn Materials,
    settings: &FactorSettings,
    observer: &dyn Observer,
) -> Result<Factoring, FactorError> {
    from_sample(document, settings, |sample| sample.thinned(grow::MATERIALS), observer)
}

fn from_sample(
    document: &dyn Materials,
    settings: &FactorSettings,
    chosen: impl FnOnce(Sample) -> Sample,
    observer: &dyn Observer,
) -> Result<Factoring, FactorError> {
    check_size(document)?;
    settings.check()?;
    let sample = chosen(Sample::draw(document, settings.seed)?);
    let Learnt { pca, bases, method } = learn(&sample, settings, observer);
    let columns = &sample.columns;
    let excursion = hull::excursions(&sample, &pca, &bases);
    let (maps, errors) = weigh::weigh(document, columns, &bases, observer)?;
    let mut table = Table::new(columns.real);
    bases.chunks_exact(columns.padded).for_each(|row| table.push(&columns.reflectance(row)));
    let report = FactorReport {
        method,
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

fn check_size(document: &dyn Materials) -> Result<(), FactorError> {
    let (width, height) = (document.width(), document.height());
    let values = width.checked_mul(height).and_then(|n| n.checked_mul(2 * MOST_BASES));
    if values.is_none_or(|n| n == 0 || n > isize::MAX as usize) {
        return Err(FactorError::Size { width, height });
    }
    Ok(())
}

/// Sweeps of metric archetypes: most of the gain comes in the first ten.
const SWEEPS: usize = 20;
/// The relative decrease of the mean squared distance below which a sweep is the last one.
const SETTLED: f64 = 1e-3;
/// Axes in which corners are searched.
const CORNER_AXES: usize = 10;

/// The largest distance of a basis of SACLS outside the hull of the document, in units of the document's spread. Measured on the
/// samples, with three and four bases: at most 0.12 where the bases look like materials (leaf, flange), 0.28 to 7 where curves
/// have holes (dove, card).
pub(super) const NEAR: f64 = 0.2;

struct Learnt {
    /// The sample's principal axes.
    pca: Pca,
    /// The bases, as rows of the sample's columns.
    bases: Vec<f32>,
    method: Method,
}

/// Learns bases for a sample.
fn learn(sample: &Sample, settings: &FactorSettings, observer: &dyn Observer) -> Learnt {
    let mut method = settings.method;
    let axes = settings.bases.unwrap_or(grow::MOST).max(CORNER_AXES + 1) - 1;
    let pca = Pca::fit(sample, axes, settings.seed);
    let most = sample.len();
    if most == 1 || settings.bases.is_some_and(|k| k >= most) {
        return Learnt { pca, bases: sample.x.clone(), method };
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
        Method::Sacls => {
            let start = bases.clone();
            sacls::refine(sample, &mut bases, settings.lambda, |_| observer.advance(1));
            let farthest = hull::excursions(sample, &pca, &bases).into_iter().fold(0.0, f64::max);
            // As section 3.1 of the paper has it: SACLS where its bases are near the hull, else convex k-means.
            if farthest > NEAR {
                observer.note(&format!(
                    "a basis of SACLS lies outside the document's materials by {farthest:.2} of their spread (at most \
                     {NEAR}), so the bases are those of convex k-means"
                ));
                (bases, method) = (start, Method::Kmeans);
            }
        }
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
    Learnt { pca, bases, method }
}
