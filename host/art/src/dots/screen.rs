//! Dots of colours, each by itself: a table of small clusters picks its stack.
//!
//! Problem: letters, lines and photographs in process inks must each have the colours that were asked for,
//! as an eye sees them at reading distance, and nothing drawn elsewhere may change a dot.
//! Method: a dot asks only for its own colour, whose mixture (`mixtures`) lies on [0, 1) with the stacks in
//! order of lightness; the threshold of the green noise at the dot ([`Table`]) picks one. A colour that is
//! a stack is that stack. A dot is flat if [`ALIKE`] of its eight neighbours have its very colour; at edges
//! between flat dots the mixture leans towards the edge (`lean`). The dots of pictures also know what those
//! before them printed (`diffusion`). Strips of rows are made independently of each other; each reads
//! [`HALO`] rows beyond itself. Blocks of one colour are found first, since most of a page is paper.
//! Cost: some 80 ns a dot of a photograph, 1 ns of a page of text. Memory: a byte a dot, and a strip for
//! each thread.
//! Limits: process inks, and colours of 8 bits.
//! Source: `green_noise` of the halftone for the table; three examinations by a model of the eye for the
//! rest (docs/decisions/flat-art.md).

#[cfg(test)]
mod carried;
#[cfg(test)]
mod colours;
#[cfg(test)]
mod constants;
mod diffusion;
#[cfg(test)]
mod figures;
mod lean;
mod mixtures;
#[cfg(test)]
mod neighbours;
#[cfg(test)]
mod tests;

use std::ops::Range;

use rayon::prelude::*;

use crate::colour::fit::Fit;
use crate::colour::packed::{DRAWN, Key, LABEL, colour};
use crate::colour::solids::Solids;
use appearance::wide::wide;
use diffusion::{Diffusion, EARLY};
use halftone::green_noise::{SIDE, Table};
use lean::{AREA, FLAT, Leans};
use mixtures::{Mixtures, Stops};

/// Rows of a strip. Source: some for every thread on the smallest sheet.
const STRIP: usize = 64;
/// Rows of a strip that begins early. Source: the rows that are looked at twice are a sixteenth of it.
const STRIP_OF_PICTURES: usize = 256;
/// Rows beyond a strip that decide about its dots: those of the dots whose flatness says whether there is
/// an edge beside the partner of a dot.
const HALO: usize = 4;
/// Neighbours of its very colour that make a dot flat: a line of one dot has two.
const ALIKE: u8 = 2;
/// All of them: four at its sides, four at its corners.
const ALL: u8 = 8;
/// Dots that are looked at together, a part of [`SIDE`].
const BLOCK: usize = 32;

/// The number of the stack of every dot. `rows` writes the colours of rows of dots, among which may be
/// those of `pictures`.
pub(crate) fn dots(
    rows: impl Fn(Range<usize>, &mut [Key]) + Sync,
    (width, height): (usize, usize),
    (fit, solids): (&Fit, &Solids<'_>),
    table: &Table,
    pictures: bool,
) -> Vec<u8> {
    let strip = if pictures { STRIP_OF_PICTURES } else { STRIP };
    // Sixteen are the stacks of four inks in one order.
    match fit.stacks.len() {
        ..=16 => {
            strips::<16, 1>(&rows, (width, height), (strip, pictures), &Mixtures::new(fit, solids), table)
        }
        _ => strips::<256, 16>(&rows, (width, height), (strip, pictures), &Mixtures::new(fit, solids), table),
    }
}

fn strips<const N: usize, const L: usize>(
    rows: &(impl Fn(Range<usize>, &mut [Key]) + Sync),
    (width, height): (usize, usize),
    (strip, pictures): (usize, bool),
    mixtures: &Mixtures<'_, N>,
    table: &Table,
) -> Vec<u8> {
    let early = if pictures { EARLY } else { 0 };
    let mut index = vec![0; width * height];
    index.par_chunks_mut(width * strip).enumerate().for_each_init(Strip::default, |read, (number, out)| {
        let top = number * strip;
        read.read(rows, (width, height), (top.min(early), top..top + out.len() / width));
        wide(
            #[inline(always)]
            || read.pick::<N, L>(mixtures, pictures, table, out),
        );
    });
    index
}

/// The dots of a strip and those beyond it that decide about them. It is read anew for the next, so that
/// its memory is not fresh each time.
#[derive(Default)]
struct Strip {
    width: usize,
    /// The strip's own rows among those read, and how many before them are looked at.
    own: Range<usize>,
    early: usize,
    /// The strip's first row on the page.
    top: usize,
    /// The colours of the dots, row by row, and these with [`FLAT`].
    plain: Vec<Key>,
    keys: Vec<Key>,
    /// The colour of each row that has only one.
    even: Vec<Option<Key>>,
}

impl Strip {
    fn read(
        &mut self,
        read: &impl Fn(Range<usize>, &mut [Key]),
        (width, height): (usize, usize),
        (early, rows): (usize, Range<usize>),
    ) {
        let all = rows.start.saturating_sub(early + HALO)..(rows.end + HALO).min(height);
        let Strip { plain, keys, even, .. } = self;
        (self.width, self.top, self.early) = (width, rows.start, early);
        self.own = rows.start - all.start..rows.end - all.start;
        plain.resize(width * all.len(), 0);
        read(all, plain);
        keys.clear();
        keys.extend_from_slice(plain);
        let last = plain.len() / width - 1;
        even.resize(last + 1, None);
        wide(
            #[inline(always)]
            || {
                for (even, row) in even.iter_mut().zip(plain.chunks_exact(width)) {
                    *even = are_alike(row, row[0]).then_some(row[0]);
                }
                for (y, out) in keys.chunks_exact_mut(width).enumerate() {
                    let row = |y: usize| &plain[y * width..(y + 1) * width];
                    // Half of a page of text are rows of paper amid paper.
                    let is_amid = y > 0 && y < last && even[y - 1] == even[y] && even[y] == even[y + 1];
                    if let (Some(key), true) = (even[y], is_amid && width > 2) {
                        let mut mark = |range: Range<usize>, alike: u8| {
                            out[range].iter_mut().for_each(|out| *out = marked(key, alike));
                        };
                        // The outermost have five neighbours.
                        mark(0..1, ALL - 3);
                        mark(1..width - 1, ALL);
                        mark(width - 1..width, ALL - 3);
                        continue;
                    }
                    // Beyond the page there is nothing, so a border has its own colour outside only where
                    // it goes on.
                    let around = [(y > 0).then(|| row(y - 1)), Some(row(y)), (y < last).then(|| row(y + 1))];
                    mark_flat(out, around);
                }
            },
        );
    }

    #[inline(always)]
    fn pick<const N: usize, const L: usize>(
        &self,
        mixtures: &Mixtures<'_, N>,
        pictures: bool,
        table: &Table,
        out: &mut [u8],
    ) {
        let mut leans = Leans::new(&self.keys, &self.even, mixtures.rules.apart);
        let mut known = Known::new(mixtures);
        let mut diffusion = pictures.then(|| Diffusion::<L>::new(self.width, mixtures.rules));
        let row = |y: usize| &self.keys[y * self.width..(y + 1) * self.width];
        if let Some(diffusion) = &mut diffusion {
            for before in (1..=self.early).rev() {
                let y = self.top - before;
                diffusion.row(y, row(self.own.start - before), &mut known, table.row(y), None);
            }
        }
        let is_carrying =
            |key: Key| pictures && diffusion::is_carrying(key, |colour| mixtures.is_named(colour));
        for (y, out) in self.own.clone().zip(out.chunks_exact_mut(self.width)) {
            let thresholds = table.row(self.top + y - self.own.start);
            let keys = row(y);
            if self.even[y].is_some_and(|key| mixtures.is_named(colour(key))) {
                let stops = known.stops(keys[0]);
                out.fill(mixtures.order[Mixtures::pick(&stops, 0)]);
                if let Some(diffusion) = &mut diffusion {
                    diffusion.rest();
                }
                continue;
            }
            let mut at = (Key::MAX, [0; N]);
            for ((number, keys), out) in keys.chunks(BLOCK).enumerate().zip(out.chunks_mut(BLOCK)) {
                if keys[0] != at.0 {
                    at = (keys[0], known.stops(keys[0]));
                }
                let thresholds = &thresholds[number * BLOCK % SIDE..][..keys.len()];
                // Most of a page is paper.
                if are_alike(keys, at.0) && mixtures::is_alone(&at.1) {
                    out.fill(mixtures.order[Mixtures::pick(&at.1, 0)]);
                    continue;
                }
                for ((&key, &threshold), out) in keys.iter().zip(thresholds).zip(out) {
                    if is_carrying(key) {
                        continue;
                    }
                    if key != at.0 {
                        at = (key, known.stops(key));
                    }
                    *out = mixtures.order[Mixtures::pick(&at.1, threshold)];
                }
            }
            if let Some(diffusion) = &mut diffusion {
                diffusion.row(self.top + y - self.own.start, keys, &mut known, thresholds, Some(&mut *out));
            }
            for lean in leans.row(y, |key| mixtures.is_named(colour(key))) {
                if is_carrying(keys[lean.x]) {
                    continue;
                }
                let stops = known.leaning(lean);
                out[lean.x] = mixtures.order[Mixtures::pick(&stops, thresholds[lean.x % SIDE])];
            }
        }
    }
}

/// A colour with marks for so many neighbours of that very colour.
#[inline(always)]
fn marked(key: Key, alike: u8) -> Key {
    let flat = if alike >= ALIKE { FLAT } else { 0 };
    key | flat | if alike == ALL && key & DRAWN == 0 { AREA } else { 0 }
}

/// Marks the flat ones among the dots of a row. `around` are the rows above, of these dots and below,
/// without marks.
#[inline(always)]
fn mark_flat(out: &mut [Key], around: [Option<&[Key]>; 3]) {
    let width = out.len();
    let Some(own) = around[1] else { return };
    let mark = |out: &mut Key, alike: u8| *out = marked(*out, alike);
    for start in (0..width).step_by(BLOCK) {
        let end = (start + BLOCK).min(width);
        let out = &mut out[start..end];
        // Dots that all have a neighbour on each side, and these.
        let inside = (start > 0 && end < width && end - start == BLOCK).then(|| {
            let [above, own, below] = around;
            Some([above?, own?, below?].map(|row| &row[start - 1..=end]))
        });
        let Some(rows) = inside.flatten() else {
            for (x, out) in (start..end).zip(out) {
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let near = around.into_iter().flatten().flat_map(|row| &row[columns.clone()]);
                // Not the dot itself.
                mark(out, near.map(|&key| u8::from(key == own[x])).sum::<u8>() - 1);
            }
            continue;
        };
        if rows.iter().all(|row| are_alike(row, own[start])) {
            out.iter_mut().for_each(|out| mark(out, ALL));
            continue;
        }
        let mut alike = [0u8; BLOCK];
        for (row, shift) in rows.iter().flat_map(|row| [0, 1, 2].map(|shift| (row, shift))) {
            for (alike, (a, b)) in alike.iter_mut().zip(own[start..end].iter().zip(&row[shift..])) {
                *alike += u8::from(a == b);
            }
        }
        out.iter_mut().zip(alike).for_each(|(out, alike)| mark(out, alike - 1));
    }
}

/// Whether all of these are one colour.
#[inline(always)]
fn are_alike(keys: &[Key], own: Key) -> bool {
    keys.iter().fold(0, |other, key| other | (key ^ own)) == 0
}

/// The stops of the flat colours that were asked for last, by a hash.
struct Known<'a, const N: usize> {
    mixtures: &'a Mixtures<'a, N>,
    last: Vec<(Key, Stops<N>)>,
    leaning: Vec<((Key, Key, bool), Stops<N>)>,
}

/// Colours that are kept.
const KEPT: usize = 1 << 10;

impl<'a, const N: usize> Known<'a, N> {
    fn new(mixtures: &'a Mixtures<'a, N>) -> Known<'a, N> {
        let none = (Key::MAX, Key::MAX, false);
        Known { mixtures, last: vec![(Key::MAX, [0; N]); KEPT], leaning: vec![(none, [0; N]); KEPT] }
    }

    #[inline(always)]
    fn stops(&mut self, key: Key) -> Stops<N> {
        // A photograph's colours hardly ever return, and the step of a shading in it is no colour of its own.
        match key & (DRAWN | AREA | LABEL) > 0 {
            true => self.kept(key & !(FLAT | AREA)),
            false => self.mixtures.stops(colour(key), false),
        }
    }

    fn kept(&mut self, key: Key) -> Stops<N> {
        let known = &mut self.last[place(key)];
        if known.0 != key {
            let stops = match key & LABEL > 0 {
                true => self.mixtures.label(colour(key)),
                false => self.mixtures.flat(colour(key), key & DRAWN > 0),
            };
            *known = (key, stops);
        }
        known.1
    }

    fn leaning(&mut self, lean: &lean::Lean) -> Stops<N> {
        let key = (lean.own, lean.other, lean.at_edge);
        let at = place(lean.own.rotate_left(7) ^ lean.other.rotate_left(1) ^ Key::from(lean.at_edge));
        if self.leaning[at].0 != key {
            // Beside an edge a colour of a picture is an area, too.
            let (own, other) = (self.stops(lean.own | AREA), self.stops(lean.other | AREA));
            self.leaning[at] = (key, lean::leaning(&own, &other, lean.at_edge, self.mixtures.rules.part));
        }
        self.leaning[at].1
    }
}

/// Where a colour is kept.
#[inline(always)]
fn place(key: Key) -> usize {
    (key.wrapping_mul(0x9e37_79b1) >> 22) as usize % KEPT
}
