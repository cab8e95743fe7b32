//! Pictures in files: decoding within limits, encoding as PNG, and the resolution that a file states.
//!
//! Problem: documents, flat art, light probes, photographs and pictures for screens come in the same formats. Decoders are
//! generic code that each caller would compile again.
//! Method: decoders read bytes in memory and are compiled here. A file is opened first ([`open`]), which tells its size, so that the
//! caller's own limits come before anything of that size is allocated; then it is decoded.
//! Cost: the bytes of the file in memory beside its pixels. Limits: see each format; of an animation the first picture.

mod chunks;
mod exr;
mod floats;
mod jpeg;
pub mod resolution;

use std::io::Cursor;
use std::path::Path;

use image::codecs::hdr::HdrDecoder;
use image::codecs::png::PngEncoder;
use image::error::{DecodingError, ImageError};
use image::metadata::Orientation;
use image::{
    ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader,
    ImageResult, Limits,
};

pub use chunks::{MOST_PROFILE, gamma};
pub use exr::{Floats, Primaries, exr, exr_sizes};
pub use floats::{FloatTiff, float_tiff};

/// The format of a file by its first bytes; Targa files, which have no signature, by the ending of their name.
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

/// Reads the header of a Radiance picture, and the exposure that its pixels were multiplied by.
///
/// # Errors
/// A damaged file, or a larger picture than allowed.
pub fn open_radiance(bytes: &[u8], bounds: Bounds) -> ImageResult<(Opened<'_>, f32)> {
    let mut decoder = HdrDecoder::new(Cursor::new(bytes))?;
    let exposure = decoder.metadata().exposure.unwrap_or(1.0);
    decoder.set_limits(limits(bounds))?;
    Ok((Opened { decoder: Box::new(decoder) }, exposure))
}

/// A picture as the bytes of a PNG. Samples of 16 bits are in the order of this computer's bytes.
///
/// # Errors
/// A number of samples that differs from the size.
pub fn png(samples: &[u8], size: (u32, u32), colour: ExtendedColorType) -> ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(samples, size.0, size.1, colour)?;
    Ok(bytes)
}
