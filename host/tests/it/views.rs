//! Two pictures in one print, and two exposures of one, as a user asks for them.

use std::fs;

use serde_json::Value;
use testing::program::{Bench, text};

/// A picture of 18 x 12 grey pixels.
fn grey(path: &std::path::Path, value: impl Fn(u32, u32) -> u8) {
    image::GrayImage::from_fn(18, 12, |x, y| image::Luma([value(x, y)])).save(path).expect("a picture");
}

/// A Radiance picture of 18 x 12 pixels: a room, and a window with a ramp of light so many times as bright.
fn room(path: &std::path::Path, brighter: f32) {
    let value = |x: u32, y: u32| {
        let wall = 0.1 + 0.05 * f32::from(u8::from(y > 6));
        if x < 9 { wall } else { wall.max(brighter * (x - 8) as f32 / 9.0) }
    };
    let picture = image::Rgb32FImage::from_fn(18, 12, |x, y| image::Rgb([value(x, y); 3]));
    picture.save(path).expect("a picture");
}

fn views(bench: &Bench, folder: &str) -> [[f64; 2]; 2] {
    let report = fs::read_to_string(bench.path(folder).join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    ["straight", "reflection"]
        .map(|view| [0, 1].map(|picture| report["views"][view][picture].as_f64().expect("a contrast")))
}

#[test]
fn the_report_says_how_well_each_picture_is_seen_in_each_view() {
    let bench = Bench::new();
    grey(&bench.path("a.png"), |x, _| if x / 3 % 2 == 0 { 240 } else { 20 });
    grey(&bench.path("b.png"), |_, y| if y < 6 { 255 } else { 0 });
    let output = bench.run("print --straight a.png --highlight b.png --size 27mm --paper postcard -q -o out");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("straight on (lamp at 45°) a.png has a contrast of"), "{said}");
    let [straight, reflection] = views(&bench, "out");
    assert!(straight[0] > 0.5 && straight[1].abs() < 0.05, "{straight:?}");
    assert!(reflection[1] > 0.25 && reflection[0].abs() < 0.05, "{reflection:?}");
    let page = fs::read_to_string(bench.path("out/report.html")).expect("a page");
    assert!(page.contains("Two pictures: straight on"), "the page says it");
    // What is drawn and what is seen in the page can be made again from the two pictures.
    let html = bench.run("preview --straight a.png --highlight b.png --size 27mm -o two.html");
    assert!(html.status.success(), "{}", text(&html.stderr));
    let page = fs::read_to_string(bench.path("two.html")).expect("a page");
    assert!(page.contains("foilpress factor --straight a.png --highlight b.png"), "the commands are there");
}

#[test]
fn an_hdr_picture_is_printed_in_two_exposures() {
    let bench = Bench::new();
    room(&bench.path("room.hdr"), 8.0);
    let output = bench.run("print --hdr room.hdr --inks all --size 27mm --paper postcard -q -o out");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("stops shorter"), "{said}");
    let [straight, reflection] = views(&bench, "out");
    assert!(straight[0] > 0.4 && straight[1].abs() < 0.1, "{straight:?}");
    assert!(reflection[1] > 0.4 && reflection[0].abs() < 0.1, "{reflection:?}");
    // A picture within white has no second exposure, and one of whole numbers never.
    room(&bench.path("dim.hdr"), 0.2);
    grey(&bench.path("a.png"), |x, _| (10 * x) as u8);
    for (name, words) in [("dim.hdr", "stops above"), ("a.png", "whole numbers"), ("none.hdr", "cannot")] {
        let output = bench.run(&format!("plan --hdr {name}"));
        assert!(!output.status.success() && text(&output.stderr).contains(words), "{}", text(&output.stderr));
    }
}

#[test]
fn pictures_that_cannot_share_a_print_are_refused() {
    let bench = Bench::new();
    grey(&bench.path("a.png"), |x, _| (10 * x) as u8);
    image::GrayImage::from_fn(12, 12, |x, _| image::Luma([(20 * x) as u8]))
        .save(bench.path("b.png"))
        .unwrap();
    for (options, words) in [
        ("--straight a.png --highlight b.png", "same proportions; crop one"),
        ("--straight a.png --highlight a.png --inks process", "allow more inks"),
        ("--straight a.png", "--highlight <PICTURE>"),
        ("sample:leaf --hdr a.png", "cannot be used with"),
    ] {
        let output = bench.run(&format!("plan {options}"));
        let said = text(&output.stderr);
        assert!(!output.status.success() && said.contains(words), "{options}: {said}");
    }
}
