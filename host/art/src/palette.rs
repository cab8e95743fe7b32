//! The palette of flat colours of a page that may draw in more than there are numbers.
//!
//! Problem: a shading has hundreds of colours, which would crowd out those of lines and areas.
//! Method: text comes first, then the most frequent. If there are too many, the colours of shadings are left out: the ones with a similar
//! colour on the page that has nearly as many dots, if half of their border or more is to such colours. An area stays, and so does a line,
//! though a shading passes through their colour.
//! Shadings in letters count only if their strokes are wide.
//! Cost: a look at each pixel; at five more for each run of a row on pages with too many colours. Limits: [`MOST`] colours of the
//! [`JUDGED`] most frequent.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::flat::{Drawn, INKED, similar, split};
use super::kinds::ObjectType;
use super::masks::Masks;
use super::posters::Span;

/// The most colours besides white and black.
const MOST: usize = INKED as usize - 2;
/// A colour with so many times the dots of any similar one is an area, though a shading passes through it.
const AREA: u64 = 16;
/// Colours gathered before the palette is chosen, and those of them among which it is: a shading may have more, and what is below it on the page
/// counts as well.
const GATHERED: usize = 1 << 16;
const JUDGED: usize = 4096;
/// Strokes in which a shading is screened are at least so many dots wide.
const WIDE: u64 = 18;
/// Rows that are gathered at once.
const ROWS: usize = 64;

/// The colours of text and drawings, text first, then the most frequent; and those of them through which a shading passes.
pub(super) fn palette<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    (masks, letters): (&Masks, &[Span]),
) -> (Vec<Drawn>, Vec<Drawn>) {
    type Counts = HashMap<(ObjectType, [u8; 3]), u64>;
    let add = |counts: &mut Counts, key, dots| {
        if counts.len() < GATHERED || counts.contains_key(&key) {
            *counts.entry(key).or_default() += dots;
        }
    };
    let gathered: Vec<Counts> = pixels
        .par_chunks(width * ROWS)
        .map(|pixels| {
            let mut counts = Counts::new();
            for run in pixels.chunk_by(|a, b| a == b) {
                match split(&run[0]) {
                    (ObjectType::Picture, _) | (_, [255, 255, 255] | [0, 0, 0]) => {}
                    key => add(&mut counts, key, run.len() as u64),
                }
            }
            counts
        })
        .collect();
    let plain = |colour: [u8; 3]| colour == [255; 3] || colour == [0; 3];
    let mut counts: Counts = masks
        .colours
        .iter()
        .filter(|(colour, _)| !plain(**colour))
        .map(|(&colour, &dots)| ((ObjectType::Drawing, colour), dots))
        .collect();
    // Letters through which a picture shows have many colours, and stay letters.
    let translucent: HashSet<[u8; 3]> = letters.iter().map(|(_, colour)| *colour).collect();
    for (stretch, colour) in letters {
        add(&mut counts, (ObjectType::Text, *colour), stretch.len() as u64);
    }
    for part in gathered {
        // In a fixed order, because the number of colours is limited.
        let mut part: Vec<_> = part.into_iter().collect();
        part.sort_unstable();
        part.into_iter().for_each(|(key, dots)| add(&mut counts, key, dots));
    }
    let mut colours: Vec<((ObjectType, [u8; 3]), u64)> = counts.into_iter().collect();
    sort(&mut colours);
    colours.truncate(JUDGED);
    let mut shaded = Vec::new();
    if colours.len() > MOST {
        let wide = in_wide_strokes(pixels, width);
        let all = colours.clone();
        let borders = borders(pixels, width, &all);
        colours.retain(|&((kind, colour), dots)| {
            let mut similar = all
                .iter()
                .filter(|&&((other, near), _)| other == kind && near != colour && similar(near, colour))
                .peekable();
            let may_be_shaded =
                kind != ObjectType::Text || wide.contains(&colour) && !translucent.contains(&colour);
            let is_shaded = may_be_shaded && similar.peek().is_some();
            // What lies in pictures has no border here. It is flat art, which has no shadings.
            let is_band = || {
                let border = borders.get(&(kind, colour)).copied();
                border.is_some_and(|[border, like]| border > 0 && 2 * like >= border)
            };
            let stays = !is_shaded || !is_band() || similar.all(|&(_, as_many)| dots >= AREA * as_many);
            if is_shaded && stays {
                shaded.push((kind, colour));
            }
            stays
        });
    }
    colours.truncate(MOST);
    (colours.into_iter().map(|(key, _)| key).collect(), shaded)
}

/// The colours of letters whose strokes are wide along rows, in the mean: what is fine is not read if it is screened.
fn in_wide_strokes<const N: usize>(pixels: &[[u8; N]], width: usize) -> HashSet<[u8; 3]> {
    let mut strokes: HashMap<[u8; 3], [u64; 2]> = HashMap::new();
    let is_text = |pixel: &[u8; N]| split(pixel).0 == ObjectType::Text;
    for row in pixels.chunks(width) {
        for stroke in row.chunk_by(|a, b| is_text(a) == is_text(b)).filter(|stroke| is_text(&stroke[0])) {
            for run in stroke.chunk_by(|a, b| a == b) {
                let [count, length] = strokes.entry(split(&run[0]).1).or_default();
                *count += 1;
                *length += stroke.len() as u64;
            }
        }
    }
    strokes.retain(|_, [count, length]| *length >= WIDE * *count);
    strokes.into_keys().collect()
}

/// How much of the border of each colour there is, and how much of it to similar colours. Of each run of dots both ends count, and above
/// and below it the middle.
fn borders<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    colours: &[(Drawn, u64)],
) -> HashMap<Drawn, [u64; 2]> {
    let none: HashMap<Drawn, [u64; 2]> = colours.iter().map(|&(key, _)| (key, [0; 2])).collect();
    let rows = pixels.par_chunks(width * ROWS).enumerate().map(|(part, rows)| {
        let mut borders = none.clone();
        let mut start = part * width * ROWS;
        for run in rows.chunks(width).flat_map(|row| row.chunk_by(|a, b| a == b)) {
            let (first, end) = (start, start + run.len());
            start = end;
            let (kind, colour) = split(&run[0]);
            let Some([border, like]) = borders.get_mut(&(kind, colour)) else { continue };
            let middle = first + run.len() / 2;
            let beside = [
                (first.checked_sub(1).filter(|_| !first.is_multiple_of(width)), 1),
                (Some(end).filter(|end| !end.is_multiple_of(width)), 1),
                (middle.checked_sub(width), run.len() as u64),
                (Some(middle + width), run.len() as u64),
            ];
            for (at, dots) in beside {
                let Some(pixel) = at.and_then(|at| pixels.get(at)).filter(|pixel| **pixel != run[0]) else {
                    continue;
                };
                let (other, near) = split(pixel);
                *border += dots;
                *like += if other == kind && similar(near, colour) { dots } else { 0 };
            }
        }
        borders
    });
    let sum = |mut all: HashMap<Drawn, [u64; 2]>, part: HashMap<Drawn, [u64; 2]>| {
        for (key, [border, like]) in part {
            let [all_border, all_like] = all.entry(key).or_default();
            *all_border += border;
            *all_like += like;
        }
        all
    };
    rows.reduce(HashMap::new, sum)
}

/// Text first, then the most frequent.
pub(super) fn sort(colours: &mut [((ObjectType, [u8; 3]), u64)]) {
    colours.sort_unstable_by_key(|&((kind, colour), dots)| (kind, std::cmp::Reverse(dots), colour));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters over a shadow have hundreds of colours, and are not read if they are screened; gold letters are shaded.
    #[test]
    fn shadings_in_fine_letters_stay_letters_and_those_in_wide_ones_are_tones() {
        let width = 60;
        for (stroke, stay) in [(8usize, true), (30, false)] {
            let pixel = |at: usize| {
                let step = (at / width / 2) as u8;
                match at % width {
                    x if x < stroke => {
                        [ObjectType::TEXT, 30 + step / 3, 60 + (step + 1) / 3, 90 + (step + 5) / 3]
                    }
                    _ => [0, 255, 255, 255],
                }
            };
            // Of two rows each; half as many again in a drawing, which alone are too many.
            let mut pixels: Vec<[u8; 4]> = (0..width * 400).map(pixel).collect();
            pixels.extend(
                (0..width * 300)
                    .map(|at| [ObjectType::DRAWING, 200, (at / 64 % 256) as u8, (at / 64 / 256) as u8]),
            );
            let found = palette(&pixels, width, (&Masks::of(&pixels, width), &[])).0;
            let letters = found.iter().filter(|(kind, _)| *kind == ObjectType::Text).count();
            assert_eq!(letters > 150, stay, "{stroke}: {letters}");
            // The last step borders on something else.
            assert!(stay || letters <= 2, "{stroke}: {letters}");
        }
    }
}
