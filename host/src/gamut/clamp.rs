//! Eq. 1 at every pixel.
//!
//! Problem: a million constrained fits of the perceptual metric, which the 2009 paper puts at hours or days.
//! Method: along a serpentine through bands of 16 rows every pixel starts from its neighbour's mixture, which is
//! nearly its own; two or three steps with a dozen stacks in the quadratic, all stacks priced, end with a gap
//! below 1e-8 in squared distance. Weights below 0.5 % are pruned and the rest solved again. Bands go to the
//! threads whole, so the result does not depend on how many there are.
//! Cost: about 10 microseconds a pixel and core. Limits: a neighbour is a start like any other: where E is not
//! convex the certificate is a statement about the valley it led to.

use rayon::prelude::*;

use super::GamutError;
use super::basis::prune;
use super::candidates::Candidates;
use crate::brdf::{Space, Table};
use crate::document::Materials;
use crate::factor::Factored;
use crate::observe::Observer;
use crate::solve::{Mixer, MixtureError, Target};
use crate::weights::{ONE, quantise};

/// Rows that are walked as one.
const BAND: usize = 16;
/// A gap in squared distance that no eye could tell from none: at d = 0.01, 5e-7 in d.
const ENOUGH: f64 = 1e-8;

/// A factored document as materials: each pixel the weighted sum of the bases.
pub(super) struct Rebuilt<'a>(pub &'a Factored);

impl Materials for Rebuilt<'_> {
    fn width(&self) -> usize {
        self.0.maps.width()
    }

    fn height(&self) -> usize {
        self.0.maps.height()
    }

    fn space(&self) -> &Space {
        &self.0.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.fill(0.0);
        for (&weight, basis) in self.0.maps.at(pixel).iter().zip(self.0.bases.rows()) {
            if weight > 0 {
                let w = f32::from(weight) / f32::from(ONE);
                out.iter_mut().zip(basis).for_each(|(out, &f)| *out += w * f as f32);
            }
        }
    }
}

/// Every pixel's mixture over the candidates.
pub(super) struct Clamped {
    /// Interleaved fixed-point shares, one for each candidate; each pixel's sum to [`ONE`].
    pub shares: Vec<u16>,
    /// Distance of each pixel and its mixture.
    pub distance: Vec<f32>,
    /// Mean cube root of each pixel's radiance in the metric: what the eye sees of it.
    pub brightness: Vec<f32>,
    /// The largest gap, in squared distance.
    pub gap: f64,
}

pub(super) fn map(
    candidates: &Candidates,
    pixels: &dyn Materials,
    observer: &dyn Observer,
) -> Result<Clamped, GamutError> {
    let (width, height, k) = (pixels.width(), pixels.height(), candidates.len());
    let mut shares = vec![0u16; width * height * k];
    let mut distance = vec![0f32; width * height];
    let mut brightness = vec![0f32; width * height];
    observer.begin("clamp", height as u64);
    let band = BAND * width;
    let gaps: Vec<Result<f64, GamutError>> = shares
        .par_chunks_mut(band * k)
        .zip(distance.par_chunks_mut(band))
        .zip(brightness.par_chunks_mut(band))
        .enumerate()
        .map(|(number, ((shares, distance), brightness))| {
            let rows = distance.len() / width;
            let mut walker = Walker::new(candidates, pixels.space());
            let mut gap = 0.0f64;
            for row in 0..rows {
                for step in 0..width {
                    let x = if row % 2 == 0 { step } else { width - 1 - step };
                    let at = row * width + x;
                    let pixel = number * band + at;
                    let out = &mut shares[at * k..][..k];
                    let met = walker.pixel(candidates, pixels, pixel, out).map_err(|source| {
                        GamutError::Mixture { what: format!("pixel ({x}, {})", number * BAND + row), source }
                    })?;
                    gap = gap.max(met.gap);
                    distance[at] = met.distance as f32;
                    brightness[at] = met.brightness as f32;
                }
            }
            observer.advance(rows as u64);
            Ok(gap)
        })
        .collect();
    observer.end();
    let mut gap = 0.0f64;
    for band in gaps {
        gap = gap.max(band?);
    }
    Ok(Clamped { shares, distance, brightness, gap })
}

/// What clamping prints (1/sr) for targets given as rows.
pub(super) fn rows(candidates: &Candidates, targets: &Table) -> Result<Table, GamutError> {
    let mut mixer = Mixer::new();
    let mut printed = Table::new(targets.columns());
    for (i, row) in targets.rows().enumerate() {
        let mut weights = vec![0.0; candidates.len()];
        let hull = &candidates.priced;
        hull.target(row)
            .and_then(|target| {
                mixer.tangent(hull, &target, &mut weights)?;
                mixer.refine_to(hull, &target, &mut weights, ENOUGH)
            })
            .map_err(|source| GamutError::Mixture { what: format!("sampled pixel {i}"), source })?;
        printed.push(&candidates.reflectance(weights.iter().copied()));
    }
    Ok(printed)
}

/// One pixel's outcome.
#[derive(Clone, Copy, Default)]
pub(super) struct Met {
    pub distance: f64,
    pub gap: f64,
    pub brightness: f64,
}

/// Walks from pixel to pixel.
pub(super) struct Walker {
    mixer: Mixer,
    target: Target,
    row: Vec<f32>,
    last_row: Vec<f32>,
    /// The last pixel's mixture before pruning, and after it.
    start: Vec<f64>,
    weights: Vec<f64>,
    met: Option<Met>,
    measure: f64,
}

impl Walker {
    pub fn new(candidates: &Candidates, space: &Space) -> Walker {
        let k = candidates.len();
        Walker {
            mixer: Mixer::new(),
            target: Target::default(),
            row: vec![0.0; space.columns()],
            last_row: vec![0.0; space.columns()],
            start: vec![0.0; k],
            weights: vec![0.0; k],
            met: None,
            measure: space.weight().iter().map(|w| w * w).sum(),
        }
    }

    /// Maps a pixel, starting from the one before.
    pub fn pixel(
        &mut self,
        candidates: &Candidates,
        pixels: &dyn Materials,
        pixel: usize,
        out: &mut [u16],
    ) -> Result<Met, MixtureError> {
        pixels.reflectance(pixel, &mut self.row);
        if let Some(met) = self.met
            && self.row == self.last_row
        {
            quantise(&self.weights, out);
            return Ok(met);
        }
        let hull = &candidates.priced;
        hull.aim(self.row.iter().map(|&f| f64::from(f)), &mut self.target)?;
        if self.met.is_none() {
            self.mixer.tangent(hull, &self.target, &mut self.start)?;
        }
        let fit = self.mixer.refine_to(hull, &self.target, &mut self.start, ENOUGH)?;
        self.weights.copy_from_slice(&self.start);
        let mut distance = fit.distance;
        if prune(&mut self.weights) {
            distance = self.mixer.polish_to(hull, &self.target, &mut self.weights, ENOUGH)?.distance;
            // Whatever has become small now is not worth another round.
            prune(&mut self.weights);
        }
        quantise(&self.weights, out);
        std::mem::swap(&mut self.row, &mut self.last_row);
        let met = Met { distance, gap: fit.gap, brightness: self.target.brightness(hull) / self.measure };
        self.met = Some(met);
        Ok(met)
    }
}
