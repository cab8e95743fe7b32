//! The samples of a picture as its file stores them.
//!
//! Problem: maps, photographs and panoramas are measurements. Nothing of them may be rounded, and what a file
//! says of their colours and of the way up is the caller's to use.
//! Method: the first bytes tell the [`Format`]. [`Format::open`] reads the header, so that the caller's
//! limits come before anything of the picture's size is allocated, and [`Header::decode`] reads the samples.
//! OpenEXR and TIFF in floating point have readers of their own. Cost: the bytes of the file in memory beside
//! its samples. Limits: grey or RGB, with or without opacity; of an animation the first picture.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use image::codecs::hdr::HdrDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder as _, ImageFormat};

use crate::exr::{Floats, Primaries};
use crate::fault::Fault;
use crate::floats::FloatTiff;
use crate::resolution::{Dpi, of_file};
use crate::{Bounds, Opened, exr, floats, gamma, limits};

/// The format of a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format(ImageFormat);

impl Format {
    /// The format by the first bytes; that of Targa files, which have no signature, by the ending of their
    /// name.
    ///
    /// # Errors
    /// An empty file, or one of no known format.
    pub fn of(bytes: &[u8], path: &Path) -> Result<Format, Fault> {
        let found = if bytes.is_empty() { "an empty file" } else { "another format" };
        crate::format(bytes, path).map(Format).ok_or(Fault::Unknown(found))
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self.0 {
            ImageFormat::Png => "PNG",
            ImageFormat::Jpeg => "JPEG",
            ImageFormat::Tiff => "TIFF",
            ImageFormat::WebP => "WebP",
            ImageFormat::Tga => "Targa",
            ImageFormat::Bmp => "BMP",
            ImageFormat::Gif => "GIF",
            ImageFormat::Pnm => "PNM",
            ImageFormat::Hdr => "Radiance HDR",
            ImageFormat::OpenExr => "OpenEXR",
            _ => "another format",
        }
    }

    /// Whether the ending of a name says that a file has another format.
    pub fn contradicts(self, path: &Path) -> bool {
        ImageFormat::from_path(path).is_ok_and(|named| named != self.0)
    }

    /// The resolution that a file of this format states.
    pub fn resolution(self, bytes: &[u8]) -> Option<Dpi> {
        of_file(bytes, self.0)
    }

    /// Reads the header of a picture.
    ///
    /// # Errors
    /// A damaged file, a kind of pixels that is not decoded, or a larger picture than allowed.
    pub fn open(self, bytes: &[u8], bounds: Bounds) -> Result<Header<'_>, Fault> {
        let of_floats = |size, channels, turn, decoder| Header {
            size,
            channels,
            is_float: true,
            turn,
            profile: None,
            gamma: None,
            exposure: 1.0,
            bounds,
            decoder,
        };
        if self.0 == ImageFormat::OpenExr {
            let (size, channels) = exr::largest(bytes)?;
            return Ok(of_floats(size, channels, Orientation::NoTransforms, Decoder::Exr(bytes)));
        }
        if self.0 == ImageFormat::Tiff
            && let Some(mut file) = floats::float_tiff(bytes)?
        {
            return Ok(of_floats(file.size(), file.channels(), file.turn(), Decoder::Tiff(Box::new(file))));
        }
        let mut exposure = 1.0;
        let mut opened = if self.0 == ImageFormat::Hdr {
            // The decoder knows only one of the two signatures.
            let renamed = bytes.strip_prefix(b"#?RGBE").map(|rest| [b"#?RADIANCE", rest].concat());
            let bytes: Cow<'_, [u8]> = renamed.map_or(Cow::Borrowed(bytes), Cow::Owned);
            let mut decoder = HdrDecoder::new(Cursor::new(bytes))?;
            exposure = decoder.metadata().exposure.unwrap_or(1.0);
            decoder.set_limits(limits(bounds))?;
            Opened { decoder: Box::new(decoder) }
        } else {
            crate::open(bytes, self.0, bounds)?
        };
        let colour = opened.colour();
        let channels = usize::from(colour.channel_count());
        Ok(Header {
            size: opened.size(),
            channels,
            is_float: usize::from(colour.bytes_per_pixel()) == 4 * channels,
            turn: opened.orientation(),
            profile: opened.profile(),
            gamma: if self.0 == ImageFormat::Png { gamma(bytes) } else { None },
            exposure,
            bounds,
            decoder: Decoder::Whole(opened),
        })
    }
}

/// A picture whose header was read.
pub struct Header<'a> {
    size: (u32, u32),
    channels: usize,
    is_float: bool,
    turn: Orientation,
    profile: Option<Vec<u8>>,
    gamma: Option<f64>,
    exposure: f32,
    bounds: Bounds,
    decoder: Decoder<'a>,
}

enum Decoder<'a> {
    Exr(&'a [u8]),
    Tiff(Box<FloatTiff<'a>>),
    Whole(Opened<'a>),
}

impl Header<'_> {
    /// Pixels across and down; those of the largest part if there are several.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Samples of a pixel; those of the largest part if there are several.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Whether the samples are floating point.
    pub fn is_float(&self) -> bool {
        self.is_float
    }

    /// Its pixels as they are stored.
    ///
    /// # Errors
    /// A damaged file, one that needs more memory than allowed, or pixels that are not grey or RGB.
    pub fn decode(self) -> Result<Stored, Fault> {
        let Header { size: (width, height), channels, turn, profile, gamma, exposure, bounds, .. } = self;
        let side = bounds.side.is_some_and(|most| width.max(height) > most);
        // Of what is whole the decoder keeps account.
        let large = 4 * channels as u64 * u64::from(width) * u64::from(height) > bounds.bytes;
        if !matches!(self.decoder, Decoder::Whole(_)) && (side || large) {
            return Err(Fault::Large(format!("{width} x {height} pixels are more than can be read")));
        }
        let floats = match self.decoder {
            Decoder::Exr(bytes) => exr::exr(bytes)?,
            Decoder::Tiff(file) => file.decode()?,
            Decoder::Whole(opened) => {
                let image = opened.decode()?;
                let (width, height) = (image.width() as usize, image.height() as usize);
                let (channels, samples) = samples(image)?;
                let primaries = None;
                return Ok(Stored {
                    width,
                    height,
                    channels,
                    samples,
                    profile,
                    gamma,
                    primaries,
                    exposure,
                    turn,
                });
            }
        };
        let Floats { width, height, channels, values, primaries } = floats;
        let samples = Samples::Float(values);
        Ok(Stored { width, height, channels, samples, profile, gamma, primaries, exposure, turn })
    }
}

/// The number of samples of a pixel, and the samples.
fn samples(image: DynamicImage) -> Result<(usize, Samples), Fault> {
    Ok(match image {
        DynamicImage::ImageLuma8(p) => (1, Samples::Eight(p.into_raw())),
        DynamicImage::ImageLumaA8(p) => (2, Samples::Eight(p.into_raw())),
        DynamicImage::ImageRgb8(p) => (3, Samples::Eight(p.into_raw())),
        DynamicImage::ImageRgba8(p) => (4, Samples::Eight(p.into_raw())),
        DynamicImage::ImageLuma16(p) => (1, Samples::Sixteen(p.into_raw())),
        DynamicImage::ImageLumaA16(p) => (2, Samples::Sixteen(p.into_raw())),
        DynamicImage::ImageRgb16(p) => (3, Samples::Sixteen(p.into_raw())),
        DynamicImage::ImageRgba16(p) => (4, Samples::Sixteen(p.into_raw())),
        DynamicImage::ImageRgb32F(p) => (3, Samples::Float(p.into_raw())),
        DynamicImage::ImageRgba32F(p) => (4, Samples::Float(p.into_raw())),
        other => {
            let kind = other.color();
            return Err(Fault::Kind(format!(
                "pixels of type {kind:?} are not supported; save the image as RGB"
            )));
        }
    })
}

/// Samples, interleaved, rows from the top.
#[derive(Clone, PartialEq, Debug)]
pub enum Samples {
    /// 0 to 255.
    Eight(Vec<u8>),
    /// 0 to 65535.
    Sixteen(Vec<u16>),
    /// Any scale.
    Float(Vec<f32>),
}

impl Samples {
    /// The samples in 8 bits: deeper ones are rounded, and floating point is that of 0 to 1.
    #[must_use]
    pub fn into_eight(self) -> Vec<u8> {
        match self {
            Samples::Eight(samples) => samples,
            Samples::Sixteen(samples) => {
                samples.iter().map(|&v| ((u32::from(v) + 128) / 257) as u8).collect()
            }
            Samples::Float(samples) => {
                samples.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
            }
        }
    }

    /// Index and value of the first sample that is no finite number.
    pub fn not_finite(&self) -> Option<(usize, f32)> {
        let Samples::Float(samples) = self else { return None };
        samples.iter().position(|v| !v.is_finite()).map(|at| (at, samples[at]))
    }
}

/// A picture as its file stores it.
#[derive(Clone, PartialEq, Debug)]
pub struct Stored {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Samples of a pixel: grey; grey and opacity; red, green, blue; these and opacity.
    pub channels: usize,
    /// The samples.
    pub samples: Samples,
    /// The colour profile, which is not applied.
    pub profile: Option<Vec<u8>>,
    /// The power of light that the values of a PNG are, if it states another than that of sRGB.
    pub gamma: Option<f64>,
    /// The colours that the values are amounts of, if the file states them.
    pub primaries: Option<Primaries>,
    /// What the program that wrote a Radiance file multiplied the values by.
    pub exposure: f32,
    turn: Orientation,
}

impl Stored {
    /// Whether the file says that the picture is turned before it is shown.
    pub fn is_turned(&self) -> bool {
        self.turn != Orientation::NoTransforms
    }

    /// The picture the right way up, as the file states it.
    #[must_use]
    pub fn upright(mut self) -> Stored {
        let size = (self.width, self.height);
        self.samples = match self.samples {
            Samples::Eight(v) => Samples::Eight(turned(v, size, self.channels, self.turn)),
            Samples::Sixteen(v) => Samples::Sixteen(turned(v, size, self.channels, self.turn)),
            Samples::Float(v) => Samples::Float(turned(v, size, self.channels, self.turn)),
        };
        if on_its_side(self.turn) {
            (self.width, self.height) = (self.height, self.width);
        }
        self.turn = Orientation::NoTransforms;
        self
    }

    /// Red, green and blue of each pixel, without its opacity.
    #[must_use]
    pub fn into_rgb(self) -> Samples {
        match self.samples {
            Samples::Eight(v) => Samples::Eight(rgb(v, self.channels)),
            Samples::Sixteen(v) => Samples::Sixteen(rgb(v, self.channels)),
            Samples::Float(v) => Samples::Float(rgb(v, self.channels)),
        }
    }
}

fn rgb<T: Copy>(samples: Vec<T>, channels: usize) -> Vec<T> {
    match channels {
        3 => samples,
        4 => samples.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect(),
        _ => samples.chunks_exact(channels).flat_map(|pixel| [pixel[0]; 3]).collect(),
    }
}

/// Whether rows become columns.
fn on_its_side(turn: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(turn, Rotate90 | Rotate90FlipH | Rotate270 | Rotate270FlipH)
}

fn turned<T: Copy>(
    samples: Vec<T>,
    (width, height): (usize, usize),
    channels: usize,
    turn: Orientation,
) -> Vec<T> {
    if turn == Orientation::NoTransforms {
        return samples;
    }
    let (across, down) = if on_its_side(turn) { (height, width) } else { (width, height) };
    let (right, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
    let mut out = Vec::with_capacity(samples.len());
    for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
        let (from_x, from_y) = match turn {
            Orientation::NoTransforms => (x, y),
            Orientation::FlipHorizontal => (right - x, y),
            Orientation::Rotate180 => (right - x, bottom - y),
            Orientation::FlipVertical => (x, bottom - y),
            Orientation::Rotate90FlipH => (y, x),
            Orientation::Rotate90 => (y, bottom - x),
            Orientation::Rotate270FlipH => (right - y, bottom - x),
            Orientation::Rotate270 => (right - y, x),
        };
        let at = channels * (from_y * width + from_x);
        out.extend_from_slice(&samples[at..at + channels]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { side: None, bytes: 1 << 30 };

    #[test]
    fn every_turn_is_that_of_the_decoders_library() {
        let picture = image::GrayImage::from_fn(3, 2, |x, y| image::Luma([(10 * y + x) as u8]));
        for number in 1..=8 {
            let turn = Orientation::from_exif(number).unwrap();
            let mut wanted = DynamicImage::ImageLuma8(picture.clone());
            wanted.apply_orientation(turn);
            let found = turned(picture.as_raw().clone(), (3, 2), 1, turn);
            assert_eq!(found, wanted.to_luma8().into_raw(), "{number}");
            let (width, height) = if on_its_side(turn) { (2, 3) } else { (3, 2) };
            assert_eq!((width, height), (wanted.width(), wanted.height()), "{number}");
        }
    }

    #[test]
    fn deep_samples_are_rounded_as_the_library_rounds_them() {
        let all: Vec<u16> = (0..=u16::MAX).collect();
        let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(256, 256, all.clone()).unwrap();
        let wanted = DynamicImage::ImageLuma16(deep).into_luma8().into_raw();
        assert_eq!(Samples::Sixteen(all).into_eight(), wanted);
        assert_eq!(Samples::Float(vec![-1.0, 0.5, 2.0, f32::NAN]).into_eight(), [0, 128, 255, 0]);
    }

    #[test]
    fn grey_becomes_rgb_and_opacity_goes() {
        for (channels, samples) in [(1, vec![7]), (2, vec![7, 1]), (3, vec![7; 3]), (4, vec![7, 7, 7, 1])] {
            assert_eq!(rgb(samples, channels), [7; 3]);
        }
    }

    #[test]
    fn radiance_is_read_by_either_signature_with_its_exposure() {
        for signature in ["#?RADIANCE", "#?RGBE"] {
            let head = format!("{signature}\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4\n\n-Y 1 +X 1\n");
            // 128 at an exponent of 128 is a half.
            let bytes = [head.as_bytes(), &[128, 64, 0, 128]].concat();
            let format = Format::of(&bytes, Path::new("a")).unwrap();
            assert_eq!(format.name(), "Radiance HDR");
            let stored = format.open(&bytes, BOUNDS).unwrap().decode().unwrap();
            assert_eq!((stored.exposure, stored.samples), (4.0, Samples::Float(vec![0.5, 0.25, 0.0])));
        }
    }

    #[test]
    fn what_is_no_picture_is_told_apart_from_what_is_damaged() {
        let of = |bytes: &[u8]| Format::of(bytes, Path::new("a.png"));
        assert_eq!(of(b""), Err(Fault::Unknown("an empty file")));
        assert_eq!(of(b"text"), Err(Fault::Unknown("another format")));
        for start in [&b"\x89PNG\r\n\x1a\n"[..], b"\x76\x2f\x31\x01", b"II*\0"] {
            let fault = of(start).unwrap().open(start, BOUNDS).map(|_| ()).unwrap_err();
            assert!(matches!(fault, Fault::Damaged(_) | Fault::Unsupported(_)), "{start:?}: {fault:?}");
        }
    }
}
