//! Decoding one image: PNG, JPEG, TIFF, Radiance HDR or OpenEXR, recognised by content and within limits.
//!
//! The contents of a file decide its format; a name that disagrees gives a note. Dimensions are checked before anything of
//! that size is allocated. Floating-point images must be finite.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use image::{DynamicImage, ImageDecoder, ImageFormat};
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
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_SIDE as u32);
    limits.max_image_height = Some(MOST_SIDE as u32);
    limits.max_alloc = Some(4 * MOST_VALUES);
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let channels = u64::from(decoder.color_type().channel_count());
    let bytes = decoder.color_type().bytes_per_pixel();
    let most = if u64::from(bytes) == 4 * channels { MOST_FLOATS } else { MOST_VALUES };
    check_size(path, u64::from(width), u64::from(height), channels, most)?;
    // A damaged profile does not matter.
    let foreign_profile =
        decoder.icc_profile().is_ok_and(|profile| profile.is_some_and(|bytes| !is_srgb(&bytes)));
    let decoded = DynamicImage::from_decoder(decoder).map_err(damaged)?;
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

/// OpenEXR files name their channels freely. Supported are `R`, `G`, `B`; `Y`; and a single channel of any name.
fn decode_exr(bytes: &[u8], path: &Path) -> Result<Picture, DocumentError> {
    let wrong = |problem: String| DocumentError::Picture { path: path.to_path_buf(), problem };
    let damaged = |error: exr::error::Error| wrong(format!("cannot decode the image: {error}"));
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        let size = header.layer_size;
        let channels = header.channels.list.len() as u64;
        check_size(path, size.width() as u64, size.height() as u64, channels, MOST_FLOATS)?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let list = &layer.channel_data.list;
    let named = |name: &str| list.iter().find(|channel| channel.name.eq(name));
    let chosen = match (named("R"), named("G"), named("B"), named("Y")) {
        (Some(r), Some(g), Some(b), _) => vec![r, g, b],
        (_, _, _, Some(y)) => vec![y],
        _ if list.len() == 1 => vec![&list[0]],
        _ => {
            let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
            return Err(wrong(format!("expected the channels R, G, B or Y, found {}", names.join(", "))));
        }
    };
    let channels = chosen.len();
    let mut values = vec![0.0; width * height * channels];
    for (c, channel) in chosen.into_iter().enumerate() {
        if channel.sample_data.len() != width * height {
            return Err(wrong(format!("channel {} is subsampled, which is not supported", channel.name)));
        }
        for (pixel, value) in values.chunks_exact_mut(channels).zip(channel.sample_data.values_as_f32()) {
            pixel[c] = value;
        }
    }
    Ok(Picture { width, height, channels, values: Values::Float(values), foreign_profile: false })
}
