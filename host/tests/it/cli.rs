//! The program as its users meet it: arguments in, files and exit codes out.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use sheet::Sheet;
use testing::program::{Bench, entries, small_document, text};

#[test]
fn a_folder_becomes_a_print_with_everything_in_it() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let plan = bench.done("print tile --size 12x8mm --paper postcard");
    for word in ["pass", "cartridge", "dots"] {
        assert!(plan.contains(word), "{word} in the plan:\n{plan}");
    }
    assert_eq!(bench.entries(), ["tile", "tile.print"]);
    let made = entries(&bench.path("tile.print"));
    let (previews, others): (Vec<_>, Vec<_>) = made.into_iter().partition(|name| name.starts_with("preview"));
    assert_eq!(
        others,
        [
            "job.rgl",
            "materials.png",
            "passes",
            "plan.html",
            "report.html",
            "report.json",
            "separation.png",
            "sheet.html",
            "sheet.png"
        ]
    );
    let passes = entries(&bench.path("tile.print/passes")).len() - 1;
    assert_eq!(previews.len(), passes + 1, "all inks together and each pass by itself: {previews:?}");
    let report = fs::read_to_string(bench.path("tile.print/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["job"]["bytes"], fs::metadata(bench.path("tile.print/job.rgl")).unwrap().len());
    let stacks = report["plan"]["stacks"].as_array().expect("stacks").iter();
    let stacks: Vec<_> = stacks.map(|stack| stack["stack"].clone()).collect();
    assert_eq!(
        report["modelled"],
        serde_json::Value::Array(stacks),
        "no ink of the built-in library is measured"
    );
    // The document stands beside its print, though it has no bases, and these are not to be edited.
    let page = fs::read_to_string(bench.path("tile.print/sheet.html")).expect("a page");
    assert!(page.contains("show=document&with=printed"));
    assert!(page.contains("\"edits\":null") && !page.contains("\"document\":null"));
    // The same command again replaces its own folder and gives the same job to the byte.
    let job = fs::read(bench.path("tile.print/job.rgl")).expect("a job");
    bench.done("print tile --size 12x8mm --paper postcard --to file:again.rgl");
    assert_eq!(fs::read(bench.path("again.rgl")).expect("a job"), job);
}

#[test]
fn every_arrow_by_itself_gives_the_job_of_print() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("print tile --size 12x8mm --paper postcard --to file:whole.rgl");
    // Each step finds the name of what it writes by itself.
    bench.done("factor tile");
    bench.done("map tile.foil");
    bench.done("halftone tile.mix --size 12x8mm");
    bench.done("layout tile.dots --paper postcard");
    bench.done("separate tile.sheet");
    bench.done("encode tile.passes -o steps.rgl");
    assert!(fs::read(bench.path("whole.rgl")).unwrap() == fs::read(bench.path("steps.rgl")).unwrap());
    let page = "--paper b5 --at 30x40mm --repeat 2x3 --gap 4mm --mirror --crop-marks --registration-marks";
    bench.done(&format!("print tile --size 12x8mm {page} --media thick --curl off --to file:whole.rgl"));
    // On thick paper primer is at hand, which is held back on plain paper.
    bench.done("map tile.foil --inks +clear -o thick.mix");
    bench.done("halftone thick.mix --size 12x8mm");
    bench.done(&format!("layout thick.dots {page} -o page.sheet"));
    bench.done("separate page.sheet");
    bench.done("encode page.passes --media thick --curl off");
    assert!(fs::read(bench.path("whole.rgl")).unwrap() == fs::read(bench.path("page.rgl")).unwrap());
    // What the simulated printer makes of a job separates into the same job.
    bench.done("simulate page.rgl -o again.sheet");
    bench.done("separate again.sheet");
    bench.done("encode again.passes --media thick --curl off");
    assert!(fs::read(bench.path("again.rgl")).unwrap() == fs::read(bench.path("page.rgl")).unwrap());
    let said = bench.refused(1, "layout tile.dots --at 95x10mm --paper postcard");
    assert!(said.contains("mm at the right") && said.contains("--crop"), "{said}");
    // The simulated printer makes the very dots of the page, whatever it calls their stacks.
    bench.done("simulate steps.rgl -o printed.sheet");
    let stacks = |folder: &str| -> Vec<String> {
        let sheet = Sheet::load(&bench.path(folder)).unwrap();
        sheet.index().iter().map(|&dot| sheet.stacks()[usize::from(dot)].to_string()).collect()
    };
    assert!(stacks("printed.sheet") == stacks("tile.sheet"));
    let summary = bench.done("inspect steps.rgl --json --passes seen");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["passes"].as_array().map(Vec::len), Some(entries(&bench.path("seen")).len()));
}

#[test]
fn only_what_was_factored_and_not_changed_since_is_mapped_with_its_document() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    small_document(&bench.path("other"));
    fs::copy(bench.path("other/metallic.png"), bench.path("other/roughness.png")).unwrap();
    bench.done("factor tile --bases 3 -o tile.foil");
    bench.done("map tile.foil --document tile --inks process -o with.mix");
    let said = bench.refused(1, "map tile.foil --document other --inks process -o other.mix");
    assert!(said.contains("factored from another document") && said.contains("--document"), "{said}");
    bench.done("edit tile.foil --tint #20ff20 -o edited.foil");
    let said = bench.refused(1, "map edited.foil --document tile --inks process -o edited.mix");
    assert!(said.contains("it was edited"), "{said}");
    // Weights that are painted over: two bases change places.
    let [a, b, c] =
        ["weights-00.png", "weights-01.png", "swapped.png"].map(|map| bench.path("tile.foil").join(map));
    for (from, to) in [(&a, &c), (&b, &a), (&c, &b)] {
        fs::rename(from, to).unwrap();
    }
    let said = bench.refused(1, "map tile.foil --document tile --inks process -o painted.mix");
    assert!(said.contains("changed since it was factored"), "{said}");
    bench.done("map tile.foil --inks process -o painted.mix");
}

#[test]
fn choices_that_a_document_has_no_use_for_are_named() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("factor tile --bases 3 -o tile.foil");
    let said = |args: &str| text(&bench.run(args).stderr);
    let again = said("factor tile.foil --bases 2 --material 7 --colour-space linear -o again.foil");
    for words in ["keeps its bases", "choice of material `7` has no effect", "colour space has no effect"] {
        assert!(again.contains(words), "{words}: {again}");
    }
    assert!(!said("factor tile.foil -o plain.foil").contains("no effect"));
}

#[test]
fn an_owners_rule_keeps_a_stack_from_being_printed() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::create_dir(bench.path("mine")).unwrap();
    let rule = "format = 1\nbased_on = \"built-in\"\n[[rule]]\nname = \"bare\"\nsays = \"yellow peels\"\n\
                severity = \"error\"\ncertainty = \"measured\"\nover = \"yellow\"\nunder = \"all\"\n";
    fs::write(bench.path("mine/library.toml"), rule).unwrap();
    bench.done("factor tile -o tile.foil");
    bench.done("map tile.foil --inks process -o tile.mix");
    bench.done("halftone tile.mix --size 12x8mm -o tile.dots");
    bench.done("layout tile.dots --paper postcard -o tile.sheet");
    bench.done("separate tile.sheet -o tile.passes");
    let said = bench.refused(1, "separate tile.sheet --library mine -o other.passes");
    assert!(said.contains("must not be printed: yellow peels (stacks: ") && said.contains("M+Y"), "{said}");
    assert!(!bench.entries().contains(&"other.passes".to_string()));
    // With the rule known from the start, no such stack is chosen.
    bench.done("map tile.foil --inks process --library mine -o kept.mix");
    bench.done("halftone kept.mix --size 12x8mm -o kept.dots");
    bench.done("layout kept.dots --paper postcard -o kept.sheet");
    bench.done("separate kept.sheet --library mine -o kept.passes");
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let bench = Bench::new();
    bench.refused(2, "");
    bench.refused(2, "print");
    bench.refused(2, "print sample:leaf --sise 3mm");
    let said = bench.refused(2, "print sample:leaf --size big");
    assert!(said.contains("120x90mm"), "{said}");
    let said = bench.refused(2, "print sample:leaf --paper a3");
    assert!(said.contains("a4"), "{said}");
    for (args, expected) in [
        ("print sample:leaf --inks process,metalic-silver", "did you mean `metallic-silver`"),
        ("layers white.png --inks goold", "--inks: `goold` is neither an ink nor"),
        ("layers white.png --knockout pinc", "--knockout: `pinc` is neither an ink nor"),
        ("layers white.png --choke 50mm", "from 0 to 10 mm"),
        ("preview sample:leaf -o out.jpg", "must end in .html, .png, .exr or .glb"),
        ("profile set --cross 99x30mm mine", "--cross and --distance"),
    ] {
        let said = bench.refused(2, args);
        assert!(said.contains(expected), "{args}: {said}");
    }
    let said = bench.refused(2, "inks choose sample:leaf --cartridges 8");
    assert!(said.contains("from 1 to 7"), "{said}");
}

#[test]
fn what_cannot_be_is_refused_before_the_long_work() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.refused(1, "plan tile --size 12x8mm --halftone blue");
    assert!(said.contains("in single dots") && said.contains("--inks process"), "{said}");
    assert!(!said.contains("cartridges are left out") && !said.contains("fitting"), "{said}");
    bench.done("plan tile --size 12x8mm --halftone blue --inks process");
    let said = bench.refused(1, "chart ramp MS MG --paper 60x60mm");
    assert!(said.contains("needs a printable area of 150 x 152 mm") && said.contains("choose a4"), "{said}");
    let said = bench.refused(1, "chart ladder --at 150x10mm");
    assert!(said.contains("mm at the right") && said.contains("change --at, --repeat"), "{said}");
    assert!(!said.contains("--size") && !said.contains("make it smaller"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_name_that_is_not_utf8_works_or_is_said_to_be_the_trouble() {
    use std::os::unix::ffi::OsStrExt as _;
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let name = std::ffi::OsStr::from_bytes(b"t\xeele");
    fs::rename(bench.path("tile"), bench.path("").join(name)).expect("a file system of bytes");
    let mut command = bench.command("plan");
    let output = command.arg(name).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("[DOC]") && said.contains("rename the file"), "{said}");
}

#[test]
fn bad_input_names_the_file_and_leaves_nothing_behind() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let whole = fs::read(bench.path("tile/roughness.png")).unwrap();
    fs::write(bench.path("tile/roughness.png"), &whole[..whole.len() / 2]).unwrap();
    let said = bench.refused(1, "print tile --size 12x8mm");
    assert!(said.contains("roughness.png"), "{said}");
    assert_eq!(bench.entries(), ["tile"]);

    let said = bench.refused(1, "print nowhere");
    assert!(said.contains("nowhere"), "{said}");
    let said = bench.refused(1, "print sample:leef");
    assert!(said.contains("leaf"), "{said}");
    let said = bench.refused(1, "print sample:leaf --size 400x500mm");
    assert!(said.contains("203.2") && said.contains("--paper"), "{said}");
    let said = bench.refused(1, "inspect tile/base_color.png");
    assert!(said.contains("base_color.png") && said.contains("byte"), "{said}");
    assert_eq!(bench.entries(), ["tile"]);
}

#[test]
fn a_folder_of_somebody_else_is_never_replaced() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::create_dir(bench.path("thesis")).unwrap();
    fs::write(bench.path("thesis/chapter1"), "words").unwrap();
    let said = bench.refused(1, "print tile --size 12x8mm -o thesis");
    assert!(said.contains("thesis"), "{said}");
    assert_eq!(entries(&bench.path("thesis")), ["chapter1"]);
}

#[test]
#[cfg(unix)]
fn an_interrupted_print_leaves_nothing_behind() {
    let bench = Bench::new();
    let mut child = bench
        .command("print sample:leaf")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let began = Instant::now();
    while bench.entries().is_empty() && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(!bench.entries().is_empty(), "the staging folder appears early");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.is_ok_and(|status| status.success()));
    assert_eq!(child.wait().expect("the program ends").code(), Some(130));
    assert!(bench.entries().is_empty(), "{:?}", bench.entries());
}
