//! OpenRaster and Krita files.

use std::io::{Cursor, Write as _};

use image::{Rgba, RgbaImage};
use zip::write::SimpleFileOptions;

use super::*;

/// An archive of these entries, as the programs write it: the kind first and stored.
pub(super) fn archive(kind: &str, entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    zip.start_file("mimetype", stored).unwrap();
    zip.write_all(kind.as_bytes()).unwrap();
    for (name, bytes) in entries {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// A PNG of one colour.
pub(super) fn plain(width: u32, height: u32, colour: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = RgbaImage::from_pixel(width, height, Rgba(colour));
    picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

const WHITE: [u8; 4] = [255; 4];
const YELLOW: [u8; 4] = [225, 160, 0, 255];

/// An OpenRaster file of 60 x 40 pixels at 600 dpi with these layers.
fn ora(layers: &str) -> Vec<u8> {
    let list = format!(
        "<?xml version='1.0'?><image version='0.0.3' w='60' h='40' xres='600' yres='600'><stack>{layers}</stack></image>"
    );
    archive(
        "image/openraster",
        &[
            ("data/a.png", plain(20, 10, WHITE)),
            ("data/b.png", plain(30, 5, YELLOW)),
            ("mergedimage.png", plain(60, 40, [9, 9, 9, 255])),
            (STACK, list.into_bytes()),
        ],
    )
}

const STACK: &str = "stack.xml";

fn of(bench: &Bench, layers: &str, options: &Options) -> Artwork {
    read(&[bench.write("art.ora", ora(layers))], options)
}

fn noted(art: &Artwork, words: &str) -> bool {
    art.notes.iter().any(|note| note.contains(words))
}

#[test]
fn layers_named_after_inks_lie_at_their_offsets() {
    let bench = Bench::new();
    let art = of(
        &bench,
        "<layer name='Gold' src='data/b.png' x='15' y='30' opacity='1.0' visibility='visible'/>\
         <layer name='sketch' src='data/b.png'/><layer name='notes' src='data/b.png' visibility='hidden'/>\
         <layer name='White' src='data/a.png' x='-5' y='2'/>",
        &Options::default(),
    );
    assert_eq!((art.width, art.length), (60, 40));
    let found: Vec<_> = art.layers.iter().map(|layer| (layer.ink, extent(layer))).collect();
    assert_eq!(
        found,
        [(Ink::White, (0, 2, 14, 11, 150)), (Ink::MetallicGold, (15, 30, 44, 34, 150))],
        "from the bottom up, cut at the canvas"
    );
    assert!(
        noted(&art, "left out, because it lies in no layer of an ink: layer `sketch`"),
        "{:?}",
        art.notes
    );
    assert!(!noted(&art, "notes"));
}

#[test]
fn groups_opacity_and_visibility_are_those_of_layers_of_ink() {
    let bench = Bench::new();
    let group = "<stack name='White' opacity='.5'><layer src='data/a.png' x='0' y='0' name='top'/><layer name='hidden' src='data/b.png' \
        visibility='hidden' y='20'/><layer src='data/a.png' x='30' y='20'/></stack>\
        <layer name='Gold' src='data/a.png' visibility='hidden'/>";
    let art = of(&bench, group, &Options::default());
    assert_eq!(art.layers.iter().map(extent).collect::<Vec<_>>(), [(0, 0, 49, 29, 400)], "{:?}", art.notes);
    for words in ["layer `White` is shown at 50 % opacity", "layer `Gold` is hidden: left out"] {
        assert!(noted(&art, words), "{words}: {:?}", art.notes);
    }
    let toned = Options { tones: ::inks::InkSet::of([Ink::White]), ..Options::default() };
    let art = of(&bench, group, &toned);
    let Shape::Tone(tones) = &art.layers[0].shape else { panic!("tones are lost") };
    assert_eq!((tones[0], tones.iter().max()), (128, Some(&128)));
    // Where no layer is an ink's, or all of them are hidden, the whole is a picture.
    for (layers, words) in [
        ("<layer name='sketch' src='data/a.png'/>", None),
        (
            "<layer name='Gold' src='data/a.png' visibility='hidden'/>",
            Some("all layers named after inks are hidden"),
        ),
        ("<layer name='golld' src='data/a.png'/>", Some("did you mean `gold`?")),
    ] {
        let art = of(&bench, layers, &Options::default());
        assert_eq!((art.drawn.dots(), art.layers.len()), (2400, 0), "{layers}");
        assert!(words.is_none_or(|words| noted(&art, words)), "{layers}: {:?}", art.notes);
    }
    let slip = bench.write(
        "slip.ora",
        ora("<layer name='White' src='data/a.png'/><layer name='golld' src='data/a.png'/>"),
    );
    assert!(refused(&[slip]).contains("layer `golld` names no ink (did you mean `gold`?)"));
}

#[test]
fn of_krita_the_merged_picture_is_read_and_its_layers_are_named() {
    let bench = Bench::new();
    let list = "<?xml version='1.0'?><!DOCTYPE DOC PUBLIC '-//KDE//DTD krita 2.0//EN' 'http://www.calligra.org/DTD/krita-2.0.dtd'>\
        <DOC xmlns='http://www.calligra.org/DTD/krita'><IMAGE width='60' height='40' x-res='300' y-res='300' name='a'>\
        <layers><layer name='White' nodetype='paintlayer' filename='layer2'/><layer name='Background'/></layers></IMAGE></DOC>";
    let kra = archive(
        "application/x-krita",
        &[
            ("maindoc.xml", list.into()),
            ("mergedimage.png", plain(60, 40, YELLOW)),
            ("a/layers/layer2", vec![1, 2, 3]),
        ],
    );
    let art = read(&[bench.write("art.kra", kra)], &Options::default());
    assert_eq!((art.width, art.length, art.drawn.dots()), (120, 80, 9600));
    assert!(noted(&art, "not its layers `White`; save a copy as OpenRaster (.ora)"), "{:?}", art.notes);
}

#[test]
fn hostile_archives_end_in_an_error_soon() {
    let bench = Bench::new();
    let soon = |bytes: Vec<u8>| {
        let begun = std::time::Instant::now();
        let said = refused(&[bench.write("art.ora", bytes)]);
        assert!(begun.elapsed().as_secs() < 5, "{said}");
        said
    };
    let layer = "<layer name='White' src='data/a.png'/>";
    let list =
        |image: &str, layers: &str| format!("<image {image}><stack>{layers}</stack></image>").into_bytes();
    let with = |list: Vec<u8>, picture: Vec<u8>| {
        archive("image/openraster", &[(STACK, list), ("data/a.png", picture)])
    };
    let size = "w='60' h='40'";
    // Zeros pack a thousand to one.
    let bomb = with(list(size, layer), vec![0; (1 << 28) + 2]);
    assert!(bomb.len() < 1 << 20);
    assert!(soon(bomb).contains("`data/a.png` expands to more than 256 MB"));
    let bomb = with([list(size, layer), vec![b' '; 1 << 23]].concat(), plain(9, 9, WHITE));
    assert!(soon(bomb).contains("`stack.xml` expands to more than 4 MB"));
    let said = soon(with(list("w='99999' h='99999'", layer), plain(9, 9, WHITE)));
    assert!(said.contains("its canvas is 99999 x 99999 pixels"), "{said}");
    let mut huge = Vec::new();
    let mut writer = png::Encoder::new(&mut huge, 60_000, 60_000).write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]).unwrap();
    drop(writer);
    assert!(soon(with(list(size, layer), huge)).contains("its layer `White` is 60000 x 60000 pixels"));
    let deep = format!("{}{layer}{}", "<stack>".repeat(200), "</stack>".repeat(200));
    assert!(soon(with(list(size, &deep), plain(9, 9, WHITE))).contains("groups 64 deep"));
    assert!(soon(with(list(size, &layer.repeat(2000)), plain(9, 9, WHITE))).contains("more than 256 layers"));
    assert!(
        soon(with(list(size, &layer.replace("a.png", "../x")), plain(9, 9, WHITE)))
            .contains("cannot be read")
    );
    let whole = ora(layer);
    for end in [40, whole.len() / 2, whole.len() - 1] {
        soon(whole[..end].to_vec());
    }
}
