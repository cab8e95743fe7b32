//! A series of exposures as one picture of radiance, with its variance.
//!
//! Problem: no exposure shows a foil's highlight and the grey card at once. Method: maximum likelihood for shot and read noise,
//! `L = sum w v/t / sum w` with `w = t^2 / (gain L t + read)`; values above 97 % of the sensor's range are missing. Exposures come
//! longest first, so that each is weighted by what the longer ones said, and noise does not choose its own weight. Where even
//! the shortest is full, its value is a lower bound and marked as one. Exposure ratios and shifts are refined between
//! neighbours in exposure; shifted photographs are read by Catmull and Rom's interpolation.
//! Cost: every file is read twice; memory for one picture of sums and two photographs.
//! Limits: shifts of up to 2 % of the picture's width, no turns.

use std::path::{Path, PathBuf};

use observe::Observer;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::align::{Match, Tones};
use super::photo::{self, Exif, Photo, Values};
use super::probe::{CLIPPED, Noise, Probe, white};
use super::response::Response;
use crate::MeasureError;

/// The largest shift that is aligned, in picture widths.
const MOST_SHIFT: f64 = 0.02;
/// The part of strange blocks from which photographs show different things.
const STRANGE: f64 = 0.06;
/// Blocks that must be comparable before a comparison counts.
const COMPARABLE: usize = 150;
/// The largest deviation of an exposure from what its file says, as a logarithm: a third of a stop is 0.23.
const MOST_RATIO: f64 = 0.4;
/// A difference of ratios between dark and bright tones that linear values do not have.
const BENT: f64 = 0.06;
/// Below so many standard deviations of noise a photograph is not used where longer ones are: sensors cut noise off at zero, so that
/// it reads too bright, and it has next to no weight.
const DARK: f32 = 4.0;
/// Shifts below this many pixels are left alone.
const STILL: f64 = 0.05;

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
    /// Share of the pixels with a full channel.
    pub clipped: f64,
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

/// A photograph with its exposure, before it is read.
#[derive(Clone, Debug)]
pub struct Exposure {
    /// The file.
    pub path: PathBuf,
    /// Time in seconds.
    pub seconds: f64,
    /// What the file says.
    pub exif: Exif,
}

impl Exposure {
    /// Light on the sensor relative to other photographs: time, sensitivity, aperture.
    fn relative(&self) -> f64 {
        let aperture = self.exif.aperture.unwrap_or(1.0);
        self.seconds * self.exif.iso.unwrap_or(100.0) / 100.0 / (aperture * aperture)
    }

    fn name(&self) -> String {
        name(&self.path)
    }
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Width and height of a photograph, and its small copy.
type Small = ((usize, usize), Probe);

/// What is taken from each photograph before it is merged.
pub struct Frames {
    /// An evenly lit white surface.
    pub flat: Option<Photo>,
    /// The lens covered.
    pub dark: Option<Photo>,
}

impl Frames {
    /// Reads the files that are named.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn read(flat: Option<&Path>, dark: Option<&Path>) -> Result<Frames, MeasureError> {
        Ok(Frames { flat: flat.map(photo::read).transpose()?, dark: dark.map(photo::read).transpose()? })
    }

    /// The photograph without the dark frame, divided by the flat field.
    fn apply(&self, photo: Photo, path: &Path) -> Result<Photo, MeasureError> {
        for frame in [&self.flat, &self.dark].into_iter().flatten() {
            if (frame.width, frame.height) != (photo.width, photo.height) {
                return Err(MeasureError::photo(
                    path,
                    format!(
                        "{} x {} pixels, but the flat field or dark frame has {} x {}; take them with the same camera, upright",
                        photo.width, photo.height, frame.width, frame.height
                    ),
                ));
            }
        }
        if self.flat.is_none() && self.dark.is_none() {
            return Ok(photo);
        }
        let count = 3 * photo.width * photo.height;
        let dark = |i: usize| self.dark.as_ref().map_or(0.0, |frame| frame.at(i));
        let field = |i: usize| self.flat.as_ref().map_or(1.0, |frame| frame.at(i) - dark(i));
        let mean: [f32; 3] = std::array::from_fn(|c| {
            let sum: f64 = (c..count).step_by(3).map(|i| f64::from(field(i))).sum();
            (sum / (count / 3) as f64) as f32
        });
        let values = (0..count)
            .into_par_iter()
            .map(|i| (photo.at(i) - dark(i)) * mean[i % 3] / field(i).max(0.02 * mean[i % 3]));
        Ok(Photo { values: Values::Float(values.collect()), ..photo })
    }
}

/// Merges photographs of one scene.
///
/// # Errors
/// Photographs that differ in size, moved, show something else, or whose exposures are wrong; each is named.
pub fn merge(
    mut exposures: Vec<Exposure>,
    frames: &Frames,
    linear: Option<bool>,
    observer: &dyn Observer,
) -> Result<(Radiance, Vec<Shot>), MeasureError> {
    exposures.sort_by(|a, b| b.relative().total_cmp(&a.relative()).then_with(|| a.path.cmp(&b.path)));
    let read = |exposure: &Exposure| frames.apply(photo::read(&exposure.path)?, &exposure.path);
    let mut probes: Vec<Probe> = Vec::new();
    let mut size = (0, 0);
    for pair in exposures.chunks(2) {
        let read: Vec<Result<Small, MeasureError>> = pair
            .par_iter()
            .map(|exposure| read(exposure).map(|photo| ((photo.width, photo.height), Probe::new(&photo))))
            .collect();
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
    let eight = probes.iter().any(|probe| probe.limit <= 255.0);
    let relative: Vec<f64> = exposures.iter().map(Exposure::relative).collect();
    let response = if linear.unwrap_or(!eight) {
        Response::Linear
    } else {
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
    let chain = compare(&exposures, &tones, size.0, &response, observer)?;
    let mut shots = Vec::new();
    let mut sums = Sums::new(size, noise, response, white);
    let times: Vec<f64> =
        relative.iter().zip(&chain).map(|(t, link)| t / relative[0] * link.ratio.exp()).collect();
    let mut next = Some(read(&exposures[0]));
    for (i, exposure) in exposures.iter().enumerate() {
        let Some(photo) = next.take() else { break };
        let photo = photo?;
        let last = i + 1 == exposures.len();
        let (clipped, following) = rayon::join(
            || sums.add(&photo, times[i] as f32, chain[i].shift, last),
            || exposures.get(i + 1).map(read),
        );
        next = following;
        shots.push(Shot {
            name: exposure.name(),
            seconds: exposure.seconds,
            ratio: chain[i].ratio.exp(),
            shift: chain[i].shift,
            clipped,
            aperture: exposure.exif.aperture,
            iso: exposure.exif.iso,
        });
        observer.advance(1);
    }
    Ok((sums.finish(), shots))
}

/// A photograph against the series.
#[derive(Clone, Copy)]
struct Link {
    shift: [f64; 2],
    ratio: f64,
}

/// Shifts and exposures of all photographs, from comparisons of neighbours in exposure.
fn compare(
    exposures: &[Exposure],
    tones: &[Tones],
    width: usize,
    response: &Response,
    observer: &dyn Observer,
) -> Result<Vec<Link>, MeasureError> {
    let strange = |found: &Match| found.compared >= COMPARABLE && found.strange > STRANGE;
    let neighbours: Vec<Match> =
        (1..tones.len()).into_par_iter().map(|i| tones[i - 1].compare(&tones[i])).collect();
    let mut chain = vec![Link { shift: [0.0; 2], ratio: 0.0 }];
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
                     camera or the lamp was moved; take it away or photograph the series again",
                    100.0 * found.strange
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
        let shift = if found.shift.iter().all(|d| d.abs() < STILL) { [0.0; 2] } else { found.shift };
        let ratio = if found.error < 0.01 { found.ratio } else { 0.0 };
        chain.push(Link {
            shift: [last.shift[0] + shift[0], last.shift[1] + shift[1]],
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
    let middle = chain[chain.len() / 2].shift;
    for link in &mut chain {
        link.shift = [link.shift[0] - middle[0], link.shift[1] - middle[1]];
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

/// The sums of the merge.
struct Sums {
    width: usize,
    height: usize,
    noise: Noise,
    response: Response,
    white: [f32; 3],
    value: Vec<f32>,
    weight: Vec<f32>,
    bound: Vec<u8>,
    first: Vec<u8>,
    /// Photographs added.
    added: u8,
}

impl Sums {
    fn new((width, height): (usize, usize), noise: Noise, response: Response, white: [f32; 3]) -> Sums {
        let (value, weight) = (vec![0.0; 3 * width * height], vec![0.0; 3 * width * height]);
        let (bound, first) = (vec![0; width * height], vec![0; width * height]);
        Sums { width, height, noise, response, white, value, weight, bound, first, added: 0 }
    }

    /// Adds a photograph; `last` is the shortest exposure. Returns the share of pixels with a full channel.
    fn add(&mut self, photo: &Photo, time: f32, shift: [f64; 2], last: bool) -> f64 {
        let Sums { width, height, noise, response, white, value, weight, bound, first, added } = self;
        let (width, height, own) = (*width, *height, *added);
        *added = added.saturating_add(1);
        let still = shift.iter().all(|d| d.abs() < STILL);
        let kernel = shift.map(|d| catmull_rom((d - d.floor()) as f32));
        let base = shift.map(|d| d.floor() as i64);
        // The value at a pixel of the series; None outside the photograph, infinite where it is full.
        let sample = |x: usize, y: usize, c: usize| -> Option<f32> {
            if still {
                let v = photo.at(3 * (y * width + x) + c);
                return Some(if v >= CLIPPED * white[c] { f32::INFINITY } else { v });
            }
            let (x0, y0) = (x as i64 + base[0] - 1, y as i64 + base[1] - 1);
            if x0 < 0 || y0 < 0 || x0 + 4 > width as i64 || y0 + 4 > height as i64 {
                return None;
            }
            let mut sum = 0.0;
            for (j, ky) in kernel[1].iter().enumerate() {
                let row = (y0 as usize + j) * width + x0 as usize;
                for (i, kx) in kernel[0].iter().enumerate() {
                    let v = photo.at(3 * (row + i) + c);
                    if v >= CLIPPED * white[c] {
                        return Some(f32::INFINITY);
                    }
                    sum += kx * ky * v;
                }
            }
            Some(sum)
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
                                value[i] = response.linear(c, CLIPPED * white[c]) / time;
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
                        let expected = if weight[i] > 0.0 { value[i] / weight[i] * time } else { v };
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
