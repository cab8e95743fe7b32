//! Inks side by side: the paper's figures 2 and 5, and every stack as a patch to measure.

use std::str::FromStr;

use inks::{Library, Stack};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;

use super::error::ChartError;
use super::sketch::{LETTER, LINE, Sketch, mm};
use crate::layout::camera::{QUIET, SIDE};
use crate::separate::MOST_CARTRIDGES;
use halftone::Method;
use observe::Observer;
use sheet::DotMap;

/// Scale of labels: letters 3.4 mm high.
pub(super) const LABEL: usize = 4;

/// The four gloss levels of figure 5, relative to the highest.
const GLOSS: [f64; 4] = [1.0, 0.8, 0.5, 0.1];
/// The gloss of the two inks of figure 5.
const INKS: [f64; 2] = [0.5, 0.1];

/// What labels and checkerboards are printed in: black, unless the stacks fill all seven places without it.
pub(super) fn pen(stacks: &[&Stack]) -> Stack {
    let mut inks: Vec<Ink> = stacks.iter().flat_map(|stack| stack.layers().iter().copied()).collect();
    inks.sort_unstable();
    inks.dedup();
    let full = inks.len() >= MOST_CARTRIDGES && !inks.contains(&Ink::Black);
    let pigment = |ink: &&Ink| matches!(ink.kind(), Kind::Metallic | Kind::Foil | Kind::Process);
    let other = inks.iter().find(pigment).or(inks.first()).filter(|_| full);
    Stack::new([other.copied().unwrap_or(Ink::Black)])
}

pub(super) fn two(chart: &'static str, a: &Stack, b: &Stack) -> Result<(), ChartError> {
    if a == b {
        return Err(ChartError::Same { chart, stack: a.clone() });
    }
    Ok(())
}

/// The share of the glossier ink that shows a gloss: clamped to the nearest ink, or with all levels brought between the inks
/// so that their relative differences stay.
fn ladder_shares(gloss: f64) -> [f64; 2] {
    let [high, low] = INKS;
    let clamped = ((gloss - low) / (high - low)).clamp(0.0, 1.0);
    let least = GLOSS[GLOSS.len() - 1];
    [clamped, (gloss - least) / (GLOSS[0] - least)]
}

/// Lengths of the ladder in dots.
struct Rungs {
    patch: usize,
    line: usize,
    step: usize,
    block: usize,
    size: (usize, usize),
}

fn rungs() -> Rungs {
    let (patch, gap, line) = (mm(30.0), mm(4.0), LINE * LABEL);
    let step = patch + gap;
    let block = line + mm(1.0) + patch + mm(1.0) + line + mm(4.0);
    Rungs { patch, line, step, block, size: (GLOSS.len() * step - gap, 2 * block) }
}

/// Width and length of [`ladder`] in dots.
pub fn size_of_ladder() -> (usize, usize) {
    rungs().size
}

/// Figure 5: four levels of gloss between a glossier stack and a duller one, clamped above, mapped below. Above, three of
/// the four are the same.
pub fn ladder(
    glossy: &Stack,
    dull: &Stack,
    method: Method,
    library: &Library,
    observer: &dyn Observer,
) -> Result<DotMap, ChartError> {
    two("ladder", glossy, dull)?;
    let Rungs { patch, line, step, block, size } = rungs();
    let pen = pen(&[glossy, dull]);
    let mut sketch = Sketch::new(size.0, size.1);
    for (row, name) in ["clamped", "mapped"].into_iter().enumerate() {
        let top = row * block;
        sketch.text(0, top, LABEL, &pen, name);
        for (column, gloss) in GLOSS.into_iter().enumerate() {
            let place = (column * step, top + line + mm(1.0), patch, patch);
            let share = ladder_shares(gloss)[row];
            sketch.halftone(place, [glossy, dull], &[share], method.into(), library, observer)?;
            let label = format!("{:.0} %", 100.0 * gloss);
            sketch.text(place.0, place.1 + patch + mm(1.0), LABEL, &pen, &label);
        }
    }
    Ok(sketch.finish()?)
}

/// Side of a patch in millimetres.
const SQUARE: f64 = 20.0;
/// Height of a strip in millimetres: where a can has room for it, and the least that can be measured, its edges left out.
const STRIP: [f64; 2] = [12.0, 7.0];
/// Width of a strip in radii of the can: to its sides 52 degrees from the middle, so that a camera sees it whole, and the marks beside it.
const AROUND: f64 = 1.8;
/// Lines around a patch of bare paper, in dots: four tenths of a millimetre.
const FRAME: usize = 10;

/// A can that a chart goes round: `33x95`, its radius and the height of its straight part in millimetres; `33` alone for any height.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Can {
    /// Radius in mm, 20 to 110.
    pub radius: f64,
    /// Height in mm.
    pub height: Option<f64>,
}

impl FromStr for Can {
    type Err = String;

    fn from_str(text: &str) -> Result<Can, String> {
        let (radius, height) = text.split_once('x').map_or((text, None), |(r, h)| (r, Some(h)));
        let number = |text: &str| text.parse::<f64>().ok().filter(|mm| mm.is_finite() && *mm > 0.0);
        let can = number(radius)
            .filter(|radius| (20.0..=110.0).contains(radius))
            .zip(height.map_or(Some(None), |height| number(height).map(Some)));
        let (radius, height) = can.ok_or(
            "a can is its radius (20 to 110) and the height of its straight part in millimetres, such as 33x95, or its radius alone",
        )?;
        Ok(Can { radius, height })
    }
}

/// Every stack that these inks can make, a solid patch each, labelled, for a gloss meter or a camera; or a strip each, one below the
/// other, to wrap round a can. Bare paper, if it is among them, is the last, in a frame. Camera marks have room above and below.
///
/// Errors: more than the paper or the can has room for.
pub fn stacks(stacks: &[Stack], paper: Paper, can: Option<Can>) -> Result<DotMap, ChartError> {
    let marks = 2 * (SIDE + QUIET);
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()).saturating_sub(marks));
    let (mut shown, bare): (Vec<&Stack>, Vec<&Stack>) =
        stacks.iter().partition(|stack| !stack.layers().is_empty());
    shown.extend(bare.first());
    let gap = mm(4.0);
    let label = mm(1.0) + LINE * 3 + mm(3.0);
    let patch = match can {
        None => (mm(SQUARE), mm(SQUARE)),
        Some(can) => {
            let height = can.height.map_or(usize::MAX, |height| mm(height).saturating_sub(marks));
            let [most, least] = STRIP.map(mm);
            let long = (height / shown.len().max(1)).saturating_sub(label).min(most);
            if long < least {
                let most = height / (least + label);
                return Err(ChartError::Can { found: shown.len(), most });
            }
            (mm(AROUND * can.radius), long)
        }
    };
    let cell = (patch.0 + gap, patch.1 + label);
    let columns = if can.is_some() { 1 } else { ((width + gap) / cell.0).max(1) };
    let most = columns * (length / cell.1);
    if shown.iter().all(|stack| stack.layers().is_empty()) || shown.len() > most {
        return Err(ChartError::TooMany { what: "stacks", found: shown.len(), most });
    }
    let columns = columns.min(shown.len());
    let pen = pen(&shown);
    let mut sketch = Sketch::new(columns * cell.0 - gap, shown.len().div_ceil(columns) * cell.1);
    for (i, stack) in shown.into_iter().enumerate() {
        let (x, y) = (i % columns * cell.0, i / columns * cell.1);
        if stack.layers().is_empty() {
            sketch.fill((x, y, patch.0, patch.1), &pen);
            sketch.fill((x + FRAME, y + FRAME, patch.0 - 2 * FRAME, patch.1 - 2 * FRAME), stack);
        } else {
            sketch.fill((x, y, patch.0, patch.1), stack);
        }
        let label = stack.to_string();
        // As large as the patch has room for.
        let scale = (patch.0 / (label.len() * LETTER)).clamp(1, 3);
        sketch.text(x, y + patch.1 + mm(1.0), scale, &pen, &label);
    }
    Ok(sketch.finish()?)
}
