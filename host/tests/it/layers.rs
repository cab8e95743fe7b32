//! Spot-colour art as its owner meets it: pictures in, a job that parses strictly and prints what was drawn out.

use std::fs;

use image::{GrayImage, Luma};
use serde_json::Value;

use testing::program::{Bench, entries};

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
    let summary: Value = serde_json::from_str(&summary).expect("JSON");
    let pass = |pass: &Value| {
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
        (1, "layers white.png --size 900mm", "even cropped it can be at most"),
        (1, "layers white.png --white alpha", "has no transparency"),
        (2, "layers white.png --inks yelow", "did you mean `yellow`?"),
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

#[test]
fn the_plan_of_art_is_that_of_its_print_and_writes_nothing_else() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    layer(&bench, "gold.png", 10..20, 10..30);
    let before = bench.entries();
    let options = "white.png gold.png --paper postcard --passes white=3 --repeat 2x3 --gap 2mm";
    let plan: Value = serde_json::from_str(&bench.done(&format!("plan layers {options} --json"))).unwrap();
    assert_eq!(bench.entries(), before);
    let report: Value =
        serde_json::from_str(&bench.done(&format!("layers {options} --json -o d.print"))).unwrap();
    let (mut own, suggestions) = (plan.clone(), plan["suggestions"].as_array().unwrap());
    assert!(suggestions.is_empty(), "white is laid three times: {suggestions:?}");
    assert_eq!(own.as_object_mut().unwrap().remove("art").as_ref(), Some(&report["art"]));
    assert_eq!(own, report["plan"]);
    assert_eq!(plan["copies"], serde_json::json!([2, 3]));
    let words = bench.done(&format!("plan layers {options} --html plan.html"));
    assert!(words.contains("From the art, lowest first"), "{words}");
    let page = fs::read_to_string(bench.path("plan.html")).unwrap();
    assert!(page.contains("MDC-SCWH") && page.ends_with("</html>\n"), "a whole page of this job");
    assert!(!page.contains("Suggestions"));
    // One pass of white is too little.
    bench.done("plan layers white.png --paper postcard --html plan.html");
    let page = fs::read_to_string(bench.path("plan.html")).unwrap();
    assert!(page.contains("<h2>Suggestions, followed only when you say so</h2>"), "{page}");
    assert!(page.contains("<li><b>--accept white-thrice</b>: one pass of white looks grey"), "{page}");
    let said = bench.refused(2, "plan layers white.png --page plan.html");
    assert!(said.contains("--html"), "{said}");
}

#[test]
fn art_given_as_a_document_is_answered_with_the_right_command() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    fs::create_dir(bench.path("decal")).unwrap();
    for name in ["decal/white.png", "decal/gold.png"] {
        layer(&bench, name, 5..55, 5..35);
    }
    fs::write(bench.path("art.svg"), "<svg xmlns='http://www.w3.org/2000/svg'/>").unwrap();
    for art in ["white.png", "decal", "art.svg"] {
        for command in ["plan", "print"] {
            let said = bench.refused(1, &format!("{command} {art}"));
            assert!(said.contains(&format!("`foilpress plan layers {art}`")), "{command} {art}: {said}");
        }
    }
    let said = bench.refused(1, "plan nothing.txt");
    assert!(!said.contains("layers"), "{said}");
}

#[test]
fn options_without_effect_on_the_art_are_noted() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    let notes = |options: &str| {
        let plan = bench.done(&format!("plan layers white.png --paper postcard --json {options}"));
        serde_json::from_str::<Value>(&plan).unwrap()["notes"].to_string()
    };
    let said = notes("--tones gold --knockout silver --gamma 2 --intent perceptual");
    for part in [
        "no layer of gold, so --tones has",
        "no layer of silver, so --knockout has",
        "so --gamma has",
        "so --intent has",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let said = notes("--tones white --knockout white");
    assert!(!said.contains("no effect"), "{said}");
    assert!(!notes("--knockout none").contains("no effect"));
}

#[test]
fn presets_reach_the_plan_of_art() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    bench.done("preset save decal --media film --mirror --paper postcard");
    for preset in
        ["plan layers white.png --json --preset decal", "plan layers --preset=decal --json white.png"]
    {
        let plan: Value = serde_json::from_str(&bench.done(preset)).unwrap();
        assert_eq!(
            (&plan["paper"], &plan["curl_correction"]),
            (&Value::from("postcard"), &Value::from(false))
        );
    }
}

#[test]
fn more_cartridges_than_the_machine_holds_are_planned_and_not_sent() {
    let bench = Bench::new();
    let inks = ["white", "gold", "silver", "metallic-red", "metallic-blue", "cyan", "yellow", "black"];
    let names: Vec<String> = inks.iter().map(|ink| format!("{ink}.png")).collect();
    for (at, name) in (0..).zip(&names) {
        layer(&bench, name, 7 * at..7 * at + 5, 5..10 + at);
    }
    let art = names.join(" ");
    let plan: Value =
        serde_json::from_str(&bench.done(&format!("plan layers {art} --paper postcard --json"))).unwrap();
    assert_eq!(plan["cartridges"].as_array().unwrap().len(), 8);
    let change = &plan["changes"][0];
    assert_eq!(change["before_pass"], 8);
    assert_eq!(change["put_in"], plan["passes"][7]["ink"]);
    assert_eq!(plan["checks"][0]["rule"], "cartridges");
    let words = bench.done(&format!("plan layers {art} --paper postcard --html plan.html"));
    let page = fs::read_to_string(bench.path("plan.html")).unwrap();
    for text in [words, page] {
        assert!(
            text.contains("The printer holds no more")
                && text.contains("white, which has the fewest dots (25)"),
            "{text}"
        );
    }
    let said = bench.refused(1, &format!("layers {art} --paper postcard --to file:job.rgl"));
    assert!(said.contains("8 cartridges and the printer holds 7"), "{said}");
    assert!(!bench.path("job.rgl").exists() && !bench.entries().iter().any(|name| name.ends_with(".print")));
}

#[test]
fn marks_of_all_inks_are_no_stack_to_warn_of() {
    let bench = Bench::new();
    for (at, name) in ["white.png", "gold.png", "cyan.png", "black.png"].into_iter().enumerate() {
        let left = 12 * at as u32;
        layer(&bench, name, left..left + 10, 5..35);
    }
    let plan = |more: &str| {
        let art = "plan layers white.png gold.png cyan.png black.png --paper postcard";
        let plan: Value = serde_json::from_str(&bench.done(&format!("{art} {more} --json"))).unwrap();
        let rules = plan["checks"].as_array().unwrap().iter().map(|check| check["rule"].clone());
        rules.collect::<Vec<Value>>()
    };
    assert_eq!(plan("--registration-marks --crop-marks"), plan(""));
    assert!(!plan("").contains(&Value::from("three-layers")));
    // An ink has the same names here as everywhere.
    for name in ["gold", "MG", "Metallic Gold"] {
        let name = name.replace(' ', "-");
        let art = format!("plan layers white.png --crop-marks --mark-ink {name} --paper postcard");
        assert!(bench.done(&art).contains("Metallic Gold"), "{name}");
    }
    // What the art itself does is still said.
    let art = "plan layers white.png --order white,white,white,white --paper postcard --registration-marks";
    assert!(bench.done(art).contains("more than three layers"));
}

/// A page of 72 x 36 points with a red rectangle and a white one, a PDF as the standard has it.
fn pdf() -> Vec<u8> {
    let content = "0.8 0.1 0.1 rg 12 6 24 24 re f 1 1 1 rg 48 12 12 12 re f";
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 72 36] /Contents 4 0 R /Resources << >> >>".to_owned(),
        format!("<< /Length {} >>\nstream\n{content}\nendstream", content.len()),
    ];
    let mut file = String::from("%PDF-1.4\n");
    let mut places = Vec::new();
    for (number, object) in (1..).zip(&objects) {
        places.push(file.len());
        file += &format!("{number} 0 obj\n{object}\nendobj\n");
    }
    let table = file.len();
    file += "xref\n0 5\n0000000000 65535 f \n";
    places.iter().for_each(|place| file += &format!("{place:010} 00000 n \n"));
    file += &format!("trailer\n<< /Size 5 /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n");
    file.into_bytes()
}

#[cfg(unix)]
mod programs {
    use super::*;
    use std::os::unix::fs::symlink;
    use std::path::PathBuf;
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    /// Where a program is. The gate installs them all.
    fn installed(program: &str) -> Option<PathBuf> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let found =
            std::env::split_paths(&path).map(|folder| folder.join(program)).find(|file| file.is_file());
        if found.is_none() {
            testing::needs::Need::Queue
                .skip(&format!("{program} is not installed; `cargo xtask queue` installs it"));
        }
        found
    }

    #[test]
    fn a_page_needs_ghostscript_and_nothing_else() {
        let bench = Bench::new();
        fs::write(bench.path("page.pdf"), pdf()).unwrap();
        fs::create_dir(bench.path("bin")).unwrap();
        let print = || {
            let mut command =
                bench.command("layers page.pdf --white alpha --paper postcard --inks white,black");
            command.args(["-o", "page.print"]).env("PATH", bench.path("bin")).output().unwrap()
        };
        let output = print();
        let said = testing::program::text(&output.stderr);
        assert!(!output.status.success() && said.contains("apt install ghostscript"), "{said}");
        let Some(file) = installed("gs") else { return };
        symlink(file, bench.path("bin/gs")).unwrap();
        let output = print();
        assert!(output.status.success(), "{}", testing::program::text(&output.stderr));
        // 24 x 24 and 12 x 12 points at 600 dpi, edges on whole dots; the white one, too.
        let passes = inspected(&bench, "page.print/job.rgl");
        assert_eq!(passes[0], ("white".to_owned(), 200 * 200 + 100 * 100), "{passes:?}");
    }

    #[test]
    fn a_page_that_is_interrupted_or_damaged_leaves_no_folder() {
        let bench = Bench::new();
        fs::write(bench.path("page.pdf"), pdf()).unwrap();
        for folder in ["bin", "scratch"] {
            fs::create_dir(bench.path(folder)).unwrap();
        }
        // A Ghostscript that has begun and does not end.
        let script = "#!/bin/sh\necho > \"$TMPDIR/begun\"\nexec /bin/sleep 20\n";
        fs::write(bench.path("bin/gs"), script).unwrap();
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        fs::set_permissions(bench.path("bin/gs"), mode).unwrap();
        let mut child = bench
            .command("layers page.pdf")
            .env("PATH", bench.path("bin"))
            .env("TMPDIR", bench.path("scratch"))
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // Ghostscript's own files go into the folder of the plates, so that they are removed with it.
        let begun = || {
            let folders = entries(&bench.path("scratch"));
            folders.iter().any(|name| bench.path("scratch").join(name).join("begun").exists())
        };
        let started = Instant::now();
        while !begun() {
            assert!(started.elapsed() < Duration::from_secs(60), "the page is never begun");
            std::thread::sleep(Duration::from_millis(10));
        }
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert!(entries(&bench.path("scratch")).is_empty());
        assert!(!bench.entries().iter().any(|name| name.ends_with(".print")), "{:?}", bench.entries());

        fs::write(bench.path("bin/gs"), "#!/bin/sh\necho broken >&2\nexit 1\n").unwrap();
        let output = bench
            .command("layers page.pdf")
            .env("PATH", bench.path("bin"))
            .env("TMPDIR", bench.path("scratch"))
            .output()
            .unwrap();
        assert!(testing::program::text(&output.stderr).contains("cannot be read: broken"));
        assert!(entries(&bench.path("scratch")).is_empty());
    }
}
