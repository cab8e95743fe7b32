//! What was measured with a tape: how far pictures may correct each measure, and whether a correction can be believed.
//!
//! Method: every unknown of the scene has a tolerance, the setup's or a usual one. A correction beyond [`MISTAKE`] tolerances is a slip of
//! the tape or of the pen, and an error that names the measure. The radius of a can is judged by its outline alone, for lamp and tilt have
//! no part in that. Limits: a mistake within its tolerance is corrected, or stays.

use serde::{Deserialize, Serialize};

use super::correction::{Measure, Solved};
use super::scene::{Scene, Unknown};
use crate::MeasureError;
use crate::camera::merge::Shot;
use crate::linalg::median;
use crate::setup::{SampleShape, Setup};

/// A correction beyond this many tolerances is a mistake: a tolerance is a standard deviation, and three of
/// them would be chance once in 370 times.
const MISTAKE: f64 = 3.0;
/// What the alignment of photographs that were moved may leave, in pixels.
const SLIP: f64 = 0.15;
/// Places on the outline that are enough to judge the radius by.
const OUTLINED: usize = 8;
/// Deviation of pixels of one half angle that is worth a word.
const UNEVEN: f64 = 0.12;

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

/// What the pictures may correct, with the setup's tolerances: the scene, and photographs of a series that were moved.
pub(crate) fn measures(setup: &Setup, series: &[&[Shot]]) -> Vec<Measure> {
    let sample = &setup.sample;
    let tilt = sample.tilt_tolerance_deg.to_radians();
    let mut measures = vec![(Unknown::Nod, tilt), (Unknown::Depth, sample.centre_tolerance_mm)];
    match sample.shape {
        SampleShape::Cylinder => {
            let radius = sample.radius_mm.unwrap_or(1.0);
            measures.push((Unknown::Radius, sample.radius_tolerance_mm.unwrap_or(0.015 * radius)));
            measures.push((Unknown::Lean, tilt));
            measures.push((Unknown::Across, sample.centre_tolerance_mm));
        }
        SampleShape::Flat => measures.push((Unknown::Turn, tilt)),
    }
    for (i, light) in setup.light.iter().enumerate() {
        measures.extend((0..3).map(|axis| (Unknown::Light(i, axis), light.tolerance_mm)));
    }
    for (i, shots) in series.iter().enumerate() {
        let moved: Vec<bool> = shots.iter().map(|shot| shot.shift != [0.0; 2]).collect();
        let shots = (0..moved.len()).filter(|&k| moved[k]);
        measures.extend(shots.flat_map(|k| [0, 1].map(|axis| (Unknown::Slip(i, k, axis), SLIP))));
    }
    measures
}

/// Each measure in words, with its correction.
pub(crate) fn describe(measures: &[Measure], solved: &Solved) -> Vec<Corrected> {
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

/// Finds mistakes of the tape or of the pen.
///
/// # Errors
/// A correction far beyond its tolerance; it says what to measure again.
pub(crate) fn check(
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
        let outside = median(&mut outside);
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

/// What the misfit of the corrected scene says of the print.
pub(crate) fn advice(misfit: f64) -> Option<String> {
    (misfit > UNEVEN).then(|| {
        format!(
            "pixels of the same half angle differ by {:.0} %: press the print smooth against the can, wipe off dust, and measure the \
             setup again",
            100.0 * misfit
        )
    })
}
