//! Memory that outlives a reset of the board: where a job stands, and the log.
//!
//! Problem: a watchdog's bite in the middle of a sheet costs the sheet, unless the board knows afterwards to the byte how much
//! of it the printer has. Method: a part of the memory that nothing initialises. The engine's checkpoint goes into
//! one of two places in turn, with a number and a checksum, so that a reset while one is written leaves the other.
//! What crosses the port after a checkpoint leaves marks: the DMA channel that counts the bytes writes one for each
//! into a ring, and the processor does the same for bytes it sends itself. After a reset the marks behind the last
//! checkpoint are counted. The ring holds more than the strobe engine can send without the processor.
//!
//! Limits: a byte is marked about a microsecond after its strobe began, and some microseconds after it if the processor sends
//! it; a reset in between, which only one from outside
//! can hit (a processor that hangs is bitten seconds after the strobe engine has fallen silent), gives that byte to the
//! printer twice. Nothing here outlives the loss of the supply; then the mark at the front is missing, and the host is
//! told that no job is known. The same after another image was flashed.

use bridge::engine::Checkpoint;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{Ordering, compiler_fence};
use protocol::link::frame::checksum;

/// Marks in the ring: a power of two for the DMA, and more than two buffers of the strobe engine.
pub const MARKS: usize = 1 << MARKS_BITS;
/// The same for the DMA.
pub const MARKS_BITS: u8 = 12;

/// A place for a checkpoint: checksum of the rest, number, position in the ring, length of what follows.
const SLOT: usize = 64;
const HEAD: usize = 11;

/// What is left of the next block of [`MARKS`] bytes: alignment would waste it.
const LOG: usize = MARKS - 2 * SLOT - 12;

#[repr(C, align(4096))]
struct Kept {
    marks: [u8; MARKS],
    image: u32,
    slots: [[u8; SLOT]; 2],
    /// Bytes logged since the log began, and the same inverted.
    written: [u32; 2],
    log: [u8; LOG],
}

struct Keep(UnsafeCell<MaybeUninit<Kept>>);

// SAFETY: one core; every access is by the functions below, each in a critical section or, for the marks, byte by byte.
unsafe impl Sync for Keep {}

#[unsafe(link_section = ".uninit.keep")]
static KEEP: Keep = Keep(UnsafeCell::new(MaybeUninit::uninit()));

fn kept() -> *mut Kept {
    KEEP.0.get().cast()
}

fn mark(at: usize) -> *mut u8 {
    // SAFETY: within the array; no reference is made to memory that DMA writes.
    unsafe { (&raw mut (*kept()).marks).cast::<u8>().add(at % MARKS) }
}

/// Whether the memory is what this image has left there. If not it is made empty. To be called once, before anything else
/// here; `image` tells one image from another.
fn wake(image: u32) -> bool {
    // SAFETY: any bytes are values of these types, and nothing else looks at them yet.
    let kept = unsafe { &mut *kept() };
    let known = kept.image == image && kept.written[0] == !kept.written[1];
    if !known {
        (kept.image, kept.written) = (image, [0, !0]);
        kept.slots = [[0; SLOT]; 2];
        for at in 0..MARKS {
            // SAFETY: a byte of the ring.
            unsafe { mark(at).write_volatile(0) };
        }
    }
    known
}

/// The checkpoints of this run.
pub struct Keeper {
    number: u32,
    /// Position in the ring that belongs to the last checkpoint.
    place: usize,
    last: Option<Checkpoint>,
}

impl Keeper {
    /// Looks for what an earlier run has left.
    pub fn new() -> (Self, Option<Checkpoint>) {
        // The vectors, and with them the address of every handler, and most of the program: 64 KiB take some
        // milliseconds.
        // SAFETY: flash, which nothing writes while the program runs.
        let image = unsafe { core::slice::from_raw_parts(0x1000_0000 as *const u8, 0x1_0000) };
        let mut keeper = Keeper { number: 0, place: 0, last: None };
        if !wake(checksum(image)) {
            return (keeper, None);
        }
        // SAFETY: as in `wake`; no other reference is alive.
        let slots = unsafe { (*kept()).slots };
        let found = slots.iter().filter_map(read).max_by_key(|&(number, ..)| number);
        let Some((number, place, mut checkpoint)) = found else { return (keeper, None) };
        (keeper.number, keeper.place) = (number, place);
        // SAFETY: a byte of the ring; the DMA stands still after a reset.
        let crossed = (0..MARKS).take_while(|at| unsafe { mark(place + at).read_volatile() } != 0).count();
        // At most MARKS.
        checkpoint.progress.printed += crossed as u32;
        keeper.store(checkpoint, place + crossed);
        (keeper, Some(checkpoint))
    }

    /// Where in the ring the next mark belongs.
    pub fn place(&self) -> usize {
        self.place
    }

    /// Keeps a checkpoint; `place` is the number of marks made so far, or that modulo [`MARKS`].
    pub fn store(&mut self, checkpoint: Checkpoint, place: usize) {
        let place = place % MARKS;
        if self.last == Some(checkpoint) && self.place == place {
            return;
        }
        self.number = self.number.wrapping_add(1);
        let mut slot = [0; SLOT];
        slot[4..8].copy_from_slice(&self.number.to_le_bytes());
        // Below MARKS, and what follows is far shorter than a slot.
        slot[8..10].copy_from_slice(&(place as u16).to_le_bytes());
        let Checkpoint { progress, ends_at, needs_reset } = checkpoint;
        let Ok(used) = postcard::to_slice(&(progress, ends_at, needs_reset), &mut slot[HEAD..]) else {
            return;
        };
        slot[10] = used.len() as u8;
        let sum = checksum(&slot[4..]);
        slot[..4].copy_from_slice(&sum.to_le_bytes());
        // SAFETY: as in `wake`.
        unsafe { (&raw mut (*kept()).slots[self.number as usize % 2]).write_volatile(slot) };
        compiler_fence(Ordering::SeqCst);
        // Only now are the marks before it of no use.
        for at in 0..place.wrapping_sub(self.place) % MARKS {
            // SAFETY: a byte of the ring behind which the DMA is already.
            unsafe { mark(self.place + at).write_volatile(0) };
        }
        (self.place, self.last) = (place, Some(checkpoint));
    }

    /// Notes that the processor has sent a byte, the one behind `sent` others since the last checkpoint.
    pub fn mark(&self, sent: usize) {
        // SAFETY: a byte of the ring; the DMA makes no marks while the processor sends.
        unsafe { mark(self.place + sent).write_volatile(1) };
    }
}

/// The ring for the DMA: where it begins.
pub fn marks() -> *mut u8 {
    mark(0)
}

fn read(slot: &[u8; SLOT]) -> Option<(u32, usize, Checkpoint)> {
    let word = |at: usize| u32::from_le_bytes([slot[at], slot[at + 1], slot[at + 2], slot[at + 3]]);
    if word(0) != checksum(&slot[4..]) {
        return None;
    }
    let body = slot.get(HEAD..HEAD + usize::from(slot[10]))?;
    let (progress, ends_at, needs_reset) = postcard::from_bytes(body).ok()?;
    let place = usize::from(u16::from_le_bytes([slot[8], slot[9]]));
    Some((word(4), place, Checkpoint { progress, ends_at, needs_reset }))
}

/// Adds bytes to the log, over the oldest.
pub fn log(bytes: &[u8]) {
    critical_section::with(|_| {
        // SAFETY: in a critical section, and no reference to these fields outlives one.
        let written = unsafe { &mut (*kept()).written };
        // SAFETY: likewise; it is another field.
        let ring = unsafe { &mut (*kept()).log };
        for &byte in bytes {
            ring[written[0] as usize % LOG] = byte;
            written[0] = written[0].wrapping_add(1);
        }
        written[1] = !written[0];
    });
}

/// Log from byte `from` on: where the piece begins, how much there is in all, and how many bytes were copied to `out`.
pub fn read_log(from: u32, out: &mut [u8]) -> (u32, u32, usize) {
    critical_section::with(|_| {
        // SAFETY: as in `log`.
        let end = unsafe { (*kept()).written[0] };
        // SAFETY: likewise.
        let ring = unsafe { &(*kept()).log };
        let oldest = end.saturating_sub(LOG as u32);
        let at = if from > end { oldest } else { from.max(oldest) };
        let count = out.len().min((end - at) as usize);
        for (i, byte) in out[..count].iter_mut().enumerate() {
            *byte = ring[(at as usize + i) % LOG];
        }
        (at, end, count)
    })
}
