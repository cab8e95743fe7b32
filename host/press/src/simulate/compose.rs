//! Passes as stacks: which inks lie on each dot.
//!
//! Method: eight passes at a time. What lies on a dot after them is what lay there before (a number) and which of the
//! eight print it (a byte); one walk over the page finds the pairs that occur, they get their stacks' numbers, a second
//! walk writes the numbers.
//! Cost: two walks and one byte a dot for each eight passes. Rows are shared among the cores; the numbers follow from
//! the pairs that occur, whoever found them, so they are the same for any number of threads.
//! Limits: at most 256 different stacks after any eight passes, which is what a sheet can tell apart.

use std::collections::HashMap;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;
use rayon::prelude::*;

use super::printout::PrintoutError;
use crate::separate::Pass;
use crate::sheet::Sheet;

/// Rows a thread takes at a time.
const BAND: usize = 64;

/// Stacks a number can stand for, and sets of eight passes.
const NUMBERS: usize = 256;

/// `SPREAD[byte]`: bit 7 - i of the byte as the lowest bit of byte i.
const SPREAD: [u64; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut i = 0;
        while i < 8 {
            table[byte] |= ((byte as u64 >> (7 - i)) & 1) << (8 * i);
            i += 1;
        }
        byte += 1;
    }
    table
};

/// Up to eight passes, and what the walks over their planes need to know.
struct Group<'a> {
    passes: &'a [&'a Pass],
    width: usize,
    stride: usize,
    /// Nothing lies on any dot yet.
    first: bool,
}

impl Group<'_> {
    /// Calls `dots(first column, for each of eight dots the passes that print it)` along row `y`, but where a first
    /// group prints nothing.
    fn walk_row(&self, y: usize, mut dots: impl FnMut(usize, [u8; 8])) {
        let mut rows: [&[u8]; 8] = [&[]; 8];
        for (row, pass) in rows.iter_mut().zip(self.passes) {
            *row = &pass.plane.bits[y * self.stride..(y + 1) * self.stride];
        }
        let rows = &rows[..self.passes.len()];
        for byte in 0..self.stride {
            let mut sets = 0;
            for (p, row) in rows.iter().enumerate() {
                sets |= SPREAD[usize::from(row[byte])] << p;
            }
            if sets != 0 || !self.first {
                dots(byte * 8, sets.to_le_bytes());
            }
        }
    }

    /// Which pairs occur: `seen[number * 256 + set]`.
    fn pairs(&self, index: &[u8]) -> Vec<bool> {
        let none = || vec![false; NUMBERS * NUMBERS];
        let mut seen = index
            .par_chunks(self.width * BAND)
            .enumerate()
            .fold(none, |mut seen, (band, lines)| {
                for (i, line) in lines.chunks(self.width).enumerate() {
                    self.walk_row(band * BAND + i, |x, sets| {
                        for (dot, set) in line[x..].iter().zip(sets) {
                            let number = if self.first { 0 } else { usize::from(*dot) };
                            seen[number * NUMBERS + usize::from(set)] = true;
                        }
                    });
                }
                seen
            })
            .reduce(none, |mut all, some| {
                all.iter_mut().zip(some).for_each(|(all, some)| *all |= some);
                all
            });
        seen[0] |= self.first;
        seen
    }

    /// Replaces the number of every dot by `numbers[number * 256 + set]`.
    fn renumber(&self, index: &mut [u8], numbers: &[u8]) {
        index.par_chunks_mut(self.width * BAND).enumerate().for_each(|(band, lines)| {
            for (i, line) in lines.chunks_mut(self.width).enumerate() {
                self.walk_row(band * BAND + i, |x, sets| {
                    for (dot, set) in line[x..].iter_mut().zip(sets) {
                        *dot = numbers[usize::from(*dot) * NUMBERS + usize::from(set)];
                    }
                });
            }
        });
    }

    /// A stack with the inks of a set of these passes on top.
    fn on(&self, below: &Stack, set: usize) -> Stack {
        let above =
            self.passes.iter().enumerate().filter(|(p, _)| set >> p & 1 != 0).map(|(_, pass)| pass.ink);
        Stack::new(below.layers().iter().copied().chain(above).collect::<Vec<Ink>>())
    }
}

/// The sheet these passes print on `paper`; all planes are the paper's size. Without a list the stacks that occur are
/// numbered, the substrate first, by the passes that make them.
pub(super) fn sheet(paper: Paper, passes: &[Pass], known: Option<&[Stack]>) -> Result<Sheet, PrintoutError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let passes: Vec<&Pass> = passes.iter().filter(|pass| pass.plane.bits.iter().any(|&b| b != 0)).collect();
    let mut index = vec![0u8; width * length];
    let mut stacks = vec![Stack::SUBSTRATE];
    let groups = passes.chunks(8).count();
    for (g, passes) in passes.chunks(8).enumerate() {
        let group = Group { passes, width, stride: width.div_ceil(8), first: g == 0 };
        let seen = group.pairs(&index);
        // In the last group the numbers are those of the list given, if any.
        let given = known.filter(|_| g + 1 == groups);
        let mut next = given.map_or_else(|| vec![Stack::SUBSTRATE], <[Stack]>::to_vec);
        let mut numbers: HashMap<Stack, usize> = next.iter().cloned().zip(0..).collect();
        let mut table = vec![0u8; NUMBERS * NUMBERS];
        for pair in (0..seen.len()).filter(|&pair| seen[pair]) {
            let stack = group.on(&stacks[pair / NUMBERS], pair % NUMBERS);
            let number = match numbers.get(&stack) {
                Some(&number) => number,
                None if given.is_some() => return Err(PrintoutError::UnknownStack(stack)),
                None => {
                    numbers.insert(stack.clone(), next.len());
                    next.push(stack);
                    next.len() - 1
                }
            };
            // Beyond a byte the sheet is refused below.
            table[pair] = number as u8;
        }
        if next.len() > NUMBERS {
            return Err(PrintoutError::TooManyStacks(next.len()));
        }
        group.renumber(&mut index, &table);
        stacks = next;
    }
    if let Some(known) = known.filter(|_| groups == 0) {
        stacks = known.to_vec();
    }
    Ok(Sheet::new(paper, stacks, index)?)
}
