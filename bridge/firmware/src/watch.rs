//! The lamp, the button and the watchdog.
//!
//! The watchdog runs from before USB starts, and only here it is fed: when both tasks that print have gone round their loops since
//! the last time, the one that makes printer bytes and the one at the port, which wakes the other every millisecond. If
//! either hangs, or another one keeps the processor, the board restarts after eight seconds. During the reset a resistor
//! holds nOE high, so the printer sees nothing of it. The library decides what the lamp shows
//! ([`bridge::lamp`]) and what a press of the button means ([`bridge::button`]).
//!
//! A USB controller that hears nothing any more ([`bridge::deaf`]) restarts the board, with no byte cut in two; the job goes on
//! after it.

use crate::shared::{Shared, Side};
use crate::{pins, strobe};
use bridge::button::Button;
use bridge::deaf::{Deaf, LOOK_MS, Shown};
use bridge::lamp::{self, Lamp};
use embassy_rp::peripherals::WATCHDOG;
use embassy_rp::watchdog::Watchdog;
use embassy_rp::{Peri, pac};
use embassy_time::{Duration, Instant, Timer};
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

/// Runs all three.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, mut watchdog: Watchdog) -> ! {
    let (mut lamp, mut button, mut deaf) = (Lamp::new(), Button::new(), Deaf::new());
    loop {
        pins::lamp(shared.engine(|engine| lamp.next(engine)));
        if ALIVE.iter().all(|alive| alive.load(Ordering::Relaxed)) {
            ALIVE.iter().for_each(|alive| alive.store(false, Ordering::Relaxed));
            watchdog.feed(PATIENCE);
        }
        for _ in 0..lamp::STEP_MS / LOOK_MS {
            // The clock of the button may wrap.
            if let Some(press) = button.look(pins::button(), Instant::now().as_millis() as u32) {
                shared.engine(|engine| engine.press(press));
                shared.wake(Side::Store);
                shared.wake(Side::Port);
            }
            let shown = Shown {
                reset: pac::USB.sie_status().read().bus_reset(),
                address: pac::USB.addr_endp().read().address(),
                frame: pac::USB.sof_rd().read().count(),
            };
            if deaf.look(shown) {
                defmt::warn!("USB hears nothing: the board restarts");
                cortex_m::interrupt::disable();
                strobe::halt();
                pins::enable(false);
                watchdog.trigger_reset();
            }
            Timer::after(Duration::from_millis(LOOK_MS.into())).await;
        }
    }
}
