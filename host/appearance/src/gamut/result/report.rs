//! The result of a mapping, and facts about it.

use inks::Stack;
use protocol::ink::Ink;

use super::mix::InkMix;
use crate::brdf::Table;
use crate::gamut::settings::Intent;

/// A mapped document and the report of the mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// The input of the halftoner.
    pub mix: InkMix,
    /// The report.
    pub report: GamutReport,
    /// What cartridges were chosen by.
    pub judged: Judged,
}

/// What cartridges were chosen by: sampled pixels, the bases or both, whichever the intent maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Their reflectance (1/sr), one per row.
    pub rows: Table,
    /// What each counts.
    pub importance: Vec<f64>,
    /// Which of them are materials that count, and the share of the document that each covers.
    pub counted: Vec<(usize, f64)>,
    /// How many times light counts for each.
    pub light: Vec<f64>,
    /// The root mean square of the objective with the cartridges chosen.
    pub objective: f64,
}

/// The report of a mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct GamutReport {
    /// The intent used: never [`Intent::Auto`].
    pub intent: Intent,
    /// The inks of the result, in the order of their codes.
    pub cartridges: Vec<Ink>,
    /// Inks left out because of the number of cartridges, those that are missed most first.
    pub given_up: Vec<Worth>,
    /// The factor on the gloss of all bases, if it was scaled.
    pub gloss_scale: Option<f64>,
    /// Materials before and after mapping: the bases if the intent uses them, otherwise typical materials
    /// of the document, those that stand for most of it first.
    pub materials: Vec<MaterialReport>,
    /// The pixels, for the intents that map them.
    pub pixels: Option<PixelReport>,
    /// The share of merged pairs ([`PixelReport::merged`]) that [`Intent::Blend`] would leave, if
    /// [`Intent::Auto`] tried it and clamped all the same.
    pub not_blended: Option<f64>,
}

/// What an ink does, or would do, for the material that it serves most.
#[derive(Clone, Debug, PartialEq)]
pub struct Worth {
    /// The ink.
    pub ink: Ink,
    /// What people call the material ([`words`](crate::materials::words)).
    pub material: String,
    /// The share of the document that it covers.
    pub share: f64,
    /// How far its print is off with the ink, in the unit of the metric.
    pub with: f64,
    /// The same without it.
    pub without: f64,
    /// The share of the document whose hue is right with it and not without it.
    pub hue: f64,
}

/// One material before and after mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialReport {
    /// The share of the document that it stands for: the mean weight of a basis, or the share of the
    /// sampled pixels that are nearest to a typical material.
    pub share: f64,
    /// The target (1/sr), with scaled gloss if [`GamutReport::gloss_scale`] is set.
    pub target: Vec<f64>,
    /// The reflectance of the mixture (1/sr), from the weights as rounded for the halftoner.
    pub printed: Vec<f64>,
    /// Distance d between the two.
    pub distance: f64,
    /// Distance d between the printed row and the material with its original gloss.
    pub unscaled_distance: f64,
    /// Distance in light between the printed row and the material with its original gloss.
    pub light: f64,
    /// The stacks of the mixture and their weights, largest first.
    pub weights: Vec<(Stack, f64)>,
    /// Gap of the optimum before pruning, in squared distance; see [`crate::solve::Fit`].
    pub gap: f64,
    /// Whether the gap is a proven bound.
    pub convex: bool,
    /// Starts tried.
    pub starts: usize,
    /// Starts that reached the same distance.
    pub agreeing: usize,
    /// Increase of the distance by leaving out what is rare.
    pub pruning_cost: f64,
}

/// The pixels of a mapping that fits each of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelReport {
    /// Root mean square distance d between pixels and their mixtures.
    pub rms: f64,
    /// Root mean square distance in light between them.
    pub light: f64,
    /// The distance d that 95 % of the pixels do not exceed.
    pub p95: f64,
    /// The largest distance d.
    pub max: f64,
    /// The largest gap of any clamped pixel before pruning, in squared distance.
    pub gap: f64,
    /// Share of sampled pairs of pixels that differ (d > 0.03) but are printed at less than a quarter of
    /// that distance.
    pub merged: f64,
    /// Mean weight of the clamped mixture in the result: 1 for clamp; for contrast, and with
    /// [`GamutSettings::eye`](crate::gamut::GamutSettings::eye), the share of pixels that keep it.
    pub clamped: f64,
}
