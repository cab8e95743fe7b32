//! `foilpress display` as users of the program meet it.

use std::fs;

use image::{Rgb, RgbImage};
use serde_json::Value;
use testing::program::{Bench, small_document};

const SCREEN: &str = "--pitch 0.28mm --mask-size 320x240 --paper postcard -q";

/// A picture of two colours, a bar further right for each number.
fn picture(bench: &Bench, name: &str, (width, height): (u32, u32), bar: u32) {
    let colour = |x, _| if x / 4 == bar { Rgb([240, 240, 235]) } else { Rgb([60, 20, 20]) };
    RgbImage::from_fn(width, height, colour).save(bench.path(name)).expect("a picture");
}

#[test]
fn images_become_a_grid_masks_and_a_page() {
    let bench = Bench::new();
    picture(&bench, "one.png", (24, 16), 1);
    picture(&bench, "two.png", (24, 16), 3);
    let said = bench.done(&format!("display one.png two.png {SCREEN} -o wall --stacks W,K --json"));
    let report: Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(report["display"]["frames"].as_array().map(Vec::len), Some(3));
    let (left, top) = (report["display"]["origin"][0].as_u64(), report["display"]["origin"][1].as_u64());
    assert_eq!((left, top), (Some((320 - 68) / 2), Some((240 - 52) / 2)));
    // The grid is an ordinary job: 68 x 52 cells of 0.28 mm.
    let plan: Value = serde_json::from_str(&bench.done("plan wall/job.rgl --json")).expect("JSON");
    assert_eq!(plan["passes"].as_array().map(Vec::len), Some(2));
    assert!(bench.done("inspect wall/job.rgl -q").contains("white"));
    // Masks: as large as the screen, and white cells open where the bar is. Cell (0, 0) of the grid is white.
    let mask = image::open(bench.path("wall/mask-001.png")).expect("a mask").into_luma8();
    assert_eq!(mask.dimensions(), (320, 240));
    let cell = |x: u32, y: u32| mask.get_pixel(126 + 10 + x, 94 + 10 + y).0[0];
    assert!(cell(2 * 5, 0) > 200, "{}", cell(10, 0));
    assert!(cell(0, 0) < 120, "{}", cell(0, 0));
    assert_eq!(mask.get_pixel(0, 0).0[0], 0);
    // What is seen: the bar is bright, and further right in the second frame.
    let bright = |name: &str, x: u32| {
        let seen = image::open(bench.path(name)).expect("a picture").into_rgb8();
        let zoom = 480u32.div_ceil(24);
        seen.get_pixel(x * zoom + zoom / 2, seen.height() / 2).0[0]
    };
    assert!(bright("wall/seen-001.png", 5) > 2 * bright("wall/seen-001.png", 13));
    assert!(bright("wall/seen-002.png", 13) > 2 * bright("wall/seen-002.png", 5));
    let page = fs::read_to_string(bench.path("wall/display.html")).expect("a page");
    assert!(page.starts_with("<!doctype html>") && page.contains("\"alignment\""));
    // Its own folder is replaced; a pixel beside its place changes what is seen and not what is shown.
    bench.done(&format!(
        "display one.png two.png {SCREEN} -o wall --stacks W,K --shift 0.28,0mm --depth 0.2mm"
    ));
    let moved = image::open(bench.path("wall/mask-001.png")).expect("a mask").into_luma8();
    assert_eq!(moved, mask);
    assert!(bright("wall/seen-001.png", 5) < 150, "black cells are exposed instead of white ones");
}

#[test]
fn documents_are_shown_by_stacks_that_are_chosen_for_them() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.done(&format!("display tile --pixels 12 {SCREEN} --json"));
    let report: Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(report["display"]["stacks"].as_array().map(Vec::len), Some(4));
    assert!(report["display"]["frames"][0]["mean"].as_f64().is_some_and(|d| d < 0.1), "{report}");
    assert!(bench.path("tile-display.print/display.html").is_file());
}

/// The bar of the larger picture is where that of the smaller one is.
#[test]
fn pictures_of_two_sizes_are_shown_at_that_of_the_smaller() {
    let bench = Bench::new();
    picture(&bench, "small.png", (24, 16), 1);
    let large = image::open(bench.path("small.png")).unwrap().resize_exact(
        72,
        48,
        image::imageops::FilterType::Nearest,
    );
    large.save(bench.path("large.png")).unwrap();
    bench.done(&format!("display large.png small.png {SCREEN} -o wall --stacks W,K"));
    let mask = |name: &str| image::open(bench.path(name)).expect("a mask").into_luma8();
    assert_eq!(mask("wall/mask-001.png"), mask("wall/mask-002.png"));
}

#[test]
fn what_cannot_be_shown_is_refused_and_nothing_is_written() {
    let bench = Bench::new();
    picture(&bench, "one.png", (24, 16), 1);
    picture(&bench, "other.png", (20, 16), 1);
    picture(&bench, "huge.png", (5000, 4000), 1);
    fs::write(bench.path("text.png"), "no picture").unwrap();
    for (args, words) in [
        ("one.png other.png", ["one.png: 24 x 16 pixels, but other.png has 20 x 16", "same proportions"]),
        ("huge.png", ["10020 x 8020 pixels of the screen", "--pixels"]),
        ("text.png", ["text.png: expected a PNG, JPEG or TIFF", ""]),
        ("missing.png", ["missing.png", ""]),
        ("one.png --pixels 30", ["--pixels 30", "give at most 24"]),
        (
            "one.png --shift 100,100mm",
            ["--shift 100,100mm: the screen lies beside the print", "shift it by less"],
        ),
        ("one.png --stacks MS", ["1 in the grid", "2 to 9"]),
        ("one.png --stacks MS,MS", ["MS is given twice", ""]),
        ("one.png --stacks MS,K --pitch 0.1mm", ["MS needs 16 dots", "--cell 2"]),
        ("one.png --pitch 0.01mm", ["dots to hold", "--cell"]),
        ("one.png --pitch 9mm --cell 1", ["does not fit on the sheet", "none at all"]),
        ("one.png --mask-size 40x300", ["the screen has 40 x 300", "at most 10 x 6"]),
        ("one.png --depth=-1mm", ["0 or more", ""]),
        ("one.png --pitch 0mm", ["the pitch must be above 0", ""]),
    ] {
        let said = bench.refused(1, &format!("display {SCREEN} -o wall {args}"));
        assert!(words.iter().all(|words| said.contains(words)), "{args}: {said}");
        assert!(!bench.path("wall").exists(), "{args}: half-written");
    }
    for args in [
        "",
        "one.png --transmission 0.1,0.2",
        "one.png --transmission nan,0",
        "one.png --mask-size 0x9",
        "one.png --cell 0",
    ] {
        bench.refused(2, &format!("display {SCREEN} -o wall {args}"));
    }
}
