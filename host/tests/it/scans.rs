//! Scans of charts by the program, as its users do: dots of an ink into a library, a printer's profile, and nothing half-written.
//!
//! The scans here are the sheet itself in thirds of its resolution; how exact readings are is shown in the crate's own tests.

use std::fs;
use std::path::Path;

use image::{GrayImage, Luma};
use sheet::Sheet;
use testing::program::{Bench, text};

/// The sheet of A4 at 200 dpi with black around it: paper, ink at its dots, `moved` by so many pixels.
fn scan(sheet: &Path, moved: (usize, usize), to: &Path) {
    let sheet = Sheet::load(sheet).unwrap();
    let (around, left, top) = (40, 80 / 3, usize::from(sheet.paper().top()) / 3);
    let (wide, long) = (1654, 2339);
    let mut picture = GrayImage::from_pixel(wide + 2 * around, long + 2 * around, Luma([6]));
    for y in 0..long as usize {
        for x in 0..wide as usize {
            let at = |at: usize, start: usize| (at.wrapping_sub(start)).wrapping_mul(3);
            let (column, row) = (at(x, left + moved.0), at(y, top + moved.1));
            let mut ink = 0.0;
            if column < sheet.width() - 2 && row < sheet.length() - 2 {
                let dots = (0..9).map(|k| sheet.index()[(row + k / 3) * sheet.width() + column + k % 3]);
                ink = dots.filter(|dot| !sheet.stacks()[usize::from(*dot)].layers().is_empty()).count()
                    as f64
                    / 9.0;
            }
            let light: f64 = 0.8 * (1.0 - ink) + 0.05 * ink;
            let value = (255.0 * (1.055 * light.powf(1.0 / 2.4) - 0.055)).round() as u8;
            picture.put_pixel(x as u32 + around, y as u32 + around, Luma([value]));
        }
    }
    picture.save(to).unwrap();
}

#[test]
fn a_ramp_tells_a_library_how_small_clusters_may_be() {
    let bench = Bench::new();
    bench.done("chart ramp K substrate -q -o chart --to file:k.rgl");
    fs::create_dir(bench.path("sheets")).unwrap();
    bench.done("simulate k.rgl -q -o sheets/k");
    scan(&bench.path("sheets/k"), (0, 0), &bench.path("k.png"));
    let measured = |more: &str| {
        let output = bench
            .command(&format!("measure ramp k.png --chart sheets/k --when 2026-11-02 -o mine {more}"))
            .args(["--by", "A. Owner"])
            .output()
            .unwrap();
        (output.status.success(), text(&output.stdout), text(&output.stderr))
    };
    let (done, said, error) = measured("--note flatbed");
    assert!(done && said.contains("inks check mine"), "{said}{error}");
    assert!(said.contains("K in substrate") && said.contains("linear but for dot gain"), "{said}");
    let library = fs::read_to_string(bench.path("mine/library.toml")).unwrap();
    for part in [
        "[[dots]]",
        "ink = \"black\"",
        "ink = \"paper\"",
        "minimum_cluster = 1",
        "dot_gain_um = ",
        "flatbed; ramp chart",
    ] {
        assert!(library.contains(part), "{part}: {library}");
    }
    assert!(bench.done("inks check mine").contains("0 errors, 0 warnings"));
    let shown = bench.done("inks show K --library mine");
    assert!(
        shown.contains("minimum cluster 1 dot\n") && shown.contains("dots measured by A. Owner, 2026-11-02"),
        "{shown}"
    );
    // What was measured is not replaced unasked, and the library stays as it was.
    let (done, _, error) = measured("");
    assert!(!done && error.contains("has measured dots of black already"), "{error}");
    assert_eq!(fs::read_to_string(bench.path("mine/library.toml")).unwrap(), library);
    // Stacks print with it.
    let listed: serde_json::Value =
        serde_json::from_str(&bench.done("inks list --library mine --json")).unwrap();
    let black = listed.as_array().unwrap().iter().find(|row| row["stack"] == "K").unwrap();
    assert_eq!(black["minimum_cluster"], 1);
}

#[test]
fn a_registration_chart_gives_a_profile() {
    let bench = Bench::new();
    bench.done("chart registration --inks black,cyan -q -o chart --to file:r.rgl");
    bench.done("simulate r.rgl -q -o sheet");
    scan(&bench.path("sheet"), (2, 5), &bench.path("r.png"));
    assert!(
        bench
            .refused(1, "measure registration r.png --chart r.rgl")
            .contains("does not state its resolution")
    );
    let said = bench.done("measure registration r.png --chart r.rgl --dpi 200 --profile scanned");
    assert!(said.contains("scanned"), "{said}");
    let listed: serde_json::Value = serde_json::from_str(&bench.done("profile list --json")).unwrap();
    let offset = |c: usize| listed[0]["offset_mm"][c].as_f64().unwrap();
    // Thirds of dots are cut off: 80 and 284 dots are no whole pixels.
    let pixel = 25.4 / 200.0;
    assert!((offset(0) - 2.0 * pixel + 2.0 / 600.0 * 25.4).abs() < 0.03, "{listed}");
    assert!((offset(1) - 5.0 * pixel + 2.0 / 600.0 * 25.4).abs() < 0.03, "{listed}");
    assert!((listed[0]["feed"].as_f64().unwrap() - 1.0).abs() < 2e-4, "{listed}");
    // A profile that no printer has is refused; the one that is there stays.
    let other = bench.refused(1, "measure registration r.png --chart r.rgl --dpi 300 --profile scanned");
    assert!(other.contains("as large as at 200 dpi"), "{other}");
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&bench.done("profile list --json")).unwrap(),
        listed
    );
}
