//! The colours of thin lines that no pixel has: what pens drew, before a filter reduced it.
//!
//! Problem: on a map of thin lines hardly a pixel has the full colour of its line, so [flat art](super::posters) does not know it.
//! Method: what is thin has ground within [`REACH`] pixels of nearly all of it. A ridge is a pixel as far from its ground in colour as
//! any beside it. On one ground all ridges of a pen lie on one ray in sRGB, as filters mix them, and the longest have the colour of the
//! pen. The most frequent direction is a pen, then that of the ridges which no pen explains, and so on. Shapes with more than a few ridges that no pen
//! explains are pictures.
//! Cost: a few looks at ground for each pixel of what is thin; photographs are given up where the first have none near.
//! Limits: [`MOST`] pens of at least [`LEAST`] ridges. Sketches, whose lines are of any strength, are no pens' work and stay pictures.

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::flat::{similar, split};
use super::main_colours;
use super::softened::OFF;

/// Ground is within so many pixels, as they were drawn, of what is thin.
const REACH: usize = 4;
/// At most this part of what is thin lacks it.
const BARE: f64 = 0.02;
/// One in so many pixels is looked at.
const SAMPLE: usize = 3;
/// Ground that a shape brings with it covers at least this part of it.
const OPEN: f64 = 0.3;
/// A ridge differs from its ground by at least so much, as length in sRGB of 0 to 255.
const FAINT: f32 = 40.0;
/// The cosine of the angle between ridges of one pen, at least.
const ALIGNED: f32 = 0.98;
/// The most pens, and the least ridges of one.
pub(super) const MOST: usize = 12;
const LEAST: usize = 64;
/// At most this part of a pen's ridges is fainter than [`WEAK`] of its colour, and of a shape's ridges has no pen, or [`SPECKS`] of them.
const OTHERS: f64 = 0.05;
const WEAK: f32 = 0.3;
const SPECKS: usize = 2;

/// A picture, and how many times its pixels were enlarged after they were drawn.
#[derive(Clone, Copy)]
pub(super) struct Page<'a, const N: usize> {
    pub pixels: &'a [[u8; N]],
    pub width: usize,
    pub enlarged: usize,
}

/// A pixel on the ridge of a line: the number of its ground, and how it differs from it.
#[derive(Clone, Copy)]
struct Ridge {
    ground: usize,
    differs: [f32; 3],
}

impl Ridge {
    fn length(&self) -> f32 {
        length(self.differs)
    }

    /// Whether a colour that differs so from the ground is seen in this ridge, and by how much of it.
    fn share_of(&self, of: [f32; 3]) -> Option<f32> {
        let along: f32 = self.differs.iter().zip(of).map(|(own, of)| own * of).sum();
        let whole = length(of);
        (along >= ALIGNED * whole * self.length() && along > 0.0).then(|| along / (whole * whole))
    }
}

fn length(of: [f32; 3]) -> f32 {
    of.iter().map(|v| v * v).sum::<f32>().sqrt()
}

/// The colours of pens that drew the ridges of these shapes on these grounds, but for those that are `known`; and of each shape whether nearly
/// all of it is of pens. None is if half of the ridges have no pen.
fn colours(shapes: &[Vec<Ridge>], grounds: &[[u8; 3]], known: &[[u8; 3]]) -> (Vec<[u8; 3]>, Vec<bool>) {
    let differs = |colour: [u8; 3], ground: usize| -> [f32; 3] {
        std::array::from_fn(|c| f32::from(colour[c]) - f32::from(grounds[ground][c]))
    };
    let is_known = |ridge: &Ridge| {
        known.iter().map(|&colour| differs(colour, ridge.ground)).any(|of| {
            ridge.share_of(of).is_some_and(|share| {
                let off: [f32; 3] = std::array::from_fn(|c| ridge.differs[c] - share * of[c]);
                share >= 0.5 && length(off) <= OFF
            })
        })
    };
    let numbered =
        shapes.iter().enumerate().flat_map(|(at, ridges)| ridges.iter().map(move |ridge| (at, ridge)));
    let mut rest: Vec<(usize, &Ridge)> = numbered.filter(|(_, ridge)| !is_known(ridge)).collect();
    let mut strange = vec![0; shapes.len()];
    let mut pens: Vec<[u8; 3]> = Vec::new();
    while pens.len() < MOST && rest.len() >= LEAST {
        // Directions to an eighth.
        let mut directions: HashMap<(usize, [i8; 3]), (usize, [f32; 3])> = HashMap::new();
        for (_, ridge) in &rest {
            let one = ridge.differs.map(|v| v / ridge.length());
            let (count, sum) =
                directions.entry((ridge.ground, one.map(|v| (v * 8.0).round() as i8))).or_default();
            *count += 1;
            (0..3).for_each(|c| sum[c] += one[c]);
        }
        let most = directions.into_iter().max_by_key(|&(key, (count, _))| (count, std::cmp::Reverse(key)));
        let Some(((ground, _), (_, direction))) = most else { break };
        let on_it = |ridge: &Ridge| ridge.ground == ground && ridge.share_of(direction).is_some();
        let mut lengths: Vec<f32> =
            rest.iter().filter(|(_, ridge)| on_it(ridge)).map(|(_, ridge)| ridge.length()).collect();
        if lengths.len() < LEAST {
            break;
        }
        lengths.sort_unstable_by(f32::total_cmp);
        let strongest = &lengths[lengths.len() * 17 / 20..=lengths.len() * 19 / 20];
        let strength = strongest.iter().sum::<f32>() / strongest.len() as f32;
        // Of each shape the ridges on it, and the weak ones.
        let mut of_shape = vec![[0usize; 2]; shapes.len()];
        for (at, ridge) in rest.iter().filter(|(_, ridge)| on_it(ridge)) {
            of_shape[*at][0] += 1;
            of_shape[*at][1] += usize::from(ridge.length() < WEAK * strength);
        }
        let is_weak = |[all, weak]: [usize; 2]| weak as f64 > OTHERS * all as f64;
        if is_weak([lengths.len(), of_shape.iter().map(|[_, weak]| weak).sum()]) {
            // A sketch, or one beside lines in its colour.
            rest.retain(|&(at, ridge)| {
                let sketched = on_it(ridge) && is_weak(of_shape[at]);
                strange[at] += usize::from(sketched);
                !sketched
            });
            continue;
        }
        let whole = length(direction);
        let pen = std::array::from_fn(|c| {
            (f32::from(grounds[ground][c]) + direction[c] / whole * strength).round().clamp(0.0, 255.0) as u8
        });
        rest.retain(|(_, ridge)| !on_it(ridge) && ridge.share_of(differs(pen, ridge.ground)).is_none());
        if !pens.iter().chain(grounds).any(|&other| similar(other, pen)) {
            pens.push(pen);
        }
    }
    rest.iter().for_each(|&(at, _)| strange[at] += 1);
    let (all, most): (usize, usize) = (strange.iter().sum(), shapes.iter().map(Vec::len).sum());
    let of_pens = shapes.iter().zip(strange).map(|(ridges, strange)| {
        2 * all <= most && strange <= ((OTHERS * ridges.len() as f64) as usize).max(SPECKS)
    });
    (pens, of_pens.collect())
}

impl<const N: usize> Page<'_, N> {
    /// Which of these shapes are thin and drawn by pens, by their numbers, and the colours of these pens, but for those that are `known`. Lines are drawn on white, black, large `areas` and on what the shapes bring with them.
    pub(super) fn pens(
        &self,
        shapes: &[Vec<Range<usize>>],
        mut areas: HashMap<[u8; 3], u64>,
        known: &[[u8; 3]],
    ) -> (Vec<usize>, Vec<[u8; 3]>) {
        areas.extend(shapes.par_iter().filter_map(|shape| self.ground(shape)).collect::<Vec<_>>());
        let grounds = main_colours::grounds(&areas);
        let thin: Vec<usize> =
            (0..shapes.len()).into_par_iter().filter(|&at| self.is_thin(&shapes[at], &grounds)).collect();
        let ridges: Vec<Vec<Ridge>> = thin.par_iter().map(|&at| self.ridges(&shapes[at], &grounds)).collect();
        let (pens, of_pens) = colours(&ridges, &grounds, known);
        (thin.into_iter().zip(of_pens).filter(|&(_, of_pens)| of_pens).map(|(at, _)| at).collect(), pens)
    }

    /// The colour of at least [`OPEN`] of a shape, and its pixels: what lines are drawn on, if it is neither white nor black.
    fn ground(&self, shape: &[Range<usize>]) -> Option<([u8; 3], u64)> {
        let mut counts: HashMap<[u8; 3], u64> = HashMap::new();
        let mut total = 0;
        for stretch in shape {
            total += stretch.len() as u64;
            for run in self.pixels[stretch.clone()]
                .chunk_by(|a, b| a == b)
                .filter(|run| run.len() > 2 * self.enlarged)
            {
                *counts.entry(split(&run[0]).1).or_default() += run.len() as u64;
            }
        }
        let most = counts.into_iter().max_by_key(|&(colour, dots)| (dots, colour))?;
        (most.1 as f64 >= OPEN * total as f64).then_some(most)
    }

    /// Whether ground is near nearly all of a shape.
    fn is_thin(&self, shape: &[Range<usize>], grounds: &[[u8; 3]]) -> bool {
        let total: usize = shape.iter().map(Range::len).sum();
        let (mut bare, most) = (0, (BARE * total as f64) as usize / SAMPLE);
        shape.iter().cloned().flatten().step_by(SAMPLE).all(|at| {
            bare += usize::from(self.ground_of(at, grounds).is_none());
            bare <= most
        })
    }

    /// The number of the ground nearest to a pixel, in eight directions.
    fn ground_of(&self, at: usize, grounds: &[[u8; 3]]) -> Option<usize> {
        let is_ground =
            |at: usize| grounds.iter().position(|&ground| similar(ground, split(&self.pixels[at]).1));
        is_ground(at).or_else(|| (1..=REACH).find_map(|far| self.around(at, far).find_map(is_ground)))
    }

    /// The pixels so far from another, as they were drawn, in eight directions.
    fn around(&self, at: usize, far: usize) -> impl Iterator<Item = usize> {
        const DIRECTIONS: [(isize, isize); 8] =
            [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
        let (x, y, step) = (at % self.width, at / self.width, (far * self.enlarged) as isize);
        let (width, height) = (self.width, self.pixels.len() / self.width);
        DIRECTIONS.into_iter().filter_map(move |(dx, dy)| {
            let (x, y) = (x.checked_add_signed(dx * step)?, y.checked_add_signed(dy * step)?);
            (x < width && y < height).then_some(y * width + x)
        })
    }

    fn ridges(&self, shape: &[Range<usize>], grounds: &[[u8; 3]]) -> Vec<Ridge> {
        // One of the pixels that were one when they were drawn.
        let is_first = |v: usize| v.is_multiple_of(self.enlarged);
        let drawn = shape.iter().cloned().flatten();
        let drawn = drawn.filter(|at| is_first(at % self.width) && is_first(at / self.width));
        let ridge = |at: usize| {
            let own = split(&self.pixels[at]).1;
            if grounds.iter().any(|&ground| similar(ground, own)) {
                return None;
            }
            let ground = self.ground_of(at, grounds)?;
            let differs = |at: usize| -> [f32; 3] {
                let pixel = split(&self.pixels[at]).1;
                std::array::from_fn(|c| f32::from(pixel[c]) - f32::from(grounds[ground][c]))
            };
            let own = Ridge { ground, differs: differs(at) };
            let is_highest = || self.around(at, 1).all(|beside| length(differs(beside)) <= own.length());
            (own.length() >= FAINT && is_highest()).then_some(own)
        };
        drawn.filter_map(ridge).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::masks::Masks;
    use super::*;

    const SIDE: usize = 192;
    const PENS: [[u8; 3]; 3] = [[30, 110, 190], [190, 60, 40], [40, 140, 70]];

    /// How much of a row (or column) of pixels a line covers that begins at a place and is so wide.
    fn share(at: usize, (from, wide): (f64, f64)) -> f64 {
        ((from + wide).min(at as f64 + 1.0) - from.max(at as f64)).clamp(0.0, 1.0)
    }

    /// A net of lines on a ground, in rows 16 pixels apart and columns 24 apart, each at another part of a pixel and 0.7 to 2 pixels wide. Of each
    /// pixel its colour, the pen that covers most of it, and by how much; columns are drawn over rows. `strength` is that of each line.
    fn net(ground: [u8; 3], strength: impl Fn(usize) -> f64) -> Vec<([u8; 3], usize, f64)> {
        let line = |number: usize, pitch: usize| {
            let phase = (number * 5 % 8) as f64 / 8.0;
            ((number * pitch) as f64 + 6.0 + phase, 0.7 + (number % 5) as f64 * 0.325)
        };
        let pixel = |at: usize| {
            let (x, y) = (at % SIDE, at / SIDE);
            let (row, column) = (y / 16, x / 24);
            let over = share(x, line(column, 24)) * strength(column + 3);
            let under = share(y, line(row, 16)) * strength(row);
            let (pen_over, pen_under) = (column % 3, (row + 1) % 3);
            let colour = std::array::from_fn(|c| {
                let mixed = f64::from(ground[c]) * (1.0 - under) + f64::from(PENS[pen_under][c]) * under;
                (mixed * (1.0 - over) + f64::from(PENS[pen_over][c]) * over).round() as u8
            });
            let under = under * (1.0 - over);
            if over >= under { (colour, pen_over, over) } else { (colour, pen_under, under) }
        };
        (0..SIDE * SIDE).map(pixel).collect()
    }

    #[test]
    fn a_net_of_thin_lines_is_cut_where_each_line_covers_most() {
        for ground in [[255; 3], [250, 244, 226], [214, 234, 204]] {
            let net = net(ground, |_| 1.0);
            let pixels: Vec<[u8; 3]> = net.iter().map(|&(colour, ..)| colour).collect();
            let masks = Masks::of(&pixels, SIDE);
            let mut found = vec![ground; pixels.len()];
            for (span, colour) in masks.stretches() {
                found[span].fill(colour);
            }
            let (mut lines, mut wrong) = (0, 0);
            for (at, &(_, pen, covered)) in
                net.iter().enumerate().filter(|(_, (.., covered))| (covered - 0.5).abs() > 0.1)
            {
                let wanted = if covered > 0.5 { PENS[pen] } else { ground };
                // A line of less than a pixel keeps its ridge, though less than half of it may be covered.
                let is_ridge = covered < 0.5 && found[at] != ground && covered > 0.2;
                lines += usize::from(covered > 0.5);
                wrong += usize::from(!similar(found[at], wanted) && !is_ridge);
            }
            assert!(100 * wrong <= lines && lines > 4000, "{wrong} wrong of {lines} on {ground:?}");
        }
    }

    /// A sketch beside it is a picture as by itself.
    #[test]
    fn a_net_of_thin_lines_beside_a_sketch_is_cut_as_by_itself() {
        let (drawn, sketch) =
            (net([255; 3], |_| 1.0), net([255; 3], |line| 0.15 + 0.17 * (line * 7 % 6) as f64));
        let blank = vec![[255; 3]; SIDE * 4];
        let pixels: Vec<[u8; 3]> = [&drawn, &sketch]
            .map(|net| net.iter().map(|&(colour, ..)| colour).collect::<Vec<_>>())
            .join(&blank[..]);
        let alone = Masks::of(&pixels[..SIDE * SIDE], SIDE);
        let both = Masks::of(&pixels, SIDE);
        let size = |masks: &Masks, from: usize, to: usize| -> usize {
            masks
                .stretches()
                .filter(|(span, _)| (from..to).contains(&span.start))
                .map(|(span, _)| span.len())
                .sum()
        };
        let (all, net) = (SIDE * SIDE + blank.len(), SIDE * SIDE);
        assert!(size(&alone, 0, net) > net / 10);
        assert_eq!(size(&both, 0, net), size(&alone, 0, net));
        assert!(10 * size(&both, all, pixels.len()) < net / 2);
    }

    /// Green lines on white, and a little grey that lies almost in their direction.
    #[test]
    fn a_colour_that_others_have_explains_only_what_lies_on_its_line() {
        let (green, grey) = ([62, 122, 56], [51; 3]);
        let ridge = |colour: [u8; 3], share: f32| Ridge {
            ground: 0,
            differs: std::array::from_fn(|c| share * (f32::from(colour[c]) - 255.0)),
        };
        let of =
            |colour: [u8; 3]| (0..200).map(|at| ridge(colour, 0.9 + at as f32 / 2000.0)).collect::<Vec<_>>();
        let (pens, of_pens) = colours(&[of(green), of(grey)], &[[255; 3]], &[grey]);
        assert!(pens.len() == 1 && similar(pens[0], green), "{pens:?}");
        assert_eq!(of_pens, [true, true]);
    }

    #[test]
    fn lines_of_any_strength_are_no_pens_work() {
        let net = net([255; 3], |line| 0.15 + 0.17 * (line * 7 % 6) as f64);
        let pixels: Vec<[u8; 3]> = net.iter().map(|&(colour, ..)| colour).collect();
        let masks = Masks::of(&pixels, SIDE);
        let found: usize = masks.stretches().map(|(span, _)| span.len()).sum();
        let drawn = pixels.iter().filter(|pixel| **pixel != [255; 3]).count();
        assert!(10 * found < drawn, "{found} of {drawn}");
    }

    #[test]
    fn a_photograph_is_not_thin() {
        let wave = |at: usize, c: usize| {
            let (x, y) = ((at % SIDE) as f64, (at / SIDE) as f64);
            (130.0 + 60.0 * (x / 9.0 + c as f64).sin() + 50.0 * (y / (11.0 + c as f64)).cos()) as u8
        };
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE).map(|at| std::array::from_fn(|c| wave(at, c))).collect();
        let page = Page { pixels: &pixels, width: SIDE, enlarged: 1 };
        let rows: Vec<Range<usize>> = (0..SIDE).map(|y| y * SIDE..(y + 1) * SIDE).collect();
        assert!(!page.is_thin(&rows, &[[255; 3], [0; 3]]));
        assert_eq!(page.ground(&rows), None);
    }
}
