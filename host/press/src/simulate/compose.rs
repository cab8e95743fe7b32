//! From passes to stacks: the inks on each dot.
//!
//! Method: eight passes at a time. The stack on a dot after them follows from the stack before (a number) and the passes
//! among the eight that print it (a byte). One walk over the page finds the pairs that occur, each pair gets the number of
//! its stack, and a second walk writes the numbers.
//! Cost: two walks and one byte a dot for each eight passes. The cores share the rows. The numbers depend only on the set
//! of pairs, so they are the same for any number of threads.
//! Limits: at most 256 different stacks after any eight passes, as many as a sheet can hold.

use std::collections::HashMap;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;
use rayon::prelude::*;

use crate::separate::Pass;
use sheet::{Sheet, SheetError};

/// Why a printout cannot become a [`Sheet`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PrintoutError {
    /// Sheets have 600 dpi.
    #[error(
        "the job prints at {across} x {along} dpi, but only a job of 600 x 600 dpi can be read as a sheet"
    )]
    Resolution {
        /// Dots per inch across.
        across: u16,
        /// Dots per inch along.
        along: u16,
    },
    /// More stacks than a sheet can hold.
    #[error("the passes make {0} different stacks on this sheet; a sheet holds at most 256")]
    TooManyStacks(usize),
    /// A dot has a stack that is not in the given list.
    #[error("the printout has dots with stack `{0}`, which is not in the list of stacks")]
    UnknownStack(Stack),
    /// The list of stacks is invalid.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

/// Rows a thread takes at a time.
const BAND: usize = 64;

/// Values of a stack's number, and of a set of eight passes.
const NUMBERS: usize = 256;

/// `SPREAD[byte]` has bit 7 - i of the byte as the lowest bit of its byte i.
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

/// Up to eight passes, with what the walks over their planes need.
struct Group<'a> {
    passes: &'a [&'a Pass],
    width: usize,
    stride: usize,
    /// Whether all dots are still bare.
    first: bool,
}

impl Group<'_> {
    /// Calls `dots(first column, the passes that print each of eight dots)` along row `y`. The first group skips dots that it
    /// does not print.
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

    /// The pairs that occur, as `seen[number * 256 + set]`.
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

    /// A stack plus the inks of a set of these passes on top.
    fn on(&self, below: &Stack, set: usize) -> Stack {
        let above =
            self.passes.iter().enumerate().filter(|(p, _)| set >> p & 1 != 0).map(|(_, pass)| pass.ink);
        Stack::new(below.layers().iter().copied().chain(above).collect::<Vec<Ink>>())
    }
}

/// The sheet that these passes print on `paper`; all planes have the paper's size. Stacks are numbered as in `known`. Without
/// it, the substrate comes first, then the stacks that occur, in the order of the passes that make them.
pub(super) fn sheet(paper: Paper, passes: &[Pass], known: Option<&[Stack]>) -> Result<Sheet, PrintoutError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let passes: Vec<&Pass> = passes.iter().filter(|pass| !pass.plane.is_blank()).collect();
    let mut index = vec![0u8; width * length];
    let mut stacks = vec![Stack::SUBSTRATE];
    let groups = passes.chunks(8).count();
    for (g, passes) in passes.chunks(8).enumerate() {
        let group = Group { passes, width, stride: width.div_ceil(8), first: g == 0 };
        let seen = group.pairs(&index);
        // The last group numbers its stacks as in the given list, if there is one.
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
            // A number of more than a byte is refused below.
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
