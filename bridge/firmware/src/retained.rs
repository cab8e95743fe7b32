//! Memory that outlives a reset of the board: where a job stands, and the log.
//!
//! Problem: the library's [`CheckpointStore`](bridge::checkpoint::CheckpointStore) and the log need memory that a reset by the watchdog leaves as
//! it is. Method: a part of the memory that nothing initialises. What crosses the port leaves marks there: the DMA channel
//! that counts the bytes writes one for each, and the processor does the same for bytes it sends itself. The ring of marks
//! holds more than the strobe engine can send without the processor.
//!
//! Limits: a byte is marked about a microsecond after its strobe began, and some microseconds after it if the processor
//! sends it: for 1 of the 2.4 µs of each. A reset in between would give that byte to the printer twice; only a reset from outside
//! can come then, because the watchdog acts seconds after the strobe engine has fallen silent. So behind one from outside a job
//! whose bytes were flowing is told as lost ([`Checkpoint::reset_from_outside`]). Nothing here outlives the loss of the supply or
//! another image: then the memory does not begin with this image's checksum, and the host is told that no job is known.
//!
//! # Why this is sound
//!
//! *The bytes survive.* The linker puts the section `.uninit` behind `.bss`. The startup code writes
//! `.bss` and `.data` only (cortex-m-rt without its features `zero-init-ram` and `paint-stack`, neither of which is on).
//! On the way to this program the boot ROM and the second-stage boot loader use the end of the memory only, which the
//! board's memory map leaves alone. What anything else has overwritten, such as a debugger, the checksums of image and slots find. The
//! stack is below all of it and grows away from it ([`crate::stack`]).
//!
//! *The bytes may be read.* To the compiler a static without an initial value is uninitialised, and reading it is
//! undefined whatever the hardware holds. So every access goes through [`layout`], whose empty assembly block stands for
//! a write of the bytes the hardware holds. The compiler has to assume that the block has written any bytes, and all
//! fields are integers, for which any bytes are valid. What the bytes *mean* is checked by the checksums; wrong bytes
//! that pass would give a wrong position, never a wrong access.
//!
//! *Nobody interferes.* Nothing starts the second core. On the first, code is interrupted but never runs in parallel.
//! Image number and log are accessed in critical sections only. Slots and marks belong to the one [`Ring`], which
//! cannot leave thread mode, for it is not `Send`; besides it, only the DMA channel writes marks, and both it and the
//! processor access them byte by byte, the processor with volatile accesses. No reference to this memory is ever made,
//! only raw pointers, so none can be aliased.

use crate::board::FLASH;
use bridge::checkpoint::{self, MARKS, Memory, PAST_SLOT, SLOT};
use bridge::engine::Checkpoint;
use core::cell::UnsafeCell;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::Range;
use core::sync::atomic::compiler_fence;
use portable_atomic::{AtomicBool, Ordering};
use protocol::link::frame::checksum;

/// What is left of the next block of [`MARKS`] bytes: alignment would waste it.
const LOG: usize = MARKS - 2 * SLOT - 2 * PAST_SLOT - 16;

/// An operation of the flash is under way.
const FLASH_AT_WORK: u32 = 0xf1a5_4b05;

#[repr(C, align(4096))]
struct Layout {
    marks: [u8; MARKS],
    image: u32,
    slots: [[u8; SLOT]; 2],
    past: [[u8; PAST_SLOT]; 2],
    /// [`FLASH_AT_WORK`], or anything else.
    flash: u32,
    /// Bytes logged since the log began, and the same inverted.
    written: [u32; 2],
    log: [u8; LOG],
}

struct Cell(UnsafeCell<MaybeUninit<Layout>>);

// SAFETY: see "Nobody interferes" above. The functions below are the only accesses, and none is at the same time as
// another to the same bytes.
unsafe impl Sync for Cell {}

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: Cell = Cell(UnsafeCell::new(MaybeUninit::uninit()));

/// Whether there is a [`Ring`].
static WOKEN: AtomicBool = AtomicBool::new(false);

/// The memory, initialised with what it holds.
fn layout() -> *mut Layout {
    let layout: *mut Layout = RETAINED.0.get().cast();
    // SAFETY: there are no instructions. The block stands for a write to `RETAINED` of the bytes that are there: it may
    // access memory, being neither `nomem` nor `readonly`, and it is given the pointer.
    unsafe { core::arch::asm!("/* {0} */", in(reg) layout, options(nostack, preserves_flags)) };
    layout
}

fn mark(at: usize) -> *mut u8 {
    // SAFETY: within the array.
    unsafe { (&raw mut (*layout()).marks).cast::<u8>().add(at % MARKS) }
}

/// Slots and marks. There is one, and it stays in thread mode.
pub struct Ring {
    /// Neither `Send` nor `Sync`.
    thread: PhantomData<*mut ()>,
}

impl Memory for Ring {
    fn slots(&self) -> [[u8; SLOT]; 2] {
        // SAFETY: initialised by `layout`; only this uses the slots.
        unsafe { (&raw const (*layout()).slots).read() }
    }

    fn write(&mut self, which: usize, slot: [u8; SLOT]) {
        // SAFETY: one of the two slots, which only this uses.
        unsafe { (&raw mut (*layout()).slots[which % 2]).write_volatile(slot) };
    }

    fn past(&self) -> [[u8; PAST_SLOT]; 2] {
        // SAFETY: initialised by `layout`; only this uses these slots.
        unsafe { (&raw const (*layout()).past).read() }
    }

    fn write_past(&mut self, which: usize, slot: [u8; PAST_SLOT]) {
        // SAFETY: one of the two slots, which only this uses.
        unsafe { (&raw mut (*layout()).past[which % 2]).write_volatile(slot) };
    }

    fn is_marked(&self, at: usize) -> bool {
        // SAFETY: a byte of the ring.
        unsafe { mark(at).read_volatile() != 0 }
    }

    fn mark(&mut self, at: usize) {
        // SAFETY: a byte of the ring; the DMA is about to write others.
        unsafe { mark(at).write_volatile(1) };
    }

    fn clear(&mut self, places: Range<usize>) {
        let count = places.end.min(MARKS).saturating_sub(places.start);
        // SAFETY: bytes of the ring, as many as are left of it from there; the DMA is about to write others.
        unsafe { mark(places.start).write_bytes(0, count) };
        // They are read only behind a reset: written all the same.
        compiler_fence(Ordering::SeqCst);
    }
}

/// The checkpoints of this run.
pub type CheckpointStore = checkpoint::CheckpointStore<Ring>;

unsafe extern "C" {
    // Addresses the linker knows: initial values of variables in flash, which are the image's end, and where they go.
    static __sidata: u32;
    static __sdata: u32;
    static __edata: u32;
}

/// The checksum of the whole image: some milliseconds.
fn image_checksum() -> u32 {
    let [from, begin, end] =
        [&raw const __sidata, &raw const __sdata, &raw const __edata].map(|at| at as usize);
    let length = from + (end - begin) - FLASH;
    // SAFETY: flash, which is mapped there as far as the linker has filled it, and which nothing writes while the program runs.
    checksum(unsafe { core::slice::from_raw_parts(FLASH as *const u8, length) })
}

/// The store of checkpoints, what an earlier run has left, and whether there was one of this image. To be called before the
/// first word of the log, and before the strobe engine is started.
///
/// Panics when it is called again.
pub fn checkpoints() -> (CheckpointStore, Option<Checkpoint>, bool) {
    assert!(!WOKEN.swap(true, Ordering::Relaxed));
    let image = image_checksum();
    let layout = layout();
    let known = critical_section::with(|_| {
        // SAFETY: fields of the static, initialised by `layout`.
        let (left, written) =
            unsafe { ((&raw const (*layout).image).read(), (&raw const (*layout).written).read()) };
        left == image && written[0] == !written[1]
    });
    let (store, found) = checkpoint::CheckpointStore::new(Ring { thread: PhantomData }, known);
    if !known {
        // Last: a reset before this leaves memory that is made empty once more.
        critical_section::with(|_| {
            // SAFETY: the same fields.
            unsafe {
                (&raw mut (*layout).written).write_volatile([0, !0]);
                (&raw mut (*layout).flash).write_volatile(0);
                (&raw mut (*layout).image).write_volatile(image);
            }
        });
    }
    (store, found, known)
}

/// Notes that an operation of the flash begins, or that it has ended.
pub fn flash_works(at_work: bool) {
    critical_section::with(|_| {
        // SAFETY: the field, initialised by `layout`, and only accessed in critical sections.
        unsafe { (&raw mut (*layout()).flash).write_volatile(if at_work { FLASH_AT_WORK } else { 0 }) };
    });
    compiler_fence(Ordering::SeqCst);
}

/// Whether a run before has ended within an operation of the flash: it has hung, and would again. Until the supply goes.
pub fn flash_hung() -> bool {
    // SAFETY: as in `flash_works`.
    critical_section::with(|_| unsafe { (&raw const (*layout()).flash).read_volatile() == FLASH_AT_WORK })
}

/// The ring for the DMA: where it begins.
pub fn marks() -> *mut u8 {
    mark(0)
}

/// Adds bytes to the log, over the oldest.
pub fn log(bytes: &[u8]) {
    critical_section::with(|_| {
        let layout = layout();
        // SAFETY: in a critical section, as all accesses to these fields.
        let mut end = unsafe { (&raw const (*layout).written).read() }[0];
        for &byte in bytes {
            // SAFETY: likewise, and within the array.
            unsafe { (&raw mut (*layout).log).cast::<u8>().add(end as usize % LOG).write(byte) };
            end = end.wrapping_add(1);
        }
        // SAFETY: likewise.
        unsafe { (&raw mut (*layout).written).write([end, !end]) };
    });
}

/// Log from byte `from` on: where the piece begins, how much there is in all, and how many bytes were copied to `out`.
pub fn read_log(from: u32, out: &mut [u8]) -> (u32, u32, usize) {
    critical_section::with(|_| {
        let layout = layout();
        // SAFETY: in a critical section, as all accesses to these fields.
        let end = unsafe { (&raw const (*layout).written).read() }[0];
        let (at, count) = bridge::log::piece(from, end, LOG as u32, out.len());
        for (i, byte) in out[..count].iter_mut().enumerate() {
            // SAFETY: likewise, and within the array.
            *byte = unsafe { (&raw const (*layout).log).cast::<u8>().add((at as usize + i) % LOG).read() };
        }
        (at, end, count)
    })
}
