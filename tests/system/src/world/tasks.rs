//! A turn of the board's tasks, with the printer at its cable and packets and frames at its other end.

use super::{Down, MS, WAYS, World};
use crate::board::Board;
use crate::chance::Draw;
use crate::pool;
use crate::promises::Promise;
use bridge::printer_class::Next;
use bridge::standing::{QUESTION, Standing};
use protocol::link::frame::{self, MAX, Read};
use protocol::link::message::{Ask, ToBridge};

impl World {
    /// Bursts that are due reach the board, and packets of an operating system.
    pub(super) fn deliver(&mut self) {
        if self.board.is_none() {
            return self.to_board.clear();
        }
        let (due, left) =
            std::mem::take(&mut self.to_board).into_iter().partition(|burst| burst.due <= self.now);
        self.to_board = left;
        let due: Vec<super::Burst> = due;
        for burst in due {
            for packet in burst.bytes.chunks(64) {
                self.overhear(burst.user, packet);
                let Some(board) = &mut self.board else { return };
                board.links.receive(WAYS[burst.user], packet, &mut board.engine);
            }
        }
        let Some(board) = &mut self.board else { return };
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

    /// What a host says that could break a promise.
    fn overhear(&mut self, user: usize, mut bytes: &[u8]) {
        let mut reader = std::mem::take(&mut self.readers[user]);
        while let Read::Message(message, rest) = reader.read(bytes) {
            bytes = rest;
            match frame::decode::<ToBridge<'_>>(message) {
                Ok(ToBridge::Ask { what: Ask::Printer, .. }) if self.printer.holds_a_part() => {
                    self.endanger(Promise::NoQuestionInASheet, QUESTION);
                    self.endanger(Promise::NothingIntoAnotherSheet, QUESTION);
                }
                Ok(ToBridge::Begin { job, .. } | ToBridge::PrintStored { job, .. })
                    if self.known.get(&job).is_some_and(|known| known.begun > 0) =>
                {
                    self.endanger(Promise::NothingTwice, job);
                }
                Ok(ToBridge::Cancel { .. }) => self.cancel(),
                _ => {}
            }
        }
        self.readers[user] = reader;
    }

    /// The board's tasks, and the printer, for so many µs. The board may go down in the middle of them.
    pub(super) fn work(&mut self, down: Option<Down>, time_us: u64, draw: &mut Draw) {
        let status = self.printer.status(self.now);
        self.cable.answer(&status);
        let end_ns = self.cable.now() + time_us * 1000;
        let Some(board) = &mut self.board else {
            self.cable.pass(time_us * 1000);
            return;
        };
        if down == Some(Down::Cut) && draw.one_in_1000(500) {
            self.flash.cut_after(0);
        }
        for _ in 0..4 + draw.below(30) {
            if !board.engine.work() {
                break;
            }
        }
        for _ in 0..1 + draw.below(3) {
            if !board.alone.poll(&mut board.engine, self.now) {
                break;
            }
        }
        if self.flash.is_off() {
            // The supply went while something was written: the board did nothing behind that.
            self.ended();
            return self.stop(Down::Cut, 0, draw);
        }
        // One that goes down does so anywhere in its turn.
        let end_ns =
            if down.is_some() { end_ns - draw.below(time_us as usize * 1000) as u64 } else { end_ns };
        if down.is_some()
            && draw.one_in_1000(500)
            && let Some(board) = &mut self.board
        {
            board.ends_with_next_bytes();
        }
        while self.cable.now() < end_ns {
            self.poll();
            if self.board.as_ref().is_some_and(Board::is_over) {
                break;
            }
            let left_ns = end_ns.saturating_sub(self.cable.now());
            let pause_us = self.pause_us.clamp(20, (2 * MS).max(time_us / 4));
            self.cable.pass(left_ns.min(pause_us * 1000));
            let number = self.open_job().unwrap_or(QUESTION);
            self.cross(number);
        }
        if let Some(down) = down {
            self.ended();
            // RUN is pressed while bytes flow: the strobe of the last one is over, and its mark is not made
            // yet.
            let unmarked = u32::from(down == Down::Run && draw.one_in_1000(800));
            return self.stop(down, unmarked, draw);
        }
        self.answer();
        self.look_for_danger();
    }

    /// A poll of the driver, and what has come of it at the printer.
    fn poll(&mut self) {
        let Some(board) = &mut self.board else { return };
        let (number, before) = (board.engine.open_job(), board.engine.standing());
        self.pause_us = u64::from(board.poll());
        // What the processor strobes is a question; what the sender has strobed meanwhile is of the sheet.
        let number = number.filter(|&number| before == Standing::InSheet(number)).unwrap_or(QUESTION);
        self.cross(number);
        if self.cable.resets() != self.resets {
            self.resets = self.cable.resets();
            self.lose_part();
        }
        self.ended();
    }

    /// What has crossed reaches the printer, as a part of this job.
    fn cross(&mut self, number: u32) {
        let bytes = self.cable.drain();
        if bytes.is_empty() {
            return;
        }
        let is_other = self.printer.begins(number);
        if is_other && self.printer.holds_a_part() {
            let promise = match number {
                QUESTION => Promise::NoQuestionInASheet,
                _ => Promise::NothingIntoAnotherSheet,
            };
            let (owner, count) = (self.printer.owner, self.printer.since.len());
            self.fail(promise, format!("job {number:08x} behind {count} bytes of job {owner:08x}"));
        }
        if is_other {
            self.printer.begin(number);
            if number != QUESTION {
                self.begun.push(number);
            }
            if let Some(known) = self.known.get_mut(&number) {
                known.begun += 1;
                if known.begun > 1 {
                    let found = format!("job {number:08x} begins for the second time: {known:?}");
                    self.fail(Promise::NothingTwice, found);
                }
            }
        }
        self.printer.since.extend_from_slice(&bytes);
        if number == QUESTION {
            self.asked_at = self.now;
            if self.printer.since.len().is_multiple_of(2) {
                self.printer.since.clear();
            }
        }
    }

    /// Notes that a job asks for bytes while the printer has a part of another one.
    fn look_for_danger(&mut self) {
        let asks = self.board.as_ref().and_then(|board| {
            let progress = board.engine.progress();
            board.engine.open_job().filter(|_| progress.accepted > 0 && board.engine.storing().is_none())
        });
        let into = asks.filter(|&number| self.printer.owner != number && !self.printer.since.is_empty());
        if let Some(number) = into
            && self.asked_into != into
            && self.printer.holds_a_part()
        {
            self.endanger(Promise::NothingIntoAnotherSheet, number);
        }
        self.asked_into = into;
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
            for (due, bytes) in self.carry(frame) {
                self.to_host[user].push_back((due, bytes));
            }
        }
    }
}
