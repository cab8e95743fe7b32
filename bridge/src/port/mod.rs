//! The parallel port, on any pins: IEEE 1284 compatibility mode forwards, nibble mode backwards.
//!
//! [`Port::write`] gives bytes to the printer with setup, strobe and hold times that are never shorter than
//! [`Timing`] says. It returns instead of waiting long: a printer may be busy for minutes while its owner looks
//! for paper, and the caller has a link to serve. Nothing is lost by that, since a byte is counted when it has
//! been strobed and only then.
//!
//! [`Port::converse`] turns the conversation round. It is for the time between jobs only: old printers take nSelectIn
//! high for a deselection. Nothing here holds the caller for longer than half a millisecond.
//!
//! Source: IEEE 1284-1994 events and limits as commonly published, parallel-port FIFO data sheets for the
//! times around Busy, the Linux parport driver for what printers put up with. Levels are those on the wire.

mod forward;
mod pins;
mod reverse;
mod timing;

pub use forward::{Stop, Written};
pub use pins::{AckPin, DataBus, Pins, Pins8, Polled};
pub use reverse::{Conversation, Reverse, ReverseError};
pub use timing::{BadSettings, Timing};

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::digital::{InputPin, PinState};
use protocol::link::message::{Fault, Handshake, Lines, PortSettings};

/// The port. Owns its pins; [`Port::new`] puts them to the idle levels.
pub struct Port<D, O, I, A, T> {
    pins: Pins<D, O, I, A>,
    delay: T,
    timing: Timing,
    handshake: Handshake,
    heed: Lines,
    patience_ms: u32,
    /// A byte was strobed and its nAck has not been seen.
    unacknowledged: bool,
    /// When the present wait began, by the caller's clock.
    waiting_since_ms: Option<u32>,
}

impl<D, O, I, A, T> Port<D, O, I, A, T>
where
    D: DataBus,
    O: OutputPin<Error = core::convert::Infallible>,
    I: InputPin<Error = core::convert::Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// A port at rest, with the default settings.
    pub fn new(pins: Pins<D, O, I, A>, delay: T) -> Self {
        let mut port = Port {
            pins,
            delay,
            timing: Timing::DEFAULT,
            handshake: Handshake::Busy,
            heed: Lines::ALL,
            patience_ms: Timing::PATIENCE_MS,
            unacknowledged: false,
            waiting_since_ms: None,
        };
        port.rest();
        port
    }

    /// Takes new settings, from the next byte on.
    pub fn configure(&mut self, settings: &PortSettings) -> Result<(), BadSettings> {
        self.timing = Timing::from_settings(settings)?;
        self.handshake = settings.handshake;
        self.heed = settings.heed;
        self.patience_ms = u32::from(settings.patience_s) * 1000;
        Ok(())
    }

    /// All outputs to their idle levels: nStrobe, nAutoFd and nInit high, nSelectIn low. The strobe first.
    pub fn rest(&mut self) {
        let (Ok(()), Ok(()), Ok(()), Ok(())) = (
            self.pins.strobe.set_high(),
            self.pins.auto_feed.set_high(),
            self.pins.init.set_high(),
            self.pins.select_in.set_low(),
        );
    }

    /// The status lines as they are on the wire.
    pub fn lines(&mut self) -> Lines {
        self.pins.lines()
    }

    /// What keeps the printer from taking bytes by its lines, as far as they are heeded.
    pub fn fault(&mut self) -> Option<Fault> {
        self.pins.lines().heeding(self.heed).fault()
    }

    /// Resets the printer: nInit low for at least 50 µs. The printer may then be busy for seconds.
    pub fn initialise(&mut self) {
        let Ok(()) = self.pins.init.set_low();
        self.delay.delay_us(100);
        let Ok(()) = self.pins.init.set_high();
        self.delay.delay_us(10);
        self.unacknowledged = false;
        self.waiting_since_ms = None;
    }

    /// Sets the outputs by hand, for a wiring test with a loop-back plug: Data1..Data8 from bit 0, and nStrobe,
    /// nAutoFd, nInit, nSelectIn from bit 0. Never with a printer connected; [`Port::rest`] ends it.
    pub fn drive(&mut self, data: u8, control: u8) {
        self.pins.data.put(data);
        let level = |bit: u8| PinState::from(control >> bit & 1 == 1);
        let (Ok(()), Ok(()), Ok(()), Ok(())) = (
            self.pins.strobe.set_state(level(0)),
            self.pins.auto_feed.set_state(level(1)),
            self.pins.init.set_state(level(2)),
            self.pins.select_in.set_state(level(3)),
        );
        // Lines need time through the level shifters and pull-ups before they are read back.
        self.delay.delay_us(10);
    }

    /// The pins, for a board that needs them back.
    pub fn release(self) -> (Pins<D, O, I, A>, T) {
        (self.pins, self.delay)
    }
}

#[cfg(test)]
mod tests;
