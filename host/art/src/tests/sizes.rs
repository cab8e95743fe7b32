//! How large art is on paper, whatever says so.

use super::drawings::drawing;
use super::*;

#[test]
fn sizes_come_from_the_user_or_the_file_and_a_layer_without_one_is_of_dots() {
    let bench = Bench::new();
    let dims = |xppu, unit| Some(png::PixelDimensions { xppu, yppu: xppu, unit });
    let save = |name: &str, dims: Option<png::PixelDimensions>| {
        let data = [0, 0, 255, 255, 0, 0, 255, 255];
        let kind = (png::ColorType::Grayscale, png::BitDepth::Eight);
        bench.png(name, (4, 2), kind.0, kind.1, &data, |encoder| encoder.set_pixel_dims(dims))
    };
    let unsized_ = save("k.png", None);
    for name in [unsized_.clone(), save("c.png", dims(1, png::Unit::Unspecified))] {
        let art = read(&[name], &Options::default());
        assert_eq!((art.width, art.length), (4, 2));
        assert!(art.notes[0].contains("at 600 dpi, 0.2 x 0.1 mm"), "{:?}", art.notes);
    }
    let narrow = Options { room: Room { width: 3, length: 9, cut: false }, ..Options::default() };
    let text = open(std::slice::from_ref(&unsized_), &narrow, &Silent).unwrap_err().to_string();
    assert!(
        text.contains("4 x 2 pixels at 600 dpi would be 0.2 x 0.1 mm")
            && text.contains("set its resolution or its size")
    );
    let cut = Options { room: Room { cut: true, ..narrow.room }, ..Options::default() };
    assert_eq!(read(std::slice::from_ref(&unsized_), &cut).width, 4);
    let dots = |path: &PathBuf, options: Options| {
        let art = read(std::slice::from_ref(path), &options);
        (art.width, art.length, extent(&art.layers[0]))
    };
    let at = |dpi| Options { dpi: Some(dpi), ..Options::default() };
    assert_eq!(dots(&unsized_, at(600.0)), (4, 2, (0, 0, 1, 1, 4)));
    assert_eq!(dots(&unsized_, at(60.0)), (40, 20, (0, 0, 19, 19, 400)));
    let size = Options { size: Some("0.3387mm".parse().unwrap()), ..Options::default() };
    assert_eq!(dots(&unsized_, size), (8, 4, (0, 0, 3, 3, 16)));
    let half = save("m.png", dims(11_811, png::Unit::Meter));
    assert_eq!(dots(&half, Options::default()), (8, 4, (0, 0, 3, 3, 16)));
    let huge =
        open(&[half], &Options { size: Some("900mm".parse().unwrap()), ..Options::default() }, &Silent);
    assert!(huge.unwrap_err().to_string().contains("even cropped it can be at most"));
}

#[test]
fn a_photograph_without_a_resolution_fills_the_page_and_one_with_it_is_believed() {
    let bench = Bench::new();
    let photo = |name: &str, size: (u32, u32), dpi: Option<f64>| {
        let data = vec![100; (size.0 * size.1) as usize];
        let per_metre = dpi.map(|dpi| (dpi / 0.0254).round() as u32);
        bench.png(name, size, png::ColorType::Grayscale, png::BitDepth::Eight, &data, |encoder| {
            let unit = png::Unit::Meter;
            encoder.set_pixel_dims(per_metre.map(|xppu| png::PixelDimensions { xppu, yppu: xppu, unit }));
        })
    };
    // A page of 100 x 80 mm.
    let room = Room { width: 2362, length: 1890, cut: false };
    let options = |reserved| Options { room, reserved, ..Options::default() };
    for (size, wanted) in [((40, 20), (2362, 1181)), ((20, 40), (945, 1890)), ((236, 189), (2360, 1890))] {
        let art = read(&[photo("holiday.png", size, None)], &options(false));
        assert!(
            art.width.abs_diff(wanted.0) <= 1 && art.length.abs_diff(wanted.1) <= 1,
            "{size:?}: {} x {}",
            art.width,
            art.length
        );
        assert!(art.width <= room.width && art.length <= room.length);
        assert!(art.notes[0].contains("as large as the page allows"), "{:?}", art.notes);
    }
    // Reserved colours are drawn at one pixel a dot.
    let art = read(&[photo("holiday.png", (40, 20), None)], &options(true));
    assert_eq!((art.width, art.length), (40, 20));
    let art = read(&[photo("small.png", (72, 36), Some(72.0))], &options(false));
    assert_eq!((art.width, art.length), (600, 300));
    let text = open(&[photo("large.png", (720, 360), Some(72.0))], &options(false), &Silent)
        .unwrap_err()
        .to_string();
    for words in ["large.png states 72 dpi", "254.0 x 127.0 mm", "room for 100.0 x 80.0 mm", "crop it"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn layers_that_do_not_fit_each_other_are_named_with_both_sizes() {
    let bench = Bench::new();
    let a = bench.grey("white.png", (4, 2), &[0; 8]);
    let b = bench.grey("gold.png", (2, 4), &[0; 8]);
    let text = refused(&[a.clone(), b]);
    for word in ["gold.png is 2 x 4 pixels at 600 dpi", "white.png is 4 x 2 pixels at 600 dpi"] {
        assert!(text.contains(word), "{text}");
    }
    let c = bench.png("k.png", (4, 2), png::ColorType::Grayscale, png::BitDepth::Eight, &[0; 8], |encoder| {
        let unit = png::Unit::Meter;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: 11_811, yppu: 11_811, unit }));
    });
    assert!(refused(&[a, c]).contains("k.png is 4 x 2 pixels at 300 dpi"));
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
        assert!(error.hints()[0].settings.iter().all(|(name, _)| *name != "dpi"), "{text}");
        assert!(text.contains(" is 210.") && text.contains("room for 203.2 x 269.7 mm"), "{text}");
        let art = read(&[file], &room(true));
        // 210 x 297 mm to the dot.
        assert!(
            art.width.abs_diff(4961) <= 1 && art.length.abs_diff(7016) <= 1,
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
    // What is lost is half of the rows: the advice is what the printer can do, and who follows it gets none.
    assert!(art.notes.iter().any(|note| note.contains("draw at 1200 x 600 dpi")), "{:?}", art.notes);
    let unit = png::Unit::Meter;
    let stated =
        bench.png("white.png", (20, 10), png::ColorType::Grayscale, png::BitDepth::Eight, &columns, |png| {
            png.set_pixel_dims(Some(png::PixelDimensions { xppu: 47_244, yppu: 23_622, unit }));
        });
    let art = read(&[stated], &Options { across: 2, ..Options::default() });
    assert_eq!(extent(&art.layers[0]), (0, 0, 18, 9, 100));
    assert!(!art.notes.iter().any(|note| note.contains("resampled")), "{:?}", art.notes);
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
