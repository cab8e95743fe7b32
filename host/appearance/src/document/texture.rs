//! Maps with one number per pixel, and resizing them to a common size.
//!
//! Problem: the maps of a large document have hundreds of millions of numbers, most of which were stored as bytes.
//! Method: a plane keeps the integers of its file and a table of what each of them means, so that encodings and factors
//! change the table alone. Planes that are computed from such planes are rounded to 16 bits, equidistant in the root of the
//! value: dark colours and small variances need the finer steps.
//! Cost: 1, 2 or 4 bytes a pixel, and one look-up a value.

pub(super) mod layers;

use maths::Maths;
use rayon::prelude::*;

/// The numbers as they are stored.
#[derive(Clone, Debug, PartialEq)]
enum Codes {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
    Float(Vec<f32>),
}

/// One number per pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    width: usize,
    height: usize,
    codes: Codes,
    /// The value of each code; of floats there is none.
    values: Vec<f32>,
}

/// The largest code of 16 bits.
const MOST: f32 = u16::MAX as f32;

impl Plane {
    /// A plane of `width * height` values.
    ///
    /// # Panics
    /// If the number of values is wrong, which is a bug in the caller and never depends on input; so with all that make planes.
    pub fn new(width: usize, height: usize, data: Vec<f32>) -> Plane {
        assert_eq!(data.len(), width * height, "the plane has another size");
        Plane { width, height, codes: Codes::Float(data), values: Vec::new() }
    }

    /// A plane of bytes, 0 to 255 for 0 to 1.
    pub fn eight(width: usize, height: usize, codes: Vec<u8>) -> Plane {
        assert_eq!(codes.len(), width * height, "the plane has another size");
        let values = (0..=u8::MAX).map(|v| f32::from(v) / f32::from(u8::MAX)).collect();
        Plane { width, height, codes: Codes::Eight(codes), values }
    }

    /// A plane of 16-bit numbers, 0 to 65535 for 0 to 1.
    pub fn sixteen(width: usize, height: usize, codes: Vec<u16>) -> Plane {
        assert_eq!(codes.len(), width * height, "the plane has another size");
        let values = (0..=u16::MAX).map(|v| f32::from(v) / MOST).collect();
        Plane { width, height, codes: Codes::Sixteen(codes), values }
    }

    /// A plane rounded to 16 bits, from `from` to `to`; other values are clamped. `rows` is called for bands of rows, with the
    /// first row of each, on all cores.
    pub fn coded(
        (width, height): (usize, usize),
        (from, to): (f32, f32),
        rows: impl Fn(usize, &mut [f32]) + Sync,
    ) -> Plane {
        let mut codes = vec![0; width * height];
        let scale = if to > from { 1.0 / (to - from) } else { 0.0 };
        codes.par_chunks_mut(width * BAND).enumerate().for_each_init(Vec::new, |band, (i, codes)| {
            band.clear();
            band.resize(codes.len(), 0.0);
            rows(i * BAND, band);
            for (code, &value) in codes.iter_mut().zip(band.iter()) {
                *code = (MOST * ((value - from) * scale).clamp(0.0, 1.0).sqrt() + 0.5) as u16;
            }
        });
        let value = |code: u16| from + (to - from) * (f32::from(code) / MOST).squared();
        Plane { width, height, codes: Codes::Sixteen(codes), values: (0..=u16::MAX).map(value).collect() }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The value of pixel `y * width + x`.
    #[inline]
    pub fn at(&self, pixel: usize) -> f32 {
        match &self.codes {
            Codes::Eight(codes) => self.values[usize::from(codes[pixel])],
            Codes::Sixteen(codes) => self.values[usize::from(codes[pixel])],
            Codes::Float(data) => data[pixel],
        }
    }

    /// The values in order.
    pub fn values(&self) -> impl Iterator<Item = f32> {
        (0..self.width * self.height).map(|pixel| self.at(pixel))
    }

    /// The pixel farthest outside of 0 to 1, and by how much it lies outside; of integers there is none.
    pub fn outside(&self) -> Option<(usize, f32)> {
        let Codes::Float(data) = &self.codes else { return None };
        let beyond = data.iter().map(|&v| (v - 1.0).max(-v)).enumerate();
        beyond.filter(|&(_, by)| by > 0.0).reduce(|most, next| if next.1 > most.1 { next } else { most })
    }

    /// Whether every value is within 0 to 1.
    pub fn is_share(&self) -> bool {
        let share = |v: &f32| (0.0..=1.0).contains(v);
        match &self.codes {
            Codes::Float(data) => data.iter().all(share),
            _ => self.values.iter().all(share) || self.values().all(|v| share(&v)),
        }
    }

    /// Applies `f` to every value, on all cores.
    pub fn map(mut self, f: impl Fn(f32) -> f32 + Sync) -> Plane {
        let values = match &mut self.codes {
            Codes::Float(data) => data,
            _ => &mut self.values,
        };
        values.par_iter_mut().for_each(|v| *v = f(*v));
        self
    }

    /// Resizes the plane. Shrinking takes the mean over the area of each new pixel; enlarging interpolates linearly between
    /// pixel centres. The cost is proportional to the pixels read and written.
    pub fn resized(&self, width: usize, height: usize) -> Plane {
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let (across, down) = (Taps::new(self.width, width), Taps::new(self.height, height));
        let rows = |top: usize, out: &mut [f32]| {
            let mut row = vec![0.0; self.width];
            let mut narrow = vec![0.0; width];
            let mut read = None;
            for (y, out) in (top..).zip(out.chunks_exact_mut(width)) {
                let (first, weights) = down.at(y);
                for (old, &weight) in (first..).zip(weights) {
                    if read != Some(old) {
                        row.iter_mut().zip(old * self.width..).for_each(|(v, pixel)| *v = self.at(pixel));
                        for (x, out) in narrow.iter_mut().enumerate() {
                            let (first, weights) = across.at(x);
                            *out = weights.iter().zip(&row[first..]).map(|(&w, &v)| w * v).sum();
                        }
                        read = Some(old);
                    }
                    out.iter_mut().zip(&narrow).for_each(|(out, &v)| *out += weight * v);
                }
            }
        };
        if let Codes::Float(_) = self.codes {
            let mut data = vec![0.0; width * height];
            data.par_chunks_mut(width * BAND).enumerate().for_each(|(band, out)| rows(band * BAND, out));
            return Plane::new(width, height, data);
        }
        let range = self.values.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
        Plane::coded((width, height), range, rows)
    }
}

/// Rows that a thread computes at a time: enough work for it, and several bands for each thread so that none
/// waits.
pub const BAND: usize = 64;

/// The old pixels that contribute to each new one along one axis, with their weights.
struct Taps {
    starts: Vec<(usize, usize)>,
    weights: Vec<f32>,
}

impl Taps {
    fn new(old: usize, new: usize) -> Taps {
        let scale = old as f64 / new as f64;
        let (mut starts, mut weights) = (Vec::with_capacity(new + 1), Vec::new());
        for i in 0..new {
            let from = weights.len();
            let first;
            if scale > 1.0 {
                let (low, high) = (i as f64 * scale, (i + 1) as f64 * scale);
                first = (low.floor() as usize).min(old - 1);
                let last = ((high.ceil() as usize).max(first + 1)).min(old);
                for j in first..last {
                    let covered = high.min((j + 1) as f64) - low.max(j as f64);
                    weights.push(covered.max(0.0) as f32);
                }
            } else {
                let centre = ((i as f64 + 0.5) * scale - 0.5).clamp(0.0, (old - 1) as f64);
                first = (centre.floor() as usize).min(old - 1);
                let s = (centre - first as f64) as f32;
                weights.push(1.0 - s);
                if first + 1 < old {
                    weights.push(s);
                }
            }
            let sum: f32 = weights[from..].iter().sum();
            weights[from..].iter_mut().for_each(|w| *w /= sum);
            starts.push((first, from));
        }
        starts.push((0, weights.len()));
        Taps { starts, weights }
    }

    fn at(&self, i: usize) -> (usize, &[f32]) {
        let (first, from) = self.starts[i];
        (first, &self.weights[from..self.starts[i + 1].1])
    }
}

/// A map, or one number for every pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Field {
    /// The same everywhere.
    Constant(f32),
    /// One number per pixel.
    Map(Plane),
}

impl Field {
    /// The value of a pixel.
    pub fn at(&self, pixel: usize) -> f32 {
        match self {
            Field::Constant(value) => *value,
            Field::Map(plane) => plane.at(pixel),
        }
    }

    /// Multiplies by a constant.
    pub fn times(self, factor: f32) -> Field {
        match self {
            Field::Constant(value) => Field::Constant(value * factor),
            Field::Map(plane) if factor == 1.0 => Field::Map(plane),
            Field::Map(plane) => Field::Map(plane.map(|v| v * factor)),
        }
    }

    /// One minus it: roughness from smoothness.
    pub fn inverted(self) -> Field {
        match self {
            Field::Map(plane) => Field::Map(plane.map(|v| 1.0 - v)),
            Field::Constant(value) => Field::Constant(1.0 - value),
        }
    }

    /// The size, if it is a map.
    pub fn size(&self) -> Option<(usize, usize)> {
        match self {
            Field::Constant(_) => None,
            Field::Map(plane) => Some((plane.width, plane.height)),
        }
    }

    /// Resizes the map, if it is one.
    pub fn resized(self, width: usize, height: usize) -> Field {
        match self {
            Field::Map(plane) if (plane.width, plane.height) != (width, height) => {
                Field::Map(plane.resized(width, height))
            }
            same => same,
        }
    }
}

/// Whether two sizes have the same proportions within 1 %.
pub fn same_shape(a: (usize, usize), b: (usize, usize)) -> bool {
    let (p, q) = (a.0 as f64 * b.1 as f64, b.0 as f64 * a.1 as f64);
    (p - q).abs() <= 0.01 * p.max(q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn shrinking_by_a_whole_factor_is_the_mean_of_blocks(
            w in 1usize..6, h in 1usize..6, fx in 1usize..5, fy in 1usize..5, seed in any::<u32>(),
        ) {
            let value = |i: usize| ((i as u32).wrapping_mul(2_654_435_761).wrapping_add(seed) >> 8) as f32 / 1.7e7;
            let (old_w, old_h) = (w * fx, h * fy);
            let plane = Plane::new(old_w, old_h, (0..old_w * old_h).map(value).collect());
            let small = plane.resized(w, h);
            for y in 0..h {
                for x in 0..w {
                    let mut sum = 0.0;
                    for j in 0..fy {
                        for i in 0..fx {
                            sum += plane.at((y * fy + j) * old_w + x * fx + i);
                        }
                    }
                    let mean = sum / (fx * fy) as f32;
                    prop_assert!((small.at(y * w + x) - mean).abs() < 1e-5);
                }
            }
        }

        #[test]
        fn any_size_keeps_a_constant_and_the_range(
            w in 1usize..9, h in 1usize..9, to_w in 1usize..30, to_h in 1usize..30,
        ) {
            let flat = Plane::new(w, h, vec![0.3; w * h]).resized(to_w, to_h);
            prop_assert!(flat.values().all(|v| (v - 0.3).abs() < 1e-6));
            let ramp = Plane::new(w, h, (0..w * h).map(|i| i as f32).collect()).resized(to_w, to_h);
            let most = (w * h - 1) as f32;
            prop_assert!(ramp.values().all(|v| (-1e-4..=most + 1e-3).contains(&v)));
        }
    }

    #[test]
    fn growing_is_linear_between_centres() {
        let plane = Plane::new(2, 1, vec![0.0, 1.0]).resized(4, 1);
        assert_eq!(Vec::from_iter(plane.values()), [0.0, 0.25, 0.75, 1.0]);
    }

    /// Planes of integers and of the same numbers as floats.
    #[test]
    fn integers_mean_what_floats_say() {
        let codes: Vec<u8> = (0..12 * 9u32).map(|i| (i * 37 % 256) as u8).collect();
        let deep: Vec<u16> = codes.iter().map(|&v| u16::from(v) * 257).collect();
        let float = Plane::new(12, 9, codes.iter().map(|&v| f32::from(v) / 255.0).collect());
        for plane in [Plane::eight(12, 9, codes), Plane::sixteen(12, 9, deep)] {
            let square = |v: f32| 0.7 * v * v;
            let (a, b) = (plane.clone().map(square), float.clone().map(square));
            assert!(a.values().zip(b.values()).all(|(a, b)| (a - b).abs() < 1e-6));
            for size in [(5, 4), (30, 20), (12, 3)] {
                let (a, b) = (a.resized(size.0, size.1), b.resized(size.0, size.1));
                // Steps of 16 bits in the root.
                assert!(a.values().zip(b.values()).all(|(a, b)| (a - b).abs() < 1.2e-5));
            }
        }
    }
}
