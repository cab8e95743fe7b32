//! Sources as the rules see them: without comments, strings and tests, and the modules of a crate with what
//! they use.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

/// Folders without sources of ours.
const OTHERS: [&str; 4] = ["target", "node_modules", ".git", "corpus"];

/// A file of Rust.
pub struct Source {
    /// From the repository's root, with slashes.
    pub path: String,
    /// As it stands.
    pub text: String,
    /// Line for line the same, with spaces in place of comments, strings and tests.
    pub code: String,
    /// That, with what only tests compile.
    pub with_tests: String,
    /// Whether only tests compile all of it.
    pub is_test: bool,
}

impl Source {
    /// Takes a file apart.
    pub fn new(path: &str, text: &str) -> Self {
        let with_tests = plain(text);
        let code = without_tests(&with_tests);
        // At the root, `tests` holds crates, whose sources are sources.
        let is_test = path.split('/').skip(1).any(|part| part == "tests" || part == "benches");
        Source { path: path.into(), text: text.into(), code, with_tests, is_test }
    }

    /// Lines that are not tests', nor of crates for tests.
    pub fn lines(&self) -> usize {
        if self.is_test || self.path.starts_with("tests/") || self.path.starts_with("fuzz/") {
            return 0;
        }
        let tests = self.with_tests.lines().zip(self.code.lines()).filter(|(a, b)| a != b).count();
        self.text.lines().count() - tests
    }

    /// Modules that only tests have: `#[cfg(test)] mod name;`.
    fn test_modules(&self) -> Vec<String> {
        let declared = |code: &str| -> BTreeSet<String> { Module::read(code).children.into_iter().collect() };
        declared(&self.with_tests).difference(&declared(&self.code)).cloned().collect()
    }

    /// The folder in which the modules that this file declares stand.
    fn folder(&self) -> String {
        let (folder, name) = self.path.rsplit_once('/').unwrap_or(("", &self.path));
        match name {
            "mod.rs" | "lib.rs" | "main.rs" => folder.into(),
            _ => format!("{folder}/{}", name.trim_end_matches(".rs")),
        }
    }
}

/// Every file of Rust in the repository, by its path.
pub fn read(root: &Path) -> Result<Vec<Source>> {
    let mut sources = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root.join(&folder))? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            let path = folder.join(&name);
            if root.join(&path).is_dir() {
                folders.extend((!OTHERS.contains(&&*name)).then_some(path));
            } else if name.ends_with(".rs") {
                let text =
                    fs::read_to_string(root.join(&path)).with_context(|| path.display().to_string())?;
                sources.push(Source::new(&path.to_string_lossy().replace('\\', "/"), &text));
            }
        }
    }
    let tests: Vec<String> = sources
        .iter()
        .flat_map(|s| s.test_modules().into_iter().map(|name| format!("{}/{name}", s.folder())))
        .collect();
    sources.retain(|s| {
        !tests
            .iter()
            .any(|t| s.path.strip_prefix(t).is_some_and(|rest| rest == ".rs" || rest.starts_with('/')))
    });
    sources.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(sources)
}

/// The text with spaces for comments and for what stands in strings.
fn plain(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let starts = |at: usize, what: &str| what.chars().enumerate().all(|(k, c)| chars.get(at + k) == Some(&c));
    let mut at = 0;
    while at < chars.len() {
        let is_word =
            at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_') && !starts(at - 1, "b");
        let hashes = chars[at + 1..].iter().take_while(|&&c| c == '#').count();
        let end = if starts(at, "//") {
            (at..chars.len()).find(|&k| chars[k] == '\n').unwrap_or(chars.len())
        } else if starts(at, "/*") {
            let mut depth = 0;
            let close = (at..chars.len()).find(|&k| {
                depth += i32::from(starts(k, "/*"));
                depth -= i32::from(starts(k, "*/"));
                depth == 0
            });
            close.map_or(chars.len(), |k| k + 2)
        } else if chars[at] == 'r' && !is_word && chars.get(at + 1 + hashes) == Some(&'"') {
            let close = format!("\"{}", "#".repeat(hashes));
            let from = at + hashes + 2;
            (from..chars.len()).find(|&k| starts(k, &close)).map_or(chars.len(), |k| k + close.len())
        } else if chars[at] == '"' {
            let mut k = at + 1;
            while k < chars.len() && chars[k] != '"' {
                k += 1 + usize::from(chars[k] == '\\');
            }
            k + 1
        } else if chars[at] == '\'' && chars.get(at + 1) == Some(&'\\') {
            (at + 3..chars.len()).find(|&k| chars[k] == '\'').map_or(chars.len(), |k| k + 1)
        } else if chars[at] == '\'' && chars.get(at + 2) == Some(&'\'') {
            at + 3
        } else {
            out.push(chars[at]);
            at += 1;
            continue;
        };
        out.extend(chars[at..end.min(chars.len())].iter().map(|&c| if c == '\n' { c } else { ' ' }));
        at = end;
    }
    out
}

/// The code with spaces for every item that only tests compile, or only the documentation.
fn without_tests(code: &str) -> String {
    const MARKS: [&str; 2] = ["#[cfg(test)]", "#[cfg(doc)]"];
    let mut out = code.to_owned();
    let blank = |s: &str| s.chars().map(|c| if c == '\n' { c } else { ' ' }).collect::<String>();
    while let Some((start, mark)) = MARKS.iter().find_map(|mark| Some((out.find(mark)?, mark))) {
        let (mut depth, mut end) = (0, out.len());
        for (at, c) in out[start + mark.len()..].char_indices() {
            depth += i32::from(matches!(c, '{' | '(' | '['));
            depth -= i32::from(matches!(c, '}' | ')' | ']'));
            // A field or variant ends with a comma, or with the brace that is not its own.
            if depth < 0 || depth == 0 && matches!(c, ';' | '}' | ',') {
                end = start + mark.len() + at + usize::from(depth == 0);
                break;
            }
        }
        let cut = blank(&out[start..end]);
        out.replace_range(start..end, &cut);
    }
    out
}

/// What one file declares, imports and names.
#[derive(Default)]
struct Module {
    children: Vec<String>,
    items: BTreeSet<String>,
    imports: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    paths: BTreeSet<Vec<String>>,
}

impl Module {
    fn read(code: &str) -> Self {
        const ITEMS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];
        let words = words(code);
        let mut module = Module::default();
        let mut at = 0;
        while at < words.len() {
            let next = words.get(at + 1).copied().unwrap_or("");
            if words[at] == "use" {
                at = module.import(&words, at + 1, &[]);
            } else if words[at] == "mod" && words.get(at + 2) == Some(&";") {
                module.children.push(next.into());
                at += 2;
            } else if ITEMS.contains(&words[at]) {
                module.items.insert(next.into());
                at += 1;
            } else if is_name(words[at]) && next == "::" {
                let mut path = vec![words[at].to_owned()];
                while words.get(at + 1) == Some(&"::") && words.get(at + 2).is_some_and(|w| is_name(w)) {
                    at += 2;
                    path.push(words[at].into());
                }
                module.paths.insert(path);
                at += 1;
            } else {
                at += 1;
            }
        }
        module
    }

    /// Reads one tree of an import from here on, and returns where it ends.
    fn import(&mut self, words: &[&str], mut at: usize, before: &[String]) -> usize {
        let mut path = before.to_vec();
        while at < words.len() {
            match words[at] {
                "::" => at += 1,
                "{" => {
                    at += 1;
                    while at < words.len() && words[at] != "}" {
                        at = self.import(words, at, &path);
                        at += usize::from(words.get(at) == Some(&","));
                    }
                    return at + 1;
                }
                "*" => {
                    self.globs.push(path);
                    return at + 1;
                }
                name if is_name(name) => {
                    let is_self = name == "self" && !path.is_empty();
                    path.extend((!is_self).then(|| name.to_owned()));
                    at += 1;
                    if words.get(at) == Some(&"as") {
                        self.imports.insert(words.get(at + 1).copied().unwrap_or("_").into(), path);
                        return at + 2;
                    }
                    if words.get(at) != Some(&"::") {
                        self.imports.insert(path.last().cloned().unwrap_or_default(), path);
                        return at;
                    }
                }
                _ => return at,
            }
        }
        at
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Names, `::`, and every other character by itself.
fn words(code: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = code.trim_start();
    while let Some(first) = rest.chars().next() {
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        let length = match first {
            ':' if rest.starts_with("::") => 2,
            c if is_part(c) => rest.find(|c| !is_part(c)).unwrap_or(rest.len()),
            c => c.len_utf8(),
        };
        words.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    words
}

/// The modules of a crate, by their paths.
pub struct Crate {
    modules: BTreeMap<Vec<String>, (String, Module)>,
}

impl Crate {
    /// The modules below this folder, which ends with `src/`. What is a program beside a library stands for
    /// itself.
    pub fn new<'a>(folder: &str, sources: impl Iterator<Item = &'a Source>) -> Self {
        let mut modules = BTreeMap::new();
        for source in sources {
            let inside = source.path.strip_prefix(folder).unwrap_or(&source.path).trim_end_matches(".rs");
            let mut path: Vec<String> = inside.split('/').map(str::to_owned).collect();
            if matches!(path.last().map(String::as_str), Some("mod" | "lib" | "main")) {
                path.pop();
            }
            // `lib` comes before `main`.
            modules.entry(path).or_insert_with(|| (source.path.clone(), Module::read(&source.code)));
        }
        Crate { modules }
    }

    /// The circles: files that use each other, directly or by others.
    pub fn circles(&self) -> Vec<Vec<String>> {
        let uses: BTreeMap<_, _> = self.modules.keys().map(|m| (m, self.uses(m))).collect();
        let reach = |from: &Vec<String>| {
            let mut seen: BTreeSet<&Vec<String>> = BTreeSet::new();
            let mut next: Vec<_> = uses[from].iter().collect();
            while let Some(module) = next.pop() {
                if seen.insert(module) {
                    next.extend(&uses[module]);
                }
            }
            seen
        };
        let all: BTreeMap<_, _> = self.modules.keys().map(|m| (m, reach(m))).collect();
        let mut circles = BTreeSet::new();
        for (module, reached) in &all {
            let circle: Vec<_> = reached.iter().filter(|m| all[*m].contains(module)).collect();
            if reached.contains(module) {
                circles.insert(circle.iter().map(|m| self.modules[**m].0.clone()).collect::<Vec<_>>());
            }
        }
        circles.into_iter().collect()
    }

    /// The modules that one uses, but for those above and below it.
    fn uses(&self, from: &[String]) -> BTreeSet<Vec<String>> {
        let module = &self.modules[from].1;
        let named = module.paths.iter().chain(module.imports.values());
        let items = named.filter_map(|path| self.find(from, path, 0)).filter(|(_, is_item)| *is_item);
        let globs = module.globs.iter().filter_map(|path| self.find(from, path, 0));
        let other = |m: &Vec<String>| !m.starts_with(from) && !from.starts_with(m);
        items.chain(globs).map(|(module, _)| module).filter(other).collect()
    }

    /// Where something that a module names is defined, and whether it is an item there or the module itself.
    fn find(&self, from: &[String], path: &[String], depth: usize) -> Option<(Vec<String>, bool)> {
        let mut at = from.to_vec();
        let mut rest = path;
        let mut is_below = false;
        // An import of an import of an import; a name that imports itself ends here.
        if depth > 16 {
            return None;
        }
        while let Some((name, after)) = rest.split_first() {
            let child = [&at[..], std::slice::from_ref(name)].concat();
            match &**name {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()),
                _ if self.modules.contains_key(&child) => at = child,
                _ => {
                    let module = &self.modules.get(&at)?.1;
                    if let Some(path) =
                        module.imports.get(name).filter(|p| p.first() != Some(name) || p.len() > 1)
                    {
                        let full = [&path[..], after].concat();
                        return self.find(&at, &full, depth + 1);
                    }
                    if module.items.contains(name) {
                        return Some((at, true));
                    }
                    let mut globs = module.globs.iter();
                    let glob = globs.find_map(|glob| self.find(&at, &[&glob[..], rest].concat(), depth + 1));
                    // A name that is not known here is another crate's, unless a path led here.
                    return glob.or_else(|| is_below.then_some((at, true)));
                }
            }
            is_below = true;
            rest = after;
        }
        Some((at, false))
    }
}
