//! Photographs from an independent renderer, with noise, 12-bit clipping and an unknown white balance, measured with exact and with
//! wrong setups, against the curves that were rendered.

#![allow(clippy::needless_range_loop, reason = "channels are numbered across several arrays at once")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use crate::renderer::{MATERIALS, Material, Picture, Raw, Rendered, render, renderer};
use measure::curves::reduce::SampleOrigin;
use measure::setup::Setup;
use measure::{Taken, measure};
use observe::Silent;
use testing::needs;

/// The setup as the renderer describes it, with errors.
#[derive(Clone, Copy)]
struct Tape {
    known: bool,
    radius: f64,
    light: [f64; 3],
    axis: [f64; 3],
    field_of_view: f64,
}

const EXACT: Tape = Tape {
    known: true,
    radius: 50.0,
    light: [350.0, 100.0, 900.0],
    axis: [0.0, 1.0, 0.0],
    field_of_view: 14.0,
};

fn setup(tape: &Tape, stack: &str, times: &BTreeMap<String, f64>) -> Setup {
    let mut text = format!(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\ngeometry = \"{}\"\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = {}\n[[light]]\nposition_mm = {:?}\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = {}\naxis = {:?}\nheight_mm = 120\nstack = \"{stack}\"\n[exposures]\n",
        if tape.known { "known" } else { "solved" },
        tape.field_of_view,
        tape.light,
        tape.radius,
        tape.axis
    );
    for (name, time) in times {
        let _ = writeln!(text, "\"{name}\" = {time:e}");
    }
    Setup::parse(&text).unwrap()
}

/// How a measured curve compares with the truth.
#[derive(Debug)]
struct Score {
    /// Largest relative error of a sample from 2 to 60 degrees.
    worst: f64,
    /// Mean relative error there.
    scale: f64,
    /// Share of the samples there, and of those below 2 degrees, whose band of two deviations holds the truth.
    covered: f64,
    /// Samples compared.
    count: usize,
}

fn score(taken: &Taken, material: &Material) -> Score {
    let (mut worst, mut sum, mut covered, mut count, mut all) = (0.0f64, 0.0, 0.0, 0.0, 0.0);
    for row in &taken.measurement.stacks[0].rows {
        if row.kind == SampleOrigin::Extrapolated || row.theta_deg > 60.0 {
            continue;
        }
        let truth = material.at(row.theta_deg.to_radians());
        for c in 0..3 {
            let error = row.rgb[c] / truth[c] - 1.0;
            covered += f64::from(u8::from((row.rgb[c] - truth[c]).abs() <= 2.0 * row.sigma[c]));
            all += 1.0;
            if std::env::var_os("FOILPRESS_ROWS").is_some() {
                println!(
                    "{:6.2} {c} {:.5} {:.5} {:+.4} {:.4} {:?} {}",
                    row.theta_deg,
                    row.rgb[c],
                    truth[c],
                    error,
                    row.sigma[c] / row.rgb[c],
                    row.kind,
                    row.pixels
                );
            }
            if row.theta_deg >= 2.0 {
                worst = worst.max(error.abs());
                sum += error;
                count += 1.0;
            }
        }
    }
    Score { worst, scale: sum / count, covered: covered / all, count: count as usize }
}

fn report(name: &str, taken: &Taken, score: &Score) {
    println!(
        "{name:<28} worst {:5.2} %, scale {:+5.2} %, covered {:3.0} % of {}, misfit {:.2} % from {:.2} %",
        100.0 * score.worst,
        100.0 * score.scale,
        100.0 * score.covered,
        score.count,
        100.0 * taken.measurement.geometry.misfit,
        100.0 * taken.measurement.geometry.misfit_before
    );
}

#[test]
fn materials_with_known_geometry() {
    let Some(script) = renderer() else { return };
    for material in testing::drawn(&MATERIALS, 3) {
        let rendered = Rendered::new(&script, material, "");
        let taken =
            measure(&rendered.photos(), &setup(&EXACT, material.stack, &rendered.times), None, &Silent)
                .unwrap();
        let score = score(&taken, material);
        report(material.name, &taken, &score);
        assert!(score.count > 90 && score.worst < 0.03, "{}: {score:?}", material.name);
        assert!(score.scale.abs() < 0.02 && score.covered >= 0.9, "{}: {score:?}", material.name);
        assert!(taken.measurement.again.is_empty(), "{:?}", taken.measurement.again);
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_wrong_tape_is_corrected() {
    let Some(script) = renderer() else { return };
    let solved = Tape { known: false, ..EXACT };
    let lean = 0.5f64.to_radians();
    let cases = [
        ("exact, solved", solved),
        ("radius 1 % large", Tape { radius: 50.5, ..solved }),
        ("light 5 mm off", Tape { light: [355.0, 100.0, 900.0], ..solved }),
        ("light 5 mm low", Tape { light: [350.0, 95.0, 900.0], ..solved }),
        ("leaning 0.5 degrees", Tape { axis: [lean.sin(), lean.cos(), 0.0], ..solved }),
        ("nodding 0.5 degrees", Tape { axis: [0.0, lean.cos(), lean.sin()], ..solved }),
    ];
    for material in testing::drawn(&MATERIALS, 2) {
        let rendered = Rendered::new(&script, material, "");
        for (name, tape) in &cases {
            let taken =
                measure(&rendered.photos(), &setup(tape, material.stack, &rendered.times), None, &Silent)
                    .unwrap();
            let score = score(&taken, material);
            report(&format!("{}, {name}", material.name), &taken, &score);
            assert!(score.worst < 0.08 && score.scale.abs() < 0.02, "{}, {name}: {score:?}", material.name);
            assert!(score.covered >= 0.9, "{}, {name}: {score:?}", material.name);
        }
    }
}

/// Where the parts of a double-size rendering are cut out that a moving camera takes: shifts of half pixels. The photograph in the
/// middle of the series is where the setup holds.
const BY_HAND: [(usize, usize); 6] = [(8, 9), (9, 8), (5, 11), (8, 8), (12, 8), (8, 3)];

/// The cut margin makes the angle of view smaller.
fn halved_field() -> f64 {
    2.0 * ((480.0 - 8.0) / 480.0 * 7f64.to_radians().tan()).atan().to_degrees()
}

/// A part of a pixel that is left after the alignment is found with the geometry: without that a foil's lamp comes out 24 mm aside.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_hand_held_camera_is_aligned() {
    let Some(script) = renderer() else { return };
    let exact = Tape { field_of_view: halved_field(), ..EXACT };
    let solved = Tape { known: false, ..exact };
    let lean = 0.5f64.to_radians();
    let off =
        Tape { radius: 50.5, light: [355.0, 95.0, 900.0], axis: [0.0, lean.cos(), lean.sin()], ..solved };
    for (material, tapes) in [(&MATERIALS[3], &[exact, solved][..]), (&MATERIALS[6], &[exact, solved, off])] {
        let rendered =
            Rendered::with(&script, material, ", size=(960, 720), ss=2", |i, raw| raw.halved(BY_HAND[i]));
        for tape in tapes {
            let setup = setup(tape, material.stack, &rendered.times);
            let taken = measure(&rendered.photos(), &setup, None, &Silent).unwrap();
            let score = score(&taken, material);
            report(&format!("{}, hand-held, known {}", material.name, tape.known), &taken, &score);
            let limit = if tape.known { 0.03 } else { 0.08 };
            assert!(score.worst < limit && score.scale.abs() < 0.02, "{}: {score:?}", material.name);
            assert!(score.covered >= 0.9, "{}: {score:?}", material.name);
            for (shot, place) in taken.measurement.series[0].shots.iter().zip(BY_HAND) {
                // The longest exposure shows little but clipped pixels, and says so.
                let moved = [place.0, place.1].map(|d| (8.0 - d as f64) / 2.0);
                println!("  {:?} ± {:?} for {moved:?}", shot.shift, shot.shift_error);
                for axis in 0..2 {
                    let (off, error) = ((shot.shift[axis] - moved[axis]).abs(), shot.shift_error[axis]);
                    assert!(off < 4.0 * error + 0.1 && error < 1.0, "{off} ± {error} for {moved:?}");
                }
            }
        }
    }
}

/// Hand-held photographs of a mirror that is narrower than any foil, all so short that the last ones share nothing with the others: their
/// shifts cannot be known, so there is no curve.
#[test]
fn photographs_that_cannot_be_aligned_are_refused() {
    let Some(script) = renderer() else { return };
    let mirror = Material { alpha: 0.03, shorter: 32.0, ..MATERIALS[6] };
    let rendered =
        Rendered::with(&script, &mirror, ", size=(960, 720), ss=2", |i, raw| raw.halved(BY_HAND[i]));
    let tape = Tape { known: false, field_of_view: halved_field(), ..EXACT };
    let setup = setup(&tape, mirror.stack, &rendered.times);
    let said = measure(&rendered.photos(), &setup, None, &Silent).err().expect("an error").to_string();
    assert!(said.contains("exp_4.png: cannot be aligned") && said.contains("tripod"), "{said}");
}

/// Exposures too long for a foil: its peak is marked, nowhere below the truth's band, and the report says what to do.
#[test]
fn a_clipped_peak_is_never_silent() {
    let Some(script) = renderer() else { return };
    for shorter in [1.0, 0.25] {
        let material = Material { shorter, ..MATERIALS[6] };
        let rendered = Rendered::new(&script, &material, "");
        let taken =
            measure(&rendered.photos(), &setup(&EXACT, material.stack, &rendered.times), None, &Silent)
                .unwrap();
        let rows = &taken.measurement.stacks[0].rows;
        let clipped: Vec<_> = rows.iter().filter(|row| row.kind == SampleOrigin::Clipped).collect();
        assert!(clipped.len() > 3, "{} clipped rows", clipped.len());
        for row in rows.iter().filter(|row| row.theta_deg < 60.0) {
            let truth = material.at(row.theta_deg.to_radians());
            for c in 0..3 {
                let low = row.rgb[c] < 0.95 * truth[c];
                assert!(row.kind != SampleOrigin::Measured || !low, "{row:?}, truth {truth:?}");
                assert!(
                    row.kind == SampleOrigin::Measured || row.rgb[c] + 2.0 * row.sigma[c] > 0.7 * truth[c],
                    "{row:?}, truth {truth:?}"
                );
            }
        }
        let again = taken.measurement.again.join("; ");
        assert!(
            again.contains("SF: the highlight is clipped") && again.contains("4 and 16 times as short"),
            "{again}"
        );
    }
}

/// A flat sheet under seven lamps, rendered one by one.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_flat_sheet_under_several_lamps() {
    let Some(script) = renderer() else { return };
    let material = &MATERIALS[3];
    let folder = tempfile::tempdir().unwrap();
    let photos = folder.path().join("photos");
    std::fs::create_dir(&photos).unwrap();
    let mut text = String::from(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11\"\ngeometry = \"known\"\n[camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = 14.0\n\
         [sample]\nshape = \"flat\"\nwidth_mm = 120\nheight_mm = 120\nstack = \"MS\"\n",
    );
    let mut times = String::from("[exposures]\n");
    let lamps = [
        (90.0, 900.0),
        (250.0, 900.0),
        (450.0, 850.0),
        (700.0, 700.0),
        (900.0, 500.0),
        (1000.0, 320.0),
        (1050.0, 190.0),
    ];
    for (i, (x, z)) in lamps.into_iter().enumerate() {
        let lamp = tempfile::tempdir().unwrap();
        // The renderer's card is at the right; a lamp at the right lights it as well.
        let extra = format!(", shape='flat', light=({}, 0.0, {}), seed={i}", x / 1000.0, z / 1000.0);
        render(&script, material, &material.times(), &extra, lamp.path());
        for (k, time) in material.times().into_iter().enumerate() {
            let name = format!("lamp{i}-{k}.png");
            Raw::read(&lamp.path().join(format!("npy/exp_{k}.npy"))).save(&photos.join(&name));
            let _ = writeln!(times, "\"{name}\" = {time:e}");
        }
        let _ = writeln!(text, "[[light]]\nposition_mm = [{x}, 0, {z}]\nphotos = \"lamp{i}-\"");
    }
    // The sheet covers x from -60 to 60 mm and the card begins at 75 mm.
    let taken = measure(&photos, &Setup::parse(&(text + &times)).unwrap(), None, &Silent).unwrap();
    let (mut worst, mut first, mut last) = (0.0f64, 90.0f64, 0.0f64);
    for row in taken.measurement.stacks[0].rows.iter().filter(|row| row.kind != SampleOrigin::Extrapolated) {
        let truth = material.at(row.theta_deg.to_radians());
        (first, last) = (first.min(row.theta_deg), last.max(row.theta_deg));
        for c in 0..3 {
            worst = worst.max((row.rgb[c] / truth[c] - 1.0).abs());
        }
    }
    println!("flat: {first:.1} to {last:.1} degrees, worst {:.2} %", 100.0 * worst);
    assert!(first < 2.0 && last > 38.0 && worst < 0.03, "{first} {last} {worst}");
    assert!(
        taken.measurement.again.iter().any(|line| line.contains("half angles from")),
        "{:?}",
        taken.measurement.again
    );
}

/// What people do wrong, each named with what to do.
#[test]
fn mistakes_are_named() {
    let Some(script) = renderer() else { return };
    let material = &MATERIALS[0];
    let rendered = Rendered::new(&script, material, "");
    let other = Rendered::new(&script, &MATERIALS[4], "");
    let exact = setup(&EXACT, material.stack, &rendered.times);
    let fails = |photos: &Path, setup: &Setup, words: [&str; 2]| {
        let error = measure(photos, setup, None, &Silent).err().expect("an error").to_string();
        println!("{error}");
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    fails(
        &rendered.photos(),
        &Setup { exposures: BTreeMap::new(), ..exact.clone() },
        ["exp_0.png: has no exposure time", "[exposures]"],
    );
    for (known, radius) in [(true, 44.0), (false, 56.0)] {
        let wrong = setup(&Tape { known, radius, ..EXACT }, material.stack, &rendered.times);
        fails(&rendered.photos(), &wrong, ["sample.radius_mm: the setup file says", "measure the can"]);
    }
    let mut aside = exact.clone();
    aside.sample.stack = None;
    aside.patch = vec![measure::setup::Patch {
        stack: "K".parse().unwrap(),
        rectangle_px: [180.0, 100.0, 210.0, 260.0],
    }];
    fails(&rendered.photos(), &aside, ["stack K: no highlight in view", "move the lamp"]);
    // Beside a stack that has one it is left out.
    let all = measure::setup::Patch {
        stack: material.stack.parse().unwrap(),
        rectangle_px: [180.0, 100.0, 300.0, 260.0],
    };
    aside.patch.push(all);
    let taken = measure(&rendered.photos(), &aside, None, &Silent).unwrap().measurement;
    assert_eq!(taken.stacks.iter().map(|s| &*s.stack).collect::<Vec<_>>(), [material.stack]);
    assert!(taken.again.iter().any(|line| line.starts_with("left out: stack K: no highlight")), "{taken:?}");

    // A check tells the same of the first photograph alone, and all of it at once.
    let alone = tempfile::tempdir().unwrap();
    std::fs::copy(rendered.photos().join("exp_3.png"), alone.path().join("exp_3.png")).unwrap();
    let mut first = aside.clone();
    first.exposures.retain(|name, _| name == "exp_3.png");
    let checked = measure::check(alone.path(), &first, None, &Silent).unwrap();
    let says = |lines: &[String], words: &str| lines.iter().any(|line| line.contains(words));
    assert!(
        says(&checked.good, "one photograph") && says(&checked.good, "grey card is found"),
        "{checked:?}"
    );
    assert!(says(&checked.good, &format!("with their highlight: {}", material.stack)), "{checked:?}");
    assert!(says(&checked.mend, "stack K: no highlight") && says(&checked.mend, "lamp off"), "{checked:?}");
    first.patch.remove(0);
    let checked = measure::check(alone.path(), &first, None, &Silent).unwrap();
    assert!(says(&checked.good, "tape fit") && says(&checked.mend, "one exposure only"), "{checked:?}");
    let wrong = Setup { patch: first.patch, ..setup(&Tape { radius: 44.0, ..EXACT }, "K", &first.exposures) };
    let checked = measure::check(alone.path(), &wrong, None, &Silent).unwrap();
    assert!(says(&checked.mend, "sample.radius_mm: the setup file says"), "{checked:?}");

    // Photographs changed one by one.
    let changed = |change: &dyn Fn(usize, &mut Picture)| {
        let folder = tempfile::tempdir().unwrap();
        for i in 0..6 {
            let name = format!("exp_{i}.png");
            let mut picture = image::open(rendered.photos().join(&name)).unwrap().into_rgb16();
            change(i, &mut picture);
            picture.save(folder.path().join(name)).unwrap();
        }
        folder
    };
    let moved = changed(&|i, picture| {
        if i == 2 {
            let still = picture.clone();
            for (x, y, pixel) in picture.enumerate_pixels_mut() {
                *pixel = *still.get_pixel((x + 480 - 20) % 480, y);
            }
        }
    });
    fails(moved.path(), &exact, ["exp_2.png", "tripod"]);
    let stranger = changed(&|i, picture| {
        if i == 3 {
            *picture = image::open(other.photos().join("exp_3.png")).unwrap().into_rgb16();
        }
    });
    fails(stranger.path(), &exact, ["exp_3.png: shows something else", "another series"]);
    let two = changed(&|_, picture| {
        let still = picture.clone();
        for y in 140..220 {
            for x in 355..460 {
                picture.put_pixel(x - 340, y, *still.get_pixel(x, y));
            }
        }
    });
    fails(two.path(), &exact, ["2 grey cards", "card.rectangle_px"]);
    let hidden = changed(&|_, picture| {
        for y in 140..220 {
            for x in 355..460 {
                picture.put_pixel(x, y, image::Rgb([0; 3]));
            }
        }
    });
    fails(hidden.path(), &exact, ["no grey card", "card.rectangle_px"]);
    // Only the longest exposures: the white step is full in all of them.
    let long = tempfile::tempdir().unwrap();
    let mut few = exact.clone();
    few.card.rectangle_px = Some([362.0, 147.0, 450.0, 212.0]);
    few.exposures.retain(|name, _| ["exp_0.png", "exp_1.png"].contains(&&**name));
    for name in few.exposures.keys() {
        std::fs::copy(rendered.photos().join(name), long.path().join(name)).unwrap();
    }
    fails(long.path(), &few, ["90.0 % step is clipped", "shorter exposures"]);
}

/// The rendered photographs of the data set, against the measurement they were rendered from.
#[test]
fn alum_bronze_of_the_data_set() {
    let Some(data) = needs::data() else { return };
    let times: BTreeMap<String, f64> = [0.00025, 0.001, 0.004, 0.016667, 0.066667, 0.25]
        .into_iter()
        .enumerate()
        .map(|(i, time)| (format!("exp_{i}.png"), time))
        .collect();
    for known in [true, false] {
        let setup = setup(&Tape { known, ..EXACT }, "MG", &times);
        let taken = measure(&data.join("photos/alum_bronze_cylinder"), &setup, None, &Silent).unwrap();
        let mut best = f64::INFINITY;
        for kind in ["avg", "colocated"] {
            let file = data.join(format!("brdf/curves_{kind}/merl_alum-bronze.csv"));
            let truth = inks::Curve::from_csv(std::fs::File::open(&file).unwrap(), &file).unwrap();
            let mut worst = 0.0f64;
            for row in
                taken.measurement.stacks[0].rows.iter().filter(|row| (2.0..60.0).contains(&row.theta_deg))
            {
                for (found, truth) in row.rgb.iter().zip(truth.at(row.theta_deg.to_radians())) {
                    worst = worst.max((found / truth - 1.0).abs());
                }
            }
            println!("alum-bronze, known {known}, {kind}: worst {:.2} %", 100.0 * worst);
            best = best.min(worst);
        }
        assert!(best < if known { 0.03 } else { 0.08 }, "{best}");
    }
}

/// 24 photographs of 12 megapixels: memory, and the time beside it, which depends on what else the computer does.
#[test]
#[ignore = "writes a gigabyte and takes minutes"]
fn memory_of_24_large_photographs() {
    let Some(script) = renderer() else { return };
    let material = &MATERIALS[3];
    let rendered = Rendered::new(&script, material, ", size=(1000, 750), ss=2");
    let large = tempfile::tempdir().unwrap();
    let mut times = BTreeMap::new();
    for k in 0..24 {
        let small = image::open(rendered.photos().join(format!("exp_{}.png", k % 6))).unwrap().into_rgb16();
        let mut state = k as u32 + 1;
        let picture = image::ImageBuffer::from_fn(4000, 3000, |x, y| {
            let image::Rgb(values) = *small.get_pixel(x / 4, y / 4);
            // Noise of one step of 12 bits keeps the files from being small.
            image::Rgb(values.map(|v| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if v >= 65_520 { v } else { v.saturating_add(16 * (state >> 31) as u16) }
            }))
        });
        let name = format!("large_{k:02}.png");
        picture.save(large.path().join(&name)).unwrap();
        times.insert(name, material.times()[k % 6]);
    }
    let memory = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or_default().to_owned();
        line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).unwrap_or(0.0) / 1e6
    };
    let before = memory();
    let start = std::time::Instant::now();
    let taken =
        measure(large.path(), &setup(&Tape { known: false, ..EXACT }, material.stack, &times), None, &Silent)
            .unwrap();
    let (took, peak) = (start.elapsed().as_secs_f64(), memory());
    let score = score(&taken, material);
    report("24 large photographs", &taken, &score);
    println!("{took:.1} s, at most {peak:.2} GB ({before:.2} GB before)");
    assert!(score.worst < 0.08 && peak < 2.0, "{score:?} {peak}");
}
