//! What the messages tell of the printer's port: how it is driven, what its lines show, why it takes no bytes.
//!
//! Problem: printers, cables and boards differ in their times and in the lines that can be relied on. Method: times,
//! handshake and the lines to heed are settings; a fault is read from the levels in an order of precedence, the supply
//! first, since the lines of a printer that is off mean nothing. Limits: times up to 65 µs, a patience up to 18 hours.

use serde::{Deserialize, Serialize};

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

/// Where the printer stands, as far as the bridge knows. Any other number says that it does not know.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Standing(pub u8);

impl Standing {
    /// The bridge does not know. The printer may have a part of a job.
    pub const UNKNOWN: Standing = Standing(0);
    /// It stands between two jobs.
    pub const AT_REST: Standing = Standing(1);
    /// It has a part of a job, and waits for the rest.
    pub const IN_SHEET: Standing = Standing(2);
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
