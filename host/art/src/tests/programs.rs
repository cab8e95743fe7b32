//! One decal as each of ten programs saves it: white on 40 x 20 mm and gold on 10 x 10 mm of it.
//!
//! The files are made here, by the structure that the programs document or write. The table in the guide says what comes of each, and
//! this test keeps it true; `INSTA_UPDATE=always` writes it.

use super::archives::{archive, plain};
use super::exports::pdf;
use super::plates::{channel, tiff_file};
use super::*;

const SPACES: &str = "xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\"";

/// A program, what it saves, the end of the file's name, and the file.
type Export = (&'static str, &'static str, &'static str, Vec<u8>);

fn inkscape() -> String {
    format!(
        r##"<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<svg width="40mm" height="20mm" viewBox="0 0 40 20" version="1.1" id="svg1" inkscape:version="1.3.2 (091e20e, 2023-11-25)"
  sodipodi:docname="decal.svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
  xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" {SPACES} xmlns:svg="http://www.w3.org/2000/svg">
  <sodipodi:namedview id="namedview1" pagecolor="#ffffff" inkscape:document-units="mm"/>
  <defs id="defs1"/>
  <g inkscape:groupmode="layer" id="layer1" inkscape:label="White" style="display:inline;opacity:0.5">
    <rect style="fill:#ffffff" id="rect1" width="40" height="20" x="0" y="0"/></g>
  <g inkscape:groupmode="layer" id="layer2" inkscape:label="Gold">
    <rect style="fill:#e1a000;stroke:none" id="rect2" width="10" height="10" x="5" y="5"/></g>
</svg>"##
    )
}

fn illustrator() -> String {
    format!(
        r##"<?xml version="1.0" encoding="utf-8"?>
<!-- Generator: Adobe Illustrator 27.5.0, SVG Export Plug-In . SVG Version: 6.00 Build 0)  -->
<svg version="1.1" id="White_1_" {SPACES} x="0px" y="0px" width="113.386px" height="56.693px" viewBox="0 0 113.386 56.693"
  style="enable-background:new 0 0 113.386 56.693;" xml:space="preserve">
<style type="text/css">
  .st0{{fill:#FFFFFF;}}
  .st1{{fill:#E1A000;}}
</style>
<g id="White"><rect class="st0" width="113.386" height="56.693"/></g>
<g id="Metallic_x0020_Gold"><rect x="14.173" y="14.173" class="st1" width="28.346" height="28.346"/></g>
<g id="CutContour"><rect x="1" y="1" fill="none" stroke="#EC008C" stroke-width="0.25" width="111" height="54"/></g>
</svg>"##
    )
}

fn affinity() -> String {
    format!(
        r##"<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
<svg width="100%" height="100%" viewBox="0 0 472.44 236.22" version="1.1" {SPACES} xml:space="preserve"
  xmlns:serif="http://www.serif.com/" style="fill-rule:evenodd;clip-rule:evenodd;stroke-linejoin:round;stroke-miterlimit:2;">
    <g id="White1" serif:id="White"><rect x="0" y="0" width="472.44" height="236.22" style="fill:white;"/></g>
    <g id="Gold-2" serif:id="Gold"><rect x="59.06" y="59.06" width="118.11" height="118.11" style="fill:rgb(225,160,0);"/></g>
</svg>"##
    )
}

fn coreldraw() -> String {
    format!(
        r##"<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
<!-- Creator: CorelDRAW 2021 -->
<svg {SPACES} xml:space="preserve" width="40mm" height="20mm" version="1.1" style="shape-rendering:geometricPrecision; text-rendering:geometricPrecision; image-rendering:optimizeQuality; fill-rule:evenodd; clip-rule:evenodd"
viewBox="0 0 4000 2000" xmlns:xodm="http://www.corel.com/coreldraw/odm/2003">
 <defs><style type="text/css"><![CDATA[
    .fil0 {{fill:white}}
    .fil1 {{fill:#E1A000}}
 ]]></style></defs>
 <g id="White"><metadata id="CorelCorpID_0Corel-Layer"/><polygon class="fil0" points="0,0 4000,0 4000,2000 0,2000 "/></g>
 <g id="Gold"><metadata id="CorelCorpID_1Corel-Layer"/><polygon class="fil1" points="500,500 1500,500 1500,1500 500,1500 "/></g>
</svg>"##
    )
}

fn libreoffice() -> String {
    format!(
        r##"<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
<svg version="1.2" width="40mm" height="20mm" viewBox="0 0 4000 2000" preserveAspectRatio="xMidYMid" fill-rule="evenodd"
 stroke-width="28.222" stroke-linejoin="round" {SPACES} xmlns:ooo="http://xml.openoffice.org/svg/export" xml:space="preserve">
 <g class="SlideGroup"><g><g id="container-id1"><g id="id1" class="Slide" clip-path="url(#presentation_clip_path)"><g class="Page">
  <g class="com.sun.star.drawing.CustomShape"><g id="id3"><rect class="BoundingBox" stroke="none" fill="none" x="0" y="0" width="4000" height="2000"/>
   <path fill="rgb(114,159,207)" stroke="none" d="M 0,0 L 4000,0 4000,2000 0,2000 0,0 Z"/></g></g>
  <g class="com.sun.star.drawing.CustomShape"><g id="id4"><path fill="rgb(225,160,0)" stroke="none" d="M 500,500 L 1500,500 1500,1500 500,1500 Z"/></g></g>
 </g></g></g></g></g>
 <defs class="ClipPathGroup"><clipPath id="presentation_clip_path" clipPathUnits="userSpaceOnUse"><rect x="0" y="0" width="4000" height="2000"/></clipPath></defs>
</svg>"##
    )
}

/// OpenRaster as a painting program writes it; `about` is what the list says beside the size.
fn openraster(about: &str, upper: &str, lower: &str) -> Vec<u8> {
    let list = format!(
        "<?xml version='1.0' encoding='UTF-8'?>\n<image {about} w=\"945\" h=\"472\"><stack>{upper}{lower}</stack></image>"
    );
    archive(
        "image/openraster",
        &[
            ("data/layer0.png", plain(945, 472, [255; 4])),
            ("data/layer1.png", plain(236, 236, [225, 160, 0, 255])),
            ("stack.xml", list.into_bytes()),
            ("mergedimage.png", plain(945, 472, [255; 4])),
        ],
    )
}

fn krita() -> Vec<u8> {
    openraster(
        "version=\"0.0.3\" name=\"decal\" xres=\"600\" yres=\"600\"",
        "<layer name=\"Gold\" composite-op=\"svg:src-over\" opacity=\"1.000\" visibility=\"visible\" x=\"118\" y=\"118\" src=\"data/layer1.png\" edit-locked=\"false\"/>",
        "<layer name=\"White\" composite-op=\"svg:src-over\" opacity=\"0.600\" visibility=\"visible\" x=\"0\" y=\"0\" src=\"data/layer0.png\" selected=\"true\"/>",
    )
}

fn gimp() -> Vec<u8> {
    openraster(
        "",
        "<layer composite-op=\"svg:src-over\" name=\"Gold\" opacity=\"1.0\" src=\"data/layer1.png\" visibility=\"visible\" x=\"118\" y=\"118\"/>",
        "<layer composite-op=\"svg:src-over\" name=\"White\" opacity=\"1.0\" src=\"data/layer0.png\" visibility=\"visible\" x=\"0\" y=\"0\"/>",
    )
}

/// A grey picture with two spot channels, whose names stand in Photoshop's resource block.
fn photoshop() -> Vec<u8> {
    let names: Vec<u8> =
        ["White", "Gold"].iter().flat_map(|name| [&[name.len() as u8], name.as_bytes()].concat()).collect();
    let mut block =
        [b"8BIM".as_slice(), &1006u16.to_be_bytes(), &[0, 0], &(names.len() as u32).to_be_bytes(), &names]
            .concat();
    block.resize(block.len().next_multiple_of(2), 0);
    let kinds = [0u16, 0].iter().flat_map(|kind| kind.to_le_bytes()).collect();
    let channels = [vec![255; 200], channel(0, 0, 20, 10, true), channel(2, 2, 7, 7, true)];
    tiff_file((20, 10), &channels, 1, &[(338, 3, kinds), (34377, 1, block)])
}

/// Spot colours as Scribus writes them, each drawn with its name.
fn scribus() -> Vec<u8> {
    let drawing = "/S0 cs 1 scn 0 28.3 113.4 56.7 re f /S1 cs 1 scn 14.2 42.5 28.3 28.3 re f";
    pdf(&[("White", "0 0 0 .1"), ("Gold", "0 .3 1 .1")], drawing, "")
}

/// A browser draws in the colours of the screen.
fn browser() -> Vec<u8> {
    pdf(&[], ".2 .4 .8 rg 0 28.3 113.4 56.7 re f .88 .63 0 rg 14.2 42.5 28.3 28.3 re f", "")
}

fn exports() -> Vec<Export> {
    vec![
        ("Inkscape", "SVG with layers", "svg", inkscape().into()),
        ("Illustrator", "SVG with layers", "svg", illustrator().into()),
        ("Affinity", "SVG with layers", "svg", affinity().into()),
        ("CorelDRAW", "SVG with layers", "svg", coreldraw().into()),
        ("LibreOffice Draw", "SVG", "svg", libreoffice().into()),
        ("Scribus", "PDF with spot colours", "pdf", scribus()),
        ("Krita", "OpenRaster", "ora", krita()),
        ("GIMP", "OpenRaster", "ora", gimp()),
        ("Photoshop", "TIFF with spot channels", "tif", photoshop()),
        ("a browser", "PDF", "pdf", browser()),
    ]
}

/// What comes of an export, as a row of the table.
fn row((program, kind, end, bytes): &Export) -> String {
    let bench = Bench::new();
    let file = bench.write(&format!("decal.{end}"), bytes);
    let art = read(std::slice::from_ref(&file), &Options::default());
    let mut inks: Vec<String> = art.layers.iter().map(|layer| layer.ink.name().to_owned()).collect();
    if art.colour.is_some() {
        inks.push("a picture in process inks".into());
    }
    let mm = |dots: usize| dots as f64 * 25.4 / 600.0;
    let place = format!("{}: ", file.display());
    let notes: Vec<String> = art
        .notes
        .iter()
        .map(|note| note.replace(&place, "").replace(&file.display().to_string(), "the file"))
        .collect();
    let notes = if notes.is_empty() { "–".into() } else { notes.join("; ") };
    format!(
        "| {program} | {kind} | {} | {:.1} x {:.1} mm | {notes} |",
        inks.join(", "),
        mm(art.width),
        mm(art.length)
    )
}

#[test]
fn the_guide_says_what_comes_of_what_each_program_saves() {
    if !ghostscript() {
        return;
    }
    let guide = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide/programs.md");
    let text = fs::read_to_string(&guide).expect("the guide");
    let head = "| program | saves | printed as | size | notes |\n|---|---|---|---|---|\n";
    let begin = text.find(head).expect("the table") + head.len();
    let end = begin + text[begin..].find("\n\n").expect("an end of the table");
    let rows: Vec<String> = exports().iter().map(row).collect();
    let found = rows.join("\n");
    if std::env::var_os("INSTA_UPDATE").is_some_and(|update| update == "always") {
        fs::write(&guide, format!("{}{found}{}", &text[..begin], &text[end..])).expect("the guide");
        return;
    }
    assert_eq!(text[begin..end], found, "INSTA_UPDATE=always writes it");
}

#[test]
fn every_program_saves_the_same_white_and_gold() {
    for export in exports() {
        let (program, kind, end, bytes) = &export;
        if *end == "pdf" && !ghostscript() {
            continue;
        }
        let bench = Bench::new();
        let art = read(&[bench.write(&format!("decal.{end}"), bytes)], &Options::default());
        let square = |width: f64, height: f64| dots(width) * dots(height);
        // The smallest picture is of 20 x 10 pixels at its own resolution.
        let wanted = match (*program, *kind) {
            ("LibreOffice Draw" | "a browser", _) => {
                let colour = art.colour.is_some() && art.layers.is_empty();
                assert!(
                    colour && near(art.drawn.dots(), square(40.0, 20.0), 0.01),
                    "{program}: {:?}",
                    art.notes
                );
                continue;
            }
            ("Photoshop", _) => [200.0, 36.0],
            // Drawn over white, gold knocks it out.
            ("Scribus", _) => [square(40.0, 20.0) - square(10.0, 10.0), square(10.0, 10.0)],
            _ => [square(40.0, 20.0), square(10.0, 10.0)],
        };
        let mut found: Vec<(Ink, u64)> =
            art.layers.iter().map(|layer| (layer.ink, extent(layer).4)).collect();
        // Spot colours are read in the order of their names.
        found.sort_by_key(|(ink, _)| *ink != Ink::White);
        assert_eq!(
            found.iter().map(|(ink, _)| *ink).collect::<Vec<_>>(),
            [Ink::White, Ink::MetallicGold],
            "{program}"
        );
        for ((ink, found), wanted) in found.iter().zip(wanted) {
            assert!(near(*found, wanted, 0.01), "{program}: {found} dots of {}, wanted {wanted}", ink.name());
        }
    }
}

#[test]
fn damage_to_any_export_ends_in_art_or_an_error() {
    // Steele and Vigna's SplitMix64, so that every run damages alike.
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = |below: usize| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below.max(1) as u64) as usize
    };
    for (program, _, end, bytes) in exports().into_iter().filter(|(_, _, end, _)| *end != "pdf") {
        let bench = Bench::new();
        for _ in 0..30 {
            let mut damaged = bytes.clone();
            for _ in 0..=random(4) {
                let (from, to) = (random(damaged.len()), random(damaged.len()));
                match random(4) {
                    0 => damaged[from] = random(256) as u8,
                    1 => damaged.truncate(from.max(1)),
                    2 => damaged.extend_from_within(from.min(to)..from.max(to)),
                    _ => damaged.drain(from.min(to)..from.max(to).min(from.min(to) + 64)).for_each(drop),
                }
                if damaged.is_empty() {
                    damaged.push(0);
                }
            }
            let file = bench.write(&format!("decal.{end}"), &damaged);
            let begun = std::time::Instant::now();
            let _ = open(&[file], &Options::default(), &Silent);
            assert!(begun.elapsed().as_secs() < 10, "{program} takes {:?}", begun.elapsed());
        }
    }
}
