//! Which printers may hold part of a job: one fact for each printer, kept once for the whole computer.
//!
//! Problem: a printer that has received part of a job takes whatever comes next as the rest of a row, and prints it as text.
//! It has to be reset first. Every process must know this: another user's, the print queue's, tomorrow's.
//! Method: a folder for the whole computer. Before the first byte of a job leaves, the file `open.PRINTER.JOB` is made durable
//! there. It is removed when the job is known to have ended in an orderly way, or when the printer was reset. So a crash
//! leaves it behind, whatever crashed. The folder is sticky: nobody can remove a file of another user. Whoever learns that
//! another user's job has ended writes `closed.PRINTER.JOB.ANY` instead, under a name that is drawn, so that nobody can take it
//! before. It counts for whoever wrote it, and for everybody if root or the owner of the open note did: this program cannot know
//! whether another user may open the bridge. Files are [durable] and whole; links are never followed; a folder with a note's name
//! is none.
//! A note of the bridge's present start is left open by others: its job may not have reached the bridge yet, and would begin
//! without one.
//! A bridge is known by its serial number, however it is reached, because it has one port. A raw device is known by its path.
//! Limits: another computer that shares a bridge over the network does not see the folder. A user who may print may also
//! write false facts here: the worst that follows is a needless reset.
//! Source: `docs/decisions/reset-owed-by-the-printer.md`.

mod unfinished;

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use protocol::link::frame::checksum;
use serde::{Deserialize, Serialize};

use crate::transit::journal::{Journal, JournalError};
use files::durable::{self, Access};

pub(crate) use unfinished::Standing;
pub use unfinished::Unfinished;

/// A fact is far smaller.
const LARGEST: u64 = 4096;

/// A printer, as this computer tells it from others.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Printer {
    /// The one at the bridge with this serial number.
    Bridge(u64),
    /// The one at a device that takes its bytes as they are.
    Device(PathBuf),
}

impl Printer {
    /// A name that is safe as part of a file's: no dots, no separators.
    fn file_name(&self) -> String {
        match self {
            Printer::Bridge(serial) => format!("bridge-{serial:016x}"),
            Printer::Device(path) => {
                // The same device by another name, such as a link made by udev, is the same printer.
                let path = fs::canonicalize(path).unwrap_or_else(|_| path.clone());
                let text = path.to_string_lossy();
                let plain: String =
                    text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(80).collect();
                format!("device{plain}-{:08x}", checksum(text.as_bytes()))
            }
        }
    }
}

impl fmt::Display for Printer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Printer::Bridge(serial) => write!(f, "the printer at bridge {serial:016x}"),
            Printer::Device(path) => write!(f, "the printer at {}", path.display()),
        }
    }
}

#[derive(PartialEq, Eq, Default, Serialize, Deserialize)]
struct Fact {
    boot: Option<u32>,
    /// When it was written, in seconds since 1970: for whoever looks into the folder.
    since: u64,
}

/// Why the folder cannot be used. Nothing is sent then.
#[derive(Debug, thiserror::Error)]
pub enum PrintersError {
    /// There is no place for it.
    #[error("found no folder for the state of printers")]
    NoFolder(#[from] JournalError),
    /// The file system refuses.
    #[error("cannot {what} {}, which records the printers that need a reset", path.display())]
    Io {
        /// What was tried.
        what: &'static str,
        /// With what.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}

fn io_error(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> PrintersError {
    let path = path.to_path_buf();
    move |source| PrintersError::Io { what, path, source }
}

/// What was noted at some moment.
#[derive(Clone, Debug)]
pub struct Noted(Vec<String>);

/// The folder of facts about printers.
#[derive(Clone, Debug)]
pub struct Printers {
    folder: PathBuf,
    /// The folder all users share, if this is not it.
    instead_of: Option<PathBuf>,
    /// The folder of this user's own, if this is not it.
    own: Option<PathBuf>,
}

/// The folder of a user's own.
fn own_folder(journal: &Journal) -> PathBuf {
    journal.folder().join("printers")
}

impl Printers {
    /// The computer's folder: `FOILPRESS_PRINTERS`; else the folder all users share, if it is there and can be written; else one
    /// of this user's own, which [`Printers::notes`] then tell.
    pub fn of_system() -> Result<Printers, PrintersError> {
        if let Some(folder) = std::env::var_os("FOILPRESS_PRINTERS").filter(|value| !value.is_empty()) {
            return Printers::at(Path::new(&folder));
        }
        let shared = shared_folder();
        if let Some(folder) = &shared
            && tempfile::Builder::new().prefix(".try.").tempfile_in(folder).is_ok()
        {
            let own = Journal::of_user().ok().map(|journal| own_folder(&journal));
            return Ok(Printers { folder: folder.clone(), instead_of: None, own });
        }
        let own = Printers::at(&own_folder(&Journal::of_user()?))?;
        Ok(Printers { instead_of: shared, ..own })
    }

    /// The facts in this folder, which is made if need be.
    pub fn at(folder: &Path) -> Result<Printers, PrintersError> {
        durable::make_folder(folder, Access::Everyone).map_err(io_error("make", folder))?;
        Ok(Printers { folder: folder.to_path_buf(), instead_of: None, own: None })
    }

    /// Where they are.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder that would be in its place if that of all users could be written, or could not.
    pub(crate) fn other(&self) -> Option<&Path> {
        self.own.as_deref().or(self.instead_of.as_deref())
    }

    /// What the user should know: that the facts are not shared, and what lies among them and is none.
    pub fn notes(&self) -> Vec<String> {
        let shared = self.instead_of.as_ref().map(|shared| {
            format!(
                "{} cannot be written, so other users and print queues do not learn of a job that leaves the printer in need of \
                 a reset; the Debian package and `foilpress queue install` make that folder",
                shared.display()
            )
        });
        let names = self.names().unwrap_or_default();
        let rubbish =
            names.into_iter().find(|name| name.starts_with("open.") && !is_note(&self.folder.join(name)));
        let rubbish = rubbish.map(|name| {
            format!(
                "{} is no file of this program and says nothing of a printer; remove it",
                self.folder.join(crate::connection::printable(&name)).display()
            )
        });
        shared.into_iter().chain(rubbish).collect()
    }

    /// Notes, before its first byte leaves, that the printer may hold a part of this job. When this returns it is on disk. The
    /// same job again replaces what was noted.
    pub fn begin(&self, printer: &Printer, job: &str, boot: Option<u32>) -> Result<(), PrintersError> {
        self.tidy();
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        self.write(&self.path("open", printer, job), &Fact { boot, since })
    }

    /// Whether the printer has shown that it does not negotiate, so that it is not asked again and again.
    pub fn is_one_way(&self, printer: &Printer) -> bool {
        self.folder.join(one_way(printer)).symlink_metadata().is_ok()
    }

    /// Notes whether the printer negotiates. A user may not remove another one's note; then it stays.
    pub fn note_one_way(&self, printer: &Printer, is: bool) -> Result<(), PrintersError> {
        let path = self.folder.join(one_way(printer));
        if is == path.symlink_metadata().is_ok() {
            return Ok(());
        }
        if is {
            let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
            return self.write(&path, &Fact { boot: None, since });
        }
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::PermissionDenied => {
                Err(io_error("remove", &path)(error))
            }
            _ => Ok(()),
        }
    }

    /// Whether such a job is noted.
    pub(crate) fn knows(&self, printer: &Printer, job: &str) -> bool {
        self.path("open", printer, job).symlink_metadata().is_ok()
    }

    /// Notes that the printer holds nothing of this job any more.
    pub fn close(&self, printer: &Printer, job: &str) -> Result<(), PrintersError> {
        let open = self.path("open", printer, job);
        match fs::remove_file(&open) {
            Ok(()) => self.sync(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            // Another user's, in a sticky folder.
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => self.write_closed(&open),
            Err(error) => Err(io_error("remove", &open)(error)),
        }
    }

    /// The jobs of which this printer may hold a part, in no order.
    pub fn unfinished(&self, printer: &Printer) -> Result<Vec<Unfinished>, PrintersError> {
        let prefix = format!("open.{}.", printer.file_name());
        let mut found = Vec::new();
        let names = self.names()?;
        for name in &names {
            let Some(job) = name.strip_prefix(&prefix) else { continue };
            let path = self.folder.join(name);
            if is_note(&path) && !self.closing(name, &names).any(|closed| is_closed(&path, &closed)) {
                let boot = fact(&path).and_then(|fact| fact.boot);
                found.push(Unfinished { job: job.to_owned(), boot });
            }
        }
        Ok(found)
    }

    /// What is noted of a printer now; without one, of all. To be asked for before the printer is reset: a job that begins
    /// behind the reset has a note of its own.
    pub fn noted(&self, printer: Option<&Printer>) -> Result<Noted, PrintersError> {
        let of = printer.map_or_else(|| "open.".into(), |printer| format!("open.{}.", printer.file_name()));
        let notes = |name: &String| name.starts_with(&of) && is_note(&self.folder.join(name));
        Ok(Noted(self.names()?.into_iter().filter(notes).collect()))
    }

    /// Notes that a printer was reset and holds nothing any more of what was noted before; but for what was noted in this start
    /// of its bridge.
    pub fn reset(&self, noted: &Noted, boot: Option<u32>) -> Result<(), PrintersError> {
        for name in &noted.0 {
            let path = self.folder.join(name);
            if boot.is_some() && fact(&path).is_some_and(|fact| fact.boot == boot) {
                continue;
            }
            match fs::remove_file(&path) {
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) if error.kind() == io::ErrorKind::PermissionDenied => self.write_closed(&path)?,
                Err(error) => return Err(io_error("remove", &path)(error)),
            }
        }
        self.sync()
    }

    fn names(&self) -> Result<Vec<String>, PrintersError> {
        let listing = fs::read_dir(&self.folder).map_err(io_error("read", &self.folder))?;
        Ok(listing.filter_map(|item| item.ok()?.file_name().into_string().ok()).collect())
    }

    fn path(&self, kind: &str, printer: &Printer, job: &str) -> PathBuf {
        self.folder.join(format!("{kind}.{}.{job}", printer.file_name()))
    }

    /// Puts a whole file under its name, readable for everyone whatever this user's mask is.
    fn write(&self, path: &Path, fact: &Fact) -> Result<(), PrintersError> {
        let text = serde_json::to_vec(fact).map_err(|error| io_error("write", path)(error.into()))?;
        durable::write(path, &text, Access::Everyone).map_err(io_error("write", path))
    }

    /// Closes another user's note.
    fn write_closed(&self, open: &Path) -> Result<(), PrintersError> {
        let name = open.file_name().unwrap_or_default().to_string_lossy();
        let names = self.names()?;
        if self.closing(&name, &names).any(|closed| is_closed(open, &closed)) {
            return Ok(());
        }
        let moment = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let any = checksum(format!("{} {}", moment.as_nanos(), std::process::id()).as_bytes());
        let path = self.folder.join(format!("{}{any:08x}", closed_prefix(&name)));
        self.write(&path, &fact(open).unwrap_or_default())
    }

    /// What is said to close the open note of this name.
    fn closing<'n>(&self, open: &str, names: &'n [String]) -> impl Iterator<Item = PathBuf> + use<'_, 'n> {
        let prefix = closed_prefix(open);
        names.iter().filter(move |name| name.starts_with(&prefix)).map(|name| self.folder.join(name))
    }

    /// Makes removals durable.
    fn sync(&self) -> Result<(), PrintersError> {
        durable::sync_folder(&self.folder).map_err(io_error("write", &self.folder))
    }

    /// Removes pairs that cancel out, as far as they are this user's.
    fn tidy(&self) {
        for name in self.names().unwrap_or_default() {
            if let Some((rest, _)) = name.strip_prefix("closed.").and_then(|rest| rest.rsplit_once('.')) {
                let open = self.folder.join(format!("open.{rest}"));
                let closed = self.folder.join(&name);
                // The open one first: without it the other means nothing.
                if is_closed(&open, &closed) && fs::remove_file(&open).is_ok()
                    || open.symlink_metadata().is_err()
                {
                    let _ = fs::remove_file(closed);
                }
            }
        }
    }
}

/// The name of the file that says that a printer does not negotiate.
fn one_way(printer: &Printer) -> String {
    format!("one-way.{}", printer.file_name())
}

/// Whether this is a note, or a link in its place. A folder, or whatever else somebody has put there, is none.
fn is_note(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|found| found.is_file() || found.is_symlink())
}

/// What a note says. A link or a device in its place says nothing, which counts as the worst.
fn fact(path: &Path) -> Option<Fact> {
    if !path.symlink_metadata().is_ok_and(|found| found.is_file()) {
        return None;
    }
    let mut text = String::new();
    File::open(path).ok()?.take(LARGEST).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// Whether an open note is closed by somebody whose word counts, and this very note: a job that begins once more has another.
fn is_closed(open: &Path, closed: &Path) -> bool {
    let Ok(found) = closed.symlink_metadata() else { return false };
    #[cfg(unix)]
    let counts = {
        use std::os::unix::fs::MetadataExt as _;
        let me = rustix::process::geteuid().as_raw();
        let owner = open.symlink_metadata().map(|open| open.uid()).ok();
        found.uid() == 0 || found.uid() == me || Some(found.uid()) == owner
    };
    #[cfg(not(unix))]
    let counts = open.symlink_metadata().is_ok();
    found.is_file() && counts && fact(open).unwrap_or_default() == fact(closed).unwrap_or_default()
}

/// How the names of the files begin that close the one of this name.
fn closed_prefix(open: &str) -> String {
    format!("closed.{}.", open.strip_prefix("open.").unwrap_or(open))
}

/// The folder all users share. An administrator makes it: this program must not choose one that others could have made first.
fn shared_folder() -> Option<PathBuf> {
    if cfg!(windows) {
        std::env::var_os("ProgramData").map(|folder| PathBuf::from(folder).join("foilpress"))
    } else if cfg!(target_os = "macos") {
        Some("/Library/Application Support/foilpress".into())
    } else {
        Some("/var/lib/foilpress".into())
    }
}

/// Makes the folder all users share, for an administrator: everyone may add to it, and nobody remove what is another's.
pub fn make_shared_folder() -> Result<(), PrintersError> {
    let Some(folder) = shared_folder() else { return Ok(()) };
    durable::make_folder(&folder, Access::Everyone).map_err(io_error("make", &folder))?;
    #[cfg(unix)]
    fs::set_permissions(&folder, std::os::unix::fs::PermissionsExt::from_mode(0o1777))
        .map_err(io_error("make", &folder))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_unfinished_from_before_its_first_byte_until_it_ends_or_the_printer_is_reset() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let (one, two) = (Printer::Bridge(1), Printer::Bridge(2));
        let device = Printer::Device("/dev/usb/lp0".into());
        printers.begin(&one, "0000000a", Some(5)).unwrap();
        printers.begin(&one, "0000000b", Some(5)).unwrap();
        printers.begin(&two, "0000000c", None).unwrap();
        printers.begin(&device, "raw-7-1", None).unwrap();
        let count = |printer: &Printer| printers.unfinished(printer).unwrap().len();
        assert_eq!([&one, &two, &device].map(count), [2, 1, 1]);
        printers.close(&one, "0000000a").unwrap();
        printers.close(&one, "0000000a").unwrap();
        let left = Unfinished { job: "0000000b".into(), boot: Some(5) };
        // Another process sees the same.
        assert_eq!(Printers::at(folder.path()).unwrap().unfinished(&one).unwrap(), [left]);
        // One that begins behind the reset stays.
        let noted = printers.noted(Some(&one)).unwrap();
        printers.begin(&one, "0000000d", Some(5)).unwrap();
        printers.reset(&noted, Some(5)).unwrap();
        assert_eq!([&one, &two, &device].map(count), [2, 1, 1], "they may not have begun yet");
        printers.reset(&noted, Some(6)).unwrap();
        assert_eq!([&one, &two, &device].map(count), [1, 1, 1]);
        printers.reset(&printers.noted(Some(&one)).unwrap(), None).unwrap();
        assert_eq!([&one, &two, &device].map(count), [0, 1, 1]);
        printers.reset(&printers.noted(None).unwrap(), None).unwrap();
        assert_eq!([&one, &two, &device].map(count), [0, 0, 0]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_another_user_closed_counts_and_is_cleared_away() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let printer = Printer::Bridge(1);
        printers.begin(&printer, "0000000a", Some(5)).unwrap();
        let open = printers.path("open", &printer, "0000000a");
        fs::copy(open, folder.path().join("closed.bridge-0000000000000001.0000000a.1")).unwrap();
        assert_eq!(printers.unfinished(&printer).unwrap(), []);
        // The same job has begun once more since, in another start of the bridge.
        printers
            .write(&printers.path("open", &printer, "0000000a"), &Fact { boot: Some(6), since: 1 })
            .unwrap();
        assert_eq!(printers.unfinished(&printer).unwrap().len(), 1);
        printers.close(&printer, "0000000a").unwrap();
        printers.begin(&printer, "0000000b", Some(5)).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(printers.unfinished(&printer).unwrap().len(), 1);
    }

    #[test]
    #[cfg(unix)]
    fn what_a_stranger_has_closed_stays_open_and_a_folder_in_place_of_a_note_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let printer = Printer::Bridge(1);
        fs::create_dir(folder.path().join("open.bridge-0000000000000001.0000000f")).unwrap();
        printers.begin(&printer, "0000000a", Some(5)).unwrap();
        let open = printers.path("open", &printer, "0000000a");
        let closed = folder.path().join("closed.bridge-0000000000000001.0000000a.1");
        fs::copy(&open, &closed).unwrap();
        assert_eq!(printers.unfinished(&printer).unwrap(), []);
        // Where the test may choose whose a file is.
        if std::os::unix::fs::lchown(&closed, Some(65_534), None).is_ok() {
            printers.begin(&printer, "0000000b", Some(5)).unwrap();
            assert_eq!(printers.unfinished(&printer).unwrap().len(), 2);
            // It hinders nobody who may, either.
            printers.write_closed(&open).unwrap();
            assert_eq!(printers.unfinished(&printer).unwrap().len(), 1);
        }
        printers.reset(&printers.noted(None).unwrap(), None).unwrap();
        assert_eq!(printers.unfinished(&printer).unwrap(), []);
    }

    #[test]
    #[cfg(unix)]
    fn a_file_that_cannot_be_read_and_a_link_count_as_the_worst_and_are_not_followed() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let printer = Printer::Bridge(1);
        let secret = folder.path().join("secret");
        fs::write(&secret, "{\"boot\":5,\"since\":0}").unwrap();
        let open = folder.path().join("open.bridge-0000000000000001.0000000a");
        symlink(&secret, &open).unwrap();
        let unknown = Unfinished { job: "0000000a".into(), boot: None };
        assert_eq!(printers.unfinished(&printer).unwrap(), std::slice::from_ref(&unknown));
        // A fact replaces the link; what it led to stays as it was.
        printers.begin(&printer, "0000000a", Some(6)).unwrap();
        assert!(fs::symlink_metadata(&open).unwrap().is_file());
        assert_eq!(fs::metadata(&open).unwrap().permissions().mode() & 0o777, 0o644);
        assert_eq!(fs::read_to_string(&secret).unwrap(), "{\"boot\":5,\"since\":0}");
        fs::write(&open, "half a fac").unwrap();
        assert_eq!(printers.unfinished(&printer).unwrap(), [unknown]);
    }

    #[test]
    fn a_printer_that_does_not_negotiate_is_remembered_by_its_bridge_until_one_there_does() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let (one, two) = (Printer::Bridge(1), Printer::Bridge(2));
        for _ in 0..2 {
            printers.note_one_way(&one, true).unwrap();
            assert!(printers.is_one_way(&one) && !printers.is_one_way(&two));
        }
        assert_eq!(printers.unfinished(&one).unwrap(), []);
        // A reset is no other printer.
        printers.reset(&printers.noted(None).unwrap(), None).unwrap();
        assert!(printers.is_one_way(&one));
        for _ in 0..2 {
            printers.note_one_way(&one, false).unwrap();
            assert!(!printers.is_one_way(&one));
        }
    }
}
