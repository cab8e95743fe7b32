//! Nothing of the art is lost, and what was decided is said: pages, the plan, the ledger's prices, lists for programs.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;

use image::{GrayImage, Luma};
use serde_json::Value;

use testing::needs::ghostscript;
use testing::program::{Bench, entries, text};

/// A black layer of 60 x 40 pixels with ink in a rectangle.
fn layer(bench: &Bench, name: &str, x: std::ops::Range<u32>, y: std::ops::Range<u32>) {
    let ink = |u: u32, v: u32| Luma([if x.contains(&u) && y.contains(&v) { 0 } else { 255 }]);
    GrayImage::from_fn(60, 40, ink).save(bench.path(name)).expect("a picture");
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error} in {text}"))
}

/// An executable script in a folder that is first on the path.
fn script(bench: &Bench, name: &str, body: &str) -> std::ffi::OsString {
    let folder = bench.path("bin");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join(name), format!("#!/bin/sh\n{body}")).unwrap();
    fs::set_permissions(folder.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(folder).chain(std::env::split_paths(&path))).unwrap()
}

const PAGES: &str = "%!PS
/page { <</PageSize [144 72]>> setpagedevice } def
page 0 setgray 12 12 96 48 rectfill showpage
page 0 setgray 24 24 36 12 rectfill showpage
page 0 setgray 84 24 12 12 rectfill showpage
";

#[test]
fn pages_are_chosen_or_given_their_inks_on_the_command_line() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    fs::write(bench.path("pages.ps"), PAGES).unwrap();
    let before = bench.entries();
    let said = bench.refused(1, "layers pages.ps --paper postcard");
    assert!(
        said.contains("art on 3 pages (1, 2, 3)") && said.contains("--page 1, --pages white,gold,black"),
        "{said}"
    );
    bench.refused(2, "layers pages.ps --page 1 --pages white");
    assert!(bench.refused(2, "layers pages.ps --pages white,blak").contains("did you mean `black`?"));
    assert_eq!(bench.entries(), before);
    let plan = json(&bench.done("plan layers pages.ps --pages white,gold,black --paper postcard --json"));
    let passes = plan["passes"].as_array().unwrap();
    let inks: Vec<&str> = passes.iter().map(|pass| pass["ink"].as_str().unwrap()).collect();
    assert_eq!(inks, ["white", "metallic-gold", "black"]);
    // 600 / 72 dots a unit; rectangles take every dot they touch.
    for (pass, wanted) in passes.iter().zip([96 * 48, 36 * 12, 12 * 12]) {
        let (found, wanted) = (pass["dots"].as_f64().unwrap(), f64::from(wanted) * (600.0f64 / 72.0).powi(2));
        assert!((found / wanted - 1.0).abs() < 0.04, "{pass}: {wanted}");
    }
}

/// What a page asks for in CMYK is printed on as many dots, whatever the amount: 75 % was a solid, and half was a fifth.
#[test]
fn tints_in_cmyk_are_printed_as_they_are_asked_for() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let area = (36.0f64 * 600.0 / 72.0).powi(2);
    for asked in [
        [0.1, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.75, 0.0, 0.0],
        [0.9, 0.0, 0.0],
        [0.0, 0.6, 0.0],
        [0.0, 0.0, 0.85],
        [0.75, 0.0, 0.75],
    ] {
        let [c, m, y] = asked;
        let page = format!(
            "%!PS\n<</PageSize [72 72]>> setpagedevice {c} {m} {y} 0 setcmykcolor 18 18 36 36 rectfill showpage\n"
        );
        fs::write(bench.path("tint.ps"), page).unwrap();
        let plan = json(&bench.done("plan layers tint.ps --paper postcard --json"));
        let dots = |ink: &str| {
            let passes = plan["passes"].as_array().unwrap();
            passes.iter().find(|pass| pass["ink"] == ink).map_or(0.0, |pass| pass["dots"].as_f64().unwrap())
        };
        for (ink, asked) in
            ["cyan", "magenta", "yellow", "black"].into_iter().zip(asked.into_iter().chain([0.0]))
        {
            let printed = dots(ink) / area;
            assert!(
                (printed - asked).abs() < 0.02,
                "{ink}: {printed:.3} instead of {asked}, C {c}, M {m}, Y {y}"
            );
        }
    }
}

#[test]
fn a_page_as_large_as_the_sheet_is_refused_with_the_remedy_and_printed_at_true_size_when_cropped() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let page = "%!PS\n<</PageSize [595.276 841.89]>> setpagedevice
        [/Separation (White) /DeviceCMYK {pop 0 0 0 0}] setcolorspace 1 setcolor 100 100 72 72 rectfill showpage\n";
    fs::write(bench.path("a4.ps"), page).unwrap();
    let said = bench.refused(1, "plan layers a4.ps");
    assert!(said.contains("room for 203.2 x 269.7 mm") && said.contains("--crop"), "{said}");
    assert!(!said.contains("--dpi"), "{said}");
    bench.done("layers a4.ps --crop --at 0x0mm -o a4.print");
    let job = json(&bench.done("inspect a4.print/job.rgl --json"));
    let bounds = &job["passes"][0]["bounds"];
    let of = |name: &str| bounds[name].as_f64().unwrap();
    // An inch of 600 dots, 100 points from the left and below, less the margins of 80 and 284 dots.
    let (x, y) = (100.0 * 600.0 / 72.0 - 80.0, (841.89 - 172.0) * 600.0 / 72.0 - 284.0);
    assert!((of("width") - 600.0).abs() <= 2.0 && (of("height") - 600.0).abs() <= 2.0, "{bounds}");
    assert!((of("x") - x).abs() <= 4.0 && (of("y") - y).abs() <= 9.0, "{bounds}: {x}, {y}");
}

#[test]
fn the_plan_and_its_page_say_what_is_mirrored_and_assumed_and_show_every_pass() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    layer(&bench, "gold.png", 10..20, 10..30);
    let words = bench.done("plan layers white.png gold.png --mirror --paper postcard --html plan.html");
    let page = fs::read_to_string(bench.path("plan.html")).unwrap();
    assert!(words.contains("\nmirrored left to right\n"), "{words}");
    assert!(page.contains("<b>Mirrored</b> left to right"));
    for text in [&words, &page] {
        assert!(text.contains("white.png states no resolution, so it is printed at 600 dpi"), "{text}");
    }
    bench.done("layers white.png gold.png --mirror --paper postcard -o d.print");
    assert!(fs::read_to_string(bench.path("d.print/plan.html")).unwrap().contains("<b>Mirrored</b>"));
    let plain = bench.done("plan layers white.png gold.png --paper postcard --html plain.html");
    assert!(
        !plain.contains("mirrored")
            && !fs::read_to_string(bench.path("plain.html")).unwrap().contains("irrored")
    );

    // Each pass by itself: gold lies left of the middle, and right of it when mirrored.
    let darkest = |page: &str, alt: &str| {
        let at = page.find(&format!("alt=\"{alt}\"")).unwrap_or_else(|| panic!("{alt}"));
        let data = page[at..].split("base64,").nth(1).unwrap().split('"').next().unwrap();
        let picture = image::load_from_memory(&decoded(data)).unwrap().to_rgb8();
        let ground = picture.get_pixel(0, 0).0;
        let columns: Vec<u32> =
            picture.enumerate_pixels().filter(|(.., pixel)| pixel.0 != ground).map(|(x, ..)| x).collect();
        let mean = columns.iter().sum::<u32>() as f64 / columns.len() as f64;
        (picture.width(), picture.height(), mean / f64::from(picture.width()))
    };
    let (width, height, place) = darkest(&page, "pass 2, metallic-gold");
    assert_eq!((width, height), (60, 40));
    assert!((place - 45.0 / 60.0).abs() < 0.02, "{place}");
    let plain = fs::read_to_string(bench.path("plain.html")).unwrap();
    assert!((darkest(&plain, "pass 2, metallic-gold").2 - 15.0 / 60.0).abs() < 0.02);
    darkest(&plain, "pass 1, white");
    darkest(&plain, "the sheet as it is printed");
}

/// Bytes of base64.
fn decoded(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u32> = text.bytes().filter(|&c| c != b'=').map(|c| u32::from(value(c))).collect();
    let group = |four: &[u32]| {
        let bits = (0..4).fold(0, |bits, at| bits << 6 | four.get(at).copied().unwrap_or(0));
        bits.to_be_bytes()[1..four.len()].to_vec()
    };
    digits.chunks(4).flat_map(group).collect()
}

#[test]
fn marks_are_no_cover_of_the_art() {
    let bench = Bench::new();
    layer(&bench, "black.png", 0..60, 0..40);
    let art = "plan layers black.png --paper postcard --json --crop-marks --registration-marks";
    let pass = &json(&bench.done(art))["passes"][0];
    assert_eq!(pass["share"], 1.0, "{pass}");
    assert!(pass["dots"].as_u64().unwrap() > 60 * 40, "{pass}");
}

#[test]
fn ribbon_has_its_price_in_ledger_and_plan() {
    let bench = Bench::new();
    layer(&bench, "white.png", 0..60, 0..40);
    let plan = || bench.done("plan layers white.png --paper postcard");
    assert!(!plan().contains("Cost:"));
    assert!(bench.done("ledger price white 12 EUR").contains("white: 12.00 EUR a cartridge"));
    assert!(
        plan()
            .contains("Cost: a cartridge of white is 12.00 EUR; how much ribbon one gives is not known yet")
    );
    assert!(bench.done("ledger").contains("12.00 EUR a cartridge"));
    bench.done("ledger price white 12,50 EUR --length 25.4m");
    // 60 dots of ribbon are 2.54 mm: 12.50 EUR for ten thousand times as much.
    let json_plan = json(&bench.done("plan layers white.png --paper postcard --json"));
    let cost = &json_plan["costs_estimated"][0];
    assert!((cost["amount"].as_f64().unwrap() - 0.00125).abs() < 1e-9 && cost["currency"] == "EUR", "{cost}");
    assert!(plan().contains("for the ribbon of white"), "{}", plan());
    bench.done("plan layers white.png --paper postcard --html plan.html");
    assert!(fs::read_to_string(bench.path("plan.html")).unwrap().contains("for the ribbon of white"));
    let totals = json(&bench.done("ledger --json"));
    assert_eq!(totals["ribbons"][0]["price"]["ribbon_mm"], 25400.0);
    // A new price keeps the length.
    assert!(bench.done("ledger price white 13 EUR").contains("white: 13.00 EUR a cartridge of 25.4"));
    assert_eq!(json(&bench.done("ledger --json"))["ribbons"][0]["price"]["ribbon_mm"], 25400.0);
    assert!(bench.done("ledger price gold 20 EUR").contains("metallic-gold: 20.00 EUR"));
    for wrong in ["white twelve EUR", "white -1 EUR", "white 12 12", "white 12 EUR --length 2", "tin 12 EUR"]
    {
        bench.refused(2, &format!("ledger price {wrong}"));
    }
}

#[test]
fn a_file_holds_one_copy_and_says_so() {
    let bench = Bench::new();
    layer(&bench, "white.png", 0..60, 0..40);
    let before = bench.entries();
    let said = bench.refused(1, "layers white.png --paper postcard --to file:job.rgl --copies 2");
    assert!(said.contains("`foilpress send job.rgl --copies 2`"), "{said}");
    assert_eq!(bench.entries(), before);
    bench.done("layers white.png --paper postcard --to file:job.rgl -o d.print");
    let said = bench.refused(1, "send job.rgl --to file:copy.rgl --copies 3");
    assert!(said.contains("--copies counts printed sheets") && !bench.path("copy.rgl").exists(), "{said}");
}

#[test]
fn a_failed_inspection_leaves_no_folder() {
    let bench = Bench::new();
    layer(&bench, "white.png", 0..60, 0..40);
    bench.done("layers white.png --paper postcard -o d.print");
    let job = fs::read(bench.path("d.print/job.rgl")).unwrap();
    fs::write(bench.path("cut.rgl"), &job[..job.len() - 4]).unwrap();
    let said = bench.refused(1, "inspect cut.rgl --passes passes");
    assert!(said.contains("no passes are written") && !bench.path("passes").exists(), "{said}");
    bench.done("inspect d.print/job.rgl --passes passes");
    assert_eq!(entries(&bench.path("passes")), ["01-white.png"]);
}

#[test]
fn default_names_can_be_typed_as_they_stand() {
    let bench = Bench::new();
    bench.done("chart ramp K C");
    let made = bench.entries();
    assert!(
        made.iter().any(|name| name.ends_with(".print")) && !made.iter().any(|name| name.contains(' ')),
        "{made:?}"
    );
}

#[test]
fn ten_millimetres_of_choke_are_not_more_than_ten() {
    let bench = Bench::new();
    GrayImage::from_pixel(600, 600, Luma([0])).save(bench.path("white.png")).unwrap();
    let plan = json(&bench.done("plan layers white.png --choke 10mm --paper postcard --json"));
    // 236 dots and a bit less on each side.
    assert_eq!(plan["passes"][0]["dots"], (600 - 2 * 236) * (600 - 2 * 236));
    let said = bench.refused(2, "plan layers white.png --choke 10.001mm --paper postcard");
    assert!(said.contains("from 0 to 10 mm"), "{said}");
}

#[test]
fn line_art_prints_at_1200_dpi_in_process_inks_and_in_no_other() {
    let bench = Bench::new();
    // Lines of one dot at 1200 dpi, for 120 x 60 dots of 1/1200 inch.
    let lines = |x: u32, _| Luma([if x.is_multiple_of(2) { 0 } else { 255 }]);
    GrayImage::from_fn(120, 60, lines).save(bench.path("black.png")).unwrap();
    layer(&bench, "white.png", 0..60, 0..40);
    let art = "black.png --dpi 1200 --resolution 1200 --paper postcard";
    let words = bench.done(&format!("layers {art} -o fine.print"));
    assert!(words.contains("printed at 1200 x 600 dpi") && words.contains("2.5 x 1.3 mm"), "{words}");
    let job = json(&bench.done("inspect fine.print/job.rgl --json"));
    assert_eq!(job["setup"]["resolution"], serde_json::json!([1200, 600]), "{job}");
    // 60 lines of 30 rows: the art's columns are the printer's, its rows are half as many.
    assert_eq!(job["passes"][0]["dots"], 60 * 30);
    assert_eq!(job["passes"][0]["bounds"]["width"], 119);
    // The plan from its bytes is the same, and the preview has the sheet's shape.
    let (own, again) = (
        json(&bench.done(&format!("plan layers {art} --json"))),
        json(&bench.done("plan fine.print/job.rgl --json")),
    );
    assert_eq!(
        (&own["resolution_dpi"], &own["passes"][0]["dots"]),
        (&again["resolution_dpi"], &again["passes"][0]["dots"])
    );
    assert_eq!(image::image_dimensions(bench.path("fine.print/preview.png")).unwrap(), (120, 60));
    // Pixels per metre: a pass has the printer's dots, the preview the sheet's shape.
    bench.done("inspect fine.print/job.rgl --passes seen");
    for (picture, expected) in [
        ("seen/01-black.png", (47244, 23622)),
        ("fine.print/passes/01-black.png", (47244, 23622)),
        ("fine.print/separation.png", (47244, 23622)),
        ("fine.print/preview.png", (47244, 47244)),
        ("fine.print/preview-01-black.png", (47244, 47244)),
    ] {
        let file = std::io::BufReader::new(fs::File::open(bench.path(picture)).unwrap());
        let dims = png::Decoder::new(file).read_info().unwrap().info().pixel_dims.unwrap();
        assert_eq!((dims.xppu, dims.yppu), expected, "{picture}");
    }
    for command in ["simulate fine.print/job.rgl -o fine.sheet", "preview fine.print/job.rgl -o fine.html"] {
        let said = bench.refused(1, command);
        assert!(
            said.contains("fine.print/job.rgl") && said.contains("`foilpress plan JOB --html FILE`"),
            "{said}"
        );
    }
    // A job is as it is.
    let note = "a job is planned as it is, so --size, --mirror have no effect";
    let plan = json(&bench.done("plan fine.print/job.rgl --size 3mm --mirror --json"));
    assert_eq!(plan["notes"], serde_json::json!([note]));
    let said = bench.refused(1, "layers white.png --resolution 1200 --paper postcard");
    assert!(said.contains("print at 600 dpi, or without white"), "{said}");
    assert!(
        bench
            .done("plan layers white.png --resolution 1200 --paper postcard")
            .contains("error: only cyan, magenta")
    );
    assert!(bench.refused(2, "layers white.png --resolution 2400").contains("600 or 1200 dpi"));
}

#[test]
fn a_job_replaces_a_job_and_nothing_else() {
    let bench = Bench::new();
    layer(&bench, "white.png", 5..55, 5..35);
    bench.done("layers white.png --paper postcard -o a.print");
    for (name, content) in [("mine.txt", "my notes"), ("mine.json", "{}"), ("mine.csv", "a,b")] {
        fs::write(bench.path(name), content).unwrap();
        let said = bench.refused(1, &format!("send a.print/job.rgl --to file:{name}"));
        assert!(said.contains(name) && said.contains("choose another name"), "{said}");
        assert_eq!(fs::read_to_string(bench.path(name)).unwrap(), content);
    }
    fs::write(bench.path("empty.rgl"), "").unwrap();
    for _ in 0..2 {
        bench.done("send a.print/job.rgl --to file:empty.rgl");
    }
}

#[test]
fn lists_are_there_for_programs() {
    let bench = Bench::new();
    // The preset that is built in.
    let preset = &json(&bench.done("preset list --json"))[0];
    assert_eq!((&preset["name"], &preset["options"]["metric"]), (&"paper".into(), &"paper".into()));
    assert_eq!(json(&bench.done("profile list --json")), Value::Array(Vec::new()));
    assert_eq!(json(&bench.done("resume --list --json")), Value::Array(Vec::new()));
    bench.done("preset save decal --media film --mirror");
    bench.done("preset use decal");
    bench.done("profile set default --cross 20.4x29.7mm --distance 200.3mm");
    let preset = &json(&bench.done("preset list --json"))[0];
    assert_eq!((&preset["name"], &preset["in_use"]), (&"decal".into(), &true.into()));
    assert_eq!((&preset["options"]["media"], &preset["options"]["mirror"]), (&"film".into(), &true.into()));
    let profile = &json(&bench.done("profile list --json"))[0];
    assert_eq!(profile["name"], "default");
    assert!(
        (profile["feed"].as_f64().unwrap() - 1.0).abs() < 0.01 && profile["offset_mm"].is_array(),
        "{profile}"
    );
    bench.refused(2, "resume --json");
    let said = bench.refused(2, "doctor --to file:job.rgl");
    assert!(said.contains("is not the address of a bridge") && !said.contains("or file:"), "{said}");
    // A print system of scripts: one queue of ours, one of another maker.
    let path = script(
        &bench,
        "lpstat",
        "case $1 in -v) echo 'device for Alps: foilpress:/usb'; echo 'device for Other: usb://x';; \
        -p) echo 'printer Alps is idle.  enabled since now'; echo '\tready';; esac\n",
    );
    let output = bench.command("queue list --json").env("PATH", path).output().unwrap();
    let queues = json(&text(&output.stdout));
    assert_eq!(queues.as_array().unwrap().len(), 1, "{queues}");
    assert_eq!((&queues[0]["name"], &queues[0]["state"][1]), (&"Alps".into(), &"ready".into()));
    // No bridge is here: the problem is in the list, and the exit code says so as well.
    let output = bench.command("doctor --json --to tcp:127.0.0.1:1").output().unwrap();
    let found = json(&text(&output.stdout));
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(found["bridges"][0]["addresses"][0], "tcp:127.0.0.1:1");
    assert!(!found["problems"].as_array().unwrap().is_empty() && found["jobs_folder"].is_string(), "{found}");
}

#[test]
fn a_document_without_a_page_to_draw_says_why_in_layers_and_in_a_queue() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    // An empty document whose password nobody knows.
    let objects = "%PDF-1.4\n1 0 obj\n<< /Type /Catalog /Pages 2 0 R >>\nendobj\n2 0 obj\n<< /Type /Pages /Kids [] /Count 0 >>\nendobj\n";
    let locked = format!(
        "{objects}xref\n0 3\n0000000000 65535 f \n{:010} 00000 n \n{:010} 00000 n \ntrailer << /Size 3 /Root 1 0 R /Encrypt \
         << /Filter /Standard /V 1 /R 2 /O <{}> /U <{}> /P -4 >> /ID [<33> <33>] >>\nstartxref\n{}\n%%EOF\n",
        objects.find("1 0 obj").unwrap(),
        objects.find("2 0 obj").unwrap(),
        "11".repeat(32),
        "22".repeat(32),
        objects.len()
    );
    for (name, document, why) in [
        ("stub.pdf", "%PDF-1.4\n", "it is damaged (Ghostscript says `"),
        ("locked.pdf", &locked, "it is encrypted and needs a password"),
        ("none.ps", "%!PS\n1 pop\n", "it has no page"),
    ] {
        fs::write(bench.path(name), document).unwrap();
        let file = bench.path(name).display().to_string();
        for command in
            [format!("layers {file}"), format!("cups-filter 1 me title 1 FoilpressSpots=Named {file}")]
        {
            let output = bench.command(&command).output().unwrap();
            let said = text(&output.stderr);
            assert!(!output.status.success() && said.contains(why), "{command}: {said}");
            assert!(!said.contains("blank"), "{command}: {said}");
        }
    }
}

#[test]
fn a_spot_colour_that_may_be_an_ink_has_a_remedy_in_a_queue() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let filtered = |spot: &str, option: &str| {
        let page = format!(
            "%!PS\n<</PageSize[288 216]>>setpagedevice\n[/Separation ({spot}) /DeviceCMYK {{pop 0 1 1 0}}] setcolorspace \
             1 setcolor 100 100 50 50 rectfill showpage\n"
        );
        fs::write(bench.path("spot.ps"), page).unwrap();
        let file = bench.path("spot.ps").display().to_string();
        let output = bench.command(&format!("cups-filter 1 me title 1 {option} {file}")).output().unwrap();
        (output.status.success(), text(&output.stderr))
    };
    let (done, said) = filtered("Golden", "FoilpressSpots=Named");
    assert!(!done && said.contains("FoilpressSpots=Off prints it in process inks"), "{said}");
    assert!(
        said.contains("spot colour `Golden` names no ink (did you mean `gold`?); rename the spot colour"),
        "{said}"
    );
    // The print system keeps the document under a name of its own.
    assert!(said.contains("this document: spot colour") && !said.contains("spot.ps"), "{said}");
    // What names no ink is said, unless nobody asked for inks; what names a process ink is no surprise.
    let note = "page 1: spot colour `Fold` names no ink: printed by its process colours";
    for (spot, option, noted) in [
        ("Golden", "FoilpressSpots=Off", false),
        ("Fold", "FoilpressSpots=Named", true),
        ("Fold", "FoilpressSpots=Reserved", true),
        ("Fold", "FoilpressSpots=Off", false),
        ("Magenta", "FoilpressSpots=Named", false),
    ] {
        let (done, said) = filtered(spot, option);
        assert!(done && said.matches(note).count() == usize::from(noted), "{spot}, {option}: {said}");
        assert!(noted || !said.contains("names no ink"), "{spot}, {option}: {said}");
    }
}

#[test]
fn a_page_without_the_reserved_white_is_printed_without_white() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let filtered = |greys: &[&str]| {
        let page = |grey: &&str| {
            format!("{grey} setgray 100 100 50 50 rectfill 0 setgray 30 100 50 50 rectfill showpage\n")
        };
        let pages: String = greys.iter().map(page).collect();
        fs::write(bench.path("pages.ps"), format!("%!PS\n<</PageSize[288 216]>>setpagedevice\n{pages}"))
            .unwrap();
        let file = bench.path("pages.ps").display().to_string();
        let output = bench
            .command(&format!("cups-filter 1 me title 1 FoilpressWhite=Reserved {file}"))
            .output()
            .unwrap();
        let said = text(&output.stderr);
        assert!(output.status.success(), "{said}");
        let passes = press::inspect::sheets(&output.stdout).into_iter().flat_map(|sheet| {
            let seen = press::inspect::inspect(&output.stdout[sheet], &observe::Silent);
            seen.inspection.passes.into_iter().map(|pass| pass.ink.to_string()).collect::<Vec<String>>()
        });
        (passes.collect::<Vec<String>>(), said)
    };
    let none = "no page has the reserved white";
    // 230 of 255, and black alone.
    let (inks, said) = filtered(&[".902", "0"]);
    assert_eq!(inks, ["white", "black", "black"]);
    assert!(said.contains("page 2: nothing has the reserved white") && !said.contains(none), "{said}");
    let (inks, said) = filtered(&["0"]);
    assert_eq!(inks, ["black"]);
    assert!(said.contains(none), "{said}");
}

#[test]
fn a_page_larger_than_any_sheet_is_told_in_millimetres_with_what_to_do() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let page = "%!PS\n<</PageSize[3000 3000]>>setpagedevice\n9 9 99 99 rectfill showpage\n";
    fs::write(bench.path("large.ps"), page).unwrap();
    let file = bench.path("large.ps").display().to_string();
    let output =
        bench.command(&format!("cups-filter 1 me title 1 FoilpressSpots=Off {file}")).output().unwrap();
    let said = text(&output.stderr);
    assert!(said.contains("page 1 is 1058 x 1058 mm") && said.contains("choose a paper"), "{said}");
}
