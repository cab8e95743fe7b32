//! Rows as runs: writing them. The form and its reader: [`super::across`].
//!
//! Method: of each different row, and of its difference from the row above, the places where off and on change are
//! found a word at a time. Each of the four kinds is measured on a copy of the model, and the shortest is written. The
//! side of the cells is estimated from how many runs are multiples of each.

use super::across::{CELLS, DIFFERENCE, KIND_BITS, LENGTH_BITS, Model, ONES, in_cells};
use super::bit_writer::BitWriter;
use super::rice::Mean;
use super::{MAX_STRIDE, form, stride};
use heapless::Vec;

/// Columns at which a row changes between off and on.
type Changes = Vec<u16, { MAX_STRIDE * 8 }>;

/// Sides of cells beside 1, and eighths of a bit that each spares a run: the logarithm of the side.
const SIDES: [(u8, u32); 7] = [(2, 8), (3, 13), (4, 16), (6, 21), (8, 24), (12, 29), (24, 37)];

/// Eighths of a bit that a run in dots takes, roughly; more than any side spares.
const RUN: u32 = 40;

/// All sides divide this.
const BLOCK: u16 = 24;

/// Writes the band, or gives up when there is no room for it.
pub(super) fn put_across(rows: &[u8], width: u16, out: &mut [u8]) -> Option<usize> {
    let stride = stride(width);
    let mut changes = Changes::new();
    let side = side(rows, stride, &mut changes);
    let [head, unit, codes @ ..] = out else { return None };
    (*head, *unit) = (form::ACROSS, side);
    let mut bits = BitWriter::new(codes);
    let mut model = Model::START;
    let mut difference = Changes::new();
    let mut above: &[u8] = &[];
    for (row, alike) in different(rows, stride) {
        find_changes(row, &[], &mut changes);
        find_changes(row, above, &mut difference);
        let of = |kind: u32| if kind & DIFFERENCE != 0 { &difference[..] } else { &changes[..] };
        let kinds = if side > 1 { DIFFERENCE | CELLS } else { DIFFERENCE };
        let mut best = (u32::MAX, 0);
        for kind in (0..4).filter(|kind| kind & kinds == *kind) {
            let mut length = 0;
            let row = RunRow { kind, changes: of(kind), width, side };
            let complete = row.put(&mut { model }, &mut |_, count| {
                length += count;
                (length < best.0).then_some(())
            });
            if complete.is_some() {
                best = (length, kind);
            }
        }
        let kind = best.1;
        bits.put(kind, KIND_BITS)?;
        RunRow { kind, changes: of(kind), width, side }
            .put(&mut model, &mut |value, count| bits.put(value, count))?;
        put_dots(&mut model.alike, alike, &mut |value, count| bits.put(value, count))?;
        above = row;
    }
    bits.end().map(|length| 2 + length)
}

/// The different rows of a band, and how many like each follow it.
fn different(rows: &[u8], stride: usize) -> impl Iterator<Item = (&[u8], u32)> {
    let mut rows = rows.chunks_exact(stride).peekable();
    core::iter::from_fn(move || {
        let row = rows.next()?;
        let mut alike = 0;
        while rows.next_if(|next| *next == row).is_some() {
            alike += 1;
        }
        Some((row, alike))
    })
}

/// The side of cells with which the band is shortest, by a rough count of bits.
fn side(rows: &[u8], stride: usize, changes: &mut Changes) -> u8 {
    let (mut in_dots, mut in_cells) = (0, [0; SIDES.len()]);
    let mut above: &[u8] = &[];
    for (row, _) in different(rows, stride) {
        let (mut dots, mut cells) = (u32::MAX, [u32::MAX; SIDES.len()]);
        for base in [&[][..], above] {
            find_changes(row, base, changes);
            let mut lengths = [0u32; BLOCK as usize];
            for pair in changes.windows(2) {
                lengths[usize::from((pair[1] - pair[0]) % BLOCK)] += 1;
            }
            let all: u32 = lengths.iter().sum();
            dots = dots.min(all * RUN);
            for (length, (side, spared)) in cells.iter_mut().zip(SIDES) {
                let whole: u32 = lengths.iter().step_by(side.into()).sum();
                *length = (*length).min(whole * (RUN - spared) + (all - whole) * (RUN + (ONES + 1) * 8));
            }
        }
        in_dots += dots;
        for (sum, length) in in_cells.iter_mut().zip(cells) {
            *sum += length.min(dots);
        }
        above = row;
    }
    let best = in_cells.iter().zip(SIDES).min_by_key(|(length, _)| **length);
    best.filter(|(length, _)| **length < in_dots).map_or(1, |(_, (side, _))| side)
}

/// Finds where `row`, or its difference from `above` if that is not empty, changes between off and on.
fn find_changes(row: &[u8], above: &[u8], changes: &mut Changes) {
    changes.clear();
    let mut last = 0;
    for (i, bytes) in row.chunks(8).enumerate() {
        let mut word = wide(bytes);
        if !above.is_empty() {
            word ^= wide(&above[i * 8..i * 8 + bytes.len()]);
        }
        let mut edges = word ^ (word >> 1 | last << 63);
        last = word & 1;
        while edges != 0 {
            let place = edges.leading_zeros();
            edges &= !(1 << (63 - place));
            #[expect(clippy::cast_possible_truncation, reason = "a row has at most 9880 dots")]
            // There is room for a change at every dot.
            let _ = changes.push((i as u32 * 64 + place) as u16);
        }
    }
}

/// Up to eight bytes, the first in the top bits.
fn wide(bytes: &[u8]) -> u64 {
    let mut all = [0; 8];
    all[..bytes.len()].copy_from_slice(bytes);
    u64::from_be_bytes(all)
}

/// A row to write.
struct RunRow<'c> {
    kind: u32,
    changes: &'c [u16],
    width: u16,
    side: u8,
}

impl RunRow<'_> {
    /// Puts the runs.
    fn put(&self, model: &mut Model, put: &mut impl FnMut(u32, u32) -> Option<()>) -> Option<()> {
        let side = u32::from(self.side);
        let mut from = 0;
        let mut index = 0;
        for &to in self.changes.iter().take_while(|to| **to < self.width) {
            let length = u32::from(to - from);
            self.put_run(length, index, side, model, put)?;
            (from, index) = (to, index + 1);
        }
        // The last may be longer than is left.
        let left = u32::from(self.width - from);
        let cells = in_cells(self.kind, index);
        let unit = if cells { side } else { 1 };
        let value = left.div_ceil(unit) - u32::from(index > 0);
        let mean = model.mean_of(self.kind, index);
        let k = mean.parameter();
        if (value >> k) + k < ONES {
            mean.add(value);
            put_rice(value, k, put)
        } else {
            put((1 << (ONES + 1)) - 1, ONES + 1)
        }
    }

    fn put_run(
        &self,
        length: u32,
        index: u32,
        side: u32,
        model: &mut Model,
        put: &mut impl FnMut(u32, u32) -> Option<()>,
    ) -> Option<()> {
        let mut kind = self.kind;
        if in_cells(kind, index) {
            let (value, mean) = ((length / side).saturating_sub(1), model.mean_of(kind, index));
            let k = mean.parameter();
            if length.is_multiple_of(side) && value >> k < ONES {
                mean.add(value);
                return put_rice(value, k, put);
            }
            put((1 << (ONES + 1)) - 2, ONES + 1)?;
            kind &= !CELLS;
        }
        put_dots(model.mean_of(kind, index), length - u32::from(index > 0), put)
    }
}

/// Puts a number that counts dots or rows.
fn put_dots(mean: &mut Mean, value: u32, put: &mut impl FnMut(u32, u32) -> Option<()>) -> Option<()> {
    let k = mean.parameter();
    mean.add(value);
    if value >> k < ONES {
        return put_rice(value, k, put);
    }
    put((1 << (ONES + 1)) - 2, ONES + 1)?;
    put(value, LENGTH_BITS)
}

/// Puts a value with few quotients.
fn put_rice(value: u32, k: u32, put: &mut impl FnMut(u32, u32) -> Option<()>) -> Option<()> {
    let quotient = value >> k;
    put((1 << (quotient + 1)) - 2, quotient + 1)?;
    put(value & ((1 << k) - 1), k)
}
