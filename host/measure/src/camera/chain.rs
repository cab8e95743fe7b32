//! How the photographs of a series follow each other: shifts and exposures, from comparisons of neighbours in exposure.
//!
//! Problem: a series must be of one scene, one lamp and one camera that stood still or nearly so, and its files proportional to light.
//! Method: each photograph is compared with the next longer one; what does not fit is an error with its likeliest cause. A shift counts where
//! it is beyond the comparison's own error (see `align`). Cost: a comparison for each photograph. Limits: photographs without a tone in
//! common are taken as their times say, if the camera stood still.

use observe::Observer;
use rayon::prelude::*;

use super::align::{Match, Tones};
use super::exposure::Exposure;
use super::response::Response;
use crate::MeasureError;

/// The largest shift that is aligned, in picture widths: a camera that moved farther sees the can from
/// elsewhere, which no shift would undo.
const MOST_SHIFT: f64 = 0.02;
/// The part of strange blocks from which photographs show different things.
const STRANGE: f64 = 0.06;
/// Blocks that must be comparable before a comparison counts.
const COMPARABLE: usize = 150;
/// The largest deviation of an exposure from what its file says, as a logarithm: a third of a stop is 0.23.
const MOST_RATIO: f64 = 0.4;
/// A difference of ratios between dark and bright tones that linear values do not have.
const BENT: f64 = 0.06;
/// A shift is one from so many standard errors (decisions/curves-from-photographs.md).
const SURE: f64 = 4.0;
/// A difference of colours between photographs that is one of white balance, as a logarithm: twice the 0.5 % by which a card's scale is
/// uncertain anyway.
const DRIFTS: f64 = 0.01;
/// The same where the response of each channel was recovered, which leaves some per cent between tones, so
/// that less could not be told.
const CURVED_DRIFTS: f64 = 0.05;

/// A photograph against the series.
#[derive(Clone, Copy)]
pub(crate) struct Link {
    pub(crate) shift: [f64; 2],
    /// Its standard error, against the photograph in the middle of the series.
    pub(crate) shift_error: [f64; 2],
    pub(crate) ratio: f64,
}

/// Shifts and exposures of all photographs, from comparisons of neighbours in exposure.
///
/// # Errors
/// Photographs that moved, show something else, or whose exposures, white balance or values are wrong; each is named.
pub(crate) fn links(
    exposures: &[Exposure],
    tones: &[Tones],
    width: usize,
    response: &Response,
    observer: &dyn Observer,
) -> Result<Vec<Link>, MeasureError> {
    let strange = |found: &Match| found.compared >= COMPARABLE && found.strange > STRANGE;
    let unrecovered = if matches!(response, Response::Linear) {
        ""
    } else {
        ", or the response of these JPEG files could not be recovered (develop RAW to 16-bit TIFF)"
    };
    let neighbours: Vec<Match> =
        (1..tones.len()).into_par_iter().map(|i| tones[i - 1].compare(&tones[i])).collect();
    let mut chain = vec![Link { shift: [0.0; 2], shift_error: [0.0; 2], ratio: 0.0 }];
    let mut alone = None;
    for (i, found) in (1..).zip(&neighbours) {
        let (name, path) = (exposures[i - 1].name(), &exposures[i].path);
        let largest = MOST_SHIFT * width as f64;
        let moved = found.shift.iter().any(|d| d.abs() > largest);
        if found.compared < COMPARABLE {
            observer.note(&format!(
                "{} and {name} share too few tones to be compared, so their exposure times are taken as they stand",
                exposures[i].name()
            ));
            let last = chain[i - 1];
            chain.push(last);
            alone.get_or_insert(i);
            continue;
        }
        if strange(found) {
            // The one that does not match others either is the stranger.
            let others = [
                i.checked_sub(2).map(|j| tones[j].compare(&tones[i])),
                tones.get(i + 1).map(|t| tones[i].compare(t)),
            ];
            let fits = others.iter().flatten().any(|m| m.compared >= COMPARABLE && !strange(m));
            let culprit = if fits { &exposures[i - 1].path } else { path };
            let other = if fits { exposures[i].name() } else { name };
            return Err(MeasureError::photo(
                culprit,
                format!(
                    "shows something else than {other} ({:.0} % of the picture differs), so it belongs to another series, or the \
                     camera or the lamp was moved{}; take it away or photograph the series again",
                    100.0 * found.strange,
                    unrecovered
                ),
            ));
        }
        if moved {
            return Err(MeasureError::photo(
                path,
                format!(
                    "the camera moved by {:.1}, {:.1} pixels since {name}; at most {largest:.0} are aligned: put the camera on a \
                     tripod and photograph the series again",
                    found.shift[0], found.shift[1]
                ),
            ));
        }
        let least = if matches!(response, Response::Linear) { DRIFTS } else { CURVED_DRIFTS };
        let drifts = |k: usize| found.balance[k].abs() > least.max(SURE * found.balance_error[k]);
        if let Some((k, colour)) = [(0, "red"), (1, "blue")].into_iter().find(|(k, _)| drifts(*k)) {
            return Err(MeasureError::photo(
                path,
                format!(
                    "its white balance is not that of {name}: {} is {:+.1} % of green off{unrecovered}; fix the camera's white balance (and the \
                     lamp's colour), or develop all photographs with the same one",
                    colour,
                    100.0 * found.balance[k].exp_m1()
                ),
            ));
        }
        if found.ratio.abs() > MOST_RATIO {
            return Err(MeasureError::photo(
                path,
                format!(
                    "is {:.2} times as bright as its exposure time of {} s promises; expected the time that was set, with lamp, \
                     aperture and sensitivity unchanged",
                    found.ratio.exp(),
                    exposures[i].seconds
                ),
            ));
        }
        if found.bend.abs() > BENT && matches!(response, Response::Linear) {
            return Err(MeasureError::photo(
                path,
                format!(
                    "its values are not proportional to light (dark and bright tones differ by {:.0} % from {name}); develop it \
                     without a tone curve, or set photos.linear = false",
                    100.0 * found.bend.abs()
                ),
            ));
        }
        let last = chain[i - 1];
        // Still cameras stay still: a comparison's own error is no shift.
        let still = (0..2).all(|axis| found.shift[axis].abs() < SURE * found.shift_error[axis]);
        let shift = if still { [0.0; 2] } else { found.shift };
        // Variances of neighbours add up, and what was no shift may have been one.
        let error = |axis: usize| {
            let own = if still { found.shift[axis] } else { 0.0 };
            last.shift_error[axis].hypot(found.shift_error[axis].hypot(own))
        };
        let ratio = if found.error < 0.01 { found.ratio } else { 0.0 };
        chain.push(Link {
            shift: [last.shift[0] + shift[0], last.shift[1] + shift[1]],
            shift_error: [0, 1].map(error),
            ratio: last.ratio + ratio,
        });
    }
    let moved = chain.iter().flat_map(|link| link.shift).fold(0.0f64, |most, d| most.max(d.abs()));
    if let Some(i) = alone.filter(|_| moved > 0.0) {
        return Err(MeasureError::photo(
            &exposures[i].path,
            format!(
                "cannot be aligned: the camera moved by {moved:.1} pixels during the series, and too few tones are alike in this \
                 photograph and {}; put the camera on a tripod and photograph the series again",
                exposures[i - 1].name()
            ),
        ));
    }
    // The photograph in the middle of the series is where the setup's positions hold.
    let middle = chain[chain.len() / 2];
    for link in &mut chain {
        link.shift = [0, 1].map(|axis| link.shift[axis] - middle.shift[axis]);
        link.shift_error = [0, 1]
            .map(|axis| (link.shift_error[axis].powi(2) - middle.shift_error[axis].powi(2)).abs().sqrt());
    }
    let along = |axis: usize| chain.iter().map(move |link| link.shift[axis]);
    for axis in 0..2 {
        let (least, most) = (along(axis).fold(f64::MAX, f64::min), along(axis).fold(f64::MIN, f64::max));
        if most - least > MOST_SHIFT * width as f64 {
            return Err(MeasureError::Scene(format!(
                "the camera moved by {:.1} pixels during the series; at most {:.0} are aligned: put it on a tripod and photograph \
                 the series again",
                most - least,
                MOST_SHIFT * width as f64
            )));
        }
    }
    Ok(chain)
}
