//! Where on a page the picture lies along whose walk a job was halftoned.
//!
//! Problem: pass streams are several times shorter along the walk of the picture than along that of the page. A job in
//! the printer's language does not say where its picture begins; one that was just made does, but not whether its dots
//! follow a walk at all. Method: runs along the right walk are long, so that few of
//! its steps lead from a dot with ink to one without. Tiles repeat every 64 columns and, since every other band is walked
//! backwards, every 128 rows. So for each of these 8192 places, or the one that is known, the steps with such a change are
//! counted in the densest windows of each pass; the place with the fewest wins, if it is clearly better than the page's own
//! corner. From there, the picture is taken to reach as far as there are dots.
//!
//! Cost: two million comparisons of 64 dots a window, tens of milliseconds for a job; next to nothing if the place is known.
//! Limits: one picture; of several copies it finds the place of one. The last tiles at the right and lower edges differ if the
//! picture ends beyond the last dot. A wrong place makes longer streams, never wrong ones.

use protocol::runs::stride;
use protocol::walk::{EDGE, Frame, MOST, Orientation, Tile};
use rayon::prelude::*;

/// Distance of places that are walked alike.
const ACROSS: usize = EDGE as usize;
const DOWN: usize = 2 * EDGE as usize;

/// Size of a window in dots: a tile at every place, and the one below it.
const COLUMNS: usize = 128;
const ROWS: usize = 256;

/// Windows of a pass that are looked at.
const WINDOWS: usize = 6;

/// Columns and rows where a walk may begin, the page's own corner first, column by column.
pub(super) struct Places(Vec<(usize, usize)>);

impl Places {
    /// All that differ.
    pub(super) fn all() -> Places {
        Places((0..ACROSS).flat_map(|x| (0..DOWN).map(move |y| (x, y))).collect())
    }

    /// The page's corner, and that of this picture.
    pub(super) fn known(picture: Frame) -> Places {
        Places(vec![(0, 0), (usize::from(picture.x) % ACROSS, usize::from(picture.y) % DOWN)])
    }
}

/// What the passes of a job tell about their picture.
#[derive(Clone)]
pub(super) struct Traces {
    /// First column and row with a dot, and one beyond the last.
    bounds: Option<[u16; 4]>,
    /// For each place the steps of the walk that lead from a dot with ink to one without, or back.
    changes: Vec<u32>,
}

impl Traces {
    pub(super) fn none(places: &Places) -> Traces {
        Traces { bounds: None, changes: vec![0; places.0.len()] }
    }

    /// Those of one pass.
    pub(super) fn of(plane: &[u8], columns: u16, places: &Places) -> Traces {
        let stride = stride(columns);
        let rows: Vec<&[u8]> = plane.chunks_exact(stride).collect();
        let mut windows: Vec<Window> = (0..(rows.len() / ROWS))
            .flat_map(|y| (0..usize::from(columns) / COLUMNS).map(move |x| (x, y)))
            .map(|(x, y)| Window::new(&rows[y * ROWS..(y + 1) * ROWS], x * COLUMNS / 8))
            .filter(|window| window.edges > 0)
            .collect();
        windows.sort_by_key(|window| std::cmp::Reverse(window.edges));
        windows.truncate(WINDOWS);
        let none = || Traces::none(places).changes;
        let changes = windows.par_iter().map(|window| window.changes(places)).reduce(none, sum);
        Traces { bounds: bounds(&rows), changes }
    }

    /// Both.
    pub(super) fn and(self, other: Traces) -> Traces {
        let bounds = match (self.bounds, other.bounds) {
            (Some([a, b, c, d]), Some([e, f, g, h])) => Some([a.min(e), b.min(f), c.max(g), d.max(h)]),
            (one, other) => one.or(other),
        };
        Traces { bounds, changes: sum(self.changes, other.changes) }
    }

    /// The rectangle of the picture; all of a plane of this size if no other is clearly better.
    pub(super) fn frame(&self, places: &Places, columns: u16, rows: u16) -> Frame {
        let whole = Frame::whole(columns, rows);
        let best = places.0.iter().zip(&self.changes).min_by_key(|(_, changes)| **changes);
        let (Some((&(across, down), &fewest)), Some([left, top, right, bottom])) = (best, self.bounds) else {
            return whole;
        };
        // One in ten is more than chance makes of thousands of steps.
        if fewest > self.changes[0] - self.changes[0] / 10 {
            return whole;
        }
        let corner = |edge: u16, place: usize, period: usize| {
            let place = u16::try_from(place).unwrap_or_default();
            edge.checked_sub(place).map_or(place, |beyond| edge - beyond % period as u16)
        };
        let (x, y) = (corner(left, across, ACROSS), corner(top, down, DOWN));
        let frame = Frame { x, y, width: right.saturating_sub(x), height: bottom.saturating_sub(y) };
        if frame.is_within(columns, rows) { frame } else { whole }
    }
}

fn sum(mut one: Vec<u32>, other: Vec<u32>) -> Vec<u32> {
    one.iter_mut().zip(other).for_each(|(one, other)| *one += other);
    one
}

fn bounds(rows: &[&[u8]]) -> Option<[u16; 4]> {
    let inked = |row: &&[u8]| row.iter().any(|&byte| byte != 0);
    let (top, bottom) = (rows.iter().position(inked)?, rows.iter().rposition(inked)?);
    let (mut left, mut right) = (usize::MAX, 0);
    for row in &rows[top..=bottom] {
        let column = |byte: usize, bit: u32| byte * 8 + bit as usize;
        if let Some(first) = row.iter().position(|&byte| byte != 0) {
            left = left.min(column(first, row[first].leading_zeros()));
        }
        if let Some(last) = row.iter().rposition(|&byte| byte != 0) {
            right = right.max(column(last, 8 - row[last].trailing_zeros()));
        }
    }
    let bounds = [left, top, right, bottom + 1].map(u16::try_from);
    bounds.into_iter().collect::<Result<Vec<_>, _>>().ok()?.try_into().ok()
}

/// Which dots of a part of a plane differ from their right and their lower neighbour, the first column in the top bit.
struct Window {
    right: Vec<u128>,
    below: Vec<u128>,
    edges: u32,
}

impl Window {
    /// Of [`COLUMNS`] dots from byte `at` of [`ROWS`] rows.
    fn new(rows: &[&[u8]], at: usize) -> Window {
        let dots: Vec<u128> = rows
            .iter()
            .map(|row| row[at..at + COLUMNS / 8].iter().fold(0, |dots, &byte| dots << 8 | u128::from(byte)))
            .collect();
        let right: Vec<u128> = dots.iter().map(|row| row ^ row << 1).collect();
        let below = dots.windows(2).map(|pair| pair[0] ^ pair[1]).chain([0]).collect();
        let edges = right.iter().map(|row| row.count_ones()).sum();
        Window { right, below, edges }
    }

    /// The steps with a change for each place: of the tile there and of the one below it, walked backwards.
    fn changes(&self, places: &Places) -> Vec<u32> {
        let along = Steps::of(Orientation::Along);
        let back = Steps::of(Orientation::Back);
        let mut changes = Vec::with_capacity(places.0.len());
        for column in places.0.chunk_by(|one, other| one.0 == other.0) {
            let cut =
                |rows: &[u128]| rows.iter().map(|row| (row << column[0].0 >> 64) as u64).collect::<Vec<_>>();
            let (right, below) = (cut(&self.right), cut(&self.below));
            changes.extend(column.iter().map(|&(_, y)| {
                along.changes(&right[y..], &below[y..])
                    + back.changes(&right[y + ACROSS..], &below[y + ACROSS..])
            }));
        }
        changes
    }
}

/// The dots of a full tile from which, or to which, a step goes to the right, and those with one downwards.
struct Steps {
    right: [u64; ACROSS],
    below: [u64; ACROSS],
}

impl Steps {
    fn of(orientation: Orientation) -> Steps {
        let mut table = [0; MOST];
        Tile { x: 0, y: 0, w: EDGE, h: EDGE, orientation }.fill(&mut table);
        let mut steps = Steps { right: [0; ACROSS], below: [0; ACROSS] };
        for pair in table.windows(2) {
            let (first, second) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            let side = if second - first == 1 { &mut steps.right } else { &mut steps.below };
            side[usize::from(first / EDGE)] |= 1 << (EDGE - 1 - first % EDGE);
        }
        steps
    }

    fn changes(&self, right: &[u64], below: &[u64]) -> u32 {
        let across = self.right.iter().zip(right).map(|(step, edge)| (step & edge).count_ones());
        let down = self.below.iter().zip(below).map(|(step, edge)| (step & edge).count_ones());
        across.chain(down).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::walk::Walk;

    /// Clusters of eight dots and more along the walk of a picture.
    fn halftoned(columns: u16, rows: u16, frame: Frame, seed: u64) -> Vec<u8> {
        let mut plane = vec![0; stride(columns) * usize::from(rows)];
        let walk = Walk::new(frame.width, frame.height);
        let (mut random, mut left, mut on) = (seed, 0, false);
        for at in 0..walk.len() {
            if left == 0 {
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (left, on) = (8 + (random >> 62), random >> 40 & 3 == 0);
            }
            left -= 1;
            if on {
                let (x, y) = walk.at(at).unwrap();
                let (x, y) = (usize::from(frame.x + x), usize::from(frame.y + y));
                plane[y * stride(columns) + x / 8] |= 0x80 >> (x % 8);
            }
        }
        plane
    }

    #[test]
    fn a_picture_is_found_wherever_it_lies() {
        for (seed, (x, y)) in (1..).zip([(0, 0), (1, 0), (0, 1), (63, 127), (100, 200), (257, 65)]) {
            let frame = Frame { x, y, width: 700, height: 900 };
            let planes = [seed, seed + 100].map(|seed| halftoned(1200, 1300, frame, seed));
            let find = |places: &Places| {
                let traces = planes.iter().map(|plane| Traces::of(plane, 1200, places));
                traces.reduce(Traces::and).unwrap().frame(places, 1200, 1300)
            };
            let found = find(&Places::all());
            let expected = if (x, y) == (0, 0) { Frame::whole(1200, 1300) } else { frame };
            // Its last dots may be blank.
            assert_eq!((found.x, found.y), (expected.x, expected.y));
            assert!(expected.width - found.width < 16 && expected.height - found.height < 16, "{found:?}");
            assert_eq!(find(&Places::known(frame)), found, "the same without a search");
        }
    }

    #[test]
    fn what_follows_no_walk_belongs_to_the_page() {
        let whole = Frame::whole(1200, 1300);
        let (mut noise, mut cells) = (vec![0; 150 * 1300], vec![0; 150 * 1300]);
        let mut random = 1u64;
        for (i, (noise, cell)) in noise.iter_mut().zip(&mut cells).enumerate() {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *noise = (random >> 40) as u8;
            let mixed = ((i / 600 * 150 + i % 150) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            *cell = [0, 0x0f, 0xf0, 0xff][(mixed >> 62) as usize];
        }
        for plane in [&noise, &cells, &vec![0; 150 * 1300], &vec![0xff; 150 * 1300]] {
            for places in [Places::all(), Places::known(Frame { x: 9, y: 30, width: 5, height: 5 })] {
                assert_eq!(Traces::of(plane, 1200, &places).frame(&places, 1200, 1300), whole);
            }
        }
        let places = Places::all();
        assert_eq!(Traces::none(&places).frame(&places, 8, 9), Frame::whole(8, 9));
        assert_eq!(Traces::of(&[0x80], 1, &places).frame(&places, 1, 1), Frame::whole(1, 1));
    }
}
