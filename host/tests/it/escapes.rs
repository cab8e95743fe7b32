//! What files and arguments of unknown origin say reaches the terminal as text: never a control character, never a change of
//! direction, never a line of its own making.

use std::fs;

use testing::program::{Bench, text};

/// Sets a title, colours, reverses what follows, and fakes a message.
const HOSTILE: &str = "x\u{1b}]0;owned\u{7}\u{1b}[31m\u{9b}8m\u{202e}\u{2066}y\nfoilpress: all is well\r";

/// `HOSTILE` as a string of TOML or JSON.
fn quoted() -> String {
    serde_json::to_string(HOSTILE).expect("a string").replace('\u{9b}', "\\u009b")
}

/// Runs, and returns standard output and standard error after checking both.
fn shown(bench: &Bench, args: &[&str]) -> String {
    let output = bench.command_of(args).output().expect("it starts");
    let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
    for c in said.chars().filter(|c| *c != '\n') {
        let acts = c.is_control()
            || ('\u{202a}'..='\u{202e}').contains(&c)
            || ('\u{2066}'..='\u{2069}').contains(&c);
        assert!(!acts, "{args:?}: {c:?} in {said:?}");
    }
    let faked = said.lines().filter(|line| line.starts_with("foilpress: all is well"));
    assert_eq!(faked.count(), 0, "{args:?}: {said}");
    said
}

#[test]
fn names_in_a_library() {
    let bench = Bench::new();
    fs::create_dir(bench.path("lib")).unwrap();
    let rows: String = (0..=90).step_by(10).map(|theta| format!("{theta},0.1,0.1,0.1\n")).collect();
    fs::write(bench.path("lib/c.csv"), format!("theta_h_deg,r,g,b\n{rows}")).unwrap();
    let name = quoted();
    let library = format!(
        "format = 1\nbased_on = \"built-in\"\nname = {name}\n[[measured]]\nstack = \"C\"\ncurve = \"c.csv\"\nby = {name}\n\
         when = \"2026-11-02\"\nsetup = {name}\n"
    );
    fs::write(bench.path("lib/library.toml"), library).unwrap();
    assert!(shown(&bench, &["inks", "list", "--library", "lib"]).contains("x\\u001b]0;owned\\u0007"));
    assert!(
        shown(&bench, &["inks", "show", "C", "--library", "lib"]).contains("measured by x\\u001b]0;owned")
    );
    assert!(shown(&bench, &["inks", "diff", "builtin", "lib"]).contains("\\u202e"));
    let json = shown(&bench, &["inks", "diff", "builtin", "lib", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["second"], HOSTILE, "JSON keeps its meaning");
    // A list of libraries, an error of a library, and one with a field that does not exist.
    fs::write(bench.path("lib/library.toml"), format!("format = 1\n{name} = 1\n")).unwrap();
    assert!(shown(&bench, &["inks", "check", "lib"]).contains("owned"));
    assert!(shown(&bench, &["inks", "list", "--library", "lib"]).contains("owned"));
}

#[test]
fn errors_that_quote_a_file() {
    let bench = Bench::new();
    fs::write(
        bench.path("a.svg"),
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"8mm\"{HOSTILE}></svg>"),
    )
    .unwrap();
    fs::write(bench.path("setup.toml"), format!("format = 1\n{} = 1\n", quoted())).unwrap();
    let mut bsdf = b"tensor_file\0\x01\0\x01\0\0\0".to_vec();
    bsdf.extend(u16::try_from(HOSTILE.len()).unwrap().to_le_bytes());
    bsdf.extend(HOSTILE.as_bytes());
    bsdf.extend(7u16.to_le_bytes());
    bsdf.push(1);
    bsdf.extend([0; 64]);
    fs::write(bench.path("m.bsdf"), bsdf).unwrap();
    fs::write(bench.path("m.gltf"), format!("{{\"asset\":{{\"version\":{}}}}}", quoted())).unwrap();
    fs::create_dir(bench.path("maps")).unwrap();
    fs::write(bench.path("maps/material.toml"), format!("{} = 1\n", quoted())).unwrap();
    for args in [
        &["layers", "a.svg", "-o", "o"][..],
        &["measure", ".", "--setup", "setup.toml", "-o", "o"],
        &["factor", "m.bsdf", "-o", "o"],
        &["print", "m.gltf"],
        &["print", "maps"],
    ] {
        assert!(shown(&bench, args).contains("foilpress: "), "{args:?} is refused");
    }
}

#[cfg(unix)]
#[test]
fn names_of_files_and_arguments() {
    let bench = Bench::new();
    let name = HOSTILE.replace('\r', "") + ".rgl";
    fs::write(bench.path(&name), "no job").unwrap();
    for args in [
        &["inspect", &name][..],
        &["plan", &name],
        &["layers", &name],
        &["print", &name],
        &["print", "sample:leaf", "--size", &name],
        &["print", "sample:leaf", &name],
        &["inks", "show", &name],
        &["ledger", "new", &name],
        &[&name],
        &["print", "sample:leaf", "--inks", &name],
        &["print", "sample:leaf", "--preset", &name],
    ] {
        let said = bench.command_of(args).output().expect("it starts").stderr;
        assert!(!said.contains(&0x1b) && !said.contains(&7), "{args:?}: {}", text(&said));
    }
    let picture = image::GrayImage::from_pixel(20, 20, image::Luma([0]));
    let art = bench.path("art");
    fs::create_dir(&art).unwrap();
    let gold = format!("gold{}.png", &HOSTILE[..12]);
    picture.save(art.join("white.png")).unwrap();
    picture.save(art.join(&gold)).unwrap();
    shown(&bench, &["plan", "layers", "art/white.png", &format!("art/{gold}")]);
}
