//! The messages between workstation and bridge.
//!
//! The bytes are postcard's: a variant is its number, integers are varints (seven bits to a byte, low bits first), a
//! slice is its length and its bytes. **The numbers and the order of fields are the wire format.** Variants are only ever
//! appended. A field is never added, moved or widened; a new variant takes its place. A reader that meets an unknown
//! number gets [`frame::Unknown`](super::frame::Unknown) and answers [`Refusal::Unknown`].
//!
//! The order of answers has no meaning. Every message of the bridge reports a state, so it may be lost, repeated or late
//! without harm, and a host that has missed one asks again.

use serde::{Deserialize, Serialize};

/// Version of the link. It changes only if an old message, or the data of a job, changes its meaning, not when messages are
/// appended.
pub const VERSION: u8 = 5;

/// Fingerprint of the message set: the CRC-32 over one example of every variant. With equal fingerprints, host and bridge
/// know the same messages. With different fingerprints but the same version, both understand everything the older knows.
pub const SCHEMA: u32 = 0x415e_b2c7;

/// Levels of the data lines and of nStrobe, nAutoFd, nInit, nSelectIn (bits 0..3) at rest: with them a wiring test ends.
pub const AT_REST: (u8, u8) = (0, 0b0111);

/// How many ended jobs a bridge remembers.
pub const PAST: usize = 16;

/// The number of a job that was started with the bridge's button.
pub const ALONE: u32 = u32::MAX - 1;

/// Bytes of the name of a stored job, at most.
pub const NAME_MAX: usize = 36;

/// The most data bytes in one [`ToBridge::Data`]. They fit a frame whatever the other fields are.
pub const DATA_MAX: usize = 960;

/// The version in a Hello of either side, whatever else its version has in it: these two bytes never change.
pub fn hello_version(message: &[u8]) -> Option<u8> {
    match message {
        [0, version, ..] => Some(*version),
        _ => None,
    }
}

/// From the workstation to the bridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ToBridge<'a> {
    /// A host has connected. Answered by [`ToHost::Hello`], [`ToHost::Past`] and [`ToHost::Progress`], in this order. Changes
    /// nothing: a job under way continues.
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
    /// Resets the printer with a pulse on nInit. Refused while a job is open. A job that was open when the bridge itself was
    /// reset, and whose data have not been sent again, is given up as [`JobState::Lost`].
    Initialise,
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

/// The kind of a job's data.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum JobKind {
    /// The printer's language, made elsewhere and passed through.
    Raw,
    /// A job header and one pass stream per pass, which the bridge turns into the printer's language.
    Streams,
}

/// The questions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Ask {
    /// The current levels of the port's status lines.
    Lines,
    /// The printer's own status answer of 38 bytes. Not while a job is open: the question would be row data. Not while the
    /// bridge does not know whether the printer stands between two jobs ([`Answer::Unsure`]).
    Printer,
    /// The printer's IEEE 1284 device ID. Not while a job is open.
    DeviceId,
    /// The same as [`Ask::Printer`], by a host that knows that the printer stands between two jobs.
    PrinterAtRest,
    /// The firmware's use of its memory and time. Answered by [`ToHost::Board`].
    Board,
}

/// How the port is driven.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct PortSettings {
    /// Data valid before nStrobe falls, in ns.
    pub setup_ns: u16,
    /// nStrobe low, in ns.
    pub strobe_ns: u16,
    /// Data held after nStrobe rises, in ns.
    pub hold_ns: u16,
    /// Time after nStrobe falls before Busy is read, in ns.
    pub settle_ns: u16,
    /// Which of the printer's signals ends a byte.
    pub handshake: Handshake,
    /// How long the printer may be busy without reporting an error before the host is told, in seconds. The byte is kept
    /// and goes out when Busy falls, however late.
    pub patience_s: u16,
    /// The status lines that are wired and reliable, as in [`Lines`]. The others are read as idle.
    pub heed: Lines,
}

/// Which of the printer's signals ends a byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Handshake {
    /// Busy is low again.
    Busy,
    /// nAck has pulsed and Busy is low again.
    BusyAck,
    /// nAck has pulsed; Busy is not wired or not reliable.
    Ack,
}

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

/// Why the printer does not take bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// PError is high.
    PaperOut,
    /// Select is low.
    OffLine,
    /// nFault is low, with paper and on line.
    Error,
    /// The port's +5 V are missing.
    PowerOff,
    /// Busy for longer than [`PortSettings::patience_s`], with no error line set.
    BusyTooLong,
    /// Busy is low but nAck never came, although the handshake asks for it.
    NoAck,
    /// Somebody holds the job with the bridge's button.
    Held,
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
    /// Another job is open; the last progress has its number.
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

/// Levels of the port's status lines.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Lines(pub u8);

impl Lines {
    /// nAck; high when idle.
    pub const ACK: u8 = 1 << 0;
    /// Busy.
    pub const BUSY: u8 = 1 << 1;
    /// PError: no paper.
    pub const PAPER_OUT: u8 = 1 << 2;
    /// Select: on line.
    pub const SELECT: u8 = 1 << 3;
    /// nFault; high when all is well.
    pub const FAULT: u8 = 1 << 4;
    /// +5 V of the printer. Always set by a bridge that has no wire for it.
    pub const POWER: u8 = 1 << 5;

    /// All of them.
    pub const ALL: Lines = Lines(0x3f);

    /// A printer that is switched on, on line and waiting for data.
    pub const IDLE: Lines = Lines(Self::ACK | Self::SELECT | Self::FAULT | Self::POWER);

    /// Whether all of `lines` are high.
    pub fn high(self, lines: u8) -> bool {
        self.0 & lines == lines
    }

    /// These levels on the lines in `heed`, and idle levels on the others.
    pub fn heeding(self, heed: Lines) -> Lines {
        Lines((self.0 & heed.0) | (Lines::IDLE.0 & !heed.0))
    }

    /// The fault that the lines show, if any. Busy is no fault.
    pub fn fault(self) -> Option<Fault> {
        if !self.high(Self::POWER) {
            Some(Fault::PowerOff)
        } else if self.high(Self::PAPER_OUT) {
            Some(Fault::PaperOut)
        } else if !self.high(Self::SELECT) {
            Some(Fault::OffLine)
        } else if !self.high(Self::FAULT) {
            Some(Fault::Error)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::super::frame;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const SETTINGS: PortSettings = PortSettings {
        setup_ns: 800,
        strobe_ns: 800,
        hold_ns: 800,
        settle_ns: 500,
        handshake: Handshake::Busy,
        patience_s: 600,
        heed: Lines(0x3f),
    };
    const PROGRESS: Progress = Progress {
        job: 7,
        state: JobState::Printing,
        accepted: 1200,
        limit: 9392,
        printed: 300,
        pass: 1,
        row: 40,
    };

    /// Job 7 printed, with 300 bytes; job 6 lost behind 4 bytes; 14 empty places.
    const PAST_BYTES: &[u8] = &[
        7, 7, 4, 0xac, 2, 6, 7, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ];

    fn with_state(state: JobState) -> ToHost<'static> {
        ToHost::Progress(Progress { job: 1, state, accepted: 2, limit: 3, printed: 4, pass: 5, row: 6 })
    }

    fn broken(what: DefectKind) -> ToHost<'static> {
        with_state(JobState::Broken(Defect { at: 9, what }))
    }

    /// One example of every variant and the bytes it has had since it was introduced.
    fn to_bridge() -> Vec<(ToBridge<'static>, &'static [u8])> {
        let settings = |handshake| ToBridge::Configure(PortSettings { handshake, ..SETTINGS });
        let ask = |what| ToBridge::Ask { request: 300, what };
        std::vec![
            (ToBridge::Hello { version: 1, schema: 0x0102_0304 }, &[0, 1, 0x84, 0x86, 0x88, 0x08]),
            (ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 1061 }, &[1, 7, 0, 0xa5, 0x08]),
            (ToBridge::Begin { job: 7, kind: JobKind::Streams, length: 1061 }, &[1, 7, 1, 0xa5, 0x08]),
            (
                ToBridge::Data { job: 7, offset: 960, bytes: &[0x1b, 0x65, 0] },
                &[2, 7, 0xc0, 0x07, 3, 0x1b, 0x65, 0]
            ),
            (ToBridge::Cancel { job: 7 }, &[3, 7]),
            (ask(Ask::Lines), &[4, 0xac, 0x02, 0]),
            (ask(Ask::Printer), &[4, 0xac, 0x02, 1]),
            (ask(Ask::DeviceId), &[4, 0xac, 0x02, 2]),
            (settings(Handshake::Busy), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 0, 0xd8, 4, 0x3f]),
            (settings(Handshake::BusyAck), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 1, 0xd8, 4, 0x3f]),
            (settings(Handshake::Ack), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 2, 0xd8, 4, 0x3f]),
            (ToBridge::Initialise, &[6]),
            (ToBridge::Bootloader, &[7]),
            (ToBridge::Drive { data: 0xaa, control: 0b0111 }, &[8, 0xaa, 7]),
            (ToBridge::Probe { request: 300, data: 0xaa, control: 0b0111 }, &[9, 0xac, 0x02, 0xaa, 7]),
            (ToBridge::ReadLog { request: 300, from: 1200 }, &[10, 0xac, 0x02, 0xb0, 9]),
            (ToBridge::Abandon { job: 7 }, &[11, 7]),
            (ask(Ask::PrinterAtRest), &[4, 0xac, 0x02, 3]),
            (ask(Ask::Board), &[4, 0xac, 0x02, 4]),
            (
                ToBridge::Store { job: 7, kind: JobKind::Streams, length: 1061, name: "leaf" },
                &[12, 7, 1, 0xa5, 0x08, 4, b'l', b'e', b'a', b'f'],
            ),
            (ToBridge::ListStored { request: 300, index: 2 }, &[13, 0xac, 0x02, 2]),
            (ToBridge::PrintStored { job: 8, stored: 7 }, &[14, 8, 7]),
            (ToBridge::DeleteStored { request: 300, stored: 7 }, &[15, 0xac, 0x02, 7]),
        ]
    }

    fn to_host() -> Vec<(ToHost<'static>, &'static [u8])> {
        let lines = |fault| ToHost::Lines { request: 3, lines: Lines(0x39), fault };
        let answer = |answer| ToHost::Answer { request: 3, answer };
        let refused = |reason| ToHost::Refused { reason, job: 7 };
        let stored = |job| ToHost::Stored { request: 3, count: 1, room: 1000, total: 2000, job };
        let mut past = [PastJob::NONE; PAST];
        past[0] = PastJob { job: 7, state: JobState::Done, printed: 300 };
        past[1] = PastJob { job: 6, state: JobState::Lost, printed: 4 };
        let usage = Usage { fixed: 1024, stack: 2048, stack_used: 100, longest_us: 9 };
        std::vec![
            (
                ToHost::Hello { version: 1, schema: 0x80, boot: 5, serial: 0xe660, firmware: "0.1" },
                &[0, 1, 0x80, 1, 5, 0xe0, 0xcc, 3, 3, b'0', b'.', b'1'],
            ),
            (ToHost::Progress(PROGRESS), &[1, 7, 1, 0xb0, 9, 0xb0, 0x49, 0xac, 2, 1, 40]),
            (with_state(JobState::None), &[1, 1, 0, 2, 3, 4, 5, 6]),
            (with_state(JobState::Stopped(Fault::PaperOut)), &[1, 1, 2, 0, 2, 3, 4, 5, 6]),
            (with_state(JobState::Cancelling), &[1, 1, 3, 2, 3, 4, 5, 6]),
            (with_state(JobState::Done), &[1, 1, 4, 2, 3, 4, 5, 6]),
            (with_state(JobState::Cancelled), &[1, 1, 5, 2, 3, 4, 5, 6]),
            (broken(DefectKind::Header), &[1, 1, 6, 9, 0, 2, 3, 4, 5, 6]),
            (broken(DefectKind::Forbidden), &[1, 1, 6, 9, 1, 2, 3, 4, 5, 6]),
            (broken(DefectKind::TooLarge), &[1, 1, 6, 9, 2, 2, 3, 4, 5, 6]),
            (broken(DefectKind::Stream), &[1, 1, 6, 9, 3, 2, 3, 4, 5, 6]),
            (broken(DefectKind::Excess), &[1, 1, 6, 9, 4, 2, 3, 4, 5, 6]),
            (broken(DefectKind::Truncated), &[1, 1, 6, 9, 5, 2, 3, 4, 5, 6]),
            (with_state(JobState::Lost), &[1, 1, 7, 2, 3, 4, 5, 6]),
            (lines(None), &[2, 3, 0x39, 0]),
            (lines(Some(Fault::PaperOut)), &[2, 3, 0x39, 1, 0]),
            (lines(Some(Fault::OffLine)), &[2, 3, 0x39, 1, 1]),
            (lines(Some(Fault::Error)), &[2, 3, 0x39, 1, 2]),
            (lines(Some(Fault::PowerOff)), &[2, 3, 0x39, 1, 3]),
            (lines(Some(Fault::BusyTooLong)), &[2, 3, 0x39, 1, 4]),
            (lines(Some(Fault::NoAck)), &[2, 3, 0x39, 1, 5]),
            (answer(Answer::Bytes(&[2, 0x80])), &[3, 3, 0, 2, 2, 0x80]),
            (answer(Answer::NotNow), &[3, 3, 1]),
            (answer(Answer::OneWay), &[3, 3, 2]),
            (answer(Answer::Silent), &[3, 3, 3]),
            (answer(Answer::Stopped(Fault::OffLine)), &[3, 3, 4, 1]),
            (refused(Refusal::Unknown), &[4, 0, 7]),
            (refused(Refusal::JobOpen), &[4, 1, 7]),
            (refused(Refusal::NoSuchJob), &[4, 2, 7]),
            (refused(Refusal::OtherJob), &[4, 3, 7]),
            (refused(Refusal::Empty), &[4, 4, 7]),
            (refused(Refusal::BeyondLimit), &[4, 5, 7]),
            (refused(Refusal::Settings), &[4, 6, 7]),
            (ToHost::Log(&[1, 2]), &[5, 2, 1, 2]),
            (
                ToHost::LogPart { request: 3, at: 1200, end: 1202, bytes: &[1, 2] },
                &[6, 3, 0xb0, 9, 0xb2, 9, 2, 1, 2],
            ),
            (answer(Answer::Unsure), &[3, 3, 5]),
            (ToHost::Past(past), PAST_BYTES),
            (ToHost::Board { request: 3, usage }, &[8, 3, 0x80, 8, 0x80, 0x10, 100, 9]),
            (with_state(JobState::Storing), &[1, 1, 8, 2, 3, 4, 5, 6]),
            (with_state(JobState::Stored), &[1, 1, 9, 2, 3, 4, 5, 6]),
            (lines(Some(Fault::Held)), &[2, 3, 0x39, 1, 6]),
            (broken(DefectKind::Flash), &[1, 1, 6, 9, 6, 2, 3, 4, 5, 6]),
            (refused(Refusal::NoRoom), &[4, 7, 7]),
            (stored(None), &[9, 3, 1, 0xe8, 7, 0xd0, 0x0f, 0]),
            (
                stored(Some(StoredJob { job: 7, kind: JobKind::Streams, length: 1061, name: "leaf" })),
                &[9, 3, 1, 0xe8, 7, 0xd0, 0x0f, 1, 7, 1, 0xa5, 0x08, 4, b'l', b'e', b'a', b'f'],
            ),
        ]
    }

    #[test]
    fn bytes_never_change() {
        let mut buffer = [0; frame::MAX];
        for (message, bytes) in to_bridge() {
            assert_eq!(postcard::to_slice(&message, &mut buffer).unwrap(), bytes, "{message:?}");
            assert_eq!(frame::decode::<ToBridge>(bytes), Ok(message));
        }
        for (message, bytes) in to_host() {
            assert_eq!(postcard::to_slice(&message, &mut buffer).unwrap(), bytes, "{message:?}");
            assert_eq!(frame::decode::<ToHost>(bytes), Ok(message));
        }
    }

    #[test]
    fn the_fingerprint_is_that_of_every_example() {
        let all: Vec<u8> = to_bridge()
            .iter()
            .map(|(_, bytes)| *bytes)
            .chain(to_host().iter().map(|(_, bytes)| *bytes))
            .flatten()
            .copied()
            .collect();
        let sum = frame::checksum(&all);
        assert_eq!(SCHEMA, sum, "the message set has changed: SCHEMA should be {sum:#010x}");
    }

    #[test]
    fn numbers_of_the_future_are_unknown_and_not_misread() {
        assert_eq!(frame::decode::<ToBridge>(&[99, 1, 2]), Err(frame::Unknown));
        assert_eq!(frame::decode::<ToHost>(&[1, 1, 99, 2, 3, 4, 5, 6]), Err(frame::Unknown));
        // A longer form of a known message is not that message.
        assert_eq!(frame::decode::<ToBridge>(&[3, 7, 0]), Err(frame::Unknown));
    }

    #[test]
    fn the_longest_data_message_fits_a_frame() {
        let message = ToBridge::Data { job: u32::MAX, offset: u32::MAX, bytes: &[0xff; DATA_MAX] };
        assert!(frame::write(&message, &mut [0; frame::MAX]).is_ok());
    }

    #[test]
    fn the_version_of_a_hello_is_found_whatever_follows_it() {
        for (_, bytes) in to_bridge().iter().take(1) {
            assert_eq!(hello_version(bytes), Some(1));
        }
        assert_eq!(hello_version(to_host()[0].1), Some(1));
        assert_eq!(hello_version(&[0, 77, 1, 2, 3, 4, 5, 6, 7]), Some(77));
        assert_eq!((hello_version(&[1, 77]), hello_version(&[0]), hello_version(&[])), (None, None, None));
    }

    #[test]
    fn the_longest_memory_of_ended_jobs_fits_a_frame() {
        let state = JobState::Broken(Defect { at: u32::MAX, what: DefectKind::Truncated });
        let past = [PastJob { job: u32::MAX, state, printed: u32::MAX }; PAST];
        assert!(frame::write(&ToHost::Past(past), &mut [0; frame::MAX]).is_ok());
    }

    #[test]
    fn the_worked_examples_of_the_document_are_these_bytes() {
        let text = include_str!("../../../docs/wire-format.md");
        let mut buffer = [0; frame::MAX];
        let check = |frame: &[u8]| {
            let hex: Vec<std::string::String> = frame.iter().map(|byte| std::format!("{byte:02x}")).collect();
            let hex = hex.join(" ");
            assert!(text.contains(&std::format!("`{hex}`")), "docs/wire-format.md does not show `{hex}`");
        };
        let examples = [
            ToBridge::Hello { version: VERSION, schema: SCHEMA },
            ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 1061 },
            ToBridge::Data { job: 7, offset: 960, bytes: &[0x1b, 0x65, 0] },
            ToBridge::Cancel { job: 7 },
        ];
        for message in &examples {
            let length = frame::write(message, &mut buffer).unwrap();
            check(&buffer[..length]);
        }
        let length = frame::write(&ToHost::Progress(PROGRESS), &mut buffer).unwrap();
        check(&buffer[..length]);
    }

    #[test]
    fn a_printer_that_is_off_is_not_called_out_of_paper() {
        assert_eq!(Lines::IDLE.fault(), None);
        assert_eq!(Lines(Lines::IDLE.0 | Lines::BUSY).fault(), None);
        assert_eq!(Lines(Lines::PAPER_OUT).fault(), Some(Fault::PowerOff));
        assert_eq!(Lines(Lines::POWER | Lines::PAPER_OUT).fault(), Some(Fault::PaperOut));
        assert_eq!(Lines(Lines::POWER | Lines::FAULT).fault(), Some(Fault::OffLine));
        assert_eq!(Lines(Lines::POWER | Lines::SELECT).fault(), Some(Fault::Error));
    }

    proptest! {
        #[test]
        fn no_bytes_make_decoding_fail_other_than_by_unknown(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
            let _ = frame::decode::<ToBridge>(&bytes);
            let _ = frame::decode::<ToHost>(&bytes);
        }
    }
}
