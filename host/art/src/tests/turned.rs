//! Pictures whose files state another way up. The turned picture is written out here by hand, not computed.

use super::plates::tiff_file;
use super::*;

/// Pixels of a side of a cell: a block of a JPEG.
const CELL: usize = 8;

/// The cells of the file, and those that are shown for each of the eight numbers.
const STORED: &str = "###/#..";
const SHOWN: [&str; 8] = [
    "###/#..", "###/..#", "..#/###", "#../###", // Stored rows stay rows.
    "##/#./#.", "##/.#/.#", ".#/.#/##", "#./#./##",
];
/// The same for a file whose left half has ink.
const HALF: [&str; 8] = ["#.", ".#", ".#", "#.", "#/.", "#/.", "./#", "./#"];

/// EXIF data: orientation, and a resolution if there is one.
fn exif(orientation: u8, dpi: Option<(u32, u32)>) -> Vec<u8> {
    let entry = |tag: u16, kind: u16, value: u32| {
        [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()].concat()
    };
    let mut entries = vec![entry(274, 3, orientation.into())];
    let mut values = Vec::new();
    if let Some((x, y)) = dpi {
        entries.extend([entry(282, 5, 62), entry(283, 5, 70), entry(296, 3, 2)]);
        values = [x, 1, y, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
    }
    let count = (entries.len() as u16).to_le_bytes().to_vec();
    [b"II*\0\x08\0\0\0".to_vec(), count, entries.concat(), vec![0; 4], values].concat()
}

/// A JPEG with EXIF data behind its start.
fn with_exif(jpeg: &[u8], exif: &[u8]) -> Vec<u8> {
    let length = (exif.len() as u16 + 8).to_be_bytes();
    [&jpeg[..2], b"\xff\xe1", &length, b"Exif\0\0", exif, &jpeg[2..]].concat()
}

/// The stored pixels in grey: dark is ink.
fn pixels() -> Vec<u8> {
    let rows: Vec<&str> = STORED.split('/').collect();
    let cell = |x: usize, y: usize| if rows[y / CELL].as_bytes()[x / CELL] == b'#' { 0 } else { 255 };
    (0..2 * CELL).flat_map(|y| (0..3 * CELL).map(move |x| cell(x, y))).collect()
}

/// What is drawn at the middle of each cell.
fn shown(art: &Artwork, wanted: &str) -> String {
    let (across, down) = (wanted.split('/').next().unwrap().len(), wanted.split('/').count());
    let at = |x: usize, y: usize| {
        let (x, y) = ((2 * x + 1) * art.width / (2 * across), (2 * y + 1) * art.length / (2 * down));
        if bitplane::at(&art.drawn, x, y) { '#' } else { '.' }
    };
    (0..down).map(|y| (0..across).map(|x| at(x, y)).collect::<String>()).collect::<Vec<_>>().join("/")
}

#[test]
fn pictures_are_shown_the_way_up_that_their_file_states() {
    let bench = Bench::new();
    let options = Options { dpi: Some(600.0), ..Options::default() };
    let (wide, high) = (3 * CELL as u32, 2 * CELL as u32);
    let grey = image::GrayImage::from_raw(wide, high, pixels()).unwrap();
    let mut jpeg = std::io::Cursor::new(Vec::new());
    grey.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    let png = |name: &str, orientation: u8| {
        let mut info = png::Info::with_size(wide, high);
        info.color_type = png::ColorType::Grayscale;
        info.exif_metadata = Some(exif(orientation, None).into());
        let file = fs::File::create(bench.path(name)).unwrap();
        let writer = png::Encoder::with_info(file, info).unwrap().write_header();
        writer.unwrap().write_image_data(&pixels()).unwrap();
        bench.path(name)
    };
    let tiff = |name: &str, orientation: u8, cmyk: bool| {
        let ink: Vec<u8> = pixels().iter().map(|v| 255 - v).collect();
        let none = vec![0; ink.len()];
        let (channels, photometric) =
            if cmyk { (vec![none.clone(), none.clone(), none, ink], 5) } else { (vec![pixels(); 3], 2) };
        let tags = [(274, 3, vec![orientation, 0])];
        bench.write(name, tiff_file((wide, high), &channels, photometric, &tags))
    };
    for (orientation, wanted) in (1..).zip(SHOWN) {
        let exif = exif(orientation, None);
        // Named after an ink, a picture is read by other code than one in colour.
        let files = [
            bench.write("photo.jpg", with_exif(&jpeg, &exif)),
            bench.write("white.jpg", with_exif(&jpeg, &exif)),
            png("photo.png", orientation),
            png("white.png", orientation),
            tiff("photo.tif", orientation, false),
            tiff("white.tif", orientation, false),
            tiff("plates.tif", orientation, true),
        ];
        for file in files {
            let name = file.file_name().unwrap().to_owned();
            let art = read(&[file], &options);
            assert_eq!(shown(&art, wanted), wanted, "{name:?}, {orientation}");
            let (across, down) = (wanted.split('/').next().unwrap().len(), wanted.split('/').count());
            assert_eq!((art.width, art.length), (across * CELL, down * CELL), "{name:?}, {orientation}");
        }
        let plates =
            bench.write("plates.jpg", with_exif(include_bytes!("../../../readers/src/cmyk.jpg"), &exif));
        let half = HALF[usize::from(orientation) - 1];
        assert_eq!(shown(&read(&[plates], &options), half), half, "plates.jpg, {orientation}");
    }
}

#[test]
fn the_resolution_turns_with_the_picture() {
    let bench = Bench::new();
    // 24 x 16 pixels at 300 x 600 dpi are 48 x 16 dots.
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let grey = image::GrayImage::from_raw(24, 16, pixels()).unwrap();
    grey.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    for (orientation, size) in [(1, (48, 16)), (3, (48, 16)), (6, (16, 48)), (7, (16, 48))] {
        let exif = exif(orientation, Some((300, 600)));
        for (name, jpeg) in [("white.jpg", jpeg.get_ref()), ("photo.jpg", jpeg.get_ref())] {
            let art = read(&[bench.write(name, with_exif(jpeg, &exif))], &Options::default());
            assert_eq!((art.width, art.length), size, "{name}, {orientation}");
        }
        let mut info = png::Info::with_size(24, 16);
        info.color_type = png::ColorType::Grayscale;
        info.exif_metadata = Some(exif.clone().into());
        info.pixel_dims = Some(png::PixelDimensions { xppu: 11_811, yppu: 23_622, unit: png::Unit::Meter });
        let file = fs::File::create(bench.path("white.png")).unwrap();
        let writer = png::Encoder::with_info(file, info).unwrap().write_header();
        writer.unwrap().write_image_data(&pixels()).unwrap();
        let art = read(&[bench.path("white.png")], &Options::default());
        assert_eq!((art.width, art.length), size, "white.png, {orientation}");
        // 16 x 8 pixels.
        let plates =
            bench.write("plates.jpg", with_exif(include_bytes!("../../../readers/src/cmyk.jpg"), &exif));
        let art = read(&[plates], &Options::default());
        let (long, short) = (32, 8);
        assert_eq!((art.width, art.length), if size.0 == 48 { (long, short) } else { (short, long) });
    }
}
