//! The task at the port: runs the library's [`Driver`] on this board.

use crate::board;
use crate::pins::{self, Ack, Data, Line};
use crate::retained::CheckpointStore;
use crate::shared::{Shared, Side};
use crate::strobe::{SENT, Strobe};
use crate::watch::{self, Life};
use bridge::checkpoint::MARKS;
use bridge::driver::{self, Clock, Driver, Event, Retained, Sender};
use bridge::engine::Checkpoint;
use bridge::port::{Port, Timing};
use embassy_futures::select::select3;
use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::delay::DelayNs;
use protocol::link::message::Lines;

/// Waits by counting clock cycles, never less than asked for.
pub struct Cycles;

impl DelayNs for Cycles {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(board::cycles(ns).max(1));
    }
}

/// The port's driver on this board.
pub type PicoDriver = Driver<Pico, Data, Line, Line, Ack, Cycles>;

/// What the driver needs of the board.
pub struct Pico {
    strobe: Strobe,
    checkpoints: CheckpointStore,
    /// Bytes that the processor has sent since the last checkpoint.
    marked: usize,
}

/// A driver around the strobe engine. The lines come to rest.
pub fn driver(strobe: Strobe, checkpoints: CheckpointStore) -> PicoDriver {
    Driver::new(Pico { strobe, checkpoints, marked: 0 }, Port::new(pins::port(), Cycles))
}

impl Clock for Pico {
    fn now_us(&self) -> u64 {
        Instant::now().as_ticks()
    }
}

impl Sender for Pico {
    fn set_timing(&mut self, timing: &Timing) {
        self.strobe.set_timing(timing);
    }

    fn connect(&mut self) {
        pins::lend_to_pio();
    }

    fn disconnect(&mut self) {
        pins::take_back(self.strobe.last());
    }

    fn has_room(&self) -> bool {
        self.strobe.has_room()
    }

    fn give(&mut self, bytes: &[u8]) -> usize {
        self.strobe.give(bytes)
    }

    fn in_flight(&self) -> usize {
        self.strobe.in_flight()
    }

    fn sent(&mut self) -> usize {
        self.strobe.crossed()
    }

    fn stop(&mut self) -> usize {
        self.strobe.stop()
    }
}

impl Retained for Pico {
    fn mark(&mut self) {
        self.checkpoints.mark(self.marked);
        self.marked += 1;
    }

    fn store(&mut self, checkpoint: Checkpoint) {
        if self.marked > 0 {
            self.strobe.set_place((self.checkpoints.place() + self.marked) % MARKS);
            self.marked = 0;
        }
        self.checkpoints.store(checkpoint, self.strobe.place());
    }
}

impl driver::Board for Pico {
    fn lines(&mut self) -> Lines {
        pins::status()
    }

    fn enable(&mut self, on: bool) {
        pins::enable(on);
    }

    fn start_boot_loader(&mut self) {
        pins::enable(false);
        embassy_rp::rom_data::reset_to_usb_boot(1 << pins::LAMP, 0);
    }

    fn log(&mut self, event: Event) {
        match event {
            Event::Job(progress) => defmt::info!(
                "job {=u32:08x}: {}, {=u32} bytes printed",
                progress.job,
                progress.state,
                progress.printed
            ),
            Event::DeviceId(count) => {
                defmt::info!("the printer has said who it is, in {=usize} bytes", count);
            }
            Event::NoDeviceId => defmt::info!("the printer does not say who it is"),
        }
    }
}

/// Serves the port.
#[embassy_executor::task]
pub async fn serve(shared: &'static Shared, driver: &'static mut PicoDriver) -> ! {
    loop {
        watch::show_life(Life::Port);
        let pause_us = shared.engine(|engine| shared.device_id(|id| driver.poll(engine, id)));
        shared.wake(Side::Work);
        shared.wake(Side::Link);
        if pause_us == 0 {
            yield_now().await;
        } else {
            let pause = Timer::after(Duration::from_ticks(pause_us.into()));
            select3(pause, shared.wait(Side::Port), SENT.wait()).await;
        }
    }
}
