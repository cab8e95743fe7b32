//! The words people read: help of every command, plans, and the commonest errors, pinned so that a change is seen in review.
//!
//! After a change of words: `INSTA_UPDATE=always cargo test -p foilpress --test it words::`, then read the difference.

use std::fs;

use testing::program::{Bench, small_document, text};

/// A picture of one ink: a solid disc.
fn disc(bench: &Bench, name: &str) {
    let picture = image::GrayImage::from_fn(300, 200, |x, y| {
        let inside = (x as f32 - 150.0).hypot(y as f32 - 100.0) < 80.0;
        image::Luma([if inside { 0 } else { 255 }])
    });
    picture.save(bench.path(name)).expect("a picture");
}

/// Pins this text under this name.
fn pinned(name: &str, text: &str) {
    // Widths of help are fixed; what a run writes beside its words (spinners, colours) is not shown without a terminal.
    insta::assert_snapshot!(name, text);
}

/// Every command below these words, the words themselves first.
fn commands(bench: &Bench, words: &str, found: &mut Vec<(String, String)>) {
    let output = bench.command(&format!("{words} --help")).env("COLUMNS", "100").output().expect("it starts");
    assert!(output.status.success(), "{words}: {}", text(&output.stderr));
    let help = text(&output.stdout);
    found.push((words.to_owned(), help.clone()));
    let Some((_, list)) = help.split_once("\nCommands:\n") else { return };
    let list = list.split("\n\n").next().unwrap_or_default();
    for line in list.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   ")) {
        let name = line.split_whitespace().next().expect("a line has a word");
        if name != "help" {
            commands(bench, format!("{words} {name}").trim(), found);
        }
    }
}

#[test]
fn help_of_every_command() {
    let bench = Bench::new();
    let mut found = Vec::new();
    commands(&bench, "", &mut found);
    assert!(found.len() > 40, "only {} commands were found", found.len());
    let mut short = String::new();
    for (words, help) in found {
        let output = bench.command(&format!("{words} -h")).env("COLUMNS", "80").output().expect("it starts");
        let brief = text(&output.stdout);
        if words.is_empty() || brief.contains("help with all options") {
            short += &format!("$ foilpress {words} -h\n{brief}\n");
        }
        let name = if words.is_empty() { "foilpress".to_owned() } else { words.replace(' ', "-") };
        pinned(&format!("help-{name}"), &help);
    }
    pinned("short-help", &short);
}

#[test]
fn plans_of_three_jobs() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    disc(&bench, "white.png");
    disc(&bench, "gold.png");
    pinned("plan-document", &bench.done("plan tile --size 12x8mm --paper postcard"));
    pinned("plan-layers", &bench.done("plan layers white.png gold.png --mirror --repeat 2x2 --gap 2mm"));
    bench.done("chart registration --inks black,cyan,white -o registration");
    pinned("plan-job", &bench.done("plan registration/job.rgl"));
}

#[test]
fn the_commonest_errors() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::create_dir(bench.path("empty")).expect("a folder");
    let whole = fs::read(bench.path("tile/roughness.png")).expect("a map");
    small_document(&bench.path("cut"));
    fs::write(bench.path("cut/roughness.png"), &whole[..whole.len() / 2]).expect("a broken map");
    fs::write(bench.path("notes.txt"), "hello, printer\n").expect("a text");
    disc(&bench, "white.png");
    disc(&bench, "purple.png");
    let small = image::GrayImage::from_pixel(20, 20, image::Luma([0]));
    small.save(bench.path("gold.png")).expect("a picture");
    bench.done("chart calibration -o chart");
    let job = fs::read(bench.path("chart/job.rgl")).expect("a job");
    fs::write(bench.path("half.rgl"), &job[..job.len() / 2]).expect("half a job");
    let _port = testing::device::Device::at(&bench.path("port"));
    let mut told = String::new();
    for args in [
        "print nowhere",
        "print sample:leef",
        "print empty",
        "print cut --size 12x8mm",
        "print white.png",
        "print tile --size big",
        "print tile --size 400x500mm",
        "print tile --paper a3",
        "print tile --inks process,metalic-silver",
        "print tile --size 12x8mm --preset decals",
        "print tile --sise 3mm",
        "layers purple.png",
        "layers white.png gold.png",
        "layers notes.txt",
        "layers white.png --choke 20mm",
        "layers white.png --choke -1mm",
        "layers white.png --gap -2mm --json -3",
        "inspect notes.txt",
        "inspect half.rgl",
        "plan half.rgl",
        "send half.rgl --to raw:port",
        "send chart/job.rgl --to raw:port",
        "send chart/job.rgl --to nowhere",
        "send chart/job.rgl --to serial:/dev/no-such-port",
        "bridge status --to serial:/dev/no-such-port",
        "resume",
        "cancel",
        "ledger new purple",
        "inks show X+Y",
        "separate tile -o tile.passes",
        "encode notes.txt -o job.rgl",
    ] {
        // Progress says how long a stage took.
        let output = bench.run(&format!("--quiet {args}"));
        let code = output.status.code().expect("it ends by itself");
        let said = text(&output.stderr);
        assert!(!said.contains("panicked"), "{args}: {said}");
        told += &format!("$ foilpress {args}\n{}[exit code {code}]\n\n", said);
    }
    // Where the test runs differs from time to time.
    let told = told.replace(&*bench.path("").display().to_string(), "FOLDER/");
    pinned("errors", &told);
}
