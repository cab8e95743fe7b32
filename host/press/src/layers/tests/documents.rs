//! Drawings and pages: nothing of the art is lost.

use super::*;
use base64::Engine as _;

/// A drawing of 40 x 30 mm, 944.88 x 708.66 dots, one unit a millimetre.
fn drawing(layers: &str) -> String {
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="30mm" viewBox="0 0 40 30">{layers}</svg>"##
    )
}

/// Dots of a length in millimetres.
fn dots(mm: f64) -> f64 {
    mm * 600.0 / 25.4
}

fn near(found: u64, wanted: f64, share: f64) -> bool {
    (found as f64 / wanted - 1.0).abs() < share
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

#[test]
fn art_of_a_whole_sheet_is_refused_with_its_size_or_cropped_at_its_true_size() {
    let bench = Bench::new();
    // The printable area of A4.
    let room = |cut| Options { room: Room { width: 4800, length: 6372, cut }, ..Options::default() };
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="210mm" height="297mm"><g id="black"><rect width="99" height="9"/></g></svg>"##;
    let mut files = vec![bench.write("a4.svg", svg)];
    if ghostscript() {
        let page = "%!PS\n<</PageSize [595.276 841.89]>> setpagedevice 9 9 99 9 rectfill showpage\n";
        files.push(bench.write("a4.ps", page));
    }
    for file in files {
        let error = open(std::slice::from_ref(&file), &room(false), &Silent).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, LayersError::Beyond { says: None, .. }), "{text}");
        assert!(text.contains(" is 210.") && text.contains("room for 203.2 x 269.7 mm"), "{text}");
        let art = read(&[file], &room(true));
        // 210 x 297 mm, as exact as Ghostscript's draft is.
        assert!(
            art.width.abs_diff(4961) <= 9 && art.length.abs_diff(7016) <= 9,
            "{} x {}",
            art.width,
            art.length
        );
        let (left, _, right, ..) = match &art.layers[..] {
            [layer] => extent(layer),
            _ => continue,
        };
        // 99 units of 1/96 inch.
        assert!((right + 1 - left).abs_diff(619) <= 1, "true size: {left} to {right}");
    }
}

#[test]
fn art_for_1200_dpi_has_twice_as_many_dots_across_and_the_same_size() {
    let bench = Bench::new();
    let fine = Options { across: 2, dpi: Some(1200.0), ..Options::default() };
    // Columns of pixels at 1200 dpi stay columns; two rows become one.
    let columns: Vec<u8> =
        (0..20 * 10).map(|at| if (at % 20usize).is_multiple_of(2) { 0 } else { 255 }).collect();
    let art = read(&[bench.grey("black.png", (20, 10), &columns)], &fine);
    assert_eq!((art.width, art.length), (20, 5));
    assert_eq!(extent(&art.layers[0]), (0, 0, 18, 4, 50));
    let file = bench
        .write("art.svg", drawing(r##"<g id="black"><rect x="10" y="10" width="10" height="10"/></g>"##));
    let art = read(&[file], &Options { across: 2, ..Options::default() });
    assert_eq!((art.width, art.length), (1890, 709));
    let (left, top, right, bottom, _) = extent(&art.layers[0]);
    assert!(
        near((right + 1 - left) as u64, 2.0 * dots(10.0), 0.01)
            && near((bottom + 1 - top) as u64, dots(10.0), 0.01)
    );
}

/// Four pages of 2 x 1 inch; the second is blank.
const SEVERAL: &str = "%!PS-Adobe-3.0
/page { <</PageSize [144 72]>> setpagedevice } def
page 0 setgray 12 12 96 48 rectfill showpage
page showpage
page 0 setgray 24 24 36 12 rectfill 1 setgray 24 24 18 12 rectfill showpage
page 1 0.9 0.5 setrgbcolor 84 24 12 12 rectfill showpage
";

#[test]
fn several_pages_of_art_are_refused_until_one_is_chosen() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let file = bench.write("pages.ps", SEVERAL);
    let error = open(std::slice::from_ref(&file), &Options::default(), &Silent).unwrap_err();
    assert!(matches!(&error, LayersError::Pages { pages, .. } if *pages == [1, 3, 4]), "{error}");
    assert!(error.to_string().contains("has art on 3 pages (1, 3, 4)"), "{error}");
    let third = Options { pages: Pages::Number(3), ..Options::default() };
    let drawn = read(&[file], &third).drawn.dots();
    assert!(near(drawn, 150.0 * 100.0, 0.03), "{drawn}");
    // One page with art among blank ones needs no choice.
    let alone: String = SEVERAL
        .lines()
        .filter(|line| !line.contains("showpage") || line.contains("1 setgray") || *line == "page showpage")
        .collect::<Vec<_>>()
        .join("\n");
    let art = read(&[bench.write("alone.ps", alone)], &Options::default());
    assert!(near(art.drawn.dots(), 150.0 * 100.0, 0.03));
    assert!(art.notes.iter().any(|note| note.contains("page 2 of 2 is read")), "{:?}", art.notes);
}

#[test]
fn a_page_for_each_ink_is_a_layer_for_each() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let file = bench.write("pages.ps", SEVERAL);
    let inked = |inks: &[Ink]| Options { pages: Pages::Inks(inks.to_vec()), ..Options::default() };
    let art =
        read(std::slice::from_ref(&file), &inked(&[Ink::White, Ink::MetallicGold, Ink::Black, Ink::Finish]));
    assert_eq!((art.width, art.length), (1200, 600));
    let dots: Vec<(Ink, Option<u32>, u64)> = art
        .layers
        .iter()
        .map(|layer| match &layer.shape {
            Shape::Solid(plane) => (layer.ink, layer.place, plane.dots()),
            Shape::Tone(_) => panic!("tones"),
        })
        .collect();
    // 600 / 72 dots a unit; a light colour alone is ink, and white on black is none.
    for ((ink, place, found), (wanted, area)) in dots.iter().zip([
        (Ink::White, 800.0 * 400.0),
        (Ink::MetallicGold, 0.0),
        (Ink::Black, 150.0 * 100.0),
        (Ink::Finish, 100.0 * 100.0),
    ]) {
        assert_eq!((*ink, *place), (wanted, None));
        assert!((*found as f64 - area).abs() <= 0.03 * area, "{ink:?}: {found}, not {area}");
    }
    assert!(art.notes.iter().any(|note| note.contains("page 2: no pixel is dark enough")), "{:?}", art.notes);
    // An ink on two pages lies at their depths.
    let twice = read(std::slice::from_ref(&file), &inked(&[Ink::White, Ink::Black, Ink::White, Ink::Black]));
    assert_eq!(
        twice.layers.iter().map(|layer| layer.place).collect::<Vec<_>>(),
        [Some(1), Some(2), Some(3), Some(4)]
    );
    let refused =
        |inks: &[Ink]| open(std::slice::from_ref(&file), &inked(inks), &Silent).unwrap_err().to_string();
    assert!(
        refused(&[Ink::White, Ink::Black]).contains("page 3 has art, but an ink is named for 2 pages only")
    );
    assert!(refused(&[Ink::White; 5]).contains("has 4 pages, but 5 inks are named"));
    let unlike = bench.write(
        "unlike.ps",
        SEVERAL.replacen("page showpage", "<</PageSize [72 72]>> setpagedevice showpage", 1),
    );
    let error = open(&[unlike], &inked(&[Ink::White; 4]), &Silent).unwrap_err().to_string();
    assert!(error.contains("page 2 is 25 x 25 mm, but page 1 is 51 x 25 mm"), "{error}");
}

/// A white plate, a spot that names no ink, and a colour made of both.
const MIXED: &str = "%!PS-Adobe-3.0
<</PageSize [144 72]>> setpagedevice
[/Separation (Dieline) /DeviceCMYK {0 exch dup 0.5 mul 0}] setcolorspace 1 setcolor 12 12 96 6 rectfill
[/Separation (White) /DeviceCMYK {pop 0 0 0 0}] setcolorspace 1 setcolor 12 30 96 30 rectfill
[/DeviceN [/White /Dieline] /DeviceCMYK {exch pop 0 exch dup 0.5 mul 0}] setcolorspace
1 0.5 setcolor 24 36 36 12 rectfill
showpage
";

/// Ink of each layer: the mean of its coverage in dots.
fn amounts(art: &Artwork) -> Vec<(Ink, f64)> {
    let amount = |shape: &Shape| match shape {
        Shape::Solid(plane) => plane.dots() as f64,
        Shape::Tone(tones) => tones.iter().map(|&v| f64::from(v)).sum::<f64>() / 255.0,
    };
    let mut amounts: Vec<(Ink, f64)> =
        art.layers.iter().map(|layer| (layer.ink, amount(&layer.shape))).collect();
    amounts.sort_by_key(|(ink, _)| *ink);
    amounts
}

#[test]
fn spots_without_an_ink_print_by_their_process_colours_in_layers_and_queue_alike() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let file = bench.write("mixed.ps", MIXED);
    let art = read(std::slice::from_ref(&file), &Options::default());
    // In dots: the line and half of the patch in magenta, half as much in yellow, white where it is drawn.
    let line = 800.0 * 50.0 + 0.5 * 300.0 * 100.0;
    let wanted = [(Ink::Magenta, line), (Ink::Yellow, line / 2.0), (Ink::White, 800.0 * 250.0)];
    let found = amounts(&art);
    assert_eq!(found.len(), 3, "{found:?}");
    for ((ink, found), (named, wanted)) in found.iter().zip(wanted) {
        assert_eq!(*ink, named);
        assert!((found / wanted - 1.0).abs() < 0.03, "{ink:?}: {found}, not {wanted}");
    }
    let note = "spot colour `Dieline` names no ink: printed by its process colours";
    assert!(art.notes.iter().any(|said| said.contains(note)), "{:?}", art.notes);
    // The queue's way.
    assert_eq!(pdf::spots(&file).unwrap(), [["White"]]);
    let page = pdf::separated(&file, 1, 600.0).unwrap();
    let window = Window { left: 0, top: 0, width: page.size.0, height: page.size.1 };
    assert_eq!(amounts(&page.art("page", &window, &Options::default()).unwrap()), amounts(&art));
    // A slip is an error in both.
    let slip = bench.write("slip.ps", MIXED.replace("Dieline", "Golld"));
    for error in [pdf::spots(&slip).unwrap_err(), open(&[slip], &Options::default(), &Silent).unwrap_err()] {
        assert!(error.to_string().contains("`Golld` names no ink, did you mean `gold`?"), "{error}");
    }
}

/// A JPEG of 60 x 40 pixels with this EXIF resolution, in either order of bytes.
fn exif_jpeg(bench: &Bench, name: &str, little: bool, fields: &[(u16, u32, u32)]) -> PathBuf {
    let mut jpeg = Vec::new();
    let grey = image::GrayImage::from_pixel(60, 40, image::Luma([90]));
    grey.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).unwrap();
    let short = |v: u16| if little { v.to_le_bytes() } else { v.to_be_bytes() };
    let long = |v: u32| if little { v.to_le_bytes() } else { v.to_be_bytes() };
    let mut block = if little { b"II".to_vec() } else { b"MM".to_vec() };
    block.extend(short(42));
    block.extend(long(8));
    block.extend(short(fields.len() as u16));
    let mut values = Vec::new();
    for &(tag, a, b) in fields {
        block.extend(short(tag));
        // A ratio, or a short number where there is no denominator.
        block.extend(short(if b > 0 { 5 } else { 3 }));
        block.extend(long(1));
        if b > 0 {
            block.extend(long((8 + 2 + 12 * fields.len() + 4 + values.len()) as u32));
            values.extend([long(a), long(b)].concat());
        } else {
            block.extend([short(a as u16), [0; 2]].concat());
        }
    }
    block.extend(long(0));
    block.extend(values);
    let mut segment = b"\xff\xe1".to_vec();
    segment.extend(((block.len() + 8) as u16).to_be_bytes());
    segment.extend(b"Exif\0\0");
    segment.extend(block);
    // Behind the JFIF segment, which states no resolution.
    let place = 4 + usize::from(u16::from_be_bytes([jpeg[4], jpeg[5]]));
    assert_eq!((&jpeg[6..10], jpeg[13]), (&b"JFIF"[..], 0));
    jpeg.splice(place..place, segment);
    bench.write(name, jpeg)
}

#[test]
fn the_resolution_in_exif_is_that_of_the_picture_and_72_dpi_is_none() {
    let bench = Bench::new();
    let room = Room { width: 2400, length: 2400, cut: false };
    let size = |file: PathBuf| {
        let art = read(&[file], &Options { room, ..Options::default() });
        (art.width, art.length)
    };
    let both = |a, b, unit: u32| [(282, a, b), (283, a, b), (296, unit, 0)];
    for little in [true, false] {
        assert_eq!(size(exif_jpeg(&bench, "a.jpg", little, &both(300, 1, 2))), (120, 80));
        assert_eq!(size(exif_jpeg(&bench, "b.jpg", little, &both(1181, 10, 3))), (120, 80));
        assert_eq!(size(exif_jpeg(&bench, "c.jpg", little, &[(282, 150, 1), (283, 300, 1)])), (240, 80));
    }
    // Without one it fills the room.
    for fields in [&both(72, 1, 2)[..], &both(300, 1, 1), &both(300, 0, 2)[..2], &[]] {
        assert_eq!(size(exif_jpeg(&bench, "d.jpg", true, fields)), (2400, 1600), "{fields:?}");
    }
}

#[test]
fn a_resolution_has_no_effect_on_a_drawing_and_is_said_of_a_picture() {
    let bench = Bench::new();
    let file = bench.write("art.svg", drawing(r##"<g id="black"><rect width="4" height="3"/></g>"##));
    let fine = Options { dpi: Some(1200.0), ..Options::default() };
    let art = read(&[file], &fine);
    assert_eq!((art.width, art.length), (945, 709));
    assert!(art.notes.iter().any(|note| note.contains("the resolution has no effect")), "{:?}", art.notes);
    let art = read(&[bench.grey("black.png", (20, 10), &[0; 200])], &fine);
    let note = "resampled from 20 x 10 pixels at 1200 dpi to 10 x 5 dots";
    assert!(art.notes.iter().any(|said| said.contains(note)), "{:?}", art.notes);
}
