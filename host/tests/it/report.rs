//! The page that joins what `foilpress print` writes.

use std::fs;

use testing::program::{Bench, small_document, text};

#[test]
fn the_report_shows_files_that_exist_and_names_as_text() {
    let bench = Bench::new();
    let name = "<b>tile&co";
    small_document(&bench.path(name));
    let args = ["print", name, "--size", "12x8mm", "--paper", "postcard", "-q", "-o", "out"];
    let output = bench.command_of(args).output().expect("it starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("See out/report.html") && said.contains("out/plan.html"), "{said}");
    let page = fs::read_to_string(bench.path("out/report.html")).expect("a page");
    assert!(page.contains("&lt;b&gt;tile&amp;co") && !page.contains(name), "names are text");
    let mut links = 0;
    for attribute in ["href=\"", "src=\""] {
        for part in page.split(attribute).skip(1) {
            let link = part.split('"').next().expect("an end");
            assert!(bench.path("out").join(link).exists(), "{link}");
            links += 1;
        }
    }
    assert!(links > 12, "{links}");
    // The spectrum of this print is drawn, and its figures are in the report.
    assert!(page.contains("power spectrum of the halftone"));
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(bench.path("out/report.json")).unwrap()).unwrap();
    assert!(report["halftone"]["spectrum"].as_array().is_some_and(|rings| rings.len() > 30));
    // Written again, the folder is ours to replace.
    assert!(bench.command_of(args).output().expect("it starts").status.success());
}
