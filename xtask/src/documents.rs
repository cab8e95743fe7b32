//! Rules of the documents, as tests.
//!
//! Problem: a decision grows into a lab book, and a renamed file or heading leaves links that lead nowhere.
//! Method: sizes of decisions and of the changelog have limits, and every relative link in a Markdown file must find its
//! file and its heading, named as GitHub names it.
//! Limits: links in code blocks are not read; addresses on the web are not tried.

use std::fs;
use std::path::{Path, PathBuf};

/// Bytes of one decision: a page.
const DECISION: usize = 7_000;

/// Bytes of all decisions.
const DECISIONS: usize = 110_000;

/// Bytes of the changelog: a screen.
const CHANGELOG: usize = 6_000;

/// Folders without documents of ours.
const OTHERS: [&str; 4] = ["target", "node_modules", ".git", "corpus"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the repository")
}

/// Every Markdown file below a folder.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !OTHERS.contains(&&*name) {
            documents(&path, found);
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

/// The text without its code blocks.
fn prose(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

/// The anchors of a document's headings.
fn anchors(text: &str) -> Vec<String> {
    let plain = |heading: &str| -> String {
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.collect::<String>().to_lowercase().replace(' ', "-")
    };
    prose(text)
        .lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| plain(line.trim_start_matches('#')))
        .collect()
}

/// The targets of a document's links.
fn links(text: &str) -> Vec<String> {
    let text = prose(text);
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    targets.map(|(target, _)| target.to_owned()).filter(|target| !target.contains("://")).collect()
}

#[test]
fn decisions_fit_on_a_page_and_the_changelog_on_a_screen() {
    let mut decisions = Vec::new();
    documents(&root().join("docs/decisions"), &mut decisions);
    let sizes = decisions.iter().map(|path| (fs::read(path).expect("a decision").len(), path));
    let total: usize = sizes.clone().map(|(size, _)| size).sum();
    for (size, path) in sizes {
        assert!(
            size <= DECISION,
            "{} has {size} bytes of {DECISION}; the rest is the history's",
            path.display()
        );
    }
    assert!(total <= DECISIONS, "decisions have {total} bytes of {DECISIONS}");
    let size = fs::read(root().join("CHANGELOG.md")).expect("the changelog").len();
    assert!(size <= CHANGELOG, "CHANGELOG.md has {size} bytes of {CHANGELOG}");
}

#[test]
fn links_find_their_file_and_heading() {
    let mut found = Vec::new();
    documents(root(), &mut found);
    assert!(found.len() > 50, "only {} documents were found", found.len());
    let (mut lost, mut tried) = (Vec::new(), 0);
    for path in &found {
        let text = fs::read_to_string(path).expect("a document");
        for link in links(&text) {
            tried += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() { path.clone() } else { path.with_file_name(file) };
            let is_there = target.exists()
                && (anchor.is_empty()
                    || fs::read_to_string(&target)
                        .is_ok_and(|text| anchors(&text).iter().any(|a| a == anchor)));
            if !is_there {
                lost.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(tried > 100, "only {tried} links were found");
    assert!(lost.is_empty(), "links that lead nowhere:\n{}", lost.join("\n"));
}

#[test]
fn packages_of_other_systems_agree_on_version_and_number() {
    let version = env!("CARGO_PKG_VERSION");
    let (vendor, product) = protocol::USB;
    let number = format!("ATTR{{idVendor}}==\"{vendor:04x}\", ATTR{{idProduct}}==\"{product:04x}\"");
    for (file, line) in [
        ("macos/foilpress.rb", format!("version \"{version}\"")),
        ("others/PKGBUILD", format!("pkgver={version}\n")),
        ("others/foilpress.spec", format!("Version:        {version}\n")),
        ("others/default.nix", format!("version = \"{version}\"")),
        ("debian/changelog", format!("foilpress ({version}-")),
        ("../CITATION.cff", format!("version: {version}\n")),
        ("70-foilpress.rules", number.clone()),
        ("71-foilpress-queues.rules", number),
    ] {
        let text = fs::read_to_string(root().join("packaging").join(file)).expect("a file");
        assert!(text.contains(&line), "packaging/{file} does not say `{}`", line.trim());
    }
}
