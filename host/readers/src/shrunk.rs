//! Pictures that are made smaller while they are read.
//!
//! Problem: a picture may have many times the dots of the sheet it is printed on, and its pixels as bytes
//! need a gigabyte. Method: each pixel of the result is the mean of the pixels under it, by area, and by
//! opacity where there is one. A row is added up as it is decoded, so that of the picture two rows are in
//! memory. PNG is decoded row by row; other formats, and interlaced PNG, come as a whole.
//! Cost: 2 ns a sample. Limits: 8 bits a sample; smaller only.

use std::io::Cursor;

use png::{Decoder, Transformations};

use crate::picture::Raster;

/// Rows that are added up to a smaller picture.
struct Shrink {
    from: (usize, usize),
    to: (usize, usize),
    channels: usize,
    /// For each pixel across the first one of the result that it lies in, and how much of it lies there and
    /// in the next one.
    across: Vec<(usize, f32, f32)>,
    /// A row, added up across.
    row: Vec<f32>,
    /// The rows of the result's next row so far.
    sum: Vec<f32>,
    /// Rows that have come.
    come: usize,
    out: Vec<u8>,
}

/// The first of `to` places that the step `at` of `from` lies in, and which parts of one place it covers
/// there and in the next one.
fn parts(at: usize, from: usize, to: usize) -> (usize, f32, f32) {
    let first = at * to / from;
    let inside = ((first + 1) * from).min((at + 1) * to) - at * to;
    (first, inside as f32 / from as f32, (to - inside) as f32 / from as f32)
}

impl Shrink {
    fn new(from: (u32, u32), to: (u32, u32), channels: usize) -> Shrink {
        let sides = |(width, height): (u32, u32)| (width as usize, height as usize);
        let (from, to) = (sides(from), sides(to));
        Shrink {
            from,
            to,
            channels,
            across: (0..from.0).map(|x| parts(x, from.0, to.0)).collect(),
            row: vec![0.0; to.0 * channels],
            sum: vec![0.0; to.0 * channels],
            come: 0,
            out: Vec::with_capacity(to.0 * to.1 * channels),
        }
    }

    /// Takes the next row.
    fn take(&mut self, samples: &[u8]) {
        let channels = self.channels;
        self.row.fill(0.0);
        for (pixel, &(first, here, next)) in samples.chunks_exact(channels).zip(&self.across) {
            let opacity = if channels.is_multiple_of(2) { f32::from(pixel[channels - 1]) } else { 1.0 };
            for (c, &sample) in pixel.iter().enumerate() {
                let is_opacity = channels.is_multiple_of(2) && c + 1 == channels;
                let value = if is_opacity { opacity } else { f32::from(sample) * opacity };
                let at = first * channels + c;
                self.row[at] += here * value;
                if next > 0.0 {
                    self.row[at + channels] += next * value;
                }
            }
        }
        let (_, here, next) = parts(self.come, self.from.1, self.to.1);
        self.come += 1;
        self.sum.iter_mut().zip(&self.row).for_each(|(sum, row)| *sum += here * row);
        if self.come * self.to.1 >= (self.out.len() / (self.to.0 * channels) + 1) * self.from.1 {
            self.emit();
            self.sum.iter_mut().zip(&self.row).for_each(|(sum, row)| *sum = next * row);
        }
    }

    fn emit(&mut self) {
        let byte = |value: f32| (value + 0.5) as u8;
        for pixel in self.sum.chunks_exact(self.channels) {
            match pixel.split_last() {
                Some((&opacity, colours)) if self.channels.is_multiple_of(2) => {
                    let over = if opacity > 0.0 { 1.0 / opacity } else { 0.0 };
                    self.out.extend(colours.iter().map(|value| byte(value * over)));
                    self.out.push(byte(opacity));
                }
                _ => self.out.extend(pixel.iter().map(|&value| byte(value))),
            }
        }
    }

    fn raster(self) -> Raster {
        Raster { channels: self.channels, samples: self.out }
    }
}

/// A decoded picture, smaller.
pub(crate) fn whole(raster: &Raster, from: (u32, u32), to: (u32, u32)) -> Raster {
    let mut shrink = Shrink::new(from, to, raster.channels);
    raster.samples.chunks_exact(raster.channels * from.0 as usize).for_each(|row| shrink.take(row));
    shrink.raster()
}

/// A PNG, smaller, row by row; `None` if it is interlaced or damaged, of which who reads it as a whole tells
/// more.
pub(crate) fn png(bytes: &[u8], to: (u32, u32)) -> Option<Raster> {
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info().ok()?;
    if reader.info().interlaced {
        return None;
    }
    let (from, channels) = (reader.info().size(), reader.output_color_type().0.samples());
    let mut shrink = Shrink::new(from, to, channels);
    while let Some(row) = reader.next_row().ok()? {
        shrink.take(row.data());
    }
    (shrink.come == shrink.from.1).then(|| shrink.raster())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixels::{self, Pixel};
    use proptest::prelude::*;

    /// The mean by area, pixel by pixel.
    fn mean(raster: &Raster, (w, h): (u32, u32), (x, y): (u32, u32), (tw, th): (u32, u32), c: usize) -> f64 {
        let overlap = |at: u32, from: u32, place: u32, to: u32| {
            let scale = f64::from(from) / f64::from(to);
            let (a, b) = (f64::from(place) * scale, f64::from(place + 1) * scale);
            (b.min(f64::from(at) + 1.0) - a.max(f64::from(at))).max(0.0)
        };
        let n = raster.channels;
        let (mut sum, mut all) = (0.0, 0.0);
        for v in 0..h {
            for u in 0..w {
                let pixel = &raster.samples[(v * w + u) as usize * n..][..n];
                let area = overlap(u, w, x, tw) * overlap(v, h, y, th);
                let opacity = if n == 4 && c < 3 { f64::from(pixel[3]) } else { 1.0 };
                sum += area * opacity * f64::from(pixel[c]);
                all += area * opacity;
            }
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }

    proptest! {
        #[test]
        fn each_pixel_is_the_mean_of_those_under_it(
            from in (1u32..12, 1u32..12),
            less in (0u32..8, 0u32..8),
            seed in any::<u32>(),
            four in any::<bool>()
        ) {
            let to = (from.0.saturating_sub(less.0).max(1), from.1.saturating_sub(less.1).max(1));
            let channels = if four { 4 } else { 3 };
            let mut state = seed;
            let samples: Vec<u8> = (0..from.0 * from.1 * channels as u32).map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            }).collect();
            let raster = Raster { channels, samples };
            let found = whole(&raster, from, to);
            prop_assert_eq!(found.samples.len(), (to.0 * to.1) as usize * channels);
            for y in 0..to.1 {
                for x in 0..to.0 {
                    for c in 0..channels {
                        let sample = found.samples[(y * to.0 + x) as usize * channels + c];
                        let expected = mean(&raster, from, (x, y), to, c);
                        prop_assert!((f64::from(sample) - expected).abs() < 0.51, "{sample}, not {expected}");
                    }
                }
            }
            // The same row by row from a file.
            if !four {
                let file = pixels::png(&raster.samples, from, Pixel::Rgb).unwrap();
                prop_assert_eq!(png(&file, to).unwrap(), found);
            }
        }
    }
}
