//! Steps that a page writes are for the document that the page names the command of.

use std::fs;

use testing::program::{Bench, small_document};

/// What follows a key in the data of a page, up to a comma or a brace.
fn value<'a>(page: &'a str, key: &str) -> &'a str {
    let from = page.find(&format!("\"{key}\":")).expect("the key") + key.len() + 3;
    page[from..].split([',', '}']).next().expect("a value").trim_matches('"')
}

#[test]
fn the_document_of_a_page_is_made_again_by_factor() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    for (i, (of_page, of_factor)) in [
        ("--intent clamp", "--bases N"),
        ("--intent clamp --seed 7 --samples 64", "--seed 7 --bases N --samples 64"),
        ("--intent basis --bases 3", "--bases N"),
        ("--intent basis", ""),
    ]
    .into_iter()
    .enumerate()
    {
        bench.done(&format!("preview tile --size 12x8mm {of_page} -q -o {i}.html"));
        let page = fs::read_to_string(bench.path(&format!("{i}.html"))).expect("a page");
        let edits = &page[page.find("\"edits\":").expect("edits")..];
        let options = of_factor.replace('N', value(edits, "bases"));
        bench.done(&format!("factor tile {options} -q -o {i}.foil"));
        let steps = format!(
            "format = 1\nfingerprint = \"{}\"\n\n[[step]]\nalbedo = 0.5\n",
            value(edits, "fingerprint")
        );
        fs::write(bench.path(&format!("{i}.toml")), steps).expect("a file");
        bench.done(&format!("edit {i}.foil --steps {i}.toml -q -o {i}-edited.foil"));
    }
}
