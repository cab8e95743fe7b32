//! Lines and shapes of SVG drawings that are thinner than a dot.

use super::drawings::drawing;
use super::*;
use sheet::Plane;

/// The only layer of a drawing.
fn plane(content: &str) -> Plane {
    let bench = Bench::new();
    let art = read(&[bench.write("art.svg", drawing(content))], &Options::default());
    match art.layers.into_iter().next().unwrap().shape {
        Shape::Solid(plane) => plane,
        Shape::Tone(_) => panic!("it has tones"),
    }
}

/// Dots in a column or row.
fn across(plane: &Plane, along: usize, column: bool) -> usize {
    let count = if column { plane.length } else { plane.width };
    (0..count)
        .filter(|&at| if column { bitplane::at(plane, along, at) } else { bitplane::at(plane, at, along) })
        .count()
}

#[test]
fn hairlines_are_lines_without_gaps() {
    // Lines along, across and askew; a line within a group that shrinks it; of next to no width, half a dot and a dot.
    for width in ["0.001", "0.02", "0.04", "0.045"] {
        for (line, column) in [
            ("M1 5 H39", true),
            ("M1 5.013 H39", true),
            ("M1 5 L39 6", true),
            ("M1 5 C10 9 20 1 39 6", true),
            ("M20.013 1 V29", false),
            ("M2 1 L9 29", false),
        ] {
            let plane = plane(&format!(
                r##"<g id="black" transform="scale(.5)"><path transform="scale(2)" d="{line}" stroke="#000" stroke-width="{width}" fill="none"/></g>"##
            ));
            let (first, last) = if column { (1.1, 38.9) } else { (1.1, 28.9) };
            for at in dots(first) as usize..dots(last) as usize {
                let found = across(&plane, at, column);
                assert!((1..=3).contains(&found), "{line}, {width}: {found} dots at {at}");
            }
        }
    }
}

#[test]
fn thin_shapes_are_painted_where_they_touch() {
    for i in 0..40 {
        let y = 3.0 + f64::from(i) * 0.013;
        for shape in [
            format!(r##"<rect x="1" y="{y}" width="38" height="0.03"/>"##),
            format!(r##"<path d="M1 {y} L39 {} v.02 L1 {} z"/>"##, y + 1.0, y + 0.02),
            // A frame of two outlines, as programs make of a stroke.
            format!(r##"<path d="M1 {y} h38 v20 h-38z M1.02 {} v19.96 h37.96 v-19.96z"/>"##, y + 0.02),
        ] {
            let plane = plane(&format!(r##"<g id="black">{shape}</g>"##));
            for at in dots(1.2) as usize..dots(38.8) as usize {
                let found = across(&plane, at, true);
                assert!((1..=4).contains(&found), "{shape}: {found} dots at {at}");
            }
        }
    }
    let speck = plane(r##"<g id="black"><rect x="9.99" y="9.99" width=".01" height=".02"/></g>"##);
    assert!((1..=6).contains(&speck.dots()), "{}", speck.dots());
}

#[test]
fn what_is_thicker_than_a_dot_keeps_its_dots() {
    let thick = r##"<rect x="3" y="3" width="9" height="5"/><circle cx="30" cy="20" r="2"/><path d="M3 20 h9" stroke="#000" stroke-width=".1"/>"##;
    let alone = plane(&format!(r##"<g id="black">{thick}</g>"##));
    let hair = r##"<path d="M1 29 h30" stroke="#000" stroke-width=".01"/><path d="M1 1h20"/>"##;
    let beside = plane(&format!(r##"<g id="black">{thick}{hair}</g>"##));
    let line = beside.dots() - alone.dots();
    assert!(near(line, dots(30.0), 0.05), "{line}");
}

#[test]
fn art_drawn_dot_by_dot_stays_so() {
    let bench = Bench::new();
    // One unit is one dot.
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="25.4mm" height="12.7mm" viewBox="0 0 600 300"><g id="black">
        <path d="M7 9h1v1h-1z"/><path d="M100 50h1v200h-1z"/><path d="M200 100.5h300" stroke="#000"/></g></svg>"##;
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    assert_eq!(extent(&art.layers[0]).4, 1 + 200 + 300);
}

#[test]
fn hairlines_in_a_picture_are_whole_too() {
    let bench = Bench::new();
    let svg = drawing(r##"<path d="M1 5 L39 6" stroke="#000" stroke-width="0.01" fill="none"/>"##);
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    let opaque = art.opaque.unwrap();
    for at in dots(1.1) as usize..dots(38.9) as usize {
        assert!((1..=2).contains(&across(&opaque, at, true)), "column {at}");
    }
}

#[test]
fn patterns_with_tiles_smaller_than_a_dot_are_named() {
    let bench = Bench::new();
    let with = |tile: f64, beside: &str| {
        let text = format!(
            "<pattern id='p' width='{tile}' height='2' patternUnits='userSpaceOnUse'><rect width='1' height='1'/></pattern>
            <rect width='9' height='9' fill='url(#p)'/>{beside}"
        );
        bench.write("a.svg", drawing(&text))
    };
    let alone = refused(&[with(0.02, "")]);
    assert!(
        alone.contains("nothing is drawn with the pattern `p`, whose tile is smaller than a dot"),
        "{alone}"
    );
    let notes = |file| read(&[file], &Options::default()).notes;
    let named = |notes: &[String]| notes.iter().filter(|note| note.contains("pattern `p`")).count();
    assert_eq!(named(&notes(with(0.02, "<rect x='20' width='9' height='9'/>"))), 1);
    assert_eq!(
        named(&notes(with(
            0.02,
            "<g id='gold'><rect width='9' height='9' fill='url(#p)'/><rect x='20' width='9' height='9'/></g>"
        ))),
        1
    );
    assert_eq!(named(&notes(with(2.0, ""))), 0);
}
