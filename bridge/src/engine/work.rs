//! From accepted data to printer bytes, and how a job ends.

use super::Engine;
use super::job::{Cancel, Phase, Way, positions};
use crate::streams::WRITE_ROOM;
use protocol::link::message::{Defect, DefectKind, JobKind, JobState, PastJob, Progress};

impl Engine<'_> {
    /// Does a slice of work, if there is any, and returns whether there may be more.
    pub fn work(&mut self) -> bool {
        let Some(job) = &self.job else { return false };
        if job.phase != Phase::Running || job.way == Way::ToStore || self.output.free() < WRITE_ROOM {
            return false;
        }
        let worked = match job.kind {
            JobKind::Raw => self.work_raw(),
            JobKind::Streams => self.work_streams(),
        };
        self.settle();
        self.begin_unnoted();
        worked
    }

    /// Whether the job's data are used up sooner than a few messages come, and there are more.
    pub(crate) fn runs_short(&self) -> bool {
        let more = self.job.as_ref().is_some_and(|job| job.accepted < job.length);
        more && self.data.len() < self.data.capacity() / 4
    }

    fn work_raw(&mut self) -> bool {
        let Some(job) = self.job else { return false };
        if job.must_stop() {
            if job.used > job.closed && job.used < job.settled && job.ends_at().is_none() {
                self.pass_command();
            } else {
                self.end_raw();
            }
            return true;
        }
        // Only whole commands go out, and none before the first row, so that the printer is not inside one wherever the
        // job ends, and gets nothing of one that breaks off before. A command longer than the queue has to go in pieces all the
        // same.
        let complete = job.accepted == job.length;
        let held = !self.ahead.has_rows() && (!complete || self.ahead.is_open());
        let stuck = self.data.free() == 0 && (held || job.settled <= job.used);
        let until = if stuck || self.ahead.is_foreign() {
            job.accepted
        } else if held {
            job.used
        } else {
            job.settled.max(job.used)
        };
        let until = job.ends_at().map_or(until, |at| at.min(until));
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
            job.closed = job.used + positions(closed);
        }
        job.used += positions(count);
        let position = self.sent.position();
        self.emit(count, Some(position));
    }

    /// Moves the rest of the command under way, all of which has been accepted, to the output.
    fn pass_command(&mut self) {
        for _ in 0..WRITE_ROOM {
            self.pass(1);
            if self.job.as_ref().is_none_or(|job| job.used == job.closed) || self.output.free() == 0 {
                return;
            }
        }
    }

    /// Ends a raw job: all of its data that go to the port have gone.
    fn end_raw(&mut self) {
        let Some(job) = &mut self.job else { return };
        let foreign = self.sent.is_foreign();
        let whole = job.used == job.length && !job.cut;
        let open = job.used > 0 && self.sent.is_open() && !foreign;
        let cancelled = job.cancel != Cancel::None;
        let state = match (whole && !open, cancelled) {
            // Even if cancelled: all of it was on its way.
            (true, _) => JobState::Done,
            (false, true) => JobState::Cancelled,
            (false, false) => JobState::Broken(Defect { at: job.accepted, what: DefectKind::Truncated }),
        };
        if cancelled {
            job.cancel = Cancel::Decided(job.used);
        }
        let needs_reset = job.used > 0 && state != JobState::Done && (foreign || job.used != job.closed);
        if open && !needs_reset {
            let ending = self.sent.ending();
            self.scratch[..ending.len()].copy_from_slice(&ending);
            self.emit(ending.len(), None);
        }
        self.finish(state, needs_reset);
    }

    fn work_streams(&mut self) -> bool {
        let Some(job) = &mut self.job else { return false };
        if job.must_stop() {
            job.cancel = Cancel::Decided(job.made);
            return self.end_streams(JobState::Cancelled);
        }
        let before = self.streams.position();
        match self.streams.work(self.data.front(), &mut self.scratch) {
            Ok(worked) => {
                self.data.pop(worked.used);
                job.used += positions(worked.used);
                let (used, accepted, length) = (job.used, job.accepted, job.length);
                let after = self.streams.position();
                // A mark every sixteen rows is enough to tell where the sheet is.
                if worked.written > 0 {
                    let marked = before.0 != after.0 || after.1.is_multiple_of(16);
                    self.emit(worked.written, marked.then_some(after));
                }
                if self.streams.ended() {
                    let excess = Defect { at: used, what: DefectKind::Excess };
                    let state = if used < length { JobState::Broken(excess) } else { JobState::Done };
                    self.finish(state, false);
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
        self.finish(state, false);
        true
    }

    /// Puts bytes of the scratch memory in the output, except those that crossed the port before a reset.
    fn emit(&mut self, count: usize, position: Option<(u8, u16)>) {
        let Some(job) = &mut self.job else { return };
        // What has been made falls short of what was printed and what waits by the bytes printed before a reset.
        let missing = (job.printed + positions(self.output.len())).saturating_sub(job.made);
        let skip = (missing as usize).min(count);
        job.made += positions(count);
        self.output.push(&self.scratch[skip..count]);
        if let Some(position) = position
            && job.made > job.printed
        {
            self.marks.push(job.made, position);
        }
    }

    /// Everything is in the output: the rest of the data does not matter.
    fn finish(&mut self, state: JobState, needs_reset: bool) {
        if let Some(job) = &mut self.job {
            job.phase = Phase::Ending { state, needs_reset };
        }
        self.data.clear();
        self.due.progress = true;
        self.settle();
    }

    /// Ends the job if its last byte has crossed the port.
    pub(super) fn settle(&mut self) {
        let Some(job) = &self.job else { return };
        if let Phase::Ending { state, needs_reset } = job.phase
            && self.output.is_empty()
        {
            // Of which no byte has crossed, it is as if it had not been. Behind a restart the printer may
            // have more than has been made again, and an end that fits that is no end of what it has.
            if (needs_reset || job.made < job.printed) && job.printed > 0 {
                self.standing.tear(job.id);
            } else {
                self.standing.end(job.id);
            }
            self.end(state);
            self.step_in();
        }
    }

    pub(super) fn end(&mut self, state: JobState) {
        let progress = self.progress();
        if let Some(job) = self.job.take() {
            self.last = Progress { state, limit: progress.accepted, ..progress };
            self.last_shape = (job.length > 0).then_some((job.kind, job.length));
            self.remember(PastJob { job: job.id, state, printed: progress.printed });
        }
        self.clear();
        self.held = false;
        self.due.progress = true;
    }
}
