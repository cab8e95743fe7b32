//! A turn of the board's tasks, with the printer at its port and packets and frames at its cable.

use super::{Down, WAYS, World};
use crate::chance::Draw;
use crate::pool;
use crate::promises::Promise;
use bridge::engine::{Outcome as Done, Task};
use bridge::printer_class::Next;
use protocol::link::frame::MAX;
use protocol::link::message::{Answer, Fault, Lines};

impl World {
    /// Bursts that are due reach the board, and packets of an operating system.
    pub(super) fn deliver(&mut self) {
        let Some(board) = &mut self.board else { return self.to_board.clear() };
        let mut left = Vec::new();
        for burst in std::mem::take(&mut self.to_board) {
            if burst.due > self.now {
                left.push(burst);
                continue;
            }
            for packet in burst.bytes.chunks(64) {
                board.links.receive(WAYS[burst.user], packet, &mut board.engine);
            }
        }
        self.to_board = left;
        for _ in 0..8 {
            match board.intake.next() {
                Next::Packet(_) if self.plain.is_some() && self.pulled_until <= self.now => {
                    let Some((which, at)) = &mut self.plain else { break };
                    let bytes = &pool::job(*which).bytes[*at..];
                    let count = bytes.len().min(64);
                    board.intake.buffer()[..count].copy_from_slice(&bytes[..count]);
                    *at += count;
                    if count == 0 {
                        // All of it has gone; whether the job is over is the intake's to find out.
                        self.plain = None;
                        break;
                    }
                    board.intake.receive(count, &mut board.engine, self.now);
                }
                Next::Packet(due) | Next::Time(due) => {
                    if due <= self.now {
                        board.intake.wake(&mut board.engine, self.now);
                    }
                    break;
                }
            }
        }
    }

    /// The board's tasks, and the printer. The board may go down in the middle of them.
    pub(super) fn work(&mut self, down: Option<Down>, draw: &mut Draw) {
        let off = self.printer.off_until > self.now;
        let paper_out = self.printer.paper_out_until > self.now;
        let Some(board) = &mut self.board else { return };
        if down == Some(Down::Cut) && draw.one_in_1000(500) {
            self.flash.cut_after(0);
        }
        for _ in 0..4 + draw.below(30) {
            if !board.engine.work() {
                break;
            }
        }
        for _ in 0..1 + draw.below(3) {
            if !board.alone.poll(&mut board.engine) {
                break;
            }
        }
        if self.flash.is_off() {
            // The supply went while something was written: the board did nothing behind that.
            self.crossed = None;
            self.ended();
            return self.stop(Down::Cut, draw);
        }
        let task = board.engine.task();
        let mut violation = None;
        if let Some(task) = task {
            match task {
                Task::Initialise if off => board.engine.done(Done::Done),
                Task::Initialise => {
                    self.printer.reset();
                    board.engine.done(Done::Done);
                }
                Task::PrinterStatus if off => {
                    board.engine.done(Done::Answer(Answer::Stopped(Fault::PowerOff)))
                }
                Task::PrinterStatus => {
                    if self.printer.holds_a_part() {
                        violation = Some((
                            Promise::NoQuestionInASheet,
                            format!(
                                "asked behind {} bytes of job {:08x}",
                                self.printer.since.len(),
                                self.printer.owner
                            ),
                        ));
                    }
                    let answer = self.printer.status(self.now);
                    board.engine.done(Done::Answer(Answer::Bytes(&answer)));
                }
                Task::DeviceId => {
                    board.engine.done(Done::Answer(Answer::Bytes(b"\0\x18MANUFACTURER:ALPS;CLS:P;")))
                }
                _ => board.engine.done(Done::Done),
            }
        }
        let (lines, fault) = match (off, paper_out) {
            (true, _) => (Lines(0), Some(Fault::PowerOff)),
            (_, true) => (Lines(Lines::IDLE.0 | Lines::PAPER_OUT), Some(Fault::PaperOut)),
            _ => (Lines::IDLE, None),
        };
        board.engine.port(lines, fault);
        let mut crossed = Vec::new();
        let mut number = 0;
        if fault.is_none() {
            let most = 1 + draw.below(self.speed);
            let output = board.engine.output();
            crossed.extend_from_slice(&output[..output.len().min(most)]);
            number = board.engine.open_job().unwrap_or(0);
            // RUN is pressed while bytes flow: the strobe of the last one is over, and its mark is not made yet.
            let unmarked = usize::from(down == Some(Down::Run) && draw.one_in_1000(800));
            board.cross(crossed.len(), unmarked);
        }
        if down.is_none() {
            board.settle(crossed.len());
        }
        if let Some((promise, found)) = violation {
            self.fail(promise, found);
        }
        self.take(number, &crossed);
        if let Some(down) = down {
            self.ended();
            self.stop(down, draw);
            return;
        }
        self.answer();
        self.ended();
    }

    /// Bytes of this job reach the printer.
    fn take(&mut self, number: u32, bytes: &[u8]) {
        self.crossed = (!bytes.is_empty()).then_some(number);
        if bytes.is_empty() {
            return;
        }
        if self.printer.owner != number || self.printer.since.is_empty() {
            if self.printer.holds_a_part() {
                let found = format!(
                    "job {number:08x} behind {} bytes of job {:08x}",
                    self.printer.since.len(),
                    self.printer.owner
                );
                self.fail(Promise::NothingIntoAnotherSheet, found);
            }
            self.printer.since.clear();
            self.printer.owner = number;
            if let Some(known) = self.known.get_mut(&number) {
                known.begun += 1;
                if known.begun > 1 {
                    let found = format!("job {number:08x} begins for the second time: {known:?}");
                    self.fail(Promise::NothingTwice, found);
                }
            }
        }
        self.printer.since.extend_from_slice(bytes);
    }

    /// What the engine has to say.
    fn answer(&mut self) {
        let Some(board) = &mut self.board else { return };
        let mut frame = [0; MAX];
        let mut said = Vec::new();
        loop {
            let length = board.engine.transmit(&mut frame);
            if length == 0 {
                break;
            }
            said.push(frame[..length].to_vec());
        }
        let Some(way) = board.links.speaker() else { return };
        let user = way as usize;
        for frame in said {
            self.send_to_host(user, frame);
        }
    }

    fn send_to_host(&mut self, user: usize, frame: Vec<u8>) {
        for (due, bytes) in self.carry(frame) {
            self.to_host[user].push_back((due, bytes));
        }
    }
}
