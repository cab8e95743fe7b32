//! Libraries of one's own by the program, as its users do: added by name, judged, compared, and handed on.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use testing::program::{Bench, entries, small_document, text};

/// A measured library in a folder: cyan a little darker than the model, metallic silver much brighter.
fn measured(bench: &Bench, name: &str) {
    let folder = bench.path(name);
    fs::create_dir(&folder).expect("a folder");
    let library = inks::Library::builtin();
    let mut described = "format = 1\nbased_on = \"built-in\"\nname = \"<mine>\"\n".to_owned();
    for (stack, file, factor) in [("C", "c.csv", 0.99), ("MS", "ms.csv", 1.5)] {
        let entry = library.entry(&stack.parse().expect("a stack")).expect("it is built in");
        let mut rows = "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma,kind\n".to_owned();
        for step in 0..48 {
            let degrees = 80.0 * (f64::from(step) / 47.0).powi(2);
            let [r, g, b] = entry.curve.at(degrees.to_radians()).map(|v| v * factor);
            rows += &format!("{degrees},{r},{g},{b},{},{},{},measured\n", 0.02 * r, 0.02 * g, 0.02 * b);
        }
        fs::write(folder.join(file), rows).expect("a curve");
        described += &format!(
            "[[measured]]\nstack = \"{stack}\"\ncurve = \"{file}\"\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\nsetup = \"a can\"\n"
        );
    }
    fs::write(folder.join("library.toml"), described).expect("a library");
}

/// The folder that a message names.
fn named(said: &str) -> PathBuf {
    said.lines().find_map(|line| line.strip_prefix("in ")).expect("a folder").into()
}

#[test]
fn a_library_is_added_whole_under_a_name_and_only_once() {
    let bench = Bench::new();
    measured(&bench, "mine");
    let said = bench.done("inks add mine --name matt-paper");
    let folder = named(&said);
    let libraries = folder.parent().expect("a folder of libraries");
    assert_eq!(entries(&folder), ["c.csv", "library.toml", "ms.csv"]);
    let listed = bench.done("inks list --library matt-paper");
    assert!(listed.contains("2 measured"), "{listed}");
    for (args, expected) in [
        ("inks add mine --name matt-paper", "there is a library `matt-paper` already"),
        ("inks add mine --name ../other", "not a valid name"),
        ("inks add mine --name builtin", "comes with the program"),
        ("inks list --library gloss-paper", "those added are matt-paper"),
        ("inks add nowhere", "nowhere"),
    ] {
        let said = bench.refused(1, args);
        assert!(said.contains(expected), "{args}: {said}");
    }
    fs::write(bench.path("mine/ms.csv"), "theta_h_deg,r,g,b\n0,9,9,9\n").expect("a curve");
    let said = bench.refused(1, "inks add mine --name bright");
    assert!(said.contains("reflects"), "{said}");
    assert_eq!(entries(libraries), ["matt-paper"], "nothing half-written stays");
    // A folder comes before a name.
    fs::create_dir(bench.path("matt-paper")).expect("a folder");
    assert!(bench.refused(1, "inks list --library matt-paper").contains("library.toml"));
}

#[test]
fn added_libraries_are_listed_and_removed() {
    let bench = Bench::new();
    assert!(bench.done("inks list --added").contains("no library was added"));
    std::fs::create_dir(bench.path("mine")).expect("a folder");
    fs::write(bench.path("mine/library.toml"), "format = 1\nbased_on = \"built-in\"\nname = \"mine\"\n")
        .expect("a library");
    bench.done("inks add mine");
    bench.done("inks add mine --name other");
    let said = bench.done("inks list --added");
    assert!(said.lines().count() == 2 && said.contains("mine") && said.contains("57 stacks"), "{said}");
    let rows: Value = serde_json::from_str(&bench.done("inks list --added --json")).expect("JSON");
    assert_eq!((rows[0]["name"].as_str(), rows[1]["name"].as_str()), (Some("mine"), Some("other")));
    bench.done("inks remove other");
    assert!(bench.refused(1, "inks remove other").contains("those added are mine"));
    assert!(bench.refused(1, "inks remove builtin").contains("comes with the program"));
    assert!(bench.refused(1, "inks remove ../mine").contains("no library was added"));
    // The folder it came from stays.
    bench.done("inks remove mine");
    assert!(
        bench.path("mine/library.toml").exists() && bench.done("inks list --added").contains("no library")
    );
}

#[test]
fn an_exported_library_can_be_imported_and_a_forged_one_cannot() {
    let bench = Bench::new();
    measured(&bench, "mine");
    assert!(bench.refused(1, "inks export mine").contains("no licence"));
    assert!(bench.refused(1, "inks export builtin").contains("nothing to export"));
    bench.done("inks export mine -o mine.zip --licence CC0-1.0");
    let said = bench.done("inks import mine.zip --name theirs");
    assert!(said.contains("licence CC0-1.0") && said.contains("2 measured"), "{said}");
    let folder = named(&said);
    assert_eq!(entries(&folder), ["c.csv", "library.toml", "ms.csv", "provenance.json"]);
    assert!(bench.refused(1, "inks import mine.zip --name theirs").contains("already"));
    let equal = bench.done("inks diff mine theirs");
    assert!(equal.contains("57 stacks are equal"), "{equal}");
    let mut bytes = fs::read(bench.path("mine.zip")).expect("an archive");
    // In the file's own header and in the archive's directory.
    for at in 0..bytes.len() - 5 {
        if bytes[at..].starts_with(b"c.csv") {
            bytes[at..at + 5].copy_from_slice(b"../.c");
        }
    }
    fs::write(bench.path("bad.zip"), bytes).expect("an archive");
    let said = bench.refused(1, "inks import bad.zip");
    assert!(said.starts_with("foilpress: bad.zip: "), "{said}");
    assert_eq!(entries(folder.parent().expect("a folder")), ["theirs"]);
}

#[test]
fn a_difference_is_within_the_measurement_or_beyond_it() {
    let bench = Bench::new();
    measured(&bench, "mine");
    let report: Value = serde_json::from_str(&bench.done("inks diff builtin mine --json")).expect("JSON");
    let row = |stack: &str| {
        let rows = report["stacks"].as_array().expect("rows");
        rows.iter().find(|row| row["stack"] == stack).expect("a row").clone()
    };
    assert_eq!((row("C")["within"].as_bool(), row("MS")["within"].as_bool()), (Some(true), Some(false)));
    assert!((row("MS")["largest"]["ratio"].as_f64().expect("a number") - 1.5).abs() < 0.02);
    assert!(row("K")["within"].is_null() && row("K")["distance"] == 0.0);
    let said = bench.done("inks diff builtin mine -o diff.html");
    assert!(said.contains("within the measurement") && said.contains("55 stacks are equal"), "{said}");
    let page = fs::read_to_string(bench.path("diff.html")).expect("a page");
    assert!(page.contains("&lt;mine>") || page.contains("&lt;mine&gt;"));
    assert_eq!(page.matches("<svg").count(), 2);
    assert_eq!(page.matches("://").count(), page.matches("http://www.w3.org").count(), "it loads nothing");
}

#[test]
fn check_names_file_line_and_stack() {
    let bench = Bench::new();
    measured(&bench, "mine");
    let good = bench.done("inks check mine");
    assert!(good.contains("0 errors, 0 warnings"), "{good}");
    let curve = fs::read_to_string(bench.path("mine/ms.csv")).expect("a curve");
    let mut lines: Vec<String> = curve.lines().map(str::to_owned).collect();
    // A second highlight in row 30.
    let mut numbers: Vec<f64> = lines[30].split(',').take(7).map(|n| n.parse().expect("a number")).collect();
    numbers[2] *= 3.0;
    lines[30] = numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + ",measured";
    fs::write(bench.path("mine/ms.csv"), lines.join("\n") + "\n").expect("a curve");
    let said = bench.done("inks check mine");
    assert!(said.contains("ms.csv:31: warning: stack MS: green rises"), "{said}");
    let found: Value = serde_json::from_str(&bench.done("inks check mine --json")).expect("JSON");
    let row = found.as_array().expect("findings").iter().find(|row| row["line"] == 31).expect("the finding");
    assert_eq!((row["severity"].as_str(), row["field"].as_str()), (Some("warning"), Some("stack MS")));
}

#[test]
fn cartridges_are_chosen_with_what_each_is_worth() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let choose = |more: &str| -> Value {
        let said = bench.done(&format!("inks choose tile --inks process,MS,finish --json -q {more}"));
        serde_json::from_str(&said).expect("JSON")
    };
    let number = |value: &Value| value.as_f64().expect("a number");
    let few = choose("--cartridges 2");
    let chosen: Vec<&str> = few["cartridges"]
        .as_array()
        .expect("some")
        .iter()
        .map(|c| c["ink"].as_str().expect("a name"))
        .collect();
    assert!(chosen.len() == 2 && chosen.contains(&"metallic-silver"), "{few}");
    for cartridge in few["cartridges"].as_array().expect("some") {
        assert!(number(&cartridge["without"]) > number(&cartridge["with"]), "{few}");
    }
    // Every other pair of the six, as the only inks at hand, is no nearer.
    let names = ["C", "M", "Y", "K", "MS", "finish"];
    for (i, a) in names.iter().enumerate() {
        for b in &names[..i] {
            let said = bench.done(&format!("inks choose tile --inks {a},{b} --json -q"));
            let pair: Value = serde_json::from_str(&said).expect("JSON");
            assert!(number(&pair["distance"]) >= number(&few["distance"]) - 1e-5, "{a} {b}: {pair} {few}");
        }
    }
    let said = bench.done("inks choose tile --inks process,MS,finish -q --cartridges 2");
    assert!(said.contains("best cartridges for tile: 2 of 6") && said.contains("left out"), "{said}");
}

#[test]
fn a_gamut_and_redundant_stacks_are_shown() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let said = bench.done("inks gamut builtin --document tile --inks process,MS -q -o gamut.html");
    assert!(said.contains("nearest") && said.contains("MS"), "{said}");
    assert!(fs::read_to_string(bench.path("gamut.html")).expect("a page").contains("<svg"));
    let found: Value =
        serde_json::from_str(&bench.done("inks gamut builtin --document tile --inks process,MS -q --json"))
            .expect("JSON");
    for basis in found["bases"].as_array().expect("bases") {
        let of = |key: &str| basis[key].as_f64().expect("a number");
        // Light counts as well, so a mixture may be a little farther in d than the nearest stack.
        assert!(of("distance_mixed") <= of("distance_nearest") + 0.02, "{basis}");
    }
    let output = bench.run("inks redundant --inks process --within 0.05");
    let said = text(&output.stdout);
    assert!(output.status.success() && said.contains("can be left out together"), "{said}");
}

/// The figures that are shown of a stack give what the list says it reflects: the lobe is written again here.
#[test]
fn shown_figures_give_the_listed_reflectance() {
    let bench = Bench::new();
    let numbers =
        |text: &str| -> Vec<f64> { text.split([' ', ',']).filter_map(|word| word.parse().ok()).collect() };
    let list: Value = serde_json::from_str(&bench.done("inks list --json")).expect("JSON");
    for stack in ["substrate", "M+Y", "K", "P+MS", "MS+C+F"] {
        let shown = bench.done(&format!("inks show {stack}"));
        let degrees = 30f64.to_radians();
        let (cos2, tan2) = (degrees.cos().powi(2), degrees.tan().powi(2));
        let mut f = [0.0; 3];
        for line in shown.lines() {
            if line.starts_with("diffuse   albedo") {
                (0..3).for_each(|c| f[c] += numbers(line)[c] / std::f64::consts::PI);
            } else if line.starts_with("lobe") {
                let [r, g, b, alpha] = numbers(line)[..] else { panic!("{line}") };
                let a2 = alpha * alpha;
                let d = 1.0 / (std::f64::consts::PI * a2 * (cos2 * (1.0 + tan2 / a2)).powi(2));
                let lobe = d / (1.0 + a2 * tan2).sqrt() / (4.0 * cos2);
                [r, g, b].into_iter().zip(&mut f).for_each(|(f0, f)| *f += f0 * lobe);
            }
        }
        let rows = list.as_array().expect("rows");
        let row = rows.iter().find(|row| row["stack"] == stack).expect("it is listed");
        for (c, found) in f.into_iter().enumerate() {
            let listed = row["reflectance"][2][c].as_f64().expect("a number");
            assert!(
                (found - listed).abs() < 0.01 * listed + 3e-4,
                "{stack} {c}: {found}, not {listed}\n{shown}"
            );
        }
    }
    // A stack that prints use although it is not on the list.
    let shown = bench.done("inks show MS+K+F");
    assert!(
        shown.contains("not on the list of the library") && shown.contains("diffuse   albedo"),
        "{shown}"
    );
}

#[test]
fn an_ink_of_another_maker_has_a_name_of_its_own_and_the_barcode_it_poses_as() {
    let bench = Bench::new();
    let drawing = |file: &str, inside: &str| {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"10mm\" viewBox=\"0 0 20 10\">{inside}</svg>"
        );
        fs::write(bench.path(file), svg).expect("a drawing");
    };
    drawing("layer.svg", "<g id=\"neon-pink\"><rect width=\"10\" height=\"10\"/></g>");
    drawing("colour.svg", "<rect width=\"10\" height=\"10\" fill=\"#ff40a0\"/>");
    let plan = |args: &str| -> Value {
        serde_json::from_str(&bench.done(&format!("plan layers {args} --json"))).expect("a plan")
    };
    // 10 x 10 mm at 600 dpi.
    let square = 236 * 236;
    let printed = |args: &str| {
        let plan = plan(args);
        let (pass, cartridge) = (&plan["passes"][0], &plan["cartridges"][0]);
        assert_eq!(
            (plan["passes"].as_array().map(Vec::len), &pass["ink"]),
            (Some(1), &"metallic-magenta".into()),
            "{plan}"
        );
        assert!(pass["dots"].as_u64().is_some_and(|dots| dots.abs_diff(square) < 1000), "{plan}");
        assert_eq!(cartridge["barcode"], 9);
        cartridge["sold_as"].as_str().expect("a name").to_owned()
    };
    let before = plan("colour.svg");
    assert!(before["cartridges"].as_array().is_some_and(|all| all.len() > 1), "{before}");
    let said = bench.done("inks add Neon-Pink --as metallic-red --colour ff40a0");
    let line = "neon-pink        #ff40a0  poses as metallic-magenta (barcode 9, ink code 05)";
    assert!(said.starts_with(line), "{said}");
    assert_eq!(
        entries(named(&said).parent().expect("a folder")),
        ["inks.toml"],
        "nothing half-written stays"
    );
    for list in ["inks list --inks process", "inks list --added"] {
        assert!(bench.done(list).contains(line), "{list}");
    }
    for args in ["layer.svg", "colour.svg --colour neon-pink", "colour.svg --colour #ff40a0=neon-pink"] {
        assert!(printed(args).ends_with(" or your neon-pink"), "{args}");
    }
    for (args, expected) in [
        ("inks add neon-pink --as gold --colour 000000", "there is an ink `neon-pink` already"),
        ("inks add gold --as gold --colour 000000", "already"),
        ("inks add a-pink --as gold --colour pink", "no colour"),
    ] {
        let said = bench.refused(1, args);
        assert!(said.contains(expected), "{args}: {said}");
    }
    assert!(bench.refused(2, "inks add a-pink --as jam --colour 000000").contains("`jam` is not an ink"));
    bench.done("inks remove neon-pink");
    assert!(bench.refused(2, "plan layers colour.svg --colour neon-pink").contains("write it as a colour"));
    // A list that cannot be read stops nothing that does not need it, and is told.
    fs::write(named(&said), "[[ink]]\nname = \"\u{1b}[2J\"\n").expect("a list");
    let output = bench.command("papers").output().expect("the program");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && told.contains("inks.toml") && !told.contains('\u{1b}'), "{told}");
}
