//! Every other kind of page in a real browser: report, plan and sheet of a print, display, comparison, measurement and libraries.

use crate::compare::camera::SHOTS;
use crate::compare::scenery;
use image::{Rgb, RgbImage};
use std::fs;

use testing::browser::Browser;
use testing::needs;
use testing::program::{Bench, small_document};

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn pages_work_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let bench = Bench::new();
    for (name, bar) in [("one.png", 1), ("two.png", 3)] {
        let colour = |x, _| if x / 4 == bar { Rgb([240, 240, 235]) } else { Rgb([60, 20, 20]) };
        RgbImage::from_fn(24, 16, colour).save(bench.path(name)).expect("a picture");
    }
    bench.done(
        "display one.png two.png --pitch 0.28mm --mask-size 320x240 --paper postcard -q -o wall --stacks W,K",
    );
    small_document(&bench.path("tile"));
    bench.done("print tile --size 12x8mm --paper postcard -q -o print");
    browser.test("pages.test.mjs", "display|report|sheet|plan", &bench.path("."));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn pages_of_inks_work_in_a_browser() {
    let (Some(browser), Some(data)) = (Browser::find(), needs::data()) else { return };
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::create_dir(bench.path("photos")).expect("a folder");
    let mut setup = "format = 1\nby = \"A. <Owner>\"\nwhen = \"2026-11-02\"\ngeometry = \"known\"\n[camera]\nposition_mm = [0, 0, 1200]\n\
        field_of_view_deg = 14.0\n[[light]]\nposition_mm = [350, 100, 900]\n[sample]\nshape = \"cylinder\"\nradius_mm = 50\n\
        height_mm = 120\nstack = \"MS\"\n[exposures]\n"
        .to_owned();
    for (i, seconds) in ["0.00025", "0.001", "0.004", "0.016667", "0.066667", "0.25"].iter().enumerate() {
        let name = format!("exp_{i}.png");
        let from = data.join("photos/alum_bronze_cylinder").join(&name);
        fs::copy(from, bench.path("photos").join(&name)).expect("a photograph");
        setup += &format!("\"{name}\" = {seconds}\n");
    }
    fs::write(bench.path("can.toml"), setup).expect("a setup");
    bench.done("measure photos --setup can.toml -q -o mine");
    bench.done("measure report mine");
    bench.done("inks diff builtin mine -o diff.html");
    bench.done("inks gamut mine --document tile -q -o gamut.html");
    browser.test("pages.test.mjs", "measurement|libraries|gamut", &bench.path("."));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_comparison_works_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let bench = Bench::new();
    scenery::photographed(&bench, &[SHOTS[0], SHOTS[2]]);
    bench.done(&format!("compare photos {} --job job.rgl --camera camera.toml", scenery::PRINT));
    browser.test("pages.test.mjs", "comparison", &bench.path("."));
}
