//! Documents for benchmarks: real textures if FOILPRESS_DATA names them, otherwise a synthetic one.

use std::path::PathBuf;

use appearance::brdf::Space;
use appearance::document::{Materials, Surface};

/// Surfaces, one per pixel, in a half-angle space.
pub struct Field {
    space: Space,
    width: usize,
    surfaces: Vec<Surface>,
    cosines: Vec<f32>,
}

impl Field {
    fn new(width: usize, surfaces: Vec<Surface>) -> Field {
        let space = Space::half_angle(32);
        let cosines = space.angles().iter().map(|t| t.cos() as f32).collect();
        Field { space, width, surfaces, cosines }
    }

    /// Rusty metal, 1024 x 1024: bare metal and rust mixed at pixel scale. The left upper part of `size` pixels.
    pub fn rusty_metal(size: usize) -> Field {
        match std::env::var_os("FOILPRESS_DATA") {
            Some(data) => Field::textures(&PathBuf::from(data).join("svbrdf/rustymetal"), size),
            None => Field::made_up(size),
        }
    }

    fn textures(folder: &std::path::Path, size: usize) -> Field {
        let find = |word: &str| {
            let mut files = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path());
            files.find(|p| p.file_name().unwrap().to_string_lossy().to_lowercase().contains(word)).unwrap()
        };
        let open = |word| image::open(find(word)).unwrap();
        let (albedo, rough, metal) =
            (open("albedo").to_rgb8(), open("rough").to_luma8(), open("metal").to_luma8());
        let linear = |v: u8| {
            let v = f32::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let surfaces = (0..size * size)
            .map(|p| {
                let (x, y) = ((p % size) as u32, (p / size) as u32);
                let base = albedo.get_pixel(x, y).0.map(linear);
                let m = f32::from(metal.get_pixel(x, y).0[0]) / 255.0;
                let r = f32::from(rough.get_pixel(x, y).0[0]) / 255.0;
                Surface {
                    diffuse: base.map(|b| b * (1.0 - m)),
                    f0: base.map(|b| 0.04 * (1.0 - m) + b * m),
                    alpha: (r * r).max(0.02),
                }
            })
            .collect();
        Field::new(size, surfaces)
    }

    fn made_up(size: usize) -> Field {
        let mut state = 1u64;
        let mut noise = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let surfaces = (0..size * size)
            .map(|p| {
                let (x, y) = ((p % size) as f32, (p / size) as f32);
                let m =
                    (0.5 + 0.4 * (x * 0.07).sin() * (y * 0.05).cos() + 0.2 * (noise() - 0.5)).clamp(0.0, 1.0);
                let base = [0.45, 0.25 + 0.2 * m, 0.12 + 0.3 * m].map(|b| b * (0.9 + 0.2 * noise()));
                let r = 0.35 + 0.3 * (1.0 - m) + 0.1 * noise();
                Surface {
                    diffuse: base.map(|b| b * (1.0 - m)),
                    f0: base.map(|b| 0.04 * (1.0 - m) + b * m),
                    alpha: r * r,
                }
            })
            .collect();
        Field::new(size, surfaces)
    }
}

impl Materials for Field {
    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.surfaces.len() / self.width
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let s = &self.surfaces[pixel];
        let a2 = s.alpha * s.alpha;
        for (n, &c) in self.cosines.iter().enumerate() {
            let c2 = (c * c).max(1e-12);
            let d = c2 * (a2 - 1.0) + 1.0;
            let g = 1.0 / (1.0 + a2 * (1.0 - c2) / c2).sqrt();
            let lobe = a2 * g / (std::f32::consts::PI * d * d * 4.0 * c2);
            for channel in 0..3 {
                out[3 * n + channel] = s.diffuse[channel] / std::f32::consts::PI + s.f0[channel] * lobe;
            }
        }
    }
}
