//! The status question: two bytes to the printer, 38 bytes back.
//!
//! Problem: a printer may be at work when it is asked, takes its time with the answer, may send it in pieces,
//! and may send nothing. To one that cannot answer the question is two bytes of text. Method: a state machine
//! that says what to do next and is told what came of it. Unless the printer is known to negotiate, that is
//! tried first, and what it still had to say is dropped. Then the question is offered until the printer has
//! taken both bytes, and nibble mode read until the answer is complete, with a pause between any two
//! attempts. Cost: an attempt to write is one poll of the port's 50 µs; one to read goes on for as many polls
//! as the printer takes.
//!
//! Limits: an answer of fewer than 38 bytes is none. That goes for a single byte, too: what a printer means
//! by one on this port is not known. A printer that stops inside a byte is taken at its word, and what came
//! is passed on.
//! A printer that shows a fault before it has taken both bytes is left with half a question, and has to be
//! reset.

use crate::port::{ReverseError, Stop, Written};
use heapless::Vec;
use protocol::link::message::Fault;

/// The question.
pub(crate) const STATUS: [u8; 2] = [0x05, 0x01];

/// The length of the answer.
pub(crate) const STATUS_LENGTH: usize = 38;

/// Attempts to put the question, and attempts to read the answer: two seconds of each.
pub(crate) const ATTEMPTS: u32 = 200;

/// The pause between two attempts.
pub(crate) const PAUSE_US: u64 = 10_000;

/// A status question under way.
pub(crate) struct StatusQuestion {
    /// Whether the printer negotiates.
    talks: bool,
    /// Bytes of the question that the printer has taken. With all of them taken, the answer is read.
    taken: usize,
    /// Attempts left to put the question, or to read the answer.
    left: u32,
    /// When the next attempt is due.
    due_us: u64,
    /// What has come of an answer that is not complete.
    so_far: Vec<u8, { STATUS_LENGTH - 1 }>,
}

/// What is to be done now.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    /// Write these bytes, and report to [`StatusQuestion::written`].
    Write(&'static [u8]),
    /// Read, and report to [`StatusQuestion::read`].
    Read,
    /// Nothing yet.
    Wait,
    /// Nothing any more: this came of it.
    Over(Outcome),
}

/// What came of the question.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Outcome {
    /// The bytes that were read are the answer.
    Answered,
    /// The printer did not answer in time.
    Silent,
    /// The printer shows a fault and takes no question.
    Stopped(Fault),
    /// Reading failed.
    Failed(ReverseError),
}

impl StatusQuestion {
    /// A question that is to be put at `now_us`. `talks` says whether the printer has been seen to negotiate.
    pub(crate) fn new(now_us: u64, talks: bool) -> Self {
        StatusQuestion { talks, taken: 0, left: ATTEMPTS, due_us: now_us, so_far: Vec::new() }
    }

    /// For how many µs there is nothing to do.
    pub(crate) fn pause_us(&self, now_us: u64) -> u32 {
        // At most the pause between two attempts.
        u32::try_from(self.due_us.saturating_sub(now_us)).unwrap_or(u32::MAX)
    }

    /// What is to be done at `now_us`.
    pub(crate) fn step(&self, now_us: u64) -> Step {
        if now_us < self.due_us {
            Step::Wait
        } else if self.left == 0 {
            Step::Over(Outcome::Silent)
        } else if self.talks && self.taken < STATUS.len() {
            Step::Write(&STATUS[self.taken..])
        } else {
            Step::Read
        }
    }

    /// Whether the printer has taken all of it.
    pub(crate) fn is_put(&self) -> bool {
        self.taken == STATUS.len()
    }

    /// Whether the printer has taken a part of it.
    pub(crate) fn is_half_put(&self) -> bool {
        self.taken > 0 && !self.is_put()
    }

    /// What has come of the answer so far.
    pub(crate) fn so_far(&self) -> &[u8] {
        &self.so_far
    }

    /// The bytes of [`Step::Write`] were offered to the printer; the attempt ended at `now_us`. Returns the
    /// end of the question, if this is it.
    pub(crate) fn written(&mut self, written: Written, now_us: u64) -> Option<Outcome> {
        self.taken += written.count;
        self.due_us = now_us + PAUSE_US;
        self.left = match written.stop {
            None => ATTEMPTS,
            Some(Stop::Busy) => self.left - 1,
            Some(Stop::Fault(fault)) => return Some(Outcome::Stopped(fault)),
        };
        None
    }

    /// By now this much of the answer has come, what had come before included, and reading ended so; the
    /// attempt ended at
    /// `now_us`. Returns the end of the question, if this is it.
    pub(crate) fn read(&mut self, come: &[u8], error: Option<ReverseError>, now_us: u64) -> Option<Outcome> {
        if !self.talks && matches!(error, None | Some(ReverseError::Silent(_))) {
            (self.talks, self.due_us) = (true, now_us);
            return None;
        }
        match error {
            // Without a byte the printer is at work on the question.
            None | Some(ReverseError::NotIdle) => {}
            Some(ReverseError::Silent(_)) if !come.is_empty() => return Some(Outcome::Answered),
            Some(error) => return Some(Outcome::Failed(error)),
        }
        self.so_far.clear();
        // What does not fit is complete.
        if self.so_far.extend_from_slice(come).is_err() {
            return Some(Outcome::Answered);
        }
        (self.left, self.due_us) = (self.left - 1, now_us + PAUSE_US);
        // Behind the last attempt to read there is nothing to wait for.
        (self.left == 0).then_some(Outcome::Silent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// What a printer does with one attempt.
    #[derive(Clone, Copy, Debug)]
    enum Reaction {
        /// It takes so many bytes of the question, and is busy then.
        Takes(usize),
        /// It shows a fault behind so many bytes.
        Fault(usize),
        /// Reading gives so many bytes.
        Gives(usize),
        /// It is busy with the question.
        Works,
        /// It stops behind so many bytes.
        Stops(usize),
        /// It does not negotiate any more.
        Deaf,
    }

    fn reactions() -> impl Strategy<Value = Vec<Reaction>> {
        let one = prop_oneof![
            30 => Just(Reaction::Works),
            10 => Just(Reaction::Takes(0)),
            10 => Just(Reaction::Takes(1)),
            5 => Just(Reaction::Takes(2)),
            10 => (0usize..60).prop_map(Reaction::Gives),
            1 => (0usize..3).prop_map(Reaction::Fault),
            1 => (0usize..60).prop_map(Reaction::Stops),
            1 => Just(Reaction::Deaf),
        ];
        prop::collection::vec(one, 1..500)
    }

    proptest! {
        /// Whatever the printer does, the question ends within its time, puts its two bytes once and in
        /// order, reads only behind them, and has an answer exactly if 38 bytes came or the printer stopped
        /// behind some.
        #[test]
        fn every_question_comes_to_an_end(reactions in reactions(), took_us in 0u64..45_000) {
            let (mut now, mut question) = (7u64, StatusQuestion::new(7, true));
            let (mut put, mut attempts) = (Vec::new(), 0u64);
            let mut come = Vec::new();
            let mut reactions = reactions.into_iter().chain(core::iter::repeat(Reaction::Works));
            let ended = loop {
                match question.step(now) {
                    Step::Wait => {
                        let pause = question.pause_us(now);
                        prop_assert!(pause > 0 && pause <= 10_000);
                        prop_assert_eq!(question.step(now + u64::from(pause) - 1), Step::Wait);
                        now += u64::from(pause);
                        continue;
                    }
                    Step::Over(ended) => break ended,
                    Step::Write(bytes) => {
                        attempts += 1;
                        prop_assert_eq!(bytes, &STATUS[put.len()..]);
                        let (count, stop) = match reactions.next().unwrap_or(Reaction::Works) {
                            Reaction::Takes(count) if count < bytes.len() => (count, Some(Stop::Busy)),
                            Reaction::Takes(_) | Reaction::Gives(_) | Reaction::Stops(_) => (bytes.len(), None),
                            Reaction::Fault(count) => (count.min(bytes.len() - 1), Some(Stop::Fault(Fault::PaperOut))),
                            Reaction::Works | Reaction::Deaf => (0, Some(Stop::Busy)),
                        };
                        now += took_us;
                        put.extend_from_slice(&bytes[..count]);
                        let ended = question.written(Written { count, stop }, now);
                        prop_assert_eq!(ended.is_some(), matches!(stop, Some(Stop::Fault(_))));
                        if let Some(ended) = ended {
                            break ended;
                        }
                    }
                    Step::Read => {
                        attempts += 1;
                        prop_assert_eq!(&put[..], STATUS);
                        let result = match reactions.next().unwrap_or(Reaction::Works) {
                            Reaction::Gives(count) => Ok(count),
                            Reaction::Stops(count) => Err(ReverseError::Silent(count)),
                            Reaction::Deaf => Err(ReverseError::OneWay),
                            _ => Err(ReverseError::NotIdle),
                        };
                        now += took_us;
                        let stops = matches!(result, Err(ReverseError::Silent(_)));
                        prop_assert_eq!(question.so_far(), &come[..]);
                        if let Ok(count) | Err(ReverseError::Silent(count)) = result {
                            come.resize(come.len() + count, come.len() as u8);
                        }
                        match question.read(&come, result.err(), now) {
                            Some(Outcome::Answered) => {
                                prop_assert!(come.len() >= STATUS_LENGTH || stops && !come.is_empty());
                                break Outcome::Answered;
                            }
                            Some(ended) => break ended,
                            None => prop_assert!(come.len() < STATUS_LENGTH && !stops),
                        }
                    }
                }
            };
            prop_assert!(attempts <= 400);
            prop_assert!(now <= 7 + 400 * (10_000 + took_us), "{} µs", now);
            match ended {
                Outcome::Answered => prop_assert!(!come.is_empty()),
                Outcome::Silent => prop_assert!(come.len() < STATUS_LENGTH && attempts >= 200),
                Outcome::Stopped(fault) => prop_assert_eq!(fault, Fault::PaperOut),
                Outcome::Failed(error) => prop_assert!(matches!(error, ReverseError::OneWay | ReverseError::Silent(0))),
            }
        }
    }

    /// A question the printer has taken at once.
    fn taken() -> StatusQuestion {
        let mut question = StatusQuestion::new(0, true);
        assert_eq!(question.step(0), Step::Write(&[5, 1]));
        assert_eq!(question.written(Written { count: 2, stop: None }, 0), None);
        question
    }

    #[test]
    fn a_printer_that_takes_no_byte_is_given_up_after_two_seconds() {
        let (mut question, mut now) = (StatusQuestion::new(0, true), 0);
        for _ in 0..200 {
            assert_eq!(question.step(now), Step::Write(&[5, 1]));
            assert_eq!(question.written(Written { count: 0, stop: Some(Stop::Busy) }, now), None);
            now += 10_000;
        }
        assert_eq!((question.step(now), now), (Step::Over(Outcome::Silent), 2_000_000));
    }

    #[test]
    fn a_mute_printer_is_given_up_two_seconds_after_it_has_taken_the_question() {
        let (mut question, mut now) = (taken(), 0);
        for attempt in 1..=200 {
            assert_eq!(question.step(now), Step::Wait);
            now += 10_000;
            assert_eq!(question.step(now), Step::Read);
            let ended = question.read(&[], None, now);
            assert_eq!(ended, (attempt == 200).then_some(Outcome::Silent));
        }
        assert_eq!(now, 2_000_000);
    }

    #[test]
    fn a_printer_not_known_to_negotiate_gets_no_byte_before_it_does() {
        let mut question = StatusQuestion::new(0, false);
        assert_eq!(question.step(0), Step::Read);
        // At work on something: it is tried again.
        assert_eq!(question.read(&[], Some(ReverseError::NotIdle), 0), None);
        assert_eq!((question.step(0), question.step(10_000)), (Step::Wait, Step::Read));
        // What it had to say is no answer to this question.
        assert_eq!(question.read(&[7; 38], None, 10_000), None);
        assert_eq!((question.step(10_000), question.so_far()), (Step::Write(&[5, 1]), &[][..]));
        let mut question = StatusQuestion::new(0, false);
        let way = ReverseError::OneWay;
        assert_eq!(question.read(&[], Some(way), 40_000), Some(Outcome::Failed(way)));
    }

    #[test]
    fn one_byte_alone_is_no_answer() {
        let (mut question, mut now) = (taken(), 10_000);
        assert_eq!(question.read(&[6], None, now), None);
        let ended = loop {
            now += 10_000;
            assert_eq!(question.step(now), Step::Read);
            if let Some(ended) = question.read(&[6], None, now) {
                break ended;
            }
        };
        assert_eq!((ended, now), (Outcome::Silent, 2_000_000));
    }

    #[test]
    fn an_answer_may_come_in_pieces_and_is_complete_with_its_last_byte() {
        let mut question = taken();
        for count in [1, 1, 21, 37] {
            assert_eq!(question.read(&[7; 38][..count], None, 0), None);
            assert_eq!(question.so_far(), &[7; 38][..count]);
        }
        assert_eq!(question.read(&[7; 38], None, 0), Some(Outcome::Answered));
    }

    #[test]
    fn bytes_that_came_before_the_printer_stopped_are_an_answer() {
        let stopped = |come, error| taken().read(come, Some(error), 0);
        assert_eq!(stopped(&[1, 2, 3], ReverseError::Silent(3)), Some(Outcome::Answered));
        // All of them in earlier attempts.
        assert_eq!(stopped(&[1, 2, 3], ReverseError::Silent(0)), Some(Outcome::Answered));
        let nothing = ReverseError::Silent(0);
        assert_eq!(stopped(&[], nothing), Some(Outcome::Failed(nothing)));
    }
}
