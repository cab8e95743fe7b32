//! The host's end of the simulated cable.

use super::{Line, World};
use crate::port::{AckPin, DataBus};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use std::cell::RefCell;
use std::rc::Rc;

/// Data1..Data8.
pub struct DataLines(pub(super) Rc<RefCell<World>>);

impl DataBus for DataLines {
    fn put(&mut self, byte: u8) {
        self.0.borrow_mut().host(Line::Data, byte);
    }
}

/// A line the host drives.
pub struct OutLine(pub(super) Rc<RefCell<World>>, pub(super) Line);

impl ErrorType for OutLine {
    type Error = Infallible;
}

impl OutputPin for OutLine {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().host(self.1, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().host(self.1, 1);
        Ok(())
    }
}

/// A line the printer drives.
pub struct InLine(pub(super) Rc<RefCell<World>>, pub(super) Line);

impl ErrorType for InLine {
    type Error = Infallible;
}

impl InputPin for InLine {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let mut world = self.0.borrow_mut();
        world.pass(8);
        Ok(world.level(self.1) == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

/// nAck, with an edge latch.
pub struct AckLine(pub(super) Rc<RefCell<World>>);

impl AckPin for AckLine {
    fn is_high(&mut self) -> bool {
        let mut world = self.0.borrow_mut();
        world.pass(8);
        world.level(Line::Ack) == 1
    }

    fn arm(&mut self) {
        self.0.borrow_mut().ack_latch = false;
    }

    fn fell(&mut self) -> bool {
        let mut world = self.0.borrow_mut();
        world.pass(8);
        world.ack_latch
    }
}

/// The clock.
pub struct DelayLine(pub(super) Rc<RefCell<World>>);

impl DelayNs for DelayLine {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().pass(u64::from(ns));
    }
}
