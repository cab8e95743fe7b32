//! The walk of a picture that lies somewhere on a larger plane.
//!
//! Problem: a picture is halftoned along the walk over its own rectangle. Along the walk over the page, whose tiles lie
//! elsewhere, its runs are cut to pieces. Method: the picture's rectangle, the frame, is walked as it was halftoned. The rows
//! above and below it have walks of their own over the plane's width. In a band of the frame, the dots to the left and to the
//! right of it follow those of the frame, each side by the walk over its own rectangle. So every dot of the plane is still
//! visited once, band by band. Steps from one rectangle to another are not to a neighbour.
//!
//! Cost: that of the walk. Limits: one frame. Copies beside it have tiles that lie elsewhere.

use super::{Band, Cut, Tile, Walk};

/// A rectangle of dots.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Frame {
    /// First column.
    pub x: u16,
    /// First row.
    pub y: u16,
    /// Dots across.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl Frame {
    /// All of a plane.
    pub fn whole(width: u16, height: u16) -> Frame {
        Frame { x: 0, y: 0, width, height }
    }

    /// Whether it has a dot and lies within a plane.
    pub fn is_within(self, width: u16, height: u16) -> bool {
        let inside = |from: u16, length: u16, side: u16| {
            length > 0 && from.checked_add(length).is_some_and(|end| end <= side)
        };
        inside(self.x, self.width, width) && inside(self.y, self.height, height)
    }
}

/// The order of all dots of a plane with a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Placed {
    above: Walk,
    framed: Walk,
    below: Walk,
    x: u16,
}

impl Placed {
    /// The walk over a plane that has one picture, as large as the plane.
    pub fn whole(width: u16, height: u16) -> Placed {
        let none = Walk::new(width, 0);
        Placed { above: none, framed: Walk::new(width, height), below: none, x: 0 }
    }

    /// The walk over a plane of `width` by `height` dots with a picture at `frame`; `None` if that has no dot or does not
    /// lie within.
    pub fn new(width: u16, height: u16, frame: Frame) -> Option<Placed> {
        frame.is_within(width, height).then(|| Placed {
            above: Walk::new(width, frame.y),
            framed: Walk::new(frame.width, frame.height),
            below: Walk::new(width, height - frame.y - frame.height),
            x: frame.x,
        })
    }

    /// Dots across the plane.
    pub fn width(&self) -> u16 {
        self.above.width
    }

    /// Rows of the plane.
    pub fn height(&self) -> u16 {
        self.above.height + self.framed.height + self.below.height
    }

    /// Where the picture is.
    pub fn frame(&self) -> Frame {
        Frame { x: self.x, y: self.above.height, width: self.framed.width, height: self.framed.height }
    }

    /// Band `i` from the top, which is the order of the walk.
    pub fn band(&self, i: usize) -> Option<PlacedBand> {
        let mut i = u16::try_from(i).ok()?;
        let mut y = 0;
        for (walk, x) in [(&self.above, 0), (&self.framed, self.x), (&self.below, 0)] {
            let count = if walk.is_empty() { 0 } else { walk.rows.count() };
            if i < count {
                return Some(PlacedBand::new(walk.nth(i), x, y, self.width()));
            }
            i -= count;
            y += walk.height;
        }
        None
    }

    /// All bands.
    pub fn bands(&self) -> impl Iterator<Item = PlacedBand> + use<> {
        let placed = *self;
        (0..).map_while(move |i| placed.band(i))
    }
}

/// A band of rows, walked completely before the next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlacedBand {
    /// First row.
    pub y: u16,
    /// Rows, at most [`EDGE`](super::EDGE).
    pub height: u16,
    /// The band of the frame, or of a strip above or below it, and the sides of the frame.
    parts: [Band; 3],
    /// First columns of the parts.
    x: [u16; 3],
}

impl PlacedBand {
    /// Band `middle` of a walk that begins at (`x`, `y`) of a plane of `width` dots.
    fn new(middle: Band, x: u16, y: u16, width: u16) -> PlacedBand {
        let (y, height) = (y + middle.y, middle.height);
        // A rectangle of the height of a band is a single band.
        let side = |width: u16| Band { y: 0, height, width, columns: Cut::columns(width), back: false };
        let right = x + middle.width;
        PlacedBand {
            y,
            height,
            parts: [Band { y: 0, ..middle }, side(x), side(width - right)],
            x: [x, 0, right],
        }
    }

    /// Number of dots.
    pub fn len(&self) -> u32 {
        self.parts.iter().map(Band::len).sum()
    }

    /// Whether there is no dot.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Tile `i` in the order of the walk.
    pub fn tile(&self, i: usize) -> Option<Tile> {
        let mut i = u16::try_from(i).ok()?;
        for (part, x) in self.parts.iter().zip(self.x) {
            let count = part.columns.count();
            if i < count {
                let tile = part.tile(if part.back { count - 1 - i } else { i });
                return Some(Tile { x: tile.x + x, y: self.y, ..tile });
            }
            i -= count;
        }
        None
    }

    /// All tiles.
    pub fn tiles(&self) -> impl Iterator<Item = Tile> + use<> {
        let band = *self;
        (0..).map_while(move |i| band.tile(i))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::super::{EDGE, MOST};
    use super::*;
    use proptest::prelude::*;
    use std::vec;

    fn a_frame() -> impl Strategy<Value = (u16, u16, Frame)> {
        (1u16..400, 1u16..300).prop_flat_map(|(width, height)| {
            (0..width, 0..height)
                .prop_flat_map(move |(x, y)| (Just((x, y)), 1..=width - x, 1..=height - y))
                .prop_map(move |((x, y), w, h)| (width, height, Frame { x, y, width: w, height: h }))
        })
    }

    proptest! {
        #[test]
        fn every_dot_is_visited_once_and_the_frame_as_by_its_own_walk((width, height, frame) in a_frame()) {
            let placed = Placed::new(width, height, frame).unwrap();
            prop_assert_eq!((placed.width(), placed.height(), placed.frame()), (width, height, frame));
            let own = Walk::new(frame.width, frame.height);
            let mut seen = vec![false; usize::from(width) * usize::from(height)];
            let mut table = [0; MOST];
            let (mut y, mut inside) = (0, 0);
            for band in placed.bands() {
                prop_assert!(band.y == y && band.height <= EDGE);
                y += band.height;
                let mut dots = 0;
                for tile in band.tiles() {
                    prop_assert!((tile.y, tile.h) == (band.y, band.height) && tile.x + tile.w <= width);
                    let count = tile.fill(&mut table);
                    dots += count;
                    for place in &table[..count] {
                        let (x, y) = (tile.x + place % EDGE, tile.y + place / EDGE);
                        let dot = &mut seen[usize::from(y) * usize::from(width) + usize::from(x)];
                        prop_assert!(!core::mem::replace(dot, true), "{x}, {y} is visited twice");
                        if let (Some(x), Some(y)) = (x.checked_sub(frame.x), y.checked_sub(frame.y))
                            && (x < frame.width && y < frame.height)
                        {
                            prop_assert_eq!(own.at(inside), Some((x, y)));
                            inside += 1;
                        }
                    }
                }
                prop_assert_eq!(band.len() as usize, dots);
            }
            prop_assert!(y == height && seen.iter().all(|&dot| dot));
        }
    }

    #[test]
    fn a_frame_as_large_as_the_plane_is_the_walk_itself() {
        for (width, height) in [(1, 1), (300, 200), (97, 131), (4800, 6372)] {
            let (placed, walk) = (Placed::whole(width, height), Walk::new(width, height));
            assert_eq!(Placed::new(width, height, Frame::whole(width, height)), Some(placed));
            let tiles = walk.bands().flat_map(|band| band.tiles());
            assert!(placed.bands().flat_map(|band| band.tiles()).eq(tiles));
        }
    }

    #[test]
    fn a_frame_beyond_the_plane_is_none() {
        let wrong = [
            (0, 0, 0, 5),
            (0, 0, 5, 0),
            (1, 0, 20, 5),
            (0, 1, 5, 10),
            (u16::MAX, 0, 2, 1),
            (0, u16::MAX, 1, 2),
        ];
        for (x, y, width, height) in wrong {
            assert_eq!(Placed::new(20, 10, Frame { x, y, width, height }), None);
        }
        assert_eq!(Placed::whole(0, 9).band(0), None);
        assert_eq!(Placed::whole(9, 0).band(0), None);
    }
}
