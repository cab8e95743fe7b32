//! From a folder of photographs and a setup to curves: the steps of the other modules in their order.
//!
//! Series are merged one after the other, and only the pixels that curves need are kept of each, so that memory does not grow with
//! the number of lamps. What nobody should trust is an error; what may be better is advice.

use std::path::Path;

use image::RgbImage;
use inks::Stack;
use observe::Observer;
use press::sheet::DotMap;
use serde::{Deserialize, Serialize};

use crate::MeasureError;
use crate::card::{self, Calibration};
use crate::geometry::{Scene, Unknown};
use crate::merge::{self, Exposure, Frames, Shot};
use crate::patches::{Chart, Region};
use crate::photo;
use crate::pictures::Copy;
use crate::reduce::{self, Kind, Pixel, Reduced, Row};
use crate::setup::{Setup, Shape, Trust};
use crate::slips::Slips;
use crate::solve::{self, Measure, Sample, Solved};

/// Pixels that correct the geometry.
const SOLVING: usize = 6000;
/// The largest half angle at which a highlight counts as seen, in degrees.
const HIGHLIGHT: f64 = 5.0;
/// Pixels a stack must have.
const FEWEST: usize = 200;
/// A correction beyond this many tolerances is a mistake.
const MISTAKE: f64 = 3.0;
/// What the alignment of photographs that were moved may leave, in pixels.
const SLIP: f64 = 0.15;
/// Places on the outline that are enough to judge the radius by.
const OUTLINED: usize = 8;
/// Deviation of pixels of one half angle that is worth a word.
const UNEVEN: f64 = 0.12;

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
    pub series: Vec<Series>,
    /// What stood where.
    pub geometry: Geometry,
    /// The stacks.
    pub stacks: Vec<Measured>,
    /// What to photograph again, and why.
    pub again: Vec<String>,
}

/// The photographs under one lamp.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Series {
    /// The photographs, longest exposure first.
    pub shots: Vec<Shot>,
    /// What the grey card says.
    pub card: Calibration,
}

/// What stood where.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Geometry {
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

/// A measure and what the pictures say of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Corrected {
    /// What.
    pub name: String,
    /// Millimetres or degrees.
    pub unit: String,
    /// By how much the pictures correct it.
    pub by: f64,
    /// How far the setup allows.
    pub tolerance: f64,
    /// Standard deviation after the correction.
    pub sigma: f64,
}

/// A stack's curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// The stack, from the bottom up.
    pub stack: String,
    /// Its samples.
    pub rows: Vec<Row>,
}

/// A measurement with its pictures: name and picture.
pub struct Taken {
    /// The figures.
    pub measurement: Measurement,
    /// Masks and residuals, with their file names.
    pub pictures: Vec<(String, RgbImage)>,
}

/// What is kept of a series.
struct Seen {
    series: Series,
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
    let series = series(folder, setup)?;
    let chart = chart.map(Chart::new).transpose()?;
    let stacks = match &chart {
        Some(chart) => chart.stacks(),
        None => {
            setup.sample.stack.iter().chain(setup.patch.iter().map(|patch| &patch.stack)).cloned().collect()
        }
    };
    let frames = Frames::read(setup.photos.flat_field.as_deref(), setup.photos.dark_frame.as_deref())?;
    observer.begin("reading photographs", 2 * series.iter().map(Vec::len).sum::<usize>() as u64);
    let mut scene: Option<((usize, usize), Scene)> = None;
    let mut seen = Vec::new();
    for (light, exposures) in series.into_iter().enumerate() {
        let film = exposures.iter().find_map(|e| e.exif.film_focal_mm);
        let first = exposures[0].path.clone();
        let (radiance, shots) = merge::merge(exposures, &frames, setup.photos.linear, observer)?;
        let size = (radiance.width, radiance.height);
        if scene.is_none() {
            scene = Some((size, Scene::new(setup, size, setup.field_of_view(film)?)?));
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
        let irradiance = middle_irradiance(scene, &card, light);
        let copy = Copy::new(&radiance, card.scale.map(|k| irradiance / std::f64::consts::PI / k));
        let regions = match &chart {
            Some(chart) => chart.regions(&first, &radiance, scene)?,
            None => regions(setup),
        };
        let pixels =
            regions.iter().map(|at| reduce::pixels(&radiance, scene, card.scale, light, at)).collect();
        let outline = solve::outline(scene, &radiance, light);
        seen.push(Seen { series: Series { shots, card }, copy, outline, pixels });
    }
    observer.end();
    let Some((_, scene)) = scene else { return Err(MeasureError::Scene("no photographs".into())) };
    let scene = scene.with_slips(Slips::new(seen.iter().map(|seen| exposures(&seen.series.shots))));
    covered(&scene, &stacks, &seen)?;
    finish(setup, &scene, &stacks, seen, observer)
}

/// Relative exposures of a series.
fn exposures(shots: &[Shot]) -> Vec<f64> {
    shots.iter().map(|shot| shot.seconds * shot.ratio).collect()
}

/// Where the stacks of a setup file are.
fn regions(setup: &Setup) -> Vec<Region> {
    let whole = setup.sample.stack.iter().map(|_| Region::All);
    whole.chain(setup.patch.iter().map(|patch| Region::Pixels(patch.rectangle_px))).collect()
}

/// The photographs of each lamp with their exposures.
fn series(folder: &Path, setup: &Setup) -> Result<Vec<Vec<Exposure>>, MeasureError> {
    let mut series: Vec<Vec<Exposure>> = vec![Vec::new(); setup.light.len()];
    let mut named: Vec<&String> = setup.exposures.keys().collect();
    for path in photo::list(folder)? {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let Some(light) = setup.light.iter().position(|light| name.starts_with(&light.photos)) else {
            let beginnings: Vec<&str> = setup.light.iter().map(|light| &*light.photos).collect();
            let problem = format!(
                "belongs to no lamp: its name begins with none of {}; rename it, or change light.photos",
                beginnings.join(", ")
            );
            return Err(MeasureError::photo(&path, problem));
        };
        let exif = photo::exif(&path)?;
        named.retain(|other| **other != name);
        let seconds =
            setup.exposures.get(&name).copied().or(exif.seconds).filter(|t| t.is_finite() && *t > 0.0);
        let Some(seconds) = seconds else {
            return Err(MeasureError::photo(
                &path,
                format!(
                    "has no exposure time; keep the camera's EXIF, or add `\"{name}\" = 0.004` (seconds) to [exposures] in the setup file"
                ),
            ));
        };
        series[light].push(Exposure { path, seconds, exif });
    }
    if let Some(name) = named.first() {
        return Err(MeasureError::Scene(format!(
            "setup file: exposures names {name}, which is not in {}; correct the name",
            folder.display()
        )));
    }
    match series.iter().position(Vec::is_empty) {
        Some(empty) => Err(MeasureError::Scene(format!(
            "light {}: no photograph's name begins with `{}`; photograph it, or take it out of the setup file",
            empty + 1,
            setup.light[empty].photos
        ))),
        None => Ok(series),
    }
}

fn middle_irradiance(scene: &Scene, card: &Calibration, light: usize) -> f64 {
    let [left, top, right, bottom] = card.steps[1];
    scene.card_irradiance(0.5 * (left + right), 0.5 * (top + bottom), light)
}

/// Every stack has pixels, and a highlight.
fn covered(scene: &Scene, stacks: &[Stack], seen: &[Seen]) -> Result<(), MeasureError> {
    for (i, stack) in stacks.iter().enumerate() {
        let pixels: Vec<&Pixel> = seen.iter().flat_map(|seen| &seen.pixels[i]).collect();
        if pixels.len() < FEWEST {
            return Err(MeasureError::Scene(format!(
                "stack {stack}: {} usable pixels; it must lie on the sample, lit and seen: check rectangle_px (or sample.chart), sample.height_mm and \
                 the camera's field of view",
                pixels.len()
            )));
        }
        let angles =
            pixels.iter().filter_map(|p| scene.view(p.x, p.y, p.light)).map(|v| v.theta.to_degrees());
        let least = angles.fold(f64::INFINITY, f64::min);
        if least > HIGHLIGHT {
            return Err(MeasureError::Scene(format!(
                "stack {stack}: no highlight in view, the smallest half angle is {least:.1} degrees; move the lamp toward the camera, \
                 or turn the sample until the highlight crosses the stack"
            )));
        }
    }
    Ok(())
}

/// What the pictures may correct, with the setup's tolerances.
fn measures(setup: &Setup, seen: &[Seen]) -> Vec<Measure> {
    let sample = &setup.sample;
    let tilt = sample.tilt_tolerance_deg.to_radians();
    let mut measures = vec![(Unknown::Nod, tilt), (Unknown::Depth, sample.centre_tolerance_mm)];
    match sample.shape {
        Shape::Cylinder => {
            let radius = sample.radius_mm.unwrap_or(1.0);
            measures.push((Unknown::Radius, sample.radius_tolerance_mm.unwrap_or(0.015 * radius)));
            measures.push((Unknown::Lean, tilt));
            measures.push((Unknown::Across, sample.centre_tolerance_mm));
        }
        Shape::Flat => measures.push((Unknown::Turn, tilt)),
    }
    for (i, light) in setup.light.iter().enumerate() {
        measures.extend((0..3).map(|axis| (Unknown::Light(i, axis), light.tolerance_mm)));
    }
    for (i, seen) in seen.iter().enumerate() {
        let moved: Vec<bool> = seen.series.shots.iter().map(|shot| shot.shift != [0.0; 2]).collect();
        let shots = (0..moved.len()).filter(|&k| moved[k]);
        measures.extend(shots.flat_map(|k| [0, 1].map(|axis| (Unknown::Slip(i, k, axis), SLIP))));
    }
    measures
}

/// Some pixels of every stack, spread over the half angles.
fn samples(scene: &Scene, seen: &[Seen], patches: usize) -> Vec<Sample> {
    let mut bins: Vec<Vec<Sample>> = vec![Vec::new(); patches * reduce::BINS];
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
        bins[patch * reduce::BINS + bin.min(reduce::BINS - 1)].push(Sample {
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

fn describe(measures: &[Measure], solved: &Solved) -> Vec<Corrected> {
    let name = |what: Unknown| match what {
        Unknown::Radius => ("radius of the can".to_owned(), 1.0, "mm"),
        Unknown::Lean => {
            ("lean of the axis in the picture".to_owned(), 180.0 / std::f64::consts::PI, "degrees")
        }
        Unknown::Nod => {
            ("tilt of the sample to the camera".to_owned(), 180.0 / std::f64::consts::PI, "degrees")
        }
        Unknown::Turn => ("turn of the sample".to_owned(), 180.0 / std::f64::consts::PI, "degrees"),
        Unknown::Across => ("middle of the sample, to the right".to_owned(), 1.0, "mm"),
        Unknown::Depth => ("middle of the sample, to the camera".to_owned(), 1.0, "mm"),
        Unknown::Light(i, axis) => (format!("lamp {}, {}", i + 1, ["x", "y", "z"][axis]), 1.0, "mm"),
        Unknown::Slip(i, k, axis) => {
            (format!("lamp {}, photograph {}, {}", i + 1, k + 1, ["across", "down"][axis]), 1.0, "pixels")
        }
    };
    let rows = measures.iter().enumerate().map(|(k, (what, tolerance))| {
        let (name, factor, unit) = name(*what);
        let variance: f64 = solved.uncertain.iter().map(|column| (column[k] - solved.moved[k]).powi(2)).sum();
        Corrected {
            name,
            unit: unit.to_owned(),
            by: factor * tolerance * solved.moved[k],
            tolerance: factor * tolerance,
            sigma: factor * tolerance * variance.sqrt(),
        }
    });
    rows.collect()
}

/// A correction beyond its tolerance: a slip of the tape or the pen.
fn mistakes(
    setup: &Setup,
    tape: &Scene,
    outline: &[[f64; 2]],
    measures: &[Measure],
    solved: &Solved,
) -> Result<(), MeasureError> {
    let far = |k: usize| solved.moved[k].abs() > MISTAKE;
    let radius = measures.iter().position(|(what, _)| *what == Unknown::Radius);
    if let (Some(k), Some(given), Some(found)) = (radius, setup.sample.radius_mm, solved.scene.radius()) {
        // The outline alone says whether the can is as wide as the tape: lamp and tilt have no part in it.
        let mut outside: Vec<f64> =
            outline.iter().map(|p| tape.outside_outline(p[0], p[1]) * tape.pixel_mm()).collect();
        let seen = outline.len() >= OUTLINED;
        let outside = crate::linear::median(&mut outside);
        let allowed = 2.0 * measures[k].1.hypot(setup.sample.centre_tolerance_mm);
        if far(k) || (seen && outside.abs() > allowed) {
            let fits = if seen { given + outside } else { found };
            return Err(MeasureError::Scene(format!(
                "sample.radius_mm: the setup file says {given}, but the can's outline and highlight fit {fits:.1} mm; measure the can \
                 with the print on it"
            )));
        }
    }
    match describe(measures, solved).into_iter().enumerate().find(|(k, _)| far(*k)) {
        Some((k, wrong)) if matches!(measures[k].0, Unknown::Slip(..)) => Err(MeasureError::Scene(format!(
            "the photographs do not fit each other: {} is off by {:.1} pixels after they were aligned; put the camera on a tripod and \
             photograph the series again",
            wrong.name, wrong.by
        ))),
        Some((_, wrong)) => Err(MeasureError::Scene(format!(
            "the pictures do not fit the setup file: {} is off by {:.1} {}, and its tolerance is {:.1}; measure the setup again",
            wrong.name, wrong.by, wrong.unit, wrong.tolerance
        ))),
        None => Ok(()),
    }
}

fn finish(
    setup: &Setup,
    tape: &Scene,
    patches: &[Stack],
    mut seen: Vec<Seen>,
    observer: &dyn Observer,
) -> Result<Taken, MeasureError> {
    observer.begin("fitting the geometry", 1);
    let measures = measures(setup, &seen);
    let outline: Vec<[f64; 2]> = seen.iter().flat_map(|seen| seen.outline.iter().copied()).collect();
    let solved = solve::solve(tape, &samples(tape, &seen, patches.len()), &outline, &measures);
    mistakes(setup, tape, &outline, &measures, &solved)?;
    observer.end();
    let trusted = setup.geometry == Trust::Known;
    let scene = if trusted { tape.clone() } else { solved.scene.clone() };
    // The card's irradiance follows the lamp.
    let scales = |scene: &Scene| -> Vec<f64> {
        let factor = |(light, seen): (usize, &Seen)| {
            middle_irradiance(scene, &seen.series.card, light)
                / middle_irradiance(tape, &seen.series.card, light)
        };
        seen.iter().enumerate().map(factor).collect()
    };
    let factors = scales(&scene);
    let doubts: Vec<(Scene, Vec<f64>)> = if trusted {
        Vec::new()
    } else {
        let doubtful = solved.uncertain.iter().map(|column| solve::apply(tape, &measures, column));
        doubtful
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
    observer.begin("making curves", patches.len() as u64);
    let mut stacks = Vec::new();
    let mut used = Vec::new();
    for (i, stack) in patches.iter().enumerate() {
        let pixels: Vec<Pixel> = seen.iter().flat_map(|seen| seen.pixels[i].iter().copied()).collect();
        let error = seen.iter().map(|seen| seen.series.card.error).fold(0.0, f64::max);
        let Reduced { rows, used: of_stack } = reduce::reduce(&scene, &pixels, &doubts, error.hypot(0.005));
        used.extend(of_stack);
        stacks.push(Measured { stack: stack.to_string(), rows });
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
    let geometry = Geometry {
        solved: !trusted,
        radius_mm: scene.radius(),
        lights_mm: scene.lights().to_vec(),
        measures: describe(&measures, &solved),
        misfit: if trusted { solved.before } else { solved.misfit },
        misfit_before: solved.before,
    };
    let series: Vec<Series> = seen.into_iter().map(|seen| seen.series).collect();
    let mut measurement = Measurement {
        by: setup.by.clone(),
        when: setup.when.clone(),
        setup: setup.sentence(),
        series,
        geometry,
        stacks,
        again: Vec::new(),
    };
    measurement.again = advice(&measurement);
    measurement.again.iter().for_each(|line| observer.note(line));
    Ok(Taken { measurement, pictures })
}

/// What a second try should do otherwise.
fn advice(measurement: &Measurement) -> Vec<String> {
    let mut again = Vec::new();
    for (i, series) in measurement.series.iter().enumerate() {
        let worst = series
            .card
            .deviation
            .iter()
            .flatten()
            .fold(0.0f64, |a, d| if d.abs() > a.abs() { *d } else { a });
        if worst.abs() > card::LINEAR {
            again.push(format!(
                "lamp {}: a step of the grey card is off by {:.0} %: keep other light from the card, and bright things out of the \
                 picture; see that the files have no tone curve",
                i + 1,
                100.0 * worst
            ));
        }
        let shortest = series.shots.last().map_or(0.0, |shot| shot.seconds);
        let clipped: Vec<&str> = measurement
            .stacks
            .iter()
            .filter(|stack| stack.rows.iter().any(|row| row.kind == Kind::Clipped))
            .map(|stack| &*stack.stack)
            .collect();
        if !clipped.is_empty() {
            again.push(format!(
                "{}: the highlight is clipped even at {}: add exposures 4 and 16 times as short",
                clipped.join(", "),
                seconds(shortest)
            ));
        }
        if series.shots.len() == 1 {
            again
                .push(format!("lamp {}: one exposure only: take at least three, a factor of 4 apart", i + 1));
        }
    }
    for stack in &measurement.stacks {
        let seen: Vec<&Row> = stack.rows.iter().filter(|row| row.kind != Kind::Extrapolated).collect();
        let (first, last) =
            (seen.first().map_or(90.0, |r| r.theta_deg), seen.last().map_or(0.0, |r| r.theta_deg));
        if first > 1.5 || last < 60.0 {
            again.push(format!(
                "stack {}: half angles from {first:.1} to {last:.0} degrees were seen, expected 1 to 60: a can covers more than a flat \
                 sheet, and a lamp beside the camera more than one far from it",
                stack.stack
            ));
        }
        if seen.iter().any(|row| row.kind == Kind::Blurred) {
            again.push(format!(
                "stack {}: the peak is narrower than a pixel or the lamp: use a smaller lamp, and let the can fill the picture",
                stack.stack
            ));
        }
        let noisy =
            seen.iter().filter(|row| (2.0..60.0).contains(&row.theta_deg) && row.sigma[1] > 0.1 * row.rgb[1]);
        if noisy.count() * 5 > seen.len() {
            again.push(format!(
                "stack {}: samples are uncertain by more than 10 %: add longer exposures",
                stack.stack
            ));
        }
    }
    if measurement.geometry.misfit > UNEVEN {
        again.push(format!(
            "pixels of the same half angle differ by {:.0} %: press the print smooth against the can, wipe off dust, and measure the \
             setup again",
            100.0 * measurement.geometry.misfit
        ));
    }
    again
}

/// A time as photographers write it.
pub(crate) fn seconds(time: f64) -> String {
    if time < 0.4 { format!("1/{:.0} s", 1.0 / time) } else { format!("{time:.1} s") }
}
