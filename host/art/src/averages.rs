//! The colours between which dots are halftoned: averages of pixels in linear light.
//!
//! Problem: no cluster of dots is finer than 300 dpi, and a finer picture would alias. Letters in an average would bleed into the
//! tone around them.
//! Method: pixels are averaged to at most one for two dots along each side. Dots that are fixed, white and black among them, do
//! not count beside others; where there are only such, a neighbour's colour takes their place. Which flat colours are fixed is known only when the
//! inks are: tones are averaged at once, and flat colours at the dots join them then. Whether text or a drawing
//! has a pixel's colour decides how it is mixed.
//! Cost: 5 ns a pixel that is not bare, and as much a dot of pages with tones and flat colours. Limits: where sides are no multiples, pixels at
//! borders count twice.

use std::ops::Range;

use rayon::prelude::*;

use super::colour::Colour;
use super::flat::{BLACK, Flat, WHITE, is_tone};
use super::kinds::ObjectType;

/// What counts of the pixels under one of an average.
#[derive(Default)]
struct Part {
    /// The sum of their linear light, and how many they are.
    light: [u64; 3],
    count: u64,
    /// Whether text or a drawing has the first of them.
    drawn: bool,
    /// Whether none of them counts beside others.
    plain: bool,
}

impl Part {
    fn add(&mut self, light: [u64; 3], count: u64) {
        (0..3).for_each(|c| self.light[c] += count * light[c]);
        self.count += count;
    }
}

/// Linear light of the 256 values of sRGB in 16 bits: exact enough to restore every one.
struct Codes {
    linear: Vec<u32>,
    coded: Vec<u8>,
}

impl Codes {
    fn new() -> Codes {
        let linear: Vec<u32> = (0..=255u8)
            .map(|v| (65535.0 * appearance::srgb::decode(f32::from(v) / 255.0)).round() as u32)
            .collect();
        let coded = (0..=65535)
            .map(|light| {
                let above = linear.partition_point(|&v| v < light).clamp(1, 255);
                let nearer = light.abs_diff(linear[above]) <= light.abs_diff(linear[above - 1]);
                (if nearer { above } else { above - 1 }) as u8
            })
            .collect();
        Codes { linear, coded }
    }

    fn light(&self, colour: [u8; 3]) -> [u64; 3] {
        colour.map(|v| self.linear[usize::from(v)].into())
    }
}

/// The colours of pixels averaged to at most one pixel for two dots along each side; `pixel` says what drew one, in which colour,
/// and `fixed` whether one besides white and black does not count.
pub(super) fn averaged(
    pixel: impl Fn(usize) -> (ObjectType, [u8; 3]) + Sync,
    fixed: impl Fn(usize) -> bool + Sync,
    flat: &Flat,
    size: (usize, usize),
    dots: (usize, usize),
) -> Colour {
    let to = (size.0.min(dots.0.div_ceil(2)), size.1.min(dots.1.div_ceil(2)));
    let codes = Codes::new();
    let counts = |at: usize| flat.index[at] > BLACK && !fixed(at);
    gathered(flat, (size, to), &codes, |_, under| {
        let toned = under.clone().find(|&at| counts(at));
        // Flat colours are drawn wherever they come from, and so are shadings.
        let drawn = toned.is_some_and(|at| !is_tone(flat.index[at]) || pixel(at).0 != ObjectType::Picture);
        let mut part = Part { drawn, plain: toned.is_none(), ..Part::default() };
        for at in under.filter(|&at| toned.is_none() || counts(at)) {
            part.add(codes.light(pixel(at).1), 1);
        }
        part
    })
}

/// The same where `tones` are averages of tones alone: with the flat colours at the dots, but for those that are `fixed`.
pub(super) fn joined(
    tones: &Colour,
    flat: &Flat,
    fixed: impl Fn(usize) -> bool + Sync,
    dots: (usize, usize),
) -> Colour {
    let to = (dots.0.div_ceil(2), dots.1.div_ceil(2));
    let codes = Codes::new();
    let places = [between(to.0, tones.width), between(to.1, tones.height)];
    let tone = |(x, y): (usize, usize)| {
        let [(left, right), (above, below)] = [places[0][x], places[1][y]];
        let mut light = [0; 3];
        for (row, down) in [(above, 256 - below), (above + 1, below)].into_iter().filter(|row| row.1 > 0) {
            for (column, across) in [(left, 256 - right), (left + 1, right)].into_iter().filter(|c| c.1 > 0) {
                let at = 3 * (row * tones.width + column);
                let own = codes.light([tones.rgb[at], tones.rgb[at + 1], tones.rgb[at + 2]]);
                (0..3).for_each(|c| light[c] += down * across * own[c]);
            }
        }
        let nearest = (above + usize::from(below > 128)) * tones.width + left + usize::from(right > 128);
        (light.map(|v| (v + (1 << 15)) >> 16), tones.drawn.get(nearest) == Some(&true))
    };
    gathered(flat, (dots, to), &codes, |at, under| {
        let (mut part, mut toned) = (Part::default(), 0);
        for dot in under {
            match flat.index[dot] {
                colour if is_tone(colour) => toned += 1,
                WHITE | BLACK => {}
                colour if !fixed(dot) => part.add(codes.light(flat.colours[usize::from(colour)].1), 1),
                _ => {}
            }
        }
        part.drawn = part.count > 0;
        if toned > 0 {
            let (light, drawn) = tone(at);
            part.add(light, toned);
            part.drawn |= drawn;
        }
        Part { plain: part.count == 0, ..part }
    })
}

/// Where so many parts lie between pixels: the pixel before the middle of each, and the weight of the next in 1/256.
fn between(parts: usize, pixels: usize) -> Vec<(usize, u64)> {
    let place = |at: usize| {
        let numerator = 256 * (2 * at as i64 + 1) * pixels as i64 - 256 * parts as i64;
        let place = (numerator / (2 * parts as i64)).clamp(0, 256 * (pixels as i64 - 1));
        ((place / 256) as usize, (place % 256) as u64)
    };
    (0..parts).map(place).collect()
}

/// The numbers of pixels in some columns of some rows.
#[derive(Clone)]
struct Pixels {
    columns: Range<usize>,
    rows: Range<usize>,
    width: usize,
    column: usize,
}

impl Pixels {
    fn under(rows: Range<usize>, columns: Range<usize>, width: usize) -> Pixels {
        Pixels { column: columns.start, columns, rows, width }
    }
}

impl Iterator for Pixels {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        if self.column == self.columns.end {
            self.column = self.columns.start;
            self.rows.start += 1;
        }
        if self.rows.is_empty() {
            return None;
        }
        self.column += 1;
        Some(self.rows.start * self.width + self.column - 1)
    }
}

/// Averages of so many parts of a page of this size. `part` is told the column and the row of one, and the pixels under it; those of which nothing
/// counts are as some neighbour.
fn gathered(
    flat: &Flat,
    (size, to): ((usize, usize), (usize, usize)),
    codes: &Codes,
    part: impl Fn((usize, usize), Pixels) -> Part + Sync,
) -> Colour {
    // Whole pixels: pairs, or shared first and last pixels where the sides are no multiples. No dot shows the difference.
    let span = |at: usize, from: usize, to: usize| match from.div_ceil(2) == to {
        _ if from == to => at..at + 1,
        true => 2 * at..(2 * at + 2).min(from),
        false => at * from / to..((at + 1) * from).div_ceil(to),
    };
    let mut rgb = vec![255; to.0 * to.1 * 3];
    let mut drawn = vec![false; to.0 * to.1];
    // Parts of which nothing counts.
    let mut plain = vec![true; to.0 * to.1];
    let rows = rgb.par_chunks_exact_mut(to.0 * 3).zip(drawn.par_chunks_exact_mut(to.0));
    rows.zip(plain.par_chunks_exact_mut(to.0)).enumerate().for_each(|(y, ((rgb, drawn), plain))| {
        let rows = span(y, size.1, to.1);
        if flat.index[rows.start * size.0..rows.end * size.0].iter().fold(0, |most, &dot| most.max(dot))
            == WHITE
        {
            return;
        }
        for (x, out) in rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let all = part((x, y), Pixels::under(rows.clone(), span(x, size.0, to.0), size.0));
            (plain[x], drawn[x]) = (all.plain, all.drawn);
            if all.count > 0 {
                *out = all.light.map(|sum| codes.coded[((sum + all.count / 2) / all.count) as usize]);
            }
        }
    });
    spread(&mut rgb, &mut drawn, &plain, to.0);
    if !drawn.contains(&true) {
        drawn.clear();
    }
    Colour { width: to.0, height: to.1, rgb, drawn, ..Colour::default() }
}

/// Gives plain pixels beside others the colour of one of these: the halftone interpolates between pixels, and a tone must
/// not fade towards an edge because white is beyond it.
fn spread(rgb: &mut [u8], drawn: &mut [bool], plain: &[bool], width: usize) {
    let height = plain.len() / width;
    let busy: Vec<bool> = plain.par_chunks_exact(width).map(|row| row.contains(&false)).collect();
    let beside = |at: usize, sides: usize| at.saturating_sub(1)..(at + 2).min(sides);
    let taken: Vec<(usize, usize)> = (0..height)
        .into_par_iter()
        .filter(|&y| busy[beside(y, height)].contains(&true))
        .flat_map_iter(|y| {
            (0..width).filter_map(move |x| {
                let at = y * width + x;
                let mut near = beside(y, height).flat_map(|v| beside(x, width).map(move |u| v * width + u));
                plain[at].then(|| near.find(|&near| !plain[near])).flatten().map(|from| (at, from))
            })
        })
        .collect();
    for (at, from) in taken {
        rgb.copy_within(3 * from..3 * from + 3, 3 * at);
        drawn[at] = drawn[from];
    }
}

#[cfg(test)]
mod tests {
    use super::super::flat::TONE;
    use super::*;

    #[test]
    fn averages_are_of_light_not_of_numbers() {
        // Of greys: white and black, and what is like them, are not averaged.
        let checks: Vec<[u8; 3]> =
            (0..64 * 64).map(|at| if (at % 64 + at / 64) % 2 == 0 { [235; 3] } else { [20; 3] }).collect();
        let half = Colour::of(&checks, (64, 64), (64, 64)).unwrap();
        assert_eq!((half.width, half.height), (32, 32));
        // sRGB of half the light, .831 and .007.
        assert!(half.rgb.iter().all(|&v| v == 173), "{:?}", &half.rgb[..6]);
        let same = Colour::of(&checks, (64, 64), (128, 128)).unwrap();
        assert_eq!(same.rgb, checks.concat(), "300 dpi stays as it is");
    }

    #[test]
    fn a_tone_does_not_fade_towards_white_letters() {
        let page: Vec<[u8; 3]> =
            (0..40 * 40).map(|at| if (at % 40) % 13 < 5 { [255; 3] } else { [40, 60, 90] }).collect();
        let colour = Colour::of(&page, (40, 40), (40, 40)).unwrap();
        let colour = colour.averages((40, 40), None);
        assert!(
            colour.rgb.as_chunks::<3>().0.iter().all(|pixel| *pixel == [40, 60, 90] || *pixel == [255; 3])
        );
        for (at, pixel) in page.iter().enumerate().filter(|(_, pixel)| **pixel != [255; 3]) {
            let (x, y) = (at % 40 / 2, at / 40 / 2);
            let near = (y.saturating_sub(1)..(y + 2).min(20))
                .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(20)).map(move |u| 20 * v + u));
            for near in near {
                assert_eq!(colour.rgb[3 * near..3 * near + 3], *pixel);
            }
        }
    }

    /// Letters that are fixed to a solid do not darken the tint around them.
    #[test]
    fn a_tone_is_not_mixed_with_letters_that_are_fixed() {
        let (letter, tint) = ([139, 0, 0], [255, 210, 220]);
        let is_letter = |at: usize| (at % 40) % 13 < 5;
        let page: Vec<[u8; 3]> = (0..40 * 40).map(|at| if is_letter(at) { letter } else { tint }).collect();
        let colour = Colour::of(&page, (40, 40), (40, 40)).unwrap();
        let fixed: Vec<u8> = (0..40 * 40).map(|at| if is_letter(at) { 3 } else { TONE }).collect();
        let mixed = colour.averages((40, 40), None);
        assert!(mixed.rgb.as_chunks::<3>().0.iter().any(|pixel| *pixel != letter && *pixel != tint));
        let apart = colour.averages((40, 40), Some(&fixed));
        // What the halftone of a dot of the tint reads: its own pixel and those beside it.
        for at in (0..40 * 40).filter(|&at| !is_letter(at)) {
            let (x, y) = (at % 40 / 2, at / 40 / 2);
            for near in x.saturating_sub(1)..(x + 2).min(20) {
                assert_eq!(apart.rgb[3 * (20 * y + near)..][..3], tint, "at {x}, {y}, read from {near}");
            }
        }
    }

    /// Nor are shadings, wherever letters are; what is flat beside a shading and not fixed counts by itself.
    #[test]
    fn a_shading_is_not_mixed_with_what_is_flat_beside_it() {
        let is_letter = |at: usize| (at % 40) % 13 < 5;
        let fixed: Vec<u8> = (0..40 * 40).map(|at| if is_letter(at) { 3 } else { TONE }).collect();
        for (letter, ground) in [([60, 0, 90], 230), ([230, 235, 240], 60), ([230, 235, 240], 200)] {
            // More greys than a palette holds, so that they are tones.
            let shading = |at: usize| [ground + (at / 40 / 2) as u8; 3].map(|v| v - (at % 40 / 2 % 13) as u8);
            let pixel = |at: usize| {
                let ([r, g, b], tag) = if is_letter(at) {
                    (letter, ObjectType::TEXT)
                } else {
                    (shading(at), ObjectType::PICTURE)
                };
                [tag, r, g, b]
            };
            let page: Vec<[u8; 4]> = (0..40 * 40).map(pixel).collect();
            for side in [40, 97] {
                let colour = Colour::of(&page, (40, 40), (side, side)).unwrap();
                let place = |v: usize| (2 * v + 1) * 40 / (2 * side);
                let at_dot = |at: usize| place(at / side) * 40 + place(at % side);
                let fixed: Vec<u8> = (0..side * side).map(|at| fixed[at_dot(at)]).collect();
                let joined = colour.averages((side, side), Some(&fixed));
                let half = side.div_ceil(2);
                let cell = |at: usize| &joined.rgb[3 * (at / side / 2 * half + at % side / 2)..][..3];
                let beside = (0..side * side).filter(|&at| fixed[at] == TONE);
                for at in beside {
                    let far = cell(at).iter().map(|v| v.abs_diff(ground + 4)).max().unwrap();
                    assert!(far <= 17, "{letter:?} on {ground} at {at} of {side}: {:?}", cell(at));
                }
                // Letters that are screened are of their colour, but for dots of the shading under the same average.
                let joined = colour.averages((side, side), None);
                let whole = (0..side * side).filter(|&at| is_letter(at_dot(at)) && is_letter(at_dot(at) + 1));
                let like = whole
                    .clone()
                    .filter(|&at| joined.rgb[3 * (at / side / 2 * half + at % side / 2)..][..3] == letter);
                assert!(2 * like.count() > whole.count(), "{letter:?} on {ground}, {side}");
            }
        }
    }
}
