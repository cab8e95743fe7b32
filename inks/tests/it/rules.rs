//! The order rules of the built-in library, and how an owner's library changes them.

use std::fs;

use files::shelf::Disk;
use inks::{Certainty, Library, LibraryError, Severity, Stack};

fn stack(text: &str) -> Stack {
    text.parse().unwrap()
}

fn broken(library: &Library, text: &str) -> Vec<String> {
    library.broken_rules(&stack(text)).iter().map(|rule| rule.name.clone()).collect()
}

/// A library based on the built-in one, with this text appended.
fn based(text: &str) -> Result<Library, LibraryError> {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("format = 1\nbased_on = \"built-in\"\n{text}");
    fs::write(folder.path().join("library.toml"), text).unwrap();
    Library::open(&Disk, folder.path())
}

fn rule(name: &str, severity: &str, condition: &str) -> String {
    format!(
        "[[rule]]\nname = \"{name}\"\nsays = \"an owner's words\"\nseverity = \"{severity}\"\n\
         certainty = \"measured\"\n{condition}\n"
    )
}

#[test]
fn ordinary_stacks_break_no_rule() {
    let library = Library::builtin();
    for text in ["substrate", "C", "C+M+Y", "MS+C", "MG+Y", "MS+M+F", "P+C", "W+C+F"] {
        assert!(broken(&library, text).is_empty(), "{text}: {:?}", broken(&library, text));
    }
}

#[test]
fn each_rule_is_broken_by_what_it_describes_and_not_by_what_it_allows() {
    let library = Library::builtin();
    let cases = [
        ("foil-needs-undercoat", "SF", "C+M+Y+K+SF"),
        ("foil-needs-undercoat", "C+M+Y+SF", "K+Y+M+C+GF"),
        ("ink-on-foil", "SF+C", "SF+F"),
        ("foil-last", "SF+F", "SF+C"),
        ("opaque-over-transparent", "C+MS", "C+M+Y+K+SF"),
        ("opaque-over-transparent", "K+F+W", "W+K"),
        ("white-on-colour", "K+W", "K+P+W"),
        ("finish-last", "F+C", "C+F"),
        ("finish-last", "F+MS", "F+P+W"),
        ("finish-under-white", "F+P+W", "W+F"),
        ("primer-first", "C+P", "P+C"),
        ("primer-first", "W+P", "P+F+P"),
        ("three-layers", "MS+C+M+F", "MS+C+F"),
    ];
    for (rule, wrong, right) in cases {
        assert!(broken(&library, wrong).iter().any(|name| name == rule), "{rule}: {wrong}");
        assert!(!broken(&library, right).iter().any(|name| name == rule), "{rule}: {right}");
    }
    for rule in library.rules() {
        assert!(cases.iter().any(|(name, ..)| *name == rule.name), "{} has no example", rule.name);
    }
}

#[test]
fn the_built_in_rules_forbid_nothing() {
    assert!(Library::builtin().rules().iter().all(|rule| rule.severity < Severity::Error));
}

#[test]
fn a_rule_of_the_same_name_replaces_and_another_joins() {
    let builtin = Library::builtin();
    let library = based(
        &(rule("finish-last", "note", "over = \"metallic\"\nunder = \"finish\"")
            + &rule("three-layers", "note", "")
            + &rule("black-first", "warning", "over = \"black\"\ndirectly_on = \"metallic\"")),
    )
    .unwrap();
    assert_eq!(library.rules().len(), builtin.rules().len() + 1);
    assert_eq!(broken(&builtin, "F+C"), ["finish-last"]);
    assert!(broken(&library, "F+C").is_empty());
    assert_eq!(broken(&library, "F+MS"), ["finish-last"]);
    assert_eq!(broken(&builtin, "MS+C+M+F"), ["three-layers"]);
    assert!(broken(&library, "MS+C+M+F").is_empty(), "a rule without a condition is silent");
    let mine = library.broken_rules(&stack("MS+K"))[0];
    assert_eq!((mine.severity, mine.certainty), (Severity::Warning, Certainty::Measured));
    assert_eq!((mine.name.as_str(), mine.says.as_str()), ("black-first", "an owner's words"));
}

#[test]
fn a_rule_given_twice_is_named_with_its_line() {
    let text = rule("short", "note", "most_layers = 2") + &rule("short", "note", "most_layers = 1");
    let error = based(&text).unwrap_err().to_string();
    assert!(error.contains("library.toml:9:") && error.contains("rule short: is given twice"), "{error}");
}

#[test]
fn a_stack_that_a_rule_forbids_is_not_available() {
    let text = rule("no-finish-on-flakes", "error", "over = \"finish\"\nunder = \"metallic\"");
    let (library, builtin) = (based(&text).unwrap(), Library::builtin());
    let names = |library: &Library| -> Vec<String> {
        let all = "metallic,cyan,finish".parse().unwrap();
        library.at_hand(&all).iter().map(|entry| entry.stack.to_string()).collect()
    };
    let gone = ["MC+F", "MM+F", "MG+F", "MS+F", "MS+C+F"];
    let kept: Vec<_> = names(&builtin).into_iter().filter(|name| !gone.contains(&name.as_str())).collect();
    assert_eq!(names(&library), kept);
    assert_eq!(names(&builtin).len(), kept.len() + gone.len());
}

#[test]
fn a_listed_stack_that_a_rule_forbids_is_an_error() {
    let text = format!(
        "stacks = [\"substrate\", \"C\", \"C+F\"]\n{}",
        rule("bare", "error", "over = \"finish\"\nunder = \"cyan\"")
    );
    let error = based(&text).unwrap_err().to_string();
    assert!(error.contains("library.toml:3:") && error.contains("stack C+F: an owner's words"), "{error}");
}
