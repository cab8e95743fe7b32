//! Decodes a pass stream into bands of rows, in bounded memory and from input in any portions.

use super::across::{Across, Stop};
use super::canvas::{Canvas, TileProgress};
use super::rice::{Ahead, ESCAPE, Mean};
use super::rows::{Inked, Rows};
use super::{Defect, MOST_RUNS, PLAIN_BITS, band_bytes, form, stride};
use crate::walk::{Placed, PlacedBand, Tile};

/// The result of [`Decoder::step`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// All input has been read, and the band is not complete.
    More,
    /// The next rows of the page are blank.
    Blank {
        /// First row.
        y: u16,
        /// Number of rows.
        rows: u16,
    },
    /// The next band is complete in the memory: rows of [`stride`] bytes each.
    Band {
        /// First row.
        y: u16,
        /// Number of rows.
        rows: u16,
        /// Bytes of each row after which all are blank.
        reach: usize,
    },
    /// The page is complete; input behind it is not read.
    End,
}

enum State {
    Form,
    Blank,
    Minimum,
    Runs(Runs),
    Row(RowState),
    Side,
    Across(Across),
    End,
}

/// Where in a runs band the decoder is.
struct Runs {
    minimum: u32,
    means: [Mean; 2],
    /// Number of the run, even ones are off.
    index: u32,
    /// Bits read and not used, from the top, and how many: fewer than eight between two codes.
    bits: u32,
    held: u32,
    /// Ones of the code under way.
    ones: u32,
    /// Parameter of the code under way, once the ones are over; [`PLAIN_BITS`] if the value stands plain.
    remainder: Option<u32>,
    /// Dots of the band done.
    done: u32,
    /// Where the run under way ends: beyond `done` while it is being inked.
    end: u32,
    /// The tile that is being inked, and which dots of the band are its own.
    tile: Option<Tile>,
    from: u32,
    to: u32,
    /// Tiles begun.
    tiles: usize,
    /// A tile, or a part of one, has been laid out in this step, or many runs have been read: others may run.
    pause: bool,
}

/// Where in a rows band the decoder is.
struct RowState {
    /// Row of the band.
    y: u16,
    part: RowPart,
}

enum RowPart {
    Head,
    /// Second byte of the varint, the first having been this.
    Tail(u8),
    Same,
    /// So many bytes of the row are left in the stream, and so many are in the memory.
    Data {
        left: u16,
        x: u16,
        run: Run,
    },
}

#[derive(Clone, Copy)]
enum Run {
    Head,
    /// So many bytes that stand as they are: all of a row that is not packed.
    Literal(u16),
    /// A byte, so many times.
    Repeat(u16),
}

/// Decodes one pass of a page.
pub struct Decoder {
    walk: Placed,
    next: usize,
    band: Option<PlacedBand>,
    state: State,
    canvas: Canvas,
    inked: Inked,
}

impl Default for Decoder {
    /// A decoder for planes without a dot, until [`Decoder::begin`].
    fn default() -> Decoder {
        Decoder::new(Placed::whole(0, 0))
    }
}

impl Decoder {
    /// A decoder for planes with this walk.
    pub fn new(walk: Placed) -> Decoder {
        let mut decoder = Decoder {
            walk,
            next: 0,
            band: None,
            state: State::End,
            canvas: Canvas::new(),
            inked: Inked::ALL,
        };
        decoder.restart();
        decoder
    }

    /// Starts the stream of another pass of the same page.
    pub fn restart(&mut self) {
        self.next = 0;
        self.follow();
    }

    /// Starts the stream of another page.
    pub fn begin(&mut self, walk: Placed) {
        self.walk = walk;
        // The memory may be another now, and its rows of another length.
        self.inked = Inked::ALL;
        self.restart();
    }

    /// Whether the page is complete.
    pub fn ended(&self) -> bool {
        matches!(self.state, State::End)
    }

    /// A band is complete in the memory.
    fn complete(&mut self, band: PlacedBand, stride: usize) -> Step {
        self.next += 1;
        self.follow();
        Step::Band { y: band.y, rows: band.height, reach: self.inked.range(stride).end }
    }

    /// The band to come, or the end.
    fn follow(&mut self) {
        self.band = self.walk.band(self.next);
        self.state = if self.band.is_some() { State::Form } else { State::End };
    }

    /// Reads until a band is complete and returns how many bytes of `input` it has read. `memory` needs [`band_bytes`]
    /// bytes and must stay the same, unchanged, until the page has all its passes.
    ///
    /// After a defect only [`Decoder::restart`] and [`Decoder::begin`] help.
    pub fn step(&mut self, input: &[u8], memory: &mut [u8]) -> Result<(usize, Step), Defect> {
        let mut read = 0;
        loop {
            let (used, step) = self.slice(&input[read..], memory)?;
            read += used;
            if let Some(step) = step {
                return Ok((read, step));
            }
        }
    }

    /// Like [`Decoder::step`], but also stops, with `None`, after every tile it has laid out, several times within tiles
    /// that take long, after every row of runs across and after many runs. The caller can do other things and then call it again with the rest of the input.
    pub fn slice(&mut self, input: &[u8], memory: &mut [u8]) -> Result<(usize, Option<Step>), Defect> {
        let width = self.walk.width();
        let memory = memory.get_mut(..band_bytes(width)).ok_or(Defect::Memory)?;
        let stride = stride(width);
        let mut read = 0;
        loop {
            let Some(band) = self.band else {
                return Ok((read, Some(Step::End)));
            };
            match &mut self.state {
                State::End => return Ok((read, Some(Step::End))),
                State::Form => {
                    let Some(&byte) = input.get(read) else { return Ok((read, Some(Step::More))) };
                    read += 1;
                    self.state = match byte {
                        form::BLANK => State::Blank,
                        form::RUNS => {
                            self.canvas.clear();
                            State::Minimum
                        }
                        form::ROWS => State::Row(RowState { y: 0, part: RowPart::Head }),
                        form::ACROSS => State::Side,
                        _ => return Err(Defect::Form),
                    };
                    if byte != form::BLANK {
                        let inked = self.inked.range(stride);
                        memory.chunks_exact_mut(stride).for_each(|row| row[inked.clone()].fill(0));
                        self.inked = Inked::NONE;
                    }
                }
                State::Blank => {
                    let Some(&count) = input.get(read) else { return Ok((read, Some(Step::More))) };
                    let end = self.next + usize::from(count);
                    let last = end.checked_sub(1).filter(|&last| last >= self.next).ok_or(Defect::Count)?;
                    let last = self.walk.band(last).ok_or(Defect::Count)?;
                    read += 1;
                    self.next = end;
                    self.follow();
                    return Ok((read, Some(Step::Blank { y: band.y, rows: last.y + last.height - band.y })));
                }
                State::Minimum => {
                    let Some(&minimum) = input.get(read) else { return Ok((read, Some(Step::More))) };
                    read += 1;
                    self.state = State::Runs(Runs::new(minimum));
                }
                State::Runs(runs) => {
                    let mut place =
                        BandTarget { band, stride, memory, canvas: &mut self.canvas, inked: &mut self.inked };
                    let (used, complete) = runs.read(&input[read..], &mut place);
                    read += used;
                    if !complete {
                        return Ok((read, (!runs.pause).then_some(Step::More)));
                    }
                    return Ok((read, Some(self.complete(band, stride))));
                }
                State::Side => {
                    let Some(&side) = input.get(read) else { return Ok((read, Some(Step::More))) };
                    if side == 0 {
                        return Err(Defect::Count);
                    }
                    read += 1;
                    self.state = State::Across(Across::new(side));
                }
                State::Across(across) => {
                    let height = band.height;
                    let mut rows = Rows { memory, stride, height, width, inked: &mut self.inked };
                    let (used, stop) = across.read(&input[read..], &mut rows);
                    read += used;
                    match stop {
                        Stop::More => return Ok((read, Some(Step::More))),
                        // On a microcontroller other tasks wait for their turn.
                        Stop::Pause => return Ok((read, None)),
                        Stop::Band => {}
                    }
                    return Ok((read, Some(self.complete(band, stride))));
                }
                State::Row(row) => {
                    let height = band.height;
                    let mut rows = Rows { memory, stride, height, width, inked: &mut self.inked };
                    let (used, complete) = row.read(&input[read..], &mut rows)?;
                    read += used;
                    if !complete {
                        return Ok((read, Some(Step::More)));
                    }
                    return Ok((read, Some(self.complete(band, stride))));
                }
            }
        }
    }
}

/// Where the dots of a runs band go.
struct BandTarget<'d> {
    band: PlacedBand,
    stride: usize,
    memory: &'d mut [u8],
    canvas: &'d mut Canvas,
    inked: &'d mut Inked,
}

impl Runs {
    fn new(minimum: u8) -> Runs {
        Runs {
            minimum: u32::from(minimum),
            means: [Mean::START; 2],
            index: 0,
            bits: 0,
            held: 0,
            ones: 0,
            // The first run is plain.
            remainder: Some(PLAIN_BITS),
            done: 0,
            end: 0,
            tile: None,
            from: 0,
            to: 0,
            tiles: 0,
            pause: false,
        }
    }

    /// Reads runs until the band is full or others may run. Returns how much was read and whether it is full.
    fn read(&mut self, input: &[u8], place: &mut BandTarget<'_>) -> (usize, bool) {
        let mut read = 0;
        self.pause = false;
        while self.done < place.band.len() {
            // On a microcontroller other tasks wait for their turn.
            if self.pause {
                return (read, false);
            }
            if self.done < self.end {
                self.ink(place);
                continue;
            }
            if self.ones == 0 && self.remainder.is_none() {
                let before = self.index;
                read += self.read_codes(&input[read..], place);
                if self.index > before {
                    continue;
                }
            }
            // Bits are needed: at least one for the ones, all of the remainder.
            let needed = self.remainder.unwrap_or(1);
            while self.held < needed {
                // Never a byte more than needed: what follows the last code belongs to the next band. There is
                // room for it, since at most 20 bits are needed.
                let Some(&byte) = input.get(read) else { return (read, false) };
                self.bits |= u32::from(byte) << (24 - self.held);
                self.held += 8;
                read += 1;
            }
            let Some(count) = self.remainder else {
                self.count_ones();
                continue;
            };
            let value = if count == 0 { 0 } else { self.bits >> (32 - count) };
            self.drop(count);
            self.take(value, count, place);
        }
        self.lay(place);
        (read, self.tile.is_none())
    }

    /// Reads codes while they are short and complete, and returns how much was read. To be called between two codes.
    fn read_codes(&mut self, input: &[u8], place: &mut BandTarget<'_>) -> usize {
        let len = place.band.len();
        let mut codes = Ahead::new(input, self.bits, self.held);
        let mut runs = 0;
        while self.done < len
            && !self.pause
            && let Some(value) = codes.value(ESCAPE, &mut self.means[self.index as usize % 2])
        {
            self.run(value + self.minimum, len, place);
            runs += 1;
            self.pause |= runs == MOST_RUNS;
        }
        let read;
        (self.bits, self.held, read) = codes.end();
        read
    }

    fn drop(&mut self, count: u32) {
        self.bits <<= count;
        self.held -= count;
    }

    fn count_ones(&mut self) {
        let ones = (!self.bits).leading_zeros().min(self.held).min(ESCAPE - self.ones);
        self.drop(ones);
        self.ones += ones;
        if self.ones == ESCAPE {
            self.remainder = Some(PLAIN_BITS);
        } else if self.held > 0 {
            self.drop(1);
            self.remainder = Some(self.means[self.index as usize % 2].parameter());
        }
    }

    /// A value is complete: `bits` of it stood as they are.
    fn take(&mut self, bits: u32, count: u32, place: &mut BandTarget<'_>) {
        let length = if self.index == 0 {
            bits
        } else {
            let value = if self.ones == ESCAPE { bits } else { self.ones << count | bits };
            self.means[self.index as usize % 2].add(value);
            value + self.minimum
        };
        self.run(length, place.band.len(), place);
        self.ones = 0;
        self.remainder = None;
    }

    /// A run is known, in a band of `len` dots.
    fn run(&mut self, length: u32, len: u32, place: &mut BandTarget<'_>) {
        self.end = self.done.saturating_add(length).min(len);
        if self.index.is_multiple_of(2) {
            self.done = self.end;
        } else if self.done < self.end && self.end <= self.to {
            place.canvas.ink(self.done - self.from, self.end - self.from);
            self.done = self.end;
        } else {
            self.ink(place);
        }
        self.index += 1;
    }

    /// Inks the run under way to its end, or until something has been laid out.
    fn ink(&mut self, place: &mut BandTarget<'_>) {
        while self.done < self.end && !self.pause {
            if self.done < self.to {
                let to = self.end.min(self.to);
                place.canvas.ink(self.done - self.from, to - self.from);
                self.done = to;
                continue;
            }
            self.lay(place);
            if self.tile.is_none() {
                self.tile = place.band.tile(self.tiles);
                self.tiles += 1;
                // There is a next tile: the run ends within the band.
                let Some(tile) = &self.tile else { return };
                (self.from, self.to) = (self.to, self.to + u32::from(tile.area()));
            }
        }
    }

    /// Lays the tile out in the band, or a part of it; there is none any more when it is done.
    fn lay(&mut self, place: &mut BandTarget<'_>) {
        let Some(tile) = &self.tile else { return };
        let laid = place.canvas.lay(tile, place.memory, place.stride);
        self.pause |= laid != TileProgress::Blank;
        if laid != TileProgress::Blank {
            place.inked.add(usize::from(tile.x / 8), usize::from((tile.x + tile.w).div_ceil(8)));
        }
        if laid != TileProgress::Part {
            self.tile = None;
        }
    }
}

impl RowState {
    /// Reads rows until the band is full. Returns how much was read and whether it is full.
    fn read(&mut self, input: &[u8], rows: &mut Rows<'_>) -> Result<(usize, bool), Defect> {
        let Rows { stride, height, width, .. } = *rows;
        let mut read = 0;
        while self.y < height {
            let row = usize::from(self.y) * stride;
            if let RowPart::Data { left: 0, run, .. } = self.part {
                // A packed row that announces more than it has.
                if !matches!(run, Run::Head) {
                    return Err(Defect::Row);
                }
                let spare = stride * 8 - usize::from(width);
                if u32::from(rows.memory[row + stride - 1]) & ((1 << spare) - 1) != 0 {
                    return Err(Defect::Row);
                }
                self.y += 1;
                self.part = RowPart::Head;
                continue;
            }
            if let RowPart::Data { left, x, run: run @ Run::Literal(_) } = &mut self.part
                && let Run::Literal(count) = *run
            {
                let data = &input[read..];
                let data = &data[..data.len().min(count.min(*left).into())];
                if data.is_empty() {
                    return Ok((read, false));
                }
                rows.next(self.y, x, data.len())?.copy_from_slice(data);
                read += data.len();
                #[expect(clippy::cast_possible_truncation, reason = "at most what is left of the row")]
                let done = data.len() as u16;
                *left -= done;
                *run = if count == done { Run::Head } else { Run::Literal(count - done) };
                continue;
            }
            let Some(&byte) = input.get(read) else { return Ok((read, false)) };
            read += 1;
            match &mut self.part {
                RowPart::Head if byte == 0 => self.part = RowPart::Same,
                RowPart::Head if byte >= 0x80 => self.part = RowPart::Tail(byte & 0x7f),
                RowPart::Head => self.part = RowPart::data(u16::from(byte)),
                RowPart::Tail(low) if byte < 0x80 => {
                    self.part = RowPart::data(u16::from(byte) << 7 | u16::from(*low));
                }
                RowPart::Tail(_) => return Err(Defect::Row),
                RowPart::Same => {
                    if byte == 0 || u16::from(byte) > height - self.y {
                        return Err(Defect::Count);
                    }
                    for _ in 0..byte {
                        if self.y > 0 {
                            rows.repeat(self.y);
                        }
                        self.y += 1;
                    }
                    self.part = RowPart::Head;
                }
                RowPart::Data { left, x, run } => {
                    *left -= 1;
                    *run = match *run {
                        Run::Head => match byte {
                            0x80 => return Err(Defect::Row),
                            0..0x80 => Run::Literal(u16::from(byte) + 1),
                            _ => Run::Repeat(257 - u16::from(byte)),
                        },
                        Run::Repeat(count) | Run::Literal(count) => {
                            // What is blank is blank already.
                            if byte == 0 {
                                *x = rows.skip(*x, count)?;
                            } else {
                                rows.next(self.y, x, count.into())?.fill(byte);
                            }
                            Run::Head
                        }
                    };
                }
            }
        }
        Ok((read, true))
    }
}

impl RowPart {
    fn data(head: u16) -> RowPart {
        let left = head / 2;
        let run = if head % 2 == 1 { Run::Head } else { Run::Literal(left) };
        RowPart::Data { left, x: 0, run }
    }
}
