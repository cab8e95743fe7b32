//! What the bridge says to the workstation.
//!
//! Problem: a host may have missed what was said before. Method: a message reports a state, not a change, and an answer
//! has the number of its question. Limits: a piece of the log has at most [`DATA_MAX`] bytes, and of the jobs that have
//! ended the last [`PAST`] are told.

#[cfg(doc)]
use super::{DATA_MAX, SCHEMA, ToBridge, VERSION};
use super::{Fault, Lines, PAST, PastJob, Progress, Standing, StoredJob};
use serde::{Deserialize, Serialize};

/// From the bridge to the workstation.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "there is no allocation to put a variant in, and messages are not stored"
)]
pub enum ToHost<'a> {
    /// The bridge's answer to [`ToBridge::Hello`].
    Hello {
        /// [`VERSION`] of the bridge.
        version: u8,
        /// [`SCHEMA`] of the bridge.
        schema: u32,
        /// Differs after every restart of the bridge.
        boot: u32,
        /// The board's serial number, to tell two bridges apart.
        serial: u64,
        /// Version of the firmware, for display.
        firmware: &'a str,
    },
    /// How far the job is. Sent after everything that could change it, at intervals while printing, and when the host
    /// repeats a message.
    Progress(Progress),
    /// The port's status lines.
    Lines {
        /// The number of the question.
        request: u16,
        /// The levels.
        lines: Lines,
        /// The fault they show, if any.
        fault: Option<Fault>,
    },
    /// The answer to a question to the printer.
    Answer {
        /// The number of the question.
        request: u16,
        /// The answer.
        #[serde(borrow)]
        answer: Answer<'a>,
    },
    /// The bridge did not act on a message. Damaged frames are ignored, not refused.
    Refused {
        /// Why.
        reason: Refusal,
        /// The job the message named, or 0.
        job: u32,
    },
    /// A piece of the firmware's log without its offset. Bridges send [`ToHost::LogPart`] instead.
    Log(&'a [u8]),
    /// A piece of the firmware's log, encoded by defmt.
    LogPart {
        /// The number of the question.
        request: u16,
        /// Offset of the first byte. Beyond the byte asked for if that is gone: the log keeps only the last bytes.
        at: u32,
        /// Bytes logged so far: the last piece ends there.
        end: u32,
        /// The bytes, at most [`DATA_MAX`].
        bytes: &'a [u8],
    },
    /// The jobs of the link that have ended, the last one first. Numbers 0 fill the rest.
    Past([PastJob; PAST]),
    /// The firmware's use of its memory and time.
    Board {
        /// The number of the question.
        request: u16,
        /// The use.
        usage: Usage,
    },
    /// What the bridge has in its flash.
    Stored {
        /// The number of the question.
        request: u16,
        /// How many jobs there are.
        count: u8,
        /// Bytes of data that one more job may have.
        room: u32,
        /// Bytes of data that the only job might have; 0 if the bridge cannot store any.
        total: u32,
        /// The job that was asked for, if there is one.
        #[serde(borrow)]
        job: Option<StoredJob<'a>>,
    },
    /// Where the printer stands. No byte goes to one of which that is not known but behind a reset.
    Standing {
        /// Where.
        standing: Standing,
        /// The job of which it has a part, or may have; 0 if there is none.
        job: u32,
    },
}

/// The answer to a question to the printer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Answer<'a> {
    /// What the printer sent.
    Bytes(&'a [u8]),
    /// A job is open.
    NotNow,
    /// The printer does not negotiate: its port is one-way.
    OneWay,
    /// The printer negotiated but did not answer in time.
    Silent,
    /// The printer does not take bytes at the moment, so it could not be asked.
    Stopped(Fault),
    /// The bridge does not know whether the printer stands between two jobs, so it was not asked.
    Unsure,
}

/// Why the bridge did not act on a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Refusal {
    /// Not a message of this version.
    Unknown,
    /// Another job is open, and the last progress has its number; or the board has another task at the moment.
    JobOpen,
    /// No such job.
    NoSuchJob,
    /// The same number was used for a job of another kind or length.
    OtherJob,
    /// Job number 0, or a length of 0.
    Empty,
    /// Data beyond the limit the bridge gave.
    BeyondLimit,
    /// Settings that the port cannot use.
    Settings,
    /// The bridge's flash has no room for the job.
    NoRoom,
}

/// How much of its memory and time the firmware has used since the board started.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Usage {
    /// Bytes of memory that belong to something fixed.
    pub fixed: u32,
    /// Bytes of memory for the stack.
    pub stack: u32,
    /// The most bytes of the stack that were in use at a time.
    pub stack_used: u32,
    /// The longest time in µs that one task has kept the processor from the others.
    pub longest_us: u32,
}
