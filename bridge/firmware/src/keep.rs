//! Memory that outlives a reset of the board: where a job stands, and the log.
//!
//! Problem: a reset by the watchdog in the middle of a sheet costs the sheet, unless the board knows afterwards to the
//! byte how much of it the printer has. Method: a part of the memory that nothing initialises. The engine's checkpoint
//! goes into one of two slots in turn, with a number and a checksum, so that a reset during a write leaves the other.
//! What crosses the port after a checkpoint leaves marks: the DMA channel that counts the bytes writes one for each into
//! a ring, and the processor does the same for bytes it sends itself. After a reset the marks behind the last checkpoint
//! are counted. The ring holds more than the strobe engine can send without the processor.
//!
//! Limits: a byte is marked about a microsecond after its strobe began, and some microseconds after it if the processor
//! sends it. A reset in between gives that byte to the printer twice; only a reset from outside can come then, because
//! the watchdog acts seconds after the strobe engine has fallen silent. Nothing here outlives the loss of the supply or
//! another image: then the memory does not begin with this image's checksum, and the host is told that no job is known.
//!
//! # Why this is sound
//!
//! *The bytes survive.* The linker puts the section `.uninit` between `.bss` and the stack. The startup code writes
//! `.bss` and `.data` only (cortex-m-rt without its features `zero-init-ram` and `paint-stack`, neither of which is on).
//! On the way to this program the boot ROM and the second-stage boot loader use the end of the memory only, which is the
//! stack's. What anything else has overwritten, such as a debugger, the checksums of image and slots find. Should the
//! stack ever grow into the section (it has more than 100 KB), that is memory corruption here as anywhere; there is no
//! guard.
//!
//! *The bytes may be read.* To the compiler a static without an initial value is uninitialised, and reading it is
//! undefined whatever the hardware holds. So every access goes through [`kept`], whose empty assembly block stands for
//! a write of the bytes the hardware holds. The compiler has to assume that the block has written any bytes, and all
//! fields are integers, for which any bytes are valid. What the bytes *mean* is checked by the checksums; wrong bytes
//! that pass would give a wrong position, never a wrong access.
//!
//! *Nobody interferes.* Nothing starts the second core. On the first, code is interrupted but never runs in parallel.
//! Image number and log are accessed in critical sections only. Slots and marks belong to the one [`Keeper`], which
//! cannot leave thread mode, for it is not `Send`; besides it, only the DMA channel writes marks, and both it and the
//! processor access them byte by byte, the processor with volatile accesses. No reference to this memory is ever made,
//! only raw pointers, so none can be aliased.

use bridge::engine::Checkpoint;
use core::cell::UnsafeCell;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::sync::atomic::compiler_fence;
use portable_atomic::{AtomicBool, Ordering};
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

// SAFETY: see "Nobody interferes" above. The functions below are the only accesses, and none is at the same time as
// another to the same bytes.
unsafe impl Sync for Keep {}

#[unsafe(link_section = ".uninit.keep")]
static KEEP: Keep = Keep(UnsafeCell::new(MaybeUninit::uninit()));

/// Whether there is a [`Keeper`].
static WOKEN: AtomicBool = AtomicBool::new(false);

/// The memory, initialised with what it holds.
fn kept() -> *mut Kept {
    let kept: *mut Kept = KEEP.0.get().cast();
    // SAFETY: there are no instructions. The block stands for a write to `KEEP` of the bytes that are there: it may
    // access memory, being neither `nomem` nor `readonly`, and it is given the pointer.
    unsafe { core::arch::asm!("/* {0} */", in(reg) kept, options(nostack, preserves_flags)) };
    kept
}

fn mark(at: usize) -> *mut u8 {
    // SAFETY: within the array.
    unsafe { (&raw mut (*kept()).marks).cast::<u8>().add(at % MARKS) }
}

/// Whether the memory is what this image has left there. If not, it is made empty. `image` tells one image from another.
fn wake(image: u32) -> bool {
    let kept = kept();
    critical_section::with(|_| {
        // SAFETY: fields of the static, initialised by `kept`.
        let (left, written) =
            unsafe { ((&raw const (*kept).image).read(), (&raw const (*kept).written).read()) };
        let known = left == image && written[0] == !written[1];
        if !known {
            // SAFETY: the same fields, and the slots, which no `Keeper` uses yet.
            unsafe {
                (&raw mut (*kept).image).write(image);
                (&raw mut (*kept).written).write([0, !0]);
                (&raw mut (*kept).slots).write([[0; SLOT]; 2]);
            }
            for at in 0..MARKS {
                // SAFETY: a byte of the ring.
                unsafe { mark(at).write_volatile(0) };
            }
        }
        known
    })
}

/// The checkpoints of this run. There is one keeper, and it stays in thread mode.
pub struct Keeper {
    number: u32,
    /// Position in the ring that belongs to the last checkpoint.
    place: usize,
    last: Option<Checkpoint>,
    /// Neither `Send` nor `Sync`.
    thread: PhantomData<*mut ()>,
}

impl Keeper {
    /// Looks for what an earlier run has left. To be called before the first word of the log, and before the strobe engine
    /// is started.
    ///
    /// Panics when it is called again.
    pub fn new() -> (Self, Option<Checkpoint>) {
        assert!(!WOKEN.swap(true, Ordering::Relaxed));
        // The vectors, and with them the address of every handler, and most of the program: 64 KiB take some
        // milliseconds.
        // SAFETY: flash, which is mapped there, and which nothing writes while the program runs.
        let image = unsafe { core::slice::from_raw_parts(0x1000_0000 as *const u8, 0x1_0000) };
        let mut keeper = Keeper { number: 0, place: 0, last: None, thread: PhantomData };
        if !wake(checksum(image)) {
            return (keeper, None);
        }
        // SAFETY: initialised by `kept`; only the keeper uses the slots.
        let slots = unsafe { (&raw const (*kept()).slots).read() };
        let found = slots.iter().filter_map(read).max_by_key(|&(number, ..)| number);
        let Some((number, place, mut checkpoint)) = found else { return (keeper, None) };
        (keeper.number, keeper.place) = (number, place);
        // SAFETY: a byte of the ring.
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
        // SAFETY: one of the two slots, which only the keeper uses.
        unsafe { (&raw mut (*kept()).slots[self.number as usize % 2]).write_volatile(slot) };
        compiler_fence(Ordering::SeqCst);
        // Only now the marks before it are no longer needed.
        for at in 0..place.wrapping_sub(self.place) % MARKS {
            // SAFETY: a byte of the ring, which the DMA has passed.
            unsafe { mark(self.place + at).write_volatile(0) };
        }
        (self.place, self.last) = (place, Some(checkpoint));
    }

    /// Marks a byte that the processor has sent, after `sent` others since the last checkpoint.
    pub fn mark(&self, sent: usize) {
        // SAFETY: a byte of the ring.
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
        let kept = kept();
        // SAFETY: in a critical section, as all accesses to these fields.
        let mut end = unsafe { (&raw const (*kept).written).read() }[0];
        for &byte in bytes {
            // SAFETY: likewise, and within the array.
            unsafe { (&raw mut (*kept).log).cast::<u8>().add(end as usize % LOG).write(byte) };
            end = end.wrapping_add(1);
        }
        // SAFETY: likewise.
        unsafe { (&raw mut (*kept).written).write([end, !end]) };
    });
}

/// Log from byte `from` on: where the piece begins, how much there is in all, and how many bytes were copied to `out`.
pub fn read_log(from: u32, out: &mut [u8]) -> (u32, u32, usize) {
    critical_section::with(|_| {
        let kept = kept();
        // SAFETY: in a critical section, as all accesses to these fields.
        let end = unsafe { (&raw const (*kept).written).read() }[0];
        let oldest = end.saturating_sub(LOG as u32);
        let at = if from > end { oldest } else { from.max(oldest) };
        let count = out.len().min((end - at) as usize);
        for (i, byte) in out[..count].iter_mut().enumerate() {
            // SAFETY: likewise, and within the array.
            *byte = unsafe { (&raw const (*kept).log).cast::<u8>().add((at as usize + i) % LOG).read() };
        }
        (at, end, count)
    })
}
