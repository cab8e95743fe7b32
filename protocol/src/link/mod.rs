//! The link between workstation and bridge: [frames](frame) that survive a bad cable, [messages](message) whose bytes
//! never change.
//!
//! The link is a byte pipe that may lose, repeat, reorder or damage whole frames and may disappear at any byte. Serial
//! port, bulk endpoint and socket all look alike. A job arrives exactly once not because of the frames but because of the
//! *position*: every piece of job data carries its offset, the bridge takes only the byte that comes next, and it reports
//! how far it has come. So sending anything twice is harmless, and losing anything costs a repetition.
//!
//! Flow control is by byte credits: [`message::Progress::limit`] is the offset up to which the bridge has memory. A host
//! that respects it can never fill the bridge's receive path. So a status request or a cancel is read at once however
//! much data is under way, and the bridge never has to stop reading.
//!
//! `docs/wire-format.md` describes the bytes; its worked examples are tests here.

pub mod frame;
pub mod message;
