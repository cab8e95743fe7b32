//! Separated TIFF files.

use super::*;

/// A TIFF of 8-bit channels, interleaved, with these tags beside the necessary ones.
pub(super) fn tiff_file(
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
pub(super) fn channel(left: usize, top: usize, right: usize, bottom: usize, inverted: bool) -> Vec<u8> {
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
    assert!(
        art.notes.iter().any(|note| note.contains("channel `Dieline` is for a cutter")),
        "{:?}",
        art.notes
    );
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

/// One tint in a plate, and its letters were torn.
#[test]
fn softened_letters_in_a_plate_with_tones_keep_their_edges() {
    let bench = Bench::new();
    let (width, length) = (80usize, 50usize);
    // A disc and a bar with the share of each pixel that lies in them, beside a ramp.
    let disc = |x: f64, y: f64| (x - 20.3).hypot(y - 25.4) < 9.2 || (34.3..37.6).contains(&x);
    let share = |x: usize, y: usize| {
        let parts = (0..64)
            .filter(|part| disc(x as f64 + f64::from(part % 8) / 8.0, y as f64 + f64::from(part / 8) / 8.0));
        (parts.count() * 255 / 64) as u8
    };
    let plate: Vec<u8> = (0..width * length)
        .map(|at| match (at % width, at / width) {
            (x @ 48.., 10..40) => (x - 40) as u8 * 5,
            (x, y) => share(x, y),
        })
        .collect();
    let none = vec![0; width * length];
    let channels = [none.clone(), none.clone(), none, plate.clone()];
    let file = tiff_file((width as u32, length as u32), &channels, 5, &[]);
    let art = read(&[bench.write("cmyk.tif", file)], &Options::default());
    let Shape::Tone(tones) = &art.layers[0].shape else { panic!("no tones") };
    for (at, &tone) in tones.iter().enumerate() {
        if at % width >= 48 {
            assert_eq!(tone, plate[at]);
        } else {
            // What is nearly ink or nearly paper may stay a tone.
            let wanted = if plate[at] >= 128 { 255 } else { 0 };
            let is_faint = tone == plate[at] && tone.abs_diff(wanted) <= 12;
            let may_be_either = plate[at].abs_diff(128) < 64 && [0, 255].contains(&tone);
            assert!(tone == wanted || is_faint || may_be_either, "{at}: {tone}");
        }
    }
}

#[test]
fn tints_of_a_spot_colour_are_printed_and_softened_edges_of_a_solid_one_are_cut() {
    let bench = Bench::new();
    let names = (333, 2, b"white\0".to_vec());
    let read_as = |coverage: Vec<u8>| {
        let file = tiff_file((20, 10), &[coverage], 5, &[(332, 3, vec![2, 0]), names.clone()]);
        read(&[bench.write("spot.tif", file)], &Options::default())
    };
    // A tint of a third beside a solid.
    let tint: Vec<u8> = (0..200).map(|at| if at % 20 < 12 { 255 } else { 85 }).collect();
    let art = read_as(tint.clone());
    assert_eq!(art.layers[0].shape, Shape::Tone(tint));
    assert!(!art.notes.iter().any(|note| note.contains("left out")), "{:?}", art.notes);
    // A disc with edges as programs soften them: by the share of each pixel that lies in it, in parts of an eighth.
    let inside = |x: f64, y: f64| (x - 10.0).hypot(y - 5.0) < 4.3;
    let parts = |at: usize| {
        (0..64).map(move |part| {
            ((at % 20) as f64 + f64::from(part % 8) / 8.0, (at / 20) as f64 + f64::from(part / 8) / 8.0)
        })
    };
    let disc: Vec<u8> =
        (0..200).map(|at| (parts(at).filter(|&(x, y)| inside(x, y)).count() * 255 / 64) as u8).collect();
    let wanted = disc.iter().filter(|&&cover| cover >= 128).count();
    let art = read_as(disc);
    assert!(matches!(art.layers[0].shape, Shape::Solid(_)), "{:?}", art.notes);
    assert_eq!(extent(&art.layers[0]).4 as usize, wanted);
}

/// A file's Photoshop resource with the names of its extra channels.
fn photoshop(names: &[&str]) -> (u16, u16, Vec<u8>) {
    let mut names: Vec<u8> =
        names.iter().flat_map(|name| [&[name.len() as u8], name.as_bytes()].concat()).collect();
    let size = (names.len() as u32).to_be_bytes();
    names.resize(names.len().next_multiple_of(2), 0);
    (34377, 1, [b"8BIM\x03\xee\0\0".to_vec(), size.to_vec(), names].concat())
}

#[test]
fn a_spot_channel_lies_under_a_picture_in_rgb_as_it_does_under_plates() {
    let bench = Bench::new();
    // Black in a corner, on white that covers the paper but for its last column.
    let (black, white) = (channel(0, 0, 4, 4, true), channel(0, 0, 18, 9, true));
    let files = [
        ("rgb.tif", vec![black.clone(), black.clone(), black, white.clone()], 2, vec![0, 0]),
        (
            "cmyk.tif",
            [vec![vec![0; 200]; 3], vec![channel(0, 0, 4, 4, false), white]].concat(),
            5,
            vec![0, 0],
        ),
    ];
    for (name, channels, photometric, extra) in files {
        let tags = [(338, 3, extra), photoshop(&["White"])];
        let file = bench.write(name, tiff_file((20, 10), &channels, photometric, &tags));
        let art = read(&[file], &Options::default());
        let composed = compose(&art, &Settings::default(), &inks::Library::builtin(), &Silent).unwrap();
        let mut laid: Vec<_> = composed.report.laid.iter().map(|laid| (laid.ink, laid.dots)).collect();
        laid.sort_unstable();
        // Paper that is white in the picture gets no ink of it.
        assert_eq!(laid, [("black", 25), ("white", 190)], "{name}");
    }
}

#[test]
fn opacity_beside_plates_is_transparency_and_no_ink() {
    let bench = Bench::new();
    let none = vec![0; 200];
    let all = channel(0, 0, 19, 9, false);
    let opaque = channel(0, 0, 9, 9, false);
    let plates = |extra: &[Vec<u8>]| {
        [vec![none.clone(), none.clone(), none.clone(), all.clone()], extra.to_vec()].concat()
    };
    let kinds = |kinds: &[u16]| (338, 3, kinds.iter().flat_map(|kind| kind.to_le_bytes()).collect());
    let spot = channel(15, 0, 19, 9, true);
    for (name, channels, tags, white) in [
        ("alone.tif", plates(std::slice::from_ref(&opaque)), vec![kinds(&[2])], None),
        // Photoshop lists it among the names, or not.
        (
            "unlisted.tif",
            plates(&[opaque.clone(), spot.clone()]),
            vec![kinds(&[2, 0]), photoshop(&["White"])],
            Some(50),
        ),
        (
            "listed.tif",
            plates(&[opaque.clone(), spot]),
            vec![kinds(&[2, 0]), photoshop(&["Alpha 1", "White"])],
            Some(50),
        ),
    ] {
        let art = read(&[bench.write(name, tiff_file((20, 10), &channels, 5, &tags))], &Options::default());
        let inked = |ink: Ink| art.layers.iter().find(|layer| layer.ink == ink).map(|layer| extent(layer).4);
        assert_eq!((inked(Ink::Black), inked(Ink::White)), (Some(100), white), "{name}");
        assert_eq!(art.opaque.as_ref().map(|plane| plane.dots()), Some(100), "{name}");
    }
    // Multiplied before, the plates are as they are; and RGB is read in the same way beside a spot channel.
    let channels = [vec![none.clone(); 3], vec![opaque.clone(), opaque.clone()]].concat();
    let art = read(
        &[bench.write("times.tif", tiff_file((20, 10), &channels, 5, &[kinds(&[1])]))],
        &Options::default(),
    );
    assert_eq!((art.layers.len(), extent(&art.layers[0]).4), (1, 100));
    let channels = [vec![none.clone(); 3], vec![opaque, channel(0, 0, 19, 0, true)]].concat();
    let tags = [kinds(&[2, 0]), photoshop(&["White"])];
    let art = read(&[bench.write("rgb.tif", tiff_file((20, 10), &channels, 2, &tags))], &Options::default());
    assert_eq!(art.opaque.as_ref().map(|plane| plane.dots()), Some(100));
    let composed = compose(&art, &Settings::default(), &inks::Library::builtin(), &Silent).unwrap();
    let mut laid: Vec<_> = composed.report.laid.iter().map(|laid| (laid.ink, laid.dots)).collect();
    laid.sort_unstable();
    assert_eq!(laid, [("black", 100), ("white", 20)]);
}
