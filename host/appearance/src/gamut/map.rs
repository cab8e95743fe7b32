//! The order of the steps: choose cartridges, choose the intent, map the bases, map the pixels.

use observe::Observer;

use super::candidates::{Candidates, Printable};
use super::error::GamutError;
use super::report::{GivenUp, Mapped, PixelReport, Report};
use super::settings::{Gloss, Intent, Settings};
use super::{assemble, basis, blend, cartridges, clamp, sample};
use crate::brdf::Table;
use crate::materials::{Factored, Materials};
use crate::solve::{MixtureError, Target};
use crate::weights::WeightMaps;

/// Pixels that the intent is chosen by and pairs are drawn from.
const SAMPLE: usize = 1024;
/// Pixels that cartridges are chosen by.
const CARTRIDGE_SAMPLE: usize = 256;
/// Share of merged pairs up to which clamping is the automatic choice.
const FEW_MERGED: f64 = 0.01;

/// Maps a document to the printer's gamut.
///
/// `materials` are the document's pixels for the intents that map each pixel; without them the pixels of the factored
/// document are used. The result depends on the input and the settings alone, not on the number of threads.
pub fn map(
    document: &Factored,
    materials: Option<&dyn Materials>,
    printable: &Printable,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Mapped, GamutError> {
    check(document, materials, printable)?;
    let all = Candidates::new(&document.space, printable).map_err(in_target("the stacks"))?;
    let pixels: &dyn Materials = materials.unwrap_or(document);
    let sampled = sample::pixels(pixels.width() * pixels.height(), SAMPLE, settings.seed);
    let sample = sample::rows(pixels, &sampled);

    let (targets, importance) = cartridge_targets(document, pixels, &all, settings)?;
    let (allowed, given_up) =
        cartridges::choose(&all, &targets, &importance, settings.most_cartridges, observer)?;
    if let Some(words) = in_words(&given_up, settings.most_cartridges) {
        observer.note(&words);
    }
    let candidates = all.subset(&allowed);

    let intent = match settings.intent {
        Intent::Auto => automatic_intent(document, &candidates, &sample, settings.seed, observer)?,
        chosen => chosen,
    };
    let gloss = if intent == Intent::Clamp { Gloss::Keep } else { settings.gloss };
    let bases = basis::map(&document.space, &document.bases, &candidates, gloss)?;
    if let Some(factor) = bases.gloss_scale {
        observer.note(&format!(
            "the gloss of all materials is reduced to {:.0} %, so that the glossiest ones still differ in print",
            100.0 * factor
        ));
    }

    let (shares, maps, mut pixels_report) = if intent == Intent::Basis {
        (bases.shares, document.maps.clone(), None)
    } else {
        let (shares, maps, report) =
            map_pixels(document, pixels, &candidates, &bases.shares, intent, observer)?;
        (shares, maps, Some(report))
    };
    let (mix, curves) = assemble::assemble(&candidates, shares, maps)?;
    if let Some(report) = &mut pixels_report {
        let printed = sample::printed(&mix, &curves, &sampled);
        report.merged = sample::merged_share(&document.space, &sample, &printed, settings.seed);
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

/// Names the target of a failed fit.
fn in_target(what: impl Into<String>) -> impl FnOnce(MixtureError) -> GamutError {
    let what = what.into();
    move |source| GamutError::Mixture { what, source }
}

/// The targets that cartridges are chosen by, and the importance of each: the bases by their mean weight and sampled
/// pixels alike, so that the cartridges serve whatever the intent maps.
fn cartridge_targets(
    document: &Factored,
    pixels: &dyn Materials,
    all: &Candidates,
    settings: &Settings,
) -> Result<(Vec<Target>, Vec<f64>), GamutError> {
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
            targets.push(all.free.target(row).map_err(in_target(format!("basis {i}")))?);
            importance.push(sums[i] as f64 / total as f64);
        }
    }
    if settings.intent != Intent::Basis {
        // A fresh draw: every n-th pixel of the larger sample would favour some columns of the picture.
        let few = sample::pixels(pixels.width() * pixels.height(), CARTRIDGE_SAMPLE, settings.seed ^ 1);
        for (row, pixel) in sample::rows(pixels, &few).rows().zip(&few) {
            targets.push(all.free.target(row).map_err(in_target(format!("pixel {pixel}")))?);
            importance.push(1.0 / few.len() as f64);
        }
    }
    Ok((targets, importance))
}

/// Clamping, unless it merges more than a few pairs of sampled materials; then blending.
fn automatic_intent(
    document: &Factored,
    candidates: &Candidates,
    sample: &Table,
    seed: u64,
    observer: &dyn Observer,
) -> Result<Intent, GamutError> {
    let clamped = clamp::rows(candidates, sample)?;
    let merged = sample::merged_share(&document.space, sample, &clamped, seed);
    if merged <= FEW_MERGED {
        return Ok(Intent::Clamp);
    }
    observer.note(&format!(
        "{:.0} % of the pairs of different materials would look alike if each were printed as closely as the inks allow, \
         so closeness is traded for difference (intent `blend`); choose intent `clamp` for closeness alone, `basis` for \
         differences alone",
        100.0 * merged
    ));
    Ok(Intent::Blend)
}

/// Clamps every pixel, and blends the result with the mapped bases if the intent asks for it.
fn map_pixels(
    document: &Factored,
    pixels: &dyn Materials,
    candidates: &Candidates,
    bases: &[Vec<u16>],
    intent: Intent,
    observer: &dyn Observer,
) -> Result<(Vec<Vec<u16>>, WeightMaps, PixelReport), GamutError> {
    let mut clamped = clamp::map(candidates, pixels, observer)?;
    let mut mean = 1.0;
    if intent == Intent::Blend {
        let s = blend::shares(&clamped.distance, &clamped.brightness, pixels.width());
        mean = s.iter().map(|&s| f64::from(s)).sum::<f64>() / s.len() as f64;
        blend::mix(&mut clamped.shares, &s, &document.maps, bases);
    }
    let report = distances(clamped.distance, clamped.gap, mean);
    let (shares, maps) =
        assemble::compact(clamped.shares, candidates.len(), pixels.width(), pixels.height())?;
    Ok((shares, maps, report))
}

/// A sentence that names the inks that were left out and what that costs.
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
        format!("the root mean square difference stays at d = {before}")
    } else {
        format!("the root mean square difference changes from d = {before} to {after}")
    };
    Some(format!("{listed} left out to use at most {most} cartridges; {cost}"))
}

fn distances(mut distance: Vec<f32>, gap: f64, clamped: f64) -> PixelReport {
    let n = distance.len();
    let squares: f64 = distance.iter().map(|&d| f64::from(d) * f64::from(d)).sum();
    let (_, p95, _) = distance.select_nth_unstable_by((n - 1) * 95 / 100, f32::total_cmp);
    let p95 = f64::from(*p95);
    let max = distance.iter().copied().fold(0.0, f32::max);
    PixelReport { rms: (squares / n as f64).sqrt(), p95, max: f64::from(max), gap, merged: 0.0, clamped }
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
