//! The lamp and the watchdog.
//!
//! The watchdog runs from before USB starts, and only here it is fed: when both tasks that print have gone round their loops since
//! the last time, the one that makes printer bytes and the one at the port, which wakes the other every millisecond. If
//! either hangs, or another one keeps the processor, the board restarts after eight seconds. During the reset a resistor
//! holds nOE high, so the printer sees nothing of it. The library decides what the lamp shows ([`bridge::lamp`]).

use crate::pins;
use crate::shared::Shared;
use bridge::lamp;
use embassy_rp::Peri;
use embassy_rp::peripherals::WATCHDOG;
use embassy_rp::watchdog::Watchdog;
use embassy_time::{Duration, Timer};
use portable_atomic::{AtomicBool, Ordering};

/// Who has to show life.
#[derive(Clone, Copy)]
pub enum Life {
    /// The task that makes printer bytes.
    Work,
    /// The task at the port.
    Port,
}

/// They have, since the watchdog was last fed.
static ALIVE: [AtomicBool; 2] = [const { AtomicBool::new(false) }; 2];

const PATIENCE: Duration = Duration::from_secs(8);

/// A task has gone round its loop.
pub fn show_life(who: Life) {
    ALIVE[who as usize].store(true, Ordering::Relaxed);
}

/// Starts the watchdog.
pub fn start(watchdog: Peri<'static, WATCHDOG>) -> Watchdog {
    let mut watchdog = Watchdog::new(watchdog);
    watchdog.start(PATIENCE);
    watchdog
}

/// Runs both.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, mut watchdog: Watchdog) -> ! {
    loop {
        for step in 0..lamp::STEPS {
            pins::lamp(lamp::is_lit(shared.engine(|engine| engine.progress().state), step));
            if ALIVE.iter().all(|alive| alive.load(Ordering::Relaxed)) {
                ALIVE.iter().for_each(|alive| alive.store(false, Ordering::Relaxed));
                watchdog.feed(PATIENCE);
            }
            Timer::after(Duration::from_millis(lamp::STEP_MS.into())).await;
        }
    }
}
