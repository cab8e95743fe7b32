//! The adaptive parameter of the Rice codes, the same on both sides.

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
