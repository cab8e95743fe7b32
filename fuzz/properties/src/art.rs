//! Art by the readers of the program's own: OpenRaster and Krita files, TIFF, drawings, and the names of inks.
//!
//! Whatever the bytes, a reader ends with art or with an error in words. Art lies within the room it was given, its planes are
//! as large as it says, and reading it twice gives the same dots. PDF and PostScript are left to Ghostscript, and are none of this.
//! The seeds are made by [`seeds`]: small files as programs write them, of all that the readers tell apart.

use std::io::{Cursor, Write as _};

use art::{Artwork, Options, Room, Settings};
use observe::Silent;
use zip::write::SimpleFileOptions;

/// The endings by which readers are chosen; the first byte of an input takes one, and one more stands for a name.
const KINDS: [&str; 4] = ["ora", "kra", "tif", "svg"];

/// Small, so that many inputs are tried.
const ROOM: Room = Room { width: 480, length: 360, cut: false };

/// The renderer of drawings may fail on hostile ones, which its reader tells as an error: that is no finding.
fn as_in_the_program() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if std::thread::current().name() != Some(art::DRAWING) {
                usual(panic);
            }
        }));
    });
}

/// Holds of any bytes: one that chooses the reader, then a file or a name.
pub fn check(bytes: &[u8]) {
    as_in_the_program();
    let Some((&kind, bytes)) = bytes.split_first() else { return };
    // Another program would read these.
    if [&b"%PDF"[..], b"%!"].iter().any(|mark| bytes.windows(mark.len()).any(|window| window == *mark)) {
        return;
    }
    match KINDS.get(usize::from(kind) % (KINDS.len() + 1)) {
        Some(ending) => file(ending, bytes),
        None => name(&String::from_utf8_lossy(bytes)),
    }
}

fn file(ending: &str, bytes: &[u8]) {
    let Ok(folder) = tempfile::tempdir() else { return };
    let path = folder.path().join(format!("art.{ending}"));
    if std::fs::write(&path, bytes).is_err() {
        return;
    }
    let options = Options { room: ROOM, cut_lines: true, ..Options::default() };
    let read = || art::open(std::slice::from_ref(&path), &options, &Silent);
    match (read(), read()) {
        (Ok(art), Ok(again)) => {
            holds(&art);
            assert!(art.drawn.bits == again.drawn.bits, "the same bytes give other dots");
        }
        (Err(error), Err(_)) => assert!(!error.to_string().is_empty(), "an error says what is wrong"),
        _ => panic!("the same bytes are art once and none another time"),
    }
}

fn holds(art: &Artwork) {
    let (width, length) = protocol::paper::LARGEST;
    assert!((1..=usize::from(width)).contains(&art.width) && (1..=usize::from(length)).contains(&art.length));
    assert_eq!((art.drawn.width, art.drawn.length), (art.width, art.length));
    if art.drawn.dots() == 0 {
        let composed = art::compose(art, &Settings::default(), &inks::Library::builtin(), &Silent);
        let error = composed.expect_err("art without a dot is an error").to_string();
        assert!(error.contains("nothing to print"), "{error}");
    }
    assert!(art.notes.iter().all(|note| !note.is_empty()));
    assert!(!art.name.chars().any(char::is_control));
}

/// What is read of names holds of all of them.
fn name(text: &str) {
    if let Ok(ink) = art::names::typed(text) {
        assert_eq!(inks::names::ink(ink.name()), Some(ink));
    }
    if let Ok((ink, _)) = art::names::colour(text) {
        assert!(text.contains('=') && inks::names::ink(ink.short()) == Some(ink));
    }
    for line in text.lines() {
        let _ = line.parse::<inks::InkSet>();
    }
    if let Ok(list) = inks::own::read(text) {
        let written = inks::own::write(&list).expect("a list that was read");
        assert_eq!(inks::own::read(&written).as_ref(), Ok(&list), "{text:?}");
    }
}

/// Inputs to begin with, by name.
pub fn seeds() -> Vec<(String, Vec<u8>)> {
    let mut seeds = Vec::new();
    let mut add = |kind: u8, name: &str, bytes: &[u8]| {
        seeds.push((name.to_owned(), [&[kind], bytes].concat()));
    };
    let picture = png(16, 8, [225, 160, 0]);
    let layers = "<stack><layer name='white' src='data/a.png' x='2' y='-1' opacity='0.9'/>\
                  <layer name='CutContour' src='data/a.png'/><layer name='gold' src='data/a.png' visibility='hidden'/></stack>";
    let list = format!("<image w='20' h='12' xres='600' yres='600'>{layers}</image>");
    add(
        0,
        "layers-ora",
        &archive("image/openraster", &[("stack.xml", list.as_bytes()), ("data/a.png", &picture)]),
    );
    let about = "<DOC><IMAGE width='16' height='8' x-res='600' y-res='600' name='art'/></DOC>";
    add(
        1,
        "merged-kra",
        &archive("application/x-krita", &[("maindoc.xml", about.as_bytes()), ("mergedimage.png", &picture)]),
    );
    for (name, photometric, samples, bits, extra, compression) in [
        ("grey-tif", 1, 1, 8, None, 1),
        ("white-is-zero-bits-tif", 0, 1, 1, None, 1),
        ("rgb-alpha-tif", 2, 4, 8, Some(2), 1),
        ("rgb-unspecified-tif", 2, 4, 8, Some(0), 1),
        ("cmyk-spot-tif", 5, 5, 8, Some(0), 1),
        ("palette-tif", 3, 1, 8, None, 1),
        ("lab-tif", 8, 3, 8, None, 1),
        ("fax-tif", 0, 1, 1, None, 4),
        ("zstd-tif", 1, 1, 8, None, 50_000),
        ("packbits-tif", 1, 1, 8, None, 32_773),
    ] {
        add(2, name, &tiff(photometric, samples, bits, extra, compression));
    }
    for (name, sides, inside) in [
        (
            "layers-svg",
            "width='4mm' height='3mm'",
            "<g id='white'><rect width='9' height='9'/></g><g id='Cut'><path d='M0 0h9'/></g>",
        ),
        (
            "percent-svg",
            "width='100%' height='100%' viewBox='0 0 70 35'",
            "<g serif:id='gold' id='gold1'><circle r='9'/></g>",
        ),
        (
            "units-svg",
            "viewBox='0 0 20 20'",
            "<linearGradient id='a'><stop stop-color='red'/></linearGradient><rect width='9' height='9' fill='url(#a)'/>",
        ),
        (
            "pattern-svg",
            "width='9px' height='9px'",
            "<pattern id='p' width='2' height='2' patternUnits='userSpaceOnUse'><path d='M0 0h1v1z'/></pattern><clipPath id='c'><g><rect width='5' height='5'/></g></clipPath><g clip-path='url(#c)'><rect width='9' height='9' fill='url(#p)'/></g>",
        ),
    ] {
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' xmlns:serif='http://www.serif.com/' {sides}>{inside}</svg>"
        );
        add(3, name, text.as_bytes());
    }
    for (name, text) in [
        ("colour-name", "#ff0000=gold"),
        ("japanese-name", "特色白版"),
        ("set-name", "process,-black,+silver foil"),
        ("own-name", "[[ink]]\nname = 'neon-pink'\ncolour = '#ff40a0'\nposes_as = 'metallic-red'\n"),
    ] {
        add(4, name, text.as_bytes());
    }
    seeds
}

fn archive(kind: &str, entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in std::iter::once(("mimetype", kind.as_bytes())).chain(entries.iter().copied()) {
        // The kind is stored, by which it is known.
        let method = if name == "mimetype" {
            zip::CompressionMethod::Stored
        } else {
            zip::CompressionMethod::Deflated
        };
        let options = SimpleFileOptions::default().compression_method(method);
        let written = zip.start_file(name, options).map(|()| zip.write_all(bytes));
        assert!(matches!(written, Ok(Ok(()))), "memory takes every byte");
    }
    zip.finish().expect("memory takes every byte").into_inner()
}

fn png(width: u32, height: u32, colour: [u8; 3]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("memory takes every byte");
    writer.write_image_data(&colour.repeat((width * height) as usize)).expect("as many bytes as pixels");
    drop(writer);
    bytes
}

/// A TIFF of 16 x 8 pixels at 600 dpi in one strip. What is packed is noise: the reader has to tell.
fn tiff(photometric: u32, samples: u32, bits: u32, extra: Option<u32>, compression: u32) -> Vec<u8> {
    const SHORT: u16 = 3;
    const LONG: u16 = 4;
    const RATIONAL: u16 = 5;
    let row = (16 * samples * bits).div_ceil(8);
    let pixels: Vec<u8> = (0..row * 8).map(|i| if i % 3 == 0 { 0 } else { 200 }).collect();
    let mut more = Vec::new();
    let mut fields: Vec<(u16, u16, u32, u32)> = Vec::new();
    // Behind the header, the pixels; the directory comes last.
    let begin = 8 + pixels.len() as u32;
    let mut apart = |values: &[u32], wide: bool| {
        let at = begin + more.len() as u32;
        for value in values {
            let bytes = value.to_le_bytes();
            more.extend_from_slice(if wide { &bytes } else { &bytes[..2] });
        }
        at
    };
    fields.push((256, SHORT, 1, 16));
    fields.push((257, SHORT, 1, 8));
    fields.push(match samples {
        1 => (258, SHORT, 1, bits),
        2 => (258, SHORT, 2, bits << 16 | bits),
        _ => (258, SHORT, samples, apart(&vec![bits; samples as usize], false)),
    });
    fields.push((259, SHORT, 1, compression));
    fields.push((262, SHORT, 1, photometric));
    fields.push((273, LONG, 1, 8));
    fields.push((277, SHORT, 1, samples));
    fields.push((278, SHORT, 1, 8));
    fields.push((279, LONG, 1, pixels.len() as u32));
    let resolution = apart(&[600, 1], true);
    fields.push((282, RATIONAL, 1, resolution));
    fields.push((283, RATIONAL, 1, resolution));
    fields.push((296, SHORT, 1, 2));
    if photometric == 3 {
        fields.push((320, SHORT, 768, apart(&(0..768).map(|i| i * 85).collect::<Vec<_>>(), false)));
    }
    if let Some(extra) = extra {
        fields.push((338, SHORT, 1, extra));
    }
    let directory = begin + more.len() as u32;
    let mut file = b"II*\0".to_vec();
    file.extend(directory.to_le_bytes());
    file.extend(pixels);
    file.extend(more);
    file.extend((fields.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in fields {
        file.extend(tag.to_le_bytes());
        file.extend(kind.to_le_bytes());
        file.extend(count.to_le_bytes());
        file.extend(value.to_le_bytes());
    }
    file.extend([0; 4]);
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As the fuzzer begins: each seed, cut off, and with bytes changed by a plain generator.
    fn tried(changes: u64) -> (usize, usize) {
        let mut state = 42_u64;
        let mut next = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut read = (0, 0);
        for (name, seed) in seeds() {
            println!("{name}");
            check(&seed);
            for change in 0..changes {
                let mut bytes = seed.clone();
                for _ in 0..=change % 3 {
                    let at = 1 + next(bytes.len() - 1);
                    bytes[at] = [next(256) as u8, 0, 255, bytes[at] ^ 1 << next(8)][next(4)];
                }
                if change % 4 == 3 {
                    bytes.truncate(1 + next(bytes.len()));
                }
                check(&bytes);
                read.1 += 1;
            }
            read.0 += 1;
        }
        read
    }

    #[test]
    fn art_that_was_changed_here_and_there_is_art_or_an_error() {
        let changes = if std::env::var("FOILPRESS_FULL").is_ok() { 2000 } else { 30 };
        let (seeds, tries) = tried(changes);
        assert!(seeds >= 20 && tries as u64 == seeds as u64 * changes);
    }

    /// `FOILPRESS_SEEDS=1` writes them.
    #[test]
    fn the_corpus_begins_with_the_seeds() {
        let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../corpus/art");
        for (name, seed) in seeds() {
            let path = corpus.join(&name);
            if std::env::var_os("FOILPRESS_SEEDS").is_some() {
                std::fs::create_dir_all(&corpus).unwrap();
                std::fs::write(&path, &seed).unwrap();
            }
            assert!(path.is_file(), "{name}");
        }
    }

    #[test]
    fn the_seeds_reach_their_readers() {
        let folder = tempfile::tempdir().unwrap();
        for (name, seed) in seeds() {
            let Some(ending) = KINDS.get(usize::from(seed[0])) else { continue };
            let path = folder.path().join(format!("{name}.{ending}"));
            std::fs::write(&path, &seed[1..]).unwrap();
            let read = art::open(&[path], &Options { room: ROOM, ..Options::default() }, &Silent);
            println!(
                "{name}: {:?}",
                read.as_ref().map(|art| (art.width, art.drawn.dots())).map_err(ToString::to_string)
            );
            if let Err(error) = read {
                let said = error.to_string();
                let packed =
                    ["fax", "zstd", "packbits", "spot", "unspecified"].iter().any(|part| name.contains(part));
                assert!(packed, "{name}: {said}");
            }
        }
    }
}
