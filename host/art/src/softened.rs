//! Softened edges: which colour of flat art a pixel belongs to that lies between two of them.
//!
//! Problem: programs soften what they draw, so that a pixel half covered by a letter has half of its colour. Such a colour may be as
//! frequent as any other: along a straight edge, or where a stem covers half of two pixels each and is a pale line. Filters that sharpen
//! draw edges beyond both colours, and ripples beside them.
//! Method: a pixel belongs to the nearer one of two colours if both lie within [`REACH`] pixels of it and its colour lies on the line
//! between them, or a little beyond; of a line that covers less than half of any pixel, the ridge is kept. A main colour that lies so of two
//! others, or is like a more frequent one, and is nowhere three pixels wide is *thin*: its pixels are edges, too, where both others are near.
//! Where they are not, its [`strokes`](super::strokes) are decided as wholes.
//! Cost: 200 ns a softened pixel.
//! Limits: a line one pixel wide between two areas, in a colour between theirs, is taken for their edge.

use std::cell::LazyCell;
use std::collections::HashMap;
use std::ops::{Deref, Range};

use super::flat::{similar, split};
use super::main_colours::WHITE_AND_BLACK;
use super::posters::MOST_KNOWN;

/// How far a softened edge reaches, in pixels as they were drawn.
const REACH: usize = 2;
/// How far from the line between two colours a softened edge may lie, in sRGB of 0 to 255.
pub(super) const OFF: f32 = 24.0;
/// How far beyond the colours a softened edge may lie: filters that sharpen draw edges stronger than they are. Twice as far where two
/// edges add up.
const BEYOND: f32 = 0.15;
/// Edges lie between colours that differ by at least this much in red, green or blue.
const CONTRAST: u8 = 64;
/// A colour is thin if at most one in so many of its pixels ends a square of three.
const THIN: u64 = 100;
/// How far from edges such filters leave ripples, which differ as little from the colour beside the edge.
const RIPPLES: usize = 8;
/// The least part of a pixel that a line covers.
const FAINTEST: f32 = 0.25;
/// Along a line, neighbouring pixels are covered by nearly as much.
const ALIKE: f32 = 0.2;

/// Flat art whose edges are looked at.
#[derive(Clone, Copy)]
pub(super) struct Edges<'a, const N: usize> {
    pub pixels: &'a [[u8; N]],
    pub width: usize,
    /// Its colours. Of those behind the first `of_shape` one may be out of sight, as in strokes that cover no pixel wholly.
    pub colours: &'a [[u8; 3]],
    pub of_shape: usize,
    /// For each colour whether it is [thin](thin_colours).
    pub thin: &'a [bool],
    /// For each colour the one that it [stands for](meant).
    pub meant: &'a [usize],
    /// How many times the pixels were enlarged after they were drawn.
    pub enlarged: usize,
}

/// How wide what is drawn in each colour is: its pixels, and those that end a square of three of them as they were drawn.
pub(super) struct Widths(HashMap<[u8; 3], [u64; 2]>);

impl Widths {
    pub fn of<const N: usize>(
        pixels: &[[u8; N]],
        width: usize,
        stretches: &[Range<usize>],
        enlarged: usize,
    ) -> Widths {
        let mut counts: HashMap<[u8; 3], [u64; 2]> = HashMap::new();
        let side = 2 * enlarged;
        for stretch in stretches {
            let mut at = stretch.start;
            for run in pixels[stretch.clone()].chunk_by(|a, b| a == b) {
                let all = at..at + run.len();
                at = all.end;
                let [dots, squares] = counts.entry(split(&run[0]).1).or_default();
                *dots += run.len() as u64;
                let ends = (all.start + side..all.end).filter(|&at| at >= side * width);
                let is_square = |&at: &usize| {
                    (1..=side).all(|up| {
                        [at, at - enlarged, at - side].into_iter().all(|at| pixels[at - up * width] == run[0])
                    })
                };
                *squares += ends.filter(is_square).count() as u64;
            }
        }
        Widths(counts)
    }

    /// Whether a colour is nowhere three pixels wide.
    pub fn is_thin(&self, colour: [u8; 3]) -> bool {
        self.0.get(&colour).is_none_or(|&[dots, squares]| squares * THIN <= dots)
    }
}

/// For each colour whether it may be that of an edge alone: it is thin, and lies between two others or is like a more frequent one,
/// of which colours come first. Colours that are found to be edges are no ends of others.
pub(super) fn thin_colours(colours: &[[u8; 3]], widths: &impl Deref<Target = Widths>) -> Vec<bool> {
    let mut thin = vec![false; colours.len()];
    for at in 0..colours.len() {
        let ends: Vec<[u8; 3]> =
            (0..colours.len().min(MOST_KNOWN)).filter(|&end| !thin[end]).map(|end| colours[end]).collect();
        let is_ground = |end| WHITE_AND_BLACK.contains(&end) || !widths.is_thin(end);
        let is_like = || colours[..at].iter().any(|&more| similar(more, colours[at]));
        thin[at] = (is_like() || is_between(colours[at], &ends, is_ground)) && widths.is_thin(colours[at]);
    }
    thin
}

/// For each colour the number of the one that it stands for where others look for what is near: a thin colour for the most frequent
/// that is like it.
pub(super) fn meant(colours: &[[u8; 3]], thin: &[bool]) -> Vec<usize> {
    let like = |at: usize| colours.iter().position(|&more| similar(more, colours[at]));
    (0..colours.len()).map(|at| like(at).filter(|_| thin[at]).unwrap_or(at)).collect()
}

/// Whether a colour, not white or black, lies between two others that are far from each other and not like it, of which one `is_ground`.
/// Sharpened edges lie a little beyond. The most frequent colours come first: what is near an end or beyond it is rarer than that.
pub(super) fn is_between(own: [u8; 3], colours: &[[u8; 3]], is_ground: impl Fn([u8; 3]) -> bool) -> bool {
    let at_own = colours.iter().position(|&colour| colour == own).unwrap_or(colours.len());
    let inner = |(at_a, a): (usize, [u8; 3]), (at_b, b): (usize, [u8; 3])| {
        (0..3).any(|c| a[c].abs_diff(b[c]) >= CONTRAST)
            && !similar(a, own)
            && !similar(b, own)
            && (is_ground(a) || is_ground(b))
            && along(own, a, b).is_some_and(|(along, _)| {
                let end = if along < 0.5 { at_a } else { at_b };
                let beyond = (along - 0.5).abs() - 0.5;
                beyond < -0.1 || beyond <= BEYOND && end < at_own
            })
    };
    let ends = || colours.iter().copied().enumerate();
    !WHITE_AND_BLACK.contains(&own) && ends().any(|a| ends().take(a.0).any(|b| inner(a, b)))
}

/// Where a colour lies on the way from one colour to another, 0 to 1, and the square of its distance from it; `None` if it does not.
pub(super) fn along(own: [u8; 3], from: [u8; 3], to: [u8; 3]) -> Option<(f32, f32)> {
    let (own, from, to) = (own.map(f32::from), from.map(f32::from), to.map(f32::from));
    let line: [f32; 3] = std::array::from_fn(|c| to[c] - from[c]);
    let length: f32 = line.iter().map(|v| v * v).sum();
    let along = (0..3).map(|c| (own[c] - from[c]) * line[c]).sum::<f32>() / length;
    let off = (0..3).map(|c| (own[c] - from[c] - along * line[c]).powi(2)).sum::<f32>();
    ((-2.0 * BEYOND..=1.0 + 2.0 * BEYOND).contains(&along) && off <= OFF * OFF).then_some((along, off))
}

impl<const N: usize> Edges<'_, N> {
    /// The colour that a pixel belongs to; `known` is the number of its own, if that is a thin one. Ripples of edges farther away take long to find.
    pub fn colour(&self, at: usize, known: Option<usize>, ripples: bool) -> Option<[u8; 3]> {
        let own = split(&self.pixels[at]).1;
        if let Some(known) = known.filter(|_| self.is_in_a_square(at)) {
            return Some(self.colours[self.meant[known]]);
        }
        let (near, far) = (self.near(at, REACH), LazyCell::new(|| self.near(at, RIPPLES)));
        // A ripple is like the colour beside the edge.
        if known.is_none() && !near.contains(&true) {
            return None;
        }
        // Filters that sharpen leave ripples farther from edges. The ground is more frequent.
        let beyond = |wide: bool| {
            let found = self.between(own, &far, (wide, known))?;
            let (more, less, share) = found;
            let of_ink = near[more.max(less)] && !near[more.min(less)];
            (of_ink || known.is_none() && share <= BEYOND).then_some(found)
        };
        let found = [true, false].into_iter().filter(|&wide| wide || known.is_none()).find_map(|wide| {
            self.between(own, &near, (wide, known)).or_else(|| if ripples { beyond(wide) } else { None })
        });
        let Some((more, less, share)) = found else {
            return known.map(|_| own);
        };
        let is_line =
            share >= FAINTEST && self.is_on_a_line(at, share, (self.colours[more], self.colours[less]));
        Some(self.colours[if is_line { less } else { more }])
    }

    /// Two colours between which a colour lies, the nearer one first, and how large the share of the other is. Of `wide` ones, that are
    /// not thin, both are near, or one and the colour out of sight.
    fn between(
        &self,
        own: [u8; 3],
        near: &[bool; MOST_KNOWN],
        (wide, known): (bool, Option<usize>),
    ) -> Option<(usize, usize, f32)> {
        let present = |colour: usize| near[colour] || colour >= self.of_shape && known.is_none();
        let ends = || (0..self.colours.len()).filter(|&end| present(end) && !(wide && self.thin[end]));
        let pairs = ends().flat_map(|a| ends().filter(move |&b| b > a).map(move |b| (a, b)));
        let pairs = pairs.filter(|&(a, b)| near[a] || near[b]);
        let lines = pairs.filter_map(|(a, b)| {
            let (along, off) = along(own, self.colours[a], self.colours[b])?;
            if known.is_some() && (along - 0.5).abs() > 0.5 + BEYOND {
                return None;
            }
            let doubt = !near[a] || !near[b];
            let (more, less) = if along < 0.5 { (a, b) } else { (b, a) };
            Some((doubt, off, (more, less, along.min(1.0 - along))))
        });
        lines.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, _, found)| found)
    }

    /// Whether a pixel that is covered by a `share` of less than half is on a line that is no wider than it: more covered than
    /// what lies on both sides of it, and about as much as the next one along the line.
    pub(super) fn is_on_a_line(&self, at: usize, share: f32, (ground, line): ([u8; 3], [u8; 3])) -> bool {
        let (x, e) = (at % self.width, self.enlarged);
        let (right, down) = (e as isize, (e * self.width) as isize);
        let covered = |step: isize, times: isize| {
            let column = if step == right { x as isize + times * step } else { x as isize };
            let pixel = at.checked_add_signed(times * step).and_then(|at| self.pixels.get(at));
            let pixel = pixel.filter(|_| (0..self.width as isize).contains(&column));
            // Beyond the page is ground; a third colour is no line.
            pixel.map_or(0.0, |pixel| along(split(pixel).1, ground, line).map_or(1.0, |(along, _)| along))
        };
        let is_over = |step: isize| {
            let [far, before, after, beyond] = [-2, -1, 1, 2].map(|times| covered(step, times));
            before < share
                && after <= share
                && before.min(far) < share / 2.0
                && after.min(beyond) < share / 2.0
        };
        let goes_on =
            |step: isize| [-1, 1].into_iter().any(|times| (covered(step, times) - share).abs() <= ALIKE);
        is_over(right) && goes_on(down) || is_over(down) && goes_on(right)
    }

    /// The number of a pixel's colour. What is nearly white or black stands for white or black beside the art, too.
    pub(super) fn number(&self, pixel: [u8; 3]) -> Option<usize> {
        let known = self.colours.iter().position(|&colour| colour == pixel).map(|known| self.meant[known]);
        known.or_else(|| WHITE_AND_BLACK.iter().position(|&colour| colour == pixel))
    }

    /// The wide colours that a colour is like, one bit each.
    fn like(&self, pixel: [u8; 3]) -> u64 {
        let wide = self.colours.iter().zip(self.thin).enumerate().filter(|(_, (_, thin))| !**thin);
        wide.filter(|(_, (colour, _))| similar(**colour, pixel)).fold(0, |all, (at, _)| all | 1 << at)
    }

    /// Which of the colours are so near a pixel. Filters that sharpen leave hardly a pixel beside an edge in the very colour of what is
    /// there: what is like a wide colour stands for it, unless another that it is like is near.
    fn near(&self, at: usize, reach: usize) -> [bool; MOST_KNOWN] {
        let (x, y, reach) = (at % self.width, at / self.width, reach * self.enlarged);
        let mut near = [false; MOST_KNOWN];
        // The colours that a pixel is like, a bit each.
        let mut alike: Vec<u64> = Vec::new();
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(self.pixels.len() / self.width);
        for row in rows.step_by(self.enlarged) {
            let row = &self.pixels[row * self.width..(row + 1) * self.width];
            let beside = &row[x.saturating_sub(reach)..(x + reach + 1).min(self.width)];
            for pixel in beside.iter().step_by(self.enlarged) {
                let pixel = split(pixel).1;
                match self.number(pixel) {
                    Some(known) => near[known] = true,
                    None => alike.extend(Some(self.like(pixel)).filter(|&like| like != 0)),
                }
            }
        }
        let exact = (0..MOST_KNOWN).filter(|&at| near[at]).fold(0, |all, at| all | 1u64 << at);
        for like in alike.into_iter().filter(|like| like & exact == 0) {
            near[like.trailing_zeros() as usize] = true;
        }
        near
    }

    /// Whether a pixel is in a square of two, as they were drawn, in its colour: between two areas no edge is so wide.
    fn is_in_a_square(&self, at: usize) -> bool {
        let (x, over, step) = (at % self.width, self.width * self.enlarged, self.enlarged);
        let alike = |other: usize| self.pixels.get(other) == Some(&self.pixels[at]);
        let beside = [(x >= step).then(|| at - step), (x + step < self.width).then_some(at + step)];
        let rows = [at.checked_sub(over), Some(at + over)];
        beside
            .into_iter()
            .flatten()
            .filter(|&beside| alike(beside))
            .any(|beside| rows.into_iter().flatten().any(|row| alike(row) && alike(row + beside - at)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posters::{Known, poster};

    const SIDE: usize = 120;

    /// The colours that a picture of flat art becomes, if it is such. A `ground` other than white makes one shape of it.
    fn cut(pixels: &[[u8; 3]]) -> Option<Vec<[u8; 3]>> {
        let rows: Vec<Range<usize>> = (0..SIDE).map(|y| y * SIDE..(y + 1) * SIDE).collect();
        let mut out = vec![[0; 3]; pixels.len()];
        for (span, colour) in
            poster(pixels, SIDE, &rows, Known { common: &[], thin: false, enlarged: 1 })?.spans
        {
            out[span].fill(colour);
        }
        Some(out)
    }

    fn mixed(ground: [u8; 3], ink: [u8; 3], share: f64) -> [u8; 3] {
        std::array::from_fn(|c| {
            (f64::from(ground[c]) * (1.0 - share) + f64::from(ink[c]) * share).round() as u8
        })
    }

    /// Words of upright stems 30 pixels high, ten pixels apart, each covering its columns by these shares.
    fn words(ground: [u8; 3], ink: [u8; 3], stems: &[&[f64]]) -> Vec<[u8; 3]> {
        let share = |x: usize, y: usize| {
            let (stem, row) = (stems[(x / 10 + y / 40 * 5) % stems.len()], y % 40);
            if (5..35).contains(&row) { stem.get(x % 10).copied().unwrap_or(0.0) } else { 0.0 }
        };
        (0..SIDE * SIDE).map(|at| mixed(ground, ink, share(at % SIDE, at / SIDE))).collect()
    }

    #[test]
    fn a_stem_that_covers_half_of_two_pixels_is_a_letter_like_others() {
        let stems: [&[f64]; 5] =
            [&[0.0, 1.0, 1.0], &[0.6, 1.0, 0.4], &[0.0, 0.55, 0.55], &[0.2, 1.0, 0.8], &[1.0, 1.0]];
        for (ground, ink) in [
            ([235, 240, 210], [0, 0, 160]),
            ([235, 240, 210], [0; 3]),
            ([0, 40, 160], [255; 3]),
            ([190, 20, 30], [250, 230, 0]),
        ] {
            let found = cut(&words(ground, ink, &stems)).expect("flat art");
            for (at, &colour) in found.iter().enumerate() {
                let (x, y) = (at % SIDE, at / SIDE);
                let stem = stems[(x / 10 + y / 40 * 5) % 5];
                let share = stem.get(x % 10).copied().filter(|_| (5..35).contains(&(y % 40))).unwrap_or(0.0);
                assert_eq!(colour, if share > 0.5 { ink } else { ground }, "{ink:?} at {x}, {y}: {share}");
            }
        }
    }

    #[test]
    fn pale_letters_amid_their_like_stay_pale() {
        let (ground, dark) = ([235, 240, 210], [0, 0, 160]);
        let pale = mixed(ground, dark, 0.5);
        // Three rows of words: dark, pale, dark.
        let of_row = [words(ground, dark, &[&[1.0, 1.0, 1.0]]), words(ground, pale, &[&[0.0, 1.0, 1.0]])];
        let pixels: Vec<[u8; 3]> =
            (0..SIDE * SIDE).map(|at| of_row[usize::from(at / SIDE / 40 == 1)][at]).collect();
        assert!(cut(&pixels).is_some_and(|found| found == pixels));
    }

    /// A filter that sharpens (cubic, a = -1/2) and its ripples, on stems of three pixels at every phase.
    #[test]
    fn sharpened_edges_and_their_ripples_are_cut() {
        let cubic = |t: f64| match t.abs() {
            t if t < 1.0 => 1.5 * t.powi(3) - 2.5 * t.powi(2) + 1.0,
            t if t < 2.0 => -0.5 * t.powi(3) + 2.5 * t.powi(2) - 4.0 * t + 2.0,
            _ => 0.0,
        };
        // Each third stem at the same phase.
        let stem = |x: f64| {
            let from = 3.0 + (x / 10.0).floor() % 3.0 * 0.3;
            (from..from + 3.2).contains(&(x % 10.0))
        };
        let share = |x: usize| {
            let taps = (-64..64).map(|tap| (f64::from(tap) + 0.5) / 32.0);
            taps.map(|t| cubic(t) / 32.0 * f64::from(stem((x as f64 + 0.5 + t).max(0.0)))).sum::<f64>()
        };
        let shares: Vec<f64> = (0..SIDE).map(share).collect();
        for (ground, ink) in [
            ([225, 230, 200], [30, 40, 160]),
            ([190, 40, 50], [240, 220, 40]),
            ([255; 3], [0, 0, 160]),
            ([235, 240, 210], [0; 3]),
        ] {
            let tone = |at: usize| {
                let share = if at / SIDE % 40 < 36 { shares[at % SIDE] } else { 0.0 };
                std::array::from_fn(|c| {
                    let (ground, ink): ([u8; 3], [u8; 3]) = (ground, ink);
                    (f64::from(ground[c]) * (1.0 - share) + f64::from(ink[c]) * share).round() as u8
                })
            };
            let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE).map(tone).collect();
            let found = cut(&pixels).expect("flat art");
            for (at, colour) in found.into_iter().enumerate() {
                let share = if at / SIDE % 40 < 36 { shares[at % SIDE] } else { 0.0 };
                if (share - 0.5).abs() > 0.05 {
                    let wanted = if share > 0.5 { ink } else { ground };
                    let alike = (0..3).all(|c| colour[c].abs_diff(wanted[c]) <= 20);
                    assert!(alike, "{colour:?} of {wanted:?} at {}: {share}", at % SIDE);
                }
            }
        }
    }

    #[test]
    fn a_line_that_covers_less_than_half_of_any_pixel_stays_whole() {
        let (ground, ink) = ([250, 240, 200], [150, 0, 20]);
        let bold: &[f64] = &[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        for (line, at_column) in
            [(&[0.0, 0.4][..], 1), (&[0.3, 0.35], 1), (&[0.35, 0.35], 0), (&[0.45, 0.1], 0)]
        {
            let found = cut(&words(ground, ink, &[line, bold, bold])).expect("flat art");
            for (at, &colour) in found.iter().enumerate() {
                let (x, y) = (at % SIDE, at / SIDE);
                let inked = match (x / 10 + y / 40 * 5) % 3 {
                    0 => x % 10 == at_column,
                    _ => (4..7).contains(&(x % 10)),
                };
                let inked = inked && (5..35).contains(&(y % 40));
                assert_eq!(colour, if inked { ink } else { ground }, "{line:?} at {x}, {y}");
            }
        }
    }
}
