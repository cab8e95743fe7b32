//! From a folder of photographs and a setup to curves: the steps of the other modules in their order.
//!
//! Series are merged one after the other, and only the pixels that curves need are kept of each, so that memory does not grow with
//! the number of lamps. Each step judges what it made: what nobody should trust is an error, what may be better is advice.

mod advice;
mod check;
mod look;

use std::path::Path;

use observe::Observer;
use readers::Pixels;
use serde::{Deserialize, Serialize};
use sheet::DotMap;

use crate::MeasureError;
use crate::camera::merge::Shot;
use crate::curves::card::Calibration;
use crate::curves::extent::{self, Pixel};
use crate::curves::reduce::{self, CurveRow, Doubts, Reduced};
use crate::geometry::correction::{self, GeometrySample};
use crate::geometry::measures::{self, Corrected};
use crate::geometry::scene::Scene;
use crate::geometry::shadow::Shadow;
use crate::setup::{Setup, Trust};

use look::{Looked, SeriesRecord};

pub use check::{Check, check};

/// Pixels that correct the geometry: enough for a dozen unknowns, and a step's time grows with them.
const SOLVING: usize = 6000;

/// Solutions of the geometry after the first, each with the curves of the one before.
const SHARPENED: usize = 2;
/// Softening of ln f below which pixels are as good as points.
const SOFT: f64 = 0.01;
/// One of so many pixels is enough for that.
const THINNED: usize = 3;
/// A deviation of a card's step that noise and paper explain.
const CARD_AGREES: f64 = 0.01;

/// Everything that was measured, and how.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measurement {
    /// Who measured.
    pub by: String,
    /// When.
    pub when: String,
    /// How, in a sentence.
    pub setup: String,
    /// One for each lamp.
    pub series: Vec<PhotoSeries>,
    /// What stood where.
    pub geometry: GeometryFigures,
    /// The stacks.
    pub stacks: Vec<MeasuredStack>,
    /// What to photograph again, and why.
    pub again: Vec<String>,
}

/// The photographs under one lamp.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhotoSeries {
    /// The photographs, longest exposure first.
    pub shots: Vec<Shot>,
    /// What the grey card says.
    pub card: Calibration,
    /// Standard deviation of the lens' blur in pixels, by the card's edges.
    pub blur: f64,
    /// What the dark side of the can says, if it is in view.
    pub shadow: Option<Shadow>,
}

/// What stood where.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GeometryFigures {
    /// Whether it was corrected from the pictures.
    pub solved: bool,
    /// Radius of the can in mm.
    pub radius_mm: Option<f64>,
    /// The lamps in mm.
    pub lights_mm: Vec<[f64; 3]>,
    /// Each measure that the pictures could correct.
    pub measures: Vec<Corrected>,
    /// Robust standard deviation of ln f among pixels of one half angle.
    pub misfit: f64,
    /// The same with the tape's measures.
    pub misfit_before: f64,
}

/// A stack's curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeasuredStack {
    /// The stack, from the bottom up.
    pub stack: String,
    /// Its samples.
    pub rows: Vec<CurveRow>,
}

/// A measurement with its pictures: name and picture.
pub struct Taken {
    /// The figures.
    pub measurement: Measurement,
    /// Masks and residuals, with their file names.
    pub pictures: Vec<(String, Pixels<[u8; 3]>)>,
}

/// Measures the photographs of a folder. `chart` is the sheet of the chart that lies on the sample, if the setup names one. A stack that
/// cannot be measured is left out with a word, as long as there are others.
///
/// # Errors
/// Photographs, setup or scene that give no trustworthy curves; each says what is wrong and what to do.
pub fn measure(
    folder: &Path,
    setup: &Setup,
    chart: Option<&DotMap>,
    observer: &dyn Observer,
) -> Result<Taken, MeasureError> {
    let mut looked = look::look(folder, setup, chart, observer, &mut Err)?;
    let left_out = looked.leave_out_hidden();
    if looked.stacks.is_empty() {
        let first = left_out.into_iter().next();
        return Err(first.unwrap_or_else(|| MeasureError::Scene("no photographs".into())));
    }
    let mut taken = finish(setup, looked, observer)?;
    for error in left_out {
        let line = format!("left out: {error}");
        observer.note(&line);
        taken.measurement.again.push(line);
    }
    Ok(taken)
}

/// Some pixels of every stack, spread over the half angles.
fn samples(scene: &Scene, seen: &[SeriesRecord], patches: usize) -> Vec<GeometrySample> {
    let mut bins: Vec<Vec<GeometrySample>> = vec![Vec::new(); patches * extent::BINS];
    for (patch, pixel) in seen
        .iter()
        .flat_map(|seen| seen.pixels.iter().enumerate().flat_map(|(i, p)| p.iter().map(move |p| (i, p))))
    {
        let mean = pixel.value.iter().sum::<f64>() / 3.0;
        let Some(view) = scene.seen(pixel.x, pixel.y, pixel.light, pixel.first) else { continue };
        if pixel.bound != 0 || mean <= 0.0 {
            continue;
        }
        let variance: f64 =
            pixel.value.iter().zip(&pixel.variance).map(|(v, r)| (v / 3.0 / mean).powi(2) * r).sum();
        let bin = ((view.theta / std::f64::consts::FRAC_PI_2).sqrt() * extent::BINS as f64) as usize;
        bins[patch * extent::BINS + bin.min(extent::BINS - 1)].push(GeometrySample {
            x: pixel.x,
            y: pixel.y,
            light: pixel.light,
            patch,
            ln: mean.ln(),
            first: pixel.first,
            sigma: variance.sqrt(),
        });
    }
    let most = (SOLVING / bins.iter().filter(|bin| !bin.is_empty()).count().max(1)).max(6);
    bins.into_iter()
        .flat_map(|bin| {
            let step = bin.len().div_ceil(most).max(1);
            bin.into_iter().step_by(step)
        })
        .filter(|s| s.sigma < 0.3)
        .collect()
}

/// Corrects the geometry. Pixel, lamp and the lens' blur change what pixels of one half angle show, so the curves that a first solution gives say by how
/// much, and the next ones do without it.
fn solve(
    tape: &Scene,
    patches: usize,
    seen: &[SeriesRecord],
    outline: &[[f64; 2]],
    measures: &[correction::Measure],
) -> correction::Solved {
    let samples = samples(tape, seen, patches);
    let mut solved = correction::solve(tape, &samples, outline, measures);
    for _ in 0..SHARPENED {
        let curves: Vec<extent::Logs> = (0..patches)
            .map(|i| {
                let pixels = seen.iter().flat_map(|seen| seen.pixels[i].iter());
                let pixels: Vec<Pixel> = pixels.step_by(THINNED).copied().collect();
                reduce::reduce(&solved.scene, &pixels, &Doubts::default()).curve
            })
            .collect();
        let mut most = 0.0f64;
        let sharp: Vec<GeometrySample> = samples
            .iter()
            .map(|s| {
                let by = extent::softened(&solved.scene, [s.x, s.y], s.light, s.first, &curves[s.patch]);
                most = most.max(by.abs());
                GeometrySample { ln: s.ln - by, ..*s }
            })
            .collect();
        if most < SOFT {
            break;
        }
        solved = correction::solve(tape, &sharp, outline, measures);
    }
    solved
}

/// What light besides the lamp's makes uncertain, as the card and the dark side of the can tell.
fn light_doubts(seen: &[SeriesRecord]) -> Doubts {
    let most = |of: &dyn Fn(&SeriesRecord) -> f64| seen.iter().map(of).fold(0.0, f64::max);
    let bright = most(&|seen| {
        let worst = seen.series.card.deviation[0].iter().fold(0.0f64, |most, d| most.max(d.abs()));
        // Below what paper and noise do, the step agrees.
        if worst > CARD_AGREES { worst } else { 0.0 }
    });
    let dark = |c: usize| {
        let over = |seen: &SeriesRecord| seen.series.card.deviation[1][c].abs();
        most(&|seen| {
            if over(seen) > CARD_AGREES {
                over(seen) * seen.series.card.darkest / std::f64::consts::PI
            } else {
                0.0
            }
        })
    };
    Doubts {
        scenes: Vec::new(),
        card: most(&|seen| seen.series.card.error).hypot(0.005).hypot(bright),
        card_foreign: std::array::from_fn(dark),
        foreign: std::array::from_fn(|c| {
            most(&|seen| seen.series.shadow.as_ref().map_or(0.0, |shadow| shadow.level[c]))
        }),
    }
}

fn finish(setup: &Setup, looked: Looked, observer: &dyn Observer) -> Result<Taken, MeasureError> {
    let Looked { scene: ref tape, stacks: ref patches, mut seen } = looked;
    observer.begin("fitting the geometry", 1);
    let shots: Vec<&[Shot]> = seen.iter().map(|seen| &*seen.series.shots).collect();
    let measures = measures::measures(setup, &shots);
    let outline: Vec<[f64; 2]> = seen.iter().flat_map(|seen| seen.outline.iter().copied()).collect();
    let solved = solve(tape, patches.len(), &seen, &outline, &measures);
    measures::check(setup, tape, &outline, &measures, &solved)
        .map_err(|error| advice::likelier(error, tape, &seen))?;
    observer.end();
    let trusted = setup.geometry == Trust::Known;
    let scene = if trusted { tape.clone() } else { solved.scene.clone() };
    // The card's irradiance follows the lamp.
    let scales = |scene: &Scene| -> Vec<f64> {
        let factor = |(light, seen): (usize, &SeriesRecord)| {
            seen.series.card.irradiance(scene, light) / seen.series.card.irradiance(tape, light)
        };
        seen.iter().enumerate().map(factor).collect()
    };
    let factors = scales(&scene);
    let scenes: Vec<(Scene, Vec<f64>)> = if trusted {
        Vec::new()
    } else {
        let doubtful = solved.uncertain.iter().map(|column| correction::apply(tape, &measures, column));
        // As far as pixels deviate as before, the tape may have been right.
        let kept = (solved.misfit / solved.before.max(1e-9)).min(1.0);
        let back: Vec<f64> = solved.moved.iter().map(|moved| moved * (1.0 - kept)).collect();
        let back = std::iter::once(correction::apply(tape, &measures, &back));
        doubtful
            .chain(back)
            .map(|other| {
                let relative = scales(&other).iter().zip(&factors).map(|(a, b)| a / b).collect();
                (other, relative)
            })
            .collect()
    };
    for (seen, factor) in seen.iter_mut().zip(&factors) {
        seen.series.card.scale = seen.series.card.scale.map(|k| k * factor);
        seen.pixels.iter_mut().flatten().for_each(|pixel| pixel.value = pixel.value.map(|v| v * factor));
    }
    let doubts = Doubts { scenes, ..light_doubts(&seen) };
    observer.begin("making curves", patches.len() as u64);
    let mut stacks = Vec::new();
    let mut used = Vec::new();
    for (i, stack) in patches.iter().enumerate() {
        let pixels: Vec<Pixel> = seen.iter().flat_map(|seen| seen.pixels[i].iter().copied()).collect();
        let Reduced { rows, used: of_stack, .. } = reduce::reduce(&scene, &pixels, &doubts);
        used.extend(of_stack);
        stacks.push(MeasuredStack { stack: stack.to_string(), rows });
        observer.advance(1);
    }
    observer.end();
    let mut pictures = Vec::new();
    for (light, seen) in seen.iter().enumerate() {
        let here: Vec<(f64, f64, Option<f64>)> =
            used.iter().filter(|p| p.2 == light).map(|p| (p.0, p.1, p.3)).collect();
        pictures.push((format!("mask-{}.png", light + 1), seen.copy.mask(&here, &seen.series.card.steps)));
        pictures.push((format!("residuals-{}.png", light + 1), seen.copy.residuals(&here)));
    }
    let geometry = GeometryFigures {
        solved: !trusted,
        radius_mm: scene.radius(),
        lights_mm: scene.lights().to_vec(),
        measures: measures::describe(&measures, &solved),
        misfit: if trusted { solved.before } else { solved.misfit },
        misfit_before: solved.before,
    };
    let series: Vec<PhotoSeries> = seen.into_iter().map(|seen| seen.series).collect();
    let mut measurement = Measurement {
        by: setup.by.clone(),
        when: setup.when.clone(),
        setup: setup.sentence(),
        series,
        geometry,
        stacks,
        again: Vec::new(),
    };
    let light = advice::light(setup, &scene, &measurement);
    measurement.again = advice::of(&measurement);
    measurement.again.extend(light);
    measurement.again.iter().for_each(|line| observer.note(line));
    Ok(Taken { measurement, pictures })
}
