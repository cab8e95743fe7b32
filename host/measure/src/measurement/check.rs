//! A look at the first photographs, before the series is taken: what is right so far, and what to mend.
//!
//! Problem: a measurement that is refused wants the whole studio again. Method: the same steps on whatever photographs there are; a
//! problem of one lamp does not hide those of the others. Where nothing is wrong the curves are made, too, for what they advise.
//! Limits: what only the later photographs show (a camera that moves, white balance that drifts) is not seen yet.

use std::path::Path;

use observe::Observer;
use sheet::DotMap;

use super::finish;
use super::look::{Looked, look};
use crate::MeasureError;
use crate::camera::series;
use crate::curves::blur;
use crate::curves::card::LINEAR;
use crate::setup::Setup;

/// What photographs say of a studio.
#[derive(Clone, Default, Debug)]
pub struct Check {
    /// What is right.
    pub good: Vec<String>,
    /// What to mend, in the order in which it was found.
    pub mend: Vec<String>,
}

/// Checks the photographs of a folder, of which there may be one. `chart` as in [`measure`](super::measure).
///
/// # Errors
/// A folder, a setup or frames that cannot be read.
pub fn check(
    folder: &Path,
    setup: &Setup,
    chart: Option<&DotMap>,
    observer: &dyn Observer,
) -> Result<Check, MeasureError> {
    let mut found = Check::default();
    let mut problems = Vec::new();
    let looked = look(folder, setup, chart, observer, &mut |error| {
        problems.push(error.to_string());
        Ok(())
    });
    match looked {
        Ok(mut looked) => {
            found.series(&looked);
            // Where the card is not found no stack is looked at.
            let hidden = if looked.seen.is_empty() { Vec::new() } else { looked.leave_out_hidden() };
            let stacks: Vec<String> = looked.stacks.iter().map(ToString::to_string).collect();
            if !stacks.is_empty() && !looked.seen.is_empty() {
                found.good.push(format!("seen with their highlight: {}", stacks.join(", ")));
            }
            problems.extend(hidden.iter().map(ToString::to_string));
            if problems.is_empty() {
                match finish(setup, looked, observer) {
                    Ok(taken) => {
                        found.good.push("the measures of the tape fit the photographs".into());
                        problems.extend(taken.measurement.again);
                    }
                    Err(error) => problems.push(error.to_string()),
                }
            } else {
                for seen in &looked.seen {
                    let lamp = seen.light + 1;
                    problems.extend(seen.series.card.advice(lamp));
                    problems.extend(blur::advice(seen.series.blur, lamp));
                }
            }
        }
        // Each lamp's own problem says more.
        Err(error) if problems.is_empty() => problems.push(error.to_string()),
        Err(_) => {}
    }
    if setup.photos.lamp_off.is_none() {
        problems.push(
            "no photograph with the lamp off: take one at the longest exposure, and name it as photos.lamp_off in the setup file".into(),
        );
    }
    found.mend = problems;
    Ok(found)
}

impl Check {
    fn series(&mut self, looked: &Looked) {
        for seen in &looked.seen {
            let lamp = seen.light + 1;
            let shots = &seen.series.shots;
            if let (Some(longest), Some(shortest)) = (shots.first(), shots.last()) {
                let (longest, shortest) =
                    (series::seconds(longest.seconds), series::seconds(shortest.seconds));
                self.good.push(match shots.len() {
                    1 => format!("lamp {lamp}: one photograph, of {longest}"),
                    n => format!("lamp {lamp}: {n} exposures from {longest} to {shortest}"),
                });
            }
            let card = &seen.series.card;
            let worst = card.deviation.iter().flatten().fold(0.0f64, |worst, d| worst.max(d.abs()));
            if worst <= LINEAR {
                self.good.push(format!(
                    "lamp {lamp}: the grey card is found, and its steps agree within {:.1} %",
                    100.0 * worst
                ));
            }
            if blur::advice(seen.series.blur, lamp).is_none() {
                self.good.push(format!(
                    "lamp {lamp}: the card's edges are sharp to {:.1} pixels",
                    seen.series.blur
                ));
            }
        }
    }
}
