//! Raspberry Pi Pico. Source: RP2040 data sheet; errata in its appendix B.
//!
//! RP2040-E1, the watchdog that counts twice a tick, is met by `embassy_rp`, which loads twice the time on this chip alone.

use super::Whole;
use core::ops::Range;
use embassy_rp::pac;
use embassy_rp::pac::dma::Channel;

pub const NAME: &str = "Pico";
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
pub const CLOCK_HZ: u32 = 125_000_000;
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
pub fn serial_number(flash: &mut Whole) -> [u8; 8] {
    let mut number = [0; 8];
    // A board whose flash does not tell has number 0, which is as good as any if it is the only one.
    let _ = flash.blocking_unique_id(&mut number);
    number
}

/// What the chip says of itself: the last byte of its JEDEC ID is the logarithm of its size. 2 MiB, the least on such boards, if it
/// says anything else than 2 to 16.
pub fn flash_bytes(flash: &mut Whole) -> u32 {
    match flash.blocking_jedec_id().map(|id| id & 0xff) {
        Ok(size @ 21..=24) => 1 << size,
        _ => 2 << 20,
    }
}
