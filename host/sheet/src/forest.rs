//! Sets of numbers that are joined one after the other: union-find.
//!
//! Problem: what touches belongs together, but that is found pair by pair.
//! Method: every number knows an older one of its set; the oldest is the root and stands for all. Paths are halved
//! whenever they are followed (Tarjan and van Leeuwen 1984).
//! Cost: a few nanoseconds a step, paths hardly longer than one. Memory: 4 bytes a number.

use std::ops::Range;

/// The dots beside a stretch of a row, above, below and at both ends; the numbers of some below may be beyond the image.
pub fn beside(stretch: Range<usize>, width: usize) -> impl Iterator<Item = usize> {
    let left = (!stretch.start.is_multiple_of(width)).then(|| stretch.start - 1);
    let right = (!stretch.end.is_multiple_of(width)).then_some(stretch.end);
    let lines = stretch.flat_map(move |at| [at.checked_sub(width), Some(at + width)]);
    lines.chain([left, right]).flatten()
}

/// Numbers from 0 on, and the sets they are in.
#[derive(Default)]
pub struct Forest {
    parent: Vec<u32>,
}

impl Forest {
    /// So many numbers, each by itself.
    pub fn new(count: usize) -> Forest {
        Forest { parent: (0..count as u32).collect() }
    }

    /// Adds the next number, by itself.
    pub fn add(&mut self) -> u32 {
        let number = self.parent.len() as u32;
        self.parent.push(number);
        number
    }

    /// The root of a number's set, its lowest number.
    pub fn root(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            let up = self.parent[self.parent[at as usize] as usize];
            self.parent[at as usize] = up;
            at = up;
        }
        at
    }

    /// Makes one set of those of two numbers. Returns the roots of both before if they were two, the one that stays first.
    pub fn join(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.root(a), self.root(b));
        let (stays, goes) = (a.min(b), a.max(b));
        self.parent[goes as usize] = stays;
        (stays < goes).then_some((stays, goes))
    }

    /// Stretches of an image's rows, of which those are joined that touch above each other or end to end and belong `together`. The
    /// `stretches` are ranges of its dots in order; none crosses from row to row.
    pub fn of_stretches(
        stretches: &[Range<usize>],
        width: usize,
        together: impl Fn(usize, usize) -> bool,
    ) -> Forest {
        let mut sets = Forest::new(stretches.len());
        let mut above = 0;
        for (at, stretch) in stretches.iter().enumerate() {
            let beside = at.checked_sub(1).filter(|&other| {
                stretches[other].end == stretch.start && !stretch.start.is_multiple_of(width)
            });
            while stretches[above].end + width <= stretch.start {
                above += 1;
            }
            let over = (above..at).take_while(|&other| stretches[other].start + width < stretch.end);
            for other in over.chain(beside).filter(|&other| together(at, other)) {
                sets.join(at as u32, other as u32);
            }
        }
        sets
    }

    /// The root of each number.
    pub fn roots(mut self) -> Vec<u32> {
        // Roots come before what belongs to them.
        for at in 0..self.parent.len() {
            self.parent[at] = self.parent[self.parent[at] as usize];
        }
        self.parent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn stretches_that_touch_are_joined(width in 1usize..12, cells in prop::collection::vec(0u8..4, 1..150)) {
            // Stretches of one letter; those of 1 and 2 belong together, none to 3.
            let cells = &cells[..cells.len() / width * width];
            let mut stretches: Vec<Range<usize>> = Vec::new();
            for at in (0..cells.len()).filter(|&at| cells[at] > 0) {
                match stretches.last_mut() {
                    Some(last) if last.end == at && at % width > 0 && cells[at] == cells[last.start] => last.end += 1,
                    _ => stretches.push(at..at + 1),
                }
            }
            let together = |a: u8, b: u8| a == b || a + b == 3;
            let of = |at: usize| cells[stretches[at].start];
            let roots = Forest::of_stretches(&stretches, width, |a, b| together(of(a), of(b))).roots();
            // By spreading numbers from dot to neighbour.
            let mut number: Vec<usize> = (0..cells.len()).collect();
            let mut changed = true;
            while std::mem::take(&mut changed) {
                for at in 0..cells.len() {
                    let right = (at % width + 1 < width).then_some(at + 1);
                    for next in [right, Some(at + width)].into_iter().flatten().filter(|&next| next < cells.len()) {
                        if cells[at].min(cells[next]) > 0 && together(cells[at], cells[next]) {
                            let least = number[at].min(number[next]);
                            changed |= number[at] != least || number[next] != least;
                            (number[at], number[next]) = (least, least);
                        }
                    }
                }
            }
            for a in 0..stretches.len() {
                for b in 0..a {
                    let same = number[stretches[a].start] == number[stretches[b].start];
                    prop_assert_eq!(roots[a] == roots[b], same, "{} {}", a, b);
                }
            }
        }
    }
}
