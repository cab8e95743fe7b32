//! Rows as runs: reading them, and the model both sides share.
//!
//! Problem: square cells on a lattice of their own, drawn edges and copies with gaps are noise along the walk, and their
//! rows hardly pack. Method: each different row is a sequence of off and on runs from left to right, either of the row
//! itself or of what changes from the row above, and in units of the cells' side or in dots. A cell's rows are alike and
//! cost nothing; edges that keep their places cost nothing in the difference. Nothing depends on where on the page the
//! cells lie. Each of these four kinds has running means of its own, so that drawn edges do not spoil the codes of cells.
//! Cost: some hundred cycles a run on a microcontroller and a copy for each row that is repeated. Limits: cells of
//! different sides in one row share one unit.

use super::MOST_RUNS;
use super::rice::{Ahead, Mean};
use super::rows::Rows;

/// Ones that announce what is not a quotient. Edges beside the lattice are common, so they are few.
pub(super) const ONES: u32 = 8;

/// Bits of a length that stands plain: no page is wider than 9880 dots.
pub(super) const LENGTH_BITS: u32 = 14;

/// Bits that say a row's kind.
pub(super) const KIND_BITS: u32 = 2;

/// Bit of a kind: the runs are those of the difference from the row above.
pub(super) const DIFFERENCE: u32 = 2;

/// Bit of a kind: the runs are measured in cells.
pub(super) const CELLS: u32 = 1;

/// The means of all codes of a band.
#[derive(Clone, Copy)]
pub(super) struct Model {
    /// Of the first run of a row of each kind, in dots.
    first: [Mean; 4],
    /// Of the off and on runs of each kind.
    runs: [[Mean; 2]; 4],
    /// Of the numbers of further rows like one.
    pub(super) alike: Mean,
}

impl Model {
    pub(super) const START: Model = {
        let (dots, cells) = ([Mean::START; 2], [Mean::SHORT; 2]);
        Model { first: [Mean::START; 4], runs: [dots, cells, dots, cells], alike: Mean::SHORT }
    };

    /// The mean of run `index` of a row of this kind.
    pub(super) fn mean_of(&mut self, kind: u32, index: u32) -> &mut Mean {
        let kind = kind as usize % 4;
        if index == 0 { &mut self.first[kind] } else { &mut self.runs[kind][index as usize % 2] }
    }
}

/// The unit of run `index` of a row of this kind: the first is measured in dots, since it leads to the lattice.
pub(super) fn in_cells(kind: u32, index: u32) -> bool {
    kind & CELLS != 0 && index > 0
}

/// Why [`Across::read`] has returned.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// All input has been read.
    More,
    /// A row is complete, or many runs have been read: others may run.
    Pause,
    /// The band is complete.
    Band,
}

#[derive(Clone, Copy)]
enum Part {
    Kind,
    /// The ones of a code, counted so far.
    Ones(u32),
    /// So many plain bits, below this.
    Plain(u32, u32),
}

/// Where in a band of row runs the decoder is.
pub(super) struct Across {
    side: u32,
    model: Model,
    /// Bits read and not used, from the top, and how many: fewer than eight between two parts.
    bits: u32,
    held: u32,
    part: Part,
    kind: u32,
    /// Number of the run, even ones are off.
    index: u32,
    /// The run under way is measured in dots although its row is in cells.
    escaped: bool,
    /// The row is complete, and the number of those like it comes.
    counting: bool,
    /// Dots of the row done.
    x: u32,
    /// Rows of the band done, and how many more are like the last.
    y: u16,
    alike: u16,
}

impl Across {
    /// `side` is not 0.
    pub(super) fn new(side: u8) -> Across {
        Across {
            side: side.into(),
            model: Model::START,
            bits: 0,
            held: 0,
            part: Part::Kind,
            kind: 0,
            index: 0,
            escaped: false,
            counting: false,
            x: 0,
            y: 0,
            alike: 0,
        }
    }

    /// Reads until a row is complete or [`MOST_RUNS`] have been read.
    pub(super) fn read(&mut self, input: &[u8], rows: &mut Rows<'_>) -> (usize, Stop) {
        let height = rows.height;
        let mut read = 0;
        let mut runs = MOST_RUNS;
        loop {
            if self.alike > 0 {
                rows.repeat(self.y);
                self.alike -= 1;
                self.y += 1;
                return (read, if self.y < height { Stop::Pause } else { Stop::Band });
            }
            if matches!(self.part, Part::Ones(0)) && self.index > 0 && !self.counting && !self.escaped {
                read += self.read_runs(&input[read..], rows, &mut runs);
                self.counting = self.x == rows.width.into();
                if runs == 0 {
                    // On a microcontroller other tasks wait for their turn.
                    return (read, Stop::Pause);
                }
            }
            let needed = match self.part {
                Part::Kind => KIND_BITS,
                Part::Ones(_) => 1,
                Part::Plain(count, _) => count,
            };
            while self.held < needed {
                // Never a byte more than needed: what follows belongs to the next band. At most 20 bits are needed, so there
                // is room.
                let Some(&byte) = input.get(read) else { return (read, Stop::More) };
                self.bits |= u32::from(byte) << (24 - self.held);
                self.held += 8;
                read += 1;
            }
            match self.part {
                Part::Kind => {
                    self.kind = self.take(KIND_BITS);
                    if self.kind & DIFFERENCE != 0 && self.y > 0 {
                        rows.repeat(self.y);
                    }
                    (self.x, self.index, self.part) = (0, 0, Part::Ones(0));
                }
                Part::Ones(before) => self.count_ones(before, rows),
                Part::Plain(count, above) => {
                    let value = above << count | self.take(count);
                    self.number(Some(value), rows);
                }
            }
            if self.counting && matches!(self.part, Part::Kind) {
                // At least this row itself.
                self.counting = false;
                self.y += 1;
                self.alike = self.alike.min(height - self.y);
                return (read, if self.y < height { Stop::Pause } else { Stop::Band });
            }
        }
    }

    /// Reads codes of the row under way while they are short and complete, at most `runs` of them, and returns how much was
    /// read.
    fn read_runs(&mut self, input: &[u8], rows: &mut Rows<'_>, runs: &mut u32) -> usize {
        let width = u32::from(rows.width);
        let row = rows.row(self.y);
        let unit = if in_cells(self.kind, self.index) { self.side } else { 1 };
        let means = &mut self.model.runs[self.kind as usize % 4];
        let mut codes = Ahead::new(input, self.bits, self.held);
        let (mut x, mut index) = (self.x, self.index);
        let (mut first, mut last) = (width, 0);
        while *runs > 0
            && x < width
            && let Some(value) = codes.value(ONES, &mut means[index as usize % 2])
        {
            let end = end_of(x, index, value, unit).min(width);
            if index % 2 == 1 {
                (first, last) = (first.min(x), end);
                flip(row, x, end);
            }
            (x, index) = (end, index + 1);
            *runs -= 1;
        }
        if first < last {
            rows.inked.add((first / 8) as usize, last.div_ceil(8) as usize);
        }
        (self.x, self.index) = (x, index);
        let read;
        (self.bits, self.held, read) = codes.end();
        read
    }

    /// Takes at most 31 bits that are held.
    fn take(&mut self, count: u32) -> u32 {
        // Shifted twice, since `count` may be 0.
        let value = self.bits >> 1 >> (31 - count);
        self.drop(count);
        value
    }

    fn drop(&mut self, count: u32) {
        self.bits <<= count;
        self.held -= count;
    }

    /// Whether the code under way counts cells.
    fn cells(&self) -> bool {
        !self.counting && !self.escaped && in_cells(self.kind, self.index)
    }

    /// The mean of the code under way.
    fn mean(&mut self) -> &mut Mean {
        if self.counting {
            return &mut self.model.alike;
        }
        let kind = if self.escaped { self.kind & !CELLS } else { self.kind };
        self.model.mean_of(kind, self.index)
    }

    /// Counts the ones of a code; some bits are held.
    fn count_ones(&mut self, before: u32, rows: &mut Rows<'_>) {
        let ones = self.bits.leading_ones().min(self.held).min(ONES + 1 - before);
        self.drop(ones);
        let count = before + ones;
        if count > ONES {
            return self.number(None, rows);
        }
        if self.held == 0 {
            self.part = Part::Ones(count);
            return;
        }
        self.drop(1);
        self.part = if count < ONES {
            Part::Plain(self.mean().parameter(), count)
        } else if self.cells() {
            self.escaped = true;
            Part::Ones(0)
        } else {
            Part::Plain(LENGTH_BITS, 0)
        };
    }

    /// A number is complete; `None` is all that is left.
    fn number(&mut self, value: Option<u32>, rows: &mut Rows<'_>) {
        if let Some(value) = value {
            self.mean().add(value);
        }
        self.part = Part::Ones(0);
        if self.counting {
            self.alike = value.and_then(|value| u16::try_from(value).ok()).unwrap_or(u16::MAX);
            self.part = Part::Kind;
            return;
        }
        let unit = if self.cells() { self.side } else { 1 };
        let end =
            value.map_or(u32::MAX, |value| end_of(self.x, self.index, value, unit)).min(rows.width.into());
        if self.index % 2 == 1 && self.x < end {
            rows.inked.add((self.x / 8) as usize, end.div_ceil(8) as usize);
            flip(rows.row(self.y), self.x, end);
        }
        (self.x, self.index, self.escaped) = (end, self.index + 1, false);
        self.counting = end == u32::from(rows.width);
    }
}

/// Where run `index` of a row ends that begins at `x` and has this number, below 2^24; it counts units of at most 255 dots, so
/// nothing overflows.
fn end_of(x: u32, index: u32, value: u32, unit: u32) -> u32 {
    // Only the first run may be empty.
    x + (value + u32::from(index > 0)) * unit
}

/// Flips dots `from..to` of a row, which has them; `from < to`.
fn flip(row: &mut [u8], from: u32, to: u32) {
    let (head, tail) = (0xff >> (from % 8), 0xff << (7 - (to - 1) % 8));
    match &mut row[(from / 8) as usize..to.div_ceil(8) as usize] {
        [one] => *one ^= head & tail,
        [first, middle @ .., last] => {
            *first ^= head;
            middle.iter_mut().for_each(|byte| *byte = !*byte);
            *last ^= tail;
        }
        [] => {}
    }
}
