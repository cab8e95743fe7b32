//! Flat colours: the dots that must not be treated as tones of a photograph.
//!
//! Problem: colours are averaged to 300 dpi for the halftone, but letters and edges must be decided at every dot.
//! Method: a [palette](super::palette). Every dot of text or a drawing has the number of its colour; a dot of a picture is white, black or a
//! tone, but for [masks](super::masks), which are drawings, and [letters](super::translucent) through which a picture shows. The band of a shading
//! in a colour of the palette is a tone. White and black dots of a picture count only in lines and areas; a lone one beside tones is noise. Of tones
//! it is known whether they have more ink than paper.
//! Cost: two scans of the page, 1 to 2 ns a pixel; one byte a dot. Limits: those of the palette.

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::fine::{Key, key};
use super::kinds::{K_OF_PICTURES, ObjectType};
use super::masks::Masks;
use super::palette::{palette, sort};
use super::{resample, translucent};
use sheet::forest::{Forest, beside};

/// A dot that is a tone with more paper than ink.
pub(super) const TONE: u8 = u8::MAX;
/// A dot that is a tone with more ink than paper.
pub(super) const INKED: u8 = TONE - 1;
/// Number of white, which is bare paper, whatever drew it.
pub(super) const WHITE: u8 = 0;
/// Number of black.
pub(super) const BLACK: u8 = 1;
/// sRGB's value of half of the light. Where a channel has less, ink that takes it away lies on more than half of the dots.
const HALF: u8 = 188;
/// Neighbours in a shading differ by at most this much in each of red, green and blue.
pub(super) const SIMILAR: u8 = 12;

/// What draws in a colour, and its sRGB.
pub(super) type Drawn = (ObjectType, [u8; 3]);

/// Flat colours and where they are.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Flat {
    /// What draws in each colour, and its sRGB. White and black come first.
    pub(super) colours: Vec<Drawn>,
    /// For each dot the number of its colour, [`TONE`] or [`INKED`].
    pub(super) index: Vec<u8>,
}

/// Pairs of colours with dots that lie beside each other, a bit each.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Touching([[u64; 4]; 256]);

impl Touching {
    fn none() -> Box<Touching> {
        Box::new(Touching([[0; 4]; 256]))
    }

    #[inline]
    fn add(&mut self, a: u8, b: u8) {
        if a != b {
            self.0[usize::from(a)][usize::from(b / 64)] |= 1 << (b % 64);
        }
    }

    fn joined(mut self: Box<Touching>, other: Box<Touching>) -> Box<Touching> {
        self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()).for_each(|(a, b)| *a |= b);
        self
    }

    /// Whether dots of two colours lie beside each other.
    pub fn has(&self, a: u8, b: u8) -> bool {
        let from = |a: u8, b: u8| self.0[usize::from(a)][usize::from(b / 64)] >> (b % 64) & 1 == 1;
        from(a, b) || from(b, a)
    }
}

/// ObjectType and colour of a pixel of three bytes, or of four with a tag before them.
#[inline(always)]
pub(super) fn split<const N: usize>(pixel: &[u8; N]) -> (ObjectType, [u8; 3]) {
    let kind = if N == 4 { ObjectType::of(pixel[0]) } else { ObjectType::Picture };
    (kind, [pixel[N - 3], pixel[N - 2], pixel[N - 1]])
}

/// What a dot is whose colour is no flat one.
pub(super) fn tone(colour: [u8; 3]) -> u8 {
    if colour.iter().any(|&v| v < HALF) { INKED } else { TONE }
}

/// Whether a dot is a tone.
pub(super) fn is_tone(dot: u8) -> bool {
    dot >= INKED
}

/// Whether one colour may follow the other in a shading.
pub(super) fn similar(a: [u8; 3], b: [u8; 3]) -> bool {
    (0..3).all(|c| a[c].abs_diff(b[c]) <= SIMILAR)
}

impl Flat {
    /// The flat colours of pixels.
    pub(super) fn of<const N: usize>(pixels: &[[u8; N]], width: usize) -> Flat {
        let mut colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3])];
        let masks = Masks::of(pixels, width);
        let letters = translucent::letters(pixels, width);
        let (palette, shaded) = palette(pixels, width, (&masks, &letters));
        colours.extend(palette);
        let numbers: HashMap<(ObjectType, [u8; 3]), u8> = colours.iter().copied().zip(0..).skip(2).collect();
        let number = |pixel: &[u8; N]| match split(pixel) {
            (_, [255, 255, 255]) => WHITE,
            (_, [0, 0, 0]) => BLACK,
            (ObjectType::Picture, colour) => tone(colour),
            key => numbers.get(&key).copied().unwrap_or_else(|| tone(key.1)),
        };
        let mut index = vec![WHITE; pixels.len()];
        index.par_chunks_mut(width).zip(pixels.par_chunks(width)).for_each(|(index, row)| {
            let mut last = (&row[0], number(&row[0]));
            for (index, pixel) in index.iter_mut().zip(row) {
                if pixel != last.0 {
                    last = (pixel, number(pixel));
                }
                *index = last.1;
            }
        });
        for (stretch, colour) in masks.stretches() {
            let number = match colour {
                K_OF_PICTURES if N == 4 => BLACK,
                [255, 255, 255] => WHITE,
                [0, 0, 0] => BLACK,
                colour => {
                    numbers.get(&(ObjectType::Drawing, colour)).copied().unwrap_or_else(|| tone(colour))
                }
            };
            index[stretch].fill(number);
        }
        for (stretch, colour) in letters {
            if let Some(&number) = numbers.get(&(ObjectType::Text, colour)) {
                index[stretch].fill(number);
            }
        }
        let mut flat = Flat { colours, index };
        flat.forget_noise(pixels, width);
        flat.forget_bands(pixels, width, &shaded);
        flat
    }

    /// The palette of colours that have so many dots each, and the number of each colour in it. There are no tones, and no more colours
    /// than a palette holds.
    pub(super) fn ordered(
        colours: &[(ObjectType, [u8; 3])],
        counts: &[u64],
    ) -> (Vec<(ObjectType, [u8; 3])>, Vec<u8>) {
        let plain = |rgb: [u8; 3]| rgb == [255; 3] || rgb == [0; 3];
        let drawn = colours.iter().zip(counts).filter(|&(&(_, rgb), &dots)| dots > 0 && !plain(rgb));
        let mut found: Vec<((ObjectType, [u8; 3]), u64)> = drawn.map(|(&key, &dots)| (key, dots)).collect();
        sort(&mut found);
        let mut palette = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3])];
        palette.extend(found.into_iter().map(|(key, _)| key));
        let number = |&(kind, rgb): &(ObjectType, [u8; 3])| match rgb {
            [255, 255, 255] => WHITE,
            [0, 0, 0] => BLACK,
            _ => palette.iter().position(|&known| known == (kind, rgb)).unwrap_or_default() as u8,
        };
        let table = colours.iter().map(number).collect();
        (palette, table)
    }

    /// Makes tones of the white and black dots of pictures that lie alone beside tones.
    fn forget_noise<const N: usize>(&mut self, pixels: &[[u8; N]], width: usize) {
        let index = &self.index;
        let busy: Vec<bool> =
            index.par_chunks(width).map(|row| row.iter().any(|&dot| is_tone(dot))).collect();
        let rows = index.len() / width;
        let noise: Vec<usize> = (0..rows)
            .into_par_iter()
            .filter(|&y| busy[y.saturating_sub(1)..(y + 2).min(rows)].iter().any(|&busy| busy))
            .flat_map_iter(|y| {
                (0..width).map(move |x| (x, y)).filter(move |&(x, y)| {
                    let at = y * width + x;
                    index[at] <= BLACK
                        && split(&pixels[at]).0 == ObjectType::Picture
                        && is_noise(index, width, (x, y))
                })
            })
            .map(|(x, y)| y * width + x)
            .collect();
        noise.into_iter().for_each(|at| self.index[at] = if self.index[at] == BLACK { INKED } else { TONE });
    }

    /// Makes tones of what is `shaded` where it is a band of a shading: by half of its border or more it lies beside tones like it.
    fn forget_bands<const N: usize>(&mut self, pixels: &[[u8; N]], width: usize, shaded: &[Drawn]) {
        let is_shaded: Vec<bool> = self.colours.iter().map(|colour| shaded.contains(colour)).collect();
        let shades = |dot: u8| is_shaded.get(usize::from(dot)) == Some(&true);
        let (mut bands, mut at): (Vec<Range<usize>>, usize) = (Vec::new(), 0);
        for row in self.index.chunks(width).filter(|_| !shaded.is_empty()) {
            for run in row.chunk_by(|a, b| a == b) {
                if shades(run[0]) {
                    bands.push(at..at + run.len());
                }
                at += run.len();
            }
        }
        let of = |at: usize| self.index[bands[at].start];
        let roots = Forest::of_stretches(&bands, width, |a, b| of(a) == of(b)).roots();
        let mut borders = vec![[0u64; 2]; bands.len()];
        for (band, &root) in bands.iter().zip(&roots) {
            let own = self.index[band.start];
            let is_other = |&other: &usize| self.index.get(other).is_some_and(|&dot| dot != own);
            for other in beside(band.clone(), width).filter(is_other) {
                let (kind, colour) = split(&pixels[other]);
                let (own_kind, own_colour) = self.colours[usize::from(own)];
                let [border, like] = &mut borders[root as usize];
                *border += 1;
                *like += u64::from(
                    (is_tone(self.index[other]) || shades(self.index[other]))
                        && kind == own_kind
                        && similar(colour, own_colour),
                );
            }
        }
        for (band, root) in bands.into_iter().zip(roots) {
            let [border, like] = borders[root as usize];
            if border > 0 && 2 * like >= border {
                let tone = tone(self.colours[usize::from(self.index[band.start])].1);
                self.index[band].fill(tone);
            }
        }
    }

    /// The same at the dots: the colour of the pixel under the middle of each.
    pub(super) fn at_dots(self, size: (u32, u32), dots: (usize, usize)) -> Flat {
        Flat { index: resample::classes(self.index, size, dots), ..self }
    }

    /// Which colours touch.
    pub(super) fn touching(&self, width: usize) -> Box<Touching> {
        let rows = self.index.par_chunks(width).enumerate().map(|(y, row)| {
            let mut touching = Touching::none();
            let above = if y > 0 { &self.index[(y - 1) * width..y * width] } else { row };
            for (x, (&dot, &over)) in row.iter().zip(above).enumerate() {
                touching.add(dot, over);
                touching.add(dot, row[x.saturating_sub(1)]);
            }
            touching
        });
        rows.reduce(Touching::none, Touching::joined)
    }

    /// The colours in the form in which dots ask for them, by their numbers.
    pub(super) fn keys(&self) -> [Key; 256] {
        let key_of = |&(kind, colour): &Drawn| key(colour, kind != ObjectType::Picture);
        std::array::from_fn(|number| self.colours.get(number).map_or(Key::MAX, key_of))
    }

    pub(super) fn has_tones(&self) -> bool {
        self.index.par_chunks(1 << 16).any(|dots| dots.iter().any(|&dot| is_tone(dot)))
    }

    /// Whether the halftone has nothing to do: every dot is white or black.
    pub(super) fn is_black_and_white(&self) -> bool {
        !self.index.is_empty()
            && self
                .index
                .par_chunks(1 << 16)
                .all(|dots| dots.iter().fold(0, |most, &dot| most.max(dot)) <= BLACK)
    }
}

/// Whether a dot touches a tone and none of the eight dots around it is like it.
fn is_noise(index: &[u8], width: usize, (x, y): (usize, usize)) -> bool {
    let own = index[y * width + x];
    let rows = index.chunks_exact(width).skip(y.saturating_sub(1)).take(y.min(1) + 2);
    let around = rows.flat_map(|row| &row[x.saturating_sub(1)..(x + 2).min(width)]);
    let (tones, like) = around.fold((0, 0), |(tones, like), &dot| {
        (tones + usize::from(is_tone(dot)), like + usize::from(dot == own))
    });
    // The dot itself is like itself.
    tones > 0 && like < 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dot_of_a_drawing_has_its_colour_and_a_photograph_has_tones() {
        let (blue, photo) = ([4, 0, 0, 200], [2, 90, 20, 160]);
        let row = [[0, 255, 255, 255], blue, [1, 0, 0, 200], [1, 0, 0, 0], photo, photo, [1, 255, 255, 255]];
        let flat = Flat::of(&row, 7);
        assert_eq!(flat.colours[2..], [(ObjectType::Text, [0, 0, 200]), (ObjectType::Drawing, [0, 0, 200])]);
        assert_eq!(flat.index, [WHITE, 3, 2, BLACK, INKED, INKED, WHITE]);
    }

    #[test]
    fn one_bit_art_is_exact_and_noise_in_a_photograph_is_not() {
        // Single dots among their like are art.
        let checks: Vec<[u8; 3]> =
            (0..64).map(|at| [if (at + at / 8) % 2 == 0 { 0 } else { 255 }; 3]).collect();
        let flat = Flat::of(&checks, 8);
        assert!(flat.is_black_and_white());
        assert!(checks.iter().zip(&flat.index).all(|(pixel, &dot)| (pixel[0] == 0) == (dot == BLACK)));
        // In a grey field one white dot is noise, four are an area.
        let mut field = vec![[100; 3]; 64];
        field[9] = [255; 3];
        [36, 37, 44, 45].into_iter().for_each(|at| field[at] = [255; 3]);
        let flat = Flat::of(&field, 8);
        let white: Vec<usize> = (0..64).filter(|&at| flat.index[at] == WHITE).collect();
        assert_eq!(white, [36, 37, 44, 45]);
    }

    #[test]
    fn an_area_is_flat_though_a_shading_passes_through_its_colour() {
        let shading = |at: usize| [4, (at / 8) as u8, (at % 8) as u8 * 3, 77];
        let mut pixels: Vec<[u8; 4]> = (0..2000).map(shading).collect();
        pixels.extend([shading(1000); 20]);
        let flat = Flat::of(&pixels, pixels.len());
        let [_, colour @ ..] = shading(1000);
        assert_eq!(flat.colours[2..], [(ObjectType::Drawing, colour)]);
        // The shading itself is a drawing's tone, mixed like the area.
        let drawn = super::super::colour::Colour::of(&pixels, (2020, 1), (4040, 2)).unwrap();
        let mixed = drawn.averages((4040, 2), None);
        assert!(mixed.drawn.iter().all(|&drawn| drawn) && mixed.drawn.len() == mixed.width);
    }

    /// A shading downwards and, in one of its colours, a panel beside it.
    #[test]
    fn the_band_of_a_shading_is_no_area() {
        let shading = |y: usize| [4, (y / 2) as u8, 40 + (y / 8) as u8, 77];
        let pixels: Vec<[u8; 4]> = (0..300 * 600)
            .map(|at| match (at % 300, at / 300) {
                (200.., y) if y < 400 => shading(301),
                (190.., _) => [0, 255, 255, 255],
                (x, y) => [4, shading(y)[1], shading(y)[2], 77 + (x % 3) as u8],
            })
            .collect();
        let flat = Flat::of(&pixels, 300);
        let panel = flat.index[250];
        assert_eq!(flat.colours[usize::from(panel)], (ObjectType::Drawing, [150, 77, 77]));
        for (at, &dot) in flat.index.iter().enumerate() {
            let (x, y) = (at % 300, at / 300);
            let wanted = if x >= 200 && y < 400 {
                panel
            } else if x >= 190 {
                WHITE
            } else {
                INKED
            };
            assert_eq!(dot, wanted, "at {x}, {y}");
        }
    }

    #[test]
    fn a_shading_does_not_crowd_out_the_colours_of_text() {
        // A rainbow has more colours than are judged.
        let mut pixels: Vec<[u8; 4]> =
            (0..6000).map(|at| [4, (at / 64) as u8, (at % 64) as u8 * 3, 77]).collect();
        pixels.extend([[1, 200, 10, 10]; 3]);
        pixels.extend([[4, 10, 200, 10]; 3]);
        let flat = Flat::of(&pixels, pixels.len());
        assert_eq!(
            flat.colours[2..],
            [(ObjectType::Text, [200, 10, 10]), (ObjectType::Drawing, [10, 200, 10])]
        );
        assert_eq!(flat.index.iter().filter(|&&dot| is_tone(dot)).count(), 6000);
    }

    /// The border of a table, in a grey through which a shadow passes elsewhere.
    #[test]
    fn a_line_in_the_colour_of_a_shading_stays() {
        let (ink, ground) = ([4, 187, 187, 187], [0, 255, 255, 255]);
        let shading = |x: usize, y: usize| {
            let grey = 20 + (y / 2) as u8;
            [4, grey, grey, grey + (x % 2) as u8]
        };
        let is_line = |x: usize, y: usize| (400..600).contains(&y) && (x % 50 < 4 || y % 50 < 4);
        let pixels: Vec<[u8; 4]> = (0..300 * 600)
            .map(|at| match (at % 300, at / 300) {
                (x, y @ 0..400) => shading(x, y),
                (x, y) if is_line(x, y) => ink,
                _ => ground,
            })
            .collect();
        let flat = Flat::of(&pixels, 300);
        let grey = flat.colours.iter().position(|&colour| colour == (ObjectType::Drawing, [187; 3])).unwrap();
        for (at, &dot) in flat.index.iter().enumerate() {
            let (x, y) = (at % 300, at / 300);
            match (y < 400, is_line(x, y)) {
                (true, _) => assert!(is_tone(dot), "at {x}, {y}"),
                (_, line) => assert_eq!(usize::from(dot), if line { grey } else { 0 }, "at {x}, {y}"),
            }
        }
    }
}
