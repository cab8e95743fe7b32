//! The link between workstation and bridge: [frames](frame) that survive a bad cable, [messages](message)
//! whose bytes never change.
//!
//! The link is a byte pipe that may lose, repeat, reorder or damage whole frames and may vanish at any byte
//! (serial port, bulk endpoint, socket: all look alike). What makes a job arrive exactly once is not the
//! frame but the *position*: every piece of job data carries its offset, the bridge takes only the byte that
//! comes next, and tells how far it has come. Sending anything twice is therefore harmless, and losing
//! anything costs a repetition.
//!
//! Flow control is by byte credits: [`message::Progress::limit`] is the offset up to which the bridge has
//! memory. A host that keeps to it can never fill the bridge's receive path, so a status request or a cancel
//! is read at once however much data is under way, and the bridge never has to stop reading.
//!
//! `docs/wire-format.md` describes the bytes; the worked examples there are tests here.

pub mod frame;
pub mod message;
