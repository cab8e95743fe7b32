//! 1-bit art among pictures: masks, stamps, scanned text.
//!
//! Problem: a page calls a mask of one colour a picture, and a plain picture does not say what is line art in it; screened as
//! a photograph, both lose their outline.
//! Method: a stretch of a row is what lies between white, black and what is no picture. Stretches that touch are one shape. A
//! shape in exactly one colour is line art: photographs have no such shapes beyond specks, so a colour counts only if its
//! shapes have [`LEAST`] dots. Shapes in several colours may be flat art ([`posters`](super::posters)), in colours of [`pens`](super::pens) if they are thin, and
//! small ones in a single colour may be the softened edge of black on white, or what letters enclose of a picture.
//! Cost: 1 ns a pixel of pictures, 20 ns a stretch. Limits: a speck of another colour makes a picture of a mask, unless both are flat art.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rayon::prelude::*;

use super::flat::split;
use super::islands::without;
use super::kinds::ObjectType;
use super::main_colours;
use super::pens::Page;
use super::posters::{self, Known, Poster, Span};
use super::softened::is_between;
use sheet::forest::Forest;

/// The least dots of a colour in shapes of its own: a square of eight dots.
const LEAST: u64 = 64;

/// How far beyond the strokes of a letter the ground is that it encloses: strokes of 1 mm, and as much of what softens them.
const REACH: usize = 48;

/// The ground has so many pixels of its colour in a row.
const AREA: usize = 8;

/// Softened edges have at least so many colours on a page.
const SOFTENED: usize = 32;

/// A stretch of a row that is a picture and neither white nor black.
pub(super) struct Stretch {
    /// The first pixel.
    pub start: usize,
    /// The pixel behind the last.
    pub end: usize,
    /// Its colour; of its shape, once the shape is whole. None for several.
    colour: Option<[u8; 3]>,
}

/// The shapes in one colour, stretch by stretch, and the dots of each of their colours.
pub(super) struct Masks {
    stretches: Vec<Stretch>,
    /// What flat art in several colours is made of.
    spans: Vec<Span>,
    /// The dots of each colour.
    pub colours: HashMap<[u8; 3], u64>,
}

impl Masks {
    /// The shapes in one colour among the pictures of pixels.
    pub fn of<const N: usize>(pixels: &[[u8; N]], width: usize) -> Masks {
        let rows: Vec<Vec<Stretch>> = pixels
            .par_chunks(width)
            .enumerate()
            .map(|(y, row)| stretches_of(row).map(|stretch| stretch.moved(y * width)).collect())
            .collect();
        let mut all: Vec<Stretch> = rows.into_iter().flatten().collect();
        let places: Vec<Range<usize>> = all.iter().map(|stretch| stretch.start..stretch.end).collect();
        let roots = Forest::of_stretches(&places, width, |_, _| true).roots();
        for at in 0..all.len() {
            let root = roots[at] as usize;
            if all[at].colour != all[root].colour {
                all[root].colour = None;
            }
        }
        for at in 0..all.len() {
            all[at].colour = all[roots[at] as usize].colour;
        }
        let found = flat_art(pixels, width, (&all, &roots));
        let mut flat = vec![false; all.len()];
        found.iter().flat_map(|art| &art.stretches).for_each(|&at| flat[at as usize] = true);
        let mut enclosed = enclosed(pixels, width, (&all, &roots), &flat).into_iter();
        for (stretch, flat) in all.iter_mut().zip(flat) {
            if enclosed.next() == Some(true) || flat {
                stretch.colour = None;
            }
        }
        let mut colours = HashMap::new();
        for Art { poster, .. } in &found {
            for (span, colour) in &poster.spans {
                *colours.entry(*colour).or_default() += span.len() as u64;
            }
        }
        let drawn: Vec<[u8; 3]> = colours.keys().copied().collect();
        for stretch in &all {
            if let Some(colour) = stretch.colour {
                *colours.entry(colour).or_default() += (stretch.end - stretch.start) as u64;
            }
        }
        colours.retain(|colour, dots| *dots >= LEAST || drawn.contains(colour));
        let spans = found.into_iter().flat_map(|art| art.poster.spans).collect();
        all.retain(|stretch| stretch.colour.is_some_and(|colour| colours.contains_key(&colour)));
        Masks { stretches: all, spans, colours }
    }

    /// The stretches of line art and flat art, with the colour of each.
    pub fn stretches(&self) -> impl Iterator<Item = Span> {
        self.in_one_colour().chain(self.spans.iter().cloned())
    }

    fn in_one_colour(&self) -> impl Iterator<Item = Span> {
        self.stretches.iter().filter_map(|stretch| Some((stretch.start..stretch.end, stretch.colour?)))
    }
}

/// A shape that is flat art in several colours, or softened edges in one.
struct Art {
    /// The numbers of its stretches.
    stretches: Vec<u32>,
    /// What these become; pixels of pictures amid it have none.
    poster: Poster,
}

/// For each stretch whether its shape, in one colour, is what letters enclose of a picture: in most of its rows the picture has the same colour
/// on both sides. `flat` tells stretches of flat art.
fn enclosed<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    (all, roots): (&[Stretch], &[u32]),
    flat: &[bool],
) -> Vec<bool> {
    let is_picture = |pixel: usize| {
        let at = all.partition_point(|stretch| stretch.end <= pixel);
        all.get(at).is_some_and(|stretch| stretch.start <= pixel && stretch.colour.is_none()) && !flat[at]
    };
    let mut balance = vec![0i32; all.len()];
    for ((stretch, &root), _) in
        all.iter().zip(roots).zip(flat).filter(|((stretch, _), flat)| stretch.colour.is_some() && !**flat)
    {
        let own = &pixels[stretch.start];
        let row = stretch.start / width * width;
        // An area, no speck.
        let like = |area: &[[u8; N]], at: usize| area.iter().all(|pixel| pixel == own) && is_picture(at);
        let before = row.max(stretch.start.saturating_sub(REACH))..stretch.start;
        let behind = stretch.end..(stretch.end + REACH).min(row + width);
        let both = [before, behind].into_iter().all(|side| {
            let areas = pixels[side.clone()].windows(AREA).zip(side);
            areas.rev().any(|(area, at)| like(area, at))
        });
        balance[root as usize] += if both { 1 } else { -1 };
    }
    roots.iter().map(|&root| balance[root as usize] > 0).collect()
}

/// The pictures amid shapes, by the first stretch of each.
type Islands<'a> = HashMap<u32, &'a [Range<usize>]>;

/// The shapes that are flat art, from all stretches and the root of each.
fn flat_art<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    (all, roots): (&[Stretch], &[u32]),
) -> Vec<Art> {
    let mut order: Vec<u32> = (0..all.len() as u32).collect();
    order.sort_by_key(|&at| roots[at as usize]);
    let shapes: Vec<&[u32]> = order.chunk_by(|&a, &b| roots[a as usize] == roots[b as usize]).collect();
    let pixels_of = |shape: &[u32]| -> usize {
        shape.iter().map(|&at| all[at as usize].end - all[at as usize].start).sum()
    };
    let places = |shape: &[u32], islands: &Islands<'_>| -> Vec<Range<usize>> {
        let all = shape.iter().map(|&at| all[at as usize].start..all[at as usize].end);
        match islands.get(&shape[0]) {
            Some(islands) => {
                let all: Vec<_> = all.map(|stretch| (stretch, ())).collect();
                without(&all, islands).map(|(part, ())| part).collect()
            }
            None => all.collect(),
        }
    };
    let enlarged = enlarged(pixels, all);
    let small = posters::SMALL * enlarged * enlarged;
    let mut counts = HashMap::new();
    for shape in shapes.iter().filter(|shape| pixels_of(shape) <= small) {
        shape.iter().for_each(|&at| count_squares(pixels, (width, enlarged), &all[at as usize], &mut counts));
    }
    let find = |shapes: &[&[u32]], islands: &Islands<'_>, common: &[[u8; 3]], thin: bool| -> Vec<Art> {
        let palette = [&main_colours::WHITE_AND_BLACK[..], common].concat();
        let is_itself = |colour| common.contains(&colour) && !is_between(colour, &palette, |_| true);
        let found = shapes.par_iter().filter_map(|shape| {
            let colour = all[shape[0] as usize].colour;
            if colour.is_some_and(is_itself) {
                return None;
            }
            let known = Known { common, thin, enlarged };
            let poster = posters::poster(pixels, width, &places(shape, islands), known)?;
            // In one colour it is line art by itself.
            let itself = colour.is_some() && poster.spans.iter().any(|span| Some(span.1) == colour);
            (!itself).then(|| Art { stretches: shape.to_vec(), poster })
        });
        found.collect()
    };
    let (of_letters, large): (Vec<&[u32]>, Vec<&[u32]>) =
        shapes.into_iter().partition(|shape| pixels_of(shape) <= small);
    let (in_one, in_several): (Vec<&[u32]>, Vec<&[u32]>) =
        large.into_iter().partition(|shape| all[shape[0] as usize].colour.is_some());
    let mut found = find(&in_several, &Islands::new(), &[], false);
    // What a letter encloses of its ground is small, too.
    let mut areas: HashMap<[u8; 3], u64> = HashMap::new();
    for (span, colour) in found.iter().flat_map(|art| &art.poster.spans) {
        *areas.entry(*colour).or_default() += span.len() as u64;
    }
    for shape in in_one {
        if let Some(colour) = all[shape[0] as usize].colour {
            *areas.entry(colour).or_default() += pixels_of(shape) as u64;
        }
    }
    let common = main_colours::common(counts, &areas);
    let mut is_flat = vec![false; all.len()];
    found.iter().flat_map(|art| &art.stretches).for_each(|&at| is_flat[at as usize] = true);
    let enclosed = enclosed(pixels, width, (all, roots), &is_flat);
    let of_letters: Vec<&[u32]> =
        of_letters.into_iter().filter(|shape| !enclosed[shape[0] as usize]).collect();
    found.extend(find(&of_letters, &Islands::new(), &common, false));
    let flat: HashMap<u32, &Poster> = found.iter().map(|art| (art.stretches[0], &art.poster)).collect();
    // Text in a colour of its own may be less than what is left over of a large ground.
    let is_left = |shape: &&&[u32]| {
        all[shape[0] as usize].colour.is_none()
            && flat.get(&shape[0]).is_none_or(|poster| poster.strays >= main_colours::LEAST)
    };
    let left: Vec<&[u32]> = in_several.iter().chain(&of_letters).filter(is_left).copied().collect();
    let islands: Islands<'_> = flat.iter().map(|(&at, poster)| (at, &poster.islands[..])).collect();
    let shapes: Vec<Vec<Range<usize>>> = left.iter().map(|shape| places(shape, &islands)).collect();
    let (thin, pens) = Page { pixels, width, enlarged }.pens(&shapes, areas, &common);
    let thin: Vec<&[u32]> = thin.into_iter().map(|at| left[at]).collect();
    let mut drawn = find(&thin, &islands, &[&pens[..], &common].concat(), true);
    drawn.retain(|art| {
        flat.get(&art.stretches[0]).is_none_or(|poster| 2 * art.poster.strays <= poster.strays)
    });
    let again: HashSet<u32> = drawn.iter().map(|art| art.stretches[0]).collect();
    found.retain(|art| !again.contains(&art.stretches[0]));
    found.extend(drawn);
    found
}

/// How many times pictures have been enlarged, as a page of 300 dpi is to be drawn at 600: nearly all runs of one colour are then at
/// least so long. Drawings in a few colours have long runs by themselves.
fn enlarged<const N: usize>(pixels: &[[u8; N]], all: &[Stretch]) -> usize {
    let (mut runs, mut colours) = ([0usize; posters::MOST_ENLARGED], HashSet::new());
    for run in all.iter().flat_map(|stretch| pixels[stretch.start..stretch.end].chunk_by(|a, b| a == b)) {
        runs[run.len().min(posters::MOST_ENLARGED) - 1] += 1;
        if colours.len() < SOFTENED {
            colours.insert(split(&run[0]).1);
        }
    }
    if colours.len() < SOFTENED {
        return 1;
    }
    let total: usize = runs.iter().sum();
    let shorter = |length: usize| runs[..length - 1].iter().sum::<usize>();
    (1..=posters::MOST_ENLARGED).rev().find(|&length| 50 * shorter(length) <= total).unwrap_or(1)
}

/// Counts the pixels of a stretch that are alike in squares of four as they were drawn.
fn count_squares<const N: usize>(
    pixels: &[[u8; N]],
    (width, enlarged): (usize, usize),
    stretch: &Stretch,
    counts: &mut HashMap<[u8; 3], u64>,
) {
    let over = width * enlarged;
    for at in (stretch.start + enlarged..stretch.end).filter(|&at| at >= over) {
        let own = pixels[at];
        if own == pixels[at - enlarged] && own == pixels[at - over] && own == pixels[at - over - enlarged] {
            *counts.entry(split(&own).1).or_default() += 1;
        }
    }
}

impl Stretch {
    fn moved(self, by: usize) -> Stretch {
        Stretch { start: self.start + by, end: self.end + by, ..self }
    }
}

/// The stretches of a row.
fn stretches_of<const N: usize>(row: &[[u8; N]]) -> impl Iterator<Item = Stretch> {
    let drawn = |pixel: &[u8; N]| match split(pixel) {
        (ObjectType::Picture, [0, 0, 0] | [255, 255, 255]) => false,
        (kind, _) => kind == ObjectType::Picture,
    };
    let mut at = 0;
    std::iter::from_fn(move || {
        at += row[at..].iter().position(drawn)?;
        let start = at;
        at += row[at..].iter().position(|pixel| !drawn(pixel)).unwrap_or(row.len() - at);
        let (_, colour) = split(&row[start]);
        let alike = row[start..at].iter().all(|pixel| split(pixel).1 == colour);
        Some(Stretch { start, end: at, colour: alike.then_some(colour) })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A map of cells in many colours with a black ring in each: what rings enclose is of the picture. A disc beside it is not.
    #[test]
    fn what_letters_enclose_of_a_picture_is_no_mask() {
        const CELL: usize = 48;
        let width = 7 * CELL;
        let disc = |x: usize, y: usize| ((x % CELL) as f64 - 23.5).hypot((y % CELL) as f64 - 23.5);
        let pixels: Vec<[u8; 3]> = (0..width * 6 * CELL)
            .map(|at| {
                let (x, y) = (at % width, at / width);
                let cell = (x / CELL + y / CELL * 6) as u8;
                let own = [40 + 5 * cell, 200 - 5 * cell, 3 * cell];
                match (x / CELL, disc(x, y)) {
                    (6, ..6.0) if y < CELL => [40, 200, 0],
                    (6, _) => [255; 3],
                    (_, 6.0..9.0) => [0; 3],
                    _ => own,
                }
            })
            .collect();
        let masks = Masks::of(&pixels, width);
        for (span, _) in masks.stretches() {
            for at in span {
                let (x, y) = (at % width, at / width);
                assert!(x / CELL == 6 && y < CELL, "at {x}, {y}");
            }
        }
        assert_eq!(masks.colours.get(&[40, 200, 0]).copied(), Some(112));
    }

    proptest! {
        #[test]
        fn shapes_in_one_colour_are_found(width in 1usize..24, cells in prop::collection::vec(0usize..12, 24..120)) {
            // White, black, text, and pictures in two colours; mostly bare, so that shapes stay apart.
            let kinds = [[0, 255, 255, 255], [2, 0, 0, 0], [1, 9, 9, 200], [2, 9, 9, 200], [2, 200, 9, 9]];
            let pixels: Vec<[u8; 4]> = cells[..cells.len() / width * width].iter()
                .map(|&cell| kinds[[0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 4][cell]]).collect();
            // Many times one below the other, so that colours reach their least number of dots.
            let blank = vec![kinds[0]; width];
            let pages: Vec<[u8; 4]> = (0..12).flat_map(|_| [&pixels[..], &blank].concat()).collect();
            let picture = |at: usize| pages[at][0] == 2 && pages[at][1] > 0;
            // By spreading numbers from dot to neighbour.
            let mut number: Vec<usize> = (0..pages.len()).collect();
            let mut changed = true;
            while std::mem::take(&mut changed) {
                for at in (0..pages.len()).filter(|&at| picture(at)) {
                    let right = (at % width + 1 < width).then_some(at + 1);
                    for next in [right, Some(at + width)].into_iter().flatten() {
                        if next < pages.len() && picture(next) {
                            let least = number[at].min(number[next]);
                            changed |= number[at] != least || number[next] != least;
                            (number[at], number[next]) = (least, least);
                        }
                    }
                }
            }
            let mixed: Vec<usize> =
                (0..pages.len()).filter(|&at| pages[at] != pages[number[at]]).map(|at| number[at]).collect();
            let whole: Vec<bool> = (0..pages.len()).map(|at| picture(at) && !mixed.contains(&number[at])).collect();
            let dots = |colour: [u8; 4]| (0..pages.len()).filter(|&at| whole[at] && pages[at] == colour).count() as u64;
            let enough = kinds.map(|colour| dots(colour) >= LEAST);
            let masks = Masks::of(&pages, width);
            // Specks in both colours, all alike, are drawn by pens: such colours are enough, too.
            let drawn = |pixel: &[u8; 4]| masks.spans.iter().any(|(_, colour)| *colour == split(pixel).1);
            let is_enough = |pixel: &[u8; 4]| {
                drawn(pixel) || kinds.iter().zip(enough).any(|(kind, enough)| enough && kind == pixel)
            };
            let mut found = vec![false; pages.len()];
            for (stretch, colour) in masks.in_one_colour() {
                for at in stretch {
                    prop_assert_eq!(split(&pages[at]).1, colour);
                    found[at] = true;
                }
            }
            for (at, found) in found.into_iter().enumerate() {
                prop_assert_eq!(found, whole[at] && is_enough(&pages[at]), "{}", at);
            }
        }
    }
}
