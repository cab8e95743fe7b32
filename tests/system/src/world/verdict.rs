//! What has to hold when a job ends.

use super::World;
use crate::promises::{Promise, State};
use bridge::engine::LOCAL;
use bridge::printer_class::End;
use bridge::standing::Standing;
use model::is_a_whole_job;
use protocol::link::message::{ALONE, JobState, Progress};

impl World {
    /// Judges a job that has ended in this step.
    pub(super) fn ended(&mut self) {
        let Some(board) = &self.board else { return };
        let after = board.engine.progress();
        let owes = matches!(board.engine.standing(), Standing::Unknown { .. });
        let before = std::mem::replace(&mut self.before, after);
        let ends = |progress: &Progress| {
            !matches!(
                progress.state,
                JobState::None
                    | JobState::Printing
                    | JobState::Stopped(_)
                    | JobState::Cancelling
                    | JobState::Storing
            )
        };
        let number = after.job;
        // Between its first byte and its end the driver looks at least once.
        if !ends(&after) || before == after || number == 0 {
            return;
        }
        if after.state == JobState::Stored {
            return;
        }
        let part = self.printer.owner == number && !self.printer.since.is_empty();
        if self.known.get(&number).is_some_and(|known| known.stored) || number == ALONE {
            let what = (Promise::StoredIsWholeOrBroken, self.door(number), State::InSheet);
            if part {
                self.endangered.note(what.0, what.1, what.2);
            }
        }
        let expected = self.job(number).map(|job| &job.bytes[..]);
        let since = &self.printer.since;
        let told = format!(
            "job {number:08x} {:?} with {} bytes, the printer has {}",
            after.state,
            after.printed,
            if part { since.len() } else { 0 }
        );
        match after.state {
            // What was printed from the store by the button or by an operating system has only to be whole.
            JobState::Done => {
                let right = part
                    && match expected {
                        Some(expected) if number != LOCAL => since == expected,
                        _ => is_a_whole_job(since),
                    };
                if !right {
                    let promise = match self.known.get(&number) {
                        Some(known) if known.stored => Promise::StoredIsWholeOrBroken,
                        _ if number == ALONE => Promise::StoredIsWholeOrBroken,
                        _ => Promise::PrintedIsAtThePrinter,
                    };
                    self.fail(promise, told);
                }
            }
            JobState::Cancelled | JobState::Broken(_) if part && !owes && !is_a_whole_job(since) => {
                self.fail(Promise::EndedSheetIsLegal, told);
            }
            _ => {}
        }
        if part && is_a_whole_job(&self.printer.since) {
            let out_at = self.printer.whole(self.now);
            if after.state == JobState::Done
                && let Some(known) = self.known.get_mut(&number)
            {
                known.whole += 1;
                known.out_at = out_at;
            }
        }
        if number == LOCAL && after.state != JobState::Done {
            // Whoever prints sees that, takes the rest back and resets the interface.
            self.plain = None;
            if let Some(board) = &mut self.board {
                board.intake.end(End::Reset, &mut board.engine, self.now);
            }
        }
    }
}
