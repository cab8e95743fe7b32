//! Pictures: layers by name, colour, transparency, profiles.

use super::*;
use proptest::prelude::*;

proptest! {
    #![proptest_config(testing::cases(24))]
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
                prop_assert_eq!(bitplane::at(plane, x, y), ink, "{} at ({}, {})", layer.name, x, y);
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
fn files_are_named_after_inks_and_slips_are_understood() {
    let bench = Bench::new();
    let save = |name: &str| bench.grey(name, (2, 1), &[0, 255]);
    let files = [save("02-black.png"), save("01-white.png"), save("3 Gold Foil.png")];
    let art = read(&files, &Options::default());
    let named: Vec<_> = art.layers.iter().map(|layer| (layer.ink, layer.place)).collect();
    assert_eq!(named, [(Ink::Black, Some(2)), (Ink::White, Some(1)), (Ink::GoldFoil, Some(3))]);
    let text = refused(&[save("white.png"), save("golld.png")]);
    assert!(
        text.contains("file `golld` names no ink (did you mean `gold`?); name each file after its ink"),
        "{text}"
    );
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
    assert!(art.notes.iter().any(|note| note.contains("rename the file to white.png")), "{:?}", art.notes);
    let layer = read(&[bench.grey("black.png", (2, 1), &[0, 255])], &Options::default());
    assert!(layer.colour.is_none() && layer.layers.len() == 1);
    // A part of a name is an ink where the picture is one, and no more: a yellow folder has many colours.
    let saved = |name: &str, at: &dyn Fn(u8) -> [u8; 3]| {
        let pixels = (0..64u8).flat_map(at).collect();
        image::RgbImage::from_raw(8, 8, pixels).unwrap().save(bench.path(name)).unwrap();
        read(&[bench.path(name)], &Options { dpi: Some(600.0), ..Options::default() })
    };
    let logo = saved("logo-yellow.png", &|at| if at % 3 == 0 { [255; 3] } else { [220, 170, 0] });
    assert!(logo.colour.is_none() && logo.layers.len() == 1);
    let shaded = |at: u8| [255 - at, 200 - 2 * at, 20];
    let folder = saved("folder-yellow.png", &shaded);
    assert!(folder.layers.is_empty() && folder.colour.is_some());
    assert!(
        folder.notes.iter().any(|note| note.contains("rename the file to yellow.png")),
        "{:?}",
        folder.notes
    );
    let plate = saved("yellow.png", &shaded);
    assert!(plate.colour.is_none() && plate.layers.len() == 1);
    // Who named it may have meant a picture.
    let named = |art: &Artwork| art.notes.iter().any(|note| note.contains("because of its name; rename it"));
    assert!(named(&logo) && named(&plate) && !named(&layer) && !named(&folder));
    // A number that is no place is a part of the name.
    let year = saved("2024 white.png", &shaded);
    assert!(year.layers.is_empty() && year.colour.is_some(), "{:?}", year.notes);
}

#[test]
fn a_grey_photograph_is_no_layer_though_a_part_of_its_name_is_an_ink() {
    let bench = Bench::new();
    let size = (64, 64);
    let saved = |name: &str, at: &dyn Fn(usize, usize) -> u8| {
        let greys: Vec<u8> = (0..64 * 64).map(|i| at(i % 64, i / 64)).collect();
        bench.grey(name, size, &greys)
    };
    let usual = Options::default();
    // Greys of all depths; the note says how to print it as a layer.
    let photograph = |x: usize, y: usize| (40 + 2 * x + y) as u8;
    let scan = read(&[saved("scan-yellow.png", &photograph)], &usual);
    assert!(scan.layers.is_empty() && scan.colour.is_some());
    assert!(
        scan.notes.iter().any(|note| note.contains("many tones")
            && note.contains("only a part of its name")
            && note.contains("rename the file to yellow.png")),
        "{:?}",
        scan.notes
    );
    // Somebody asked for its tones, gave it the name of the ink, or gave several plates.
    let toned = Options { tones: inks::InkSet::of([Ink::Yellow]), ..Options::default() };
    let asked = read(&[saved("scan-yellow.png", &photograph)], &toned);
    assert!(matches!(asked.layers[..], [Layer { ink: Ink::Yellow, shape: Shape::Tone(_), .. }]));
    assert_eq!(read(&[saved("yellow.png", &photograph)], &usual).layers.len(), 1);
    let plates = [saved("scan-yellow.png", &photograph), saved("scan-cyan.png", &photograph)];
    assert_eq!(read(&plates, &usual).layers.len(), 2);
    // One grey, and black with edges five pixels wide.
    let flat = |x: usize, y: usize| if x % 32 < 24 && y < 50 { 128u8 } else { 255 };
    let soft = |x: usize, _: usize| [0u8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 60, 110, 160, 210, 250, 255][x % 16];
    for (name, at) in [("logo-white.png", &flat as &dyn Fn(usize, usize) -> u8), ("logo-gold.png", &soft)] {
        let art = read(&[saved(name, at)], &usual);
        assert_eq!(art.layers.len(), 1, "{name}: {:?}", art.notes);
        assert!(art.notes.iter().any(|note| note.contains("because of its name; rename it")), "{name}");
    }
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

/// A soft shadow had white beneath all of it, and black line art a white rim.
#[test]
fn white_goes_beneath_what_is_at_least_half_opaque() {
    let bench = Bench::new();
    let pixels: Vec<u8> = [0, 1, 127, 128, 255].iter().flat_map(|&alpha| [30, 30, 30, alpha]).collect();
    let (kind, depth) = (png::ColorType::Rgba, png::BitDepth::Eight);
    let file = bench.png("shadow.png", (5, 1), kind, depth, &pixels, |_| ());
    let opaque = read(&[file], &Options { dpi: Some(600.0), ..Options::default() }).opaque.unwrap();
    assert_eq!((opaque.dots(), opaque.bits[0]), (2, 0b0001_1000));
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
    packed::colour(art.colour.unwrap().keys((art.width, art.length))[0])
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
