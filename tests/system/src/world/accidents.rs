//! What goes wrong in a step, and what a wire makes of a burst.

use super::{Down, MS, SECTORS, USERS, World};
use crate::chance::{Draw, Kind};
use crate::pool;
use crate::promises::{Promise, State};
use bridge::button::Press;
use bridge::simulation::{Line, Pause};

impl World {
    /// What goes wrong in this step.
    pub(super) fn accidents(&mut self) -> (Option<Down>, Draw) {
        if let Some(mut draw) = self.chance.happens(Kind::Unplug) {
            self.pulled_until = self.now + draw.below(3_000) as u64 * MS;
            self.harmless();
            self.unplug();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Kill) {
            let user = draw.below(USERS);
            self.doomed[user] = self.runs[user];
            self.harmless();
        }
        if let Some(mut draw) = self.chance.happens(Kind::PaperOut) {
            let ms = draw.below(4_000) as u64;
            if !self.is_off {
                self.cable.plan(0, Line::PaperOut, 1);
                self.cable.plan(ms * 1_000_000, Line::PaperOut, 0);
            }
        }
        if let Some(mut draw) = self.chance.happens(Kind::Age) {
            self.aged = true;
            let (mut byte, bit) = (draw.below(SECTORS * 4096), draw.below(8) as u8);
            if draw.one_in_1000(500) {
                // In the first page of a job, if this is the first of its sectors.
                byte = byte / 4096 * 4096 + 2 * 256 + byte % 256;
            }
            self.flash.flip(byte, bit);
        }
        if let Some(mut draw) = self.chance.happens(Kind::Press)
            && self.board.is_some()
        {
            self.touch(true);
            let press = if draw.one_in_1000(300) { Press::Long } else { Press::Short };
            if press == Press::Long {
                self.cancel();
            }
            if let Some(board) = &mut self.board {
                board.engine.press(press);
            }
        }
        if self.plain.is_none()
            && self.board.is_some()
            && self.pulled_until <= self.now
            && let Some(mut draw) = self.chance.happens(Kind::Plain)
        {
            self.plain = Some((draw.below(pool::SIZE), 0));
        }
        if self.board.is_some()
            && let Some(mut draw) = self.chance.happens(Kind::HalfAsked)
        {
            // The next printer that is asked takes a byte of the question, and then has something else to do.
            let (line, ms) = ([Line::Busy, Line::PaperOut][draw.below(2)], 1 + draw.below(4_000) as u64);
            self.cable.pause(Pause { after: 1, line, ns: ms * 1_000_000 });
        }
        // A printer that is switched off only while the board restarts is one that nobody has seen off; and
        // until the board has seen it off, it does not restart.
        let unseen = self.printer.off_until > self.now && !self.has_seen_it_off();
        for (kind, how) in [(Kind::Watchdog, Down::Watchdog), (Kind::Run, Down::Run), (Kind::Cut, Down::Cut)]
        {
            if !unseen
                && self.board.is_some()
                && let Some(draw) = self.chance.happens(kind)
            {
                if how == Down::Watchdog {
                    self.harmless();
                } else {
                    self.touch(true);
                }
                return (Some(how), draw);
            }
        }
        if let Some(mut draw) = self.chance.happens(Kind::SwitchOff) {
            // Where the board is down it is the cable that was pulled: what the printer has it keeps.
            let forgets = self.board.is_some() && draw.one_in_1000(500);
            self.printer.off_until = self.now + (50 + draw.below(4_000) as u64) * MS;
            self.touch(true);
            self.supply(true);
            if forgets {
                self.lose_part();
            }
        }
        (None, Draw::new(self.seed ^ self.step))
    }

    /// What costs nothing happens to the job that is open.
    fn harmless(&mut self) {
        if let Some(number) = self.open_job() {
            self.touch(false);
            if self.known.contains_key(&number) {
                self.endanger(Promise::HarmlessCostsNothing, number);
            }
        }
    }

    /// Somebody wants the open job to end early.
    pub(super) fn cancel(&mut self) {
        let Some(number) = self.open_job() else { return };
        if let Some(known) = self.known.get_mut(&number) {
            known.cancelled = true;
        }
        // Jobs without a number of their own share one, so that the printer's part may be of an earlier one.
        let is_own = self.known.contains_key(&number) || self.state() == State::InSheet;
        if is_own && self.printer.owner == number && self.printer.holds_a_part() {
            self.endanger(Promise::EndedSheetIsLegal, number);
        }
    }

    /// Whether the board has seen the printer without its supply, and takes nothing for granted any more.
    fn has_seen_it_off(&self) -> bool {
        self.state() == State::Unknown
    }

    /// The printer's supply is at the port, or not.
    pub(super) fn supply(&mut self, off: bool) {
        if self.is_off != off {
            self.is_off = off;
            self.cable.switch(!off);
        }
    }

    /// What a wire makes of a burst.
    pub(super) fn carry(&mut self, mut bytes: Vec<u8>) -> Vec<(u64, Vec<u8>)> {
        let mut due = self.now + MS;
        if self.chance.happens(Kind::Lose).is_some() {
            return Vec::new();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Flip) {
            let at = draw.below(bytes.len());
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << draw.below(8);
            }
        }
        if let Some(mut draw) = self.chance.happens(Kind::Late) {
            due += draw.below(900) as u64 * MS;
        }
        if self.chance.happens(Kind::Double).is_some() {
            return vec![(due, bytes.clone()), (due, bytes)];
        }
        vec![(due, bytes)]
    }
}
