//! Raspberry Pi Pico. Source: RP2040 data sheet; errata in its appendix B.
//!
//! RP2040-E1, the watchdog that counts twice a tick, is met by `embassy_rp`, which loads twice the time on this chip alone.

use core::ops::Range;
use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, Flash};
use embassy_rp::pac;
use embassy_rp::pac::dma::Channel;
use embassy_rp::peripherals::FLASH;

pub const NAME: &str = "Pico";
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
pub const CLOCK_HZ: u32 = 125_000_000;
const FLASH_BYTES: usize = 2 * 1024 * 1024;
/// Behind the second-stage boot loader, as far as any image of ours goes.
pub const CODE: Range<u32> = 0x1000_0100..0x1002_0000;
pub const COUNT_MAX: u32 = u32::MAX;
pub const PULL_DOWN: bool = true;

/// A cycle is 8 ns.
pub const fn cycles(ns: u32) -> u32 {
    ns.div_ceil(8)
}

pub fn count(channel: Channel) -> u32 {
    channel.trans_count().read()
}

pub fn set_count(channel: Channel, count: u32) {
    channel.trans_count().write_value(count);
}

pub fn abort(channel: usize) {
    pac::DMA.chan_abort().write(|w| w.set_chan_abort(1 << channel));
}

pub fn now_us() -> u32 {
    pac::TIMER.timerawl().read()
}

/// That of the flash chip: the RP2040 has none.
pub fn serial_number(flash: Peri<'static, FLASH>) -> [u8; 8] {
    let mut flash = Flash::<_, Blocking, FLASH_BYTES>::new_blocking(flash);
    let mut number = [0; 8];
    // A board whose flash does not tell has number 0, which is as good as any if it is the only one.
    let _ = flash.blocking_unique_id(&mut number);
    number
}
