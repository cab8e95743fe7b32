//! The main colours of flat art, and whether they are the steps of a shading.
//!
//! Problem: art in a few colours has hundreds, since its edges are softened; and a shading may have few.
//! Method: main colours cover most of the art in stretches of two pixels or more. Of colours that are alike one counts, unless they do not follow
//! each other: a colour of a shading touches its like by half of its border. Colours of which most lie on one line, and touch in that order, are a
//! shading in few colours, and no flat art.
//! Cost: 2 ns a pixel, and as much again where colours are nearly alike. Limits: [`MOST`] colours, besides white and black and those of edges.

use std::collections::{HashMap, HashSet};
use std::ops::{Deref, Range};

use super::flat::{similar, split};
use super::softened::{Widths, along, thin_colours};
use sheet::forest::beside;

/// The most main colours, and the most colours that small shapes have in common.
pub(super) const MOST: usize = 16;
/// Colours in stretches of two pixels or more; photographs have more.
const MOST_FOUND: usize = 4096;
/// The least pixels of a main colour: a square of eight.
pub(super) const LEAST: u64 = 64;
/// Main colours cover at least this part of the art: thin letters are mostly softened edge.
const COVERED: f64 = 0.3;
/// A shading in few colours has at least so many, white and black among them.
const STEPS: usize = 8;
/// What is nearly white or black differs from it by more than this in red, green or blue if anybody is to see it.
const UNSEEN: u8 = 3;
/// The first two main colours.
pub(super) const WHITE_AND_BLACK: [[u8; 3]; 2] = [[255; 3], [0; 3]];

/// The square of the distance between two colours in sRGB.
pub(super) fn apart(a: [u8; 3], b: [u8; 3]) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c])).pow(2)).sum()
}

/// The colours that small shapes have in common, and those of large `areas`, half as many at most: [`MOST`] that are not alike. Of both
/// the counts of pixels.
pub(super) fn common(counts: HashMap<[u8; 3], u64>, areas: &HashMap<[u8; 3], u64>) -> Vec<[u8; 3]> {
    let mut colours: Vec<[u8; 3]> = Vec::new();
    for (counts, most) in [(areas, MOST / 2), (&counts, MOST)] {
        let mut found: Vec<([u8; 3], u64)> = counts
            .iter()
            .map(|(&colour, &dots)| (colour, dots))
            .filter(|(colour, dots)| *dots >= LEAST && !WHITE_AND_BLACK.contains(colour))
            .collect();
        found.sort_unstable_by_key(|&(colour, dots)| (std::cmp::Reverse(dots), colour));
        for (colour, _) in found {
            if colours.len() < most && !colours.iter().any(|&known| similar(known, colour)) {
                colours.push(colour);
            }
        }
    }
    colours
}

/// What thin lines are drawn on: white, black, and colours of large `areas` that are not alike.
pub(super) fn grounds(areas: &HashMap<[u8; 3], u64>) -> Vec<[u8; 3]> {
    [&WHITE_AND_BLACK[..], &common(HashMap::new(), areas)].concat()
}

/// The main colours, white and black first.
pub(super) fn main_colours<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    stretches: &[Range<usize>],
    (total, enlarged): (u64, usize),
    widths: &impl Deref<Target = Widths>,
) -> Option<Vec<[u8; 3]>> {
    let mut found: HashMap<[u8; 3], u64> = HashMap::new();
    let over = width * enlarged;
    for stretch in stretches {
        let mut at = stretch.start;
        for run in pixels[stretch.clone()].chunk_by(|a, b| a == b) {
            let (start, length) = (at, run.len());
            at += length;
            // Upright lines are stretches, too.
            let beside = [start.checked_sub(over), Some(start + over)].into_iter().flatten();
            if length > enlarged
                || beside.filter_map(|beside| pixels.get(beside)).any(|pixel| *pixel == run[0])
            {
                *found.entry(split(&run[0]).1).or_default() += length as u64;
            }
        }
        if found.len() > MOST_FOUND {
            return None;
        }
    }
    let mut found: Vec<([u8; 3], u64)> = found.into_iter().filter(|&(_, dots)| dots >= LEAST).collect();
    found.sort_unstable_by_key(|&(colour, dots)| (std::cmp::Reverse(dots), colour));
    let (mut colours, mut covered) = (WHITE_AND_BLACK.to_vec(), 0);
    // White and black may be beside the art without being of it. Nearly white and nearly black are main colours in their place, or beside them where
    // the art touches them: the edge of a disc in pale grey with a rim is softened to white.
    let mut own = [false; 2];
    let mut shading = None;
    for &(colour, dots) in &found {
        match colours.iter().position(|&known| similar(known, colour)) {
            None => colours.push(colour),
            Some(at) if own.get(at) == Some(&false) => {
                own[at] = true;
                let is_seen = (0..3).any(|c| colours[at][c].abs_diff(colour[c]) > UNSEEN);
                if is_seen && touches(pixels, width, stretches, colours[at]) {
                    colours.push(colour);
                } else {
                    colours[at] = colour;
                }
            }
            Some(_) => {
                if shading
                    .get_or_insert_with(|| shades(pixels, width, stretches, &found, widths))
                    .contains(&colour)
                {
                    continue;
                }
                colours.push(colour);
            }
        }
        covered += dots;
    }
    if colours.len() > MOST + 2 {
        // Edges are not counted as colours; the most frequent of them are enough to know strokes by.
        let mut thin = thin_colours(&colours, widths).into_iter();
        let mut edges = 0;
        colours.retain(|_| {
            let is_edge = thin.next() == Some(true);
            edges += usize::from(is_edge);
            !is_edge || edges <= MOST
        });
        if colours.len() - edges.min(MOST) > MOST + 2 {
            return None;
        }
    }
    (covered as f64 >= COVERED * total as f64 && !is_shaded(pixels, stretches, &colours)).then_some(colours)
}

/// Whether pixels of a colour lie beside the art.
fn touches<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    stretches: &[Range<usize>],
    colour: [u8; 3],
) -> bool {
    let beside = stretches.iter().flat_map(|stretch| beside(stretch.clone(), width));
    let like = beside.filter_map(|at| pixels.get(at)).filter(|pixel| split(pixel).1 == colour);
    like.take(LEAST as usize).count() == LEAST as usize
}

/// Whether most of these colours are the steps of one shading: those between the two that are farthest apart are many, and one in three that touch
/// follow each other. In softened text in 16 greys it is one in seven.
fn is_shaded<const N: usize>(pixels: &[[u8; N]], stretches: &[Range<usize>], colours: &[[u8; 3]]) -> bool {
    let pairs =
        colours.iter().enumerate().flat_map(|(at, &a)| colours[at + 1..].iter().map(move |&b| (a, b)));
    let Some((from, to)) = pairs.max_by_key(|&(a, b)| apart(a, b)) else { return false };
    let mut steps: Vec<(f32, [u8; 3])> = colours
        .iter()
        .filter_map(|&colour| along(colour, from, to).map(|(share, _)| (share, colour)))
        .collect();
    if steps.len() < STEPS || 2 * steps.len() < colours.len() {
        return false;
    }
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: HashMap<[u8; 3], usize> = steps.iter().enumerate().map(|(at, step)| (step.1, at)).collect();
    let (mut touch, mut follow) = (0, 0);
    for stretch in stretches {
        for pair in pixels[stretch.clone()].windows(2).filter(|pair| pair[0] != pair[1]) {
            let [a, b] = [0, 1].map(|at| places.get(&split(&pair[at]).1));
            if let (Some(a), Some(b)) = (a, b) {
                (touch, follow) = (touch + 1, follow + u64::from(a.abs_diff(*b) == 1));
            }
        }
    }
    touch >= LEAST && 3 * follow > touch
}

/// Of these colours, those of a shading: by half of their border or more they touch pixels that are like them, which are as wide where
/// they are: what a filter that sharpens leaves along edges is not.
fn shades<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    stretches: &[Range<usize>],
    found: &[([u8; 3], u64)],
    widths: &Widths,
) -> HashSet<[u8; 3]> {
    let mut borders: HashMap<[u8; 3], [u64; 2]> = found.iter().map(|&(colour, _)| (colour, [0; 2])).collect();
    for stretch in stretches {
        let mut at = stretch.start;
        for run in pixels[stretch.clone()].chunk_by(|a, b| a == b) {
            let all = at..at + run.len();
            at = all.end;
            let own = split(&run[0]).1;
            let Some([border, like]) = borders.get_mut(&own) else { continue };
            let is_thin = widths.is_thin(own);
            for beside in beside(all, width).filter_map(|at| pixels.get(at)) {
                let other = split(beside).1;
                *border += u64::from(other != own);
                let is_like = other != own && similar(other, own) && (is_thin || !widths.is_thin(other));
                *like += u64::from(is_like);
            }
        }
    }
    borders.into_iter().filter(|&(_, [border, like])| 2 * like >= border).map(|(colour, _)| colour).collect()
}
