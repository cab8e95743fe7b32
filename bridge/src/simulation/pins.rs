//! The host's end of the simulated cable.

use super::{Cable, Line};
use crate::port::{AckPin, DataBus};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

/// Data1..Data8.
pub struct DataLines(pub(super) Cable);

impl DataBus for DataLines {
    fn put(&mut self, byte: u8) {
        self.0.look().host(Line::Data, byte);
    }
}

/// A line the host drives.
pub struct OutLine(pub(super) Cable, pub(super) Line);

impl ErrorType for OutLine {
    type Error = Infallible;
}

impl OutputPin for OutLine {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.look().host(self.1, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.look().host(self.1, 1);
        Ok(())
    }
}

/// A line the printer drives.
pub struct InLine(pub(super) Cable, pub(super) Line);

impl ErrorType for InLine {
    type Error = Infallible;
}

impl InputPin for InLine {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let mut world = self.0.look();
        world.pass(8);
        Ok(world.level(self.1) == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

/// nAck, with an edge latch.
pub struct AckLine(pub(super) Cable);

impl AckPin for AckLine {
    fn is_high(&mut self) -> bool {
        let mut world = self.0.look();
        world.pass(8);
        world.level(Line::Ack) == 1
    }

    fn arm(&mut self) {
        self.0.look().ack_latch = false;
    }

    fn fell(&mut self) -> bool {
        let mut world = self.0.look();
        world.pass(8);
        world.ack_latch
    }
}

/// The clock.
pub struct DelayLine(pub(super) Cable);

impl DelayNs for DelayLine {
    fn delay_ns(&mut self, ns: u32) {
        self.0.look().pass(u64::from(ns));
    }
}
