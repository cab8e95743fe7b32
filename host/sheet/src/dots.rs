//! A map of dots: which stack lies on each dot of a rectangle.

use inks::Stack;
use rayon::prelude::*;

/// One stack for every dot of a rectangle at 600 dpi, by number. Stack 0 is the bare substrate: its dots are the
/// surroundings of what is printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DotMap {
    width: usize,
    length: usize,
    stacks: Vec<Stack>,
    index: Vec<u8>,
}

/// Why numbers are not a dot map.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SheetError {
    /// There are no dots, or the index does not fill the rectangle.
    #[error("a map of {width} x {length} dots needs {} values, not {found}", width.saturating_mul(*length))]
    Size {
        /// Dots across.
        width: usize,
        /// Rows.
        length: usize,
        /// Values given.
        found: usize,
    },
    /// The first stack must be the substrate, stacks must differ, and there can be 256 at most.
    #[error("stack {index} (`{stack}`): the substrate comes first, then at most 255 different stacks")]
    Stacks {
        /// Position in the list.
        index: usize,
        /// The stack.
        stack: Stack,
    },
    /// A dot names a stack that is not in the list.
    #[error("dot ({x}, {y}) has stack number {stack}, but there are only {stacks}")]
    Index {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The number found.
        stack: u8,
        /// How many stacks there are.
        stacks: usize,
    },
}

/// Whether a dot map can have these stacks: the substrate first, at most 256, all different.
pub fn check_stacks(stacks: &[Stack]) -> Result<(), SheetError> {
    for (i, stack) in stacks.iter().enumerate() {
        if (i == 0) != stack.layers().is_empty() || i > 255 || stacks[..i].contains(stack) {
            return Err(SheetError::Stacks { index: i, stack: stack.clone() });
        }
    }
    if stacks.is_empty() {
        return Err(SheetError::Stacks { index: 0, stack: Stack::SUBSTRATE });
    }
    Ok(())
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
        let counted = self.index.par_chunks(1 << 20).map(|dots| census([dots].into_iter()));
        let all = counted.reduce(|| [0; 256], |a, b| std::array::from_fn(|stack| a[stack] + b[stack]));
        all[..self.stacks.len()].to_vec()
    }
}

/// How many dots of these rows each stack has.
pub fn census<'a>(rows: impl Iterator<Item = &'a [u8]>) -> [u64; 256] {
    // Neighbours are alike: four tables keep their counts from waiting for each other.
    let mut counts = [[0u64; 256]; 4];
    let mut bare = 0;
    for row in rows {
        let (blocks, rest) = row.as_chunks::<16>();
        for block in blocks {
            // Most dots are bare.
            if *block == [0; 16] {
                bare += 16;
                continue;
            }
            for quad in block.as_chunks::<4>().0 {
                for (count, &dot) in counts.iter_mut().zip(quad) {
                    count[usize::from(dot)] += 1;
                }
            }
        }
        for &dot in rest {
            counts[0][usize::from(dot)] += 1;
        }
    }
    counts[0][0] += bare;
    std::array::from_fn(|stack| counts.iter().map(|count| count[stack]).sum())
}
