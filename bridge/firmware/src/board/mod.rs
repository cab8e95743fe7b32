//! What is true of one chip and not of the other: the Pico's RP2040, the Pico 2's RP2350.
//!
//! Problem: clock, flash, the DMA counter, the timer, the serial number and the errata of the two chips differ, everything
//! else of this program does not. Method: a module for each chip with the same names, one of which is built; the chip's
//! memory map is the linker script beside it. Nothing else of the firmware knows a chip. Limits: what no emulator has run is
//! listed in `docs/decisions/second-board.md`.
//!
//! Both modules have these:
//!
//! | name | what it is |
//! |---|---|
//! | `NAME` | the board's name |
//! | `VERSION` | the firmware's version as a string for C, with the board unless that is a Pico |
//! | `CLOCK_HZ` | the processor's clock after the start |
//! | `cycles` | the clock cycles in a time, rounded up |
//! | `CODE` | where instructions can be |
//! | `COUNT_MAX`, `count`, `set_count` | the DMA's counter of transfers |
//! | `abort` | ends a DMA channel's work |
//! | `PULL_DOWN` | whether a pad's own resistor can hold an input low |
//! | `now_us` | the lower half of the clock, which is enough for a difference |
//! | `serial_number` | the number of this very board, 0 if it does not tell |
//! | `flash_bytes` | the size of its flash |

use embassy_rp::flash::{Blocking, Flash};
use embassy_rp::peripherals;

#[cfg(feature = "pico")]
mod rp2040;
#[cfg(feature = "pico2")]
mod rp2350;

#[cfg(feature = "pico")]
pub use rp2040::*;
#[cfg(feature = "pico2")]
pub use rp2350::*;

#[cfg(all(feature = "pico", feature = "pico2"))]
compile_error!("one board at a time: `--no-default-features --features pico2` builds for a Pico 2");

/// The largest chip: 16 MiB, which is as much as the processor sees.
const MOST: usize = 16 << 20;

/// The flash of the board.
pub type Whole = Flash<'static, peripherals::FLASH, Blocking, MOST>;

/// Where the flash begins, as the processor sees it.
pub const FLASH: usize = 0x1000_0000;
