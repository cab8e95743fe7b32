//! SVG drawings and their layers.

use super::*;
use base64::Engine as _;

#[test]
fn a_drawings_layers_lie_where_they_are_drawn() {
    let bench = Bench::new();
    // 25.4 mm are 600 dots for 300 units: 2 dots a unit.
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
        width="25.4mm" height="12.7mm" viewBox="0 0 300 150">
      <g inkscape:groupmode="layer" inkscape:label="white" style="display:inline"><rect x="10" y="20" width="200" height="100" fill="#ff0"/></g>
      <g inkscape:groupmode="layer" inkscape:label="guides" id="g2"><rect width="300" height="150"/></g>
      <g inkscape:groupmode="layer" inkscape:label="outer" transform="translate(5,0)">
        <g id="Metallic_Gold" transform="translate(10,15)"><rect width="20" height="30"/></g>
      </g>
      <g id="black"><path d="M100 50h50v25h-50z"/><path d="M200 50h10v10h-10z"/></g>
      <g id="silver" style="display:none"><rect width="9" height="9"/></g>
    </svg>"##;
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    assert_eq!((art.width, art.length), (600, 300));
    let layers: Vec<_> = art.layers.iter().map(|layer| (layer.ink, extent(layer))).collect();
    assert_eq!(
        layers,
        [
            (Ink::White, (20, 40, 419, 239, 400 * 200)),
            (Ink::MetallicGold, (30, 30, 69, 89, 40 * 60)),
            (Ink::Black, (200, 100, 419, 149, 100 * 50 + 20 * 20)),
        ]
    );
    let left_out = "left out, because it lies in no layer of an ink: layer `guides`";
    for word in [left_out, "layer `silver` is hidden: left out; show it"] {
        assert!(art.notes.iter().any(|note| note.contains(word)), "{word}: {:?}", art.notes);
    }
    let hidden = drawing(r##"<g id="white" display="none"><rect width="9" height="9"/></g><g id="gold"/>"##);
    assert!(refused(&[bench.write("hidden.svg", hidden)]).contains("hidden.svg is visible; show its layers"));
    let slip = svg.replace("guides", "finnish");
    let refusal = refused(&[bench.write("slip.svg", slip)]);
    assert!(
        refusal.contains("layer `finnish` names no ink (did you mean `finish`?); rename the layer"),
        "{refusal}"
    );
}

#[test]
fn text_is_drawn_even_if_its_font_is_missing_and_refused_without_any() {
    let bench = Bench::new();
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="25.4mm" height="12.7mm" viewBox="0 0 600 300">
        <g id="black"><text x="50" y="200" font-family="No Such Family" font-size="150">HHH</text></g></svg>"##;
    let found = open(&[bench.write("art.svg", svg)], &Options::default(), &Silent);
    let mut fonts = resvg::usvg::fontdb::Database::new();
    fonts.load_system_fonts();
    if fonts.is_empty() {
        assert!(found.unwrap_err().to_string().contains("this computer has no fonts"));
        return;
    }
    // Three letters in a row, as high as capitals are: two thirds of their size or so, on the line.
    let (left, top, right, bottom, dots) = extent(&found.unwrap().layers[0]);
    assert!((50..80).contains(&left) && right - left > 150, "{left} to {right}");
    assert!((70..130).contains(&top) && (195..205).contains(&bottom), "{top} to {bottom}");
    assert!(dots > 3000, "{dots} dots");
}

#[test]
fn text_is_drawn_in_the_font_that_stands_for_its_own_in_drawing_programs() {
    let matched = |family: &str| {
        let output = std::process::Command::new("fc-match").args(["--format=%{family[0]}", family]).output();
        output
            .ok()
            .filter(|output| output.status.success())
            .map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    // Without fontconfig there is no such font.
    let Some(missing) = matched("No Such Family").filter(|family| !family.is_empty()) else { return };
    let bench = Bench::new();
    let read_as = |family: &str| {
        let svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="25.4mm" height="12.7mm" viewBox="0 0 600 300">
            <g id="black"><text x="9" y="200" font-family="{family}" font-size="150">Ragi</text></g></svg>"##
        );
        let art = read(&[bench.write("art.svg", svg)], &Options::default());
        let said = art
            .notes
            .iter()
            .filter(|note| note.contains("this computer has no font"))
            .cloned()
            .collect::<Vec<String>>();
        (art.layers[0].shape.clone(), said)
    };
    for generic in ["sans-serif", "serif", "monospace", "Sans", "Mono"] {
        let family = matched(generic).unwrap();
        let ((shape, said), (wanted, _)) = (read_as(generic), read_as(&format!("'{family}'")));
        assert!(shape == wanted, "{generic} is not drawn in {family}");
        assert!(said.is_empty(), "{said:?}");
    }
    let (shape, said) = read_as("No Such Family");
    assert!(shape == read_as(&format!("'{missing}'")).0, "not drawn in {missing}");
    let [note] = &said[..] else { panic!("{said:?}") };
    assert!(
        note.contains(&format!(
            "no font No Such Family (drawn in {missing}); install it, or convert the text to paths"
        )),
        "{note}"
    );
    // What ends a name in fontconfig's patterns is part of the name here, and an option is none.
    for family in ["No-Such:Family", "--version"] {
        let (_, said) = read_as(&format!("'{family}'"));
        assert!(said.len() == 1 && said[0].contains(&format!("no font {family} (drawn in ")), "{said:?}");
    }
}

#[test]
fn a_drawing_without_layers_is_a_picture_with_exact_edges() {
    let bench = Bench::new();
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="2.54mm" height="2.54mm" viewBox="0 0 60 60">
        <circle cx="30" cy="30" r="20" fill="#e1a000"/></svg>"##;
    let file = bench.write("disc.svg", svg);
    let art = read(&[file], &Options { reserved: true, ..Options::default() });
    assert!(art.colour.is_none(), "no softened edge is left over");
    let dots = extent(&art.layers[0]).4 as f64;
    assert!((dots / (std::f64::consts::PI * 400.0) - 1.0).abs() < 0.02, "{dots} dots");
    assert_eq!(art.opaque.map(|plane| plane.dots()), Some(dots as u64));
}

/// A drawing of 40 x 30 mm, 944.88 x 708.66 dots, one unit a millimetre.
pub(super) fn drawing(layers: &str) -> String {
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="30mm" viewBox="0 0 40 30">{layers}</svg>"##
    )
}

#[test]
fn what_is_drawn_in_the_layer_of_an_ink_is_ink_whatever_its_colour() {
    let bench = Bench::new();
    let svg = drawing(
        r##"<g id="white"><rect width="40" height="30" fill="#fff"/></g>
        <g id="gold"><rect x="5" y="5" width="20" height="10" fill="#ffe97f" stroke="#000" stroke-width="1"/></g>
        <g id="finish"><rect x="1" y="1" width="38" height="28" fill="#fff"/></g>"##,
    );
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    let all = (art.width * art.length) as u64;
    let layers: Vec<(Ink, u64)> = art.layers.iter().map(|layer| (layer.ink, extent(layer).4)).collect();
    assert_eq!(layers[0], (Ink::White, all), "white drawn all over in white is white all over");
    // The stroke adds half its width on each side.
    assert_eq!(layers[1].0, Ink::MetallicGold);
    assert!(near(layers[1].1, dots(21.0) * dots(11.0), 0.005), "{layers:?}");
    assert!(near(layers[2].1, dots(38.0) * dots(28.0), 0.005), "{layers:?}");
    assert!(art.notes.iter().any(|note| note.contains("gold: drawn in several colours; all of it is ink")));
    assert_eq!(art.opaque.unwrap().dots(), all);
}

#[test]
fn a_drawing_has_no_ground_even_if_it_leaves_no_dot_free() {
    let bench = Bench::new();
    let full = drawing(r##"<rect width="40" height="30" fill="#e1a000"/>"##);
    let art = read(&[bench.write("full.svg", full)], &Options::default());
    assert_eq!(art.opaque.unwrap().dots(), (art.width * art.length) as u64);
    let half = drawing(r##"<rect width="20" height="30" fill="#fff"/>"##);
    let art = read(&[bench.write("half.svg", half)], &Options::default());
    let opaque = art.opaque.unwrap().dots();
    assert!(near(opaque, dots(20.0) * dots(30.0), 0.005) && art.drawn.dots() == 0, "{opaque}");
}

#[test]
fn a_layer_with_tones_keeps_them_and_a_picture_in_a_layer_is_ink_where_it_is_dark() {
    let bench = Bench::new();
    let svg = drawing(
        r##"<linearGradient id="g"><stop stop-color="#000"/><stop offset="1" stop-color="#fff"/></linearGradient>
        <g id="white"><rect width="40" height="30" fill="url(#g)"/></g>"##,
    );
    let file = bench.write("art.svg", svg);
    let toned = Options { tones: inks::InkSet::of([Ink::White]), ..Options::default() };
    let art = read(std::slice::from_ref(&file), &toned);
    let Shape::Tone(tones) = &art.layers[0].shape else { panic!("tones are lost") };
    let mean = tones.iter().map(|&v| f64::from(v)).sum::<f64>() / tones.len() as f64;
    assert!((mean - 127.5).abs() < 2.0, "{mean}");
    assert_eq!(extent(&read(&[file], &Options::default()).layers[0]).4, (art.width * art.length) as u64);
    // A scan on white paper, put into a layer: its left half is black.
    let scan = bench.grey("scan.png", (20, 10), &[[0u8; 10], [255; 10]].concat().repeat(10));
    let data = base64::engine::general_purpose::STANDARD.encode(fs::read(scan).unwrap());
    let svg = drawing(&format!(
        r##"<g id="black"><image width="20" height="10" style="image-rendering:pixelated" href="data:image/png;base64,{data}"/></g>"##
    ));
    let art = read(&[bench.write("scan.svg", svg)], &Options::default());
    let found = extent(&art.layers[0]).4;
    assert!(near(found, dots(10.0) * dots(10.0), 0.02), "{found}");
}

#[test]
fn a_drawing_that_the_renderer_cannot_take_is_an_error() {
    let bench = Bench::new();
    // The renderer's noise overflows beyond some thirty octaves in builds that check.
    let svg = drawing(
        r##"<filter id="f"><feTurbulence baseFrequency="0.05" numOctaves="200"/></filter>
        <g id="white"><rect width="40" height="30" filter="url(#f)"/></g>"##,
    );
    if let Err(error) = open(&[bench.write("noise.svg", svg)], &Options::default(), &Silent) {
        assert!(error.to_string().contains("noise.svg: the drawing cannot be rendered"), "{error}");
    }
}
