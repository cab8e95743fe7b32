//! What has to be known of a job after this process is gone: the state that the journal keeps.
//!
//! A record is made durable before the step it speaks of; see [`super::session`] for which steps those are.

use protocol::link::message::JobKind;
use serde::{Deserialize, Serialize};

/// How far a job has come, as far as it matters after a crash.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// No bridge has heard of it.
    Queued,
    /// A bridge may have heard of it, but has no byte of it.
    Begun,
    /// Data may have reached the bridge, and the printer.
    Sending,
    /// It is over.
    Ended(Outcome),
}

/// How a job ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Every byte has crossed the port.
    Printed,
    /// Ended early on request; the printer is ready for the next job.
    Cancelled,
    /// The bridge could not make sense of the data.
    Broken,
    /// Printer or bridge lost their place in the middle: the sheet is lost. The bridge resets the printer before anything
    /// else goes to it.
    Lost,
    /// All of it is in the bridge's flash, and nothing printed.
    Stored,
    /// The bridge does not know of the job any more, though data had left for it. The sheet may be complete; if it is
    /// not, it is lost.
    Forgotten,
}

/// What has to outlive the process.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Record {
    /// The job's number; never 0.
    pub job: u32,
    /// What its data are.
    pub kind: JobKind,
    /// Length of the data in bytes.
    pub length: u32,
    /// How far it is.
    pub phase: Phase,
    /// Whether the user wants it ended early.
    pub cancel: bool,
    /// The bridge it was begun on, by its serial number.
    pub bridge: Option<u64>,
    /// Bytes that had crossed the port when last heard of. For the user only: the bridge decides where to go on.
    pub printed: u32,
}

impl Record {
    /// A job that waits.
    pub fn new(job: u32, kind: JobKind, length: u32) -> Record {
        Record { job, kind, length, phase: Phase::Queued, cancel: false, bridge: None, printed: 0 }
    }
}
