//! The server: its printers, its jobs, and what the one device behind them does.
//!
//! Method: one lock over all that changes. Whoever changes a job has it on disk before the lock is given
//! back, so nobody is ever told of a state that a restart would undo. One thread prints ([`crate::worker`]);
//! it is woken when there is something to do.

mod data;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub(crate) use self::data::key;
pub use self::data::{Cartridge, Data, identities, identity};
use self::data::{Kept, keep, kept};
use crate::access::{Asker, Deed, Permit, Refused, permit};
use crate::budget::{self, Client, Disk, Exceeded, Turns};
use crate::jobs::{Found, Job, Owner, State, Store, StoreError, Version, after_restart};
use crate::seen::Seen;
use crate::template::{Loaded, Size, Ticket, paper, supported};
use crate::values::now;
use device::connection::Destination;
use device::printers::Printers;
use files::durable::{self, Access};
use inks::Library;
use make::options::Choices;
use observe::Observer;
use queue::backend;
use queue::messages::Reason;

/// A printer: a preset under a name.
#[derive(Clone, Debug)]
pub struct Preset {
    /// Its name, and the last part of its address.
    pub name: String,
    /// What it is, for people.
    pub about: String,
    /// How it draws.
    pub choices: Choices,
}

/// What a server is made of.
pub struct Settings {
    /// Where sheets go. A file is a folder for them.
    pub to: Destination,
    /// The printers; the first is the one without a name.
    pub printers: Vec<Preset>,
    /// Where jobs are kept.
    pub folder: PathBuf,
    /// The inks.
    pub library: Library,
    /// What is known of devices.
    pub devices: Printers,
    /// The names under which this computer is asked for.
    pub hosts: Vec<String>,
    /// What this server is called where there are several.
    pub instance: Option<String>,
}

impl Settings {
    /// The name of this computer, without a domain.
    pub fn computer(&self) -> &str {
        self.hosts.first().map_or("localhost", |name| name.split('.').next().unwrap_or(name))
    }

    /// The same, and which of its servers this is.
    pub fn called(&self) -> String {
        called(self.computer(), self.instance.as_deref())
    }
}

/// What a computer is called in dialogs, and which of its servers.
pub fn called(computer: &str, instance: Option<&str>) -> String {
    [computer, instance.unwrap_or_default()].join(" ").trim_end().to_owned()
}

/// Why a server does not begin.
#[derive(Debug, thiserror::Error)]
pub enum BeginError {
    /// The folder of jobs.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A file beside them.
    #[error("{}: cannot be read or written", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: std::io::Error,
    },
    /// Another server.
    #[error("another server keeps its jobs in {}; stop it, or choose another folder with --jobs", .0.display())]
    Twice(PathBuf),
}

/// Why nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// No such job.
    #[error("there is no such job")]
    NoJob,
    /// Its state does not allow it.
    #[error("the job is {0}")]
    State(&'static str),
    /// Whoever asks has its share.
    #[error(transparent)]
    Share(#[from] Exceeded),
    /// No such sheet.
    #[error("the printer does not take such a sheet")]
    Sheet,
    /// A value that something cannot have.
    #[error("{0}")]
    Value(String),
    /// Somebody else was faster.
    #[error("somebody has changed it meanwhile; look at what it is now")]
    Stale,
    /// The disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The disk.
    #[error("cannot keep the loaded sheet")]
    Disk(#[source] std::io::Error),
}

/// How many documents stay that were printed.
const DOCUMENTS: usize = 20;

/// The server.
pub struct Server {
    /// What it was begun with.
    pub settings: Settings,
    /// Its jobs on disk.
    pub store: Store,
    data: Mutex<Data>,
    /// The sheet that somebody looks at.
    pub(crate) seen: Mutex<Option<Seen>>,
    wake: Condvar,
    /// Whose turn it is to draw.
    pub drawing: Turns,
    disk: Disk,
    /// When it began.
    pub started: Instant,
    /// Told what people at the terminal should know.
    pub observer: Box<dyn Observer + Send>,
    _lock: std::fs::File,
}

impl Server {
    /// Begins, with the jobs that an earlier process has left.
    ///
    /// # Errors
    /// What is on disk cannot be read or written.
    pub fn begin(settings: Settings, observer: Box<dyn Observer + Send>) -> Result<Server, BeginError> {
        let file = |path: &Path| {
            let path = path.to_path_buf();
            move |source| BeginError::File { path, source }
        };
        durable::make_folder(&settings.folder, Access::Private).map_err(file(&settings.folder))?;
        let path = settings.folder.join("lock");
        let lock = std::fs::File::create(&path).map_err(file(&path))?;
        if lock.try_lock().is_err() {
            return Err(BeginError::Twice(settings.folder));
        }
        let (store, Found { mut jobs, aside: unread, last }) = Store::open(&settings.folder.join("jobs"))?;
        let aside = unread.iter().map(|(path, why)| {
            format!(
                "a job could not be read ({why}) and lies in {}; nothing of it was printed since",
                path.display()
            )
        });
        let mut aside: Vec<String> = aside.collect();
        for job in jobs.values_mut() {
            let before = job.clone();
            after_restart(job, now());
            if *job != before {
                store.save(job)?;
            }
            match job.state {
                State::Completed => store.clear_sheets(job.id),
                state if state.is_over() => store.clear(job.id, false)?,
                _ => {}
            }
        }
        let disk = Disk::of_free(durable::free(&settings.folder));
        let kept = kept(&settings.folder, &mut aside).map_err(file(&settings.folder))?;
        aside.iter().for_each(|words| observer.note(words));
        let data = Data {
            next: last + 1,
            takes_any_sheet: matches!(settings.to, Destination::File(_)),
            jobs,
            heard: BTreeMap::new(),
            held: BTreeMap::new(),
            arriving: BTreeMap::new(),
            looking: BTreeSet::new(),
            reasons: Vec::new(),
            message: String::new(),
            percent: None,
            cartridges: Vec::new(),
            kept,
            aside,
            again: None,
            drawing: None,
            changed: now(),
            configured: now(),
            identify: 0,
            identified: None,
        };
        let server = Server {
            settings,
            store,
            data: Mutex::new(data),
            seen: Mutex::default(),
            wake: Condvar::new(),
            drawing: Turns::default(),
            disk,
            started: Instant::now(),
            observer,
            _lock: lock,
        };
        server.forget_documents(DOCUMENTS);
        Ok(server)
    }

    /// All that changes. Not kept while anything is waited for.
    pub fn data(&self) -> MutexGuard<'_, Data> {
        self.data.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A printer by the last part of its address; the first without one.
    pub fn printer(&self, name: &str) -> Option<&Preset> {
        match name {
            "" => self.settings.printers.first(),
            name => self.settings.printers.iter().find(|printer| printer.name == name),
        }
    }

    /// Lets somebody do something, perhaps to a job.
    ///
    /// # Errors
    /// The table of rights says no.
    pub fn permit<T: Into<Deed> + Copy>(
        &self,
        asked: T,
        asker: &Asker,
        job: Option<u32>,
    ) -> Result<Permit<T>, Refused> {
        let data = self.data();
        let job = job.and_then(|id| Some((id, &data.jobs.get(&id)?.owner)));
        permit(asked, asker, job)
    }

    /// What somebody elsewhere has to know to change things: the same after every start.
    pub fn code(&self) -> String {
        self.data().kept.code.clone()
    }

    /// Shows which printer this is; false if that was just done.
    pub fn identify(&self) -> bool {
        const AGAIN: Duration = Duration::from_secs(10);
        let mut data = self.data();
        let is_new = data.identified.is_none_or(|last| last.elapsed() >= AGAIN);
        if is_new {
            (data.identified, data.identify) = (Some(Instant::now()), now());
        }
        is_new
    }

    /// The identity of a printer, or of a job: the same after every start, and no other computer's.
    pub fn uuid(&self, of: &str) -> String {
        identity(&self.data(), of)
    }

    /// The job that is being drawn has so many sheets now; `None` when nothing is drawn any more.
    pub(crate) fn draws(&self, drawing: Option<(u32, usize)>) {
        self.data().drawing = drawing;
    }

    /// What the delivery knows of jobs.
    pub fn sent(&self) -> PathBuf {
        self.settings.folder.join("sent")
    }

    /// Whether a sheet of a job may be open at the bridge.
    pub fn is_open(&self, job: &Job) -> bool {
        job.begun.is_some() && backend::is_open(&self.settings.to, &self.sent().join(job.identity()))
    }

    /// Takes a job without its document.
    ///
    /// # Errors
    /// Too many wait, or it cannot be kept.
    pub fn create(
        &self,
        printer: &Preset,
        name: &str,
        owner: Owner,
        ticket: Ticket,
    ) -> Result<u32, ChangeError> {
        let mut data = self.data();
        let client = owner.client();
        budget::job(client, data.open(), data.open_of(client))?;
        let id = data.next;
        let job = Job {
            version: Version,
            id,
            printer: printer.name.clone(),
            name: name.into(),
            owner,
            ticket,
            document: None,
            format: "application/octet-stream".into(),
            octets: 0,
            state: State::Incoming,
            cancel: false,
            message: String::new(),
            created: now(),
            begun: None,
            ended: None,
            sheets: None,
            done: 0,
            laid: Vec::new(),
            is_cut: false,
            awaits_switch: false,
            round: 0,
            lies: None,
        };
        self.store.save(&job)?;
        data.next += 1;
        data.jobs.insert(id, job);
        data.changed = now();
        let Data { jobs, .. } = &mut *data;
        self.store.tidy(jobs)?;
        Ok(id)
    }

    /// Changes a job, and has that on disk.
    ///
    /// # Errors
    /// There is none, or it cannot be kept; then nothing has changed.
    pub fn change<T>(
        &self,
        id: u32,
        change: impl FnOnce(&mut Job) -> Result<T, ChangeError>,
    ) -> Result<T, ChangeError> {
        let mut data = self.data();
        let mut job = data.jobs.get(&id).ok_or(ChangeError::NoJob)?.clone();
        let done = change(&mut job)?;
        self.store.save(&job)?;
        data.jobs.insert(id, job);
        data.changed = now();
        drop(data);
        self.wake.notify_all();
        Ok(done)
    }

    /// Whether another job of a client is taken.
    pub fn accepts(&self, data: &Data, client: Client) -> bool {
        let (own, all) = data.octets(client);
        budget::job(client, data.open(), data.open_of(client)).is_ok()
            && self.disk.holds(client, own + 1, all + 1).is_ok()
    }

    /// A job's document that is arriving has so many bytes now.
    ///
    /// # Errors
    /// There is no room for them.
    pub fn reserve(&self, id: u32, octets: u64) -> Result<(), Exceeded> {
        let mut data = self.data();
        data.arriving.insert(id, octets);
        let client = data.jobs.get(&id).map_or(Client::Here, |job| job.owner.client());
        let (own, all) = data.octets(client);
        self.disk.holds(client, own, all)
    }

    /// Somebody looks at what would be printed, until what is given back is dropped; `None` if they do so
    /// already.
    pub fn looks(&self, client: Client) -> Option<impl Drop + use<'_>> {
        struct Looks<'a>(&'a Server, Client);
        impl Drop for Looks<'_> {
            fn drop(&mut self) {
                self.0.data().looking.remove(&self.1);
            }
        }
        let is_first = self.data().looking.insert(client) || !client.is_limited();
        is_first.then(|| Looks(self, client))
    }

    /// A job's document comes, until what is given back is dropped. Time runs out between operations; each
    /// has limits of its own.
    pub fn receives(&self, id: u32) -> impl Drop + use<'_> {
        struct Receives<'a>(&'a Server, u32);
        impl Drop for Receives<'_> {
            fn drop(&mut self) {
                let mut data = self.0.data();
                data.heard.insert(self.1, Some(Instant::now()));
                data.arriving.remove(&self.1);
            }
        }
        self.data().heard.insert(id, None);
        Receives(self, id)
    }

    /// A job's document is here: it waits for its turn, or until it is released.
    ///
    /// # Errors
    /// As [`Server::change`].
    pub fn arrived(&self, id: u32) -> Result<(), ChangeError> {
        self.change(id, |job| match (job.state, &job.document) {
            (State::Incoming, Some(_)) => {
                job.state = if job.ticket.held { State::Held } else { State::Pending };
                Ok(())
            }
            (State::Incoming, None) => {
                (job.state, job.ended) = (State::Aborted, Some(now()));
                job.message = "the job has no document".into();
                Ok(())
            }
            _ => Err(ChangeError::State("complete already")),
        })
    }

    /// A job whose document did not arrive is none.
    pub fn forget(&self, id: u32) {
        let mut data = self.data();
        // What cannot be removed now is removed at the next start.
        let _ = self.store.clear(id, true);
        data.jobs.remove(&id);
    }

    /// Ends a job: at once if nothing of it is on its way, else as soon as the device allows. A sheet that is
    /// open at the bridge from before a restart, or from before the job was held, is on its way. A full disk
    /// hinders nobody.
    ///
    /// # Errors
    /// It is over, or there is none.
    pub fn cancel(&self, id: u32) -> Result<(), ChangeError> {
        let cancel = |job: &mut Job| match job.state {
            state if state.is_over() => Err(ChangeError::State("over")),
            state if state == State::Processing || self.is_open(job) => {
                if state == State::Held {
                    job.state = State::Pending;
                }
                job.cancel = true;
                job.message = "cancelling".into();
                Ok(false)
            }
            _ => {
                (job.cancel, job.state, job.ended) = (true, State::Canceled, Some(now()));
                job.message = "cancelled".into();
                Ok(true)
            }
        };
        let over = match self.change(id, cancel) {
            Err(ChangeError::Store(_)) => {
                let mut data = self.data();
                let job = data.jobs.get_mut(&id).ok_or(ChangeError::NoJob)?;
                if cancel(job)? {
                    // Its document is removed first: that makes room, and then nothing can print it any more.
                    let job = job.clone();
                    self.store.clear(id, false)?;
                    self.store.save(&job)?;
                }
                data.changed = now();
                drop(data);
                self.wake.notify_all();
                false
            }
            changed => changed?,
        };
        if over {
            self.store.clear(id, false)?;
        }
        Ok(())
    }

    /// A job is over. Where the disk is full, what is not needed any more makes room for its record: its
    /// sheets, which can be drawn again, and of one that is not printed its document.
    ///
    /// # Errors
    /// It cannot be kept all the same.
    pub(crate) fn end(&self, id: u32, state: State, why: &str) -> Result<(), ChangeError> {
        let end = |job: &mut Job| {
            (job.state, job.ended) = (state, Some(now()));
            job.message = why.into();
            Ok(())
        };
        match self.change(id, end) {
            Err(ChangeError::Store(error)) if durable::is_full(&error) => {
                match state {
                    State::Completed => self.store.clear_sheets(id),
                    _ => self.store.clear(id, false)?,
                }
                self.change(id, end)
            }
            ended => ended,
        }?;
        match state {
            State::Completed => self.store.clear_sheets(id),
            _ => self.store.clear(id, false)?,
        }
        self.forget_documents(DOCUMENTS);
        Ok(())
    }

    /// Nothing is printed now.
    pub(crate) fn rests(&self) {
        let mut data = self.data();
        data.percent = None;
        data.message.clear();
        data.reasons.clear();
        data.changed = now();
    }

    /// A job that could not be kept waits again, and is tried after a while.
    pub(crate) fn try_again(&self, id: u32, why: &str, reason: Reason, after: Duration) {
        if reason == Reason::SpoolAreaFull {
            self.forget_documents(0);
        }
        let mut data = self.data();
        if let Some(job) = data.jobs.get_mut(&id).filter(|job| job.state == State::Processing) {
            // On disk it is as it was, which a restart takes for the same.
            (job.state, job.message) = (State::Pending, why.into());
        }
        data.message = why.into();
        data.reasons = vec![reason];
        data.again = Some(Instant::now() + after);
        data.changed = now();
    }

    /// Words without the places of this computer's files, which guests need not know.
    pub fn without_places(&self, text: &str) -> String {
        let mut places = vec![(self.settings.folder.as_path(), "the server's folder")];
        if let Destination::File(folder) = &self.settings.to {
            places.insert(0, (folder, "the folder of sheets"));
        }
        let absolute = places.into_iter().filter(|(place, _)| place.is_absolute());
        absolute.fold(text.to_owned(), |text, (place, name)| text.replace(&place.display().to_string(), name))
    }

    /// Holds a job that has not begun.
    ///
    /// # Errors
    /// It has, or there is none.
    pub fn hold(&self, id: u32) -> Result<(), ChangeError> {
        self.change(id, |job| match job.state {
            State::Held => Ok(()),
            State::Pending if !job.cancel && !self.is_open(job) => {
                (job.state, job.ticket.held) = (State::Held, true);
                Ok(())
            }
            State::Incoming => {
                job.ticket.held = true;
                Ok(())
            }
            _ => Err(ChangeError::State("not waiting")),
        })
    }

    /// Releases a job that is held.
    ///
    /// # Errors
    /// It is not, or there is none.
    pub fn release(&self, id: u32) -> Result<(), ChangeError> {
        self.change(id, |job| match job.state {
            State::Held => {
                (job.state, job.ticket.held, job.awaits_switch) = (State::Pending, false, false);
                job.message.clear();
                Ok(())
            }
            State::Incoming if job.ticket.held => {
                job.ticket.held = false;
                Ok(())
            }
            State::Pending => Ok(()),
            _ => Err(ChangeError::State("not held")),
        })
    }

    /// Somebody has switched the printer off and on: all jobs go on that were held for that.
    ///
    /// # Errors
    /// One of them cannot be kept.
    pub fn switched(&self) -> Result<(), ChangeError> {
        let held: Vec<u32> = self.data().await_switch().map(|job| job.id).collect();
        held.into_iter().try_for_each(|id| match self.release(id) {
            Err(ChangeError::State(_) | ChangeError::NoJob) => Ok(()),
            released => released,
        })
    }

    /// Somebody says which sheet is in the printer, its size or kind or both. `seen` is the
    /// [`Data::revision`] that they have looked at, if they have.
    ///
    /// # Errors
    /// The printer takes no such sheet, somebody else has said something meanwhile, or it cannot be kept.
    pub fn load(
        &self,
        (size, kind): (Option<Size>, Option<String>),
        seen: Option<u32>,
    ) -> Result<(), ChangeError> {
        let mut data = self.data();
        let revision = data.kept.revision;
        if seen.is_some_and(|seen| seen != revision) {
            return Err(ChangeError::Stale);
        }
        let is_any = size.is_some() || kind.is_some();
        let Loaded { size: was, kind: of } = data.loaded().clone();
        let loaded = Loaded { size: size.unwrap_or(was), kind: kind.unwrap_or(of) };
        let is_kind =
            loaded.kind == crate::template::AUTO || supported("media-type").any(|known| known == loaded.kind);
        if paper(loaded.size).is_none() || !is_kind || !is_any {
            return Err(ChangeError::Sheet);
        }
        let kept = Kept { loaded, revision: revision.wrapping_add(1), ..data.kept.clone() };
        keep(&self.settings.folder, &kept).map_err(ChangeError::Disk)?;
        (data.kept, data.configured, data.changed) = (kept, now(), now());
        drop(data);
        // A job may have waited for it.
        self.wake.notify_all();
        Ok(())
    }

    /// A job that waits for another sheet is laid on the one that is loaded.
    ///
    /// # Errors
    /// It does not wait, or it cannot be kept.
    pub fn lay_on_loaded(&self, id: u32) -> Result<(), ChangeError> {
        let loaded = self.data().loaded().clone();
        self.change(id, |job| match job.state {
            State::Pending | State::Held if !self.is_open(job) => {
                (job.ticket.size, job.ticket.kind) = (Some(loaded.size), Some(loaded.kind));
                job.is_drawn_again();
                Ok(())
            }
            _ => Err(ChangeError::State("not waiting")),
        })
    }

    /// Changes what a job asks for before it is printed, by names and values of the desk.
    ///
    /// # Errors
    /// It does not wait, or there is no such thing; then nothing has changed.
    pub fn edit(
        &self,
        id: u32,
        printer: Option<&Preset>,
        changes: &[(String, String)],
    ) -> Result<(), ChangeError> {
        self.change(id, |job| match job.state {
            State::Pending | State::Held if !self.is_open(job) && !job.cancel => {
                if let Some(printer) = printer {
                    job.printer.clone_from(&printer.name);
                }
                changes
                    .iter()
                    .try_for_each(|(name, value)| job.ticket.change(name, value))
                    .map_err(ChangeError::Value)?;
                job.is_drawn_again();
                Ok(())
            }
            _ => Err(ChangeError::State("not waiting")),
        })?;
        self.store.clear_sheets(id);
        Ok(())
    }

    /// A job that was printed, once more: another one with its document, which is held until somebody has
    /// looked at it.
    ///
    /// # Errors
    /// Its document is not there any more, or a new job cannot be kept.
    pub fn again(&self, id: u32, owner: Owner) -> Result<u32, ChangeError> {
        let job = self.data().jobs.get(&id).cloned().ok_or(ChangeError::NoJob)?;
        let gone =
            ChangeError::State("one whose document is not kept any more; print it again from its program");
        let Some(from) = self.store.document(&job) else { return Err(gone) };
        let printer = self
            .printer(&job.printer)
            .ok_or(ChangeError::State("for a printer that is not there any more"))?;
        let ticket = Ticket { held: true, ..job.ticket.clone() };
        let again = self.create(printer, &job.name, owner, ticket)?;
        let to = self.store.folder(again).join(from.file_name().unwrap_or_default());
        let kept = std::fs::hard_link(&from, &to).or_else(|_| std::fs::copy(&from, &to).map(|_| ()));
        let kept = kept.map_err(ChangeError::Disk).and_then(|()| {
            self.change(again, |new| {
                (new.document, new.octets) = (job.document.clone(), job.octets);
                new.format.clone_from(&job.format);
                Ok(())
            })?;
            self.arrived(again)
        });
        if kept.is_err() {
            self.forget(again);
        }
        kept.map(|()| again)
    }

    /// Removes the documents of jobs that were printed, but for the last `most` of them, and what documents
    /// may take then.
    pub(crate) fn forget_documents(&self, most: usize) {
        let printed: Vec<Job> = {
            let data = self.data();
            let printed = data.jobs.values().filter(|job| job.state == State::Completed);
            let mut printed: Vec<Job> = printed.cloned().collect();
            printed.sort_by_key(|job| std::cmp::Reverse((job.ended, job.id)));
            printed
        };
        let (mut octets, mut count) = (0, 0);
        for job in printed.iter().filter(|job| self.store.document(job).is_some()) {
            (octets, count) = (octets + job.octets, count + 1);
            if count > most || octets > self.disk.printed() {
                // What stays now is removed the next time.
                let _ = self.store.clear(job.id, false);
            }
        }
    }

    /// Waits for the next job to print; it is processing then. One for another sheet than the loaded one is
    /// passed by others. The bridge has one sheet at a time, so the job whose sheet is open there goes before
    /// all others, and while it is held nobody goes.
    pub fn next(&self) -> Job {
        let mut data = self.data();
        loop {
            if let Some(left) = Server::pause(&mut data) {
                data = self.wake.wait_timeout(data, left).unwrap_or_else(PoisonError::into_inner).0;
                continue;
            }
            let mut jobs = data.jobs.values();
            let open =
                jobs.find(|job| matches!(job.state, State::Pending | State::Held) && self.is_open(job));
            let can_print = |job: &&Job| job.state == State::Pending && !data.lacks_sheet(job);
            let first = || data.jobs.values().find(can_print);
            let next = open.or_else(first).filter(|job| job.state == State::Pending).cloned();
            if let Some(mut job) = next {
                job.state = State::Processing;
                job.begun.get_or_insert(now());
                if !job.cancel {
                    job.message.clear();
                }
                // If it cannot be saved it is printed all the same: a restart makes it pending again anyway.
                let _ = self.store.save(&job);
                data.jobs.insert(job.id, job.clone());
                data.changed = now();
                return job;
            }
            data = self.wake.wait(data).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Until when nothing is tried, if that is not over.
    fn pause(data: &mut Data) -> Option<Duration> {
        let left = data.again.and_then(|again| again.checked_duration_since(Instant::now()));
        if left.is_none() && data.again.take().is_some() {
            data.reasons.clear();
        }
        left
    }

    /// Ends jobs that have waited so long for their document, and those that have lain so long on the desk
    /// while the server ran.
    pub fn time_out(&self, document: Duration, held: Duration) {
        let now = Instant::now();
        let is_late = |since: Instant, most: Duration| now.duration_since(since) >= most;
        let (late, left): (Vec<u32>, Vec<u32>) = {
            let mut data = self.data();
            let Data { jobs, heard, held: lying, .. } = &mut *data;
            heard.retain(|id, _| jobs.get(id).is_some_and(|job| job.state == State::Incoming));
            let lies = |job: &Job| job.state == State::Held && job.ticket.held && job.owner.key.is_some();
            lying.retain(|id, _| jobs.get(id).is_some_and(lies));
            for job in jobs.values() {
                if job.state == State::Incoming {
                    heard.entry(job.id).or_insert(Some(now));
                } else if lies(job) {
                    lying.entry(job.id).or_insert(now);
                }
            }
            let late = heard.iter().filter(|(_, last)| last.is_some_and(|last| is_late(last, document)));
            let left = lying.iter().filter(|(_, since)| is_late(**since, held));
            (late.map(|(id, _)| *id).collect(), left.map(|(id, _)| *id).collect())
        };
        let ends = late.into_iter().map(|id| (id, State::Incoming, "the document did not come in time"));
        let ends = ends.chain(left.into_iter().map(|id| (id, State::Held, "nobody printed it within a day")));
        for (id, state, why) in ends {
            let ended = self.change(id, |job| {
                // Somebody may have released it just now.
                if job.state != state {
                    return Err(ChangeError::State("not waiting"));
                }
                (job.state, job.ended) = (State::Aborted, Some(crate::values::now()));
                job.message = why.into();
                Ok(())
            });
            // Tried again the next time.
            let _ = ended.and_then(|()| Ok(self.store.clear(id, false)?));
        }
    }
}
