//! The board's pins, and the port's lines on them.
//!
//! The lines are driven through the SIO registers, whose bits each belong to one pin: setting a line is one store and
//! disturbs no other. nStrobe and the data lines are lent to the PIO block while a job is printed with the default
//! handshake; [`lend_to_pio`] and [`take_back`] are the only places where they change hands, and nStrobe is high at
//! both ends of either.

use crate::board;
use bridge::port::{AckPin, DataBus, Pins};
use core::convert::Infallible;
use embassy_rp::pac;
use embassy_rp::pac::common::{RW, Reg};
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use protocol::link::message::Lines;

/// Data1; Data2 to Data8 follow.
pub const DATA: u8 = 2;
/// nStrobe.
pub const STROBE: u8 = 10;
/// nAutoFd.
pub const AUTO_FEED: u8 = 11;
/// nInit.
pub const INIT: u8 = 12;
/// nSelectIn.
pub const SELECT_IN: u8 = 13;
/// nAck. Busy, PError, Select and nFault follow, in this order.
pub const ACK: u8 = 14;
/// Busy, the first of the lines the strobe program looks at. The last is [`POWER`].
pub const BUSY: u8 = 15;
/// Connected to nothing, and held low: the strobe program sees it.
const UNUSED: u8 = 19;
/// nOE of the output buffers: high, by a resistor, until the firmware has put the lines to rest.
pub const ENABLE: u8 = 20;
/// The printer's +5 V, through a divider and a buffer.
pub const POWER: u8 = 21;
/// The button, to ground.
pub const BUTTON: u8 = 22;
/// The board's lamp.
pub const LAMP: u8 = 25;

const SIO: u8 = 5;
const PIO0: u8 = 6;

/// Control lines at rest: nStrobe, nAutoFd and nInit high, nSelectIn low.
const AT_REST: u32 = 1 << STROBE | 1 << AUTO_FEED | 1 << INIT;

fn out_set() -> Reg<u32, RW> {
    pac::SIO.gpio_out(0).value_set()
}

fn out_clear() -> Reg<u32, RW> {
    pac::SIO.gpio_out(0).value_clr()
}

fn levels() -> u32 {
    pac::SIO.gpio_in(0).read()
}

fn function(pin: u8, function: u8) {
    pac::IO_BANK0.gpio(pin.into()).ctrl().write(|w| w.set_funcsel(function));
}

/// How an input rests when nothing drives it. A board without its buffers shows a printer that is switched off.
enum Rest {
    Up,
    Down,
}

fn input(pin: u8, rest: Rest) {
    pac::PADS_BANK0.gpio(pin.into()).write(|w| {
        w.set_ie(true);
        w.set_od(true);
        w.set_schmitt(true);
        w.set_pue(matches!(rest, Rest::Up));
        w.set_pde(matches!(rest, Rest::Down) && board::PULL_DOWN);
    });
    function(pin, SIO);
}

fn output(pin: u8) {
    // Level and direction are set before the pad is handed over, so it never shows anything else.
    pac::SIO.gpio_oe(0).value_set().write_value(1 << pin);
    pac::PADS_BANK0.gpio(pin.into()).write(|w| {
        w.set_ie(true);
        w.set_schmitt(true);
    });
    function(pin, SIO);
}

/// Puts every line to rest, with nOE high: the buffers do not drive the cable yet. Until now the pads were inputs and nOE
/// was high by its resistor, so nothing strobed.
pub fn bring_up() {
    out_set().write_value(AT_REST | 1 << ENABLE);
    out_clear().write_value(1 << SELECT_IN | 0xff << DATA | 1 << LAMP | 1 << UNUSED);
    for pin in [ENABLE, STROBE, AUTO_FEED, INIT, SELECT_IN, LAMP, UNUSED].into_iter().chain(DATA..DATA + 8) {
        output(pin);
    }
    for (pin, rest) in [
        (ACK, Rest::Up),
        (BUSY, Rest::Up),
        (BUSY + 1, Rest::Up),
        (BUSY + 2, Rest::Down),
        (BUSY + 3, Rest::Up),
        (POWER, Rest::Down),
        (BUTTON, Rest::Up),
    ] {
        input(pin, rest);
    }
}

/// Lets the output buffers drive the cable, or not.
pub fn enable(on: bool) {
    if on { out_clear() } else { out_set() }.write_value(1 << ENABLE);
}

/// Switches the board's lamp.
pub fn lamp(on: bool) {
    if on { out_set() } else { out_clear() }.write_value(1 << LAMP);
}

/// Whether the button is pressed.
pub fn button() -> bool {
    levels() >> BUTTON & 1 == 0
}

/// Gives nStrobe and the data lines to the PIO block, whose own level for nStrobe has to be high by now.
pub fn lend_to_pio() {
    for pin in (DATA..DATA + 8).chain([STROBE]) {
        function(pin, PIO0);
    }
}

/// Takes nStrobe and the data lines back from the PIO block, nStrobe at rest. The data lines keep the level `data`.
pub fn take_back(data: u8) {
    Data.put(data);
    out_set().write_value(1 << STROBE);
    for pin in [STROBE].into_iter().chain(DATA..DATA + 8) {
        function(pin, SIO);
    }
}

/// The status lines, all looked at in one moment.
pub fn status() -> Lines {
    let levels = levels();
    // GP14 to GP18 are nAck, Busy, PError, Select, nFault: the order of the bits of `Lines`.
    let lines = (levels >> ACK & 0x1f) as u8;
    Lines(lines | if levels >> POWER & 1 == 1 { Lines::POWER } else { 0 })
}

/// Data1..Data8.
pub struct Data;

impl DataBus for Data {
    fn put(&mut self, byte: u8) {
        let levels = pac::SIO.gpio_out(0).value().read();
        pac::SIO.gpio_out(0).value_xor().write_value((levels ^ u32::from(byte) << DATA) & 0xff << DATA);
    }
}

/// A line by the number of its pin.
pub struct Line(u8);

impl ErrorType for Line {
    type Error = Infallible;
}

impl OutputPin for Line {
    fn set_low(&mut self) -> Result<(), Infallible> {
        out_clear().write_value(1 << self.0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        out_set().write_value(1 << self.0);
        Ok(())
    }
}

impl InputPin for Line {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(levels() >> self.0 & 1 == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

/// nAck with the edge detector of the pin as its memory: it catches pulses of a few clock cycles, whether or not an
/// interrupt is taken.
pub struct Ack;

/// The edge-low bit of nAck in the raw interrupt registers: four bits a pin, eight pins a register.
const ACK_EDGE: u32 = 1 << (4 * (ACK % 8) + 2);

fn ack_edges() -> Reg<pac::io::regs::Int, RW> {
    pac::IO_BANK0.intr(usize::from(ACK / 8))
}

impl AckPin for Ack {
    fn is_high(&mut self) -> bool {
        levels() >> ACK & 1 == 1
    }

    fn arm(&mut self) {
        ack_edges().write_value(pac::io::regs::Int(ACK_EDGE));
    }

    fn fell(&mut self) -> bool {
        ack_edges().read().0 & ACK_EDGE != 0
    }
}

/// The port's pins, for the processor to work them.
pub fn port() -> Pins<Data, Line, Line, Ack> {
    Pins {
        data: Data,
        strobe: Line(STROBE),
        auto_feed: Line(AUTO_FEED),
        init: Line(INIT),
        select_in: Line(SELECT_IN),
        ack: Ack,
        busy: Line(BUSY),
        paper_out: Line(BUSY + 1),
        select: Line(BUSY + 2),
        fault: Line(BUSY + 3),
        power: Some(Line(POWER)),
    }
}
