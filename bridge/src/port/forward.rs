//! Compatibility mode: bytes to the printer.

use super::{AckPin, DataBus, Port};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use protocol::link::message::{Fault, Handshake, Lines};

/// What came of [`Port::write`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Written {
    /// How many of the bytes have crossed the port.
    pub count: usize,
    /// Why not more, if not all.
    pub stop: Option<Stop>,
}

/// Why the port takes no byte at the moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stop {
    /// The printer is at work. Try again soon.
    Busy,
    /// Someone has to see to the printer. Try again for as long as it takes.
    Fault(Fault),
}

/// Between two looks at the lines, in ns.
const POLL_NS: u32 = 500;

/// Looks before [`Port::write`] returns to its caller: 50 µs or more. A byte every 100 µs is the pace of a
/// slow dot-matrix printer; above it the caller's overhead is what it would have waited anyway.
const POLLS: u32 = 100;

impl<D, O, I, A, T> Port<D, O, I, A, T>
where
    D: DataBus,
    O: OutputPin<Error = Infallible>,
    I: InputPin<Error = Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// Gives bytes to the printer until it stops taking them. `now_ms` is the caller's clock, which may wrap; it
    /// only decides when a busy printer is called a fault.
    pub fn write(&mut self, bytes: &[u8], now_ms: u32) -> Written {
        for (count, &byte) in bytes.iter().enumerate() {
            if let Err(stop) = self.put(byte, now_ms) {
                return Written { count, stop: Some(stop) };
            }
        }
        Written { count: bytes.len(), stop: None }
    }

    /// One byte, or why not. The byte is on the port exactly if this is `Ok`.
    fn put(&mut self, byte: u8, now_ms: u32) -> Result<(), Stop> {
        for _ in 0..POLLS {
            if !self.ready() {
                self.delay.delay_ns(POLL_NS);
                continue;
            }
            self.pins.data.put(byte);
            self.delay.delay_ns(self.timing.setup);
            // The printer may have gone busy or off line in the meantime; the data may stand, nobody latches. Setting up again and
            // again could take milliseconds.
            if !self.ready() {
                break;
            }
            self.pins.ack.arm();
            let Ok(()) = self.pins.strobe.set_low();
            self.delay.delay_ns(self.timing.strobe);
            let Ok(()) = self.pins.strobe.set_high();
            self.delay.delay_ns(self.timing.hold);
            self.delay.delay_ns(self.timing.settle.saturating_sub(self.timing.strobe + self.timing.hold));
            self.unacknowledged = self.handshake != Handshake::Busy;
            self.waiting_since_ms = None;
            return Ok(());
        }
        Err(self.why(now_ms))
    }

    /// Whether the printer has done with the last byte and takes another.
    fn ready(&mut self) -> bool {
        // The latch first: after the last look at it the printer may still take its time with Busy.
        if self.unacknowledged && self.pins.ack.fell() {
            self.unacknowledged = false;
        }
        let lines = self.lines().heeding(self.heed);
        let acknowledged = match self.handshake {
            Handshake::Busy => true,
            // The pulse must be over, or the next one would be the same edge.
            Handshake::BusyAck | Handshake::Ack => !self.unacknowledged && lines.high(Lines::ACK),
        };
        let busy = lines.high(Lines::BUSY) && self.handshake != Handshake::Ack;
        acknowledged && !busy && lines.fault().is_none()
    }

    /// What the printer is waited for, after looking for a while.
    fn why(&mut self, now_ms: u32) -> Stop {
        let since = *self.waiting_since_ms.get_or_insert(now_ms);
        let lines = self.lines().heeding(self.heed);
        if let Some(fault) = lines.fault() {
            // The operator may take any time; what the printer does afterwards is timed from then.
            self.waiting_since_ms = None;
            return Stop::Fault(fault);
        }
        let waited = now_ms.wrapping_sub(since);
        if self.unacknowledged && !lines.high(Lines::BUSY) {
            // The port says that it is ready, so nAck is not late but lost. That is reported once and the next
            // byte goes out by Busy alone: a pulse too short for the cable must not hold a sheet for ever.
            if waited < ACK_LIMIT_MS {
                return Stop::Busy;
            }
            self.unacknowledged = false;
            self.waiting_since_ms = None;
            return Stop::Fault(Fault::NoAck);
        }
        if waited >= self.patience_ms { Stop::Fault(Fault::BusyTooLong) } else { Stop::Busy }
    }
}

/// How long nAck may stay away while Busy is low: a thousand times its usual 5 µs, and then some.
const ACK_LIMIT_MS: u32 = 1000;
