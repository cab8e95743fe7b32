//! The firmware's log: defmt's frames into a ring that the host reads over the link, and that outlives a reset, so that it
//! tells what came before one.

use core::cell::UnsafeCell;
use critical_section::RestoreState;
use embassy_time::Instant;
use portable_atomic::{AtomicBool, Ordering};

struct State {
    encoder: defmt::Encoder,
    restore: RestoreState,
}

struct Held(UnsafeCell<State>);

// SAFETY: looked at only between `acquire` and `release`, which are a critical section.
unsafe impl Sync for Held {}

static STATE: Held =
    Held(UnsafeCell::new(State { encoder: defmt::Encoder::new(), restore: RestoreState::invalid() }));

/// Someone is in the middle of a frame.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// The program has ended, wherever it was: in the middle of a frame, perhaps. The next frame is a new one.
pub fn take_over() {
    if TAKEN.swap(false, Ordering::Relaxed) {
        // An empty frame ends what there is of the other.
        crate::retained::log(&[0]);
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: frames do not overlap, because a critical section lasts from `acquire` to `release`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: given back in `release`, which defmt calls once for each `acquire`.
        let restore = unsafe { critical_section::acquire() };
        // A `Format` that logs would come here again, and none of this program's does.
        assert!(!TAKEN.swap(true, Ordering::Relaxed));
        // SAFETY: in the critical section.
        let state = unsafe { &mut *STATE.0.get() };
        state.restore = restore;
        state.encoder.start_frame(crate::retained::log);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: in the critical section of `acquire`.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.end_frame(crate::retained::log);
        TAKEN.store(false, Ordering::Relaxed);
        // SAFETY: what `acquire` has been given.
        unsafe { critical_section::release(state.restore) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: in the critical section of `acquire`.
        unsafe { &mut *STATE.0.get() }.encoder.write(bytes, crate::retained::log);
    }
}

defmt::timestamp!("{=u64:us}", Instant::now().as_micros());
