//! A board in virtual time: a sender of two buffers on the simulated lines, memory that survives a reset, a log.
//!
//! The sender keeps to the steps of the firmware's PIO program, tick by tick: it waits for Busy to fall, puts the byte on
//! the data lines, looks at Busy, PError, Select, nFault and +5 V together until all are well, and strobes three ticks later.
//! It runs while the clock does, so the processor's side sees it at any point of a byte. The program itself, its DMA and
//! its interrupt run in the emulator only.

use super::{Cable, Line, SimulatedPort, World};
use crate::driver::{Board, Clock, Event, Retained, Sender};
use crate::engine::Checkpoint;
use crate::port::Timing;
use protocol::link::message::Lines;
use std::collections::VecDeque;
use std::vec::Vec;

/// Bytes in each of the sender's buffers.
const CHUNK: usize = 1024;

/// The clock whose cycles the sender counts.
const CLOCK_HZ: u32 = 125_000_000;

/// What the sender does next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Step {
    /// Takes a byte, if there is one, when Busy is low.
    Wait,
    /// Puts the byte on the data lines.
    Put(u8),
    /// Looks at the lines.
    Look,
    /// nStrobe falls, rises, and the byte is counted.
    Fall,
    Rise,
    Count,
}

/// The sender, as a part of the world.
pub(crate) struct Strobing {
    connected: bool,
    bytes: VecDeque<u8>,
    step: Step,
    /// When the step may be taken.
    at: u64,
    tick: u64,
    /// Bytes counted and not yet asked for.
    counted: usize,
}

impl Strobing {
    pub(crate) fn new() -> Self {
        let tick = tick(&Timing::DEFAULT);
        Strobing { connected: false, bytes: VecDeque::new(), step: Step::Wait, at: 0, tick, counted: 0 }
    }
}

/// Nanoseconds of a tick, rounded up.
fn tick(timing: &Timing) -> u64 {
    (u64::from(timing.eighth(CLOCK_HZ)) * 8).div_ceil(256)
}

impl World {
    /// When the sender takes its next step, unless a line changes before.
    pub(crate) fn strobes_at(&self) -> Option<u64> {
        let Strobing { connected, ref bytes, step, at, .. } = self.strobing;
        let ready = match step {
            Step::Wait => !bytes.is_empty() && self.level(Line::Busy) == 0,
            Step::Look => self.is_ready(),
            Step::Put(_) | Step::Fall | Step::Rise | Step::Count => true,
        };
        (connected && ready).then_some(at.max(self.now))
    }

    fn is_ready(&self) -> bool {
        let lines = [Line::Busy, Line::PaperOut, Line::Select, Line::Fault, Line::Power];
        lines.map(|line| self.level(line)) == [0, 0, 1, 1, 1]
    }

    /// Takes the sender's next step.
    pub(crate) fn strobe(&mut self) {
        let ticks = match self.strobing.step {
            Step::Wait => {
                let Some(byte) = self.strobing.bytes.pop_front() else { return };
                self.strobing.step = Step::Put(byte);
                1
            }
            Step::Put(byte) => {
                self.drive(Line::Data, byte);
                self.strobing.step = Step::Look;
                5
            }
            Step::Look => {
                self.strobing.step = Step::Fall;
                3
            }
            Step::Fall => {
                self.drive(Line::Strobe, 0);
                self.strobing.step = Step::Rise;
                8
            }
            Step::Rise => {
                self.drive(Line::Strobe, 1);
                self.strobing.step = Step::Count;
                5
            }
            Step::Count => {
                self.strobing.counted += 1;
                self.marks += 1;
                self.strobing.step = Step::Wait;
                2
            }
        };
        self.strobing.at = self.now + ticks * self.strobing.tick;
    }
}

/// The board. Its clones are the same board.
#[derive(Clone)]
pub struct SimulatedBoard {
    world: Cable,
}

impl SimulatedBoard {
    /// A board at this end of the cable, which it does not drive yet.
    pub fn new(port: &SimulatedPort) -> Self {
        port.0.look().enable(false);
        SimulatedBoard { world: port.0.clone() }
    }

    /// What the log says.
    pub fn events(&self) -> Vec<Event> {
        self.world.look().events.clone()
    }

    /// How often the boot loader was started.
    pub fn boots(&self) -> usize {
        self.world.look().boots
    }

    /// A byte whose strobe is under way comes to its end.
    pub fn halt(&self) {
        self.world.look().finish_byte();
    }

    /// Bytes that were marked since the last checkpoint.
    pub fn marks(&self) -> u32 {
        self.world.look().marks
    }

    /// What the board finds in its memory when it is reset now: the last checkpoint, with the bytes that were marked since.
    /// A byte whose strobe is under way comes to its end first.
    pub fn reset(self) -> Option<Checkpoint> {
        let mut world = self.world.look();
        world.finish_byte();
        world.strobing = Strobing::new();
        world.buffers.clear();
        world.enable(false);
        let marks = core::mem::take(&mut world.marks);
        let mut checkpoint = world.checkpoint?;
        checkpoint.progress.printed += marks;
        Some(checkpoint)
    }
}

impl World {
    /// Bytes cross one after the other until then, while the lines are well, without an edge.
    pub(crate) fn cross(&mut self, until: u64) {
        if self.strobing.connected && self.enabled && self.is_ready() {
            let each = 24 * self.strobing.tick + self.peripheral.work;
            let count = ((until - self.now) / each).min(self.strobing.bytes.len() as u64) as usize;
            self.taken.extend(self.strobing.bytes.drain(..count));
            self.strobing.counted += count;
            self.marks += count as u32;
        }
    }

    /// Lets time pass until no strobe is under way.
    fn finish_byte(&mut self) {
        while matches!(self.strobing.step, Step::Rise | Step::Count) {
            self.pass(8);
        }
    }
}

impl Clock for SimulatedBoard {
    fn now_us(&self) -> u64 {
        self.world.look().now / 1000
    }
}

impl Sender for SimulatedBoard {
    fn set_timing(&mut self, timing: &Timing) {
        self.world.look().strobing.tick = tick(timing);
    }

    fn connect(&mut self) {
        let mut world = self.world.look();
        assert_eq!(world.level(Line::Strobe), 1, "the pins change hands with nStrobe low");
        world.strobing.connected = true;
    }

    fn disconnect(&mut self) {
        let mut world = self.world.look();
        assert_eq!(world.level(Line::Strobe), 1, "the pins change hands with nStrobe low");
        assert!(world.strobing.bytes.is_empty(), "the pins change hands with bytes in flight");
        world.strobing.connected = false;
    }

    fn has_room(&self) -> bool {
        self.world.look().buffers.free().is_some()
    }

    fn give(&mut self, bytes: &[u8]) -> usize {
        let mut world = self.world.look();
        if world.buffers.free().is_none() {
            return 0;
        }
        let count = bytes.len().min(CHUNK);
        assert!(world.strobing.connected, "bytes for a sender that has no pins");
        let is_kept = world.checkpoint.is_some_and(|checkpoint| checkpoint.flowing);
        assert!(
            is_kept || !world.is_ready() || world.buffers.in_flight() > 0,
            "bytes flow, and nobody has kept that"
        );
        world.strobing.bytes.extend(&bytes[..count]);
        world.buffers.fill(count as u32);
        count
    }

    fn in_flight(&self) -> usize {
        self.world.look().buffers.in_flight() as usize
    }

    fn sent(&mut self) -> usize {
        let mut world = self.world.look();
        let sent = core::mem::take(&mut world.strobing.counted);
        world.buffers.empty(sent as u32);
        sent
    }

    fn stop(&mut self) -> usize {
        {
            let mut world = self.world.look();
            world.finish_byte();
            world.strobing.bytes.clear();
            world.strobing.step = Step::Wait;
        }
        let sent = self.sent();
        self.world.look().buffers.clear();
        sent
    }
}

impl Retained for SimulatedBoard {
    fn mark(&mut self) {
        self.world.look().marks += 1;
    }

    fn store(&mut self, checkpoint: Checkpoint) {
        let mut world = self.world.look();
        // The marks of bytes that the checkpoint covers; those the sender has counted since are not reported yet.
        world.marks = world.strobing.counted as u32;
        world.checkpoint = Some(checkpoint);
    }
}

impl Board for SimulatedBoard {
    fn lines(&mut self) -> Lines {
        let mut world = self.world.look();
        world.pass(8);
        let lines = [
            (Line::Ack, Lines::ACK),
            (Line::Busy, Lines::BUSY),
            (Line::PaperOut, Lines::PAPER_OUT),
            (Line::Select, Lines::SELECT),
            (Line::Fault, Lines::FAULT),
            (Line::Power, Lines::POWER),
        ];
        Lines(lines.into_iter().filter(|&(line, _)| world.level(line) == 1).map(|(_, bit)| bit).sum())
    }

    fn enable(&mut self, on: bool) {
        self.world.look().enable(on);
    }

    fn start_boot_loader(&mut self) {
        self.world.look().boots += 1;
    }

    fn log(&mut self, event: Event) {
        let mut world = self.world.look();
        if !world.quick {
            world.events.push(event);
        }
    }
}
