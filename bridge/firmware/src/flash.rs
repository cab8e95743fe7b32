//! The area of the flash that is the store's: from behind any image of ours to the end of the chip.
//!
//! While the flash is written it cannot be read, and the program lies there. So what writes runs in memory, with interrupts off: a
//! page for up to 3 ms, an erase for up to 400 (45 as a rule). The strobe engine goes on from its buffers in memory, which last
//! for 5 ms; USB is answered by its own hardware, which tells the host to wait. The library erases only while nothing
//! is printed. A chip that never ends an operation is met by the watchdog, and from then on, until the supply goes, the board works
//! without a store: otherwise each start could begin the same operation again.

use crate::board::{self, FLASH, Whole};
use crate::{retained, trace};
use bridge::store::{Flash as Chip, SECTOR};
use embassy_rp::Peri;
use embassy_rp::flash::Flash;
use embassy_rp::peripherals;

/// Takes the flash.
pub fn take(flash: Peri<'static, peripherals::FLASH>) -> Whole {
    Flash::new_blocking(flash)
}

unsafe extern "C" {
    // An address the linker knows: the end of the part of the flash that images are linked for.
    static _store_start: u32;
}

/// The store's area.
pub struct Area {
    flash: Whole,
    /// Offset from the beginning of the flash.
    start: u32,
    size: u32,
}

impl Area {
    /// The area of this board; nothing of a chip that has hung.
    pub fn new(mut flash: Whole) -> Self {
        let start = (&raw const _store_start as usize - FLASH) as u32;
        let size = match retained::flash_hung() {
            true => 0,
            false => board::flash_bytes(&mut flash).saturating_sub(start) / SECTOR * SECTOR,
        };
        Area { flash, start, size }
    }

    /// Whether so many bytes from here on lie in the area.
    fn holds(&self, at: u32, count: usize) -> bool {
        at as usize + count <= self.size as usize
    }
}

impl Chip for Area {
    fn size(&self) -> u32 {
        self.size
    }

    fn read(&self, at: u32, out: &mut [u8]) {
        if !self.holds(at, out.len()) {
            return out.fill(0xff);
        }
        let from = (FLASH + (self.start + at) as usize) as *const u8;
        // SAFETY: flash, mapped there, and behind everything that the linker has placed. Nothing writes it meanwhile: only this does,
        // with `&mut self`.
        unsafe { core::ptr::copy_nonoverlapping(from, out.as_mut_ptr(), out.len()) };
    }

    fn program(&mut self, at: u32, bytes: &[u8]) {
        if self.holds(at, bytes.len()) {
            retained::flash_works(true);
            // What was written is read back by the library.
            let _ = self.flash.blocking_write(self.start + at, bytes);
            retained::flash_works(false);
            trace::restart();
        }
    }

    fn erase(&mut self, sector: u32) {
        let from = sector * SECTOR;
        if self.holds(from, SECTOR as usize) {
            retained::flash_works(true);
            let _ = self.flash.blocking_erase(self.start + from, self.start + from + SECTOR);
            retained::flash_works(false);
            trace::restart();
        }
    }
}
