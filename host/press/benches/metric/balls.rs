//! Balls of documents and of their prints under four lights: how much of the light there is, and how far its colour is off.
//!
//! Mean light: that of the printed balls over that of the wanted ones. Chroma: root mean square difference of the chromaticities of
//! pixels, each counted by the cube root of its light, which is about how bright it looks. By the paper's metric and by the default.

use std::path::Path;

use appearance::brdf::{Space, Table};
use appearance::gamut::{self, GamutSettings, Intent, LIGHT, Printable};
use inks::{InkSet, Library};
use observe::Silent;
use press::preview::sphere::under_probe;
use press::preview::{Probe, Radiance};

use super::light::{One, documents, probes, surface};

/// Mean light of both, and the chroma error.
fn compare(target: &Radiance, printed: &Radiance) -> [f64; 4] {
    let (mut wanted, mut made, mut apart, mut all) = (0.0, 0.0, 0.0, 0.0);
    for (a, b) in target.pixels.iter().zip(&printed.pixels).filter(|(a, _)| a[3] == 1.0) {
        let sum = |p: &[f32; 4]| p[..3].iter().map(|&v| f64::from(v.max(0.0))).sum::<f64>();
        let (of_a, of_b) = (sum(a), sum(b));
        (wanted, made) = (wanted + of_a, made + of_b);
        if of_a > 0.0 && of_b > 0.0 {
            let weight = of_a.cbrt();
            let off = (0..3).map(|c| (f64::from(a[c]) / of_a - f64::from(b[c]) / of_b).powi(2)).sum::<f64>();
            (apart, all) = (apart + weight * off, all + weight);
        }
    }
    [wanted, made, apart, all]
}

/// One row for each document, metric and set of inks.
pub fn balls(data: &Path) {
    let (space, library) = (Space::half_angle(32), Library::builtin());
    let mut panes = Table::new(space.columns());
    for (f0, rough) in [(0.05f32, 0.14f32), (0.08, 0.2), (0.1, 0.3), (0.14, 0.45)] {
        panes.push(&surface(&space, [0.0; 3], [0.75, 0.9, 1.0].map(|c| c * f0), rough * rough));
    }
    let [studio, venice, room] = probes(data);
    let lights = [("studio", studio), ("Venice", venice), ("room", room), ("even", Probe::constant(1.0))];
    println!("| material | inks | light weighs | {} |", lights.each_ref().map(|(name, _)| *name).join(" | "));
    println!("|---|---|---|---|---|---|---|");
    for (inks, set) in [("default", InkSet::default()), ("all", InkSet::of(protocol::ink::Ink::ALL))] {
        let printable = Printable::combined(&library, &set, &space);
        let all = std::iter::once(("dark panes".to_owned(), panes.clone())).chain(documents(data, &space));
        for (name, targets) in all {
            for light in [0.0, LIGHT] {
                let settings = GamutSettings { intent: Intent::Clamp, light, ..GamutSettings::default() };
                let mut printed = Table::new(space.columns());
                for row in targets.rows() {
                    let one = One(space.clone(), row.iter().map(|&f| f as f32).collect());
                    let mapped = gamut::clamped(&one, &printable, &settings, &Silent).unwrap();
                    printed.push(&mapped.report.materials[0].printed);
                }
                let words = lights.each_ref().map(|(_, probe)| {
                    let [a, b] =
                        [&targets, &printed].map(|t| under_probe(&space, t, probe, 48, &Silent).unwrap());
                    let [wanted, made, apart, all] = a
                        .iter()
                        .zip(&b)
                        .map(|(a, b)| compare(a, b))
                        .fold([0.0; 4], |sum, part| std::array::from_fn(|i| sum[i] + part[i]));
                    format!("{:.2}, {:.3}", made / wanted, (apart / all).sqrt())
                });
                println!("| {name} | {inks} | {light} | {} |", words.join(" | "));
            }
        }
    }
}
