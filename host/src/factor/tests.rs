//! The stage as a whole, on made documents with known answers and on real textures.

use std::path::Path;

use proptest::prelude::*;

use super::*;
use crate::observe::Silent;
use crate::weights::ONE;

/// Documents as rows given outright.
struct Rows {
    width: usize,
    space: Space,
    rows: Vec<Vec<f32>>,
}

impl Materials for Rows {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.rows.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.rows[pixel]);
    }
}

/// Metallic-roughness textures, every `step`-th pixel.
struct Textures {
    width: usize,
    space: Space,
    pixels: Vec<([f32; 3], f32, f32)>,
}

impl Textures {
    fn open(name: &str, step: u32) -> Option<Textures> {
        let Some(data) = std::env::var_os("FOILPRESS_DATA") else {
            eprintln!("skipped: FOILPRESS_DATA does not name the folder of real documents");
            return None;
        };
        let folder = Path::new(&data).join("svbrdf").join(name);
        let load = |file: &str| image::open(folder.join(file)).ok().map(|image| image.to_rgb8());
        let separate = load("albedo.jpg").zip(load("roughness.jpg")).zip(load("metallic.jpg"));
        let packed = load("base_color.png").zip(load("occlusion_roughness_metallic.png"));
        let (base, roughness, metallic, channels) = match (separate, packed) {
            (Some(((base, roughness), metallic)), _) => (base, roughness, metallic, [0, 0]),
            (_, Some((base, packed))) => (base, packed.clone(), packed, [1, 2]),
            _ => {
                eprintln!("skipped: no textures in {}", folder.display());
                return None;
            }
        };
        let linear = |v: u8| {
            let v = f32::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let (width, height) = (base.width() / step, base.height() / step);
        let pixels = (0..width * height).map(|i| {
            let (x, y) = (i % width * step, i / width * step);
            let rough = f32::from(roughness.get_pixel(x, y)[channels[0]]) / 255.0;
            let metal = f32::from(metallic.get_pixel(x, y)[channels[1]]) / 255.0;
            (base.get_pixel(x, y).0.map(linear), (rough * rough).max(0.02), metal)
        });
        Some(Textures { width: width as usize, space: Space::half_angle(32), pixels: pixels.collect() })
    }
}

impl Materials for Textures {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.pixels.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let (base, alpha, metal) = self.pixels[pixel];
        for (out, &theta) in out.chunks_exact_mut(3).zip(self.space.angles()) {
            let lobe = inks::ggx::lobe(theta, f64::from(alpha)) as f32;
            for (out, base) in out.iter_mut().zip(base) {
                let f0 = 0.04 + (base - 0.04) * metal;
                *out = base * (1.0 - metal) * 0.96 / std::f32::consts::PI + f0 * lobe;
            }
        }
    }
}

#[test]
#[ignore]
fn explore() {
    for (name, step, k) in [
        ("rustymetal", 8, 4),
        ("rustymetal", 8, 8),
        ("helmet_metal", 4, 6),
        ("helmet_metal", 4, 10),
        ("helmet_leather", 8, 5),
    ] {
        let Some(document) = Textures::open(name, step) else { return };
        for method in [Method::Kmeans, Method::Sacls, Method::Archetypes] {
            let settings = Settings { method, bases: Some(k), ..Settings::default() };
            let r = factor(&document, &settings, &Silent).unwrap().report;
            println!(
                "{name} k={k} {method:?}: n={} rmse {:.4} p95 {:.4} max {:.3} uncovered {:.3} out {:.3} {:.2}s",
                r.materials,
                r.rmse,
                r.p95,
                r.max,
                r.uncovered,
                r.excursion.iter().sum::<f64>() / r.bases as f64,
                r.seconds
            );
        }
    }
}
