//! What the port needs of a board.

use core::convert::Infallible;
use embedded_hal::digital::{InputPin, OutputPin};
use protocol::link::message::Lines;

/// Eight data lines.
pub trait DataBus {
    /// Puts a byte on the lines, Data1 being bit 0.
    fn put(&mut self, byte: u8);
}

/// Eight single pins, Data1 first.
pub struct Pins8<P>(pub [P; 8]);

impl<P: OutputPin<Error = Infallible>> DataBus for Pins8<P> {
    fn put(&mut self, byte: u8) {
        for (bit, pin) in self.0.iter_mut().enumerate() {
            let Ok(()) = pin.set_state((byte >> bit & 1 == 1).into());
        }
    }
}

/// nAck with a memory: its pulse may be as short as 0.5 µs, so a board latches the falling edge.
pub trait AckPin {
    /// The level now.
    fn is_high(&mut self) -> bool;
    /// Forgets earlier pulses.
    fn arm(&mut self);
    /// Whether the line has fallen since [`AckPin::arm`].
    fn fell(&mut self) -> bool;
}

/// nAck without an edge latch: sees only pulses that are low when it looks. Enough for the Busy handshake and
/// for nibble mode, where nAck waits for the host; not enough for the other handshakes.
pub struct Polled<P> {
    pin: P,
    seen: bool,
}

impl<P> Polled<P> {
    /// Polls this pin.
    pub fn new(pin: P) -> Self {
        Polled { pin, seen: false }
    }
}

impl<P: InputPin<Error = Infallible>> AckPin for Polled<P> {
    fn is_high(&mut self) -> bool {
        let Ok(high) = self.pin.is_high();
        self.seen |= !high;
        high
    }

    fn arm(&mut self) {
        self.seen = false;
    }

    fn fell(&mut self) -> bool {
        !self.is_high() || self.seen
    }
}

/// The port's pins, by their names in compatibility mode.
pub struct Pins<D, O, I, A> {
    /// Data1..Data8.
    pub data: D,
    /// nStrobe.
    pub strobe: O,
    /// nAutoFd.
    pub auto_feed: O,
    /// nInit.
    pub init: O,
    /// nSelectIn.
    pub select_in: O,
    /// nAck.
    pub ack: A,
    /// Busy.
    pub busy: I,
    /// PError.
    pub paper_out: I,
    /// Select.
    pub select: I,
    /// nFault.
    pub fault: I,
    /// The printer's +5 V, where it is wired.
    pub power: Option<I>,
}

impl<D, O, I, A> Pins<D, O, I, A>
where
    I: InputPin<Error = Infallible>,
    A: AckPin,
{
    /// All status lines; Busy is looked at last, so that what follows is decided on its latest level.
    pub(super) fn lines(&mut self) -> Lines {
        let Ok(power) = self.power.as_mut().map_or(Ok(true), InputPin::is_high);
        let mut lines = if power { Lines::POWER } else { 0 };
        lines |= if self.ack.is_high() { Lines::ACK } else { 0 };
        let pins = [
            (&mut self.paper_out, Lines::PAPER_OUT),
            (&mut self.select, Lines::SELECT),
            (&mut self.fault, Lines::FAULT),
            (&mut self.busy, Lines::BUSY),
        ];
        for (pin, bit) in pins {
            let Ok(high) = pin.is_high();
            lines |= if high { bit } else { 0 };
        }
        Lines(lines)
    }
}
