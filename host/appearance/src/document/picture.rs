//! Decoding one image: PNG, JPEG, TIFF, Radiance HDR or OpenEXR, recognised by content and within limits.
//!
//! The contents of a file decide its format; a name that disagrees gives a note. Dimensions are checked before anything of
//! that size is allocated. Floating-point images must be finite.

use std::path::Path;

use image::{DynamicImage, ImageFormat};
use rayon::prelude::*;

use super::content::ColourSpace;
use super::error::DocumentError;
use super::source::Source;
use super::texture::Plane;
use crate::srgb;

/// The most pixels of a document. The largest page has 38 million dots, and no known document has more.
pub const MOST_PIXELS: u64 = 1 << 26;

/// The most pixels along one side.
const MOST_SIDE: u64 = 16_384;

/// The most values (pixels times channels) in one image.
const MOST_VALUES: u64 = 1 << 28;

/// The most values of floating point in one image: they take four bytes each, and twice that while they are decoded.
const MOST_FLOATS: u64 = 1 << 26;

/// The values of an image, interleaved, rows from the top.
#[derive(Clone, Debug)]
enum Values {
    /// 0..=255 for 0..=1.
    Eight(Vec<u8>),
    /// 0..=65535 for 0..=1.
    Sixteen(Vec<u16>),
    /// Unscaled; finite.
    Float(Vec<f32>),
}

/// A decoded image with 1 to 4 channels: grey, grey and alpha, RGB, or RGB and alpha.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels across, at least 1.
    pub width: usize,
    /// Pixels down, at least 1.
    pub height: usize,
    channels: usize,
    values: Values,
    foreign_profile: bool,
}

impl Picture {
    /// Decodes the bytes of a file; `path` names it in errors and notes.
    pub fn decode(bytes: &[u8], path: &Path, source: &mut Source<'_>) -> Result<Picture, DocumentError> {
        let wrong = |problem: String| DocumentError::Picture { path: path.to_path_buf(), problem };
        let format = if bytes.starts_with(b"#?RGBE") {
            Some(ImageFormat::Hdr)
        } else {
            image::guess_format(bytes).ok()
        };
        let Some((format, kind)) = format.and_then(|format| Some((format, kind(format)?))) else {
            let found = if bytes.is_empty() { "an empty file" } else { "another format" };
            return Err(wrong(format!(
                "expected a PNG, JPEG, TIFF, OpenEXR or Radiance HDR image, found {found}"
            )));
        };
        if let Ok(named) = ImageFormat::from_path(path)
            && named != format
        {
            source.note(format!("{}: read as {kind}, which it is despite its name", path.display()));
        }
        let picture = match format {
            ImageFormat::OpenExr => decode_exr(bytes, path)?,
            format => {
                // The decoder knows only one of the two signatures of a Radiance file.
                let renamed = bytes.strip_prefix(b"#?RGBE").map(|rest| [b"#?RADIANCE", rest].concat());
                decode_image(renamed.as_deref().unwrap_or(bytes), format, path)?
            }
        };
        if let Values::Float(values) = &picture.values
            && let Some(at) = values.iter().position(|v| !v.is_finite())
        {
            let (pixel, channel) = (at / picture.channels, at % picture.channels);
            return Err(wrong(format!(
                "pixel ({}, {}) channel {channel} is {}, not a finite number",
                pixel % picture.width,
                pixel / picture.width,
                values[at]
            )));
        }
        if picture.has_alpha() && !picture.is_opaque() {
            source.note(format!("{}: alpha is ignored; every pixel is printed", path.display()));
        }
        Ok(picture)
    }

    /// Whether the values are floating point, as in EXR and HDR files.
    pub fn is_float(&self) -> bool {
        matches!(self.values, Values::Float(_))
    }

    /// Whether it has a colour profile other than sRGB. Profiles are never applied, and data maps do not need them.
    pub fn has_foreign_profile(&self) -> bool {
        self.foreign_profile
    }

    /// The values of a 16-bit grey image, 0 to 65535.
    pub fn sixteen(&self) -> Option<&[u16]> {
        match &self.values {
            Values::Sixteen(values) if self.channels == 1 => Some(values),
            _ => None,
        }
    }

    /// Channels without alpha: 1 or 3.
    pub fn colours(&self) -> usize {
        if self.channels < 3 { 1 } else { 3 }
    }

    fn has_alpha(&self) -> bool {
        self.channels == 2 || self.channels == 4
    }

    fn is_opaque(&self) -> bool {
        let (channels, last) = (self.channels, self.channels - 1);
        match &self.values {
            Values::Eight(v) => v.chunks_exact(channels).all(|p| p[last] == u8::MAX),
            Values::Sixteen(v) => v.chunks_exact(channels).all(|p| p[last] == u16::MAX),
            Values::Float(v) => v.chunks_exact(channels).all(|p| p[last] >= 1.0),
        }
    }

    /// One channel as data; integers are scaled to 0..1. Channel 3 is alpha (1 if there is none); in a grey image every
    /// other channel is the grey one.
    pub fn channel(&self, channel: usize) -> Plane {
        let at = match (channel, self.has_alpha()) {
            (3, false) => {
                return Plane::eight(self.width, self.height, vec![u8::MAX; self.width * self.height]);
            }
            (3, true) => self.channels - 1,
            (channel, _) => channel.min(self.colours() - 1),
        };
        let (width, height, channels) = (self.width, self.height, self.channels);
        match &self.values {
            Values::Eight(v) => {
                Plane::eight(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
            Values::Sixteen(v) => {
                Plane::sixteen(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
            Values::Float(v) => {
                Plane::new(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
        }
    }

    /// The default encoding of its colours: linear for floating point, sRGB for integers.
    pub fn natural_space(&self) -> ColourSpace {
        if self.is_float() { ColourSpace::Linear } else { ColourSpace::Srgb }
    }

    /// One colour channel as linear values.
    pub fn linear_channel(&self, channel: usize, space: ColourSpace) -> Plane {
        let plane = self.channel(channel);
        match space {
            ColourSpace::Linear => plane,
            ColourSpace::Srgb => plane.map(srgb::decode),
        }
    }

    /// The colours as linear values.
    pub fn linear(&self, space: ColourSpace) -> [Plane; 3] {
        if self.colours() == 1 {
            let grey = self.linear_channel(0, space);
            return [grey.clone(), grey.clone(), grey];
        }
        std::array::from_fn(|channel| self.linear_channel(channel, space))
    }
}

/// Whether a colour profile is named sRGB, in either of the text encodings of profiles.
fn is_srgb(profile: &[u8]) -> bool {
    profile.windows(4).any(|w| w == b"sRGB") || profile.windows(8).any(|w| w == b"\0s\0R\0G\0B")
}

fn kind(format: ImageFormat) -> Option<&'static str> {
    match format {
        ImageFormat::Png => Some("PNG"),
        ImageFormat::Jpeg => Some("JPEG"),
        ImageFormat::Tiff => Some("TIFF"),
        ImageFormat::Hdr => Some("Radiance HDR"),
        ImageFormat::OpenExr => Some("OpenEXR"),
        _ => None,
    }
}

/// Checks that a size is plausible, before anything is allocated.
fn check_size(path: &Path, width: u64, height: u64, channels: u64, most: u64) -> Result<(), DocumentError> {
    let large = |field: &str, found, most| {
        Err(DocumentError::Large { path: path.to_path_buf(), field: field.into(), found, most })
    };
    if width == 0 || height == 0 {
        let problem = format!("the image has {width} x {height} pixels; expected at least one");
        return Err(DocumentError::Picture { path: path.to_path_buf(), problem });
    }
    if width.max(height) > MOST_SIDE {
        return large("the longer side in pixels", width.max(height), MOST_SIDE);
    }
    if width * height > MOST_PIXELS {
        return large("the number of pixels", width * height, MOST_PIXELS);
    }
    if width * height * channels > most {
        return large("the number of values", width * height * channels, most);
    }
    Ok(())
}

fn decode_image(bytes: &[u8], format: ImageFormat, path: &Path) -> Result<Picture, DocumentError> {
    let wrong = |problem: String| DocumentError::Picture { path: path.to_path_buf(), problem };
    let damaged = |error: image::ImageError| {
        wrong(match &error {
            image::ImageError::Limits(_) => {
                format!(
                    "the image has more than {MOST_SIDE} pixels along a side or needs too much memory; \
                     make it smaller"
                )
            }
            image::ImageError::Unsupported(_) => {
                format!("cannot decode the image: {error}; save it as an 8-bit or 16-bit PNG, or as OpenEXR")
            }
            _ => format!("cannot decode the image: {error}"),
        })
    };
    let bounds = pictures::Bounds { side: Some(MOST_SIDE as u32), bytes: 4 * MOST_VALUES };
    let mut opened = pictures::open(bytes, format, bounds).map_err(damaged)?;
    let ((width, height), colour) = (opened.size(), opened.colour());
    let channels = u64::from(colour.channel_count());
    let most = if u64::from(colour.bytes_per_pixel()) == 4 * channels { MOST_FLOATS } else { MOST_VALUES };
    check_size(path, u64::from(width), u64::from(height), channels, most)?;
    // A damaged profile does not matter.
    let foreign_profile = opened.profile().is_some_and(|bytes| !is_srgb(&bytes));
    let decoded = opened.decode().map_err(damaged)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let picture = |channels, values| Picture { width, height, channels, values, foreign_profile };
    Ok(match decoded {
        DynamicImage::ImageLuma8(p) => picture(1, Values::Eight(p.into_raw())),
        DynamicImage::ImageLumaA8(p) => picture(2, Values::Eight(p.into_raw())),
        DynamicImage::ImageRgb8(p) => picture(3, Values::Eight(p.into_raw())),
        DynamicImage::ImageRgba8(p) => picture(4, Values::Eight(p.into_raw())),
        DynamicImage::ImageLuma16(p) => picture(1, Values::Sixteen(p.into_raw())),
        DynamicImage::ImageLumaA16(p) => picture(2, Values::Sixteen(p.into_raw())),
        DynamicImage::ImageRgb16(p) => picture(3, Values::Sixteen(p.into_raw())),
        DynamicImage::ImageRgba16(p) => picture(4, Values::Sixteen(p.into_raw())),
        DynamicImage::ImageRgb32F(p) => picture(3, Values::Float(p.into_raw())),
        DynamicImage::ImageRgba32F(p) => picture(4, Values::Float(p.into_raw())),
        other => {
            return Err(wrong(format!(
                "pixels of type {:?} are not supported; save the image as RGB",
                other.color()
            )));
        }
    })
}

fn decode_exr(bytes: &[u8], path: &Path) -> Result<Picture, DocumentError> {
    let wrong = |problem: String| DocumentError::Picture { path: path.to_path_buf(), problem };
    for (width, height, channels) in pictures::exr_sizes(bytes).map_err(wrong)? {
        check_size(path, width as u64, height as u64, channels as u64, MOST_FLOATS)?;
    }
    let pictures::Floats { width, height, channels, values } = pictures::exr(bytes).map_err(wrong)?;
    Ok(Picture { width, height, channels, values: Values::Float(values), foreign_profile: false })
}
