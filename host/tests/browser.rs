//! The display's page, the report and the sheet's page of a print, and a comparison, in a real browser.

#[path = "compare/camera.rs"]
#[expect(dead_code, reason = "tests of the figures need more of it")]
mod camera;
#[path = "compare/scenery.rs"]
mod scenery;

use camera::SHOTS;
use image::{Rgb, RgbImage};
use testing::browser::Browser;
use testing::program::{Bench, small_document};

#[test]
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
    browser.test("pages.test.mjs", "display|report|sheet", &bench.path("."));
}

#[test]
fn a_comparison_works_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let bench = Bench::new();
    scenery::photographed(&bench, &[SHOTS[0], SHOTS[2]]);
    bench.done(&format!("compare photos {} --job job.rgl --camera camera.toml", scenery::PRINT));
    browser.test("pages.test.mjs", "comparison", &bench.path("."));
}
