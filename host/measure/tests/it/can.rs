//! The circle closed: a printed chart of stacks round a can, its photographs, the library they give, and a document printed with it.
//!
//! The photographs are made by a camera that shares nothing with the program: a ray for each part of a pixel, the can it
//! meets, the dot of the wrapped sheet, that stack's curve, the inverse square of the lamp's distance. What the ribbons really reflect differs from what the built-in library says. The program is told
//! where things stand by a tape that is a little off, and finds the stacks by the chart's marks.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::made::{Camera, Curves, DOTS_PER_MM, EYE, STACKS, V, chart, lit, stack, truth};
use appearance::brdf::Space;
use appearance::gamut::{self, Mapped, Printable};
use appearance::materials::Materials;
use files::shelf::Disk;
use inks::{Library, Stack, ggx};
use measure::curves::reduce::SampleOrigin;
use measure::measure;
use measure::setup::Setup;
use observe::Silent;
use press::layout::{Layout, arrange};
use protocol::paper::Paper;
use sheet::DotMap;
use std::f64::consts::PI;

const CAMERA: Camera =
    Camera { size: (1800, 900), field_deg: 14.0, times: &[0.25, 0.0625, 0.0156, 0.0039, 0.00098], rays: 3 };
const LAMP: V = [350.0, 30.0, 900.0];
const RADIUS: f64 = 50.0;
/// Where the chart's middle lies: along the arc and along the axis in mm, and its turn.
const LIES: [f64; 3] = [9.5, 1.2, 0.012];
/// Where the card begins at the left, and the width of its steps, in mm.
const CARD: (f64, f64) = (70.0, 20.0);

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
    Library::open(&Disk, folder).unwrap()
}

/// The light from a direction of the camera: from the can, from the card beside it, or none.
fn light(dots: &DotMap, curves: &Curves, d: V) -> V {
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
        let (theta, irradiance) = lit(p, n, LAMP);
        // Bare paper goes on round the can.
        let beside = i < 0.0 || i >= width;
        let own = if beside { 0 } else { usize::from(dots.index()[j as usize * dots.width() + i as usize]) };
        return curves.at(own, theta).map(|f| f * irradiance);
    }
    crate::made::card(d, CARD, LAMP)
}

/// What a tape says, and no word of where the stacks are.
fn setup() -> Setup {
    let (card, times) = (CAMERA.card_px(CARD), CAMERA.exposures("exp_"));
    Setup::parse(&format!(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = {}\n\
         [[light]]\nposition_mm = [353, 30, 898]\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = 50.3\nheight_mm = 130\nchart = \"stacks.rgl\"\n\
         [card]\nrectangle_px = {card:?}\n[exposures]\n{times}",
        CAMERA.field_deg
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
    let photos = folder.path().join("photos");
    let curves = Curves::new(sheet.dots());
    CAMERA.photograph(&photos, "exp_", |d| light(sheet.dots(), &curves, d));
    // Another chart is not what is in the pictures.
    let stacks: Vec<Stack> = ["C", "MS"].map(stack).to_vec();
    let dots = press::chart::stacks(&stacks, Paper::A4, Some("50".parse().unwrap())).unwrap();
    let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
    let other = arrange(&dots, &layout, &Silent).unwrap().sheet;
    let said = measure(&photos, &setup(), Some(other.dots()), &Silent).err().unwrap().to_string();
    assert!(said.contains("exp_") && said.contains("another sheet"), "{said}");

    let taken = measure(&photos, &setup(), Some(sheet.dots()), &Silent).unwrap();
    assert_eq!(taken.measurement.stacks.iter().map(|s| s.stack.as_str()).collect::<Vec<_>>(), STACKS);
    for measured in &taken.measurement.stacks {
        let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0.0);
        let rows = measured.rows.iter().filter(|row| row.kind != SampleOrigin::Extrapolated);
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
    measure::curves::library::write(&taken, &mine).unwrap();
    // Paper is not on the chart: that of the true library takes its place in both.
    let real = written(&folder.path().join("real"));
    let text = fs::read_to_string(mine.join("library.toml")).unwrap();
    let paper = "[[measured]]\nstack = \"substrate\"\ncurve = \"substrate.csv\"\nby = \"nobody\"\nwhen = \"2026-11\"\nsetup = \"made up\"\n";
    fs::write(mine.join("library.toml"), format!("{text}\n{paper}")).unwrap();
    fs::copy(folder.path().join("real/substrate.csv"), mine.join("substrate.csv")).unwrap();
    let mine = Library::open(&Disk, &mine).unwrap();

    let target = Target { space: Space::half_angle(48) };
    let stacks = || STACKS.iter().chain(&["substrate"]).map(|s| stack(s)).collect::<Vec<_>>();
    let print = |library: &Library| {
        let rows = appearance::brdf::reflectances(&stacks(), library, &target.space);
        let printable = Printable::new(stacks(), rows);
        let mapped = gamut::clamped(&target, &printable, &gamut::GamutSettings::default(), &Silent).unwrap();
        fidelity(&target, &mapped, &real)
    };
    let (best, measured, modelled) = (print(&real), print(&mine), print(&Library::builtin()));
    println!(
        "distance d of the print: {best:.5} with the true library, {measured:.5} with the measured, {modelled:.5} with the built-in one"
    );
    assert!(measured < 1.05 * best, "{measured} {best}");
    assert!(modelled > 1.2 * best, "the test says nothing: {modelled} {best}");
}
