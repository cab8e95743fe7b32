//! Where documents and libraries stand: on disk, or in memory.
//!
//! Problem: a document is one file or many, comes from strangers, and may lie on disk, in an archive, or in
//! the memory of another program. A reader that opens files itself works with the first only, and judges each
//! danger anew. Method: readers see a [`Shelf`]. It says what stands at a path and opens regular files,
//! nothing else: a pipe or a device, or a link to one, could block forever. [`Shelf::read`] takes a limit. A
//! name that stands inside a document goes through [`inside`], which refuses whatever could lead out of the
//! document's folder. Cost: one virtual call for each file that is opened or read.
//! Limits: a folder shows at most [`MOST_NAMES`] names. Links on disk are followed, as they are the user's
//! own; [`Memory`] has none. [`Memory`] refuses `..`, as it has no folder above; only [`Shelf::resolved`]
//! follows it, as far as it stays within.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::fs::{self, File};
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::ops::Bound;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::FileError;

/// The most names that a folder shows.
pub const MOST_NAMES: usize = 10_000;

/// What stands at a path.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Kind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// Something else that has a name, such as a pipe, a device or a link to nothing.
    Other,
}

/// Files and folders by their paths.
pub trait Shelf: Debug + Send + Sync {
    /// What stands at a path; links are followed.
    ///
    /// # Errors
    /// Nothing stands there, or the system refuses.
    fn kind(&self, path: &Path) -> io::Result<Kind>;

    /// The names in a folder in order, and what each is; of a large folder a part.
    ///
    /// # Errors
    /// No folder, or the system refuses.
    fn list(&self, folder: &Path) -> io::Result<Vec<(String, Kind)>>;

    /// Opens a regular file.
    ///
    /// # Errors
    /// Nothing stands there, it is no regular file, or the system refuses.
    fn open(&self, path: &Path) -> io::Result<Opened>;

    /// The first bytes of a regular file, at most `most`.
    ///
    /// # Errors
    /// As [`Shelf::open`], and what goes wrong while it is read.
    fn start(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        let opened = self.open(path)?;
        let mut bytes = Vec::with_capacity(usize::try_from(opened.size.min(most)).unwrap_or_default());
        opened.take(most).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// The bytes of a regular file that has at most `most`.
    ///
    /// # Errors
    /// A file that is missing, no regular file, or too large.
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        let large = |found| FileError::Large { path: path.to_path_buf(), found, most };
        let opened = self.open(path).map_err(crate::io(path, "open"))?;
        if opened.size > most {
            return Err(large(opened.size));
        }
        let mut bytes = Vec::with_capacity(usize::try_from(opened.size).unwrap_or_default());
        // The file may grow while it is read, and some systems have files that state no length.
        opened.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(crate::io(path, "read"))?;
        if bytes.len() as u64 > most {
            return Err(large(bytes.len() as u64));
        }
        Ok(bytes)
    }

    /// Whether a regular file stands at a path.
    fn is_file(&self, path: &Path) -> bool {
        self.kind(path).is_ok_and(|kind| kind == Kind::File)
    }

    /// A path without links, `.` and `..`, of something that stands there: what a document links may lead up
    /// and down again, and a path without these tells where it ends.
    ///
    /// # Errors
    /// As [`Shelf::kind`].
    fn resolved(&self, path: &Path) -> io::Result<PathBuf> {
        let mut found = PathBuf::new();
        for part in path.components() {
            match part {
                Component::ParentDir if !found.pop() => return place(path),
                Component::ParentDir | Component::CurDir => {}
                part => found.push(part),
            }
        }
        self.kind(&found).map(|_| found)
    }

    /// Whether other programs see these files by the same paths.
    fn is_disk(&self) -> bool {
        false
    }

    /// Whether a folder stands at a path.
    fn is_folder(&self, path: &Path) -> bool {
        self.kind(path).is_ok_and(|kind| kind == Kind::Folder)
    }
}

trait Input: Debug + Read + Seek + Send {}

impl<T: Debug + Read + Seek + Send> Input for T {}

/// An open file.
#[derive(Debug)]
pub struct Opened {
    size: u64,
    input: Box<dyn Input>,
}

impl Opened {
    /// A file in memory.
    pub fn memory(bytes: impl AsRef<[u8]> + Debug + Send + 'static) -> Opened {
        Opened { size: bytes.as_ref().len() as u64, input: Box::new(Cursor::new(bytes)) }
    }

    /// Its length in bytes when it was opened.
    pub fn size(&self) -> u64 {
        self.size
    }
}

impl Read for Opened {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.input.read(buffer)
    }
}

impl Seek for Opened {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.input.seek(to)
    }
}

/// The path of a file that a document names, in the folder `base` or below. Nothing for a name that could
/// lead out of it: one with `..`, an absolute one, a drive's letter or a stream's colon, and a backslash,
/// which only some systems take for a separator.
pub fn inside(base: &Path, name: &str) -> Option<PathBuf> {
    let plain = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    let within =
        !name.is_empty() && !name.contains([':', '\\', '\0']) && Path::new(name).components().all(plain);
    within.then(|| base.join(name))
}

fn not_regular() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")
}

/// The disk of this computer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

fn kind_of(about: &fs::Metadata) -> Kind {
    match about {
        about if about.is_file() => Kind::File,
        about if about.is_dir() => Kind::Folder,
        _ => Kind::Other,
    }
}

/// A folder, which has a name even if it is the one that all names start from.
fn named(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

impl Shelf for Disk {
    fn resolved(&self, path: &Path) -> io::Result<PathBuf> {
        named(path).canonicalize()
    }

    fn is_disk(&self) -> bool {
        true
    }

    fn kind(&self, path: &Path) -> io::Result<Kind> {
        fs::metadata(named(path)).map(|about| kind_of(&about))
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<(String, Kind)>> {
        let mut list = Vec::new();
        for entry in fs::read_dir(named(folder))?.take(MOST_NAMES) {
            let entry = entry?;
            let kind = fs::metadata(entry.path()).map_or(Kind::Other, |about| kind_of(&about));
            list.push((entry.file_name().to_string_lossy().into_owned(), kind));
        }
        list.sort();
        Ok(list)
    }

    fn open(&self, path: &Path) -> io::Result<Opened> {
        // Opening a pipe waits for its other end, so it is looked at first.
        if self.kind(path)? != Kind::File {
            return Err(not_regular());
        }
        let file = File::open(path)?;
        let about = file.metadata()?;
        // Its name may have changed hands between the two.
        if !about.is_file() {
            return Err(not_regular());
        }
        Ok(Opened { size: about.len(), input: Box::new(file) })
    }
}

/// Files in memory. Folders are there as far as files are in them.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    files: BTreeMap<PathBuf, Arc<[u8]>>,
}

impl Memory {
    /// Puts a file at a path, in place of what was there.
    ///
    /// # Errors
    /// A path with `..`, one that is no file's name, or one at which a folder stands or that leads through a
    /// file.
    pub fn insert(&mut self, path: impl AsRef<Path>, bytes: impl Into<Arc<[u8]>>) -> io::Result<()> {
        let path = place(path.as_ref())?;
        if path.file_name().is_none() || self.is_folder(&path) {
            return Err(not_regular());
        }
        if self.leads_through_file(&path) {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        self.files.insert(path, bytes.into());
        Ok(())
    }

    fn leads_through_file(&self, path: &Path) -> bool {
        path.ancestors().skip(1).any(|above| self.files.contains_key(above))
    }

    /// The parts of the paths that begin with a folder's, behind it.
    fn below<'a>(&'a self, folder: &'a Path) -> impl Iterator<Item = &'a Path> {
        // Paths are in the order of their parts, so those below a folder follow it without a gap.
        let from = (Bound::Included(folder), Bound::Unbounded);
        let paths = self.files.range::<Path, _>(from).map(|(path, _)| path);
        paths
            .map_while(move |path| path.strip_prefix(folder).ok())
            .filter(|rest| !rest.as_os_str().is_empty())
    }
}

/// A path without `.`, as files are kept under; one with `..` is none.
fn place(path: &Path) -> io::Result<PathBuf> {
    if path.components().any(|part| part == Component::ParentDir) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "`..` leads out of the files in memory"));
    }
    Ok(path.components().filter(|part| *part != Component::CurDir).collect())
}

impl Shelf for Memory {
    fn kind(&self, path: &Path) -> io::Result<Kind> {
        let path = place(path)?;
        match () {
            () if self.files.contains_key(&path) => Ok(Kind::File),
            () if path.as_os_str().is_empty() || self.below(&path).next().is_some() => Ok(Kind::Folder),
            () if self.leads_through_file(&path) => Err(io::ErrorKind::NotADirectory.into()),
            () => Err(io::ErrorKind::NotFound.into()),
        }
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<(String, Kind)>> {
        if self.kind(folder)? != Kind::Folder {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        let folder = place(folder)?;
        let mut names = BTreeSet::new();
        for rest in self.below(&folder) {
            let mut parts = rest.components();
            let name = parts.next().map(|first| first.as_os_str().to_string_lossy().into_owned());
            let kind = if parts.next().is_some() { Kind::Folder } else { Kind::File };
            names.extend(name.map(|name| (name, kind)));
        }
        Ok(names.into_iter().take(MOST_NAMES).collect())
    }

    fn open(&self, path: &Path) -> io::Result<Opened> {
        match self.kind(path)? {
            Kind::File => Ok(Opened::memory(Arc::clone(&self.files[&place(path)?]))),
            _ => Err(not_regular()),
        }
    }
}

#[cfg(test)]
mod tests;
