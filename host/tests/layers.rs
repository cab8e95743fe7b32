//! Spot-colour art as its owner meets it: pictures in, a job that parses strictly and prints what was drawn out.

use std::fs;

use image::{GrayImage, Luma};

mod common;

use common::{Bench, entries};

/// A layer of 60 x 40 pixels with ink in a rectangle, at 600 dpi.
fn layer(bench: &Bench, name: &str, x: std::ops::Range<u32>, y: std::ops::Range<u32>) {
    let picture =
        GrayImage::from_fn(60, 40, |u, v| Luma([if x.contains(&u) && y.contains(&v) { 0 } else { 255 }]));
    let file = fs::File::create(bench.path(name)).expect("a file");
    let mut encoder = png::Encoder::new(file, 60, 40);
    encoder.set_color(png::ColorType::Grayscale);
    let unit = png::Unit::Meter;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: 23_622, yppu: 23_622, unit }));
    encoder.write_header().expect("a header").write_image_data(&picture).expect("pixels");
}

fn inspected(bench: &Bench, job: &str) -> Vec<(String, u64)> {
    let summary = bench.done(&format!("inspect {job} --json"));
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let pass = |pass: &serde_json::Value| {
        (pass["ink"].as_str().expect("an ink").to_owned(), pass["dots"].as_u64().expect("dots"))
    };
    summary["passes"].as_array().expect("passes").iter().map(pass).collect()
}

#[test]
fn three_pictures_become_a_job_of_their_inks() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    layer(&bench, "gold.png", 10..20, 10..30);
    layer(&bench, "black.png", 30..50, 10..30);
    let plan = bench.done("layers white.png gold.png black.png --paper postcard -o decal.print");
    for word in ["white", "metallic-gold", "black", "1 500", "--accept white-thrice"] {
        assert!(plan.contains(word), "{word} in:\n{plan}");
    }
    let made = entries(&bench.path("decal.print"));
    for file in ["job.rgl", "report.json", "preview.png", "preview-02-metallic-gold.png", "passes"] {
        assert!(made.iter().any(|name| name == file), "{file} in {made:?}");
    }
    let dots = |ink: &str, dots| (ink.to_owned(), dots);
    let wanted = [dots("white", 1500), dots("metallic-gold", 200), dots("black", 400)];
    assert_eq!(inspected(&bench, "decal.print/job.rgl"), wanted);
}

#[test]
fn white_choke_passes_and_finish_are_in_the_job() {
    let bench = Bench::new();
    layer(&bench, "black.png", 10..50, 10..30);
    // 0.0847 mm are two dots.
    bench.done(
        "layers black.png --white under --choke 0.0847mm --passes white=3 --finish all --paper postcard -o d.print",
    );
    let white = ("white".to_owned(), 36 * 16);
    let (black, finish) = (("black".to_owned(), 800), ("finish".to_owned(), 2400));
    assert_eq!(inspected(&bench, "d.print/job.rgl"), [white.clone(), white.clone(), white, black, finish]);
}

#[test]
fn what_is_wrong_is_said_and_nothing_is_left() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    layer(&bench, "golld.png", 5..55, 5..35);
    layer(&bench, "blank.png", 0..0, 0..0);
    layer(&bench, "silver-foil.png", 5..55, 5..35);
    let before = bench.entries();
    for (code, args, words) in [
        (1, "layers white.png golld.png", "did you mean `gold`?"),
        (1, "layers blank.png", "nothing to print"),
        (1, "layers silver-foil.png", "--inks +silver-foil"),
        (1, "layers white.png --size 900mm", "the largest page prints"),
        (1, "layers white.png --white alpha", "has no transparency"),
        (1, "layers white.png --inks yelow", "did you mean `yellow`?"),
        (2, "layers white.png --passes white=0", "1 to 9"),
        (2, "layers white.png --choke 3", "length"),
        (2, "layers white.png --order white,blak", "did you mean `black`?"),
        (2, "layers", "ART"),
    ] {
        let said = bench.refused(code, args);
        assert!(said.contains(words), "{args}: {words} in {said}");
    }
    assert_eq!(bench.entries(), before);
}
