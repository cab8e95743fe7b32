//! What goes wrong in a step, and what a wire makes of a burst.

use super::{Down, MS, SECTORS, USERS, World};
use crate::chance::{Draw, Kind};
use crate::pool;
use bridge::button::Press;

impl World {
    /// What goes wrong in this step.
    pub(super) fn accidents(&mut self) -> (Option<Down>, Draw) {
        if let Some(mut draw) = self.chance.happens(Kind::Unplug) {
            self.pulled_until = self.now + draw.below(3_000) as u64 * MS;
            self.unplug();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Kill) {
            let user = draw.below(USERS);
            self.doomed[user] = self.runs[user];
        }
        if let Some(mut draw) = self.chance.happens(Kind::PaperOut) {
            self.printer.paper_out_until = self.now + draw.below(4_000) as u64 * MS;
        }
        if let Some(mut draw) = self.chance.happens(Kind::Age) {
            self.harmed = true;
            let (mut byte, bit) = (draw.below(SECTORS * 4096), draw.below(8) as u8);
            if draw.one_in_1000(500) {
                // In the first page of a job, if this is the first of its sectors.
                byte = byte / 4096 * 4096 + 2 * 256 + byte % 256;
            }
            self.flash.flip(byte, bit);
        }
        if self.chance.happens(Kind::Forge).is_some() {
            self.forge();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Press)
            && let Some(board) = &mut self.board
        {
            self.harmed = true;
            let press = if draw.one_in_1000(300) { Press::Long } else { Press::Short };
            if press == Press::Long
                && let Some(known) = board.engine.open_job().and_then(|number| self.known.get_mut(&number))
            {
                known.cancelled = true;
            }
            board.engine.press(press);
        }
        if self.plain.is_none()
            && self.board.is_some()
            && self.pulled_until <= self.now
            && let Some(mut draw) = self.chance.happens(Kind::Plain)
        {
            self.plain = Some((draw.below(pool::SIZE), 0));
        }
        for (kind, how) in [(Kind::Watchdog, Down::Watchdog), (Kind::Run, Down::Run), (Kind::Cut, Down::Cut)]
        {
            if let Some(draw) = self.chance.happens(kind) {
                self.harmed |= how != Down::Watchdog;
                return (Some(how), draw);
            }
        }
        // A printer that is off only while the board restarts is one that nobody has seen off; so is one that
        // goes off in the very turn in which the board goes down, for that turn leaves no mark.
        if self.board.is_some()
            && let Some(mut draw) = self.chance.happens(Kind::SwitchOff)
        {
            self.harmed = true;
            self.printer.off_until = self.now + (50 + draw.below(4_000) as u64) * MS;
            self.printer.reset();
        }
        (None, Draw::new(self.seed ^ self.step))
    }

    /// A user who may not open the bridge writes that every job is closed.
    fn forge(&mut self) {
        let Ok(listing) = std::fs::read_dir(&self.notes) else { return };
        for name in listing.filter_map(|item| item.ok()?.file_name().into_string().ok()) {
            if let Some(rest) = name.strip_prefix("open.") {
                let path = self.notes.join(format!("closed.{rest}.1"));
                if std::fs::copy(self.notes.join(&name), &path).is_ok() {
                    crate::users::give_to_stranger(&path);
                }
            }
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
