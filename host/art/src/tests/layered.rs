//! Where layers of ink are found in an SVG drawing, and what becomes of everything else.

use super::drawings::drawing;
use super::*;
use base64::Engine as _;

/// Ink and dots of each layer, and the notes.
fn layers(name: &str, content: &str) -> (Vec<(Ink, u64)>, Vec<String>) {
    let bench = Bench::new();
    let art = read(&[bench.write(name, drawing(content))], &Options::default());
    (art.layers.iter().map(|layer| (layer.ink, extent(layer).4)).collect(), art.notes)
}

fn noted(notes: &[String], words: &str) -> bool {
    notes.iter().any(|note| note.contains(words))
}

const BLACK: &str = r##"<g id="black"><rect x="30" width="5" height="5"/></g>"##;

#[test]
fn layers_are_found_in_links_switches_drawings_clones_and_single_shapes() {
    let square = r##"<rect width="8" height="4"/>"##;
    for content in [
        format!(r##"<a href="x"><g id="white">{square}</g></a>"##),
        format!(
            r##"<switch><foreignObject requiredExtensions="x"/><g><g id="White">{square}</g></g></switch>"##
        ),
        format!(
            r##"<svg x="5" y="5" width="16" height="8" viewBox="0 0 16 8"><g id="white">{square}</g></svg>"##
        ),
        format!(r##"<defs><g id="white">{square}</g></defs><use href="#white" x="10"/>"##),
        r##"<path id="white" d="M0 0h8v4h-8z"/>"##.into(),
        r##"<path id="white" d="M0 0h4v4h-4z"/><path id="white-2" d="M10 0h4v4h-4z"/>"##.into(),
    ] {
        let (found, notes) = layers("art.svg", &format!("{content}{BLACK}"));
        assert_eq!((found.len(), found[0].0, found[1].0), (2, Ink::White, Ink::Black), "{content}");
        assert!(near(found[0].1, dots(8.0) * dots(4.0), 0.02), "{content}: {found:?}");
        assert!(near(found[1].1, dots(5.0) * dots(5.0), 0.02), "{content}: {found:?}");
        assert!(!noted(&notes, "left out, because"), "{notes:?}");
    }
    let names = r##"<g id="Gold_x0020_Foil"><rect width="8" height="4"/></g>"##;
    assert_eq!(layers("art.svg", names).0[0].0, Ink::GoldFoil);
}

/// A group needs the whole name of an ink, unlike a layer that its owner named in a program that has layers.
#[test]
fn a_part_of_a_groups_name_is_no_ink() {
    let cat = r##"<g id="black_cat"><rect width="8" height="4"/></g>"##;
    let (found, notes) = layers("art.svg", cat);
    assert!(found.is_empty() && noted(&notes, "`black_cat` (a layer of ink would be `black`)"), "{notes:?}");
    let named = r##"<g id="g1" inkscape:groupmode="layer" inkscape:label="logo white"><rect width="8" height="4"/></g>"##;
    let prefix = r##"<g xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape">"##;
    assert_eq!(layers("art.svg", &format!("{prefix}{named}</g>")).0[0].0, Ink::White);
    for name in ["Spot White", "white-layer", "2_White"] {
        let group = format!(r##"<g id="{name}"><rect width="8" height="4"/></g>"##);
        assert_eq!(layers("art.svg", &group).0[0].0, Ink::White, "{name}");
    }
}

#[test]
fn everything_drawn_beside_the_layers_is_listed_once() {
    let (found, notes) = layers(
        "art.svg",
        r##"<g id="white"><rect width="9" height="9"/></g><text x="5" y="15">Outside of all the layers</text>
        <g id="logo"><rect x="30" width="9" height="9"/></g><g id="empty"/><g style="display: none"><path d="M0 0h9v9"/></g>
        <g id="fronts"><g id="black"><path d="M0 0h9v9"/></g><circle r="2"/><circle r="3"/></g><g id="goldd"><line x2="3"/></g>"##,
    );
    assert_eq!(found.len(), 2);
    let listed: Vec<_> = notes.iter().filter(|note| note.contains("left out, because")).collect();
    assert_eq!(listed.len(), 1, "{notes:?}");
    let wanted = "no layer of an ink: text `Outside of all the laye…`, group `logo`, group `goldd` (did you mean `gold`?), \
                  circle (2)";
    assert!(listed[0].ends_with(wanted), "{listed:?}");
}

#[test]
fn an_ink_within_a_layer_is_a_layer_of_its_own() {
    let (found, notes) = layers(
        "art.svg",
        r##"<g id="white"><rect width="9" height="9"/><g id="gold"><rect x="20" width="6" height="6"/></g></g>"##,
    );
    assert_eq!((found[0].0, found[1].0), (Ink::White, Ink::MetallicGold));
    assert!(
        near(found[0].1, dots(9.0).powi(2), 0.02) && near(found[1].1, dots(6.0).powi(2), 0.02),
        "{found:?}"
    );
    assert!(noted(&notes, "`gold` lies within layer `white`: printed as a layer of its own"), "{notes:?}");
    // A clone of one layer in another is art of the other.
    let clone =
        r##"<g id="white"><rect width="9" height="9"/></g><g id="black"><use href="#white" x="20"/></g>"##;
    let (found, _) = layers("art.svg", clone);
    assert_eq!(found.len(), 2);
    assert!(found.iter().all(|layer| near(layer.1, dots(9.0).powi(2), 0.02)), "{found:?}");
}

#[test]
fn layers_with_one_identifier_are_both_drawn() {
    let bench = Bench::new();
    let twice = r##"<g id="1-white"><rect width="9" height="9"/></g><g id="2-white"><rect x="20" width="4" height="4"/></g>"##;
    let svg = drawing(&twice.replace("2-white", "1-white"));
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    let found: Vec<u64> = art.layers.iter().map(|layer| extent(layer).4).collect();
    assert!(near(found[0], dots(9.0).powi(2), 0.02) && near(found[1], dots(4.0).powi(2), 0.02), "{found:?}");
}

#[test]
fn the_clips_masks_opacity_and_transforms_around_a_layer_hold() {
    let (found, notes) = layers(
        "art.svg",
        r##"<g opacity="0"><g id="black"><rect width="9" height="9"/></g></g>
        <g clip-path="url(#c)"><clipPath id="c"><rect width="5" height="5"/></clipPath>
          <g transform="translate(1 0)"><g id="gold"><rect width="20" height="20"/></g></g></g>
        <mask id="m"><rect width="40" height="30" fill="#fff"/><rect width="10" height="30" fill="#000"/></mask>
        <g mask="url(#m)"><g id="white"><rect width="40" height="30" fill="#fff"/></g></g>"##,
    );
    assert_eq!(found.iter().map(|layer| layer.0).collect::<Vec<_>>(), [Ink::MetallicGold, Ink::White]);
    assert!(near(found[0].1, dots(4.0) * dots(5.0), 0.02), "{found:?}");
    assert!(near(found[1].1, dots(30.0) * dots(30.0), 0.005), "{found:?}");
    assert!(noted(&notes, "layer `black` is "), "{notes:?}");
}

#[test]
fn a_layer_that_holds_a_picture_keeps_its_white_shapes() {
    let bench = Bench::new();
    bench.grey("a scan.png", (20, 10), &[[0u8; 10], [255; 10]].concat().repeat(10));
    let svg = drawing(
        r##"<g id="white"><rect width="12" height="30" fill="#fff"/>
        <image href="a%20scan.png" x="20" width="20" height="10" style="image-rendering:pixelated"/></g>"##,
    );
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    let found = extent(&art.layers[0]).4;
    assert!(near(found, dots(12.0) * dots(30.0) + dots(10.0) * dots(10.0), 0.01), "{found}");
    assert!(noted(&art.notes, "its pictures are ink where they are dark"), "{:?}", art.notes);
}

#[test]
fn a_missing_picture_is_an_error_unless_it_is_not_drawn() {
    let bench = Bench::new();
    let image = r##"<image href="missing.png" width="20" height="20"/>"##;
    let shape = r##"<rect width="5" height="5"/>"##;
    let error = refused(&[bench.write("art.svg", drawing(&format!("{shape}{image}")))]);
    assert!(error.contains("art.svg: its picture `missing.png` cannot be read"), "{error}");
    let error =
        refused(&[bench.write("art.svg", drawing(&format!(r##"<g id="white">{shape}{image}</g>"##)))]);
    assert!(error.contains("`missing.png`"), "{error}");
    let (found, notes) = layers("art.svg", &format!(r##"<g id="white">{shape}</g>{image}"##));
    assert!(found.len() == 1 && noted(&notes, "no layer of an ink: image (1)"), "{notes:?}");
}

#[test]
fn a_damaged_picture_is_an_error_and_not_left_out_in_silence() {
    let bench = Bench::new();
    let noise: Vec<u8> = (0..4096u32).map(|at| (at.wrapping_mul(at + 7919) % 251) as u8).collect();
    let whole = fs::read(bench.grey("scan.png", (64, 64), &noise)).unwrap();
    let embedded = |data: &str| {
        drawing(&format!(
            r##"<rect width="5" height="5"/><image href="data:image/png;base64,{data}" x="20" width="10" height="10"/>"##
        ))
    };
    let text = base64::engine::general_purpose::STANDARD.encode(&whole);
    read(&[bench.write("art.svg", embedded(&text))], &Options::default());
    // Cut between and within groups of four letters; and letters that do not occur.
    let half = text.len() / 2 / 4 * 4;
    for data in [&text[..half], &text[..half + 1], "?!"] {
        let error = refused(&[bench.write("art.svg", embedded(data))]);
        assert!(error.contains("its picture of the type `image/png` is damaged or was cut short"), "{error}");
    }
    bench.write("cut.png", &whole[..whole.len() / 2]);
    let linked = drawing(r##"<g id="white"><image href="cut.png" width="20" height="20"/></g>"##);
    let error = refused(&[bench.write("art.svg", linked)]);
    assert!(error.contains("its picture `cut.png` is damaged"), "{error}");
}

#[test]
fn shapes_that_happen_to_be_named_after_inks_are_told_from_layers() {
    let bench = Bench::new();
    let outside = r##"<rect width="9" height="9"/>"##;
    let shape = r##"<path id="black" d="M0 0h9v9"/>"##;
    let note = "only the shapes named after inks are printed: `black`; to print the whole drawing as a picture, rename them";
    let notes = |content: &str| read(&[bench.write("art.svg", drawing(content))], &Options::default()).notes;
    let of_shape = notes(&format!("{shape}{outside}"));
    assert!(noted(&of_shape, note) && noted(&of_shape, "left out, because"), "{of_shape:?}");
    // With all of it in layers, or with a group, it is art in layers.
    assert!(!noted(&notes(shape), "only the shapes"));
    assert!(!noted(&notes(&format!(r##"<g id="white">{shape}</g>{outside}"##)), "only the shapes"));
}

#[test]
fn flowed_text_is_named_where_it_would_be_drawn() {
    let flowed = r##"<foreignObject width="30" height="9"><p xmlns="http://www.w3.org/1999/xhtml">Hello <b>there</b></p></foreignObject>
        <flowRoot><flowRegion><rect width="30" height="10"/></flowRegion><flowPara>Old</flowPara></flowRoot>"##;
    let shape = r##"<rect width="3" height="3"/>"##;
    let words = "flowed text cannot be drawn and is left out: `Hello there`, `Old`; convert";
    for content in [format!("{shape}{flowed}"), format!(r##"<g id="black">{shape}{flowed}</g>"##)] {
        let bench = Bench::new();
        let art = read(&[bench.write("art.svg", drawing(&content))], &Options::default());
        assert!(noted(&art.notes, words), "{:?}", art.notes);
    }
    // A switch offers plain text beside it.
    let (_, notes) = layers(
        "art.svg",
        &format!(r##"<g id="black">{shape}<switch>{flowed}<path d="M9 9h9v9"/></switch></g>"##),
    );
    assert!(!noted(&notes, "flowed text"), "{notes:?}");
}

#[test]
fn a_drawing_with_prefixes_has_its_text() {
    let bench = Bench::new();
    let mut fonts = resvg::usvg::fontdb::Database::new();
    fonts.load_system_fonts();
    if fonts.is_empty() {
        return;
    }
    let text = r##"<svg:text x="5" y="20" font-size="15">HHH</svg:text>"##;
    let svg = |content: &str| {
        format!(
            r##"<svg:svg xmlns:svg="http://www.w3.org/2000/svg" width="40mm" height="30mm" viewBox="0 0 40 30">{content}</svg:svg>"##
        )
    };
    let layered = svg(&format!(r##"<svg:g id="black">{text}</svg:g>"##));
    let art = read(&[bench.write("art.svg", layered)], &Options::default());
    assert!(extent(&art.layers[0]).4 > 5000);
    let art = read(&[bench.write("plain.svg", svg(text))], &Options::default());
    assert!(art.opaque.unwrap().dots() > 5000);
}

#[test]
fn drawings_are_read_in_their_encoding_and_behind_long_comments() {
    let bench = Bench::new();
    let svg = drawing(r##"<g id="white" class="weiß"><rect width="9" height="9"/></g>"##);
    let latin: Vec<u8> =
        format!("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>{svg}").chars().map(|c| c as u8).collect();
    let utf16: Vec<u8> = format!("\u{feff}{svg}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    let long = format!("<!-- {} -->{svg}", "words ".repeat(2000));
    for bytes in [latin, utf16, long.into_bytes()] {
        let art = read(&[bench.write("art.svg", bytes)], &Options::default());
        assert!(near(extent(&art.layers[0]).4, dots(9.0).powi(2), 0.02));
    }
    let bad = [b"<svg xmlns='http://www.w3.org/2000/svg' id='".as_slice(), b"\xdf'/>"].concat();
    assert!(refused(&[bench.write("bad.svg", bad)]).contains("save the drawing as UTF-8"));
}

#[test]
fn a_drawing_without_a_size_is_as_large_as_all_that_is_drawn() {
    let bench = Bench::new();
    // The page's ground is drawn in no layer.
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" style="background-color:#fff"><g id="white"><rect width="96" height="48"/></g>
        <g id="black"><rect x="96" y="48" width="96" height="60"/></g></svg>"##;
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    assert_eq!((art.width, art.length), (1200, 675));
    let found: Vec<_> = art.layers.iter().map(extent).collect();
    assert_eq!(found, [(0, 0, 599, 299, 180_000), (600, 300, 1199, 674, 225_000)]);
}

/// A layer of Inkscape.
fn inkscape(label: &str, style: &str, content: &str) -> String {
    let prefix = r##"xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape""##;
    format!(
        r##"<g {prefix} inkscape:groupmode="layer" inkscape:label="{label}" style="{style}">{content}</g>"##
    )
}

#[test]
fn what_is_visible_beside_hidden_layers_of_ink_is_a_picture() {
    let square = r##"<rect width="8" height="4" fill="#c4281b"/>"##;
    let bench = Bench::new();
    let hidden = inkscape("Black Adam", "display:none", square);
    let torso = inkscape("Torso", "", r##"<rect x="10" width="6" height="5" fill="#c4281b"/>"##);
    let art = read(&[bench.write("adam.svg", drawing(&format!("{hidden}{torso}")))], &Options::default());
    assert!(art.layers.is_empty() && art.colour.is_some());
    assert!(near(art.drawn.dots(), dots(6.0) * dots(5.0), 0.02), "{}", art.drawn.dots());
    assert!(noted(&art.notes, "are hidden: `Black Adam`; to print them"), "{:?}", art.notes);
    // Nothing is visible beside it, or only within what is hidden as well.
    for content in [hidden.clone(), format!(r##"<g style="display:none">{hidden}{torso}</g>"##)] {
        let refused = refused(&[bench.write("none.svg", drawing(&content))]);
        assert!(refused.contains("no layer of"), "{refused}");
    }
    // Another layer of ink is visible.
    let (found, notes) = layers("art.svg", &format!("{hidden}{torso}{BLACK}"));
    assert_eq!(found.len(), 1);
    assert!(noted(&notes, "layer `Black Adam` is hidden") || noted(&notes, "left out"), "{notes:?}");
}

#[test]
fn a_note_tells_of_layers_of_which_a_part_of_the_name_is_an_ink() {
    let square = r##"<rect width="8" height="4" fill="#1b2a34"/>"##;
    let (found, notes) = layers("art.svg", &inkscape("Black Adam", "", square));
    assert_eq!(found[0].0, Ink::Black);
    assert!(noted(&notes, "layer `Black Adam` is printed in black, because of its name"), "{notes:?}");
    for label in ["Black", "02 black", "Spot White"] {
        let (_, notes) = layers("art.svg", &inkscape(label, "", square));
        assert!(!noted(&notes, "because of its name"), "{label}: {notes:?}");
    }
}

#[test]
fn a_prefix_that_is_not_declared_is_an_error_that_says_what_to_do() {
    let bench = Bench::new();
    let layer = r##"<g inkscape:groupmode="layer" inkscape:label="white"><rect width="8" height="4"/></g>"##;
    let text = refused(&[bench.write("bare.svg", drawing(layer))]);
    for words in [
        "bare.svg",
        "prefix 'inkscape'",
        "open the drawing in Inkscape and save it again",
        "xmlns:inkscape=\"http://www.inkscape.org/",
    ] {
        assert!(text.contains(words), "{text}");
    }
}
