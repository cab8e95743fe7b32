//! Strokes in the colour of softened edges: what lies on what is behind them, and which are letters by themselves.
//!
//! Problem: a stem that covers half of two pixels each is a pale line, with no pixel of the letters' colour near it; a pale letter beside
//! dark ones looks the same.
//! Method: strokes in a [thin](super::softened::thin_colours) colour are decided as wholes. What is amid letters in the colour behind it, as the stem of an l is amid
//! its word, is of that colour; what is amid its like keeps its own.
//! Cost: a few microseconds a stroke. Limits: strokes longer than [`LONGEST`] pixels keep their colour.

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::flat::split;
use super::posters::{MOST_KNOWN, Span, push};
use super::softened::{Edges, along};
use sheet::forest::Forest;

/// Strokes longer than so many pixels as they were drawn are lines, not of letters.
const LONGEST: usize = 48;

impl<const N: usize> Edges<'_, N> {
    /// Gives strokes in a thin colour the colour of the letters that they are amid.
    pub fn decide_strokes(&self, spans: &mut Vec<Span>) {
        if !self.thin.contains(&true) {
            return;
        }
        let is_thin = |colour: [u8; 3]| {
            self.colours.iter().position(|&known| known == colour).is_some_and(|known| self.thin[known])
        };
        let edges: Vec<usize> = (0..spans.len()).filter(|&at| is_thin(spans[at].1)).collect();
        let places: Vec<Range<usize>> = edges.iter().map(|&at| spans[at].0.clone()).collect();
        let roots = Forest::of_stretches(&places, self.width, |_, _| true).roots();
        let mut order: Vec<usize> = (0..edges.len()).collect();
        order.sort_by_key(|&at| roots[at]);
        let strokes: Vec<Vec<usize>> = order
            .chunk_by(|&a, &b| roots[a] == roots[b])
            .map(|stroke| stroke.iter().map(|&at| edges[at]).collect())
            .collect();
        let decided: Vec<(usize, Vec<Span>)> = strokes
            .par_iter()
            .filter_map(|stroke| {
                let colours = self.behind(&stroke.iter().map(|&at| &spans[at]).collect::<Vec<_>>())?;
                Some(stroke.iter().map(|&at| (at, self.split(&spans[at].0, colours))).collect::<Vec<_>>())
            })
            .flatten()
            .collect();
        let mut decided: HashMap<usize, Vec<Span>> = decided.into_iter().collect();
        let all = std::mem::take(spans);
        for (at, span) in all.into_iter().enumerate() {
            match decided.remove(&at) {
                Some(parts) => spans.extend(parts),
                None => spans.push(span),
            }
        }
    }

    /// The pixels of a stroke, each in the colour that it belongs to: of what it lies on, or that of letters.
    fn split(&self, span: &Range<usize>, (ground, ink): ([u8; 3], [u8; 3])) -> Vec<Span> {
        let mut parts = Vec::new();
        for at in span.clone() {
            let share = along(split(&self.pixels[at]).1, ground, ink).map_or(1.0, |(along, _)| along);
            let is_ink = share >= 0.5 || self.is_on_a_line(at, share, (ground, ink));
            push(&mut parts, at..at + 1, if is_ink { ink } else { ground });
        }
        parts
    }

    /// What a stroke in a thin colour lies on, and the colour behind it: a third one, beyond that of the stroke, if more beside the stroke
    /// is covered by it than is like the stroke.
    fn behind(&self, stroke: &[&Span]) -> Option<([u8; 3], [u8; 3])> {
        let width = self.width;
        let left = stroke.iter().map(|span| span.0.start % width).min()?;
        let right = stroke.iter().map(|span| (span.0.end - 1) % width + 1).max()?;
        let (top, bottom) = (stroke.first()?.0.start / width, stroke.last()?.0.start / width + 1);
        let side = (right - left).max(bottom - top);
        if side > LONGEST * self.enlarged {
            return None;
        }
        let mut dots = [0usize; MOST_KNOWN];
        let mut border = [0usize; MOST_KNOWN];
        for (span, colour) in stroke {
            let known = self.colours.iter().position(|known| known == colour)?;
            dots[known] += span.len();
            let ends = [span.start.checked_sub(1), Some(span.end)];
            let beside = span.clone().flat_map(|at| [at.checked_sub(width), Some(at + width)]).chain(ends);
            let beside =
                beside.flatten().filter_map(|at| self.pixels.get(at)).filter_map(|p| self.number(split(p).1));
            beside.filter(|&beside| beside != known).for_each(|beside| border[beside] += 1);
        }
        let most = |counts: &[usize]| (0..self.colours.len()).rev().max_by_key(|&colour| counts[colour]);
        let own = most(&dots)?;
        // Letters of a word are beside each other; what is above a stem is another line.
        let over = right - left;
        let rows = top.saturating_sub(over)..(bottom + over).min(self.pixels.len() / width);
        let around = rows.step_by(self.enlarged).flat_map(|y| {
            let row = &self.pixels[y * width..(y + 1) * width];
            row[left.saturating_sub(side)..(right + side).min(width)].iter().step_by(self.enlarged)
        });
        let mut counts = [0usize; MOST_KNOWN];
        around.clone().filter_map(|pixel| self.number(split(pixel).1)).for_each(|colour| counts[colour] += 1);
        let flat = |colour: usize| if self.thin[colour] { 0 } else { counts[colour] };
        let ground = (0..self.colours.len()).rev().max_by_key(|&colour| flat(colour))?;
        let all: usize = border.iter().sum();
        let share = |colour: [u8; 3], behind: usize| {
            along(colour, self.colours[ground], self.colours[behind]).map(|(along, _)| along)
        };
        let behind = (0..self.colours.len()).filter(|&colour| {
            counts[colour] > 0
                && 4 * border[colour] <= all
                && colour != ground
                && share(self.colours[own], colour).is_some_and(|share| (0.05..=0.9).contains(&share))
        });
        let behind = behind.max_by_key(|&colour| counts[colour])?;
        // Its like, against what is more covered than it.
        let covered = share(self.colours[own], behind)? + 0.1;
        let like = counts[own].saturating_sub(dots[own] / self.enlarged.pow(2));
        let deeper =
            around.filter(|pixel| share(split(pixel).1, behind).is_some_and(|share| share > covered)).count();
        (2 * deeper > 3 * like).then(|| (self.colours[ground], self.colours[behind]))
    }
}
