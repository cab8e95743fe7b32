//! The server: its printers, its jobs, and what the one device behind them does.
//!
//! Method: one lock over all that changes. Whoever changes a job has it on disk before the lock is given back, so nobody is ever told of
//! a state that a restart would undo. One thread prints ([`crate::worker`]); it is woken when there is something to do.

mod data;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

pub use self::data::{Cartridge, Data, identities, identity};
use self::data::{Kept, keep, kept};
use crate::jobs::{Job, Owner, State, Store, StoreError, after_restart};
use crate::template::{Loaded, Ticket, paper, supported};
use crate::values::now;
use device::connection::Destination;
use device::printers::Printers;
use files::durable::{self, Access};
use inks::Library;
use make::options::Choices;
use observe::Observer;
use queue::backend;

/// The most jobs that wait.
pub const MOST_JOBS: usize = 500;

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
    /// What somebody elsewhere has to know to change things.
    pub code: String,
}

impl Settings {
    /// The name of this computer, without a domain.
    pub fn computer(&self) -> &str {
        self.hosts.first().map_or("localhost", |name| name.split('.').next().unwrap_or(name))
    }
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
    /// The most jobs wait already.
    #[error("{MOST_JOBS} jobs wait already; try again later")]
    Busy,
    /// No such sheet.
    #[error("the printer does not take such a sheet")]
    Sheet,
    /// The disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The disk.
    #[error("cannot keep the loaded sheet")]
    Disk(#[source] std::io::Error),
}

/// The server.
pub struct Server {
    /// What it was begun with.
    pub settings: Settings,
    /// Its jobs on disk.
    pub store: Store,
    data: Mutex<Data>,
    wake: Condvar,
    /// Held while a document is drawn: a page is 100 MB.
    pub drawing: Mutex<()>,
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
        let (store, mut jobs) = Store::open(&settings.folder.join("jobs"))?;
        for job in jobs.values_mut() {
            let before = job.clone();
            after_restart(job, now());
            if *job != before {
                store.save(job)?;
            }
            if job.state.is_over() {
                store.clear(job.id, false)?;
            }
        }
        let kept = kept(&settings.folder).map_err(file(&settings.folder))?;
        let data = Data {
            next: jobs.keys().next_back().map_or(1, |last| last + 1),
            jobs,
            heard: BTreeMap::new(),
            reasons: Vec::new(),
            message: String::new(),
            percent: None,
            cartridges: Vec::new(),
            kept,
            changed: now(),
            configured: now(),
            identify: 0,
        };
        Ok(Server {
            settings,
            store,
            data: Mutex::new(data),
            wake: Condvar::new(),
            drawing: Mutex::new(()),
            started: Instant::now(),
            observer,
            _lock: lock,
        })
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

    /// The identity of a printer, or of a job: the same after every start, and no other computer's.
    pub fn uuid(&self, of: &str) -> String {
        identity(&self.data(), of)
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
        if data.open() >= MOST_JOBS {
            return Err(ChangeError::Busy);
        }
        let id = data.next;
        let job = Job {
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

    /// A job's document comes, until what is given back is dropped. Time runs out between operations; each has limits of its own.
    pub fn receives(&self, id: u32) -> impl Drop + use<'_> {
        struct Receives<'a>(&'a Server, u32);
        impl Drop for Receives<'_> {
            fn drop(&mut self) {
                self.0.data().heard.insert(self.1, Some(now()));
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

    /// Ends a job: at once if nothing of it is on its way, else as soon as the device allows. A sheet that is open at the bridge
    /// from before a restart, or from before the job was held, is on its way.
    ///
    /// # Errors
    /// It is over, or there is none.
    pub fn cancel(&self, id: u32) -> Result<(), ChangeError> {
        let over = self.change(id, |job| match job.state {
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
        })?;
        if over {
            self.store.clear(id, false)?;
        }
        Ok(())
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
                (job.state, job.ticket.held) = (State::Pending, false);
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

    /// Somebody says which sheet is in the printer.
    ///
    /// # Errors
    /// The printer takes no such sheet, or it cannot be kept.
    pub fn load(&self, loaded: Loaded) -> Result<(), ChangeError> {
        let is_kind =
            loaded.kind == crate::template::AUTO || supported("media-type").any(|known| known == loaded.kind);
        if paper(loaded.size).is_none() || !is_kind {
            return Err(ChangeError::Sheet);
        }
        let mut data = self.data();
        let kept = Kept { loaded, ..data.kept.clone() };
        keep(&self.settings.folder.join("server.json"), &kept).map_err(ChangeError::Disk)?;
        (data.kept, data.configured, data.changed) = (kept, now(), now());
        Ok(())
    }

    /// Waits for the next job to print; it is processing then. The bridge has one sheet at a time, so the job whose sheet is open there
    /// goes before all others, and while it is held nobody goes.
    pub fn next(&self) -> Job {
        let mut data = self.data();
        loop {
            let mut jobs = data.jobs.values();
            let open =
                jobs.find(|job| matches!(job.state, State::Pending | State::Held) && self.is_open(job));
            let first = || data.jobs.values().find(|job| job.state == State::Pending);
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

    /// Ends jobs that have waited for their document since before this time, in seconds since 1970.
    pub fn time_out(&self, since: u64) {
        let late: Vec<u32> = {
            let mut data = self.data();
            let Data { jobs, heard, .. } = &mut *data;
            heard.retain(|id, _| jobs.get(id).is_some_and(|job| job.state == State::Incoming));
            let last = |job: &Job| heard.get(&job.id).copied().unwrap_or(Some(job.created));
            let late = |job: &&Job| last(job).is_some_and(|last| last < since);
            let incoming = jobs.values().filter(|job| job.state == State::Incoming);
            incoming.filter(late).map(|job| job.id).collect()
        };
        for id in late {
            let ended = self.change(id, |job| {
                (job.state, job.ended) = (State::Aborted, Some(now()));
                job.message = "the document did not come in time".into();
                Ok(())
            });
            // Tried again the next time.
            let _ = ended.and_then(|()| Ok(self.store.clear(id, false)?));
        }
    }
}
