//! The board: engine, store, ways to the host, and the driver at the simulated cable, with memory that
//! outlives a reset.

use bridge::alone::Alone;
use bridge::checkpoint::{CheckpointStore, MARKS, Memory as Slots, PAST_SLOT, SLOT};
use bridge::driver::{Clock, Driver, Event, Sender};
use bridge::engine::{Checkpoint, Engine, Identity, Memory};
use bridge::links::Links;
use bridge::port::{Port, Timing};
use bridge::printer_class::{DeviceId, Intake};
use bridge::simulation::{AckLine, DataLines, DelayLine, InLine, OutLine, SimulatedBoard, SimulatedPort};
use model::flash::ModelFlash;
use protocol::link::message::Lines;
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

/// The board at the cable: the sender's bytes leave their marks in the memory that outlives a reset. Clones
/// are the same.
#[derive(Clone)]
struct AtCable {
    board: SimulatedBoard,
    cable: SimulatedPort,
    kept: Arc<Mutex<(CheckpointStore<Retained>, u32)>>,
    end: Arc<Mutex<End>>,
}

/// Whether the board comes to its end in the middle of a poll.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Far,
    /// When it has given bytes to the sender: some of them cross, and nothing is kept any more.
    Near,
    Reached,
}

impl AtCable {
    fn kept(&self) -> MutexGuard<'_, (CheckpointStore<Retained>, u32)> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) -> MutexGuard<'_, End> {
        self.end.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the marks of what has crossed, but for the last `unmarked`.
    fn mark_crossed(&self, unmarked: u32) {
        let (checkpoints, marked) = &mut *self.kept();
        let crossed = self.board.marks().saturating_sub(unmarked);
        (*marked..crossed).for_each(|at| checkpoints.mark(at as usize));
        *marked = crossed.max(*marked);
    }
}

impl Clock for AtCable {
    fn now_us(&self) -> u64 {
        self.board.now_us()
    }
}

impl Sender for AtCable {
    fn set_timing(&mut self, timing: &Timing) {
        self.board.set_timing(timing);
    }

    fn connect(&mut self) {
        self.board.connect();
    }

    fn disconnect(&mut self) {
        self.board.disconnect();
    }

    fn has_room(&self) -> bool {
        *self.end() != End::Reached && self.board.has_room()
    }

    fn give(&mut self, bytes: &[u8]) -> usize {
        let given = self.board.give(bytes);
        let mut end = self.end();
        if *end == End::Near && given > 0 {
            self.cable.pass(200_000);
            *end = End::Reached;
        }
        given
    }

    fn in_flight(&self) -> usize {
        self.board.in_flight()
    }

    fn sent(&mut self) -> usize {
        self.board.sent()
    }

    fn stop(&mut self) -> usize {
        self.board.stop()
    }
}

impl bridge::driver::Retained for AtCable {
    fn mark(&mut self) {
        self.board.mark();
    }

    fn store(&mut self, checkpoint: Checkpoint) {
        if *self.end() == End::Reached {
            return;
        }
        self.mark_crossed(0);
        let crossed = self.board.marks();
        self.board.store(checkpoint);
        // Those that the checkpoint does not cover stay.
        let left = self.board.marks();
        let (checkpoints, marked) = &mut *self.kept();
        checkpoints.store(checkpoint, checkpoints.place() + (crossed - left) as usize);
        *marked = left;
    }
}

impl bridge::driver::Board for AtCable {
    fn lines(&mut self) -> Lines {
        bridge::driver::Board::lines(&mut self.board)
    }

    fn enable(&mut self, on: bool) {
        self.board.enable(on);
    }

    fn start_boot_loader(&mut self) {
        self.board.start_boot_loader();
    }

    fn log(&mut self, event: Event) {
        self.board.log(event);
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
    driver: Driver<AtCable, DataLines, OutLine, InLine, AckLine, DelayLine>,
    at_cable: AtCable,
    id: DeviceId,
}

/// Memory for an engine, which goes from one start to the next.
pub fn memory(data: usize, output: usize) -> Memory<'static> {
    model::memory(data, output, 8192)
}

impl Board {
    /// The board starts at this cable; `known` says that its memory is what an earlier start has left there,
    /// `from_outside` that it was not reset by its own watchdog.
    pub fn start(
        memory: Memory<'static>,
        cable: &SimulatedPort,
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
        let at_cable = AtCable {
            board: SimulatedBoard::new(cable),
            cable: cable.clone(),
            kept: Arc::new(Mutex::new((checkpoints, 0))),
            end: Arc::new(Mutex::new(End::Far)),
        };
        let (pins, delay) = cable.pins();
        let driver = Driver::new(at_cable.clone(), Port::new(pins, delay));
        let (links, intake, id) = (Links::new(), Intake::new(), DeviceId::new());
        Board { engine, alone, links, intake, driver, at_cable, id }
    }

    /// The driver looks; for how many µs there is nothing to do then.
    pub fn poll(&mut self) -> u32 {
        self.driver.poll(&mut self.engine, &mut self.id)
    }

    /// The board stops when it next gives bytes to the sender.
    pub fn ends_with_next_bytes(&mut self) {
        *self.at_cable.end() = End::Near;
    }

    /// It has stopped so.
    pub fn is_over(&self) -> bool {
        *self.at_cable.end() == End::Reached
    }

    /// The board stops: its memory. A byte whose strobe is under way comes to its end; all are marked but the
    /// last `unmarked`.
    pub fn stop(self, unmarked: u32) -> Memory<'static> {
        self.at_cable.board.halt();
        self.at_cable.mark_crossed(unmarked);
        let _ = self.at_cable.board.reset();
        self.engine.into_memory()
    }
}
