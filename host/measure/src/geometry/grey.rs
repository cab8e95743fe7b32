//! Pictures of one channel, in which marks are found.
//!
//! The channel is the darkest one of each pixel, against the bright tones of each, so that ink of any colour is dark and paper is bright.

use rayon::prelude::*;

/// A picture of one channel, linear in light.
#[derive(Clone, Debug)]
pub struct Grey {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Values, rows from the top.
    pub values: Vec<f32>,
}

impl Grey {
    /// The darkest channel of each pixel (RGB interleaved), each channel divided by its own bright tones: dark for any coloured ink,
    /// bright for paper.
    pub(crate) fn darkest(rgb: &[f32], width: usize, height: usize) -> Grey {
        let bright: [f32; 3] = std::array::from_fn(|c| {
            let stride = (width * height / 20_000).max(1) | 1;
            let mut some: Vec<f32> = (0..width * height)
                .step_by(stride)
                .map(|i| rgb[3 * i + c])
                .filter(|v| v.is_finite())
                .collect();
            let at = some.len() * 9 / 10;
            if some.is_empty() { 1.0 } else { some.select_nth_unstable_by(at, f32::total_cmp).1.max(1e-9) }
        });
        let values = rgb
            .par_chunks_exact(3)
            .map(|rgb| (0..3).map(|c| rgb[c] / bright[c]).fold(f32::MAX, f32::min))
            .collect();
        Grey { width, height, values }
    }

    /// The picture with left and right exchanged.
    pub(crate) fn mirrored(&self) -> Grey {
        let rows = self.values.chunks_exact(self.width.max(1));
        Grey { values: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..*self }
    }

    /// The value between pixel centres, which are at halves. `None` outside of the picture.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let (x, y) = (x - 0.5, y - 0.5);
        if !(x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64) {
            return None;
        }
        let (i, j, s, t) = (x as usize, y as usize, x.fract(), y.fract());
        let value = |i: usize, j: usize| f64::from(self.values[j * self.width + i]);
        let row = |j: usize| value(i, j) * (1.0 - s) + value(i + 1, j) * s;
        Some(row(j) * (1.0 - t) + row(j + 1) * t)
    }
}
