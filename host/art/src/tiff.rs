//! TIFF files whose channels name inks: CMYK plates, spot channels, or both.
//!
//! Problem: drawing programs export spot inks as extra channels. Their names stand in one of two places, and full ink is
//! either the largest value or zero.
//! Method: names come from the InkNames tag (every channel is an ink, the largest value is full ink) or from Photoshop's
//! resource block (extra channels only, 0 is full ink, as Photoshop displays them). CMYK channels are the plates of the
//! process inks. An extra channel that the file calls opacity, and that names no ink, is the transparency of all others.
//! The decoder drops extra channels unless the file is greyscale, so the photometric tag is changed in memory
//! first.
//! Cost: the file in memory, and one byte a pixel for each channel. Limits: 8 and 16 bits a channel; one page ([`tiff_pages`]).
//! Source: TIFF 6.0 sections 16 and 18; Adobe's file format specification for the resource block.

use std::path::Path;

use ::tiff::decoder::DecodingResult;
use ::tiff::tags::Tag;

use super::artwork::Artwork;
use super::cmyk::{self, PLATES};
use super::coverage::{Coverage, Scan};
use super::cut_lines;
use super::error::{NamedPart, io, wrong};
use super::names::{self, stem};
use super::options::Options;
use super::orientation::Turn;
use super::picture::{self, Pixels};
use super::size::{self, MOST_BYTES, Unstated};
use super::tiff_pages;
use observe::Diagnosis;
use readers::resolution::{TiffDecoder, of_tiff, tiff_decoder};

const INK_SET: Tag = Tag::Unknown(332);
const PHOTOSHOP: Tag = Tag::Unknown(34377);
const PROFILE: Tag = Tag::Unknown(34675);
const PHOTOMETRIC: u16 = 262;
const INK_NAMES: u16 = 333;

/// Values of the photometric tag.
const BLACK_IS_ZERO: u16 = 1;
const RGB: u16 = 2;
const SEPARATED: u16 = 5;

/// The most channels of a file.
const MOST_CHANNELS: usize = 24;

/// A channel of the file.
struct Channel {
    name: String,
    ink: Option<names::Named>,
    /// Whether 0 is full ink.
    inverted: bool,
    opacity: Option<Opacity>,
}

/// What a channel of opacity means for the others.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Opacity {
    /// They were multiplied with it.
    Associated,
    /// They were not.
    Unassociated,
}

impl Opacity {
    /// From a value of the tag ExtraSamples.
    fn of(extra: Option<&u16>) -> Option<Opacity> {
        match extra {
            Some(1) => Some(Opacity::Associated),
            Some(2) => Some(Opacity::Unassociated),
            _ => None,
        }
    }
}

/// Reads a TIFF with plates or spot channels; `None` if it is a plain picture.
pub(super) fn read(path: &Path, options: &Options) -> Result<Option<Artwork>, Diagnosis> {
    let reading = io(path, "read it");
    if std::fs::metadata(path).map_err(&reading)?.len() > MOST_BYTES {
        return Err(wrong(path, "the file is larger than a gigabyte"));
    }
    let mut bytes = std::fs::read(path).map_err(&reading)?;
    tiff_pages::choose(path, &mut bytes, options.page())?;
    let Some(mut decoder) = tiff_decoder(&bytes) else { return Ok(None) };
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
        return Err(wrong(path, format!("it has {samples} channels; expected at most {MOST_CHANNELS}")));
    }
    if samples < base || samples == base && photometric != SEPARATED {
        return Ok(None);
    }
    let (named_inks, named_extra) = (ink_names(&bytes), photoshop_names(&mut decoder));
    // An extra channel without a name is transparency.
    if photometric != SEPARATED && named_extra.is_empty() {
        return Ok(None);
    }
    let mut notes = Vec::new();
    let named = Names { inks: named_inks, extra: named_extra, kinds: extra_samples(&mut decoder) };
    let channels = channels(path, base, samples, &named, photometric, &mut notes)?;
    if photometric != SEPARATED && channels.iter().all(|channel| channel.ink.is_none()) {
        return Ok(None);
    }
    let (width, height) =
        decoder.dimensions().map_err(|error| wrong(path, format!("the file is damaged: {error}")))?;
    size::check_pixels(path, width, height)?;
    let turn = Turn::of_tag(number(&mut decoder, Tag::Orientation));
    let dpi = turn.dpi(of_tiff(&mut decoder));
    let profile = decoder.find_tag(PROFILE).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    drop(decoder);
    set_photometric(&mut bytes);
    let planes = planes(path, &bytes, samples, width as usize * height as usize)?;
    let planes: Vec<_> = planes.into_iter().map(|plane| turn.plane(plane, (width, height))).collect();
    let (width, height) = turn.size((width, height));
    let opacity =
        channels.iter().zip(&planes).find_map(|(channel, plane)| Some((channel.opacity?, plane.clone())));

    if base == 4 {
        notes.push(cmyk::note(path, profile.is_some()));
    }
    let spots = channels[base..].iter().any(|channel| channel.ink.is_some());
    let unstated = if spots { Unstated::PixelPerDot } else { Unstated::FillRoom };
    let sides = (f64::from(width), f64::from(height));
    let dots = size::dots(path, sides, dpi, unstated, options, &mut notes)?;
    let mut art = if photometric == SEPARATED {
        Artwork::blank(&stem(path), dots)
    } else {
        let colour = |c: usize, at: usize| {
            let value = planes[if base == 3 { c } else { 0 }][at];
            match &opacity {
                Some((Opacity::Associated, opacity)) if opacity[at] > 0 => {
                    (u32::from(value) * 255 / u32::from(opacity[at])).min(255) as u8
                }
                _ => value,
            }
        };
        let alpha = |at: usize| opacity.as_ref().map_or(255, |(_, opacity)| opacity[at]);
        let mut rgba: Vec<u8> = (0..planes[0].len())
            .flat_map(|at| [colour(0, at), colour(1, at), colour(2, at), alpha(at)])
            .collect();
        if let Some(profile) = profile {
            notes.extend(picture::to_srgb(path, &profile, base == 1, &mut rgba)?);
        }
        let pixels = Pixels { path: path.to_path_buf(), width, height, dpi, rgba, notes: Vec::new() };
        let mut art = picture::artwork_of(&stem(path), pixels, dots, options);
        if let Some(colour) = art.colour.as_mut().filter(|_| art.layers.is_empty()) {
            // A spot channel lies under or over the picture, as it does with CMYK plates. A reserved colour stands instead of it.
            colour.overprints = true;
        }
        art
    };
    if let Some((_, opacity)) = opacity.as_ref().filter(|(_, opacity)| opacity.iter().any(|&a| a < 255)) {
        art.opaque = Some(picture::plane_of::<1>(opacity, (width, height), dots, |&[a]| a > 0));
    }
    for (at, (channel, plane)) in channels.into_iter().zip(planes).enumerate() {
        let Some(named) = channel.ink else { continue };
        let coverage = match &opacity {
            _ if channel.inverted => plane.iter().map(|v| 255 - v).collect(),
            // A spot channel is a plate of its own, which no transparency of the picture thins.
            Some((Opacity::Unassociated, opacity)) if at < base => {
                let times = |(&v, &a): (&u8, &u8)| ((u32::from(v) * u32::from(a) + 127) / 255) as u8;
                plane.iter().zip(opacity).map(times).collect()
            }
            _ => plane,
        };
        let (path, by) = (path.to_path_buf(), Coverage::Dark);
        let scan = Scan { path, width, height, dpi, coverage, by };
        art.add(scan, &channel.name, named, true, options);
    }
    art.notes.append(&mut notes);
    Ok(Some(art))
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
    path: &Path,
    base: usize,
    samples: usize,
    named: &Names,
    photometric: u16,
    notes: &mut Vec<String>,
) -> Result<Vec<Channel>, Diagnosis> {
    let mut channels = Vec::new();
    // Opacity may be among Photoshop's names or not.
    let all_named = named.extra.len() >= samples - base;
    let mut extra = named.extra.iter();
    for at in 0..samples {
        if at < base {
            let ink = PLATES.get(at).filter(|_| photometric == SEPARATED);
            let name = ink.map_or_else(String::new, |&ink| cmyk::plate_of(ink));
            let ink = ink.map(|&ink| names::Named { place: None, ink });
            channels.push(Channel { name, ink, inverted: false, opacity: None });
            continue;
        }
        let kind = (at + named.kinds.len()).checked_sub(samples).and_then(|at| named.kinds.get(at));
        let opacity = Opacity::of(kind);
        let of_photoshop = if opacity.is_none() || all_named { extra.next() } else { None };
        let (name, inverted) = match (named.inks.get(at), of_photoshop) {
            (Some(name), _) if base == 0 || named.inks.len() == samples => (name, false),
            (_, Some(name)) if opacity.is_none() || names::ink(name).is_some() => (name, true),
            _ if opacity.is_some() => {
                channels.push(Channel { name: String::new(), ink: None, inverted: false, opacity });
                continue;
            }
            _ => {
                return Err(wrong(path, format!("channel {} of {samples} has no name", at + 1)));
            }
        };
        let ink = if cut_lines::is_cut(name) {
            notes.push(cut_lines::note(&path.display(), "channel", name));
            None
        } else {
            names::of_part(path, name, NamedPart::Channel, notes)?
        };
        if ink.is_some() && inverted {
            notes.push(format!(
                "{}: black is ink in channel `{name}`, as Photoshop displays it",
                path.display()
            ));
        }
        channels.push(Channel { name: name.clone(), ink, inverted, opacity: None });
    }
    Ok(channels)
}

/// Names of all inks: consecutive texts that end in NUL. The decoder itself stops at the first.
fn ink_names(bytes: &[u8]) -> Vec<String> {
    let text = tiff_pages::field(bytes, INK_NAMES).and_then(|field| bytes.get(field)).unwrap_or_default();
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
        tiff_pages::field(bytes, PHOTOMETRIC).filter(|f| f.len() == 2).and_then(|field| bytes.get_mut(field))
    {
        value.copy_from_slice(&grey);
    }
}

/// One byte a pixel for each channel.
pub(super) fn planes(
    path: &Path,
    bytes: &[u8],
    samples: usize,
    pixels: usize,
) -> Result<Vec<Vec<u8>>, Diagnosis> {
    let bad = |error: ::tiff::TiffError| {
        wrong(path, format!("cannot decode its channels: {error}"))
            .hint("save it uncompressed or with LZW, 8 or 16 bits")
    };
    let Some(mut decoder) = tiff_decoder(bytes) else { return Err(wrong(path, "the file is damaged")) };
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(bad)?;
    let values: Vec<u8> = match decoded {
        DecodingResult::U8(values) => values,
        DecodingResult::U16(values) => values.into_iter().map(|v| (v >> 8) as u8).collect(),
        _ => return Err(wrong(path, "its channels have neither 8 nor 16 bits").hint("save it with 8 bits")),
    };
    if values.len() != samples * pixels {
        return Err(wrong(path, "it has fewer channels than its header states")
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
