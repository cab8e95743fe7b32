//! The open job, and the places on the sheet that its bytes belong to.

use heapless::Deque;
use protocol::link::message::{JobKind, JobState};

/// What the engine does with the open job.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// The bridge was reset: the host has to say again what the job is.
    Unknown,
    /// Data come in and bytes go out.
    Running,
    /// All bytes are in the output queue. Once they have crossed the port, the job has ended.
    Ending {
        /// How it has ended then.
        state: JobState,
        /// Whether it ends where the printer's state is not known, so that the printer must be reset.
        needs_reset: bool,
    },
}

/// Where a job's data come from and go to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// From a host to the port.
    ToPort,
    /// From a host to the board's flash.
    ToStore,
    /// From the board's flash to the port.
    FromStore,
}

/// Whether the host has cancelled the job, and where it ends then.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Cancel {
    /// It has not.
    None,
    /// It has.
    Requested,
    /// It has, and the early end begins at this byte at the port.
    Decided(u32),
}

#[derive(Clone, Copy)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) kind: JobKind,
    pub(super) way: Way,
    pub(super) length: u32,
    pub(super) accepted: u32,
    /// Data taken out of the queue again.
    pub(super) used: u32,
    /// Bytes made for the port, including those left out after a reset.
    pub(super) made: u32,
    /// Bytes that have crossed the port.
    pub(super) printed: u32,
    /// The store has lost the rest of it.
    pub(super) cut: bool,
    pub(super) phase: Phase,
    pub(super) cancel: Cancel,
    /// For raw jobs: the accepted data are whole commands up to here.
    pub(super) settled: u32,
    /// For raw jobs: of the data that have gone to the output, the job could be ended here.
    pub(super) closed: u32,
    pub(super) pass: u8,
    pub(super) row: u16,
}

impl Job {
    /// A job of which nothing has come yet.
    pub(super) fn new(id: u32, kind: JobKind, length: u32, way: Way) -> Self {
        Job {
            id,
            kind,
            way,
            length,
            accepted: 0,
            used: 0,
            made: 0,
            printed: 0,
            cut: false,
            phase: Phase::Running,
            cancel: Cancel::None,
            settled: 0,
            closed: 0,
            pass: 0,
            row: 0,
        }
    }

    /// Whether no more of the data may go to the port, because the host has cancelled the job. What had crossed the port
    /// before a reset is worked through first, so that the end comes where it came before the reset, or later.
    pub(super) fn must_stop(&self) -> bool {
        match self.cancel {
            Cancel::None => false,
            Cancel::Requested => self.made >= self.printed,
            Cancel::Decided(at) => self.made >= at,
        }
    }

    /// Where the early end begins, once that is decided.
    pub(super) fn ends_at(&self) -> Option<u32> {
        match self.cancel {
            Cancel::Decided(at) => Some(at),
            Cancel::None | Cancel::Requested => None,
        }
    }
}

/// A number of bytes, as wide as the positions in a job. The queues are far smaller than 4 GB, so nothing is cut; on the
/// microcontroller there is nothing to convert.
pub(super) fn positions(bytes: usize) -> u32 {
    u32::try_from(bytes).unwrap_or(u32::MAX)
}

/// Places on the sheet of bytes in the output, to tell what has crossed the port.
pub(super) struct Marks(Deque<Mark, 16>);

struct Mark {
    /// Bytes at the port, counted from the beginning of the job.
    at: u32,
    /// Pass and row of what comes after them.
    position: (u8, u16),
}

impl Marks {
    pub(super) const fn new() -> Self {
        Marks(Deque::new())
    }

    /// Records that what comes after byte `at` belongs at this position. If all places are taken, it is left out.
    pub(super) fn push(&mut self, at: u32, position: (u8, u16)) {
        let _ = self.0.push_back(Mark { at, position });
    }

    /// Removes the marks up to byte `at` and returns the position of the last of them, if there is one.
    pub(super) fn reach(&mut self, at: u32) -> Option<(u8, u16)> {
        let mut reached = None;
        while let Some(mark) = self.0.pop_front_if(|mark| mark.at <= at) {
            reached = Some(mark.position);
        }
        reached
    }
}
