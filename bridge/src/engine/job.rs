//! The job under way, and where on the sheet its bytes belong.

use protocol::link::message::{JobKind, JobState};

/// How the job under way ends when the output is empty.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// After a reset: the host has to say again what the job is.
    Unknown,
    /// Data come and bytes go.
    Running,
    /// Everything is in the output; then the job is this.
    Ending(JobState),
}

pub(super) struct Job {
    pub(super) id: u32,
    pub(super) kind: JobKind,
    pub(super) length: u32,
    pub(super) accepted: u32,
    /// Data taken out of the queue again.
    pub(super) used: u32,
    /// Bytes made for the port, those left out after a reset among them.
    pub(super) made: u32,
    /// Bytes that crossed it.
    pub(super) printed: u32,
    pub(super) phase: Phase,
    /// Cancelled by the host.
    pub(super) cancelled: bool,
    pub(super) ends_at: Option<u32>,
    /// For raw jobs: the data up to here are whole commands.
    pub(super) settled: u32,
    /// For raw jobs: up to here the job could be ended, of the data that have gone to the output.
    pub(super) closed: u32,
    pub(super) pass: u8,
    pub(super) row: u16,
}

impl Job {
    /// Whether nothing more of the data is to go to the port, because the host has said so. What had crossed the
    /// port before a reset is gone through first, so that the end comes where it came, or behind it.
    pub(super) fn must_stop(&self) -> bool {
        match self.ends_at {
            Some(at) => self.made >= at,
            None => self.cancelled && self.made >= self.printed,
        }
    }
}

/// Positions on the sheet of bytes in the output, to say what crossed the port.
pub(super) struct Marks {
    marks: [(u32, u8, u16); 16],
    first: usize,
    count: usize,
}

impl Marks {
    pub(super) const fn new() -> Self {
        Marks { marks: [(0, 0, 0); 16], first: 0, count: 0 }
    }

    /// Notes that what comes after byte `at` belongs there. With all places taken the note is left out.
    pub(super) fn push(&mut self, at: u32, (pass, row): (u8, u16)) {
        if self.count < self.marks.len() {
            self.marks[(self.first + self.count) % self.marks.len()] = (at, pass, row);
            self.count += 1;
        }
    }

    /// The last position not beyond byte `at`, if there is one; it is removed.
    pub(super) fn reach(&mut self, at: u32) -> Option<(u8, u16)> {
        let mut reached = None;
        while self.count > 0 && self.marks[self.first].0 <= at {
            reached = Some((self.marks[self.first].1, self.marks[self.first].2));
            self.first = (self.first + 1) % self.marks.len();
            self.count -= 1;
        }
        reached
    }
}
