//! What a second try should do otherwise, and what is behind photographs that do not fit.

use crate::MeasureError;
use crate::camera::series;
use crate::curves::{blur, coverage, reduce};
use crate::geometry::measures;
use crate::geometry::scene::Scene;
use crate::setup::Setup;

use super::Measurement;
use super::look::SeriesRecord;

/// A share of other light that is worth a word: as much as a curve may be off
/// (decisions/curves-from-photographs.md).
const FOREIGN: f64 = 0.03;

/// A series that does not fit its setup file may be one under other light or out of focus: where the dark side of the can or the card shows that,
/// the refusal says so first.
pub fn likelier(error: MeasureError, tape: &Scene, seen: &[SeriesRecord]) -> MeasureError {
    let foreign = seen.iter().enumerate().any(|(i, seen)| {
        let grey = seen.series.card.irradiance(tape, i) / std::f64::consts::PI;
        let shadow = seen.series.shadow.as_ref().map_or(0.0, |shadow| shadow.level[1]);
        shadow > FOREIGN * grey * seen.series.card.darkest || seen.series.card.advice(i + 1).is_some()
    });
    let widest = seen.iter().map(|seen| seen.series.blur).fold(0.0, f64::max);
    let cause = if foreign {
        "other light than the lamp's falls on the can or the card, and the geometry does not fit it; cover the table with black cloth, darken \
         the room, and give a photograph with the lamp off (photos.lamp_off)"
            .to_owned()
    } else if let Some(blurred) = blur::advice(widest, 1) {
        blurred
    } else {
        return error;
    };
    MeasureError::Scene(format!("{cause}. Otherwise: {error}"))
}

/// What the dark side of the can says of the light.
pub fn light(setup: &Setup, scene: &Scene, measurement: &Measurement) -> Vec<String> {
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
pub fn of(measurement: &Measurement) -> Vec<String> {
    let mut again = Vec::new();
    for (i, series) in measurement.series.iter().enumerate() {
        let clipped = measurement.stacks.iter().filter(|stack| coverage::is_clipped(&stack.rows));
        let clipped: Vec<&str> = clipped.map(|stack| &*stack.stack).collect();
        again.extend(series.card.advice(i + 1));
        again.extend(blur::advice(series.blur, i + 1));
        again.extend(series::advice(&series.shots, i + 1, &clipped));
    }
    again.extend(measurement.stacks.iter().flat_map(|stack| coverage::advice(&stack.stack, &stack.rows)));
    again.extend(measures::advice(measurement.geometry.misfit));
    again
}
