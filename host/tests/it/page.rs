//! Pages, plans, presets and ribbons as users of the program meet them.

use std::fs;

use observe::Silent;
use press::simulate;
use serde_json::Value;
use sheet::Sheet;

use testing::device::Device;
use testing::program::{Bench, small_document, text};

const SMALL: &str = "--size 12x8mm --paper postcard";

fn printed(bench: &Bench, job: &str) -> Sheet {
    let job = fs::read(bench.path(job)).expect("a job");
    simulate::print(&job, &simulate::Setup::default(), &Silent).expect("it prints").sheet().expect("a sheet")
}

fn json(said: &str) -> Value {
    serde_json::from_str(said).expect("JSON")
}

/// The stack of a dot, by name.
fn at(sheet: &Sheet, x: usize, y: usize) -> String {
    sheet.stacks()[usize::from(sheet.index()[y * sheet.width() + x])].to_string()
}

#[test]
fn a_document_is_placed_repeated_and_mirrored_dot_by_dot() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done(&format!("print tile {SMALL} -q --to file:plain.rgl"));
    let place = "--at 10x20mm --repeat 2x3 --gap 1x2mm";
    bench.done(&format!("print tile {SMALL} -q {place} --mirror --to file:page.rgl"));
    let (plain, page) = (printed(&bench, "plain.rgl"), printed(&bench, "page.rgl"));
    // 12 x 8 mm are 283 x 189 dots, in the middle of 2202 x 3082; 10 x 20 mm are 236 x 472 from the paper's
    // corner, which is 80 x 71 dots from that of the printable area; gaps are 24 and 47 dots.
    let (left, top) = ((2202 - 283) / 2, (3082 - 189) / 2);
    let mut inked = 0;
    for (row, column) in (0..3).flat_map(|row| (0..2).map(move |column| (row, column))) {
        for (x, y) in (0..189).step_by(4).flat_map(|y| (0..283).map(move |x| (x, y))) {
            let want = at(&plain, left + 282 - x, top + y);
            let found = at(&page, 236 - 80 + column * (283 + 24) + x, 472 - 71 + row * (189 + 47) + y);
            assert_eq!(found, want, "copy {column}, {row}, dot {x}, {y}");
            inked += usize::from(want != "substrate");
        }
    }
    assert!(inked > 1000);
    let all = |sheet: &Sheet| sheet.index().iter().filter(|&&dot| dot != 0).count();
    assert_eq!(all(&page), 6 * all(&plain));
}

#[test]
fn what_would_be_cut_is_refused_in_mm_before_the_long_work() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.refused(1, &format!("print tile {SMALL} --at 1x20mm"));
    assert!(said.contains("2.4 mm at the left") && said.contains("--crop"), "{said}");
    let plan = bench.done(&format!("print tile {SMALL} -q --at 1x20mm --crop"));
    assert!(plan.contains("cut off beyond the printable area: 2.4 mm at the left"), "{plan}");
    for (args, word) in [
        ("--repeat 0x2", "3x4"),
        ("--gap -1mm", "0 or more"),
        ("--at 20", "20x30mm"),
        ("--paper 300x200mm", "215.9"),
    ] {
        let said = bench
            .refused(2, &format!("print tile --size 12x8mm {}", args.replace("--gap -1mm", "--gap=-1mm")));
        assert!(said.contains(word), "{args}: {said}");
    }
    // More than the page holds can be cut, more than any sheet cannot; --crop is advised where it helps.
    let said = bench.refused(1, "plan tile --size 250mm");
    assert!(said.contains("a4 has room for") && said.contains("--crop"), "{said}");
    let said = bench.refused(1, "plan tile --size 400mm --crop");
    assert!(said.contains("the largest sheet") && said.contains("give a smaller --size"), "{said}");
    assert!(!said.contains("--crop") && !said.contains("a4"), "{said}");
}

#[test]
fn soft_borders_of_coarse_documents_are_announced() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = |args: &str| {
        let output = bench.run(args);
        assert!(output.status.success(), "{args}: {}", text(&output.stderr));
        text(&output.stderr)
    };
    let coarse = said("plan tile --size 90mm");
    assert!(coarse.contains("a pixel of the document is 3.8 mm wide on paper"), "{coarse}");
    assert!(coarse.contains("about 4 mm soft"), "{coarse}");
    assert!(!said("plan tile --size 30mm").contains(" soft"));
    // One material has no borders, however large its only pixel is.
    fs::write(bench.path("one.csv"), "theta_h_deg,r,g,b\n0,0.3,0.2,0.1\n90,0.3,0.2,0.1\n").expect("a curve");
    assert!(!said("plan one.csv").contains(" soft"));
}

#[test]
fn differences_say_what_they_count() {
    let bench = Bench::new();
    fs::create_dir(bench.path("mirror")).expect("a folder");
    for (name, grey) in [("base_color", 230), ("roughness", 60), ("metallic", 255)] {
        let picture = image::RgbImage::from_pixel(4, 4, image::Rgb([grey; 3]));
        picture.save(bench.path(&format!("mirror/{name}.png"))).expect("a picture");
    }
    let said = |args: &str| text(&bench.run(&format!("plan mirror {SMALL} {args}")).stderr);
    let light = said("");
    let of = "with silver-foil the inks would come";
    assert!(light.contains(of) && light.contains("nearer to this document (root mean square"), "{light}");
    assert!(light.contains("difference, light, hue and grain included, "), "{light}");
    let paper = said("--preset paper");
    assert!(paper.contains(of) && paper.contains("nearer to the bases of this document"), "{paper}");
    assert!(paper.contains("difference d ") && !paper.contains("light included"), "{paper}");
}

/// Documents of materials, on plain paper with the default inks: metal, black, white, gloss.
#[test]
fn rules_that_the_program_can_keep_are_kept_unless_the_owner_asks() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let touched = |args: &str| -> Vec<String> {
        let plan: serde_json::Value =
            serde_json::from_str(&bench.done(&format!("plan {args} --json -q"))).expect("JSON");
        let checks = plan["checks"].as_array().expect("checks");
        checks.iter().map(|check| check["rule"].as_str().expect("a name").to_owned()).collect()
    };
    let mut asked = Vec::new();
    for document in ["sample:leaf --size 30mm", "sample:flange --size 30mm", &format!("tile {SMALL}")] {
        let plain = touched(document);
        for (rule, _) in
            press::separate::keepers().filter(|(_, keeper)| *keeper == press::separate::Keeper::Program)
        {
            assert!(!plain.iter().any(|touched| touched == rule), "{document}: {plain:?}");
        }
        asked.extend(touched(&format!("{document} --inks P,silver-foil")));
    }
    for rule in ["primer-ribbon", "foil-code"] {
        assert!(asked.iter().any(|touched| touched == rule), "{rule}: {asked:?}");
    }
}

#[test]
fn nothing_is_sent_before_the_plan_was_confirmed() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let mut port = Device::at(&bench.path("port"));
    let said = bench.refused(1, &format!("print tile {SMALL} -q --to raw:port"));
    assert!(said.contains("--yes"), "{said}");
    assert!(port.taken().is_empty(), "something was sent");
    bench.done(&format!("print tile {SMALL} -q --to raw:port --yes"));
    assert!(port.taken() == fs::read(bench.path("tile.print/job.rgl")).unwrap());
}

#[test]
fn copies_wait_for_enter_and_every_ribbon_is_counted() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done(&format!("print tile {SMALL} -q --media film --to file:job.rgl"));
    let job = fs::read(bench.path("job.rgl")).unwrap();
    let mut port = Device::at(&bench.path("port"));
    let mut send = |answers: &str| {
        let output = bench.answered("send job.rgl --to raw:port --copies 3", answers);
        (output.status.code(), text(&output.stderr), port.taken().len())
    };
    let (code, _, length) = send("\n\n");
    assert_eq!((code, length), (Some(0), 3 * job.len()));
    let (code, said, _) = send("\n");
    assert_eq!(code, Some(1));
    assert!(said.contains("2 of 3 sheets are sent") && said.contains("--copies 1"), "{said}");
    // Five sheets in all: five times the ribbon of the plan.
    let plan = json(&bench.done("plan job.rgl --json"));
    let ledger = json(&bench.done("ledger --json"));
    for cartridge in plan["cartridges"].as_array().unwrap() {
        let ribbons = ledger["ribbons"].as_array().unwrap();
        let total = ribbons.iter().find(|total| total["ink"] == cartridge["ink"]).expect("counted");
        let want = 5.0 * cartridge["ribbon_mm_estimated"].as_f64().unwrap();
        assert!((total["ribbon_mm"].as_f64().unwrap() - want).abs() < 1e-6, "{total} {want}");
    }
    let ink = plan["cartridges"][0]["ink"].as_str().unwrap();
    bench.done(&format!("ledger new {ink}"));
    assert!(bench.done("ledger").contains("0 mm  0 passes, since it was new"));
    assert!(bench.refused(2, "ledger new blak").contains("did you mean `black`"));
}

#[test]
fn the_plan_of_a_job_has_the_figures_that_are_in_its_bytes() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done(&format!(
        "print tile {SMALL} -q --repeat 2x1 --gap 3mm --media thick --curl off --to file:job.rgl"
    ));
    let plan = json(&bench.done("plan job.rgl --json"));
    let inspected = json(&bench.done("inspect job.rgl --json"));
    assert_eq!((&plan["media"], &plan["curl_correction"]), (&Value::from("cardboard"), &Value::from(false)));
    let (planned, passes) = (plan["passes"].as_array().unwrap(), inspected["passes"].as_array().unwrap());
    assert_eq!(planned.len(), passes.len());
    for (plan, pass) in planned.iter().zip(passes) {
        assert_eq!((&plan["ink"], &plan["dots"]), (&pass["ink"], &pass["dots"]));
        // 8 mm are one band: the ribbon is as long as the print is wide.
        let (ribbon, width) = (&plan["estimate"]["ribbon_mm"], &pass["bounds"]["mm"][2]);
        assert!((ribbon.as_f64().unwrap() - width.as_f64().unwrap()).abs() < 1e-6, "{plan} {pass}");
        assert_eq!(plan["estimate"]["bands"], 1);
    }
    // The same from the document, before there is a job.
    let before =
        bench.done(&format!("plan tile {SMALL} --repeat 2x1 --gap 3mm --media thick --curl off --json"));
    assert_eq!(json(&before)["passes"].as_array().map(Vec::len), Some(planned.len()));
    assert_eq!(json(&before)["copies"], serde_json::json!([2, 1]));
    bench.done("plan job.rgl --html page.html");
    let page = fs::read_to_string(bench.path("page.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("://"), "whole in itself");
    assert!(page.contains("cardboard") && page.contains(passes[0]["cartridge"].as_str().unwrap()));
}

#[test]
fn a_preset_stands_for_its_options_and_gives_way_to_what_is_typed() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("preset save card --paper postcard --size 12x8mm --media=film --mirror");
    bench.done(&format!("print tile {SMALL} -q --media film --mirror --to file:typed.rgl"));
    bench.done("print tile -q --preset card --to file:preset.rgl");
    assert!(fs::read(bench.path("typed.rgl")).unwrap() == fs::read(bench.path("preset.rgl")).unwrap());
    let plan = json(&bench.done("plan tile --preset card --media thick --json"));
    assert_eq!((&plan["media"], &plan["paper"]), (&Value::from("cardboard"), &Value::from("postcard")));
    bench.done("preset use card");
    assert!(bench.done("preset list").contains("(in use)"));
    assert_eq!(json(&bench.done("plan tile --json"))["media"], "plain");
    assert_eq!(json(&bench.done("plan tile --json"))["curl_correction"], false);
    bench.done("preset use none");
    assert!(bench.refused(1, "print tile --preset crad").contains("card"));
    assert!(
        bench
            .refused(2, "preset save bad --media foo")
            .contains("expected one of the media paper, thick, film")
    );
    assert!(bench.refused(2, "preset save ../x --mirror").contains("is not a valid name"));
    assert!(bench.refused(2, "preset save none --mirror").contains("no preset is used"));
    assert!(!bench.entries().contains(&"x.toml".to_string()));
}

#[test]
fn a_preset_or_a_profile_that_cannot_be_used_is_named_and_hides_no_other() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("preset save card --paper postcard");
    bench.done("preset save white --white under");
    bench.done("profile set desk --cross 20.4x29.7mm");
    let config = |args: &str| {
        let mut command = bench.command(args);
        command.env("FOILPRESS_CONFIG", bench.path("config"));
        command
    };
    for folder in ["presets", "profiles"] {
        fs::create_dir_all(bench.path("config").join(folder)).unwrap();
        fs::write(bench.path("config").join(folder).join("bad.toml"), "format=").unwrap();
    }
    for (save, list, good) in [
        ("preset save card --paper postcard", "preset list", "card             --paper=postcard"),
        ("profile set desk --cross 20.4x29.7mm", "profile list", "desk             offset 0.40"),
    ] {
        assert!(config(save).output().unwrap().status.success());
        let listed = config(list).output().unwrap();
        let said = text(&listed.stdout);
        assert!(listed.status.success() && said.contains(good), "{said}");
        assert!(said.contains("bad.toml: TOML parse error at line 1"), "{said}");
        let rows = json(&text(&config(&format!("{list} --json")).output().unwrap().stdout));
        let row = rows.as_array().unwrap().iter().find(|row| row["name"] == "bad").unwrap();
        assert!(row["error"].as_str().unwrap().contains("bad.toml: TOML parse error"), "{row}");
    }
    let said = text(&config("plan tile --preset bad").output().unwrap().stderr);
    assert!(said.contains("preset `bad` cannot be used") && said.contains("bad.toml: TOML"), "{said}");
    // A preset for art alone.
    let said = bench.refused(2, "plan tile --preset white");
    assert!(said.contains("white.toml) does not fit this command") && said.contains("--white"), "{said}");
    bench.done("preset use card");
    let paper = |args: &str| json(&bench.done(&format!("plan tile -q --json {args}")))["paper"].clone();
    assert_eq!((paper(""), paper("--preset none")), ("postcard".into(), "a4".into()));
    // A command that needs the name of a file to write takes it, too.
    let output = bench.run("preview tile --pixels 32 -o tile.png");
    assert!(
        text(&output.stderr).contains("note: preset `card`: --paper=postcard"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn a_measured_machine_is_corrected_without_being_named() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("profile set default --cross 21x30mm");
    let output = bench.run(&format!("print tile {SMALL} -q --at 20x30mm --to file:moved.rgl"));
    assert!(text(&output.stderr).contains("using the printer's profile"), "{}", text(&output.stderr));
    let plan = json(&bench.done("plan moved.rgl --json"));
    // It prints 1 mm too far to the right: what is sent lies 1 mm further left.
    assert!((plan["from_edge_mm"][0].as_f64().unwrap() - 19.0).abs() < 0.1, "{}", plan["from_edge_mm"]);
    assert!(bench.refused(2, "profile set x --cross 50x50mm").contains("measure them again"));
    assert!(bench.refused(1, "print tile --profile other").contains("(there are: default)"));
}

#[test]
fn charts_are_sheets_like_any_other() {
    let bench = Bench::new();
    let plan = bench.done("chart ramp MS MS+F -q -o ramp --to file:ramp.rgl");
    assert!(plan.contains("Metallic Silver") && plan.contains("Finish"), "{plan}");
    assert!(fs::read(bench.path("ramp.rgl")).unwrap() == fs::read(bench.path("ramp/job.rgl")).unwrap());
    assert!(bench.path("ramp/preview-01-metallic-silver.png").exists());
    bench.done("inspect ramp.rgl");
    // Again into the same folder, with other passes: nothing of the old print stays.
    bench.done("chart calibration -q -o ramp");
    assert!(!bench.path("ramp/preview-01-metallic-silver.png").exists());
    assert!(bench.refused(1, "chart registration --inks black,black").contains("twice"));
    assert!(bench.refused(1, "chart stacks --inks all").contains("7 cartridges"));
    assert!(bench.refused(2, "chart ramp MS tin").contains("`tin`"));
}
