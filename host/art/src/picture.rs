//! A picture as art: transparency, reserved colours, and colour for the process inks.
//!
//! Method: the picture is brought to sRGB by its embedded profile and laid on white by its transparency. Reserved colours
//! become layers if the options say so; whatever else is not white is colour.
//! Cost: four bytes a pixel, and some nanoseconds. Limits: 8 bits a channel.

use maths::Maths;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use image::DynamicImage;
use moxcms::{ColorProfile, DataColorSpace, Layout, TransformOptions};
use observe::Diagnosis;
use rayon::prelude::*;

use super::artwork::Artwork;
use super::colour::Colour;
use super::decode::decode;
use super::error::{io, wrong};
use super::options::Options;
use super::size::{self, Unstated};
use super::{bitplane, object_type, pixels, resample, reserved, scans};
use readers::resolution::Dpi;
use sheet::Plane;

/// A picture in sRGB with straight alpha.
pub(super) struct Pixels {
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub dpi: Option<Dpi>,
    /// Red, green, blue, opacity.
    pub rgba: Vec<u8>,
    pub notes: Vec<String>,
}

/// Reads a picture and converts its colours to sRGB; of a TIFF with several pages the one of this number.
pub(super) fn read(path: &Path, page: Option<u32>) -> Result<Pixels, Diagnosis> {
    let file = File::open(path).map_err(io(path, "open it"))?;
    of(path, BufReader::new(file), page)
}

/// The same from the bytes of a picture in the file at `path`.
pub(super) fn of(path: &Path, bytes: impl Read, page: Option<u32>) -> Result<Pixels, Diagnosis> {
    let decoded = decode(path, bytes, page)?;
    let (width, height) = (decoded.image.width(), decoded.image.height());
    let mut notes = decoded.notes;
    let deep = matches!(
        decoded.image,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    if deep {
        notes.push(format!("{}: 16 bits per channel are reduced to 8", path.display()));
    }
    let grey = !decoded.image.color().has_color();
    let mut rgba = decoded.image.into_rgba8().into_raw();
    if let Some(profile) = decoded.profile {
        notes.extend(to_srgb(path, &profile, grey, &mut rgba)?);
    }
    if let Some(gamma) = decoded.gamma {
        let table: Vec<u8> = (0..=255).map(|v| of_power(v, gamma)).collect();
        rgba.par_chunks_exact_mut(4).for_each(|pixel| {
            pixel[..3].iter_mut().for_each(|v| *v = table[usize::from(*v)]);
        });
        notes.push(format!("{}: its gamma of {gamma:.3} was applied", path.display()));
    }
    Ok(Pixels { path: path.to_path_buf(), width, height, dpi: decoded.dpi, rgba, notes })
}

/// A value whose light has this power, in sRGB (IEC 61966-2-1).
fn of_power(value: u8, gamma: f64) -> u8 {
    let light = (f64::from(value) / 255.0).power(1.0 / gamma);
    let encoded = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.power(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// Colours of which red, green and blue differ by so much are no grey.
const COLOURED: u8 = 48;
/// Colours that differ by at most so much in red, green and blue are about one.
const ALIKE: u8 = 24;

/// The most colours of a picture that may be line art.
const MOST_OF_LINE_ART: usize = 255;

/// Darkness from and to which a pixel is neither nearly paper nor nearly ink.
const TONES: std::ops::RangeInclusive<u8> = 48..=207;

/// What a picture has that the layer of an ink does not. That is grey or in one colour, and ink or paper but at its edges.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Looks {
    /// Nothing.
    Layer,
    /// Several colours.
    Colours,
    /// Mostly tones, none of which is most of them.
    Tones,
}

/// What a picture looks like. A file that cannot be read looks like a layer, whose reader tells why.
pub(super) fn looks(path: &Path, page: Option<u32>) -> Looks {
    let Ok(Pixels { rgba, .. }) = read(path, page) else { return Looks::Layer };
    let (pixels, _) = rgba.as_chunks::<4>();
    match () {
        () if has_colours(pixels) => Looks::Colours,
        () if has_tones(pixels) => Looks::Tones,
        () => Looks::Layer,
    }
}

fn has_colours(pixels: &[[u8; 4]]) -> bool {
    let seen = pixels.iter().filter(|pixel| pixel[3] > 0 && **pixel != [255; 4]).count();
    let coloured =
        |&&[r, g, b, opacity]: &&[u8; 4]| opacity >= 128 && r.max(g).max(b) - r.min(g).min(b) >= COLOURED;
    let coloured: Vec<&[u8; 4]> = pixels.iter().filter(coloured).collect();
    // The commonest of 4096 colours, and all that is about like it.
    let mut counts = HashMap::<[u8; 3], usize>::new();
    for &&[r, g, b, _] in &coloured {
        *counts.entry([r >> 4, g >> 4, b >> 4]).or_default() += 1;
    }
    let Some((most, _)) = counts.into_iter().max_by_key(|&(colour, count)| (count, colour)) else {
        return false;
    };
    let most = most.map(|v| v << 4 | 8);
    let like = coloured.iter().filter(|pixel| (0..3).all(|c| pixel[c].abs_diff(most[c]) <= ALIKE)).count();
    20 * coloured.len() >= seen && 4 * like < 3 * coloured.len()
}

/// Whether more than half of what is drawn has tones, and no sixteenth of all tones has half of these: a flat grey is the ink
/// of a layer. Opacity counts like darkness.
fn has_tones(pixels: &[[u8; 4]]) -> bool {
    let (mut drawn, mut counts) = (0, [0; 16]);
    for &[r, g, b, opacity] in pixels {
        let dark = (u32::from(255 - r.min(g).min(b)) * u32::from(opacity) / 255) as u8;
        drawn += usize::from(dark > 8);
        counts[usize::from(dark >> 4)] += usize::from(TONES.contains(&dark));
    }
    let toned: usize = counts.iter().sum();
    2 * toned > drawn && counts.iter().all(|count| 2 * count < toned)
}

/// Applies an embedded profile, and returns a note if that changed anything. `grey` marks pixels of a greyscale file.
pub(super) fn to_srgb(
    path: &Path,
    profile: &[u8],
    grey: bool,
    rgba: &mut [u8],
) -> Result<Option<String>, Diagnosis> {
    let Ok(profile) = ColorProfile::new_from_slice(profile) else {
        return Ok(Some(format!("{}: its colour profile is damaged, so it is read as sRGB", path.display())));
    };
    let of_grey = match profile.color_space {
        DataColorSpace::Rgb => false,
        DataColorSpace::Gray if grey => true,
        other => {
            return Err(wrong(path, format!("its colour profile is for {other:?}, but its pixels are not"))
                .hint("convert the picture to sRGB"));
        }
    };
    let srgb = ColorProfile::new_srgb();
    let bad = |error| {
        wrong(path, format!("its colour profile cannot be applied ({error})")).hint("convert it to sRGB")
    };
    let layout = if of_grey { Layout::GrayAlpha } else { Layout::Rgba };
    let transform = profile
        .create_transform_8bit(layout, &srgb, Layout::Rgba, TransformOptions::default())
        .map_err(bad)?;
    let mut changed = false;
    let mut line = vec![0; 4 << 12];
    let mut greys = Vec::new();
    for pixels in rgba.chunks_mut(4 << 12) {
        let line = &mut line[..pixels.len()];
        if of_grey {
            greys.clear();
            greys.extend(pixels.as_chunks::<4>().0.iter().flat_map(|&[v, _, _, alpha]| [v, alpha]));
        }
        transform.transform(if of_grey { &greys } else { &*pixels }, line).map_err(bad)?;
        changed |= pixels != line;
        pixels.copy_from_slice(line);
    }
    Ok(changed.then(|| format!("{}: its colour profile was applied", path.display())))
}

/// Art from a page with tags. What nothing was drawn on is transparent, which is known even if every dot is drawn.
pub(super) fn tagged_artwork(
    name: &str,
    size: (u32, u32),
    dots: (usize, usize),
    pixels: Vec<u8>,
    options: &Options,
) -> Artwork {
    let opaque = Some(plane_of::<{ object_type::BYTES }>(&pixels, size, dots, |pixel| pixel[0] != 0));
    let art = opaque_artwork::<{ object_type::BYTES }>(name, name, size, dots, pixels, options);
    Artwork { opaque, ..art }
}

/// Art from one picture: reserved colours as layers if the options say so, the rest as colour.
pub(super) fn artwork(name: &str, mut pixels: Pixels, options: &Options) -> Result<Artwork, Diagnosis> {
    let sides = (f64::from(pixels.width), f64::from(pixels.height));
    let unstated = if options.reserves() { Unstated::PixelPerDot } else { Unstated::FillRoom };
    let dots = size::dots(&pixels.path, sides, pixels.dpi, unstated, options, &mut pixels.notes)?;
    Ok(artwork_of(name, pixels, dots, options))
}

/// The same at a known size in dots.
pub(super) fn artwork_of(name: &str, pixels: Pixels, dots: (usize, usize), options: &Options) -> Artwork {
    let Pixels { path, width, height, mut rgba, notes, .. } = pixels;
    let size = (width, height);
    let transparent = rgba.par_chunks_exact(4).any(|p| p[3] < 255);
    let opaque = transparent.then(|| plane_of::<4>(&rgba, size, dots, |p| p[3] > 127));
    rgba.par_chunks_exact_mut(4).for_each(|p| {
        let alpha = u32::from(p[3]);
        for v in &mut p[..3] {
            *v = ((u32::from(*v) * alpha + 255 * (255 - alpha) + 127) / 255) as u8;
        }
    });
    let mut rgb = rgba;
    // In place: three bytes of a pixel never lie after its four.
    for at in 0..rgb.len() / 4 {
        rgb.copy_within(4 * at..4 * at + 3, 3 * at);
    }
    rgb.truncate(rgb.len() / 4 * 3);
    let file = path.file_name().map_or_else(|| name.into(), |file| file.to_string_lossy().into_owned());
    let mut art = opaque_artwork::<3>(name, &file, size, dots, rgb, options);
    art.opaque = opaque;
    art.notes.splice(..0, notes);
    art
}

/// Art from pixels without transparency: three bytes each, or four with a tag before them. `file` is what notes call it.
pub(super) fn opaque_artwork<const N: usize>(
    name: &str,
    file: &str,
    size: (u32, u32),
    dots: (usize, usize),
    mut pixels: Vec<u8>,
    options: &Options,
) -> Artwork {
    if !options.reserves() {
        scans::clean::<N>(pixels.as_chunks_mut().0);
    } else if size.0 as usize <= dots.0 && size.1 as usize <= dots.1 && sides(size) != dots {
        // Reserved colours may be nearly white. Coarser than dots, they have the edges of all flat art.
        let coarse = pixels::Pixels { bytes: pixels, each: N, width: sides(size).0, height: sides(size).1 };
        let size = (dots.0 as u32, dots.1 as u32);
        return opaque_artwork::<{ object_type::BYTES }>(
            name,
            file,
            size,
            dots,
            coarse.at_dots(dots),
            options,
        );
    }
    let drawn = plane_of::<N>(&pixels, size, dots, |p| p[N - 3..] != [255; 3]);
    let (mut layers, mut notes) = (Vec::new(), Vec::new());
    if options.reserves() {
        let mut rgb: Vec<u8> =
            pixels.as_chunks::<N>().0.iter().flat_map(|p| [p[N - 3], p[N - 2], p[N - 1]]).collect();
        let found = reserved::take(&mut rgb, size, dots, options);
        notes.extend(found.notes(file));
        layers = found.layers;
        let both = pixels.as_chunks_mut::<N>().0.iter_mut().zip(rgb.as_chunks::<3>().0);
        both.for_each(|(pixel, rgb)| pixel[N - 3..].copy_from_slice(rgb));
    }
    let finer = size.0 as usize > dots.0 || size.1 as usize > dots.1;
    if finer && is_line_art(pixels.as_chunks::<N>().0) {
        notes.push(resample::note(file, format!("{} x {} pixels", size.0, size.1), dots, options));
    }
    let colour = Colour::of_pixels::<N>(pixels, size);
    Artwork { layers, colour, drawn, notes, ..Artwork::blank(name, dots) }
}

fn sides(size: (u32, u32)) -> (usize, usize) {
    (size.0 as usize, size.1 as usize)
}

/// Whether a picture has no more colours than a drawing, one of them not white.
fn is_line_art<const N: usize>(pixels: &[[u8; N]]) -> bool {
    let mut colours = HashSet::new();
    let mut last = [255; 3];
    pixels.iter().all(|pixel| {
        let colour = [pixel[N - 3], pixel[N - 2], pixel[N - 1]];
        if colour != last {
            last = colour;
            colours.insert(colour);
        }
        colours.len() <= MOST_OF_LINE_ART
    }) && colours.iter().any(|colour| *colour != [255; 3])
}

/// The dots whose pixel of `N` bytes satisfies `is`.
pub(super) fn plane_of<const N: usize>(
    pixels: &[u8],
    size: (u32, u32),
    dots: (usize, usize),
    is: impl Fn(&[u8; N]) -> bool + Sync,
) -> Plane {
    let pixels = pixels.as_chunks::<N>().0;
    if (size.0 as usize, size.1 as usize) == dots {
        return bitplane::from(dots.0, pixels, is);
    }
    let bytes: Vec<u8> = pixels.par_iter().map(|pixel| u8::from(is(pixel))).collect();
    bitplane::from_bytes(dots.0, &resample::classes(bytes, size, dots), |byte| byte > 0)
}
