//! From a folder of photographs and a setup to curves: the steps of the other modules in their order.
//!
//! Series are merged one after the other, and only the pixels that curves need are kept of each, so that memory does not grow with
//! the number of lamps. Each step judges what it made: what nobody should trust is an error, what may be better is advice.

use std::path::Path;

use image::RgbImage;
use inks::Stack;
use observe::Observer;
use serde::{Deserialize, Serialize};
use sheet::DotMap;

use crate::camera::frames::Frames;
use crate::camera::merge::{self, Shot};
use crate::camera::residual_shift::ResidualShifts;
use crate::camera::series;
use crate::curves::blur;
use crate::curves::card::{self, Calibration};
use crate::curves::coverage;
use crate::curves::patches::{ChartOnSample, Region};
use crate::curves::pictures::Copy;
use crate::curves::reduce::{self, CurveRow, Doubts, Pixel, Reduced};
use crate::curves::{extent, gather};
use crate::geometry::correction::{self, GeometrySample};
use crate::geometry::measures::{self, Corrected};
use crate::geometry::scene::Scene;
use crate::geometry::shadow::{self, Shadow};
use crate::setup::{Setup, Trust};
use crate::{MeasureError, linalg};

/// Pixels that correct the geometry.
const SOLVING: usize = 6000;

/// Solutions of the geometry after the first, each with the curves of the one before.
const SHARPENED: usize = 2;
/// Softening of ln f below which pixels are as good as points.
const SOFT: f64 = 0.01;
/// One of so many pixels is enough for that.
const THINNED: usize = 3;
/// A blur in pixels that is worth a word: below it a foil's peak keeps its height within the band.
const OUT_OF_FOCUS: f64 = 0.8;
/// A share of other light that is worth a word.
const FOREIGN: f64 = 0.03;
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
    pub pictures: Vec<(String, RgbImage)>,
}

/// What is kept of a series.
struct SeriesRecord {
    series: PhotoSeries,
    copy: Copy,
    outline: Vec<[f64; 2]>,
    /// For each stack.
    pixels: Vec<Vec<Pixel>>,
}

/// Measures the photographs of a folder. `chart` is the sheet of the chart that lies on the sample, if the setup names one.
///
/// # Errors
/// Photographs, setup or scene that give no trustworthy curves; each says what is wrong and what to do.
pub fn measure(
    folder: &Path,
    setup: &Setup,
    chart: Option<&DotMap>,
    observer: &dyn Observer,
) -> Result<Taken, MeasureError> {
    let series = series::series(folder, setup)?;
    let chart = chart.map(ChartOnSample::new).transpose()?;
    let stacks = match &chart {
        Some(chart) => chart.stacks(),
        None => {
            setup.sample.stack.iter().chain(setup.patch.iter().map(|patch| &patch.stack)).cloned().collect()
        }
    };
    let frames = Frames::read(setup.photos.flat_field.as_deref(), setup.photos.dark_frame.as_deref())?;
    let off = series::lamp_off(setup)?;
    observer.begin("reading photographs", 2 * series.iter().map(Vec::len).sum::<usize>() as u64);
    let mut scene: Option<((usize, usize), Scene)> = None;
    let mut seen = Vec::new();
    for (light, exposures) in series.into_iter().enumerate() {
        let film = exposures.iter().find_map(|e| e.exif.film_focal_mm);
        let first = exposures[0].path.clone();
        let (radiance, shots) =
            merge::merge(exposures, &frames, off.as_ref(), setup.photos.linear, observer)?;
        let size = (radiance.width, radiance.height);
        if scene.is_none() {
            scene = Some((size, Scene::new(setup, size, setup.field_of_view(film, size)?)?));
        }
        let Some((expected, scene)) = &scene else { continue };
        if *expected != size {
            let problem = format!(
                "{} x {} pixels, but another lamp's have {} x {}",
                size.0, size.1, expected.0, expected.1
            );
            return Err(MeasureError::photo(&first, problem));
        }
        let steps = match setup.card.rectangle_px {
            Some(rectangle) => card::steps_of(rectangle, &radiance),
            None => card::find(&radiance, setup.card.reflectance)?,
        };
        let card = card::calibrate(&radiance, steps, &setup.card, scene, light)?;
        let blur = blur::of_card(&radiance, &card.steps);
        let scene = &scene.clone().with_blur(blur);
        let shadow = scene.radius().and_then(|_| shadow::look(scene, &radiance, card.scale, light));
        let irradiance = card.irradiance(scene, light);
        let copy = Copy::new(&radiance, card.scale.map(|k| irradiance / std::f64::consts::PI / k));
        let regions = match &chart {
            Some(chart) => chart.regions(&first, &radiance, scene)?,
            None => regions(setup),
        };
        let pixels =
            regions.iter().map(|at| gather::pixels(&radiance, scene, card.scale, light, at)).collect();
        let outline = correction::outline(scene, &radiance, light);
        seen.push(SeriesRecord { series: PhotoSeries { shots, card, blur, shadow }, copy, outline, pixels });
    }
    observer.end();
    let Some((_, scene)) = scene else { return Err(MeasureError::Scene("no photographs".into())) };
    let blur = linalg::median(&mut seen.iter().map(|seen| seen.series.blur).collect::<Vec<_>>());
    let scene = scene.with_blur(blur);
    let scene =
        scene.with_slips(ResidualShifts::new(seen.iter().map(|seen| series::exposures(&seen.series.shots))));
    for (i, stack) in stacks.iter().enumerate() {
        coverage::check(&scene, stack, seen.iter().flat_map(|seen| &seen.pixels[i]))?;
    }
    finish(setup, &scene, &stacks, seen, observer)
}

/// Where the stacks of a setup file are.
fn regions(setup: &Setup) -> Vec<Region> {
    let whole = setup.sample.stack.iter().map(|_| Region::All);
    whole.chain(setup.patch.iter().map(|patch| Region::Pixels(patch.rectangle_px))).collect()
}

/// The photographs of each lamp with their exposures.
/// Some pixels of every stack, spread over the half angles.
fn samples(scene: &Scene, seen: &[SeriesRecord], patches: usize) -> Vec<GeometrySample> {
    let mut bins: Vec<Vec<GeometrySample>> = vec![Vec::new(); patches * reduce::BINS];
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
        let bin = ((view.theta / std::f64::consts::FRAC_PI_2).sqrt() * reduce::BINS as f64) as usize;
        bins[patch * reduce::BINS + bin.min(reduce::BINS - 1)].push(GeometrySample {
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

/// A series that does not fit its setup file may be one under other light or out of focus: where the dark side of the can or the card shows that,
/// the refusal says so first.
fn likelier(error: MeasureError, tape: &Scene, seen: &[SeriesRecord]) -> MeasureError {
    let foreign = seen.iter().enumerate().any(|(i, seen)| {
        let grey = seen.series.card.irradiance(tape, i) / std::f64::consts::PI;
        let shadow = seen.series.shadow.as_ref().map_or(0.0, |shadow| shadow.level[1]);
        shadow > FOREIGN * grey * seen.series.card.darkest || seen.series.card.advice(i + 1).is_some()
    });
    let blur = seen.iter().map(|seen| seen.series.blur).fold(0.0, f64::max);
    let cause = if foreign {
        "other light than the lamp's falls on the can or the card, and the geometry does not fit it; cover the table with black cloth, darken \
         the room, and give a photograph with the lamp off (photos.lamp_off)"
            .to_owned()
    } else if let Some(blurred) = blurred(blur, 1) {
        blurred
    } else {
        return error;
    };
    MeasureError::Scene(format!("{cause}. Otherwise: {error}"))
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

fn finish(
    setup: &Setup,
    tape: &Scene,
    patches: &[Stack],
    mut seen: Vec<SeriesRecord>,
    observer: &dyn Observer,
) -> Result<Taken, MeasureError> {
    observer.begin("fitting the geometry", 1);
    let shots: Vec<&[Shot]> = seen.iter().map(|seen| &*seen.series.shots).collect();
    let measures = measures::measures(setup, &shots);
    let outline: Vec<[f64; 2]> = seen.iter().flat_map(|seen| seen.outline.iter().copied()).collect();
    let solved = solve(tape, patches.len(), &seen, &outline, &measures);
    measures::check(setup, tape, &outline, &measures, &solved)
        .map_err(|error| likelier(error, tape, &seen))?;
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
    let light = light_advice(setup, &scene, &measurement);
    measurement.again = advice(&measurement);
    measurement.again.extend(light);
    measurement.again.iter().for_each(|line| observer.note(line));
    Ok(Taken { measurement, pictures })
}

/// What to do about a lens that blurs.
fn blurred(blur: f64, lamp: usize) -> Option<String> {
    (blur > OUT_OF_FOCUS).then(|| {
        format!(
            "lamp {lamp}: the card's edges are blurred by {blur:.1} pixels, so the lens is out of focus or the camera shook: focus on the card, and \
             close the aperture to f/8"
        )
    })
}

/// What the dark side of the can says of the light.
fn light_advice(setup: &Setup, scene: &Scene, measurement: &Measurement) -> Vec<String> {
    let mut said = Vec::new();
    for (i, series) in measurement.series.iter().enumerate() {
        let Some(shadow) = &series.shadow else { continue };
        let light = series.card.irradiance(scene, i);
        let mut worst: Option<(f64, &str)> = None;
        for stack in &measurement.stacks {
            let rows = stack.rows.iter().filter(|row| row.kind == reduce::SampleOrigin::Measured);
            for row in rows.filter(|row| row.theta_deg < 60.0) {
                let shares = (0..3).map(|c| shadow.level[c] / light / row.rgb[c].max(1e-9));
                let share = shares.fold(0.0, f64::max);
                if worst.is_none_or(|worst| share > worst.0) {
                    worst = Some((share, &stack.stack));
                }
            }
        }
        if let Some((share, stack)) = worst.filter(|worst| worst.0 > FOREIGN) {
            said.push(format!(
                "lamp {}: other light than the lamp's is on the can or strays in the lens: its dark side shows {:.0} % of what {stack} reflects where \
                 it is darkest; cover the table with black cloth, darken the room, and give a photograph with the lamp off (photos.lamp_off)",
                i + 1,
                100.0 * share
            ));
        }
        let given = setup.light[i].diameter_mm;
        if shadow.lamp_mm > 2.0 * given && given < shadow.lamp_mm {
            said.push(format!(
                "lamp {}: the lamp is about {:.0} mm wide, as the edge of the can's dark side shows, and the setup file says {given:.0}: correct \
                 light.diameter_mm, or use a smaller lamp",
                i + 1,
                shadow.lamp_mm
            ));
        }
    }
    said
}

/// What a second try should do otherwise, as each step judges it.
fn advice(measurement: &Measurement) -> Vec<String> {
    let mut again = Vec::new();
    for (i, series) in measurement.series.iter().enumerate() {
        let clipped = measurement.stacks.iter().filter(|stack| coverage::is_clipped(&stack.rows));
        let clipped: Vec<&str> = clipped.map(|stack| &*stack.stack).collect();
        again.extend(series.card.advice(i + 1));
        again.extend(blurred(series.blur, i + 1));
        again.extend(series::advice(&series.shots, i + 1, &clipped));
    }
    again.extend(measurement.stacks.iter().flat_map(|stack| coverage::advice(&stack.stack, &stack.rows)));
    again.extend(measures::advice(measurement.geometry.misfit));
    again
}
