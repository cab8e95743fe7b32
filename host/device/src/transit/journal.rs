//! Jobs on disk: what has to survive `kill -9`, a crash and an empty battery.
//!
//! A folder for each job, named by its number: `data`, the bytes, and `job.json`, where it stands. A job appears
//! whole or not at all, and so does every change of `job.json` ([`durable`]).
//! The bytes are removed when the job has ended; the last records stay, so that a user who asks is told how it ended.
//! A lock on the folder keeps two processes from sending the same job. What a job may have left in the printer is no matter of
//! one user's journal: see [`crate::printers`].
//!
//! Cost: two file syncs for each saved step; [`run`](super::run()) saves at the steps that matter and once a second.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use protocol::link::frame::checksum;
use protocol::link::message::{ALONE, JobKind};
use serde::{Deserialize, Serialize};

use super::record::{Phase, Record};
use crate::encodings::PassPlace;
use files::durable::{self, Access, STAGED};
use files::scratch::private;

/// Ended jobs whose records are kept.
const KEPT: usize = 20;
/// A record is far smaller.
const LARGEST_RECORD: u64 = 1 << 20;

/// What the journal knows of a job.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// What people call it.
    pub name: String,
    /// Where it goes, as an [`Address`](crate::connection::Address) is written.
    pub to: String,
    /// When it was queued, in seconds since 1970.
    pub queued: u64,
    /// Its bytes at the port.
    pub port_bytes: u64,
    /// Its passes.
    pub passes: Vec<PassPlace>,
    /// CRC-32 of the data.
    pub checksum: u32,
    /// Where it stands.
    pub record: Record,
}

/// Why the journal cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// No place for it.
    #[error("no folder for jobs: set HOME, or FOILPRESS_JOBS to a folder of your choice")]
    NoFolder,
    /// The file system says no.
    #[error("cannot {what} {}", path.display())]
    Io {
        /// What was tried.
        what: &'static str,
        /// With what.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// Not what was written.
    #[error("{}: {what}; remove the folder to forget the job, and switch the printer off and on if it was printing", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// Another process is at it.
    #[error("another process is sending job {0:08x}; wait for it or stop it first")]
    Locked(u32),
    /// No such job.
    #[error("there is no job {0:08x}")]
    NoSuchJob(u32),
    /// It has ended.
    #[error("job {0:08x} has ended; there is nothing to resume")]
    Ended(u32),
}

fn io_error(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> JournalError {
    let path = path.to_path_buf();
    move |source| JournalError::Io { what, path, source }
}

/// The folder of all jobs.
#[derive(Clone, Debug)]
pub struct Journal {
    folder: PathBuf,
}

/// A job that this process, and no other, may send.
#[derive(Debug)]
pub struct OpenJob {
    folder: PathBuf,
    /// What is known of it; [`OpenJob::save`] keeps its record.
    pub entry: Entry,
    /// Its data.
    pub data: Vec<u8>,
    _lock: File,
}

/// What is to be queued.
#[derive(Clone, Debug)]
pub struct NewJob<'a> {
    /// What people call it.
    pub name: &'a str,
    /// Where it goes.
    pub to: String,
    /// What the data are.
    pub kind: JobKind,
    /// The data, not empty.
    pub data: &'a [u8],
    /// Bytes at the port.
    pub port_bytes: u64,
    /// The passes.
    pub passes: Vec<PassPlace>,
}

/// A number for a job that no other job of this or another computer has: time, process, content and place say so well enough, and a
/// bridge that knows the number as another job's refuses it. All are equally long on the link.
pub fn fresh_number(content: u32, place: &[u8]) -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let seed =
        [&now.as_nanos().to_le_bytes()[..], &std::process::id().to_le_bytes(), &content.to_le_bytes(), place]
            .concat();
    const LEAST: u32 = 1 << 28;
    LEAST + protocol::link::frame::checksum(&seed) % (ALONE - LEAST)
}

impl Journal {
    /// The user's journal: `FOILPRESS_JOBS`, or `foilpress/jobs` where the system keeps programs' state.
    pub fn of_user() -> Result<Journal, JournalError> {
        let var = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let home = |under: &str| var("HOME").map(|home| home.join(under));
        let state = if cfg!(windows) {
            var("LOCALAPPDATA")
        } else if cfg!(target_os = "macos") {
            home("Library/Application Support")
        } else {
            var("XDG_STATE_HOME").or_else(|| home(".local/state"))
        };
        let folder =
            var("FOILPRESS_JOBS").or_else(|| state.map(|state| state.join("foilpress").join("jobs")));
        Journal::at(&folder.ok_or(JournalError::NoFolder)?)
    }

    /// The journal in this folder, which is made if need be.
    pub fn at(folder: &Path) -> Result<Journal, JournalError> {
        durable::make_folder(folder, Access::Private).map_err(io_error("make the folder", folder))?;
        Ok(Journal { folder: folder.to_path_buf() })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Queues a job under a new number. When this returns the job is on disk.
    pub fn queue(&self, job: NewJob<'_>) -> Result<OpenJob, JournalError> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let staged = private(tempfile::Builder::new().prefix(STAGED))
            .tempdir_in(&self.folder)
            .map_err(io_error("write in", &self.folder))?;
        let checksum = checksum(job.data);
        let data = staged.path().join("data");
        durable::write(&data, job.data, Access::Private).map_err(io_error("write", &data))?;
        let mut number = fresh_number(checksum, self.folder.as_os_str().as_encoded_bytes());
        while self.folder_of(number).exists() {
            // 0 is no job.
            number = ((number + 1) % ALONE).max(1);
        }
        let entry = Entry {
            name: job.name.into(),
            to: job.to,
            queued: now.as_secs(),
            port_bytes: job.port_bytes,
            passes: job.passes,
            checksum,
            // Callers refuse data that do not fit the link's offsets.
            record: Record::new(number, job.kind, job.data.len() as u32),
        };
        write_entry(staged.path(), &entry)?;
        let folder = self.folder_of(number);
        durable::place(staged.path(), &folder).map_err(io_error("write", &folder))?;
        let lock = lock(&folder, number)?;
        Ok(OpenJob { folder, entry, data: job.data.to_vec(), _lock: lock })
    }

    /// A job that is not over, to go on with.
    pub fn open(&self, job: u32) -> Result<OpenJob, JournalError> {
        let folder = self.folder_of(job);
        if !folder.is_dir() {
            return Err(JournalError::NoSuchJob(job));
        }
        let lock = lock(&folder, job)?;
        // Read under the lock: another process may just have ended it.
        let entry = read_entry(&folder)?;
        if matches!(entry.record.phase, Phase::Ended(_)) {
            return Err(JournalError::Ended(job));
        }
        let path = folder.join("data");
        let damaged = |what: String| JournalError::Damaged { path: path.clone(), what };
        if entry.record.job != job {
            return Err(damaged(format!("the record is that of job {:08x}", entry.record.job)));
        }
        let mut data = Vec::new();
        let file = File::open(&path).map_err(io_error("read", &path))?;
        file.take(u64::from(entry.record.length) + 1)
            .read_to_end(&mut data)
            .map_err(io_error("read", &path))?;
        if data.len() != entry.record.length as usize || checksum(&data) != entry.checksum {
            return Err(damaged("the data are not those that were queued".into()));
        }
        Ok(OpenJob { folder, entry, data, _lock: lock })
    }

    /// All jobs that can be read, oldest first. Folders that are none of ours are passed over, and [those that are damaged](Journal::damaged).
    pub fn entries(&self) -> Result<Vec<Entry>, JournalError> {
        let mut entries: Vec<Entry> =
            self.folders()?.iter().filter_map(|folder| read_entry(folder).ok()).collect();
        entries.sort_by_key(|entry| (entry.queued, entry.record.job));
        Ok(entries)
    }

    /// Why jobs cannot be read whose record is there.
    pub fn damaged(&self) -> Result<Vec<(u32, JournalError)>, JournalError> {
        let damage = |folder: &PathBuf| {
            let number = u32::from_str_radix(folder.file_name()?.to_str()?, 16).ok()?;
            let error = read_entry(folder).err()?;
            matches!(error, JournalError::Damaged { .. }).then_some((number, error))
        };
        Ok(self.folders()?.iter().filter_map(damage).collect())
    }

    fn folders(&self) -> Result<Vec<PathBuf>, JournalError> {
        let listing = fs::read_dir(&self.folder).map_err(io_error("read", &self.folder))?;
        Ok(listing
            .filter_map(|item| Some(item.ok()?.path()))
            .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_number))
            .collect())
    }

    /// Removes all but the last records of jobs that are over.
    pub fn tidy(&self) -> Result<(), JournalError> {
        let mut over = self.entries()?;
        over.retain(|entry| matches!(entry.record.phase, Phase::Ended(_)));
        for entry in &over[..over.len().saturating_sub(KEPT)] {
            let folder = self.folder_of(entry.record.job);
            fs::remove_dir_all(&folder).map_err(io_error("remove", &folder))?;
        }
        Ok(())
    }

    fn folder_of(&self, job: u32) -> PathBuf {
        self.folder.join(format!("{job:08x}"))
    }
}

fn is_number(name: &str) -> bool {
    name.len() == 8 && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}

impl OpenJob {
    /// Where its data are on disk until it has ended.
    pub fn place(&self) -> PathBuf {
        self.folder.join("data")
    }

    /// Makes the record durable; with the job's end its data go.
    pub fn save(&mut self, record: &Record) -> Result<(), JournalError> {
        self.entry.record = *record;
        write_entry(&self.folder, &self.entry)?;
        if matches!(record.phase, Phase::Ended(_)) {
            let path = self.folder.join("data");
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(io_error("remove", &path)(error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

fn lock(folder: &Path, job: u32) -> Result<File, JournalError> {
    let path = folder.join("lock");
    let file = File::create(&path).map_err(io_error("write", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(JournalError::Locked(job)),
        Err(TryLockError::Error(error)) => Err(io_error("lock", &path)(error)),
    }
}

fn read_entry(folder: &Path) -> Result<Entry, JournalError> {
    let path = folder.join("job.json");
    let file = File::open(&path).map_err(io_error("read", &path))?;
    let mut text = String::new();
    file.take(LARGEST_RECORD).read_to_string(&mut text).map_err(io_error("read", &path))?;
    serde_json::from_str(&text).map_err(|error| JournalError::Damaged { path, what: error.to_string() })
}

fn write_entry(folder: &Path, entry: &Entry) -> Result<(), JournalError> {
    let path = folder.join("job.json");
    let text = serde_json::to_vec_pretty(entry)
        .map_err(|error| JournalError::Damaged { path: path.clone(), what: error.to_string() })?;
    durable::write(&path, &text, Access::Private).map_err(io_error("write", &path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transit::session::Outcome;

    fn job(data: &[u8]) -> NewJob<'_> {
        NewJob {
            name: "leaf",
            to: "serial:/dev/ttyACM0".into(),
            kind: JobKind::Raw,
            data,
            port_bytes: data.len() as u64,
            passes: vec![PassPlace { ink: 0x0b, offset: 40 }],
        }
    }

    #[test]
    fn a_job_comes_back_from_disk_as_it_was_saved() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        let mut queued = journal.queue(job(b"\x1b data")).unwrap();
        let number = queued.entry.record.job;
        let record = Record { phase: Phase::Sending, printed: 3, bridge: Some(9), ..queued.entry.record };
        queued.save(&record).unwrap();
        let saved = queued.entry.clone();
        drop(queued);
        let opened = journal.open(number).unwrap();
        assert_eq!((&opened.entry, &opened.data[..]), (&saved, &b"\x1b data"[..]));
        assert_eq!(journal.entries().unwrap(), [saved]);
    }

    #[test]
    fn two_processes_cannot_send_the_same_job() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        let queued = journal.queue(job(b"x")).unwrap();
        let number = queued.entry.record.job;
        assert!(matches!(journal.open(number), Err(JournalError::Locked(n)) if n == number));
        drop(queued);
        assert!(journal.open(number).is_ok());
    }

    #[test]
    fn the_data_go_with_the_end_and_the_record_stays() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        let mut queued = journal.queue(job(b"x")).unwrap();
        let number = queued.entry.record.job;
        let ended = Record { phase: Phase::Ended(Outcome::Printed), ..queued.entry.record };
        queued.save(&ended).unwrap();
        drop(queued);
        assert!(matches!(journal.open(number), Err(JournalError::Ended(_))));
        assert_eq!(journal.entries().unwrap()[0].record, ended);
        assert!(!folder.path().join(format!("{number:08x}/data")).exists());
    }

    #[test]
    fn damage_is_noticed_before_a_byte_is_sent() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        let number = journal.queue(job(b"some data")).unwrap().entry.record.job;
        let inside = folder.path().join(format!("{number:08x}"));
        for wrong in [&b"same data"[..], b"some", b"some data and more"] {
            fs::write(inside.join("data"), wrong).unwrap();
            assert!(matches!(journal.open(number), Err(JournalError::Damaged { .. })), "{wrong:?}");
        }
        fs::write(inside.join("job.json"), "{").unwrap();
        assert!(matches!(journal.open(number), Err(JournalError::Damaged { .. })));
        assert!(matches!(journal.open(number ^ 1), Err(JournalError::NoSuchJob(_))));
        assert!(journal.entries().unwrap().is_empty(), "one damaged job does not hide the others");
    }

    #[test]
    fn only_the_last_records_are_kept_and_nothing_that_is_not_over_goes() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        let waiting = journal.queue(job(b"x")).unwrap().entry.record.job;
        for _ in 0..KEPT + 3 {
            let mut queued = journal.queue(job(b"x")).unwrap();
            let ended = Record { phase: Phase::Ended(Outcome::Cancelled), ..queued.entry.record };
            queued.save(&ended).unwrap();
        }
        journal.tidy().unwrap();
        assert_eq!(journal.entries().unwrap().len(), KEPT + 1);
        assert!(journal.open(waiting).is_ok());
    }

    #[test]
    fn a_half_written_job_is_no_job() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::at(folder.path()).unwrap();
        fs::create_dir(folder.path().join(".new.1234")).unwrap();
        fs::write(folder.path().join(".new.1234/data"), b"half").unwrap();
        assert!(journal.entries().unwrap().is_empty());
    }
}
