//! Tables for decisions, in words and figures: no times.
//!
//! `FOILPRESS_DATA=... cargo bench -p foilpress-appearance --bench tables -- hue`: what hue in the dark costs each document
//! (`docs/decisions/metric-that-knows-light.md`). R/B is that of the printed reflectance at 60 degrees over the target's, on pixels
//! that reflect less than .01/sr there: the least, the 5th and the 95th of a hundred, and the largest.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use std::path::{Path, PathBuf};

use appearance::brdf::{Space, Table, reflectances};
use appearance::document::{self, Materials, Options, Surface};
use appearance::gamut::{self, GamutSettings, Printable};
use inks::{InkSet, Library};
use observe::Silent;
use protocol::ink::Ink;

fn main() {
    let data = std::env::var_os("FOILPRESS_DATA").map(PathBuf::from);
    for table in std::env::args().skip(1) {
        match table.as_str() {
            "hue" => hue(data.as_deref()),
            // Cargo's own.
            "--bench" => {}
            other => eprintln!("there is no table `{other}`; there is hue"),
        }
    }
}

/// Panes of smooth dark metal, each rougher than the one to its left and lighter than the one above.
struct Panes(Space);

impl Materials for Panes {
    fn width(&self) -> usize {
        16
    }
    fn height(&self) -> usize {
        16
    }
    fn space(&self) -> &Space {
        &self.0
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let (x, y) = ((pixel % 16) as f32 / 15.0, (pixel / 16) as f32 / 15.0);
        let (rough, f0) = (0.14 + 0.31 * x, 0.05 + 0.09 * y);
        let surface =
            Surface { diffuse: [0.0; 3], f0: [0.75, 0.9, 1.0].map(|c| c * f0), alpha: rough * rough };
        let row = self.0.row(&surface.curve(self.0.angles()));
        out.iter_mut().zip(row).for_each(|(out, f)| *out = f as f32);
    }
}

fn hue(data: Option<&Path>) {
    println!(
        "| document | inks | d | light | R/B in the dark: least, 5 %, 95 %, most | cartridges | stacks |"
    );
    println!("|---|---|---|---|---|---|---|");
    for inks in [("default", InkSet::default()), ("all", InkSet::of(Ink::ALL))] {
        row("dark panes", inks, &Panes(Space::half_angle(32)));
        let open = |path: &str| {
            let document = document::open(path, &Options::default(), &Silent).unwrap();
            row(path.rsplit('/').next().unwrap_or(path), inks, document.materials());
        };
        ["leaf", "dove", "flange", "ladder", "card"].iter().for_each(|name| open(&format!("sample:{name}")));
        for folder in
            data.iter().flat_map(|data| ["svbrdf", "brdf/curves_avg", "brdf/cornell"].map(|f| data.join(f)))
        {
            let mut paths: Vec<PathBuf> =
                std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
            paths.sort();
            let known = |path: &&PathBuf| {
                path.is_dir() || path.extension().is_some_and(|e| e == "csv" || e == "brdf")
            };
            paths.iter().filter(known).for_each(|path| open(&path.display().to_string()));
        }
    }
}

fn row(name: &str, (set, inks): (&str, InkSet), pixels: &dyn Materials) {
    let (space, library) = (pixels.space(), Library::builtin());
    let printable = Printable::combined(&library, &inks, space);
    let mapped = gamut::clamped(pixels, &printable, &GamutSettings::default(), &Silent).unwrap();
    let stacks: Table = reflectances(&mapped.mix.stacks, &library, space);
    let n = space.angles().iter().position(|t| t.to_degrees() > 60.0).unwrap();
    let (mut shares, mut target) = (vec![0.0; stacks.len()], vec![0f32; space.columns()]);
    let (mut ratios, total) = (Vec::new(), pixels.width() * pixels.height());
    for pixel in (0..total).step_by((total / 20_000).max(1)) {
        pixels.reflectance(pixel, &mut target);
        let [r, g, b] = [0, 1, 2].map(|c| f64::from(target[3 * n + c]));
        if (r + g + b) / 3.0 > 0.01 || b <= 0.0 || r <= 0.0 {
            continue;
        }
        mapped.mix.shares(pixel, &mut shares);
        let printed = |c: usize| stacks.rows().zip(&shares).map(|(row, s)| s * row[3 * n + c]).sum::<f64>();
        ratios.push(printed(0) / printed(2) * b / r);
    }
    ratios.sort_by(f64::total_cmp);
    let at = |percent: usize| ratios.get(ratios.len().saturating_sub(1) * percent / 100);
    let words: Vec<String> =
        [0, 5, 95, 100].iter().map(|&p| at(p).map_or("-".into(), |r| format!("{r:.2}"))).collect();
    let report = mapped.report.pixels.unwrap();
    let cartridges: Vec<&str> = mapped.report.cartridges.iter().map(|ink| ink.short()).collect();
    println!(
        "| {name} | {set} | {:.5} | {:.5} | {} | {} | {} |",
        report.rms,
        report.light,
        words.join(", "),
        cartridges.join(" "),
        mapped.mix.stacks.len()
    );
}
