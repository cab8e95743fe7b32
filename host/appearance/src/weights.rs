//! Weight maps: the weight of each basis (or stack) at every pixel of a document.
//!
//! Weights are fixed point with [`ONE`] as 1. At every pixel they sum to [`ONE`] exactly, so rounding cannot break the
//! partition of unity on any machine. Layout: interleaved, `channels` values per pixel, rows from the top.

pub(crate) mod grey;

use rayon::prelude::*;

/// Pixels that a thread takes at a time where weights are only read or moved: enough to be worth a task.
pub(crate) const RUN: usize = 1 << 14;

/// Full weight. A power of two, so that products scale back by a shift.
pub const ONE: u16 = 1 << 15;

/// Weight maps of one size. See the module documentation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeightMaps {
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<u16>,
}

/// Why some numbers are not weight maps.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WeightError {
    /// The data does not fill the maps.
    #[error("{width} x {height} pixels with {channels} weights each need {expected} values; found {found}")]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Weights per pixel.
        channels: usize,
        /// Values needed.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// The weights of a pixel do not sum to one.
    #[error("the weights of pixel ({x}, {y}) sum to {:.5}, not 1", f64::from(*sum) / f64::from(ONE))]
    Sum {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The sum found, in units of 1/ONE.
        sum: u32,
    },
}

impl WeightMaps {
    /// Makes maps from interleaved fixed-point weights; the weights of every pixel must sum to [`ONE`].
    pub fn new(
        width: usize,
        height: usize,
        channels: usize,
        data: Vec<u16>,
    ) -> Result<WeightMaps, WeightError> {
        let expected = width.checked_mul(height).and_then(|n| n.checked_mul(channels)).unwrap_or(usize::MAX);
        if data.len() != expected || expected == 0 {
            return Err(WeightError::Size { width, height, channels, expected, found: data.len() });
        }
        let sum = |weights: &[u16]| weights.iter().map(|&w| u32::from(w)).sum::<u32>();
        let wrong = |(i, run): (usize, &[u16])| {
            let at = run.chunks_exact(channels).position(|weights| sum(weights) != u32::from(ONE))?;
            Some((i * RUN + at, sum(&run[at * channels..][..channels])))
        };
        let first = data.par_chunks(RUN * channels).enumerate().filter_map(wrong).min();
        if let Some((pixel, sum)) = first {
            return Err(WeightError::Sum { x: pixel % width, y: pixel / width, sum });
        }
        Ok(WeightMaps { width, height, channels, data })
    }

    /// A one-channel map with full weight at every pixel.
    pub fn uniform(width: usize, height: usize) -> WeightMaps {
        WeightMaps { width, height, channels: 1, data: vec![ONE; width * height] }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Weights per pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The weights of one pixel; they sum to [`ONE`].
    pub fn at(&self, pixel: usize) -> &[u16] {
        &self.data[pixel * self.channels..][..self.channels]
    }

    /// The sum of each channel over all pixels; together [`ONE`] times the number of pixels.
    pub fn totals(&self) -> Vec<u64> {
        let add = |mut sums: Vec<u64>, pixel: &[u16]| {
            sums.iter_mut().zip(pixel).for_each(|(sum, &weight)| *sum += u64::from(weight));
            sums
        };
        let both = |mut a: Vec<u64>, b: Vec<u64>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let none = || vec![0u64; self.channels];
        let runs = self.data.par_chunks(RUN * self.channels);
        runs.map(|run| run.chunks_exact(self.channels).fold(none(), add)).reduce(none, both)
    }

    /// All weights, interleaved.
    pub fn data(&self) -> &[u16] {
        &self.data
    }
}

/// Rounds weights (finite, 0 or more, sum near 1) to fixed point by largest remainder, so that they sum to
/// [`ONE`] exactly. Ties go to the lower index. If all are zero, channel 0 gets full weight.
pub fn quantise(weights: &[f64], out: &mut [u16]) {
    let sum: f64 = weights.iter().map(|w| w.max(0.0)).sum();
    out.fill(0);
    if sum.is_nan() || sum <= 0.0 || weights.is_empty() {
        if let Some(first) = out.first_mut() {
            *first = ONE;
        }
        return;
    }
    let scale = f64::from(ONE) / sum;
    let mut left = u32::from(ONE);
    for (w, o) in weights.iter().zip(out.iter_mut()) {
        *o = (w.max(0.0) * scale).floor() as u16;
        left -= u32::from(*o).min(left);
    }
    // `left` is at most the number of channels: one unit for each lost fraction, largest first.
    for _ in 0..left {
        let mut best = 0;
        let mut most = f64::NEG_INFINITY;
        for (i, w) in weights.iter().enumerate() {
            let lost = w.max(0.0) * scale - f64::from(out[i]);
            if lost > most {
                (best, most) = (i, lost);
            }
        }
        out[best] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn quantised_weights_sum_to_one_and_stay_within_a_unit(w in prop::collection::vec(0.0f64..1.0, 1..60)) {
            let mut out = vec![0; w.len()];
            quantise(&w, &mut out);
            prop_assert_eq!(out.iter().map(|&v| u32::from(v)).sum::<u32>(), u32::from(ONE));
            let sum: f64 = w.iter().sum();
            if sum > 0.0 {
                for (w, &q) in w.iter().zip(&out) {
                    prop_assert!((w / sum * f64::from(ONE) - f64::from(q)).abs() <= 1.0);
                }
            }
        }
    }

    #[test]
    fn a_pixel_that_does_not_sum_to_one_is_named() {
        let error = WeightMaps::new(2, 1, 2, vec![ONE, 0, ONE, 5]).unwrap_err();
        assert_eq!(error, WeightError::Sum { x: 1, y: 0, sum: u32::from(ONE) + 5 });
    }
}
