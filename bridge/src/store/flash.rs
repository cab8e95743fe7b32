//! What the store needs of a board's flash.

/// Bytes that are erased at a time.
pub const SECTOR: u32 = 4096;

/// Bytes that are programmed at a time, at most.
pub const PAGE: u32 = 256;

/// An area of NOR flash. Erasing sets the bits of a sector, programming clears some. A supply that goes meanwhile leaves any of
/// the bits concerned as they were. Whoever programs reads back what matters, so nothing here can fail.
pub trait Flash {
    /// Bytes of the area: whole sectors, 0 if there is none.
    fn size(&self) -> u32;

    /// Copies bytes from the area; those beyond it are `ff`.
    fn read(&self, at: u32, out: &mut [u8]);

    /// Clears the bits that are clear in `bytes`, which lie within one page.
    fn program(&mut self, at: u32, bytes: &[u8]);

    /// Sets all bits of the sector with this number.
    fn erase(&mut self, sector: u32);
}

/// A board without an area for jobs.
pub struct NoFlash;

impl Flash for NoFlash {
    fn size(&self) -> u32 {
        0
    }

    fn read(&self, _at: u32, out: &mut [u8]) {
        out.fill(0xff);
    }

    fn program(&mut self, _at: u32, _bytes: &[u8]) {}

    fn erase(&mut self, _sector: u32) {}
}
