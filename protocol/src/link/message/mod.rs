//! The messages between workstation and bridge.
//!
//! Problem: host and bridge are updated apart from each other, so each must read what an older or newer one writes.
//! Method: [`ToBridge`] and [`ToHost`] are all that is ever said; `job` and `port` have what they carry. The bytes are
//! postcard's: a variant is its number, integers are varints (seven bits to a byte, low bits first), a slice is its length
//! and its bytes. **The numbers and the order of fields are the wire format.** Variants are only ever appended. A field is
//! never added, moved or widened; a new variant takes its place. A reader that meets an unknown number gets
//! [`frame::Unknown`](super::frame::Unknown) and answers [`Refusal::Unknown`].
//!
//! Limits: the order of answers has no meaning. Every message of the bridge reports a state, so it may be lost, repeated or
//! late without harm, and a host that has missed one asks again.

mod job;
mod port;
mod to_bridge;
mod to_host;

#[cfg(test)]
mod tests;

pub use job::{Defect, DefectKind, JobKind, JobState, PastJob, Progress, StoredJob};
pub use port::{Fault, Handshake, Lines, PortSettings, Standing};
pub use to_bridge::{Ask, ToBridge};
pub use to_host::{Answer, Refusal, ToHost, Usage};

/// Version of the link. It changes only if an old message, or the data of a job, changes its meaning, not when messages are
/// appended.
pub const VERSION: u8 = 5;

/// Fingerprint of the message set: the CRC-32 over one example of every variant. With equal fingerprints, host and bridge
/// know the same messages. With different fingerprints but the same version, both understand everything the older knows.
pub const SCHEMA: u32 = 0x9d69_23f6;

/// Levels of the data lines and of nStrobe, nAutoFd, nInit, nSelectIn (bits 0..3) at rest: with them a wiring test ends.
pub const AT_REST: (u8, u8) = (0, 0b0111);

/// How many ended jobs a bridge remembers.
pub const PAST: usize = 16;

/// The number of a job that came through the bridge's plain printer interface.
pub const LOCAL: u32 = u32::MAX;
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
