//! A studio in which one thing at a time goes wrong: a can of one stack, a card, a lamp and a camera, with what disturbs them.
//!
//! Problem: a measurement must not be wrong in silence, so each disturbance needs photographs whose truth is known. Method: rays through
//! parts of a pixel meet the can, the card or the cloth behind; a lamp is a disc of points, a table a grid of patches that pass
//! its light on, a lens blurs the picture of light, glare spreads a part of it evenly; then come exposure, noise, the sensor's limit and the
//! file. Nothing here is shared with the program. Cost: about a second for a series. Limits: one bounce from the table, and
//! materials that reflect by the half angle.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use inks::ggx;
use measure::setup::Setup;
use rayon::prelude::*;

use crate::made::{V, dot, minus, unit};

/// A stack: its name, a diffuse part and a lobe.
#[derive(Clone, Copy)]
pub struct Material {
    pub name: &'static str,
    pub stack: &'static str,
    pub diffuse: V,
    pub f0: V,
    pub alpha: f64,
}

/// From matte to mirror.
pub const MATERIALS: [Material; 6] = [
    Material { name: "paper", stack: "substrate", diffuse: [0.84, 0.85, 0.88], f0: [0.04; 3], alpha: 0.28 },
    Material { name: "glossy black", stack: "K+F", diffuse: [0.02; 3], f0: [0.045; 3], alpha: 0.05 },
    Material { name: "magenta", stack: "M", diffuse: [0.69, 0.02, 0.2], f0: [0.04; 3], alpha: 0.12 },
    Material { name: "metallic silver", stack: "MS", diffuse: [0.1; 3], f0: [0.57; 3], alpha: 0.27 },
    Material {
        name: "red on silver",
        stack: "MS+M+Y",
        diffuse: [0.06, 0.012, 0.01],
        f0: [0.42, 0.05, 0.04],
        alpha: 0.2,
    },
    Material { name: "silver foil", stack: "SF", diffuse: [0.015; 3], f0: [0.85; 3], alpha: 0.05 },
];

impl Material {
    pub fn at(&self, theta: f64) -> V {
        std::array::from_fn(|c| 0.96 * self.diffuse[c] / PI + self.f0[c] * ggx::lobe(theta, self.alpha))
    }
}

/// How the camera writes its values, for values of 0 to 1.
#[derive(Clone, Copy, PartialEq)]
pub enum Written {
    /// 16 bits, proportional to light.
    Linear,
    /// 16 bits with the tone curve of sRGB.
    Srgb,
    /// 16 bits with this added.
    Offset(f64),
    /// JPEG, with sRGB and an S-curve of this strength over it.
    Jpeg(f64),
}

/// What is in the studio, and what the setup file says.
#[derive(Clone)]
pub struct Studio {
    pub size: (usize, usize),
    /// Exposure times in seconds, longest first.
    pub times: Vec<f64>,
    pub radius: f64,
    pub lamp: V,
    /// The lamp's true diameter in mm, and the one in the setup file.
    pub lamp_mm: f64,
    pub lamp_said_mm: f64,
    /// What the setup file says of radius and lamp.
    pub radius_said: f64,
    pub lamp_said: V,
    /// Standard deviation of the lens' blur in pixels.
    pub blur: f64,
    /// Largest slope of the paper's waves in degrees, and their length along the arc or along the axis in mm.
    pub waves: (f64, f64),
    pub waves_along: bool,
    /// Reflectance of a table under the can.
    pub table: f64,
    /// Radiance of a white wall behind the camera, in parts of the card's white.
    pub room: f64,
    /// The part of all light that the lens spreads evenly.
    pub glare: f64,
    /// Gains of red and blue in each photograph are off by so much, alternating.
    pub drift: (f64, f64),
    /// The lamp's flicker from photograph to photograph.
    pub flicker: f64,
    pub written: Written,
    /// The part of light that is lost in the corners, whether a flat field takes it out, whether that is full itself.
    pub vignetting: f64,
    pub flat_field: bool,
    /// Movement from photograph to photograph in pixels.
    pub moved: [f64; 2],
    /// The lens' distortion: places move outward by this part at half the width.
    pub distortion: f64,
    /// The gains of the sensor's channels, and bits of its values.
    pub gains: V,
    /// The true reflectance of the card's steps.
    pub card: V,
    /// A photograph with the lamp off is there.
    pub lamp_off: bool,
    pub known: bool,
    pub seed: u64,
}

pub const EYE: V = [30.0, 70.0, 1350.0];
pub const LOOK: V = [24.0, 0.0, 0.0];
pub const FIELD_DEG: f64 = 10.0;
const LAMP: V = [-310.0, 90.0, 1020.0];
/// The card's left edge, its bottom, and the width of a step in mm.
const CARD: [f64; 3] = [56.0, -34.0, 14.0];
const CARD_HIGH: f64 = 22.0;
const HEIGHT: f64 = 130.0;

impl Default for Studio {
    fn default() -> Studio {
        Studio {
            size: (600, 450),
            times: vec![2.0, 0.5, 0.125, 0.033_333, 0.008],
            radius: 42.0,
            lamp: LAMP,
            lamp_mm: 0.0,
            lamp_said_mm: 0.0,
            radius_said: 42.0,
            lamp_said: LAMP,
            blur: 0.0,
            waves: (0.0, 15.0),
            waves_along: false,
            table: 0.0,
            room: 0.0,
            glare: 0.0,
            drift: (0.0, 0.0),
            flicker: 0.0,
            written: Written::Linear,
            vignetting: 0.0,
            flat_field: false,
            moved: [0.0; 2],
            distortion: 0.0,
            gains: [1.7, 1.0, 1.4],
            card: [0.9, 0.18, 0.036],
            lamp_off: false,
            known: false,
            seed: 1,
        }
    }
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Half angle, and the light of a point lamp of unit strength on a place, in units of a lamp a metre away.
fn lit(p: V, n: V, lamp: V, eye: V) -> (f64, f64) {
    let (to, away) = (minus(lamp, p), minus(eye, p));
    let (l, v) = (unit(to), unit(away));
    let h = unit(std::array::from_fn(|i| l[i] + v[i]));
    let side = cross(n, h);
    (dot(side, side).sqrt().atan2(dot(n, h)), 1e6 * dot(n, l).max(0.0) / dot(to, to))
}

/// Splitmix.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.next()).sum::<f64>() - 2.0) * 3f64.sqrt()
    }
}

/// The light of a place with this normal, and a reflectance for each half angle.
type Shade<'a> = &'a dyn Fn(V, V, &dyn Fn(f64) -> V) -> V;

/// Light on a picture, three numbers a pixel.
type Light = Vec<V>;

impl Studio {
    /// Exposures that a foil needs.
    pub fn for_material(mut self, material: &Material) -> Studio {
        if material.alpha < 0.1 && self.times.last().is_some_and(|t| *t > 0.005) && self.times.len() > 3 {
            self.times.extend([0.002, 0.0005]);
        }
        self
    }

    fn frame() -> (V, V, V) {
        let forward = unit(minus(LOOK, EYE));
        let right = unit(cross(forward, [0.0, 1.0, 0.0]));
        (forward, right, cross(right, forward))
    }

    /// The points of the lamp.
    fn lamps(&self) -> Vec<V> {
        if self.lamp_mm <= 0.0 {
            return vec![self.lamp];
        }
        let way = unit(self.lamp);
        let side = unit(cross(way, [0.0, 1.0, 0.0]));
        let other = cross(way, side);
        let count = 24;
        (0..count)
            .map(|i| {
                let (r, turn) =
                    (0.5 * self.lamp_mm * ((i as f64 + 0.5) / count as f64).sqrt(), 2.399_963 * i as f64);
                std::array::from_fn(|c| self.lamp[c] + r * (turn.cos() * side[c] + turn.sin() * other[c]))
            })
            .collect()
    }

    /// Patches of the table with their light.
    fn patches(&self) -> Vec<(V, f64)> {
        if self.table <= 0.0 {
            return Vec::new();
        }
        let (count, half, y) = (7, 420.0, -0.5 * HEIGHT - 25.0);
        let size = 2.0 * half / f64::from(count);
        (0..count * count)
            .filter_map(|i| {
                let at = |k: i32| -half + size * (f64::from(k) + 0.5);
                let p = [at(i % count), y, at(i / count)];
                // What the can stands on is in its own shadow.
                if p[0].hypot(p[2]) < self.radius {
                    return None;
                }
                let to = minus(self.lamp, p);
                let cosine = unit(to)[1].max(0.0);
                let shaded = {
                    // The can's shadow on the table.
                    let l = [to[0], to[2]];
                    let t = -(p[0] * l[0] + p[2] * l[1]) / (l[0] * l[0] + l[1] * l[1]);
                    t > 0.0
                        && (p[0] + t * l[0]).hypot(p[2] + t * l[1]) < self.radius
                        && y + t * to[1] < 0.5 * HEIGHT
                };
                (!shaded).then(|| (p, self.table / PI * 1e6 * cosine / dot(to, to) * size * size))
            })
            .collect()
    }

    /// Light from each part of the picture, in units of reflectance times light.
    fn radiance(&self, material: &Material, lamp_on: bool) -> Light {
        let (width, height) = self.size;
        let (forward, right, up) = Studio::frame();
        let focal = 0.5 * width as f64 / (0.5 * FIELD_DEG).to_radians().tan();
        let lamps = if lamp_on { self.lamps() } else { Vec::new() };
        let table = if lamp_on { self.patches() } else { Vec::new() };
        let curve: Vec<V> = (0..=8192).map(|i| material.at(f64::from(i) / 8192.0 * 1.6)).collect();
        let f = |theta: f64| -> V {
            let at = (theta / 1.6 * 8192.0).clamp(0.0, 8191.99);
            let (a, b, t) = (curve[at as usize], curve[at as usize + 1], at.fract());
            std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
        };
        let room = self.room * 0.9 / PI * 0.55;
        let shade = |p: V, n: V, reflects: &dyn Fn(f64) -> V| -> V {
            let mut sum = [0.0; 3];
            for lamp in &lamps {
                let (theta, light) = lit(p, n, *lamp, EYE);
                let f = reflects(theta);
                (0..3).for_each(|c| sum[c] += f[c] * light / lamps.len() as f64);
            }
            for (patch, strength) in &table {
                let to = minus(*patch, p);
                let (theta, _) = lit(p, n, *patch, EYE);
                let l = unit(to);
                let light = dot(n, l).max(0.0) * l[1].abs() * strength / dot(to, to);
                let f = reflects(theta);
                (0..3).for_each(|c| sum[c] += f[c] * light);
            }
            if room > 0.0 {
                // A wall from all directions in front: its diffuse part, and its mirror image.
                let f = reflects(0.6);
                let mirror = 0.5 * (material.f0[1] - 0.04).max(0.0) + 0.04;
                (0..3).for_each(|c| sum[c] += room * (PI * f[c] + mirror));
            }
            sum
        };
        let rays = 3;
        (0..width * height)
            .into_par_iter()
            .map(|i| {
                let mut sum = [0.0; 3];
                for k in 0..rays * rays {
                    let part = |k: usize| (k as f64 + 0.5) / rays as f64;
                    let x = (i % width) as f64 + part(k % rays) - width as f64 / 2.0;
                    let y = height as f64 / 2.0 - ((i / width) as f64 + part(k / rays));
                    let stretch = 1.0 - self.distortion * (x * x + y * y) / (width as f64 / 2.0).powi(2);
                    let (u, v) = (x * stretch / focal, y * stretch / focal);
                    let d: V = std::array::from_fn(|c| forward[c] + u * right[c] + v * up[c]);
                    let seen = self.along(d, &shade, &f);
                    (0..3).for_each(|c| sum[c] += seen[c] / (rays * rays) as f64);
                }
                sum
            })
            .collect()
    }

    /// What is in a direction.
    fn along(&self, d: V, shade: Shade<'_>, f: &dyn Fn(f64) -> V) -> V {
        let (a, b, c) = (
            d[0] * d[0] + d[2] * d[2],
            EYE[0] * d[0] + EYE[2] * d[2],
            EYE[0] * EYE[0] + EYE[2] * EYE[2] - self.radius * self.radius,
        );
        let root = b * b - a * c;
        if root > 0.0 {
            let t = (-b - root.sqrt()) / a;
            let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
            if p[1].abs() <= 0.5 * HEIGHT {
                let turn = p[0].atan2(p[2]);
                let arc = self.radius * turn;
                let (degrees, length) = self.waves;
                let mut n = [turn.sin(), 0.0, turn.cos()];
                if degrees > 0.0 {
                    let slope = degrees.to_radians();
                    if self.waves_along {
                        n[1] = slope * (2.0 * PI * p[1] / length).sin();
                    } else {
                        let slope = slope * (2.0 * PI * (arc / length + 0.3 * p[1] / length)).sin();
                        n = [(turn + slope).sin(), 0.0, (turn + slope).cos()];
                    }
                    n = unit(n);
                }
                return shade(p, n, f);
            }
        }
        let facing = unit(minus(EYE, LOOK));
        let t = dot(minus([56.0, -25.0, 0.0], EYE), facing) / dot(d, facing);
        let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
        let place = (p[0] - CARD[0]) / CARD[2];
        if (0.0..3.0).contains(&place) && (CARD[1]..CARD[1] + CARD_HIGH).contains(&p[1]) {
            let reflectance = self.card[place as usize] / PI;
            return shade(p, facing, &move |_| [reflectance; 3]);
        }
        // Black cloth.
        let table = -0.5 * HEIGHT - 25.0;
        if self.table > 0.0 && d[1] < 0.0 {
            let t = (table - EYE[1]) / d[1];
            let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
            if p[2] > -420.0 {
                return shade(p, [0.0, 1.0, 0.0], &|_| [self.table / PI; 3]);
            }
        }
        [self.room * 0.01 / PI; 3]
    }

    /// The lens: blur and glare.
    fn through_lens(&self, light: Light) -> Light {
        let (width, height) = self.size;
        let mut light = light;
        if self.blur > 0.0 {
            let reach = (4.0 * self.blur).ceil() as i64;
            let kernel: Vec<f64> =
                (-reach..=reach).map(|k| (-0.5 * (k as f64 / self.blur).powi(2)).exp()).collect();
            let total: f64 = kernel.iter().sum();
            for across in [true, false] {
                let from = light.clone();
                light = (0..width * height)
                    .into_par_iter()
                    .map(|i| {
                        let (x, y) = ((i % width) as i64, (i / width) as i64);
                        let mut sum = [0.0; 3];
                        for (k, w) in (-reach..=reach).zip(&kernel) {
                            let (u, v) = if across { (x + k, y) } else { (x, y + k) };
                            let at =
                                v.clamp(0, height as i64 - 1) * width as i64 + u.clamp(0, width as i64 - 1);
                            (0..3).for_each(|c| sum[c] += w / total * from[at as usize][c]);
                        }
                        sum
                    })
                    .collect();
            }
        }
        if self.glare > 0.0 {
            let mean: V =
                std::array::from_fn(|c| light.iter().map(|l| l[c]).sum::<f64>() / light.len() as f64);
            light.iter_mut().for_each(|l| (0..3).for_each(|c| l[c] += self.glare * mean[c]));
        }
        light
    }

    fn corner(&self, i: usize) -> f64 {
        let (width, height) = self.size;
        let (x, y) =
            ((i % width) as f64 + 0.5 - width as f64 / 2.0, (i / width) as f64 + 0.5 - height as f64 / 2.0);
        let far = (width * width + height * height) as f64 / 4.0;
        1.0 - self.vignetting * (x * x + y * y) / far
    }

    fn save(&self, light: &Light, time: f64, shot: usize, path: &Path) {
        let (width, height) = self.size;
        let mut random = Random(self.seed.wrapping_mul(977).wrapping_add(shot as u64));
        let sign = if shot.is_multiple_of(2) { 1.0 } else { -1.0 };
        let gains = [
            self.gains[0] * (1.0 + sign * self.drift.0),
            self.gains[1],
            self.gains[2] * (1.0 + sign * self.drift.1),
        ];
        let time = time * (1.0 + sign * self.flicker);
        let by = self.moved.map(|m| m * shot as f64);
        let at = |i: usize, c: usize| -> f64 {
            if by == [0.0; 2] {
                return light[i][c];
            }
            let (x, y) = ((i % width) as f64 - by[0], (i / width) as f64 - by[1]);
            let (x, y) = (x.clamp(0.0, width as f64 - 1.001), y.clamp(0.0, height as f64 - 1.001));
            let (x0, y0, u, v) = (x as usize, y as usize, x.fract(), y.fract());
            let p = |i: usize, j: usize| light[(y0 + j).min(height - 1) * width + (x0 + i).min(width - 1)][c];
            (1.0 - v) * ((1.0 - u) * p(0, 0) + u * p(1, 0)) + v * ((1.0 - u) * p(0, 1) + u * p(1, 1))
        };
        let values: Vec<f64> = (0..3 * width * height)
            .map(|i| {
                let v = 3.0 * time * gains[i % 3] * at(i / 3, i % 3) * self.corner(i / 3);
                let noisy = v + random.normal() * (v / 30_000.0 + 1.0f64 / 4096.0 / 4096.0).sqrt();
                let digital = (4095.0 * noisy).round().clamp(0.0, 4095.0) / 4095.0;
                match self.written {
                    Written::Linear => digital,
                    Written::Offset(offset) => (digital + offset).min(1.0),
                    Written::Srgb => srgb(digital),
                    Written::Jpeg(strength) => {
                        let y = srgb(noisy.clamp(0.0, 1.0));
                        y - strength * (2.0 * PI * y).sin()
                    }
                }
            })
            .collect();
        if matches!(self.written, Written::Jpeg(_)) {
            let bytes: Vec<u8> = values.iter().map(|v| (255.0 * v).round().clamp(0.0, 255.0) as u8).collect();
            let picture = image::RgbImage::from_raw(width as u32, height as u32, bytes).unwrap();
            let mut file = std::fs::File::create(path).unwrap();
            let coder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 92);
            picture.write_with_encoder(coder).unwrap();
        } else {
            let words: Vec<u16> =
                values.iter().map(|v| (65_520.0 * v).round().min(65_535.0) as u16).collect();
            image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(width as u32, height as u32, words)
                .unwrap()
                .save(path)
                .unwrap();
        }
    }

    /// Photographs a material; the setup file's text lies in the folder beside them.
    pub fn photograph(&self, material: &Material, folder: &Path) -> Setup {
        let photos = folder.join("photos");
        std::fs::create_dir_all(&photos).unwrap();
        let ending = if matches!(self.written, Written::Jpeg(_)) { "jpg" } else { "png" };
        let light = self.through_lens(self.radiance(material, true));
        self.times.par_iter().enumerate().for_each(|(i, time)| {
            self.save(&light, *time, i, &photos.join(format!("e{i}.{ending}")));
        });
        let mut more = String::new();
        let mut times: String =
            self.times.iter().enumerate().map(|(i, t)| format!("\"e{i}.{ending}\" = {t}\n")).collect();
        if self.flat_field {
            let plain =
                Studio { blur: 0.0, drift: (0.0, 0.0), flicker: 0.0, moved: [0.0; 2], ..self.clone() };
            let even = vec![[0.15, 0.25, 0.18]; self.size.0 * self.size.1];
            plain.save(&even, 1.0, 99, &folder.join("flat.png"));
            more.push_str("flat_field = \"flat.png\"\n");
        }
        if self.lamp_off {
            let dark = self.through_lens(self.radiance(material, false));
            self.save(&dark, self.times[0], 2, &folder.join(format!("off.{ending}")));
            let _ = writeln!(more, "lamp_off = \"off.{ending}\"");
            let _ = writeln!(times, "\"off.{ending}\" = {}", self.times[0]);
        }
        let text = format!(
            "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\ngeometry = \"{}\"\n\
             [camera]\nposition_mm = {EYE:?}\nlook_at_mm = {LOOK:?}\nfield_of_view_deg = {FIELD_DEG:?}\n\
             [[light]]\nposition_mm = {:?}\ndiameter_mm = {:?}\n\
             [sample]\nshape = \"cylinder\"\nradius_mm = {:?}\nheight_mm = {HEIGHT:?}\nstack = \"{}\"\n\
             [card]\nposition_mm = [56.0, -25.0, 0.0]\n[photos]\n{more}[exposures]\n{times}",
            if self.known { "known" } else { "solved" },
            self.lamp_said,
            self.lamp_said_mm,
            self.radius_said,
            material.stack
        );
        let path = folder.join("setup.toml");
        std::fs::write(&path, text).unwrap();
        Setup::read(&path).unwrap()
    }
}

fn srgb(l: f64) -> f64 {
    if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 }
}
