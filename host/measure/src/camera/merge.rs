//! A series of exposures as one picture of radiance, with its variance.
//!
//! Problem: no exposure shows a foil's highlight and the grey card at once. Method: maximum likelihood for shot and read noise,
//! `L = sum w v/t / sum w` with `w = t^2 / (gain L t + read)`; values above 97 % of the sensor's range are missing. Exposures come
//! longest first, so that each is weighted by what the longer ones said, the first by what is around a pixel, and noise does not choose
//! its own weight: pixels that it makes dark would count most wherever pixels are averaged. Where even
//! the shortest is full, its value is a lower bound and marked as one. Exposure ratios and shifts are refined between
//! neighbours in exposure; shifted photographs are read by Catmull and Rom's interpolation.
//! Cost: every file is read twice; memory for one picture of sums and two photographs.
//! Limits: shifts of up to 2 % of the picture's width, no turns.

use observe::Observer;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::align::Tones;
use super::chain;
use super::exposure::Exposure;
use super::files;
use super::frames::{Developed, FULL, Frames};
use super::photo;
use super::probe::{CLIPPED, Noise, Probe, white};
use super::response::Response;
use crate::MeasureError;

/// Below so many standard deviations of noise a photograph is not used where longer ones are: sensors cut noise off at zero, so that
/// it reads too bright, and it has next to no weight.
const DARK: f32 = 4.0;

/// One photograph of a series as it was used.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Shot {
    /// File name.
    pub name: String,
    /// Exposure time in seconds, as the file or the setup says.
    pub seconds: f64,
    /// Exposure relative to the file's, as the pictures say.
    pub ratio: f64,
    /// Shift against the series in pixels.
    pub shift: [f64; 2],
    /// Its standard error, which grows with the steps to the photograph in the middle of the series.
    pub shift_error: [f64; 2],
    /// Share of the pixels with a full channel.
    pub clipped: f64,
    /// Its values are not proportional to light, so the camera's response was recovered.
    pub recovered: bool,
    /// The f-number, where the file says it.
    pub aperture: Option<f64>,
    /// The sensitivity, where the file says it.
    pub iso: Option<f64>,
}

/// Light in the directions of the pixels, in the units of the longest exposure.
pub struct Radiance {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// RGB interleaved; not a number where nothing was recorded.
    pub value: Vec<f32>,
    /// Variance of each value.
    pub variance: Vec<f32>,
    /// For each pixel one bit a channel: the value is a lower bound.
    pub bound: Vec<u8>,
    /// For each pixel the first photograph whose green is not full there, counted from the longest exposure; the last if all are.
    pub first: Vec<u8>,
}

/// Width and height of a photograph, and its small copy.
type Small = ((usize, usize), Probe);

/// Merges photographs of one scene.
///
/// `off` is a photograph with the lamp off, whose light is subtracted.
///
/// # Errors
/// Photographs that differ in size, moved, show something else, or whose exposures are wrong; each is named.
pub fn merge(
    mut exposures: Vec<Exposure>,
    frames: &Frames,
    off: Option<&Exposure>,
    linear: Option<bool>,
    observer: &dyn Observer,
) -> Result<(Radiance, Vec<Shot>), MeasureError> {
    exposures.sort_by(|a, b| b.relative().total_cmp(&a.relative()).then_with(|| a.path.cmp(&b.path)));
    let read = |exposure: &Exposure| {
        let raw = photo::read(&exposure.path)?;
        frames.fits(&raw, &exposure.path)?;
        Ok(raw)
    };
    let small = |exposure: &Exposure| {
        let raw = read(exposure)?;
        let size = (raw.width, raw.height);
        let probe = if frames.is_empty() {
            Probe::new(&raw, &raw)
        } else {
            Probe::new(&raw, &frames.corrected(&raw))
        };
        Ok((size, probe))
    };
    let mut probes: Vec<Probe> = Vec::new();
    let mut size = (0, 0);
    for pair in exposures.chunks(2) {
        let read: Vec<Result<Small, MeasureError>> = pair.par_iter().map(small).collect();
        for (exposure, probe) in pair.iter().zip(read) {
            let (found, probe) = probe?;
            if probes.is_empty() {
                size = found;
            }
            if found != size {
                let problem = format!(
                    "{} x {} pixels, but {} has {} x {}; it belongs to another series: take it away, or turn it",
                    found.0,
                    found.1,
                    exposures[0].name(),
                    size.0,
                    size.1
                );
                return Err(MeasureError::photo(&exposure.path, problem));
            }
            probes.push(probe);
            observer.advance(1);
        }
    }
    let white = white(&probes);
    frames.check(white)?;
    let eight = probes.iter().any(|probe| probe.limit <= 255.0);
    let relative: Vec<f64> = exposures.iter().map(Exposure::relative).collect();
    let response = if linear.unwrap_or(!eight) {
        files::check(&exposures, &probes, &relative, white)?;
        Response::Linear
    } else {
        if !frames.is_empty() {
            return Err(MeasureError::Scene(
                "a flat field or a dark frame corrects values that are proportional to light, and these photographs' are not; develop RAW \
                 to linear 16-bit TIFF, or take photos.flat_field and photos.dark_frame away"
                    .into(),
            ));
        }
        let highest = white.iter().copied().fold(0.0, f32::max);
        Response::recover(&probes, &relative, if highest.is_finite() { highest } else { 1.0 })?
    };
    if eight {
        observer.note("photographs of 8 bits: the camera's response is recovered, and fine tones are lost; RAW or 16-bit TIFF is better");
    }
    let noise = Noise::estimate(&probes, white[1]);
    let tones: Vec<Tones> = probes
        .iter()
        .zip(&relative)
        .map(|(probe, &t)| Tones::new(probe, &response, noise, white, t))
        .collect();
    let chain = chain::links(&exposures, &tones, size.0, &response, observer)?;
    let mut shots = Vec::new();
    let recovered = !matches!(response, Response::Linear);
    let mut sums = Sums::new(size, noise, response);
    let times: Vec<f64> =
        relative.iter().zip(&chain).map(|(t, link)| t / relative[0] * link.ratio.exp()).collect();
    let develop = |exposure: &Exposure| Ok(frames.develop(read(exposure)?, white));
    let mut next = Some(develop(&exposures[0]));
    for (i, exposure) in exposures.iter().enumerate() {
        let Some(photo) = next.take() else { break };
        let photo = photo?;
        let last = i + 1 == exposures.len();
        let (clipped, following) = rayon::join(
            || sums.add(&photo, times[i] as f32, chain[i].shift, last),
            || exposures.get(i + 1).map(develop),
        );
        next = following;
        shots.push(Shot {
            name: exposure.name(),
            seconds: exposure.seconds,
            ratio: chain[i].ratio.exp(),
            shift: chain[i].shift,
            shift_error: chain[i].shift_error,
            clipped,
            recovered,
            aperture: exposure.exif.aperture,
            iso: exposure.exif.iso,
        });
        observer.advance(1);
    }
    if let Some(off) = off {
        let photo = develop(off)?;
        if (photo.photo.width, photo.photo.height) != size {
            return Err(MeasureError::photo(
                &off.path,
                "not of the series' size; take it with the same camera",
            ));
        }
        let full = sums.subtract(&photo, (off.relative() / relative[0]) as f32);
        if full > FULL {
            return Err(MeasureError::photo(
                &off.path,
                format!("{:.1} % of the lamp-off photograph is clipped; expose it shorter", 100.0 * full),
            ));
        }
    }
    Ok((sums.finish(), shots))
}

/// The sums of the merge.
struct Sums {
    width: usize,
    height: usize,
    noise: Noise,
    response: Response,
    value: Vec<f32>,
    weight: Vec<f32>,
    bound: Vec<u8>,
    first: Vec<u8>,
    /// Photographs added.
    added: u8,
}

impl Sums {
    fn new((width, height): (usize, usize), noise: Noise, response: Response) -> Sums {
        let (value, weight) = (vec![0.0; 3 * width * height], vec![0.0; 3 * width * height]);
        let (bound, first) = (vec![0; width * height], vec![0; width * height]);
        Sums { width, height, noise, response, value, weight, bound, first, added: 0 }
    }

    /// Adds a photograph; `last` is the shortest exposure. Returns the share of pixels with a full channel.
    fn add(&mut self, developed: &Developed, time: f32, shift: [f64; 2], last: bool) -> f64 {
        let Sums { width, height, noise, response, value, weight, bound, first, added, .. } = self;
        let photo = &developed.photo;
        let (width, height, own) = (*width, *height, *added);
        *added = added.saturating_add(1);
        let still = shift == [0.0; 2];
        let kernel = shift.map(|d| catmull_rom((d - d.floor()) as f32));
        let base = shift.map(|d| d.floor() as i64);
        // The value at a pixel of the series; None outside the photograph, infinite where it is full.
        let sample = |x: usize, y: usize, c: usize| -> Option<f32> {
            if still {
                let i = 3 * (y * width + x) + c;
                return Some(if developed.is_full(i, c) { f32::INFINITY } else { photo.at(i) });
            }
            let (x0, y0) = (x as i64 + base[0] - 1, y as i64 + base[1] - 1);
            if x0 < 0 || y0 < 0 || x0 + 4 > width as i64 || y0 + 4 > height as i64 {
                return None;
            }
            let mut sum = 0.0;
            for (j, ky) in kernel[1].iter().enumerate() {
                let row = (y0 as usize + j) * width + x0 as usize;
                for (i, kx) in kernel[0].iter().enumerate() {
                    let i = 3 * (row + i) + c;
                    if developed.is_full(i, c) {
                        return Some(f32::INFINITY);
                    }
                    sum += kx * ky * photo.at(i);
                }
            }
            Some(sum)
        };
        // A value beside a pixel of the series.
        let near = |x: usize, y: usize, c: usize, [i, j]: [i64; 2]| {
            let near =
                |at: usize, base: i64, most: usize| (at as i64 + base).clamp(0, most as i64 - 1) as usize;
            photo.at(3 * (near(y, base[1] + j, height) * width + near(x, base[0] + i, width)) + c)
        };
        // The least that a full pixel may be: the sensor's limit, after the frames.
        let limit = |x: usize, y: usize, c: usize| CLIPPED * near(x, y, c, [0, 0]);
        let around = |x: usize, y: usize, c: usize| {
            [[-1, 0], [1, 0], [0, -1], [0, 1]].map(|beside| near(x, y, c, beside)).iter().sum::<f32>() / 4.0
        };
        let rows = value
            .par_chunks_mut(3 * width)
            .zip(weight.par_chunks_mut(3 * width))
            .zip(bound.par_chunks_mut(width))
            .zip(first.par_chunks_mut(width));
        let full: usize = rows
            .enumerate()
            .map(|(y, (((value, weight), bound), first))| {
                let mut full = 0;
                for x in 0..width {
                    let mut any = false;
                    for c in 0..3 {
                        let i = 3 * x + c;
                        let Some(code) = sample(x, y, c) else { continue };
                        if code == f32::INFINITY {
                            any = true;
                            if last && weight[i] == 0.0 {
                                // The sensor's limit, in the sum's units; the variance says nothing.
                                value[i] = response.linear(c, limit(x, y, c)) / time;
                                weight[i] = 1.0;
                                bound[x] |= 1 << c;
                                if c == 1 {
                                    first[x] = own;
                                }
                            }
                            continue;
                        }
                        if c == 1 && weight[i] == 0.0 {
                            first[x] = own;
                        }
                        let v = response.linear(c, code);
                        let (expected, code) = if weight[i] > 0.0 {
                            (value[i] / weight[i] * time, code)
                        } else {
                            let code = around(x, y, c);
                            (response.linear(c, code), code)
                        };
                        let step = response.step(c, code);
                        let variance = (noise.variance(expected) + step * step / 6.0).max(1e-20);
                        if weight[i] > 0.0 && expected * expected < DARK * DARK * variance {
                            continue;
                        }
                        let w = time * time / variance;
                        value[i] += w * v / time;
                        weight[i] += w;
                    }
                    full += usize::from(any);
                }
                full
            })
            .sum();
        full as f64 / (width * height) as f64
    }

    /// Takes the light of a photograph away from what was summed. Returns the share of its pixels that are full.
    fn subtract(&mut self, off: &Developed, time: f32) -> f64 {
        let Sums { width, height, noise, response, value, weight, .. } = self;
        let full = value
            .par_iter_mut()
            .zip(weight.par_iter_mut())
            .enumerate()
            .filter(|(_, (_, weight))| **weight > 0.0)
            .map(|(i, (value, weight))| {
                let code = off.photo.at(i);
                let (light, step) = (response.linear(i % 3, code), response.step(i % 3, code));
                let variance = (noise.variance(light) + step * step / 6.0) / (time * time);
                *value -= *weight * light / time;
                let mean = *value / *weight;
                *weight = 1.0 / (1.0 / *weight + variance);
                *value = mean * *weight;
                usize::from(i % 3 == 0 && (0..3).any(|c| off.is_full(i + c, c)))
            })
            .sum::<usize>();
        full as f64 / (*width * *height) as f64
    }

    fn finish(self) -> Radiance {
        let Sums { width, height, mut value, mut weight, bound, first, .. } = self;
        value.par_iter_mut().zip(weight.par_iter_mut()).for_each(|(value, weight)| {
            if *weight > 0.0 {
                *value /= *weight;
                *weight = 1.0 / *weight;
            } else {
                *value = f32::NAN;
            }
        });
        Radiance { width, height, value, variance: weight, bound, first }
    }
}

/// Weights of four neighbours for a place `t` after the second.
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t + 2.0 * t2 - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (t + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests;
