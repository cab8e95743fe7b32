//! Documents that never end, and interrupted work, end in time and leave nothing behind.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use testing::needs::ghostscript;
use testing::program::{Bench, entries, text};

/// Whether any process has this text in its arguments.
fn runs(what: &str) -> bool {
    let listing = fs::read_dir("/proc").into_iter().flatten().filter_map(Result::ok);
    listing
        .filter_map(|entry| fs::read(entry.path().join("cmdline")).ok())
        .any(|arguments| text(&arguments).contains(what))
}

#[test]
fn endless_pages_end_at_the_limit_in_every_path_and_nothing_runs_on() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let scratch = bench.path("scratch");
    fs::create_dir(&scratch).unwrap();
    // Calculates for ever, and shows pages for ever.
    for (name, body) in [("loop.ps", "{} loop"), ("pages.ps", "{showpage} loop")] {
        fs::write(bench.path(name), format!("%!PS\n{body}\n")).unwrap();
        let file = bench.path(name).display().to_string();
        for command in [
            format!("layers {name}"),
            format!("layers {name} --page 1"),
            format!("plan layers {name} --pages white,gold"),
            format!("cups-filter 1 me title 1 FoilpressSpots=Named {file}"),
            format!("cups-filter 1 me title 1 FoilpressSpots=Off {file}"),
        ] {
            let begun = Instant::now();
            let output = bench
                .command(&command)
                .env("FOILPRESS_TIME_LIMIT", "2")
                .env("TMPDIR", &scratch)
                .output()
                .unwrap();
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{command}: {said}");
            // A page, or all pages together.
            let time = said.contains("took more than 2 s and was stopped")
                || said.contains("took more than 20 s altogether and was stopped");
            let number = said.contains("more than 1000 pages");
            assert!(time && said.contains("FOILPRESS_TIME_LIMIT") || number, "{command}: {said}");
            assert!(begun.elapsed() < Duration::from_secs(60), "{command}: {:?}", begun.elapsed());
            assert!(!runs(&file), "{command}: Ghostscript goes on");
            assert!(entries(&scratch).is_empty(), "{command}: {:?}", entries(&scratch));
        }
    }
}

#[test]
fn a_drawing_with_endless_filters_ends_at_the_limit() {
    let bench = Bench::new();
    let dilate =
        r#"<feMorphology operator="dilate" radius="50"/><feMorphology operator="erode" radius="50"/>"#
            .repeat(200);
    let svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="190mm" height="260mm"><filter id="f" x="0" y="0" width="1" height="1">{dilate}</filter>
        <g id="white"><rect width="700" height="900" filter="url(#f)"/></g></svg>"##
    );
    fs::write(bench.path("heavy.svg"), svg).unwrap();
    for command in ["layers heavy.svg", "plan layers heavy.svg"] {
        let begun = Instant::now();
        let output = bench.command(command).env("FOILPRESS_TIME_LIMIT", "1").output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("heavy.svg: drawing it took more than 1 s"), "{said}");
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
    }
}

#[test]
fn a_drawing_on_which_the_renderer_fails_is_an_error_like_any_other() {
    let bench = Bench::new();
    // Its noise overflows in builds that check.
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"><filter id="f">
        <feTurbulence baseFrequency="0.05" numOctaves="200"/></filter><g id="white"><rect width="9" height="9" filter="url(#f)"/></g></svg>"##;
    fs::write(bench.path("noise.svg"), svg).unwrap();
    let output = bench.run("plan layers noise.svg --paper postcard");
    let said = text(&output.stderr);
    assert!(!said.contains("panicked"), "{said}");
    assert!(output.status.success() || said.contains("noise.svg: the drawing cannot be rendered"), "{said}");
}

#[test]
fn a_cancelled_filter_leaves_neither_folders_nor_a_ghostscript() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    fs::create_dir(bench.path("scratch")).unwrap();
    fs::write(bench.path("loop.ps"), "%!PS\n{} loop\n").unwrap();
    let file = bench.path("loop.ps").display().to_string();
    let mut child = bench
        .command(&format!("cups-filter 1 me title 1 FoilpressSpots=Named {file}"))
        .env("TMPDIR", bench.path("scratch"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !runs(&format!("-f\0{file}")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "Ghostscript is never started");
        std::thread::sleep(Duration::from_millis(20));
    }
    // As the print system ends it.
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert_ne!(child.wait().unwrap().code(), Some(0));
    assert!(!runs(&format!("-f\0{file}")), "Ghostscript goes on");
    assert!(entries(&bench.path("scratch")).is_empty(), "{:?}", entries(&bench.path("scratch")));
}
