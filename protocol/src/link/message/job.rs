//! What the messages tell of a job: its kind, how far it is, how it has ended and what was wrong with its data.
//!
//! Problem: neither side may take a job for printed that is not, or print it twice. Method: a job has a number of the
//! host's, and [`Progress`] counts bytes from its beginning. Limits: 4 GB of data in a job; the numbers of states and
//! defects are part of the wire format.

use super::Fault;
use serde::{Deserialize, Serialize};

/// The kind of a job's data.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum JobKind {
    /// The printer's language, made elsewhere and passed through.
    Raw,
    /// A job header and one pass stream per pass, which the bridge turns into the printer's language.
    Streams,
}

/// How far a job is. All positions count from the beginning of the job and never go back, except that `accepted` starts
/// again from 0 if the bridge itself has restarted in the middle of a job.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Progress {
    /// The job, or 0 if there was none since the bridge started.
    pub job: u32,
    /// Its state.
    pub state: JobState,
    /// Data bytes accepted: the next piece should begin here.
    pub accepted: u32,
    /// The bridge has memory for data up to here; never less than `accepted`.
    pub limit: u32,
    /// Bytes that have crossed the port.
    pub printed: u32,
    /// The pass those belong to, from 0.
    pub pass: u8,
    /// The next row of that pass.
    pub row: u16,
}

impl Progress {
    /// Whether the job is open: neither ended nor none.
    pub const fn is_open(&self) -> bool {
        match self.state {
            JobState::None
            | JobState::Done
            | JobState::Cancelled
            | JobState::Broken(_)
            | JobState::Lost
            | JobState::Stored => false,
            JobState::Printing | JobState::Stopped(_) | JobState::Cancelling | JobState::Storing => true,
        }
    }
}

/// The state of a job.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum JobState {
    /// There is no job.
    None,
    /// The bridge waits for data or sends them to the printer.
    Printing,
    /// The printer does not take bytes. The job continues when the fault is gone.
    Stopped(Fault),
    /// The job is being ended early.
    Cancelling,
    /// Every byte has crossed the port.
    Done,
    /// The job was ended early, and the printer is ready for the next one.
    Cancelled,
    /// The data were invalid. The job was ended as if cancelled.
    Broken(Defect),
    /// The job was given up in the middle: the printer was switched off, or the bridge was reset and the data were gone.
    /// Nothing more was sent, and the sheet is lost.
    Lost,
    /// The bridge waits for data or writes them to its flash.
    Storing,
    /// All of the job is in the bridge's flash.
    Stored,
}

/// What is wrong with a job's data.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Defect {
    /// Offset in the job's data of the byte where it was noticed.
    pub at: u32,
    /// Its kind.
    pub what: DefectKind,
}

/// Kinds of defect.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DefectKind {
    /// Not a job header that this bridge knows.
    Header,
    /// The header asks for something that must not be sent to the printer.
    Forbidden,
    /// The page needs more memory than the bridge has.
    TooLarge,
    /// Not a pass stream.
    Stream,
    /// Data after the end of the job.
    Excess,
    /// The data end before the job does.
    Truncated,
    /// The bridge's flash does not keep what is written.
    Flash,
}

/// How a job has ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct PastJob {
    /// The job, or 0.
    pub job: u32,
    /// How it has ended.
    pub state: JobState,
    /// Bytes that had crossed the port.
    pub printed: u32,
}

impl PastJob {
    /// The place of a job there has not been.
    pub const NONE: PastJob = PastJob { job: 0, state: JobState::None, printed: 0 };
}

/// A job in the bridge's flash.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StoredJob<'a> {
    /// The number it was stored under.
    pub job: u32,
    /// The kind of its data.
    pub kind: JobKind,
    /// Its number of data bytes.
    pub length: u32,
    /// What people call it.
    pub name: &'a str,
}
