//! TIFF files whose channels have names: CMYK plates, spot channels, or both.
//!
//! Problem: drawing programs export spot inks as extra channels. Their names stand in one of two places, and
//! a full plate is either the largest value or zero.
//! Method: names come from the InkNames tag (every channel is an ink, the largest value is full) or from
//! Photoshop's resource block (extra channels only, 0 is full, as Photoshop displays them). CMYK channels are
//! the plates of the process inks. An extra channel that the file calls opacity, and whose name nobody wants,
//! is the transparency of all others. The decoder drops extra channels unless the file is greyscale, so the
//! photometric tag is changed in memory first.
//! Cost: the file in memory twice, and one byte a pixel for each channel. Limits: 8 and 16 bits a channel;
//! one page ([`pages`](super::pages)). Source: TIFF 6.0 sections 16 and 18; Adobe's file format specification
//! for the resource block.

use std::path::Path;

use ::tiff::decoder::DecodingResult;
use ::tiff::tags::Tag;
use image::ImageFormat;
use observe::Diagnosis;

use super::pages;
use crate::picture::{Picture, Plane, PlaneKind, Process, Raster};
use crate::request::Request;
use crate::resolution::{TiffDecoder, of_file, tiff_decoder};
use crate::turn::Turn;

const INK_SET: Tag = Tag::Unknown(332);
const PHOTOSHOP: Tag = Tag::Unknown(34377);
pub(super) const PROFILE: Tag = Tag::Unknown(34675);
const PHOTOMETRIC: u16 = 262;
const INK_NAMES: u16 = 333;

/// Values of the photometric tag.
const BLACK_IS_ZERO: u16 = 1;
const RGB: u16 = 2;
const SEPARATED: u16 = 5;

/// The most channels of a file.
const MOST_CHANNELS: usize = 24;

/// A channel of the file.
enum Channel {
    /// Of its colours.
    Colour,
    /// Of these planes.
    Plane(String, PlaneKind),
    /// Its opacity, and whether all others were multiplied with it.
    Opacity { multiplied: bool },
}

/// Reads a TIFF with plates, or with extra channels of which any is `wanted`; `None` if it is a plain
/// picture.
pub(crate) fn read(
    bytes: &[u8],
    name: &Path,
    wanted: &dyn Fn(&str) -> bool,
    request: &Request<'_>,
) -> Result<Option<Picture>, Diagnosis> {
    let Some(mut decoder) = tiff_decoder(bytes) else { return Ok(None) };
    let number = |decoder: &mut TiffDecoder<'_>, tag| decoder.find_tag_unsigned::<u16>(tag).ok().flatten();
    let photometric = number(&mut decoder, Tag::PhotometricInterpretation).unwrap_or(BLACK_IS_ZERO);
    let samples = usize::from(number(&mut decoder, Tag::SamplesPerPixel).unwrap_or(1));
    let ink_set = number(&mut decoder, INK_SET).unwrap_or(1);
    let base = match (photometric, ink_set) {
        (SEPARATED, 2) => 0,
        (SEPARATED, _) => 4,
        (RGB, _) => 3,
        (BLACK_IS_ZERO, _) => 1,
        _ => return Ok(None),
    };
    if samples > MOST_CHANNELS {
        let problem = format!("it has {samples} channels; expected at most {MOST_CHANNELS}");
        return Err(Diagnosis::of_file(name, problem));
    }
    if samples < base || samples == base && photometric != SEPARATED {
        return Ok(None);
    }
    let (named_inks, named_extra) = (ink_names(bytes), photoshop_names(&mut decoder));
    // An extra channel without a name is transparency.
    if photometric != SEPARATED && named_extra.is_empty() {
        return Ok(None);
    }
    let named = Names { inks: named_inks, extra: named_extra, kinds: extra_samples(&mut decoder) };
    let channels = channels(name, (base, samples), &named, photometric, wanted)?;
    let is_wanted =
        |channel: &Channel| matches!(channel, Channel::Plane(name, PlaneKind::Plate { .. }) if wanted(name));
    if photometric != SEPARATED && !channels.iter().any(is_wanted) {
        return Ok(None);
    }
    let size = decoder
        .dimensions()
        .map_err(|error| Diagnosis::of_file(name, format!("the file is damaged: {error}")))?;
    request.check(name, size)?;
    let turn = Turn::of_tag(number(&mut decoder, Tag::Orientation));
    let profile = decoder.find_tag(PROFILE).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    drop(decoder);
    let mut grey = bytes.to_vec();
    set_photometric(&mut grey);
    let stored = planes(name, &grey, samples, size.0 as usize * size.1 as usize)?;
    drop(grey);
    let mut stored: Vec<_> = stored.into_iter().map(|plane| turn.plane(plane, size)).collect();
    let opacity = channels.iter().zip(&stored).find_map(|(channel, plane)| match channel {
        Channel::Opacity { multiplied } => Some((*multiplied, plane.clone())),
        _ => None,
    });
    let colours = (photometric != SEPARATED).then(|| colours(&stored[..base], opacity.as_ref()));
    if let (SEPARATED, Some((false, opacity))) = (photometric, &opacity) {
        // A spot channel is a plate of its own, which no transparency of the picture thins.
        for plate in &mut stored[..base] {
            let times = |(v, &a): (&mut u8, &u8)| *v = ((u32::from(*v) * u32::from(a) + 127) / 255) as u8;
            plate.iter_mut().zip(opacity).for_each(times);
        }
    }
    let plane = |(channel, mut samples): (Channel, Vec<u8>)| match channel {
        Channel::Colour => None,
        Channel::Opacity { .. } => Some(Plane { name: String::new(), kind: PlaneKind::Opacity, samples }),
        Channel::Plane(name, kind) => {
            if kind == (PlaneKind::Plate { inverted: true }) {
                samples.iter_mut().for_each(|v| *v = 255 - *v);
            }
            Some(Plane { name, kind, samples })
        }
    };
    Ok(Some(Picture {
        name: name.into(),
        size: turn.size(size),
        planes: channels.into_iter().zip(stored).filter_map(plane).collect(),
        colours,
        resolution: turn.dpi(of_file(bytes, ImageFormat::Tiff)),
        profile,
        gamma: None,
        notes: Vec::new(),
    }))
}

/// Grey or red, green and blue, with the opacity if there is one.
fn colours(planes: &[Vec<u8>], opacity: Option<&(bool, Vec<u8>)>) -> Raster {
    let colour = |plane: &Vec<u8>, at: usize| match opacity {
        Some((true, opacity)) if opacity[at] > 0 => {
            (u32::from(plane[at]) * 255 / u32::from(opacity[at])).min(255) as u8
        }
        _ => plane[at],
    };
    let pixels = 0..planes.first().map_or(0, Vec::len);
    let samples = pixels.flat_map(|at| {
        let own = planes.iter().map(move |plane| colour(plane, at));
        own.chain(opacity.map(|(_, opacity)| opacity[at]))
    });
    Raster { samples: samples.collect(), channels: planes.len() + usize::from(opacity.is_some()) }
}

/// What a file says of its channels.
struct Names {
    /// Names of all inks.
    inks: Vec<String>,
    /// Photoshop's names of the extra channels.
    extra: Vec<String>,
    /// Values of ExtraSamples, one for each of the last channels.
    kinds: Vec<u16>,
}

fn extra_samples(decoder: &mut TiffDecoder<'_>) -> Vec<u16> {
    let values = decoder.find_tag(Tag::ExtraSamples).ok().flatten();
    values.and_then(|value| value.into_u16_vec().ok()).unwrap_or_default()
}

fn channels(
    name: &Path,
    (base, samples): (usize, usize),
    named: &Names,
    photometric: u16,
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Vec<Channel>, Diagnosis> {
    let mut channels = Vec::new();
    // Opacity may be among Photoshop's names or not.
    let all_named = named.extra.len() >= samples - base;
    let mut extra = named.extra.iter();
    for at in 0..samples {
        if at < base {
            let plate = Process::ALL.get(at).filter(|_| photometric == SEPARATED);
            let plane = |&plate| Channel::Plane(String::new(), PlaneKind::Process(plate));
            channels.push(plate.map_or(Channel::Colour, plane));
            continue;
        }
        let kind = (at + named.kinds.len()).checked_sub(samples).and_then(|at| named.kinds.get(at));
        // By the tag ExtraSamples.
        let multiplied = match kind {
            Some(1) => Some(true),
            Some(2) => Some(false),
            _ => None,
        };
        let of_photoshop = if multiplied.is_none() || all_named { extra.next() } else { None };
        channels.push(match (named.inks.get(at), of_photoshop, multiplied) {
            (Some(name), ..) if base == 0 || named.inks.len() == samples => {
                Channel::Plane(name.clone(), PlaneKind::Plate { inverted: false })
            }
            (_, Some(name), multiplied) if multiplied.is_none() || wanted(name) => {
                Channel::Plane(name.clone(), PlaneKind::Plate { inverted: true })
            }
            (.., Some(multiplied)) => Channel::Opacity { multiplied },
            _ => {
                let problem = format!("channel {} of {samples} has no name", at + 1);
                return Err(Diagnosis::of_file(name, problem));
            }
        });
    }
    Ok(channels)
}

/// Names of all inks: consecutive texts that end in NUL. The decoder itself stops at the first.
fn ink_names(bytes: &[u8]) -> Vec<String> {
    let text = pages::field(bytes, INK_NAMES).and_then(|field| bytes.get(field)).unwrap_or_default();
    let names = text.split(|&byte| byte == 0).map(|name| String::from_utf8_lossy(name).trim().to_owned());
    names.filter(|name| !name.is_empty()).collect()
}

/// Names of the extra channels, from Photoshop's resource block.
fn photoshop_names(decoder: &mut TiffDecoder<'_>) -> Vec<String> {
    let block = decoder.find_tag(PHOTOSHOP).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    let block = block.unwrap_or_default();
    let (mut plain, mut unicode) = (Vec::new(), Vec::new());
    let mut rest = block.as_slice();
    while let Some((id, data, after)) = resource(rest) {
        match id {
            1006 => plain = pascal_strings(data),
            1045 => unicode = unicode_strings(data),
            _ => {}
        }
        rest = after;
    }
    if unicode.is_empty() { plain } else { unicode }
}

/// The first resource: its number, its data, and the bytes after it. Names and data are padded to even lengths.
fn resource(block: &[u8]) -> Option<(u16, &[u8], &[u8])> {
    let rest = block.strip_prefix(b"8BIM")?;
    let (id, rest) = rest.split_first_chunk::<2>()?;
    let name = (1 + usize::from(*rest.first()?)).next_multiple_of(2);
    let (size, rest) = rest.get(name..)?.split_first_chunk::<4>()?;
    let size = u32::from_be_bytes(*size) as usize;
    let data = rest.get(..size)?;
    Some((u16::from_be_bytes(*id), data, rest.get(size.next_multiple_of(2)..).unwrap_or_default()))
}

fn pascal_strings(mut data: &[u8]) -> Vec<String> {
    let mut strings = Vec::new();
    while let Some((&length, rest)) = data.split_first()
        && let Some(text) = rest.get(..usize::from(length))
    {
        strings.push(String::from_utf8_lossy(text).into_owned());
        data = &rest[text.len()..];
    }
    strings
}

fn unicode_strings(mut data: &[u8]) -> Vec<String> {
    let mut strings = Vec::new();
    while let Some((length, rest)) = data.split_first_chunk::<4>()
        && let Some(text) = (u32::from_be_bytes(*length) as usize).checked_mul(2).and_then(|n| rest.get(..n))
    {
        let units: Vec<u16> = text.as_chunks::<2>().0.iter().map(|&two| u16::from_be_bytes(two)).collect();
        strings.push(String::from_utf16_lossy(&units).trim_end_matches('\0').to_owned());
        data = &rest[text.len()..];
    }
    strings
}

/// Marks the first image as greyscale, so that the decoder returns all of its channels.
pub(super) fn set_photometric(bytes: &mut [u8]) {
    let grey =
        if bytes.starts_with(b"II") { BLACK_IS_ZERO.to_le_bytes() } else { BLACK_IS_ZERO.to_be_bytes() };
    // The decoder refuses a file without the field.
    if let Some(value) =
        pages::field(bytes, PHOTOMETRIC).filter(|f| f.len() == 2).and_then(|field| bytes.get_mut(field))
    {
        value.copy_from_slice(&grey);
    }
}

/// One byte a pixel for each channel.
pub(super) fn planes(
    name: &Path,
    bytes: &[u8],
    samples: usize,
    pixels: usize,
) -> Result<Vec<Vec<u8>>, Diagnosis> {
    let bad = |error: ::tiff::TiffError| {
        Diagnosis::of_file(name, format!("cannot decode its channels: {error}"))
            .hint("save it uncompressed or with LZW, 8 or 16 bits")
    };
    let Some(mut decoder) = tiff_decoder(bytes) else {
        return Err(Diagnosis::of_file(name, "the file is damaged"));
    };
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(bad)?;
    let values: Vec<u8> = match decoded {
        DecodingResult::U8(values) => values,
        DecodingResult::U16(values) => values.into_iter().map(|v| (v >> 8) as u8).collect(),
        _ => {
            return Err(Diagnosis::of_file(name, "its channels have neither 8 nor 16 bits")
                .hint("save it with 8 bits"));
        }
    };
    if values.len() != samples * pixels {
        return Err(Diagnosis::of_file(name, "it has fewer channels than its header states")
            .hint("save it with interleaved channels of 8 bits"));
    }
    let planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).ok().flatten() == Some(2);
    let plane = |c: usize| -> Vec<u8> {
        if planar {
            values[c * pixels..(c + 1) * pixels].to_vec()
        } else {
            values.iter().skip(c).step_by(samples).copied().collect()
        }
    };
    Ok((0..samples).map(plane).collect())
}
