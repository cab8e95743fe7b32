//! Decodes pictures of any format within limits.
//!
//! Method: the `image` crate decodes PNG, JPEG, TIFF and PNM, chosen by what the file holds. Limits: a gigabyte of file,
//! [`MOST_PIXELS`] pixels. A damaged colour profile is no reason to refuse a picture.

use std::io::{Cursor, Read};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat};

use super::error::{LayersError, io, wrong};
use super::resolution::{self, Dpi};
use super::size::{MOST_BYTES, MOST_PIXELS, check_pixels};
use super::tiff_pages;

/// A decoded picture.
pub(super) struct Decoded {
    pub image: DynamicImage,
    pub dpi: Option<Dpi>,
    pub profile: Option<Vec<u8>>,
}

/// Decodes a whole picture; of a TIFF with several pages the one of this number.
pub(super) fn decode(path: &Path, mut file: impl Read, page: Option<u32>) -> Result<Decoded, LayersError> {
    let mut bytes = Vec::new();
    file.by_ref().take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(io(path, "read it"))?;
    let guessed = image::guess_format(&bytes).ok();
    let format = guessed.filter(|format| {
        matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Tiff | ImageFormat::Pnm)
    });
    let Some(format) = format else {
        let found = match guessed {
            Some(format) => format!("{format:?}").to_uppercase() + ", which is not read; save it as PNG",
            None if bytes.is_empty() => "an empty file".into(),
            None => "an unknown format".into(),
        };
        return Err(wrong(
            path,
            format!("expected a PNG, TIFF, JPEG, PNM, SVG, PDF or PostScript file, found {found}"),
        ));
    };
    if format == ImageFormat::Jpeg && jpeg_frame(&bytes).is_some_and(|(channels, ..)| channels == 4) {
        return Err(wrong(
            path,
            "the picture is CMYK, which is four layers instead of one; convert it to greyscale",
        ));
    }
    if format == ImageFormat::Tiff {
        tiff_pages::choose(path, &mut bytes, page)?;
    }
    let bad = |error: image::ImageError| wrong(path, format!("cannot decode the picture: {error}"));
    let mut reader = image::ImageReader::with_format(Cursor::new(&bytes[..]), format);
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(8 * MOST_PIXELS);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(bad)?;
    let (width, height) = decoder.dimensions();
    check_pixels(path, width, height)?;
    let profile = decoder.icc_profile().ok().flatten();
    let dpi = resolution::of_file(&bytes, format);
    let image = DynamicImage::from_decoder(decoder).map_err(bad)?;
    Ok(Decoded { image, dpi, profile })
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
