//! Art as programs save it: what their files say in ways of their own.

use ::files::shelf::Disk;

use super::drawings::drawing;
use super::*;

/// Millimetres of dots.
fn mm(dots: usize) -> f64 {
    dots as f64 * 25.4 / 600.0
}

fn noted(art: &Artwork, words: &str) -> bool {
    art.notes.iter().any(|note| note.contains(words))
}

/// The inks and dots of the layers of a drawing.
fn inks(art: &Artwork) -> Vec<(Ink, u64)> {
    art.layers.iter().map(|layer| (layer.ink, extent(layer).4)).collect()
}

/// The page of a drawing that is filled by one rectangle, and the notes on it.
fn filled(before: &str, attributes: &str, (width, height): (f64, f64), options: &Options) -> Artwork {
    let bench = Bench::new();
    let svg = format!(
        r##"{before}<svg xmlns="http://www.w3.org/2000/svg" {attributes}>
        <g id="gold"><rect width="{width}" height="{height}"/></g></svg>"##
    );
    read(&[bench.write("art.svg", svg)], options)
}

const ILLUSTRATOR: &str = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- Generator: Adobe Illustrator 24.0.1, SVG Export \
    Plug-In . SVG Version: 6.00 Build 0)  -->";
const INKSCAPE: &str = "xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\"";

#[test]
fn a_drawing_without_a_size_on_paper_is_measured_as_its_program_does_and_says_so() {
    let usual = Options::default();
    let of = |before, attributes: &str, size, options: &Options| {
        let art = filled(before, attributes, size, options);
        assert_eq!(inks(&art)[0].1, (art.width * art.length) as u64, "the rectangle fills the page");
        ((mm(art.width) * 10.0).round() / 10.0, art)
    };
    let (width, art) = of(
        ILLUSTRATOR,
        r#"width="113.39px" height="56.69px" viewBox="0 0 113.39 56.69""#,
        (113.39, 56.69),
        &usual,
    );
    assert_eq!(width, 40.0);
    assert!(noted(
        &art,
        "states no size on paper, so it is printed 40.0 x 20.0 mm large: its units at 72 an inch"
    ));
    let (width, art) = of(ILLUSTRATOR, r#"viewBox="0 0 113.39 56.69""#, (113.39, 56.69), &usual);
    assert!(width == 40.0 && noted(&art, "as Illustrator writes; set its size"), "{:?}", art.notes);
    let old = format!("{INKSCAPE} width=\"141.73\" height=\"70.87\" inkscape:version=\"0.91 r13725\"");
    assert_eq!(of("", &old, (141.73, 70.87), &usual).0, 40.0);
    // With a size on paper but no view box its pixels are 1/90 inch as well.
    let sized = format!("{INKSCAPE} width=\"40mm\" height=\"20mm\" inkscape:version=\"0.48.4 r9939\"");
    let (width, art) = of("", &sized, (141.74, 70.88), &usual);
    assert!(width == 40.0 && !noted(&art, "states no"), "{:?}", art.notes);
    let affinity = r#"width="100%" height="100%" viewBox="0 0 709 354" xmlns:serif="http://www.serif.com/""#;
    let (width, art) = of("", affinity, (709.0, 354.0), &usual);
    assert!(width == 60.0 && noted(&art, "units at 300 an inch, as Affinity's"), "{:?}", art.notes);
    let (width, art) = of("", r#"viewBox="0 0 192 96""#, (192.0, 96.0), &usual);
    assert!(width == 50.8 && noted(&art, "units at 96 an inch; set its size"), "{:?}", art.notes);
    let (width, art) = of("", r#"width="2in" viewBox="0 0 192 96""#, (192.0, 96.0), &usual);
    assert!(width == 50.8 && !noted(&art, "states no"), "{:?}", art.notes);
    // What the owner says counts more than any mark.
    let said = Options { dpi: Some(192.0), ..Options::default() };
    let (width, art) = of(ILLUSTRATOR, r#"viewBox="0 0 192 96""#, (192.0, 96.0), &said);
    assert!(width == 25.4 && !noted(&art, "states no"), "{:?}", art.notes);
    let said = Options { size: Some("30mm".parse().unwrap()), ..Options::default() };
    let (width, art) = of("", affinity, (709.0, 354.0), &said);
    assert!(width == 30.0 && art.notes.iter().all(|note| !note.contains("states no")), "{:?}", art.notes);
    let bench = Bench::new();
    let large = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4000 300"><g id="gold"><rect width="9" height="9"/></g></svg>"#;
    let text = refused(&[bench.write("large.svg", large)]);
    for words in ["large.svg states no size on paper; its 4000 x 300 units at 96 an inch", "1058.3 x 79.4 mm"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn affinity_names_a_layer_beside_its_identifier() {
    let bench = Bench::new();
    let svg = r##"<svg width="40mm" height="20mm" viewBox="0 0 473 237" xmlns="http://www.w3.org/2000/svg" xmlns:serif="http://www.serif.com/">
        <g id="White1" serif:id="White"><rect width="473" height="237" style="fill:#fff;"/></g>
        <g id="Metallic-Gold" serif:id="Metallic Gold"><rect x="20" y="20" width="100" height="100" style="fill:#c90;"/></g>
        <g id="Black-2" serif:id="Black"><rect x="200" y="20" width="100" height="100"/></g></svg>"##;
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    let found: Vec<Ink> = art.layers.iter().map(|layer| layer.ink).collect();
    assert_eq!(found, [Ink::White, Ink::MetallicGold, Ink::Black]);
    assert!(near(inks(&art)[0].1, (art.width * art.length) as f64, 0.005));
}

#[test]
fn a_layer_that_its_owner_lets_shine_through_prints_in_full_and_a_faint_shape_is_told() {
    let bench = Bench::new();
    let white = |style: &str, shape: &str| {
        drawing(&format!(
            r##"<g id="black"><rect width="1" height="1"/></g>
            <g style="opacity:.9"><g id="white" style="{style}"><rect width="20" height="20" fill="#fff" {shape}/></g></g>"##
        ))
    };
    let of = |svg: String, options: &Options| read(&[bench.write("art.svg", svg)], options);
    for style in ["opacity:0.4", "opacity: 40% ;fill:#fff"] {
        let art = of(white(style, ""), &Options::default());
        assert!(near(inks(&art)[1].1, dots(20.0) * dots(20.0), 0.005), "{style}: {:?}", art.notes);
        assert!(noted(
            &art,
            "layer `white` is shown at 40 % opacity, which ink does not have: printed in full"
        ));
    }
    let toned = Options { tones: ::inks::InkSet::of([Ink::White]), ..Options::default() };
    let art = of(white("opacity:0.4", ""), &toned);
    let Shape::Tone(tones) = &art.layers[1].shape else { panic!("tones are lost") };
    let most = f64::from(*tones.iter().max().unwrap());
    assert!((most / 255.0 - 0.4 * 0.9).abs() < 0.02 && !noted(&art, "opacity"), "{most}");
    let art = of(white("", "opacity=\".3\""), &Options::default());
    assert!(
        noted(&art, "white: nothing in it is opaque enough to be ink: its opacity is at most 30 %"),
        "{:?}",
        art.notes
    );
}

#[test]
fn groups_and_clones_in_clip_paths_clip_as_inkscape_shows_them() {
    let bench = Bench::new();
    let shapes = r##"<circle cx="10" cy="10" r="8"/><rect x="10" y="4" width="4" height="12" transform="translate(10)"/>"##;
    let wanted = std::f64::consts::PI * dots(8.0) * dots(8.0) + dots(4.0) * dots(12.0);
    for clip in [
        format!("<clipPath id='c'><g>{shapes}</g></clipPath>"),
        format!(
            "<clipPath id='c'><g transform='scale(.5)'><g transform='scale(2)'>{shapes}</g></g></clipPath>"
        ),
        format!(
            "<g id='s' transform='translate(2 1)'>{shapes}</g><clipPath id='c'><use href='#s' x='-2' y='-1'/></clipPath>"
        ),
        format!("<clipPath id='c'>{shapes}</clipPath>"),
    ] {
        let svg = drawing(&format!(
            r##"<defs>{clip}</defs><g id="gold"><g clip-path="url(#c)"><rect width="40" height="30"/></g></g>"##
        ));
        let art = read(&[bench.write("art.svg", svg)], &Options::default());
        assert!(near(inks(&art)[0].1, wanted, 0.003), "{clip}: {:?}, wanted {wanted}", inks(&art));
    }
    // A hole by the rule of the group: one square in another.
    let squares = "<path d='M0 0h20v20h-20zM5 5h10v10h-10z'/>";
    for (rule, area) in [("evenodd", 300.0), ("nonzero", 400.0)] {
        let svg = drawing(&format!(
            r##"<clipPath id="c"><g style="clip-rule:{rule}">{squares}</g></clipPath>
            <g id="gold"><rect clip-path="url(#c)" width="40" height="30"/></g>"##
        ));
        let art = read(&[bench.write("art.svg", svg)], &Options::default());
        assert!(near(inks(&art)[0].1, area * dots(1.0) * dots(1.0), 0.005), "{rule}: {:?}", inks(&art));
    }
    // Clones without end are no clip, and end.
    let endless = drawing(
        r##"<clipPath id="c"><g id="a"><use href="#b"/><use href="#b"/></g></clipPath><defs><g id="b"><use href="#a"/><use href="#a"/></g></defs>
        <g id="gold"><rect width="9" height="9"/><rect clip-path="url(#c)" width="40" height="30"/></g>"##,
    );
    let art = read(&[bench.write("endless.svg", endless)], &Options::default());
    assert!(inks(&art)[0].1 > 0);
}

#[test]
fn strokes_that_do_not_scale_are_as_wide_as_the_page_says() {
    let bench = Bench::new();
    // A pixel is 6.25 dots; the line is 36 mm long.
    for line in [
        r##"<path d="M.2 .9H3.8" stroke="#000" stroke-width="1" vector-effect="non-scaling-stroke"/>"##,
        r##"<path d="M.2 .9H3.8" style="stroke:#000;vector-effect:non-scaling-stroke;stroke-width:1px"/>"##,
        r##"<style>line{stroke:#000;stroke-width:1}</style><line x1=".2" y1=".9" x2="3.8" y2=".9" vector-effect="non-scaling-stroke"/>"##,
    ] {
        let svg = drawing(&format!(r##"<g id="black"><g transform="scale(10)">{line}</g></g>"##));
        let art = read(&[bench.write("art.svg", svg)], &Options::default());
        let (_, top, _, bottom, count) = extent(&art.layers[0]);
        assert!((6..=7).contains(&(bottom - top + 1)), "{line}: {} dots high", bottom - top + 1);
        assert!(near(count, 6.25 * dots(36.0), 0.15), "{line}: {count} dots");
    }
    // Dashes do not scale either: of 36 mm, 136 pixels, two thirds are drawn.
    let dashed = drawing(
        r##"<g id="black"><path transform="scale(10)" d="M.2 .9H3.8" stroke="#000" stroke-dasharray="10 5" vector-effect="non-scaling-stroke"/></g>"##,
    );
    let art = read(&[bench.write("dashed.svg", dashed)], &Options::default());
    assert!(near(inks(&art)[0].1, 6.25 * dots(36.0) * 2.0 / 3.0, 0.15), "{:?}", inks(&art));
}

#[test]
fn meshes_and_hatches_are_named() {
    let bench = Bench::new();
    let svg = drawing(
        r##"<defs><meshgradient id="mg"/><hatch id="h"/></defs>
        <rect x="2" y="2" width="9" height="9" fill="url(#mg)"/><rect x="22" y="2" width="9" height="9" fill="url(#h)"/>
        <rect width="1" height="1"/>"##,
    );
    let art = read(&[bench.write("art.svg", svg)], &Options::default());
    assert!(
        noted(&art, "cannot be drawn and is left out: mesh gradient `mg`, hatch `h`; convert"),
        "{:?}",
        art.notes
    );
}

/// A PDF of one page, 142 x 85 points or another size, with these spots (their names, and their process colours) and this drawing.
pub(crate) fn pdf(spots: &[(&str, &str)], drawing: &str, more: &str) -> Vec<u8> {
    let space = |(at, (name, cmyk)): (usize, &(&str, &str))| {
        format!(
            "/S{at} [/Separation /{name} /DeviceCMYK << /FunctionType 2 /Domain [0 1] /C0 [0 0 0 0] /C1 [{cmyk}] /N 1 >>] "
        )
    };
    let spaces: String = spots.iter().enumerate().map(space).collect();
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R /OCProperties << /OCGs [5 0 R 6 0 R] /D << >> >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".into(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 142 85] /Contents 4 0 R /Resources << /ColorSpace << {spaces} >> \
             /Properties << /L1 5 0 R /L2 6 0 R >> {more} >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{drawing}\nendstream", drawing.len()),
        "<< /Type /OCG /Name (White) >>".into(),
        "<< /Type /OCG /Name (guides) /Usage << /Print << /PrintState /OFF >> >> >>".into(),
    ];
    let count = if drawing.contains("/OC") { 6 } else { 4 };
    let mut file = "%PDF-1.6\n".to_owned();
    let mut table = format!("xref\n0 {}\n0000000000 65535 f \n", count + 1);
    for (at, object) in objects[..count].iter().enumerate() {
        table += &format!("{:010} 00000 n \n", file.len());
        file += &format!("{} 0 obj\n{object}\nendobj\n", at + 1);
    }
    file +=
        &format!("{table}trailer << /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", count + 1, file.len());
    file.into_bytes()
}

const WHITE: (&str, &str) = ("White", ".1 0 0 0");

#[test]
fn a_small_transparent_page_keeps_its_spot_plates() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let drawing = "/S0 cs 1 scn 0 0 142 85 re f /G gs 0 1 1 0 k 40 12 60 60 re f";
    let page = pdf(&[("White", "0 0 0 .1")], drawing, "/ExtGState << /G << /ca .5 /OP true /op true >> >>");
    let art = read(&[bench.write("art.pdf", page)], &Options::default());
    let white = inks(&art).into_iter().find(|(ink, _)| *ink == Ink::White);
    assert!(white.is_some_and(|(_, dots)| dots > 500_000), "{:?}: {:?}", white, art.notes);
}

#[test]
fn registration_marks_are_printed_in_the_inks_of_the_page_only() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let marks = "/S1 cs 1 scn 5 20 10 1 re f";
    let art = |drawing: &str| {
        let file = bench.write("art.pdf", pdf(&[WHITE, ("All", "1 1 1 1")], drawing, ""));
        let art = read(&[file], &Options::default());
        let mut found: Vec<Ink> = laid(&art).into_iter().map(|(ink, _)| ink).collect();
        found.sort_by_key(|ink| ink.name());
        (
            found,
            noted(&art, "marks in the registration colour are printed in the inks that the page has anyway"),
        )
    };
    let page = format!("/S0 cs 1 scn 20 20 100 40 re f 0 0 0 1 k 40 30 40 15 re f {marks}");
    assert_eq!(art(&page), (vec![Ink::Black, Ink::White], true));
    assert_eq!(
        art(&page.replace("0 0 0 1 k", "1 0 0 0 k 22 22 5 5 re f 0 0 0 1 k")),
        (vec![Ink::Black, Ink::Cyan, Ink::White], true)
    );
    assert_eq!(art(&page.replace(marks, "")), (vec![Ink::Black, Ink::White], false));
}

#[test]
fn lines_for_a_cutter_are_left_out_and_named() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let of = |drawing: &str, gold: &str| {
        let file =
            bench.write("art.pdf", pdf(&[(gold, "0 .2 .9 0"), ("CutContour", "0 1 0 0")], drawing, ""));
        read(&[file], &Options::default())
    };
    let cut = "/S1 cs 1 scn 30 25 30 20 re f";
    let art = of(&format!("/S0 cs 1 scn 20 20 100 40 re f {cut}"), "Gold");
    let layers: Vec<Ink> = inks(&art).into_iter().map(|(ink, _)| ink).collect();
    assert_eq!(layers, [Ink::MetallicGold], "{:?}", art.notes);
    assert!(
        noted(&art, "spot colour `CutContour` is for a cutter: left out of the print"),
        "{:?}",
        art.notes
    );
    // Beside plain colours with tones it is left out as well.
    let art = of(&format!(".5 0 0 0 k 20 20 100 40 re f {cut}"), "Gold");
    let colour = art.colour.as_ref().expect("colours");
    assert!(noted(&art, "for a cutter") && art.layers.is_empty(), "{:?}", art.notes);
    let hole = art.drawn.dots();
    assert!(near(hole, 3400.0 * (600.0f64 / 72.0).powi(2), 0.005), "{hole} dots, {}", colour.overprints);
}

#[test]
fn layers_and_fonts_of_a_pdf_are_named_and_bytes_before_it_skipped() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let text = "/OC /L1 BDC 0 0 0 .1 k 0 0 142 85 re f EMC /OC /L2 BDC 0 0 0 1 k BT /F 24 Tf 10 40 Td (RACING) Tj ET EMC";
    let font = "/Font << /F << /Type /Font /Subtype /Type1 /BaseFont /EurostileBold >> >>";
    let plain = pdf(&[], text, font);
    let art = read(&[bench.write("art.pdf", &plain)], &Options::default());
    for words in [
        "`White` is a layer named after an ink; layers of a PDF are not read",
        "`guides` is a layer that is not meant to be printed, but is shown, so it is printed",
        "text is not drawn in its font, because neither the document nor this computer has it: EurostileBold (drawn in ",
    ] {
        assert!(noted(&art, words), "{words}: {:?}", art.notes);
    }
    let spooled = [b"\xef\xbb\xbf@PJL JOB\r\n\r\n".as_slice(), &plain].concat();
    let again = read(&[bench.write("spooled.pdf", spooled)], &Options::default());
    assert!(again.drawn == art.drawn && art.drawn.dots() > 0);
    let eps = "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 200 36\n%%EndComments\n\
        /EurostileBold findfont 20 scalefont setfont 5 10 moveto (RACING 27) show /Helvetica 9 selectfont (x) show showpage\n";
    let art = read(&[bench.write("art.eps", eps)], &Options::default());
    assert!(noted(&art, "computer has it: EurostileBold; embed the font"), "{:?}", art.notes);
}

#[test]
fn kinds_of_tiff_that_scanners_and_programs_write_are_read() {
    use super::plates::tiff_file;
    let bench = Bench::new();
    let size = (20, 10);
    let at =
        |dot: &dyn Fn(usize, usize) -> u8| -> Vec<u8> { (0..200).map(|i| dot(i % 20, i / 20)).collect() };
    // A black square of 5 x 5 at the left of a ground that is white, or transparent and black.
    let square = |x: usize, y: usize| x < 5 && y < 5;
    let ink = at(&|x, y| if square(x, y) { 0 } else { 255 });
    let (opaque, black) = (at(&|x, y| if square(x, y) { 255 } else { 0 }), vec![0; 200]);
    let short = |v: u16| v.to_le_bytes().to_vec();
    let extra = |kind: u16| [(338, 3, short(kind))];
    let palette: Vec<u8> = [[0u16; 256], [0; 256], [0; 256]]
        .map(|mut half| {
            half[7] = 0xffff;
            half
        })
        .concat()
        .into_iter()
        .flat_map(u16::to_le_bytes)
        .collect();
    let lab = |v: &[u8]| [v.to_vec(), vec![0; 200], vec![0; 200]];
    let ground = at(&|x, y| if square(x, y) { 0 } else { 7 });
    for (name, bytes, words) in [
        ("grey and opacity", tiff_file(size, &[black.clone(), opaque.clone()], 1, &extra(2)), ""),
        (
            "grey and opacity that is not called so",
            tiff_file(size, &[black.clone(), opaque.clone()], 1, &extra(0)),
            "channel 2 of 2 has no name",
        ),
        ("white is zero, and opacity", tiff_file(size, &[vec![255; 200], opaque.clone()], 0, &extra(1)), ""),
        (
            "colour and an unnamed channel",
            tiff_file(size, &[black.clone(), black.clone(), black.clone(), opaque.clone()], 2, &extra(0)),
            "channel 4 of 4 has no name; it is read as transparency",
        ),
        (
            "colour times opacity",
            tiff_file(size, &[black.clone(), black.clone(), black.clone(), opaque.clone()], 2, &extra(1)),
            "",
        ),
        (
            "an empty channel",
            tiff_file(size, &[ink.clone(), ink.clone(), ink.clone(), black.clone()], 2, &extra(0)),
            "",
        ),
        ("a palette", tiff_file(size, &[ground], 3, &[(320, 3, palette)]), ""),
        ("Lab", tiff_file(size, &lab(&ink), 8, &[]), ""),
    ] {
        let art = read(&[bench.write("art.tif", bytes)], &Options::default());
        assert_eq!(art.drawn.dots(), 25, "{name}: {:?}", art.notes);
        assert_eq!(words.is_empty(), !noted(&art, "has no name"), "{name}: {:?}", art.notes);
        assert!(words.is_empty() || noted(&art, words), "{name}: {:?}", art.notes);
    }
    // What is not read says why in words of its owner.
    let mut zstd = tiff_file(size, std::slice::from_ref(&ink), 1, &[]);
    let entry = zstd.windows(4).rposition(|tag| tag == [3, 1, 3, 0]).unwrap();
    zstd[entry + 8..entry + 10].copy_from_slice(&short(50_000));
    let said = refused(&[bench.write("art.tif", zstd)]);
    assert!(said.contains("compressed with Zstandard, which is not read; save it in RGB or grey"), "{said}");
}

#[test]
fn the_gamma_of_a_png_is_applied_and_a_profile_that_expands_is_an_error() {
    use std::io::Write as _;
    let bench = Bench::new();
    let linear = |gamma: f32| {
        bench.png("art.png", (2, 1), png::ColorType::Grayscale, png::BitDepth::Eight, &[55, 188], |encoder| {
            encoder.set_source_gamma(png::ScaledFloat::new(gamma));
        })
    };
    let pixels = |path: PathBuf| {
        let mut picture = file::picture(&Disk, &path, None).unwrap();
        picture.to_srgb().unwrap();
        (picture.colours.unwrap().samples, picture.notes)
    };
    // Linear light of 55/255 and 188/255 is .5018 and .8742 in sRGB.
    let (rgba, notes) = pixels(linear(1.0));
    assert_eq!((rgba[0], rgba[4]), (128, 223), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("gamma of 1.000")), "{notes:?}");
    assert_eq!(pixels(linear(0.45455)).0[..1], [55]);
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    (0..64).for_each(|_| packed.write_all(&vec![0; 1 << 20]).unwrap());
    let body = [b"icc\0\0".as_slice(), &packed.finish().unwrap()].concat();
    let plain = fs::read(linear(0.45455)).unwrap();
    let chunk = [&(body.len() as u32).to_be_bytes(), b"iCCP".as_slice(), &body, &[0; 4]].concat();
    let bomb = [&plain[..33], &chunk, &plain[33..]].concat();
    for name in ["art.png", "photo.png"] {
        let said = refused(&[bench.write(name, &bomb)]);
        assert!(said.contains("its colour profile expands to more than 16 MB"), "{said}");
    }
}

#[test]
fn layers_for_a_cutter_are_left_out_of_a_drawing_with_layers_and_without() {
    let bench = Bench::new();
    let cut = r##"<g id="CutContour"><rect width="39" height="29" fill="none" stroke="#f0f"/></g>"##;
    let art = |layers: &str| read(&[bench.write("art.svg", drawing(layers))], &Options::default());
    for rest in [
        r##"<g id="gold"><rect width="9" height="9"/></g>"##,
        r##"<rect width="9" height="9" fill="#123"/>"##,
    ] {
        let with = art(&format!("{cut}{rest}"));
        assert!(with.drawn == art(rest).drawn, "{rest}");
        assert!(
            noted(&with, "layer `CutContour` is for a cutter: left out of the print"),
            "{:?}",
            with.notes
        );
        assert!(!noted(&with, "lies in no layer of an ink"), "{:?}", with.notes);
    }
}

#[test]
fn sublayers_of_one_ink_in_two_objects_are_one_layer_and_two_layers_side_by_side_are_two() {
    let bench = Bench::new();
    let object = |x: u32, white: &str| {
        format!(
            r##"<g id="badge{x}"><g id="{white}"><rect x="{x}" width="5" height="5"/></g><g id="Gold_{x}"><rect x="{x}" y="9" width="3" height="3"/></g></g>"##
        )
    };
    let of = |inside: &str| {
        let art = read(&[bench.write("art.svg", drawing(inside))], &Options::default());
        inks(&art)
    };
    let found = of(&[object(1, "White"), object(11, "White-2"), object(21, "White_3_")].concat());
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        near(found[0].1, 3.0 * dots(5.0) * dots(5.0), 0.02)
            && near(found[1].1, 3.0 * dots(3.0) * dots(3.0), 0.03)
    );
    let side = r##"<g id="White"><rect width="5" height="5"/></g><g id="White-2"><rect x="9" width="5" height="5"/></g>"##;
    assert_eq!(of(side).len(), 2);
}
