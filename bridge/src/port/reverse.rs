//! Negotiation and nibble mode: bytes from the printer over its five status lines.
//!
//! The data lines stay outputs, so one-way buffers do. A printer that does not know IEEE 1284 does not answer
//! the first step within 35 ms; the lines then go back to where they were and forward printing goes on.
//! The event numbers are the standard's.

use super::{AckPin, DataBus, Port};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use protocol::link::message::Lines;

/// Why nothing could be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReverseError {
    /// The printer is busy or has a fault; it might answer, but its buffered data are not to be risked.
    NotIdle,
    /// No answer to the negotiation: not a 1284 device, or switched off.
    OneWay,
    /// The printer negotiates but does not offer this mode.
    Refused,
    /// It stopped in the middle. What had come until then stands in the buffer: so many bytes.
    Silent(usize),
}

/// Extensibility byte: nibble mode.
const NIBBLE: u8 = 0x00;
/// Extensibility byte: device ID in nibble mode.
const DEVICE_ID: u8 = 0x04;

/// Limit of the standard for every answer of the printer, in µs, and what the Linux driver adds to it.
const ANSWER_US: u32 = 40_000;

/// Between two looks, in µs.
const POLL_US: u32 = 1;

impl<D, O, I, A, T> Port<D, O, I, A, T>
where
    D: DataBus,
    O: OutputPin<Error = Infallible>,
    I: InputPin<Error = Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// The device ID as the printer sends it, two length bytes and text; as much as fits `buffer`. The length
    /// bytes are not believed (printers send them in either order, or wrong): it ends where the printer says
    /// that there is no more.
    pub fn device_id(&mut self, buffer: &mut [u8]) -> Result<usize, ReverseError> {
        self.reverse(DEVICE_ID, buffer)
    }

    /// What the printer has to say now, as much as fits `buffer`; often nothing. An answer to a question may take
    /// the printer seconds: ask again.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ReverseError> {
        self.reverse(NIBBLE, buffer)
    }

    fn reverse(&mut self, mode: u8, buffer: &mut [u8]) -> Result<usize, ReverseError> {
        if self.lines().high(Lines::BUSY) {
            return Err(ReverseError::NotIdle);
        }
        self.negotiate(mode)?;
        let mut count = 0;
        let outcome = loop {
            if count == buffer.len() {
                break Ok(count);
            }
            match self.byte() {
                Ok(Some(byte)) => {
                    buffer[count] = byte;
                    count += 1;
                }
                Ok(None) => break Ok(count),
                Err(()) => break Err(ReverseError::Silent(count)),
            }
        };
        self.terminate();
        outcome
    }

    /// Events 0 to 6. On failure the port is back in compatibility mode.
    fn negotiate(&mut self, mode: u8) -> Result<(), ReverseError> {
        self.pins.data.put(mode);
        self.delay.delay_us(10);
        let (Ok(()), Ok(())) = (self.pins.select_in.set_high(), self.pins.auto_feed.set_low());
        let answer = Lines::PAPER_OUT | Lines::SELECT | Lines::FAULT;
        if !self.wait(|lines| lines.high(answer) && !lines.high(Lines::ACK)) {
            self.rest();
            return Err(ReverseError::OneWay);
        }
        let Ok(()) = self.pins.strobe.set_low();
        self.delay.delay_us(5);
        let (Ok(()), Ok(())) = (self.pins.strobe.set_high(), self.pins.auto_feed.set_high());
        if !self.wait(|lines| lines.high(Lines::ACK)) {
            self.terminate();
            return Err(ReverseError::OneWay);
        }
        // XFlag: 0 says yes to plain nibble mode, which every 1284 device has, and no to everything else.
        if self.lines().high(Lines::SELECT) != (mode != NIBBLE) {
            self.terminate();
            return Err(ReverseError::Refused);
        }
        Ok(())
    }

    /// One byte, low nibble first, or none if the printer has no more.
    fn byte(&mut self) -> Result<Option<u8>, ()> {
        if self.lines().high(Lines::FAULT) {
            return Ok(None);
        }
        let low = self.nibble()?;
        let high = self.nibble()?;
        Ok(Some(low | high << 4))
    }

    /// Events 7 to 11.
    fn nibble(&mut self) -> Result<u8, ()> {
        let Ok(()) = self.pins.auto_feed.set_low();
        if !self.wait(|lines| !lines.high(Lines::ACK)) {
            return Err(());
        }
        let lines = self.lines();
        let Ok(()) = self.pins.auto_feed.set_high();
        if !self.wait(|lines| lines.high(Lines::ACK)) {
            return Err(());
        }
        let bits = [Lines::FAULT, Lines::SELECT, Lines::PAPER_OUT, Lines::BUSY];
        Ok(bits.iter().enumerate().fold(0, |nibble, (i, &line)| nibble | u8::from(lines.high(line)) << i))
    }

    /// Events 22 to 29; a printer that does not follow is left behind by force, which the standard allows at any
    /// time.
    fn terminate(&mut self) {
        let (Ok(()), Ok(())) = (self.pins.select_in.set_low(), self.pins.auto_feed.set_high());
        if self.wait(|lines| !lines.high(Lines::ACK)) {
            let Ok(()) = self.pins.auto_feed.set_low();
            self.wait(|lines| lines.high(Lines::ACK));
        }
        self.rest();
    }

    fn wait(&mut self, until: impl Fn(Lines) -> bool) -> bool {
        for _ in 0..ANSWER_US / POLL_US {
            let lines = self.lines();
            if until(lines) {
                // The other lines are valid before nAck moves, but ours were not read all at once.
                return true;
            }
            self.delay.delay_us(POLL_US);
        }
        false
    }
}
