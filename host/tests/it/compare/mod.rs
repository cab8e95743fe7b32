//! Photographs of a print beside its prediction, by the program, as its users do.
//!
//! The photographs are made here ([`camera`]), and what is said of them is held against figures over all dots ([`truth`]). Exposure,
//! white balance, lens and poses are not told to the program.

pub mod camera;
pub mod scenery;
mod truth;

use std::fs;
use std::path::Path;

use camera::{
    BRIGHTER, FOCAL, Picture, RADIAL, RIGHT, SHOTS, Sheet, Shot, V, dot, minus, out_of_focus, photograph,
};
use protocol::ink::Ink;
use scenery::{CAMERA, PRINT, photographed};
use serde_json::Value;
use testing::program::Bench;
use truth::{Truth, rms, size};

/// A bench with a document, its job, these photographs of its print and the camera file.
fn bench(photos: &[&str]) -> Bench {
    let bench = Bench::new();
    let shots: Vec<Shot> = SHOTS.into_iter().filter(|shot| photos.contains(&shot.name)).collect();
    photographed(&bench, &shots);
    bench
}

fn names() -> Vec<&'static str> {
    SHOTS.iter().map(|shot| shot.name).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn vector(value: &Value) -> V {
    std::array::from_fn(|i| number(&value[i]))
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn poses_and_errors_are_the_true_ones() {
    let bench = bench(&names());
    let said = bench.done(&format!("compare photos {PRINT} --job job.rgl --camera camera.toml --json"));
    let report: Value = serde_json::from_str(&said).expect("JSON");
    let alone = bench.done("compare photos --job job.rgl --camera camera.toml -q --json -o alone.html");
    let alone: Value = serde_json::from_str(&alone).expect("JSON");
    let sheet = Sheet::load(&bench.path("tile.sheet"));
    println!(
        "focal length {:.1} of {FOCAL}, distortion {} of {RADIAL:?}, brighter stack {}",
        number(&report["lens"]["focal_px"]),
        report["lens"]["radial"],
        sheet.page.sheet.stacks()[sheet.bright]
    );
    let mut worst = 0.0f64;
    for (i, shot) in SHOTS.iter().enumerate() {
        let found = &report["photos"][i];
        assert_eq!(found["name"], shot.name);
        let off = minus(vector(&found["camera_mm"]), shot.eye);
        let trace: f64 = shot
            .axes()
            .iter()
            .enumerate()
            .map(|(k, axis)| dot(*axis, vector(&found["camera_axes"][k])))
            .sum();
        let turned = (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees();
        let picture = image::open(bench.path("photos").join(shot.name)).unwrap().into_rgb16();
        let truth = Truth::new(&sheet, shot, &picture, &bench.path("tile"));
        let errors = &found["errors"];
        let pairs = [
            ("total", number(&errors["total"]), rms(&truth.photo, &truth.document) / size(&truth.document)),
            ("print", number(&errors["print"]), rms(&truth.photo, &truth.print) / size(&truth.document)),
        ];
        println!(
            "{}: {:.3} mm off (states {:.3}), turned by {turned:.4} degrees, residual {:.3} px; {errors}",
            shot.name,
            dot(off, off).sqrt(),
            number(&found["camera_error_mm"]),
            number(&found["residual_px"])
        );
        assert!(dot(off, off).sqrt() < 0.5 && turned < 0.2, "{}: {off:?} {turned}", shot.name);
        for (name, found, truth) in pairs {
            println!("  {name}: {:.3} %, truly {:.3} %", 100.0 * found, 100.0 * truth);
            worst = worst.max((found / truth - 1.0).abs());
        }
        let seen = truth.photo.len() as f64 / truth.spots as f64;
        println!("  {:.1} % seen, truly {:.1} %", 100.0 * number(&found["seen"]), 100.0 * seen);
        assert!((number(&found["seen"]) - seen).abs() < 0.005, "{}", shot.name);
        // What differs is one stack, so it is the inks'.
        assert!(number(&errors["rest"]) < 0.25 * number(&errors["inks"]), "{errors}");
        let name = sheet.page.sheet.stacks()[sheet.bright].to_string();
        let factor =
            found["stacks"].as_array().unwrap().iter().find(|row| row["stack"] == name.as_str()).unwrap();
        let factor = vector(&factor["factor"]);
        println!("  {name}: {factor:?}, truly {BRIGHTER:?}");
        assert!((0..3).all(|c| (factor[c] / BRIGHTER[c] - 1.0).abs() < 0.05), "{factor:?}");
    }
    assert!(worst < 0.03, "figures are off by {worst}");
    // The highlight of the last photograph is full, so that squares are left out.
    assert!(number(&report["photos"][3]["seen"]) < 0.99);
    assert!(number(&report["photos"][0]["errors"]["gamut"]) > 0.0);
    // Alone, the window is all between the marks, and errors are from the print.
    assert_eq!(alone["document"], false);
    assert_eq!(alone["photos"][0]["errors"]["gamut"], Value::Null);
    let page = fs::read_to_string(bench.path("photos/compare.html")).unwrap();
    assert!(
        page.starts_with("<!doctype html>")
            && page.contains("left-1.png")
            && page.matches("data:image/jpeg").count() == 20
    );
    assert!(!page.contains("http://") && !page.contains("https://"));
    if let Some(keep) = std::env::var_os("FOILPRESS_KEEP") {
        fs::copy(bench.path("photos/compare.html"), Path::new(&keep).join("compare.html")).unwrap();
        fs::copy(bench.path("photos/left-2.png"), Path::new(&keep).join("left-2.png")).unwrap();
    }
}

/// A print that is as predicted does not differ from its prediction, and one ink that is a tenth darker is found with its uncertainty.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn what_is_as_predicted_does_not_differ() {
    let bench = bench(&[]);
    let shots = [&SHOTS[0], &SHOTS[3]];
    for (factor, darker) in [([1.0; 3], false), ([0.9; 3], true)] {
        let sheet = Sheet::with_stack(&bench.path("tile.sheet"), factor);
        for shot in shots {
            photograph(&sheet, shot, shot.exposure, true).save(bench.path("photos").join(shot.name)).unwrap();
        }
        let said = bench.done(&format!("compare photos {PRINT} --job job.rgl --camera camera.toml --json"));
        let report: Value = serde_json::from_str(&said).expect("JSON");
        let words = bench.done("compare photos --job job.rgl --camera camera.toml -q -o page.html");
        println!("{words}");
        let bright = sheet.page.sheet.stacks()[sheet.bright].to_string();
        let (mut within, mut all) = (0, 0);
        for (i, shot) in shots.into_iter().enumerate() {
            let found = &report["photos"][i];
            let errors = &found["errors"];
            println!("{}: {errors}", shot.name);
            for row in found["stacks"].as_array().unwrap() {
                let (value, error) = (vector(&row["factor"]), vector(&row["standard_error"]));
                let changed = row["stack"] == bright.as_str();
                println!("  {} {value:.4?} ± {error:.4?} of {:.4}", row["stack"], number(&row["share"]));
                for c in 0..3 {
                    let truth = if changed { factor[c] } else { 1.0 };
                    let off = (value[c] - truth).abs() / error[c];
                    assert!(off < 5.0, "{row}");
                    within += usize::from(off < 2.0);
                    all += 1;
                }
                assert_eq!(row["differs"], changed && darker, "{row}");
            }
            if darker {
                let picture = image::open(bench.path("photos").join(shot.name)).unwrap().into_rgb16();
                let truth = Truth::new(&sheet, shot, &picture, &bench.path("tile"));
                let print = rms(&truth.photo, &truth.print) / size(&truth.document);
                println!("  print {:.5}, truly {print:.5}", number(&errors["print"]));
                assert!((number(&errors["print"]) / print - 1.0).abs() < 0.03, "{}", shot.name);
            } else {
                assert!(number(&errors["print"]) < 0.005 && number(&errors["inks"]) < 0.005, "{errors}");
            }
        }
        println!("{within} of {all} factors within two standard errors");
        assert_eq!(words.matches("no stack differs").count(), if darker { 0 } else { 2 }, "{words}");
        assert!(10 * within > 8 * all, "{within} of {all}");
    }
}

/// A lens out of focus carries light of bright stacks to dark ones, and a pass that lies beside its place bares and doubles them: neither is an ink's.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn neither_focus_nor_register_is_taken_for_inks() {
    let bench = bench(&[]);
    let shots = [&SHOTS[0], &SHOTS[1]];
    for (sigma, ink, off) in [(1.5, None, [0, 0]), (0.7, Some(Ink::Yellow), [3, -2])] {
        let sheet = match ink {
            Some(ink) => Sheet::with_pass_off(&bench.path("tile.sheet"), ink, off),
            None => Sheet::with_stack(&bench.path("tile.sheet"), [1.0; 3]),
        };
        for shot in shots {
            let picture = out_of_focus(&photograph(&sheet, shot, shot.exposure, false), sigma);
            picture.save(bench.path("photos").join(shot.name)).unwrap();
        }
        let said = bench.done("compare photos --job job.rgl --camera camera.toml -q --json -o alone.html");
        let report: Value = serde_json::from_str(&said).expect("JSON");
        println!("{} {}", report["passes"], report["warnings"]);
        for photo in report["photos"].as_array().unwrap() {
            println!("{}: blur {}, {}", photo["name"], photo["blur_mm"], photo["errors"]);
            for row in photo["stacks"].as_array().unwrap() {
                let (value, error) = (vector(&row["factor"]), vector(&row["standard_error"]));
                println!("  {} {value:.4?} ± {error:.4?} of {:.4}", row["stack"], number(&row["share"]));
                assert_eq!(row["differs"], false, "{row}");
                assert!(value.iter().all(|factor| *factor >= 0.0), "{row}");
            }
            let errors = &photo["errors"];
            assert!(number(&errors["inks"]) < 0.006, "{errors}");
            assert!(ink.is_none() || number(&errors["rest"]) > 3.0 * number(&errors["inks"]), "{errors}");
        }
        let passes = report["passes"].as_array().unwrap();
        assert_eq!(passes.len(), usize::from(ink.is_some()), "{passes:?}");
        for pass in passes {
            assert_eq!(pass["ink"], Ink::Yellow.name());
            let truth = [off[0] as f64 / camera::DOTS_PER_MM, -off[1] as f64 / camera::DOTS_PER_MM];
            for c in 0..2 {
                assert!((number(&pass["off_mm"][c]) - truth[c]).abs() < 0.01, "{pass} {truth:?}");
            }
        }
    }
}

/// Paper that is darker and yellower than the library's would make all of the print look brighter and bluer; a grey card does not.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_grey_card_is_white_where_the_paper_is_not() {
    let bench = bench(&[]);
    let sheet = Sheet::with_card(&bench.path("tile.sheet"));
    // The card is looked for where it is level.
    let level = Shot { eye: [-40.0, -60.0, 250.0], target: [0.0; 3], roll: 0.0, lamp: RIGHT, ..SHOTS[2] };
    let shots = [&SHOTS[0], &level];
    for shot in shots {
        let photo = bench.path("photos").join(shot.name);
        photograph(&sheet, shot, shot.exposure, true).save(&photo).unwrap();
    }
    fs::write(bench.path("card.toml"), format!("white = \"card\"\n{CAMERA}")).unwrap();
    let report = |camera: &str| -> Value {
        let said = bench.done(&format!("compare photos {PRINT} --job job.rgl --camera {camera} --json"));
        serde_json::from_str(&said).expect("JSON")
    };
    let (card, paper) = (report("card.toml"), report("camera.toml"));
    for (i, shot) in shots.into_iter().enumerate() {
        let picture = image::open(bench.path("photos").join(shot.name)).unwrap().into_rgb16();
        let truth = Truth::new(&sheet, shot, &picture, &bench.path("tile"));
        // What inks do not reach is most of the total, whatever the paper.
        for (name, from, off) in [("total", &truth.document, 0.15), ("print", &truth.print, 0.5)] {
            let truth = rms(&truth.photo, from) / size(&truth.document);
            let [card, paper] = [&card, &paper].map(|report| number(&report["photos"][i]["errors"][name]));
            println!(
                "{} {name}: {card:.4} by the card, {paper:.4} by the paper, truly {truth:.4}",
                shot.name
            );
            assert!((card / truth - 1.0).abs() < 0.03 && (paper / truth - 1.0).abs() > off, "{}", shot.name);
        }
    }
    // Without a card in the pictures there is nothing to go by.
    let plain = Sheet::load(&bench.path("tile.sheet"));
    for shot in shots {
        let photo = bench.path("photos").join(shot.name);
        photograph(&plain, shot, shot.exposure, true).save(photo).unwrap();
    }
    fs::remove_file(bench.path("photos/compare.html")).unwrap();
    let said = bench.refused(1, &format!("compare photos {PRINT} --job job.rgl --camera card.toml"));
    assert!(said.contains("left-1.png") && said.contains("no grey card"), "{said}");
    assert!(!bench.path("photos/compare.html").exists(), "half-written");
}

#[test]
fn photographs_and_camera_files_that_do_not_serve_are_named() {
    let shot = &SHOTS[0];
    let compare = "compare photos --job job.rgl --camera camera.toml -q";
    let bench = bench(&[shot.name, SHOTS[1].name]);
    let sheet = Sheet::load(&bench.path("tile.sheet"));
    let photo = bench.path("photos").join(shot.name);
    let original = image::open(&photo).unwrap().into_rgb16();
    let put = |change: &dyn Fn(&mut Picture)| {
        let mut picture = original.clone();
        change(&mut picture);
        picture.save(&photo).unwrap();
    };
    let refused = |args: &str, words: &[&str]| {
        let said = bench.refused(1, args);
        assert!(words.iter().all(|words| said.contains(words)), "{said}");
        assert!(!bench.path("photos/compare.html").exists(), "half-written");
    };
    put(&|picture| picture.pixels_mut().for_each(|p| p.0 = [20_000; 3]));
    refused(compare, &[shot.name, "no camera marks were found"]);
    // A hand over the right half hides two marks.
    put(&|picture| {
        picture.enumerate_pixels_mut().filter(|(x, _, _)| *x > 600).for_each(|(_, _, p)| p.0 = [9000; 3]);
    });
    refused(compare, &[shot.name, "only 2 of the sheet's 4 camera marks"]);
    put(&|picture| *picture = image::imageops::crop_imm(picture, 10, 0, 1100, 900).to_image());
    refused(compare, &["1200 x 900 pixels, but left-1.png has 1100 x 900"]);
    photograph(&sheet, shot, 4.0, false).save(&photo).unwrap();
    refused(compare, &[shot.name, "clipped", "expose shorter"]);
    fs::write(&photo, "no picture").unwrap();
    refused(compare, &[shot.name, "not a readable photograph"]);
    put(&|_| ());

    // The same photographs with another sheet's job, and with one without marks.
    bench.done("layout tile.dots -q --paper postcard -o bare.sheet");
    bench.done("halftone tile.mix -q --size 50x30mm -o other.dots");
    bench.done("layout other.dots -q --paper postcard --camera-marks -o other.sheet");
    refused(
        "compare photos bare.sheet --camera camera.toml -q",
        &["the sheet has 0 camera marks", "--camera-marks"],
    );
    refused("compare photos other.sheet --camera camera.toml -q", &[shot.name, "those of another sheet"]);
    refused(
        "compare photos tile --size 50x30mm --paper postcard --job job.rgl --camera camera.toml -q",
        &["not the job of tile"],
    );
    refused("compare photos --camera camera.toml -q", &["say what was printed"]);
    refused("compare job.rgl --job job.rgl --camera camera.toml -q", &["not a folder"]);

    for (text, words) in [
        ("format = 1\n[[light]]\nposition_mm = [0, 0, -300]\n", "behind the sheet"),
        ("format = 1\n[[light]]\nposition_mm = [nan, 0, 300]\n", "not a place"),
        (
            "format = 1\n[camera]\nposition_mm = [0, 0, -300]\n[[light]]\nposition_mm = [0, 9, 300]\n",
            "camera.position_mm",
        ),
        (
            "format = 1\n[[light]]\nphotos = \"low\"\nposition_mm = [0, 9, 300]\n",
            "no lamp of the camera file",
        ),
    ] {
        fs::write(bench.path("camera.toml"), text).unwrap();
        refused(compare, &[words]);
    }
    // A lamp that was elsewhere does not go unnoticed.
    fs::write(bench.path("camera.toml"), "format = 1\n[[light]]\nposition_mm = [150, -200, 250]\n").unwrap();
    let output =
        bench.command("compare photos --job job.rgl --camera camera.toml -o page.html").output().unwrap();
    let said = testing::program::text(&output.stderr);
    assert!(output.status.success() && said.contains("fall-off of lamp 1"), "{said}");
}

/// Eight bits went through a camera's tone curve, and nobody knows which.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn photographs_of_eight_bits_are_said_to_be_rough() {
    let bench = bench(&["left-1.png", "left-2.png"]);
    let warned = |camera: &str| -> Vec<String> {
        fs::write(bench.path("some.toml"), camera).unwrap();
        let said = bench.done("compare photos --job job.rgl --camera some.toml -q --json -o alone.html");
        let report: Value = serde_json::from_str(&said).expect("JSON");
        let warnings = report["warnings"].as_array().unwrap();
        warnings
            .iter()
            .map(|warning| warning.as_str().unwrap().to_owned())
            .filter(|w| w.contains("8 bits"))
            .collect()
    };
    assert!(warned(CAMERA).is_empty());
    let photo = bench.path("photos/left-1.png");
    let coded = image::open(&photo).unwrap().into_rgb16();
    let coded = image::RgbImage::from_fn(coded.width(), coded.height(), |x, y| {
        image::Rgb(coded.get_pixel(x, y).0.map(|value| {
            let v = f64::from(value) / 65_535.0;
            let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            (255.0 * v).round() as u8
        }))
    });
    coded.save(&photo).unwrap();
    let [ref said] = warned(CAMERA)[..] else { panic!("one warning") };
    assert!(said.starts_with("1 of 2 photographs"), "{said}");
    assert!(warned(&format!("linear = true\n{CAMERA}")).is_empty());
}
