use super::*;

fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let sources: Vec<Source> = files.iter().map(|(path, text)| Source::new(path, text)).collect();
    Crate::new("a/src/", sources.iter()).circles()
}

fn named(text: &str) -> Vec<String> {
    numbers(&Source::new("host/art/src/a.rs", text)).into_iter().map(|found| found.what).collect()
}

#[test]
fn the_repository_is_as_tidy_as_its_list_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the repository");
    run(root, false).unwrap();
}

#[test]
fn circles_are_found_by_paths_imports_and_what_parents_hand_on() {
    let by_path = [("a/src/b.rs", "fn f() { crate::c::g() }"), ("a/src/c.rs", "use super::b::f; fn g() {}")];
    assert_eq!(circles_of(&by_path), [["a/src/b.rs", "a/src/c.rs"]]);
    // Three of them, one through its parent and one through a glob.
    let by_parent = [
        ("a/src/lib.rs", "mod b; mod c; mod d; pub use c::{G, h as i};"),
        ("a/src/b.rs", "struct S(super::G);"),
        ("a/src/c.rs", "use crate::d::*; pub struct G; pub fn h() {}"),
        ("a/src/d.rs", "use crate::b; fn f(s: b::S) {}"),
    ];
    assert_eq!(circles_of(&by_parent), [["a/src/b.rs", "a/src/c.rs", "a/src/d.rs"]]);
    let two = [
        ("a/src/b.rs", "use crate::c::C;"),
        ("a/src/c.rs", "pub struct C; use crate::b::B;"),
        ("a/src/d/mod.rs", "mod e; mod f;"),
        ("a/src/d/e.rs", "fn e() { super::f::f() }"),
        ("a/src/d/f.rs", "fn f() { super::e::e() }"),
    ];
    assert_eq!(circles_of(&two).len(), 2);
}

#[test]
fn what_is_no_circle_is_not_called_one() {
    for free in [
        // A parent and its child.
        [("a/src/b.rs", "mod c; fn f() { c::g() }"), ("a/src/b/c.rs", "use super::f; fn g() {}")],
        // Words, and what only tests or the documentation see.
        [
            ("a/src/b.rs", "// crate::c::g\nconst A: &str = \"crate::c::g\";"),
            ("a/src/c.rs", "use crate::b::A;"),
        ],
        [("a/src/b.rs", "#[cfg(test)]\nmod tests { use crate::c::g; }"), ("a/src/c.rs", "use crate::b::A;")],
        [("a/src/b.rs", "#[cfg(doc)]\nuse crate::c::g;"), ("a/src/c.rs", "use crate::b::A;")],
        // Another crate of that name.
        [("a/src/b.rs", "use c::g;"), ("a/src/c.rs", "use crate::b::A;")],
        // A module by which something else is named.
        [("a/src/b.rs", "use crate::c; fn f(x: c::super::b::A) {}"), ("a/src/c.rs", "use crate::b::A;")],
    ] {
        assert_eq!(circles_of(&free), Vec::<Vec<String>>::new(), "{free:?}");
    }
}

#[test]
fn numbers_need_a_reason() {
    assert_eq!(named("/// Steps.\nconst A: usize = 14;\n"), ["A in line 2"]);
    assert_eq!(named("const A: (f64, f64) = (0.1, 0.2);\npub(super) const B: [u8; 2] = [3, 4];").len(), 2);
    assert_eq!(named("fn f() {\n    const A: f64 = 3.0;\n}"), ["A in line 2"]);
    // A reason of another number, and one that is farther away.
    assert_eq!(named("/// Because.\nconst A: f64 = 3.0;\nconst B: f64 = 4.0;"), ["B in line 3"]);
    for reason in
        ["Source: the paper, section 3.", "Enough: a sheet has four.", "Less would be noise.", "As measured."]
    {
        assert_eq!(named(&format!("/// Steps. {reason}\nconst A: usize = 14;")), [""; 0], "{reason}");
        assert_eq!(named(&format!("const A: usize = 14; // {reason}")), [""; 0], "{reason}");
    }
    for other in [
        "const A: &str = \"3\";",
        "const A: Rules = Rules { a: 3 };",
        "const A: usize = 2 * FAR;",
        "// const A: f64 = 3.0;",
        "fn f<const N: usize>(a: [u8; N]) {}",
        "pub fn f<const N: usize>() {}",
        "const A: &[u8] = b\"3\";",
    ] {
        assert_eq!(named(other), [""; 0], "{other}");
    }
    let of = Source::new("host/art/src/a.rs", "struct Rules { a: f64 }");
    let by = |path| Source::new(path, "#[cfg(test)]\nmod tests { fn f(r: Rules) {} }");
    assert_eq!(rules(&[of, by("host/view/src/b.rs")]).len(), 1);
    let of = Source::new("host/art/src/a.rs", "struct Rules { a: f64 }");
    assert_eq!(rules(&[of, by("host/art/src/b.rs")]).len(), 0);
}

#[test]
fn long_lines_full_folders_and_libraries_are_found() {
    let found = lines(&Source::new("a.rs", &format!("{}\n// {}\n", "é".repeat(110), "e".repeat(108))));
    assert_eq!(found.iter().map(|found| &*found.what).collect::<Vec<_>>(), ["line 2"]);
    let files: Vec<Source> = (0..27).map(|i| Source::new(&format!("a/src/m{i}.rs"), "")).collect();
    assert_eq!((folders(&files[..25]).len(), folders(&files).len()), (0, 2));
    let manifest = "[dependencies]\nimage.workspace = true\npngs = \"1\"\n[dev-dependencies]\ntiff = \"1\"\n\
        [target.'cfg(unix)'.dependencies]\npng = { version = \"1\" }\n[workspace.dependencies]\nexr = \"1\"\n";
    assert_eq!(images(manifest), ["image", "png"]);
}

#[test]
fn tests_and_comments_are_told_from_code() {
    let text = "fn a<'a>() { let b = ('\"', '\\'', r#\"//\"#); /* /* */ */ }\n#[cfg(test)]\nmod tests {\n    fn c() {}\n}\nfn d() {}\n";
    let source = Source::new("a/src/b.rs", text);
    assert!(
        source.code.contains("fn a<'a>") && source.code.contains("fn d") && !source.code.contains("fn c")
    );
    assert!(!source.code.contains('/') && source.code.lines().count() == text.lines().count());
    assert_eq!(source.lines(), 2);
    assert_eq!(Source::new("a/tests/it/b.rs", text).lines(), 0);
    assert_eq!(Source::new("tests/src/b.rs", text).lines(), 0);
}

#[test]
fn lists_only_become_shorter() {
    let found = |file: &str| Finding { rule: "lines", file: file.into(), what: "line 1".into() };
    let known = parse("# words\nlines a.rs 2\nlines b.rs 1\n").unwrap();
    compare(&known, &[found("a.rs"), found("a.rs"), found("b.rs")]).unwrap();
    let more = compare(&known, &[found("a.rs"), found("a.rs"), found("b.rs"), found("b.rs")]).unwrap_err();
    assert!(more.to_string().starts_with("lines of b.rs: 2, of 1 listed"), "{more}");
    let less = compare(&known, &[found("a.rs"), found("b.rs")]).unwrap_err();
    assert!(less.to_string().starts_with("lines of a.rs: 1, of 2 listed; run"), "{less}");
    // A file that moved takes its lines along, and none comes beside them.
    let moved = shrunk(&known, &[found("c.rs"), found("c.rs"), found("b.rs")]).unwrap();
    assert!(moved.ends_with("lines b.rs 1\nlines c.rs 2\n"), "{moved}");
    assert!(shrunk(&known, &[found("c.rs"), found("c.rs"), found("b.rs"), found("b.rs")]).is_err());
    assert!(parse("lines a.rs\n").is_err() && parse("lines a.rs x\n").is_err());
}
