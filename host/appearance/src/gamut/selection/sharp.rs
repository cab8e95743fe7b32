//! Materials that reflect more sharply than any ink, and how much light counts for them.
//!
//! Problem: where no ink is as sharp, every mixture misses the highlight, and the metric takes a wide lobe
//! for as far off as none; smooth silver came out as a black ball.
//! Method: materials whose peak no stack reaches are fitted with light counting 1 to 4 times ([`TIMES`]),
//! and the mixture counts whose ball looks most like that of the material under four lights ([`Balls`]). If
//! one of them gains a fifth by that, it is done for all, so that what is sharper is not darker.
//! Cost: six fits for each such material, and the matrix of the balls, in such documents alone. Limits: a
//! material is judged by itself.

use rayon::prelude::*;

use crate::brdf::Space;
use crate::gamut::balls::Balls;
use crate::gamut::candidates::Candidates;
use crate::gamut::shine::Shine;
use crate::gamut::things::Things;
use crate::materials::words;
use crate::solve::{Mixer, MixtureError};
use crate::srgb::luminance;
use maths::Maths as _;

/// How many times light may count: steps of a root of two, up to where light is all that counts.
const TIMES: [f64; 5] = [1.0, std::f64::consts::SQRT_2, 2.0, 2.0 * std::f64::consts::SQRT_2, 4.0];
/// Light counts more if some ball looks so much better, by a fifth, or if the intent asks for it.
/// Source: a choice, the same as for blending.
const HELPS: f64 = 0.8;
/// Gap in squared distance that decides nothing. Source: a hundredth of what is barely visible, squared.
const ENOUGH: f64 = 1e-8;
/// The most materials that a sentence is said about. Source: a choice; more are not read.
const SAID: usize = 3;

/// What became of a material.
struct Judged {
    times: f64,
    /// Whether its ball gains enough.
    gains: bool,
    /// Its print without that, and with it.
    plain: Vec<f64>,
    printed: Vec<f64>,
}

/// Judges the materials of a document, and says what is done. `None` if none gains; `asked` if any gain
/// will do.
pub(crate) fn find(
    space: &Space,
    things: &Things,
    stacks: &Candidates,
    asked: bool,
) -> Result<(Option<Shine>, Vec<String>), MixtureError> {
    let peak = |row: &[f64]| luminance([row[0], row[1], row[2]]);
    let sharpest = stacks.curves.rows().map(peak).fold(0.0, f64::max);
    let sharp: Vec<usize> = (0..things.rows.len()).filter(|&i| peak(things.rows.row(i)) > sharpest).collect();
    if sharp.is_empty() {
        return Ok((None, Vec::new()));
    }
    let balls = Balls::new(space);
    let judge = |mixer: &mut Mixer, &i: &usize| judge(&balls, things.rows.row(i), stacks, mixer);
    let judged: Result<Vec<Judged>, MixtureError> = sharp.par_iter().map_init(Mixer::new, judge).collect();
    let judged = judged?;
    if !asked && !judged.iter().any(|judged| judged.gains) {
        return Ok((None, Vec::new()));
    }
    let (mut times, mut said) = (vec![1.0; things.rows.len()], Vec::<(String, String)>::new());
    for (&i, Judged { times: found, gains, plain, printed }) in sharp.iter().zip(judged) {
        times[i] = found;
        let target = things.rows.row(i);
        let name = words(space, target);
        if (gains || asked)
            && found > 1.0
            && said.len() < SAID
            && said.iter().all(|(other, _)| *other != name)
        {
            let light = |row: &[f64]| luminance(space.albedo(row)) / luminance(space.albedo(target));
            let (light, before) = (light(&printed), light(&plain));
            let sentence = match (words(space, &printed), words(space, &plain)) {
                (now, then) if now == then => format!("with {light:.2} of its light and not {before:.2}"),
                (now, then) => format!("as {now} ({light:.2} of the light) and not as {then} ({before:.2})"),
            };
            let sentence = format!("{name}: no ink is as sharp; printed {sentence}");
            said.push((name, sentence));
        }
    }
    if said.is_empty() {
        return Ok((None, Vec::new()));
    }
    let rows = things.rows.rows().zip(times);
    let known = rows.map(|(row, times)| Ok((stacks.free.target(row)?.summary(&stacks.free), times)));
    let shine = Shine(known.collect::<Result<_, MixtureError>>()?);
    Ok((Some(shine), said.into_iter().map(|(_, sentence)| sentence).collect()))
}

/// Finds how many times light counts for a material: by the least error of [`TIMES`], and the vertex of the
/// parabola through it and its neighbours.
fn judge(balls: &Balls, row: &[f64], stacks: &Candidates, mixer: &mut Mixer) -> Result<Judged, MixtureError> {
    let mut tried = Vec::with_capacity(TIMES.len());
    for times in TIMES {
        let printed = printed(row, times, stacks, mixer)?;
        tried.push((balls.apart(row, &printed), printed));
    }
    let errors: Vec<f64> = tried.iter().map(|(error, _)| *error).collect();
    let (plainly, plain) = tried.swap_remove(0);
    let least = (0..TIMES.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
    let off = match errors.get(least.wrapping_sub(1)..least + 2) {
        Some(&[before, here, after]) => 0.5 * (before - after) / (before - 2.0 * here + after),
        _ => 0.0,
    };
    let times = TIMES[least] * (0.5 * off).exponential2();
    let printed = printed(row, times, stacks, mixer)?;
    let gains = balls.apart(row, &printed) <= HELPS * plainly;
    Ok(Judged { times, gains, plain, printed })
}

/// The reflectance (1/sr) of the mixture for a material for which light counts so many times.
fn printed(
    row: &[f64],
    times: f64,
    stacks: &Candidates,
    mixer: &mut Mixer,
) -> Result<Vec<f64>, MixtureError> {
    let (hull, mut weights) = (&stacks.priced, vec![0.0; stacks.len()]);
    let mut target = hull.target(row)?;
    target.light = times;
    mixer.tangent(hull, &target, &mut weights)?;
    let fit = mixer.refine_beyond(hull, &target, &mut weights, ENOUGH)?;
    stacks.brightness.settle(mixer, hull, &target, &mut weights, fit, ENOUGH)?;
    Ok(stacks.reflectance(weights.into_iter()))
}
