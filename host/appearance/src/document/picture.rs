//! Decoding one image: PNG, JPEG, TIFF, WebP, Targa, BMP, Radiance HDR or OpenEXR, recognised by content and within limits.
//!
//! The contents of a file decide its format; a name that disagrees gives a note. Targa has no signature: its name decides. Dimensions are checked before anything of
//! that size is allocated. Floating-point images must be finite.

pub(super) mod primaries;

use maths::Maths;
use std::path::Path;

use rayon::prelude::*;
use readers::{Bounds, Fault, Format, Primaries, Samples, Stored};

use super::content::ColourSpace;
use super::error::DocumentError;
use super::source::Source;
use super::texture::Plane;
use crate::srgb;
use primaries::to_rec_709;

/// The most pixels of a document, as memory must hold them: the largest page has 38 million dots, and no
/// known document has more.
pub const MOST_PIXELS: u64 = 1 << 26;

/// The most pixels along one side: twice the dots of the longest page, so that a row is small whatever a file
/// says.
const MOST_SIDE: u64 = 16_384;

/// The most values (pixels times channels) in one image: four channels of the most pixels.
const MOST_VALUES: u64 = 1 << 28;

/// The most values of floating point in one image: they take four bytes each, and twice that while they are decoded.
const MOST_FLOATS: u64 = 1 << 26;

/// The formats of maps.
const FORMATS: [&str; 8] = ["PNG", "JPEG", "TIFF", "WebP", "Targa", "BMP", "Radiance HDR", "OpenEXR"];

/// A decoded image with 1 to 4 channels: grey, grey and alpha, RGB, or RGB and alpha.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels across, at least 1.
    pub width: usize,
    /// Pixels down, at least 1.
    pub height: usize,
    channels: usize,
    values: Samples,
    foreign_profile: bool,
    /// The power that a PNG states for its values.
    gamma: Option<f64>,
    /// To linear Rec. 709, if a file states other primaries.
    matrix: Option<[[f64; 3]; 3]>,
}

/// How numbers encode colours.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Encoding {
    /// The transfer curve of IEC 61966-2-1.
    Srgb,
    /// Proportional to reflectance.
    Linear,
    /// This power of reflectance, as a file states it.
    Power(f64),
}

impl Encoding {
    /// The linear value of an encoded one.
    pub fn linear(self, v: f32) -> f32 {
        match self {
            Encoding::Linear => v,
            Encoding::Srgb => srgb::decode(v),
            Encoding::Power(power) => v.max(0.0).power((1.0 / power) as f32),
        }
    }
}

impl From<ColourSpace> for Encoding {
    fn from(space: ColourSpace) -> Encoding {
        match space {
            ColourSpace::Srgb => Encoding::Srgb,
            ColourSpace::Linear => Encoding::Linear,
        }
    }
}

impl Picture {
    /// Decodes the bytes of a file; `path` names it in errors and notes. Alpha, if there is any, is ignored with a note.
    pub fn decode(bytes: &[u8], path: &Path, source: &mut Source<'_>) -> Result<Picture, DocumentError> {
        let picture = Picture::decode_with_alpha(bytes, path, source)?;
        if picture.has_alpha() && !picture.is_opaque() {
            source.note(format!("{}: alpha is ignored; every pixel is printed", path.display()));
        }
        Ok(picture)
    }

    /// Decodes the bytes of a file whose alpha is a map of its own.
    pub fn decode_with_alpha(
        bytes: &[u8],
        path: &Path,
        source: &mut Source<'_>,
    ) -> Result<Picture, DocumentError> {
        let wrong = |problem: String| DocumentError::Picture { path: path.to_path_buf(), problem };
        let format = Format::of(bytes, path).and_then(|format| match FORMATS.contains(&format.name()) {
            true => Ok(format),
            false => Err(Fault::Unknown("another format")),
        });
        let format = format.map_err(|fault| {
            wrong(format!(
                "expected a PNG, JPEG, TIFF, WebP, Targa, BMP, OpenEXR or Radiance HDR image, {fault}"
            ))
        })?;
        if format.contradicts(path) {
            let kind = format.name();
            source.note(format!("{}: read as {kind}, which it is despite its name", path.display()));
        }
        let unread = |fault: Fault| {
            wrong(match fault {
                Fault::Large(_) => format!(
                    "the image has more than {MOST_SIDE} pixels along a side or needs too much memory; \
                     make it smaller"
                ),
                Fault::Unsupported(said) => {
                    format!(
                        "cannot decode the image: {said}; save it as an 8-bit or 16-bit PNG, or as OpenEXR"
                    )
                }
                Fault::Damaged(said) => format!("cannot decode the image: {said}"),
                Fault::Kind(_) | Fault::Unknown(_) => fault.to_string(),
            })
        };
        let bounds = Bounds { side: Some(MOST_SIDE as u32), bytes: 4 * MOST_VALUES };
        let header = format.open(bytes, bounds).map_err(unread)?;
        let most = if header.is_float() { MOST_FLOATS } else { MOST_VALUES };
        check_size(path, header.size(), header.channels() as u64, most)?;
        let stored = header.decode().map_err(unread)?;
        if let Some((at, value)) = stored.samples.not_finite() {
            let (pixel, channel) = (at / stored.channels, at % stored.channels);
            return Err(wrong(format!(
                "pixel ({}, {}) channel {channel} is {value}, not a finite number",
                pixel % stored.width,
                pixel / stored.width,
            )));
        }
        let turned = stored.is_turned();
        let Stored { width, height, channels, samples: values, profile, gamma, primaries, .. } = stored;
        let matrix = primaries.as_ref().map_or(Ok(None), to_rec_709).map_err(wrong)?;
        // A damaged profile does not matter.
        let foreign_profile = profile.is_some_and(|bytes| !is_srgb(&bytes));
        let picture = Picture { width, height, channels, values, foreign_profile, gamma, matrix };
        if turned {
            source.note(format!(
                "{}: the file says that it is turned before it is shown (orientation); maps are read as they are stored",
                path.display()
            ));
        }
        Ok(picture)
    }

    /// Whether the values are floating point, as in EXR and HDR files.
    pub fn is_float(&self) -> bool {
        matches!(self.values, Samples::Float(_))
    }

    /// Whether it has a colour profile other than sRGB. Profiles are never applied, and data maps do not need them.
    pub fn has_foreign_profile(&self) -> bool {
        self.foreign_profile
    }

    /// The values of a 16-bit grey image, 0 to 65535.
    pub fn sixteen(&self) -> Option<&[u16]> {
        match &self.values {
            Samples::Sixteen(values) if self.channels == 1 => Some(values),
            _ => None,
        }
    }

    /// Channels without alpha: 1 or 3.
    pub fn colours(&self) -> usize {
        if self.channels < 3 { 1 } else { 3 }
    }

    /// Whether its colours are equal, up to what a JPEG changes.
    pub fn is_grey(&self) -> bool {
        let green = self.channel(1);
        let alike = |other: Plane| green.values().zip(other.values()).all(|(a, b)| (a - b).abs() <= 0.02);
        self.colours() == 1 || alike(self.channel(0)) && alike(self.channel(2))
    }

    /// Whether there is a channel of alpha.
    pub fn has_alpha(&self) -> bool {
        self.channels == 2 || self.channels == 4
    }

    fn is_opaque(&self) -> bool {
        let (channels, last) = (self.channels, self.channels - 1);
        match &self.values {
            Samples::Eight(v) => v.chunks_exact(channels).all(|p| p[last] == u8::MAX),
            Samples::Sixteen(v) => v.chunks_exact(channels).all(|p| p[last] == u16::MAX),
            Samples::Float(v) => v.chunks_exact(channels).all(|p| p[last] >= 1.0),
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
            Samples::Eight(v) => {
                Plane::eight(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
            Samples::Sixteen(v) => {
                Plane::sixteen(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
            Samples::Float(v) => {
                Plane::new(width, height, v.par_chunks_exact(channels).map(|p| p[at]).collect())
            }
        }
    }

    /// The default encoding of its colours: as the file states, or linear for floating point, sRGB for integers.
    pub fn natural_encoding(&self) -> Encoding {
        match self.gamma {
            _ if self.is_float() => Encoding::Linear,
            Some(power) => Encoding::Power(power),
            None => Encoding::Srgb,
        }
    }

    /// Whether its colours have other primaries than Rec. 709; they are converted.
    pub fn has_other_primaries(&self) -> bool {
        self.matrix.is_some()
    }

    /// One colour channel as linear values.
    fn linear_channel(&self, channel: usize, encoding: Encoding) -> Plane {
        let plane = self.channel(channel);
        match encoding {
            Encoding::Linear => plane,
            encoding => plane.map(|v| encoding.linear(v)),
        }
    }

    /// The same with the primaries that a document states, whatever the file says.
    pub fn with_primaries(mut self, primaries: Option<&Primaries>) -> Picture {
        if let Some(stated) = primaries {
            self.matrix = to_rec_709(stated).ok().flatten();
        }
        self
    }

    /// The colours as linear values of Rec. 709.
    pub fn linear(&self, encoding: Encoding) -> [Plane; 3] {
        if self.colours() == 1 {
            let grey = self.linear_channel(0, encoding);
            return [grey.clone(), grey.clone(), grey];
        }
        let planes = [0, 1, 2].map(|channel| self.linear_channel(channel, encoding));
        let Some(matrix) = self.matrix else { return planes };
        matrix.map(|row| {
            let mixed = |pixel| (0..3).map(|c| row[c] * f64::from(planes[c].at(pixel))).sum::<f64>() as f32;
            let values = (0..self.width * self.height).into_par_iter().map(mixed).collect();
            Plane::new(self.width, self.height, values)
        })
    }
}

/// Whether a colour profile is named sRGB, in either of the text encodings of profiles.
fn is_srgb(profile: &[u8]) -> bool {
    profile.windows(4).any(|w| w == b"sRGB") || profile.windows(8).any(|w| w == b"\0s\0R\0G\0B")
}

/// Checks that a size is plausible, before anything is allocated.
fn check_size(
    path: &Path,
    (width, height): (u32, u32),
    channels: u64,
    most: u64,
) -> Result<(), DocumentError> {
    let (width, height) = (u64::from(width), u64::from(height));
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
