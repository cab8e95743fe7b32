//! Tools for drawing the samples: noise, shapes as distances, and layers of materials.
//!
//! Shapes are signed distances in pixels (negative inside), so that one number gives edges, rims and shadows. Each segment
//! of a stroke changes only the pixels near it.

use maths::Maths;
use rayon::prelude::*;

use super::painting::{Finish, Painting};

/// A point or a vector, in pixels, y down.
pub type Point = [f32; 2];

/// A material during drawing; colours are linear.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Base colour, linear.
    pub base: [f32; 3],
    /// Roughness, 0 to 1.
    pub roughness: f32,
    /// Metallic, 0 to 1.
    pub metallic: f32,
}

impl Coat {
    /// A coat from an sRGB colour `0xRRGGBB`.
    pub fn new(hex: u32, roughness: f32, metallic: f32) -> Coat {
        Coat { base: colour(hex), roughness, metallic }
    }

    /// This coat under `share` (0 to 1) of another.
    pub fn under(self, other: Coat, share: f32) -> Coat {
        let share = share.clamp(0.0, 1.0);
        Coat {
            base: mix3(self.base, other.base, share),
            roughness: mix(self.roughness, other.roughness, share),
            metallic: mix(self.metallic, other.metallic, share),
        }
    }

    /// Darker or lighter by a factor.
    pub fn shaded(mut self, factor: f32) -> Coat {
        self.base = self.base.map(|v| v * factor);
        self
    }
}

/// An sRGB colour as linear values.
pub fn colour(hex: u32) -> [f32; 3] {
    [hex >> 16, hex >> 8, hex].map(|v| crate::srgb::decode((v & 255) as f32 / 255.0))
}

/// Interpolates from `a` to `b`.
pub fn mix(a: f32, b: f32, s: f32) -> f32 {
    a + (b - a) * s
}

/// Interpolates from `a` to `b`, channel by channel.
pub fn mix3(a: [f32; 3], b: [f32; 3], s: f32) -> [f32; 3] {
    std::array::from_fn(|c| mix(a[c], b[c], s))
}

/// 0 below `low`, 1 above `high`, smooth between; falls if `low > high`.
pub fn smooth(low: f32, high: f32, v: f32) -> f32 {
    let s = ((v - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// The share of a pixel that lies inside a shape at this signed distance.
pub fn inside(distance: f32) -> f32 {
    smooth(0.7, -0.7, distance)
}

/// A pseudo-random number in 0..1 for a grid point.
pub fn hash(x: i32, y: i32, seed: u32) -> f32 {
    // An integer finaliser with two rounds; any good mixing function would do.
    let mut v = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    v = (v ^ (v >> 15)).wrapping_mul(0x2C1B_3C6D);
    v = (v ^ (v >> 12)).wrapping_mul(0x297A_2D39);
    v ^= v >> 15;
    (v >> 8) as f32 / (1 << 24) as f32
}

/// Value noise of period one, 0 to 1.
pub fn noise(x: f32, y: f32, seed: u32) -> f32 {
    let (fx, fy) = (x.floor(), y.floor());
    let (ix, iy) = (fx as i32, fy as i32);
    let ease = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (sx, sy) = (ease(x - fx), ease(y - fy));
    let top = mix(hash(ix, iy, seed), hash(ix + 1, iy, seed), sx);
    let bottom = mix(hash(ix, iy + 1, seed), hash(ix + 1, iy + 1, seed), sx);
    mix(top, bottom, sy)
}

/// Octaves of noise, each with half the amplitude and about twice the frequency, 0 to 1.
pub fn clouds(x: f32, y: f32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0);
    for octave in 0..octaves {
        sum += weight * noise(x * scale, y * scale, seed.wrapping_add(octave * 101));
        weight *= 0.5;
        scale *= 2.03;
    }
    sum / (1.0 - 0.5f32.whole_power(octaves as i32))
}

/// Distances to the nearest and the second nearest of random points, one per unit cell.
pub fn cells(x: f32, y: f32, seed: u32) -> (f32, f32) {
    let (fx, fy) = (x.floor(), y.floor());
    let (mut first, mut second) = (9.0f32, 9.0f32);
    for dy in -1..=1 {
        for dx in -1..=1 {
            let (cx, cy) = (fx as i32 + dx, fy as i32 + dy);
            let px = cx as f32 + hash(cx, cy, seed) - x;
            let py = cy as f32 + hash(cx, cy, seed ^ 0x5bd1) - y;
            let d = px * px + py * py;
            if d < first {
                second = first;
                first = d;
            } else if d < second {
                second = d;
            }
        }
    }
    (first.sqrt(), second.sqrt())
}

/// Distance from a point to a segment whose radius changes from `ra` to `rb`.
pub fn capsule(p: Point, a: Point, b: Point, ra: f32, rb: f32) -> f32 {
    let (pa, ba) = ([p[0] - a[0], p[1] - a[1]], [b[0] - a[0], b[1] - a[1]]);
    let length = (ba[0] * ba[0] + ba[1] * ba[1]).max(1e-9);
    let s = ((pa[0] * ba[0] + pa[1] * ba[1]) / length).clamp(0.0, 1.0);
    let (dx, dy) = (pa[0] - ba[0] * s, pa[1] - ba[1] * s);
    (dx * dx + dy * dy).sqrt() - mix(ra, rb, s)
}

/// The union of two shapes, with the crease between them filled over about `k` pixels.
pub fn blend(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// A point of a cubic Bézier curve.
pub fn bezier(p: [Point; 4], s: f32) -> Point {
    let r = 1.0 - s;
    let w = [r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s];
    std::array::from_fn(|k| (0..4).map(|i| w[i] * p[i][k]).sum())
}

/// Signed distances to strokes and fills, correct within `reach` pixels of them.
pub struct DistanceField {
    width: usize,
    height: usize,
    reach: f32,
    distance: Vec<f32>,
}

impl DistanceField {
    /// An empty shape; distances are limited to `reach`.
    pub fn new(width: usize, height: usize, reach: f32) -> DistanceField {
        DistanceField { width, height, reach, distance: vec![reach; width * height] }
    }

    /// The signed distance at a pixel.
    pub fn at(&self, pixel: usize) -> f32 {
        self.distance[pixel]
    }

    fn stamp(&mut self, low: Point, high: Point, distance: impl Fn(Point) -> f32) {
        let clip = |v: f32, most: usize| (v.max(0.0) as usize).min(most);
        let (x0, x1) = (clip(low[0] - self.reach, self.width), clip(high[0] + self.reach + 1.0, self.width));
        let (y0, y1) =
            (clip(low[1] - self.reach, self.height), clip(high[1] + self.reach + 1.0, self.height));
        for y in y0..y1 {
            let row = &mut self.distance[y * self.width..][..self.width];
            for (x, d) in row.iter_mut().enumerate().take(x1).skip(x0) {
                *d = d.min(distance([x as f32 + 0.5, y as f32 + 0.5]));
            }
        }
    }

    /// A straight stroke from `a` with radius `ra` to `b` with radius `rb`.
    pub fn stroke(&mut self, a: Point, b: Point, ra: f32, rb: f32) {
        let r = ra.max(rb);
        let low = [a[0].min(b[0]) - r, a[1].min(b[1]) - r];
        let high = [a[0].max(b[0]) + r, a[1].max(b[1]) + r];
        self.stamp(low, high, |p| capsule(p, a, b, ra, rb));
    }

    /// A disc.
    pub fn disc(&mut self, centre: Point, radius: f32) {
        self.stroke(centre, centre, radius, radius);
    }

    /// A stroke through points, with the radius as a function of the position along it (0 to 1).
    pub fn line(&mut self, points: &[Point], radius: impl Fn(f32) -> f32) {
        let last = (points.len().max(2) - 1) as f32;
        for (i, pair) in points.windows(2).enumerate() {
            self.stroke(pair[0], pair[1], radius(i as f32 / last), radius((i + 1) as f32 / last));
        }
    }

    /// A closed outline, filled by the even-odd rule.
    pub fn fill(&mut self, outline: &[Point]) {
        let n = outline.len();
        let mut rim = DistanceField::new(self.width, self.height, self.reach);
        for i in 0..n {
            rim.stroke(outline[i], outline[(i + 1) % n], 0.0, 0.0);
        }
        let mut crossings = Vec::new();
        for y in 0..self.height {
            let at = y as f32 + 0.5;
            crossings.clear();
            for i in 0..n {
                let (a, b) = (outline[i], outline[(i + 1) % n]);
                if (a[1] <= at) != (b[1] <= at) {
                    crossings.push(a[0] + (at - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
            crossings.sort_by(f32::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let x0 = ((pair[0] - 0.5).ceil().max(0.0) as usize).min(self.width);
                let x1 = ((pair[1] - 0.5).ceil().max(0.0) as usize).min(self.width);
                rim.distance[y * self.width..][x0.min(x1)..x1].iter_mut().for_each(|d| *d = -*d);
            }
        }
        self.distance.iter_mut().zip(&rim.distance).for_each(|(d, r)| *d = d.min(*r));
    }
}

/// Paints every pixel, on all cores; `coat` receives the index of the pixel and its centre.
pub fn paint(
    width: usize,
    height: usize,
    size: (u16, u16),
    coat: impl Fn(usize, Point) -> Coat + Sync,
) -> Painting {
    let pixels: Vec<([u8; 3], u8, u8)> = (0..width * height)
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            let p = [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5];
            let coat = coat(i, p);
            (coat.base.map(encode), byte(coat.roughness), byte(coat.metallic))
        })
        .collect();
    Painting {
        width,
        height,
        base: pixels.iter().map(|p| p.0).collect(),
        finish: Finish::Metallic {
            roughness: pixels.iter().map(|p| p.1).collect(),
            metallic: pixels.iter().map(|p| p.2).collect(),
        },
        size,
    }
}

/// Converts 0..1 to a byte.
pub fn byte(v: f32) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A linear value as an sRGB byte.
pub fn encode(v: f32) -> u8 {
    byte(crate::srgb::encode(v))
}

/// A smooth function of the position, sampled every few pixels and interpolated linearly.
pub struct Coarse {
    across: usize,
    down: usize,
    step: f32,
    values: Vec<f32>,
}

impl Coarse {
    /// Samples `f` every `step` pixels, on all cores.
    pub fn sample(width: usize, height: usize, step: usize, f: impl Fn(Point) -> f32 + Sync) -> Coarse {
        let (across, down) = (width / step + 2, height / step + 2);
        let values = (0..across * down)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| f([(i % across * step) as f32, (i / across * step) as f32]))
            .collect();
        Coarse { across, down, step: step as f32, values }
    }

    /// The value at a point; points outside take the value at the border.
    pub fn at(&self, p: Point) -> f32 {
        let cell = |v: f32, n: usize| {
            let v = (v / self.step).clamp(0.0, (n - 1) as f32);
            let i = (v as usize).min(n - 2);
            (i, v - i as f32)
        };
        let ((x, s), (y, t)) = (cell(p[0], self.across), cell(p[1], self.down));
        let row = |y: usize| mix(self.values[y * self.across + x], self.values[y * self.across + x + 1], s);
        mix(row(y), row(y + 1), t)
    }
}
