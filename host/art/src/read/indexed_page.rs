//! A page in few flat colours while it is read: one byte a pixel.
//!
//! Problem: four bytes a pixel are 140 MB for A4, most of them bare paper, and every look at them takes as long as drawing them
//! did. Most pages that are not black alone are text in a few colours.
//! Method: what draws a pixel and its colour have a number in the order in which they are first met; bare paper is 0. A
//! page stays numbered while it has no tones of pictures and no more than 256 colours.
//! Cost: 0.1 ns a pixel of bare paper, 2 ns others. Limits: of a tag nothing is kept but its [`ObjectType`].

use std::collections::HashMap;

use crate::colour::Colour;
use crate::dots::bitplane;
use crate::read::object_type::{BYTES, ObjectType, split};
use crate::window::Window;
use sheet::Plane;

/// A pixel as it is read: the tag, then sRGB.
type Pixel = [u8; BYTES];

/// Pixels that are compared at once.
const BLOCK: usize = 16;
/// Pixels whose numbers are found without a search.
const CACHED: usize = 256;
const PAPER: (ObjectType, [u8; 3]) = (ObjectType::Picture, [255; 3]);
const BLACK: (ObjectType, [u8; 3]) = (ObjectType::Drawing, [0; 3]);

/// The numbers of a page's pixels, row by row from the top.
pub(crate) struct Numbered {
    /// What draws in each colour, and the colour.
    colours: Vec<(ObjectType, [u8; 3])>,
    numbers: HashMap<(ObjectType, [u8; 3]), u8>,
    /// By a hash, the last pixel with it and its number.
    cache: Vec<(Pixel, u8)>,
    index: Vec<u8>,
    pub width: usize,
}

impl Numbered {
    /// A page that begins with some rows in black and white, of which `last` is the lowest: what drew their black does not
    /// matter, except beside what is still to come.
    pub fn of(plane: &Plane, rows: usize, last: &[u8]) -> Numbered {
        let width = plane.width;
        let mut page = Numbered {
            colours: Vec::new(),
            numbers: HashMap::new(),
            cache: Vec::new(),
            index: vec![0; width * plane.length],
            width,
        };
        page.number(PAPER);
        let black = page.number(BLACK).unwrap_or_default();
        page.cache = vec![([0, 255, 255, 255], 0); CACHED];
        let bits = plane.bits.chunks_exact(plane.stride.max(1)).take(rows);
        for (row, bits) in page.index.chunks_exact_mut(width.max(1)).zip(bits) {
            for (eight, &bits) in row.chunks_mut(8).zip(bits).filter(|(_, bits)| **bits != 0) {
                for (x, pixel) in eight.iter_mut().enumerate() {
                    *pixel = if bits & 0x80 >> x != 0 { black } else { 0 };
                }
            }
        }
        if let Some(row) = rows.checked_sub(1) {
            // In black and white there are few colours.
            page.read(row, last);
        }
        page
    }

    /// Numbers the pixels of some rows from `top` on. If one has no number, the page is not numbered any more.
    pub fn read(&mut self, top: usize, rows: &[u8]) -> bool {
        let pixels = rows.as_chunks::<BYTES>().0;
        let mut index = std::mem::take(&mut self.index);
        let out = &mut index[self.width * top..][..pixels.len()];
        let mut last = ([0, 255, 255, 255], 0);
        let mut all = true;
        for (pixels, out) in pixels.chunks(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let same = u32::from_ne_bytes(last.0);
            if pixels.iter().fold(0, |other, pixel| other | u32::from_ne_bytes(*pixel) ^ same) == 0 {
                out.fill(last.1);
                continue;
            }
            for (pixel, out) in pixels.iter().zip(out) {
                if *pixel != last.0 {
                    match self.number_of(*pixel) {
                        Some(number) => last = (*pixel, number),
                        None => all = false,
                    }
                }
                *out = last.1;
            }
            if !all {
                break;
            }
        }
        self.index = index;
        all
    }

    fn number_of(&mut self, pixel: Pixel) -> Option<u8> {
        let place = (u32::from_ne_bytes(pixel).wrapping_mul(0x9e37_79b1) >> 24) as usize % CACHED;
        if self.cache[place].0 == pixel {
            return Some(self.cache[place].1);
        }
        let number = self.number(split(&pixel))?;
        self.cache[place] = (pixel, number);
        Some(number)
    }

    /// The number of a colour; `None` for a tone and if there are too many.
    fn number(&mut self, key: (ObjectType, [u8; 3])) -> Option<u8> {
        if let Some(&number) = self.numbers.get(&key) {
            return Some(number);
        }
        let tone = key.0 == ObjectType::Picture && key.1 != [255; 3] && key.1 != [0; 3];
        let number = u8::try_from(self.colours.len()).ok().filter(|_| !tone)?;
        self.numbers.insert(key, number);
        self.colours.push(key);
        Some(number)
    }

    pub fn length(&self) -> usize {
        self.index.len() / self.width.max(1)
    }

    /// The first pixels of the page, with tags.
    pub fn expand(&self, pixels: &mut [u8]) {
        let pixel = |&(kind, [r, g, b]): &(ObjectType, [u8; 3])| match kind {
            ObjectType::Text => [ObjectType::TEXT, r, g, b],
            ObjectType::Drawing => [ObjectType::DRAWING, r, g, b],
            ObjectType::Picture => [ObjectType::PICTURE, r, g, b],
        };
        let table: Vec<Pixel> = self.colours.iter().map(pixel).collect();
        for (pixel, &number) in pixels.as_chunks_mut::<BYTES>().0.iter_mut().zip(&self.index) {
            *pixel = table[usize::from(number)];
        }
    }

    /// The window around everything that is not white; `None` for a blank page.
    pub fn bounds(&self) -> Option<Window> {
        let is_drawn: [bool; 256] =
            std::array::from_fn(|number| self.colours.get(number).is_some_and(|(_, rgb)| *rgb != [255; 3]));
        let drawn = |&number: &u8| is_drawn[usize::from(number)];
        let mut found: Option<[usize; 4]> = None;
        for (y, row) in self.index.chunks_exact(self.width.max(1)).enumerate() {
            // Most rows are bare.
            if row.iter().fold(0, |all, &number| all | number) == 0 {
                continue;
            }
            if let (Some(first), Some(last)) = (row.iter().position(drawn), row.iter().rposition(drawn)) {
                let [top, left, right] =
                    found.map_or([y, first, last], |[top, _, left, right]| [top, left, right]);
                found = Some([top, y, left.min(first), right.max(last)]);
            }
        }
        let [top, bottom, left, right] = found?;
        Some(Window { left, top, width: right + 1 - left, height: bottom + 1 - top })
    }

    /// Its colours, and the dots that have any; no colours if all are white.
    pub fn colour(self) -> (Option<Colour>, Plane) {
        let is_white = |number: u8| self.colours[usize::from(number)].1 == [255; 3];
        let drawn = bitplane::from_bytes(self.width, &self.index, |number| !is_white(number));
        (Colour::numbered(self.colours, self.index, self.width), drawn)
    }
}
