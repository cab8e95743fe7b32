//! What of a server changes: its jobs, its device, and the sheet that is loaded.
//!
//! The loaded sheet and the code outlive the process, and a seed that makes the identities of printers and
//! jobs this computer's own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

use files::durable::{self, Access};
use protocol::paper::Paper;
use queue::messages::Reason;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::budget::Client;
use crate::jobs::{Job, State, Version, put_aside};
use crate::template::{AUTO, Loaded, Size, label, paper, size};

/// What a cartridge says of itself.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Cartridge {
    /// Its ink.
    pub name: String,
    /// How it looks in a dialog.
    pub colour: &'static str,
    /// Whether there is ribbon.
    pub is_loaded: bool,
}

/// What outlives the process beside jobs.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Kept {
    pub(super) version: Version,
    /// Makes the identities of printers this computer's own.
    pub(super) seed: String,
    /// What somebody elsewhere has to know to change things.
    pub(super) code: String,
    pub(super) loaded: Loaded,
    pub(super) revision: u32,
}

/// What changes.
pub struct Data {
    /// All jobs that are known.
    pub jobs: BTreeMap<u32, Job>,
    pub(super) next: u32,
    /// Whether what sheets are sent to takes every sheet, as a folder does.
    pub(super) takes_any_sheet: bool,
    /// When the last operation of a job without its document ended; none while its document comes.
    pub(super) heard: BTreeMap<u32, Option<Instant>>,
    /// Since when jobs of the desk wait to be released.
    pub(super) held: BTreeMap<u32, Instant>,
    /// Unpacked bytes of documents that come just now.
    pub(super) arriving: BTreeMap<u32, u64>,
    /// Who looks at what would be printed.
    pub(super) looking: BTreeSet<Client>,
    /// Why the device does not print, or soon will not.
    pub reasons: Vec<Reason>,
    /// What it does, for people.
    pub message: String,
    /// Percent of the sheet that is on its way.
    pub percent: Option<u64>,
    /// The cartridges it has found; none before it was asked.
    pub cartridges: Vec<Cartridge>,
    pub(super) kept: Kept,
    /// What could not be read at the start, in words.
    pub aside: Vec<String>,
    /// The job whose sheets are being drawn, and how many are.
    pub drawing: Option<(u32, usize)>,
    /// When a job that could not be kept is tried again.
    pub(super) again: Option<Instant>,
    /// When any of this changed, in seconds since 1970.
    pub changed: u64,
    /// When the sheet changed.
    pub configured: u64,
    /// Somebody wants to see which printer this is: when, in seconds since 1970.
    pub identify: u64,
    pub(super) identified: Option<Instant>,
}

impl Data {
    /// The sheet that is loaded.
    pub fn loaded(&self) -> &Loaded {
        &self.kept.loaded
    }

    /// The job that is printed now.
    pub fn current(&self) -> Option<&Job> {
        self.jobs.values().find(|job| job.state == State::Processing)
    }

    /// Counts how often somebody has said what is loaded: who changes it says which count they saw.
    pub fn revision(&self) -> u32 {
        self.kept.revision
    }

    /// Jobs that are held until the printer was switched off and on.
    pub fn await_switch(&self) -> impl Iterator<Item = &Job> {
        self.jobs.values().filter(|job| job.state == State::Held && job.awaits_switch)
    }

    /// A job that has stopped until somebody does what its message says, and releases it.
    pub fn stopped(&self) -> Option<&Job> {
        self.jobs.values().find(|job| job.state == State::Held && !job.ticket.held)
    }

    /// Whether a job is for another sheet than the one that is loaded.
    pub fn lacks_sheet(&self, job: &Job) -> bool {
        let Loaded { size, kind } = self.loaded();
        let is_other_size = job.ticket.size.is_some_and(|asked| paper(asked) != paper(*size));
        let is_other_kind = |asked: &String| asked != AUTO && kind != AUTO && asked != kind;
        !self.takes_any_sheet && (is_other_size || job.ticket.kind.as_ref().is_some_and(is_other_kind))
    }

    /// A job that waits for its sheet, while nothing else can be printed.
    pub fn waiting(&self) -> Option<&Job> {
        let pending = || self.jobs.values().filter(|job| job.state == State::Pending);
        pending()
            .find(|job| self.lacks_sheet(job))
            .filter(|_| self.current().is_none() && pending().all(|job| self.lacks_sheet(job)))
    }

    /// Why the device does not print, or soon will not, as keywords. While another job is printed, one that
    /// has stopped is a warning.
    pub fn keywords(&self) -> Vec<&'static str> {
        let mut all: Vec<&str> = self.reasons.iter().map(|reason| reason.keyword()).collect();
        let word = if self.current().is_some() { "other-warning" } else { "other-error" };
        if self.stopped().is_some() && !all.contains(&word) {
            all.push(word);
        }
        if self.waiting().is_some() && !all.contains(&"media-needed") {
            all.push("media-needed");
        }
        all
    }

    /// What it does or waits for, for people.
    pub fn said(&self) -> String {
        match (self.current(), self.stopped()) {
            (None, Some(job)) => format!("job {}: {}", job.id, job.message),
            _ => self.waiting().map_or_else(|| self.message.clone(), |job| self.wants(job)),
        }
    }

    /// Which sheet a job waits for, for people.
    fn wants(&self, job: &Job) -> String {
        let sheet = |size: Size, kind: &str| match kind {
            AUTO => label(size),
            kind => format!("{} of {kind}", label(size)),
        };
        let Loaded { size, kind } = self.loaded();
        let asked = job.ticket.kind.as_deref().unwrap_or(AUTO);
        format!(
            "job {} waits for a sheet of {}; {} is loaded: load it and say so, or print on the loaded one",
            job.id,
            sheet(job.ticket.size.unwrap_or(*size), asked),
            sheet(*size, kind)
        )
    }

    /// Jobs that are not over.
    pub fn open(&self) -> usize {
        self.jobs.values().filter(|job| !job.state.is_over()).count()
    }

    /// Those of a client.
    pub(super) fn open_of(&self, client: Client) -> usize {
        self.jobs.values().filter(|job| !job.state.is_over() && job.owner.client() == client).count()
    }

    /// Bytes of the documents of a client, and of all, that are not over.
    pub(super) fn octets(&self, client: Client) -> (u64, u64) {
        let open = self.jobs.values().filter(|job| !job.state.is_over());
        open.fold((0, 0), |(own, all), job| {
            let octets = job.octets.max(self.arriving.get(&job.id).copied().unwrap_or(0));
            let is_own = job.owner.client() == client;
            (own + if is_own { octets } else { 0 }, all + octets)
        })
    }
}

/// The identity of a printer or a job, see [`super::Server::uuid`].
pub fn identity(data: &Data, of: &str) -> String {
    uuid(&data.kept.seed, of)
}

/// The identities that printers of these names have where jobs are kept in this folder.
///
/// # Errors
/// What the system says.
pub fn identities(folder: &Path, printers: &[String]) -> std::io::Result<Vec<String>> {
    durable::make_folder(folder, Access::Private)?;
    let kept = kept(folder, &mut Vec::new())?;
    Ok(printers.iter().map(|name| uuid(&kept.seed, &format!("printer {name}"))).collect())
}

/// What is kept beside the jobs in a folder. What cannot be read is put aside, and its former version is
/// taken; without one it is made. What became of it goes to `aside`, in words.
pub(super) fn kept(folder: &Path, aside: &mut Vec<String>) -> std::io::Result<Kept> {
    let path = folder.join(KEPT);
    let read = |path: &Path| match std::fs::read(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        text => {
            let kept = text
                .map_err(|error| error.to_string())
                .and_then(|text| serde_json::from_slice::<Kept>(&text).map_err(|error| error.to_string()))?;
            let is_sheet = paper(kept.loaded.size).is_some();
            if is_sheet { Ok(Some(kept)) } else { Err("its sheet is none".to_owned()) }
        }
    };
    match read(&path) {
        Ok(Some(kept)) => return Ok(kept),
        Ok(None) => {}
        Err(why) => {
            let to = put_aside(&path, folder)?;
            let then = match read(&path.with_extension(FORMER)) {
                Ok(Some(former)) => {
                    keep(folder, &former)?;
                    aside.push(format!(
                        "what is known of the printer could not be read ({why}) and lies in {}; what was known before is taken: look \
                         whether the right sheet is set",
                        to.display()
                    ));
                    return Ok(former);
                }
                _ => "the code is another one, and the printers are new ones for other computers",
            };
            aside.push(format!(
                "what is known of the printer could not be read ({why}) and lies in {}; {then}",
                to.display()
            ));
        }
    }
    let mut seed = [0; 16];
    crate::random(&mut seed)?;
    let loaded = Loaded { size: size(Paper::A4), kind: AUTO.into() };
    let kept = Kept { version: Version, seed: hex(&seed), code: code()?, loaded, revision: 0 };
    keep(folder, &kept)?;
    Ok(kept)
}

/// Its file.
const KEPT: &str = "server.json";
/// The end of the name of its former version.
const FORMER: &str = "former.json";

/// Keeps it, and what it was before beside it.
pub(super) fn keep(folder: &Path, kept: &Kept) -> std::io::Result<()> {
    let path = folder.join(KEPT);
    match std::fs::read(&path) {
        Ok(former) => durable::write(&path.with_extension(FORMER), &former, Access::Private)?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    durable::write(&path, &serde_json::to_vec(kept)?, Access::Private)
}

/// A code for people: no letters that look alike, and 2^40 of them are not tried out over a network.
fn code() -> std::io::Result<String> {
    const LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";
    let mut bytes = [0; 8];
    crate::random(&mut bytes)?;
    Ok(bytes.iter().map(|byte| char::from(LETTERS[usize::from(byte % 32)])).collect())
}

/// A key for a browser, which shows that a job is its own.
pub(crate) fn key() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    crate::random(&mut bytes)?;
    Ok(hex(&bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An identity made of a seed and a name. Source: RFC 9562, version 8.
fn uuid(seed: &str, of: &str) -> String {
    let digest = Sha256::digest(format!("{seed}/{of}").as_bytes());
    let mut bytes: Vec<u8> = digest.iter().copied().take(16).collect();
    bytes[6] = bytes[6] & 0x0f | 0x80;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    let text = hex(&bytes);
    format!("{}-{}-{}-{}-{}", &text[..8], &text[8..12], &text[12..16], &text[16..20], &text[20..])
}
