//! How a job ends early.
//!
//! Problem: a job that is cancelled or breaks off must not leave the printer inside a row, a pass or a sheet, or the
//! printer reads the next job as the rest of this one.
//! Method: a job is reduced to the few [events](Event) that decide how it can end. [`Ending`] follows them, says after
//! each whether the job can end there, and gives the shortest legal ending from there. A row cannot be separated from
//! its compression and skip commands, nor a back-feed from the pass it prepares. In a pass that was not announced as
//! the last, the ending feeds the sheet back and selects the same ink again as the last pass, without a row: this
//! changes no cartridge, and the form feed does not come between passes.
//! Cost: a few bytes of state, one comparison for each command.
//! Limits: the order of the commands is not checked; [`Order`](super::Order) does that.
//! Source: the grammar in [`order`](super::order), which every ending completes.
//!
//! [`Track`](super::Track) finds the events in a stream of bytes.

use super::encode::{ESC, FF, LAST, SUB};
use heapless::Vec;

/// What a command means for the end of a job.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Event {
    /// Printer reset.
    Reset,
    /// Select RGL.
    Select,
    /// Leave RGL.
    Leave,
    /// Start of raster data.
    RasterStart,
    /// End of raster data.
    RasterEnd,
    /// A pass begins.
    InkSelect {
        /// Code of its ink, known to this project or not.
        ink: u8,
        /// Whether it is announced as the last pass.
        last: bool,
    },
    /// The sheet goes back for the next pass.
    BackFeed,
    /// How the rows that follow are packed.
    Compression,
    /// So many blank rows.
    Skip(u16),
    /// One row.
    Row,
    /// The sheet is ejected.
    FormFeed,
    /// Any other command.
    Other,
}

/// The most bytes of an ending: back-feed, ink select, raster end, form feed, leave RGL, reset.
pub const MAX_ENDING: usize = 5 + 5 + 4 + 1 + 4 + 2;

/// The bytes of an ending.
pub type EndingBytes = Vec<u8, MAX_ENDING>;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum JobPhase {
    /// Not in the printer's language: before a job or after it.
    Outside,
    /// In the setup, or after the raster data.
    Selected,
    /// In the raster data: before the first pass, or in a mode that selects no ink.
    Raster,
    /// In a pass of this ink, with more passes to come.
    Pass(u8),
    /// After such a pass, with the sheet fed back.
    FedBack(u8),
    /// In the last pass.
    LastPass,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Sheet {
    Untouched,
    Printed,
    Ejected,
}

/// How a job would have to end at this point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ending {
    place: JobPhase,
    sheet: Sheet,
}

impl Default for Ending {
    fn default() -> Ending {
        Ending::new()
    }
}

impl Ending {
    /// Before the first command.
    pub const fn new() -> Ending {
        Ending { place: JobPhase::Outside, sheet: Sheet::Untouched }
    }

    /// Takes the next event and returns whether the job can end after it.
    pub fn follow(&mut self, event: Event) -> bool {
        use JobPhase::{FedBack, LastPass, Outside, Pass, Raster, Selected};
        match (event, self.place) {
            (Event::Reset | Event::Leave, _) => *self = Ending::new(),
            (Event::Select, Outside) => *self = Ending { place: Selected, sheet: Sheet::Untouched },
            (Event::RasterStart, Selected) => self.place = Raster,
            (Event::RasterEnd, Raster | Pass(_) | FedBack(_) | LastPass) => self.place = Selected,
            (Event::InkSelect { ink, last }, Raster | Pass(_) | FedBack(_) | LastPass) => {
                self.place = if last { LastPass } else { Pass(ink) };
            }
            (Event::BackFeed, Pass(ink)) => self.place = FedBack(ink),
            (Event::Row, _) if self.sheet == Sheet::Untouched => self.sheet = Sheet::Printed,
            (Event::FormFeed, _) => self.sheet = Sheet::Ejected,
            _ => {}
        }
        !matches!(event, Event::BackFeed | Event::Compression | Event::Skip(_))
    }

    /// Whether a job has begun and has not ended.
    pub fn is_open(&self) -> bool {
        self.place != JobPhase::Outside
    }

    /// The bytes that end the job here: none if it has not begun or has ended.
    pub fn bytes(&self) -> EndingBytes {
        let mut out = EndingBytes::new();
        let mut put = |bytes: &[u8]| {
            // Each of the six commands is put at most once, so they fit.
            let _ = out.extend_from_slice(bytes);
        };
        if self.place == JobPhase::Outside {
            return out;
        }
        if let JobPhase::Pass(ink) | JobPhase::FedBack(ink) = self.place
            && self.sheet != Sheet::Ejected
        {
            if let JobPhase::Pass(_) = self.place {
                put(&[ESC, SUB, 0, 0, FF]);
            }
            put(&[ESC, SUB, ink, LAST, b'r']);
        }
        if self.place != JobPhase::Selected {
            put(&[ESC, b'*', b'r', b'C']);
        }
        if self.sheet == Sheet::Printed {
            put(&[FF]);
        }
        put(&[ESC, b'%', 0, b'X']);
        put(&[ESC, b'e']);
        out
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::command::Command;
    use super::super::encode::encode_into;
    use super::super::job::JobWriter;
    use super::super::order::Order;
    use super::super::parse::{Step, parse};
    use super::super::setup::{JobSetup, Page};
    use super::super::track::Track;
    use super::*;
    use crate::ink::Ink;
    use crate::paper::Paper;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    /// A job whose rows print where `rows` says so.
    fn job(inks: &[Ink], rows: &[Vec<bool>]) -> Vec<u8> {
        let setup = match inks {
            [] => JobSetup::black_raster(Page::plain(Paper::A4)).unwrap(),
            _ => JobSetup::new(Page::plain(Paper::A4), inks, None).unwrap(),
        };
        let mut writer = JobWriter::new(setup, 9).unwrap();
        let (mut out, mut bytes) = ([0; 200], vec![]);
        let mut add = |length: Result<usize, _>, out: &[u8]| bytes.extend_from_slice(&out[..length.unwrap()]);
        add(writer.begin(&mut out), &out);
        for pass in rows.iter().take(inks.len().max(1)) {
            add(writer.next_pass(&mut out), &out);
            for (y, &dots) in pass.iter().enumerate() {
                add(
                    writer.row(&[u8::from(dots) * 0x55, 1, y as u8][..if dots { 3 } else { 0 }], &mut out),
                    &out,
                );
            }
        }
        add(writer.end(&mut out), &out);
        bytes
    }

    /// The commands of a legal job, each with the place where it ends.
    fn commands(bytes: &[u8]) -> Vec<(Command<'_>, usize)> {
        let (mut order, mut at, mut commands) = (Order::new(), 0, vec![]);
        while at < bytes.len() {
            let Ok(Step::Command(command, length)) = parse(&bytes[at..]) else { panic!("byte {at}") };
            order.accept(&command).unwrap();
            at += length;
            commands.push((command, at));
        }
        commands
    }

    /// The ending by another route: what is there and what is missing in the list of commands so far. `None` where the
    /// job cannot end.
    fn expected(commands: &[Command<'_>]) -> Option<Vec<Command<'static>>> {
        let has = |wanted: Command<'_>| commands.contains(&wanted);
        if matches!(commands.last(), Some(Command::Compression(_) | Command::Skip(_) | Command::BackFeed)) {
            return None;
        }
        if !has(Command::SelectRgl) || has(Command::LeaveRgl) {
            return Some(vec![]);
        }
        let mut missing = vec![];
        let pass = commands.iter().rev().find_map(|command| match *command {
            Command::InkSelect { ink, last } => Some((ink, last)),
            _ => None,
        });
        if let Some((ink, false)) = pass {
            missing.extend([Command::BackFeed, Command::InkSelect { ink, last: true }]);
        }
        if has(Command::RasterStart) && !has(Command::RasterEnd) {
            missing.push(Command::RasterEnd);
        }
        let printed = commands.iter().any(|command| matches!(command, Command::Row { .. }));
        if printed && !has(Command::FormFeed) {
            missing.push(Command::FormFeed);
        }
        missing.extend([Command::LeaveRgl, Command::Reset]);
        Some(missing)
    }

    fn encoded(commands: &[Command<'_>]) -> Vec<u8> {
        let mut bytes = vec![];
        for command in commands {
            let mut out = [0; 16];
            let length = encode_into(command, &mut out).unwrap();
            bytes.extend_from_slice(&out[..length]);
        }
        bytes
    }

    fn is_a_whole_job(bytes: &[u8]) -> bool {
        let (mut order, mut at) = (Order::new(), 0);
        while at < bytes.len() {
            match parse(&bytes[at..]) {
                Ok(Step::Command(command, length)) if order.accept(&command).is_ok() => at += length,
                _ => return false,
            }
        }
        order.is_complete()
    }

    proptest! {
        #[test]
        fn behind_every_command_the_ending_is_what_the_list_of_commands_lacks(
            inks in prop::sample::subsequence(vec![Ink::White, Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black], 0..=5),
            rows in prop::collection::vec(prop::collection::vec(any::<bool>(), 9), 5),
        ) {
            let job = job(&inks, &rows);
            let all = commands(&job);
            let mut track = Track::new();
            let (mut next, mut seen) = (0, vec![]);
            for (at, &byte) in job.iter().enumerate() {
                let can_end = track.follow(&[byte]).is_some();
                let (command, end) = &all[next];
                if *end != at + 1 {
                    // The 00 behind the resolution command counts as a command of its own, for other drivers leave it out.
                    let stray = matches!(command, Command::Resolution(_)) && *end == at + 2;
                    prop_assert_eq!(can_end, stray, "inside a command, at byte {}", at);
                    continue;
                }
                seen.push(*command);
                next += 1;
                let expected = expected(&seen);
                prop_assert_eq!(can_end, expected.is_some());
                let Some(expected) = expected else { continue };
                let ending = track.ending();
                prop_assert_eq!(&ending[..], &encoded(&expected)[..]);
                prop_assert_eq!(track.is_open(), !ending.is_empty());
                if track.has_rows() {
                    prop_assert!(is_a_whole_job(&[&job[..=at], &ending[..]].concat()), "after byte {}", at);
                }
            }
        }
    }

    #[test]
    fn the_longest_ending_fills_its_room() {
        let mut ending = Ending::new();
        for event in [Event::Select, Event::RasterStart, Event::InkSelect { ink: 1, last: false }, Event::Row]
        {
            ending.follow(event);
        }
        assert_eq!(ending.bytes().len(), MAX_ENDING);
    }

    #[test]
    fn a_sheet_that_is_out_is_not_ejected_again_and_the_next_job_begins_with_another() {
        let mut ending = Ending::new();
        for event in [Event::Select, Event::RasterStart, Event::InkSelect { ink: 1, last: false }, Event::Row]
        {
            ending.follow(event);
        }
        ending.follow(Event::FormFeed);
        assert_eq!(ending.bytes(), *b"\x1b*rC\x1b%\0X\x1be");
        ending.follow(Event::Leave);
        assert!(!ending.is_open() && ending.bytes().is_empty());
        for event in [Event::Select, Event::RasterStart, Event::Row] {
            ending.follow(event);
        }
        assert_eq!(ending.bytes(), *b"\x1b*rC\x0c\x1b%\0X\x1be");
    }
}
