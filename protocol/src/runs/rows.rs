//! The rows of a band in memory, and which of their bytes are worth a look.
//!
//! Problem: a small picture on a page leaves most of each row blank, and clearing, copying and packing whole rows takes a
//! microcontroller longer than decoding what is in them. Method: the columns that have got ink since the memory was last cleared
//! are known as one range of bytes for all rows of the band. Limits: two pictures side by side are one range.

use super::Defect;
use core::ops::Range;

/// The rows of a band.
pub(super) struct Rows<'b> {
    /// Blank at the beginning.
    pub(super) memory: &'b mut [u8],
    /// Bytes of a row.
    pub(super) stride: usize,
    /// Rows of the band and dots of each.
    pub(super) height: u16,
    pub(super) width: u16,
    pub(super) inked: &'b mut Inked,
}

impl Rows<'_> {
    /// Row `y`.
    pub(super) fn row(&mut self, y: u16) -> &mut [u8] {
        let at = usize::from(y) * self.stride;
        &mut self.memory[at..at + self.stride]
    }

    /// The `count` bytes at `x` of row `y`, and moves `x` behind them.
    pub(super) fn next(&mut self, y: u16, x: &mut u16, count: usize) -> Result<&mut [u8], Defect> {
        let from = usize::from(*x);
        let end = from + count;
        *x = u16::try_from(end).map_err(|_| Defect::Row)?;
        self.inked.add(from, end);
        self.row(y).get_mut(from..end).ok_or(Defect::Row)
    }

    /// The place `count` bytes behind `x`.
    pub(super) fn skip(&self, x: u16, count: u16) -> Result<u16, Defect> {
        x.checked_add(count).filter(|&x| usize::from(x) <= self.stride).ok_or(Defect::Row)
    }

    /// Copies the row above to row `y`, which is not the first.
    pub(super) fn repeat(&mut self, y: u16) {
        let at = usize::from(y) * self.stride;
        let Range { start, end } = self.inked.range(self.stride);
        self.memory.copy_within(at - self.stride + start..at - self.stride + end, at + start);
    }
}

/// Which bytes of the rows in memory may have ink.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Inked {
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Inked {
    pub(super) const NONE: Inked = Inked { start: usize::MAX, end: 0 };
    pub(super) const ALL: Inked = Inked { start: 0, end: usize::MAX };

    /// Bytes from `start` to `end` may have ink too.
    pub(super) fn add(&mut self, start: usize, end: usize) {
        *self = Inked { start: self.start.min(start), end: self.end.max(end) };
    }

    /// Those of a row of `stride` bytes.
    pub(super) fn range(self, stride: usize) -> Range<usize> {
        let end = self.end.min(stride);
        self.start.min(end)..end
    }
}
