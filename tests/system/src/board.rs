//! The board: engine, store, ways to the host, memory that outlives a reset.

use bridge::alone::Alone;
use bridge::checkpoint::{CheckpointStore, MARKS, Memory as Slots, PAST_SLOT, SLOT};
use bridge::engine::{Checkpoint, Engine, Identity, Memory};
use bridge::links::Links;
use bridge::printer_class::Intake;
use model::flash::ModelFlash;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Its serial number.
pub const SERIAL: u64 = 2;

struct Held {
    slots: [[u8; SLOT]; 2],
    past: [[u8; PAST_SLOT]; 2],
    marks: Vec<bool>,
}

/// Memory that outlives a reset. Clones are the same.
#[derive(Clone)]
pub struct Retained(Arc<Mutex<Held>>);

impl Retained {
    /// Memory that holds this byte everywhere.
    pub fn new(rubbish: u8) -> Retained {
        let held = Held {
            slots: [[rubbish; SLOT]; 2],
            past: [[rubbish; PAST_SLOT]; 2],
            marks: vec![rubbish > 99; MARKS],
        };
        Retained(Arc::new(Mutex::new(held)))
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Slots for Retained {
    fn slots(&self) -> [[u8; SLOT]; 2] {
        self.held().slots
    }

    fn write(&mut self, which: usize, slot: [u8; SLOT]) {
        self.held().slots[which] = slot;
    }

    fn past(&self) -> [[u8; PAST_SLOT]; 2] {
        self.held().past
    }

    fn write_past(&mut self, which: usize, slot: [u8; PAST_SLOT]) {
        self.held().past[which] = slot;
    }

    fn is_marked(&self, at: usize) -> bool {
        self.held().marks[at]
    }

    fn mark(&mut self, at: usize) {
        self.held().marks[at] = true;
    }

    fn clear(&mut self, places: Range<usize>) {
        self.held().marks[places].fill(false);
    }
}

/// A board from one start to the next.
pub struct Board {
    /// The engine.
    pub engine: Engine<'static>,
    /// The store.
    pub alone: Alone<ModelFlash>,
    /// The ways to it.
    pub links: Links,
    /// The plain printer interface.
    pub intake: Intake,
    checkpoints: CheckpointStore<Retained>,
}

/// Memory for an engine, which goes from one start to the next.
pub fn memory(data: usize, output: usize) -> Memory<'static> {
    model::memory(data, output, 8192)
}

impl Board {
    /// The board starts; `known` says that its memory is what an earlier start has left there, `from_outside` that it was not
    /// reset by its own watchdog.
    pub fn start(
        memory: Memory<'static>,
        retained: Retained,
        flash: &ModelFlash,
        boot: u32,
        known: bool,
        from_outside: bool,
    ) -> Board {
        let identity = Identity { boot, serial: SERIAL, firmware: "test" };
        let (checkpoints, checkpoint) = CheckpointStore::new(retained, known);
        let checkpoint =
            if from_outside { checkpoint.map(Checkpoint::reset_from_outside) } else { checkpoint };
        let mut engine = match checkpoint {
            Some(checkpoint) => Engine::resume(memory, identity, checkpoint),
            None => Engine::new(memory, identity),
        };
        let alone = Alone::open(flash.clone(), &mut engine, checkpoint.is_some());
        Board { engine, alone, links: Links::new(), intake: Intake::new(), checkpoints }
    }

    /// The board stops: its memory.
    pub fn stop(self) -> Memory<'static> {
        self.engine.into_memory()
    }

    /// So many bytes cross the port; all are marked but the last `unmarked`. What the driver does before the first of them is done.
    pub fn cross(&mut self, count: usize, unmarked: usize) {
        self.checkpoints.store(self.engine.checkpoint(), self.checkpoints.place());
        for sent in 0..count.saturating_sub(unmarked) {
            self.checkpoints.mark(sent);
        }
    }

    /// The driver has looked: what has crossed counts, and the checkpoint covers it.
    pub fn settle(&mut self, count: usize) {
        self.engine.consumed(count);
        self.checkpoints.store(self.engine.checkpoint(), self.checkpoints.place() + count);
    }
}
