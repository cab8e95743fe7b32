//! A photograph of a flat sheet as linear light, and laid flat.
//!
//! Method: values of 8 bits are undone of their sRGB curve; the sheet's places are projected through lens and pose, and the
//! photograph is read between its pixels: for pictures at about as many places as it has pixels there, for figures at twice as many in
//! each direction. Limits: cameras bend 8-bit tones in ways of their own, so figures from JPEG are rough.

use std::path::Path;

use rayon::prelude::*;

use super::flat::{ComparedArea, Flat};
use crate::MeasureError;
use crate::camera::merge::Radiance;
use crate::camera::photo;
use crate::camera::probe::CLIPPED;
use crate::geometry::grey::Grey;
use crate::geometry::pose::{Lens, Pose};
use readers::Samples;

/// A photograph, linear in light.
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// RGB interleaved, 1 where a channel is full.
    values: Vec<f32>,
    /// The value from which a channel is full.
    full: f32,
    /// Whether a camera's tone curve had to be undone, which is not known exactly.
    pub(crate) bent: bool,
    /// Whether values have 16 bits, of which nobody knows what they are: raw ones are proportional to light, others are not.
    sixteen: bool,
}

impl Picture {
    pub(crate) fn read(path: &Path, linear: Option<bool>) -> Result<Picture, MeasureError> {
        let photo = photo::read(path)?;
        let eight = matches!(photo.values, Samples::Eight(_));
        let (limit, full) = match photo.values {
            Samples::Eight(_) => (255.0, 253.5 / 255.0),
            Samples::Sixteen(_) => (65_535.0, CLIPPED),
            Samples::Float(_) => (1.0, f32::INFINITY),
        };
        let bent = !linear.unwrap_or(!eight);
        let plain = |v: f32| if bent { undone(v / limit) } else { v / limit };
        let count = 3 * photo.width * photo.height;
        let values: Vec<f32> = match &photo.values {
            Samples::Eight(bytes) => {
                let table: Vec<f32> = (0..=255).map(|v| plain(v as f32)).collect();
                bytes.par_iter().map(|v| table[usize::from(*v)]).collect()
            }
            _ => (0..count).into_par_iter().map(|i| plain(photo.at(i))).collect(),
        };
        let full = if bent { undone(full) } else { full };
        if photo.width.min(photo.height) < 100 {
            let problem = format!("{} x {} pixels; too small to find marks in", photo.width, photo.height);
            return Err(MeasureError::photo(path, problem));
        }
        let sixteen = matches!(photo.values, Samples::Sixteen(_));
        Ok(Picture { width: photo.width, height: photo.height, values, full, bent, sixteen })
    }

    /// The picture of 16 bits as it would be if its values, which were taken to be proportional to light, had the curve of sRGB.
    pub(crate) fn other_tones(mut self) -> Option<Picture> {
        if self.bent || !self.sixteen {
            return None;
        }
        self.values.par_iter_mut().for_each(|v| *v = undone(*v));
        self.full = undone(self.full);
        self.bent = true;
        Some(self)
    }

    /// The picture as marks are found in it.
    pub(crate) fn grey(&self) -> Grey {
        Grey::darkest(&self.values, self.width, self.height)
    }

    /// The same for the search of the grey card. Noise is not known here, and not needed.
    pub(crate) fn radiance(&self) -> Radiance {
        let bound: Vec<u8> =
            self.values.chunks_exact(3).map(|rgb| u8::from(rgb.iter().any(|v| *v >= self.full))).collect();
        Radiance {
            width: self.width,
            height: self.height,
            value: self.values.clone(),
            variance: vec![1e-12; self.values.len()],
            first: vec![0; bound.len()],
            bound,
        }
    }

    /// A pixel's light, and whether one of its channels is empty, and full.
    pub(crate) fn pixel(&self, x: usize, y: usize) -> ([f64; 3], [bool; 2]) {
        let rgb: [f32; 3] = std::array::from_fn(|c| self.values[3 * (y * self.width + x) + c]);
        (rgb.map(f64::from), [rgb.iter().any(|v| *v <= 0.0), rgb.iter().any(|v| *v >= self.full)])
    }

    /// The light between pixel centres, which are at halves, and whether a channel near it is full. `None` outside.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> Option<([f64; 3], bool)> {
        let (x, y) = (x - 0.5, y - 0.5);
        if !(x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64) {
            return None;
        }
        let (i, j, s, t) = (x as usize, y as usize, x.fract(), y.fract());
        let (mut sum, mut full) = ([0.0; 3], false);
        for (i, j, part) in [
            (i, j, (1.0 - s) * (1.0 - t)),
            (i + 1, j, s * (1.0 - t)),
            (i, j + 1, (1.0 - s) * t),
            (i + 1, j + 1, s * t),
        ] {
            for (c, sum) in sum.iter_mut().enumerate() {
                let value = self.values[3 * (j * self.width + i) + c];
                full |= value >= self.full;
                *sum += part * f64::from(value);
            }
        }
        Some((sum, full))
    }

    /// Means over the window's spots, with each channel multiplied by `scale`; `None` where a part is not seen, or full.
    pub(crate) fn spots(
        &self,
        window: &ComparedArea,
        lens: &Lens,
        pose: &Pose,
        scale: [f64; 3],
    ) -> Vec<Option<[f64; 3]>> {
        let [across, down] = window.squares;
        let parts = ((2.0 * lens.density(pose, window.middle)).ceil() as usize).clamp(8, 64);
        // A spot's weight within a square is a product of two lines, so each square has a sum for the spot on each of its corners.
        let corners = |square: usize| -> Option<[[f64; 3]; 4]> {
            let mut sums = [[0.0; 3]; 4];
            let part = |k: usize| (k as f64 + 0.5) / parts as f64;
            for (y, x) in (0..parts).flat_map(|y| (0..parts).map(move |x| (part(y), part(x)))) {
                let u = ((square % across) as f64 + x) / across as f64;
                let v = ((square / across) as f64 + y) / down as f64;
                let [px, py] = window.at(u, v);
                let (light, full) = lens.project(pose, [px, py, 0.0]).and_then(|at| self.at(at))?;
                if full {
                    return None;
                }
                let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    (0..3).for_each(|c| sum[c] += weight * light[c]);
                }
            }
            Some(sums)
        };
        let squares: Vec<_> = (0..across * down).into_par_iter().map(corners).collect();
        let [columns, rows] = window.spots();
        let share = 1.0 / (parts * parts) as f64;
        (0..columns * rows)
            .map(|i| {
                let first = i / columns * across + i % columns;
                let around = [first, first + 1, first + across, first + across + 1];
                let mut sum = [0.0; 3];
                for (square, corner) in around.into_iter().zip([3, 2, 1, 0]) {
                    let light = squares[square]?[corner];
                    (0..3).for_each(|c| sum[c] += share * scale[c] * light[c]);
                }
                Some(sum)
            })
            .collect()
    }

    /// The window laid flat, with each channel multiplied by `scale`.
    pub(crate) fn flat(&self, window: &ComparedArea, lens: &Lens, pose: &Pose, scale: [f64; 3]) -> Flat {
        let pixels = window.size[0] / window.width as f64 * lens.density(pose, window.middle);
        let parts = (pixels.ceil() as usize + 1).clamp(2, 8);
        let share = 1.0 / (parts * parts) as f64;
        let mut flat = Flat::new(window.width, window.height);
        let (rgb, known) = (&mut flat.rgb, &mut flat.known);
        rgb.par_chunks_exact_mut(window.width)
            .zip(known.par_chunks_exact_mut(window.width))
            .enumerate()
            .for_each(|(y, (rgb, known))| {
                for (x, (rgb, known)) in rgb.iter_mut().zip(known).enumerate() {
                    let mut sum = [0.0; 3];
                    let seen = (0..parts * parts).all(|i| {
                        let part = |k: usize| (k as f64 + 0.5) / parts as f64;
                        let [px, py] = window.place(x as f64 + part(i % parts), y as f64 + part(i / parts));
                        let read = lens.project(pose, [px, py, 0.0]).and_then(|at| self.at(at));
                        read.is_some_and(|(light, full)| {
                            (0..3).for_each(|c| sum[c] += share * light[c]);
                            !full
                        })
                    });
                    *rgb = std::array::from_fn(|c| (sum[c] * scale[c]) as f32);
                    *known = seen;
                }
            });
        flat
    }
}

/// IEC 61966-2-1.
fn undone(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
