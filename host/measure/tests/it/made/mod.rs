//! What tests photograph without the independent renderer: a chart of stacks whose curves are known, and a pinhole camera that shares
//! nothing with the program.
//!
//! The camera stands on the z axis and looks at the origin. A picture is a ray for each part of a pixel, whatever light a test sends
//! along it, the noise of a sensor and its 12 bits.

use std::f64::consts::PI;
use std::path::Path;

use inks::{Stack, ggx};
use observe::Silent;
use press::chart;
use press::layout::{Layout, arrange};
use protocol::paper::Paper;
use rayon::prelude::*;
use sheet::{DotMap, Sheet};

pub type V = [f64; 3];

pub const DOTS_PER_MM: f64 = 600.0 / 25.4;
pub const EYE: V = [0.0, 0.0, 1200.0];
/// The sensor's white balance.
const WHITE: V = [1.4, 1.0, 1.2];
/// The stacks of the chart.
pub const STACKS: [&str; 4] = ["K", "MS", "MS+F", "MS+C"];

pub fn dot(a: V, b: V) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

pub fn unit(a: V) -> V {
    a.map(|v| v / dot(a, a).sqrt())
}

pub fn stack(text: &str) -> Stack {
    text.parse().unwrap()
}

/// What a stack really reflects: a diffuse part and a lobe that are not those of the library.
pub fn truth(stack: &str, theta: f64) -> V {
    let (diffuse, f0, alpha) = match stack {
        "K" => ([0.03, 0.03, 0.032], [0.04; 3], 0.2),
        "MS" => ([0.13, 0.13, 0.12], [0.5; 3], 0.33),
        "MS+F" => ([0.08, 0.08, 0.075], [0.47; 3], 0.17),
        "MS+C" => ([0.02, 0.07, 0.1], [0.06, 0.27, 0.4], 0.3),
        _ => ([0.84, 0.85, 0.88], [0.04; 3], 0.28),
    };
    std::array::from_fn(|c| 0.96 * diffuse[c] / PI + f0[c] * ggx::lobe(theta, alpha))
}

/// A chart of strips with camera marks.
pub fn chart() -> Sheet {
    let stacks: Vec<Stack> = STACKS.map(stack).to_vec();
    let dots = chart::stacks(&stacks, Paper::A4, Some("50".parse().unwrap())).unwrap();
    let paper = Paper::Custom { width: dots.width() as u16 + 100, length: dots.length() as u16 + 650 };
    let layout = Layout { camera_marks: true, ..Layout::centred(paper) };
    arrange(&dots, &layout, &Silent).unwrap().sheet
}

/// Curves at even steps.
pub struct Curves(Vec<Vec<V>>);

impl Curves {
    pub fn new(dots: &DotMap) -> Curves {
        let row =
            |s: &Stack| (0..=2048).map(|i| truth(&s.to_string(), f64::from(i) / 2048.0 * 1.6)).collect();
        Curves(dots.stacks().iter().map(row).collect())
    }

    pub fn at(&self, stack: usize, theta: f64) -> V {
        let at = (theta / 1.6 * 2048.0).clamp(0.0, 2047.99);
        let (a, b, t) = (self.0[stack][at as usize], self.0[stack][at as usize + 1], at.fract());
        std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
    }
}

/// Half angle in radians at a place with this normal, and the irradiance there.
pub fn lit(p: V, n: V, lamp: V) -> (f64, f64) {
    let (to, away) = (minus(lamp, p), minus(EYE, p));
    let (l, v) = (unit(to), unit(away));
    let h = unit(std::array::from_fn(|i| l[i] + v[i]));
    (dot(n, h).clamp(-1.0, 1.0).acos(), 1e6 * dot(n, l).max(0.0) / dot(to, to))
}

/// The light of a card of three steps of this width in mm, from the left, that faces the camera in the plane of the origin.
pub fn card(d: V, (left, step): (f64, f64), lamp: V) -> V {
    let t = -EYE[2] / d[2];
    let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
    let place = (p[0] - left) / step;
    if !(0.0..3.0).contains(&place) || p[1].abs() > 12.0 {
        return [0.0; 3];
    }
    let (_, irradiance) = lit(p, [0.0, 0.0, 1.0], lamp);
    [[0.9, 0.18, 0.036][place as usize] / PI * irradiance; 3]
}

/// A camera and its exposures.
pub struct Camera {
    pub size: (usize, usize),
    pub field_deg: f64,
    pub times: &'static [f64],
    /// Rays along a side of a pixel.
    pub rays: usize,
}

impl Camera {
    pub fn focal(&self) -> f64 {
        0.5 * self.size.0 as f64 / (0.5 * self.field_deg).to_radians().tan()
    }

    /// Left, top, right, bottom of the card in pixels.
    pub fn card_px(&self, (left, step): (f64, f64)) -> [f64; 4] {
        let (x, y) = (self.size.0 as f64 / 2.0, self.size.1 as f64 / 2.0);
        let px = |mm: f64| mm * self.focal() / EYE[2];
        [x + px(left), y - px(12.0), x + px(left + 3.0 * step), y + px(12.0)]
    }

    /// The table of the setup file, for photographs whose names begin so.
    pub fn exposures(&self, prefix: &str) -> String {
        self.times.iter().enumerate().map(|(i, t)| format!("\"{prefix}{i}.png\" = {t}\n")).collect()
    }

    /// A series in a folder: the light from each direction through the exposures.
    pub fn photograph(&self, folder: &Path, prefix: &str, light: impl Fn(V) -> V + Sync) {
        let (width, height) = self.size;
        let rays = self.rays;
        let radiance: Vec<V> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let mut sum = [0.0; 3];
                for k in 0..rays * rays {
                    let part = |k: usize| (k as f64 + 0.5) / rays as f64;
                    let (x, y) = ((i % width) as f64 + part(k % rays), (i / width) as f64 + part(k / rays));
                    let (x, y) = (x - width as f64 / 2.0, height as f64 / 2.0 - y);
                    let seen = light([x / self.focal(), y / self.focal(), -1.0]);
                    (0..3).for_each(|c| sum[c] += seen[c] / (rays * rays) as f64);
                }
                sum
            })
            .collect();
        std::fs::create_dir_all(folder).unwrap();
        self.times.par_iter().enumerate().for_each(|(shot, time)| {
            let mut state = 0x9e37_79b9_7f4a_7c15u64.wrapping_mul(shot as u64 + 3);
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1u64 << 53) as f64
            };
            let values: Vec<u16> = radiance
                .iter()
                .flat_map(|rgb| {
                    std::array::from_fn::<u16, 3, _>(|c| {
                        let v = 90.0 * time * WHITE[c] * rgb[c];
                        let normal = ((0..4).map(|_| random()).sum::<f64>() - 2.0) * 3f64.sqrt();
                        let noisy = v + normal * (v / 20_000.0 + (1.5f64 / 4096.0).powi(2)).sqrt();
                        16 * (4096.0 * noisy).round().clamp(0.0, 4095.0) as u16
                    })
                })
                .collect();
            let picture =
                image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(width as u32, height as u32, values);
            picture.unwrap().save(folder.join(format!("{prefix}{shot}.png"))).unwrap();
        });
    }
}
