//! From accepted data to printer bytes, and how a job comes to its end.

use super::Engine;
use super::job::Phase;
use crate::engine::Task;
use crate::streams::WRITE_ROOM;
use crate::track::ENDING_ROOM;
use protocol::link::message::{Defect, DefectKind, JobKind, JobState, Progress};

impl Engine<'_> {
    /// Does a slice of work, if there is some; true if there may be more.
    pub fn work(&mut self) -> bool {
        let Some(job) = &self.job else { return false };
        if job.phase != Phase::Running || self.output.free() < WRITE_ROOM {
            return false;
        }
        let worked = match job.kind {
            JobKind::Raw => self.work_raw(),
            JobKind::Streams => self.work_streams(),
        };
        self.settle();
        worked
    }

    fn work_raw(&mut self) -> bool {
        let Some(job) = &mut self.job else { return false };
        if job.must_stop() {
            if job.used > job.closed && job.used < job.settled && job.ends_at.is_none() {
                self.pass_command();
            } else {
                self.end_raw();
            }
            return true;
        }
        // Whole commands only, and none before the first row, so that wherever the job ends the printer is not
        // inside one. A command longer than the queue has to go in pieces all the same.
        let complete = job.accepted == job.length;
        let held = !complete && !self.ahead.has_rows();
        let stuck = self.data.free() == 0 && (held || job.settled <= job.used);
        let until = if stuck || self.ahead.is_foreign() {
            job.accepted
        } else if held {
            job.used
        } else {
            job.settled.max(job.used)
        };
        let until = job.ends_at.map_or(until, |at| at.min(until));
        if job.used < until {
            let count = (until - job.used) as usize;
            self.pass(count);
            return true;
        }
        if complete {
            self.end_raw();
        }
        complete
    }

    /// Moves at most so many bytes of a raw job to the output.
    fn pass(&mut self, count: usize) {
        let Some(job) = &mut self.job else { return };
        let front = self.data.front();
        let count = front.len().min(count).min(WRITE_ROOM);
        self.scratch[..count].copy_from_slice(&front[..count]);
        self.data.pop(count);
        if let Some(closed) = self.sent.follow(&self.scratch[..count]) {
            job.closed = job.used + closed as u32;
        }
        job.used += count as u32;
        let position = self.sent.position();
        self.emit(count, Some(position));
    }

    /// Moves the rest of the command under way, which has been accepted whole, to the output.
    fn pass_command(&mut self) {
        for _ in 0..WRITE_ROOM {
            self.pass(1);
            if self.job.as_ref().is_none_or(|job| job.used == job.closed) || self.output.free() == 0 {
                return;
            }
        }
    }

    /// Everything that will go to the port of a raw job has gone, but for its ending.
    fn end_raw(&mut self) {
        let Some(job) = &mut self.job else { return };
        let foreign = self.sent.is_foreign();
        let whole = job.used == job.length;
        let open = job.used > 0 && self.sent.is_open() && !foreign;
        let state = match (whole && !open, job.cancelled) {
            // Even if cancelled: all of it was on its way.
            (true, _) => JobState::Done,
            (false, true) => JobState::Cancelled,
            (false, false) => JobState::Broken(Defect { at: job.accepted, what: DefectKind::Truncated }),
        };
        if job.cancelled {
            job.ends_at = Some(job.used);
        }
        if job.used > 0 && state != JobState::Done && (foreign || job.used != job.closed) {
            self.needs_reset = true;
        } else if open {
            let mut ending = [0; ENDING_ROOM];
            let length = self.sent.ending(&mut ending);
            self.scratch[..length].copy_from_slice(&ending[..length]);
            self.emit(length, None);
        }
        self.finish(state);
    }

    fn work_streams(&mut self) -> bool {
        let Some(job) = &mut self.job else { return false };
        if job.must_stop() {
            job.ends_at = Some(job.made);
            return self.end_streams(JobState::Cancelled);
        }
        let before = self.streams.position();
        match self.streams.work(self.data.front(), &mut self.scratch) {
            Ok(worked) => {
                self.data.pop(worked.used);
                job.used += worked.used as u32;
                let (used, accepted, length) = (job.used, job.accepted, job.length);
                let after = self.streams.position();
                // A note every sixteen rows is enough to say where the sheet is.
                if worked.written > 0 {
                    let noted = before.0 != after.0 || after.1.is_multiple_of(16);
                    self.emit(worked.written, noted.then_some(after));
                }
                if self.streams.ended() {
                    let excess = Defect { at: used, what: DefectKind::Excess };
                    let state = if used < length { JobState::Broken(excess) } else { JobState::Done };
                    self.finish(state);
                    return true;
                }
                if !worked.progress && accepted == length && self.data.is_empty() {
                    let defect = Defect { at: length, what: DefectKind::Truncated };
                    return self.end_streams(JobState::Broken(defect));
                }
                worked.progress
            }
            Err(what) => {
                let defect = Defect { at: job.used, what };
                self.end_streams(JobState::Broken(defect))
            }
        }
    }

    fn end_streams(&mut self, state: JobState) -> bool {
        let length = self.streams.cancel(&mut self.scratch);
        self.emit(length, None);
        self.finish(state);
        true
    }

    /// Puts bytes of the scratch memory in the output, but for those that crossed the port before a reset.
    fn emit(&mut self, count: usize, position: Option<(u8, u16)>) {
        let Some(job) = &mut self.job else { return };
        // What is made lies behind what was printed and what waits; the difference was printed before a reset.
        let missing = (job.printed + self.output.len() as u32).saturating_sub(job.made);
        let skip = (missing as usize).min(count);
        job.made += count as u32;
        self.output.push(&self.scratch[skip..count]);
        if let Some(position) = position
            && job.made > job.printed
        {
            self.marks.push(job.made, position);
        }
    }

    /// All is in the output: the rest of the data is of no interest.
    fn finish(&mut self, state: JobState) {
        if let Some(job) = &mut self.job {
            job.phase = Phase::Ending(state);
        }
        self.data.clear();
        self.due.progress = true;
        self.settle();
    }

    /// Ends the job if its last byte has crossed the port.
    pub(super) fn settle(&mut self) {
        let Some(job) = &self.job else { return };
        if let Phase::Ending(state) = job.phase
            && self.output.is_empty()
        {
            let needs_reset = self.needs_reset;
            self.end(state);
            if needs_reset {
                self.owes_reset = true;
                self.assign(Task::Initialise);
            }
        }
    }

    pub(super) fn end(&mut self, state: JobState) {
        let progress = self.progress();
        if let Some(job) = self.job.take() {
            self.last = Progress { state, limit: progress.accepted, ..progress };
            self.last_shape = (job.length > 0).then_some((job.kind, job.length));
        }
        self.needs_reset = false;
        self.clear();
        self.due.progress = true;
    }
}
