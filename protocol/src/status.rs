//! The printer's answer to the status question: 38 bytes about its state, its cartridges and its errors.
//!
//! ```text
//! 02 80 length(2) state { entry(3) } errors(5) 03        length = 33, nine entries
//! ```
//!
//! The question is `05 01`, asked only before a job or after its last byte. The layout is that of the established open
//! driver's tool, checked against answers recorded from the hardware. The second and third byte of an entry look like the
//! level of the ribbon but are not: they rise and fall.

use crate::ink::Ink;

/// Length of an answer.
pub const LENGTH: usize = 38;

/// Cartridge places: four above, four below, and the one on the carriage.
pub const PLACES: usize = 9;

/// An answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Status {
    state: u8,
    entries: [u8; PLACES],
    errors: [u8; 5],
}

/// The bytes are not a status answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct NotAStatus;

/// What a cartridge place holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CartridgePlace {
    /// Nothing.
    Empty,
    /// A cartridge with this barcode.
    Loaded(u8),
    /// One inserted backwards.
    Backwards(u8),
    /// One whose ribbon is at its end.
    AtEnd(u8),
}

/// An error, as the printer reports it; the real cause may differ.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Complaint {
    /// A motor: which one is in the bits.
    Motor {
        /// Hexadecimal: 80 cartridge changer, 40 carriage, 20 bail arm, 10 line feed, 08 feeder, 04 anti-curl.
        units: u8,
    },
    /// The cover is open.
    CoverOpen,
    /// The settings memory has failed.
    Memory,
    /// There is no sheet to feed.
    NoPaper {
        /// In the manual slot; otherwise in the tray.
        manual: bool,
    },
    /// The sheet is shorter than the job declares.
    WrongSize {
        /// From the manual slot; otherwise from the tray.
        manual: bool,
    },
    /// The sheet is stuck.
    Jam {
        /// At the exit; otherwise it was not fed.
        at_exit: bool,
    },
    /// A ribbon is at its end.
    RibbonEnd,
    /// A ribbon is torn.
    RibbonBreak,
    /// Two cartridges for one place.
    PlaceOccupied,
    /// A pass needs a cartridge that is not loaded.
    WrongCartridge {
        /// The barcode of the cartridge wanted.
        wanted: u8,
    },
    /// An unknown error of a cartridge.
    Cartridge,
}

impl Status {
    /// Reads an answer. The bytes must be exactly one.
    pub fn parse(bytes: &[u8]) -> Result<Status, NotAStatus> {
        let [0x02, 0x80, 33, 0, state, rest @ ..] = bytes else { return Err(NotAStatus) };
        let Some((entries, [e0, e1, e2, e3, e4, 0x03])) = rest.split_at_checked(3 * PLACES) else {
            return Err(NotAStatus);
        };
        let mut first = [0; PLACES];
        for (place, entry) in first.iter_mut().zip(entries.chunks_exact(3)) {
            *place = entry[0];
        }
        Ok(Status { state: *state, entries: first, errors: [*e0, *e1, *e2, *e3, *e4] })
    }

    /// Whether the printer is off line.
    pub fn off_line(&self) -> bool {
        self.state & 0x80 != 0
    }

    /// Whether an error has stopped the printer. The places are then those from before the error, and do not tell whether
    /// an ink is missing.
    pub fn in_error(&self) -> bool {
        self.state & 0xc0 == 0xc0
    }

    /// Whether the printer is printing, which continues for long after the last byte of a job.
    pub fn printing(&self) -> bool {
        self.state & 0x08 != 0
    }

    /// Whether the feed lever is set to automatic, and not to manual.
    pub fn automatic_feed(&self) -> bool {
        self.state & 0x10 != 0
    }

    /// Whether there are data in the printer.
    pub fn has_data(&self) -> bool {
        self.state & 0x01 != 0
    }

    /// The places: upper 1 to 4, lower 1 to 4, carriage. The carousel turns, so find a cartridge by its barcode and not by
    /// its place.
    pub fn places(&self) -> [CartridgePlace; PLACES] {
        self.entries.map(|entry| match (entry, entry & 0x3f) {
            (0xff, _) => CartridgePlace::Empty,
            (0x00..0x40, barcode) => CartridgePlace::Loaded(barcode),
            (0x40..0x80, barcode) => CartridgePlace::Backwards(barcode),
            (0x80..0xc0, barcode) => CartridgePlace::AtEnd(barcode),
            _ => CartridgePlace::Empty,
        })
    }

    /// Whether a usable cartridge of this ink is loaded; `None` while the printer is in error, for then it does not tell.
    pub fn has(&self, ink: Ink) -> Option<bool> {
        (!self.in_error()).then(|| self.places().contains(&CartridgePlace::Loaded(ink.barcode())))
    }

    /// The errors that the printer reports; none unless it is in error.
    pub fn complaints(&self) -> impl Iterator<Item = Complaint> + use<> {
        let [e0, e1, e2, e3, e4] = if self.in_error() { self.errors } else { [0; 5] };
        let manual = e2 & 0x40 != 0;
        let cartridge = match (e3 & 7) >> 1 {
            2 => Complaint::PlaceOccupied,
            3 => Complaint::WrongCartridge { wanted: e3 >> 3 },
            _ => Complaint::Cartridge,
        };
        [
            (e0 & 0x80 != 0, Complaint::Motor { units: e4 }),
            (e0 & 0x40 != 0, Complaint::CoverOpen),
            (e0 & 0x01 != 0, Complaint::Memory),
            // Without paper the size is wrong too; that adds nothing.
            (e1 & 0x80 != 0 && e2 & 0x80 == 0, Complaint::NoPaper { manual }),
            (e2 & 0x80 != 0, Complaint::WrongSize { manual }),
            (e1 & 0x40 != 0, Complaint::Jam { at_exit: e2 & 0x08 != 0 }),
            (e1 & 0x20 != 0, Complaint::RibbonEnd),
            (e1 & 0x02 != 0, Complaint::RibbonBreak),
            (e1 & 0x10 != 0, cartridge),
        ]
        .into_iter()
        .filter_map(|(is, complaint)| is.then_some(complaint))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Recorded: idle, with cyan, yellow, black above and magenta below.
    const IDLE: [u8; LENGTH] = [
        0x02, 0x80, 0x21, 0x00, 0x00, 0xff, 0, 0, 0x03, 0, 0, 0x01, 0, 0, 0x00, 0, 0, 0xff, 0, 0, 0x02, 0, 0,
        0xff, 0, 0, 0xff, 0, 0, 0xff, 0, 0, 0, 0, 0, 0, 0, 0x03,
    ];

    fn with(state: u8, errors: [u8; 5]) -> Status {
        let mut bytes = IDLE;
        bytes[4] = state;
        bytes[32..37].copy_from_slice(&errors);
        Status::parse(&bytes).unwrap()
    }

    #[test]
    fn the_cartridges_of_an_idle_printer_are_found_by_their_barcodes() {
        let status = Status::parse(&IDLE).unwrap();
        assert!(!status.off_line() && !status.in_error() && !status.printing() && !status.has_data());
        for (ink, there) in [(Ink::Cyan, true), (Ink::Magenta, true), (Ink::Black, true), (Ink::White, false)]
        {
            assert_eq!(status.has(ink), Some(there));
        }
        assert_eq!(status.places()[1], CartridgePlace::Loaded(3));
        assert_eq!(status.places()[8], CartridgePlace::Empty);
    }

    #[test]
    fn recorded_errors_are_what_they_were() {
        // In the order of the recordings: a missing white, a sheet too short, a jam at the exit, the changer.
        let mismatch = with(0xc9, [0x00, 0x10, 0x00, 0x86, 0x00]);
        let complaints: Vec<_> = mismatch.complaints().collect();
        assert_eq!(complaints, [Complaint::WrongCartridge { wanted: Ink::White.barcode() }]);
        assert_eq!(mismatch.has(Ink::Cyan), None, "stale entries");
        assert!(with(0xc0, [0, 0x80, 0x80, 0, 0]).complaints().eq([Complaint::WrongSize { manual: false }]));
        let jam = with(0xd9, [0, 0xc0, 0x08, 0, 0]);
        assert!(
            jam.complaints().eq([Complaint::NoPaper { manual: false }, Complaint::Jam { at_exit: true }])
        );
        assert!(with(0xc0, [0x80, 0, 0, 0, 0x80]).complaints().eq([Complaint::Motor { units: 0x80 }]));
    }

    #[test]
    fn error_bytes_without_the_error_bit_are_old_news() {
        assert_eq!(with(0x10, [0x40, 0x10, 0, 0x86, 0]).complaints().count(), 0);
    }

    proptest! {
        #[test]
        fn only_whole_answers_are_answers(mut bytes in prop::collection::vec(any::<u8>(), 0..60), cut in 0..LENGTH) {
            let _ = Status::parse(&bytes).map(|status| (status.places(), status.complaints().count()));
            prop_assert_eq!(Status::parse(&IDLE[..cut]), Err(NotAStatus));
            bytes.insert(0, 0);
            let long: Vec<u8> = IDLE.iter().copied().chain(bytes).collect();
            prop_assert_eq!(Status::parse(&long), Err(NotAStatus));
        }
    }
}
