//! Styles of drawings, against the same drawing in attributes.

use super::drawings::drawing;
use super::*;
use base64::Engine as _;

/// What is drawn, without the notes; and the notes on styles.
fn drawn(inside: &str) -> (Artwork, Vec<String>) {
    let bench = Bench::new();
    let mut art = read(&[bench.write("a.svg", drawing(inside))], &Options::default());
    let mut notes = std::mem::take(&mut art.notes);
    notes.retain(|note| note.contains("not understood") || note.contains("left out"));
    (art, notes)
}

const RECT: &str = "<rect x='5' y='5' width='10' height='8'";

#[test]
fn styles_draw_what_the_attributes_of_their_meaning_draw() {
    let hidden =
        "<style>.off{display:none}</style><g id='white' class='off'><rect width='9' height='9'/></g>";
    for (styled, plain) in [
        // Figma.
        (
            "fill='#f24e1e' style='fill:#F24E1E;fill:color(display-p3 0.9490 0.3059 0.1176);fill-opacity:1'",
            "fill='#f24e1e'",
        ),
        ("style='fill:color(display-p3 0 1 0)'", "fill='#0f0'"),
        // draw.io.
        ("fill='#fff2cc' style='fill: light-dark(#fff2cc, #281d00)'", "fill='#fff2cc'"),
        ("fill='#000' style='fill: var(--ge-light, #00ffff)'", "fill='#0ff'"),
        // The web.
        ("class='b' style='--brand:#ff0'", "fill='#ff0'"),
        ("class='b'", "fill='#e22222'"),
        ("class='b' fill='#0ff' style='fill:odd(1)'", "fill='#e22222'"),
        ("class='c' style='fill:#fff'", "fill='#f0f'"),
        ("style='fill:rgb(0 160 0 / 100%)'", "fill='#00a000'"),
        ("fill='var(--brand)'", "fill='#e22222'"),
        ("fill='rebeccapurple' stroke='unset'", "fill='#639'"),
        (
            "fill='#c00' style='transform:rotate(20deg);transform-origin:10px 9px'",
            "fill='#c00' transform='rotate(20 10 9)'",
        ),
        (
            "fill='#c00' transform='scale(9)' style='transform:translate(2px,1px)'",
            "fill='#c00' transform='translate(2 1)'",
        ),
        (
            "fill='#c00' transform='scale(.5)' style='translate:4px 2px'",
            "fill='#c00' transform='translate(4 2) scale(.5)'",
        ),
    ] {
        let sheet = "<style>/* {} */ :root{--brand:#e22222} .b{fill:var(--brand)} rect.c{fill:#f0f!important}
            @media print{#no{fill:red}}</style>";
        let (styled, plain) = (format!("{sheet}{RECT} {styled}/>"), format!("{RECT} {plain}/>"));
        let (found, wanted) = (drawn(&styled), drawn(&plain));
        assert!(found.0 == wanted.0, "{styled}");
        assert_eq!(found.1.len(), usize::from(styled.contains("odd(")), "{styled}: {:?}", found.1);
    }
    let gold = |how: &str| drawn(&format!("<g id='gold'>{RECT} {how}/></g>"));
    assert_eq!(gold("style='transform:translateX(20px)'"), gold("transform='translate(20 0)'"));
    assert_eq!(
        drawn("<rect style='x:3px;width:9px' y='2' height='4'/>"),
        drawn("<rect x='3' width='9' y='2' height='4'/>")
    );
    let (art, notes) = drawn(&format!("{hidden}<g id='gold'>{RECT}/></g>"));
    assert_eq!(art.layers.len(), 1);
    assert!(notes[0].contains("layer `white` is hidden"), "{notes:?}");
}

#[test]
fn pictures_in_a_drawing_are_crisp_if_asked_and_drawings_in_it_have_styles() {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 3, 3);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[0, 255, 0, 255, 0, 255, 0, 255, 0]).unwrap();
    let base64 = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
    let picture = |how: &str| {
        drawn(&format!("<image width='9' height='9' href='data:image/png;base64,{}' {how}/>", base64(&png))).0
    };
    let crisp = picture("style='image-rendering:pixelated'");
    assert!(crisp != picture(""));
    for how in [
        "image-rendering='pixelated'",
        "image-rendering='crisp-edges'",
        "style='image-rendering:-moz-crisp-edges'",
    ] {
        assert!(picture(how) == crisp, "{how}");
    }
    let within = |how: &str| {
        let inner = drawing(&format!("{RECT} {how}/>"));
        let image = format!(
            "<image width='40' height='30' href='data:image/svg+xml;base64,{}'/>",
            base64(inner.as_bytes())
        );
        drawn(&image)
    };
    assert!(within("style='fill:var(--a, #0f0)'") == within("fill='#0f0'"));
    assert!(within("style='fill:odd()'").1[0].contains("a.svg: not understood"));
}

#[test]
fn one_note_names_what_is_not_understood_and_what_counts_instead() {
    let inside = "<style>rect:nth-child(2){fill:red} @media (min-width:9px){rect{fill:red}} @font-face{src:url(a)}</style>
        <rect id='r' width='9' height='9' fill='#0f0' style='fill:color-mix(in srgb, red, blue);transform:translate(50%)'/>
        <rect x='20' width='9' height='9' style='fill:color-mix(in srgb, red, blue)'/>
        <g style='display:none'><rect fill='nothing'/></g>";
    let (_, notes) = drawn(inside);
    let [note] = &notes[..] else { panic!("{notes:?}") };
    let said = "a.svg: not understood, and printed as if it were not there: rule `rect:nth-child(2)`, rule `@media (min-width:9px)`, \
        `fill:color-mix(in srgb, red, blue)` of rect `r` (`#0f0` counts), `transform:translate(50%)` of rect `r`; use colours";
    assert!(note.contains(said), "{note}");
}
