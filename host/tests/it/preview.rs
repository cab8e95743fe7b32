//! `foilpress preview` as users of the program meet it.

use std::fs;

use serde_json::Value;
use testing::program::{Bench, small_document};

const SMALL: &str = "--size 12x8mm -q";

#[test]
fn a_document_becomes_a_page_a_picture_or_radiance() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.done(&format!("preview tile {SMALL} -o tile.html --json"));
    let report: Value = serde_json::from_str(&said).expect("JSON");
    let page = fs::read_to_string(bench.path("tile.html")).expect("a page");
    assert_eq!(report["bytes"], page.len());
    assert!(page.starts_with("<!doctype html>") && page.contains("show=document&with=printed"));
    assert!(page.contains("53 thousand dots"), "12 x 8 mm are 283 x 189 dots");

    // Twice the light is twice the radiance, and a darker exposure a darker picture.
    let red = |name: &str| {
        let picture = image::open(bench.path(name)).expect("a picture").into_rgba32f();
        picture.pixels().map(|p| f64::from(p.0[0])).sum::<f64>()
    };
    bench.done(&format!("preview tile {SMALL} -o one.exr --light 20,10 --pixels 120"));
    bench.done(&format!("preview tile {SMALL} -o two.exr --light 20,10 --light 20,10 --pixels 120"));
    assert!((red("two.exr") / red("one.exr") - 2.0).abs() < 1e-4);
    bench.done(&format!("preview tile {SMALL} -o bright.png --exposure 1 --show document --pixels 120"));
    bench.done(&format!(
        "preview tile {SMALL} -o dark.png --exposure -2 --show mapped --pixels 120 --curl 0.02"
    ));
    assert!(red("dark.png") < 0.8 * red("bright.png"));

    // Values below the old knee are kept by both curves; above it, cutting off is brighter.
    let lit = format!("preview tile {SMALL} --light 20,10 --pixels 120");
    bench.done(&format!("{lit} -o soft.png --exposure 1"));
    let said = bench.done(&format!("{lit} -o cut.png --exposure 1 --tone-curve 1 --json"));
    assert_eq!(serde_json::from_str::<Value>(&said).expect("JSON")["tone_curve"], 1.0);
    assert!(red("cut.png") > 1.05 * red("soft.png"));
    let said = bench.refused(2, &format!("{lit} -o cut.png --tone-curve 1.5"));
    assert!(said.contains("expected a share of white from 0 to 1"), "{said}");
    for option in ["--tone-curve 1", "--exposure 1"] {
        let said = bench.refused(1, &format!("{lit} -o one.exr {option}"));
        assert!(said.contains("leave --exposure and --tone-curve out"), "{said}");
    }
}

#[test]
fn dots_and_jobs_show_the_print_alone() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("print tile --size 12x8mm --paper postcard -q --to file:job.rgl");
    bench.done("preview job.rgl -q -o job.png --pixels 200");
    // The folder of a print has the document's name, and so has the job in it.
    for (job, name) in [("job.rgl", "job"), ("tile.print/job.rgl", "tile"), ("tile.print", "tile")] {
        bench.done(&format!("preview {job} -q -o page.html"));
        let page = fs::read_to_string(bench.path("page.html")).unwrap();
        assert!(page.contains(&format!("<title>{name}")), "{name}");
    }
    bench.done("simulate job.rgl -q -o printed.sheet");
    bench.done("preview printed.sheet -q -o sheet.png --pixels 200");
    assert_eq!(fs::read(bench.path("job.png")).unwrap(), fs::read(bench.path("sheet.png")).unwrap());
    let said = bench.refused(1, "preview job.rgl -q -o job.png --show document");
    assert!(said.contains("has printed dots and no document"), "{said}");
}

/// A job shows the whole sheet with every copy on it, all alike.
#[test]
fn a_job_with_copies_shows_them_all() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("print tile --size 12x8mm --repeat 2x1 --gap 4mm --paper postcard -q --to file:job.rgl");
    // Light and eye in front and far away: what a place reflects does not depend on where it is.
    bench.done("preview job.rgl -q -o job.exr --pixels 640 --distance far --light 0,0");
    let picture = image::open(bench.path("job.exr")).expect("a picture").into_rgba32f();
    let paper = picture.get_pixel(picture.width() / 2, picture.height() / 8).0[0];
    let printed = |left: u32, right: u32| {
        let inked = |&(x, _, p): &(u32, u32, &image::Rgba<f32>)| {
            (left..right).contains(&x) && p.0[3] == 1.0 && (p.0[0] / paper - 1.0).abs() > 0.05
        };
        picture.enumerate_pixels().filter(inked).count() as f64
    };
    let middle = picture.width() / 2;
    let (left, right) = (printed(0, middle), printed(middle, picture.width()));
    assert!(left > 500.0 && (left / right - 1.0).abs() < 0.1, "{left} and {right} pixels");
    let output = bench
        .command("preview tile --size 12x8mm --repeat 2x1 --paper postcard -o one.html")
        .output()
        .unwrap();
    assert!(
        testing::program::text(&output.stderr).contains("one copy of the document is shown"),
        "{output:?}"
    );
    // The gap between them is bare.
    assert!(printed(middle - 5, middle + 5) == 0.0);
}

/// The commands on the page replay its steps, whatever options the page was made with.
#[test]
fn the_page_names_the_commands_that_replay_its_edits() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    for (options, bases) in [
        ("", "--bases 12"),
        ("--intent basis", "-o"),
        (
            "--intent basis --bases 3 --factor kmeans --seed 7 --samples 40",
            "--samples 40 --bases 3 --factor kmeans --seed 7",
        ),
        ("--intent clamp --bases 2 --colour-space linear", "--colour-space linear --bases 2"),
    ] {
        bench.done(&format!("preview tile {SMALL} {options} -o tile.html"));
        let page = fs::read_to_string(bench.path("tile.html")).expect("a page");
        let (_, rest) = page.split_once("\"edits\":").expect("edits");
        let edits = serde_json::Deserializer::from_str(rest).into_iter::<Value>().next().unwrap().unwrap();
        let (fingerprint, replay) =
            (edits["fingerprint"].as_str().unwrap(), edits["replay"].as_str().unwrap());
        let text =
            format!("format = 1\nfingerprint = \"{fingerprint}\"\n\n[[step]]\nbasis = 1\nrougher = 2.0\n");
        fs::write(bench.path("steps.toml"), text).unwrap();
        let lines: Vec<&str> = replay.lines().collect();
        assert!(lines[0].starts_with(&format!("foilpress factor tile {bases}")), "{options}: {replay}");
        assert_eq!(lines[1..], ["foilpress edit tile.foil --steps steps.toml -o edited.foil"]);
        for line in lines {
            bench.done(line.strip_prefix("foilpress ").unwrap());
        }
        for folder in ["tile.foil", "edited.foil"] {
            fs::remove_dir_all(bench.path(folder)).unwrap();
        }
    }
}

/// Steps copied from the page of a factored document are for that document.
#[test]
fn the_page_names_the_document_whose_bases_it_edits() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("factor tile -q --bases 2 -o tile.foil");
    bench.done(&format!("preview tile.foil {SMALL} -o tile.html"));
    let page = fs::read_to_string(bench.path("tile.html")).expect("a page");
    let (_, rest) = page.split_once("\"fingerprint\":\"").expect("a fingerprint");
    let steps = |fingerprint: &str| {
        let text =
            format!("format = 1\nfingerprint = \"{fingerprint}\"\n\n[[step]]\nbasis = 1\nrougher = 2.0\n");
        fs::write(bench.path("steps.toml"), text).unwrap();
    };
    steps(&rest[..64]);
    bench.done("edit tile.foil --steps steps.toml -q -o edited.foil");
    steps(&"0".repeat(64));
    bench.refused(1, "edit tile.foil --steps steps.toml -q -o other.foil");
}

/// Wear acts on documents, jobs and sheets alike: the same seed makes the same picture, another seed another one.
#[test]
fn a_worn_printer_prints_other_dots_and_says_which() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("print tile --size 12x8mm --paper postcard -q --to file:job.rgl");
    let read = |name: &str| fs::read(bench.path(name)).unwrap();
    let worn = |name: &str, more: &str| {
        let exposure = if name.ends_with(".exr") { "" } else { "--exposure 0" };
        let said = bench.done(&format!("preview job.rgl -q -o {name} --pixels 200 {exposure} --json {more}"));
        serde_json::from_str::<Value>(&said).expect("JSON")["worn"].clone()
    };
    assert!(worn("new.png", "--registration-error 0mm").is_null());
    let first = worn("one.png", "--registration-error 0.1mm --missing-dots 5%");
    let share = first["changed_dots"].as_f64().unwrap() / first["planned_dots"].as_f64().unwrap();
    assert!((0.05..1.0).contains(&share), "{first}");
    assert!(first["passes"].as_array().unwrap().iter().any(|pass| pass["down_mm"] != 0.0), "{first}");
    worn("again.png", "--registration-error 0.1mm --missing-dots 5%");
    worn("two.png", "--registration-error 0.1mm --missing-dots 5% --wear-seed 2");
    assert_eq!(read("one.png"), read("again.png"));
    assert!(read("one.png") != read("new.png") && read("one.png") != read("two.png"));
    // Light in the paper darkens.
    worn("gain.exr", "--dot-gain 2");
    worn("plain.exr", "");
    let light = |name: &str| {
        let picture = image::open(bench.path(name)).expect("a picture").into_rgba32f();
        picture.pixels().map(|p| f64::from(p.0[0])).sum::<f64>()
    };
    assert!(light("gain.exr") < light("plain.exr"));

    let said = bench.done(&format!("preview tile {SMALL} -o tile.html --missing-dots 5%"));
    assert!(said.contains("dots whose stack is not as planned"), "{said}");
    assert!(fs::read_to_string(bench.path("tile.html")).unwrap().contains("on a worn printer"));
    for (args, expected) in [
        ("-o out.html --dot-gain 2", "a page cannot show it"),
        ("-o out.png --show document --missing-dots 1%", "act on printed dots"),
        ("-o out.png --show mapped --dot-gain 1.5", "act on printed dots"),
    ] {
        let said = bench.refused(1, &format!("preview tile {SMALL} {args}"));
        assert!(said.contains(expected), "{args}: {said}");
    }
}

/// The height of the window is that of the whole sheet by the zoom, and the place asked for is in its middle (`seen` in
/// geometry.js): a pixel of the zoomed picture lies on the sheet where the formula says, and nothing lies beside the sheet.
#[test]
fn a_zoomed_picture_shows_the_places_that_the_formula_says() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let lit = "preview tile --size 12x8mm -q --light 0,0 --distance far --exposure 0 --tone-curve 1";
    let (zoom, x, y) = (10.0, 3.0, 0.25);
    bench.done(&format!("{lit} -o near.png --pixels 300 --zoom {zoom} --middle {x}x{y}mm"));
    bench.done(&format!("{lit} -o whole.png --pixels 3000"));
    let [near, whole] =
        ["near.png", "whole.png"].map(|name| image::open(bench.path(name)).expect("a picture").into_rgb8());
    // The sheet is a whole number of dots.
    let [width, height] = [12.0, 8.0].map(|mm: f64| (mm * 600.0 / 25.4).round() * 25.4 / 600.0);
    // Millimetres of a pixel of a picture in the sheet's proportions: it shows 1.08 times the greater side.
    let tall = |w: u32, h: u32| 1.08 * height.max(width * f64::from(h) / f64::from(w)) / f64::from(h);
    let (small, large) = (tall(near.width(), near.height()) / zoom, tall(whole.width(), whole.height()));
    let (mut compared, mut off, mut levels) = (0, 0, std::collections::BTreeSet::new());
    for (px, py, found) in near.enumerate_pixels() {
        let from_middle = |p: u32, side: u32| f64::from(p) + 0.5 - 0.5 * f64::from(side);
        let (at_x, at_y) =
            (x + from_middle(px, near.width()) * small, y + from_middle(py, near.height()) * small);
        if at_y < -2.0 * small {
            assert_eq!(found, near.get_pixel(0, 0), "beside the sheet at {px}, {py}");
        } else if at_y > 2.0 * small {
            let on = |at: f64, side: f64, pixels: u32| {
                ((at - 0.5 * side) / large + 0.5 * f64::from(pixels)) as u32
            };
            let (ox, oy) = (on(at_x, width, whole.width()), on(at_y, height, whole.height()));
            let expected = whole.get_pixel(ox, oy).0;
            // The pixels of the two pictures do not lie on each other, so edges of dots differ.
            let near = (ox - 1..=ox + 1).flat_map(|i| (oy - 1..=oy + 1).map(move |j| (i, j)));
            let even = |p: [u8; 3]| (0..3).all(|c| p[c].abs_diff(expected[c]) < 3);
            if near.into_iter().all(|(i, j)| even(whole.get_pixel(i, j).0)) {
                compared += 1;
                off += u32::from(!even(found.0));
                levels.insert(found.0);
            }
        }
    }
    assert!(compared > 10_000 && levels.len() > 1, "{compared} places, {} colours", levels.len());
    assert!(off * 100 < compared, "{off} of {compared} places");

    bench.done(&format!("preview tile {SMALL} -o tile.html --zoom 10 --middle 3x4mm"));
    let page = fs::read_to_string(bench.path("tile.html")).unwrap();
    assert!(page.contains("&zoom=10&pan=-0.00"), "the page opens there");
    for (args, expected) in [
        ("-o out.png --middle 13x4mm", "is not on the sheet, which is 12.0 x 8.0 mm"),
        ("-o out.glb --zoom 2", "a .glb is the whole sheet"),
    ] {
        let said = bench.refused(1, &format!("preview tile {SMALL} {args}"));
        assert!(said.contains(expected), "{args}: {said}");
    }
}

/// From near by dots show, from farther away they do not, and the sheet keeps its brightness.
#[test]
fn an_eye_far_away_sees_no_dots() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let contrast = |name: &str, more: &str| {
        let said = bench.done(&format!(
            "preview tile {SMALL} -o {name} --pixels 256 --zoom 4 --light 0,0 --distance far --json {more}"
        ));
        let picture = image::open(bench.path(name)).expect("a picture").into_rgba32f();
        let values: Vec<f64> = picture.pixels().map(|p| f64::from(p.0[1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        let report: Value = serde_json::from_str(&said).expect("JSON");
        (mean, spread.sqrt() / mean, report["seen_from_mm"].clone())
    };
    let (mean, dots, told) = contrast("dots.exr", "");
    assert!(told.is_null());
    let mut last = dots;
    for (metres, more) in [(0.1, ""), (0.5, "--missing-dots 0.1%"), (5.0, "--dot-gain 1.0001")] {
        let (seen, spread, told) = contrast("seen.exr", &format!("--seen-from {metres}m {more}"));
        assert_eq!(told, 1000.0 * metres);
        assert!((seen / mean - 1.0).abs() < 0.1, "{metres} m: {seen}, not {mean}");
        assert!(spread < 0.9 * last, "{metres} m: {spread}, after {last}");
        last = spread;
    }
    for (args, expected) in [
        ("-o out.html --seen-from 0.5m", "a page shows dots as they are"),
        ("-o out.glb --seen-from 0.5m", "a .glb is the material"),
    ] {
        let said = bench.refused(1, &format!("preview tile {SMALL} {args}"));
        assert!(said.contains(expected), "{args}: {said}");
    }
}

/// A sky with a sun of a strength that no lamp has.
#[test]
fn a_real_sun_does_not_burn_the_picture_out() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let mut sky = image::Rgb32FImage::from_fn(512, 256, |_, y| {
        let v = 0.3 + 0.7 * (255 - y) as f32 / 255.0;
        image::Rgb([v; 3])
    });
    for (x, y) in [(255, 80), (256, 80), (255, 81), (256, 81)] {
        sky.put_pixel(x, y, image::Rgb([1e5; 3]));
    }
    sky.save(bench.path("sun.hdr")).unwrap();
    bench.done(&format!("preview tile {SMALL} -o sun.png --light-probe sun.hdr --pixels 120 --distance far"));
    let picture = image::open(bench.path("sun.png")).expect("a picture").into_rgb8();
    let white = picture.pixels().filter(|p| p.0.iter().all(|&v| v > 250)).count();
    let total = (picture.width() * picture.height()) as usize;
    assert!(white * 4 < total, "{white} of {total} pixels are white");
    let mut values: Vec<u8> = picture.pixels().map(|p| p.0[0].max(p.0[1]).max(p.0[2])).collect();
    values.sort_unstable();
    assert!((90..240).contains(&values[total / 2]), "the middle is {}", values[total / 2]);
}

/// A print written as glTF is a document like any other.
#[test]
fn a_print_as_gltf_is_read_as_a_document() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.done(&format!("preview tile {SMALL} -o tile.glb --pixels 64 --json"));
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["bytes"], fs::metadata(bench.path("tile.glb")).unwrap().len());
    assert!(report["distance"].as_f64().unwrap() <= report["worst"].as_f64().unwrap());
    bench.done("factor tile.glb -q --bases 2 -o again.foil");
}

#[test]
fn what_cannot_be_shown_is_refused_with_what_to_do_and_leaves_nothing() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let panorama = |exposure: &str| {
        let mut bytes = format!("#?RADIANCE\n{exposure}FORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n").into_bytes();
        bytes.extend([[128u8, 128, 128, 128]; 8].concat());
        bytes
    };
    fs::write(bench.path("good.hdr"), panorama("")).unwrap();
    fs::write(bench.path("nan.hdr"), panorama("EXPOSURE=NaN\n")).unwrap();
    fs::write(bench.path("negative.hdr"), panorama("EXPOSURE=-1\n")).unwrap();
    fs::write(bench.path("infinite.hdr"), panorama("EXPOSURE=inf\n")).unwrap();
    fs::write(bench.path("tiny.hdr"), panorama("EXPOSURE=1e-38\nEXPOSURE=1e-38\n")).unwrap();
    fs::write(bench.path("short.hdr"), &panorama("")[..60]).unwrap();
    bench.done(&format!("preview tile {SMALL} -o out.png --light-probe good.hdr --pixels 64"));
    fs::remove_file(bench.path("out.png")).unwrap();
    for (args, expected) in [
        ("-o out.png --view 120,0", "behind the sheet"),
        ("-o out.png --view 60,0 --tilt -60,0", "behind the sheet"),
        ("-o out.png --curl 0.001", "cannot be bent"),
        ("-o out.glb --light 10,20", "a .glb has no lights"),
        ("-o out.png --light-probe nan.hdr", "nan.hdr"),
        ("-o out.png --light-probe negative.hdr", "negative.hdr"),
        ("-o out.png --light-probe infinite.hdr", "infinite.hdr"),
        ("-o out.png --light-probe tiny.hdr", "tiny.hdr"),
        ("-o out.png --light-probe short.hdr", "short.hdr"),
        ("-o out.png --light-probe missing.hdr", "missing.hdr"),
        ("-o out.png --light 0,0 --light 0,0 --light 0,0 --light 0,0 --light 0,0", "at most four lights"),
        ("-o nowhere/out.png", "there is no folder nowhere"),
    ] {
        let said = bench.refused(1, &format!("preview tile {SMALL} {args}"));
        assert!(said.contains(expected), "{args}: {said}");
        assert!(!bench.path("out.png").exists(), "{args}");
    }
}

#[test]
fn figures_of_the_paper_are_pictures_of_any_document() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let size = |name: &str| image::image_dimensions(bench.path(name)).expect("a picture");
    bench.done(&format!("preview tile {SMALL} --bases 2 --figure weights -o weights.png"));
    // Two balls of 160 pixels in a row, each above its map.
    assert_eq!(size("weights.png").0, 16 + 2 * 176);
    bench.done(&format!("preview tile {SMALL} --bases 2 --figure balls -o balls.png"));
    assert_eq!(size("balls.png").0, 16 + 4 * 176);
    bench.done(&format!("preview tile {SMALL} --figure lights -o lights.png"));
    // Each at most 300 pixels wide, and of whole dots.
    let step = (size("lights.png").0 - 16) / 6;
    assert!(size("lights.png").0 == 16 + 6 * step && (200..=316).contains(&step), "{step}");
    // The lower the lamp, the less light: left to right the row becomes darker.
    let picture = image::open(bench.path("lights.png")).expect("a picture").into_rgb8();
    let light = |column: u32| -> u64 {
        let xs = 16 + column * step..column * step + step;
        xs.flat_map(|x| (80..200).map(move |y| (x, y)))
            .map(|(x, y)| u64::from(picture.get_pixel(x, y).0[1]))
            .sum()
    };
    assert!(light(2) > light(4) && light(4) > light(5), "{} {} {}", light(2), light(4), light(5));
    // The sheet fills the picture with 640 pixels; a row of the board has ten squares.
    bench.done(&format!("preview tile {SMALL} --figure near -o near.png"));
    let picture = image::open(bench.path("near.png")).expect("a picture").into_rgb8();
    assert_eq!(picture.width(), 2 * 16 + 640);
    let is_white = |i: u32| picture.get_pixel(16 + 32 + 64 * i, 100).0[1] > 150;
    assert!((0..9).all(|i| is_white(i) != is_white(i + 1)));
    // The ramp of the paper: foil mirrors the squares, metallic ink hardly.
    bench.done("chart ramp silver-foil metallic-silver -q -o ramp --figure ramp.png");
    let picture = image::open(bench.path("ramp.png")).expect("a picture").into_rgb8();
    let y = picture.height() - 16 - 36;
    let spread = |from: u32| {
        let light = |x: u32| (y..y + 8).map(|y| f64::from(picture.get_pixel(x, y).0[1])).sum::<f64>();
        let all: Vec<f64> = (from..from + 100).map(light).collect();
        let (low, high) = all.iter().fold((f64::MAX, 0.0f64), |(low, high), &v| (low.min(v), high.max(v)));
        high / low
    };
    assert!(spread(80) > 1.3 * spread(450), "{} {}", spread(80), spread(450));
    let drawn = format!("preview tile {SMALL} --figure lights -o lights.html");
    for args in [&drawn, "chart ramp silver-foil metallic-silver -o other --figure ramp.jpg"] {
        let refused = bench.run(args);
        assert!(
            !refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("name a .png")
        );
    }
    assert!(!bench.path("other").exists());
}
