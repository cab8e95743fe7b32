//! A map of dots: which stack lies on each dot of a rectangle.

use inks::Stack;
use rayon::prelude::*;

use super::{SheetError, check_stacks};

/// One stack for every dot of a rectangle at 600 dpi, by number. Stack 0 is the bare substrate: its dots are the
/// surroundings of what is printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DotMap {
    width: usize,
    length: usize,
    stacks: Vec<Stack>,
    index: Vec<u8>,
}

impl DotMap {
    /// A map of `width` dots across and `length` rows from the stack number of every dot, row by row from the top.
    ///
    /// # Errors
    /// No dots, another number of dots than the sides give, stacks that do not begin with the substrate or are not all
    /// different, or a number without a stack.
    pub fn new(
        width: usize,
        length: usize,
        stacks: Vec<Stack>,
        index: Vec<u8>,
    ) -> Result<DotMap, SheetError> {
        if Some(index.len()) != width.checked_mul(length) || index.is_empty() {
            return Err(SheetError::Size { width, length, found: index.len() });
        }
        check_stacks(&stacks)?;
        // Branch-free over the map first; only a bad one is searched for its dot.
        if usize::from(index.iter().copied().max().unwrap_or(0)) >= stacks.len()
            && let Some(dot) = index.iter().position(|&s| usize::from(s) >= stacks.len())
        {
            let stack = index[dot];
            return Err(SheetError::Index { x: dot % width, y: dot / width, stack, stacks: stacks.len() });
        }
        Ok(DotMap { width, length, stacks, index })
    }

    /// Dots across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The stacks; number 0 is the bare substrate.
    pub fn stacks(&self) -> &[Stack] {
        &self.stacks
    }

    /// The stack number of every dot, row by row.
    pub fn index(&self) -> &[u8] {
        &self.index
    }

    /// The stacks and the stack number of every dot.
    pub fn into_parts(self) -> (Vec<Stack>, Vec<u8>) {
        (self.stacks, self.index)
    }

    /// How many dots each stack has.
    pub fn census(&self) -> Vec<u64> {
        let counted = self.index.par_chunks(1 << 20).map(|dots| {
            // Neighbours are alike: four tables keep their counts from waiting for each other.
            let mut counts = [[0u32; 256]; 4];
            let quads = dots.chunks_exact(4);
            for &dot in quads.remainder() {
                counts[0][usize::from(dot)] += 1;
            }
            for quad in quads {
                for (count, &dot) in counts.iter_mut().zip(quad) {
                    count[usize::from(dot)] += 1;
                }
            }
            (0..self.stacks.len()).map(|i| counts.iter().map(|c| u64::from(c[i])).sum()).collect::<Vec<u64>>()
        });
        let none = || vec![0; self.stacks.len()];
        counted.reduce(none, |a, b| a.into_iter().zip(b).map(|(a, b)| a + b).collect())
    }
}
