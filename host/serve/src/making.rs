//! The sheets of a job, each in a file of a folder, while they are drawn and sent.
//!
//! Method: whoever draws adds files, and whoever sends waits for the next one; each says when it wants no more. Files of an
//! earlier process are there from the start. Cost: one sheet in memory for whoever reads it.

use std::borrow::Cow;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use queue::backend::Sheets;

/// The sheets of a job in a folder, while they are made.
pub struct Making {
    folder: PathBuf,
    state: Mutex<MakingState>,
    more: Condvar,
}

#[derive(Default)]
struct MakingState {
    /// Sheets that are there.
    count: usize,
    /// Whether no more will come.
    is_over: bool,
    /// Whether nobody wants more.
    is_enough: bool,
}

impl Making {
    /// With those that are there.
    pub fn of(folder: &Path) -> Making {
        let making = Making { folder: folder.to_path_buf(), state: Mutex::default(), more: Condvar::new() };
        let count = (1..).take_while(|&number| making.path(number).exists()).count();
        making.has(count);
        making
    }

    /// Its folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether nobody wants more.
    pub(crate) fn is_enough(&self) -> bool {
        self.state().is_enough
    }

    fn state(&self) -> MutexGuard<'_, MakingState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The file of a sheet, from 1.
    pub(crate) fn path(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{number:05}.rgl"))
    }

    /// So many sheets are there.
    pub(crate) fn has(&self, count: usize) {
        self.state().count = count;
        self.more.notify_all();
    }

    /// Whether so many sheets are there.
    pub(crate) fn holds(&self, count: u32) -> bool {
        self.state().count >= usize::try_from(count).unwrap_or(usize::MAX)
    }

    /// Nobody wants more.
    pub(crate) fn enough(&self) {
        self.state().is_enough = true;
    }

    /// No more will come once what is given back is dropped.
    pub(crate) fn until_over(&self) -> impl Drop + use<'_> {
        struct Over<'a>(&'a Making);
        impl Drop for Over<'_> {
            fn drop(&mut self) {
                self.0.state().is_over = true;
                self.0.more.notify_all();
            }
        }
        Over(self)
    }
}

impl Sheets for Making {
    fn count(&self) -> usize {
        self.state().count
    }

    fn sheet(&self, index: usize) -> io::Result<Option<Cow<'_, [u8]>>> {
        let mut state = self.state();
        while state.count <= index && !state.is_over {
            state = self.more.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let is_there = state.count > index;
        drop(state);
        is_there.then(|| Ok(Cow::Owned(fs::read(self.path(index + 1))?))).transpose()
    }
}
