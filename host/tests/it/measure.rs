//! Measuring photographs by the program, as its users do: a library, a page, and nothing half-written.

use std::fs;
use std::path::Path;

use testing::needs;
use testing::program::{Bench, text};

/// The setup of the rendered photographs in the folder of published data, with exposures by name.
fn setup(bench: &Bench, more: &str) {
    let times = ["0.00025", "0.001", "0.004", "0.016667", "0.066667", "0.25"];
    let exposures: String =
        times.iter().enumerate().map(|(i, t)| format!("\"exp_{i}.png\" = {t}\n")).collect();
    let text = format!(
        "format = 1\nby = \"A. <Owner>\"\nwhen = \"2026-11-02\"\nnote = \"an artificial can\"\n{more}\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = 14.0\n[[light]]\nposition_mm = [350, 100, 900]\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = 50\nheight_mm = 120\nstack = \"MG+C+F\"\n[exposures]\n{exposures}"
    );
    fs::write(bench.path("can.toml"), text).unwrap();
}

fn photographs(bench: &Bench, data: &Path) {
    fs::create_dir(bench.path("photos")).unwrap();
    for i in 0..6 {
        let name = format!("exp_{i}.png");
        fs::copy(data.join("photos/alum_bronze_cylinder").join(&name), bench.path("photos").join(name))
            .unwrap();
    }
}

#[test]
fn photographs_become_a_library_and_a_page() {
    let Some(data) = needs::data() else { return };
    let bench = Bench::new();
    photographs(&bench, &data);
    setup(&bench, "geometry = \"known\"");
    let said = bench.done("measure photos --setup can.toml -o mine");
    assert!(said.contains("MG+C+F") && said.contains("measure report mine"), "{said}");
    let checked = bench.done("inks check mine");
    assert!(checked.contains("0 errors, 0 warnings"), "{checked}");
    let shown = bench.done("inks show MG+C+F --library mine");
    assert!(
        shown.contains("measured by A. <Owner>, 2026-11-02") && shown.contains("an artificial can"),
        "{shown}"
    );
    let curve = fs::read_to_string(bench.path("mine/mg-c-f.csv")).unwrap();
    assert!(curve.starts_with("theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma,pixels,kind"), "{curve}");
    bench.done("measure report mine");
    let page = fs::read_to_string(bench.path("mine/report.html")).unwrap();
    for part in
        ["A. &lt;Owner&gt;", "<svg", "data:image/png;base64,", "exp_0.png", "radius of the can", "MG+C+F"]
    {
        assert!(page.contains(part), "{part}");
    }
    assert!(
        !page.contains("http://")
            || page.matches("http://").count() == page.matches("http://www.w3.org").count()
    );
    // A second run replaces the folder, with the page in it.
    bench.done("measure photos --setup can.toml -o mine");
    assert!(!bench.path("mine/report.html").exists() && bench.path("mine/measurement.json").exists());
    // Not one to which something was added since.
    let library = fs::read_to_string(bench.path("mine/library.toml")).unwrap();
    let dots = "\n[[dots]]\nink = \"black\"\nminimum_cluster = 9\nby = \"A. Owner\"\nwhen = \"2026-11\"\nsetup = \"a scanner\"\n";
    fs::write(bench.path("mine/library.toml"), format!("{library}{dots}")).unwrap();
    assert!(bench.refused(1, "measure photos --setup can.toml -o mine").contains("holds the dots of black"));
    assert!(bench.path("mine/mg-c-f.csv").exists());
}

#[test]
fn a_failure_names_its_cause_and_leaves_nothing() {
    let bench = Bench::new();
    fs::create_dir(bench.path("photos")).unwrap();
    setup(&bench, "");
    let fails = |words: &[&str]| {
        let output = bench.command("measure photos --setup can.toml -o mine").output().unwrap();
        let said = text(&output.stderr);
        assert!(!output.status.success() && words.iter().all(|word| said.contains(word)), "{said}");
        let left: Vec<_> = fs::read_dir(bench.path("")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left.len(), 2, "{left:?}");
    };
    fails(&["photos: no photographs"]);
    image::RgbImage::from_pixel(64, 48, image::Rgb([90; 3])).save(bench.path("photos/a.png")).unwrap();
    fails(&["a.png: has no exposure time", "[exposures]"]);
    setup(&bench, "colour = 3");
    fails(&["can.toml", "colour"]);
    fs::create_dir(bench.path("empty")).unwrap();
    let output = bench.command("measure report empty").output().unwrap();
    assert!(
        !output.status.success() && text(&output.stderr).contains("measurement.json"),
        "{}",
        text(&output.stderr)
    );
}
