//! Pictures in files: bytes and a name become a [`Picture`], and pixels become a file.
//!
//! Problem: documents, flat art, light probes, photographs and pictures for screens come in the same formats.
//! Each caller would judge them anew, and compile the decoders again.
//! Method: decoders read bytes in memory and are compiled here. [`read`] gives planes with the names that the
//! file has for them, colours of 8 bits, resolution and notes, and knows nothing of what they are for;
//! [`Layered`] does so for files of layers. Measurements keep their depth: [`Format::open`] reads a header,
//! which tells the size, so that the caller's own limits come before anything of that size is allocated; then
//! it is decoded.
//! Cost: the bytes of the file in memory beside its pixels. Limits: see each format; of an animation the
//! first picture.

mod chunks;
mod cmyk;
pub mod exact;
mod exif;
mod exr;
mod fault;
mod floats;
mod foreign;
mod jpeg;
mod layered;
mod picture;
mod pixels;
pub mod profile;
mod read;
mod request;
pub mod resolution;
mod shrunk;
mod stored;
mod tiff;
mod turn;

use std::io::Cursor;
use std::path::Path;

use image::error::{DecodingError, ImageError};
use image::imageops::{self, FilterType};
use image::metadata::Orientation;
use image::{
    ColorType, DynamicImage, GrayImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits,
};

pub use exif::{Exif, exif};
pub use exr::Primaries;
pub use fault::Fault;
pub use layered::{Layered, is_layered};
pub use picture::{Picture, Plane, PlaneKind, Process, Raster};
pub use pixels::{Pixel, Pixels, open_exr, png};
pub use read::{Flaw, flaw, is_picture, read, size, stated};
pub use request::Request;
pub use stored::{Format, Header, Samples, Stored};
pub use tiff::pages::{count as pages, is_tiff};

use chunks::{MOST_PROFILE, gamma};

/// The format of a file by its first bytes; Targa files, which have no signature, by the ending of their
/// name.
pub(crate) fn format(bytes: &[u8], path: &Path) -> Option<ImageFormat> {
    if bytes.starts_with(b"#?RGBE") {
        return Some(ImageFormat::Hdr);
    }
    // BigTIFF, of either order of bytes.
    if bytes.starts_with(b"II+\0") || bytes.starts_with(b"MM\0+") {
        return Some(ImageFormat::Tiff);
    }
    let targa = || path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("tga"));
    image::guess_format(bytes).ok().or_else(|| (!bytes.is_empty() && targa()).then_some(ImageFormat::Tga))
}

/// What a decoder may use.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bounds {
    /// The most pixels along a side.
    pub side: Option<u32>,
    /// The most bytes of memory.
    pub bytes: u64,
}

/// A picture whose header was read.
pub(crate) struct Opened<'a> {
    decoder: Box<dyn ImageDecoder + 'a>,
}

impl Opened<'_> {
    /// Pixels across and down.
    pub fn size(&self) -> (u32, u32) {
        self.decoder.dimensions()
    }

    /// What its pixels are decoded to.
    pub fn colour(&self) -> ColorType {
        self.decoder.color_type()
    }

    /// Its colour profile; nothing if it is damaged.
    pub fn profile(&mut self) -> Option<Vec<u8>> {
        self.decoder.icc_profile().ok().flatten()
    }

    /// How to turn it before it is shown; not at all if the file does not say so.
    pub fn orientation(&mut self) -> Orientation {
        self.decoder.orientation().unwrap_or(Orientation::NoTransforms)
    }

    /// Its pixels as they are stored.
    ///
    /// # Errors
    /// A damaged file, or one that needs more memory than allowed.
    pub fn decode(self) -> ImageResult<DynamicImage> {
        DynamicImage::from_decoder(self.decoder)
    }
}

/// Reads the header of a picture.
///
/// # Errors
/// A damaged file, a kind of pixels that is not decoded, or a larger picture than allowed.
pub(crate) fn open(bytes: &[u8], format: ImageFormat, bounds: Bounds) -> ImageResult<Opened<'_>> {
    if format == ImageFormat::Png && !chunks::has_plain_profile(bytes) {
        let problem = format!("its colour profile expands to more than {} MB", MOST_PROFILE >> 20);
        return Err(ImageError::Decoding(DecodingError::new(format.into(), problem)));
    }
    if format == ImageFormat::Jpeg && !jpeg::is_whole(bytes) {
        let problem = "the file ends before the picture does: it was cut short; copy or save it again";
        return Err(ImageError::Decoding(DecodingError::new(format.into(), problem)));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits(bounds));
    Ok(Opened { decoder: Box::new(reader.into_decoder()?) })
}

pub(crate) fn limits(bounds: Bounds) -> Limits {
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (bounds.side, bounds.side);
    limits.max_alloc = Some(bounds.bytes);
    limits
}

/// Grey samples, a byte each, at another size: interpolated between pixels, or their averages (a triangle
/// filter).
pub fn resized(samples: Vec<u8>, from: (u32, u32), to: (u32, u32)) -> Vec<u8> {
    match GrayImage::from_raw(from.0, from.1, samples) {
        Some(image) => imageops::resize(&image, to.0, to.1, FilterType::Triangle).into_raw(),
        None => vec![0; to.0 as usize * to.1 as usize],
    }
}
