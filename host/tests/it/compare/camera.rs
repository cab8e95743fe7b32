//! A camera that photographs a sheet: a pinhole with a bent lens that shares nothing with the program's solver or renderer.
//!
//! A ray for each part of a pixel, the dot it meets, that stack's curve, the inverse square of the lamp's distance. One stack is
//! brighter on paper than the library says, and the paper may be darker. Noise is that of a 12-bit sensor.

use std::f64::consts::PI;
use std::path::Path;

use appearance::brdf::{Space, reflectances};
use inks::{Curve, Library, Stack};
use press::layout::Arranged;
use protocol::ink::Ink;
use rayon::prelude::*;

pub type V = [f64; 3];
/// A photograph of 16 bits.
pub type Picture = image::ImageBuffer<image::Rgb<u16>, Vec<u16>>;

pub const SIZE: (usize, usize) = (1200, 900);
pub const FOCAL: f64 = 2300.0;
pub const RADIAL: [f64; 2] = [-0.14, 0.03];
/// Rays across and down a pixel, which sees 2.7 dots. With three, rays that beat with the dots look like an error of 1 %.
const PARTS: u32 = 6;
pub const DOTS_PER_MM: f64 = 600.0 / 25.4;
/// On paper the inks' strongest stack is brighter than in the library.
pub const BRIGHTER: V = [1.3, 1.25, 1.35];

pub fn dot(a: V, b: V) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: V) -> V {
    a.map(|v| v / dot(a, a).sqrt())
}

/// Where a camera stood, what it looked at, how it was turned, and the lamp that was on.
#[derive(Clone, Copy)]
pub struct Shot {
    pub name: &'static str,
    pub eye: V,
    pub target: V,
    pub roll: f64,
    pub lamp: V,
    pub exposure: f64,
}

const LEFT: V = [-190.0, 150.0, 330.0];
pub const RIGHT: V = [260.0, -60.0, 420.0];
pub const SHOTS: [Shot; 4] = [
    Shot {
        name: "left-1.png",
        eye: [10.0, -15.0, 265.0],
        target: [0.0, 1.0, 0.0],
        roll: 0.03,
        lamp: LEFT,
        exposure: 0.8,
    },
    Shot {
        name: "left-2.png",
        eye: [120.0, 60.0, 235.0],
        target: [-2.0, 0.0, 0.0],
        roll: -0.2,
        lamp: LEFT,
        exposure: 0.5,
    },
    Shot {
        name: "right-1.png",
        eye: [-60.0, 130.0, 230.0],
        target: [0.0, 0.0, 0.0],
        roll: 0.1,
        lamp: RIGHT,
        exposure: 0.7,
    },
    Shot {
        name: "right-2.png",
        eye: [-110.0, -70.0, 225.0],
        target: [1.0, 1.0, 0.0],
        roll: 1.5,
        lamp: RIGHT,
        exposure: 1.4,
    },
];
/// The sensor's response to the three channels.
const WHITE: V = [1.5, 1.0, 1.25];

impl Shot {
    /// The camera's axes right, down and forward.
    pub fn axes(&self) -> [V; 3] {
        let forward = unit(minus(self.target, self.eye));
        let right = unit(cross(forward, [0.0, 1.0, 0.0]));
        let down = cross(forward, right);
        let (s, c) = self.roll.sin_cos();
        let turned = |a: V, ka: f64, b: V, kb: f64| -> V { std::array::from_fn(|i| ka * a[i] + kb * b[i]) };
        [turned(right, c, down, s), turned(down, c, right, -s), forward]
    }

    /// The lens moves a place at r to r (1 + k1 r^2 + k2 r^4); Newton's method finds r. What a pixel's middle is to be multiplied by;
    /// within a pixel it is even.
    fn bent(pixel: [f64; 2]) -> f64 {
        let [x, y] = seen(pixel);
        let far = x.hypot(y);
        let mut r = far;
        for _ in 0..5 {
            let r2 = r * r;
            let bent = r * (1.0 + RADIAL[0] * r2 + RADIAL[1] * r2 * r2) - far;
            r -= bent / (1.0 + 3.0 * RADIAL[0] * r2 + 5.0 * RADIAL[1] * r2 * r2);
        }
        if far > 0.0 { r / far } else { 1.0 }
    }

    /// The place on the sheet in mm that is seen at a place of the picture.
    fn place(&self, axes: &[V; 3], at: [f64; 2], by: f64) -> [f64; 2] {
        let [x, y] = seen(at);
        let way: V = std::array::from_fn(|c| axes[2][c] + by * (x * axes[0][c] + y * axes[1][c]));
        let t = -self.eye[2] / way[2];
        [self.eye[0] + t * way[0], self.eye[1] + t * way[1]]
    }

    /// The places in mm whose pixels are full, or nearly: sensors bend the last values.
    pub fn full(&self, picture: &Picture) -> Vec<[f64; 2]> {
        let axes = self.axes();
        let full = picture
            .enumerate_pixels()
            .filter(|(_, _, p)| p.0.iter().any(|v| f64::from(*v) > 0.97 * 65_535.0));
        full.map(|(x, y, _)| [f64::from(x) + 0.5, f64::from(y) + 0.5])
            .map(|pixel| self.place(&axes, pixel, Shot::bent(pixel)))
            .collect()
    }
}

/// Pixels from the picture's corner as tangents of the angles from its middle.
fn seen([x, y]: [f64; 2]) -> [f64; 2] {
    [(x - SIZE.0 as f64 / 2.0) / FOCAL, (y - SIZE.1 as f64 / 2.0) / FOCAL]
}

/// A curve by its values at even steps of the angle.
pub struct Steps(Vec<V>);

impl Steps {
    pub fn new(curve: &Curve, factor: V) -> Steps {
        let value = |i: usize| -> V {
            let f = curve.at(i as f64 / 4096.0 * 1.6);
            std::array::from_fn(|c| f[c] * factor[c])
        };
        Steps((0..=4096).map(value).collect())
    }

    pub fn at(&self, theta: f64) -> V {
        let at = (theta / 1.6 * 4096.0).clamp(0.0, 4095.999);
        let (a, b, t) = (self.0[at as usize], self.0[at as usize + 1], at.fract());
        std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
    }
}

/// The sheet as it lies on the table: dots, and a curve for each stack.
pub struct Sheet {
    pub page: Arranged,
    pub curves: Vec<Steps>,
    /// The stack that is brighter.
    pub bright: usize,
    pub library: Vec<Steps>,
    /// Whether a grey card lies beside it.
    card: bool,
    /// The stack of each dot, where a pass lies beside its place.
    moved: Option<Vec<u8>>,
}

/// Left and top of the grey card's three steps, one below the other, and their side, in mm.
const CARD: (f64, f64, f64) = (54.0, 13.0, 9.0);
/// Of the table around the sheet: unlike any of them.
const TABLE: f64 = 0.1;
const GREY: V = [0.9, 0.18, 0.036];

impl Sheet {
    /// A sheet on paper as the library says, with its strongest stack brighter.
    pub fn load(folder: &Path) -> Sheet {
        Sheet::on(folder, [1.0; 3], BRIGHTER, false)
    }

    /// The same with another factor on that stack.
    pub fn with_stack(folder: &Path, factor: V) -> Sheet {
        Sheet::on(folder, [1.0; 3], factor, false)
    }

    /// A sheet on another paper, with a grey card on it: by the paper, whatever is white would be wrong.
    pub fn with_card(folder: &Path) -> Sheet {
        Sheet::on(folder, [0.85, 0.8, 0.7], BRIGHTER, true)
    }

    fn on(folder: &Path, paper: V, brighter: V, card: bool) -> Sheet {
        let page = Arranged::load(folder).unwrap();
        let library = Library::builtin();
        let space = Space::half_angle(512);
        let plain: Vec<Curve> =
            reflectances(page.sheet.stacks(), &library, &space).rows().map(|row| space.curve(row)).collect();
        let census = page.laid.census(&page.sheet);
        let bright = (1..plain.len()).max_by_key(|&i| census[i]).unwrap();
        let factor = |i: usize| match i {
            _ if page.sheet.stacks()[i].layers().is_empty() => paper,
            _ if i == bright => brighter,
            _ => [1.0; 3],
        };
        let curves = plain.iter().enumerate().map(|(i, curve)| Steps::new(curve, factor(i))).collect();
        let library = plain.iter().map(|curve| Steps::new(curve, [1.0; 3])).collect();
        Sheet { page, curves, bright, library, card, moved: None }
    }

    /// As predicted, but one ink lies so many dots to the right and down. It goes on top of what it then lies on.
    pub fn with_pass_off(folder: &Path, ink: Ink, [right, down]: [i64; 2]) -> Sheet {
        let mut sheet = Sheet::on(folder, [1.0; 3], [1.0; 3], false);
        let dots = &sheet.page.sheet;
        let (width, length) = (dots.width() as i64, dots.length() as i64);
        let mut stacks = dots.stacks().to_vec();
        let mut moved = Vec::with_capacity(dots.index().len());
        for i in 0..dots.index().len() as i64 {
            let (x, y) = (i % width - right, i / width - down);
            let there = (0..width).contains(&x) && (0..length).contains(&y);
            let from = if there { usize::from(dots.index()[(y * width + x) as usize]) } else { 0 };
            let own = usize::from(dots.index()[i as usize]);
            let (has, gets) = (stacks[own].layers().contains(&ink), stacks[from].layers().contains(&ink));
            if has == gets {
                moved.push(own as u8);
                continue;
            }
            let mut layers: Vec<Ink> =
                stacks[own].layers().iter().copied().filter(|own| *own != ink).collect();
            if gets {
                layers.push(ink);
            }
            let stack = Stack::new(layers);
            let known = stacks.iter().position(|known| *known == stack);
            moved.push(known.unwrap_or(stacks.len()) as u8);
            if known.is_none() {
                stacks.push(stack);
            }
        }
        let space = Space::half_angle(512);
        let rows = reflectances(&stacks[sheet.curves.len()..], &Library::builtin(), &space);
        sheet.curves.extend(rows.rows().map(|row| Steps::new(&space.curve(row), [1.0; 3])));
        sheet.moved = Some(moved);
        sheet
    }

    /// The middle of the print in dots: that of its marks, which stand alike above and below.
    pub fn middle(&self) -> [f64; 2] {
        let copy = self.page.laid.copies[0];
        [copy.left as f64 + copy.width as f64 / 2.0, copy.top as f64 + copy.length as f64 / 2.0]
    }

    /// Reflectance at a place in mm under a half angle.
    fn at(&self, [x, y]: [f64; 2], theta: f64) -> V {
        let (left, top, side) = CARD;
        let step = (top - y) / side;
        if self.card && (left..left + side).contains(&x) && (0.0..3.0).contains(&step) {
            return [GREY[step as usize] / PI; 3];
        }
        self.stack(x, y).map_or([TABLE / PI; 3], |stack| self.curves[stack].at(theta))
    }

    /// The stack at a place in mm; nothing beyond the paper.
    fn stack(&self, x: f64, y: f64) -> Option<usize> {
        let [mx, my] = self.middle();
        let (i, j) = ((mx + x * DOTS_PER_MM).floor(), (my - y * DOTS_PER_MM).floor());
        let (width, length) = (self.page.sheet.width() as f64, self.page.sheet.length() as f64);
        let margin = 4.0 * DOTS_PER_MM;
        if i < -margin || j < -margin || i >= width + margin || j >= length + margin {
            return None;
        }
        if i < 0.0 || j < 0.0 || i >= width || j >= length {
            return Some(0);
        }
        let index = self.moved.as_deref().unwrap_or(self.page.sheet.index());
        Some(usize::from(index[j as usize * self.page.sheet.width() + i as usize]))
    }
}

/// Half angle, and irradiance relative to that of a surface that faces the lamp in the middle of the sheet.
pub fn lit(place: [f64; 2], eye: V, lamp: V) -> (f64, f64) {
    let p = [place[0], place[1], 0.0];
    let (to, away) = (minus(lamp, p), minus(eye, p));
    let (l, v) = (unit(to), unit(away));
    let h = unit(std::array::from_fn(|i| l[i] + v[i]));
    (h[2].clamp(-1.0, 1.0).acos(), l[2] * dot(lamp, lamp) / dot(to, to))
}

/// A photograph: RGB of 12 bits in 16.
pub fn photograph(sheet: &Sheet, shot: &Shot, exposure: f64, noise: bool) -> Picture {
    let axes = shot.axes();
    let (width, height) = SIZE;
    let values: Vec<u16> = (0..height)
        .into_par_iter()
        .flat_map_iter(|j| {
            let mut state =
                0x9e37_79b9_7f4a_7c15u64.wrapping_mul(j as u64 + 1 + 7919 * shot.name.len() as u64);
            let mut row = Vec::with_capacity(3 * width);
            for i in 0..width {
                let pixel = [i as f64 + 0.5, j as f64 + 0.5];
                let by = Shot::bent(pixel);
                let (theta, irradiance) = lit(shot.place(&axes, pixel, by), shot.eye, shot.lamp);
                let mut sum = [0.0; 3];
                for k in 0..PARTS * PARTS {
                    let part = |k: u32| (f64::from(k) + 0.5) / f64::from(PARTS);
                    let place =
                        shot.place(&axes, [i as f64 + part(k % PARTS), j as f64 + part(k / PARTS)], by);
                    let f = sheet.at(place, theta);
                    (0..3).for_each(|c| sum[c] += f[c] * irradiance / f64::from(PARTS * PARTS));
                }
                for c in 0..3 {
                    // White paper is about 0.85 / pi.
                    let signal = 4095.0 * 2.2 * sum[c] * exposure * WHITE[c] / 1.5;
                    let mut normal = -6.0;
                    for _ in 0..12 {
                        state = state
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        normal += (state >> 11) as f64 / (1u64 << 53) as f64;
                    }
                    let seen =
                        if noise { signal + normal * (0.25 * signal.max(0.0) + 4.0).sqrt() } else { signal };
                    row.push(seen.round().clamp(0.0, 4095.0) as u16 * 16);
                }
            }
            row
        })
        .collect();
    image::ImageBuffer::from_raw(width as u32, height as u32, values).unwrap()
}

/// The same through a lens out of focus: a normal distribution of so many pixels.
pub fn out_of_focus(picture: &Picture, sigma: f64) -> Picture {
    let reach = (3.5 * sigma).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let whole: f64 = weights.iter().sum();
    let (width, height) = (picture.width() as i64, picture.height() as i64);
    let mut values: Vec<f64> = picture.as_raw().iter().map(|v| f64::from(*v)).collect();
    for [dx, dy] in [[1, 0], [0, 1]] {
        values = (0..values.len() as i64)
            .into_par_iter()
            .map(|i| {
                let (x, y, c) = (i / 3 % width, i / 3 / width, i % 3);
                let at = |k: i64| {
                    let (x, y) = ((x + k * dx).clamp(0, width - 1), (y + k * dy).clamp(0, height - 1));
                    values[(3 * (y * width + x) + c) as usize]
                };
                (-reach..=reach).zip(&weights).map(|(k, weight)| weight * at(k)).sum::<f64>() / whole
            })
            .collect();
    }
    let values = values.into_iter().map(|v| v.round() as u16).collect();
    image::ImageBuffer::from_raw(picture.width(), picture.height(), values).unwrap()
}
