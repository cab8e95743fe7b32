//! How long a task keeps the processor from the others.
//!
//! Problem: on one core a task that does not yield stops all others, and what a host or the bus then waits for is late. Method:
//! the executor calls back before and after each turn of a task; the longest turn is kept. Limits: interrupts that come in a
//! turn count as part of it; what runs before the tasks, at the start, does not count.

use crate::board::now_us;
use portable_atomic::{AtomicU32, Ordering};

static BEGAN_US: AtomicU32 = AtomicU32::new(0);
static LONGEST_US: AtomicU32 = AtomicU32::new(0);

/// The present turn begins only now: what came before was the start of the board.
pub fn restart() {
    BEGAN_US.store(now_us(), Ordering::Relaxed);
}

/// The longest turn until now, in µs.
pub fn longest_us() -> u32 {
    LONGEST_US.load(Ordering::Relaxed)
}

// What the executor calls, with these names, and only from thread mode but for `ready_begin`.

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_begin(_executor: u32, _task: u32) {
    restart();
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_end(_executor: u32, _task: u32) {
    let took = now_us().wrapping_sub(BEGAN_US.load(Ordering::Relaxed));
    if took > longest_us() {
        LONGEST_US.store(took, Ordering::Relaxed);
    }
}

#[unsafe(no_mangle)]
fn _embassy_trace_poll_start(_executor: u32) {}
#[unsafe(no_mangle)]
fn _embassy_trace_task_new(_executor: u32, _task: u32) {}
#[unsafe(no_mangle)]
fn _embassy_trace_task_end(_executor: u32, _task: u32) {}
#[unsafe(no_mangle)]
fn _embassy_trace_task_ready_begin(_executor: u32, _task: u32) {}
#[unsafe(no_mangle)]
fn _embassy_trace_executor_idle(_executor: u32) {}
