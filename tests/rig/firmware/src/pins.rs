//! The pins: those of the bridge, with inputs and outputs exchanged.

use embassy_rp::pac;
use rig::{Host, Own, Status};

/// Data1..Data8 at GP2 to GP9.
pub const DATA: u8 = 2;
const AUTO_FEED: u8 = 11;
pub const INIT: u8 = 12;
const SELECT_IN: u8 = 13;
pub const ACK: u8 = 14;
pub const BUSY: u8 = 15;
const PAPER_OUT: u8 = 16;
const SELECT: u8 = 17;
const FAULT: u8 = 18;
/// nOE of the output buffer: high, by a resistor, until there is something to show.
const ENABLE: u8 = 20;
/// The printer's +5 V.
const POWER: u8 = 21;
const LAMP: u8 = 25;

const SIO: u8 = 5;
const PIO0: u8 = 6;

fn function(pin: u8, function: u8) {
    pac::IO_BANK0.gpio(pin.into()).ctrl().write(|w| w.set_funcsel(function));
}

fn set(pin: u8, high: bool) {
    let out = pac::SIO.gpio_out(0);
    if high { out.value_set() } else { out.value_clr() }.write_value(1 << pin);
}

/// Nothing is driven at the plug; the lines behind the buffer are those of a printer that is off.
pub fn bring_up() {
    set(ENABLE, true);
    for pin in [ENABLE, PAPER_OUT, SELECT, FAULT, POWER, LAMP] {
        pac::SIO.gpio_oe(0).value_set().write_value(1 << pin);
    }
    for pin in (DATA..=FAULT).chain([ENABLE, POWER, LAMP]) {
        pac::PADS_BANK0.gpio(pin.into()).write(|w| {
            w.set_ie(true);
            w.set_od((DATA..ACK).contains(&pin));
            w.set_schmitt(true);
        });
        function(pin, if pin == ACK || pin == BUSY { PIO0 } else { SIO });
    }
}

/// PError, Select, nFault.
pub fn show(status: Status) {
    set(PAPER_OUT, status.paper_out);
    set(SELECT, status.select);
    set(FAULT, status.fault);
}

/// The printer's own switch: its +5 V, and whether its lines are driven.
pub fn power(on: bool) {
    set(POWER, on);
    set(ENABLE, !on);
    set(LAMP, on);
}

/// What the host shows.
pub fn host() -> Host {
    let levels = pac::SIO.gpio_in(0).read();
    let high = |pin: u8| levels >> pin & 1 == 1;
    Host { data: (levels >> DATA) as u8, auto_feed: high(AUTO_FEED), select_in: high(SELECT_IN) }
}

/// The level that side-set shows for these: nAck in bit 0, Busy in bit 1.
pub fn side(own: Own) -> u16 {
    u16::from(own.ack) | u16::from(own.busy) << 1
}
