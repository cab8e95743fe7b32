//! Curves from other instruments, and stacks predicted from measured ones, by the program as its users do it.

use std::fs;
use std::path::Path;

use files::shelf::Disk;
use serde_json::Value;
use testing::program::{Bench, entries, small_document, text};

/// The library of the guide: nine stacks, written by another program than this one.
fn few_stacks(bench: &Bench) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/few-stacks");
    fs::create_dir(bench.path("few")).expect("a folder");
    for entry in fs::read_dir(from).expect("the guide has it") {
        let entry = entry.expect("a file");
        fs::copy(entry.path(), bench.path("few").join(entry.file_name())).expect("a copy");
    }
}

#[test]
fn stacks_are_predicted_and_say_so_everywhere() {
    let bench = Bench::new();
    few_stacks(&bench);
    let said = bench.done("inks predict few -o full");
    assert!(said.contains("leave-one-out error:") && said.contains("still modelled"), "{said}");
    let listed = bench.done("inks list --library full");
    let words = listed.lines().last().expect("a last line");
    assert!(words.contains("9 measured") && words.contains("predicted from measurements"), "{words}");
    let shown = bench.done("inks show MS+Y --library full");
    for word in
        ["predicted from measurements by A. Owner, 2026-11-02", "filters and lobes", "leave-one-out error"]
    {
        assert!(shown.contains(word), "`{word}` is not in:\n{shown}");
    }
    assert!(bench.done("inks check full").contains("0 errors"));
    small_document(&bench.path("tile"));
    let said = bench.done("print tile --size 12x8mm --library few --trust measured -o printed");
    assert!(said.contains("of the difference lies within your measurement"), "{said}");
    let report = fs::read_to_string(bench.path("printed/report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let measurement = &report["gamut"]["measurement"];
    let share = |name: &str| measurement[name].as_f64().expect("a number");
    // All nine curves say that they are uncertain by 1.5 %.
    assert!(share("known") > 0.99 && share("deviation") < 0.01 && share("within") < 0.5, "{measurement}");
    let page = fs::read_to_string(bench.path("printed/report.html")).expect("a page");
    assert!(page.contains("lies within your measurement"));
    let said = bench.done("print tile --size 12x8mm -o modelled");
    assert!(!said.contains("your measurement"), "{said}");
    let json: Value = serde_json::from_str(&bench.done("inks predict few -o full --json")).expect("JSON");
    let error = json["leave_one_out"].as_f64().expect("a number");
    // The curves have noise of 1.5 % and were made with figures the fit has to find.
    assert!(error > 0.005 && error < 0.15, "{error}");
    let kept: Value = serde_json::from_slice(&fs::read(bench.path("full/prediction.json")).expect("figures"))
        .expect("JSON");
    assert_eq!(kept["figures"], json["figures"]);
    // The band of a predicted curve goes with it, into archives too.
    let diff = bench.done("inks diff builtin full --json");
    let diff: Value = serde_json::from_str(&diff).expect("JSON");
    let row =
        diff["stacks"].as_array().expect("rows").iter().find(|row| row["stack"] == "MS+Y").expect("a row");
    assert!(row["band"].as_f64().is_some_and(|band| band > 0.0), "{row}");
    bench.done("inks export full -o full.zip");
    bench.done("inks import full.zip --name theirs");
    assert!(bench.done("inks list --library theirs").contains("predicted from measurements"));
}

#[test]
fn only_trusted_curves_are_printed() {
    let bench = Bench::new();
    few_stacks(&bench);
    small_document(&bench.path("tile"));
    bench.done("inks predict few -o full");
    let stacks = |args: &str| {
        bench.done(&format!("map tile.foil --library full {args} -o out.mix"));
        let text = fs::read_to_string(bench.path("out.mix/mix.toml")).expect("a mix");
        fs::remove_dir_all(bench.path("out.mix")).expect("it was there");
        text
    };
    bench.done("factor tile -o tile.foil");
    let measured = ["substrate", "C", "M", "Y", "MS", "F", "C+F", "MS+C", "C+M"];
    let named = |text: &str| -> Vec<String> {
        let mix: toml::Value = toml::from_str(text).expect("TOML");
        let list = mix["stacks"].as_array().expect("stacks");
        list.iter().map(|stack| stack.as_str().expect("a name").to_owned()).collect()
    };
    let trusted = named(&stacks("--trust measured"));
    assert!(
        !trusted.is_empty() && trusted.iter().all(|stack| measured.contains(&stack.as_str())),
        "{trusted:?}"
    );
    let predicted = named(&stacks("--trust predicted --inks all"));
    assert!(predicted.iter().all(|stack| !stack.contains('K') && !stack.contains("SF")), "{predicted:?}");
    let said = bench.refused(1, "map tile.foil --trust measured -o out.mix");
    assert!(said.contains("--trust measured") && said.contains("foilpress inks list"), "{said}");
}

#[test]
fn a_library_without_measurements_predicts_nothing() {
    let bench = Bench::new();
    fs::create_dir(bench.path("none")).expect("a folder");
    fs::write(bench.path("none/library.toml"), "format = 1\nbased_on = \"built-in\"\n").expect("a library");
    let said = bench.refused(1, "inks predict none -o full");
    assert!(said.contains("no measured curve") && !bench.path("full").exists(), "{said}");
}

/// A goniometer's table, a MERL file and readings, each made here byte by byte, go into one library.
#[test]
fn curves_of_other_instruments_join_a_library() {
    let bench = Bench::new();
    let mut table = "# reflectance 0.2 everywhere\n3 430 550 650\n".to_owned();
    for light in 1..14 {
        for eye in 0..14 {
            table += &format!("{} 0 {} 3.0 0.2 0.2 0.2\n", 0.1 * f64::from(light), 0.1 * f64::from(eye));
        }
    }
    fs::write(bench.path("grey.brdf"), &table).expect("a table");
    let mut merl: Vec<u8> = [4i32, 30, 6].iter().flat_map(|d| d.to_le_bytes()).collect();
    for scale in [1.0, 1.15, 1.66] {
        merl.extend((0..4 * 30 * 6).flat_map(|_| (0.1f64 * 1500.0 / scale).to_le_bytes()));
    }
    fs::write(bench.path("flat.binary"), &merl).expect("a table");
    fs::write(bench.path("k.toml"), "format = 1\nlab = [18, 0, 1]\ngloss_20 = 1.0\ngloss_60 = 10.8\n")
        .expect("readings");
    fs::write(
        bench.path("ms.csv"),
        "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma\n0,1,1,1,.1,.1,.1\n40,.1,.1,.1,.1,.1,.1\n",
    )
    .expect("a curve");
    let by = "--by Owner --when 2026-11 -o mine";
    let said = bench.done(&format!("inks from grey.brdf --stack substrate {by} --note gonio"));
    assert!(said.contains("substrate: measured"), "{said}");
    bench.done(&format!("inks from flat.binary --stack P+SF {by}"));
    bench.done(&format!("inks from ms.csv --stack MS {by}"));
    let said = bench.done(&format!("inks from k.toml --stack K {by}"));
    assert!(said.contains("K: predicted") && said.contains("3 measured, 1 predicted"), "{said}");
    assert_eq!(
        entries(&bench.path("mine")),
        ["k.csv", "library.toml", "ms.csv", "p-sf.csv", "substrate.csv"]
    );
    let library = inks::Library::open(&Disk, &bench.path("mine")).expect("a library");
    let at =
        |stack: &str| library.entry(&stack.parse().expect("a stack")).expect("it is there").curve.at(0.4);
    assert!(
        at("substrate").iter().all(|v| (v - 0.2).abs() < 1e-6)
            && at("P+SF").iter().all(|v| (v - 0.1).abs() < 1e-9)
    );
    let shown = bench.done("inks show K --library mine");
    for word in ["predicted from measurements by Owner", "10.8 GU at 60 degrees", "alpha 0.118"] {
        assert!(shown.contains(word), "`{word}` is not in:\n{shown}");
    }
    assert!(bench.done("inks show substrate --library mine").contains("gonio; goniometer table grey.brdf"));

    let before = fs::read(bench.path("mine/library.toml")).expect("a library");
    fs::write(bench.path("bright.csv"), "theta_h_deg,r,g,b\n0,9,9,9\n").expect("a curve");
    fs::write(bench.path("cut.brdf"), &table[..table.len() - 9]).expect("a table");
    fs::write(bench.path("notes.txt"), "0.2").expect("a text");
    for (args, expected) in [
        (format!("inks from ms.csv --stack MS {by}"), "has a measured curve of MS already"),
        (format!("inks from k.toml --stack K {by}"), "has a predicted curve of K already"),
        (format!("inks from bright.csv --stack C {by}"), "reflects"),
        (format!("inks from cut.brdf --stack C {by}"), "cut.brdf: end of file"),
        (format!("inks from notes.txt --stack C {by}"), "unknown kind of measurement"),
        (format!("inks from nowhere.brdf --stack C {by}"), "nowhere.brdf"),
        (
            "inks from ms.csv --stack C --by Owner --when yesterday -o mine".into(),
            "`yesterday` is not a date",
        ),
        ("inks from ms.csv --stack C --by Owner --when 2026-11 -o .".into(), "not a usable ink library"),
    ] {
        let output = bench.run(&args);
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(expected), "{args}: {said}");
        assert!(!said.contains("/tmp/."), "{args}: {said}");
        assert_eq!(fs::read(bench.path("mine/library.toml")).expect("a library"), before, "{args}");
        assert_eq!(entries(&bench.path("mine")).len(), 5, "{args}");
    }
    // A table prints as a document, too.
    bench.done("factor grey.brdf -o grey.foil");
}
