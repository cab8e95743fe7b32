//! Bounded reading of files, with a fingerprint of everything read and notes for the user.

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};

use super::archive::{Archive, MOST_ENTRIES};
use super::error::DocumentError;
use observe::Observer;

/// The most bytes in one file. An uncompressed 16-bit RGBA image of the largest page has 0.3 GB.
pub const MOST_BYTES: u64 = 1 << 30;

/// The most bytes in a settings file.
const MOST_SETTINGS: u64 = 1 << 20;

/// Reads the files of one document, and keeps their fingerprint and the notes for the user.
pub struct Source<'a> {
    /// Receives progress and notes.
    pub observer: &'a dyn Observer,
    /// What was assumed, in sentences.
    pub notes: Vec<String>,
    hash: Sha256,
    /// The archive that is read like a folder.
    archive: Option<Archive>,
}

impl<'a> Source<'a> {
    /// A source from which nothing has been read yet.
    pub fn new(observer: &'a dyn Observer) -> Source<'a> {
        Source { observer, notes: Vec::new(), hash: Sha256::new(), archive: None }
    }

    /// Adds a note, which the user sees now through the observer and later through the document.
    pub fn note(&mut self, text: String) {
        if !self.notes.contains(&text) {
            self.observer.note(&text);
            self.notes.push(text);
        }
    }

    /// Reads what is inside of a zip archive from now on, under the path of the archive.
    pub fn mount(&mut self, path: &Path) -> Result<(), DocumentError> {
        self.archive = Some(Archive::open(path, open_regular(path)?)?);
        Ok(())
    }

    /// The archive that a path leads into, and the path inside.
    fn within<'p>(&mut self, path: &'p Path) -> Option<(&mut Archive, &'p Path)> {
        let archive = self.archive.as_mut()?;
        let inside = archive.inside(path)?;
        Some((archive, inside))
    }

    /// Whether the path is a folder; an error if it does not exist.
    pub fn is_folder(&mut self, path: &Path) -> Result<bool, DocumentError> {
        if let Some((archive, inside)) = self.within(path) {
            return Ok(archive.is_folder(inside));
        }
        std::fs::metadata(path).map(|meta| meta.is_dir()).map_err(|source| DocumentError::Io {
            path: path.to_path_buf(),
            attempt: "open",
            source,
        })
    }

    /// Whether the path is an ordinary file.
    pub fn is_file(&mut self, path: &Path) -> bool {
        match self.within(path) {
            Some((archive, inside)) => archive.is_file(inside),
            None => path.is_file(),
        }
    }

    /// The names in a folder in order, and whether each is a folder; of a large folder a part.
    pub fn list(&mut self, folder: &Path) -> Result<Vec<(String, bool)>, DocumentError> {
        if let Some((archive, inside)) = self.within(folder) {
            return Ok(archive.list(inside).into_iter().collect());
        }
        let io = |source| DocumentError::Io { path: folder.to_path_buf(), attempt: "list", source };
        let mut list = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(io)?.take(MOST_ENTRIES) {
            let entry = entry.map_err(io)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            list.push((name, entry.path().is_dir()));
        }
        list.sort();
        Ok(list)
    }

    /// The first bytes of a file, at most 16; not part of the fingerprint.
    pub fn head(&mut self, path: &Path) -> Result<Vec<u8>, DocumentError> {
        if let Some((archive, inside)) = self.within(path) {
            return archive.head(inside).map_err(|source| DocumentError::Io {
                path: path.to_path_buf(),
                attempt: "read",
                source,
            });
        }
        let mut head = Vec::new();
        let file = open_regular(path)?;
        file.take(16).read_to_end(&mut head).map_err(|source| DocumentError::Io {
            path: path.to_path_buf(),
            attempt: "read",
            source,
        })?;
        Ok(head)
    }

    /// Reads a whole file of at most `most` bytes.
    pub fn read(&mut self, path: &Path, most: u64) -> Result<Vec<u8>, DocumentError> {
        let io = |source| DocumentError::Io { path: path.to_path_buf(), attempt: "read", source };
        let large = |found| DocumentError::Large {
            path: path.to_path_buf(),
            field: "size in bytes".into(),
            found,
            most,
        };
        let bytes = if let Some((archive, inside)) = self.within(path) {
            archive.read(inside, most).map_err(io)?
        } else {
            let file = open_regular(path)?;
            let length = file.metadata().map_err(io)?.len();
            if length > most {
                return Err(large(length));
            }
            let mut bytes = Vec::with_capacity(length as usize);
            // The file may grow while it is read.
            file.take(most + 1).read_to_end(&mut bytes).map_err(io)?;
            bytes
        };
        if bytes.len() as u64 > most {
            return Err(large(bytes.len() as u64));
        }
        self.take_in(&path.file_name().map_or_else(PathBuf::new, PathBuf::from).to_string_lossy(), &bytes);
        Ok(bytes)
    }

    /// Reads a whole settings file as text.
    pub fn read_text(&mut self, path: &Path) -> Result<String, DocumentError> {
        let bytes = self.read(path, MOST_SETTINGS)?;
        String::from_utf8(bytes).map_err(|error| DocumentError::Settings {
            path: path.to_path_buf(),
            problem: format!("not UTF-8 text (byte {})", error.utf8_error().valid_up_to()),
        })
    }

    /// Adds named bytes to the fingerprint.
    pub fn take_in(&mut self, name: &str, bytes: &[u8]) {
        // Lengths separate the parts, so that different sets of files never give the same bytes.
        self.hash.update((name.len() as u64).to_le_bytes());
        self.hash.update(name.as_bytes());
        self.hash.update((bytes.len() as u64).to_le_bytes());
        self.hash.update(bytes);
    }

    /// Returns the notes and the fingerprint.
    pub fn finish(self) -> (Vec<String>, String) {
        let digest = self.hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        (self.notes, digest)
    }
}

/// Whether a file that a document names is in the document's folder or below.
pub fn is_within(name: &str) -> bool {
    let plain = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    !name.is_empty() && !name.contains([':', '\\', '\0']) && Path::new(name).components().all(plain)
}

/// Opens a regular file. Reading from a pipe or a device could block forever.
fn open_regular(path: &Path) -> Result<File, DocumentError> {
    let io = |source| DocumentError::Io { path: path.to_path_buf(), attempt: "open", source };
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    File::open(path).map_err(io)
}
