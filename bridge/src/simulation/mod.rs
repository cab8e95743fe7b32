//! A printer, its cable and the board in front of it, in virtual time.
//!
//! [`SimulatedPort`] holds all lines and a clock. Its pins implement the `embedded-hal` traits; looking at a
//! pin and waiting are what makes time pass, so a test sees every edge with its time to the nanosecond and
//! minutes of an operator's absence cost nothing. The printer's side reacts as IEEE 1284 describes, with
//! times of its own; bytes it has taken, what it would send back and every edge on the way can be looked at
//! afterwards. [`SimulatedBoard`] is what the driver needs beside the pins.
//!
//! Where millions of bytes cross, [`SimulatedPort::quick`] lets the sender's bytes cross by their number: the
//! same bytes at the same levels, without an edge for each.
//!
//! Limits: edges are ideal, no analogue behaviour of a cable is modelled.

mod board;
mod check;
mod peripheral;
mod pins;

pub use board::SimulatedBoard;
pub use check::{Violation, check};
pub use peripheral::{Pause, Peripheral, Response};
pub use pins::{AckLine, DataLines, DelayLine, InLine, OutLine};

use crate::driver::{Event, TwoBuffers};
use crate::engine::Checkpoint;
use crate::port::Pins;
use board::Strobing;
use peripheral::Phase;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::vec::Vec;

/// A line of the port.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Line {
    /// Data1..Data8 together; the level is the byte.
    Data,
    /// nStrobe.
    Strobe,
    /// nAutoFd.
    AutoFeed,
    /// nInit.
    Init,
    /// nSelectIn.
    SelectIn,
    /// nAck.
    Ack,
    /// Busy.
    Busy,
    /// PError.
    PaperOut,
    /// Select.
    Select,
    /// nFault.
    Fault,
    /// +5 V.
    Power,
}

/// A change of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edge {
    /// When, in ns from the start.
    pub at: u64,
    /// Which.
    pub line: Line,
    /// 0 or 1; for [`Line::Data`] the byte.
    pub level: u8,
}

pub(crate) struct World {
    pub(crate) now: u64,
    /// What the printer will do, by time and order of planning.
    plan: BTreeMap<(u64, u64), (Line, u8)>,
    planned: u64,
    levels: [u8; 11],
    /// What the host's side puts out, whether or not its buffers drive the cable.
    outputs: [u8; 11],
    enabled: bool,
    ack_latch: bool,
    pub(crate) edges: Vec<Edge>,
    pub(crate) taken: Vec<u8>,
    peripheral: Peripheral,
    phase: Phase,
    /// Until when it waits for a host that leaves a negotiation.
    patience: Option<u64>,
    sent_back: usize,
    /// A strobe before this is not seen: the last byte is still being worked on.
    ready_at: u64,
    resets: usize,
    off: bool,
    /// What the printer will have to say, and from when on.
    responses: Vec<(u64, Vec<u8>)>,
    strobing: Strobing,
    buffers: TwoBuffers,
    /// Bytes cross by their number, and no edge is recorded.
    quick: bool,
    /// Bytes sent since the last checkpoint.
    marks: u32,
    checkpoint: Option<Checkpoint>,
    events: Vec<Event>,
    boots: usize,
}

/// What its pins, its board and its printer share.
#[derive(Clone)]
struct Cable(Arc<Mutex<World>>);

impl Cable {
    fn look(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The cable and what hangs at its end. Clones are the same cable.
#[derive(Clone)]
pub struct SimulatedPort(Cable);

/// The pins of a simulated port.
pub type SimulatedPins = Pins<DataLines, OutLine, InLine, AckLine>;

impl SimulatedPort {
    /// A cable to this printer, which is switched on and on line.
    pub fn new(peripheral: Peripheral) -> Self {
        let mut levels = [0; 11];
        for line in
            [Line::Strobe, Line::AutoFeed, Line::Init, Line::Ack, Line::Select, Line::Fault, Line::Power]
        {
            levels[line as usize] = 1;
        }
        SimulatedPort(Cable(Arc::new(Mutex::new(World {
            now: 0,
            plan: BTreeMap::new(),
            planned: 0,
            levels,
            outputs: levels,
            enabled: true,
            ack_latch: false,
            edges: Vec::new(),
            taken: Vec::new(),
            peripheral,
            phase: Phase::Forward,
            patience: None,
            sent_back: 0,
            ready_at: 0,
            resets: 0,
            off: false,
            responses: Vec::new(),
            strobing: Strobing::new(),
            buffers: TwoBuffers::new(),
            quick: false,
            marks: 0,
            checkpoint: None,
            events: Vec::new(),
            boots: 0,
        }))))
    }

    /// The host's end, and the clock to wait by.
    pub fn pins(&self) -> (SimulatedPins, DelayLine) {
        let output = |line| OutLine(self.0.clone(), line);
        let input = |line| InLine(self.0.clone(), line);
        let pins = Pins {
            data: DataLines(self.0.clone()),
            strobe: output(Line::Strobe),
            auto_feed: output(Line::AutoFeed),
            init: output(Line::Init),
            select_in: output(Line::SelectIn),
            ack: AckLine(self.0.clone()),
            busy: input(Line::Busy),
            paper_out: input(Line::PaperOut),
            select: input(Line::Select),
            fault: input(Line::Fault),
            power: Some(input(Line::Power)),
        };
        (pins, DelayLine(self.0.clone()))
    }

    /// Lets time pass, in ns.
    pub fn pass(&self, ns: u64) {
        self.0.look().pass(ns);
    }

    /// The time, in ns.
    pub fn now(&self) -> u64 {
        self.0.look().now
    }

    /// Changes a line of the printer in `after` ns, whatever its model says.
    pub fn plan(&self, after: u64, line: Line, level: u8) {
        self.0.look().plan(after, line, level);
    }

    /// Switches the printer on or off. What it was at work on, and what was planned, is gone.
    pub fn switch(&self, on: bool) {
        self.0.look().switch(on);
    }

    /// The bytes the printer has taken.
    pub fn taken(&self) -> Vec<u8> {
        self.0.look().taken.clone()
    }

    /// Every change of every line.
    pub fn edges(&self) -> Vec<Edge> {
        self.0.look().edges.clone()
    }

    /// From now on the sender's bytes cross by their number, and neither edges nor events are recorded.
    pub fn quick(&self) {
        self.0.look().quick = true;
    }

    /// The bytes the printer has taken since this was last asked.
    pub fn drain(&self) -> Vec<u8> {
        core::mem::take(&mut self.0.look().taken)
    }

    /// What the printer will answer to the status question, a millisecond behind it.
    pub fn answer(&self, bytes: &[u8]) {
        let response = Response { after: 1_000_000, bytes: bytes.to_vec() };
        self.0.look().peripheral.status = std::vec![response];
    }

    /// The printer has a fault for a while when it has taken so many bytes since [`SimulatedPort::drain`].
    pub fn pause(&self, pause: Pause) {
        self.0.look().peripheral.pauses = std::vec![pause];
    }

    /// How often nInit has reset the printer.
    pub fn resets(&self) -> usize {
        self.0.look().resets
    }
}

impl World {
    pub(crate) fn level(&self, line: Line) -> u8 {
        self.levels[line as usize]
    }

    fn plan(&mut self, after: u64, line: Line, level: u8) {
        self.planned += 1;
        self.plan.insert((self.now + after, self.planned), (line, level));
    }

    pub(crate) fn pass(&mut self, ns: u64) {
        let until = self.now + ns;
        loop {
            let planned = self.plan.first_key_value().map(|(&(at, _), _)| at);
            let strobes = if self.quick { None } else { self.strobes_at() };
            if self.quick {
                self.cross(planned.map_or(until, |at| at.min(until)));
            }
            match (planned, strobes) {
                (Some(at), _) if at <= until && strobes.is_none_or(|strobes| at <= strobes) => {
                    self.now = at;
                    if let Some((_, (line, level))) = self.plan.pop_first() {
                        self.change(line, level);
                    }
                }
                (_, Some(at)) if at <= until => {
                    self.now = at;
                    self.strobe();
                }
                _ => break,
            }
        }
        self.now = until;
        if self.patience.is_some_and(|at| at <= until) {
            self.give_up();
        }
    }

    /// Sets a line; true if that changed it.
    fn change(&mut self, line: Line, level: u8) -> bool {
        if self.level(line) == level {
            return false;
        }
        self.levels[line as usize] = level;
        if !self.quick {
            self.edges.push(Edge { at: self.now, line, level });
        }
        if line == Line::Ack && level == 0 {
            self.ack_latch = true;
        }
        true
    }

    /// The host's side sets a line.
    fn drive(&mut self, line: Line, level: u8) {
        self.outputs[line as usize] = level;
        if self.enabled {
            self.show(line, level);
        }
    }

    /// The printer sees a line of the host's.
    fn show(&mut self, line: Line, level: u8) {
        if self.change(line, level) && !self.off {
            self.react(line, level);
        }
    }

    /// The host's buffers drive the cable, or pull-ups hold its control lines high.
    fn enable(&mut self, on: bool) {
        self.enabled = on;
        for line in [Line::Data, Line::SelectIn, Line::AutoFeed, Line::Init, Line::Strobe] {
            let free = if line == Line::Data { self.level(line) } else { 1 };
            self.show(line, if on { self.outputs[line as usize] } else { free });
        }
    }

    /// The host's processor sets a line.
    pub(crate) fn host(&mut self, line: Line, level: u8) {
        self.drive(line, level);
        // An instruction of a microcontroller at 125 MHz.
        self.pass(8);
    }
}
