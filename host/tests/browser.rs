//! The display's page and the report in a real browser. `cargo xtask preview` brings the browser and names it, as for the
//! preview's page.

use std::process::Command;

use image::{Rgb, RgbImage};
use testing::needs::{self, Need};
use testing::program::{Bench, small_document};

#[test]
fn display_and_report_work_in_a_browser() {
    let Some(_) = needs::path(Need::Browser, "FOILPRESS_CHROMIUM") else { return };
    let Some(node) = needs::path(Need::Browser, "FOILPRESS_NODE") else { return };
    let Some(scripts) = needs::path(Need::Browser, "FOILPRESS_BROWSER") else { return };
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
    let mut run = Command::new(node);
    run.args(["--test", "--test-reporter=spec", "--test-concurrency=1", "pages.test.mjs"]);
    let status = run.current_dir(scripts).env("FOILPRESS_PAGE", bench.path(".")).status().expect("node runs");
    assert!(status.success(), "{status}");
}
