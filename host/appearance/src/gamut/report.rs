//! What a mapping gives, and what is known about it.

use inks::Stack;
use protocol::ink::Ink;

use super::mix::InkMix;
use super::settings::Intent;

/// A mapped document and what is known of the mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// What the halftoner reads.
    pub mix: InkMix,
    /// What happened.
    pub report: Report,
}

/// What happened in the mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The intent used: never [`Intent::Auto`].
    pub intent: Intent,
    /// The inks of the result, in the order of the ink codes.
    pub cartridges: Vec<Ink>,
    /// Inks given up to keep to the number of cartridges, in the order they were given up.
    pub given_up: Vec<GivenUp>,
    /// The common factor on the gloss of the bases, if it was scaled.
    pub gloss_scale: Option<f64>,
    /// Each basis before and after.
    pub bases: Vec<BasisReport>,
    /// The pixels, for the intents that map them.
    pub pixels: Option<PixelReport>,
}

/// An ink given up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GivenUp {
    /// The ink.
    pub ink: Ink,
    /// Root mean square distance of targets and mixtures with it and without it.
    pub before: f64,
    /// See `before`.
    pub after: f64,
}

/// One basis before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct BasisReport {
    /// The target (1/sr), with its gloss scaled if [`Report::gloss_scale`] says so.
    pub target: Vec<f64>,
    /// What the mixture reflects (1/sr), from the weights as rounded for the halftoner.
    pub printed: Vec<f64>,
    /// Distance d of the two.
    pub distance: f64,
    /// Distance d of the printed row and the basis with its gloss as it was.
    pub unscaled_distance: f64,
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
    /// What leaving out weights below 0.5 % added to the distance.
    pub pruning_cost: f64,
}

/// The pixels of a clamped or blended mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelReport {
    /// Root mean square distance of pixels and their clamped mixtures.
    pub rms: f64,
    /// The distance 95 % of the pixels are within.
    pub p95: f64,
    /// The largest distance.
    pub max: f64,
    /// The largest gap of any pixel before pruning, in squared distance.
    pub gap: f64,
    /// Share of sampled pairs of pixels that differ (d > 0.03) and are printed at less than a quarter of that.
    pub merged: f64,
    /// Mean weight of the clamped mixture in the result: 1 for clamp.
    pub clamped: f64,
}
