//! The order in which the dots of a rectangle are visited: bands of at most 64 rows, tiles within a band, a
//! space-filling curve within a tile.
//!
//! Problem: error diffusion with a hard minimum cluster needs an order of all dots in which every step goes to a
//! 4-neighbour, so that a run of c dots is a connected cluster of c dots. A microcontroller must be able to rebuild the
//! image from that order with one band in memory.
//!
//! Method: even bands run left to right, odd bands right to left. With a band's height even, a tile of even
//! width entered at its top left can leave at its top right ([`Orientation::Along`]); the rightmost tile, of any
//! width, leaves at its bottom left instead ([`Orientation::Down`]). The band below enters there, at the top left of its
//! own rightmost tile, leaves that at the bottom left, and goes back along the bottom row
//! ([`Orientation::Back`]), to step straight down into the next even band. A path over a rectangle between two
//! corners of one side exists only if that side is even or both sides are odd (colour the dots like a
//! chessboard), hence the rules: only the last band may have odd height, and then it runs left to right, so
//! that an odd height makes an odd number of bands. Rests narrower than 32 are shared with their neighbours,
//! so no tile is needlessly thin.
//!
//! Within a tile the curve is the generalised Hilbert curve: a rectangle is cut across its long side into two
//! in a row, or into three, up, across and down, so that every cut length that must be even is even.
//! A tile of 64 by 64 is the Hilbert curve itself, and 16 consecutive dots from its start are a 4 by 4 square.
//!
//! Cost: a tile's table is filled in a few operations a dot without allocation; one position or one dot is found
//! in O(log) without a table. Limits: sides up to 65535; a side of 0 makes an empty walk.
//! Source: J. Cerveny's description of the generalised Hilbert curve.

use heapless::Vec;

mod placed;

pub use placed::{Frame, Placed, PlacedBand};

/// Largest height of a band, and largest width and height of a tile.
pub const EDGE: u16 = 64;

/// Most dots in a tile: what a table for [`Tile::fill`] must hold.
pub const MOST: usize = EDGE as usize * EDGE as usize;

/// Rests narrower than this are shared with their neighbours.
const THIN: u16 = EDGE / 2;

/// The walk over a rectangle. See the [module](self).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Walk {
    width: u16,
    height: u16,
    columns: Cut,
    rows: Cut,
}

/// A side cut into pieces: `full` pieces of [`EDGE`], then up to three others.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Cut {
    full: u16,
    tail: [u16; 3],
    tails: u16,
}

impl Cut {
    /// The columns of tiles: even widths but for the last.
    fn columns(width: u16) -> Cut {
        let (full, rest) = (width / EDGE, width % EDGE);
        if rest == 0 {
            Cut { full, tail: [0; 3], tails: 0 }
        } else if rest < THIN && full > 0 {
            Cut::shared(full - 1, EDGE + rest, 2)
        } else {
            Cut::shared(full, rest, 1)
        }
    }

    /// The bands: even heights but for the last, and an odd number of them if that one is odd.
    fn bands(height: u16) -> Cut {
        if height.is_multiple_of(2) {
            return Cut::columns(height);
        }
        let (pairs, rest) = (height / (2 * EDGE), height % (2 * EDGE));
        if rest < THIN && pairs > 0 {
            Cut::shared(2 * pairs - 2, 2 * EDGE + rest, 3)
        } else {
            Cut::shared(2 * pairs, rest, if rest > EDGE { 3 } else { 1 })
        }
    }

    /// `tails` pieces of about equal length, all but the last even.
    fn shared(full: u16, total: u16, tails: u16) -> Cut {
        let even = (total / tails + 1) & !1;
        let last = total - even * (tails - 1);
        let tail = match tails {
            1 => [last, 0, 0],
            2 => [even, last, 0],
            _ => [even, even, last],
        };
        Cut { full, tail, tails }
    }

    fn count(&self) -> u16 {
        self.full + self.tails
    }

    /// Where piece `i < count` begins and how long it is.
    fn piece(&self, i: u16) -> (u16, u16) {
        if i < self.full {
            return (i * EDGE, EDGE);
        }
        let t = usize::from(i - self.full);
        (self.full * EDGE + self.tail[..t].iter().sum::<u16>(), self.tail[t])
    }

    /// Which piece holds coordinate `at`, which lies within the side.
    fn find(&self, at: u16) -> u16 {
        let mut i = at / EDGE;
        if i >= self.full {
            i = self.full;
            while i + 1 < self.count() && self.piece(i + 1).0 <= at {
                i += 1;
            }
        }
        i
    }
}

impl Walk {
    /// The walk over `width` by `height` dots.
    pub fn new(width: u16, height: u16) -> Walk {
        Walk { width, height, columns: Cut::columns(width), rows: Cut::bands(height) }
    }

    /// Dots across.
    pub fn width(&self) -> u16 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u16 {
        self.height
    }

    /// Number of dots.
    pub fn len(&self) -> u32 {
        u32::from(self.width) * u32::from(self.height)
    }

    /// Whether there is no dot.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bands from the top, which is the order of the walk. None if a side is 0.
    pub fn bands(&self) -> impl ExactSizeIterator<Item = Band> + use<> {
        let walk = *self;
        let count = if walk.is_empty() { 0 } else { walk.rows.count() };
        (0..count).map(move |i| walk.nth(i))
    }

    /// Band `i`, which exists.
    fn nth(&self, i: u16) -> Band {
        let (y, height) = self.rows.piece(i);
        Band { y, height, width: self.width, columns: self.columns, back: i % 2 == 1 }
    }

    /// The dot at a position, (column, row). `None` beyond the end.
    pub fn at(&self, position: u32) -> Option<(u16, u16)> {
        if position >= self.len() {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "position / width < height")]
        let row = (position / u32::from(self.width)) as u16;
        let band = self.nth(self.rows.find(row));
        let rest = position - band.start();
        // All tiles of a band are equally high, so a column of dots is `height` positions.
        #[expect(clippy::cast_possible_truncation, reason = "rest / height < width")]
        let column = (rest / u32::from(band.height)) as u16;
        let i =
            if band.back { self.columns.find(self.width - 1 - column) } else { self.columns.find(column) };
        let tile = band.tile(i);
        #[expect(clippy::cast_possible_truncation, reason = "a position within a tile of at most 4096 dots")]
        let within = (rest - band.before(i)) as u16;
        let (x, y) = tile.at(within);
        Some((tile.x + x, tile.y + y))
    }

    /// The position of dot (`x`, `y`). `None` outside the rectangle.
    pub fn position(&self, x: u16, y: u16) -> Option<u32> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let band = self.nth(self.rows.find(y));
        let i = self.columns.find(x);
        let tile = band.tile(i);
        Some(band.start() + band.before(i) + u32::from(tile.position(x - tile.x, y - tile.y)))
    }
}

/// A band of rows, walked completely before the next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Band {
    /// First row.
    pub y: u16,
    /// Rows, at most [`EDGE`].
    pub height: u16,
    width: u16,
    columns: Cut,
    back: bool,
}

impl Band {
    /// Position of the band's first dot.
    pub fn start(&self) -> u32 {
        u32::from(self.y) * u32::from(self.width)
    }

    /// Number of dots.
    pub fn len(&self) -> u32 {
        u32::from(self.height) * u32::from(self.width)
    }

    /// Whether there is no dot.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The tiles in the order of the walk.
    pub fn tiles(&self) -> impl ExactSizeIterator<Item = Tile> + use<> {
        let band = *self;
        let count = band.columns.count();
        (0..count).map(move |i| band.tile(if band.back { count - 1 - i } else { i }))
    }

    /// The tile of column `i`, counted from the left.
    fn tile(&self, i: u16) -> Tile {
        let (x, w) = self.columns.piece(i);
        let orientation = if self.height.is_multiple_of(2) && i + 1 == self.columns.count() {
            Orientation::Down
        } else if self.back {
            Orientation::Back
        } else {
            Orientation::Along
        };
        Tile { x, y: self.y, w, h: self.height, orientation }
    }

    /// How many dots of the band are walked before the tile of column `i`.
    fn before(&self, i: u16) -> u32 {
        let (x, w) = self.columns.piece(i);
        u32::from(self.height) * u32::from(if self.back { self.width - x - w } else { x })
    }
}

/// Where a tile is entered and left.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Orientation {
    /// In at the top left, out at the top right. (A single column of odd height, which can only be the whole
    /// of the last band, leaves at its bottom.)
    Along,
    /// In at the top left, out at the bottom left.
    Down,
    /// In at the bottom right, out at the bottom left.
    Back,
}

/// A rectangle of at most [`EDGE`] by [`EDGE`] dots with its curve.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Tile {
    /// First column.
    pub x: u16,
    /// First row.
    pub y: u16,
    /// Dots across.
    pub w: u16,
    /// Rows.
    pub h: u16,
    /// Where it is entered and left.
    pub orientation: Orientation,
}

/// A corner to start from, a side to walk along and end on, and the side across: signed dot counts.
#[derive(Clone, Copy, Default)]
struct Piece {
    x: i32,
    y: i32,
    ax: i32,
    ay: i32,
    bx: i32,
    by: i32,
}

impl Piece {
    fn along(&self) -> i32 {
        (self.ax + self.ay).abs()
    }

    fn across(&self) -> i32 {
        (self.bx + self.by).abs()
    }

    #[expect(clippy::cast_possible_truncation, reason = "both sides are at most 64, by `Tile::piece`")]
    fn area(&self) -> u16 {
        (self.along() * self.across()) as u16
    }

    fn holds(&self, x: i32, y: i32) -> bool {
        let inside = |at: i32, from: i32, by: i32| {
            if by > 0 { (from..from + by).contains(&at) } else { (from + by + 1..=from).contains(&at) }
        };
        inside(x, self.x, self.ax + self.bx) && inside(y, self.y, self.ay + self.by)
    }

    /// The pieces it is walked in, in order, and how many; `None` if it is a single line of dots, walked straight. An array
    /// with a count and not a `heapless::Vec`, which makes [`Tile::fill`] a quarter slower (4.9 ns a dot against 3.9).
    ///
    /// With a the length along and b the length across: walked along `a`, the path needs a even or both odd. Cut
    /// across a: the first half is made even, the second then has the parity of a. Cut into three: both arms
    /// are walked along b1, made even; the bar is a by b - b1, which again fits.
    fn split(&self) -> Option<([Piece; 3], usize)> {
        let (a, b) = (self.along(), self.across());
        if a == 1 || b == 1 {
            return None;
        }
        let (dax, day) = (self.ax.signum(), self.ay.signum());
        let (dbx, dby) = (self.bx.signum(), self.by.signum());
        let even = |n: i32| if n > 2 { (n / 2 + 1) & !1 } else { n / 2 };
        if 2 * a > 3 * b {
            let a1 = even(a);
            let first = Piece { ax: dax * a1, ay: day * a1, ..*self };
            let second = Piece {
                x: self.x + first.ax,
                y: self.y + first.ay,
                ax: self.ax - first.ax,
                ay: self.ay - first.ay,
                ..*self
            };
            return Some(([first, second, Piece::default()], 2));
        }
        let (a1, b1) = (a / 2, even(b));
        let (bx, by) = (dbx * b1, dby * b1);
        let up = Piece { x: self.x, y: self.y, ax: bx, ay: by, bx: dax * a1, by: day * a1 };
        let bar = Piece { x: self.x + bx, y: self.y + by, bx: self.bx - bx, by: self.by - by, ..*self };
        let down = Piece {
            x: self.x + self.ax - dax + bx - dbx,
            y: self.y + self.ay - day + by - dby,
            ax: -bx,
            ay: -by,
            bx: up.bx - self.ax,
            by: up.by - self.ay,
        };
        Some(([up, bar, down], 3))
    }

    /// The dots of a piece of two by two, as [`Piece::split`] would have them.
    #[expect(clippy::cast_possible_truncation, reason = "coordinates within a tile are 0 to 63")]
    fn round(&self) -> [u16; 4] {
        let (ax, ay) = (self.ax.signum(), self.ay.signum());
        let (bx, by) = (self.bx.signum(), self.by.signum());
        [(0, 0), (bx, by), (ax + bx, ay + by), (ax, ay)]
            .map(|(x, y)| (self.y + y) as u16 * EDGE + (self.x + x) as u16)
    }

    /// Direction and number of dots of a single line.
    fn line(&self) -> (i32, i32, u16) {
        let (x, y) = if self.along() > 1 { (self.ax, self.ay) } else { (self.bx, self.by) };
        (x.signum(), y.signum(), self.area())
    }
}

/// Deepest stack of pieces [`Tile::fill`] needs; the tests try every tile there is.
const DEPTH: usize = 24;

impl Tile {
    /// Number of dots.
    pub fn area(&self) -> u16 {
        self.w * self.h
    }

    fn piece(&self) -> Piece {
        // A side is at most 64 in any walk; a tile made by hand with longer sides is cut, not overflowed.
        let (w, h) = (self.w.min(EDGE) as i32, self.h.min(EDGE) as i32);
        match self.orientation {
            Orientation::Along => Piece { x: 0, y: 0, ax: w, ay: 0, bx: 0, by: h },
            Orientation::Down => Piece { x: 0, y: 0, ax: 0, ay: h, bx: w, by: 0 },
            Orientation::Back => Piece { x: w - 1, y: h - 1, ax: -w, ay: 0, bx: 0, by: -h },
        }
    }

    /// Writes the dots in the order of the curve as `row * 64 + column` within the tile and returns how many;
    /// dots beyond the end of `out` are left out. The table depends on size and orientation only.
    #[expect(clippy::cast_possible_truncation, reason = "coordinates within a tile are 0 to 63")]
    pub fn fill(&self, out: &mut [u16]) -> usize {
        if self.w == 0 || self.h == 0 {
            return 0;
        }
        let mut pending = Vec::<Piece, DEPTH>::new();
        let _ = pending.push(self.piece());
        let mut n = 0;
        while let Some(piece) = pending.pop() {
            // What most tiles come down to: without this a microcontroller takes three times as long.
            if piece.along() == 2
                && piece.across() == 2
                && let Some(places) = out.get_mut(n..n + 4)
            {
                places.copy_from_slice(&piece.round());
                n += 4;
                continue;
            }
            let Some((parts, count)) = piece.split() else {
                let (dx, dy, dots) = piece.line();
                let (mut x, mut y) = (piece.x, piece.y);
                for _ in 0..dots {
                    if let Some(place) = out.get_mut(n) {
                        *place = (y as u16) * EDGE + x as u16;
                        n += 1;
                    }
                    (x, y) = (x + dx, y + dy);
                }
                continue;
            };
            for part in parts[..count].iter().rev() {
                // There is room: see `DEPTH`.
                let _ = pending.push(*part);
            }
        }
        n
    }

    /// The dot at a position within the tile, (column, row); positions beyond the end give the last dot.
    #[expect(clippy::cast_possible_truncation, reason = "coordinates within a tile are 0 to 63")]
    pub fn at(&self, position: u16) -> (u16, u16) {
        let mut piece = self.piece();
        let mut rest = position.min(piece.area().saturating_sub(1));
        while let Some((parts, count)) = piece.split() {
            for part in &parts[..count] {
                piece = *part;
                if rest < part.area() {
                    break;
                }
                rest -= part.area();
            }
        }
        let (dx, dy, _) = piece.line();
        ((piece.x + dx * rest as i32) as u16, (piece.y + dy * rest as i32) as u16)
    }

    /// The position within the tile of a dot that lies in it.
    #[expect(clippy::cast_possible_truncation, reason = "a single line of dots is at most 64 long")]
    pub fn position(&self, x: u16, y: u16) -> u16 {
        let (x, y) = (x as i32, y as i32);
        let mut piece = self.piece();
        let mut position = 0;
        while let Some((parts, count)) = piece.split() {
            for part in &parts[..count] {
                piece = *part;
                if part.holds(x, y) {
                    break;
                }
                position += part.area();
            }
        }
        position + ((x - piece.x).abs() + (y - piece.y).abs()) as u16
    }
}

#[cfg(test)]
mod tests;
