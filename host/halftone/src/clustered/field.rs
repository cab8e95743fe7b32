//! The mixture on the dots of a rectangle: what a cell asks for.
//!
//! Problem: a cell needs the mean shares of its dots over all stacks.
//! Method: both axes are separable tables of pixels and parts, the walk's own ([`Axis`]), summed over the dots of a
//! cell. A row of cells takes its pixels down the axis once and then across for each cell.
//! Cost: pixels x channels a row of cells, then channels x stacks a cell. Memory: tables of a few bytes a dot of either side. Arithmetic is that of `f32`, each operation rounded once and in a
//! fixed order: equal on any machine.

use std::ops::Range;

use super::super::solids::Solids;
use super::evenness::{Evenness, FLAT};
use super::mask::{BLOCK, Mask, bits};
use crate::axis::Axis;
use appearance::gamut::InkMix;
use appearance::weights::ONE;

/// Stacks are padded to a multiple of this, so that sums are equal on every processor.
pub(crate) const LANES: usize = 8;

/// The pixels under each of a row of equal spans of dots.
struct Spans {
    /// First pixel, and where its parts begin.
    from: Vec<(u32, u32)>,
    /// Dots of the span that fall on each pixel; a span's parts sum to its dots.
    parts: Vec<f32>,
}

impl Spans {
    fn new(axis: &Axis, dots: usize, size: usize) -> Spans {
        let (mut from, mut parts) = (Vec::with_capacity(dots.div_ceil(size) + 1), Vec::new());
        let mut sums = Vec::new();
        for start in (0..dots).step_by(size) {
            let first = axis.sum(start..(start + size).min(dots), &mut sums);
            from.push((first as u32, parts.len() as u32));
            parts.extend(sums.iter().map(|&sum| sum as f32 / Axis::FULL as f32));
        }
        from.push((0, parts.len() as u32));
        Spans { from, parts }
    }

    /// First pixel and the parts of span `i`.
    fn get(&self, i: usize) -> (usize, &[f32]) {
        let (first, start) = self.from[i];
        (first as usize, &self.parts[start as usize..self.from[i + 1].1 as usize])
    }

    /// First pixel and the one after the last.
    fn pixels(&self, i: usize) -> (usize, usize) {
        let (first, parts) = self.get(i);
        (first, first + parts.len())
    }
}

/// A mixture on a rectangle of dots. Stacks are counted among those that have weight.
pub(crate) struct Field<'a> {
    mix: &'a InkMix,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Numbers in `mix.stacks` of the stacks with weight, ascending.
    pub(crate) stacks: Vec<u8>,
    /// Stacks and padding: a multiple of [`LANES`].
    pub(crate) lanes: usize,
    /// Channels with weight.
    channels: Vec<usize>,
    /// Share of [`LANES`] stacks after another in each of `channels`.
    matrix: Vec<[f32; LANES]>,
    pub(super) solids: &'a Solids<'a>,
    /// By size of span: single dots first.
    across: Vec<(usize, Spans)>,
    down: Vec<(usize, Spans)>,
}

impl<'a> Field<'a> {
    /// A checked mixture on so many dots, to be read in spans of these sizes.
    pub(crate) fn new(
        mix: &'a InkMix,
        width: usize,
        height: usize,
        sizes: &[usize],
        solids: &'a Solids<'a>,
    ) -> Field<'a> {
        let maps = &mix.maps;
        let count = maps.channels();
        let mut any = vec![0u16; count];
        for pixel in maps.data().chunks_exact(count) {
            for (any, weight) in any.iter_mut().zip(pixel) {
                *any |= weight;
            }
        }
        let channels: Vec<usize> = (0..count).filter(|&i| any[i] > 0).collect();
        let used = |q: &usize| channels.iter().any(|&i| mix.matrix[i][*q] > 0);
        let stacks: Vec<u8> = (0..mix.stacks.len()).filter(used).map(|q| q as u8).collect();
        let lanes = stacks.len().next_multiple_of(LANES);
        let mut matrix = vec![[0.0; LANES]; channels.len() * lanes / LANES];
        for (lanes, stacks) in matrix.chunks_exact_mut(channels.len().max(1)).zip(stacks.chunks(LANES)) {
            for (lanes, &channel) in lanes.iter_mut().zip(&channels) {
                for (share, &q) in lanes.iter_mut().zip(stacks) {
                    // A weight of ONE, and a share of ONE, make 1.
                    *share =
                        f32::from(mix.matrix[channel][usize::from(q)]) / (f32::from(ONE) * f32::from(ONE));
                }
            }
        }
        let spans = |dots: usize, pixels: usize| {
            let axis = if pixels > dots { Axis::over(dots, pixels) } else { Axis::between(dots, pixels) };
            std::iter::once(1)
                .chain(sizes.iter().copied())
                .map(|size| (size, Spans::new(&axis, dots, size)))
                .collect()
        };
        let (across, down) = (spans(width, maps.width()), spans(height, maps.height()));
        Field { mix, width, height, stacks, lanes, channels, matrix, solids, across, down }
    }

    fn spans(table: &[(usize, Spans)], size: usize) -> &Spans {
        // Every size that is asked for was given to `new`.
        table.iter().find(|(known, _)| *known == size).map_or(&table[0].1, |(_, spans)| spans)
    }

    /// The share of each stack in all pixels.
    pub(super) fn mean(&self) -> Vec<f32> {
        let maps = &self.mix.maps;
        let sums = maps.totals();
        let pixels = (maps.width() * maps.height()) as f64;
        let channels: Vec<f32> =
            self.channels.iter().map(|&channel| (sums[channel] as f64 / pixels) as f32).collect();
        let mut shares = vec![0.0; self.lanes];
        self.shares(&channels, &mut shares);
        shares.truncate(self.stacks.len());
        shares
    }

    /// For the pixels that dots of a block read, all of them without a mask: marks the stacks that have weight there, and tells how even
    /// they are.
    pub(super) fn survey(
        &self,
        (column, row): (usize, usize),
        dots: Option<&Mask>,
        present: &mut [bool],
    ) -> Evenness {
        let (left, right) = Field::spans(&self.across, BLOCK).pixels(column);
        let (top, bottom) = Field::spans(&self.down, BLOCK).pixels(row);
        let (maps, count, across) = (&self.mix.maps, self.mix.maps.channels(), right - left);
        let read = dots.map(|dots| self.read((column, row), dots, (left..right, top..bottom)));
        let is_read = |x: usize, y: usize| read.as_ref().is_none_or(|read| read[y * across + x]);
        let row = |y: usize| {
            maps.data()[((top + y) * maps.width() + left) * count..][..across * count].chunks_exact(count)
        };
        let (mut least, mut most) = (vec![u16::MAX; count], vec![0u16; count]);
        for y in 0..bottom - top {
            for (_, pixel) in row(y).enumerate().filter(|&(x, _)| is_read(x, y)) {
                for ((least, most), &weight) in least.iter_mut().zip(&mut most).zip(pixel) {
                    (*least, *most) = ((*least).min(weight), (*most).max(weight));
                }
            }
        }
        for &channel in self.channels.iter().filter(|&&channel| most[channel] > 0) {
            for (present, &q) in present.iter_mut().zip(&self.stacks) {
                *present |= self.mix.matrix[channel][usize::from(q)] > 0;
            }
        }
        let varies =
            most.iter().zip(&least).map(|(most, least)| most.saturating_sub(*least)).max().unwrap_or(0);
        let (mut pairs, mut alike) = (0, 0);
        let mut count_pair = |a: (usize, usize), b: (usize, usize)| {
            if is_read(a.0, a.1) && is_read(b.0, b.1) {
                let at = |(x, y): (usize, usize)| maps.at((top + y) * maps.width() + left + x);
                (pairs, alike) = (pairs + 1, alike + u32::from(at(a) == at(b)));
            }
        };
        for y in (0..bottom - top).filter(|_| varies > FLAT) {
            (1..across).for_each(|x| count_pair((x - 1, y), (x, y)));
            if y > 0 {
                (0..across).for_each(|x| count_pair((x, y - 1), (x, y)));
            }
        }
        Evenness { varies, alike: if pairs > 0 { f64::from(alike) / f64::from(pairs) } else { 1.0 } }
    }

    /// Which pixels of a rectangle dots of a block read, row by row.
    fn read(
        &self,
        (column, row): (usize, usize),
        dots: &Mask,
        (columns, rows): (Range<usize>, Range<usize>),
    ) -> Vec<bool> {
        let mut read = vec![false; columns.len() * rows.len()];
        for (y, &dots) in dots.iter().enumerate().filter(|(_, dots)| **dots != 0) {
            let (above, below) = self.down[0].1.pixels(row * BLOCK + y);
            for x in bits(dots) {
                let (from, to) = self.across[0].1.pixels(column * BLOCK + x);
                for y in above..below {
                    read[(y - rows.start) * columns.len() + from - columns.start..][..to - from].fill(true);
                }
            }
        }
        read
    }

    /// On each dot of a window, row by row: the mean of `points` over its mixture, of which there is one for each stack of the
    /// mix. And whether all pixels under the window are alike.
    #[inline(always)]
    pub(crate) fn points(
        &self,
        (left, top): (usize, usize),
        (width, height): (usize, usize),
        points: &[[f32; 4]],
    ) -> (Vec<[f32; 4]>, bool) {
        let (maps, unit) = (&self.mix.maps, f32::from(ONE) * f32::from(ONE));
        let of_channel = |shares: &Vec<u16>| {
            let mut sum = [0.0; 4];
            for (point, &share) in points.iter().zip(shares).filter(|(_, share)| **share > 0) {
                (0..4).for_each(|c| sum[c] += f32::from(share) / unit * point[c]);
            }
            sum
        };
        let channels: Vec<[f32; 4]> = self.mix.matrix.iter().map(of_channel).collect();
        let (across, down) = (&self.across[0].1, &self.down[0].1);
        let (from, to) = (across.pixels(left).0, across.pixels(left + width - 1).1);
        let row = |y: usize| {
            maps.data()[(y * maps.width() + from) * channels.len()..][..(to - from) * channels.len()]
                .chunks_exact(channels.len())
        };
        let first = maps.at(down.pixels(top).0 * maps.width() + from);
        // Neighbouring rows of dots share their rows of pixels.
        let mut same = true;
        let mut kept = [(usize::MAX, vec![[0.0; 4]; to - from]), (usize::MAX, vec![[0.0; 4]; to - from])];
        let mut sums = vec![[0.0; 4]; to - from];
        let mut out = Vec::with_capacity(width * height);
        for y in top..top + height {
            sums.fill([0.0; 4]);
            let (above, parts) = down.get(y);
            for (y, &part) in (above..).zip(parts) {
                let (of, values) = &mut kept[y % 2];
                if *of != y {
                    *of = y;
                    for (value, weights) in values.iter_mut().zip(row(y)) {
                        same &= weights == first;
                        *value = [0.0; 4];
                        for (&weight, channel) in weights.iter().zip(&channels) {
                            (0..4).for_each(|c| value[c] += f32::from(weight) * channel[c]);
                        }
                    }
                }
                for (sum, value) in sums.iter_mut().zip(values) {
                    (0..4).for_each(|c| sum[c] += part * value[c]);
                }
            }
            for x in left..left + width {
                let (pixel, parts) = across.get(x);
                let mut mean = [0.0; 4];
                for (sum, &part) in sums[pixel - from..].iter().zip(parts) {
                    (0..4).for_each(|c| mean[c] += part * sum[c]);
                }
                out.push(mean);
            }
        }
        (out, same)
    }

    /// Adds what one dot asks for, in dots.
    pub(crate) fn add_dot(&self, x: usize, y: usize, scratch: &mut Vec<f32>, out: &mut [f32]) {
        let (across, down) = (&self.across[0].1, &self.down[0].1);
        let ((left, parts_x), (top, parts_y)) = (across.get(x), down.get(y));
        let (maps, count) = (&self.mix.maps, self.mix.maps.channels());
        scratch.clear();
        scratch.resize(self.channels.len(), 0.0);
        for (row, &part_y) in parts_y.iter().enumerate() {
            for (column, &part_x) in parts_x.iter().enumerate() {
                let at = ((top + row) * maps.width() + left + column) * count;
                for (sum, &channel) in scratch.iter_mut().zip(&self.channels) {
                    *sum += part_x * part_y * f32::from(maps.data()[at + channel]);
                }
            }
        }
        self.shares(scratch, out);
    }

    /// Adds channels times matrix.
    #[inline(always)]
    fn shares(&self, channels: &[f32], out: &mut [f32]) {
        let stacks = out.as_chunks_mut::<LANES>().0.iter_mut();
        for (out, shares) in stacks.zip(self.matrix.chunks_exact(channels.len().max(1))) {
            let mut sums = *out;
            for (weight, shares) in channels.iter().zip(shares) {
                for l in 0..LANES {
                    sums[l] += weight * shares[l];
                }
            }
            *out = sums;
        }
    }

    /// Pixels of a row of cells, taken down the axis.
    #[inline(always)]
    pub(crate) fn row(&self, size: usize, row: usize, out: &mut Row) {
        let (first, parts) = Field::spans(&self.down, size).get(row);
        let (maps, all, count) = (&self.mix.maps, self.mix.maps.channels(), self.channels.len());
        if out.of == Some((size, row)) {
            return;
        }
        out.of = Some((size, row));
        out.sums.clear();
        out.sums.resize(maps.width() * count, 0.0);
        for (y, &part) in (first..).zip(parts) {
            let pixels = &maps.data()[y * maps.width() * all..][..maps.width() * all];
            if count == all {
                for (sum, &weight) in out.sums.iter_mut().zip(pixels) {
                    *sum += part * f32::from(weight);
                }
                continue;
            }
            for (sums, pixel) in out.sums.chunks_exact_mut(count).zip(pixels.chunks_exact(all)) {
                for (sum, &channel) in sums.iter_mut().zip(&self.channels) {
                    *sum += part * f32::from(pixel[channel]);
                }
            }
        }
    }

    /// What a whole cell of a row asks for, in dots: into `out`.
    #[inline(always)]
    pub(crate) fn cell(&self, size: usize, column: usize, row: &mut Row, out: &mut [f32]) {
        let (first, parts) = Field::spans(&self.across, size).get(column);
        let count = self.channels.len();
        row.channels.clear();
        row.channels.resize(count, 0.0);
        for (sums, &part) in row.sums[first * count..].chunks_exact(count).zip(parts) {
            for (channel, &sum) in row.channels.iter_mut().zip(sums) {
                *channel += part * sum;
            }
        }
        out.fill(0.0);
        self.shares(&row.channels, out);
    }
}

/// Sums of [`Field::row`], kept from cell to cell.
#[derive(Default)]
pub(crate) struct Row {
    of: Option<(usize, usize)>,
    sums: Vec<f32>,
    channels: Vec<f32>,
}
