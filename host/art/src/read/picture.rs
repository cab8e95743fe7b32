//! A picture as art: transparency, reserved colours, and colour for the process inks.
//!
//! Method: the picture, in sRGB, is laid on white by its transparency. Reserved colours
//! become layers if the options say so; whatever else is not white is colour.
//! Cost: four bytes a pixel, and some nanoseconds. Limits: 8 bits a channel.

use std::collections::{HashMap, HashSet};

use observe::Diagnosis;
use rayon::prelude::*;
use readers::{Picture, Raster};

use crate::artwork::Artwork;
use crate::colour::Colour;
use crate::dots::bitplane;
use crate::dots::pixels;
use crate::dots::resample;
use crate::options::Options;
use crate::read::names::stem;
use crate::read::object_type;
use crate::read::reserved;
use crate::read::scans;
use crate::read::size::{self, Unstated};
use sheet::Plane;

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
pub(crate) enum Looks {
    /// Nothing.
    Layer,
    /// Several colours.
    Colours,
    /// Mostly tones, none of which is most of them.
    Tones,
}

/// What a picture looks like. One whose colours cannot be brought to sRGB looks like a layer, of which no
/// colour matters.
pub(crate) fn looks(mut picture: Picture) -> Looks {
    let colours = picture.to_srgb().ok().and(picture.colours);
    let Some(colours) = colours else { return Looks::Layer };
    let pixels = colours.samples.as_chunks::<4>().0;
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

/// Art from a page with tags. What nothing was drawn on is transparent, which is known even if every dot is drawn.
pub(crate) fn tagged_artwork(
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
pub(crate) fn artwork(mut picture: Picture, options: &Options) -> Result<Artwork, Diagnosis> {
    picture.to_srgb()?;
    let sides = (f64::from(picture.size.0), f64::from(picture.size.1));
    let unstated = if options.reserves() { Unstated::PixelPerDot } else { Unstated::FillRoom };
    let dots = size::dots(&picture.name, sides, picture.resolution, unstated, options, &mut picture.notes)?;
    Ok(artwork_of(picture, dots, options))
}

/// The same from colours in sRGB at a known size in dots.
pub(crate) fn artwork_of(picture: Picture, dots: (usize, usize), options: &Options) -> Artwork {
    let Picture { name: path, size, colours, notes, .. } = picture;
    let name = stem(&path);
    let mut rgba = colours.map_or_else(Vec::new, Raster::into_rgba);
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
    let file = path.file_name().map_or_else(|| name.clone(), |file| file.to_string_lossy().into_owned());
    let mut art = opaque_artwork::<3>(&name, &file, size, dots, rgb, options);
    art.opaque = opaque;
    art.notes.splice(..0, notes);
    art
}

/// Art from pixels without transparency: three bytes each, or four with a tag before them. `file` is what notes call it.
pub(crate) fn opaque_artwork<const N: usize>(
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
pub(crate) fn plane_of<const N: usize>(
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
