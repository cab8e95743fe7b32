//! Storing jobs, and printing them with no host: what stands between the engine and the [`Store`].
//!
//! Problem: a job goes from the link into the flash, and from there to the printer, and the supply may go at
//! any instant of either.
//! Nothing may be lost but the sheet in the rollers, and a printer that waits for the rest of a row has to be
//! reset before anything else goes to it, whoever comes next and however long the supply was away.
//! Method: a poll does one thing at most: it answers a question, writes a page, or reads one. Storing goes on
//! only while nothing is printed, because the flash cannot be read while it is written, and the processor
//! stands still for that long.
//! Printing, whatever the job and its way, writes to the flash twice: before the first byte, and when the job
//! has ended. So the printer's state after a loss of the supply is known from the [diary](crate::store), and
//! after any other reset from memory, to the byte ([`crate::checkpoint`]); then the engine gets the data of a
//! stored job once more and leaves out what has crossed.
//! A store whose host is silent is dropped after [`SILENCE_US`], since it cannot be resumed and keeps all
//! others waiting.
//! Cost: a poll that writes takes as long as the flash does; all others stay well below a millisecond.
//! Limits: if the supply goes between the last byte of a job and the note that it has ended, some
//! milliseconds, the sheet counts as lost.

use crate::engine::{Engine, Request};
use crate::standing::Standing;
use crate::store::{End, Flash, Next, PAGE_DATA, Reading, Record, Store, Stored, Worn};
use protocol::link::message::{ALONE, JobState, Refusal, StoredJob};

/// For how long the host of a job that is being stored may say nothing of it. Source:
/// `docs/decisions/print-alone.md`.
pub const SILENCE_US: u64 = 30_000_000;

/// The store, its diary, and the job that is printed from it.
pub struct Alone<F> {
    store: Store<F>,
    run: Option<Run>,
    /// How often the host had spoken of the job that is being stored when it last did, and when that was.
    heard: (u32, u64),
}

/// A stored job that is being printed.
struct Run {
    job: u32,
    stored: Stored,
    reading: Reading,
}

impl<F: Flash> Alone<F> {
    /// Finds what is in the flash, and tells the engine what it has to know of it. `remembers` says whether
    /// the engine continues from a checkpoint, which then knows better. To be called before anything is sent.
    pub fn open(flash: F, engine: &mut Engine<'_>, remembers: bool) -> Self {
        let store = Store::open(flash);
        let mut alone = Alone { store, run: None, heard: (0, 0) };
        engine.set_stored(alone.store.jobs().len());
        for stored in alone.store.jobs() {
            engine.was_stored(stored.job);
        }
        if alone.store.keeps_diary() {
            engine.keep_diary();
        }
        if !remembers {
            alone.store.lost_before().for_each(|job| engine.was_lost(job));
        }
        match alone.store.noted() {
            Some(Record { job, end, .. }) if !remembers => {
                engine.wake(end.is_some(), if end == Some(End::Legal) { 0 } else { job });
            }
            Some(Record { job, stored, .. }) if engine.prints_from_store(job) => {
                if let Some(stored) = alone.find(|found| found.id() == stored) {
                    engine.resume_from_store(stored.kind, stored.length);
                    alone.run = Some(alone.begin(job, stored));
                }
            }
            _ => {}
        }
        if alone.run.is_none() {
            engine.lost_in_store();
        }
        alone
    }

    /// The store.
    pub fn store(&self) -> &Store<F> {
        &self.store
    }

    /// Does what is due, one thing at most; returns whether there may be more at once.
    pub fn poll(&mut self, engine: &mut Engine<'_>, now_us: u64) -> bool {
        if self.run.as_ref().is_some_and(|run| !engine.prints_from_store(run.job)) {
            self.run = None;
        }
        self.note(engine);
        if let Some(request) = engine.request() {
            self.serve(request, engine, now_us);
            return true;
        }
        if self.run.is_some() { self.feed(engine) } else { self.keep(engine, now_us) }
    }

    /// Notes which sheet the printer is in, or is about to be in, which may begin then.
    fn note(&mut self, engine: &mut Engine<'_>) {
        let begins = engine.waits_to_begin();
        match (&self.run, engine.standing()) {
            (Some(run), _) => self.store.note_begin(run.job, run.stored.id()),
            (None, Standing::InSheet(job)) => self.store.note_begin(job, 0),
            (None, Standing::AtRest) => match begins {
                Some(job) => self.store.note_begin(job, 0),
                None => {
                    let lost = self.store.noted().is_some_and(|last| engine.has_lost(last.job));
                    self.store.note_end(if lost { End::Reset } else { End::Legal });
                }
            },
            // A record without an end says so already.
            (None, Standing::Unknown { job, .. })
                if self.store.noted().is_some_and(|last| last.end.is_some()) =>
            {
                self.store.note_begin(job, 0);
            }
            (None, Standing::Unknown { .. }) => {}
        }
        if let Some(job) = begins {
            engine.begin_sheet(job);
        }
    }

    fn serve(&mut self, request: Request, engine: &mut Engine<'_>, now_us: u64) {
        match request {
            Request::Store { job, kind, length, name } => {
                if engine.open_job().is_some() {
                    engine.refuse_stored(Refusal::JobOpen, job);
                } else if !self.store.begin(job, kind, length, &name) {
                    engine.refuse_stored(Refusal::NoRoom, job);
                } else if !engine.open_for_store(job, kind, length) {
                    engine.refuse_stored(Refusal::Empty, job);
                }
                self.heard = (engine.words_of_store(), now_us);
            }
            Request::List { request, index } => self.tell(request, Some(index), engine),
            Request::Print { job, stored } => match self.find(|found| found.job == stored) {
                Some(found) => self.print(job, found, engine),
                None => engine.refuse_stored(Refusal::NoSuchJob, stored),
            },
            Request::PrintLast => {
                if let Some(&last) = self.store.jobs().last() {
                    self.print(ALONE, last, engine);
                }
            }
            // Nothing is written while bytes flow.
            Request::Delete { stored, .. } if engine.open_job().is_some() => {
                engine.refuse_stored(Refusal::JobOpen, stored);
            }
            Request::Delete { request, stored } => {
                if self.store.delete(stored) {
                    engine.set_stored(self.store.jobs().len());
                    self.tell(request, None, engine);
                } else {
                    engine.refuse_stored(Refusal::NoSuchJob, stored);
                }
            }
        }
    }

    /// Begins to print a job. That it is printed is written down before the engine has a byte of it.
    fn print(&mut self, job: u32, stored: Stored, engine: &mut Engine<'_>) {
        if engine.open_job().is_some() {
            return engine.refuse_stored(Refusal::JobOpen, job);
        }
        self.run = Some(self.begin(job, stored));
        self.note(engine);
        if !engine.open_from_store(job, stored.kind, stored.length) {
            self.run = None;
            engine.refuse_stored(Refusal::Empty, job);
        }
    }

    fn begin(&self, job: u32, stored: Stored) -> Run {
        Run { job, stored, reading: self.store.read(&stored) }
    }

    fn find(&self, which: impl Fn(&Stored) -> bool) -> Option<Stored> {
        self.store.jobs().iter().copied().find(which)
    }

    /// Answers a question.
    fn tell(&self, request: u16, index: Option<u8>, engine: &mut Engine<'_>) {
        let stored = index.and_then(|index| self.store.jobs().get(usize::from(index)));
        let name = stored.map(|stored| self.store.name(stored)).unwrap_or_default();
        let job =
            stored.map(|&Stored { job, kind, length, .. }| StoredJob { job, kind, length, name: &name });
        engine.tell_stored(request, self.store.room(), self.store.total(), job);
    }

    /// Gives the engine the next page of the job that is printed.
    fn feed(&mut self, engine: &mut Engine<'_>) -> bool {
        let Some(run) = &mut self.run else { return false };
        if engine.room_from_store() == 0 {
            return false;
        }
        let mut page = [0; PAGE_DATA];
        let mut ahead = run.reading;
        match self.store.next(&mut ahead, &mut page) {
            // All of the page or nothing: what is left of it would have to be kept.
            Next::Bytes(count) if engine.room_from_store() < count => return false,
            Next::Bytes(count) => engine.feed_from_store(&page[..count]),
            Next::Later => {}
            Next::Damaged => engine.end_from_store(),
            Next::End => return false,
        }
        run.reading = ahead;
        true
    }

    /// Writes the next page of the job that is stored; while there is none, what makes room for the diary.
    fn keep(&mut self, engine: &mut Engine<'_>, now_us: u64) -> bool {
        let Some(cancelled) = engine.storing() else {
            self.store.forget();
            let at_rest = engine.is_idle() && engine.standing() == Standing::AtRest;
            return at_rest && self.store.make_room();
        };
        if self.heard.0 != engine.words_of_store() {
            self.heard = (engine.words_of_store(), now_us);
        }
        if cancelled || now_us.saturating_sub(self.heard.1) >= SILENCE_US {
            self.store.forget();
            engine.stored(JobState::Cancelled);
            return true;
        }
        let mut page = [0; PAGE_DATA];
        let page = &mut page[..self.store.wants()];
        if page.is_empty() {
            // Nobody has begun it here.
            engine.not_stored();
            return true;
        }
        if !engine.take_for_store(page) {
            return false;
        }
        match self.store.put(page) {
            Ok(false) => {}
            Ok(true) => {
                engine.set_stored(self.store.jobs().len());
                engine.stored(JobState::Stored);
            }
            Err(Worn) => engine.not_stored(),
        }
        true
    }
}
