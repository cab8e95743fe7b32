//! The printer's status answer, and the troubles it reports.
//!
//! An answer has 38 bytes: `02 80`, the length 33, a status byte, nine cartridge entries of three bytes, five error bytes,
//! `03`. Source: answers recorded from the hardware; the layout is
//! that of the established open driver's tool.

use std::fmt;

use protocol::ink::Ink;

use super::carousel::PLACES;

/// Length of a status answer.
pub const STATUS_LENGTH: usize = 38;

/// The status question; legal between jobs only.
pub(super) const ASK: [u8; 2] = [0x05, 0x01];
/// "@RCL3": clears an error; answered by [`TAKEN`].
pub(super) const CLEAR: [u8; 11] = [0x02, 0x02, 0x06, 0x00, 0x40, 0x52, 0x43, 0x4c, 0x33, 0x01, 0x03];
/// Acknowledges a command; it does not report success.
pub(super) const TAKEN: u8 = 0x06;

/// Where sheets are taken from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Lever {
    /// The tray.
    #[default]
    Auto,
    /// The manual slot.
    Manual,
}

/// A reason for the printer to stop.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Trouble {
    /// There is no sheet.
    NoPaper,
    /// The sheet is shorter than the declared length plus the margins.
    WrongSize,
    /// A pass needs a cartridge that is missing.
    RibbonMismatch {
        /// Barcode of the missing cartridge.
        wanted: u8,
    },
    /// The ribbon of the pass is used up.
    RibbonEnd {
        /// Barcode of the cartridge.
        barcode: u8,
    },
    /// The cover is open.
    CoverOpen,
    /// The sheet is stuck.
    Jam {
        /// Whether it is stuck at the exit; otherwise it was not fed.
        at_exit: bool,
    },
    /// A motor has failed.
    Motor {
        /// 80 cartridge changer, 40 carriage, 20 bail arm, 10 line feed, 08 feeder, 04 anti-curl.
        unit: u8,
    },
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |barcode: u8| Ink::from_barcode(barcode).map_or("unknown", Ink::name);
        match *self {
            Trouble::NoPaper => f.write_str("no paper; load a sheet"),
            Trouble::WrongSize => f.write_str(
                "wrong paper size: the sheet is shorter than the job's page and its margins; load the declared paper",
            ),
            Trouble::RibbonMismatch { wanted } => {
                write!(f, "ribbon mismatch: insert the {} cartridge (barcode {wanted})", name(wanted))
            }
            Trouble::RibbonEnd { barcode } => {
                write!(f, "ribbon end: the {} ribbon (barcode {barcode}) is used up; insert a new cartridge", name(barcode))
            }
            Trouble::CoverOpen => f.write_str("the cover is open; close it"),
            Trouble::Jam { at_exit: true } => f.write_str("paper jam at the exit; remove the sheet"),
            Trouble::Jam { at_exit: false } => f.write_str("the sheet was not fed; load it again"),
            Trouble::Motor { unit } => {
                write!(f, "motor error (unit {unit:02x}); switch the printer off and on")
            }
        }
    }
}

impl Trouble {
    /// The five error bytes.
    pub(super) fn bytes(self, lever: Lever) -> [u8; 5] {
        let manual = lever == Lever::Manual;
        match self {
            Trouble::NoPaper => [0, 0x80, if manual { 0x40 } else { 0 }, 0, 0],
            Trouble::WrongSize => [0, 0x80, if manual { 0xc0 } else { 0x80 }, 0, 0],
            Trouble::RibbonMismatch { wanted } => [0, 0x10, 0, wanted << 3 | 6, 0],
            // Some bits give the cartridge holder, but their coding is unknown.
            Trouble::RibbonEnd { .. } => [0, 0x20, 0, 0, 0],
            Trouble::CoverOpen => [0x40, 0, 0, 0, 0],
            Trouble::Jam { at_exit } => {
                [0, 0x40, if at_exit { 0x08 } else { 0 } | if manual { 0x04 } else { 0 }, 0, 0]
            }
            Trouble::Motor { unit } => [0x80, 0, 0, 0, unit],
        }
    }

    /// Whether "@RCL3" clears it.
    pub(super) fn can_be_cleared(self) -> bool {
        !matches!(self, Trouble::Motor { .. } | Trouble::CoverOpen)
    }
}

/// What the printer is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Activity {
    Idle,
    /// It has received bytes of a job but printed nothing, or has just ejected the sheet.
    Buffered,
    Printing,
}

/// The status answer. `entries` are the first bytes of the cartridge entries. The other two bytes of each are 0 here: their
/// meaning is unknown, except that they are not the remaining ribbon.
pub(super) fn answer(
    activity: Activity,
    trouble: Option<Trouble>,
    lever: Lever,
    entries: [u8; PLACES + 1],
) -> [u8; STATUS_LENGTH] {
    let mut bytes = [0; STATUS_LENGTH];
    bytes[..4].copy_from_slice(&[0x02, 0x80, (STATUS_LENGTH - 5) as u8, 0]);
    bytes[4] = match activity {
        Activity::Idle => 0x00,
        Activity::Buffered if trouble.is_some() => 0x00,
        Activity::Buffered => 0x01,
        Activity::Printing => 0x09,
    } | if trouble.is_some() { 0xc0 } else { 0 }
        | if lever == Lever::Auto { 0x10 } else { 0 };
    for (place, entry) in bytes[5..32].chunks_exact_mut(3).zip(entries) {
        place[0] = entry;
    }
    bytes[32..37].copy_from_slice(&trouble.map_or([0; 5], |trouble| trouble.bytes(lever)));
    bytes[37] = 0x03;
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recorded_idle_answer_comes_out() {
        let entries = [0xff, 3, 1, 0, 0xff, 2, 0xff, 0xff, 0xff];
        let mut want = vec![0x02, 0x80, 0x21, 0x00, 0x00];
        entries.iter().for_each(|&entry| want.extend([entry, 0, 0]));
        want.extend([0, 0, 0, 0, 0, 0x03]);
        assert_eq!(answer(Activity::Idle, None, Lever::Manual, entries)[..], want);
    }

    #[test]
    fn troubles_have_the_recorded_error_bytes() {
        let manual = |trouble| {
            let bytes = answer(Activity::Printing, Some(trouble), Lever::Manual, [0xff; 9]);
            (bytes[4], bytes[32..37].to_vec())
        };
        assert_eq!(manual(Trouble::RibbonMismatch { wanted: 16 }), (0xc9, vec![0, 0x10, 0, 0x86, 0]));
        assert_eq!(Trouble::WrongSize.bytes(Lever::Auto), [0, 0x80, 0x80, 0, 0]);
        assert_eq!(Trouble::Motor { unit: 0x80 }.bytes(Lever::Auto), [0x80, 0, 0, 0, 0x80]);
        let auto = answer(Activity::Printing, Some(Trouble::NoPaper), Lever::Auto, [0xff; 9]);
        assert_eq!(auto[4], 0xd9);
        let before = answer(Activity::Buffered, Some(Trouble::NoPaper), Lever::Manual, [0xff; 9]);
        assert_eq!(before[4], 0xc0);
        assert_eq!(answer(Activity::Printing, None, Lever::Manual, [0xff; 9])[4], 0x09);
        assert_eq!(answer(Activity::Buffered, None, Lever::Manual, [0xff; 9])[4], 0x01);
        assert_eq!(answer(Activity::Idle, None, Lever::Auto, [0xff; 9])[4], 0x10);
    }
}
