//! The classes of a picture's pixels, and the classes around each.
//!
//! Problem: whether a pixel is an edge depends on the 24 pixels around it. A page has thirty million pixels, and nearly all
//! of them are plainly paper or plainly part of a photograph.
//! Method: rows are searched in blocks. A block is skipped if no pixel in it is a candidate, or if it and the blocks around it
//! have nothing but plain colour. Cost: 1 ns a pixel in skipped blocks, 10 ns for each candidate.

use rayon::prelude::*;

/// Class of bare paper. Other classes are places in the list of reserved colours, which must begin at 1, or
/// [`OTHER`].
pub(super) const PAPER: u8 = 0;
/// Class of all colours that are not reserved.
pub(super) const OTHER: u8 = u8::MAX;
/// Marks the class of a pixel that may be the edge of two others. [`OTHER`] has it. The highest bit, so that
/// places in the list have the others.
pub(super) const LOOSE: u8 = 0x80;

/// Pixels in a block.
pub(super) const BLOCK: usize = 64;

/// The classes of a picture's pixels, row by row.
pub(super) struct Classes {
    pub of: Vec<u8>,
    pub width: usize,
}

impl Classes {
    /// Collects changes of class. `change` gets the class and place of every pixel whose class satisfies `asked`, and
    /// returns its new class.
    ///
    /// Pixels of class [`OTHER`] are skipped if all pixels within two pixels of them are [`OTHER`] as well.
    pub fn changes(
        &self,
        asked: impl Fn(u8) -> bool + Sync,
        change: impl Fn(u8, usize) -> Option<u8> + Sync,
    ) -> Vec<(usize, u8)> {
        let blocks = self.width.div_ceil(BLOCK);
        let busy: Vec<bool> = self
            .of
            .par_chunks(self.width)
            .flat_map_iter(|row| {
                row.chunks(BLOCK).map(|block| block.iter().fold(OTHER, |a, &b| a & b) != OTHER)
            })
            .collect();
        let busy = |y: usize, block: usize| {
            let rows = busy.chunks_exact(blocks).skip(y.saturating_sub(2)).take(y.min(2) + 3);
            rows.flat_map(|row| &row[block.saturating_sub(1)..(block + 2).min(blocks)]).any(|&busy| busy)
        };
        self.of
            .par_chunks(self.width)
            .enumerate()
            .flat_map_iter(|(y, row)| {
                let (asked, change, busy) = (&asked, &change, &busy);
                row.chunks(BLOCK)
                    .enumerate()
                    .filter(move |(block, classes)| {
                        classes.iter().fold(false, |any, &class| any | asked(class)) && busy(y, *block)
                    })
                    .flat_map(move |(block, classes)| {
                        let at = y * self.width + block * BLOCK;
                        (at..).zip(classes).filter(|(_, class)| asked(**class))
                    })
                    .filter_map(move |(at, &class)| Some((at, change(class, at)?)))
            })
            .collect()
    }

    /// Applies changes.
    pub fn apply(&mut self, changes: &[(usize, u8)]) {
        changes.iter().for_each(|&(at, class)| self.of[at] = class);
    }

    /// Whether a pixel belongs to a square of four pixels of its class.
    pub fn in_a_square(&self, at: usize) -> bool {
        let (x, y) = (at % self.width, at / self.width);
        let same = |x: usize, y: usize| self.at(x, y) == Some(self.of[at]);
        let beside = [x.wrapping_sub(1), x + 1];
        let beyond = [y.wrapping_sub(1), y + 1];
        beside.into_iter().any(|u| same(u, y) && beyond.into_iter().any(|v| same(x, v) && same(u, v)))
    }

    /// Whether a pixel belongs to a square of nine pixels of its class.
    pub fn in_three(&self, at: usize) -> bool {
        let (x, y) = (at % self.width, at / self.width);
        let is_whole = |left: usize, top: usize| {
            (0..9).all(|place| {
                let (u, v) = (left.wrapping_add(place % 3), top.wrapping_add(place / 3));
                self.at(u, v) == Some(self.of[at])
            })
        };
        (0..9).any(|place| is_whole(x.wrapping_sub(place % 3), y.wrapping_sub(place / 3)))
    }

    /// Whether all four pixels beside a pixel are of other classes.
    pub fn is_alone(&self, at: usize) -> bool {
        let (x, y) = (at % self.width, at / self.width);
        let beside = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        let own = self.of[at] | LOOSE;
        !beside.into_iter().any(|(u, v)| self.at(u, v).is_some_and(|class| class | LOOSE == own))
    }

    /// The classes within two pixels, as bits; those marked [`LOOSE`] are left out.
    pub fn around(&self, at: usize) -> u32 {
        let (x, y) = (at % self.width, at / self.width);
        let rows = self.of.chunks_exact(self.width).skip(y.saturating_sub(2)).take(y.min(2) + 3);
        rows.flat_map(|row| &row[x.saturating_sub(2)..(x + 3).min(self.width)])
            .filter(|&&class| class < LOOSE)
            .fold(0, |seen, &class| seen | 1 << class)
    }

    fn at(&self, x: usize, y: usize) -> Option<u8> {
        // Places before the first row or column have wrapped around to the largest numbers.
        let inside = x < self.width && y < self.of.len() / self.width;
        inside.then(|| self.of[y * self.width + x])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_is_passed_over_that_has_a_colour_around_it(
            width in 1usize..200,
            length in 1usize..12,
            drawn in prop::collection::vec((any::<u16>(), 0u8..3), 0..5),
        ) {
            let mut classes = Classes { of: vec![OTHER; width * length], width };
            for &(at, class) in &drawn {
                classes.of[usize::from(at) % (width * length)] = class;
            }
            let asked = classes.changes(|class| class != 1, |_, _| Some(0));
            prop_assert!(asked.iter().all(|&(at, _)| classes.of[at] != 1));
            for at in (0..width * length).filter(|&at| classes.of[at] != 1) {
                let near = |&other: &usize| {
                    (at % width).abs_diff(other % width) <= 2 && (at / width).abs_diff(other / width) <= 2
                };
                let seen = (0..width * length).filter(near).map(|other| classes.of[other]);
                let seen = seen.filter(|&class| class != OTHER).fold(0, |seen, class| seen | 1 << class);
                prop_assert_eq!(classes.around(at), seen);
                prop_assert!(seen == 0 || asked.binary_search(&(at, 0)).is_ok(), "{} sees {}", at, seen);
            }
        }
    }
}
