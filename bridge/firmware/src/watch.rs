//! The lamp and the watchdog.
//!
//! The watchdog is fed only if the task at the port has been round its loop since the last time; if it hangs, or any
//! task keeps the processor, the board restarts after eight seconds. While it is in reset nOE is high by its
//! resistor and the printer sees nothing.

use crate::pins;
use crate::shared::Shared;
use embassy_rp::watchdog::Watchdog;
use embassy_time::{Duration, Timer};
use portable_atomic::{AtomicBool, Ordering};
use protocol::link::message::JobState;

/// The task at the port is alive.
pub static HEARTBEAT: AtomicBool = AtomicBool::new(false);

const PATIENCE: Duration = Duration::from_secs(8);

/// The same as the watchdog counts it: twice every microsecond (erratum RP2040-E1).
pub const LOAD: u32 = 2 * 8_000_000;

const STEP: Duration = Duration::from_millis(50);

/// Steps of 50 ms in which the lamp is lit, from the lowest bit.
fn pattern(shared: &Shared) -> u32 {
    shared.engine(|engine| match engine.progress().state {
        // A short blink: nothing to do.
        JobState::None | JobState::Done | JobState::Cancelled => 0x0000_0003,
        // Even flashing: at work.
        JobState::Printing | JobState::Cancelling => 0x33333333,
        // Two blinks: someone has to see to the printer.
        JobState::Stopped(_) => 0x0000_0c03,
        // Three: the last job went wrong.
        JobState::Broken(_) | JobState::Lost => 0x0030_0c03,
    })
}

/// Runs both.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, mut watchdog: Watchdog) -> ! {
    watchdog.start(PATIENCE);
    loop {
        for step in 0..32 {
            pins::lamp(pattern(shared) >> step & 1 == 1);
            if HEARTBEAT.swap(false, Ordering::Relaxed) {
                watchdog.feed(PATIENCE);
            }
            Timer::after(STEP).await;
        }
    }
}
