//! What a whole cell prints: one stack, or two stacks with half of it each.
//!
//! Problem: the most demanding stack makes the cells of a block larger than the others ask for.
//! Method: a cell with an even side may be cut across or down into halves twice as long as wide, for stacks whose
//! minimum cluster is no larger than a half.

/// The stacks of a cell's halves, by their number in the field. Both are the same where one stack has the whole cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Cell {
    /// The left or upper half, then the other.
    pub(crate) halves: [u8; 2],
    /// Whether the halves lie one above the other.
    pub(crate) stacked: bool,
}

/// Whether half of a cell of this side holds a minimum cluster.
pub(crate) fn fits_half(minimum: u16, size: usize) -> bool {
    size.is_multiple_of(2) && 2 * usize::from(minimum) <= size * size
}

impl Cell {
    /// One stack.
    pub(crate) fn whole(stack: u8) -> Cell {
        Cell { halves: [stack; 2], stacked: false }
    }

    pub(crate) fn is_split(&self) -> bool {
        self.halves[0] != self.halves[1]
    }

    /// The cell whose first dot this is, in rows of `width` dots; `number` is the number of a stack in the field.
    pub(crate) fn read(dots: &[u8], width: usize, size: usize, number: &[u8; 256]) -> Cell {
        let stack = |x: usize, y: usize| number[usize::from(dots[y * width + x])];
        let (first, right, last) = (stack(0, 0), stack(size - 1, 0), stack(size - 1, size - 1));
        Cell { halves: [first, last], stacked: first == right && first != last }
    }

    /// Prints the cell whose first dot this is; `stacks` are the stacks by their number in the field.
    pub(crate) fn print(&self, dots: &mut [u8], width: usize, size: usize, stacks: &[u8]) {
        let [first, last] = self.halves.map(|half| stacks[usize::from(half)]);
        for (y, row) in dots.chunks_mut(width).take(size).enumerate() {
            let (left, right) = row[..size].split_at_mut(size / 2);
            let upper = if y < size / 2 { first } else { last };
            left.fill(if self.stacked { upper } else { first });
            right.fill(if self.stacked { upper } else { last });
        }
    }
}
