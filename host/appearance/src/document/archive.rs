//! A zip archive as a shelf: a material as it was downloaded.
//!
//! Problem: material sites hand out zip files. They come from strangers, so nothing in them is believed.
//! Method: files are read where they lie in the archive and nothing is written to disk. Names must stay inside; no entry may be a
//! link, encrypted, or share its bytes with another; counts and sizes have limits, which hold for the bytes that come out,
//! whatever the archive says. The table of contents is counted before it is read.
//! Cost: one file at a time in memory. Limits: stored or deflated entries; what macOS adds under `__MACOSX` is left out; an archive
//! that holds nothing but an archive is read as that, and no deeper.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use files::FileError;
use files::shelf::{Kind, MOST_NAMES, Opened, Shelf};
use zip::ZipArchive;

use super::content::MOST_BYTES;
use super::error::DocumentError;

/// The most bytes that come out of one archive, of all the files that are read: four of the largest that a
/// document may have.
const MOST_OUT: u64 = 4 * MOST_BYTES;

/// The end of an archive, and where a comment behind it may push it: its record and 16 bits of length.
const TAIL: u64 = 22 + 0xffff;

/// A zip archive whose table of contents was read.
#[derive(Debug)]
pub(super) struct Archive {
    path: PathBuf,
    /// The number of each file by its path inside.
    files: BTreeMap<PathBuf, usize>,
    open: Mutex<Open>,
}

#[derive(Debug)]
struct Open {
    zip: ZipArchive<BufReader<Opened>>,
    /// The bytes that may still come out.
    left: u64,
}

impl Archive {
    /// Opens the archive of this path.
    pub(super) fn open(path: &Path, mut file: Opened) -> Result<Archive, DocumentError> {
        let wrong = |field: &str, problem: String| DocumentError::Field {
            path: path.to_path_buf(),
            field: field.into(),
            problem,
        };
        let broken = |error: zip::result::ZipError| wrong("zip", format!("cannot be read: {error}"));
        let many = |found| DocumentError::Large {
            path: path.to_path_buf(),
            field: "the number of files".into(),
            found,
            most: MOST_NAMES as u64,
        };
        let counted = entries(&mut file).map_err(files::io(path, "read"))?;
        if counted > MOST_NAMES as u64 {
            return Err(many(counted));
        }
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(broken)?;
        if zip.len() > MOST_NAMES {
            return Err(many(zip.len() as u64));
        }
        if zip.has_duplicate_names() || zip.has_overlapping_entries().map_err(broken)? {
            return Err(wrong(
                "zip",
                "files share a name or their bytes; no honest archive does that".into(),
            ));
        }
        let mut files = BTreeMap::new();
        for number in 0..zip.len() {
            let entry = zip.by_index_raw(number).map_err(broken)?;
            let name = entry.name().map_err(broken)?.replace('\\', "/");
            let inside = Path::new(&name).components().all(|part| matches!(part, Component::Normal(_)));
            if !inside || name.contains(['\0', ':']) {
                let shown: String =
                    name.chars().map(|c| if c.is_control() { '?' } else { c }).take(200).collect();
                return Err(wrong("zip", format!("`{shown}` lies outside of the archive")));
            }
            // The kind of a file is in the upper bits of its mode; none at all is a plain file, too.
            let kind = entry.unix_mode().unwrap_or(0) & 0o170_000;
            let plain = !entry.is_symlink() && (kind == 0 || kind == 0o100_000) && !entry.encrypted();
            if plain && !entry.is_dir() && !name.ends_with('/') && !name.starts_with("__MACOSX/") {
                files.insert(PathBuf::from(name), number);
            }
        }
        let open = Mutex::new(Open { zip, left: MOST_OUT });
        Ok(Archive { path: path.to_path_buf(), files, open })
    }

    /// The archive inside, if it is the only file: some sites pack what they pack.
    pub(super) fn only_archive(&self) -> Option<&Path> {
        let mut files = self.files.keys();
        let (only, others) = (files.next()?, files.next());
        let is_zip = only.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zip"));
        (is_zip && others.is_none()).then_some(only)
    }

    /// The path inside.
    fn inside<'p>(&self, path: &'p Path) -> io::Result<&'p Path> {
        path.strip_prefix(&self.path).map_err(|_| io::ErrorKind::NotFound.into())
    }
}

impl Shelf for Archive {
    fn kind(&self, path: &Path) -> io::Result<Kind> {
        let inside = self.inside(path)?;
        match () {
            () if self.files.contains_key(inside) => Ok(Kind::File),
            () if inside.as_os_str().is_empty() => Ok(Kind::Folder),
            () if self.files.keys().any(|file| file.starts_with(inside)) => Ok(Kind::Folder),
            () => Err(io::ErrorKind::NotFound.into()),
        }
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<(String, Kind)>> {
        let inside = self.inside(folder)?;
        let mut list = BTreeMap::new();
        for file in self.files.keys() {
            let Ok(rest) = file.strip_prefix(inside) else { continue };
            let mut parts = rest.components();
            if let Some(first) = parts.next() {
                let kind = if parts.next().is_some() { Kind::Folder } else { Kind::File };
                list.insert(first.as_os_str().to_string_lossy().into_owned(), kind);
            }
        }
        Ok(list.into_iter().collect())
    }

    fn open(&self, path: &Path) -> io::Result<Opened> {
        Ok(Opened::memory(self.start(path, MOST_BYTES)?))
    }

    fn start(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        let number = *self.files.get(self.inside(path)?).ok_or(io::ErrorKind::NotFound)?;
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let left = open.left;
        let entry = open.zip.by_index(number).map_err(io::Error::other)?;
        let mut bytes = Vec::new();
        // What the archive says about sizes is not believed.
        entry.take(most.min(left + 1)).read_to_end(&mut bytes)?;
        let Some(left) = left.checked_sub(bytes.len() as u64) else {
            let gib = MOST_OUT >> 30;
            return Err(io::Error::other(format!("the files of the archive hold more than {gib} GiB")));
        };
        open.left = left;
        Ok(bytes)
    }

    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        let bytes = self.start(path, most.saturating_add(1)).map_err(files::io(path, "read"))?;
        match bytes.len() as u64 {
            found if found > most => Err(FileError::Large { path: path.to_path_buf(), found, most }),
            _ => Ok(bytes),
        }
    }
}

/// The most entries that any record at the end of the file states.
fn entries(file: &mut Opened) -> io::Result<u64> {
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL + 76)))?;
    let mut tail = Vec::new();
    file.take(TAIL + 76).read_to_end(&mut tail)?;
    file.seek(SeekFrom::Start(0))?;
    let mut most = 0;
    for (at, window) in tail.windows(4).enumerate() {
        let number = |offset: usize, bytes: usize| {
            let field = tail.get(at + offset..at + offset + bytes)?;
            Some(field.iter().rev().fold(0u64, |sum, &byte| sum << 8 | u64::from(byte)))
        };
        let stated = match window {
            b"PK\x05\x06" => number(10, 2).filter(|&count| count != 0xffff),
            b"PK\x06\x06" => number(32, 8),
            _ => None,
        };
        most = most.max(stated.unwrap_or(0));
    }
    Ok(most)
}

#[cfg(test)]
mod tests;
