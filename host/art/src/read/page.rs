//! A page in memory, as a print queue has it.
//!
//! Problem: print systems hand over whole sheets, most of which is bare, at four bytes a pixel; and most
//! pages are black text.
//! Method: as long as a page is black and white alone, it is kept as one bit a pixel while it is read: what
//! drew a black pixel does not matter. With the first other colour, its pixels become numbers of colours
//! (`indexed_page`), and with the first tone of a picture, pixels. So the whole page is read as a picture.
//! Cost: 1 ns a pixel; a bit, a byte or four bytes. Limits: no transparency.

use std::io::{self, Read};
use std::path::Path;

use crate::artwork::Artwork;
use crate::colour::Colour;
use crate::dots::bitplane;
use crate::dots::resample;
use crate::error::wrong;
use crate::options::Options;
use crate::read::indexed_page::Numbered;
use crate::read::object_type;
use crate::read::object_type::{BYTES, ObjectType, Order};
use crate::read::picture;
use crate::read::size;
use crate::window::Window;
use observe::Diagnosis;
use sheet::Plane;

/// Rows that are read at once: they stay in the cache.
const ROWS: usize = 32;
/// The pixels of a page, row by row from the top, without transparency.
pub struct Page {
    pixels: Pixels,
    /// Where something is drawn, white included, if that was asked for.
    ground: Option<Plane>,
}

enum Pixels {
    /// One bit a pixel: black or white.
    Black(Plane),
    /// Few flat colours.
    Numbered(Numbered),
    /// sRGB, three bytes a pixel, and pixels across.
    Plain(Vec<u8>, usize),
    /// What drew each pixel, then its sRGB, and pixels across.
    Tagged(Vec<u8>, usize),
}

impl Page {
    /// A page of sRGB, three bytes a pixel.
    pub fn plain(rgb: Vec<u8>, width: usize) -> Page {
        Page { pixels: Pixels::Plain(rgb, width), ground: None }
    }

    /// Reads a page with tags ([`object_type`]) in this order, of so many pixels across and down.
    /// `has_ground` tells bare paper apart from what is drawn in white.
    ///
    /// # Errors
    /// Those of reading.
    pub fn read(
        input: &mut impl Read,
        order: Order,
        (width, height): (usize, usize),
        has_ground: bool,
    ) -> io::Result<Page> {
        let mut ground = has_ground.then(|| bitplane::blank(width, height));
        let mut tell = |top: usize, pixels: &[u8]| {
            let Some(ground) = &mut ground else { return };
            let rows = ground.bits[ground.stride * top..].chunks_exact_mut(ground.stride);
            rows.zip(pixels.chunks_exact(BYTES * width)).for_each(|(bits, row)| drawn(row, bits));
        };
        let mut plane = bitplane::blank(width, height);
        let mut numbered: Option<Numbered> = None;
        let mut strip = vec![0; BYTES * width * ROWS.min(height)];
        let mut last = vec![0; BYTES * width];
        for top in (0..height).step_by(ROWS) {
            let strip = &mut strip[..BYTES * width * ROWS.min(height - top)];
            input.read_exact(strip)?;
            order.turn(strip);
            tell(top, strip);
            if numbered.is_none() {
                let rows = plane.bits[plane.stride * top..].chunks_exact_mut(plane.stride);
                if rows.zip(strip.chunks_exact(BYTES * width)).all(|(bits, row)| black(row, bits)) {
                    last.copy_from_slice(&strip[strip.len() - BYTES * width..]);
                    continue;
                }
            }
            let page = numbered.get_or_insert_with(|| Numbered::of(&plane, top, &last));
            if page.read(top, strip) {
                continue;
            }
            let mut pixels = vec![0; BYTES * width * height];
            let (before, rest) = pixels.split_at_mut(BYTES * width * top);
            page.expand(before);
            let (these, rest) = rest.split_at_mut(strip.len());
            these.copy_from_slice(strip);
            input.read_exact(rest)?;
            order.turn(rest);
            tell(top + strip.len() / (BYTES * width), rest);
            return Ok(Page { pixels: Pixels::Tagged(pixels, width), ground });
        }
        Ok(Page { pixels: numbered.map_or(Pixels::Black(plane), Pixels::Numbered), ground })
    }

    /// The window around everything that is not white; `None` for a blank page.
    pub fn bounds(&self) -> Option<Window> {
        match &self.pixels {
            Pixels::Black(plane) => bitplane::bounds(plane),
            Pixels::Numbered(page) => page.bounds(),
            Pixels::Plain(rgb, width) => Window::around(rgb, *width, 3, 255),
            Pixels::Tagged(pixels, width) => object_type::bounds(pixels, *width),
        }
    }

    /// The page as art. It is printed at `dpi` pixels an inch.
    ///
    /// # Errors
    /// No dots, or more than 65535 on a side.
    pub fn art(self, name: &str, dpi: f64, options: &Options) -> Result<Artwork, Diagnosis> {
        let (width, height) = self.size();
        let problem = || {
            let problem =
                format!("the page is {width} x {height} pixels; expected 1 to 65535 dots on a side");
            wrong(Path::new(name), problem)
        };
        let dots = size::page_dots((width, height), dpi).ok_or_else(problem)?;
        u32::try_from(width).and(u32::try_from(height)).map_err(|_| problem())?;
        Ok(self.at(name, dots, options))
    }

    /// Pixels across and down.
    fn size(&self) -> (usize, usize) {
        match &self.pixels {
            Pixels::Black(plane) => (plane.width, plane.length),
            Pixels::Numbered(page) => (page.width, page.length()),
            Pixels::Plain(rgb, width) => (*width, rgb.len() / 3 / (*width).max(1)),
            Pixels::Tagged(pixels, width) => (*width, pixels.len() / BYTES / (*width).max(1)),
        }
    }

    /// The pixels with their tags.
    pub(super) fn pixels(self) -> Vec<u8> {
        let (width, height) = self.size();
        let expanded = |expand: &dyn Fn(&mut [u8])| {
            let mut pixels = vec![0; BYTES * width * height];
            expand(&mut pixels);
            pixels
        };
        match self.pixels {
            Pixels::Black(plane) => expanded(&|pixels| expand(&plane, pixels)),
            Pixels::Numbered(page) => expanded(&|pixels| page.expand(pixels)),
            Pixels::Plain(pixels, _) => {
                let tagged = |&[r, g, b]: &[u8; 3]| [ObjectType::PICTURE, r, g, b];
                pixels.as_chunks::<3>().0.iter().flat_map(tagged).collect()
            }
            Pixels::Tagged(pixels, _) => pixels,
        }
    }

    /// The page as art of so many dots; its sides fit in 32 bits.
    pub(super) fn at(mut self, name: &str, dots: (usize, usize), options: &Options) -> Artwork {
        let size = self.size();
        let is_dots = size == dots && !options.reserves();
        let ground = self.ground.take();
        let opaque = ground.map(|ground| {
            let classes = || {
                let has = |at: usize| u8::from(bitplane::at(&ground, at % size.0, at / size.0));
                let sides = (size.0 as u32, size.1 as u32);
                resample::classes((0..size.0 * size.1).map(has).collect(), sides, dots)
            };
            if size == dots { ground } else { bitplane::from_bytes(dots.0, &classes(), |byte| byte > 0) }
        });
        let art = match self.pixels {
            Pixels::Black(plane) if is_dots => {
                let colour = (plane.dots() > 0).then(|| Colour::black(plane.clone()));
                Artwork { drawn: plane, colour, ..Artwork::blank(name, dots) }
            }
            Pixels::Numbered(page) if is_dots => {
                let (colour, drawn) = page.colour();
                Artwork { drawn, colour, ..Artwork::blank(name, dots) }
            }
            Pixels::Plain(rgb, _) => {
                let size = (size.0 as u32, size.1 as u32);
                picture::opaque_artwork::<3>(name, name, size, dots, rgb, options)
            }
            pixels => {
                let pixels = Page { pixels, ground: None }.pixels();
                let size = (size.0 as u32, size.1 as u32);
                picture::opaque_artwork::<BYTES>(name, name, size, dots, pixels, options)
            }
        };
        Artwork { opaque: opaque.or(art.opaque), ..art }
    }
}

/// Sets the bits of the pixels of a row that something drew.
fn drawn(row: &[u8], bits: &mut [u8]) {
    for (bits, eight) in bits.iter_mut().zip(row.chunks(BYTES * 8)) {
        let pixels = eight.as_chunks::<BYTES>().0.iter().zip(0..8);
        *bits = pixels.fold(0, |bits, (pixel, at)| bits | u8::from(pixel[0] != 0) << (7 - at));
    }
}

/// Sets the bits of the black pixels of a row, if the others are white.
fn black(row: &[u8], bits: &mut [u8]) -> bool {
    /// The tag is the first byte, so that the others are the colour.
    const COLOUR: u32 = u32::from_be_bytes([0, 255, 255, 255]);
    bits.iter_mut().zip(row.chunks(BYTES * 8)).all(|(bits, eight)| {
        let pixels = eight.as_chunks::<BYTES>().0.iter().map(|pixel| u32::from_be_bytes(*pixel) & COLOUR);
        if pixels.clone().fold(COLOUR, |all, pixel| all & pixel) == COLOUR {
            *bits = 0;
            return true;
        }
        *bits = pixels.clone().zip(0..8).fold(0, |bits, (pixel, at)| bits | u8::from(pixel == 0) << (7 - at));
        pixels.clone().all(|pixel| pixel == 0 || pixel == COLOUR)
    })
}

/// The first rows of a page in black and white as pixels with tags.
fn expand(plane: &Plane, pixels: &mut [u8]) {
    let rows = pixels.chunks_exact_mut((BYTES * plane.width).max(1));
    for (row, bits) in rows.zip(plane.bits.chunks_exact(plane.stride.max(1))) {
        for (x, pixel) in row.as_chunks_mut::<BYTES>().0.iter_mut().enumerate() {
            let is_black = bits[x / 8] & 0x80 >> (x % 8) != 0;
            *pixel = if is_black { [ObjectType::DRAWING, 0, 0, 0] } else { [0, 255, 255, 255] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Where the first tone is decides how much was read as bits before it.
    fn page(
        (width, height): (usize, usize),
        seed: u32,
        (colours, most): (Vec<usize>, u32),
        tone: Option<usize>,
    ) -> Vec<u8> {
        let random = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 13;
        let pixel = |at: usize| match random(at) % 5 {
            0 => [(random(at + 9) % 8) as u8, 0, 0, 0],
            _ => [(random(at + 9) % 8) as u8, 255, 255, 255],
        };
        let mut pixels: Vec<[u8; 4]> = (0..width * height).map(pixel).collect();
        // Text and drawings in some colours.
        for at in colours {
            let at = at % pixels.len();
            pixels[at] = [[1, 4, 5][random(at + 3) as usize % 3], 20, (random(at + 5) % most) as u8, 90];
        }
        if let Some(at) = tone {
            let at = at % pixels.len();
            pixels[at] = [[2, 3, 6][random(at + 3) as usize % 3], 90, (random(at + 5) % 256) as u8, 90];
        }
        pixels.concat()
    }

    proptest! {
        #[test]
        fn a_page_is_the_same_whether_it_was_read_as_bits_or_not(
            width in 3usize..40, height in 3usize..100, seed: u32, tone in prop::option::of(any::<usize>()),
            colours in prop_oneof![
                Just(Vec::new()),
                prop::collection::vec(any::<usize>(), 1..60),
                prop::collection::vec(any::<usize>(), 900),
            ],
            most in prop_oneof![Just(1u32), Just(5), Just(256)],
            tag_last: bool, draft: bool
        ) {
            let is_black = tone.is_none() && colours.is_empty();
            let pixels = page((width, height), seed, (colours, most), tone);
            let found = match tag_last {
                false => Page::read(&mut &pixels[..], Order::First, (width, height), true).unwrap(),
                true => {
                    let turned: Vec<u8> =
                        pixels.as_chunks::<BYTES>().0.iter().flat_map(|&[tag, r, g, b]| [r, g, b, tag]).collect();
                    Page::read(&mut &turned[..], Order::Last, (width, height), true).unwrap()
                }
            };
            let tags = bitplane::from(width, pixels.as_chunks::<BYTES>().0, |pixel| pixel[0] != 0);
            let whole = Page { pixels: Pixels::Tagged(pixels, width), ground: Some(tags) };
            prop_assert_eq!(matches!(found.pixels, Pixels::Black(_)), is_black);
            let numbered = matches!(found.pixels, Pixels::Numbered(_));
            prop_assert!(!numbered || tone.is_none() && !is_black);
            prop_assert!(numbered || tone.is_some() || is_black || most > 5);
            prop_assert_eq!(found.bounds(), whole.bounds());
            let (dpi, options) = (if draft { 300.0 } else { 600.0 }, Options::default());
            let found = found.art("page", dpi, &options).unwrap();
            let whole = whole.art("page", dpi, &options).unwrap();
            prop_assert_eq!(&found.drawn, &whole.drawn);
            prop_assert_eq!(&found.opaque, &whole.opaque);
            // What nothing is drawn on has no colour.
            if whole.drawn.dots() > 0 {
                let dots = (whole.width, whole.length);
                let keys = |colour: Option<Colour>| colour.map(|colour| colour.keys(dots));
                prop_assert_eq!(keys(found.colour), keys(whole.colour));
            }
        }
    }

    #[test]
    fn a_page_cut_short_is_an_error() {
        let pixels = page((9, 40), 1, (Vec::new(), 1), None);
        assert!(Page::read(&mut &pixels[..pixels.len() - 1], Order::First, (9, 40), false).is_err());
    }
}
