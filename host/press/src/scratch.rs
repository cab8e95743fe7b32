//! Temporary folders that go even when the program is stopped.
//!
//! A folder removes itself when it is dropped, but a program that is stopped drops nothing. So every folder stands in one
//! list, which the program goes through when it is stopped. The list's lock orders the two: whoever holds it
//! sees each folder either not made yet or listed.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// All folders there are. Nothing is made or given up while the guard lives.
pub fn folders() -> MutexGuard<'static, Vec<PathBuf>> {
    FOLDERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A temporary folder.
pub struct Scratch(TempDir);

impl Scratch {
    /// A hidden one in `parent`, so that what is made in it can be moved beside it.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn beside(parent: &Path) -> io::Result<Scratch> {
        let mut folders = folders();
        let folder = tempfile::Builder::new().prefix(".foilpress-").tempdir_in(parent)?;
        folders.push(folder.path().to_path_buf());
        Ok(Scratch(folder))
    }

    /// One where the system keeps temporary files.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn new() -> io::Result<Scratch> {
        Scratch::beside(&std::env::temp_dir())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Lets the folder stay, and says where. The guard shows that the list is in hand.
    pub fn keep(mut self, folders: &mut MutexGuard<'static, Vec<PathBuf>>) -> PathBuf {
        folders.retain(|path| path != self.0.path());
        self.0.disable_cleanup(true);
        self.0.path().to_path_buf()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // A path that stays listed is removed once more at worst.
        if let Ok(mut folders) = FOLDERS.try_lock() {
            folders.retain(|path| path != self.0.path());
        }
    }
}
