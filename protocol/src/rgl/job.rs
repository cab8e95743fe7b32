//! A job to send, row by row.
//!
//! [`JobWriter`] takes one row after the other and writes the bytes for it. It holds no row and no page, so the same
//! code serves a workstation and a microcontroller. [`JobSetup`] has refused what must never be sent, and every command
//! passes through [`Order`] before it is written, so an illegal job cannot come out.
//!
//! The rule for each row: `docs/rgl.md`, section "Rows"; an early end: section "End of a job".

use super::command::{Command, Compression, Mode, PaperCode};
use super::encode::encode_into;
use super::fault::Fault;
use super::order::{Extent, Order};
use super::parse::ROW_HEAD;
use super::setup::JobSetup;
use crate::{packbits, scan};

/// The most room that [`JobWriter::begin`], [`JobWriter::next_pass`], [`JobWriter::end`] and [`JobWriter::cancel`] need.
pub const COMMAND_ROOM: usize = 96;

/// Room that [`JobWriter::row`] needs besides the row itself: three commands of six bytes.
pub const ROW_ROOM: usize = 18;

/// Writes a job: `begin`, then for each pass `next_pass` and its rows, then `end`.
///
/// Every call returns the number of bytes written to the start of `out`. A call that fails has changed nothing and may
/// be repeated. A call in the wrong order is [`Fault::OutOfOrder`].
#[derive(Clone, Debug)]
pub struct JobWriter {
    setup: JobSetup,
    order: Order,
    /// Rows of the image.
    rows: u16,
    /// The row of the pass that comes next.
    row: u16,
    /// Blank rows since the last one sent.
    blank: u16,
}

impl JobWriter {
    /// A writer for an image of `rows` rows, which start at the top of the page or below its shift.
    ///
    /// Errors: [`Fault::TooManyRows`] if the page has no room for them.
    pub fn new(setup: JobSetup, rows: u16) -> Result<JobWriter, Fault> {
        let page = setup.page();
        if u32::from(rows) + u32::from(page.resolution.along(page.shift_y)) > u32::from(page.length()) {
            return Err(Fault::TooManyRows);
        }
        Ok(JobWriter { setup, order: Order::new(), rows, row: 0, blank: 0 })
    }

    /// The job.
    pub fn setup(&self) -> &JobSetup {
        &self.setup
    }

    /// Passes begun so far.
    pub fn passes(&self) -> usize {
        self.order.passes()
    }

    /// The setup. `out` needs [`COMMAND_ROOM`].
    pub fn begin(&mut self, out: &mut [u8]) -> Result<usize, Fault> {
        let page = *self.setup.page();
        let (shift_x, shift_y) = (page.resolution.across(page.shift_x), page.resolution.along(page.shift_y));
        self.write(out, |put| {
            put(Command::SelectRgl)?;
            put(Command::Resolution(page.resolution))?;
            put(Command::Media(page.media))?;
            put(Command::Paper(PaperCode::from_paper(page.paper)))?;
            put(Command::Length(page.length()))?;
            put(Command::Width(page.width()))?;
            if let Some(list) = self.setup.cartridges() {
                put(Command::Cartridges(list))?;
            }
            if shift_x > 0 {
                put(Command::ShiftX(shift_x))?;
            }
            if shift_y > 0 {
                put(Command::ShiftY(shift_y))?;
            }
            put(Command::CurlCorrection(page.curl_correction))?;
            put(Command::Mode(self.setup.mode()))?;
            put(Command::RasterStart)
        })
        .map(|(order, length)| {
            self.order = order;
            length
        })
    }

    /// Ends the previous pass, if any, and begins the next. `out` needs [`COMMAND_ROOM`]. Rows that were not given to the
    /// previous pass are blank.
    pub fn next_pass(&mut self, out: &mut [u8]) -> Result<usize, Fault> {
        let passes = self.setup.passes();
        if self.setup.mode() == Mode::BlackRaster {
            // Its pass began with the raster data; this call exists so that all modes are driven alike.
            return if self.order.passes() == 1 && self.row == 0 { Ok(0) } else { Err(Fault::OutOfOrder) };
        }
        let next = self.order.passes();
        let ink = *passes.get(next).ok_or(Fault::OutOfOrder)?;
        let last = next + 1 == passes.len();
        let (order, length) = self.write(out, |put| {
            if next > 0 {
                put(Command::BackFeed)?;
            }
            put(Command::InkSelect { ink, last })
        })?;
        (self.order, self.row, self.blank) = (order, 0, 0);
        Ok(length)
    }

    /// The next row of the pass: 8 dots to a byte, most significant bit left, 1 = ink. Blank bytes at the right may be
    /// omitted. `out` needs [`ROW_ROOM`] bytes more than the row has. A blank row writes nothing yet.
    ///
    /// Errors: [`Fault::BeyondWidth`] for a dot beyond the page, [`Fault::TooManyRows`], [`Fault::NoRoom`].
    pub fn row(&mut self, row: &[u8], out: &mut [u8]) -> Result<usize, Fault> {
        let row = scan::trim(row);
        if row.is_empty() {
            return self.blank_rows(1).map(|()| 0);
        }
        if !self.order.in_pass() {
            return Err(Fault::OutOfOrder);
        }
        if self.row >= self.rows {
            return Err(Fault::TooManyRows);
        }
        let extent = Extent::of_row(row);
        self.order.fits(extent, u32::from(self.row))?;
        if out.len() < ROW_ROOM + row.len() {
            return Err(Fault::NoRoom);
        }
        // Behind the commands that usually stand before it: one more where the compression changes.
        let usual = if self.blank > 0 { 2 * ROW_HEAD } else { ROW_HEAD };
        // Packed only if strictly shorter.
        let packed = packbits::pack_into(row, &mut out[usual..usual + row.len() - 1]);
        let (compression, length) = match packed {
            Some(length) => (Compression::Packed, length),
            None => {
                out[usual..usual + row.len()].copy_from_slice(row);
                (Compression::Plain, row.len())
            }
        };
        let changes = self.order.compression() != Some(compression);
        let data = if changes { usual + ROW_HEAD } else { usual };
        if changes {
            out.copy_within(usual..usual + length, data);
        }
        let mut order = self.order;
        let mut at = 0;
        let mut put = |command: Command<'_>| -> Result<(), Fault> {
            order.accept(&command).map_err(|refusal| refusal.fault)?;
            at += encode_into(&command, &mut out[at..data])?;
            Ok(())
        };
        if changes {
            put(Command::Compression(compression))?;
        }
        if self.blank > 0 {
            put(Command::Skip(self.blank))?;
        }
        let last = self.row + 1 == self.rows;
        order.accept_row(extent, last)?;
        // The data are in place already, only their head is missing.
        #[expect(clippy::cast_possible_truncation, reason = "a row that fits a page has at most 1235 bytes")]
        let [low, high] = (length as u16).to_le_bytes();
        let letter = if last { b'V' } else { b'W' };
        out[at..at + ROW_HEAD].copy_from_slice(&[super::encode::ESC, b'*', b'b', low, high, letter]);
        debug_assert_eq!(at + ROW_HEAD, data);
        self.order = order;
        self.row += 1;
        self.blank = 0;
        Ok(data + length)
    }

    /// The next `count` rows are blank.
    pub fn blank_rows(&mut self, count: u16) -> Result<(), Fault> {
        if !self.order.in_pass() {
            return Err(Fault::OutOfOrder);
        }
        match self.row.checked_add(count) {
            Some(row) if row <= self.rows => {
                self.row = row;
                self.blank += count;
                Ok(())
            }
            _ => Err(Fault::TooManyRows),
        }
    }

    /// The end of the job, once the last pass has begun. `out` needs [`COMMAND_ROOM`].
    pub fn end(&mut self, out: &mut [u8]) -> Result<usize, Fault> {
        let (order, length) = self.write(out, |put| finish(put))?;
        self.order = order;
        Ok(length)
    }

    /// Ends the job early in a way the printer knows, so that the sheet is ejected and the next job starts clean. If the
    /// current pass was not announced as the last, an empty pass of the same ink follows that is; it needs no other
    /// cartridge. Writes nothing if the job has not begun or has ended. `out` needs [`COMMAND_ROOM`].
    pub fn cancel(&mut self, out: &mut [u8]) -> Result<usize, Fault> {
        if self.order.is_idle() || self.order.is_complete() {
            return Ok(0);
        }
        let begun = self.order.passes();
        let announced = begun == self.setup.passes().len();
        let ink = self.setup.passes()[begun.saturating_sub(1)];
        let (order, length) = self.write(out, |put| {
            if !announced {
                if begun > 0 {
                    put(Command::BackFeed)?;
                }
                put(Command::InkSelect { ink, last: true })?;
            }
            finish(put)
        })?;
        self.order = order;
        Ok(length)
    }

    /// Runs `commands` on a copy of the order and returns it with the length, so that a failure changes nothing.
    fn write(
        &self,
        out: &mut [u8],
        commands: impl FnOnce(&mut dyn FnMut(Command<'_>) -> Result<(), Fault>) -> Result<(), Fault>,
    ) -> Result<(Order, usize), Fault> {
        let mut order = self.order;
        let mut at = 0;
        commands(&mut |command| {
            order.accept(&command).map_err(|refusal| refusal.fault)?;
            at += encode_into(&command, &mut out[at..])?;
            Ok(())
        })?;
        Ok((order, at))
    }
}

fn finish(put: &mut dyn FnMut(Command<'_>) -> Result<(), Fault>) -> Result<(), Fault> {
    put(Command::RasterEnd)?;
    put(Command::FormFeed)?;
    put(Command::LeaveRgl)?;
    put(Command::Reset)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::command::{Cartridges, Resolution};
    use super::super::parse::{Step, parse};
    use super::super::setup::Page;
    use super::*;
    use crate::ink::Ink;
    use crate::paper::Paper;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    type Image = Vec<Vec<u8>>;

    /// The stream of a job whose pass `i` prints `images[i]`.
    fn stream(setup: JobSetup, rows: u16, images: &[Image]) -> Result<Vec<u8>, Fault> {
        let mut writer = JobWriter::new(setup, rows)?;
        let (mut out, mut bytes) = (vec![0; 2000], vec![]);
        let mut add = |n: usize, out: &[u8]| bytes.extend_from_slice(&out[..n]);
        add(writer.begin(&mut out)?, &out);
        for image in images {
            add(writer.next_pass(&mut out)?, &out);
            for row in image {
                add(writer.row(row, &mut out)?, &out);
            }
        }
        add(writer.end(&mut out)?, &out);
        Ok(bytes)
    }

    /// The commands of a stream, after the whole order has been checked.
    fn commands(bytes: &[u8]) -> Vec<Command<'_>> {
        let (mut order, mut at, mut commands) = (Order::new(), 0, vec![]);
        while at < bytes.len() {
            let Ok(Step::Command(command, length)) = parse(&bytes[at..]) else { panic!("{at}") };
            order.accept(&command).unwrap();
            commands.push(command);
            at += length;
        }
        assert!(order.is_over());
        commands
    }

    fn a4(passes: &[Ink]) -> JobSetup {
        JobSetup::new(Page::plain(Paper::A4), passes, None).unwrap()
    }

    const CMYK: [Ink; 4] = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black];

    #[test]
    fn the_documented_stream_of_a_square_comes_out_whole() {
        // A square of 40 x 40 dots at (40, 40) of an image of 120 x 120, cyan, magenta and yellow blank.
        let blank = vec![vec![0; 15]; 120];
        let mut square = blank.clone();
        square[40..80].iter_mut().for_each(|row| row[5..10].fill(0xff));
        let setup_and_blank_passes: &[u8] = &[
            0x1b, 0x25, 0x80, 0x41, 0x1b, 0x2a, 0x74, 0x03, 0x52, 0x00, 0x1b, 0x26, 0x6c, 0x00, 0x00, 0x4d,
            0x1b, 0x26, 0x6c, 0x04, 0x00, 0x41, 0x1b, 0x26, 0x6c, 0xe4, 0x18, 0x50, 0x1b, 0x26, 0x61, 0xc0,
            0x12, 0x4d, 0x1b, 0x1a, 0x00, 0x00, 0x43, 0x1b, 0x2a, 0x72, 0x04, 0x55, 0x1b, 0x2a, 0x72, 0x00,
            0x41, 0x1b, 0x1a, 0x01, 0x00, 0x72, 0x1b, 0x1a, 0x00, 0x00, 0x0c, 0x1b, 0x1a, 0x02, 0x00, 0x72,
            0x1b, 0x1a, 0x00, 0x00, 0x0c, 0x1b, 0x1a, 0x03, 0x00, 0x72, 0x1b, 0x1a, 0x00, 0x00, 0x0c, 0x1b,
            0x1a, 0x00, 0x80, 0x72,
        ];
        let first: &[u8] = &[0x1b, 0x2a, 0x62, 0x02, 0x00, 0x4d, 0x1b, 0x2a, 0x62, 0x28, 0x00, 0x59];
        let row: &[u8] = &[0x1b, 0x2a, 0x62, 0x04, 0x00, 0x57, 0xfc, 0x00, 0xfc, 0xff];
        let end: &[u8] = &[0x1b, 0x2a, 0x72, 0x43, 0x0c, 0x1b, 0x25, 0x00, 0x58, 0x1b, 0x65];
        let want = [setup_and_blank_passes, first, &row.repeat(40), end].concat();
        let images = [blank.clone(), blank.clone(), blank, square];
        assert_eq!(stream(a4(&CMYK), 120, &images).unwrap(), want);
    }

    #[test]
    fn the_last_row_of_the_image_and_a_change_of_packing_are_marked() {
        let image = vec![vec![1, 2, 3], vec![], vec![0xff; 15], vec![0xff; 15]];
        let bytes = stream(a4(&[Ink::White]), 4, &[image]).unwrap();
        assert_eq!(
            commands(&bytes)[9..17],
            [
                Command::InkSelect { ink: Ink::White, last: true },
                Command::Compression(Compression::Plain),
                Command::Row { last: false, data: &[1, 2, 3] },
                Command::Compression(Compression::Packed),
                Command::Skip(1),
                Command::Row { last: false, data: &[0xf2, 0xff] },
                Command::Row { last: true, data: &[0xf2, 0xff] },
                Command::RasterEnd,
            ]
        );
    }

    #[test]
    fn five_cartridges_make_multi_plane_and_repeats_do_not() {
        let five = [&CMYK[..], &[Ink::Finish]].concat();
        assert_eq!(a4(&five).mode(), Mode::MultiPlane);
        let bytes = stream(a4(&five), 1, &vec![vec![]; 5]).unwrap();
        assert!(commands(&bytes).contains(&Command::Cartridges(Cartridges::new(&five).unwrap())));
        // The list has an entry for each pass while there is room for them.
        let listed = |passes: &[Ink]| a4(passes).cartridges().map(|list| list.inks().to_vec());
        let twice = [&five[..], &[Ink::Finish]].concat();
        assert_eq!(listed(&twice), Some(twice.clone()));
        let eight = [&five[..], &[Ink::Finish; 3]].concat();
        assert_eq!(listed(&eight), Some(five.clone()));
        let seven_of_four =
            [Ink::Black, Ink::Primer, Ink::Finish, Ink::Primer, Ink::White, Ink::White, Ink::White];
        assert_eq!(a4(&seven_of_four).mode(), Mode::ColourPlane);
    }

    #[test]
    fn shifts_stand_in_the_setup_in_dots_of_the_resolution() {
        let page =
            Page { shift_x: 100, shift_y: 200, resolution: Resolution::Dpi1200, ..Page::plain(Paper::A4) };
        let bytes = stream(JobSetup::new(page, &CMYK, None).unwrap(), 1, &vec![vec![]; 4]).unwrap();
        let all = commands(&bytes);
        assert_eq!(all[5..8], [Command::Width(9600), Command::ShiftX(200), Command::ShiftY(200)]);
        assert_eq!(all[4], Command::Length(6372));
    }

    #[test]
    fn a_refused_call_leaves_the_job_as_it_was() {
        let setup = a4(&[Ink::Cyan, Ink::Black]);
        let mut writer = JobWriter::new(setup, 6372).unwrap();
        let mut out = [0; 700];
        assert_eq!(writer.row(&[1], &mut out), Err(Fault::OutOfOrder));
        assert_eq!(writer.begin(&mut out[..20]), Err(Fault::NoRoom));
        writer.begin(&mut out).unwrap();
        assert_eq!(writer.begin(&mut out), Err(Fault::Repeated));
        assert_eq!(writer.end(&mut out), Err(Fault::NoPass));
        writer.next_pass(&mut out).unwrap();
        assert_eq!(writer.end(&mut out), Err(Fault::NotLastPass));
        assert_eq!(writer.row(&[0xff; 601], &mut out), Err(Fault::BeyondWidth));
        assert_eq!(writer.row(&[0xff; 600], &mut out[..617]), Err(Fault::NoRoom));
        assert_eq!(writer.blank_rows(6373), Err(Fault::TooManyRows));
        writer.blank_rows(6371).unwrap();
        let length = writer.row(&[0x80, 0, 0], &mut out).unwrap();
        assert_eq!(out[..length][length - 7..], [0x1b, 0x2a, 0x62, 1, 0, 0x56, 0x80]);
        assert_eq!(writer.row(&[1], &mut out), Err(Fault::TooManyRows));
        writer.next_pass(&mut out).unwrap();
        assert_eq!(writer.next_pass(&mut out), Err(Fault::OutOfOrder));
        writer.end(&mut out).unwrap();
        assert_eq!(writer.end(&mut out), Err(Fault::AfterJob));
        assert_eq!(writer.row(&[], &mut out), Err(Fault::OutOfOrder));
        assert_eq!(writer.cancel(&mut out), Ok(0));
    }

    #[test]
    fn an_image_longer_than_the_page_is_refused() {
        let setup = a4(&[Ink::Black]);
        assert_eq!(JobWriter::new(setup, 6373).unwrap_err(), Fault::TooManyRows);
        let shifted = Page { shift_y: 1, ..Page::plain(Paper::A4) };
        let setup = JobSetup::new(shifted, &[Ink::Black], None).unwrap();
        assert_eq!(JobWriter::new(setup, 6372).unwrap_err(), Fault::TooManyRows);
    }

    #[test]
    fn a_job_cancelled_anywhere_is_still_a_legal_job() {
        for calls in 0..8 {
            let mut writer = JobWriter::new(a4(&[Ink::White, Ink::Cyan]), 3).unwrap();
            let (mut out, mut bytes) = ([0; 200], vec![]);
            for call in 0..calls {
                let n = match call {
                    0 => writer.begin(&mut out),
                    1 | 4 => writer.next_pass(&mut out),
                    _ => writer.row(&[0x55], &mut out),
                };
                bytes.extend_from_slice(&out[..n.unwrap()]);
            }
            let n = writer.cancel(&mut out).unwrap();
            bytes.extend_from_slice(&out[..n]);
            assert_eq!(bytes.is_empty(), calls == 0);
            if calls > 0 {
                let feeds = commands(&bytes).iter().filter(|&&c| c == Command::FormFeed).count();
                assert_eq!(feeds, 1);
            }
        }
    }

    proptest! {
        #[test]
        fn the_rows_that_went_in_are_read_from_the_stream(
            images in proptest::collection::vec(
                proptest::collection::vec(
                    proptest::collection::vec(prop_oneof![4 => Just(0u8), 2 => Just(0xff), 1 => any::<u8>()], 0..40),
                    0..20,
                ),
                1..4,
            ),
        ) {
            let inks = &[Ink::White, Ink::Cyan, Ink::White][..images.len()];
            let bytes = stream(a4(inks), 20, &images).unwrap();
            let (mut pass, mut packed, mut y) = (0, false, 0usize);
            let mut seen: Vec<Image> = images.iter().map(|image| vec![vec![]; image.len()]).collect();
            for command in commands(&bytes) {
                match command {
                    Command::InkSelect { ink, last } => {
                        prop_assert_eq!(ink, inks[pass]);
                        pass += 1;
                        prop_assert_eq!(last, pass == inks.len());
                        y = 0;
                    }
                    Command::Compression(c) => packed = c == Compression::Packed,
                    Command::Skip(n) => y += usize::from(n),
                    Command::Row { last, data } => {
                        let mut row = vec![0; 64];
                        let n = if packed { packbits::unpack_into(data, &mut row).unwrap() } else {
                            row[..data.len()].copy_from_slice(data);
                            data.len()
                        };
                        row.truncate(n);
                        prop_assert!(!packed || data.len() < n);
                        prop_assert_eq!(last, y == 19);
                        seen[pass - 1][y] = row;
                        y += 1;
                    }
                    _ => {}
                }
            }
            let trimmed: Vec<Image> =
                images.iter().map(|image| image.iter().map(|row| scan::trim(row).to_vec()).collect()).collect();
            prop_assert_eq!(seen, trimmed);
        }
    }
}
