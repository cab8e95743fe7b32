//! The 57 stacks compared with the figures published with the model, which other code computed.
//!
//! Columns: stack, diffuse albedo, lobes (F0, alpha), green reflectance at half angles of 0, 10 and 30 degrees in 1/sr
//! to three significant digits.

use std::path::Path;

use files::shelf::Disk;
use inks::{Curve, Library, Stack};
use testing::needs::data;

struct Row {
    stack: &'static str,
    kd: [f64; 3],
    lobes: &'static [([f64; 3], f64)],
    green: [&'static str; 3],
}

const fn row(
    stack: &'static str,
    kd: [f64; 3],
    lobes: &'static [([f64; 3], f64)],
    green: [&'static str; 3],
) -> Row {
    Row { stack, kd, lobes, green }
}

#[rustfmt::skip]
const PUBLISHED: [Row; 57] = [
    row("substrate", [0.842, 0.853, 0.884], &[([0.04, 0.04, 0.04], 0.280)], ["0.301", "0.284", "0.264"]),
    row("C", [0.012, 0.310, 0.701], &[([0.04, 0.04, 0.04], 0.120)], ["0.316", "0.119", "0.0956"]),
    row("M", [0.690, 0.012, 0.196], &[([0.04, 0.04, 0.04], 0.120)], ["0.225", "0.0279", "0.00456"]),
    row("Y", [0.842, 0.746, 0.012], &[([0.04, 0.04, 0.04], 0.120)], ["0.449", "0.252", "0.229"]),
    row("K", [0.021, 0.021, 0.021], &[([0.04, 0.04, 0.04], 0.140)], ["0.169", "0.033", "0.0076"]),
    row("MC", [0.001, 0.036, 0.079], &[([0.02, 0.24, 0.44], 0.310), ([0.02, 0.02, 0.02], 0.300)], ["0.224", "0.144", "0.0358"]),
    row("MM", [0.082, 0.001, 0.022], &[([0.45, 0.02, 0.16], 0.310), ([0.02, 0.02, 0.02], 0.300)], ["0.0326", "0.0202", "0.00399"]),
    row("MG", [0.090, 0.068, 0.032], &[([0.54, 0.41, 0.20], 0.290), ([0.02, 0.02, 0.02], 0.300)], ["0.422", "0.255", "0.0589"]),
    row("MS", [0.100, 0.100, 0.100], &[([0.57, 0.57, 0.57], 0.270), ([0.02, 0.02, 0.02], 0.300)], ["0.667", "0.374", "0.0791"]),
    row("GF", [0.015, 0.015, 0.015], &[([0.84, 0.66, 0.31], 0.060)], ["14.7", "0.178", "0.00855"]),
    row("SF", [0.015, 0.015, 0.015], &[([0.85, 0.85, 0.86], 0.060)], ["18.8", "0.226", "0.00967"]),
    row("F", [0.757, 0.771, 0.808], &[([0.04, 0.04, 0.04], 0.050)], ["1.51", "0.243", "0.236"]),
    row("P", [0.817, 0.828, 0.857], &[([0.04, 0.04, 0.04], 0.210)], ["0.325", "0.28", "0.255"]),
    row("C+M", [0.010, 0.004, 0.156], &[([0.04, 0.04, 0.04], 0.120)], ["0.222", "0.0256", "0.00223"]),
    row("C+Y", [0.012, 0.271, 0.010], &[([0.04, 0.04, 0.04], 0.120)], ["0.304", "0.107", "0.0838"]),
    row("M+Y", [0.690, 0.010, 0.003], &[([0.04, 0.04, 0.04], 0.120)], ["0.224", "0.0275", "0.0041"]),
    row("C+M+Y", [0.010, 0.004, 0.002], &[([0.04, 0.04, 0.04], 0.120)], ["0.222", "0.0254", "0.00206"]),
    row("C+F", [0.008, 0.230, 0.596], &[([0.04, 0.04, 0.04], 0.050)], ["1.34", "0.0779", "0.0704"]),
    row("M+F", [0.585, 0.008, 0.140], &[([0.04, 0.04, 0.04], 0.050)], ["1.28", "0.0102", "0.00264"]),
    row("Y+F", [0.757, 0.646, 0.008], &[([0.04, 0.04, 0.04], 0.050)], ["1.47", "0.205", "0.198"]),
    row("K+F", [0.014, 0.014, 0.014], &[([0.04, 0.04, 0.04], 0.050)], ["1.28", "0.0121", "0.00451"]),
    row("C+M+F", [0.007, 0.003, 0.110], &[([0.04, 0.04, 0.04], 0.050)], ["1.27", "0.00863", "0.00106"]),
    row("C+Y+F", [0.008, 0.198, 0.006], &[([0.04, 0.04, 0.04], 0.050)], ["1.33", "0.0683", "0.0608"]),
    row("M+Y+F", [0.585, 0.007, 0.002], &[([0.04, 0.04, 0.04], 0.050)], ["1.28", "0.00989", "0.00233"]),
    row("C+M+Y+F", [0.007, 0.003, 0.001], &[([0.04, 0.04, 0.04], 0.050)], ["1.27", "0.00851", "0.000951"]),
    row("MC+F", [0.001, 0.033, 0.073], &[([0.02, 0.22, 0.41], 0.356), ([0.04, 0.04, 0.04], 0.050)], ["1.42", "0.114", "0.0345"]),
    row("MM+F", [0.076, 0.001, 0.020], &[([0.42, 0.02, 0.15], 0.356), ([0.04, 0.04, 0.04], 0.050)], ["1.28", "0.0153", "0.00235"]),
    row("MG+F", [0.083, 0.062, 0.029], &[([0.49, 0.37, 0.18], 0.333), ([0.04, 0.04, 0.04], 0.050)], ["1.56", "0.206", "0.0582"]),
    row("MS+F", [0.092, 0.092, 0.092], &[([0.52, 0.52, 0.53], 0.310), ([0.04, 0.04, 0.04], 0.050)], ["1.73", "0.306", "0.0789"]),
    row("GF+F", [0.014, 0.014, 0.014], &[([0.77, 0.61, 0.28], 0.069), ([0.04, 0.04, 0.04], 0.050)], ["11.5", "0.209", "0.00919"]),
    row("SF+F", [0.014, 0.014, 0.014], &[([0.78, 0.78, 0.79], 0.069), ([0.04, 0.04, 0.04], 0.050)], ["14.4", "0.265", "0.0105"]),
    row("MS+C", [0.001, 0.036, 0.079], &[([0.01, 0.19, 0.42], 0.284), ([0.04, 0.04, 0.04], 0.120)], ["0.42", "0.142", "0.0286"]),
    row("MS+M", [0.082, 0.001, 0.022], &[([0.43, 0.01, 0.12], 0.284), ([0.04, 0.04, 0.04], 0.120)], ["0.229", "0.0288", "0.00197"]),
    row("MS+Y", [0.100, 0.087, 0.001], &[([0.52, 0.46, 0.01], 0.284), ([0.04, 0.04, 0.04], 0.120)], ["0.699", "0.308", "0.0675"]),
    row("MS+C+M", [0.001, 0.001, 0.018], &[([0.01, 0.00, 0.09], 0.298), ([0.04, 0.04, 0.04], 0.120)], ["0.223", "0.0258", "0.00128"]),
    row("MS+C+Y", [0.001, 0.032, 0.001], &[([0.01, 0.15, 0.01], 0.298), ([0.04, 0.04, 0.04], 0.120)], ["0.368", "0.116", "0.0247"]),
    row("MS+M+Y", [0.082, 0.001, 0.000], &[([0.39, 0.01, 0.00], 0.298), ([0.04, 0.04, 0.04], 0.120)], ["0.227", "0.0278", "0.00182"]),
    row("SF+C", [0.000, 0.005, 0.012], &[([0.01, 0.28, 0.62], 0.063), ([0.04, 0.04, 0.04], 0.120)], ["5.92", "0.106", "0.00443"]),
    row("SF+M", [0.012, 0.000, 0.003], &[([0.64, 0.01, 0.17], 0.063), ([0.04, 0.04, 0.04], 0.120)], ["0.442", "0.0274", "0.00103"]),
    row("SF+Y", [0.015, 0.013, 0.000], &[([0.78, 0.68, 0.01], 0.063), ([0.04, 0.04, 0.04], 0.120)], ["13.9", "0.221", "0.0094"]),
    row("SF+C+M", [0.000, 0.000, 0.003], &[([0.01, 0.00, 0.13], 0.066), ([0.04, 0.04, 0.04], 0.120)], ["0.288", "0.0254", "0.000946"]),
    row("SF+C+Y", [0.000, 0.005, 0.000], &[([0.01, 0.23, 0.01], 0.066), ([0.04, 0.04, 0.04], 0.120)], ["4.38", "0.0951", "0.00401"]),
    row("SF+M+Y", [0.012, 0.000, 0.000], &[([0.59, 0.01, 0.00], 0.066), ([0.04, 0.04, 0.04], 0.120)], ["0.382", "0.027", "0.00102"]),
    row("MG+C", [0.001, 0.025, 0.025], &[([0.01, 0.14, 0.14], 0.304), ([0.04, 0.04, 0.04], 0.120)], ["0.345", "0.103", "0.0213"]),
    row("MG+M", [0.074, 0.001, 0.007], &[([0.40, 0.01, 0.04], 0.304), ([0.04, 0.04, 0.04], 0.120)], ["0.226", "0.0273", "0.00168"]),
    row("MG+Y", [0.090, 0.059, 0.000], &[([0.49, 0.33, 0.00], 0.304), ([0.04, 0.04, 0.04], 0.120)], ["0.519", "0.214", "0.0499"]),
    row("GF+C", [0.000, 0.005, 0.012], &[([0.01, 0.22, 0.22], 0.063), ([0.04, 0.04, 0.04], 0.120)], ["4.67", "0.0883", "0.00402"]),
    row("GF+M", [0.012, 0.000, 0.003], &[([0.63, 0.01, 0.06], 0.063), ([0.04, 0.04, 0.04], 0.120)], ["0.393", "0.0268", "0.00102"]),
    row("P+SF", [0.015, 0.015, 0.015], &[([0.85, 0.85, 0.86], 0.045)], ["33.4", "0.141", "0.00747"]),
    row("P+GF", [0.015, 0.015, 0.015], &[([0.84, 0.66, 0.31], 0.045)], ["26.1", "0.111", "0.00683"]),
    row("P+MS", [0.100, 0.100, 0.100], &[([0.57, 0.57, 0.57], 0.238), ([0.02, 0.02, 0.02], 0.300)], ["0.847", "0.405", "0.0718"]),
    row("P+MG", [0.090, 0.068, 0.032], &[([0.54, 0.41, 0.20], 0.255), ([0.02, 0.02, 0.02], 0.300)], ["0.534", "0.28", "0.0536"]),
    row("MS+C+F", [0.001, 0.033, 0.073], &[([0.01, 0.17, 0.38], 0.326), ([0.04, 0.04, 0.04], 0.050)], ["1.41", "0.104", "0.0282"]),
    row("MS+M+F", [0.076, 0.001, 0.020], &[([0.39, 0.01, 0.11], 0.326), ([0.04, 0.04, 0.04], 0.050)], ["1.28", "0.0114", "0.00125"]),
    row("MS+Y+F", [0.092, 0.081, 0.001], &[([0.48, 0.42, 0.01], 0.326), ([0.04, 0.04, 0.04], 0.050)], ["1.61", "0.238", "0.0676"]),
    row("P+F", [0.727, 0.740, 0.776], &[([0.04, 0.04, 0.04], 0.050)], ["1.5", "0.234", "0.226"]),
    row("MS+K", [0.002, 0.002, 0.002], &[([0.01, 0.01, 0.01], 0.284), ([0.04, 0.04, 0.04], 0.120)], ["0.234", "0.0323", "0.00277"]),
];

/// Half a unit of the last published digit, plus 0.1 % because the anchors were published with three digits.
fn rounding(text: &str) -> f64 {
    let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    0.5 * 10f64.powi(-(decimals as i32)) + 1e-3 * text.parse::<f64>().unwrap()
}

#[test]
fn the_stacks_come_in_the_published_order() {
    let library = Library::builtin();
    let stacks: Vec<String> = library.entries().iter().map(|entry| entry.stack.to_string()).collect();
    let published: Vec<&str> = PUBLISHED.iter().map(|row| row.stack).collect();
    assert_eq!(stacks, published);
    for (number, entry) in library.entries().iter().enumerate() {
        assert_eq!(entry.number, number);
    }
}

#[test]
fn lobes_agree_with_the_published_figures_within_rounding() {
    let library = Library::builtin();
    for row in &PUBLISHED {
        let stack: Stack = row.stack.parse().unwrap();
        let lobes = library.optics().lobes(&stack).unwrap();
        for c in 0..3 {
            let rounding = 5e-4 + 1e-3 * row.kd[c];
            assert!((lobes.kd[c] - row.kd[c]).abs() <= rounding, "{stack}: kd {:?} {:?}", lobes.kd, row.kd);
        }
        assert_eq!(lobes.lobes.len(), row.lobes.len(), "{stack}");
        for (lobe, (f0, alpha)) in lobes.lobes.iter().zip(row.lobes) {
            assert!((lobe.alpha - alpha).abs() <= 5e-4 + 1e-12, "{stack}: alpha {} {alpha}", lobe.alpha);
            for c in 0..3 {
                assert!(
                    (lobe.f0[c] - f0[c]).abs() <= 5e-3 + 1e-3 * f0[c],
                    "{stack}: F0 {:?} {f0:?}",
                    lobe.f0
                );
            }
        }
    }
}

#[test]
fn reflectance_agrees_with_the_published_figures_within_rounding() {
    let library = Library::builtin();
    for (row, entry) in PUBLISHED.iter().zip(library.entries()) {
        for (text, degrees) in row.green.iter().zip([0.0, 10.0, 30.0]) {
            let green = entry.curve.at(f64::to_radians(degrees))[1];
            let published: f64 = text.parse().unwrap();
            assert!(
                (green - published).abs() <= rounding(text),
                "{} at {degrees} degrees: {green} not {text}",
                row.stack
            );
        }
    }
}

/// Gloss of stacks without coloured metal. The published readings do not say how channels are weighted, nor how the
/// reflectance of a metal rises under a dark ink.
#[test]
fn gloss_agrees_with_the_published_readings() {
    let library = Library::builtin();
    for (stack, published) in [
        ("substrate", 2.0),
        ("C", 11.0),
        ("K", 9.0),
        ("P", 4.0),
        ("F", 31.0),
        ("MS", 19.0),
        ("SF", 246.0),
        ("MS+F", 43.0),
        ("SF+F", 226.0),
        ("P+SF", 328.0),
        ("P+MS", 23.0),
    ] {
        let reading = inks::gloss::units(&library.optics().lobes(&stack.parse().unwrap()).unwrap());
        assert!((reading - published).abs() < 0.6 + 0.03 * published, "{stack}: {reading} not {published}");
    }
}

/// R = ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) at 630, 532 and 465 nm, from measured n and k of evaporated aluminium.
#[test]
fn the_metal_is_aluminium() {
    let Some(data) = data() else { return };
    let text = std::fs::read_to_string(data.join("metals/Al_Rakic.yml")).unwrap();
    let rows: Vec<[f64; 3]> = text
        .lines()
        .filter_map(|line| {
            let numbers =
                line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>()?;
            numbers.try_into().ok()
        })
        .collect();
    assert!(rows.len() > 100);
    for (micrometres, figure) in
        [0.630, 0.532, 0.465].into_iter().zip(Library::builtin().optics().model.aluminium.get())
    {
        let above = rows.partition_point(|row| row[0] <= micrometres);
        let (a, b) = (rows[above - 1], rows[above]);
        let s = (micrometres - a[0]) / (b[0] - a[0]);
        let (n, k) = (a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]));
        let reflectance = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        assert!((figure / reflectance - 1.0).abs() < 0.01, "{micrometres}: {figure} {reflectance}");
    }
}

/// The flakes of the model peak at the height of a measured flake paint. Away from the peak the paint falls far faster,
/// which a comment in the library states.
#[test]
fn silver_flakes_peak_like_a_measured_silver_paint() {
    let Some(data) = data() else { return };
    let paint = read(&data.join("brdf/curves_colocated/merl_silver-metallic-paint.csv"));
    let library = Library::builtin();
    let flakes = &library.entries()[8];
    assert_eq!(flakes.stack.to_string(), "MS");
    for (paint, flakes) in paint.at(0.0).into_iter().zip(flakes.curve.at(0.0)) {
        assert!((0.7..1.4).contains(&(flakes / paint)), "{flakes} {paint}");
    }
}

/// Every real curve in the data, read as a measurement of a print. The only allowed error is that it creates light.
#[test]
fn real_measurements_are_read_and_judged_by_their_energy() {
    let Some(data) = data() else { return };
    let quadratures = inks::albedo::standard();
    let mut count = 0;
    for set in ["brdf/curves_avg", "brdf/curves_colocated"] {
        for file in std::fs::read_dir(data.join(set)).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "csv") {
                continue;
            }
            count += 1;
            let curve = read(&path);
            let most = quadratures.iter().flat_map(|q| q.of_curve(&curve)).fold(0.0, f64::max);
            let folder = tempfile::tempdir().unwrap();
            std::fs::copy(&path, folder.path().join("c.csv")).unwrap();
            let text = "format = 1\nbased_on = \"built-in\"\n[[measured]]\nstack = \"C\"\ncurve = \"c.csv\"\n\
                        by = \"x\"\nwhen = \"2010-01\"\nsetup = \"x\"\n";
            std::fs::write(folder.path().join("library.toml"), text).unwrap();
            assert_eq!(
                Library::open(&Disk, folder.path()).is_ok(),
                most <= 1.05,
                "{}: {most}",
                path.display()
            );
        }
    }
    assert!(count > 50, "{count}");
}

fn read(path: &Path) -> Curve {
    Curve::from_csv(std::fs::File::open(path).unwrap(), path).unwrap()
}
