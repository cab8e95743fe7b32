//! Adaptive Rice codes: the parameter, the same on both sides, and a quick way to read short codes.

/// Ones that announce a plain value.
pub(super) const ESCAPE: u32 = 20;

/// Running mean of values of one sort, such as the lengths of off runs.
#[derive(Clone, Copy)]
pub(super) struct Mean {
    sum: u32,
    count: u32,
    /// Smallest with `count << parameter >= sum`.
    parameter: u32,
}

impl Mean {
    pub(super) const START: Mean = Mean { sum: 32, count: 4, parameter: 3 };

    /// The start for values that are mostly 0 to 3: cells and rows.
    pub(super) const SHORT: Mean = Mean { sum: 8, count: 4, parameter: 1 };

    /// The parameter for the next value: at most 20, because no value counts for more than 2^20.
    pub(super) fn parameter(self) -> u32 {
        self.parameter
    }

    /// Adds a value that was coded with the present parameter. A single long gap must not make the short ones after it
    /// expensive, so it counts at most eightfold.
    pub(super) fn add(&mut self, value: u32) {
        self.sum += value.min(8 << self.parameter).min(1 << 20);
        self.count += 1;
        if self.count == 64 {
            self.sum /= 2;
            self.count /= 2;
        }
        while self.count << self.parameter < self.sum {
            self.parameter += 1;
        }
        while self.parameter > 0 && self.count << (self.parameter - 1) >= self.sum {
            self.parameter -= 1;
        }
    }
}

/// Bytes that are looked at ahead of a code.
const AHEAD: usize = 3;

/// Reads short codes from a word of bits. Most of a decoder's time is spent here.
pub(super) struct Ahead<'i> {
    input: &'i [u8],
    read: usize,
    bits: u32,
    held: u32,
}

impl<'i> Ahead<'i> {
    /// Goes on behind `held` bits, fewer than eight, which stand at the top of `bits`.
    pub(super) fn new(input: &'i [u8], bits: u32, held: u32) -> Ahead<'i> {
        Ahead { input, read: 0, bits, held }
    }

    /// The next value, of a code with fewer than `escape` ones. None if there are as many, or if the input may not have all of the
    /// code: nothing has been read of it then.
    #[inline(always)]
    pub(super) fn value(&mut self, escape: u32, mean: &mut Mean) -> Option<u32> {
        let &[one, two, three] = self.input.get(self.read..)?.first_chunk::<AHEAD>()?;
        if self.held <= 8 {
            self.bits |= u32::from_be_bytes([one, two, three, 0]) >> self.held;
            (self.held, self.read) = (self.held + 24, self.read + 3);
        } else if self.held <= 16 {
            self.bits |= u32::from_be_bytes([one, two, 0, 0]) >> self.held;
            (self.held, self.read) = (self.held + 16, self.read + 2);
        }
        let (mut rest, mut ones) = (self.bits, 0);
        while rest >> 31 == 1 && ones < escape {
            rest <<= 1;
            ones += 1;
        }
        let count = mean.parameter();
        if ones == escape || ones + 1 + count > self.held {
            return None;
        }
        rest <<= 1;
        // Shifted twice, since `count` may be 0.
        let value = ones << count | rest >> 1 >> (31 - count);
        (self.bits, self.held) = (rest << count, self.held - ones - 1 - count);
        mean.add(value);
        Some(value)
    }

    /// Gives back whole bytes, which can only be of this input: the bits that are held, how many, fewer than eight, and the bytes
    /// read.
    pub(super) fn end(self) -> (u32, u32, usize) {
        let held = self.held % 8;
        (self.bits & !(u32::MAX >> held), held, self.read - self.held as usize / 8)
    }
}
