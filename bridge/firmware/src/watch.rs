//! The lamp and the watchdog.
//!
//! The watchdog is fed only if the task at the port has gone round its loop since the last time. If that task hangs, or
//! another one keeps the processor, the board restarts after eight seconds. During the reset a resistor holds nOE high,
//! so the printer sees nothing of it. The library decides what the lamp shows ([`bridge::lamp`]).

use crate::pins;
use crate::shared::Shared;
use bridge::lamp;
use embassy_rp::watchdog::Watchdog;
use embassy_time::{Duration, Timer};
use portable_atomic::{AtomicBool, Ordering};

/// The task at the port is alive.
pub static HEARTBEAT: AtomicBool = AtomicBool::new(false);

const PATIENCE: Duration = Duration::from_secs(8);

/// The same as the watchdog counts it: twice every microsecond (erratum RP2040-E1).
pub const LOAD: u32 = 2 * 8_000_000;

/// Runs both.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, mut watchdog: Watchdog) -> ! {
    watchdog.start(PATIENCE);
    loop {
        for step in 0..lamp::STEPS {
            pins::lamp(lamp::is_lit(shared.engine(|engine| engine.progress().state), step));
            if HEARTBEAT.swap(false, Ordering::Relaxed) {
                watchdog.feed(PATIENCE);
            }
            Timer::after(Duration::from_millis(lamp::STEP_MS.into())).await;
        }
    }
}
