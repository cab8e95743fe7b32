//! Whether the pixels of a stack are enough for its curve, and what its curve lacks.
//!
//! A stack needs [`FEWEST`] pixels and a highlight: without the peak a curve says nothing of a foil. Half angles that no picture shows,
//! peaks narrower than a pixel, and samples that are uncertain are advice for a second try.

use inks::Stack;

use super::extent::Pixel;
use super::reduce::{CurveRow, SampleOrigin};
use crate::MeasureError;
use crate::geometry::scene::Scene;

/// The largest half angle at which a highlight counts as seen, in degrees: there a foil's (alpha .045) has
/// fallen to a twentieth, so that nothing farther off would tell its height.
const HIGHLIGHT: f64 = 5.0;
/// Pixels a stack must have.
const FEWEST: usize = 200;

/// Checks the pixels of a stack.
///
/// # Errors
/// Too few of them, or none in the highlight.
pub(crate) fn check<'p>(
    scene: &Scene,
    stack: &Stack,
    pixels: impl Iterator<Item = &'p Pixel>,
) -> Result<(), MeasureError> {
    let pixels: Vec<&Pixel> = pixels.collect();
    if pixels.len() < FEWEST {
        return Err(MeasureError::Scene(format!(
            "stack {stack}: {} usable pixels; it must lie on the sample, lit and seen: check rectangle_px (or sample.chart), sample.height_mm and \
             the camera's field of view",
            pixels.len()
        )));
    }
    let angles = pixels.iter().filter_map(|p| scene.view(p.x, p.y, p.light)).map(|v| v.theta.to_degrees());
    let least = angles.fold(f64::INFINITY, f64::min);
    if least > HIGHLIGHT {
        return Err(MeasureError::Scene(format!(
            "stack {stack}: no highlight in view, the smallest half angle is {least:.1} degrees; move the lamp toward the camera, \
             or turn the sample until the highlight crosses the stack"
        )));
    }
    Ok(())
}

/// Whether a curve's highlight is full in every photograph.
pub(crate) fn is_clipped(rows: &[CurveRow]) -> bool {
    rows.iter().any(|row| row.kind == SampleOrigin::Clipped)
}

/// What a second try should do for a stack's curve.
pub(crate) fn advice(stack: &str, rows: &[CurveRow]) -> Vec<String> {
    let mut again = Vec::new();
    let seen: Vec<&CurveRow> = rows.iter().filter(|row| row.kind != SampleOrigin::Extrapolated).collect();
    let (first, last) =
        (seen.first().map_or(90.0, |r| r.theta_deg), seen.last().map_or(0.0, |r| r.theta_deg));
    if first > 1.5 || last < 60.0 {
        again.push(format!(
            "stack {stack}: half angles from {first:.1} to {last:.0} degrees were seen, expected 1 to 60: a can covers more than a flat \
             sheet, and a lamp beside the camera more than one far from it"
        ));
    }
    if seen.iter().any(|row| row.kind == SampleOrigin::Blurred) {
        again.push(format!(
            "stack {stack}: the peak is narrower than a pixel or the lamp: use a smaller lamp, and let the can fill the picture"
        ));
    }
    let noisy = seen.iter().filter(|row| {
        (2.0..60.0).contains(&row.theta_deg) && (0..3).any(|c| row.sigma[c] > 0.1 * row.rgb[c])
    });
    if noisy.count() * 5 > seen.len() {
        again.push(format!("stack {stack}: samples are uncertain by more than 10 %: add longer exposures"));
    }
    again
}
