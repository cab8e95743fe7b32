//! Letters and lines in colours that no stack prints: which of their dots are fixed, and to what.
//!
//! Problem: a halftone of clusters is coarser than a letter's strokes, so a screened letter loses its outline.
//! Method: by colour, kind and width of their [shapes](super::shapes). A shape is thin if no square of [`STROKE`] dots a side ([`LETTER`]
//! for text, and for what is as small as a letter and about like a stack) fits in it, and if it is no [piece](super::pieces) that a line cut off of a fill. Thin
//! shapes that have more ink than paper are printed in the nearest solid, and so are the [lines](super::lines) that hang on wide ones. Wide
//! ones keep their rim in that solid [where they need it](super::beside) and are screened inside; so do thin shapes with more paper than ink, which a solid
//! would make too dark. Of pale lines of [`HAIR`] dots or less only the middle is printed, one dot wide: screened they were dashes, and the palest had no
//! dot. Pale lines that lie on several colours are decided dot by dot by both sides of them. Soft edges, which lie between colours, and wide pale shapes are
//! screened as they are: their edge is exact, because the halftone does not cross it.
//! What a shape lies on ([`grounds`](super::grounds)) counts, too. One that lies on its own solid, by half of its border or more, would vanish in it. Such a
//! thin shape is printed in the next solid or in paper; such a wide one has its rim in the next solid or none. A thin shape with more paper than ink that lies
//! on ink, by nearly all of its border, is printed in paper: a rim of ink would be drawn within white letters, and screened they are ragged.
//! A drawing that is a step between a lighter and a darker colour is part of a shading, and screened; small drawings with the strokes of larger ones in their
//! colour are no letters.
//! A letter that is filled with a shading is screened; in strokes narrower than a thin line it has one colour, that nearest to its mean.
//! Letters of a word are all thin or all wide ([`words`](super::words)), also where they were drawn as outlines. What of the ground lies
//! inside letters is as wide as the ground ([`counters`](super::counters)).
//! Cost: 5 ns a dot of such shapes, 0.3 ns of others. Memory: 44 bytes a run of a row, 20 bytes a run where solids may meet. Limits:
//! widths of letters are measured with squares, so a slanting stroke of one counts as thinner than it is.

use std::collections::HashMap;

use rayon::prelude::*;

use super::beside::{PaleLines, at_the_rim, is_ridge, needs_rim};
use super::counters::counters;
use super::flat::{Flat, SIMILAR, TONE};
use super::grounds::{Grounds, Lies, PAPER, lies, steps};
use super::kinds::ObjectType;
use super::lines::{lines, slanting};
use super::looks::Looks;
use super::pieces::pieces;
use super::shapes::{Run, shapes};
use super::treatments::{Shape, Treatment};
use super::words::{Words, near};

/// A thin line is narrower than this many dots: about three clusters of eight dots.
const STROKE: u8 = 9;
/// A pale line at most so many dots wide has less than a cluster in each of its dots along it.
const HAIR: u8 = 4;
/// The strokes of thin letters are narrower than this many dots, 1 mm: those of bold text of 14 points are up to 22 wide.
pub(super) const LETTER: u8 = 24;

/// The strokes of a letter that was made an outline are at most one in so many of its width or height, and so many of them are a word.
const SLENDER: u32 = 3;
const WORD: usize = 3;

/// A drawing at most so many dots wide and high, 5 mm, is as small as a letter: text that was made outlines, a module of a QR code.
const SMALL: u32 = 118;

/// For each dot the stack it is fixed to, or [`TONE`]. `treatments` has one for each colour, and `looks` tells what is seen on what.
pub(super) fn fixed(flat: &Flat, width: usize, treatments: &[Treatment], looks: &Looks<'_>) -> Vec<u8> {
    let of = |colour: u8| treatments.get(usize::from(colour)).copied();
    let stack: [u8; 256] = std::array::from_fn(|colour| match of(colour as u8) {
        Some(Treatment::Solid(stack)) => stack,
        _ => TONE,
    });
    let shaped: [bool; 256] =
        std::array::from_fn(|colour| matches!(of(colour as u8), Some(Treatment::Shape { .. })));
    let mut fixed = vec![TONE; flat.index.len()];
    fixed.par_chunks_mut(width).zip(flat.index.par_chunks(width)).for_each(|(fixed, row)| {
        fixed.iter_mut().zip(row).for_each(|(fixed, &colour)| *fixed = stack[usize::from(colour)]);
    });
    if !shaped.contains(&true) {
        return fixed;
    }
    let shapes = shapes(flat, width, (&shaped, STROKE));
    let (runs, rows) = (&shapes.runs, &shapes.rows);
    let grounds = Grounds::of(flat, width, (treatments, looks), (runs, rows));
    let (small, slender) = letters(flat, (runs, rows));
    // A small drawing in a colour unlike all stacks would be a blot of another colour.
    let is_like = |run: &Run| match of(run.colour) {
        Some(Treatment::Shape(shape)) => shape.near || !shape.dark || is_text(flat, run),
        _ => true,
    };
    let drawn_larger = drawn_larger(flat, runs, &small);
    let is_letter: Vec<bool> =
        (runs.iter().zip(&small)).map(|(run, &small)| small && is_like(run) && !drawn_larger(run)).collect();
    // At 45 degrees a square is narrower than the stroke it fits in by the root of two.
    let may_slant =
        |root: u32| !is_letter[root as usize] && (2 * STROKE / 3..STROKE).contains(&runs[root as usize].side);
    let slanting = slanting((runs, rows), (flat, width), STROKE, may_slant);
    let is_thin = |root: u32| {
        let limit = if is_letter[root as usize] { LETTER } else { STROKE };
        runs[root as usize].side < limit && !slanting.contains(&root)
    };
    let is_counter = counters(flat, (runs, rows), u32::from(2 * LETTER), is_thin);
    let takes_part = |root: u32| is_letter[root as usize] && !is_counter[root as usize];
    let words = Words::of(flat, (runs, rows), (near(LETTER), LETTER), takes_part);
    // Text that was made outlines, in a colour unlike all stacks: a row of slender shapes.
    let takes_part = |root: u32| {
        let at = root as usize;
        slender[at] && !is_letter[at] && !is_counter[at]
    };
    let outlined = Words::of(flat, (runs, rows), (HAIR..2 * LETTER, LETTER), takes_part);
    let of_word = |root: u32| words.thin(root).or_else(|| outlined.thin_in_a_word_of(WORD, root));
    let is_of_word = |root: u32| {
        let found = [&words, &outlined].map(|words| words.thin_in_a_word_of(WORD, root));
        slender[root as usize] && found.iter().any(Option::is_some)
    };
    let is_thin = |root: u32| !is_counter[root as usize] && of_word(root).unwrap_or_else(|| is_thin(root));
    let is_narrow = |run: &Run| !is_text(flat, run) && is_thin(run.root);
    let is_bare = |colour: u8| matches!(of(colour), None | Some(Treatment::Solid(PAPER)));
    let is_dark = |run: &Run| matches!(of(run.colour), Some(Treatment::Shape(shape)) if shape.dark);
    let may_be_step = |run: &Run| is_dark(run) && !is_text(flat, run) && runs[run.root as usize].side > HAIR;
    let steps = steps(flat, width, (runs, rows), may_be_step);
    let mut is_piece = vec![false; runs.len()];
    for root in pieces(flat, width, (runs, rows), is_narrow, is_bare) {
        is_piece[root as usize] = true;
    }
    let is_thin = |root: u32| !is_piece[root as usize] && is_thin(root);
    let is_pale = |colour: u8| matches!(of(colour), Some(Treatment::Shape(shape)) if !shape.dark);
    let takes_part = |run: &Run| is_pale(run.colour) && is_thin(run.root);
    let lies = lies(flat, width, treatments, (runs, rows), takes_part);
    // What is only the rim of a pale shape does not stand for it.
    let solid = |root: u32, shape: &Shape, stands: bool| {
        if lies.get(&root) == Some(&Lies::OnInk) {
            // A pale disc as small as a letter is no letter.
            let run = &runs[root as usize];
            let is_fine = shape.bare || run.side < STROKE || is_text(flat, run) || is_of_word(root);
            return is_fine.then_some(PAPER);
        }
        grounds.as_ref().map_or(Some(shape.solids[0]), |grounds| grounds.solid(root, shape, stands))
    };
    let shaded = shaded_letters(flat, runs, of);
    let pale = PaleLines { flat, width, treatments };
    fixed.par_chunks_mut(width).enumerate().for_each(|(y, fixed)| {
        for run in &runs[rows[y]..rows[y + 1]] {
            let root = run.root;
            let colour = match shaded.get(&root) {
                Some(_) if runs[root as usize].side >= STROKE => continue,
                Some(&mean) => mean,
                None => run.colour,
            };
            let Some(Treatment::Shape(shape)) = of(colour).filter(|_| !steps.contains(&root)) else {
                continue;
            };
            let (thin, first, is_small) = (is_thin(root), shape.solids[0], small[root as usize]);
            let (start, end) = (run.start as usize, run.end as usize);
            match solid(root, &shape, thin && shape.dark) {
                Some(solid) if thin && (shape.dark || solid != first) => fixed[start..end].fill(solid),
                Some(solid) if solid > PAPER && (shape.dark || thin) => {
                    let side = runs[root as usize].side;
                    let is_hairline = !shape.dark && side <= HAIR && !is_letter[root as usize];
                    let (kind, _) = flat.colours[usize::from(run.colour)];
                    if !shape.dark && kind != ObjectType::Text && lies.get(&root) != Some(&Lies::OnOneColour)
                    {
                        if side < STROKE {
                            for (x, dot) in (start..).zip(&mut fixed[start..end]) {
                                let ink = pale.has_ink((x, y), side, HAIR);
                                *dot = ink.map_or(*dot, |ink| if ink { solid } else { PAPER });
                            }
                        }
                        continue;
                    }
                    for (x, dot) in (start..).zip(&mut fixed[start..end]) {
                        if is_hairline {
                            *dot = if is_ridge(flat, width, (x, y), HAIR) { solid } else { PAPER };
                        } else if at_the_rim(flat, width, (x, y), |beside| {
                            is_small || needs_rim(&shape, of(beside))
                        }) {
                            *dot = solid;
                        }
                    }
                }
                _ => {}
            }
        }
    });
    let is_wide = |root: u32| {
        !is_letter[root as usize] && !is_piece[root as usize] && !steps.contains(&root) && !is_thin(root)
    };
    for line in lines(&shapes, (flat, width), STROKE, is_wide, is_bare) {
        let run = &runs[line.run as usize];
        let Some(Treatment::Shape(shape)) = of(run.colour) else { continue };
        if let Some(solid) =
            solid(run.root, &shape, true).filter(|&solid| shape.dark || solid != shape.solids[0])
        {
            let row = line.row as usize * width;
            fixed[row + line.start as usize..row + line.end as usize].fill(solid);
        }
    }
    fixed
}

/// The letters, by their roots, that are filled with a shading: their colours differ by more than three steps of one, and are not all dark, or all
/// pale, with one solid for all. Of each the colour that is nearest to their mean.
fn shaded_letters(flat: &Flat, runs: &[Run], of: impl Fn(u8) -> Option<Treatment>) -> HashMap<u32, u8> {
    let printed = |colour: u8| match of(colour) {
        Some(Treatment::Solid(stack)) => Some((stack, true)),
        Some(Treatment::Shape(shape)) => Some((shape.solids[0], shape.dark)),
        None => None,
    };
    let colour = |run: &Run| flat.colours[usize::from(run.colour)].1;
    let several =
        runs.iter().filter(|run| run.colour != runs[run.root as usize].colour && is_text(flat, run));
    let mut letters: HashMap<u32, Shades> = several.map(|run| (run.root, Shades::default())).collect();
    if letters.is_empty() {
        return HashMap::new();
    }
    for run in runs {
        if let Some(shades) = letters.get_mut(&run.root) {
            shades.add(colour(run), u64::from(run.end - run.start));
            shades.in_several |= printed(run.colour) != printed(runs[run.root as usize].colour);
        }
    }
    letters.retain(|_, shades| shades.are_a_shading());
    let mut nearest: HashMap<u32, (u64, u8)> = HashMap::new();
    for run in runs {
        let Some(shades) = letters.get(&run.root) else { continue };
        let off = (shades.off(colour(run)), run.colour);
        nearest.entry(run.root).and_modify(|least| *least = off.min(*least)).or_insert(off);
    }
    nearest.into_iter().map(|(root, (_, colour))| (root, colour)).collect()
}

/// The colours of a shape.
struct Shades {
    least: [u8; 3],
    most: [u8; 3],
    sum: [u64; 3],
    dots: u64,
    /// Whether not all of them are printed alike.
    in_several: bool,
}

impl Default for Shades {
    fn default() -> Shades {
        Shades { least: [u8::MAX; 3], most: [0; 3], sum: [0; 3], dots: 0, in_several: false }
    }
}

impl Shades {
    fn add(&mut self, colour: [u8; 3], dots: u64) {
        self.dots += dots;
        for (c, value) in colour.into_iter().enumerate() {
            (self.least[c], self.most[c]) = (self.least[c].min(value), self.most[c].max(value));
            self.sum[c] += dots * u64::from(value);
        }
    }

    fn are_a_shading(&self) -> bool {
        self.in_several && (0..3).any(|c| self.most[c] - self.least[c] > 3 * SIMILAR)
    }

    /// How far a colour is from the mean.
    fn off(&self, colour: [u8; 3]) -> u64 {
        (0..3).map(|c| (self.sum[c] / self.dots.max(1)).abs_diff(colour[c].into())).sum()
    }
}

/// Whether a small drawing has the strokes of larger ones in its colour, which are screened: of stripes of a flag, the shorter are no letters.
fn drawn_larger<'a>(flat: &'a Flat, runs: &[Run], small: &[bool]) -> impl Fn(&Run) -> bool + use<'a> {
    // Dots in each colour and width of strokes, of small drawings and of others.
    let mut dots = vec![[[0u64; 2]; LETTER as usize]; flat.colours.len()];
    for run in runs {
        if let Some([small_dots, others]) =
            dots[usize::from(run.colour)].get_mut(usize::from(runs[run.root as usize].side))
        {
            let own = if small[run.root as usize] { small_dots } else { others };
            *own += u64::from(run.end - run.start);
        }
    }
    let sides: Vec<u8> = runs.iter().map(|run| runs[run.root as usize].side).collect();
    move |run| {
        let side = usize::from(sides[run.root as usize]);
        if is_text(flat, run) || !(usize::from(STROKE)..usize::from(LETTER)).contains(&side) {
            return false;
        }
        let like = dots[usize::from(run.colour)].iter().take(side + side / 4 + 1).skip(side - side / 5);
        let [small, others] = like.fold([0, 0], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
        others > small
    }
}

fn is_text(flat: &Flat, run: &Run) -> bool {
    flat.colours[usize::from(run.colour)].0 == ObjectType::Text
}

/// For each run that is the root of a shape, whether the shape is text or as small as a letter, and whether it is a drawing as small and as slender.
fn letters(flat: &Flat, (runs, rows): (&[Run], &[usize])) -> (Vec<bool>, Vec<bool>) {
    let mut bounds = vec![[u32::MAX, 0, u32::MAX, 0]; runs.len()];
    for (y, row) in (0u32..).zip(rows.windows(2)) {
        for run in &runs[row[0]..row[1]] {
            let [left, right, top, bottom] = &mut bounds[run.root as usize];
            (*left, *right) = ((*left).min(run.start), (*right).max(run.end));
            (*top, *bottom) = ((*top).min(y), y + 1);
        }
    }
    let judged = runs.iter().zip(bounds).map(|(run, [left, right, top, bottom])| {
        let (across, down) = (right - left.min(right), bottom - top.min(bottom));
        let is_small = across.max(down) <= SMALL;
        let text = is_text(flat, run);
        (text || is_small, !text && is_small && SLENDER * u32::from(run.side) <= across.max(down))
    });
    judged.unzip()
}

#[cfg(test)]
mod tests;
