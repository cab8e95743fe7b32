//! What the tasks share: the engine, who is answered, the printer's device ID, and bells to wake each other.
//!
//! All tasks run on one core, in thread mode, and none waits while it holds one of these; so plain cells are lock
//! enough and no interrupt is ever held off by the engine's work.

use bridge::engine::Engine;
use bridge::links::{Links, Way};
use bridge::printer_class::{DeviceId, End};
use core::cell::RefCell;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;

/// Who can be woken.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The one that makes printer bytes of data.
    Work,
    /// The one that sends them.
    Port,
    /// The one that answers the host.
    Link,
    /// The one at the store.
    Store,
}

/// What is shared.
pub struct Shared {
    engine: RefCell<Engine<'static>>,
    links: RefCell<Links>,
    device_id: RefCell<DeviceId>,
    bells: [Signal<NoopRawMutex, ()>; 4],
    /// Another way to the host is to be answered, or none any more.
    pub speaker_changed: Signal<NoopRawMutex, ()>,
    /// No more of a job comes through the printer interface.
    pub printer_end: Signal<NoopRawMutex, End>,
}

impl Shared {
    /// Around an engine.
    pub fn new(engine: Engine<'static>) -> Self {
        Shared {
            engine: RefCell::new(engine),
            links: RefCell::new(Links::new()),
            device_id: RefCell::new(DeviceId::new()),
            bells: [const { Signal::new() }; 4],
            speaker_changed: Signal::new(),
            printer_end: Signal::new(),
        }
    }

    /// Does something with the engine.
    pub fn engine<R>(&self, act: impl FnOnce(&mut Engine<'static>) -> R) -> R {
        act(&mut self.engine.borrow_mut())
    }

    /// Does something with the printer's device ID.
    pub fn device_id<R>(&self, act: impl FnOnce(&mut DeviceId) -> R) -> R {
        act(&mut self.device_id.borrow_mut())
    }

    /// Does something with the ways to the engine.
    pub fn links<R>(&self, act: impl FnOnce(&mut Links, &mut Engine<'static>) -> R) -> R {
        let mut links = self.links.borrow_mut();
        let before = links.speaker();
        let result = act(&mut links, &mut self.engine.borrow_mut());
        if links.speaker() != before {
            self.speaker_changed.signal(());
        }
        result
    }

    /// A packet has come this way.
    pub fn hear(&self, way: Way, bytes: &[u8]) {
        // A message of data comes in some fifteen packets.
        if self.links(|links, engine| links.receive(way, bytes, engine)) {
            self.wake(Side::Work);
            self.wake(Side::Port);
            self.wake(Side::Link);
            self.wake(Side::Store);
        }
    }

    /// Wakes a side that waits, or keeps it from waiting the next time.
    pub fn wake(&self, side: Side) {
        self.bells[side as usize].signal(());
    }

    /// Waits to be woken.
    pub async fn wait(&self, side: Side) {
        self.bells[side as usize].wait().await;
    }
}
