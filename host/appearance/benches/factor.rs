//! Factoring a real texture of a million pixels: `FOILPRESS_DATA=… cargo bench --bench factor`.
//!
//! Without the textures it uses a synthetic document of the same size, so the benchmark always runs.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use std::path::Path;

use appearance::brdf::Space;
use appearance::document::Materials;
use appearance::factor::{FactorSettings, Method, factor};
use divan::Bencher;
use observe::Silent;

fn main() {
    divan::main();
}

const SIDE: usize = 1024;

/// A metallic-roughness document: base colour (linear), microfacet width, metalness.
struct Document {
    space: Space,
    pixels: Vec<([f32; 3], f32, f32)>,
}

impl Document {
    fn rusty() -> Document {
        let space = Space::half_angle(32);
        let pixels = Document::textures().unwrap_or_else(Document::made);
        Document { space, pixels }
    }

    fn textures() -> Option<Vec<([f32; 3], f32, f32)>> {
        let folder = Path::new(&std::env::var_os("FOILPRESS_DATA")?).join("svbrdf/rustymetal");
        let load = |file: &str| image::open(folder.join(file)).ok().map(|image| image.to_rgb8());
        let (albedo, rough, metal) = (load("albedo.jpg")?, load("roughness.jpg")?, load("metallic.jpg")?);
        if albedo.dimensions() != (SIDE as u32, SIDE as u32) {
            return None;
        }
        let linear = |v: u8| (f32::from(v) / 255.0).powf(2.2);
        let unit = |v: u8| f32::from(v) / 255.0;
        let pixels = albedo.pixels().zip(rough.pixels()).zip(metal.pixels());
        let pixels = pixels.map(|((albedo, rough), metal)| {
            (albedo.0.map(linear), unit(rough[0]).powi(2).max(0.02), unit(metal[0]))
        });
        Some(pixels.collect())
    }

    fn made() -> Vec<([f32; 3], f32, f32)> {
        let wave =
            |x: usize, y: usize, f: f32| 0.5 + 0.5 * (x as f32 * f + (y as f32 * f * 1.7).sin() * 3.0).sin();
        (0..SIDE * SIDE)
            .map(|i| {
                let (x, y) = (i % SIDE, i / SIDE);
                let base = [wave(x, y, 0.011), wave(y, x, 0.007), wave(x + y, y, 0.013)];
                (base.map(|b| 0.05 + 0.8 * b), 0.03 + 0.5 * wave(x, y, 0.017), wave(x, y, 0.019).round())
            })
            .collect()
    }
}

impl Materials for Document {
    fn width(&self) -> usize {
        SIDE
    }
    fn height(&self) -> usize {
        SIDE
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

#[divan::bench(args = [Method::Kmeans, Method::Sacls, Method::Archetypes], sample_count = 1)]
fn rusty_metal_in_eight_bases(bencher: Bencher, method: Method) {
    let document = Document::rusty();
    let settings = FactorSettings { method, bases: Some(8), ..FactorSettings::default() };
    bencher.bench_local(|| {
        let report = factor(&document, &settings, &Silent).expect("the document is sound").report;
        eprintln!("{report:?}");
    });
}

#[divan::bench(sample_count = 1)]
fn rusty_metal_in_as_many_bases_as_it_needs(bencher: Bencher) {
    let document = Document::rusty();
    bencher.bench_local(|| {
        let report =
            factor(&document, &FactorSettings::default(), &Silent).expect("the document is sound").report;
        eprintln!("{report:?}");
    });
}

/// The cost of reading the pixels alone: a lower bound for all of the above.
#[divan::bench(sample_count = 3)]
fn rusty_metal_read_once(bencher: Bencher) {
    let document = Document::rusty();
    let mut row = vec![0.0; document.space.columns()];
    bencher.bench_local(|| {
        (0..SIDE * SIDE).for_each(|i| document.reflectance(i, divan::black_box(&mut row)));
    });
}
