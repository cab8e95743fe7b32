//! One side of the rectangle of dots against the document's pixels.
//!
//! Method: where pixels are coarser than dots, a place lies between two of them (positions in 1/2 dots, fractions in 1/256 pixel);
//! where they are finer, a dot is the average over its exact footprint. Integers only, so the result is equal on any machine.
//! Memory: a few bytes for each half dot.

use std::ops::Range;

/// Maps positions along one side of the rectangle to the document's pixels.
pub(super) enum Axis {
    /// For each half dot: the pixel before it, and the weight of the next pixel in 1/256.
    Between(Vec<(u32, u16)>),
    /// For each dot: its first pixel and its range of `parts`. The parts of a dot sum to [`Axis::FULL`].
    Over { spans: Vec<(u32, u32, u32)>, parts: Vec<u32> },
}

impl Axis {
    /// What the parts of a dot sum to: a power of two so that division is a shift, fine enough for a pixel
    /// that covers a thousandth of a dot.
    pub(super) const FULL: u32 = 1 << 12;

    pub(super) fn between(dots: usize, pixels: usize) -> Axis {
        let last = 256 * (pixels as i64 - 1);
        let place = |half: usize| {
            // (half / 2) * pixels / dots - 1/2 pixels, in 1/256, to the nearest.
            let numerator = 256 * half as i64 * pixels as i64 - 256 * dots as i64;
            let at = (numerator + dots as i64).div_euclid(2 * dots as i64).clamp(0, last);
            ((at / 256) as u32, (at % 256) as u16)
        };
        Axis::Between((0..=2 * dots).map(place).collect())
    }

    pub(super) fn over(dots: usize, pixels: usize) -> Axis {
        let (mut spans, mut parts) = (Vec::with_capacity(dots), Vec::new());
        for dot in 0..dots {
            // In units of 1/dots pixel: the dot covers [dot * pixels, (dot + 1) * pixels), a pixel is `dots` wide.
            let (from, to) = (dot * pixels, (dot + 1) * pixels);
            let (first, end) = (from / dots, to.div_ceil(dots));
            let start = parts.len();
            let mut before = 0;
            for pixel in first..end {
                // Differences of rounded sums keep the total exact.
                let covered = ((pixel + 1) * dots).min(to) - from;
                let sum = (covered as u64 * u64::from(Axis::FULL) + pixels as u64 / 2) / pixels as u64;
                parts.push(sum as u32 - before);
                before = sum as u32;
            }
            spans.push((first as u32, start as u32, parts.len() as u32));
        }
        Axis::Over { spans, parts }
    }

    /// The first pixel under a range of dots, and into `out` what falls on it and on each of the next.
    pub(super) fn sum(&self, dots: Range<usize>, out: &mut Vec<u64>) -> usize {
        out.clear();
        let mut first = usize::MAX;
        for dot in dots {
            self.parts(2 * dot + 1, |pixel, part| {
                first = first.min(pixel);
                out.resize(out.len().max(pixel - first + 1), 0);
                out[pixel - first] += part;
            });
        }
        first
    }

    /// Calls `with(pixel, part)`; the parts sum to [`Axis::FULL`].
    pub(super) fn parts(&self, half: usize, mut with: impl FnMut(usize, u64)) {
        match self {
            Axis::Between(table) => {
                let (pixel, fraction) = table[half];
                let next = u64::from(fraction) * u64::from(Axis::FULL) / 256;
                with(pixel as usize, u64::from(Axis::FULL) - next);
                if next > 0 {
                    with(pixel as usize + 1, next);
                }
            }
            Axis::Over { spans, parts } => {
                let (first, from, to) = spans[half / 2];
                for (i, &part) in parts[from as usize..to as usize].iter().enumerate() {
                    with(first as usize + i, u64::from(part));
                }
            }
        }
    }
}
