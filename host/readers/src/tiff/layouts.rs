//! Pictures in TIFF of the kinds that the usual decoder refuses or reads wrong.
//!
//! Problem: scanners write JPEG in TIFF, old programs palettes and grey of two and four bits, Photoshop Lab, ImageMagick grey with
//! transparency and transparency that it does not call so. The decoder refuses these or drops the last channel, so that what is
//! transparent becomes black.
//! Method: the file is marked as greyscale in memory, for which the decoder returns all channels as they are stored; colours are
//! converted here. A channel beside the colours that is not named and not empty is transparency. Where colours were multiplied with
//! it, they are divided. Cost: four bytes a pixel, one for each channel. Limits: 8 and 16 bits a channel, less for palettes and grey;
//! one page ([`pages`](super::pages)); YCbCr only as JPEG.
//! Source: TIFF 6.0, sections 5, 8, 18, 21 to 23; TIFF Technical Note 4 for ICC Lab; IEC 61966-2-1 and CIE 15 by the crate `palette`.

use std::path::Path;

use ::tiff::decoder::DecodingResult;
use ::tiff::tags::Tag;
use image::ImageFormat;
use observe::Diagnosis;
use palette::convert::FromColorUnclamped;
use palette::{Lab, Srgb, white_point::D50};
use rayon::prelude::*;

use super::channels::{self, PROFILE};
use crate::picture::{Picture, Raster};
use crate::request::{Request, reduced};
use crate::resolution::{TiffDecoder, of_file, tiff_decoder};
use crate::turn::Turn;

/// Values of the photometric tag.
const WHITE_IS_ZERO: u16 = 0;
const BLACK_IS_ZERO: u16 = 1;
const RGB: u16 = 2;
const PALETTE: u16 = 3;
const YCBCR: u16 = 6;
const LAB: u16 = 8;
const ICC_LAB: u16 = 9;

/// The value of the tag of compression for JPEG.
const JPEG: u16 = 7;

/// How compressions that are not read are called, by the value of their tag.
const COMPRESSIONS: [(u16, &str); 12] = [
    (2, "CCITT"),
    (3, "CCITT fax (group 3)"),
    (6, "old-style JPEG"),
    (9, "JBIG"),
    (10, "JBIG"),
    (34_661, "JBIG"),
    (34_712, "JPEG 2000"),
    (34_925, "LZMA"),
    (50_000, "Zstandard"),
    (50_001, "WebP"),
    (50_002, "JPEG XL"),
    (34_887, "LERC"),
];

/// What a file says of its pixels.
struct About {
    photometric: u16,
    samples: usize,
    bits: u16,
    compression: u16,
    /// What the first channel beside the colours is, by the tag ExtraSamples.
    extra: Option<u16>,
    size: (u32, u32),
}

impl About {
    fn of(decoder: &mut TiffDecoder<'_>) -> Option<About> {
        let size = decoder.dimensions().ok()?;
        let mut first = |tag| {
            let values = decoder.find_tag(tag).ok().flatten()?.into_u16_vec().ok()?;
            values.first().copied()
        };
        Some(About {
            photometric: first(Tag::PhotometricInterpretation).unwrap_or(BLACK_IS_ZERO),
            samples: first(Tag::SamplesPerPixel).unwrap_or(1).into(),
            bits: first(Tag::BitsPerSample).unwrap_or(1),
            compression: first(Tag::Compression).unwrap_or(1),
            extra: first(Tag::ExtraSamples),
            size,
        })
    }

    /// How many channels colours have, if they are of a kind for this reader.
    fn colours(&self) -> Option<usize> {
        let whole = matches!(self.bits, 8 | 16);
        match self.photometric {
            WHITE_IS_ZERO | BLACK_IS_ZERO if self.samples >= 2 && whole => Some(1),
            WHITE_IS_ZERO | BLACK_IS_ZERO if self.samples == 1 && matches!(self.bits, 2 | 4) => Some(1),
            RGB if self.samples >= 4 && whole && self.extra != Some(2) => Some(3),
            PALETTE if self.samples == 1 && matches!(self.bits, 1 | 2 | 4 | 8) => Some(1),
            YCBCR if self.samples == 3 && self.bits == 8 && self.compression == JPEG => Some(3),
            LAB | ICC_LAB if self.samples >= 3 && whole => Some(3),
            _ => None,
        }
    }
}

/// Reads a picture of one of these kinds; `None` if the usual decoder reads it.
pub(crate) fn read(bytes: &[u8], name: &Path, request: &Request<'_>) -> Result<Option<Picture>, Diagnosis> {
    let Some(mut decoder) = tiff_decoder(bytes) else { return Ok(None) };
    let Some(about) = About::of(&mut decoder) else { return Ok(None) };
    let Some(colours) = about.colours() else { return Ok(None) };
    request.check(name, about.size)?;
    let map = decoder.find_tag(Tag::ColorMap).ok().flatten().and_then(|map| map.into_u16_vec().ok());
    let turn = Turn::of_tag(decoder.find_tag_unsigned(Tag::Orientation).ok().flatten());
    let profile = decoder.find_tag(PROFILE).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    drop(decoder);
    let mut grey = bytes.to_vec();
    channels::set_photometric(&mut grey);
    let pixels = about.size.0 as usize * about.size.1 as usize;
    let planes = if about.bits < 8 {
        vec![unpacked(name, &grey, &about)?]
    } else {
        channels::planes(name, &grey, about.samples, pixels)?
    };
    let mut notes = Vec::new();
    if about.bits == 16 {
        notes.push(reduced(name));
    }
    // A channel that is empty everywhere would make the whole picture transparent.
    let unnamed = !matches!(about.extra, Some(1 | 2));
    let opacity = planes.get(colours).filter(|plane| !unnamed || plane.iter().any(|&v| v > 0));
    if opacity.is_some_and(|plane| unnamed && plane.iter().any(|&v| v < 255)) {
        notes.push(format!(
            "{}: its channel {} of {} has no name; it is read as transparency",
            name.display(),
            colours + 1,
            about.samples
        ));
    }
    let palette = map.unwrap_or_default();
    let entries = palette.len() / 3;
    if about.photometric == PALETTE && entries == 0 {
        return Err(Diagnosis::of_file(name, "it has no palette").hint("save it in RGB"));
    }
    // Grey of few bits is spread over all values.
    let most = if about.photometric <= BLACK_IS_ZERO { (1u32 << about.bits.min(8)) - 1 } else { 255 };
    let channel =
        |c: usize, at: usize| planes.get(c).map_or(0, |plane| (u32::from(plane[at]) * 255 / most) as u8);
    let colour = |at: usize| -> [u8; 3] {
        let own = [channel(0, at), channel(1, at), channel(2, at)];
        match about.photometric {
            WHITE_IS_ZERO => [255 - own[0]; 3],
            BLACK_IS_ZERO => [own[0]; 3],
            PALETTE => {
                let entry = usize::from(own[0]).min(entries - 1);
                [0, 1, 2].map(|c| (palette[c * entries + entry] >> 8) as u8)
            }
            YCBCR => of_ycbcr(own),
            LAB => of_lab(own[0], [own[1], own[2]].map(|v| f32::from(v.cast_signed()))),
            ICC_LAB => of_lab(own[0], [own[1], own[2]].map(|v| f32::from(v) - 128.0)),
            _ => own,
        }
    };
    let multiplied = about.extra == Some(1);
    let pixel = |at: usize| {
        let alpha = opacity.map_or(255, |plane| plane[at]);
        let divided = |v: u8| match alpha {
            1.. if multiplied => (u32::from(v) * 255 / u32::from(alpha)).min(255) as u8,
            _ => v,
        };
        let [r, g, b] = colour(at).map(divided);
        [r, g, b, alpha]
    };
    let channels = if about.photometric <= BLACK_IS_ZERO { 1 } else { 3 } + usize::from(opacity.is_some());
    let samples = (0..pixels).into_par_iter().flat_map_iter(|at| {
        let [r, g, b, alpha] = pixel(at);
        match channels {
            1 => [r, 0, 0, 0],
            2 => [r, alpha, 0, 0],
            _ => [r, g, b, alpha],
        }
        .into_iter()
        .take(channels)
    });
    let colours = turn.raster(Raster { channels, samples: samples.collect() }, about.size);
    // Colours that were converted are no longer those of the profile.
    let converted = matches!(about.photometric, LAB | ICC_LAB);
    Ok(Some(Picture {
        name: name.into(),
        size: turn.size(about.size),
        planes: Vec::new(),
        colours: Some(colours),
        resolution: turn.dpi(of_file(bytes, ImageFormat::Tiff)),
        profile: profile.filter(|_| !converted),
        gamma: None,
        notes,
    }))
}

/// Values of less than a byte; each row begins with a byte of its own.
fn unpacked(name: &Path, bytes: &[u8], about: &About) -> Result<Vec<u8>, Diagnosis> {
    let damaged = || Diagnosis::of_file(name, "the file is damaged");
    let mut decoder = tiff_decoder(bytes).ok_or_else(damaged)?;
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(|error| refused(name, bytes, &error))?;
    let DecodingResult::U8(packed) = decoded else { return Err(damaged()) };
    let (width, bits) = (about.size.0 as usize, usize::from(about.bits));
    let stride = (width * bits).div_ceil(8);
    let mask = ((1u32 << bits) - 1) as u8;
    let value = |row: &[u8], x: usize| (row[x * bits / 8] >> (8 - bits - x * bits % 8)) & mask;
    let rows = packed.chunks_exact(stride).take(about.size.1 as usize);
    let values: Vec<u8> = rows.flat_map(|row| (0..width).map(move |x| value(row, x))).collect();
    if values.len() == width * about.size.1 as usize { Ok(values) } else { Err(damaged()) }
}

/// Why a TIFF cannot be decoded, in words for its owner.
pub(crate) fn refused(name: &Path, bytes: &[u8], error: &dyn std::fmt::Display) -> Diagnosis {
    let about = tiff_decoder(bytes).and_then(|mut decoder| About::of(&mut decoder));
    let compressed = about.as_ref().and_then(|about| {
        COMPRESSIONS.iter().find(|(value, _)| *value == about.compression).map(|(_, kind)| *kind)
    });
    let hint = "save it in RGB or grey with 8 bits a channel, uncompressed or with LZW or ZIP compression";
    let problem = match (compressed, about) {
        (Some(kind), _) => format!("it is compressed with {kind}, which is not read"),
        (None, Some(about)) => format!(
            "its pixels are not read: {} of {} bits, {} ({error})",
            match about.samples {
                1 => "one channel".to_owned(),
                samples => format!("{samples} channels"),
            },
            about.bits,
            match about.photometric {
                ..=BLACK_IS_ZERO => "grey",
                RGB => "RGB",
                PALETTE => "a palette",
                5 => "CMYK",
                YCBCR => "YCbCr",
                LAB | ICC_LAB => "Lab",
                _ => "an unknown kind of colour",
            }
        ),
        (None, None) => format!("cannot decode the picture: {error}"),
    };
    Diagnosis::of_file(name, problem).hint(hint)
}

/// Why a TIFF whose data end too early cannot be decoded although all of them are in the file; `None` if they are not.
pub(crate) fn ended(name: &Path, bytes: &[u8]) -> Option<Diagnosis> {
    let mut decoder = tiff_decoder(bytes)?;
    let about = About::of(&mut decoder)?;
    let mut all = |tag| decoder.find_tag(tag).ok().flatten()?.into_u64_vec().ok();
    let starts = all(Tag::TileOffsets).or_else(|| all(Tag::StripOffsets))?;
    let lengths = all(Tag::TileByteCounts).or_else(|| all(Tag::StripByteCounts))?;
    let is_there = |(start, length): (&u64, &u64)| start.saturating_add(*length) <= bytes.len() as u64;
    if starts.len() != lengths.len() || !starts.iter().zip(&lengths).all(is_there) {
        return None;
    }
    let kind = match about.compression {
        1 => "uncompressed",
        5 => "LZW",
        JPEG => "JPEG",
        8 | 32_946 => "ZIP",
        32_773 => "PackBits",
        _ => "compressed",
    };
    let problem = format!("its {kind} data are all there but cannot be read to their end");
    Some(Diagnosis::of_file(name, problem).hint("save it as PNG, or as TIFF without compression"))
}

/// The colour of JPEG's components, by JFIF.
fn of_ycbcr([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb]
        .map(|v| v.round().clamp(0.0, 255.0) as u8)
}

/// The colour of Lab under D50 in sRGB.
fn of_lab(l: u8, [a, b]: [f32; 2]) -> [u8; 3] {
    let lab = Lab::<D50, f32>::new(f32::from(l) / 255.0 * 100.0, a, b);
    let xyz = palette::Xyz::<D50, f32>::from_color_unclamped(lab);
    // Bradford's adaptation from D50 to D65.
    let adapted = [
        [0.955_576_6, -0.023_039_3, 0.063_163_6],
        [-0.028_289_5, 1.009_941_6, 0.021_007_7],
        [0.012_298_2, -0.020_483, 1.329_909_8],
    ]
    .map(|[x, y, z]: [f32; 3]| x * xyz.x + y * xyz.y + z * xyz.z);
    let xyz = palette::Xyz::<palette::white_point::D65, f32>::new(adapted[0], adapted[1], adapted[2]);
    let rgb = Srgb::from_color_unclamped(xyz);
    [rgb.red, rgb.green, rgb.blue].map(|v| (v * 255.0).round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lab_and_ycbcr_are_the_colours_of_their_standards() {
        // White, mid grey, and sRGB red and blue as CSS Color 4 gives them in Lab.
        for (lab, wanted) in [
            ((255, [0.0, 0.0]), [255, 255, 255]),
            ((137, [0.0, 0.0]), [128, 128, 128]),
            ((138, [80.8, 69.9]), [255, 0, 0]),
            ((75, [68.3, -112.0]), [0, 0, 255]),
        ] {
            let found = of_lab(lab.0, lab.1);
            assert!(
                (0..3).all(|c| found[c].abs_diff(wanted[c]) <= 3),
                "{lab:?}: {found:?}, wanted {wanted:?}"
            );
        }
        assert_eq!(of_ycbcr([255, 128, 128]), [255; 3]);
        assert_eq!(of_ycbcr([76, 85, 255]), [254, 0, 0]);
    }
}
