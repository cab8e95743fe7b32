//! The tile under way: dots in the order of the walk on one side, rows of the band on the other.
//!
//! Problem: a microcontroller has some thirty clock cycles for every dot of the page, including those without ink, and
//! setting a single dot costs a dozen. Method: runs are filled into a line of 4096 bits, a word at a time, and a complete
//! tile is then laid out in the band. In a full tile, sixteen consecutive dots are a square of four by four, walked in one
//! of four ways, so four look-ups turn sixteen bits of the line into four nibbles of four rows. The rows of the tile are then
//! shifted to its place in the band, which may begin at any column. Tiles of other sizes, which occur only at the right
//! and lower edges of a picture and around it, are laid out dot by dot from a table of their own.
//!
//! Cost: three operations a dot where there is ink, none for words without; 16 KB for two tables, 1.5 KB for the
//! order of the squares. Limits: those of the walk.

use crate::walk::{EDGE, MOST, Orientation, Tile};

/// Squares in a full tile.
const SQUARES: usize = MOST / 16;

/// The four ways in which a curve goes through a square: from top left to bottom left, from top left to top right, and
/// both turned by half a circle. Each the order in which it visits row * 4 + column.
const WAYS: [[u8; 16]; 4] = [
    [0, 4, 5, 1, 2, 3, 7, 6, 10, 11, 15, 14, 13, 9, 8, 12],
    [0, 1, 5, 4, 8, 12, 13, 9, 10, 14, 15, 11, 7, 6, 2, 3],
    [15, 11, 10, 14, 13, 12, 8, 9, 5, 4, 0, 1, 2, 6, 7, 3],
    [15, 14, 10, 11, 7, 3, 2, 6, 5, 1, 0, 4, 8, 9, 13, 12],
];

/// For each way, for each quarter of sixteen bits and each value of it: the square, its first row in the top nibble.
static LAID: [[[u16; 16]; 4]; 4] = laid();

const fn laid() -> [[[u16; 16]; 4]; 4] {
    let mut laid = [[[0; 16]; 4]; 4];
    // A counter for each of the 4 x 16 x 16 bits: constant functions have no iterators.
    let mut i = 0;
    while i < 4 * 16 * 16 {
        let (way, dot, value) = (i / 256, i / 16 % 16, i % 16);
        if value >> (3 - dot % 4) & 1 == 1 {
            laid[way][dot / 4][value] |= 0x8000 >> WAYS[way][dot];
        }
        i += 1;
    }
    laid
}

/// Words of the line that are laid out dot by dot before others may run: a thousand dots.
const PORTION: usize = 32;

/// The result of [`Canvas::lay`].
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum TileProgress {
    /// There was nothing to lay out.
    Blank,
    /// There is more: call it again, and ink nothing in between.
    Part,
    /// The tile is laid out.
    Whole,
}

/// Where a square of a full tile is and how it is walked.
#[derive(Clone, Copy)]
struct Square {
    /// Row and column of the square within the tile, in squares: four bits each.
    place: u8,
    way: u8,
}

pub(super) struct Canvas {
    /// Dots of the tile along the walk, the first in the top bit.
    line: [u32; MOST / 32],
    /// Words of the line that are not all zero lie within these.
    used: (usize, usize),
    /// Squares of full tiles by orientation, once there has been one.
    squares: [Option<[Square; SQUARES]>; 3],
    /// The dots of the last tiles of other sizes: a band has at most one that is left at the bottom, and another.
    tables: [Table; 2],
}

/// The dots of a tile along the walk, `row * 64 + column` each.
struct Table {
    shape: Option<Tile>,
    dots: [u16; MOST],
}

const UNUSED: (usize, usize) = (MOST / 32, 0);

impl Canvas {
    pub(super) fn new() -> Canvas {
        Canvas {
            line: [0; MOST / 32],
            used: UNUSED,
            squares: [None; 3],
            tables: [Table { shape: None, dots: [0; MOST] }, Table { shape: None, dots: [0; MOST] }],
        }
    }

    /// Drops what has not been laid out.
    pub(super) fn clear(&mut self) {
        self.line.fill(0);
        self.used = UNUSED;
    }

    /// Inks dots `from..to` along the walk; `from < to`, and `to` is at most [`MOST`].
    pub(super) fn ink(&mut self, from: u32, to: u32) {
        let (first, last) = ((from / 32) as usize, ((to - 1) / 32) as usize);
        let (head, tail) = (u32::MAX >> (from % 32), u32::MAX << (31 - (to - 1) % 32));
        if first == last {
            self.line[first] |= head & tail;
        } else {
            self.line[first] |= head;
            self.line[first + 1..last].fill(u32::MAX);
            self.line[last] |= tail;
        }
        self.used = (self.used.0.min(first), self.used.1.max(last + 1));
    }

    /// Lays the tile out in rows of `stride` bytes, starting with its first row, and begins the next tile. A tile that takes
    /// long is laid out only in part. Its place must be blank.
    pub(super) fn lay(&mut self, tile: &Tile, rows: &mut [u8], stride: usize) -> TileProgress {
        let (first, end) = self.used;
        if first >= end {
            return TileProgress::Blank;
        }
        if (tile.w, tile.h) != (EDGE, EDGE) {
            return self.lay_dots(tile, rows, stride);
        }
        self.used = UNUSED;
        let mut dots = [[0; 2]; EDGE as usize];
        if self.line.iter().all(|&word| word == u32::MAX) {
            dots.fill([u32::MAX; 2]);
            self.line.fill(0);
        } else {
            self.lay_squares(tile.orientation, first..end, &mut dots);
        }
        let (at, shift) = (usize::from(tile.x / 8), u32::from(tile.x % 8));
        for (row, &[left, right]) in rows.chunks_exact_mut(stride).zip(&dots) {
            if left | right != 0 {
                put(left, right, shift, &mut row[at..]);
            }
        }
        TileProgress::Whole
    }

    fn lay_squares(
        &mut self,
        orientation: Orientation,
        words: core::ops::Range<usize>,
        rows: &mut [[u32; 2]; EDGE as usize],
    ) {
        let squares = self.squares[orientation as usize].get_or_insert_with(|| squares(orientation));
        let pairs = squares.chunks_exact(2).zip(&mut self.line);
        for (pair, word) in pairs.take(words.end).skip(words.start) {
            let word = core::mem::take(word);
            for (square, bits) in pair.iter().zip([word >> 16, word & 0xffff]) {
                if bits == 0 {
                    continue;
                }
                let laid = &LAID[usize::from(square.way % 4)];
                let nibble = |shift: u32| (bits >> shift & 15) as usize;
                let dots = u32::from(
                    laid[0][nibble(12)] | laid[1][nibble(8)] | laid[2][nibble(4)] | laid[3][nibble(0)],
                );
                let (row, column) = (usize::from(square.place >> 4), usize::from(square.place & 15));
                // Eight squares to a word.
                let (word, shift) = (column / 8, 28 - column % 8 * 4);
                for (row, from) in rows[row * 4..row * 4 + 4].iter_mut().zip([12, 8, 4, 0]) {
                    row[word] |= (dots >> from & 15) << shift;
                }
            }
        }
    }

    /// Makes the table if it is another tile's, or lays out a portion of the line.
    fn lay_dots(&mut self, tile: &Tile, rows: &mut [u8], stride: usize) -> TileProgress {
        // The way back is the way along, turned by half a circle.
        let (orientation, turned) = match tile.orientation {
            Orientation::Back => (Orientation::Along, Some((tile.h - 1) * EDGE + tile.w - 1)),
            orientation => (orientation, None),
        };
        let table = &mut self.tables[usize::from(orientation == Orientation::Down)];
        let shape = Tile { x: 0, y: 0, orientation, ..*tile };
        if table.shape != Some(shape) {
            shape.fill(&mut table.dots);
            table.shape = Some(shape);
            return TileProgress::Part;
        }
        let (first, end) = self.used;
        let until = end.min(first + PORTION);
        let words = table.dots.chunks_exact(32).zip(&mut self.line);
        for (dots, word) in words.take(until).skip(first) {
            let mut word = core::mem::take(word);
            let mut dots = dots.iter();
            while word != 0
                && let Some(&dot) = dots.next()
            {
                if word >> 31 == 1 {
                    let dot = turned.map_or(dot, |last| last - dot);
                    let x = usize::from(tile.x + dot % EDGE);
                    rows[usize::from(dot / EDGE) * stride + x / 8] |= 0x80 >> (x % 8);
                }
                word <<= 1;
            }
        }
        if until < end {
            self.used = (until, end);
            return TileProgress::Part;
        }
        self.used = UNUSED;
        TileProgress::Whole
    }
}

/// Puts 64 dots into a row, beginning at bit `shift` (0 to 7) of its first byte. Only the first and the last byte are shared with
/// other tiles.
#[expect(clippy::cast_possible_truncation, reason = "bytes of words")]
fn put(left: u32, right: u32, shift: u32, row: &mut [u8]) {
    if shift == 0 {
        if let Some(row) = row.first_chunk_mut::<8>() {
            row[..4].copy_from_slice(&left.to_be_bytes());
            row[4..].copy_from_slice(&right.to_be_bytes());
        }
    } else if let Some(row) = row.first_chunk_mut::<9>() {
        let middle = left << (32 - shift) | right >> shift;
        let left = left >> shift;
        row[0] |= (left >> 24) as u8;
        (row[1], row[2], row[3]) = ((left >> 16) as u8, (left >> 8) as u8, left as u8);
        row[4..8].copy_from_slice(&middle.to_be_bytes());
        row[8] |= (right << (8 - shift)) as u8;
    }
}

/// The squares of a full tile. The curve is the same at every scale: through a tile of half the size it visits the
/// quarters of the squares, so four dots of it tell where a square is and how it is walked.
fn squares(orientation: Orientation) -> [Square; SQUARES] {
    const HALF: u16 = EDGE / 2;
    let mut dots = [0; SQUARES * 4];
    Tile { x: 0, y: 0, w: HALF, h: HALF, orientation }.fill(&mut dots);
    let mut squares = [Square { place: 0, way: 0 }; SQUARES];
    for (square, quarters) in squares.iter_mut().zip(dots.chunks_exact(4)) {
        let (x, y, end) = (quarters[0] % EDGE, quarters[0] / EDGE, quarters[3] % EDGE);
        #[expect(clippy::cast_possible_truncation, reason = "squares are counted from 0 to 15 either way")]
        let place = (y / 2 * 16 + x / 2) as u8;
        square.place = place;
        // It begins at the top left or the bottom right, and ends in the same column or in the same row.
        square.way = match (x % 2, x == end) {
            (0, true) => 0,
            (0, false) => 1,
            (_, true) => 2,
            (_, false) => 3,
        };
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_dots_of_a_full_tile_are_a_square_walked_in_one_of_four_ways() {
        for orientation in [Orientation::Along, Orientation::Down, Orientation::Back] {
            let tile = Tile { x: 0, y: 0, w: EDGE, h: EDGE, orientation };
            let mut table = [0; MOST];
            tile.fill(&mut table);
            for (square, dots) in squares(orientation).iter().zip(table.chunks_exact(16)) {
                for (&dot, &place) in dots.iter().zip(&WAYS[usize::from(square.way)]) {
                    let row = u16::from(square.place >> 4) * 4 + u16::from(place / 4);
                    let column = u16::from(square.place & 15) * 4 + u16::from(place % 4);
                    assert_eq!(dot, row * EDGE + column);
                }
            }
        }
    }
}
