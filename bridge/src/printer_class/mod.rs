//! The bridge as an ordinary printer: the USB Printer class, so that any operating system prints without a program of
//! ours.
//!
//! Three things are decided here: what the class's requests mean and are answered ([`Request`], [`DeviceId`],
//! [`port_status`]), what becomes of the bytes of the bulk endpoint, and when a job is over ([`Intake`]). The
//! endpoints and their descriptors are the board's.
//!
//! GET_PORT_STATUS returns the lines at that moment. GET_DEVICE_ID returns what the printer said when it was last asked,
//! between jobs. Nothing is ever sent to the host by the other bulk endpoint; it is there because systems prefer printers
//! that have one.
//!
//! Source: USB Device Class Definition for Printing Devices 1.1.

mod device_id;
mod intake;

pub use device_id::{DEVICE_ID_MAX, DeviceId};
pub use intake::{End, Intake, Next, PACKET};

use protocol::link::message::Lines;

/// The interface's class, subclass and protocol: printer, printer, both directions.
pub const CLASS: [u8; 3] = [0x07, 0x01, 0x02];

/// What a SETUP packet says about whom it is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Setup {
    /// Direction in bit 7, type in bits 6 and 5, recipient below.
    pub request_type: u8,
    /// Which request.
    pub request: u8,
    /// For requests to an interface, its number.
    pub index: u16,
}

/// A request of the class.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request {
    /// GET_DEVICE_ID, answered by [`DeviceId::bytes`].
    DeviceId,
    /// GET_PORT_STATUS, answered by [`port_status`].
    PortStatus,
    /// SOFT_RESET, which is [`End::Reset`] to the [`Intake`].
    SoftReset,
}

impl Request {
    /// The request in a SETUP packet, if it is one to the printer interface of this number.
    pub fn parse(setup: &Setup, interface: u8) -> Option<Request> {
        let [low, high] = setup.index.to_le_bytes();
        match (setup.request_type, setup.request) {
            // Here, and only here, the interface is in the high byte.
            (0xa1, 0) if high == interface => Some(Request::DeviceId),
            (0xa1, 1) if low == interface => Some(Request::PortStatus),
            // Version 1.0 of the class had the recipient wrong, and Linux follows it.
            (0x21 | 0x23, 2) if low == interface => Some(Request::SoftReset),
            _ => None,
        }
    }
}

/// The answer to GET_PORT_STATUS: bit 3 no error, bit 4 selected, bit 5 paper empty.
pub fn port_status(lines: Lines) -> u8 {
    let bit = |on: bool, bit: u8| u8::from(on) << bit;
    // The lines of a printer that is off float; they are not its word.
    let on = lines.high(Lines::POWER);
    bit(on && lines.high(Lines::FAULT), 3)
        | bit(on && lines.high(Lines::SELECT), 4)
        | bit(on && lines.high(Lines::PAPER_OUT), 5)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn setup(request_type: u8, request: u8, index: u16) -> Setup {
        Setup { request_type, request, index }
    }

    #[test]
    fn the_requests_of_the_class_are_told_apart_by_recipient_and_interface() {
        let parse = |request_type, request, index| Request::parse(&setup(request_type, request, index), 3);
        assert_eq!(parse(0xa1, 0, 0x0300), Some(Request::DeviceId));
        assert_eq!(parse(0xa1, 1, 0x0003), Some(Request::PortStatus));
        assert_eq!(parse(0x21, 2, 0x0003), Some(Request::SoftReset));
        assert_eq!(parse(0x23, 2, 0x0003), Some(Request::SoftReset));
        let mut found = 0;
        for request_type in 0..=255 {
            for request in 0..8 {
                for index in [0, 1, 3, 0x0300, 0x0103, 0x0301] {
                    found += usize::from(parse(request_type, request, index).is_some());
                }
            }
        }
        // Each of the requests, with the other byte of the index free: it is the setting's or zero.
        assert_eq!(found, 2 + 2 + 2 * 2);
    }

    #[test]
    fn the_port_status_is_that_of_the_lines_while_the_printer_is_on() {
        for bits in 0..=Lines::ALL.0 {
            let lines = Lines(bits);
            let expected = if bits & Lines::POWER == 0 {
                0
            } else {
                (bits & Lines::FAULT) >> 4 << 3
                    | (bits & Lines::SELECT) >> 3 << 4
                    | (bits & Lines::PAPER_OUT) >> 2 << 5
            };
            assert_eq!(port_status(lines), expected, "{bits:#08b}");
        }
        assert_eq!(port_status(Lines::IDLE), 0x18);
    }
}
