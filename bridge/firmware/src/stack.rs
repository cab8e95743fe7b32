//! The stack: what is below it, and how much of it was ever used.
//!
//! Problem: a stack that grows too far writes over variables, and the board then fails somewhere else. Method: the stack is the
//! *lowest* part of the memory ([the board's](crate::board) map). Below it there is no memory, so the first access beyond its end is a bus error, which
//! is a [fault](crate::fault). Nothing needs to be configured, and nothing can be forgotten. At the start the unused part is
//! filled with a pattern; the lowest word without it says how much was used. The pattern outlives a restart, so the next start
//! sees it too.
//!
//! Cost: one pass over [`BYTES`] at the start, and one over its unused part for each question. Limits: a frame that was left
//! unwritten at its far end is not seen.

use core::ptr::addr_of;

unsafe extern "C" {
    // Addresses the linker knows: the stack, from its lowest byte on, and the memory behind it that has a fixed use.
    static _stack_end: u32;
    static _stack_start: u32;
    static __euninit: u32;
}

/// What an unused word holds.
const PATTERN: u32 = 0x5afe_57ac;

/// Left alone above: what the filling itself uses.
const MARGIN: u32 = 256;

/// The lowest address of the stack.
pub fn end() -> u32 {
    addr_of!(_stack_end) as u32
}

/// The address behind its highest word.
pub fn start() -> u32 {
    addr_of!(_stack_start) as u32
}

/// Bytes of the stack.
pub fn size() -> u32 {
    start() - end()
}

/// Bytes of memory with a fixed use.
pub fn fixed() -> u32 {
    // The stack begins where these end.
    addr_of!(__euninit) as u32 - start()
}

/// Bytes of the stack that were used since it was [filled](fill); before that, by the run before, or rubbish after the supply
/// was away.
pub fn used() -> u32 {
    let mut at = end();
    // SAFETY: words of the stack, which is memory. Those below the pointer are nobody's; of those above it only the value is
    // looked at, by a volatile access.
    while at < start() && unsafe { (at as *const u32).read_volatile() } == PATTERN {
        at += 4;
    }
    start() - at
}

/// Fills what is not in use. To be called once, near the beginning.
pub fn fill() {
    let top = cortex_m::register::msp::read() - MARGIN;
    let mut at = end();
    while at < top {
        // SAFETY: a word of the stack below the pointer, with room for what this function and an interrupt use; so it is nobody's.
        unsafe { (at as *mut u32).write_volatile(PATTERN) };
        at += 4;
    }
}
