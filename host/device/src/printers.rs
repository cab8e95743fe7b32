//! Which devices may hold part of a job: notes that this computer keeps of printers without a bridge.
//!
//! Problem: a printer that has received part of a job takes whatever comes next as the rest of a row, and prints it as text. A bridge
//! knows where its printer stands; a device that takes bytes as they are tells nothing, so its next user must learn it from the last one.
//! Method: before the first byte of a job leaves, the file `open.DEVICE.JOB` is made durable. It is removed when the job has ended in an
//! orderly way, or when somebody says that the printer was switched off and on. The folder that all users share is sticky: nobody can
//! remove a file of another one, and lists it in `closed.ANY` instead. That counts for whoever wrote it, and for everybody if root
//! or the note's owner did, and has given it one name only. Every folder that can be read is read; the first that can be written is
//! written. Links are never followed.
//! Limits: whatever lies there that is no note costs a question at most, and never a sheet.
//! Source: `docs/decisions/where-the-printer-stands.md`.

use std::collections::HashMap;
use std::fmt;
use std::fs::{self, File, Metadata};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use protocol::link::frame::checksum;

use crate::transit::journal::{Journal, JournalError};
use files::durable::{self, Access};

/// A list of many thousand notes is smaller.
const LARGEST: u64 = 4 << 20;

/// A printer, as this computer tells it from others.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Printer {
    /// The one at the bridge with this serial number.
    Bridge(u64),
    /// The one at a device that takes its bytes as they are.
    Device(PathBuf),
}

impl fmt::Display for Printer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Printer::Bridge(serial) => write!(f, "the printer at bridge {serial:016x}"),
            Printer::Device(path) => write!(f, "the printer at {}", path.display()),
        }
    }
}

/// Why the notes cannot be used. Nothing is sent then.
#[derive(Debug, thiserror::Error)]
pub enum PrintersError {
    /// There is no place for them.
    #[error("found no folder for the state of printers")]
    NoFolder(#[from] JournalError),
    /// The file system refuses.
    #[error("cannot {what} {}, which records the printers that may hold part of a job", path.display())]
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

/// A note that a device may hold part of a job.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Note(PathBuf);

/// The notes of this computer, and its place for what all users count together ([`crate::ledger`]).
#[derive(Clone, Debug)]
pub struct Printers {
    /// Where notes are read: the folder that all users share, then one of this user's own.
    folders: Vec<PathBuf>,
    /// Which of them is written.
    written: usize,
}

impl Printers {
    /// `FOILPRESS_PRINTERS` alone; else the folder that all users share and one of this user's own.
    pub fn of_system() -> Result<Printers, PrintersError> {
        if let Some(folder) = std::env::var_os("FOILPRESS_PRINTERS").filter(|value| !value.is_empty()) {
            return Printers::at(Path::new(&folder));
        }
        let shared = shared_folder();
        let own = Journal::of_user().map(|journal| journal.folder().join("printers"));
        if let Some(shared) = &shared
            && tempfile::Builder::new().prefix(".try.").tempfile_in(shared).is_ok()
        {
            return Ok(Printers {
                folders: [shared.clone()].into_iter().chain(own.ok()).collect(),
                written: 0,
            });
        }
        let own = own?;
        durable::make_folder(&own, Access::Everyone).map_err(io_error("make", &own))?;
        let folders: Vec<PathBuf> = shared.into_iter().chain([own]).collect();
        Ok(Printers { written: folders.len() - 1, folders })
    }

    /// The notes in this folder, which is made if need be.
    pub fn at(folder: &Path) -> Result<Printers, PrintersError> {
        durable::make_folder(folder, Access::Everyone).map_err(io_error("make", folder))?;
        Ok(Printers { folders: vec![folder.to_path_buf()], written: 0 })
    }

    /// The folder that is written.
    pub fn folder(&self) -> &Path {
        &self.folders[self.written]
    }

    /// The folder that would be written if that of all users could be, or could not.
    pub(crate) fn other(&self) -> Option<&Path> {
        self.folders.iter().find(|folder| *folder != self.folder()).map(PathBuf::as_path)
    }

    /// What whoever prints on a device should know: that other users do not learn of a job that breaks off.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.written > 0).then(|| {
            format!(
                "{} cannot be written, so other users and print queues do not learn of a job that leaves the printer in need of a \
                 reset; the Debian package and `foilpress queue install` make that folder",
                self.folders[0].display()
            )
        })
    }

    /// Notes, before its first byte leaves, that the device may hold a part of this job. When this returns it is on disk.
    pub fn begin(&self, device: &Path, job: &str) -> Result<Note, PrintersError> {
        let path = self.folder().join(format!("{}{job}", prefix(device)));
        self.write(&path, &[])?;
        Ok(Note(path))
    }

    /// The jobs of which this device may hold a part; without one, those of all devices.
    pub fn noted(&self, device: Option<&Path>) -> Result<Vec<Note>, PrintersError> {
        let prefix = device.map_or_else(|| OPEN.into(), prefix);
        let (mut open, mut closed) = (Vec::new(), HashMap::<String, Vec<u32>>::new());
        for folder in &self.folders {
            let listing = match fs::read_dir(folder) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                listing => listing.map_err(io_error("read", folder))?,
            };
            for name in listing.filter_map(|item| item.ok()?.file_name().into_string().ok()) {
                let path = folder.join(&name);
                let Ok(found) = path.symlink_metadata() else { continue };
                // A folder, or whatever else somebody has put there, is no note; a link is one of which nothing is known.
                if name.starts_with(&prefix) && (found.is_file() || found.is_symlink()) {
                    open.push((path, name, owner(&found)));
                } else if name.starts_with(CLOSED) {
                    for name in list(&path, &found) {
                        closed.entry(name).or_default().push(owner(&found));
                    }
                }
            }
        }
        let counts = |name: &str, own: u32| {
            closed
                .get(name)
                .is_some_and(|owners| owners.iter().any(|&owner| [own, 0, user()].contains(&owner)))
        };
        Ok(open
            .into_iter()
            .filter(|(_, name, own)| !counts(name, *own))
            .map(|(path, ..)| Note(path))
            .collect())
    }

    /// Notes that the device holds nothing any more of what was noted.
    pub fn close(&self, notes: &[Note]) -> Result<(), PrintersError> {
        let mut others = Vec::new();
        for Note(path) in notes {
            match fs::remove_file(path) {
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                // Another user's in a sticky folder, or in one that cannot be written.
                Err(_) => others.extend(path.file_name().map(|name| name.to_string_lossy().into_owned())),
            }
        }
        if !others.is_empty() {
            let moment = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            let any = checksum(format!("{} {}", moment.as_nanos(), std::process::id()).as_bytes());
            self.write(&self.folder().join(format!("{CLOSED}{any:08x}")), &others)?;
        }
        self.tidy();
        durable::sync_folder(self.folder()).map_err(io_error("write", self.folder()))
    }

    /// Puts a whole file under its name, readable for everyone whatever this user's mask is.
    fn write(&self, path: &Path, list: &[String]) -> Result<(), PrintersError> {
        let text = serde_json::to_vec(list).map_err(|error| io_error("write", path)(error.into()))?;
        durable::write(path, &text, Access::Everyone).map_err(io_error("write", path))
    }

    /// Removes this user's lists of notes of which none is there any more.
    fn tidy(&self) {
        let names = fs::read_dir(self.folder()).into_iter().flatten();
        for path in names.filter_map(|item| Some(item.ok()?.path())) {
            let is_list = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(CLOSED));
            let Some(found) = path.symlink_metadata().ok().filter(|_| is_list) else { continue };
            let there = |name: &String| {
                self.folders.iter().any(|folder| folder.join(name).symlink_metadata().is_ok())
            };
            if owner(&found) == user() && !list(&path, &found).iter().any(there) {
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// How the names of notes begin, and of lists of those that are closed.
const OPEN: &str = "open.device";
const CLOSED: &str = "closed.";

/// How the names of a device's notes begin: no dots and no separators but those at the ends.
fn prefix(device: &Path) -> String {
    // The same device by another name, such as a link made by udev, is the same printer.
    let path = fs::canonicalize(device).unwrap_or_else(|_| device.to_path_buf());
    let text = path.to_string_lossy();
    let plain = text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(80);
    format!("{OPEN}{}-{:08x}.", plain.collect::<String>(), checksum(text.as_bytes()))
}

/// The notes that a file lists; none if it is no list, or has another name that its owner may not know of.
fn list(path: &Path, found: &Metadata) -> Vec<String> {
    if !found.is_file() || names(found) != 1 {
        return Vec::new();
    }
    let mut text = Vec::new();
    let read = File::open(path).and_then(|file| file.take(LARGEST).read_to_end(&mut text));
    read.ok().and_then(|_| serde_json::from_slice(&text).ok()).unwrap_or_default()
}

#[cfg(unix)]
fn names(found: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(found)
}

#[cfg(unix)]
fn owner(found: &Metadata) -> u32 {
    std::os::unix::fs::MetadataExt::uid(found)
}

#[cfg(unix)]
fn user() -> u32 {
    rustix::process::geteuid().as_raw()
}

#[cfg(not(unix))]
fn names(_: &Metadata) -> u64 {
    1
}

#[cfg(not(unix))]
fn owner(_: &Metadata) -> u32 {
    0
}

#[cfg(not(unix))]
fn user() -> u32 {
    0
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

    const ONE: &str = "/dev/usb/lp0";
    const TWO: &str = "/dev/usb/lp1";

    fn count(printers: &Printers, device: Option<&str>) -> usize {
        printers.noted(device.map(Path::new)).unwrap().len()
    }

    #[test]
    fn a_job_is_noted_from_before_its_first_byte_until_it_ends_or_the_printer_was_switched() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let first = printers.begin(Path::new(ONE), "raw-7-1").unwrap();
        printers.begin(Path::new(ONE), "raw-7-2").unwrap();
        printers.begin(Path::new(TWO), "raw-7-3").unwrap();
        // Another process sees the same.
        let printers = Printers::at(folder.path()).unwrap();
        assert_eq!([Some(ONE), Some(TWO), None].map(|device| count(&printers, device)), [2, 1, 3]);
        printers.close(&[first]).unwrap();
        assert_eq!([Some(ONE), Some(TWO), None].map(|device| count(&printers, device)), [1, 1, 2]);
        printers.close(&printers.noted(None).unwrap()).unwrap();
        assert_eq!((count(&printers, None), fs::read_dir(folder.path()).unwrap().count()), (0, 0));
    }

    #[test]
    fn what_cannot_be_written_is_read_and_what_lies_there_and_is_no_note_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let [shared, own] = ["shared", "own"].map(|name| folder.path().join(name));
        let theirs = Printers::at(&shared).unwrap().begin(Path::new(ONE), "raw-7-1").unwrap();
        fs::create_dir_all(&own).unwrap();
        let printers = Printers { folders: vec![shared.clone(), own.clone()], written: 1 };
        assert_eq!(printers.noted(Some(Path::new(ONE))).unwrap(), std::slice::from_ref(&theirs));
        printers.begin(Path::new(ONE), "raw-8-1").unwrap();
        assert_eq!((count(&printers, Some(ONE)), fs::read_dir(&own).unwrap().count()), (2, 1));
        // A folder in the note's place cannot be removed as a file can: what is not ours is listed.
        fs::create_dir(shared.join(format!("{}raw-9", prefix(Path::new(ONE))))).unwrap();
        assert_eq!(count(&printers, Some(ONE)), 2, "a folder is no note");
        let Note(path) = &theirs;
        fs::remove_file(path).unwrap();
        fs::create_dir(path).unwrap();
        printers.close(std::slice::from_ref(&theirs)).unwrap();
        fs::remove_dir(path).unwrap();
        fs::write(path, "").unwrap();
        assert_eq!(count(&printers, Some(ONE)), 1, "the list in the other folder counts");
        fs::remove_file(path).unwrap();
        printers.close(&printers.noted(None).unwrap()).unwrap();
        assert_eq!(fs::read_dir(&own).unwrap().count(), 0, "a list of what is gone goes, too");
    }

    #[test]
    #[cfg(unix)]
    fn what_a_stranger_has_closed_stays_open_and_so_does_what_has_another_name() {
        let folder = tempfile::tempdir().unwrap();
        let printers = Printers::at(folder.path()).unwrap();
        let Note(open) = printers.begin(Path::new(ONE), "raw-7-1").unwrap();
        let closed = folder.path().join("closed.1");
        fs::write(&closed, serde_json::to_vec(&[open.file_name().unwrap().to_str()]).unwrap()).unwrap();
        assert_eq!(count(&printers, None), 0);
        fs::hard_link(&closed, folder.path().join("closed.2")).unwrap();
        assert_eq!(count(&printers, None), 1, "one of the names may be a stranger's");
        fs::remove_file(folder.path().join("closed.2")).unwrap();
        // Where the test may choose whose a file is.
        if std::os::unix::fs::lchown(&closed, Some(65_534), None).is_ok() {
            assert_eq!(count(&printers, None), 1);
            std::os::unix::fs::lchown(&open, Some(65_534), None).unwrap();
            assert_eq!(count(&printers, None), 0, "of their own note everybody may say that it is closed");
        }
        for name in ["closed.3", "open.device.x"] {
            std::os::unix::fs::symlink("/dev/zero", folder.path().join(name)).unwrap();
        }
        assert!(
            count(&printers, None) > 0,
            "a link is a note of which nothing is known, and is not followed"
        );
    }
}
