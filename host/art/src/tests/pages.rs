//! Pages of PostScript and PDF, through Ghostscript.

use super::*;

const PAGES: &str = "%!PS-Adobe-3.0
<< /PageSize [144 72] >> setpagedevice
[/Separation (white) /DeviceCMYK {0 mul dup dup dup}] setcolorspace 1 setcolor 12 12 96 48 rectfill
[/Separation (Gold Foil) /DeviceCMYK {dup 0 mul exch dup 0.4 mul exch dup 0.9 mul exch 0 mul}] setcolorspace
1 setcolor 24 24 36 12 rectfill
0 0 0 1 setcmykcolor 84 24 12 12 rectfill
showpage
<< /PageSize [144 72] >> setpagedevice
0.8 0.1 0.1 setrgbcolor 24 12 48 48 rectfill
1 1 1 setrgbcolor 36 24 12 12 rectfill
showpage
";

#[test]
fn spot_plates_of_a_page_are_layers() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let first = Options { pages: Pages::Number(1), ..Options::default() };
    let art = read(&[bench.write("page.ps", PAGES)], &first);
    assert_eq!((art.width, art.length), (1200, 600));
    // PostScript measures from the bottom; 600 / 72 dots a unit. Its rectangles take every dot they touch.
    assert!(dots_of(&art, Ink::Black).abs_diff(100 * 100) < 300);
    for (ink, left, top, wide, high) in
        [(Ink::White, 100, 100, 800, 400), (Ink::GoldFoil, 200, 300, 300, 100)]
    {
        let layer = art.layers.iter().find(|layer| layer.ink == ink).unwrap();
        let (x0, y0, x1, y1, dots) = extent(layer);
        let knocked_out: u64 = if ink == Ink::White { 300 * 100 + 100 * 100 } else { 0 };
        let near = |a: usize, b: usize| a.abs_diff(b) <= 1;
        assert!(
            near(x0, left) && near(y0, top) && near(x1 + 1, left + wide) && near(y1 + 1, top + high),
            "{ink:?}: {x0}, {y0} to {x1}, {y1}"
        );
        assert!(dots.abs_diff((wide * high) as u64 - knocked_out) < 3000, "{ink:?}: {dots}");
    }
}

#[test]
fn a_pages_ground_stays_transparent_and_its_white_does_not() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let file = bench.write("page.ps", PAGES);
    let second = Options { pages: Pages::Number(2), ..Options::default() };
    let art = read(std::slice::from_ref(&file), &second);
    assert!(art.layers.is_empty() && art.colour.is_some());
    let (opaque, drawn) = (art.opaque.unwrap().dots(), art.drawn.dots());
    assert!(opaque.abs_diff(400 * 400) < 900, "{opaque}");
    assert!((opaque - drawn).abs_diff(100 * 100) < 300, "{drawn}");
    let third = open(&[file], &Options { pages: Pages::Number(3), ..Options::default() }, &Silent);
    assert!(third.unwrap_err().to_string().contains("there is no page 3"));
    let broken = bench.write("broken.pdf", "%PDF-1.4\nno page at all");
    assert!(open(&[broken], &Options::default(), &Silent).is_err());
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
    assert!(error.to_string().contains("art on 3 pages (1, 3, 4)"), "{error}");
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
[/Separation (Violet) /DeviceCMYK {0 exch dup 0.5 mul 0}] setcolorspace 1 setcolor 12 12 96 6 rectfill
[/Separation (White) /DeviceCMYK {pop 0 0 0 0}] setcolorspace 1 setcolor 12 30 96 30 rectfill
[/DeviceN [/White /Violet] /DeviceCMYK {exch pop 0 exch dup 0.5 mul 0}] setcolorspace
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
    let [(Ink::White, white)] = amounts(&art)[..] else { panic!("{:?}", art.layers) };
    assert!((white / (800.0 * 250.0) - 1.0).abs() < 0.03, "{white}");
    // The line, half of it on white, and white alone. Half of an ink takes half of the light: 188 of 255.
    let keys = art.colour.as_ref().unwrap().keys((art.width, art.length));
    for ((x, y), wanted) in
        [((500, 474), [255, 0, 188]), ((350, 250), [255, 188, 225]), ((700, 250), [255; 3])]
    {
        let found = packed::colour(keys[y * art.width + x]);
        assert!(found.iter().zip(wanted).all(|(v, w)| v.abs_diff(w) <= 3), "at {x}, {y}: {found:?}");
    }
    let note = "spot colour `Violet` names no ink: printed by its process colours";
    assert!(art.notes.iter().any(|said| said.contains(note)), "{:?}", art.notes);
    // The queue's way.
    assert_eq!(spots_of(&file).unwrap(), [["White"]]);
    let page = pdf::separated(&file, Interpreter::Usual, (1, Part::Sheet), 600.0).unwrap();
    let queued = page.art("page", 600.0, &Options::default()).unwrap();
    let keys = |art: &Artwork| art.colour.as_ref().map(|colour| colour.keys((art.width, art.length)));
    assert_eq!((amounts(&queued), keys(&queued)), (amounts(&art), keys(&art)));
    // A slip is an error in both.
    let slip = bench.write("slip.ps", MIXED.replace("Violet", "Golld"));
    for error in [spots_of(&slip).unwrap_err(), open(&[slip], &Options::default(), &Silent).unwrap_err()] {
        assert!(
            error
                .to_string()
                .contains("spot colour `Golld` names no ink (did you mean `gold`?); rename the spot colour"),
            "{error}"
        );
    }
}

#[test]
fn a_page_keeps_tints_of_its_spot_colours_in_layers_and_queue_alike() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let page = "%!PS\n<</PageSize [144 72]>> setpagedevice [/Separation (Gold) /DeviceCMYK {pop 0 0 1 0}] setcolorspace
        1 setcolor 12 12 48 48 rectfill 0.3 setcolor 72 12 48 48 rectfill showpage\n";
    let file = bench.write("tint.ps", page);
    let art = read(std::slice::from_ref(&file), &Options::default());
    let separated = pdf::separated(&file, Interpreter::Usual, (1, Part::Sheet), 600.0).unwrap();
    let queued = separated.art("page", 600.0, &Options::default()).unwrap();
    assert_eq!(amounts(&queued), amounts(&art));
    // Both squares are 400 dots a side.
    let [(Ink::MetallicGold, gold)] = amounts(&art)[..] else { panic!("{:?}", art.notes) };
    assert!((gold / (1.3 * 400.0 * 400.0) - 1.0).abs() < 0.01, "{gold}");
}
