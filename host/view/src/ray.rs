//! Where the rays of a picture meet the sheet, for many pixels of a row at once.
//!
//! Problem: a million rays a frame, each a few roots and divisions, which one after the other take four fifths of a frame.
//! Method: a ray meets the plane or the cylinder of the sheet in closed form. The form has no branch, and what it finds goes to
//! one list a figure ([`Hits`]), so the compiler runs it in lanes over neighbouring pixels. A ray that misses is computed like all
//! others and covers nothing. The angle on a cylinder and the logarithm of a footprint are polynomials: a library's function
//! takes one number at a time, and differs from machine to machine.
//! Cost: about 100 operations and ten roots or divisions a pixel. Error: 3e-7 radians of the angle and 1e-6 of the level (tests).
//! Limits: the silhouette of a bent sheet is not smooth; the footprint is a circle.
//! Source of the arc tangent: M. Abramowitz, I. Stegun, Handbook of Mathematical Functions, 4.4.49.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::scene::{Frame, Scene, right_and_up, unit};

pub(crate) type V = [f32; 3];

/// Pixels of a row that are handled together: many lanes, and so few that all their figures stay in the nearest cache.
pub(crate) const BLOCK: usize = 64;

/// A value for each pixel of a block.
pub(crate) type Values = [f32; BLOCK];

/// The rays of one picture, in the axes of the sheet.
pub(crate) struct Rays {
    /// The eye, if it is near.
    eye: Option<V>,
    /// Unit direction to the eye from the origin.
    towards: V,
    /// A pixel to the right and up, in metres.
    right: V,
    up: V,
    /// The window's point at the top left corner of the picture.
    corner: V,
    curl: Option<f32>,
    /// Half the sheet's sides.
    half: [f32; 2],
    /// Places of the finest weight map in a metre across and down.
    density: [f32; 2],
}

/// Where the rays of a block of pixels meet the sheet. Figures of pixels that cover nothing mean nothing.
pub(crate) struct Hits {
    /// The part of the pixel that the sheet covers.
    pub covered: Values,
    /// The point in the axes of the sheet, metres.
    pub at: [Values; 3],
    /// The normal's x and z; its y is 0.
    pub normal: [Values; 2],
    /// Unit direction to the eye.
    pub view: [Values; 3],
    /// Place along the paper from the top left corner, as parts of the sheet's sides.
    pub place: [Values; 2],
    /// The level of the pyramid whose places are as large as the pixel, 0 or more.
    pub level: Values,
    /// A pixel to the right and one up on the paper: each to the right and up, in metres.
    pub steps: [[Values; 2]; 2],
}

impl Default for Hits {
    fn default() -> Hits {
        let none = [0.0; BLOCK];
        Hits {
            covered: none,
            at: [none; 3],
            normal: [none; 2],
            view: [none; 3],
            place: [none; 2],
            level: none,
            steps: [[none; 2]; 2],
        }
    }
}

/// A surface that rays meet.
trait Surface {
    /// How many `d` from `o` the nearest point is along the whole line; not finite if there is none.
    fn meet(&self, o: V, d: V) -> f32;
    /// The normal's x and z at a point of it, and how far along the paper the point is from the middle.
    fn point(&self, at: V) -> ([f32; 2], f32);
}

struct Flat;

struct Bent {
    radius: f32,
    inverse: f32,
}

impl Surface for Flat {
    #[inline(always)]
    fn meet(&self, o: V, d: V) -> f32 {
        -o[2] / d[2]
    }

    #[inline(always)]
    fn point(&self, at: V) -> ([f32; 2], f32) {
        ([0.0, 1.0], at[0])
    }
}

impl Surface for Bent {
    #[inline(always)]
    fn meet(&self, o: V, d: V) -> f32 {
        // The axis lies a radius behind the origin; the square of the radius has cancelled in `c`.
        let a = d[0] * d[0] + d[2] * d[2];
        let b = o[0] * d[0] + (o[2] + self.radius) * d[2];
        let c = o[0] * o[0] + o[2] * o[2] + 2.0 * o[2] * self.radius;
        // The line's distance from the axis, times the length of `d`. Instead of `b * b - a * c`, which cancels.
        let beside = o[0] * d[2] - (o[2] + self.radius) * d[0];
        let root = (self.radius * self.radius * a - beside * beside).sqrt();
        // The nearer root, by the formula that does not cancel. None is not a number.
        let (above, below) = if b < 0.0 { (c, root - b) } else { (-b - root, a) };
        above / below
    }

    #[inline(always)]
    fn point(&self, at: V) -> ([f32; 2], f32) {
        let (x, z) = (at[0], at[2] + self.radius);
        ([x * self.inverse, z * self.inverse], self.radius * angle(x, z))
    }
}

impl Rays {
    /// The rays of a picture of `width` x `height` pixels of a sheet of `size` metres, whose finest weight map has `places`.
    pub fn new(scene: &Scene, size: [f64; 2], places: [usize; 2], width: usize, height: usize) -> Rays {
        let frame = Frame::new(&scene.pose);
        let towards = unit(scene.camera.towards);
        let [right, up] = right_and_up(towards).map(|axis| frame.in_sheet(axis));
        let pixel = scene.camera.height / height as f64;
        let [x, y] = scene.camera.middle;
        let (left, top) = (x - 0.5 * width as f64 * pixel, y + 0.5 * height as f64 * pixel);
        let f32s = |v: [f64; 3]| v.map(|c| c as f32);
        let towards = frame.in_sheet(towards);
        Rays {
            eye: scene.camera.distance.map(|distance| f32s(towards.map(|c| c * distance))),
            towards: f32s(towards),
            right: f32s(right.map(|c| c * pixel)),
            up: f32s(up.map(|c| c * pixel)),
            corner: f32s(std::array::from_fn(|c| left * right[c] + top * up[c])),
            curl: scene.pose.curl.map(|r| r as f32),
            half: size.map(|side| 0.5 * side as f32),
            density: std::array::from_fn(|i| places[i] as f32 / size[i] as f32),
        }
    }

    /// Puts the window into the sheet, edge to edge, instead of in front of the eye.
    pub fn lay_flat(&mut self, width: usize, height: usize) {
        let [w, h] = self.half.map(|half| 2.0 * half);
        self.right = [w / width as f32, 0.0, 0.0];
        self.up = [0.0, h / height as f32, 0.0];
        self.corner = [-self.half[0], self.half[1], 0.0];
    }

    /// Follows the rays through the middles of [`BLOCK`] pixels of row `y`, from pixel `x` on.
    #[inline(always)]
    pub fn follow(&self, x: usize, y: usize, hits: &mut Hits) {
        let bent = |radius: f32| Bent { radius, inverse: 1.0 / radius };
        match (self.eye, self.curl.map(bent)) {
            (None, None) => self.hit(&Flat, |_| self.towards.map(|c| -c), |_| 1.0, x, y, hits),
            (None, Some(bent)) => self.hit(&bent, |_| self.towards.map(|c| -c), |_| 1.0, x, y, hits),
            (Some(eye), None) => self.hit(&Flat, |w| minus(w, eye), |t| 1.0 + t, x, y, hits),
            (Some(eye), Some(bent)) => self.hit(&bent, |w| minus(w, eye), |t| 1.0 + t, x, y, hits),
        }
    }

    /// `ray` makes the direction of the ray through a point of the window, as far as from the eye. Rays are followed from the
    /// window, which is near the sheet, both ways: from a far eye places would be rounded to its distance. `scale` is how
    /// long a step in the window has become where the ray hits, so many directions from the window.
    #[inline(always)]
    fn hit(
        &self,
        surface: &impl Surface,
        ray: impl Fn(V) -> V,
        scale: impl Fn(f32) -> f32,
        x: usize,
        y: usize,
        hits: &mut Hits,
    ) {
        let line: V = std::array::from_fn(|c| self.corner[c] - (y as f32 + 0.5) * self.up[c]);
        // What lies behind a near eye is not seen. A far eye has nothing behind it.
        let least = if self.eye.is_some() { -1.0 } else { f32::NEG_INFINITY };
        let inverse = self.half.map(|half| 0.5 / half);
        let (right, up) = (self.right, self.up);
        for i in 0..BLOCK {
            let px = (x + i) as i32 as f32 + 0.5;
            let o = [line[0] + px * right[0], line[1] + px * right[1], line[2] + px * right[2]];
            let d = ray(o);
            let t = surface.meet(o, d);
            let at = [o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]];
            let ([nx, nz], along) = surface.point(at);
            let facing = nx * d[0] + nz * d[2];
            // A step in the picture, moved along the ray into the tangent plane: along the paper, across and down.
            let scale = scale(t);
            let slope = 1.0 / facing;
            let step = |e: V| {
                let on = (nx * e[0] + nz * e[2]) * slope;
                let p = [e[0] - on * d[0], e[1] - on * d[1], e[2] - on * d[2]];
                [scale * (p[0] * nz - p[2] * nx), scale * p[1]]
            };
            let (across, down) = (step(right), step(up));
            let edge = |place: f32, half: f32, a: f32, b: f32| {
                // At the silhouette of a bent sheet a step goes to infinity, which must not blur its edge into the air.
                let width = greater(lesser((a * a + b * b).sqrt(), 0.1 * half), 1e-12);
                greater(lesser((half - place.abs()) / width + 0.5, 1.0), 0.0)
            };
            let covered =
                edge(along, self.half[0], across[0], down[0]) * edge(at[1], self.half[1], across[1], down[1]);
            let seen = (t > least) & (t < f32::INFINITY) & (facing < 0.0) & (covered > 0.0);
            hits.covered[i] = if seen { covered } else { 0.0 };
            let length = |[s, y]: [f32; 2]| {
                let (s, y) = (s * self.density[0], y * self.density[1]);
                s * s + y * y
            };
            for (hits, step) in hits.steps.iter_mut().zip([across, down]) {
                (hits[0][i], hits[1][i]) = (step[0], step[1]);
            }
            hits.level[i] = 0.5 * log2(greater(greater(length(across), length(down)), 1.0));
            let part = |at: f32| greater(lesser(at, 1.0), 0.0);
            hits.place[0][i] = part(0.5 + along * inverse[0]);
            hits.place[1][i] = part(0.5 - at[1] * inverse[1]);
            [hits.at[0][i], hits.at[1][i], hits.at[2][i]] = at;
            [hits.normal[0][i], hits.normal[1][i]] = [nx, nz];
            let back = -1.0 / dot(d, d).sqrt();
            [hits.view[0][i], hits.view[1][i], hits.view[2][i]] = d.map(|c| back * c);
        }
    }
}

/// The angle from +z to a point, growing towards +x.
#[inline(always)]
fn angle(x: f32, z: f32) -> f32 {
    const TERMS: [f32; 8] = [
        -0.333_331_45,
        0.199_935_51,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_614,
        -0.016_165_737,
        0.002_866_225_7,
    ];
    let (ax, az) = (x.abs(), z.abs());
    let q = lesser(ax, az) / greater(ax, az);
    let square = q * q;
    let mut sum = TERMS[7];
    for k in (0..7).rev() {
        sum = sum * square + TERMS[k];
    }
    let octant = q + q * (square * sum);
    let quadrant = if ax < az { octant } else { FRAC_PI_2 - octant };
    let half = if z < 0.0 { PI - quadrant } else { quadrant };
    if x < 0.0 { -half } else { half }
}

/// The logarithm to base 2 of a number from 1 on.
#[inline(always)]
fn log2(x: f32) -> f32 {
    /// The root of 1/2: what is left of `x` without its power of two lies between this and the root of 2.
    const LEAST: u32 = 0x3f35_04f3;
    let bits = x.to_bits().wrapping_sub(LEAST);
    let power = (bits.cast_signed() >> 23) as f32;
    let rest = f32::from_bits((bits & 0x007f_ffff) + LEAST);
    // 2 / ln 2 of the area tangent, whose series needs four terms this near to 0.
    let z = (rest - 1.0) / (rest + 1.0);
    let square = z * z;
    power + z * (2.885_39 + square * (0.961_796_7 + square * (0.577_078 + square * 0.412_198_6)))
}

/// The first, unless the second is less or the first is not a number. One instruction, unlike [`f32::min`].
#[inline(always)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The first, unless the second is greater or the first is not a number.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(crate) fn dot(a: V, b: V) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn minus(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Pose, direction};
    use proptest::prelude::*;

    const SIZE: [f64; 2] = [0.1, 0.08];
    const PLACES: [usize; 2] = [2048, 1024];

    /// Where the ray through a point of a picture (pixels) of a side of 100 meets the sheet, in f64: the point by bisection of
    /// the ray, and the place along the paper.
    fn by_hand(scene: &Scene, x: f64, y: f64) -> Option<([f64; 3], [f64; 2])> {
        let frame = Frame::new(&scene.pose);
        let towards = unit(scene.camera.towards);
        let [right, up] = right_and_up(towards).map(|axis| frame.in_sheet(axis));
        let towards = frame.in_sheet(towards);
        let step = scene.camera.height / 100.0;
        let window: [f64; 3] =
            std::array::from_fn(|c| (x - 50.0) * step * right[c] + (50.0 - y) * step * up[c]);
        // A far eye is far enough at 10 m, as its rays are parallel.
        let eye: [f64; 3] = std::array::from_fn(|c| match scene.camera.distance {
            Some(d) => d * towards[c],
            None => window[c] + 10.0 * towards[c],
        });
        let along = |t: f64| -> [f64; 3] { std::array::from_fn(|c| eye[c] + t * (window[c] - eye[c])) };
        let above = |p: [f64; 3]| match scene.pose.curl {
            Some(r) => p[0].hypot(p[2] + r) - r,
            None => p[2],
        };
        // Beyond the point nearest to the axis, or far beyond the plane.
        let mut far = match scene.pose.curl {
            Some(r) => {
                let (d0, d2) = (window[0] - eye[0], window[2] - eye[2]);
                -(eye[0] * d0 + (eye[2] + r) * d2) / (d0 * d0 + d2 * d2)
            }
            None => 100.0,
        };
        if above(along(far)) > 0.0 {
            return None;
        }
        let mut near = 0.0;
        for _ in 0..100 {
            let middle = 0.5 * (near + far);
            if above(along(middle)) > 0.0 { near = middle } else { far = middle }
        }
        let p = along(far);
        let s = scene.pose.curl.map_or(p[0], |r| r * p[0].atan2(p[2] + r));
        Some((p, [s, p[1]]))
    }

    proptest! {
        #![proptest_config(testing::cases(60))]

        #[test]
        fn rays_meet_the_sheet_where_bisection_finds_it(
            towards in (-60.0..60.0, -50.0..50.0),
            distance in prop::option::of(0.15..2.0),
            pose in (-0.3..0.3, -0.3..0.3, prop::option::of(1.0..30.0)),
            zoom in 0.05..1.2,
            row in 0..100usize,
        ) {
            let (turn, tip, curl) = pose;
            let mut camera = Camera::whole(direction(towards.0, towards.1), distance, SIZE, 1.0);
            camera.height *= zoom;
            let pose = Pose { turn, tip, curl: curl.map(|c| c * SIZE[0] / std::f64::consts::PI) };
            let scene = Scene { camera, pose, lights: Vec::new(), probe: None };
            prop_assume!(scene.check(SIZE).is_ok());
            let rays = Rays::new(&scene, SIZE, PLACES, 100, 100);
            let mut hits = Hits::default();
            rays.follow(20, row, &mut hits);
            for i in 0..BLOCK {
                let (x, y) = ((20 + i) as f64 + 0.5, row as f64 + 0.5);
                let hand = by_hand(&scene, x, y);
                let Some((at, place)) = hand.filter(|(_, p)| (0..2).all(|c| p[c].abs() < 0.49 * SIZE[c])) else {
                    continue;
                };
                let normal = match scene.pose.curl {
                    Some(r) => [at[0] / r, 0.0, (at[2] + r) / r],
                    None => [0.0, 0.0, 1.0],
                };
                let view: [f64; 3] = std::array::from_fn(|c| f64::from(hits.view[c][i]));
                let facing: f64 = (0..3).map(|c| normal[c] * view[c]).sum();
                if facing < 0.1 {
                    continue;
                }
                // A step of a hundredth of a pixel, which the curve of the sheet does not change.
                let step = |dx: f64, dy: f64| {
                    let (_, to) = by_hand(&scene, x + dx, y + dy).unwrap();
                    let parts: [f64; 2] =
                        std::array::from_fn(|c| 100.0 * (to[c] - place[c]) * PLACES[c] as f64 / SIZE[c]);
                    parts[0].hypot(parts[1])
                };
                let level = step(0.01, 0.0).max(step(0.0, 0.01)).log2().max(0.0);
                prop_assert!(hits.covered[i] > 0.0, "{} is not covered", x);
                for c in 0..3 {
                    prop_assert!((f64::from(hits.at[c][i]) - at[c]).abs() < 3e-7, "{:?}, not {:?}", hits.at[c][i], at);
                }
                for (c, n) in [normal[0], normal[2]].into_iter().enumerate() {
                    prop_assert!((f64::from(hits.normal[c][i]) - n).abs() < 1e-5);
                }
                let (u, v) = (place[0] / SIZE[0] + 0.5, 0.5 - place[1] / SIZE[1]);
                for (found, expected) in [(hits.place[0][i], u), (hits.place[1][i], v)] {
                    prop_assert!((f64::from(found) - expected).abs() < 5e-6, "{}, not {}", found, expected);
                }
                prop_assert!((f64::from(hits.level[i]) - level).abs() < 0.02, "{}, not {}", hits.level[i], level);
            }
        }
    }

    #[test]
    fn the_angle_is_that_of_the_library() {
        let mut worst = 0.0f64;
        for i in 0..200_000 {
            let a = (f64::from(i) / 100_000.0 - 1.0) * std::f64::consts::PI;
            for r in [1e-3, 0.07, 1000.0] {
                let (x, z) = ((r * a.sin()) as f32, (r * a.cos()) as f32);
                let exact = f64::from(x).atan2(f64::from(z));
                worst = worst.max((f64::from(angle(x, z)) - exact).abs());
            }
        }
        assert!(worst < 3e-7, "{worst}");
        assert_eq!((angle(0.0, 1.0), angle(2.0, 0.0), angle(-2.0, 0.0)), (0.0, FRAC_PI_2, -FRAC_PI_2));
    }

    #[test]
    fn the_logarithm_is_that_of_the_library() {
        let mut worst = 0.0f64;
        let mut x = 1.0f32;
        while x < 1e9 {
            let off = (f64::from(log2(x)) - f64::from(x).log2()).abs();
            worst = worst.max(off);
            x *= 1.000_1;
        }
        assert!(worst < 2e-6, "{worst}");
        assert_eq!((log2(1.0), log2(2.0), log2(4096.0)), (0.0, 1.0, 12.0));
        // The silhouette of a bent sheet.
        assert!(log2(f32::INFINITY) > 100.0);
    }
}
