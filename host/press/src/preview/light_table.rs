//! What the weight of the distance in light buys: materials fitted at several weights, lit as balls under light probes.
//!
//! `FOILPRESS_DATA=... cargo test --release -p foilpress-press --lib table_of_weights -- --ignored --nocapture` prints the
//! table of `docs/decisions/metric-that-knows-light.md`.

use std::path::Path;

use appearance::brdf::{Space, Table};
use appearance::document::{self, Materials, Options, Surface};
use appearance::gamut::{self, Intent, Printable, Settings};
use inks::{InkSet, Library};
use observe::Silent;
use protocol::ink::Ink;

use super::probe::Probe;
use super::sphere::under_probe;

/// One material on one pixel.
struct One(Space, Vec<f32>);

impl Materials for One {
    fn width(&self) -> usize {
        1
    }
    fn height(&self) -> usize {
        1
    }
    fn space(&self) -> &Space {
        &self.0
    }
    fn reflectance(&self, _: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.1);
    }
}

fn surface(space: &Space, diffuse: [f32; 3], f0: [f32; 3], alpha: f32) -> Vec<f64> {
    space.row(&Surface { diffuse, f0, alpha }.curve(space.angles()))
}

/// Root mean square difference of the cube roots of two balls, relative to that of the first from black.
fn off(target: &super::Radiance, printed: &super::Radiance) -> f64 {
    let (mut sum, mut all) = (0.0, 0.0);
    for (a, b) in target.pixels.iter().zip(&printed.pixels).filter(|(a, _)| a[3] == 1.0) {
        for c in 0..3 {
            let (a, b) = (f64::from(a[c].max(0.0)).cbrt(), f64::from(b[c].max(0.0)).cbrt());
            sum += (a - b).powi(2);
            all += a * a;
        }
    }
    (sum / all).sqrt()
}

/// Twelve pixels of a document, evenly spread down its length.
fn materials(path: &Path, space: &Space) -> Table {
    let document = document::open(&path.display().to_string(), &Options::default(), &Silent).unwrap();
    let pixels = document.materials();
    let total = pixels.width() * pixels.height();
    let mut rows = Table::new(space.columns());
    let mut row = vec![0f32; space.columns()];
    for i in 0..12 {
        pixels.reflectance((2 * i + 1) * total / 24 + i * 37 % pixels.width(), &mut row);
        rows.push(&row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>());
    }
    rows
}

#[test]
#[ignore = "prints a table"]
fn table_of_weights() {
    let Some(data) = testing::needs::data() else { return };
    let space = Space::half_angle(32);
    let silver = [0.972, 0.960, 0.915];
    let mut documents: Vec<(String, Table)> = Vec::new();
    let mut one = |name: &str, row: Vec<f64>| {
        let mut table = Table::new(space.columns());
        table.push(&row);
        documents.push((name.into(), table));
    };
    for alpha in [0.02, 0.04, 0.06, 0.1, 0.2, 0.3] {
        one(&format!("silver {alpha}"), surface(&space, [0.0; 3], silver, alpha));
    }
    one("gold .15", surface(&space, [0.0; 3], [1.0, 0.782, 0.344], 0.15));
    one("red plastic .1", surface(&space, [0.4, 0.03, 0.03], [0.04; 3], 0.1));
    one("blue plastic .3", surface(&space, [0.03, 0.06, 0.3], [0.04; 3], 0.3));
    for name in ["rustymetal", "helmet_metal", "helmet_leather"] {
        documents.push((name.into(), materials(&data.join("svbrdf").join(name), &space)));
    }
    let probes = [
        ("studio", Probe::read_hdr(&data.join("env/studio.hdr")).unwrap().shrunk(64)),
        ("venice", Probe::read_hdr(&data.join("env/venice.hdr")).unwrap().shrunk(64)),
        ("soft", Probe::studio(64)),
    ];
    let library = Library::builtin();
    for (inks, set) in [("default", InkSet::default()), ("all", InkSet::of(Ink::ALL))] {
        let printable = Printable::from_library(&library, &set, &space);
        for (name, targets) in &documents {
            for light in [0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 1.0] {
                let settings =
                    Settings { intent: Intent::Clamp, light, most_cartridges: 13, ..Settings::default() };
                let mut both = Table::new(space.columns());
                let (mut d, mut l) = (0.0, 0.0);
                let mut words = String::new();
                for row in targets.rows() {
                    let pixel = One(space.clone(), row.iter().map(|&f| f as f32).collect());
                    let mapped = gamut::clamped(&pixel, &printable, &settings, &Silent).unwrap();
                    let material = &mapped.report.materials[0];
                    d += material.distance.powi(2);
                    l += material.light.powi(2);
                    if targets.len() == 1 {
                        words = super::materials_picture::mix_in_words(&material.weights);
                    }
                    both.push(row);
                    both.push(&material.printed);
                }
                let n = targets.len() as f64;
                let seen: Vec<String> = probes
                    .iter()
                    .map(|(_, probe)| {
                        let balls = under_probe(&space, &both, probe, 48, &Silent).unwrap();
                        let sum: f64 = balls.chunks(2).map(|pair| off(&pair[0], &pair[1]).powi(2)).sum();
                        format!("{:.3}", (sum / n).sqrt())
                    })
                    .collect();
                let (d, l) = ((d / n).sqrt(), (l / n).sqrt());
                println!(
                    "{inks:8} {name:16} {light:.1}  d {d:.4}  light {l:.4}  {}  {words}",
                    seen.join("  ")
                );
            }
        }
    }
}
