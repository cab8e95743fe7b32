//! Bases to mixtures of printable stacks.
//!
//! Problem: a document's materials are mostly not printable; each must become a mixture of stacks that looks
//! like it, and materials that differ must still differ.
//! Method: by intent. [`Intent::Basis`] maps the document's few bases by eq. 1 and keeps the weight maps (section
//! 4.1 of the 2009 paper: convex combinations of convex combinations are printable); [`Intent::Clamp`] maps every
//! pixel by eq. 1; [`Intent::Blend`] goes smoothly from clamped, where the material is in the gamut, to basis,
//! where it is far out. [`Intent::Auto`] clamps unless that merges materials that differ.
//! Cost: a millisecond a basis; about 10 microseconds a pixel and core for clamp and blend. Limits: the mixture is
//! exact for light that does not scatter sideways in the paper.

mod basis;
mod blend;
mod candidates;
mod cartridges;
mod clamp;
pub mod files;
mod gloss;
mod mix;
mod sample;

use inks::Stack;
use protocol::ink::Ink;
use serde::Serialize;

use crate::brdf::Table;
use crate::document::Materials;
use crate::factor::Factored;
use crate::solve::MixtureError;
use crate::weights::{ONE, WeightError, WeightMaps};
use candidates::Candidates;
use observe::Observer;

pub use candidates::Printable;
pub use mix::{InkMix, MixError};
pub use sample::merged_share;

/// Pixels that the intent is chosen by and pairs are drawn from.
const SAMPLE: usize = 1024;
/// Pixels that inks are given up by.
const CARTRIDGE_SAMPLE: usize = 256;
/// Share of merged pairs up to which clamping is the automatic choice.
const FEW_MERGED: f64 = 0.01;

/// What to do with materials outside the printer's gamut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Intent {
    /// Clamp, unless that merges more than 1 % of pairs of materials that differ; then blend.
    #[default]
    Auto,
    /// Map the bases, keep the weights: relative differences survive.
    Basis,
    /// Map each pixel by itself: lowest error, differences outside the gamut are lost.
    Clamp,
    /// Clamped where that is near, the mapped bases where it is not.
    Blend,
}

/// How the bases' gloss is treated before they are mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Gloss {
    /// Scale, if mapping would otherwise merge bases that differ and scaling helps.
    #[default]
    WhereMerged,
    /// Leave the gloss as it is.
    Keep,
    /// Scale all gloss in common, so that the most extreme basis just reaches the gamut.
    Scale,
}

/// Settings of the gamut mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// What to do with materials outside the gamut.
    pub intent: Intent,
    /// How the bases' gloss is treated.
    pub gloss: Gloss,
    /// Most different cartridges in the result; the machine holds 7.
    pub most_cartridges: usize,
    /// Seed of the sample of pixels that cartridges and intent are chosen by.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { intent: Intent::Auto, gloss: Gloss::WhereMerged, most_cartridges: 7, seed: 1 }
    }
}

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

/// Why a document was not mapped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GamutError {
    /// Nothing can be printed.
    #[error(
        "no stack can be printed with the inks at hand; add an ink, or leave the bare substrate among the stacks"
    )]
    NothingPrintable,
    /// More stacks than the index of a sheet holds.
    #[error("{found} stacks are more than the 255 a sheet can hold beside the substrate; choose fewer inks")]
    TooManyStacks {
        /// Stacks given.
        found: usize,
    },
    /// As many curves as stacks are needed.
    #[error("{stacks} stacks come with {curves} curves")]
    Curves {
        /// Stacks given.
        stacks: usize,
        /// Curves given.
        curves: usize,
    },
    /// A stack is listed twice.
    #[error("stack `{stack}` is listed twice")]
    Twice {
        /// The stack.
        stack: Stack,
    },
    /// Weight maps and bases disagree.
    #[error("the document has {bases} bases and weights for {channels}")]
    Channels {
        /// Bases.
        bases: usize,
        /// Channels of the weight maps.
        channels: usize,
    },
    /// The materials are not those of the factored document.
    #[error("the materials are {found_width} x {found_height} pixels, their weight maps {width} x {height}")]
    Size {
        /// Pixels across of the maps.
        width: usize,
        /// Pixels down of the maps.
        height: usize,
        /// Pixels across of the materials.
        found_width: usize,
        /// Pixels down of the materials.
        found_height: usize,
    },
    /// No cartridge may be used, and the bare substrate is not among the stacks.
    #[error(
        "no mixture keeps to {most} cartridges; allow more, or leave the bare substrate among the stacks"
    )]
    Cartridges {
        /// The limit.
        most: usize,
    },
    /// Eq. 1 could not be solved.
    #[error("{what} cannot be fitted")]
    Mixture {
        /// Which target: a basis or a pixel.
        what: String,
        /// Why.
        source: MixtureError,
    },
    /// The result breaks a rule of mixes: a bug.
    #[error(transparent)]
    Mix(#[from] MixError),
    /// The result breaks a rule of weight maps: a bug.
    #[error(transparent)]
    Weights(#[from] WeightError),
}

/// Maps a document to the printer's gamut.
///
/// `materials` are the document's pixels for the intents that map them one by one; without them the pixels of the
/// factored document are used. The result is a function of the input and the settings alone, whatever the number
/// of threads.
pub fn map(
    document: &Factored,
    materials: Option<&dyn Materials>,
    printable: &Printable,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Mapped, GamutError> {
    check(document, materials, printable)?;
    let failed = |source| GamutError::Mixture { what: "the stacks".into(), source };
    let all = Candidates::new(&document.space, printable).map_err(failed)?;
    let pixels: &dyn Materials = materials.unwrap_or(document);
    let sampled = sample::pixels(pixels.width() * pixels.height(), SAMPLE, settings.seed);
    let sample = sample::rows(pixels, &sampled);

    // Bases count by their mean weight, pixels alike: the cartridges serve what the intent maps.
    let mut targets = Vec::new();
    let mut importance = Vec::new();
    if settings.intent != Intent::Clamp {
        let channels = document.maps.channels();
        let mut sums = vec![0u64; channels];
        for weights in document.maps.data().chunks_exact(channels) {
            sums.iter_mut().zip(weights).for_each(|(sum, &w)| *sum += u64::from(w));
        }
        let total: u64 = sums.iter().sum();
        for (i, row) in document.bases.rows().enumerate() {
            let what = || format!("basis {i}");
            targets
                .push(all.free.target(row).map_err(|source| GamutError::Mixture { what: what(), source })?);
            importance.push(sums[i] as f64 / total as f64);
        }
    }
    if settings.intent != Intent::Basis {
        // Drawn anew: every so manieth of the sample above would favour some columns of the picture.
        let few = sample::pixels(pixels.width() * pixels.height(), CARTRIDGE_SAMPLE, settings.seed ^ 1);
        for (row, pixel) in sample::rows(pixels, &few).rows().zip(&few) {
            let what = || format!("pixel {pixel}");
            targets
                .push(all.free.target(row).map_err(|source| GamutError::Mixture { what: what(), source })?);
            importance.push(1.0 / few.len() as f64);
        }
    }
    let (allowed, given_up) =
        cartridges::choose(&all, &targets, &importance, settings.most_cartridges, observer)?;
    if let Some(words) = in_words(&given_up, settings.most_cartridges) {
        observer.note(&words);
    }
    let candidates = all.subset(&allowed);

    let mut intent = settings.intent;
    if intent == Intent::Auto {
        let clamped = clamp::rows(&candidates, &sample)?;
        let merged = merged_share(&document.space, &sample, &clamped, settings.seed);
        intent = if merged > FEW_MERGED { Intent::Blend } else { Intent::Clamp };
        if intent == Intent::Blend {
            observer.note(&format!(
                "{:.0} % of pairs of different materials would print alike if each were printed as near as the inks \
                 come, so nearness is blended with keeping differences; --intent clamp or basis takes one of them",
                100.0 * merged
            ));
        }
    }
    let gloss = if intent == Intent::Clamp { Gloss::Keep } else { settings.gloss };
    let bases = basis::map(&document.space, &document.bases, &candidates, gloss)?;

    if let Some(factor) = bases.gloss_scale {
        observer.note(&format!(
            "the gloss of all materials is printed at {:.0} %, so that the glossiest still differ",
            100.0 * factor
        ));
    }

    let (shares, maps, mut pixels_report) = if intent == Intent::Basis {
        (bases.shares, document.maps.clone(), None)
    } else {
        let mut clamped = clamp::map(&candidates, pixels, observer)?;
        let mut mean = 1.0;
        if intent == Intent::Blend {
            let s = blend::shares(&clamped.distance, &clamped.brightness, pixels.width());
            mean = s.iter().map(|&s| f64::from(s)).sum::<f64>() / s.len() as f64;
            blend::mix(&mut clamped.shares, &s, &document.maps, &bases.shares);
        }
        let report = distances(clamped.distance, clamped.gap, mean);
        let (shares, maps) = compact(clamped.shares, candidates.len(), pixels.width(), pixels.height())?;
        (shares, maps, Some(report))
    };
    let (mix, curves) = assemble(&candidates, shares, maps)?;
    if let Some(report) = &mut pixels_report {
        let printed = sample::printed(&mix, &curves, &sampled);
        report.merged = merged_share(&document.space, &sample, &printed, settings.seed);
    }
    let report = Report {
        intent,
        cartridges: mix.inks(),
        given_up,
        gloss_scale: bases.gloss_scale,
        bases: bases.reports,
        pixels: pixels_report,
    };
    Ok(Mapped { mix, report })
}

/// Which inks were given up and what that costs, in a sentence.
fn in_words(given_up: &[GivenUp], most: usize) -> Option<String> {
    let (first, last) = (given_up.first()?, given_up.last()?);
    let names: Vec<&str> = given_up.iter().map(|given_up| given_up.ink.name()).collect();
    let listed = match names.split_last() {
        Some((last, [])) => format!("{last} is"),
        Some((last, others)) => format!("{} and {last} are", others.join(", ")),
        None => return None,
    };
    let (before, after) = (format!("{:.4}", first.before), format!("{:.4}", last.after));
    let cost = if before == after {
        format!("the mean distance stays at {before}")
    } else {
        format!("the mean distance goes from {before} to {after}")
    };
    Some(format!("{listed} left out to keep to {most} cartridges; {cost}"))
}

fn distances(mut distance: Vec<f32>, gap: f64, clamped: f64) -> PixelReport {
    let n = distance.len();
    let squares: f64 = distance.iter().map(|&d| f64::from(d) * f64::from(d)).sum();
    let (_, p95, _) = distance.select_nth_unstable_by((n - 1) * 95 / 100, f32::total_cmp);
    let p95 = f64::from(*p95);
    let max = distance.iter().copied().fold(0.0, f32::max);
    PixelReport { rms: (squares / n as f64).sqrt(), p95, max: f64::from(max), gap, merged: 0.0, clamped }
}

/// Drops the candidates that no pixel uses: the identity as matrix, and maps of the others.
fn compact(
    mut shares: Vec<u16>,
    k: usize,
    width: usize,
    height: usize,
) -> Result<(Vec<Vec<u16>>, WeightMaps), WeightError> {
    let mut used = vec![false; k];
    for pixel in shares.chunks_exact(k) {
        used.iter_mut().zip(pixel).for_each(|(used, &w)| *used |= w > 0);
    }
    let kept: Vec<usize> = (0..k).filter(|&q| used[q]).collect();
    // In place: what is kept of a pixel never lies after where it was.
    for pixel in 0..width * height {
        for (channel, &q) in kept.iter().enumerate() {
            shares[pixel * kept.len() + channel] = shares[pixel * k + q];
        }
    }
    shares.truncate(width * height * kept.len());
    shares.shrink_to_fit();
    let unit = |q: usize| (0..k).map(|r| if r == q { ONE } else { 0 }).collect();
    let maps = WeightMaps::new(width, height, kept.len(), shares)?;
    Ok((kept.into_iter().map(unit).collect(), maps))
}

/// The mix of rows of shares over the candidates, and the curves of its stacks: the substrate first, then the
/// candidates that have a share.
fn assemble(
    candidates: &Candidates,
    shares: Vec<Vec<u16>>,
    maps: WeightMaps,
) -> Result<(InkMix, Table), GamutError> {
    let bare = candidates.stacks.iter().position(|stack| stack.layers().is_empty());
    let mut columns = vec![bare];
    columns.extend(
        (0..candidates.len()).filter(|&q| Some(q) != bare && shares.iter().any(|row| row[q] > 0)).map(Some),
    );
    let mut curves = Table::new(candidates.curves.columns());
    let mut stacks = Vec::new();
    for column in &columns {
        match column {
            Some(q) => {
                curves.push(candidates.curves.row(*q));
                stacks.push(candidates.stacks[*q].clone());
            }
            // A substrate that may not be used has no share and needs no curve.
            None => {
                curves.push(&vec![0.0; candidates.curves.columns()]);
                stacks.push(Stack::SUBSTRATE);
            }
        }
    }
    let matrix = shares
        .iter()
        .map(|row| columns.iter().map(|column| column.map_or(0, |q| row[q])).collect())
        .collect();
    Ok((InkMix::new(stacks, maps, matrix)?, curves))
}

fn check(
    document: &Factored,
    materials: Option<&dyn Materials>,
    printable: &Printable,
) -> Result<(), GamutError> {
    let Printable { stacks, curves } = printable;
    if stacks.is_empty() {
        return Err(GamutError::NothingPrintable);
    }
    if stacks.iter().filter(|s| !s.layers().is_empty()).count() > 255 {
        return Err(GamutError::TooManyStacks { found: stacks.len() });
    }
    if stacks.len() != curves.len() {
        return Err(GamutError::Curves { stacks: stacks.len(), curves: curves.len() });
    }
    if let Some(i) = (1..stacks.len()).find(|&i| stacks[..i].contains(&stacks[i])) {
        return Err(GamutError::Twice { stack: stacks[i].clone() });
    }
    let maps = &document.maps;
    if document.bases.len() != maps.channels() {
        return Err(GamutError::Channels { bases: document.bases.len(), channels: maps.channels() });
    }
    if let Some(m) = materials
        && (m.width(), m.height()) != (maps.width(), maps.height())
    {
        return Err(GamutError::Size {
            width: maps.width(),
            height: maps.height(),
            found_width: m.width(),
            found_height: m.height(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
