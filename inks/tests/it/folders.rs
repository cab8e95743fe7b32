//! Libraries in folders: what replaces what, and the findings about invalid ones.

use std::fs;
use std::path::Path;

use files::shelf::Disk;
use inks::{Library, LibraryError, Problem, Provenance, Severity, Stack};
use proptest::prelude::*;
use protocol::ink::Ink;

const BUILTIN: &str = include_str!("../../library/library.toml");
const BASED: &str = "format = 1\nbased_on = \"built-in\"\n";

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn check(files: &[(&str, &str)]) -> Vec<Problem> {
    Library::check(&Disk, folder(files).path())
}

fn measured(stack: &str, curve: &str) -> String {
    format!(
        "{BASED}\n[[measured]]\nstack = \"{stack}\"\ncurve = \"{curve}\"\nby = \"A. Owner\"\n\
         when = \"2026-11-02\"\nsetup = \"two polarisers, one lamp, matte paper\"\n"
    )
}

fn errors(problems: &[Problem]) -> Vec<String> {
    problems.iter().filter(|p| p.severity == Severity::Error).map(ToString::to_string).collect()
}

/// Checks that a library has exactly one error, and that its text contains all of the words.
fn one_error(files: &[(&str, &str)], words: &[&str]) {
    let errors = errors(&check(files));
    assert_eq!(errors.len(), 1, "{errors:#?}");
    for word in words {
        assert!(errors[0].contains(word), "`{word}` is not in: {}", errors[0]);
    }
}

#[test]
fn the_builtin_text_in_a_folder_is_the_builtin_library() {
    let folder = folder(&[("library.toml", BUILTIN)]);
    assert_eq!(Library::open(&Disk, folder.path()).unwrap(), Library::builtin());
}

#[test]
fn a_measurement_replaces_one_curve_and_says_so() {
    let text = measured("metallic-silver+C", "ms-c.csv");
    let folder = folder(&[
        ("library.toml", &text),
        ("ms-c.csv", "theta_h_deg,r,g,b\n0,0.4,0.5,0.6\n10,0.1,0.1,0.1\n"),
    ]);
    let library = Library::open(&Disk, folder.path()).unwrap();
    let stack: Stack = "MS+C".parse().unwrap();
    let entry = library.entry(&stack).unwrap();
    assert_eq!(entry.curve.at(0.0), [0.4, 0.5, 0.6]);
    assert!(matches!(&entry.provenance, Provenance::Measured { by, .. } if by == "A. Owner"));
    for (old, new) in Library::builtin().entries().iter().zip(library.entries()) {
        assert_eq!(old.stack, new.stack);
        assert!(new.stack == stack || (new.curve == old.curve && !new.provenance.is_measured()));
    }
}

#[test]
fn a_measured_stack_the_library_lacks_joins_it() {
    let text = measured("W", "white.csv");
    let folder = folder(&[("library.toml", &text), ("white.csv", "theta_h_deg,r,g,b\n0,0.2,0.2,0.2\n")]);
    let library = Library::open(&Disk, folder.path()).unwrap();
    assert_eq!(library.entries().len(), 58);
    assert_eq!(library.entries()[57].stack.layers(), [Ink::White]);
    assert!(library.at_hand(&"white".parse().unwrap()).len() == 2);
}

#[test]
fn a_measured_figure_of_an_ink_changes_every_stack_with_it() {
    let ink =
        BUILTIN.split("\n[[ink]]\n").find(|table| table.starts_with("ink = \"metallic-silver\"")).unwrap();
    let ink = ink.split("\n# ----").next().unwrap();
    let changed = ink.replace(
        "alpha = { value = 0.27, source = \"guess\" }",
        "alpha = { value = 0.20, source = \"measured\" }",
    );
    assert_ne!(ink, changed);
    let folder = folder(&[("library.toml", &format!("{BASED}[[ink]]\n{changed}"))]);
    let library = Library::open(&Disk, folder.path()).unwrap();
    for (old, new) in Library::builtin().entries().iter().zip(library.entries()) {
        let holds = new.stack.layers().contains(&Ink::MetallicSilver);
        assert_eq!(old.curve != new.curve, holds, "{}", new.stack);
    }
    let Provenance::Modelled { parameters, .. } = &library.entries()[8].provenance else { panic!() };
    let alpha = parameters.iter().find(|p| p.name == "metallic-silver.alpha").unwrap();
    assert_eq!((alpha.value[0], alpha.source), (0.20, inks::Source::Measured));
}

#[test]
fn unknown_keys_are_named_with_their_line() {
    let text = BUILTIN.replacen("coat_internal", "coat_infernal", 1);
    let line = 1 + text[..text.find("coat_infernal").unwrap()].matches('\n').count();
    one_error(&[("library.toml", &text)], &["library.toml", &format!(":{line}:"), "coat_infernal"]);
    let text = BUILTIN.replacen("levelling =", "leveling =", 1);
    one_error(&[("library.toml", &text)], &["leveling"]);
}

#[test]
fn the_printers_numbers_are_checked() {
    let text = BUILTIN.replacen("barcode = 19", "barcode = 17", 1);
    one_error(&[("library.toml", &text)], &["ink finish.barcode", "17", "19"]);
    let text = BUILTIN.replacen("code = 0x11", "code = 0x14", 1);
    one_error(&[("library.toml", &text)], &["ink gold-foil.code", "0x14", "0x11"]);
    let text = BUILTIN.replacen("MDC-METS", "MDC-METR", 1);
    one_error(&[("library.toml", &text)], &["ink metallic-silver.part", "MDC-METS"]);
}

#[test]
fn figures_out_of_range_are_named() {
    let text = BUILTIN.replacen("f0 = { value = 0.04", "f0 = { value = 4", 1);
    one_error(&[("library.toml", &text)], &["paper.f0", "4 is outside 0 to 1"]);
    let text = BUILTIN.replacen("alpha = { value = 0.28", "alpha = { value = nan", 1);
    one_error(&[("library.toml", &text)], &["paper.alpha", "NaN"]);
    let text = BUILTIN.replacen("minimum_cluster = { value = 8", "minimum_cluster = { value = 0", 1);
    one_error(&[("library.toml", &text)], &["paper.minimum_cluster", "0 dots"]);
}

#[test]
fn stacks_that_cannot_be_are_named() {
    let text = BUILTIN.replacen("\"C+Y\"", "\"C+Q\"", 1);
    one_error(&[("library.toml", &text)], &["stacks: C+Q", "`Q`"]);
    let text = BUILTIN.replacen("\"C+Y\"", "\"C+M\"", 1);
    one_error(&[("library.toml", &text)], &["stacks: C+M", "twice"]);
    let text = BUILTIN.replacen("\"C+Y\"", "\"W+Y\"", 1);
    one_error(&[("library.toml", &text)], &["stack W+Y", "white", "measure it"]);
    let text = BUILTIN.replacen("    \"substrate\",\n", "", 1);
    one_error(&[("library.toml", &text)], &["with `substrate` first"]);
}

#[test]
fn a_stack_of_an_ink_without_a_cartridge_is_named() {
    let start = BUILTIN.find("[[ink]]\nink = \"yellow\"").unwrap();
    let end = start + BUILTIN[start..].find("# ----").unwrap();
    let text = format!("{}{}", &BUILTIN[..start], &BUILTIN[end..]);
    let errors = errors(&check(&[("library.toml", &text)]));
    assert!(errors.iter().all(|e| e.contains("contains yellow, which has no `[[ink]]`")), "{errors:#?}");
    let stacks =
        Library::builtin().entries().iter().filter(|e| e.stack.layers().contains(&Ink::Yellow)).count();
    assert_eq!(errors.len(), stacks);
}

#[test]
fn a_metal_seen_through_no_filter_is_named() {
    let text = BUILTIN.replacen("seen_through = \"cyan\"", "seen_through = \"finish\"", 1);
    let errors = errors(&check(&[("library.toml", &text)]));
    assert!(errors.iter().all(|e| e.contains("metallic-cyan is seen through finish")), "{errors:#?}");
    let text = BUILTIN.replacen("seen_through = \"cyan\"", "seen_through = \"cian\"", 1);
    one_error(&[("library.toml", &text)], &["did you mean `cyan`?"]);
}

#[test]
fn bad_curves_are_named_with_file_line_and_field() {
    let text = measured("C", "c.csv");
    let curve = |rows: &str| format!("theta_h_deg,r,g,b\n{rows}");
    for (rows, line, word) in [
        ("0,1,1,1\n5,1,1,1\n4,1,1,1\n", 4, "ascend"),
        ("0,1,1,1\n5,1,-1,1\n", 3, "-1"),
        ("0,1,1,1\n5,1,NaN,1\n", 3, "NaN"),
        ("0,1,1,1\n5,1,one,1\n", 3, "invalid float"),
        ("0,1,1,1\n5,1,1\n", 3, "fields"),
        ("0,1,1,1\n95,1,1,1\n", 3, "95"),
    ] {
        let found = [("library.toml", &*text), ("c.csv", &*curve(rows))];
        one_error(&found, &[&format!("c.csv:{line}:"), "measured C.curve", word]);
    }
    one_error(&[("library.toml", &text)], &["measured C.curve", "c.csv"]);
    one_error(&[("library.toml", &text), ("c.csv", "")], &["c.csv"]);
}

#[test]
fn a_curve_that_creates_light_is_an_error_or_a_warning() {
    let text = measured("substrate", "paper.csv");
    let curve = |v: f64| format!("theta_h_deg,r,g,b\n0,0.1,{v},0.1\n");
    let lambert = |share: f64| curve(share / std::f64::consts::PI);
    one_error(&[("library.toml", &text), ("paper.csv", &lambert(1.2))], &["stack substrate", "120.0%"]);
    let problems = check(&[("library.toml", &text), ("paper.csv", &lambert(1.03))]);
    assert!(errors(&problems).is_empty());
    assert!(
        problems.iter().any(|p| p.severity == Severity::Warning && p.text.contains("103.0%")),
        "{problems:?}"
    );
}

#[test]
fn a_curve_outside_the_folder_is_not_read() {
    for name in ["../paper.csv", "/etc/hostname", "", "./c.csv/.."] {
        one_error(&[("library.toml", &measured("C", name))], &["inside the library's folder"]);
    }
}

#[test]
fn a_measurement_needs_who_when_and_how() {
    let curve = ("c.csv", "theta_h_deg,r,g,b\n0,0.1,0.1,0.1\n");
    let text = measured("C", "c.csv").replace("A. Owner", " ");
    one_error(&[("library.toml", &text), curve], &["measured C.by", "empty"]);
    for when in ["yesterday", "2026-13", "26-01-01", "2026-11-32", "2026-11-02-01"] {
        let text = measured("C", "c.csv").replace("2026-11-02", when);
        one_error(&[("library.toml", &text), curve], &["measured C.when", when]);
    }
}

#[test]
fn an_unused_curve_gives_a_warning() {
    let problems = check(&[("library.toml", BASED), ("stray.csv", "")]);
    assert!(errors(&problems).is_empty());
    assert!(problems.iter().any(|p| p.file.ends_with("stray.csv") && p.severity == Severity::Warning));
}

#[test]
fn foil_without_its_undercoat_gives_a_finding_with_its_line() {
    let problems = check(&[("library.toml", BUILTIN)]);
    let told = problems.iter().filter(|p| p.text.contains("foil-needs-undercoat")).collect::<Vec<_>>();
    let foils = Library::builtin().entries().iter().filter(|e| e.stack.to_string().contains("F")).count();
    assert!(!told.is_empty() && told.len() < foils);
    let line = told[0].line.unwrap();
    assert!(BUILTIN.lines().nth(line - 1).unwrap().contains("\"GF\""), "{}", told[0]);
    assert!(errors(&problems).is_empty());
}

#[test]
fn an_invalid_library_is_an_error_with_its_path() {
    let error = Library::open(&Disk, Path::new("/nowhere/at/all")).unwrap_err();
    let LibraryError::Problems { problems } = &error;
    assert_eq!(problems.len(), 1);
    assert!(error.to_string().contains("/nowhere/at/all/library.toml"), "{error}");
    one_error(&[("library.toml", "format = 2\n")], &["library.toml:1:", "version 2"]);
    one_error(&[("library.toml", "format = \"one")], &["library.toml:1:"]);
    one_error(
        &[("library.toml", "format = 1\nbased_on = \"elsewhere\"\n")],
        &["library.toml:2:", "`built-in`"],
    );
}

/// The blocks of the guide that are fenced as `language`.
fn blocks(language: &str) -> Vec<&'static str> {
    let guide = include_str!("../../../docs/measuring-inks.md");
    let fence = format!("```{language}\n");
    guide.split(fence.as_str()).skip(1).map(|rest| rest.split("```").next().unwrap()).collect()
}

#[test]
fn the_examples_of_the_guide_are_libraries() {
    let curve = blocks("csv")[0];
    let examples = blocks("toml");
    assert_eq!(examples.len(), 3);
    let library = |example: &str| {
        let folder = folder(&[("library.toml", example), ("ms-c.csv", curve)]);
        Library::open(&Disk, folder.path()).unwrap()
    };
    for (example, changed) in examples.iter().zip(["MS+C", "K+F"]) {
        let stack: Stack = changed.parse().unwrap();
        assert_ne!(
            library(example).entry(&stack).unwrap().curve,
            Library::builtin().entry(&stack).unwrap().curve
        );
    }
    let forbidding = library(examples[2]);
    let names = |library: &Library| {
        let entries = library.at_hand(&inks::InkSet::ALL);
        entries.iter().map(|entry| entry.stack.to_string()).collect::<Vec<_>>()
    };
    let kept: Vec<_> = names(&Library::builtin()).into_iter().filter(|name| !name.ends_with("F+F")).collect();
    assert_eq!(names(&forbidding), kept);
    assert_eq!(kept.len(), 55, "all but SF+F and GF+F");
}

proptest! {
    /// Libraries come from anybody: any text gives a library or a list of problems.
    #[test]
    fn a_damaged_library_gives_findings(at in 0usize..BUILTIN.len(), cut in 0usize..200, put in "\\PC{0,8}") {
        prop_assume!(BUILTIN.is_ascii());
        let end = (at + cut).min(BUILTIN.len());
        let text = format!("{}{put}{}", &BUILTIN[..at], &BUILTIN[end..]);
        let folder = folder(&[("library.toml", &text)]);
        match Library::open(&Disk, folder.path()) {
            Ok(library) => prop_assert!(library.entries()[0].stack == Stack::SUBSTRATE),
            Err(LibraryError::Problems { problems }) => {
                prop_assert!(problems.iter().any(|p| p.severity == Severity::Error));
            }
        }
    }

    #[test]
    fn a_damaged_curve_gives_findings(rows in prop::collection::vec("[-0-9.,eEnNaAiIfF \"]{0,24}", 0..12)) {
        let curve = format!("theta_h_deg,r,g,b\n{}", rows.join("\n"));
        let folder = folder(&[("library.toml", &measured("C", "c.csv")), ("c.csv", &curve)]);
        if let Ok(library) = Library::open(&Disk, folder.path()) {
            prop_assert!(library.entries().iter().all(|e| e.curve.rgb().iter().flatten().all(|v| v.is_finite())));
        }
    }
}

#[test]
fn dots_as_measured_override_the_minimum_clusters_and_say_who_measured() {
    let head = BASED;
    let dots = |ink: &str, more: &str| {
        format!(
            "[[dots]]\nink = \"{ink}\"\nminimum_cluster = 11\nby = \"A. Owner\"\nwhen = \"2026-11\"\nsetup = \"a scanner\"\n{more}"
        )
    };
    let text = format!("{head}{}{}", dots("black", "dot_gain_um = 17.5\n"), dots("paper", ""));
    let here = folder(&[("library.toml", &text)]);
    let library = Library::open(&Disk, here.path()).unwrap();
    let black = library.cartridge(Ink::Black).unwrap();
    assert_eq!((black.minimum_cluster.get(), black.minimum_cluster.source()), (11, inks::Source::Measured));
    assert_eq!(black.dots.as_ref().unwrap().dot_gain_um, Some(17.5));
    assert!(black.minimum_cluster.note().unwrap().contains("A. Owner, 2026-11: a scanner"));
    // Paper has the same between clusters of any ink.
    assert_eq!(library.minimum_cluster(&"C".parse().unwrap()), 11);
    assert_eq!(library.minimum_cluster(&"MS".parse().unwrap()), 16);
    let guide = folder(&[("library.toml", &format!("{head}{}", blocks("toml dots")[0]))]);
    let library = Library::open(&Disk, guide.path()).unwrap();
    assert_eq!(library.cartridge(Ink::Black).unwrap().minimum_cluster.get(), 9);
    for (tables, words) in [
        (dots("black", "").replace("= 11", "= 0"), ["dots black.minimum_cluster", "0 dots"]),
        (dots("black", "") + &dots("black", ""), ["dots black", "given twice"]),
        (dots("black", "dot_gain_um = 300.0\n"), ["dots black.dot_gain_um", "300"]),
        (dots("black", "dot_gain_um = nan\n"), ["dots black.dot_gain_um", "NaN"]),
        (dots("black", "").replace("2026-11", "soon"), ["dots black.when", "soon"]),
        (dots("black", "").replace("A. Owner", " "), ["dots black.by", "empty"]),
        (dots("blackk", ""), ["blackk", "library.toml"]),
        (dots("black", "gain = 1\n"), ["gain", "library.toml"]),
    ] {
        one_error(&[("library.toml", &format!("{head}{tables}"))], &words);
    }
}
