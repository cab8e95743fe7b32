//! The circle closed: a printed chart of stacks round a can, its photographs, the library they give, and a document printed with it.
//!
//! The photographs are made here by a pinhole camera that shares nothing with the program: a ray for each part of a pixel, the can it
//! meets, the dot of the wrapped sheet, that stack's curve, the inverse square of the lamp's distance, the noise and the 12
//! bits of a sensor. What the ribbons really reflect differs from what the built-in library says. The program is told
//! where things stand by a tape that is a little off, and finds the stacks by the chart's marks.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use appearance::brdf::Space;
use appearance::gamut::{self, Mapped, Printable};
use appearance::materials::Materials;
use inks::{Library, Stack, ggx};
use measure::measure;
use measure::reduce::Kind;
use measure::setup::Setup;
use observe::Silent;
use press::chart;
use press::layout::{Layout, arrange};
use press::sheet::{DotMap, Sheet};
use protocol::paper::Paper;
use rayon::prelude::*;

type V = [f64; 3];

const DOTS_PER_MM: f64 = 600.0 / 25.4;
const SIZE: (usize, usize) = (1800, 900);
const EYE: V = [0.0, 0.0, 1200.0];
const FIELD_DEG: f64 = 14.0;
const LAMP: V = [350.0, 30.0, 900.0];
const RADIUS: f64 = 50.0;
/// Where the chart's middle lies: along the arc and along the axis in mm, and its turn.
const LIES: [f64; 3] = [9.5, 1.2, 0.012];
const WHITE: V = [1.4, 1.0, 1.2];
const TIMES: [f64; 5] = [0.25, 0.0625, 0.0156, 0.0039, 0.00098];
/// The stacks of the chart.
const STACKS: [&str; 4] = ["K", "MS", "MS+F", "MS+C"];

fn dot(a: V, b: V) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

fn unit(a: V) -> V {
    a.map(|v| v / dot(a, a).sqrt())
}

fn stack(text: &str) -> Stack {
    text.parse().unwrap()
}

/// What a stack really reflects: a diffuse part and a lobe that are not those of the library.
fn truth(stack: &str, theta: f64) -> V {
    let (diffuse, f0, alpha) = match stack {
        "K" => ([0.03, 0.03, 0.032], [0.04; 3], 0.2),
        "MS" => ([0.13, 0.13, 0.12], [0.5; 3], 0.33),
        "MS+F" => ([0.08, 0.08, 0.075], [0.47; 3], 0.17),
        "MS+C" => ([0.02, 0.07, 0.1], [0.06, 0.27, 0.4], 0.3),
        _ => ([0.84, 0.85, 0.88], [0.04; 3], 0.28),
    };
    std::array::from_fn(|c| 0.96 * diffuse[c] / PI + f0[c] * ggx::lobe(theta, alpha))
}

/// A library with these curves for the chart's stacks and paper.
fn written(folder: &Path) -> Library {
    fs::create_dir_all(folder).unwrap();
    let mut library = "format = 1\nbased_on = \"built-in\"\n".to_owned();
    for name in STACKS.iter().chain(&["substrate"]) {
        let mut curve = "theta_h_deg,r,g,b\n".to_owned();
        for i in 0..=356 {
            let degrees = f64::from(i) * 0.25;
            let [r, g, b] = truth(name, degrees.to_radians());
            let _ = writeln!(curve, "{degrees},{r:e},{g:e},{b:e}");
        }
        let file = format!("{}.csv", name.to_lowercase().replace('+', "-"));
        fs::write(folder.join(&file), curve).unwrap();
        let _ = writeln!(
            library,
            "[[measured]]\nstack = \"{name}\"\ncurve = \"{file}\"\nby = \"nobody\"\nwhen = \"2026-11\"\nsetup = \"made up\""
        );
    }
    fs::write(folder.join("library.toml"), library).unwrap();
    Library::from_dir(folder).unwrap()
}

fn chart() -> Sheet {
    let stacks: Vec<Stack> = STACKS.map(stack).to_vec();
    let dots = chart::stacks(&stacks, Paper::A4, true).unwrap();
    let paper = Paper::Custom { width: dots.width() as u16 + 100, length: dots.length() as u16 + 650 };
    let layout = Layout { camera_marks: true, ..Layout::centred(paper) };
    arrange(&dots, &layout, &Silent).unwrap().sheet
}

/// Curves at even steps.
struct Curves(Vec<Vec<V>>);

impl Curves {
    fn new(dots: &DotMap) -> Curves {
        let row =
            |s: &Stack| (0..=2048).map(|i| truth(&s.to_string(), f64::from(i) / 2048.0 * 1.6)).collect();
        Curves(dots.stacks().iter().map(row).collect())
    }

    fn at(&self, stack: usize, theta: f64) -> V {
        let at = (theta / 1.6 * 2048.0).clamp(0.0, 2047.99);
        let (a, b, t) = (self.0[stack][at as usize], self.0[stack][at as usize + 1], at.fract());
        std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
    }
}

/// The light from a direction of the camera: from the can, from the card beside it, or none.
fn light(dots: &DotMap, curves: &Curves, d: V) -> V {
    let lit = |p: V, n: V| {
        let (to, away) = (minus(LAMP, p), minus(EYE, p));
        let (l, v) = (unit(to), unit(away));
        let h = unit(std::array::from_fn(|i| l[i] + v[i]));
        (dot(n, h).clamp(-1.0, 1.0).acos(), 1e6 * dot(n, l).max(0.0) / dot(to, to))
    };
    let (a, b, c) =
        (d[0] * d[0] + d[2] * d[2], EYE[0] * d[0] + EYE[2] * d[2], EYE[2] * EYE[2] - RADIUS * RADIUS);
    let root = b * b - a * c;
    if root > 0.0 {
        let t = (-b - root.sqrt()) / a;
        let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
        let n = [p[0] / RADIUS, 0.0, p[2] / RADIUS];
        let (x, y) = (RADIUS * p[0].atan2(p[2]) - LIES[0], p[1] - LIES[1]);
        let (s, c) = LIES[2].sin_cos();
        let (x, y) = (c * x + s * y, c * y - s * x);
        let (width, length) = (dots.width() as f64, dots.length() as f64);
        let (i, j) = (width / 2.0 + x * DOTS_PER_MM, length / 2.0 - y * DOTS_PER_MM);
        if j < 0.0 || j >= length {
            return [0.0; 3];
        }
        let (theta, irradiance) = lit(p, n);
        // Bare paper goes on round the can.
        let beside = i < 0.0 || i >= width;
        let own = if beside { 0 } else { usize::from(dots.index()[j as usize * dots.width() + i as usize]) };
        return curves.at(own, theta).map(|f| f * irradiance);
    }
    let t = -EYE[2] / d[2];
    let p: V = std::array::from_fn(|i| EYE[i] + t * d[i]);
    if !(70.0..130.0).contains(&p[0]) || p[1].abs() > 12.0 {
        return [0.0; 3];
    }
    let (_, irradiance) = lit(p, [0.0, 0.0, 1.0]);
    [[0.9, 0.18, 0.036][((p[0] - 70.0) / 20.0) as usize] / PI * irradiance; 3]
}

fn focal() -> f64 {
    0.5 * SIZE.0 as f64 / (0.5 * FIELD_DEG).to_radians().tan()
}

/// The series in a folder.
fn photographed(dots: &DotMap, folder: &Path) {
    let curves = Curves::new(dots);
    let (width, height) = SIZE;
    let radiance: Vec<V> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let mut sum = [0.0; 3];
            for k in 0..9 {
                let part = |k: usize| (k as f64 + 0.5) / 3.0;
                let (x, y) = ((i % width) as f64 + part(k % 3), (i / width) as f64 + part(k / 3));
                let d = [(x - width as f64 / 2.0) / focal(), (height as f64 / 2.0 - y) / focal(), -1.0];
                let seen = light(dots, &curves, d);
                (0..3).for_each(|c| sum[c] += seen[c] / 9.0);
            }
            sum
        })
        .collect();
    fs::create_dir_all(folder).unwrap();
    TIMES.par_iter().enumerate().for_each(|(shot, time)| {
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
        let picture = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(width as u32, height as u32, values);
        picture.unwrap().save(folder.join(format!("exp_{shot}.png"))).unwrap();
    });
}

/// What a tape says, and no word of where the stacks are.
fn setup() -> Setup {
    let (width, middle) = (SIZE.0 as f64, SIZE.1 as f64 / 2.0);
    let px = |x: f64| width / 2.0 + x * focal() / EYE[2];
    let card = [px(70.0), middle - 12.0 * focal() / EYE[2], px(130.0), middle + 12.0 * focal() / EYE[2]];
    let times: String = TIMES.iter().enumerate().map(|(i, t)| format!("\"exp_{i}.png\" = {t}\n")).collect();
    Setup::parse(&format!(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = {FIELD_DEG}\n\
         [[light]]\nposition_mm = [353, 30, 898]\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = 50.3\nheight_mm = 130\nchart = \"stacks.rgl\"\n\
         [card]\nrectangle_px = {card:?}\n[exposures]\n{times}"
    ))
    .unwrap()
}

/// A document of 20 x 20 pixels: dark to metallic to bluish, dull to glossy.
struct Target {
    space: Space,
}

const SIDE: usize = 20;

impl Materials for Target {
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
        let (u, v) = ((pixel % SIDE) as f64 / SIDE as f64, (pixel / SIDE) as f64 / SIDE as f64);
        let colour = [0.75 - 0.5 * v, 0.75 - 0.2 * v, 0.75];
        let angles: Vec<f64> = self.space.angles().to_vec();
        let curve = inks::Curve::sampled(&angles, |theta| {
            colour
                .map(|k| k * (0.02 + 0.1 * u) / PI + k * (0.05 + 0.5 * u) * ggx::lobe(theta, 0.16 + 0.2 * v))
        });
        out.iter_mut().zip(self.space.row(&curve)).for_each(|(out, f)| *out = f as f32);
    }
}

/// How far the document is from its print, as the ribbons really are: root mean square of the distance d.
fn fidelity(target: &Target, mapped: &Mapped, real: &Library) -> f64 {
    let rows = appearance::brdf::reflectances(&mapped.mix.stacks, real, &target.space);
    let mut sum = 0.0;
    for pixel in 0..SIDE * SIDE {
        let mut shares = vec![0.0; mapped.mix.stacks.len()];
        mapped.mix.shares(pixel, &mut shares);
        let mut printed = vec![0.0; target.space.columns()];
        for (row, share) in rows.rows().zip(&shares) {
            printed.iter_mut().zip(row).for_each(|(out, f)| *out += share * f);
        }
        let mut wanted = vec![0.0f32; printed.len()];
        target.reflectance(pixel, &mut wanted);
        let wanted: Vec<f64> = wanted.into_iter().map(f64::from).collect();
        sum += target.space.distance(&printed, &wanted).powi(2);
    }
    (sum / (SIDE * SIDE) as f64).sqrt()
}

#[test]
fn a_library_measured_from_a_can_prints_as_well_as_the_true_one() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = chart();
    photographed(sheet.dots(), &folder.path().join("photos"));
    let photos = folder.path().join("photos");
    // Another chart is not what is in the pictures.
    let stacks: Vec<Stack> = ["C", "MS"].map(stack).to_vec();
    let dots = chart::stacks(&stacks, Paper::A4, true).unwrap();
    let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
    let other = arrange(&dots, &layout, &Silent).unwrap().sheet;
    let said = measure(&photos, &setup(), Some(other.dots()), &Silent).err().unwrap().to_string();
    assert!(said.contains("exp_") && said.contains("another sheet"), "{said}");

    let taken = measure(&photos, &setup(), Some(sheet.dots()), &Silent).unwrap();
    assert_eq!(taken.measurement.stacks.iter().map(|s| s.stack.as_str()).collect::<Vec<_>>(), STACKS);
    for measured in &taken.measurement.stacks {
        let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0.0);
        let rows = measured.rows.iter().filter(|row| row.kind != Kind::Extrapolated);
        for row in rows.filter(|row| (2.0..50.0).contains(&row.theta_deg)) {
            let real = truth(&measured.stack, row.theta_deg.to_radians());
            for (found, real) in row.rgb.iter().zip(real) {
                let error = found / real - 1.0;
                worst = worst.max(error.abs());
                sum += error;
                count += 1.0;
            }
        }
        println!(
            "{:<5} worst {:.2} %, scale {:+.2} %, {count} samples",
            measured.stack,
            100.0 * worst,
            100.0 * sum / count
        );
        assert!(
            count > 60.0 && worst < 0.08 && (sum / count).abs() < 0.02,
            "{}: {worst} {}",
            measured.stack,
            sum / count
        );
    }
    let mine = folder.path().join("mine");
    fs::create_dir(&mine).unwrap();
    measure::library::write(&taken, &mine).unwrap();
    // Paper is not on the chart: that of the true library takes its place in both.
    let real = written(&folder.path().join("real"));
    let text = fs::read_to_string(mine.join("library.toml")).unwrap();
    let paper = "[[measured]]\nstack = \"substrate\"\ncurve = \"substrate.csv\"\nby = \"nobody\"\nwhen = \"2026-11\"\nsetup = \"made up\"\n";
    fs::write(mine.join("library.toml"), format!("{text}\n{paper}")).unwrap();
    fs::copy(folder.path().join("real/substrate.csv"), mine.join("substrate.csv")).unwrap();
    let mine = Library::from_dir(&mine).unwrap();

    let target = Target { space: Space::half_angle(48) };
    let stacks = || STACKS.iter().chain(&["substrate"]).map(|s| stack(s)).collect::<Vec<_>>();
    let print = |library: &Library| {
        let rows = appearance::brdf::reflectances(&stacks(), library, &target.space);
        let printable = Printable::new(stacks(), rows);
        let mapped = gamut::clamped(&target, &printable, &gamut::Settings::default(), &Silent).unwrap();
        fidelity(&target, &mapped, &real)
    };
    let (best, measured, modelled) = (print(&real), print(&mine), print(&Library::builtin()));
    println!(
        "distance d of the print: {best:.5} with the true library, {measured:.5} with the measured, {modelled:.5} with the built-in one"
    );
    assert!(measured < 1.05 * best, "{measured} {best}");
    assert!(modelled > 1.2 * best, "the test says nothing: {modelled} {best}");
}
