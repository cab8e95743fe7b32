//! What the workstation says to the bridge.
//!
//! Problem: whatever is sent may arrive twice or not at all. Method: a message that belongs to a job or a question names
//! it, and data name their offset, so repeating them is harmless. Limits: a piece of data has at most [`DATA_MAX`] bytes.

#[cfg(doc)]
use super::{Answer, DATA_MAX, JobState, NAME_MAX, SCHEMA, ToHost, VERSION};
use super::{JobKind, PortSettings};
use serde::{Deserialize, Serialize};

/// From the workstation to the bridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ToBridge<'a> {
    /// A host has connected. Answered by [`ToHost::Hello`], [`ToHost::Past`], [`ToHost::Progress`] and
    /// [`ToHost::Standing`], in this order. Changes nothing: a job under way continues.
    Hello {
        /// [`VERSION`] of the host.
        version: u8,
        /// [`SCHEMA`] of the host.
        schema: u32,
    },
    /// Opens a job. Repeating it for the same job changes nothing. Answered by [`ToHost::Progress`].
    Begin {
        /// The host's number for the job: not 0, and never used for another job.
        job: u32,
        /// The kind of its data.
        kind: JobKind,
        /// Its number of data bytes.
        length: u32,
    },
    /// A piece of a job's data. Bytes that were accepted before are skipped. A piece that begins beyond the accepted
    /// position is dropped. Answered by [`ToHost::Progress`], not necessarily one by one.
    Data {
        /// The job.
        job: u32,
        /// Offset of the first byte in the job's data.
        offset: u32,
        /// At most [`DATA_MAX`] bytes.
        #[serde(borrow)]
        bytes: &'a [u8],
    },
    /// Ends a job early, leaving the printer ready for the next one. Answered by [`ToHost::Progress`].
    Cancel {
        /// The job.
        job: u32,
    },
    /// Asks a question. Answered by [`ToHost::Lines`] or [`ToHost::Answer`] with the same number.
    Ask {
        /// Number of the question, returned with the answer.
        request: u16,
        /// The question.
        what: Ask,
    },
    /// Sets how the port is driven, from the next byte on.
    Configure(PortSettings),
    /// Resets the printer with a pulse on nInit; answered by [`ToHost::Lines`] when that is done. Refused while a job is open, which
    /// only [`ToBridge::Abandon`] gives up.
    Initialise {
        /// Number of the question, returned with the answer.
        request: u16,
    },
    /// Restarts the bridge in its boot loader, for flashing. Refused while a job is open.
    Bootloader,
    /// Sets the port's outputs by hand, for the wiring test; [`Ask::Lines`] reads the inputs. The idle levels (data 0, control 7)
    /// end the test, and the next job starts from them in any case. Refused while a job is open.
    Drive {
        /// Levels of Data1..Data8, Data1 in bit 0.
        data: u8,
        /// Levels of nStrobe, nAutoFd, nInit, nSelectIn in bits 0..3.
        control: u8,
    },
    /// Like [`ToBridge::Drive`], and reads the inputs once they have settled. Answered by [`ToHost::Lines`] with the same
    /// number, or by [`Answer::NotNow`] while a job is open.
    Probe {
        /// Number of the question, returned with the answer.
        request: u16,
        /// Levels of Data1..Data8, Data1 in bit 0.
        data: u8,
        /// Levels of nStrobe, nAutoFd, nInit, nSelectIn in bits 0..3.
        control: u8,
    },
    /// Asks for a piece of the firmware's log. Answered by [`ToHost::LogPart`] with the same number, at any time.
    ReadLog {
        /// Number of the question, returned with the answer.
        request: u16,
        /// The first byte wanted, counted since the log began. 0 gives the oldest bytes kept.
        from: u32,
    },
    /// Gives up an open job wherever it stands, and resets the printer. The job is [`JobState::Lost`], or
    /// [`JobState::Cancelled`] if none of it has crossed the port. Answered by [`ToHost::Progress`].
    Abandon {
        /// The job.
        job: u32,
    },
    /// Opens a job that is kept in the bridge's flash instead of being printed; its data follow as those of any other. Repeating
    /// it for the same job changes nothing. Answered by [`ToHost::Progress`]; the job ends as [`JobState::Stored`].
    Store {
        /// The host's number for the job: not 0, and never used for another job.
        job: u32,
        /// The kind of its data.
        kind: JobKind,
        /// Its number of data bytes.
        length: u32,
        /// What people call it, at most [`NAME_MAX`] bytes.
        name: &'a str,
    },
    /// Asks for a stored job. Answered by [`ToHost::Stored`] with the same number.
    ListStored {
        /// Number of the question, returned with the answer.
        request: u16,
        /// Which one, the oldest being 0.
        index: u8,
    },
    /// Prints a stored job, which stays in the store. Repeating it for the same job changes nothing. Answered by
    /// [`ToHost::Progress`].
    PrintStored {
        /// The number of the job at the printer, as in [`ToBridge::Begin`].
        job: u32,
        /// The number it was stored under.
        stored: u32,
    },
    /// Deletes a stored job. Answered by [`ToHost::Stored`] with the same number and without a job.
    DeleteStored {
        /// Number of the question, returned with the answer.
        request: u16,
        /// The number it was stored under.
        stored: u32,
    },
}

/// The questions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Ask {
    /// The current levels of the port's status lines.
    Lines,
    /// The printer's own status answer of 38 bytes. Not while a job is open: the question would be row data. Not while the
    /// bridge does not know whether the printer stands between two jobs ([`Answer::Unsure`]).
    Printer,
    /// The printer's IEEE 1284 device ID. As [`Ask::Printer`], since a negotiation may disturb a printer inside a job.
    DeviceId,
    /// The same as [`Ask::Printer`]. By this a host once vouched for the printer, and none does any more.
    Vouched,
    /// The firmware's use of its memory and time. Answered by [`ToHost::Board`].
    Board,
}
