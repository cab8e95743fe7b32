//! Decodes pictures of any format within limits.
//!
//! Method: the `image` crate decodes PNG, JPEG, TIFF, PNM, BMP, GIF and WebP, chosen by what the file holds; of an animation the
//! first picture. Limits: a gigabyte of file, [`MOST_PIXELS`] pixels. A damaged colour profile is no reason to refuse a picture. The decoder of JPEG makes up what a file
//! that was cut short lacks, so the end of the picture is looked for first.

use std::fmt::Display;
use std::io::{ErrorKind, Read};
use std::path::Path;

use ::tiff::tags::Tag;
use image::{DynamicImage, ImageError, ImageFormat};
use observe::Diagnosis;
use readers::Bounds;
use readers::resolution::{self, Dpi};

use super::error::{io, wrong};
use super::orientation::Turn;
use super::size::{MOST_BYTES, MOST_PIXELS, check_pixels};
use super::{foreign, tiff_kinds, tiff_pages};

/// A decoded picture, the right way up.
pub(super) struct Decoded {
    pub image: DynamicImage,
    pub dpi: Option<Dpi>,
    pub profile: Option<Vec<u8>>,
    /// The power of its values, if they have neither a profile nor that of sRGB.
    pub gamma: Option<f64>,
    /// What had to be assumed.
    pub notes: Vec<String>,
}

/// How much of a file tells its format.
const START: usize = 1 << 12;

/// Decodes a whole picture; of a TIFF with several pages the one of this number.
pub(super) fn decode(path: &Path, mut file: impl Read, page: Option<u32>) -> Result<Decoded, Diagnosis> {
    let mut bytes = Vec::new();
    file.by_ref().take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(io(path, "read it"))?;
    let big = tiff_pages::is_tiff(&bytes).then_some(ImageFormat::Tiff);
    let guessed = image::guess_format(&bytes).ok().or(big);
    let format = guessed.filter(|format| {
        use ImageFormat::{Bmp, Gif, Jpeg, Png, Pnm, Tiff, WebP};
        matches!(format, Png | Jpeg | Tiff | Pnm | Bmp | Gif | WebP)
    });
    let Some(format) = format else {
        let foreign = foreign::format(&bytes[..bytes.len().min(START)]);
        let (found, way) = match (foreign, guessed) {
            _ if bytes.is_empty() => ("an empty file".into(), None),
            (Some((name, way)), _) => (name.to_owned(), Some(way)),
            (None, Some(format)) => {
                (format!("{format:?}").to_uppercase() + ", which is not read", Some("save it as PNG"))
            }
            (None, None) => ("an unknown format".into(), None),
        };
        let diagnosis = wrong(
            path,
            format!(
                "expected a PNG, TIFF, JPEG, PNM, BMP, GIF, WebP, SVG, PDF or PostScript file, found {found}"
            ),
        );
        return Err(match way {
            Some(way) => diagnosis.hint(way),
            None => diagnosis,
        });
    };
    if format == ImageFormat::Jpeg && jpeg_frame(&bytes).is_some_and(|(channels, ..)| channels == 4) {
        return Err(wrong(path, "the picture is CMYK, which is four layers instead of one")
            .hint("convert it to greyscale"));
    }
    match format {
        ImageFormat::Jpeg => whole_jpeg(path, &bytes)?,
        ImageFormat::Tiff => tiff_pages::choose(path, &mut bytes, page)?,
        _ => {}
    }
    let bad = |error: ImageError| {
        if let (ImageError::Unsupported(found), ImageFormat::Tiff) = (&error, format) {
            return tiff_kinds::refused(path, &bytes, found);
        }
        if let ImageError::Unsupported(found) = &error {
            return wrong(path, found.to_string())
                .hint("save the picture in RGB or grey, with 8 or 16 bits a channel");
        }
        let cause = if let ImageError::IoError(cause) = &error { Some(cause) } else { None };
        if let (Some(cause), ImageFormat::Tiff) = (cause, format)
            && cause.kind() == ErrorKind::UnexpectedEof
            && let Some(ended) = tiff_kinds::ended(path, &bytes)
        {
            return ended;
        }
        undecodable(path, &error, cause)
    };
    if format == ImageFormat::Tiff
        && let Some(read) = tiff_kinds::read(path, &bytes)?
    {
        return Ok(of_tiff(read, &bytes));
    }
    let bounds = Bounds { side: None, bytes: 8 * MOST_PIXELS };
    let mut opened = readers::open(&bytes, format, bounds).map_err(bad)?;
    let (width, height) = opened.size();
    check_pixels(path, width, height)?;
    let profile = opened.profile();
    let turn = Turn(opened.orientation());
    let dpi = turn.dpi(resolution::of_file(&bytes, format));
    let mut image = opened.decode().map_err(bad)?;
    image.apply_orientation(turn.0);
    let gamma = if format == ImageFormat::Png { readers::gamma(&bytes) } else { None };
    Ok(Decoded { image, dpi, profile, gamma, notes: Vec::new() })
}

/// A picture in TIFF with what its tags say of it.
fn of_tiff(read: tiff_kinds::Read, bytes: &[u8]) -> Decoded {
    const PROFILE: Tag = Tag::Unknown(34675);
    let tiff_kinds::Read { mut image, notes, converted } = read;
    let Some(mut decoder) = resolution::tiff_decoder(bytes) else {
        return Decoded { image, dpi: None, profile: None, gamma: None, notes };
    };
    let turn = Turn::of_tag(decoder.find_tag_unsigned(Tag::Orientation).ok().flatten());
    let dpi = turn.dpi(resolution::of_file(bytes, ImageFormat::Tiff));
    let profile = decoder.find_tag(PROFILE).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    image.apply_orientation(turn.0);
    Decoded { image, dpi, profile: profile.filter(|_| !converted), gamma: None, notes }
}

/// A picture that ends before its end.
const CUT_SHORT: &str = "the picture ends before its last row: the file was cut short; copy or save it again";

/// Why a picture cannot be decoded; `cause` is what reading its bytes ended with, if that is the reason.
pub(super) fn undecodable(path: &Path, error: &impl Display, cause: Option<&std::io::Error>) -> Diagnosis {
    match cause {
        Some(cause) if cause.kind() == ErrorKind::UnexpectedEof => wrong(path, CUT_SHORT),
        _ => wrong(path, format!("cannot decode the picture: {error}")),
    }
}

/// Refuses a JPEG that was cut short: one without the marker of its end.
pub(super) fn whole_jpeg(path: &Path, bytes: &[u8]) -> Result<(), Diagnosis> {
    if jpeg_has_end(bytes) { Ok(()) } else { Err(wrong(path, CUT_SHORT)) }
}

/// Whether a JPEG has the marker of its end, outside of the segments with data of their own, such as a small copy in EXIF.
fn jpeg_has_end(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    while let Some(at) = rest.iter().position(|&byte| byte == 0xff) {
        rest = &rest[at + 1..];
        match rest.first() {
            Some(0xd9) => return true,
            // An FF among the data of a scan, a restart, a start, or one more FF.
            Some(0 | 1 | 0xd0..=0xd8 | 0xff) => {}
            _ => {
                let Some(&[_, high, low]) = rest.first_chunk() else { return false };
                rest = rest.get(1 + usize::from(u16::from_be_bytes([high, low]))..).unwrap_or_default();
            }
        }
    }
    false
}

/// Channels, height and width of a JPEG, from the first of its frame headers.
pub(super) fn jpeg_frame(bytes: &[u8]) -> Option<(u8, u16, u16)> {
    let mut rest = bytes.strip_prefix(b"\xff\xd8")?;
    loop {
        let (&[0xff, marker, high, low], body) = rest.split_first_chunk::<4>()? else { return None };
        // C4, C8 and CC are tables, all others of this row are frames.
        if (0xc0..=0xcf).contains(&marker) && ![0xc4, 0xc8, 0xcc].contains(&marker) {
            let &[_, h, e, w, i, channels] = body.first_chunk()?;
            return Some((channels, u16::from_be_bytes([h, e]), u16::from_be_bytes([w, i])));
        }
        rest = body.get(usize::from(u16::from_be_bytes([high, low])).checked_sub(2)?..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_jpeg_is_found_behind_its_scans_and_not_in_its_segments() {
        let whole = [
            &b"\xff\xd8\xff\xe1\0\x06\xff\xd9xx"[..],
            b"\xff\xda\0\x04ab scan \xff\0\xff\xd0 scan",
            b"\xff\xff\xc4\0\x03a\xff\xda\0\x02more\xff\xd9rest",
        ];
        let bytes = whole.concat();
        assert!(jpeg_has_end(&bytes));
        let end = bytes.windows(6).position(|six| six == b"more\xff\xd9").unwrap() + 6;
        for cut in 0..bytes.len() {
            assert_eq!(jpeg_has_end(&bytes[..cut]), cut >= end, "{cut}");
        }
    }
}
