//! What the engine has to do with the store and with the button: jobs that go to the flash, jobs that come from it, and a job that
//! somebody holds.
//!
//! A job goes to the store through the same window as a job for the port, and comes from it into that window; what is made of
//! it at the port is made by the same code. Between the engine and the store stands [`crate::alone`].

use super::job::{Cancel, Job, Phase, Way, positions};
use super::{ALONE, Engine, LOCAL};
use crate::button::Press;
use heapless::String;
use protocol::link::message::{
    Defect, DefectKind, JobKind, JobState, NAME_MAX, PastJob, Refusal, StoredJob, ToHost,
};

/// What the store has to do.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Request {
    /// Take a job.
    Store {
        /// The job.
        job: u32,
        /// The kind of its data.
        kind: JobKind,
        /// Their length.
        length: u32,
        /// What people call it.
        name: String<NAME_MAX>,
    },
    /// Tell of a stored job.
    List {
        /// Number of the question.
        request: u16,
        /// Which one.
        index: u8,
    },
    /// Print a stored job.
    Print {
        /// The number of the job at the printer.
        job: u32,
        /// The number it was stored under.
        stored: u32,
    },
    /// Print the job that was stored last.
    PrintLast,
    /// Delete a stored job.
    Delete {
        /// Number of the question.
        request: u16,
        /// The number it was stored under.
        stored: u32,
    },
}

impl Engine<'_> {
    /// What the store has to do, once.
    pub fn request(&mut self) -> Option<Request> {
        self.request.take()
    }

    /// Asks the store for something. If it has not done the last thing yet, the host repeats itself.
    pub(super) fn ask_store(&mut self, request: Request) {
        if self.request.is_none() {
            self.request = Some(request);
        }
    }

    pub(super) fn have_stored(&mut self, job: u32, kind: JobKind, length: u32, name: &str) {
        match name.try_into() {
            Ok(name) => self.ask_store(Request::Store { job, kind, length, name }),
            Err(_) => self.refuse(Refusal::Unknown, job),
        }
    }

    /// Whether a host may have a stored job printed under this number now. If not, it is told where that one stands.
    pub(super) fn may_print(&mut self, id: u32) -> bool {
        self.due.progress = true;
        if id == 0 || id >= ALONE {
            self.refuse(Refusal::Empty, id);
        } else if let Some(job) = &self.job {
            if job.id != id {
                self.refuse(Refusal::JobOpen, id);
            }
        } else if self.last.job != id {
            if self.remembered(id).is_none() {
                return true;
            }
            self.due.past = true;
        }
        false
    }

    /// The store does not do what this job would need.
    pub fn refuse_stored(&mut self, reason: Refusal, job: u32) {
        self.refuse(reason, job);
    }

    /// The store takes this job. False if another one is open.
    pub fn open_for_store(&mut self, job: u32, kind: JobKind, length: u32) -> bool {
        self.due.progress = true;
        self.job.is_none() && self.open(job, kind, length, Way::ToStore)
    }

    /// Whether a job is being stored, and then whether it is to be given up.
    pub fn storing(&self) -> Option<bool> {
        let job = self.job.as_ref().filter(|job| job.way == Way::ToStore)?;
        Some(job.cancel != Cancel::None)
    }

    /// How often the host has spoken of the job that is being stored; the count may wrap.
    pub fn words_of_store(&self) -> u32 {
        self.words_of_store
    }

    /// Moves the next bytes of the job that is being stored; false if not all of them are there.
    pub fn take_for_store(&mut self, out: &mut [u8]) -> bool {
        let Some(job) = self.job.as_mut().filter(|job| job.way == Way::ToStore) else { return false };
        if self.data.len() < out.len() {
            return false;
        }
        let mut at = 0;
        while at < out.len() {
            let front = self.data.front();
            let count = front.len().min(out.len() - at);
            out[at..at + count].copy_from_slice(&front[..count]);
            self.data.pop(count);
            at += count;
        }
        job.used += positions(out.len());
        true
    }

    /// The job that is being stored has ended like this.
    pub fn stored(&mut self, state: JobState) {
        if self.storing().is_some() {
            self.end(state);
        }
    }

    /// The job that is being stored ends because the flash does not keep it.
    pub fn not_stored(&mut self) {
        if let Some(job) = &self.job {
            let defect = Defect { at: job.used, what: DefectKind::Flash };
            self.stored(JobState::Broken(defect));
        }
    }

    /// Opens a job whose data come from the store. False if another one is open, or there is no memory for any.
    pub fn open_from_store(&mut self, job: u32, kind: JobKind, length: u32) -> bool {
        self.due.progress = true;
        self.job.is_none() && self.open(job, kind, length, Way::FromStore)
    }

    /// The job that was open at a reset of the board comes from the store, and does so again from its beginning.
    pub fn resume_from_store(&mut self, kind: JobKind, length: u32) {
        if let Some(job) = self.job.as_mut().filter(|job| job.phase == Phase::Unknown) {
            (job.kind, job.length, job.way, job.phase) = (kind, length, Way::FromStore, Phase::Running);
            self.due.progress = true;
        }
    }

    /// The job that was open at a reset of the board came from the store, and is not there any more.
    pub fn lost_in_store(&mut self) {
        let is_lost = |job: &&mut Job| job.way == Way::FromStore && job.phase == Phase::Unknown;
        if let Some(job) = self.job.as_mut().filter(is_lost) {
            job.phase = Phase::Running;
            self.end_from_store();
        }
    }

    /// Whether this job is open and its data come from the store.
    pub fn prints_from_store(&self, id: u32) -> bool {
        self.job.as_ref().is_some_and(|job| job.id == id && job.way == Way::FromStore)
    }

    /// How many bytes the job from the store takes now.
    pub fn room_from_store(&self) -> usize {
        match &self.job {
            Some(job) if job.way == Way::FromStore && job.phase == Phase::Running => {
                self.data.free().min((job.length - job.accepted) as usize)
            }
            _ => 0,
        }
    }

    /// The next bytes of the job from the store, no more than it takes.
    pub fn feed_from_store(&mut self, bytes: &[u8]) {
        self.accept(&bytes[..bytes.len().min(self.room_from_store())]);
    }

    /// The store has lost the rest of the job. It ends early, as one whose data are not complete.
    pub fn end_from_store(&mut self) {
        if let Some(job) = self.job.as_mut().filter(|job| job.way == Way::FromStore) {
            (job.length, job.cut) = (job.accepted, true);
        }
    }

    /// The job that is open, whatever its way.
    pub fn open_job(&self) -> Option<u32> {
        self.job.as_ref().map(|job| job.id)
    }

    /// This job was in the store already when the board was reset, and that it was is not remembered.
    pub fn was_stored(&mut self, id: u32) {
        if self.last.job == id && self.last.state == JobState::Cancelled {
            self.last.state = JobState::Stored;
            if let Some(past) = self.past.iter_mut().find(|past| past.job == id) {
                past.state = JobState::Stored;
            }
        }
    }

    /// Whether there are bytes for the printer, which it does not take yet.
    pub fn waits_for_printer(&self) -> bool {
        self.job.is_some() && !self.output.is_empty()
    }

    /// The button was pressed: it starts the job that was stored last, holds the open one, lets it go on, or cancels it.
    pub fn press(&mut self, press: Press) {
        match (press, &self.job) {
            (Press::Short, None) => self.ask_store(Request::PrintLast),
            (Press::Short, Some(job)) if job.way != Way::ToStore && job.cancel == Cancel::None => {
                self.held = !self.held;
            }
            (Press::Long, Some(job)) => self.cancel(job.id),
            (Press::Short, Some(_)) | (Press::Long, None) => {}
        }
        self.due.progress = true;
    }

    /// So many jobs are in the store.
    pub fn set_stored(&mut self, count: usize) {
        self.stored = count;
    }

    /// How many jobs are in the store.
    pub fn stored_jobs(&self) -> usize {
        self.stored
    }

    /// What the store says of itself and of one of its jobs, for the host that asked. While another answer waits to be sent this one
    /// is dropped, and the host repeats its question.
    pub fn tell_stored(&mut self, request: u16, room: u32, total: u32, job: Option<StoredJob<'_>>) {
        if self.frame.is_empty() {
            let count = u8::try_from(self.stored).unwrap_or(u8::MAX);
            self.prepare(&ToHost::Stored { request, count, room, total, job });
        }
    }

    /// Notes how a job of the link has ended.
    pub(super) fn remember(&mut self, past: PastJob) {
        if past.job != LOCAL && past.job != ALONE {
            self.past.rotate_right(1);
            self.past[0] = past;
        }
    }
}
