//! Camera marks: small square patterns at the corners of a print that say to a camera which sheet and which corner they are.
//!
//! Problem: a photograph must be laid over the sheet to a tenth of a millimetre, and one of another sheet must be refused.
//! Method: a mark is a dark frame around 6 x 6 cells on bare paper. Its number is 256 times its corner plus one byte of the
//! sheet's fingerprint, another byte at each corner, so three marks tell 16 million sheets apart. Numbers are written in a
//! dictionary of 1024 patterns: drawn by a fixed generator, each kept if it differs from all others and from itself in
//! every quarter turn in at least [`DISTANCE`] cells. Idea of such dictionaries: Garrido-Jurado et al., Pattern Recognition 47
//! (2014); this dictionary is our own. Cost: some milliseconds, once. Limits: the fingerprint is of what is laid out, so sheets
//! that differ only in their layout are alike.

use std::sync::LazyLock;

use crate::split_mix;
use sheet::DotMap;

/// Cells along a side, the frame included.
pub const CELLS: usize = 8;
/// Cells along a side of the pattern.
const INNER: usize = CELLS - 2;
/// Side of a cell in 1/600 inch: 1.27 mm.
pub const CELL: usize = 30;
/// Side of a mark in 1/600 inch: 10.2 mm.
pub const SIDE: usize = CELLS * CELL;
/// Bare paper around a mark in 1/600 inch: as wide as a cell and a half.
pub const QUIET: usize = CELL + CELL / 2;
/// Marks of a sheet: top left, top right, bottom left, bottom right.
pub const CORNERS: usize = 4;
/// Cells in which any two patterns differ, turned or not.
pub const DISTANCE: u32 = 9;
/// Cells that may be read wrongly. More could be mended, but this keeps chance squares out: one in 25 000 reads as a mark.
const MENDED: u32 = 2;

/// The patterns by number. A set bit is a dark cell; bit 0 is the top left, rows follow each other.
static PATTERNS: LazyLock<Vec<u64>> = LazyLock::new(|| {
    let mut found: Vec<u64> = Vec::with_capacity(256 * CORNERS);
    let mut tried = 0;
    while found.len() < 256 * CORNERS {
        let bits = split_mix::nth(0x0f01_1b9e_5500, tried) & ((1 << (INNER * INNER)) - 1);
        tried += 1;
        // Even patches say little about where cells are.
        if !(12..=24).contains(&bits.count_ones()) {
            continue;
        }
        let turns = turns(bits);
        let far = |other: u64| (bits ^ other).count_ones() >= DISTANCE;
        if turns[1..].iter().all(|&turned| far(turned))
            && found.iter().all(|&known| turns.iter().all(|turned| (turned ^ known).count_ones() >= DISTANCE))
        {
            found.push(bits);
        }
    }
    found
});

/// A pattern and its turns, each a quarter to the right of the one before.
fn turns(bits: u64) -> [u64; 4] {
    let mut all = [bits; 4];
    for i in 1..4 {
        let before = all[i - 1];
        all[i] = (0..INNER * INNER).fold(0, |turned, at| {
            let (x, y) = (at % INNER, at / INNER);
            // What comes to (x, y) was at (y, INNER - 1 - x).
            turned | ((before >> ((INNER - 1 - x) * INNER + y)) & 1) << at
        });
    }
    all
}

/// What a mark says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// Its corner: 0 to 3.
    pub corner: u8,
    /// The byte of the sheet's fingerprint that belongs to this corner.
    pub byte: u8,
}

impl Name {
    /// Whether a cell is dark, counted from the top left corner of the mark, the frame included.
    pub fn is_dark(self, x: usize, y: usize) -> bool {
        let inner = 1..CELLS - 1;
        if !inner.contains(&x) || !inner.contains(&y) {
            return true;
        }
        let pattern = PATTERNS[256 * usize::from(self.corner % CORNERS as u8) + usize::from(self.byte)];
        pattern >> ((y - 1) * INNER + x - 1) & 1 == 1
    }

    /// Reads the inner cells of a mark, whose bits are numbered as those of a pattern. Returns the mark and by how many quarter turns to
    /// the right it was seen turned.
    pub fn read(bits: u64) -> Option<(Name, usize)> {
        let turns = turns(bits);
        PATTERNS.iter().enumerate().find_map(|(number, &pattern)| {
            // Turning what was seen further until it is upright.
            let turn = turns.iter().position(|turned| (turned ^ pattern).count_ones() <= MENDED)?;
            Some((Name { corner: (number / 256) as u8, byte: (number % 256) as u8 }, (4 - turn) % 4))
        })
    }
}

/// The marks of a sheet with these dots laid out on it: Fowler, Noll and Vo's hash (1a, 64 bits), folded to a byte a corner.
pub fn names(dots: &DotMap) -> [Name; CORNERS] {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        for &byte in bytes {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    add(&(dots.width() as u64).to_le_bytes());
    for stack in dots.stacks() {
        add(stack.to_string().as_bytes());
        add(b",");
    }
    add(dots.index());
    let folded = (hash ^ (hash >> 32)) as u32;
    std::array::from_fn(|corner| Name { corner: corner as u8, byte: folded.to_le_bytes()[corner] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Stack;
    use proptest::prelude::*;
    use protocol::ink::Ink;

    /// Cell by cell, with nothing shared with `turns`.
    fn turned(cells: [[bool; INNER]; INNER]) -> [[bool; INNER]; INNER] {
        std::array::from_fn(|y| std::array::from_fn(|x| cells[INNER - 1 - x][y]))
    }

    fn cells(name: Name) -> [[bool; INNER]; INNER] {
        std::array::from_fn(|y| std::array::from_fn(|x| name.is_dark(x + 1, y + 1)))
    }

    fn bits(cells: [[bool; INNER]; INNER]) -> u64 {
        cells.iter().flatten().enumerate().fold(0, |bits, (i, &dark)| bits | u64::from(dark) << i)
    }

    #[test]
    fn any_two_marks_differ_in_nine_cells_however_they_are_turned() {
        let upright: Vec<u64> = PATTERNS.clone();
        let all: Vec<(usize, u64)> = (0..1024usize)
            .flat_map(|i| {
                let mut now = cells(Name { corner: (i / 256) as u8, byte: (i % 256) as u8 });
                (0..4).map(move |_| {
                    let bits = bits(now);
                    now = turned(now);
                    (i, bits)
                })
            })
            .collect();
        let least = upright
            .iter()
            .enumerate()
            .flat_map(|(i, a)| {
                all.iter()
                    .enumerate()
                    .filter(move |(at, _)| *at != 4 * i)
                    .map(move |(_, (_, b))| (a ^ b).count_ones())
            })
            .min();
        assert_eq!(least, Some(DISTANCE));
    }

    proptest! {
        /// A mark is read whichever way it lies, with two cells wrong, and random squares hardly ever.
        #[test]
        fn marks_are_read_in_any_turn_with_two_cells_wrong(
            corner in 0u8..4, byte: u8, turn in 0usize..4, wrong in prop::array::uniform2(0usize..36),
        ) {
            let name = Name { corner, byte };
            let mut now = cells(name);
            for _ in 0..turn {
                now = turned(now);
            }
            let seen = wrong.iter().fold(bits(now), |bits, at| bits ^ (1 << at));
            prop_assert_eq!(Name::read(seen), Some((name, turn)));
        }
    }

    #[test]
    fn chance_squares_are_hardly_ever_marks() {
        let mut state = 7u64;
        let read = (0..100_000)
            .filter(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                Name::read(state >> 28).is_some()
            })
            .count();
        assert!(read < 12, "{read} of 100 000");
    }

    #[test]
    fn one_dot_makes_another_sheet() {
        let stacks = vec![Stack::SUBSTRATE, Stack::new([Ink::Black])];
        let mut index = vec![0; 600];
        let one = names(&DotMap::new(30, 20, stacks.clone(), index.clone()).unwrap());
        index[77] = 1;
        let other = names(&DotMap::new(30, 20, stacks.clone(), index.clone()).unwrap());
        assert_ne!(one, other);
        assert_ne!(other, names(&DotMap::new(20, 30, stacks, index).unwrap()));
    }
}
