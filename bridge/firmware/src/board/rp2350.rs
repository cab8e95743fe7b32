//! Raspberry Pi Pico 2. Source: RP2350 data sheet; errata in its appendix E.
//!
//! * RP2350-E5: an aborted channel may start the one it is chained to, itself included. It is disabled before it is aborted.
//! * RP2350-E9 (stepping A2): an input that has once been high is held there by a leak of some 120 µA, against which the pad's
//!   pull-down, of some 50 kΩ, can do nothing; a resistor of 8.2 kΩ outside can. So no input of ours relies on a pull-down:
//!   a buffer drives those from the printer both ways, and the button has a pull-up.
//! * The counter of a DMA channel has 28 bits; the four above them choose a mode, and all of them set mean that it does not
//!   count at all (data sheet, 12.6.2.2).
//! * The watchdog counts once a tick: RP2040-E1 is not here. `embassy_rp` knows.

use super::FLASH;
use super::Whole;
use core::ops::Range;
use embassy_rp::otp;
use embassy_rp::pac;
use embassy_rp::pac::dma::Channel;

pub const NAME: &str = "Pico 2";
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (Pico 2)\0");
pub const CLOCK_HZ: u32 = 150_000_000;
/// As far as any image of ours goes.
pub const CODE: Range<u32> = 0x1000_0000..0x1002_0000;
pub const COUNT_MAX: u32 = 0x0fff_ffff;
pub const PULL_DOWN: bool = false;

/// Three cycles are 20 ns.
pub const fn cycles(ns: u32) -> u32 {
    ns.div_ceil(20) * 3
}

pub fn count(channel: Channel) -> u32 {
    channel.trans_count().read().count()
}

pub fn set_count(channel: Channel, count: u32) {
    channel.trans_count().write(|w| w.set_count(count));
}

pub fn abort(channel: usize) {
    // Not by the alias that starts the channel.
    pac::DMA.ch(channel).al1_ctrl().modify(|w| *w &= !1);
    pac::DMA.chan_abort().write(|w| w.set_chan_abort(1 << channel));
    // Until then it is not safe to start it again.
    while pac::DMA.chan_abort().read().0 & 1 << channel != 0 {}
}

pub fn now_us() -> u32 {
    pac::TIMER0.timerawl().read()
}

/// That of the chip.
pub fn serial_number(_flash: &mut Whole) -> [u8; 8] {
    otp::get_chipid().unwrap_or_default().to_be_bytes()
}

/// That of the chip. `embassy_rp` cannot ask it on this processor; but a chip begins anew behind its end, so at its size the image
/// is seen once more. A Pico 2 has 4 MiB, other boards less or more.
pub fn flash_bytes(_flash: &mut Whole) -> u32 {
    let begins = |at: usize| {
        let page = (FLASH + at) as *const u32;
        // SAFETY: flash, which is mapped there as far as addresses of a chip reach. Nothing writes it now.
        (0..256).map(move |word| unsafe { page.add(word).read_volatile() })
    };
    let again = |&size: &u32| begins(size as usize).eq(begins(0));
    [1 << 20, 2 << 20, 4 << 20, 8 << 20].into_iter().find(again).unwrap_or(4 << 20)
}
