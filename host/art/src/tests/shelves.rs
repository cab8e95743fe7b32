//! Art on disk and in memory.

use std::sync::Arc;

use ::files::shelf::Memory;

use super::drawings::drawing;
use super::*;

/// What is made of files of a bench, by their names, on disk and in memory under the same paths: artwork with the dots of
/// its layers, or what is said instead.
fn both(bench: &Bench, kept: &[&str], asked: &[&str]) -> Result<String, String> {
    let mut memory = Memory::default();
    for name in kept {
        memory.insert(bench.path(name), fs::read(bench.path(name)).unwrap()).unwrap();
    }
    let paths: Vec<PathBuf> = asked.iter().map(|name| bench.path(name)).collect();
    let made = |options: &Options| match open(&paths, options, &Silent) {
        Ok(art) => Ok(format!("{art:?}")),
        Err(error) => Err(error.to_string()),
    };
    let on_disk = made(&Options::default());
    let in_memory = made(&Options { shelf: Arc::new(memory), ..Options::default() });
    assert!(on_disk == in_memory, "{asked:?}");
    on_disk
}

#[test]
fn art_is_the_same_on_disk_and_in_memory() {
    let bench = Bench::new();
    bench.grey("white.png", (20, 10), &[0; 200]);
    bench.grey("gold.png", (20, 10), &[9; 200]);
    bench.write("a.svg", drawing("<image width='9' height='9' href='white.png'/><text y='8'>a</text>"));
    bench.write("cut.png", &fs::read(bench.path("gold.png")).unwrap()[..60]);
    for asked in [&["white.png"][..], &["white.png", "gold.png"], &["a.svg"]] {
        both(&bench, &["white.png", "gold.png", "a.svg"], asked).unwrap();
    }
    both(&bench, &["cut.png"], &["cut.png"]).unwrap_err();
    let folder = tempfile::tempdir_in(bench.0.path()).unwrap();
    fs::copy(bench.path("gold.png"), folder.path().join("gold.png")).unwrap();
    let name = folder.path().file_name().unwrap().to_str().unwrap();
    both(&bench, &[&format!("{name}/gold.png")], &[name]).unwrap();
}

#[test]
fn a_link_to_nothing_in_memory_is_named_and_one_that_leads_out_is_refused() {
    let said = |href: &str| {
        let mut memory = Memory::default();
        let svg = drawing(&format!("<image width='9' height='9' href='{href}'/>"));
        memory.insert("art/a.svg", svg.into_bytes()).unwrap();
        memory.insert("secret.png", [0; 9]).unwrap();
        let options = Options { shelf: Arc::new(memory), ..Options::default() };
        open(&["art/a.svg".into()], &options, &Silent).unwrap_err().to_string()
    };
    let gone = said("gone.png");
    assert!(gone.contains("art/a.svg") && gone.contains("its picture `gone.png` cannot be read"), "{gone}");
    assert!(said("../secret.png").contains("lies outside of the folder"));
    for href in ["../../secret.png", "/secret.png", "/etc/passwd"] {
        assert!(said(href).contains("cannot be read"), "{href}");
    }
}

#[test]
fn a_page_in_memory_says_that_ghostscript_draws_it() {
    for start in ["%PDF-1.7\n", "%!PS-Adobe-3.0\n"] {
        let mut memory = Memory::default();
        memory.insert("page.pdf", start.as_bytes()).unwrap();
        let options = Options { shelf: Arc::new(memory), ..Options::default() };
        let said = open(&["page.pdf".into()], &options, &Silent).unwrap_err().to_string();
        assert!(said.contains("page.pdf") && said.contains("Ghostscript"), "{said}");
    }
}
