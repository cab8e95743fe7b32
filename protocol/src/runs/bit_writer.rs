//! Codes of any number of bits as bytes, filled from the top.

/// Writes bits from the top of each byte.
pub(super) struct BitWriter<'o> {
    out: &'o mut [u8],
    at: usize,
    pending: u32,
    held: u32,
}

impl<'o> BitWriter<'o> {
    pub(super) fn new(out: &'o mut [u8]) -> BitWriter<'o> {
        BitWriter { out, at: 0, pending: 0, held: 0 }
    }

    /// Puts the low `count` (at most 21) bits of `value`, which has no others.
    pub(super) fn put(&mut self, value: u32, count: u32) -> Option<()> {
        self.pending = self.pending << count | value;
        self.held += count;
        while self.held >= 8 {
            self.held -= 8;
            *self.out.get_mut(self.at)? = (self.pending >> self.held & 0xff) as u8;
            self.at += 1;
        }
        Some(())
    }

    pub(super) fn end(mut self) -> Option<usize> {
        let rest = (8 - self.held % 8) % 8;
        self.put(0, rest)?;
        Some(self.at)
    }
}
