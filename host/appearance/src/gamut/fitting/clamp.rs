//! Mapping every pixel by eq. 1.
//!
//! Problem: a million constrained fits in the perceptual metric, which takes hours or days according to the
//! 2009 paper.
//! Method: each distinct material, in reading order, starts from the mixture of the most similar one of the
//! last few hundred ([`WarmStarts`]). Two or three steps, with half a dozen stacks in the quadratic and the
//! gradient of all stacks, reach a gap below 1e-7 in squared distance. Stacks that are rare and seen are
//! left out and the others solved again. Each thread takes whole runs of fixed length, so the result does
//! not depend on the number of threads.
//! Cost: about 7 microseconds per distinct material and core. Limits: the start matters where F is not
//! convex; there the certificate holds only for the local minimum that was found, which is the better of
//! two where hue has a price.

use rayon::prelude::*;

use super::warm_start::WarmStarts;
use crate::brdf::{Space, Table};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::materials::{Distinct, Materials};
use crate::solve::{Mixer, MixtureError, Target};
use crate::weights::quantise;
use observe::Observer;

/// Materials per run: a run starts with nothing to start from, and thousands of cores are not expected.
const RUN: usize = 8192;
/// An invisible gap in squared distance: at d = 0.01 it is 5e-6 in d. A tenth of the price of a layer,
/// which decides ties.
pub(crate) const ENOUGH: f64 = 1e-7;

/// The mixture of every pixel over the candidates.
pub(crate) struct Clamped {
    /// Interleaved fixed-point weights, one per candidate; those of each pixel sum to
    /// [`ONE`](crate::weights::ONE).
    pub shares: Vec<u16>,
    /// Distance d between each pixel and its mixture.
    pub distance: Vec<f32>,
    /// Distance in light between them.
    pub light: Vec<f32>,
    /// Mean cube root of the radiance of each pixel in the metric: its perceived brightness.
    pub brightness: Vec<f32>,
    /// The largest gap, in squared distance.
    pub gap: f64,
}

pub(crate) fn map(
    candidates: &Candidates,
    pixels: &dyn Materials,
    observer: &dyn Observer,
) -> Result<Clamped, GamutError> {
    let (width, k) = (pixels.width(), candidates.len());
    let distinct = Distinct::find(pixels);
    let count = distinct.first().len();
    let mut shares = vec![0u16; count * k];
    let mut distance = vec![0f32; count];
    let mut light = vec![0f32; count];
    let mut brightness = vec![0f32; count];
    observer.begin("fitting pixels to inks", count as u64);
    let gaps: Vec<Result<f64, GamutError>> = shares
        .par_chunks_mut(RUN * k)
        .zip(distance.par_chunks_mut(RUN).zip(light.par_chunks_mut(RUN)))
        .zip(brightness.par_chunks_mut(RUN))
        .zip(distinct.first().par_chunks(RUN))
        .map(|(((shares, (distance, light)), brightness), first)| {
            let mut walker = Walker::new(candidates, pixels.space());
            let mut gap = 0.0f64;
            for (i, &pixel) in first.iter().enumerate() {
                let pixel = pixel as usize;
                let met =
                    walker.pixel(candidates, pixels, pixel, &mut shares[i * k..][..k]).map_err(|source| {
                        GamutError::Mixture {
                            what: format!("pixel ({}, {})", pixel % width, pixel / width),
                            source,
                        }
                    })?;
                gap = gap.max(met.gap);
                distance[i] = met.distance as f32;
                light[i] = met.light as f32;
                brightness[i] = met.brightness as f32;
            }
            observer.advance(first.len() as u64);
            Ok(gap)
        })
        .collect();
    observer.end();
    let mut gap = 0.0f64;
    for run in gaps {
        gap = gap.max(run?);
    }
    Ok(Clamped {
        shares: distinct.spread(shares, k),
        distance: distinct.spread(&distance, 1),
        light: distinct.spread(&light, 1),
        brightness: distinct.spread(&brightness, 1),
        gap,
    })
}

/// The printed reflectance (1/sr) of clamped targets, given as rows.
pub(crate) fn rows(candidates: &Candidates, targets: &Table) -> Result<Table, GamutError> {
    let fit = |mixer: &mut Mixer, i: usize| {
        let mut weights = vec![0.0; candidates.len()];
        let hull = &candidates.priced;
        candidates
            .target(targets.row(i))
            .and_then(|target| {
                mixer.tangent(hull, &target, &mut weights)?;
                mixer.refine(hull, &target, &mut weights, ENOUGH)
            })
            .map_err(|source| GamutError::Mixture { what: format!("sampled pixel {i}"), source })?;
        Ok(candidates.reflectance(weights.iter().copied()))
    };
    let rows: Vec<Result<Vec<f64>, GamutError>> =
        (0..targets.len()).into_par_iter().map_init(Mixer::new, fit).collect();
    let mut printed = Table::new(targets.columns());
    for row in rows {
        printed.push(&row?);
    }
    Ok(printed)
}

/// The result for one pixel.
#[derive(Clone, Copy)]
struct Met {
    pub distance: f64,
    pub light: f64,
    pub gap: f64,
    pub brightness: f64,
}

/// Maps one pixel after another.
struct Walker {
    mixer: Mixer,
    target: Target,
    row: Vec<f32>,
    /// The mixture, with what is rare and without.
    start: Vec<f64>,
    weights: Vec<f64>,
    recent: WarmStarts,
    measure: f64,
}

impl Walker {
    pub fn new(candidates: &Candidates, space: &Space) -> Walker {
        let k = candidates.len();
        Walker {
            mixer: Mixer::new(),
            target: Target::default(),
            row: vec![0.0; space.columns()],
            start: vec![0.0; k],
            weights: vec![0.0; k],
            recent: WarmStarts::default(),
            measure: space.weight().iter().map(|w| w * w).sum(),
        }
    }

    /// Maps a pixel, starting from the mixture of a similar one.
    pub fn pixel(
        &mut self,
        candidates: &Candidates,
        pixels: &dyn Materials,
        pixel: usize,
        out: &mut [u16],
    ) -> Result<Met, MixtureError> {
        pixels.reflectance(pixel, &mut self.row);
        let hull = &candidates.priced;
        candidates.aim(self.row.iter().map(|&f| f64::from(f)), &mut self.target)?;
        let found = self.recent.start(hull, &self.target, &mut self.start);
        if found.is_none() {
            self.mixer.tangent(hull, &self.target, &mut self.start)?;
        }
        let mut fit = if found == Some(true) {
            self.mixer.refine(hull, &self.target, &mut self.start, ENOUGH)?
        } else {
            self.mixer.refine_beyond(hull, &self.target, &mut self.start, ENOUGH)?
        };
        self.recent.keep(&self.start);
        let gap = fit.gap;
        self.weights.copy_from_slice(&self.start);
        let brightness = &candidates.brightness;
        fit = brightness.settle(&mut self.mixer, hull, &self.target, &mut self.weights, fit, ENOUGH)?;
        quantise(&self.weights, out);
        let light = candidates.light_distance(&self.weights, pixels.space(), &self.row);
        let brightness = self.target.brightness(hull) / self.measure;
        Ok(Met { distance: fit.curve, light, gap, brightness })
    }
}
