//! Maps with one number per pixel, and resizing them to a common size.

use rayon::prelude::*;

/// One number per pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Plane {
    /// A plane of `width * height` values.
    ///
    /// # Panics
    /// If the number of values is wrong, which is a bug in the caller and never depends on input.
    pub fn new(width: usize, height: usize, data: Vec<f32>) -> Plane {
        assert_eq!(data.len(), width * height, "the plane has another size");
        Plane { width, height, data }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The values.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// Applies `f` to every value, on all cores.
    pub fn map(mut self, f: impl Fn(f32) -> f32 + Sync) -> Plane {
        self.data.par_iter_mut().for_each(|v| *v = f(*v));
        self
    }

    /// Resizes the plane. Shrinking takes the mean over the area of each new pixel; enlarging interpolates linearly between
    /// pixel centres. Separable; the cost is proportional to the pixels read and written.
    pub fn resized(&self, width: usize, height: usize) -> Plane {
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let across = Taps::new(self.width, width);
        let mut narrow = vec![0.0; width * self.height];
        narrow.par_chunks_mut(width).zip(self.data.par_chunks(self.width)).for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                let (first, weights) = across.at(x);
                *out = weights.iter().zip(&row[first..]).map(|(&w, &v)| w * v).sum();
            }
        });
        let down = Taps::new(self.height, height);
        let mut data = vec![0.0; width * height];
        data.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            let (first, weights) = down.at(y);
            for (&weight, row) in weights.iter().zip(narrow[first * width..].chunks_exact(width)) {
                for (out, &v) in out.iter_mut().zip(row) {
                    *out += weight * v;
                }
            }
        });
        Plane { width, height, data }
    }
}

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
            Field::Map(plane) => plane.data[pixel],
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
                            sum += plane.data()[(y * fy + j) * old_w + x * fx + i];
                        }
                    }
                    let mean = sum / (fx * fy) as f32;
                    prop_assert!((small.data()[y * w + x] - mean).abs() < 1e-5);
                }
            }
        }

        #[test]
        fn any_size_keeps_a_constant_and_the_range(
            w in 1usize..9, h in 1usize..9, to_w in 1usize..30, to_h in 1usize..30,
        ) {
            let flat = Plane::new(w, h, vec![0.3; w * h]).resized(to_w, to_h);
            prop_assert!(flat.data().iter().all(|v| (v - 0.3).abs() < 1e-6));
            let ramp = Plane::new(w, h, (0..w * h).map(|i| i as f32).collect()).resized(to_w, to_h);
            let most = (w * h - 1) as f32;
            prop_assert!(ramp.data().iter().all(|v| (-1e-4..=most + 1e-3).contains(v)));
        }
    }

    #[test]
    fn growing_is_linear_between_centres() {
        let plane = Plane::new(2, 1, vec![0.0, 1.0]).resized(4, 1);
        assert_eq!(plane.data(), [0.0, 0.25, 0.75, 1.0]);
    }
}
