//! `cargo xtask tidy`: rules of order that the compiler does not know.
//!
//! Problem: a circle of modules can only be read as a whole, a folder of fifty files has no rooms, a decoder
//! that is used in ten crates is judged in ten ways, and a number without a reason can neither be trusted nor
//! changed.
//!
//! Method: the sources are read as text without comments, strings and tests ([`source`]).
//! - *circles*: modules are files. One uses another if it names something that stands there: by a path, or by
//!   an import, followed to where the item is defined. A parent and what is below it are one thing, so that
//!   uses between them do not count. What remains has to be free of circles.
//! - *folders*: at most 25 files of Rust side by side.
//! - *libraries*: only `readers` depends on a library that reads pictures. Tests may.
//! - *lines*: at most 110 characters, in comments and strings too, which rustfmt leaves alone.
//! - *numbers*: in the crates that decide dots and curves, every named number has `Source:` or a comment that
//!   says why ([`REASONS`]). Numbers that belong together may stand in a value of a type `Rules`, if a test
//!   of the crate names it.
//!
//! What stood when a rule came is listed by rule and file in `xtask/tidy.list`, and may only become less:
//! more than listed fails, and so does a list that is longer than needed. `cargo xtask tidy --shrink`
//! rewrites it, also for files that moved, unless a rule's sum would grow.
//!
//! Limits: what a glob import brings is found, what a macro writes is not, nor a method that is called on a
//! value. A comment that has the words of a reason may still give a bad one.

pub mod source;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};

use source::{Crate, Source};

/// Files of Rust side by side: what fits on a screen.
const SIDE_BY_SIDE: usize = 25;
/// Characters of a line, as in `rustfmt.toml`.
const LINE: usize = 110;
/// The one crate that reads pictures.
const READERS: &str = "host/readers";
/// Libraries that read pictures, by the names that dependencies have here.
const IMAGES: [&str; 8] = ["image", "tiff", "png", "zune-jpeg", "exr", "moxcms", "exif", "kamadak-exif"];
/// Crates whose named numbers need a reason: a wrong one is seen on paper only, or never.
const NUMBERS: [&str; 4] = ["host/appearance/", "host/measure/", "host/art/", "host/halftone/"];
/// What a comment says that gives a reason: a cause, what would happen otherwise, what was measured, or where
/// to read.
const REASONS: [&str; 23] = [
    "source:",
    "because",
    "so that",
    ", for ",
    "; for ",
    ". for ",
    ", since ",
    "otherwise",
    "measured",
    "decisions/",
    "decision",
    "equation",
    "section",
    "would",
    "cannot",
    "must",
    "enough",
    "needs",
    ", so ",
    "as in",
    "as much as",
    "as many as",
    ": ",
];

/// One thing that a rule found.
pub struct Finding {
    rule: &'static str,
    file: String,
    what: String,
}

impl Finding {
    fn new(rule: &'static str, file: &str, what: String) -> Self {
        Finding { rule, file: file.into(), what }
    }
}

/// How many findings a rule may have in a file.
type Known = BTreeMap<(String, String), usize>;

/// Checks all rules, or writes the list anew; says how many lines of Rust there are without tests.
pub fn run(root: &Path, shrink: bool) -> Result<()> {
    let sources = source::read(root)?;
    let found = findings(root, &sources)?;
    let path = root.join("xtask/tidy.list");
    let known = parse(&fs::read_to_string(&path).unwrap_or_default())?;
    if shrink {
        fs::write(&path, shrunk(&known, &found)?)?;
    } else {
        compare(&known, &found)?;
    }
    println!("{} lines of Rust without tests", sources.iter().map(Source::lines).sum::<usize>());
    Ok(())
}

/// What all rules find.
fn findings(root: &Path, sources: &[Source]) -> Result<Vec<Finding>> {
    let code: Vec<&Source> = sources.iter().filter(|s| !s.is_test).collect();
    let mut found = circles(&code);
    found.extend(folders(sources));
    found.extend(libraries(root)?);
    found.extend(rules(sources));
    found.extend(sources.iter().flat_map(lines));
    found
        .extend(code.into_iter().filter(|s| NUMBERS.iter().any(|c| s.path.starts_with(c))).flat_map(numbers));
    Ok(found)
}

/// The members of circles, each listed by the first file.
fn circles(sources: &[&Source]) -> Vec<Finding> {
    let roots = sources.iter().filter_map(|s| Some(format!("{}/src/", s.path.split_once("/src/")?.0)));
    let folders: BTreeSet<String> = roots.collect();
    let crates =
        folders.iter().map(|f| Crate::new(f, sources.iter().copied().filter(|s| s.path.starts_with(&**f))));
    let circles = crates.flat_map(|c| c.circles());
    circles.map(|circle| Finding::new("circles", &circle[0], circle[1..].join(" "))).collect()
}

/// Folders with too many files side by side.
fn folders(sources: &[Source]) -> Vec<Finding> {
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    for source in sources {
        *folders.entry(source.path.rsplit_once('/').map_or("", |(folder, _)| folder)).or_default() += 1;
    }
    let full = folders.into_iter().filter(|(_, count)| *count > SIDE_BY_SIDE);
    full.flat_map(|(folder, count)| {
        (SIDE_BY_SIDE..count)
            .map(move |_| Finding::new("folders", folder, format!("{count} files side by side")))
    })
    .collect()
}

/// Dependencies on libraries that read pictures.
fn libraries(root: &Path) -> Result<Vec<Finding>> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root.join(&folder))? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            let path = folder.join(&name);
            if root.join(&path).is_dir() {
                folders.extend((!["target", "node_modules", ".git"].contains(&&*name)).then_some(path));
            } else if name == "Cargo.toml" && folder != Path::new(READERS) {
                let file = path.to_string_lossy().replace('\\', "/");
                let text = fs::read_to_string(root.join(&path)).with_context(|| file.clone())?;
                let named = images(&text).into_iter();
                found.extend(named.map(|what| Finding::new("libraries", &file, what)));
            }
        }
    }
    Ok(found)
}

/// Libraries that read pictures among the dependencies of a manifest, but for those of tests.
fn images(manifest: &str) -> Vec<String> {
    let mut is_inside = false;
    let mut found = Vec::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            is_inside =
                line.ends_with("dependencies]") && !line.contains("dev-") && !line.contains("workspace");
        }
        let name = line.split(['.', '=', ' ']).next().unwrap_or_default();
        found.extend((is_inside && IMAGES.contains(&name)).then(|| name.to_owned()));
    }
    found
}

/// Lines that are too long.
fn lines(source: &Source) -> Vec<Finding> {
    let long = source.text.lines().enumerate().filter(|(_, line)| line.chars().count() > LINE);
    long.map(|(at, _)| Finding::new("lines", &source.path, format!("line {}", at + 1))).collect()
}

/// Named numbers without a reason.
fn numbers(source: &Source) -> Vec<Finding> {
    let text: Vec<&str> = source.text.lines().map(str::trim).collect();
    let mut found = Vec::new();
    for (at, line) in source.code.lines().enumerate() {
        let Some((before, (name, rest))) = line
            .split_once("const ")
            .and_then(|(before, after)| Some((before.trim(), after.split_once(": ")?)))
        else {
            continue;
        };
        let (kind, value) = rest.split_once('=').unwrap_or((rest, ""));
        let is_item =
            before.is_empty() || before == "pub" || before.starts_with("pub(") && before.ends_with(')');
        if !is_item || !is_number(kind) || is_derived(value) || value.trim_matches([' ', ';']) == "b" {
            continue;
        }
        let above = text[..at].iter().rposition(|line| !line.starts_with("//")).map_or(0, |last| last + 1);
        let beside = text[at].split_once("//").map_or("", |(_, comment)| comment);
        let comment = format!("{} {beside}", text[above..at].join(" ")).to_lowercase();
        if !REASONS.iter().any(|reason| comment.contains(reason)) {
            found.push(Finding::new("numbers", &source.path, format!("{name} in line {}", at + 1)));
        }
    }
    found
}

/// Types `Rules` that no test of their crate names.
fn rules(sources: &[Source]) -> Vec<Finding> {
    let of_crate = |path: &str| path.split_once("/src/").map_or("", |(folder, _)| folder).to_owned();
    let names = |s: &Source| {
        s.is_test && s.text.contains("Rules")
            || s.with_tests.matches("Rules").count() > s.code.matches("Rules").count()
    };
    let moved: BTreeSet<String> = sources.iter().filter(|s| names(s)).map(|s| of_crate(&s.path)).collect();
    let unmoved =
        sources.iter().filter(|s| s.code.contains("struct Rules") && !moved.contains(&of_crate(&s.path)));
    unmoved.map(|s| Finding::new("numbers", &s.path, "no test names `Rules`".into())).collect()
}

/// Whether a type is made of numbers.
fn is_number(kind: &str) -> bool {
    const TYPES: [&str; 14] = [
        "f32", "f64", "u8", "u16", "u32", "u64", "u128", "usize", "i8", "i16", "i32", "i64", "i128", "isize",
    ];
    let element = |part: &str| part.is_empty() || part.parse::<usize>().is_ok() || TYPES.contains(&part);
    let parts: Vec<&str> = kind.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    parts.iter().any(|p| TYPES.contains(p))
        && parts.iter().all(|p| element(p) || p.chars().all(|c| c.is_uppercase() || c == '_'))
}

/// Whether a value follows from others that have names.
fn is_derived(value: &str) -> bool {
    let parts = value.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '.');
    let parts: Vec<&str> = parts.filter(|p| !p.is_empty()).collect();
    let is_literal = |p: &&str| p.starts_with(|c: char| c.is_ascii_digit());
    parts.iter().any(|p| {
        p.len() > 1 && p.chars().all(|c| c.is_uppercase() || c == '_' || c.is_ascii_digit()) && !is_literal(p)
    }) && parts
        .iter()
        .filter(|p| is_literal(p))
        .all(|p| matches!(*p, "0" | "1" | "2" | "0.0" | "1.0" | "2.0"))
}

fn parse(text: &str) -> Result<Known> {
    let mut known = Known::new();
    for line in text.lines().filter(|l| !l.starts_with('#') && !l.is_empty()) {
        let parts: Vec<&str> = line.split(' ').collect();
        let [rule, file, count] = parts[..] else {
            bail!("xtask/tidy.list: `{line}` is not rule, file and count")
        };
        known.insert((rule.into(), file.into()), count.parse().with_context(|| line.to_owned())?);
    }
    Ok(known)
}

fn count(found: &[Finding]) -> Known {
    let mut counts = Known::new();
    for finding in found {
        *counts.entry((finding.rule.into(), finding.file.clone())).or_default() += 1;
    }
    counts
}

/// Fails where there is more than listed, and where a list is longer than needed.
fn compare(known: &Known, found: &[Finding]) -> Result<()> {
    let counts = count(found);
    let mut said = Vec::new();
    for (key, &count) in &counts {
        let allowed = known.get(key).copied().unwrap_or(0);
        if count > allowed {
            let of_key = found.iter().filter(|f| (f.rule, &f.file) == (&key.0, &key.1));
            let list: Vec<&str> = of_key.map(|f| &*f.what).collect();
            said.push(format!("{} of {}: {count}, of {allowed} listed: {}", key.0, key.1, list.join(", ")));
        }
    }
    for ((rule, file), &allowed) in known {
        let count = counts.get(&(rule.clone(), file.clone())).copied().unwrap_or(0);
        if count < allowed {
            said.push(format!(
                "{rule} of {file}: {count}, of {allowed} listed; run `cargo xtask tidy --shrink`"
            ));
        }
    }
    ensure!(said.is_empty(), "{}", said.join("\n"));
    Ok(())
}

/// The list for what is found, if no rule found more than the list has.
fn shrunk(known: &Known, found: &[Finding]) -> Result<String> {
    let sum =
        |known: &Known, rule: &str| known.iter().filter(|(k, _)| k.0 == rule).map(|(_, n)| n).sum::<usize>();
    let counts = count(found);
    for rule in counts.keys().map(|(rule, _)| rule) {
        let (now, before) = (sum(&counts, rule), sum(known, rule));
        ensure!(now <= before, "{rule}: {now} in all, of {before} listed: the list may only become shorter");
    }
    let lines = counts.iter().map(|((rule, file), count)| format!("{rule} {file} {count}\n"));
    Ok(format!(
        "# What `cargo xtask tidy` knows of, and how much of it. It may only become less: `cargo xtask tidy --shrink`.\n{}",
        lines.collect::<String>()
    ))
}
