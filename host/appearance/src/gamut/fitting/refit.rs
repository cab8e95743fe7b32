//! Pixels fitted by eq. 1 with their targets moved.
//!
//! Problem: what keeps contrast between neighbours and what an eye averages over both ask of a pixel
//! something else than its own nearest mixture.
//! Method: a moved target is a target ([`Target::shift`]), so the solver of clamping fits it, from the
//! pixel's last mixture.
//! Cost: two or three steps of the solver. Limits: those of [`Mixer::refine`].

use super::clamp::ENOUGH;
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::materials::Materials;
use crate::solve::{Mixer, MixtureError, Target};
use crate::weights::ONE;

/// Names the pixel of a failed fit.
pub(crate) fn in_pixel(pixel: usize, width: usize) -> impl FnOnce(MixtureError) -> GamutError {
    move |source| GamutError::Mixture {
        what: format!("pixel ({}, {})", pixel % width, pixel / width),
        source,
    }
}

/// Solves one pixel after another.
pub(crate) struct Solver<'a> {
    candidates: &'a Candidates,
    pixels: &'a dyn Materials,
    mixer: Mixer,
    row: Vec<f32>,
    target: Target,
    /// Cube roots of the target before it is moved, and the same with the weights of the metric.
    wanted: Vec<f64>,
    pub look: Vec<f64>,
    /// What is missed around the pixel, and by the pixel, in cube roots.
    pub shift: Vec<f64>,
    pub miss: Vec<f64>,
    /// What a pixel in the gamut misses.
    pub nothing: Vec<f64>,
    pub weights: Vec<f64>,
}

impl<'a> Solver<'a> {
    pub fn new(candidates: &'a Candidates, pixels: &'a dyn Materials) -> Solver<'a> {
        let columns = vec![0.0; candidates.priced.metric().len()];
        Solver {
            candidates,
            pixels,
            mixer: Mixer::new(),
            row: vec![0.0; pixels.space().columns()],
            target: Target::default(),
            wanted: columns.clone(),
            look: columns.clone(),
            shift: columns.clone(),
            miss: columns.clone(),
            nothing: columns,
            weights: vec![0.0; candidates.len()],
        }
    }

    /// Aims at a pixel.
    pub fn aim(&mut self, pixel: usize) -> Result<(), MixtureError> {
        self.pixels.reflectance(pixel, &mut self.row);
        let hull = &self.candidates.priced;
        self.candidates.aim(self.row.iter().map(|&f| f64::from(f)), &mut self.target)?;
        self.wanted.copy_from_slice(self.target.roots());
        for ((look, root), weight) in self.look.iter_mut().zip(&self.wanted).zip(hull.metric()) {
            *look = root * weight;
        }
        Ok(())
    }

    /// Takes the mixture to start from.
    pub fn start(&mut self, shares: &[u16]) {
        self.weights.iter_mut().zip(shares).for_each(|(w, &s)| *w = f64::from(s) / f64::from(ONE));
    }

    /// Solves equation 1 with the target moved by a part of the shift.
    pub fn solve(&mut self, part: f64, finish: bool) -> Result<(), MixtureError> {
        let hull = &self.candidates.priced;
        self.target.shift(self.shift.iter().map(|c| part * c));
        let fit = self.mixer.refine(hull, &self.target, &mut self.weights, ENOUGH)?;
        if finish {
            let brightness = &self.candidates.brightness;
            brightness.settle(&mut self.mixer, hull, &self.target, &mut self.weights, fit, ENOUGH)?;
        }
        Ok(())
    }

    /// Finds what the mixture misses of the pixel. Returns distance d.
    pub fn compare(&mut self) -> f64 {
        let hull = &self.candidates.priced;
        hull.roots(&self.weights, &mut self.miss);
        let mut sum = 0.0;
        for (j, ((miss, wanted), weight)) in
            self.miss.iter_mut().zip(&self.wanted).zip(hull.metric()).enumerate()
        {
            *miss -= wanted;
            if j < self.row.len() {
                sum += (*miss * weight) * (*miss * weight);
            }
        }
        sum.sqrt()
    }

    /// The distance in light between the mixture and the pixel.
    pub fn light(&self) -> f64 {
        self.candidates.light_distance(&self.weights, self.pixels.space(), &self.row)
    }
}
