//! Formats that are not read, and the way out.
//!
//! Problem: owners have files of their drawing program, and the name of the format alone does not tell what to do with one.
//! Method: the first bytes tell the format; each has a sentence on how its program saves something that is read. Cost: a look at
//! the first bytes. Limits: the formats that owners of these printers were seen to have.
//! Source: the published descriptions of the formats; for those of Affinity, Corel and Clip Studio their files.

/// A format: its name, and what to do.
type Format = (&'static str, &'static str);

const LAYERS: &str = "export each layer as PNG, named after its ink (white.png, gold.png, …)";
const DRAWING: &str = "export the drawing as SVG with its layers, or as PDF with a spot colour for each ink";
const PICTURE: &str = "save it as PNG or TIFF";
const PAGE: &str = "print it to a PDF from its program";

/// Formats by the bytes at a place in the file.
const MAGIC: [(usize, &[u8], Format); 29] = [
    (
        0,
        b"8BPS",
        (
            "Photoshop's own format",
            "save a copy as TIFF with its spot channels, or export each layer as PNG, named after its ink",
        ),
    ),
    (
        0,
        b"gimp xcf",
        ("GIMP's own format", "export it as OpenRaster (.ora), or each layer as PNG, named after its ink"),
    ),
    (0, b"\0\xffKA", ("Affinity's own format", DRAWING)),
    (8, b"CDR", ("a CorelDRAW drawing", DRAWING)),
    (8, b"cdr", ("a CorelDRAW drawing", DRAWING)),
    (0, b"CPT", ("Corel Photo-Paint's own format", LAYERS)),
    (0, b"CSFCHUNK", ("Clip Studio's own format", LAYERS)),
    (0, b"Paint Shop Pro", ("Paint Shop Pro's own format", LAYERS)),
    (0, b"\x06\x06\xed\xf5", ("an InDesign document", "export it as PDF with a spot colour for each ink")),
    (4, b"ftypheic", ("HEIC", PICTURE)),
    (4, b"ftypheix", ("HEIC", PICTURE)),
    (4, b"ftypmif1", ("HEIF", PICTURE)),
    (4, b"ftypmsf1", ("HEIF", PICTURE)),
    (4, b"ftypavif", ("AVIF", PICTURE)),
    (4, b"ftypcrx", ("a raw photograph", PICTURE)),
    (0, b"\0\0\0\x0cjP  ", ("JPEG 2000", PICTURE)),
    (0, b"\xff\x4f\xff\x51", ("JPEG 2000", PICTURE)),
    (0, b"\0\0\0\x0cJXL ", ("JPEG XL", PICTURE)),
    (0, b"\xff\x0a", ("JPEG XL", PICTURE)),
    (0, b"AutoCAD Binary DXF", ("DXF", DRAWING)),
    (0, b"AC10", ("DWG", DRAWING)),
    (40, b" EMF", ("an enhanced metafile", DRAWING)),
    (0, b"\xd7\xcd\xc6\x9a", ("a Windows metafile", DRAWING)),
    (0, b"\xd0\xcf\x11\xe0", ("an Office document", PAGE)),
    (0, b"fig-kiwi", ("Figma's own format", DRAWING)),
    (0, b"\0\0\x01\0", ("an icon", PICTURE)),
    (0, b"DDS ", ("DDS", PICTURE)),
    (0, b"\x76\x2f\x31\x01", ("OpenEXR", PICTURE)),
    (0, b"#?RADIANCE", ("Radiance", PICTURE)),
];

/// What these first bytes of a file are, if they are of a format that is known but not read.
pub(crate) fn known(start: &[u8]) -> Option<Format> {
    let at = |place: usize, magic: &[u8]| start.get(place..).is_some_and(|rest| rest.starts_with(magic));
    let known = MAGIC.iter().find(|(place, magic, _)| at(*place, magic)).map(|(.., format)| *format);
    known.or_else(|| archive(start)).or_else(|| text(start))
}

/// A zip archive, by what its first entry says.
fn archive(start: &[u8]) -> Option<Format> {
    if start.starts_with(b"\x1f\x8b") {
        return Some(("a compressed file", "unpack it, such as with gunzip"));
    }
    if !start.starts_with(b"PK\x03\x04") {
        return None;
    }
    let has = |word: &[u8]| start.windows(word.len()).any(|part| part == word);
    Some(if has(b"coreldraw") || has(b"corel") {
        ("a CorelDRAW drawing", DRAWING)
    } else if has(b"Document.archive") {
        (
            "Procreate's own format",
            "share its layers as PNG, and name each after its ink (white.png, gold.png, …)",
        )
    } else if has(b"word/")
        || has(b"ppt/")
        || has(b"xl/")
        || has(b"[Content_Types].xml")
        || has(b"opendocument")
    {
        ("an Office document", PAGE)
    } else {
        ("an archive", "unpack it, and print the pictures in it")
    })
}

fn text(start: &[u8]) -> Option<Format> {
    let text = start.trim_ascii_start();
    let begins = |word: &[u8]| text.get(..word.len()).is_some_and(|first| first.eq_ignore_ascii_case(word));
    let (first, rest) = text.split_at(text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len()));
    if first == b"0" && rest.trim_ascii_start().starts_with(b"SECTION") {
        return Some(("DXF", DRAWING));
    }
    let has = |word: &[u8]| start.windows(word.len()).any(|part| part == word);
    if begins(b"<") && has(b"LightBurnProject") {
        return Some(("LightBurn's own format", "export it as SVG, and name its layers after their inks"));
    }
    // The language of plotters: initialise, or choose a pen first.
    if [&b"IN;"[..], b"\x1b%-1BIN", b"\x1b%0BIN", b"SP1;", b"BPIN"].iter().any(|word| text.starts_with(word))
    {
        return Some(("a drawing for a plotter (HPGL)", DRAWING));
    }
    (begins(b"<!doctype html") || begins(b"<html"))
        .then_some(("a page of the web", "print it to a PDF from the browser"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_their_first_bytes_and_each_has_a_way_out() {
        for (start, name) in [
            (&b"8BPS\0\x01"[..], "Photoshop's own format"),
            (b"gimp xcf v011\0", "GIMP's own format"),
            (b"RIFF\x10\0\0\0CDRD", "a CorelDRAW drawing"),
            (b"PK\x03\x04..mimetypeapplication/x-vnd.corel.draw.document+zip", "a CorelDRAW drawing"),
            (b"PK\x03\x04..[Content_Types].xml", "an Office document"),
            (b"PK\x03\x04..art.png", "an archive"),
            (b"\0\0\0\x18ftypheic", "HEIC"),
            (b"\0\0\0\x0cjP  \r\n", "JPEG 2000"),
            (b"  0\r\nSECTION\r\n", "DXF"),
            (b"\0\xffKA\x0b\0", "Affinity's own format"),
            (b"\n<!DOCTYPE HTML>", "a page of the web"),
        ] {
            let (found, way) = known(start).unwrap();
            assert_eq!(found, name);
            assert!(["export", "save", "print", "unpack"].iter().any(|verb| way.starts_with(verb)), "{way}");
        }
        for start in [&b"\x89PNG\r\n"[..], b"RIFF\x10\0\0\0WEBP", b"<svg>", b"%PDF-1.4", b"", b"0 0 0"] {
            assert_eq!(known(start), None);
        }
    }
}
