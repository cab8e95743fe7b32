//! Runs along a space-filling walk: the halftone of the paper.
//!
//! Problem: runs of one stack must be as long as its minimum cluster, and the debt that they leave must stay near.
//! Method: error diffusion along the band walk ([`protocol::walk`]) of the document's rectangle, whose tiles are filled by Hilbert
//! curves, by the rule in [`rule`] on the mix sampled by [`mix`]; among solids region by region ([`regions`]). The walk is cut into
//! strips of [`STRIP`] bands, which are diffused independently.
//! Cost and memory: see the modules. Limits: a strip drops a few dots of debt at its end.
//! Source: section 4.2 of the 2009 paper.

pub(crate) mod mix;
mod regions;
mod rule;

use appearance::gamut::InkMix;
use observe::Observer;
use protocol::walk::{Band, MOST, Tile, Walk};
use rayon::prelude::*;

use super::solids::Solids;
use mix::Lattice;

/// Bands in a strip, enough work for a thread; the last strip has up to twice as many, so that none is short.
const STRIP: usize = 16;

/// The dots by the rule of the paper.
pub(super) fn walked(
    mix: &InkMix,
    size: (u16, u16),
    minimum: &[u16],
    solids: &Solids,
    observer: &dyn Observer,
) -> Vec<u8> {
    let walk = Walk::new(size.0, size.1);
    let lattice = Lattice::new(mix, &walk);
    let minimum: Vec<u16> = lattice.stacks.iter().map(|&q| minimum[usize::from(q)]).collect();

    let (width, length) = (usize::from(size.0), usize::from(size.1));
    let mut index = vec![0u8; width * length];
    let mut rest = &mut index[..];
    let bands: Vec<Band> = walk.bands().collect();
    let count = (bands.len() / STRIP).max(1);
    let mut strips = Vec::with_capacity(count);
    for i in 0..count {
        let bands = &bands[i * STRIP..if i + 1 == count { bands.len() } else { (i + 1) * STRIP }];
        let height: usize = bands.iter().map(|band| usize::from(band.height)).sum();
        let (rows, below) = rest.split_at_mut(height * width);
        rest = below;
        strips.push((bands, rows));
    }

    observer.begin("halftone", u64::from(walk.len()));
    let none = solids.none();
    strips.into_par_iter().for_each(|(bands, rows)| {
        let top = bands.first().map_or(0, |band| usize::from(band.y));
        if !none && solids.any(0..width, top..top + rows.len() / width) {
            let mut rest = rows;
            for band in bands {
                let (rows, below) = rest.split_at_mut(usize::from(band.height) * width);
                rest = below;
                regions::band(band, &lattice, &minimum, solids, rows, observer);
            }
            return;
        }
        let tiles = || bands.iter().flat_map(|band| band.tiles());
        let dots = bands.iter().map(|band| band.len()).sum();
        let mut rule = rule::Rule::new(&minimum, dots, rule::ABSENT);
        let mut source = lattice.along(tiles());
        let mut paint = Paint {
            lattice: &lattice,
            observer,
            rows,
            stride: width,
            top,
            tiles: tiles(),
            tile: None,
            line: [0; MOST + SLACK],
            filled: 0,
        };
        rule::walk(&mut rule, &mut source, &mut paint);
    });
    observer.end();
    index
}

/// Places beyond the end of a tile that a short run may overwrite.
const SLACK: usize = 16;

/// Writes runs along the walk to rows of the map, tile by tile.
struct Paint<'a, T> {
    lattice: &'a Lattice<'a>,
    observer: &'a dyn Observer,
    rows: &'a mut [u8],
    stride: usize,
    top: usize,
    tiles: T,
    tile: Option<Tile>,
    /// The dots of the tile in the order of its curve.
    line: [u8; MOST + SLACK],
    filled: usize,
}

impl<T: Iterator<Item = Tile>> rule::Sink for Paint<'_, T> {
    #[inline(always)]
    fn run(&mut self, k: usize, dots: u32) {
        let stack = self.lattice.stacks[k];
        let mut dots = dots as usize;
        while dots > 0 {
            if self.tile.is_none() {
                self.tile = self.tiles.next();
            }
            let Some(tile) = self.tile else { return };
            let area = usize::from(tile.area());
            let step = dots.min(area - self.filled);
            // Most runs are short, so one store of fixed length comes first; the next run overwrites the excess.
            self.line[self.filled..self.filled + SLACK].fill(stack);
            if step > SLACK {
                self.line[self.filled + SLACK..self.filled + step].fill(stack);
            }
            self.filled += step;
            dots -= step;
            if self.filled == area {
                self.lay(&tile);
                (self.tile, self.filled) = (None, 0);
            }
        }
    }
}

impl<T> Paint<'_, T> {
    fn lay(&mut self, tile: &Tile) {
        let shape = self.lattice.shape(tile);
        let (width, x) = (usize::from(tile.w), usize::from(tile.x));
        for (row, order) in shape.order.chunks_exact(width).enumerate() {
            let start = (usize::from(tile.y) - self.top + row) * self.stride + x;
            for (dot, &position) in self.rows[start..start + width].iter_mut().zip(order) {
                *dot = self.line[usize::from(position) % MOST];
            }
        }
        self.observer.advance(u64::from(tile.area()));
    }
}
