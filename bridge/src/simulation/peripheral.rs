//! The printer's side of the conversation.

use super::{Line, World};
use crate::driver::STATUS;
use std::vec::Vec;

/// A printer that, having taken so many bytes, has a fault for a while.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pause {
    /// After this many bytes.
    pub after: usize,
    /// The line that shows it: Busy alone, or with PError, Select, nFault.
    pub line: Line,
    /// For how long, in ns.
    pub ns: u64,
}

/// How a printer behaves.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Peripheral {
    /// From nStrobe falling to Busy rising, in ns; the standard allows 500.
    pub busy_after: u64,
    /// Work on one byte, from Busy rising, in ns.
    pub work: u64,
    /// Width of nAck's pulse, in ns; Busy falls when it ends. 0: no pulse.
    pub ack: u64,
    /// Whether Busy is used at all; very old printers have only nAck.
    pub has_busy: bool,
    /// Faults to come, by ascending byte.
    pub pauses: Vec<Pause>,
    /// Whether it answers a negotiation.
    pub negotiates: bool,
    /// Its answers in reverse are this late, in ns.
    pub answer_after: u64,
    /// It says no more after so many nibbles.
    pub dumb_after: Option<usize>,
    /// Its device ID, with the length; none if it refuses to tell.
    pub device_id: Option<Vec<u8>>,
    /// What it has to say in nibble mode.
    pub reverse_data: Vec<u8>,
    /// What it adds to that when it has taken the status question.
    pub status: Vec<Response>,
}

/// A piece of an answer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Response {
    /// How long after the question, in ns.
    pub after: u64,
    /// The piece.
    pub bytes: Vec<u8>,
}

impl Default for Peripheral {
    fn default() -> Self {
        Peripheral {
            busy_after: 300,
            work: 1000,
            ack: 500,
            has_busy: true,
            pauses: Vec::new(),
            negotiates: true,
            answer_after: 2000,
            dumb_after: None,
            device_id: None,
            reverse_data: Vec::new(),
            status: Vec::new(),
        }
    }
}

/// For how long a printer waits for its host to go on (IEEE 1284, T_H).
const HOST_NS: u64 = 1_000_000_000;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Phase {
    /// Compatibility mode.
    Forward,
    /// Event 2 done or ignored; waits for the strobe that carries the mode.
    Negotiating { mode: Option<u8> },
    /// Nibbles of these data, so many done.
    Reverse { id: bool, nibbles: usize },
    /// Event 22 seen, and event 25 or not yet.
    Leaving { confirmed: bool },
}

impl World {
    /// What the printer does about an edge of the host's.
    pub(super) fn react(&mut self, line: Line, level: u8) {
        let late = self.peripheral.answer_after;
        let now = self.now;
        let due = self.responses.extract_if(.., |(at, _)| *at <= now);
        self.peripheral.reverse_data.extend(due.flat_map(|(_, bytes)| bytes));
        match (self.phase, line, level) {
            (_, Line::Init, 0) => {
                self.resets += 1;
                self.give_up();
            }
            (Phase::Forward, Line::Strobe, 0) => self.take(),
            (Phase::Forward, Line::AutoFeed, 0)
                if self.level(Line::SelectIn) == 1 && self.peripheral.negotiates =>
            {
                self.phase = Phase::Negotiating { mode: None };
                for (line, level) in
                    [(Line::PaperOut, 1), (Line::Select, 1), (Line::Fault, 1), (Line::Ack, 0)]
                {
                    self.plan(late, line, level);
                }
            }
            (Phase::Negotiating { mode: None }, Line::Strobe, 0) => {
                self.phase = Phase::Negotiating { mode: Some(self.level(Line::Data)) };
            }
            (Phase::Negotiating { mode: Some(mode) }, Line::AutoFeed, 1) => {
                let known = match mode {
                    0x00 => true,
                    0x04 => self.peripheral.device_id.is_some(),
                    _ => false,
                };
                // XFlag says yes by 1, but for plain nibble mode by 0; an unknown request is refused by 0.
                let flag = u8::from(known && mode != 0);
                self.phase = Phase::Reverse { id: mode == 0x04 && known, nibbles: 0 };
                let more = known && self.more();
                self.offer(more, flag);
                self.plan(late + 500, Line::Ack, 1);
            }
            (Phase::Reverse { id, nibbles }, Line::AutoFeed, 0) if self.more() => {
                if self.peripheral.dumb_after.is_some_and(|limit| nibbles >= limit) {
                    return;
                }
                let byte = self.answer(id)[nibbles / 2];
                let nibble = byte >> (4 * (nibbles % 2)) & 0xf;
                for (bit, line) in
                    [Line::Fault, Line::Select, Line::PaperOut, Line::Busy].into_iter().enumerate()
                {
                    self.plan(late, line, nibble >> bit & 1);
                }
                self.plan(late + 500, Line::Ack, 0);
                self.phase = Phase::Reverse { id, nibbles: nibbles + 1 };
            }
            (Phase::Reverse { id, nibbles }, Line::AutoFeed, 1)
                if nibbles > 0 && self.level(Line::SelectIn) == 1 =>
            {
                if nibbles % 2 == 0 {
                    let more = self.more();
                    self.offer(more, u8::from(id));
                }
                self.plan(late + 500, Line::Ack, 1);
            }
            (Phase::Negotiating { .. } | Phase::Reverse { .. }, Line::SelectIn, 0) => {
                if let Phase::Reverse { id: false, nibbles } = self.phase {
                    // What was read once is gone.
                    self.sent_back += nibbles / 2;
                }
                self.phase = Phase::Leaving { confirmed: false };
                self.patience = Some(now + HOST_NS);
                self.plan(late, Line::Fault, 1);
                self.plan(late, Line::Busy, 0);
                self.plan(late, Line::Ack, 0);
            }
            (Phase::Leaving { confirmed: false }, Line::AutoFeed, 0) => {
                self.phase = Phase::Leaving { confirmed: true };
                for (line, level) in
                    [(Line::PaperOut, 0), (Line::Select, 1), (Line::Fault, 1), (Line::Ack, 1)]
                {
                    self.plan(late, line, level);
                }
            }
            (Phase::Leaving { confirmed: true }, Line::AutoFeed, 1) => {
                (self.phase, self.patience) = (Phase::Forward, None);
            }
            _ => {}
        }
    }

    /// The printer waits no longer for a host that has begun to leave, as one that restarts does:
    /// compatibility mode again.
    pub(super) fn give_up(&mut self) {
        self.patience = None;
        if self.phase != Phase::Forward {
            self.phase = Phase::Forward;
            for (line, level) in
                [(Line::PaperOut, 0), (Line::Select, 1), (Line::Fault, 1), (Line::Busy, 0), (Line::Ack, 1)]
            {
                self.change(line, level);
            }
        }
    }

    /// The printer's own switch. The lines of a printer that is off rest as the board's resistors have them.
    pub(super) fn switch(&mut self, on: bool) {
        (self.off, self.patience) = (!on, None);
        (self.phase, self.sent_back, self.ready_at) = (Phase::Forward, self.peripheral.reverse_data.len(), 0);
        self.plan.clear();
        self.responses.clear();
        let rest = u8::from(!on);
        for (line, level) in [
            (Line::Power, u8::from(on)),
            (Line::Busy, rest),
            (Line::PaperOut, rest),
            (Line::Select, 1),
            (Line::Fault, 1),
            (Line::Ack, 1),
        ] {
            self.change(line, level);
        }
    }

    fn take(&mut self) {
        if self.now < self.ready_at {
            return;
        }
        self.taken.push(self.level(Line::Data));
        if self.taken.ends_with(&STATUS) {
            let status = self.peripheral.status.iter();
            self.responses.extend(status.map(|Response { after, bytes }| (self.now + after, bytes.clone())));
        }
        let Peripheral { busy_after, work, ack, has_busy, .. } = self.peripheral;
        let mut busy = work;
        let count = self.taken.len();
        let pauses: Vec<Pause> =
            self.peripheral.pauses.extract_if(.., |pause| pause.after == count).collect();
        for pause in pauses {
            let (bad, good) = match pause.line {
                Line::Busy => (1, 0),
                Line::PaperOut => (1, 0),
                _ => (0, 1),
            };
            busy = busy.max(pause.ns);
            if pause.line != Line::Busy {
                self.plan(busy_after, pause.line, bad);
                self.plan(busy_after + pause.ns, pause.line, good);
            }
        }
        self.ready_at = self.now + busy_after + busy;
        if has_busy {
            self.plan(busy_after, Line::Busy, 1);
            self.plan(busy_after + busy + ack, Line::Busy, 0);
        }
        if ack > 0 {
            self.plan(busy_after + busy, Line::Ack, 0);
            self.plan(busy_after + busy + ack, Line::Ack, 1);
        }
    }

    fn answer(&self, id: bool) -> &[u8] {
        if id {
            self.peripheral.device_id.as_deref().unwrap_or(&[])
        } else {
            &self.peripheral.reverse_data[self.sent_back.min(self.peripheral.reverse_data.len())..]
        }
    }

    fn more(&self) -> bool {
        match self.phase {
            Phase::Reverse { id, nibbles } => nibbles < 2 * self.answer(id).len(),
            _ => false,
        }
    }

    fn offer(&mut self, more: bool, flag: u8) {
        let late = self.peripheral.answer_after;
        for (line, level) in [
            (Line::Fault, u8::from(!more)),
            (Line::PaperOut, u8::from(!more)),
            (Line::Select, flag),
            (Line::Busy, 0),
        ] {
            self.plan(late, line, level);
        }
    }
}
