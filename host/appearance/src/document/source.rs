//! Bounded reading of files, with a fingerprint of everything read and notes for the user.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

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
}

impl<'a> Source<'a> {
    /// A source from which nothing has been read yet.
    pub fn new(observer: &'a dyn Observer) -> Source<'a> {
        Source { observer, notes: Vec::new(), hash: Sha256::new() }
    }

    /// Adds a note, which the user sees now through the observer and later through the document.
    pub fn note(&mut self, text: String) {
        if !self.notes.contains(&text) {
            self.observer.note(&text);
            self.notes.push(text);
        }
    }

    /// Whether the path is a folder; an error if it does not exist.
    pub fn is_folder(&self, path: &Path) -> Result<bool, DocumentError> {
        std::fs::metadata(path).map(|meta| meta.is_dir()).map_err(|source| DocumentError::Io {
            path: path.to_path_buf(),
            attempt: "open",
            source,
        })
    }

    /// The first bytes of a file, at most 16; not part of the fingerprint.
    pub fn head(&self, path: &Path) -> Result<Vec<u8>, DocumentError> {
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
        let file = open_regular(path)?;
        let length = file.metadata().map_err(io)?.len();
        let large = |found| DocumentError::Large {
            path: path.to_path_buf(),
            field: "size in bytes".into(),
            found,
            most,
        };
        if length > most {
            return Err(large(length));
        }
        let mut bytes = Vec::with_capacity(length as usize);
        // The file may grow while it is read.
        file.take(most + 1).read_to_end(&mut bytes).map_err(io)?;
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

/// Opens a regular file. Reading from a pipe or a device could block forever.
fn open_regular(path: &Path) -> Result<File, DocumentError> {
    let io = |source| DocumentError::Io { path: path.to_path_buf(), attempt: "open", source };
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    File::open(path).map_err(io)
}
