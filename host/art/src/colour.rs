//! Plain colour to the process inks: a picture is a matte document.
//!
//! Problem: a page has thirty million dots, white must stay bare paper, and letters must stay whole.
//! Method: [`screen`] picks each dot's stack by the dot's own colour, whose mixture a [`Fit`] knows. Other
//! halftones need more than a dot: for them `tones` averages the colours. A page in black and white has its
//! stacks already. Cost: that of the halftone; a page in black and white costs nothing. Limits: those of
//! `fit`.

pub(crate) mod bound;
pub(crate) mod fit;
pub(crate) mod intent;
pub(crate) mod lattice;
pub(crate) mod packed;
pub(crate) mod solids;
pub(crate) mod tetrahedra;

use std::ops::Range;

use inks::{InkSet, Library, Stack};
use protocol::ink::Ink;
use rayon::prelude::*;

use crate::colour::fit::{Fit, Wishes};
use crate::colour::intent::Intent;
use crate::colour::lattice::ends;
use crate::colour::packed::{BLACK, Key, LABEL, WHITE, colour as colour_of, of_drawn};
use crate::colour::solids::Solids;
use crate::dots::bitplane;
use crate::dots::pixels::{Pixels, Rows};
use crate::dots::screen;
use crate::dots::tones;
use crate::dots::turn;
use crate::error::{no_cluster, not_halftoned};
use crate::read::object_type::{ObjectType, split};
use appearance::brdf::Space;
use appearance::document::SAMPLES;
use appearance::gamut::Printable;
use appearance::wide::wide;
use halftone::green_noise::Table;
use halftone::{Method, halftone};
use observe::{Diagnosis, Observer};
use sheet::{Plane, Turn, pack};

/// Dots that are looked at together.
const BLOCK: usize = 32;

/// Colours to print with the process inks.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    drawn: Drawn,
    /// Whether the colours are printed on dots of layers, too; an ink of a layer otherwise has its dots to itself.
    pub(crate) overprints: bool,
}

/// What has the colours.
#[derive(Clone, Debug, PartialEq)]
enum Drawn {
    /// Black dots on white.
    Black(Plane),
    /// For each dot the number of its colour.
    Numbered(Vec<(ObjectType, [u8; 3])>, Vec<u8>),
    /// Pixels, which are read when their dots are picked, and what drew them.
    Pixels(Pixels, Drew),
}

/// What drew colours other than white.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
struct Drew {
    any: bool,
    /// Whether there are tones of pictures, and of text and drawings: black and white are none.
    pictures: bool,
    drawings: bool,
}

impl Drew {
    fn of<const N: usize>(pixels: &[[u8; N]]) -> Drew {
        let (mut any, mut pictures, mut drawings) = (false, false, false);
        wide(
            #[inline(always)]
            || {
                for pixel in pixels {
                    let (kind, [r, g, b]) = split(pixel);
                    let is_tone = (r & g & b != 255) & (r | g | b != 0);
                    let is_picture = kind == ObjectType::Picture;
                    any |= r & g & b != 255;
                    pictures |= is_tone & is_picture;
                    drawings |= is_tone & !is_picture;
                }
            },
        );
        Drew { any, pictures, drawings }
    }

    fn and(self, other: Drew) -> Drew {
        Drew {
            any: self.any | other.any,
            pictures: self.pictures | other.pictures,
            drawings: self.drawings | other.drawings,
        }
    }
}

/// The dots of the process inks.
pub(crate) struct Picked {
    pub planes: Vec<(Ink, Plane)>,
    /// The number of each dot's stack, and for each number the planes that have it, a bit each; `None` for black alone.
    pub stacks: Option<(Vec<u8>, [u16; 256])>,
}

/// How the colours become dots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct How {
    pub intent: Intent,
    pub gamma: f64,
    pub halftone: Method,
    /// Whether text is printed in the nearest solid.
    pub labels: bool,
}

impl Colour {
    /// Black dots on white.
    pub(crate) fn black(dots: Plane) -> Colour {
        Colour { drawn: Drawn::Black(dots), overprints: false }
    }

    /// Rows of `width` dots in these colours, a number each; `None` if all are white.
    pub(crate) fn numbered(
        colours: Vec<(ObjectType, [u8; 3])>,
        index: Vec<u8>,
        width: usize,
    ) -> Option<Colour> {
        let used = index.par_chunks(1 << 16).map(|dots| {
            let mut used = [false; 256];
            for dots in dots.chunks(BLOCK) {
                // Most of a page is one colour.
                if dots.iter().fold(0, |other, dot| other | (dot ^ dots[0])) == 0 {
                    used[usize::from(dots[0])] = true;
                } else {
                    dots.iter().for_each(|&dot| used[usize::from(dot)] = true);
                }
            }
            used
        });
        let used = used.reduce(|| [false; 256], |a, b| std::array::from_fn(|at| a[at] | b[at]));
        let inked = colours.iter().zip(used).filter(|&(colour, used)| used && colour.1 != [255; 3]);
        inked.clone().next()?;
        if inked.clone().all(|(colour, _)| colour.1 == [0; 3]) {
            let black = |dot: u8| colours[usize::from(dot)].1 == [0; 3];
            return Some(Colour::black(bitplane::from_bytes(width, &index, black)));
        }
        Some(Colour { drawn: Drawn::Numbered(colours, index), overprints: false })
    }

    /// The colours of pixels of three bytes, or of four with a tag before them; `None` if all are white.
    pub(crate) fn of_pixels<const N: usize>(bytes: Vec<u8>, size: (u32, u32)) -> Option<Colour> {
        let parts = bytes.as_chunks::<N>().0.par_chunks(1 << 12).map(Drew::of);
        let drew = parts.reduce(Drew::default, Drew::and);
        let pixels = Pixels { bytes, each: N, width: size.0 as usize, height: size.1 as usize };
        drew.any.then_some(Colour { drawn: Drawn::Pixels(pixels, drew), overprints: false })
    }

    /// The same colours, turned; `dots` are those before the turn.
    pub(crate) fn turned(self, dots: (usize, usize), turn: Turn) -> Colour {
        let drawn = match self.drawn {
            Drawn::Black(plane) => Drawn::Black(turn::plane(&plane, turn)),
            Drawn::Numbered(colours, index) => Drawn::Numbered(colours, turn::samples(index, 1, dots, turn)),
            Drawn::Pixels(pixels, drew) => Drawn::Pixels(pixels.turned(turn), drew),
        };
        Colour { drawn, ..self }
    }

    /// What writes the colours of rows of so many dots; `labels` says whether text is a label.
    pub(crate) fn rows(&self, dots: (usize, usize), labels: bool) -> Box<Rows<'_>> {
        let of_rows = move |rows: Range<usize>| rows.start * dots.0..rows.end * dots.0;
        match &self.drawn {
            Drawn::Black(plane) => Box::new(move |rows, out| {
                for (y, out) in rows.zip(out.chunks_exact_mut(dots.0)) {
                    let row = &plane.bits[y * plane.stride..][..plane.stride];
                    let is_black = |x: usize| row[x / 8] & 0x80 >> (x % 8) != 0;
                    out.iter_mut().enumerate().for_each(|(x, out)| {
                        *out = if is_black(x) { BLACK } else { WHITE };
                    });
                }
            }),
            Drawn::Numbered(colours, index) => {
                let keys: Vec<Key> = colours.iter().map(|&(kind, rgb)| of_drawn(kind, rgb, labels)).collect();
                Box::new(move |rows, out| {
                    for (out, dots) in out.chunks_mut(BLOCK).zip(index[of_rows(rows)].chunks(BLOCK)) {
                        if dots.iter().fold(0, |other, dot| other | (dot ^ dots[0])) == 0 {
                            out.fill(keys[usize::from(dots[0])]);
                        } else {
                            out.iter_mut().zip(dots).for_each(|(out, &dot)| *out = keys[usize::from(dot)]);
                        }
                    }
                })
            }
            Drawn::Pixels(pixels, _) => pixels.rows(dots, labels),
        }
    }

    /// The dots of the process inks that the colours need.
    pub(crate) fn picked(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        how: How,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<Picked, Diagnosis> {
        if let Drawn::Black(black) = &self.drawn {
            let inks = black_inks(inks, library);
            let planes = inks.into_iter().map(|ink| (ink, black.clone())).collect();
            return Ok(Picked { planes, stacks: None });
        }
        let (stacks, index) = self.stacks(dots, inks, how, library, observer)?;
        let mut inks_of = [0u16; 256];
        for (inks_of, stack) in inks_of.iter_mut().zip(&stacks) {
            let has = inks.iter().enumerate().filter(|(_, ink)| stack.layers().contains(ink));
            *inks_of = has.fold(0, |bits, (at, _)| bits | 1 << at);
        }
        let planes = pack::pack(dots.0, &index, &inks_of, inks.len());
        Ok(Picked { planes: inks.iter().zip(planes).collect(), stacks: Some((index, inks_of)) })
    }

    /// Stacks of process inks, and the number of the stack of each dot.
    fn stacks(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        how: How,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(Vec<Stack>, Vec<u8>), Diagnosis> {
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(library, inks, &space);
        let solids = Solids::new(&printable, &space);
        let (has_pictures, has_drawings) = match &self.drawn {
            Drawn::Pixels(_, drew) => (drew.pictures, drew.drawings),
            // A numbered page has no tones of pictures.
            _ => (false, true),
        };
        let wishes = Wishes { intent: how.intent, gamma: how.gamma, has_drawings, has_pictures };
        let mut fit = Fit::new((&printable, &solids), &space, &wishes)?;
        let rows = self.rows(dots, how.labels);
        if how.halftone == Method::Fine {
            let table = Table::for_cluster(largest_cluster(inks, library)?);
            let index = screen::dots(rows, dots, (&fit, &solids), table, has_pictures);
            return Ok((fit.stacks, index));
        }
        let corners: Vec<[u8; 3]> =
            (0..8).map(|bits| [4, 2, 1].map(|bit| if bits & bit > 0 { 255 } else { 0 })).collect();
        let stacks: Vec<Stack> = printable.stacks.clone();
        let numbers: Vec<u8> = stacks.iter().map(|stack| fit.number(stack.clone())).collect();
        let number = |stack: &Stack| Some(numbers[stacks.iter().position(|known| known == stack)?]);
        let named: Vec<Option<u8>> =
            corners.into_iter().map(|corner| number(&solids.named(corner)?)).collect();
        let solid = |key: Key| match colour_of(key) {
            rgb if rgb.iter().all(|&v| v == 0 || v == 255) => {
                named[rgb.iter().fold(0, |bits, &v| 2 * bits + usize::from(v > 0))]
            }
            rgb if key & LABEL > 0 => solids.nearest(rgb).and_then(number),
            _ => None,
        };
        let (mix, fixed) = tones::mixed(&rows, dots, fit, solid)?;
        // Larger art was refused when its size was decided.
        let size = (dots.0 as u16, dots.1 as u16);
        let settings = halftone::Settings {
            method: how.halftone,
            ..halftone::Settings::from_library(&mix.stacks, library)
        };
        Ok(halftone(&mix, size, Some(&fixed), &settings, observer).map_err(not_halftoned)?.into_parts())
    }

    /// The colour of each of so many dots.
    #[cfg(test)]
    pub(crate) fn keys(&self, dots: (usize, usize)) -> Vec<Key> {
        let mut keys = vec![0; dots.0 * dots.1];
        self.rows(dots, false)(0..dots.1, &mut keys);
        keys
    }
}

/// The minimum cluster of the most demanding of these inks.
pub(crate) fn largest_cluster(inks: &InkSet, library: &Library) -> Result<u16, Diagnosis> {
    let cluster = |ink: Ink| Some(library.cartridge(ink)?.minimum_cluster.get());
    inks.iter().try_fold(1, |most, ink| Ok(most.max(cluster(ink).ok_or_else(|| no_cluster(ink))?)))
}

/// The inks of black: black ink or, without it, the darkest stack of these process inks.
fn black_inks(inks: &InkSet, library: &Library) -> Vec<Ink> {
    if inks.contains(Ink::Black) {
        return vec![Ink::Black];
    }
    let space = Space::half_angle(SAMPLES);
    let printable = Printable::from_library(library, inks, &space);
    printable.stacks[ends(&printable, &space).1].layers().to_vec()
}
