//! The ink mix where the walk is: document weights sampled along the curve, times the matrix of shares.
//!
//! Problem: weights over 57 stacks for every dot of a page would be gigabytes, while a document has a few
//! bases at its own resolution.
//! Method: the walk is cut into stretches of 16, 4 or 1 consecutive dots, which are squares of a Hilbert
//! tile, the largest that is no coarser than the document's pixels. At the middle of each the basis weights are
//! read, bilinear between pixels (positions in 1/2 dots, fractions in 1/256 pixel), or averaged over a dot's exact
//! footprint where the document is finer than the dots. Shares are `sum_i a_i matrix[i][q]`, rounded to 1/UNIT; what
//! rounding leaves goes to the largest share, at most stacks/2 units of 2^-18. All integers: equal on any machine.
//! Cost: channels x stacks multiplications a stretch, eight at a time; stacks and channels without any weight are
//! left out. Memory: a table of a few bytes for each half dot of the two sides.

use protocol::walk::{EDGE, MOST, Tile, Walk};

use super::rule::{LANES, Lanes, Source, UNIT, blocks};
use crate::gamut::InkMix;
use crate::weights::ONE;

/// Basis weights within a stretch are in this unit.
const WEIGHT: u32 = 1 << 16;

/// A size and orientation of tile: its curve as tables.
pub(super) struct Shape {
    tile: Tile,
    /// Position on the curve of each dot, row by row.
    pub(super) order: Vec<u16>,
    /// Middle of each stretch in half dots from the tile's corner, and its number of dots.
    stretches: Vec<(u8, u8, u8)>,
}

impl Shape {
    fn new(tile: Tile, stretch: usize) -> Shape {
        let mut curve = [0u16; MOST];
        let dots = tile.fill(&mut curve);
        let curve = &curve[..dots];
        let mut order = vec![0; dots];
        for (position, &offset) in curve.iter().enumerate() {
            let (x, y) = (offset % EDGE, offset / EDGE);
            order[usize::from(y * tile.w + x)] = position as u16;
        }
        let stretches = curve
            .chunks(stretch)
            .map(|dots| {
                let n = dots.len() as u32;
                let middle =
                    |side: fn(u16) -> u16| dots.iter().map(|&o| 2 * u32::from(side(o)) + 1).sum::<u32>() / n;
                // At most 2 * 64 half dots, and 16 dots.
                (middle(|o| o % EDGE) as u8, middle(|o| o / EDGE) as u8, n as u8)
            })
            .collect();
        Shape { tile, order, stretches }
    }

    fn fits(&self, tile: &Tile) -> bool {
        (self.tile.w, self.tile.h, self.tile.orientation) == (tile.w, tile.h, tile.orientation)
    }
}

/// Where a position along one side falls in the document.
enum Axis {
    /// For each half dot: the pixel before it and the part of the next, in 1/256.
    Between(Vec<(u32, u16)>),
    /// For each dot: the first pixel and the range of `parts` it covers, each dot's parts with sum [`Axis::FULL`].
    Over { spans: Vec<(u32, u32, u32)>, parts: Vec<u32> },
}

impl Axis {
    const FULL: u32 = 1 << 12;

    fn between(dots: usize, pixels: usize) -> Axis {
        let last = 256 * (pixels as i64 - 1);
        let place = |half: usize| {
            // (half / 2) * pixels / dots - 1/2 pixels, in 1/256, to the nearest.
            let numerator = 256 * half as i64 * pixels as i64 - 256 * dots as i64;
            let at = (numerator + dots as i64).div_euclid(2 * dots as i64).clamp(0, last);
            ((at / 256) as u32, (at % 256) as u16)
        };
        Axis::Between((0..=2 * dots).map(place).collect())
    }

    fn over(dots: usize, pixels: usize) -> Axis {
        let (mut spans, mut parts) = (Vec::with_capacity(dots), Vec::new());
        for dot in 0..dots {
            // In units of 1/dots pixel: the dot covers [dot * pixels, (dot + 1) * pixels), a pixel is `dots` wide.
            let (from, to) = (dot * pixels, (dot + 1) * pixels);
            let (first, end) = (from / dots, to.div_ceil(dots));
            let start = parts.len();
            let mut before = 0;
            for pixel in first..end {
                // Differences of rounded sums keep the total exact.
                let covered = ((pixel + 1) * dots).min(to) - from;
                let sum = (covered as u64 * u64::from(Axis::FULL) + pixels as u64 / 2) / pixels as u64;
                parts.push(sum as u32 - before);
                before = sum as u32;
            }
            spans.push((first as u32, start as u32, parts.len() as u32));
        }
        Axis::Over { spans, parts }
    }

    /// Calls `with(pixel, part)`; the parts sum to [`Axis::FULL`].
    fn parts(&self, half: usize, mut with: impl FnMut(usize, u64)) {
        match self {
            Axis::Between(table) => {
                let (pixel, fraction) = table[half];
                let next = u64::from(fraction) * u64::from(Axis::FULL) / 256;
                with(pixel as usize, u64::from(Axis::FULL) - next);
                if next > 0 {
                    with(pixel as usize + 1, next);
                }
            }
            Axis::Over { spans, parts } => {
                let (first, from, to) = spans[half / 2];
                for (i, &part) in parts[from as usize..to as usize].iter().enumerate() {
                    with(first as usize + i, u64::from(part));
                }
            }
        }
    }
}

/// Everything about a document on a rectangle of dots that does not change along the walk.
pub(super) struct Lattice<'a> {
    mix: &'a InkMix,
    /// Numbers in `mix.stacks` of the stacks with weight, ascending.
    pub(super) stacks: Vec<u8>,
    /// Channels with weight, and their shares of the stacks above.
    rows: Vec<(usize, Vec<Lanes>)>,
    shapes: Vec<Shape>,
    across: Axis,
    down: Axis,
}

impl<'a> Lattice<'a> {
    /// For a walk over the dots the document is printed on. The mix has been checked.
    pub(super) fn new(mix: &'a InkMix, walk: &Walk) -> Lattice<'a> {
        let maps = &mix.maps;
        let (width, height) = (usize::from(walk.width()), usize::from(walk.height()));
        let mut sums = vec![0u16; maps.channels()];
        for pixel in maps.data().chunks_exact(maps.channels()) {
            for (sum, weight) in sums.iter_mut().zip(pixel) {
                *sum |= weight;
            }
        }
        let channels: Vec<usize> = (0..maps.channels()).filter(|&i| sums[i] > 0).collect();
        let used = |q: &usize| channels.iter().any(|&i| mix.matrix[i][*q] > 0);
        let stacks: Vec<u8> = (0..mix.stacks.len()).filter(used).map(|q| q as u8).collect();
        let rows = channels
            .iter()
            .map(|&i| {
                let mut row = vec![Lanes::default(); blocks(stacks.len())];
                for (lane, &q) in stacks.iter().enumerate() {
                    row[lane / LANES].0[lane % LANES] = i32::from(mix.matrix[i][usize::from(q)]);
                }
                (i, row)
            })
            .collect();
        let finer = (maps.width() > width, maps.height() > height);
        let axis =
            |finer, dots, pixels| if finer { Axis::over(dots, pixels) } else { Axis::between(dots, pixels) };
        let stretch = if width >= 4 * maps.width() && height >= 4 * maps.height() {
            16
        } else if width >= 2 * maps.width() && height >= 2 * maps.height() {
            4
        } else {
            1
        };
        let mut shapes: Vec<Shape> = Vec::new();
        for tile in walk.bands().flat_map(|band| band.tiles()) {
            if !shapes.iter().any(|shape| shape.fits(&tile)) {
                shapes.push(Shape::new(tile, stretch));
            }
        }
        Lattice {
            mix,
            stacks,
            rows,
            shapes,
            across: axis(finer.0, width, maps.width()),
            down: axis(finer.1, height, maps.height()),
        }
    }

    /// The tables of a tile of the walk.
    pub(super) fn shape(&self, tile: &Tile) -> &Shape {
        // Every tile of the walk found its shape in `new`.
        self.shapes.iter().find(|shape| shape.fits(tile)).unwrap_or(&self.shapes[0])
    }

    /// The mix along these tiles.
    pub(super) fn along<T: Iterator<Item = Tile>>(&self, tiles: T) -> Along<'_, T> {
        Along {
            lattice: self,
            tiles,
            tile: None,
            weights: vec![0; self.mix.maps.channels()],
            sums: vec![0; self.mix.maps.channels()],
            mixed: None,
        }
    }

    /// Basis weights in units of 1/[`WEIGHT`] at a place in half dots, when no axis is finer than the dots.
    #[inline(always)]
    fn between(&self, x: (u32, u16), y: (u32, u16), weights: &mut [u32]) {
        let maps = &self.mix.maps;
        let (width, channels) = (maps.width(), maps.channels());
        let row = (y.0 as usize * width + x.0 as usize) * channels;
        let (right, below) = (if x.1 > 0 { channels } else { 0 }, if y.1 > 0 { width * channels } else { 0 });
        if right + below == 0 {
            for (weight, &a) in weights.iter_mut().zip(&maps.data()[row..][..channels]) {
                *weight = u32::from(a) * (WEIGHT / ONE as u32);
            }
            return;
        }
        let pixel = |at: usize| &maps.data()[at..][..channels];
        let corners = [pixel(row), pixel(row + right), pixel(row + below), pixel(row + right + below)];
        let (fx, fy) = (u32::from(x.1), u32::from(y.1));
        let parts = [(256 - fx) * (256 - fy), fx * (256 - fy), (256 - fx) * fy, fx * fy];
        for (i, weight) in weights.iter_mut().enumerate() {
            // At most 2^15 * 2^16.
            let sum = u32::from(corners[0][i]) * parts[0]
                + u32::from(corners[1][i]) * parts[1]
                + u32::from(corners[2][i]) * parts[2]
                + u32::from(corners[3][i]) * parts[3];
            *weight = (sum + (1 << 14)) >> 15;
        }
    }

    /// The same by exact parts of pixels on either axis.
    #[cold]
    fn over(&self, x: usize, y: usize, sums: &mut [u64], weights: &mut [u32]) {
        let maps = &self.mix.maps;
        sums.fill(0);
        self.down.parts(y, |row, part_y| {
            self.across.parts(x, |column, part_x| {
                for (sum, &a) in sums.iter_mut().zip(maps.at(row * maps.width() + column)) {
                    *sum += u64::from(a) * part_x * part_y;
                }
            });
        });
        // Sums are in units of 2^-15 * 2^-24.
        for (weight, &sum) in weights.iter_mut().zip(sums.iter()) {
            *weight = ((sum + (1 << 22)) >> 23) as u32;
        }
    }

    /// Shares in the rule's unit from basis weights.
    #[inline(always)]
    fn shares(&self, weights: &[u32], out: &mut [Lanes]) {
        out.fill(Lanes::default());
        for (channel, row) in &self.rows {
            let weight = weights[*channel] as i32;
            if weight == 0 {
                continue;
            }
            for (sum, share) in out.iter_mut().zip(row) {
                for l in 0..LANES {
                    // The whole sum is about 2^31, and kept as the bits of an unsigned number.
                    sum.0[l] = sum.0[l].wrapping_add(weight.wrapping_mul(share.0[l]));
                }
            }
        }
        let (mut total, mut most) = ([0i32; LANES], [0i32; LANES]);
        for sum in out.iter_mut() {
            for l in 0..LANES {
                // From 2^-31 to 2^-18.
                let share = ((sum.0[l] as u32 + (1 << 12)) >> 13) as i32;
                sum.0[l] = share;
                total[l] += share;
                most[l] = most[l].max(share);
            }
        }
        let left = UNIT - total.iter().sum::<i32>();
        if left == 0 {
            return;
        }
        let most = most.into_iter().fold(0, i32::max);
        for sum in out.iter_mut() {
            if let Some(largest) = sum.0.iter_mut().find(|share| **share == most) {
                *largest += left;
                return;
            }
        }
    }
}

/// The mix along some tiles, stretch by stretch.
pub(super) struct Along<'a, T> {
    lattice: &'a Lattice<'a>,
    tiles: T,
    tile: Option<(Tile, &'a Shape, usize)>,
    weights: Vec<u32>,
    sums: Vec<u64>,
    /// Where the last mix was taken, which flat or enlarged documents often need again.
    mixed: Option<((u32, u16), (u32, u16))>,
}

impl<T: Iterator<Item = Tile>> Source for Along<'_, T> {
    #[inline(always)]
    fn stretch(&mut self, out: &mut [Lanes]) -> u32 {
        let lattice = self.lattice;
        let (tile, shape, at) = match self.tile.take() {
            Some(here) => here,
            None => match self.tiles.next() {
                Some(tile) => (tile, lattice.shape(&tile), 0),
                // Not asked for beyond the last tile; all to the first stack if it were.
                None => {
                    out.fill(Lanes::default());
                    out[0].0[0] = UNIT;
                    return u32::MAX;
                }
            },
        };
        let (x, y, dots) = shape.stretches[at];
        self.tile = (at + 1 < shape.stretches.len()).then_some((tile, shape, at + 1));
        let (x, y) = (2 * usize::from(tile.x) + usize::from(x), 2 * usize::from(tile.y) + usize::from(y));
        match (&lattice.across, &lattice.down) {
            (Axis::Between(across), Axis::Between(down)) => {
                let place = (across[x], down[y]);
                if self.mixed != Some(place) {
                    self.mixed = Some(place);
                    lattice.between(place.0, place.1, &mut self.weights);
                }
            }
            _ => lattice.over(x, y, &mut self.sums, &mut self.weights),
        }
        lattice.shares(&self.weights, out);
        u32::from(dots)
    }
}
