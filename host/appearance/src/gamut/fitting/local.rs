//! Local gamut mapping: outside the gamut, differences between neighbours are kept at the price of closeness.
//!
//! Problem: clamping takes every material outside the gamut to the nearest point of its surface, so scratches, grain and
//! steps of gloss that point outwards vanish.
//! Method: with r the difference between print and target in cube roots (where the metric is Euclidean), minimise
//! `sum_x |r_x|^2 / f_x + mu sum_x sum_j B_xj |r_x - c_j|^2` over printable mixtures and the free vectors c_j, one for each
//! of the overlapping [`Regions`] with membership B. Without c, which is the mean of r over its region, the second sum is
//! `|(print_x - print_y) - (target_x - target_y)|^2` over all pairs of a region: the gradient-domain term of local mapping,
//! with all pairs instead of the four neighbours. For a given c each pixel is equation 1 with its target moved by
//! `mu f / (1 + mu f)` of the mean c around it; for given mixtures c is a mean. The two alternate, so the objective
//! falls with each sweep, all pixels are solved at once, and the result does not depend on the number of threads.
//! The freedom f is 0 in the gamut, where the clamped mixture stays, and 1 outside, with a smooth step between.
//! A flat material needs no room and is clamped: moving its target against its own r leads to the same point.
//! The vectors c are found on a quarter of the pixels.
//! Cost: two to three fits of each pixel outside the gamut, from its own last mixture; 5 bytes a pixel and kind of material. Limits: differences that no shift can make printable stay lost; differences over more than two cells are not
//! seen, so a ladder of wide steps is mapped as by clamping.
//! Source: Pereira & Rusinkiewicz 2012 for keeping contrast; half-quadratic splitting (Geman & Yang 1995) for the method.

mod regions;
#[cfg(test)]
mod tests;

use observe::Observer;
use rayon::prelude::*;

use self::regions::{CELL, Membership, Regions, Sums};
use super::clamp::Clamped;
use super::refit::{Solver, in_pixel};
use crate::brdf::Table;
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::gamut::sample;
use crate::materials::Materials;
use crate::weights::quantise;

/// The weight of contrast, mu: 4 keeps less of it, 32 hardly more and costs distance
/// (decisions/contrast-between-neighbours.md).
const CONTRAST: f64 = 16.0;
/// Sweeps over a part of the pixels, and how many pixels one stands for: means over a window need no more. A last sweep
/// solves all.
const SWEEPS: u32 = 5;
/// How many pixels one of a sweep stands for: the means over a window of 32 x 32 need no more.
const EVERY: u32 = 4;
/// The distance up to which the clamped mixture stays bit for bit (decisions/contrast-between-neighbours.md):
/// half of what is barely visible.
const EXACT: f64 = 0.005;
/// The distance from which a pixel moves freely (decisions/contrast-between-neighbours.md): twice what is
/// barely visible.
const FREE: f64 = 0.02;
/// Pixels by which the kinds of materials are found, and the seed of their choice.
const SAMPLE: usize = 1024;
/// The seed of the choice of that sample: any would do, as long as it is the same each time.
const SEED: u64 = 1;

/// Replaces the clamped mixtures of pixels outside the gamut, and their distances, by those that keep contrast. Returns the
/// share of pixels that keep their clamped mixture.
pub(crate) fn keep_contrast(
    candidates: &Candidates,
    pixels: &dyn Materials,
    clamped: &mut Clamped,
    observer: &dyn Observer,
) -> Result<f64, GamutError> {
    let free: Vec<f32> = clamped.distance.iter().map(|&d| freedom(f64::from(d)) as f32).collect();
    let kept = free.iter().filter(|&&f| f == 0.0).count() as f64 / free.len() as f64;
    if kept == 1.0 {
        return Ok(kept);
    }
    let mut regions = Regions::new(pixels.width(), pixels.height(), &looks(candidates, pixels)?);
    observer.begin("keeping contrast outside the gamut", u64::from(SWEEPS + 1 + EVERY));
    for sweep in 0..=SWEEPS {
        let pass = if sweep == 0 { Pass::Measure } else { Pass::Solve };
        let sums = run(candidates, pixels, clamped, &free, &regions, pass, EVERY)?;
        regions.take_means(&sums);
        observer.advance(1);
    }
    run(candidates, pixels, clamped, &free, &regions, Pass::Finish, 1)?;
    observer.advance(u64::from(EVERY));
    observer.end();
    Ok(kept)
}

/// How freely a pixel moves whose clamped mixture is at this distance, 0..=1.
fn freedom(distance: f64) -> f64 {
    let t = ((distance - EXACT) / (FREE - EXACT)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// What a run over the pixels does with each.
#[derive(Clone, Copy, PartialEq)]
enum Pass {
    /// Measure what clamping misses. A pixel counts by the square of its distance: with room for the farthest ones, the
    /// sweeps need not feel their way inwards.
    Measure,
    /// Solve.
    Solve,
    /// Solve, leave out small weights, note the distance.
    Finish,
}

/// Looks of sampled pixels.
fn looks(candidates: &Candidates, pixels: &dyn Materials) -> Result<Table, GamutError> {
    let mut solver = Solver::new(candidates, pixels);
    let mut looks = Table::new(solver.look.len());
    for pixel in sample::pixels(pixels.width() * pixels.height(), SAMPLE, SEED) {
        solver.aim(pixel).map_err(in_pixel(pixel, pixels.width()))?;
        looks.push(&solver.look);
    }
    Ok(looks)
}

/// Whether a pixel is one of those drawn from every so many.
fn drawn(pixel: usize, every: u32) -> bool {
    ((pixel as u32).wrapping_mul(0x9e37_79b1) >> 8).is_multiple_of(every)
}

/// One pass over the pixels, or one of `every` so many. Returns the sums of what each row of cells misses.
fn run(
    candidates: &Candidates,
    pixels: &dyn Materials,
    clamped: &mut Clamped,
    free: &[f32],
    regions: &Regions,
    pass: Pass,
    every: u32,
) -> Result<Vec<Sums>, GamutError> {
    let (width, k) = (pixels.width(), candidates.len());
    let length = CELL * width;
    let shares = clamped.shares.par_chunks_mut(length * k);
    let seen = clamped.distance.par_chunks_mut(length).zip(clamped.light.par_chunks_mut(length));
    let rows = shares.zip(seen).zip(free.par_chunks(length)).enumerate();
    rows.map(|(row, ((shares, (distance, light)), free))| {
        let mut solver = Solver::new(candidates, pixels);
        let mut place = Membership::default();
        let mut sums = regions.sums(row);
        let seen = distance.iter_mut().zip(light);
        for (i, ((shares, (distance, light)), &free)) in
            shares.chunks_exact_mut(k).zip(seen).zip(free).enumerate()
        {
            let pixel = row * length + i;
            if !drawn(pixel, every) {
                continue;
            }
            solver.aim(pixel).map_err(in_pixel(pixel, width))?;
            regions.locate(pixel % width, pixel / width, &solver.look, &mut place);
            if free > 0.0 {
                solver.start(shares);
                if pass != Pass::Measure {
                    regions.read(&place, &mut solver.shift);
                    let pull = CONTRAST * f64::from(free);
                    solver
                        .solve(pull / (1.0 + pull), pass == Pass::Finish)
                        .map_err(in_pixel(pixel, width))?;
                    quantise(&solver.weights, shares);
                }
                let d = solver.compare() as f32;
                if pass == Pass::Finish {
                    *distance = d;
                    *light = solver.light() as f32;
                }
                let weight = if pass == Pass::Measure { d * d } else { 1.0 };
                sums.add(&place, weight, &solver.miss);
            } else {
                let weight = if pass == Pass::Measure { (EXACT * EXACT) as f32 } else { 1.0 };
                sums.add(&place, weight, &solver.nothing);
            }
        }
        Ok(sums)
    })
    .collect()
}
