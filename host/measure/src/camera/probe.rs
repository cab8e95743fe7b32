//! What is kept of a photograph to compare it with the others: a small copy, its brightest value, samples of its noise.
//!
//! Problem: a series of 24 photographs of 12 megapixels does not fit into memory, and exposures must be compared before they are
//! merged. Method: blocks of pixels become one, with their mean and their largest value; noise is the second difference
//! along rows, which smooth shading does not enter. Cost: one pass over each photograph.

use super::photo::Photo;
use crate::linalg::median;
use readers::Samples;

/// Pixels across a small copy, at most.
const ACROSS: usize = 640;
/// Samples of noise from one photograph.
const NOISE_SAMPLES: usize = 20_000;
/// Pixels that share the brightest value where it is the sensor's limit.
const PILE: usize = 50;
/// The part of the largest value up to which a sensor is trusted, for near its limit it is no longer
/// proportional to light.
pub(crate) const CLIPPED: f32 = 0.97;

/// A photograph in small.
pub(crate) struct Probe {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Pixels of the photograph along a side of a block.
    pub(crate) factor: usize,
    /// Mean of each block after the frames.
    pub(crate) mean: Vec<[f32; 3]>,
    /// Largest raw value of each block.
    pub(crate) most: Vec<[f32; 3]>,
    /// The brightest raw value of each channel, and how many pixels have it.
    pub(crate) top: [(f32, usize); 3],
    /// The largest value that the file's kind can hold.
    pub(crate) limit: f32,
    /// A value, and its squared second difference along the row.
    noise: Vec<(f32, f32)>,
}

impl Probe {
    /// `raw` is the photograph as its file has it, `photo` what the frames made of it.
    pub(crate) fn new(raw: &Photo, photo: &Photo) -> Probe {
        let factor = photo.width.div_ceil(ACROSS).max(1);
        let (width, height) = ((photo.width / factor).max(1), (photo.height / factor).max(1));
        let (mut mean, mut most) = (vec![[0.0f32; 3]; width * height], vec![[f32::MIN; 3]; width * height]);
        let mut top = [(f32::MIN, 0usize); 3];
        let share = 1.0 / (factor * factor) as f32;
        for y in 0..photo.height {
            let row = (y / factor < height).then_some(y / factor * width);
            for x in 0..photo.width {
                let block = row.filter(|_| x / factor < width).map(|row| row + x / factor);
                for c in 0..3 {
                    let value = raw.at(3 * (y * photo.width + x) + c);
                    if value > top[c].0 {
                        top[c] = (value, 1);
                    } else if value == top[c].0 {
                        top[c].1 += 1;
                    }
                    if let Some(block) = block {
                        mean[block][c] += share * photo.at(3 * (y * photo.width + x) + c);
                        most[block][c] = most[block][c].max(value);
                    }
                }
            }
        }
        let limit = match raw.values {
            Samples::Eight(_) => 255.0,
            Samples::Sixteen(_) => 65_535.0,
            Samples::Float(_) => f32::INFINITY,
        };
        let stride = (photo.width * photo.height / NOISE_SAMPLES).max(1) | 1;
        let noise = (3..photo.width * photo.height - 3.min(photo.width * photo.height))
            .step_by(stride)
            .map(|i| {
                let at = |pixel: usize| photo.at(3 * pixel + 1);
                let d = at(i - 1) - 2.0 * at(i) + at(i + 1);
                (at(i), d * d)
            })
            .collect();
        Probe { width, height, factor, mean, most, top, limit, noise }
    }
}

/// The value at which each channel of the sensor is full: where bright pixels pile up, or the limit of the file's kind.
pub(crate) fn white(probes: &[Probe]) -> [f32; 3] {
    std::array::from_fn(|c| {
        let most = probes.iter().map(|probe| probe.top[c].0).fold(0.0, f32::max);
        let piled = probes.iter().any(|probe| probe.top[c].0 == most && probe.top[c].1 >= PILE);
        let limit = probes.iter().map(|probe| probe.limit).fold(0.0, f32::max);
        if piled && limit > 255.0 { most } else { limit }
    })
}

/// Variance of a value: `gain v + read`, shot noise and read noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    pub(crate) gain: f32,
    pub(crate) read: f32,
}

impl Noise {
    pub(crate) fn variance(self, value: f32) -> f32 {
        self.gain * value.max(0.0) + self.read
    }

    /// Fits the noise of photographs with the same sensor and sensitivity.
    pub(crate) fn estimate(probes: &[Probe], white: f32) -> Noise {
        let top = if white.is_finite() { white } else { f32::MAX };
        let mut samples: Vec<(f32, f32)> = probes
            .iter()
            .flat_map(|probe| &probe.noise)
            .copied()
            .filter(|s| s.0 > 0.0 && s.0 < CLIPPED * top)
            .collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let scale = samples.last().map_or(1.0, |s| s.0);
        // The rounding of 16-bit values, relative to the largest one found.
        let least = (f64::from(scale) / 65_535.0).powi(2) / 12.0;
        // var = gain v + read by least squares with relative weights; medians leave out edges.
        let (mut a, mut b) = ([[0.0f64; 2]; 2], [0.0f64; 2]);
        for bin in samples.chunks((samples.len() / 24).max(200)) {
            let level = bin.iter().map(|s| f64::from(s.0)).sum::<f64>() / bin.len() as f64;
            let mut squares: Vec<f64> = bin.iter().map(|s| f64::from(s.1)).collect();
            // A second difference has 6 times the variance; the median of a squared normal number is 0.455.
            let variance = (median(&mut squares) / 6.0 / 0.455).max(least);
            let weight = 1.0 / (variance * variance);
            for (i, u) in [level, 1.0].into_iter().enumerate() {
                for (j, v) in [level, 1.0].into_iter().enumerate() {
                    a[i][j] += weight * u * v;
                }
                b[i] += weight * u * variance;
            }
        }
        let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        let gain = ((b[0] * a[1][1] - b[1] * a[0][1]) / det).max(0.0);
        let gain = if gain.is_finite() { gain } else { 0.0 };
        let read = if a[1][1] > 0.0 { (b[1] - gain * a[0][1]) / a[1][1] } else { least };
        Noise { gain: gain as f32, read: read.max(least).max(1e-12) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal numbers from sums of a linear congruence.
    fn normal(state: &mut u64) -> f32 {
        (0..12)
            .map(|_| {
                // Splitmix: neighbours are independent.
                *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
            })
            .sum::<f32>()
            - 6.0
    }

    fn probe(photo: &Photo) -> Probe {
        Probe::new(photo, photo)
    }

    fn ramp(gain: f32, read: f32) -> Photo {
        let (width, height, mut state) = (600, 200, 7u64);
        let values = (0..width * height)
            .flat_map(|i| {
                let v = 100.0 * (i % width) as f32;
                [(); 3]
                    .map(|()| (v + normal(&mut state) * (gain * v + read).sqrt()).clamp(0.0, 50_000.0) as u16)
            })
            .collect();
        Photo { width, height, values: Samples::Sixteen(values) }
    }

    #[test]
    fn a_known_noise_is_found() {
        let white = white(&[probe(&ramp(0.5, 9000.0))]);
        assert_eq!(white, [50_000.0; 3]);
        let noise = Noise::estimate(&[probe(&ramp(0.5, 9000.0))], white[1]);
        assert!(
            (noise.gain / 0.5 - 1.0).abs() < 0.1 && (noise.read / 9000.0 - 1.0).abs() < 0.15,
            "{noise:?}"
        );
        let quiet = Noise::estimate(&[probe(&ramp(0.0, 0.0))], 65_535.0);
        assert!(quiet.read > 0.0 && quiet.gain < 1.0, "{quiet:?}");
    }

    #[test]
    fn without_a_pile_the_limit_is_that_of_the_file() {
        let photo =
            Photo { width: 4, height: 4, values: Samples::Sixteen((0..48).map(|i| i * 900).collect()) };
        assert_eq!(white(&[probe(&photo)]), [65_535.0; 3]);
    }
}
