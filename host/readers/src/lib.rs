//! Pictures in files: decoding within limits, encoding, and what a file states of its picture.
//!
//! Problem: documents, flat art, light probes, photographs and pictures for screens come in the same formats.
//! Each caller would judge them anew, and compile the decoders again.
//! Method: decoders read bytes in memory and are compiled here. A file is opened first ([`open`]), which
//! tells its size, so that the caller's own limits come before anything of that size is allocated; then it is
//! decoded.
//! Cost: the bytes of the file in memory beside its pixels. Limits: see each format; of an animation the
//! first picture.

mod chunks;
pub mod exact;
mod exif;
mod exr;
mod floats;
mod jpeg;
mod pixels;
pub mod resolution;
mod stored;

use std::io::Cursor;
use std::path::Path;

use image::error::{DecodingError, ImageError};
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits};

pub use chunks::{MOST_PROFILE, gamma};
pub use exif::{Exif, exif};
pub use exr::Primaries;
pub use pixels::{Pixel, Pixels, open_exr, png};
pub use stored::{Fault, Format, Header, Samples, Stored};

/// The format of a file by its first bytes; Targa files, which have no signature, by the ending of their
/// name.
pub fn format(bytes: &[u8], path: &Path) -> Option<ImageFormat> {
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
pub struct Opened<'a> {
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
pub fn open(bytes: &[u8], format: ImageFormat, bounds: Bounds) -> ImageResult<Opened<'_>> {
    if format == ImageFormat::Png && !chunks::has_plain_profile(bytes) {
        let problem = format!("its colour profile expands to more than {} MB", MOST_PROFILE >> 20);
        return Err(ImageError::Decoding(DecodingError::new(format.into(), problem)));
    }
    if format == ImageFormat::Jpeg && jpeg::is_cut_short(bytes) {
        let problem = "the file ends before the picture does: it was cut short; copy or save it again";
        return Err(ImageError::Decoding(DecodingError::new(format.into(), problem)));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits(bounds));
    Ok(Opened { decoder: Box::new(reader.into_decoder()?) })
}

fn limits(bounds: Bounds) -> Limits {
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (bounds.side, bounds.side);
    limits.max_alloc = Some(bounds.bytes);
    limits
}
