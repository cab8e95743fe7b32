//! The ink mix along the walk: weights of the document times the matrix of shares.
//!
//! Problem: weights over 57 stacks for every dot of a page would take gigabytes, while a document has a few
//! bases at its own resolution.
//! Method: the walk is cut into stretches of 16, 4 or 1 consecutive dots, which are squares of a Hilbert
//! tile: the largest that are no coarser than the document's pixels. Basis weights are read at the middle of each stretch:
//! bilinear between pixels (positions in 1/2 dots, fractions in 1/256 pixel), or averaged over the exact footprint of a dot
//! where the document is finer than the dots. Shares are `sum_i a_i matrix[i][q]`, rounded to 1/UNIT. The rounding error,
//! at most stacks/2 units of 2^-18, is added to the largest share. Integers only, so the result is equal on any machine.
//! Cost: channels x stacks multiplications a stretch, eight at a time; stacks and channels without any weight are
//! left out. Memory: a table of a few bytes for each half dot of the two sides.

use maths::Maths;
use protocol::walk::{EDGE, MOST, Tile, Walk};

use super::rule::{LANES, Lanes, Source, UNIT, blocks};
use crate::axis::Axis;
use appearance::gamut::InkMix;
use appearance::weights::ONE;

/// The unit of basis weights within a stretch.
const WEIGHT: u32 = 1 << 16;

/// Weights that processors fetch together: 64 bytes.
const LINE: usize = 32;

/// The curve of all tiles with one size and orientation, as tables.
pub(crate) struct Shape {
    tile: Tile,
    /// Position on the curve of each dot, row by row.
    pub(crate) order: Vec<u16>,
    /// The middle of each stretch in half dots from the tile's corner, and its number of dots.
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
                let middle = |side: fn(u16) -> u16| {
                    let sum: u32 = dots.iter().map(|&o| 2 * u32::from(side(o)) + 1).sum();
                    (sum + n / 2) / n
                };
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

/// Everything about a document on a rectangle of dots that is constant along the walk.
pub(crate) struct Lattice<'a> {
    mix: &'a InkMix,
    /// Numbers in `mix.stacks` of the stacks with weight, ascending.
    pub(crate) stacks: Vec<u8>,
    /// Channels with weight.
    channels: Vec<usize>,
    /// For each group of eight of these stacks, the shares of each of these channels.
    shares: Vec<Lanes>,
    shapes: Vec<Shape>,
    across: Axis,
    down: Axis,
}

impl<'a> Lattice<'a> {
    /// For a walk over the dots of the document. The mix has been checked.
    pub(crate) fn new(mix: &'a InkMix, walk: &Walk) -> Lattice<'a> {
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
        let share = |block: usize, channel: usize| {
            let stack = |l: usize| stacks.get(block * LANES + l);
            Lanes(std::array::from_fn(|l| {
                stack(l).map_or(0, |&q| i32::from(mix.matrix[channel][usize::from(q)]))
            }))
        };
        let shares = (0..blocks(stacks.len()))
            .flat_map(|block| channels.iter().map(move |&channel| (block, channel)))
            .map(|(block, channel)| share(block, channel))
            .collect();
        let finer = (maps.width() > width, maps.height() > height);
        let axis =
            |finer, dots, pixels| if finer { Axis::over(dots, pixels) } else { Axis::between(dots, pixels) };
        // Rounded up, so that an odd number of dots counts as two dots a pixel.
        let coarse =
            |dots: usize| width.div_ceil(dots) >= maps.width() && height.div_ceil(dots) >= maps.height();
        let stretch = if coarse(4) {
            16
        } else if coarse(2) {
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
            channels,
            shares,
            shapes,
            across: axis(finer.0, width, maps.width()),
            down: axis(finer.1, height, maps.height()),
        }
    }

    /// The tables of a tile of the walk.
    pub(crate) fn shape(&self, tile: &Tile) -> &Shape {
        // `new` made a shape for every tile of the walk.
        self.shapes.iter().find(|shape| shape.fits(tile)).unwrap_or(&self.shapes[0])
    }

    /// Reads a little of all pixels of a tile at once. Along the curve, each would be waited for by itself.
    fn touch(&self, tile: &Tile) {
        let (Axis::Between(across), Axis::Between(down)) = (&self.across, &self.down) else { return };
        let pixels = |axis: &[(u32, u16)], from: u16, dots: u16| {
            let (from, end) = (2 * usize::from(from), 2 * (usize::from(from) + usize::from(dots)));
            axis[from].0 as usize..axis[end].0 as usize + 1
        };
        let maps = &self.mix.maps;
        let (columns, channels) = (pixels(across, tile.x, tile.w), maps.channels());
        let mut all = 0;
        for row in pixels(down, tile.y, tile.h) {
            let row =
                &maps.data()[(row * maps.width() + columns.start) * channels..][..columns.len() * channels];
            all |= row.iter().step_by(LINE).fold(0, |all, weight| all | weight);
        }
        std::hint::black_box(all);
    }

    /// The mix along these tiles, from a dot of the curve of the first.
    pub(crate) fn along_from<T: Iterator<Item = Tile>>(&self, mut tiles: T, offset: usize) -> Along<'_, T> {
        let tile = tiles.next().map(|tile| {
            let shape = self.shape(&tile);
            // All stretches but the last are equally long.
            let dots = usize::from(shape.stretches[0].2);
            (tile, shape, offset / dots, (offset % dots) as u32)
        });
        let (skip, tile) =
            (tile.map_or(0, |tile| tile.3), tile.map(|(tile, shape, at, _)| (tile, shape, at)));
        Along { tile, skip, ..self.along(tiles) }
    }

    /// The mix along these tiles.
    pub(crate) fn along<T: Iterator<Item = Tile>>(&self, tiles: T) -> Along<'_, T> {
        Along {
            lattice: self,
            tiles,
            tile: None,
            skip: 0,
            weights: vec![0; self.mix.maps.channels()],
            sums: vec![0; self.mix.maps.channels()],
            mixed: None,
        }
    }

    /// What a tile asks for of each of `stacks`, in dots: the sum over its dots, each at its own place. Every pixel is read once.
    #[inline(always)]
    pub(crate) fn asked(&self, tile: &Tile) -> Vec<f64> {
        let maps = &self.mix.maps;
        let (mut across, mut down) = (Vec::new(), Vec::new());
        let range = |from: u16, dots: u16| usize::from(from)..usize::from(from) + usize::from(dots);
        let (left, top) = (
            self.across.sum(range(tile.x, tile.w), &mut across),
            self.down.sum(range(tile.y, tile.h), &mut down),
        );
        // At most ONE times the parts of the tile's dots: 2^15 * 2^36.
        let mut sums = vec![0u64; maps.channels()];
        for (y, &part_y) in (top..).zip(&down) {
            let pixels =
                maps.data()[(y * maps.width() + left) * maps.channels()..].chunks_exact(maps.channels());
            for (pixel, &part_x) in pixels.zip(&across) {
                for (sum, &weight) in sums.iter_mut().zip(pixel) {
                    *sum += part_x * part_y * u64::from(weight);
                }
            }
        }
        let unit = (f64::from(Axis::FULL) * f64::from(ONE)).squared();
        let share = |&q: &u8| {
            let shares = self.mix.matrix.iter().map(|shares| f64::from(shares[usize::from(q)]));
            sums.iter().zip(shares).map(|(&sum, share)| sum as f64 * share).sum::<f64>() / unit
        };
        self.stacks.iter().map(share).collect()
    }

    /// Basis weights in units of 1/[`WEIGHT`] at a place in half dots, if neither axis is finer than the dots.
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

    /// The same by exact parts of pixels along both axes.
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
        let (mut total, mut most) = ([0i32; LANES], [0i32; LANES]);
        let channels = self.channels.len();
        for (out, shares) in out.iter_mut().zip(self.shares.chunks_exact(channels)) {
            let mut sum = [0i32; LANES];
            for (&channel, share) in self.channels.iter().zip(shares) {
                let weight = weights[channel] as i32;
                for (sum, share) in sum.iter_mut().zip(share.0) {
                    // The full sum is about 2^31, which fits if the bits are read as an unsigned number.
                    *sum = sum.wrapping_add(weight.wrapping_mul(share));
                }
            }
            for l in 0..LANES {
                // From 2^-31 to 2^-18.
                let share = ((sum[l] as u32 + (1 << 12)) >> 13) as i32;
                out.0[l] = share;
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
pub(crate) struct Along<'a, T> {
    lattice: &'a Lattice<'a>,
    tiles: T,
    tile: Option<(Tile, &'a Shape, usize)>,
    /// Dots at the beginning of the next stretch that are left out.
    skip: u32,
    weights: Vec<u32>,
    sums: Vec<u64>,
    /// The place of the last mix, which flat or enlarged documents often need again.
    mixed: Option<((u32, u16), (u32, u16))>,
}

impl<T: Iterator<Item = Tile>> Along<'_, T> {
    /// Reads the basis weights of the next stretch, and returns the number of its dots; `None` beyond the last tile.
    #[inline(always)]
    fn read(&mut self) -> Option<u32> {
        let lattice = self.lattice;
        let (tile, shape, at) = match self.tile.take() {
            Some(here) => here,
            None => {
                let tile = self.tiles.next()?;
                lattice.touch(&tile);
                (tile, lattice.shape(&tile), 0)
            }
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
        Some(u32::from(dots) - std::mem::take(&mut self.skip))
    }
}

impl<T: Iterator<Item = Tile>> Source for Along<'_, T> {
    #[inline(always)]
    fn stretch(&mut self, out: &mut [Lanes]) -> u32 {
        let Some(dots) = self.read() else {
            // Never called beyond the last tile; if it were, the first stack would get all weight.
            out.fill(Lanes::default());
            out[0].0[0] = UNIT;
            return u32::MAX;
        };
        self.lattice.shares(&self.weights, out);
        dots
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::weights::{WeightMaps, quantise};
    use inks::Stack;
    use proptest::prelude::*;
    use protocol::ink::Ink;

    fn random(seed: u64, i: usize) -> f64 {
        let v = (seed ^ i as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((v ^ (v >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1u64 << 24) as f64
    }

    /// Three channels over five stacks; stack 2 has no share, channel 1 only where `x` is even.
    fn mix(width: usize, height: usize, seed: u64) -> InkMix {
        let mut data = vec![0; width * height * 3];
        for (pixel, out) in data.chunks_exact_mut(3).enumerate() {
            let second = if (pixel % width).is_multiple_of(2) { random(seed, 3 * pixel + 1) } else { 0.0 };
            quantise(&[random(seed, 3 * pixel) + 0.01, second, random(seed, 3 * pixel + 2)], out);
        }
        let matrix = vec![
            vec![ONE, 0, 0, 0, 0],
            vec![0, ONE / 4, 0, ONE / 2, ONE / 4],
            vec![100, 10_000, 0, ONE - 10_100, 0],
        ];
        let stacks = std::iter::once(Stack::SUBSTRATE).chain(Ink::ALL.map(|ink| Stack::new([ink])));
        InkMix {
            stacks: stacks.take(5).collect(),
            maps: WeightMaps::new(width, height, 3, data).unwrap(),
            matrix,
        }
    }

    /// The parts of the pixels along one side, in floating point, for the dots between `from` and `to`.
    fn parts(dots: usize, pixels: usize, from: f64, to: f64) -> Vec<(usize, f64)> {
        let scale = pixels as f64 / dots as f64;
        if pixels > dots {
            let (from, to) = (from * scale, to * scale);
            let covered = |p: usize| ((p + 1) as f64).min(to) - (p as f64).max(from);
            return (0..pixels)
                .map(|p| (p, covered(p).max(0.0) / (to - from)))
                .filter(|p| p.1 > 0.0)
                .collect();
        }
        let at = ((from + to) / 2.0 * scale - 0.5).clamp(0.0, (pixels - 1) as f64);
        let (pixel, part) = (at.floor() as usize, at.fract());
        if part > 0.0 { vec![(pixel, 1.0 - part), (pixel + 1, part)] } else { vec![(pixel, 1.0)] }
    }

    proptest! {
        #[test]
        fn shares_are_the_bilinear_or_averaged_weights_times_the_matrix(
            (pw, ph) in (1usize..40, 1usize..40), (width, height) in (1u16..140, 1u16..140), seed: u64,
        ) {
            let mix = mix(pw, ph, seed);
            let walk = Walk::new(width, height);
            let lattice = Lattice::new(&mix, &walk);
            prop_assert!(!lattice.stacks.contains(&2) && lattice.stacks.is_sorted());
            let tiles = || walk.bands().flat_map(|band| band.tiles());
            let mut along = lattice.along(tiles());
            let mut out = vec![Lanes::default(); blocks(lattice.stacks.len())];
            for tile in tiles() {
                let mut curve = [0; MOST];
                let n = tile.fill(&mut curve);
                let mut done = 0;
                while done < n {
                    let dots = along.stretch(&mut out) as usize;
                    let offsets = &curve[done..done + dots];
                    done += dots;
                    let shares = out[0].0;
                    prop_assert_eq!(shares.iter().sum::<i32>(), UNIT);
                    let middle = |of: fn(u16) -> u16, corner: u16| {
                        let sum: f64 = offsets.iter().map(|&o| f64::from(of(o)) + 0.5).sum();
                        f64::from(corner) + sum / dots as f64
                    };
                    let (x, y) = (middle(|o| o % EDGE, tile.x), middle(|o| o / EDGE, tile.y));
                    let across = parts(width.into(), pw, x - 0.5, x + 0.5);
                    let down = parts(height.into(), ph, y - 0.5, y + 0.5);
                    // Half a half dot of rounding, on either side, moves a weight by at most that part of a pixel.
                    let slack = 0.01 + 0.25 * (pw as f64 / f64::from(width)).min(1.0) * f64::from(u8::from(dots > 1))
                        + 0.25 * (ph as f64 / f64::from(height)).min(1.0) * f64::from(u8::from(dots > 1));
                    for (lane, &q) in lattice.stacks.iter().enumerate() {
                        let mut wanted = 0.0;
                        for &(row, part_y) in &down {
                            for &(column, part_x) in &across {
                                let weights = mix.maps.at(row * pw + column).iter().zip(&mix.matrix);
                                wanted += part_x * part_y * weights
                                    .map(|(&a, shares)| f64::from(a) * f64::from(shares[usize::from(q)]))
                                    .sum::<f64>() / f64::from(ONE).powi(2);
                            }
                        }
                        let found = f64::from(shares[lane]) / f64::from(UNIT);
                        prop_assert!((found - wanted).abs() < slack, "stack {} at ({}, {}): {} not {}", q, x, y, found, wanted);
                    }
                }
            }
        }

        /// Where a pixel is a whole square of dots in every tile, its own weights come through unblended.
        #[test]
        fn the_middle_of_a_pixel_has_the_pixels_own_weights(seed: u64) {
            let mix = mix(16, 16, seed);
            let walk = Walk::new(64, 64);
            let lattice = Lattice::new(&mix, &walk);
            let tile = walk.bands().next().unwrap().tiles().next().unwrap();
            let mut curve = [0; MOST];
            tile.fill(&mut curve);
            let mut along = lattice.along(std::iter::once(tile));
            let mut out = vec![Lanes::default(); 1];
            for dots in curve.chunks(16) {
                prop_assert_eq!(along.stretch(&mut out), 16);
                let pixel = usize::from(dots[0] / EDGE / 4) * 16 + usize::from(dots[0] % EDGE / 4);
                for (lane, &q) in lattice.stacks.iter().enumerate() {
                    let exact: u32 = mix.maps.at(pixel).iter().zip(&mix.matrix)
                        .map(|(&a, shares)| u32::from(a) * u32::from(shares[usize::from(q)])).sum();
                    // Exact to the unit, but for what the largest takes to make the sum whole.
                    prop_assert!(out[0].0[lane].abs_diff((exact >> 12) as i32) <= 4);
                }
            }
        }
    }
}
