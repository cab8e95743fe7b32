//! Where in the printer's language a stream is that was made elsewhere.
//!
//! Problem: a raw job passes through unread, yet when it is cancelled or ends too early the printer must not be
//! left in the middle of a row, a pass or a sheet. Method: know the length of every command, of this project's
//! dialect and of the others in use, and the few facts that decide how a job is brought to an end. No command
//! is judged; a byte that begins none of them makes the stream foreign, and nothing is said about it any more.
//! Cost: rows are skipped over by their length, so a few operations for each command.

const ESC: u8 = 0x1b;
const SUB: u8 = 0x1a;
const FF: u8 = 0x0c;

/// Room that [`Track::ending`] needs.
pub(crate) const ENDING_ROOM: usize = 24;

#[derive(Clone, Copy)]
enum Place {
    /// Between commands.
    Ground,
    /// In a command, so many of its first bytes being in `head`.
    Head(u8),
    /// In the data of a command, so many bytes before its end.
    Data(u32),
    /// The stream is not the printer's language as known here.
    Foreign,
}

/// What has been sent of a job.
#[derive(Clone, Copy, Default)]
struct Facts {
    selected: bool,
    raster: bool,
    ink: Option<u8>,
    last_pass: bool,
    back_fed: bool,
    ejected: bool,
    any_row: bool,
    pass: u8,
    row: u16,
}

/// Follows a stream.
pub(crate) struct Track {
    place: Place,
    head: [u8; 8],
    facts: Facts,
    /// The facts at the last place where the job could be ended.
    settled: Facts,
    /// Where in the last portion a job with rows was over, its final reset included.
    over: Option<usize>,
}

enum Head {
    More,
    Whole,
    Data(u32),
    Unknown,
}

impl Track {
    pub(crate) const fn new() -> Self {
        const NOTHING: Facts = Facts {
            selected: false,
            raster: false,
            ink: None,
            last_pass: false,
            back_fed: false,
            ejected: false,
            any_row: false,
            pass: 0,
            row: 0,
        };
        Track { place: Place::Ground, head: [0; 8], facts: NOTHING, settled: NOTHING, over: None }
    }

    /// Follows some bytes. Gives the number of them up to and with the last one after which the job could be
    /// ended, if there is one.
    pub(crate) fn follow(&mut self, bytes: &[u8]) -> Option<usize> {
        let mut settled = None;
        let mut at = 0;
        self.over = None;
        while at < bytes.len() {
            let used = match self.place {
                Place::Foreign => return Some(bytes.len()),
                Place::Ground => {
                    self.head[0] = bytes[at];
                    self.place = Place::Head(1);
                    1
                }
                Place::Head(count) => {
                    // Every command's head is complete at 8 bytes (see `length`).
                    self.head[usize::from(count) % 8] = bytes[at];
                    self.place = Place::Head(count + 1);
                    1
                }
                Place::Data(left) => {
                    let used = (left as usize).min(bytes.len() - at);
                    self.place = Place::Data(left - used as u32);
                    used
                }
            };
            at += used;
            if let Place::Head(count) = self.place {
                let head = &self.head[..usize::from(count)];
                self.place = match length(head) {
                    Head::More if count < 8 => continue,
                    Head::Data(left) => Place::Data(left),
                    Head::Whole => Place::Data(0),
                    Head::More | Head::Unknown => Place::Foreign,
                };
            }
            match self.place {
                Place::Data(0) => {
                    self.place = Place::Ground;
                    if self.facts.any_row && self.head[..2] == [ESC, b'e'] {
                        self.over.get_or_insert(at);
                    }
                    if self.finish_command() {
                        self.settled = self.facts;
                        settled = Some(at);
                    }
                }
                Place::Foreign => return Some(bytes.len()),
                _ => {}
            }
        }
        settled
    }

    /// How many bytes of the portion last followed belong to the job, if it was over in it.
    pub(crate) fn over(&self) -> Option<usize> {
        self.over
    }

    /// Whether the stream is not the printer's language.
    pub(crate) fn is_foreign(&self) -> bool {
        matches!(self.place, Place::Foreign)
    }

    /// Whether a row has been complete at the last settled place: before it, no sheet has been touched.
    pub(crate) fn has_rows(&self) -> bool {
        self.settled.any_row
    }

    /// Whether the job has been left open at the last settled place.
    pub(crate) fn is_open(&self) -> bool {
        self.settled.selected
    }

    /// Pass and row at the last settled place.
    pub(crate) fn position(&self) -> (u8, u16) {
        (self.settled.pass.saturating_sub(1), self.settled.row)
    }

    /// A command is complete; takes note of it and says whether a job could be ended behind it. It could not
    /// between the packing of a row, a skip or a back-feed and what they belong to.
    fn finish_command(&mut self) -> bool {
        let facts = &mut self.facts;
        let [_, class, third, ..] = self.head;
        let number = u16::from_le_bytes([self.head[3], self.head[4]]);
        match (self.head[0], class, third) {
            (FF, ..) => facts.ejected = true,
            (ESC, b'e', _) => {
                let (pass, row, any_row) = (facts.pass, facts.row, facts.any_row);
                *facts = Facts { pass, row, any_row, ..Facts::default() };
            }
            (ESC, b'%', 0x80) => facts.selected = true,
            (ESC, b'%', _) => facts.selected = false,
            (ESC, SUB, ink) if self.head[4] == b'r' => {
                facts.ink = Some(ink);
                (facts.last_pass, facts.back_fed) = (self.head[3] & 0x80 != 0, false);
                (facts.pass, facts.row) = (facts.pass.saturating_add(1), 0);
            }
            (ESC, SUB, _) if self.head[4] == FF => {
                facts.back_fed = true;
                return false;
            }
            (ESC, b'*', b'r') if self.head[3] == b'C' => facts.raster = false,
            (ESC, b'*', b'r') if self.head[4] == b'A' => facts.raster = true,
            (ESC, b'*', b'b') => match self.head[5] {
                b'M' => return false,
                b'Y' => {
                    facts.row = facts.row.saturating_add(number);
                    return false;
                }
                _ => {
                    facts.row = facts.row.saturating_add(1);
                    facts.any_row = true;
                }
            },
            _ => {}
        }
        true
    }

    /// The bytes that bring a job to an end from the last settled place: nothing if it has ended or never begun.
    ///
    /// Within the grammar the machine is known to take: in a pass that was not announced as the last, the sheet is
    /// fed back and the same ink selected as last pass, without a row, so that no cassette is changed and the form
    /// feed does not come between passes.
    pub(crate) fn ending(&self, out: &mut [u8; ENDING_ROOM]) -> usize {
        let facts = &self.settled;
        let mut length = 0;
        let mut put = |bytes: &[u8]| {
            // 5 + 5 + 4 + 1 + 4 + 2 bytes at most.
            out[length..length + bytes.len()].copy_from_slice(bytes);
            length += bytes.len();
        };
        if !facts.selected {
            return 0;
        }
        if facts.raster {
            if let Some(ink) = facts.ink
                && !facts.last_pass
                && !facts.ejected
            {
                if !facts.back_fed {
                    put(&[ESC, SUB, 0, 0, FF]);
                }
                put(&[ESC, SUB, ink, 0x80, b'r']);
            }
            put(&[ESC, b'*', b'r', b'C']);
        }
        if facts.any_row && !facts.ejected {
            put(&[FF]);
        }
        put(&[ESC, b'%', 0, b'X', ESC, b'e']);
        length
    }
}

/// How long the command is that begins with these bytes.
fn length(head: &[u8]) -> Head {
    let fixed = |length: usize| if head.len() < length { Head::More } else { Head::Whole };
    match *head {
        // The established driver sends a stray 00 behind its resolution command.
        [FF] | [0] | [ESC, b'e'] => Head::Whole,
        [ESC] => Head::More,
        [ESC, b'%', ..] => fixed(4),
        [ESC, SUB, ..] => fixed(5),
        [ESC, b'*', b'r', b'C'] => Head::Whole,
        [ESC, b'*', b't' | b'r', ..] => fixed(5),
        [ESC, b'*', b'b', low, high, letter, ref rest @ ..] => {
            let number = u32::from(u16::from_le_bytes([low, high]));
            match (letter, rest.len()) {
                (b'M' | b'Y', _) => Head::Whole,
                (b'V' | b'W', _) => Head::Data(number),
                // A row with a left offset of two bytes.
                (b'T', 2) => Head::Data(number),
                (b'T', _) => Head::More,
                _ => Head::Unknown,
            }
        }
        [ESC, b'&', b'l', low, high, b'C'] => Head::Data(u32::from(u16::from_le_bytes([low, high]))),
        [ESC, b'&', b'l' | b'a', ..] => fixed(6),
        [ESC, b'*' | b'&'] | [ESC, b'*', b'b', ..] => Head::More,
        _ => Head::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::rgl::{self, Order, Step};
    use std::vec::Vec;

    const SETUP: &[u8] = b"\x1b%\x80A\x1b*t\x03R\0\x1b&l\0\0M\x1b&l\x04\0A\x1b&l\xe4\x18P\x1b&a\xc0\x12M\x1b\x1a\0\0C\x1b*r\x04U\x1b*r\0A";
    const ROW: &[u8] = b"\x1b*b\0\0M\x1b*b\x02\0W\x1b\x0c";

    fn is_a_whole_job(mut bytes: &[u8]) -> bool {
        let mut order = Order::new();
        while !bytes.is_empty() {
            let Ok(Step::Command(command, length)) = rgl::parse(bytes) else { return false };
            if order.accept(&command).is_err() {
                return false;
            }
            bytes = &bytes[length..];
        }
        order.is_complete()
    }

    fn job() -> Vec<u8> {
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
    fn ended_behind_any_command_with_a_row_before_it_a_job_is_whole() {
        let job = job();
        assert!(is_a_whole_job(&job));
        let mut track = Track::new();
        let mut ends = 0;
        for (i, &byte) in job.iter().enumerate() {
            if track.follow(&[byte]).is_some() && track.has_rows() {
                let mut out = [0; ENDING_ROOM];
                let length = track.ending(&mut out);
                let ended = [&job[..=i], &out[..length]].concat();
                // Behind "leave RGL" only the reset is missing, and nothing has to be done about it.
                let left = i + 3 == job.len();
                assert!(left || is_a_whole_job(&ended), "after byte {i}");
                ends += 1;
            }
        }
        assert_eq!(ends, 8);
        assert!(!track.is_open() && !track.is_foreign());
    }

    #[test]
    fn every_real_stream_is_followed_to_its_end() {
        let Some(folder) = std::env::var_os("FOILPRESS_GOLDEN") else {
            std::println!("skipped: FOILPRESS_GOLDEN names no folder of streams");
            return;
        };
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
        assert!(track.is_foreign());
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
            }
            whole.follow(&job);
            prop_assert_eq!(track.is_open(), whole.is_open());
        }

        #[test]
        fn no_bytes_make_it_fail(bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(ESC), Just(b'*'), Just(b'b')], 0..300)) {
            let mut track = Track::new();
            track.follow(&bytes);
            track.ending(&mut [0; ENDING_ROOM]);
        }
    }
}
