//! Who is at the other end of a link, by its Hello.

use protocol::link::message::{VERSION, hello_version};
use serde::Serialize;

/// A bridge as it introduces itself.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Bridge {
    /// Version of its messages.
    pub version: u8,
    /// Differs after every restart.
    pub boot: u32,
    /// The board's own number.
    pub serial: u64,
    /// Version of the firmware.
    pub firmware: String,
}

/// What to do about a bridge of another version.
pub(crate) fn other_version(found: u8) -> &'static str {
    if found < VERSION {
        "`foilpress bridge flash` puts the firmware that came with this program on it"
    } else {
        "install the foilpress its firmware came with, or put this program's firmware on it with `foilpress bridge flash`"
    }
}

/// The bridge that has sent a Hello of a version this program does not know.
pub(crate) fn stranger(message: &[u8]) -> Option<Bridge> {
    let version = hello_version(message).filter(|&version| version != VERSION)?;
    Some(Bridge { version, boot: 0, serial: 0, firmware: "of another release".into() })
}

/// Text from a cable, fit for a terminal.
pub(crate) fn printable(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(120).collect()
}
