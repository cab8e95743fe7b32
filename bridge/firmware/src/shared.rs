//! What the tasks share: the engine, and bells to wake each other.
//!
//! All tasks run on one core, in thread mode, and none waits while it holds the engine; so a plain cell is lock
//! enough and no interrupt is ever held off by the engine's work.

use bridge::engine::Engine;
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
}

/// The engine and its bells.
pub struct Shared {
    engine: RefCell<Engine<'static>>,
    bells: [Signal<NoopRawMutex, ()>; 3],
}

impl Shared {
    /// Around an engine.
    pub fn new(engine: Engine<'static>) -> Self {
        Shared { engine: RefCell::new(engine), bells: [const { Signal::new() }; 3] }
    }

    /// Does something with the engine.
    pub fn engine<R>(&self, act: impl FnOnce(&mut Engine<'static>) -> R) -> R {
        act(&mut self.engine.borrow_mut())
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
