//! Photographs from an independent renderer, with noise, 12-bit clipping and an unknown white balance, measured with exact and with
//! wrong setups, against the curves that were rendered.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use inks::ggx;
use measure::reduce::Kind;
use measure::setup::Setup;
use measure::{Taken, measure};
use observe::Silent;
use testing::needs::{self, Need};

/// The renderer, where there is one.
fn renderer() -> Option<PathBuf> {
    needs::path(Need::Reference, "FOILPRESS_REFERENCE").filter(|_| needs::numpy())
}

/// A diffuse part and a lobe: reflectances, F0 and alpha.
#[derive(Clone, Copy)]
struct Material {
    name: &'static str,
    stack: &'static str,
    diffuse: [f64; 3],
    f0: [f64; 3],
    alpha: f64,
    /// How much shorter the exposures are than the renderer's own.
    shorter: f64,
}

const MATERIALS: [Material; 7] = [
    Material { name: "paper", stack: "substrate", diffuse: [0.84, 0.85, 0.88], f0: [0.04; 3], alpha: 0.28, shorter: 1.0 },
    Material { name: "magenta", stack: "M", diffuse: [0.69, 0.02, 0.2], f0: [0.04; 3], alpha: 0.12, shorter: 1.0 },
    Material { name: "finish", stack: "C+F", diffuse: [0.02, 0.23, 0.6], f0: [0.04; 3], alpha: 0.05, shorter: 1.0 },
    Material { name: "silver", stack: "MS", diffuse: [0.1; 3], f0: [0.57; 3], alpha: 0.27, shorter: 1.0 },
    Material { name: "gold", stack: "MG", diffuse: [0.09, 0.07, 0.03], f0: [0.54, 0.41, 0.2], alpha: 0.29, shorter: 1.0 },
    Material { name: "gold foil", stack: "GF", diffuse: [0.015; 3], f0: [0.84, 0.66, 0.31], alpha: 0.06, shorter: 8.0 },
    Material { name: "silver foil", stack: "SF", diffuse: [0.015; 3], f0: [0.85; 3], alpha: 0.06, shorter: 8.0 },
];

impl Material {
    fn at(&self, theta: f64) -> [f64; 3] {
        std::array::from_fn(|c| 0.96 * self.diffuse[c] / PI + self.f0[c] * ggx::lobe(theta, self.alpha))
    }

    fn csv(&self, path: &Path) {
        let mut text = String::from("theta_h_deg,r,g,b\n");
        for i in 0..=1780 {
            let degrees = f64::from(i) * 0.05;
            let [r, g, b] = self.at(degrees.to_radians());
            let _ = writeln!(text, "{degrees},{r:e},{g:e},{b:e}");
        }
        std::fs::write(path, text).unwrap();
    }

    fn times(&self) -> Vec<f64> {
        [0.25, 1.0 / 15.0, 1.0 / 60.0, 1.0 / 250.0, 1.0 / 1000.0, 1.0 / 4000.0].map(|t| t / self.shorter).to_vec()
    }
}

/// A picture as the renderer stores it: NumPy's format, 16 bits.
struct Raw {
    width: usize,
    height: usize,
    values: Vec<u16>,
}

impl Raw {
    fn read(path: &Path) -> Raw {
        let bytes = std::fs::read(path).unwrap();
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let text = String::from_utf8_lossy(&bytes[10..header]).into_owned();
        assert!(text.contains("<u2"), "{text}");
        let shape = text.split("'shape': (").nth(1).unwrap().split(')').next().unwrap();
        let sizes: Vec<usize> = shape.split(',').filter_map(|s| s.trim().parse().ok()).collect();
        let values = bytes[header..].chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        Raw { width: sizes[1], height: sizes[0], values }
    }

    /// Half the size from an even place on, so that a double-size picture gives shifts of half a pixel.
    fn halved(&self, (dx, dy): (usize, usize)) -> Raw {
        let (width, height) = (self.width / 2 - 8, self.height / 2 - 8);
        let at = |x: usize, y: usize, c: usize| u32::from(self.values[3 * (y * self.width + x) + c]);
        let values = (0..3 * width * height)
            .map(|i| {
                let (x, y, c) = (8 + 2 * (i / 3 % width) - dx, 8 + 2 * (i / 3 / width) - dy, i % 3);
                let four = [at(x, y, c), at(x + 1, y, c), at(x, y + 1, c), at(x + 1, y + 1, c)];
                // A full part of a pixel fills it in a real sensor; a mean with one would look like data.
                if four.iter().any(|v| *v >= 65_520) { 65_520 } else { (four.iter().sum::<u32>() / 4) as u16 }
            })
            .collect();
        Raw { width, height, values }
    }

    fn save(self, path: &Path) {
        let buffer =
            image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(self.width as u32, self.height as u32, self.values);
        buffer.unwrap().save(path).unwrap();
    }
}

/// What is rendered besides the renderer's own choices: keyword arguments of its function `photo`.
fn render(script: &Path, material: &Material, times: &[f64], extra: &str, folder: &Path) {
    let curve = folder.join("truth.csv");
    material.csv(&curve);
    let code = format!(
        "import importlib.util as u, sys\ns = u.spec_from_file_location('r', sys.argv[1]); m = u.module_from_spec(s); s.loader.exec_module(m)\n\
         m.photo(m.load_curve(sys.argv[2]), sys.argv[3], times={times:?}{extra})"
    );
    let done = Command::new("python3").args(["-c", &code]).arg(script).arg(&curve).arg(folder.join("npy")).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

/// A series in a folder of its own: the photographs as PNG, and their times.
struct Rendered {
    folder: tempfile::TempDir,
    times: BTreeMap<String, f64>,
}

impl Rendered {
    fn new(script: &Path, material: &Material, extra: &str) -> Rendered {
        Rendered::with(script, material, extra, |_, raw| raw)
    }

    fn with(script: &Path, material: &Material, extra: &str, change: impl Fn(usize, Raw) -> Raw) -> Rendered {
        let folder = tempfile::tempdir().unwrap();
        let times = material.times();
        render(script, material, &times, extra, folder.path());
        std::fs::create_dir(folder.path().join("photos")).unwrap();
        let mut named = BTreeMap::new();
        for (i, time) in times.into_iter().enumerate() {
            let name = format!("exp_{i}.png");
            let raw = Raw::read(&folder.path().join(format!("npy/exp_{i}.npy")));
            change(i, raw).save(&folder.path().join("photos").join(&name));
            named.insert(name, time);
        }
        Rendered { folder, times: named }
    }

    fn photos(&self) -> PathBuf {
        self.folder.path().join("photos")
    }
}

/// The setup as the renderer describes it, with errors.
#[derive(Clone, Copy)]
struct Tape {
    known: bool,
    radius: f64,
    light: [f64; 3],
    axis: [f64; 3],
    field_of_view: f64,
}

const EXACT: Tape =
    Tape { known: true, radius: 50.0, light: [350.0, 100.0, 900.0], axis: [0.0, 1.0, 0.0], field_of_view: 14.0 };

fn setup(tape: &Tape, stack: &str, times: &BTreeMap<String, f64>) -> Setup {
    let mut text = format!(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\ngeometry = \"{}\"\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = {}\n[[light]]\nposition_mm = {:?}\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = {}\naxis = {:?}\nheight_mm = 120\nstack = \"{stack}\"\n[exposures]\n",
        if tape.known { "known" } else { "solved" },
        tape.field_of_view,
        tape.light,
        tape.radius,
        tape.axis
    );
    for (name, time) in times {
        let _ = writeln!(text, "\"{name}\" = {time:e}");
    }
    Setup::parse(&text).unwrap()
}

/// How a measured curve compares with the truth.
#[derive(Debug)]
struct Score {
    /// Largest relative error of a sample from 2 to 60 degrees.
    worst: f64,
    /// Mean relative error there.
    scale: f64,
    /// Share of the samples there, and of those below 2 degrees, whose band of two deviations holds the truth.
    covered: f64,
    /// Samples compared.
    count: usize,
}

fn score(taken: &Taken, material: &Material) -> Score {
    let (mut worst, mut sum, mut covered, mut count, mut all) = (0.0f64, 0.0, 0.0, 0.0, 0.0);
    for row in &taken.measurement.stacks[0].rows {
        if row.kind == Kind::Extrapolated || row.theta_deg > 60.0 {
            continue;
        }
        let truth = material.at(row.theta_deg.to_radians());
        for c in 0..3 {
            let error = row.rgb[c] / truth[c] - 1.0;
            covered += f64::from(u8::from((row.rgb[c] - truth[c]).abs() <= 2.0 * row.sigma[c]));
            all += 1.0;
            if std::env::var_os("FOILPRESS_ROWS").is_some() {
                println!("{:6.2} {c} {:.5} {:.5} {:+.4} {:.4} {:?} {}", row.theta_deg, row.rgb[c], truth[c], error, row.sigma[c] / row.rgb[c], row.kind, row.pixels);
            }
            if row.theta_deg >= 2.0 {
                worst = worst.max(error.abs());
                sum += error;
                count += 1.0;
            }
        }
    }
    Score { worst, scale: sum / count, covered: covered / all, count: count as usize }
}

fn report(name: &str, taken: &Taken, score: &Score) {
    println!(
        "{name:<28} worst {:5.2} %, scale {:+5.2} %, covered {:3.0} % of {}, misfit {:.2} % from {:.2} %",
        100.0 * score.worst,
        100.0 * score.scale,
        100.0 * score.covered,
        score.count,
        100.0 * taken.measurement.geometry.misfit,
        100.0 * taken.measurement.geometry.misfit_before
    );
}

#[test]
fn seven_materials_with_known_geometry() {
    let Some(script) = renderer() else { return };
    for material in &MATERIALS {
        let rendered = Rendered::new(&script, material, "");
        let taken = measure(&rendered.photos(), &setup(&EXACT, material.stack, &rendered.times), &Silent).unwrap();
        let score = score(&taken, material);
        report(material.name, &taken, &score);
        assert!(score.count > 90 && score.worst < 0.03, "{}: {score:?}", material.name);
        assert!(score.scale.abs() < 0.02 && score.covered >= 0.9, "{}: {score:?}", material.name);
        assert!(taken.measurement.again.is_empty(), "{:?}", taken.measurement.again);
    }
}

#[test]
fn a_wrong_tape_is_corrected() {
    let Some(script) = renderer() else { return };
    let solved = Tape { known: false, ..EXACT };
    let lean = 0.5f64.to_radians();
    let cases = [
        ("exact, solved", solved),
        ("radius 1 % large", Tape { radius: 50.5, ..solved }),
        ("light 5 mm off", Tape { light: [355.0, 100.0, 900.0], ..solved }),
        ("light 5 mm low", Tape { light: [350.0, 95.0, 900.0], ..solved }),
        ("leaning 0.5 degrees", Tape { axis: [lean.sin(), lean.cos(), 0.0], ..solved }),
        ("nodding 0.5 degrees", Tape { axis: [0.0, lean.cos(), lean.sin()], ..solved }),
    ];
    for material in &MATERIALS {
        let rendered = Rendered::new(&script, material, "");
        for (name, tape) in &cases {
            let taken = measure(&rendered.photos(), &setup(tape, material.stack, &rendered.times), &Silent).unwrap();
            let score = score(&taken, material);
            report(&format!("{}, {name}", material.name), &taken, &score);
            assert!(score.worst < 0.08 && score.scale.abs() < 0.02, "{}, {name}: {score:?}", material.name);
            assert!(score.covered >= 0.9, "{}, {name}: {score:?}", material.name);
        }
    }
}
