//! Following a stream of bytes in the printer's language that was made elsewhere.
//!
//! Problem: a raw job passes through unread, yet when it is cancelled or breaks off, someone must know where in the
//! language it stands.
//! Method: the length of every command is known, of this project's dialect and of the others in use, and what each
//! means for the [end of the job](super::ending). No command is judged. A byte that begins none of them makes the
//! stream foreign; nothing more is known about it then.
//! Cost: rows are skipped by their length, so a few operations for each command.

use super::encode::{ESC, FF, LAST, SUB};
use super::ending::{Ending, EndingBytes, Event};
use heapless::Vec;

/// Bytes of the longest command before its data: a row with a left offset.
const MAX_HEAD: usize = 8;

#[derive(Clone, Copy)]
enum StreamPosition {
    /// Between commands, or in the head of one.
    Head,
    /// In the data of a command, so many bytes before its end.
    Data(u32),
    /// The stream is not the printer's language as known here.
    Foreign,
}

/// What has come of a job.
#[derive(Clone, Copy)]
struct JobTrace {
    ending: Ending,
    /// Whether there was a row, in this job or one before it in the stream.
    rows: bool,
    pass: u8,
    row: u16,
}

/// Follows a stream.
pub struct Track {
    place: StreamPosition,
    head: Vec<u8, MAX_HEAD>,
    now: JobTrace,
    /// As it was at the last place where the job could end.
    settled: JobTrace,
    /// Where in the last portion a job with rows was over, its final reset included.
    over: Option<usize>,
}

impl Default for Track {
    fn default() -> Track {
        Track::new()
    }
}

impl Track {
    /// Before the first byte.
    pub const fn new() -> Track {
        const NOTHING: JobTrace = JobTrace { ending: Ending::new(), rows: false, pass: 0, row: 0 };
        Track { place: StreamPosition::Head, head: Vec::new(), now: NOTHING, settled: NOTHING, over: None }
    }

    /// Follows some bytes. Returns how many of them stand up to the end of the last command after which the job can
    /// end, if there is one. In a foreign stream that is all of them.
    pub fn follow(&mut self, bytes: &[u8]) -> Option<usize> {
        let mut settled = None;
        let mut at = 0;
        self.over = None;
        while at < bytes.len() {
            match self.place {
                StreamPosition::Foreign => return Some(bytes.len()),
                StreamPosition::Head => {
                    // There is room: a full head has been told apart below.
                    let _ = self.head.push(bytes[at]);
                    at += 1;
                    self.place = match length(&self.head) {
                        Length::More if !self.head.is_full() => StreamPosition::Head,
                        Length::More | Length::Unknown => StreamPosition::Foreign,
                        Length::Whole => StreamPosition::Data(0),
                        Length::Data(left) => StreamPosition::Data(left),
                    };
                }
                StreamPosition::Data(left) => {
                    // A portion of 4 GB or more ends no earlier than any command.
                    let used = u32::try_from(bytes.len() - at).unwrap_or(u32::MAX).min(left);
                    at += used as usize;
                    self.place = StreamPosition::Data(left - used);
                }
            }
            match self.place {
                StreamPosition::Data(0) => {
                    let event = event(&self.head);
                    self.head.clear();
                    self.place = StreamPosition::Head;
                    if event == Event::Reset && self.now.rows {
                        self.over.get_or_insert(at);
                    }
                    if self.now.follow(event) {
                        self.settled = self.now;
                        settled = Some(at);
                    }
                }
                StreamPosition::Foreign => return Some(bytes.len()),
                StreamPosition::Head | StreamPosition::Data(_) => {}
            }
        }
        settled
    }

    /// How many bytes of the portion last followed belong to the job, if it was over in it.
    pub fn over(&self) -> Option<usize> {
        self.over
    }

    /// Whether the stream is not the printer's language.
    pub fn is_foreign(&self) -> bool {
        matches!(self.place, StreamPosition::Foreign)
    }

    /// Whether a row was complete at the last place where the job could end: before that, no sheet has been touched.
    pub fn has_rows(&self) -> bool {
        self.settled.rows
    }

    /// Whether the job was still open at the last place where it could end.
    pub fn is_open(&self) -> bool {
        self.settled.ending.is_open()
    }

    /// Pass and next row, both from 0, at the last place where the job could end.
    pub fn position(&self) -> (u8, u16) {
        (self.settled.pass.saturating_sub(1), self.settled.row)
    }

    /// The bytes that end the job at the last place where it could end: none if it has not begun or has ended.
    pub fn ending(&self) -> EndingBytes {
        self.settled.ending.bytes()
    }
}

impl JobTrace {
    fn follow(&mut self, event: Event) -> bool {
        match event {
            Event::InkSelect { .. } => (self.pass, self.row) = (self.pass.saturating_add(1), 0),
            Event::Skip(rows) => self.row = self.row.saturating_add(rows),
            Event::Row => (self.rows, self.row) = (true, self.row.saturating_add(1)),
            _ => {}
        }
        self.ending.follow(event)
    }
}

/// What the command with this head means.
fn event(head: &[u8]) -> Event {
    match *head {
        [FF] => Event::FormFeed,
        [ESC, b'e'] => Event::Reset,
        [ESC, b'%', 0x80, _] => Event::Select,
        [ESC, b'%', ..] => Event::Leave,
        [ESC, SUB, ink, flags, b'r'] => Event::InkSelect { ink, last: flags & LAST != 0 },
        [ESC, SUB, _, _, FF] => Event::BackFeed,
        [ESC, b'*', b'r', b'C'] => Event::RasterEnd,
        [ESC, b'*', b'r', _, b'A'] => Event::RasterStart,
        [ESC, b'*', b'b', _, _, b'M'] => Event::Compression,
        [ESC, b'*', b'b', low, high, b'Y'] => Event::Skip(u16::from_le_bytes([low, high])),
        [ESC, b'*', b'b', ..] => Event::Row,
        _ => Event::Other,
    }
}

enum Length {
    /// The head is not complete.
    More,
    /// The head is the command.
    Whole,
    /// So many bytes of data follow the head.
    Data(u32),
    /// No command begins so.
    Unknown,
}

/// How long the command is that begins with these bytes.
fn length(head: &[u8]) -> Length {
    let fixed = |length: usize| if head.len() < length { Length::More } else { Length::Whole };
    match *head {
        // The established driver sends a stray 00 behind its resolution command.
        [FF] | [0] | [ESC, b'e'] => Length::Whole,
        [ESC] => Length::More,
        [ESC, b'%', ..] => fixed(4),
        [ESC, SUB, ..] => fixed(5),
        [ESC, b'*', b'r', b'C'] => Length::Whole,
        [ESC, b'*', b't' | b'r', ..] => fixed(5),
        [ESC, b'*', b'b', low, high, letter, ref rest @ ..] => {
            let number = u32::from(u16::from_le_bytes([low, high]));
            match (letter, rest.len()) {
                (b'M' | b'Y', _) => Length::Whole,
                (b'V' | b'W', _) => Length::Data(number),
                // A row with a left offset of two bytes.
                (b'T', 2) => Length::Data(number),
                (b'T', _) => Length::More,
                _ => Length::Unknown,
            }
        }
        [ESC, b'&', b'l', low, high, b'C'] => Length::Data(u32::from(u16::from_le_bytes([low, high]))),
        [ESC, b'&', b'l' | b'a', ..] => fixed(6),
        [ESC, b'*' | b'&'] | [ESC, b'*', b'b', ..] => Length::More,
        _ => Length::Unknown,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn job() -> Vec<u8> {
        const SETUP: &[u8] = b"\x1b%\x80A\x1b*t\x03R\0\x1b&l\0\0M\x1b&l\x04\0A\x1b&l\xe4\x18P\x1b&a\xc0\x12M\x1b\x1a\0\0C\x1b*r\x04U\x1b*r\0A";
        const ROW: &[u8] = b"\x1b*b\0\0M\x1b*b\x02\0W\x1b\x0c";
        let passes: [&[u8]; 7] = [
            SETUP,
            b"\x1b\x1a\x0b\0r",
            ROW,
            b"\x1b*b\x05\0Y\x1b*b\x01\0W\x80\x1b\x1a\0\0\x0c",
            b"\x1b\x1a\x01\x80r",
            ROW,
            b"\x1b*rC\x0c\x1b%\0X\x1be",
        ];
        passes.concat()
    }

    #[test]
    fn every_real_stream_is_followed_to_its_end() {
        let Some(folder) = testing::needs::golden() else { return };
        let mut streams = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|name| name == "bin") {
                let bytes = std::fs::read(&path).unwrap();
                let mut track = Track::new();
                assert_eq!(track.follow(&bytes), Some(bytes.len()), "{path:?}");
                assert!(track.has_rows() && !track.is_open() && !track.is_foreign(), "{path:?}");
                streams += 1;
            }
        }
        assert!(streams > 0);
    }

    #[test]
    fn a_job_of_the_other_driver_is_followed_too() {
        let ghostscript = b"\x1be\x1b%\x80A\x1b\x1a\0\0L\x1b&l\x01\0H\x1b&l\0\0M\x1b&l\x04\0A\x1b*r\x08U\x1b*t\x03R\x1b&l\xea\x18P\x1b\x1a\0\0A\x1b&l\x04\0C\x03\x02\x01\0\x1b\x1a\0\0U\x1b*r\x01A\x1b*b\0\0M\x1b\x1a\0\0r\x1b*b\x02\0T\x10\0\x0c\x1b\x0c\x1b*rC\x1b%\0X";
        let mut track = Track::new();
        assert_eq!(track.follow(ghostscript), Some(ghostscript.len()));
        assert!(track.has_rows() && !track.is_open() && !track.is_foreign());
    }

    #[test]
    fn text_is_foreign() {
        let mut track = Track::new();
        assert_eq!(track.follow(b"Hello"), Some(5));
        assert!(track.is_foreign() && !track.is_open());
    }

    #[test]
    fn the_reset_behind_the_rows_is_where_a_job_is_over() {
        let two = [job(), job()].concat();
        let mut track = Track::new();
        assert_eq!((track.follow(&two), track.over()), (Some(two.len()), Some(job().len())));
        let mut track = Track::new();
        track.follow(b"\x1be");
        assert_eq!(track.over(), None, "no rows before it");
    }

    #[test]
    fn the_position_is_pass_and_row_from_0() {
        let mut track = Track::new();
        let bytes = job();
        let second = bytes.windows(5).position(|window| window == b"\x1b\x1a\x01\x80r").unwrap();
        track.follow(&bytes[..second - 5]);
        assert_eq!(track.position(), (0, 7));
        track.follow(&bytes[second - 5..]);
        assert_eq!(track.position(), (1, 1));
    }

    proptest! {
        #[test]
        fn portions_do_not_matter(sizes in prop::collection::vec(1usize..9, 1..30)) {
            let job = job();
            let (mut left, mut sizes) = (&job[..], sizes.into_iter().cycle());
            let (mut track, mut whole) = (Track::new(), Track::new());
            let mut done = 0;
            while !left.is_empty() {
                let (portion, rest) = left.split_at(sizes.next().unwrap().min(left.len()));
                let settled = track.follow(portion).map(|count| done + count);
                done += portion.len();
                left = rest;
                let mut alone = Track::new();
                let expected = alone.follow(&job[..done]);
                prop_assert_eq!(settled.or(expected.filter(|&at| at <= done - portion.len())), expected);
                prop_assert_eq!(track.position(), alone.position());
                prop_assert_eq!(track.ending(), alone.ending());
            }
            whole.follow(&job);
            prop_assert_eq!(track.is_open(), whole.is_open());
        }

        #[test]
        fn no_bytes_make_it_fail(bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(ESC), Just(b'*'), Just(b'b')], 0..300)) {
            let mut track = Track::new();
            track.follow(&bytes);
            track.ending();
        }
    }
}
