//! Art as its owner's programs save it, through the program: what is cut, where it lies, and what the plan says.

use std::fs;

use testing::needs::ghostscript;
use testing::program::Bench;

/// A drawing of 40 x 30 mm, one unit a millimetre.
fn drawing(bench: &Bench, name: &str, inside: &str) {
    let svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="30mm" viewBox="0 0 40 30">{inside}</svg>"##
    );
    fs::write(bench.path(name), svg).unwrap();
}

/// All coordinates of the paths in a group of a drawing.
fn points(svg: &str, group: &str) -> Vec<(f64, f64)> {
    let inside = svg.split_once(&format!("<g id=\"{group}\"")).unwrap().1.split("</g>").next().unwrap();
    let paths = inside.split("d=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let pairs = paths.flat_map(|path| path.split(['M', 'L', 'Z']).filter(|pair| !pair.is_empty()));
    pairs
        .filter_map(|pair| pair.split_once(' '))
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect()
}

#[test]
fn lines_for_a_cutter_lie_on_the_sheet_where_their_copies_are_printed() {
    let bench = Bench::new();
    let art = r##"<g id="gold"><rect x="10" y="5" width="10" height="10"/></g>
        <g id="CutContour"><rect x="8" y="3" width="14" height="14" fill="none" stroke="#f0f" stroke-width=".25"/></g>"##;
    drawing(&bench, "art.svg", art);
    let options = "--repeat 2x1 --gap 5mm --at 30x40mm --registration-marks";
    let said = bench.done(&format!("layers art.svg {options} --cut-lines lines.svg -o d.print"));
    assert!(said.contains("layer `CutContour` is for a cutter: left out of the print"), "{said}");
    assert!(said.contains("metallic-gold"), "{said}");
    let lines = fs::read_to_string(bench.path("lines.svg")).unwrap();
    assert!(lines.contains("width=\"210mm\" height=\"297mm\""), "{lines}");
    let found = points(&lines, "CutContour");
    // Each copy lies 45 mm beside the one before it.
    for (x, y) in [(38.0, 43.0), (52.0, 43.0), (52.0, 57.0), (38.0, 57.0)] {
        for x in [x, x + 45.0] {
            let near = found.iter().any(|(a, b)| (a - x).abs() < 0.15 && (b - y).abs() < 0.15);
            assert!(near, "{x}, {y} in {found:?}");
        }
    }
    assert!(found.len() < 24, "a square has few corners: {found:?}");
    assert_eq!(
        lines
            .split("<g id=\"registration\"")
            .nth(1)
            .unwrap()
            .split("</g>")
            .next()
            .unwrap()
            .matches("<path")
            .count(),
        4
    );
    // Mirrored, the gap to the left of the square is the one to its right.
    bench.done("plan layers art.svg --mirror --at 30x40mm --cut-lines mirrored.svg");
    let mirrored = points(&fs::read_to_string(bench.path("mirrored.svg")).unwrap(), "CutContour");
    let left = mirrored.iter().map(|(x, _)| *x).fold(f64::MAX, f64::min);
    assert!((left - 48.0).abs() < 0.15, "{left}");
    drawing(&bench, "plain.svg", r##"<g id="gold"><rect width="9" height="9"/></g>"##);
    let said = bench.refused(1, "layers plain.svg --cut-lines none.svg");
    assert!(said.contains("the art has nothing for a cutter") && !bench.path("none.svg").exists(), "{said}");
}

#[test]
fn a_picture_without_resolution_fills_the_room_from_its_corner() {
    let bench = Bench::new();
    fs::write(bench.path("x.ppm"), [b"P6 40 20 255\n".to_vec(), vec![90; 2400]].concat()).unwrap();
    let said = bench.done("plan layers x.ppm --at 10x15mm");
    // 210 less 10, less 3.4 mm of margin that cannot be printed.
    assert!(said.contains("as large as the page allows, 196.6 x 98.3 mm"), "{said}");
}

#[test]
fn thin_lines_of_our_own_marks_are_no_warning_about_foil() {
    let bench = Bench::new();
    drawing(&bench, "art.svg", r##"<g id="silver-foil"><rect x="5" y="5" width="26" height="4"/></g>"##);
    for marks in ["", "--registration-marks"] {
        let said = bench.done(&format!("plan layers art.svg --inks +silver-foil {marks}"));
        assert!(!said.contains("may not stick"), "{marks}: {said}");
    }
    drawing(&bench, "thin.svg", r##"<g id="silver-foil"><rect x="5" y="5" width="26" height=".1"/></g>"##);
    assert!(bench.done("plan layers thin.svg --inks +silver-foil").contains("may not stick"));
}

#[test]
fn the_plan_says_what_the_paper_needs_and_media_that_were_never_tried_are_refused() {
    let bench = Bench::new();
    drawing(&bench, "art.svg", r##"<g id="gold"><rect width="9" height="9"/></g>"##);
    let said = bench.done("plan layers art.svg --paper postcard --media glossy-label");
    for words in ["set the feed lever to M", "only labels that are sold for thermal transfer"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let said = bench.refused(1, "layers art.svg --media vphoto-film");
    assert!(said.contains("rows of four bits a dot"), "{said}");
}

#[test]
fn a_first_sheet_and_strips_for_the_cartridges_say_what_to_look_for() {
    let bench = Bench::new();
    let said = bench.done("chart first --paper postcard -o first.print");
    assert!(said.contains("A ruler must find: 4 bars, 5.0 mm wide, 3.0 mm from bar to bar"), "{said}");
    assert!(fs::metadata(bench.path("first.print/job.rgl")).unwrap().len() < 2000);
    let said = bench.done("chart heads --inks black,white -o heads.print");
    assert!(said.contains("Look for: an area without streaks"), "{said}");
    assert!(bench.refused(1, "chart heads --inks black,black").contains("black is given twice"));
}

#[test]
fn white_that_a_page_knocks_out_can_be_kept() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let page = "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 140 80\n%%EndComments\n\
        [/Separation (White) /DeviceCMYK {0 0 0 4 -1 roll .1 mul}] setcolorspace 1 setcolor 10 10 120 60 rectfill\n\
        0 0 0 1 setcmykcolor 30 20 40 30 rectfill showpage\n";
    fs::write(bench.path("art.eps"), page).unwrap();
    let said = bench.done("plan layers art.eps");
    assert!(said.contains("--accept white-kept") && said.contains("knock out the white"), "{said}");
    let kept = bench.done("plan layers art.eps --accept white-kept");
    assert!(!kept.contains("white-kept"), "{kept}");
}
