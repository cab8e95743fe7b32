//! Reading art, dot by dot, from files that other means than the readers made.

use std::fs;
use std::path::PathBuf;

mod documents;

use super::*;
use observe::Silent;
use proptest::prelude::*;
use protocol::ink::Ink;
use tempfile::TempDir;
use testing::needs::{self, Need};

struct Bench(TempDir);

impl Bench {
    fn new() -> Bench {
        Bench(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a PNG of this kind, at 600 dpi by default.
    fn png(
        &self,
        name: &str,
        (width, height): (u32, u32),
        colour: png::ColorType,
        depth: png::BitDepth,
        data: &[u8],
        change: impl FnOnce(&mut png::Encoder<'_, fs::File>),
    ) -> PathBuf {
        let path = self.path(name);
        let mut encoder = png::Encoder::new(fs::File::create(&path).unwrap(), width, height);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let unit = png::Unit::Meter;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: 23_622, yppu: 23_622, unit }));
        change(&mut encoder);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        path
    }

    fn grey(&self, name: &str, size: (u32, u32), data: &[u8]) -> PathBuf {
        self.png(name, size, png::ColorType::Grayscale, png::BitDepth::Eight, data, |_| ())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }
}

fn read(paths: &[PathBuf], options: &Options) -> Artwork {
    open(paths, options, &Silent).unwrap()
}

fn refused(paths: &[PathBuf]) -> String {
    open(paths, &Options::default(), &Silent).unwrap_err().to_string()
}

/// Columns and rows of the dots of a layer: first and last of each, and how many dots.
fn extent(layer: &Layer) -> (usize, usize, usize, usize, u64) {
    let Shape::Solid(plane) = &layer.shape else { panic!("{} has tones", layer.name) };
    let inked = |&(x, y): &(usize, usize)| bits::at(plane, x, y);
    let all = || (0..plane.length).flat_map(|y| (0..plane.width).map(move |x| (x, y))).filter(inked);
    let (xs, ys) = (all().map(|p| p.0), all().map(|p| p.1));
    (xs.clone().min().unwrap(), ys.clone().min().unwrap(), xs.max().unwrap(), ys.max().unwrap(), plane.dots())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn whatever_the_kind_of_png_dark_is_ink(width in 1u32..40, height in 1u32..20, seed: u32) {
        use png::{BitDepth, ColorType};
        let bench = Bench::new();
        let random = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 20 & 1 == 1;
        let ink: Vec<bool> = (0..(width * height) as usize).map(random).collect();
        let each = |pixel: &dyn Fn(bool) -> Vec<u8>| -> Vec<u8> { ink.iter().flat_map(|&ink| pixel(ink)).collect() };
        let size = (width, height);
        let v = |ink: bool| if ink { 0u8 } else { 255 };
        let rows = |one: &dyn Fn(bool) -> u8| -> Vec<u8> {
            ink.chunks(width as usize)
                .flat_map(|row| row.chunks(8).map(|eight| {
                    eight.iter().zip(0..).fold(0u8, |byte, (&ink, at)| byte | one(ink) << (7 - at))
                }).collect::<Vec<u8>>())
                .collect()
        };
        let plain = |_: &mut png::Encoder<'_, fs::File>| ();
        let files = [
            bench.grey("white.png", size, &each(&|ink| vec![v(ink)])),
            bench.png("k.png", size, ColorType::Grayscale, BitDepth::One, &rows(&|ink| u8::from(!ink)), plain),
            bench.png("c.png", size, ColorType::Indexed, BitDepth::One, &rows(&u8::from), |encoder| {
                encoder.set_palette(vec![255, 255, 255, 30, 20, 10]);
            }),
            bench.png("m.png", size, ColorType::Rgb, BitDepth::Eight, &each(&|ink| vec![v(ink); 3]), plain),
            bench.png("y.png", size, ColorType::Rgba, BitDepth::Eight, &each(&|ink| vec![v(ink), v(ink), v(ink), 255]), plain),
            bench.png("gold.png", size, ColorType::GrayscaleAlpha, BitDepth::Eight, &each(&|ink| vec![9, 255 - v(ink)]), plain),
            bench.png("silver.png", size, ColorType::Grayscale, BitDepth::Sixteen, &each(&|ink| vec![v(ink); 2]), plain),
            bench.png("finish.png", size, ColorType::Indexed, BitDepth::One, &rows(&u8::from), |encoder| {
                encoder.set_palette(vec![0, 0, 0, 0, 0, 0]);
                encoder.set_trns(vec![0, 255]);
            }),
        ];
        let art = read(&files, &Options::default());
        prop_assert_eq!((art.width, art.length), (width as usize, height as usize));
        for layer in &art.layers {
            let Shape::Solid(plane) = &layer.shape else { panic!("tones") };
            for (dot, &ink) in ink.iter().enumerate() {
                let (x, y) = (dot % width as usize, dot / width as usize);
                prop_assert_eq!(bits::at(plane, x, y), ink, "{} at ({}, {})", layer.name, x, y);
            }
        }
    }
}

#[test]
fn what_is_drawn_on_transparent_ground_is_ink_whatever_its_colour() {
    let bench = Bench::new();
    let rgba = |pixels: &[[u8; 4]]| {
        let data = pixels.concat();
        let size = (pixels.len() as u32, 1);
        bench.png("white.png", size, png::ColorType::Rgba, png::BitDepth::Eight, &data, |_| ())
    };
    // White drawn in white, with a soft edge and rubbish under the transparent pixel.
    let file = rgba(&[[255, 255, 255, 255], [255, 255, 255, 200], [250, 250, 250, 60], [9, 8, 7, 0]]);
    let art = read(&[file], &Options::default());
    assert_eq!(extent(&art.layers[0]), (0, 0, 1, 0, 2));
    assert!(art.notes.iter().any(|note| note.contains("2 pixels (50.00 %)")), "{:?}", art.notes);
    // Edges that a program multiplied into the colour are as opaque as they were.
    let file = rgba(&[[0, 0, 0, 255], [0, 0, 0, 200], [0, 0, 0, 60], [0, 0, 0, 0]]);
    assert_eq!(extent(&read(&[file], &Options::default()).layers[0]), (0, 0, 1, 0, 2));
    // Black and white on transparent: white is left out, with a note.
    let file = rgba(&[[0, 0, 0, 255], [255, 255, 255, 255], [0, 0, 0, 0]]);
    let art = read(&[file], &Options::default());
    assert_eq!(extent(&art.layers[0]), (0, 0, 0, 0, 1));
    assert!(art.notes.iter().any(|note| note.contains("light parts are left out")), "{:?}", art.notes);
}

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
fn files_are_named_after_inks_and_slips_are_understood() {
    let bench = Bench::new();
    let save = |name: &str| bench.grey(name, (2, 1), &[0, 255]);
    let files = [save("02-black.png"), save("01-white.png"), save("3 Gold Foil.png")];
    let art = read(&files, &Options::default());
    let named: Vec<_> = art.layers.iter().map(|layer| (layer.ink, layer.place)).collect();
    assert_eq!(named, [(Ink::Black, Some(2)), (Ink::White, Some(1)), (Ink::GoldFoil, Some(3))]);
    let text = refused(&[save("white.png"), save("golld.png")]);
    assert!(text.contains("`golld` names no ink, did you mean `gold`?"), "{text}");
    // A folder is its pictures.
    let folder = bench.path("decal");
    fs::create_dir(&folder).unwrap();
    assert!(refused(std::slice::from_ref(&folder)).contains("no picture in the folder"));
    for name in ["white.png", "k.png"] {
        fs::copy(bench.path("white.png"), folder.join(name)).unwrap();
    }
    fs::write(folder.join("notes.txt"), "mine").unwrap();
    let art = read(&[folder], &Options::default());
    assert_eq!((art.name.as_str(), art.layers.len()), ("decal", 2));
}

#[test]
fn one_picture_is_colour_unless_its_name_says_an_ink() {
    let bench = Bench::new();
    let picture = bench.grey("holiday.png", (2, 1), &[0, 255]);
    let art = read(&[picture], &Options::default());
    assert!(art.layers.is_empty() && art.colour.is_some() && art.drawn.dots() == 1);
    let art = read(&[bench.grey("whitee.png", (2, 1), &[0, 255])], &Options::default());
    assert!(art.notes.iter().any(|note| note.contains("name it white.png")), "{:?}", art.notes);
    let layer = read(&[bench.grey("black.png", (2, 1), &[0, 255])], &Options::default());
    assert!(layer.colour.is_none() && layer.layers.len() == 1);
}

#[test]
fn reserved_colours_become_layers_and_the_rest_stays_colour() {
    let bench = Bench::new();
    let rgb = [[230, 230, 230], [225, 160, 0], [200, 30, 40], [255, 255, 255], [0, 0, 0]];
    let rows = [rgb.concat(), rgb.concat()].concat();
    let wide: Vec<u8> = rows.chunks(3).flat_map(|pixel| pixel.repeat(2)).collect();
    let file = bench.png("art.png", (10, 2), png::ColorType::Rgb, png::BitDepth::Eight, &wide, |_| ());
    let art = read(&[file], &Options { reserved: true, ..Options::default() });
    let layers: Vec<_> = art.layers.iter().map(|layer| (layer.ink, extent(layer))).collect();
    assert_eq!(
        layers,
        [(Ink::White, (0, 0, 1, 1, 4)), (Ink::MetallicGold, (2, 0, 3, 1, 4)), (Ink::Black, (8, 0, 9, 1, 4))]
    );
    assert_eq!(art.drawn.dots(), 16);
    assert!(art.colour.is_some());
}

/// A TIFF of 8-bit channels, interleaved, with these tags beside the necessary ones.
fn tiff_file(
    size: (u32, u32),
    channels: &[Vec<u8>],
    photometric: u16,
    tags: &[(u16, u16, Vec<u8>)],
) -> Vec<u8> {
    let n = channels.len() as u16;
    let data: Vec<u8> = (0..channels[0].len()).flat_map(|at| channels.iter().map(move |c| c[at])).collect();
    let (short, long) = (|v: u16| v.to_le_bytes().to_vec(), |v: u32| v.to_le_bytes().to_vec());
    let ratio = [600u32.to_le_bytes(), 1u32.to_le_bytes()].concat();
    let mut all: Vec<(u16, u16, Vec<u8>)> = vec![
        (256, 4, long(size.0)),
        (257, 4, long(size.1)),
        (258, 3, short(8).repeat(usize::from(n))),
        (259, 3, short(1)),
        (262, 3, short(photometric)),
        (273, 4, long(8)),
        (277, 3, short(n)),
        (278, 4, long(size.1)),
        (279, 4, long(data.len() as u32)),
        (282, 5, ratio.clone()),
        (283, 5, ratio),
        (296, 3, short(2)),
    ];
    all.extend_from_slice(tags);
    all.sort();
    let start = 8 + data.len().next_multiple_of(2);
    let mut beyond = start + 2 + 12 * all.len() + 4;
    let (mut directory, mut values) = ((all.len() as u16).to_le_bytes().to_vec(), Vec::new());
    for (tag, kind, value) in &all {
        let unit = match kind {
            3 => 2,
            4 => 4,
            5 => 8,
            _ => 1,
        };
        directory.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        directory.extend((value.len() as u32 / unit).to_le_bytes());
        let mut field = value.clone();
        if value.len() > 4 {
            field = long(beyond as u32);
            values.extend_from_slice(value);
            values.resize(values.len().next_multiple_of(2), 0);
            beyond += value.len().next_multiple_of(2);
        }
        field.resize(4, 0);
        directory.extend(field);
    }
    let mut file = [b"II*\0".to_vec(), long(start as u32), data].concat();
    file.resize(start, 0);
    [file, directory, long(0), values].concat()
}

/// A channel of 20 x 10 with full ink in this rectangle.
fn channel(left: usize, top: usize, right: usize, bottom: usize, inverted: bool) -> Vec<u8> {
    (0..200)
        .map(|at| (left..=right).contains(&(at % 20)) && (top..=bottom).contains(&(at / 20)))
        .map(|ink| if ink != inverted { 255 } else { 0 })
        .collect()
}

#[test]
fn inks_named_by_the_ink_names_tag_are_layers() {
    let bench = Bench::new();
    let channels = [channel(1, 1, 18, 8, false), channel(5, 2, 9, 4, false)];
    let names = (333, 2, b"white\0Gold Foil\0".to_vec());
    let file = tiff_file((20, 10), &channels, 5, &[(332, 3, vec![2, 0]), names]);
    let art = read(&[bench.write("spots.tif", file)], &Options::default());
    let layers: Vec<_> = art.layers.iter().map(|layer| (layer.ink, extent(layer))).collect();
    assert_eq!(layers, [(Ink::White, (1, 1, 18, 8, 144)), (Ink::GoldFoil, (5, 2, 9, 4, 15))]);
}

#[test]
fn photoshops_spot_channels_are_layers_beside_the_process_plates() {
    let bench = Bench::new();
    let ink = |a, b, c, d| channel(a, b, c, d, false);
    let spot = |a, b, c, d| channel(a, b, c, d, true);
    let none = vec![0; 200];
    let channels =
        [none.clone(), ink(0, 0, 3, 3), none.clone(), ink(4, 4, 9, 9), spot(2, 2, 5, 5), spot(0, 0, 19, 0)];
    let unicode = |name: &str| {
        let units: Vec<u8> = name.encode_utf16().chain([0]).flat_map(u16::to_be_bytes).collect();
        [(units.len() as u32 / 2).to_be_bytes().to_vec(), units].concat()
    };
    let names = [unicode("white"), unicode("Dieline")].concat();
    let resource =
        [b"8BIM\x04\x15\0\0".to_vec(), (names.len() as u32).to_be_bytes().to_vec(), names].concat();
    let extra = (338, 3, vec![0, 0, 0, 0]);
    let file = tiff_file((20, 10), &channels, 5, &[extra.clone(), (34377, 1, resource)]);
    let art = read(&[bench.write("ps.tif", file)], &Options::default());
    let layers: Vec<_> = art.layers.iter().map(|layer| (layer.ink, extent(layer))).collect();
    assert_eq!(
        layers,
        [(Ink::Magenta, (0, 0, 3, 3, 16)), (Ink::Black, (4, 4, 9, 9, 36)), (Ink::White, (2, 2, 5, 5, 16))]
    );
    assert!(art.notes.iter().any(|note| note.contains("channel `Dieline` names no ink")), "{:?}", art.notes);
    let file = tiff_file((20, 10), &channels, 5, &[extra]);
    let text = refused(&[bench.write("noname.tif", file)]);
    assert!(text.contains("channel 5 of 6 has no name"), "{text}");
}

#[test]
fn plates_with_tones_keep_them() {
    let bench = Bench::new();
    let ramp: Vec<u8> = (0..200).map(|at| (at % 20 * 13) as u8).collect();
    let none = vec![0; 200];
    let file =
        tiff_file((20, 10), &[ramp.clone(), none.clone(), none.clone(), channel(3, 3, 6, 6, false)], 5, &[]);
    let art = read(&[bench.write("cmyk.tif", file)], &Options::default());
    assert_eq!(art.layers[0].shape, Shape::Tone(ramp));
    assert_eq!(art.layers.len(), 2, "blank plates are no layers");
    assert_eq!((art.layers[1].ink, extent(&art.layers[1])), (Ink::Black, (3, 3, 6, 6, 16)));
}

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
    for word in ["layer `guides` names no ink", "layer `silver` is hidden or empty"] {
        assert!(art.notes.iter().any(|note| note.contains(word)), "{word}: {:?}", art.notes);
    }
    let slip = svg.replace("guides", "finnish");
    assert!(refused(&[bench.write("slip.svg", slip)]).contains("did you mean `finish`?"));
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

fn ghostscript() -> bool {
    let found = needs::starts("gs");
    if !found {
        Need::Queue.skip("Ghostscript is not installed; `cargo xtask queue` installs it");
    }
    found
}

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
    for (ink, left, top, wide, high) in [
        (Ink::White, 100, 100, 800, 400),
        (Ink::GoldFoil, 200, 300, 300, 100),
        (Ink::Black, 700, 300, 100, 100),
    ] {
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

#[test]
fn sixteen_bits_and_grey_with_transparency_are_read_as_they_are() {
    let bench = Bench::new();
    let big = |values: &[u16]| values.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
    let sixteen = png::BitDepth::Sixteen;
    // A layer: half black is the limit, to the last bit of 8.
    let data = big(&[0, 0x7fff, 0x8000, 0xffff]);
    let file = bench.png("white.png", (4, 1), png::ColorType::Grayscale, sixteen, &data, |_| ());
    assert_eq!(extent(&read(&[file], &Options::default()).layers[0]), (0, 0, 1, 0, 2));
    // A picture: 225,160,0 and half of it on nothing.
    let data = big(&[0xe1e1, 0xa0a0, 0, 0xffff, 0, 0, 0, 0]);
    let file = bench.png("art.png", (2, 1), png::ColorType::Rgba, sixteen, &data, |_| ());
    let art = read(&[file], &Options { reserved: true, ..Options::default() });
    assert_eq!((art.layers[0].ink, extent(&art.layers[0])), (Ink::MetallicGold, (0, 0, 0, 0, 1)));
    assert_eq!(art.opaque.map(|plane| plane.dots()), Some(1));
    let file = bench.png(
        "black.png",
        (3, 1),
        png::ColorType::GrayscaleAlpha,
        png::BitDepth::Eight,
        &[0, 255, 0, 0, 255, 0],
        |_| (),
    );
    assert_eq!(extent(&read(&[file], &Options::default()).layers[0]), (0, 0, 0, 0, 1));
}

/// A picture of one colour with a profile, and the colour it is read as.
fn with_profile(profile: &moxcms::ColorProfile, kind: png::ColorType, pixel: &[u8]) -> [u8; 3] {
    let bench = Bench::new();
    let mut info = png::Info::with_size(4, 1);
    info.color_type = kind;
    info.icc_profile = Some(profile.encode().unwrap().into());
    info.pixel_dims = Some(png::PixelDimensions { xppu: 11_811, yppu: 11_811, unit: png::Unit::Meter });
    let file = bench.path("photo.png");
    let encoder = png::Encoder::with_info(fs::File::create(&file).unwrap(), info).unwrap();
    encoder.write_header().unwrap().write_image_data(&pixel.repeat(4)).unwrap();
    let art = read(&[file], &Options::default());
    assert!(art.notes.iter().any(|note| note.contains("profile was applied")), "{:?}", art.notes);
    art.colour.unwrap().rgb[..3].try_into().unwrap()
}

#[test]
fn profiles_of_colour_and_grey_pictures_are_honoured() {
    // Display P3 to sRGB through XYZ, written out: linear light, the two matrices, sRGB's curve for both.
    let decode = |v: f64| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    let code = |v: f64| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    // The product of CSS Color 4's matrices from linear Display P3 to linear sRGB.
    let matrix = [[1.2249, -0.2247, 0.0], [-0.0420, 1.0419, 0.0], [-0.0197, -0.0786, 1.0979]];
    let p3 = [180u8, 120, 60];
    let light = p3.map(|v| decode(f64::from(v) / 255.0));
    let found = with_profile(&moxcms::ColorProfile::new_display_p3(), png::ColorType::Rgb, &p3);
    for (row, found) in matrix.iter().zip(found) {
        let wanted = 255.0 * code(row.iter().zip(light).map(|(m, v)| m * v).sum::<f64>());
        assert!((wanted - f64::from(found)).abs() < 1.5, "{found}, not {wanted}");
    }
    // Grey of gamma 1.0 is light itself.
    let linear = moxcms::ColorProfile::new_gray_with_gamma(1.0);
    let found = with_profile(&linear, png::ColorType::Grayscale, &[64]);
    let wanted = 255.0 * code(64.0 / 255.0);
    assert!(found.iter().all(|&v| (f64::from(v) - wanted).abs() < 1.5), "{found:?}, not {wanted}");
}

#[test]
fn damaged_files_are_errors_that_name_the_file() {
    let bench = Bench::new();
    let good = fs::read(bench.grey("good.png", (40, 30), &[7; 1200])).unwrap();
    let (cmyk, none) =
        (tiff_file((20, 10), &[vec![9; 200], vec![9; 200], vec![9; 200], vec![9; 200]], 5, &[]), Vec::new());
    let svg = b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"><g id=\"white\"><rect"
        .to_vec();
    for (name, bytes) in [
        ("white.png", good[..good.len() / 2].to_vec()),
        ("gold.png", good[..20].to_vec()),
        ("photo.png", good[..60].to_vec()),
        ("plates.tif", cmyk[..300].to_vec()),
        ("cut.tif", cmyk[..cmyk.len() - 30].to_vec()),
        ("cut.svg", svg),
        ("empty.png", none),
        ("text.png", b"hello".to_vec()),
    ] {
        let text = refused(&[bench.write(name, bytes)]);
        assert!(text.contains(name), "{name}: {text}");
    }
    assert!(refused(&[bench.path("nowhere.png")]).contains("cannot open it"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn no_bytes_panic(kind in 0usize..4, at in 0usize..400, value: u8, cut in 0usize..500) {
        let bench = Bench::new();
        let mut bytes = match kind {
            0 => fs::read(bench.grey("a.png", (20, 10), &[7; 200])).unwrap(),
            1 => tiff_file((20, 10), &[channel(1, 1, 3, 3, false), vec![0; 200]], 5,
                &[(332, 3, vec![2, 0]), (333, 2, b"white\0gold\0".to_vec())]),
            2 => tiff_file((20, 10), &vec![vec![9; 200]; 5], 5, &[(338, 3, vec![0, 0]),
                (34377, 1, b"8BIM\x03\xee\0\0\0\0\0\x06\x05white".to_vec())]),
            _ => b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"><g id=\"white\"><rect width=\"2\" height=\"2\"/></g></svg>".to_vec(),
        };
        let length = bytes.len();
        bytes[at % length] = value;
        bytes.truncate(length - cut.min(length) / 4);
        let path = bench.write(["white.png", "a.tif", "b.tif", "c.svg"][kind], bytes);
        let _ = open(&[path], &Options { dpi: Some(600.0), ..Options::default() }, &Silent);
    }
}
