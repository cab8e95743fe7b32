//! The negotiation's answers: whatever a printer shows on its lines, and when, a conversation ends, with the port at rest.
//!
//! Each byte of the input is what the lines show at the next looks, and for how many of them.

use bridge::port::{AckPin, Conversation, DataBus, Pins, Port, Reverse, ReverseError};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use std::cell::RefCell;

/// Lines of a printer.
pub fn check(bytes: &[u8]) {
    for what in [Reverse::DeviceId, Reverse::Answer] {
        let wire = RefCell::new(Wire { script: bytes.iter().copied(), now: 0, left: 0, at_rest: [false; 4] });
        let pins = Pins {
            data: Data,
            strobe: Out(&wire, 0, true),
            auto_feed: Out(&wire, 1, true),
            init: Out(&wire, 2, true),
            select_in: Out(&wire, 3, false),
            ack: In(&wire, 0),
            busy: In(&wire, 1),
            paper_out: In(&wire, 2),
            select: In(&wire, 3),
            fault: In(&wire, 4),
            power: Some(In(&wire, 5)),
        };
        let mut port = Port::new(pins, Delay);
        let (mut talk, mut text) = (Conversation::new(what), [0; 64]);
        let mut ended = None;
        // The standard gives a printer 35 ms for an answer; two for each nibble of 64 bytes, and some more.
        for ms in 0..20_000u64 {
            ended = port.converse(&mut talk, &mut text, ms * 1000);
            if ended.is_some() {
                break;
            }
        }
        match ended.expect("a conversation that ends") {
            Ok(count) | Err(ReverseError::Silent(count)) => assert!(count <= text.len()),
            Err(_) => {}
        }
        assert_eq!(wire.borrow().at_rest, [true; 4], "nStrobe, nAutoFd, nInit, nSelectIn at rest");
    }
}

struct Wire<I> {
    script: I,
    now: u8,
    left: u8,
    /// Whether each control line is at its idle level.
    at_rest: [bool; 4],
}

impl<I: Iterator<Item = u8>> Wire<I> {
    /// The lines at this look. The last ones stay.
    fn look(&mut self) -> u8 {
        match self.left.checked_sub(1) {
            Some(left) => self.left = left,
            None => {
                if let Some(byte) = self.script.next() {
                    // +5 V is mostly there.
                    self.now = byte & 0x1f | if byte == 0xff { 0 } else { 0x20 };
                    self.left = byte >> 5;
                }
            }
        }
        self.now
    }
}

struct Data;

impl DataBus for Data {
    fn put(&mut self, _byte: u8) {}
}

struct Delay;

impl DelayNs for Delay {
    fn delay_ns(&mut self, _ns: u32) {}
}

struct Out<'w, I>(&'w RefCell<Wire<I>>, usize, bool);

impl<I> ErrorType for Out<'_, I> {
    type Error = Infallible;
}

impl<I> OutputPin for Out<'_, I> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().at_rest[self.1] = !self.2;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().at_rest[self.1] = self.2;
        Ok(())
    }
}

struct In<'w, I>(&'w RefCell<Wire<I>>, u8);

impl<I> ErrorType for In<'_, I> {
    type Error = Infallible;
}

impl<I: Iterator<Item = u8>> InputPin for In<'_, I> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.borrow_mut().look() >> self.1 & 1 == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        InputPin::is_high(self).map(|high| !high)
    }
}

impl<I: Iterator<Item = u8>> AckPin for In<'_, I> {
    fn is_high(&mut self) -> bool {
        let Ok(high) = InputPin::is_high(self);
        high
    }

    fn arm(&mut self) {}

    fn fell(&mut self) -> bool {
        !AckPin::is_high(self)
    }
}
