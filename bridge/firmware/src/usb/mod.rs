//! The USB device: a serial port and a pair of bulk endpoints, both speaking frames, and an ordinary [`printer`], which
//! speaks none.
//!
//! What arrives is always read: flow control is by credits in the frames, never by leaving an endpoint full, so a
//! cancel or a question is seen however much data is under way. The printer's endpoint is the exception, since its
//! class has no other flow control.

pub mod control;
pub mod device;
pub mod link;
pub mod printer;

use embassy_rp::peripherals::USB;
use embassy_rp::usb::Driver;

/// The driver.
pub type Usb = control::Watchful<Driver<'static, USB>>;
/// A bulk endpoint to the host.
pub type BulkIn = <Usb as embassy_usb::driver::Driver<'static>>::EndpointIn;
/// A bulk endpoint from the host.
pub type BulkOut = <Usb as embassy_usb::driver::Driver<'static>>::EndpointOut;

/// Bytes of a full packet.
pub const PACKET: u16 = 64;

const _: () = assert!(PACKET as usize == bridge::printer_class::PACKET);
