//! Dots that are no tone: the art gives them wholly to one stack, or the caller has fixed them.
//!
//! Problem: text and line art are exact to the dot only if a dot of one stack is printed as that stack, whatever its
//! surroundings owe.
//! Method: a pixel is solid when all its weight is on channels that are wholly the same stack. A dot is solid when all
//! pixels that it reads ([`Axis`]) are, to the same stack. A fixed dot overrides the mixture.
//! Cost: one look at each pixel, and a few bytes a dot where there is any solid. Memory: a byte a pixel.
//! Limits: stack number 255 of a mixture of 256 cannot be told from a tone and is halftoned.

use rayon::prelude::*;

use super::TONE;
use super::axis::Axis;
use appearance::gamut::InkMix;
use appearance::weights::ONE;

/// The solid dots of a rectangle.
pub(super) struct Solids<'a> {
    fixed: Option<&'a [u8]>,
    width: usize,
    /// Pixels across.
    across: usize,
    /// The stack of each pixel that is wholly one, or [`TONE`].
    pixels: Vec<u8>,
    /// First pixel of each dot and the one after the last.
    columns: Vec<(u32, u32)>,
    rows: Vec<(u32, u32)>,
    /// Whether any pixel is solid.
    any: bool,
}

/// The pixels that each dot along one side reads.
fn reads(dots: usize, pixels: usize, finer: bool) -> Vec<(u32, u32)> {
    let axis = if finer { Axis::over(dots, pixels) } else { Axis::between(dots, pixels) };
    (0..dots)
        .map(|dot| {
            let (mut first, mut end) = (u32::MAX, 0);
            axis.parts(2 * dot + 1, |pixel, _| {
                (first, end) = (first.min(pixel as u32), end.max(pixel as u32 + 1));
            });
            (first, end)
        })
        .collect()
}

impl<'a> Solids<'a> {
    /// Of a checked mixture on so many dots. `fixed` has one byte a dot.
    pub(super) fn new(mix: &InkMix, width: usize, height: usize, fixed: Option<&'a [u8]>) -> Solids<'a> {
        let maps = &mix.maps;
        let pure: Vec<u8> = mix
            .matrix
            .iter()
            .map(|shares| shares.iter().position(|&share| share == ONE).map_or(TONE, |q| q as u8))
            .collect();
        let class = |pixel: &[u16]| {
            let mut found = pixel.iter().zip(&pure).filter(|&(&weight, _)| weight > 0).map(|(_, &q)| q);
            let first = found.next().unwrap_or(TONE);
            if found.all(|q| q == first) { first } else { TONE }
        };
        let row = maps.width() * maps.channels();
        let some = pure.iter().any(|&q| q != TONE);
        let mut pixels = vec![TONE; maps.width() * maps.height()];
        let any = some
            && pixels
                .par_chunks_mut(maps.width())
                .zip(maps.data().par_chunks_exact(row))
                .map(|(out, row)| {
                    let mut any = false;
                    for (out, pixel) in out.iter_mut().zip(row.chunks_exact(maps.channels())) {
                        *out = class(pixel);
                        any |= *out != TONE;
                    }
                    any
                })
                .reduce(|| false, |a, b| a | b);
        let columns = reads(width, maps.width(), maps.width() > width);
        let rows = reads(height, maps.height(), maps.height() > height);
        Solids { fixed, width, across: maps.width(), pixels, columns, rows, any }
    }

    /// Whether no dot is solid.
    pub(super) fn none(&self) -> bool {
        !self.any && self.fixed.is_none_or(|fixed| fixed.iter().all(|&stack| stack == TONE))
    }

    /// The stack of a dot that is solid, or [`TONE`].
    pub(super) fn at(&self, x: usize, y: usize) -> u8 {
        if let Some(fixed) = self.fixed
            && fixed[y * self.width + x] != TONE
        {
            return fixed[y * self.width + x];
        }
        let ((left, right), (top, bottom)) = (self.columns[x], self.rows[y]);
        let row = |row: u32| &self.pixels[row as usize * self.across..][left as usize..right as usize];
        let first = row(top)[0];
        if (top..bottom).all(|y| row(y).iter().all(|&class| class == first)) { first } else { TONE }
    }

    /// Whether any dot of a rectangle may be solid.
    pub(super) fn any(&self, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> bool {
        if columns.is_empty() || rows.is_empty() {
            return false;
        }
        let solid = |line: &[u8]| line.iter().any(|&class| class != TONE);
        let fixed = self.fixed.is_some_and(|fixed| {
            rows.clone().any(|y| solid(&fixed[y * self.width..][columns.start..columns.end]))
        });
        let (left, right) = (self.columns[columns.start].0, self.columns[columns.end - 1].1);
        let (top, bottom) = (self.rows[rows.start].0, self.rows[rows.end - 1].1);
        fixed
            || self.any
                && (top..bottom)
                    .any(|y| solid(&self.pixels[y as usize * self.across..][left as usize..right as usize]))
    }
}
