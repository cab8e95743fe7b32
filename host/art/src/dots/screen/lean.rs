//! Mixtures lean towards the edges of what they fill.
//!
//! Problem: where a tone ends at an edge, picked dots leave the edge open between them.
//! Method: an edge lies between two flat dots whose colours differ by more than `apart` of the rules and which share a side. Of the two dots of
//! one side that are nearest to it, the stacks that the other side lacks gain a `part` of what they can gain in the first and lose as
//! much in the second, so the sum stays. A dot without a second one behind it, in strokes of one or two dots, keeps its mixture: more of it
//! would be more ink than was asked.
//! Cost: a look at each dot, and some 100 ns at an edge.

use super::BLOCK;
use super::mixtures::{Stops, shares, stops};
use crate::colour::packed::Key;
use appearance::weights::ONE;

/// Marks the colour of a flat dot.
pub(super) const FLAT: Key = 1 << 25;
/// Marks the colour of a dot of a picture amid its like.
pub(super) const AREA: Key = 1 << 27;

/// Sides of a dot, a bit each, and the way to the neighbour there.
const SIDES: [(u8, isize, isize); 4] = [(1, -1, 0), (2, 1, 0), (4, 0, -1), (8, 0, 1)];

/// A dot near an edge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Lean {
    pub x: usize,
    /// Its own colour, and that beyond the edge.
    pub own: Key,
    pub other: Key,
    /// Whether it is the first beside the edge, or else the second.
    pub at_edge: bool,
}

/// The dots near edges, row by row.
pub(super) struct Leans<'a> {
    keys: &'a [Key],
    width: usize,
    /// For each dot the sides on which it has an edge.
    edges: Vec<u8>,
    /// Whether a row has any.
    busy: Vec<bool>,
    found: Vec<Lean>,
}

/// Whether there is an edge between two neighbours.
#[inline(always)]
fn is_edge(a: Key, b: Key, apart: u32) -> bool {
    let off = |shift: u32| (a >> shift & 0xff).abs_diff(b >> shift & 0xff);
    (a & b & FLAT > 0) & (off(0).max(off(8)).max(off(16)) > apart)
}

impl<'a> Leans<'a> {
    /// Of rows of dots, of which some are `even`: of one colour.
    #[inline(always)]
    pub fn new(keys: &'a [Key], even: &[Option<Key>], apart: u32) -> Leans<'a> {
        let mut edges = vec![0; keys.len()];
        let (rows, width) = (even.len(), keys.len() / even.len());
        let mut mark = |from: std::ops::Range<usize>, way: usize, (here, there): (u8, u8)| {
            for start in from.clone().step_by(BLOCK) {
                let block = start..(start + BLOCK).min(from.end);
                let (a, b) = (&keys[block.clone()], &keys[block.start + way..block.end + way]);
                // Most have no edge: they are of one colour, or not flat.
                let may_be = |(a, b): (&Key, &Key)| if a != b { a & b & FLAT } else { 0 };
                if a.iter().zip(b).fold(0, |any, pair| any | may_be(pair)) == 0 {
                    continue;
                }
                // Of a photograph's neighbours hardly any.
                if !a.iter().zip(b).fold(false, |any, (&a, &b)| any | is_edge(a, b, apart)) {
                    continue;
                }
                let mark = |edges: &mut [u8], side: u8| {
                    for (edges, (&a, &b)) in edges.iter_mut().zip(a.iter().zip(b)) {
                        *edges |= side * u8::from(is_edge(a, b, apart));
                    }
                };
                mark(&mut edges[block.clone()], here);
                mark(&mut edges[block.start + way..block.end + way], there);
            }
        };
        for y in 0..rows {
            let row = y * width..(y + 1) * width;
            if even[y].is_none() {
                mark(row.start..row.end - 1, 1, (2, 1));
            }
            if y + 1 < rows && (even[y].is_none() || even[y] != even[y + 1]) {
                mark(row, width, (8, 4));
            }
        }
        let busy = edges.chunks_exact(width).map(|row| row.iter().fold(0, |any, &side| any | side) > 0);
        let busy = busy.collect();
        Leans { keys, width, edges, busy, found: Vec::new() }
    }

    /// The dots of a row that lean, from the left. A colour that `is_solid` has nothing to lean.
    #[inline(always)]
    pub fn row(&mut self, y: usize, is_solid: impl Fn(Key) -> bool) -> &[Lean] {
        self.found.clear();
        for row in y.saturating_sub(1)..(y + 2).min(self.busy.len()) {
            if self.busy[row] {
                self.beside(row, y, &is_solid);
            }
        }
        // One that is the second of several keeps what was found first.
        self.found.sort_by_key(|lean| lean.x);
        self.found.dedup_by_key(|lean| lean.x);
        &self.found
    }

    /// Adds the dots of row `y` that lean because of an edge of row `row`.
    #[inline(always)]
    fn beside(&mut self, row: usize, y: usize, is_solid: &impl Fn(Key) -> bool) {
        let first = row * self.width;
        let (eights, _) = self.edges[first..first + self.width].as_chunks::<8>();
        let mut x = 0;
        while x < self.width {
            if x % 8 == 0 && eights.get(x / 8) == Some(&[0; 8]) {
                x += 8;
                continue;
            }
            let own = self.keys[first + x];
            if self.edges[first + x] == 0 || is_solid(own) {
                x += 1;
                continue;
            }
            let mut at_edge = false;
            for (side, right, down) in SIDES.into_iter().filter(|(side, ..)| self.edges[first + x] & side > 0)
            {
                let at = |times: isize| {
                    let (x, y) =
                        (x.checked_add_signed(times * right)?, row.checked_add_signed(times * down)?);
                    (x < self.width && y < self.busy.len()).then_some((x, y))
                };
                let ((Some(behind), Some(beyond)), true) = ((at(-1), at(1)), side > 0) else { continue };
                let number = |(x, y): (usize, usize)| y * self.width + x;
                // What is flat beside its like is, too.
                let like = |key: Key| key & !(FLAT | AREA) == own & !(FLAT | AREA);
                if !like(self.keys[number(behind)]) || self.edges[number(behind)] > 0 {
                    continue;
                }
                let other = self.keys[number(beyond)];
                if row == y && !at_edge {
                    self.found.push(Lean { x, own, other, at_edge: true });
                    at_edge = true;
                }
                if behind.1 == y {
                    self.found.push(Lean { x: behind.0, own, other, at_edge: false });
                }
            }
            x += 1;
        }
    }
}

/// The stops of a colour near an edge, beyond which there is another.
pub(super) fn leaning<const N: usize>(
    own: &Stops<N>,
    other: &Stops<N>,
    at_edge: bool,
    part: u32,
) -> Stops<N> {
    let (own_shares, others) = (shares(own), shares(other));
    let lacking: [bool; N] = std::array::from_fn(|q| others[q] == 0);
    let sum: u32 =
        own_shares.iter().zip(lacking).filter(|(_, lacks)| *lacks).map(|(&s, _)| u32::from(s)).sum();
    let all = u32::from(ONE);
    if sum == 0 || sum == all {
        return *own;
    }
    let change = sum.min(all - sum) * part / 100;
    let wanted = if at_edge { sum + change } else { sum - change };
    let parts = own_shares.iter().zip(lacking).map(|(&share, lacks)| {
        let (to, from) = if lacks { (wanted, sum) } else { (all - wanted, all - sum) };
        (u64::from(share) * u64::from(to) / u64::from(from)) as u16
    });
    let mut leaning = [0; N];
    leaning.iter_mut().zip(parts).for_each(|(to, from)| *to = from);
    stops(&leaning)
}
