//! Jobs: what is known of them, and what stays known when the process is gone.
//!
//! Problem: a job that was accepted must be printed, once, whatever happens to the server meanwhile. Method:
//! a folder for each job, with its record and its document; a change of the record is on disk before anybody
//! is told of it ([`durable`]). A job that was on its way when the process ended is pending again: what of it
//! is printed the delivery's own journal knows, so it goes on behind that.
//! The order at the end of a job is: its end on record, then the journal's records of its sheets removed,
//! then its document. So there is no step after which a restart would print it again.
//! Cost: two syncs for each change of a job's state. Limits: the records of the last hundred ended jobs stay,
//! and the documents of the last twenty that were printed, so that they can be printed again.
//! Source: RFC 8011, section 5.3.7, for the states.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::net::IpAddr;
use std::path::{Path, PathBuf};

use files::durable::{self, Access};
use serde::{Deserialize, Serialize};

use crate::budget::Client;
use crate::template::Ticket;

/// Ended jobs whose records stay.
const KEPT: usize = 100;
/// A record is far smaller.
const LARGEST_RECORD: u64 = 1 << 20;
/// The version of records that this program writes and reads.
const VERSION: u32 = 1;
/// The folder of what cannot be read, beside the jobs.
const ASIDE: &str = "aside";
/// How the folders of drawn sheets begin.
const SHEETS: &str = "sheets-";

/// Where a job stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Its document is not here yet.
    Incoming,
    /// It waits for its turn.
    Pending,
    /// It waits until it is released.
    Held,
    /// It is drawn, sent or printed.
    Processing,
    /// Ended by somebody.
    Canceled,
    /// Ended because it cannot be printed.
    Aborted,
    /// Its last sheet is out.
    Completed,
}

impl State {
    /// Whether it is over.
    pub fn is_over(self) -> bool {
        matches!(self, State::Canceled | State::Aborted | State::Completed)
    }
}

/// Whose a job is: a name that everybody can say, from a computer that nobody else has meanwhile.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Owner {
    /// What they call themselves.
    pub user: String,
    /// Where they are.
    pub from: Option<IpAddr>,
    /// What their browser got with what it uploaded, and shows again.
    pub key: Option<String>,
}

impl Owner {
    /// Who has a share of the server.
    pub fn client(&self) -> Client {
        self.from.map_or(Client::Here, Client::at)
    }
}

/// The version of a record; another one is not read.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(into = "u32", try_from = "u32")]
pub struct Version;

impl From<Version> for u32 {
    fn from(Version: Version) -> u32 {
        VERSION
    }
}

impl TryFrom<u32> for Version {
    type Error = String;

    fn try_from(found: u32) -> Result<Version, String> {
        if found == VERSION { Ok(Version) } else { Err(format!("it is of version {found}, not {VERSION}")) }
    }
}

/// A job.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Job {
    /// The version of this record.
    pub version: Version,
    /// Its number.
    pub id: u32,
    /// The printer it was given to.
    pub printer: String,
    /// What its owner calls it.
    pub name: String,
    /// Its owner.
    pub owner: Owner,
    /// What it asks for.
    pub ticket: Ticket,
    /// The name of its document's file; none until that is here.
    pub document: Option<String>,
    /// The type of its document.
    pub format: String,
    /// The document's bytes.
    pub octets: u64,
    /// Where it stands.
    pub state: State,
    /// Whether somebody wants it ended.
    pub cancel: bool,
    /// What there is to know, for people.
    pub message: String,
    /// When it came, in seconds since 1970.
    pub created: u64,
    /// When its drawing began.
    pub begun: Option<u64>,
    /// When it ended.
    pub ended: Option<u64>,
    /// Its sheets, copies included, once they are drawn.
    pub sheets: Option<u32>,
    /// Sheets that are printed.
    pub done: u32,
    /// How its pages lie on their sheets, in words.
    pub laid: Vec<String>,
    /// Whether anything that is drawn was cut.
    pub is_cut: bool,
    /// Whether it is held until the printer was switched off and on, or reset.
    pub awaits_switch: bool,
    /// How often it was changed after it was drawn, perhaps.
    pub round: u32,
    /// Where its first page lies on the sheet, in hundredths of a millimetre: left, top, width, length.
    pub lies: Option<[i32; 4]>,
}

impl Job {
    /// Something of it was changed: what is drawn of it is not right any more.
    pub fn is_drawn_again(&mut self) {
        self.round = self.round.wrapping_add(1);
        (self.sheets, self.lies, self.is_cut) = (None, None, false);
        self.laid.clear();
    }

    /// The name under which the delivery knows it: no other job's, on any server.
    pub fn identity(&self) -> String {
        format!("serve-{:06}-{:x}", self.id, self.created)
    }
}

/// Why jobs cannot be kept.
#[derive(Debug, thiserror::Error)]
#[error("cannot {what} {}", path.display())]
pub struct StoreError {
    what: &'static str,
    path: PathBuf,
    #[source]
    source: io::Error,
}

fn failed(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> StoreError {
    let path = path.to_path_buf();
    move |source| StoreError { what, path, source }
}

/// The jobs on disk.
pub struct Store {
    folder: PathBuf,
}

/// What was found on disk.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// The jobs.
    pub jobs: BTreeMap<u32, Job>,
    /// What was put aside since it cannot be read: where it lies now, and why.
    pub aside: Vec<(PathBuf, String)>,
    /// The largest number that a job ever had here, as far as it is known.
    pub last: u32,
}

/// Moves what cannot be read out of the way, under a name that nothing has there; where it lies now.
///
/// # Errors
/// What the system says.
pub(crate) fn put_aside(path: &Path, folder: &Path) -> io::Result<PathBuf> {
    let aside = folder.join(ASIDE);
    durable::make_folder(&aside, Access::Private)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut names = std::iter::once(name.clone()).chain((2..).map(|again| format!("{name}-{again}")));
    let to = names.find_map(|name| Some(aside.join(name)).filter(|to| !to.exists())).unwrap_or(aside);
    fs::rename(path, &to)?;
    durable::sync_folder(folder)?;
    Ok(to)
}

impl Store {
    /// Those in this folder, which is made if need be. A job whose record cannot be read is put aside with
    /// its document.
    ///
    /// # Errors
    /// The folder cannot be made or read.
    pub fn open(folder: &Path) -> Result<(Store, Found), StoreError> {
        durable::make_folder(folder, Access::Private).map_err(failed("make", folder))?;
        let store = Store { folder: folder.to_path_buf() };
        let mut found = Found::default();
        let number = |path: &Path| path.file_name().and_then(|name| name.to_str()?.parse::<u32>().ok());
        let entries = |folder: &Path| -> Result<Vec<PathBuf>, StoreError> {
            let entries = fs::read_dir(folder).map_err(failed("read", folder))?;
            entries.map(|entry| Ok(entry.map_err(failed("read", folder))?.path())).collect()
        };
        for path in entries(folder)? {
            let Some(number) = number(&path) else { continue };
            found.last = found.last.max(number);
            match read(&path) {
                Ok(Some(job)) if job.id == number => {
                    found.jobs.insert(number, job);
                }
                // Its owner was never told that it is here.
                Ok(None) => store.clear(number, true)?,
                other => {
                    let why = other.err().unwrap_or_else(|| "it is that of another job".into());
                    let parent = folder.parent().unwrap_or(folder);
                    let to = put_aside(&path, parent).map_err(failed("move", &path))?;
                    found.aside.push((to, why));
                }
            }
        }
        if let Ok(aside) = entries(&folder.with_file_name(ASIDE)) {
            let name = |path: &Path| path.file_name()?.to_str()?.split('-').next()?.parse::<u32>().ok();
            found.last = aside.iter().filter_map(|path| name(path)).max().unwrap_or(0).max(found.last);
        }
        Ok((store, found))
    }

    /// The folder of a job.
    pub fn folder(&self, id: u32) -> PathBuf {
        self.folder.join(id.to_string())
    }

    /// The folder of a job's drawn sheets, which is another one after each change.
    pub fn sheets(&self, job: &Job) -> PathBuf {
        self.folder(job.id).join(format!("{SHEETS}{}", job.round))
    }

    /// A small picture of a job's first sheet.
    pub fn picture(&self, id: u32) -> PathBuf {
        self.folder(id).join("sheet.png")
    }

    /// A job's document, if it is still there.
    pub fn document(&self, job: &Job) -> Option<PathBuf> {
        let path = self.folder(job.id).join(job.document.as_ref()?);
        path.is_file().then_some(path)
    }

    /// Makes a job's record durable.
    ///
    /// # Errors
    /// The disk says no.
    pub fn save(&self, job: &Job) -> Result<(), StoreError> {
        let folder = self.folder(job.id);
        durable::make_folder(&folder, Access::Private).map_err(failed("make", &folder))?;
        let path = folder.join("job.json");
        let text = serde_json::to_vec(job).map_err(|error| failed("write", &path)(error.into()))?;
        durable::write(&path, &text, Access::Private).map_err(failed("write", &path))
    }

    /// Removes what a job that is over does not need any more: its document and its sheets; with `all` its
    /// record, too.
    ///
    /// # Errors
    /// The disk says no.
    pub fn clear(&self, id: u32, all: bool) -> Result<(), StoreError> {
        let folder = self.folder(id);
        if all {
            return match fs::remove_dir_all(&folder) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    Err(failed("remove", &folder)(error))
                }
                _ => Ok(()),
            };
        }
        for entry in fs::read_dir(&folder).map_err(failed("read", &folder))? {
            let path = entry.map_err(failed("read", &folder))?.path();
            let removed = match path.file_name().is_some_and(|name| name == "job.json") {
                true => Ok(()),
                false if path.is_dir() => fs::remove_dir_all(&path),
                false => fs::remove_file(&path),
            };
            removed.map_err(failed("remove", &path))?;
        }
        Ok(())
    }

    /// Removes the drawn sheets of a job: they can be drawn again.
    pub fn clear_sheets(&self, id: u32) {
        let entries = fs::read_dir(self.folder(id)).into_iter().flatten();
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(SHEETS)) {
                // What stays is removed when the job is over.
                let _ = fs::remove_dir_all(path);
            }
        }
    }

    /// Forgets the oldest of the jobs that are over. The newest job stays, so that no number is given twice.
    ///
    /// # Errors
    /// The disk says no.
    pub fn tidy(&self, jobs: &mut BTreeMap<u32, Job>) -> Result<(), StoreError> {
        let over: Vec<u32> = jobs.values().filter(|job| job.state.is_over()).map(|job| job.id).collect();
        for id in &over[..over.len().saturating_sub(KEPT)] {
            self.clear(*id, true)?;
            jobs.remove(id);
        }
        Ok(())
    }
}

/// The record in a job's folder; none if there is none.
fn read(folder: &Path) -> Result<Option<Job>, String> {
    let path = folder.join("job.json");
    let length = match fs::metadata(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        found => found.map_err(|error| error.to_string())?.len(),
    };
    if length > LARGEST_RECORD {
        return Err("its record is too large".into());
    }
    let text = fs::read(path).map_err(|error| error.to_string())?;
    serde_json::from_slice(&text).map(Some).map_err(|error| format!("its record cannot be read: {error}"))
}

/// What becomes of a job when the server begins again.
pub fn after_restart(job: &mut Job, now: u64) {
    match job.state {
        State::Incoming => {
            (job.state, job.ended) = (State::Aborted, Some(now));
            job.message = "the server ended before the document was here; print it again".into();
        }
        State::Processing => {
            job.state = State::Pending;
            job.message.clear();
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A job of this number in this state.
    fn job(id: u32, state: State) -> Job {
        Job {
            version: Version,
            id,
            printer: "standard".into(),
            name: "leaf".into(),
            owner: Owner { user: "me".into(), from: None, key: None },
            ticket: Ticket::default(),
            document: Some("document.pdf".into()),
            format: "application/pdf".into(),
            octets: 9,
            state,
            cancel: false,
            message: String::new(),
            created: 1_795_000_000,
            begun: None,
            ended: None,
            sheets: None,
            done: 0,
            laid: Vec::new(),
            is_cut: false,
            awaits_switch: false,
            round: 0,
            lies: None,
        }
    }

    #[test]
    fn jobs_come_back_and_what_is_no_job_goes() {
        let folder = tempfile::tempdir().unwrap();
        let (store, found) = Store::open(&folder.path().join("jobs")).unwrap();
        assert_eq!(found, Found::default());
        for (id, state) in
            [(1, State::Completed), (2, State::Processing), (3, State::Incoming), (4, State::Held)]
        {
            store.save(&job(id, state)).unwrap();
            fs::write(store.folder(id).join("document.pdf"), "%PDF").unwrap();
        }
        // A folder that was made, and nothing in it was saved.
        fs::create_dir(store.folder(5)).unwrap();
        fs::write(store.folder(5).join("document.part"), "%P").unwrap();
        // Records that are damaged, of another job, and of another version.
        for (id, record) in [(7, "{"), (8, ""), (9, ""), (10, "")] {
            store.save(&job(id, State::Pending)).unwrap();
            let path = store.folder(id).join("job.json");
            let text = fs::read_to_string(&path).unwrap();
            let text = match id {
                8 => text.replace("\"id\":8", "\"id\":1"),
                9 => text.replace("\"version\":1", "\"version\":2"),
                10 => text.replace("\"version\":1,", ""),
                _ => record.into(),
            };
            fs::write(path, text).unwrap();
            fs::write(store.folder(id).join("document.pdf"), "%PDF").unwrap();
        }
        let (store, Found { mut jobs, mut aside, last }) = Store::open(&folder.path().join("jobs")).unwrap();
        aside.sort();
        let whys: Vec<&str> = aside.iter().map(|(_, why)| why.as_str()).collect();
        assert!(
            whys[0].contains("missing field `version`") && whys[1].contains("cannot be read"),
            "{whys:?}"
        );
        assert!(whys[2].contains("another job") && whys[3].contains("version 2, not 1"), "{whys:?}");
        assert!(aside.iter().all(|(path, _)| path.join("document.pdf").exists()));
        assert_eq!(last, 10);
        assert_eq!(Store::open(&folder.path().join("jobs")).unwrap().1.last, 10);
        assert_eq!(jobs.keys().copied().collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert!(!store.folder(5).exists());
        jobs.values_mut().for_each(|job| after_restart(job, 7));
        let states: Vec<State> = jobs.values().map(|job| job.state).collect();
        assert_eq!(states, [State::Completed, State::Pending, State::Aborted, State::Held]);
        store.clear(1, false).unwrap();
        assert!(!store.folder(1).join("document.pdf").exists() && store.folder(1).join("job.json").exists());
    }

    #[test]
    fn the_last_records_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (store, Found { mut jobs, .. }) = Store::open(folder.path()).unwrap();
        for id in 1..=KEPT as u32 + 3 {
            let state = if id == 2 { State::Held } else { State::Completed };
            store.save(&job(id, state)).unwrap();
            jobs.insert(id, job(id, state));
        }
        store.tidy(&mut jobs).unwrap();
        assert_eq!(jobs.len(), KEPT + 1);
        assert!(jobs.contains_key(&2) && !jobs.contains_key(&1) && !jobs.contains_key(&3));
        assert_eq!(Store::open(folder.path()).unwrap().1.jobs, jobs);
    }
}
