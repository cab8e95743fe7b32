//! Passes as stacks: which inks lie on each dot.
//!
//! Method: a first walk over the planes finds which sets of passes occur, the sets get their stack's number, a second
//! walk writes the numbers. Eight dots of eight passes are looked up at a time.
//! Cost: two walks over the planes, one byte a dot. Both walks share the rows among the cores; the numbers follow from
//! the sets alone, so they are the same for any number of threads.

use std::collections::{BTreeSet, HashMap};

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;
use rayon::prelude::*;

use super::printout::PrintoutError;
use crate::separate::Pass;
use crate::sheet::Sheet;

/// Rows a thread takes at a time.
const BAND: usize = 64;

/// More sets than this are not collected: no sheet needs them, and a hostile stream could have one for each dot.
const MOST_SETS: usize = 1 << 16;

/// Up to this many passes the sets index an array.
const DIRECT: usize = 12;

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

/// The passes that print each of the eight dots of one byte, pass p as bit p.
fn sets(rows: &[&[u8]], byte: usize) -> [u32; 8] {
    let mut sets = [0; 8];
    for (group, rows) in rows.chunks(8).enumerate() {
        let mut lanes = 0;
        for (p, row) in rows.iter().enumerate() {
            lanes |= SPREAD[usize::from(row[byte])] << p;
        }
        for (set, lane) in sets.iter_mut().zip(lanes.to_le_bytes()) {
            *set |= u32::from(lane) << (8 * group);
        }
    }
    sets
}

/// Calls `dots(byte, sets)` for every byte of a row in which any pass prints.
fn walk_row(rows: &[&[u8]], stride: usize, mut dots: impl FnMut(usize, [u32; 8])) {
    let mut byte = 0;
    while byte < stride {
        let end = (byte + 8).min(stride);
        // Most of a page is blank in most passes; eight bytes are passed over at once.
        if rows.iter().any(|row| row[byte..end] != [0; 8][..end - byte]) {
            for byte in byte..end {
                let sets = sets(rows, byte);
                if sets != [0; 8] {
                    dots(byte, sets);
                }
            }
        }
        byte = end;
    }
}

/// The sets of passes that occur on the page, but not the empty one.
fn occurring(passes: &[&Pass], length: usize, stride: usize) -> BTreeSet<u32> {
    let bands: Vec<BTreeSet<u32>> = (0..length.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let mut seen = if passes.len() <= DIRECT { vec![false; 1 << passes.len()] } else { Vec::new() };
            let mut found = BTreeSet::new();
            let mut last = 0;
            for y in band * BAND..((band + 1) * BAND).min(length) {
                let rows = rows_at(passes, y, stride);
                walk_row(&rows, stride, |_, sets| {
                    for set in sets {
                        if let Some(seen) = seen.get_mut(set as usize) {
                            *seen = true;
                        } else if set != last && found.len() <= MOST_SETS {
                            last = set;
                            found.insert(set);
                        }
                    }
                });
            }
            found.extend((0..seen.len()).filter(|&set| seen[set]).map(|set| set as u32));
            found.remove(&0);
            found
        })
        .collect();
    bands.into_iter().flatten().collect()
}

fn rows_at<'a>(passes: &[&'a Pass], y: usize, stride: usize) -> Vec<&'a [u8]> {
    passes.iter().map(|pass| &pass.plane.bits[y * stride..(y + 1) * stride]).collect()
}

/// The stack of a set of passes.
fn stack(passes: &[&Pass], set: u32) -> Stack {
    let inks: Vec<Ink> =
        passes.iter().enumerate().filter(|(p, _)| set >> p & 1 != 0).map(|(_, pass)| pass.ink).collect();
    Stack::new(inks)
}

/// The sheet these passes print on `paper`; all planes are the paper's size. Without a list the stacks that occur are
/// numbered by their sets.
pub(super) fn sheet(paper: Paper, passes: &[Pass], stacks: Option<&[Stack]>) -> Result<Sheet, PrintoutError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let stride = width.div_ceil(8);
    // Empty passes would only make the sets longer.
    let passes: Vec<&Pass> = passes.iter().filter(|pass| pass.plane.bits.iter().any(|&b| b != 0)).collect();
    let passes = &passes[..];
    let occurring = occurring(passes, length, stride);
    if occurring.len() > MOST_SETS {
        return Err(PrintoutError::TooManyStacks(occurring.len()));
    }

    let mut list = stacks.map_or_else(|| vec![Stack::SUBSTRATE], <[Stack]>::to_vec);
    let mut numbers: HashMap<Stack, usize> = list.iter().cloned().zip(0..).collect();
    let mut of_set = HashMap::with_capacity(occurring.len());
    for set in occurring {
        let stack = stack(passes, set);
        let number = match numbers.get(&stack) {
            Some(&number) => number,
            None if stacks.is_some() => return Err(PrintoutError::UnknownStack(stack)),
            None => {
                numbers.insert(stack.clone(), list.len());
                list.push(stack);
                list.len() - 1
            }
        };
        of_set.insert(set, number);
    }
    if list.len() > 256 {
        return Err(PrintoutError::TooManyStacks(list.len()));
    }
    // The list has at most 256 entries, so the numbers fit a byte.
    let of_set: HashMap<u32, u8> = of_set.into_iter().map(|(set, number)| (set, number as u8)).collect();
    let mut direct = vec![0u8; if passes.len() <= DIRECT { 1 << passes.len() } else { 0 }];
    for (&set, &number) in &of_set {
        if let Some(place) = direct.get_mut(set as usize) {
            *place = number;
        }
    }

    let mut index = vec![0u8; width * length];
    index.par_chunks_mut(width * BAND).enumerate().for_each(|(band, chunk)| {
        let mut last = (0, 0);
        for (i, line) in chunk.chunks_mut(width).enumerate() {
            let rows = rows_at(passes, band * BAND + i, stride);
            walk_row(&rows, stride, |byte, sets| {
                let start = byte * 8;
                let end = (start + 8).min(width);
                for (dot, set) in line[start..end].iter_mut().zip(sets) {
                    *dot = match direct.get(set as usize) {
                        Some(&number) => number,
                        None if set == last.0 => last.1,
                        None => {
                            // Every set but the empty one has a number; the empty one is the substrate.
                            last = (set, of_set.get(&set).copied().unwrap_or(0));
                            last.1
                        }
                    };
                }
            });
        }
    });
    Ok(Sheet::new(paper, list, index)?)
}
