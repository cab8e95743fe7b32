//! The door to pictures: bytes and a name become a [`Picture`].
//!
//! Problem: a picture comes in many formats, each with its own ways to say what it is, and some that no
//! decoder reads. Files are damaged, cut short or absurdly large.
//! Method: the first bytes tell the format. PNG, PNM, BMP, GIF and WebP are decoded as they are, of an
//! animation the first picture; JPEG and TIFF have readers of their own for what decoders refuse or drop. A
//! plane is read as one if it is a process plate or has a name that the caller asks for. Cost: the pixels,
//! twice where planes are taken apart. Limits: the caller's, checked before anything of that size is
//! allocated. A damaged colour profile is no reason to refuse a picture.

use std::fmt::Display;
use std::io::{BufRead, Cursor, ErrorKind, Seek};
use std::path::Path;

use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageError, ImageFormat, ImageReader};
use observe::Diagnosis;

use crate::picture::{Picture, Raster};
use crate::request::{CUT_SHORT, Request, reduced, whole_jpeg};
use crate::resolution::{self, Dpi};
use crate::turn::Turn;
use crate::{Bounds, cmyk, foreign, jpeg, shrunk, tiff};

/// What reading a header may take: profiles and previews are smaller.
const MOST_OF_HEADER: u64 = 1 << 26;

/// How much of a file tells its format.
const START: usize = 1 << 12;

/// Reads a picture. `name` is that of its file, for messages and for formats without a signature.
///
/// # Errors
/// An unknown, damaged, empty or oversized file, or pixels of a kind that is not read; each says what to do.
pub fn read(mut bytes: Vec<u8>, name: &Path, request: &Request<'_>) -> Result<Picture, Diagnosis> {
    let format = format(&bytes, name, request.besides)?;
    if format == ImageFormat::Jpeg {
        if jpeg::channels(&bytes) == Some(4) {
            if request.planes.is_some() {
                return cmyk::read(&bytes, name, request);
            }
            let problem = "the picture is CMYK, which is four layers instead of one";
            return Err(Diagnosis::of_file(name, problem).hint("convert it to greyscale, or to sRGB"));
        }
        whole_jpeg(name, &bytes)?;
    }
    if format == ImageFormat::Tiff {
        tiff::pages::choose(name, &mut bytes, request.page)?;
        if let Some(wanted) = request.planes
            && let Some(picture) = tiff::channels::read(&bytes, name, wanted, request)?
        {
            return Ok(picture);
        }
        if let Some(picture) = tiff::layouts::read(&bytes, name, request)? {
            return Ok(picture);
        }
    }
    let bad = |error: ImageError| {
        if let (ImageError::Unsupported(found), ImageFormat::Tiff) = (&error, format) {
            return tiff::layouts::refused(name, &bytes, found);
        }
        if let ImageError::Unsupported(found) = &error {
            return Diagnosis::of_file(name, found.to_string())
                .hint("save the picture in RGB or grey, with 8 or 16 bits a channel");
        }
        let cause = if let ImageError::IoError(cause) = &error { Some(cause) } else { None };
        if let (Some(cause), ImageFormat::Tiff) = (cause, format)
            && cause.kind() == ErrorKind::UnexpectedEof
            && let Some(ended) = tiff::layouts::ended(name, &bytes)
        {
            return ended;
        }
        undecodable(name, &error, cause)
    };
    // A sample has at most four bytes and a pixel four samples; twice that is never decoded at once.
    let bounds = Bounds { side: None, bytes: 8 * request.pixels };
    let mut opened = crate::open(&bytes, format, bounds).map_err(bad)?;
    request.check(name, opened.size())?;
    let profile = opened.profile();
    let turn = Turn(opened.orientation());
    let resolution = turn.dpi(resolution::of_file(&bytes, format));
    let (stored, kind) = (opened.size(), opened.colour());
    let finest = request.finest.map(|finest| turn.size(finest));
    let to = finest.map(|finest| (finest.0.clamp(1, stored.0), finest.1.clamp(1, stored.1)));
    let (colours, size) = match to.filter(|to| *to != stored) {
        Some(to) => {
            let rows = (format == ImageFormat::Png).then(|| shrunk::png(&bytes, to)).flatten();
            let raster = match rows {
                Some(raster) => raster,
                None => shrunk::whole(&Raster::from(opened.decode().map_err(bad)?), stored, to),
            };
            (turn.raster(raster, to), turn.size(to))
        }
        None => {
            let mut image = opened.decode().map_err(bad)?;
            image.apply_orientation(turn.0);
            let size = (image.width(), image.height());
            (Raster::from(image), size)
        }
    };
    let colours = Some(colours);
    let gamma = if format == ImageFormat::Png { crate::gamma(&bytes) } else { None };
    let deep = kind.bits_per_pixel() == 16 * u16::from(kind.channel_count());
    let notes = if deep { vec![reduced(name)] } else { Vec::new() };
    Ok(Picture { name: name.into(), size, planes: Vec::new(), colours, resolution, profile, gamma, notes })
}

/// The format of a picture that is read.
fn format(bytes: &[u8], name: &Path, besides: &str) -> Result<ImageFormat, Diagnosis> {
    use ImageFormat::{Bmp, Gif, Jpeg, Png, Pnm, Tiff, WebP};
    let guessed = crate::format(bytes, name);
    if let Some(format @ (Png | Jpeg | Tiff | Pnm | Bmp | Gif | WebP)) = guessed {
        return Ok(format);
    }
    let foreign = foreign::known(&bytes[..bytes.len().min(START)]);
    let (found, way) = match (foreign, guessed) {
        _ if bytes.is_empty() => ("an empty file".into(), None),
        (Some((name, way)), _) => (name.to_owned(), Some(way)),
        (None, Some(format)) => {
            (format!("{format:?}").to_uppercase() + ", which is not read", Some("save it as PNG"))
        }
        (None, None) => ("an unknown format".into(), None),
    };
    let problem = format!("expected a PNG, TIFF, JPEG, PNM, BMP, GIF, WebP{besides} file, found {found}");
    let diagnosis = Diagnosis::of_file(name, problem);
    Err(match way {
        Some(way) => diagnosis.hint(way),
        None => diagnosis,
    })
}

/// Whether these are the first bytes of a picture in some format that decoders know.
pub fn is_picture(start: &[u8]) -> bool {
    image::guess_format(start).is_ok()
}

/// Pixels across and down, from the header of a picture.
pub fn size(file: impl BufRead + Seek) -> Option<(u32, u32)> {
    ImageReader::new(file).with_guessed_format().ok()?.into_dimensions().ok()
}

/// Pixels across and down of a picture, the right way up, and its resolution if it states one, from its
/// header; `None` if it has none that is read.
pub fn stated(bytes: &[u8], name: &Path) -> Option<((u32, u32), Option<Dpi>)> {
    let format = format(bytes, name, "").ok()?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(crate::limits(Bounds { side: None, bytes: MOST_OF_HEADER }));
    let mut decoder = reader.into_decoder().ok()?;
    let turn = Turn(decoder.orientation().unwrap_or(Orientation::NoTransforms));
    Some((turn.size(decoder.dimensions()), turn.dpi(resolution::of_file(bytes, format))))
}

/// Why a picture cannot be drawn to its end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flaw {
    /// It has more pixels than allowed.
    Large,
    /// It is damaged, or was cut short.
    Damaged,
}

/// What is wrong with a picture of at most so many pixels, if anything is; also that it is none. Pixels of a
/// kind that is not decoded are no flaw.
pub fn flaw(bytes: &[u8], pixels: u64) -> Option<Flaw> {
    let Ok(format) = image::guess_format(bytes) else { return Some(Flaw::Damaged) };
    if format == ImageFormat::Jpeg && !jpeg::is_whole(bytes) {
        return Some(Flaw::Damaged);
    }
    let opened = match crate::open(bytes, format, Bounds { side: None, bytes: 8 * pixels }) {
        Ok(opened) => opened,
        Err(ImageError::Limits(_)) => return Some(Flaw::Large),
        Err(_) => return Some(Flaw::Damaged),
    };
    let (width, height) = opened.size();
    if u64::from(width) * u64::from(height) > pixels {
        return Some(Flaw::Large);
    }
    match opened.decode() {
        Ok(_) | Err(ImageError::Unsupported(_)) => None,
        Err(_) => Some(Flaw::Damaged),
    }
}

/// Why a picture cannot be decoded; `cause` is what reading its bytes ended with, if that is the reason.
fn undecodable(name: &Path, error: &impl Display, cause: Option<&std::io::Error>) -> Diagnosis {
    match cause {
        Some(cause) if cause.kind() == ErrorKind::UnexpectedEof => Diagnosis::of_file(name, CUT_SHORT),
        _ => Diagnosis::of_file(name, format!("cannot decode the picture: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pixel, png};

    const ASKED: Request<'static> = Request {
        page: None,
        planes: None,
        pixels: 100,
        finest: None,
        room: "ten by ten",
        besides: " or SVG",
    };

    fn refused(bytes: &[u8], name: &str) -> String {
        read(bytes.to_vec(), Path::new(name), &ASKED).unwrap_err().to_string()
    }

    #[test]
    fn what_is_no_picture_is_told_with_what_was_expected_and_what_to_do() {
        let expected = "expected a PNG, TIFF, JPEG, PNM, BMP, GIF, WebP or SVG file, found";
        for (bytes, name, found) in [
            (&b""[..], "a.png", "an empty file"),
            (b"hello", "a.png", "an unknown format"),
            (b"8BPS\0\x01", "a.psd", "Photoshop's own format"),
            (b"hello", "a.tga", "TGA, which is not read"),
            (b"\0\0\x01\0\x01\0", "a.ico", "an icon"),
        ] {
            let text = refused(bytes, name);
            assert!(text.contains(name) && text.contains(expected) && text.contains(found), "{text}");
        }
    }

    #[test]
    fn the_size_of_a_picture_is_judged_before_its_pixels() {
        let whole = png(&[7; 60], (10, 6), Pixel::Grey).unwrap();
        let picture = read(whole.clone(), Path::new("a.png"), &ASKED).unwrap();
        assert_eq!((picture.size, picture.colours.unwrap().samples), ((10, 6), vec![7; 60]));
        // The header alone claims ten thousand rows.
        let mut large = whole.clone();
        large[20..24].copy_from_slice(&10_000u32.to_be_bytes());
        let crc = flate2_crc(&large[12..29]);
        large[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(refused(&large, "a.png").contains("the picture is 10 x 10000 pixels, more than ten by ten"));
        let empty = b"BM\x1e\0\0\0\0\0\0\0\x1a\0\0\0\x0c\0\0\0\0\0\x01\0\x01\0\x18\0\0\0\0\0";
        assert!(refused(empty, "a.bmp").contains("a.bmp"));
        for cut in [10, 40, whole.len() / 2, whole.len() - 20] {
            assert!(refused(&whole[..cut], "a.png").contains("a.png"), "{cut}");
        }
    }

    fn flate2_crc(bytes: &[u8]) -> u32 {
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        crc.sum()
    }

    #[test]
    fn deep_samples_are_rounded_and_a_note_says_so() {
        let samples: Vec<u8> = [0x0080u16, 0x7f80, 0xffff].iter().flat_map(|v| v.to_ne_bytes()).collect();
        let deep = png(&samples, (3, 1), Pixel::Grey16).unwrap();
        let picture = read(deep, Path::new("a.png"), &ASKED).unwrap();
        assert_eq!(picture.notes, ["a.png: 16 bits per channel are reduced to 8"]);
        // 128 / 257 = .498, 32640 / 257 = 127.004.
        assert_eq!(picture.colours.unwrap().samples, [0, 127, 255]);
    }

    #[test]
    fn flaws_of_pictures_are_told_apart() {
        let whole = png(&[7; 60], (10, 6), Pixel::Grey).unwrap();
        assert_eq!(flaw(&whole, 60), None);
        assert_eq!(flaw(&whole, 59), Some(Flaw::Large));
        assert_eq!(flaw(&whole[..whole.len() - 30], 60), Some(Flaw::Damaged));
        assert_eq!(size(std::io::Cursor::new(&whole)), Some((10, 6)));
        assert_eq!((size(std::io::Cursor::new(b"hello")), is_picture(b"hello")), (None, false));
    }
}
