//! Temporary folders that are removed even if the program is interrupted.
//!
//! Problem: a folder removes itself when it is dropped, but an interrupted program drops nothing.
//! Method: one list has every folder, and the program removes the folders in the list when it is interrupted. The lock of the
//! list keeps the two apart: its holder sees each folder either listed or not yet made.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, TempDir};

const PREFIX: &str = ".foilpress-";

static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// The list of all folders. No folder is made or kept while the guard lives.
pub fn folders() -> MutexGuard<'static, Vec<PathBuf>> {
    FOLDERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Has a temporary folder made for this user alone.
pub fn private<'b, 'p, 's>(builder: &'b mut Builder<'p, 's>) -> &'b mut Builder<'p, 's> {
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder
}

/// A temporary folder.
pub struct Scratch(TempDir);

impl Scratch {
    /// Makes a hidden folder in `parent`, whose contents can then be moved beside it.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn beside(parent: &Path) -> io::Result<Scratch> {
        Scratch::made(tempfile::Builder::new().prefix(PREFIX), parent)
    }

    /// Makes a folder in the system's folder for temporary files, for this user alone.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn new() -> io::Result<Scratch> {
        Scratch::made(private(tempfile::Builder::new().prefix(PREFIX)), &std::env::temp_dir())
    }

    fn made(builder: &mut Builder<'_, '_>, parent: &Path) -> io::Result<Scratch> {
        let mut folders = folders();
        let folder = builder.tempdir_in(parent)?;
        folders.push(folder.path().to_path_buf());
        Ok(Scratch(folder))
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Keeps the folder and returns its path. The guard proves that the caller holds the list.
    pub fn keep(mut self, folders: &mut MutexGuard<'static, Vec<PathBuf>>) -> PathBuf {
        folders.retain(|path| path != self.0.path());
        self.0.disable_cleanup(true);
        self.0.path().to_path_buf()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // At worst, a path that stays in the list is removed once more.
        if let Ok(mut folders) = FOLDERS.try_lock() {
            folders.retain(|path| path != self.0.path());
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn what_a_document_leaves_on_the_way_is_for_its_owner_alone() {
        let folder = Scratch::new().unwrap();
        assert_eq!(std::fs::metadata(folder.path()).unwrap().permissions().mode() & 0o777, 0o700);
    }
}
