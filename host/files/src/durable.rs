//! Files and folders that are on disk, whole, once this says so: one way to write whatever has to outlive a crash.
//!
//! Problem: a program may be killed, and a computer lose its supply, between any two steps. What stands under a file's name
//! afterwards must be its old contents or its new ones, and once the caller was told that it is written, the new ones.
//! Method: write under a hidden name in the same folder, sync the file, rename it, sync the folder. Without the first sync the
//! new name may lead to an empty file; without the second, the old contents may come back. [`place`] does the same with a
//! file or a whole folder that was written elsewhere. A folder cannot replace another by a rename, so the two change places.
//! Cost: two syncs for a file, one more for each file and folder inside a folder.
//! Limits: systems other than Unix cannot sync folders; there a crash may bring the old contents back. Where folders cannot
//! change places, the old one is moved away first, so a crash may find it only there. A crash may also leave a
//! file whose name begins with [`STAGED`]. Nobody reads such a file, and it can be removed.
//! Source: the guarantees of `fsync` and `rename` in POSIX.1-2017; a model of a disk that keeps no more than these checks the steps.

use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// How the names of files begin that are not finished.
pub const STAGED: &str = ".new.";

/// The bytes that are free where a folder stands; `None` where the system does not tell.
#[must_use]
pub fn free(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let found = rustix::fs::statvfs(folder).ok()?;
        Some(found.f_bavail.saturating_mul(found.f_frsize))
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

/// Whether something failed because the disk, or somebody's share of it, is full.
#[must_use]
pub fn is_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut next = Some(error);
    while let Some(error) = next {
        let of_system = error.downcast_ref::<io::Error>();
        let kind = of_system.map(io::Error::kind);
        if matches!(kind, Some(io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)) {
            return true;
        }
        // One of the system may hold another one, which says why.
        next = match of_system.and_then(io::Error::get_ref) {
            Some(held) => Some(held),
            None => error.source(),
        };
    }
    false
}

/// Who may read a file. Only its owner may change it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Access {
    /// Its owner.
    Private,
    /// Everyone, whatever the owner's mask says.
    Everyone,
    /// Everyone, who may also run it.
    Program,
}

impl Access {
    #[cfg(unix)]
    fn mode(self) -> u32 {
        match self {
            Access::Private => 0o600,
            Access::Everyone => 0o644,
            Access::Program => 0o755,
        }
    }
}

/// Puts a file with these contents under its name, in place of what was there. A link is replaced, not followed.
///
/// # Errors
/// What the system says. The old contents are still there, or the new ones already, but never a part of them.
pub fn write(path: &Path, contents: &[u8], access: Access) -> io::Result<()> {
    write_on(&mut System, path, contents, access)
}

/// Moves a file, or a folder with everything in it, to its name on the same file system, in place of what was there. What
/// a folder replaces is then beside where the new one was, or in its place.
///
/// # Errors
/// What the system says. It is still where it was, or whole under its new name.
pub fn place(from: &Path, to: &Path) -> io::Result<()> {
    place_on(&mut System, from, to)
}

/// Makes a folder and those above it, as far as they are missing. A private one is for its owner alone; who may look into another one,
/// the owner's mask says.
///
/// # Errors
/// What the system says.
pub fn make_folder(path: &Path, access: Access) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    let above = folder_of(path);
    make_folder(above, access)?;
    let mut folder = fs::DirBuilder::new();
    #[cfg(unix)]
    if access == Access::Private {
        std::os::unix::fs::DirBuilderExt::mode(&mut folder, 0o700);
    }
    #[cfg(not(unix))]
    let _ = (access, &mut folder);
    match folder.create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => {}
        made => made?,
    }
    sync_folder(above)
}

/// Makes the names in a folder durable: of a file that was made there, and that of one that was removed is gone for good.
///
/// # Errors
/// What the system says.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    System.sync(path)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The steps that a file takes to the disk.
trait Disk {
    /// Makes an empty file under a hidden name that no other has.
    fn create(&mut self, folder: &Path, access: Access) -> io::Result<PathBuf>;
    /// Fills it.
    fn fill(&mut self, file: &Path, contents: &[u8]) -> io::Result<()>;
    /// What is in a folder; nothing in a file.
    fn inside(&mut self, path: &Path) -> io::Result<Vec<PathBuf>>;
    /// Makes the contents of a file, or the names in a folder, durable.
    fn sync(&mut self, path: &Path) -> io::Result<()>;
    /// Gives a file or folder another name. A file takes that of another.
    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()>;
    /// Whether it is a folder.
    fn is_folder(&mut self, path: &Path) -> bool;
    /// Two folders change places. An error of [`io::ErrorKind::Unsupported`] if this system has no such thing.
    fn exchange(&mut self, one: &Path, other: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove(&mut self, file: &Path) -> io::Result<()>;
}

fn write_on(disk: &mut impl Disk, path: &Path, contents: &[u8], access: Access) -> io::Result<()> {
    let staged = disk.create(folder_of(path), access)?;
    let written = disk.fill(&staged, contents).and_then(|()| place_on(disk, &staged, path));
    if written.is_err() {
        // If it has its name already, nothing is there to remove.
        let _ = disk.remove(&staged);
    }
    written
}

fn place_on(disk: &mut impl Disk, from: &Path, to: &Path) -> io::Result<()> {
    sync_all(disk, from)?;
    if disk.is_folder(to) {
        match disk.exchange(from, to) {
            Err(error) if error.kind() == io::ErrorKind::Unsupported => {
                let mut aside = from.as_os_str().to_owned();
                aside.push(".replaced");
                disk.rename(to, Path::new(&aside))?;
                if let Err(error) = disk.rename(from, to) {
                    // If even that fails, the old folder is where it was put.
                    let _ = disk.rename(Path::new(&aside), to);
                    return Err(error);
                }
            }
            exchanged => exchanged?,
        }
    } else {
        disk.rename(from, to)?;
    }
    disk.sync(folder_of(to))
}

fn sync_all(disk: &mut impl Disk, path: &Path) -> io::Result<()> {
    for inner in disk.inside(path)? {
        sync_all(disk, &inner)?;
    }
    disk.sync(path)
}

/// The disk of this computer.
struct System;

impl Disk for System {
    fn create(&mut self, folder: &Path, access: Access) -> io::Result<PathBuf> {
        let file = tempfile::Builder::new().prefix(STAGED).tempfile_in(folder)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            file.as_file().set_permissions(fs::Permissions::from_mode(access.mode()))?;
        }
        #[cfg(not(unix))]
        let _ = access;
        Ok(file.into_temp_path().keep()?)
    }

    fn fill(&mut self, file: &Path, contents: &[u8]) -> io::Result<()> {
        OpenOptions::new().write(true).open(file)?.write_all(contents)
    }

    fn inside(&mut self, path: &Path) -> io::Result<Vec<PathBuf>> {
        match fs::symlink_metadata(path)?.is_dir() {
            true => fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect(),
            false => Ok(Vec::new()),
        }
    }

    fn sync(&mut self, path: &Path) -> io::Result<()> {
        let is_folder = path.is_dir();
        if is_folder && !cfg!(unix) {
            return Ok(());
        }
        // Windows syncs only what may be written.
        OpenOptions::new().read(true).write(!cfg!(unix)).open(path).and_then(|file| file.sync_all())
    }

    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn is_folder(&mut self, path: &Path) -> bool {
        fs::symlink_metadata(path).is_ok_and(|found| found.is_dir())
    }

    #[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
    fn exchange(&mut self, one: &Path, other: &Path) -> io::Result<()> {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        use rustix::io::Errno;
        renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE).map_err(|error| match error {
            // File systems that cannot do it say so in each of these ways.
            Errno::INVAL | Errno::NOSYS | Errno::NOTSUP => io::ErrorKind::Unsupported.into(),
            error => error.into(),
        })
    }

    #[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
    fn exchange(&mut self, _: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        fs::remove_file(file)
    }
}

#[cfg(test)]
mod tests;
