//! Bounded reading of a shelf's files, with a fingerprint of everything read and notes for the user.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use files::shelf::{Kind, Opened, Shelf};
use sha2::{Digest, Sha256};

use super::archive::Archive;
use super::content::{MOST_BYTES, name_of};
use super::error::{DocumentError, list};
use super::names::is_picture;
use observe::Observer;

/// The most bytes in a settings file: far more than anybody writes, few enough for hostile ones.
const MOST_SETTINGS: u64 = 1 << 20;

/// The most bytes by which a format is recognised.
const HEAD: u64 = 16;

/// Reads the files of one document, and keeps their fingerprint and the notes for the user.
pub struct Source<'a> {
    /// Receives progress and notes.
    pub observer: &'a dyn Observer,
    /// What was assumed, in sentences.
    pub notes: Vec<String>,
    hash: Sha256,
    shelf: &'a dyn Shelf,
    /// Files that were read, and whether pictures beside them that were not are told.
    read: Vec<PathBuf>,
    tells_unread: bool,
    /// The archive that is read in place of the shelf.
    archive: Option<Archive>,
}

impl<'a> Source<'a> {
    /// A source from which nothing has been read yet.
    pub fn new(shelf: &'a dyn Shelf, observer: &'a dyn Observer) -> Source<'a> {
        Source {
            observer,
            notes: Vec::new(),
            hash: Sha256::new(),
            shelf,
            read: Vec::new(),
            tells_unread: false,
            archive: None,
        }
    }

    /// Where its files stand.
    pub fn shelf(&self) -> &dyn Shelf {
        self.archive.as_ref().map_or(self.shelf, |archive| archive as &dyn Shelf)
    }

    /// Adds a note, which the user sees now through the observer and later through the document.
    pub fn note(&mut self, text: String) {
        if !self.notes.contains(&text) {
            self.observer.note(&text);
            self.notes.push(text);
        }
    }

    /// Reads what is inside of a zip archive from now on, under the path of the archive, and nothing else.
    pub fn mount(&mut self, path: &Path) -> Result<(), DocumentError> {
        let opened = self.shelf.open(path).map_err(files::io(path, "open"))?;
        let archive = Archive::open(path, opened)?;
        let inner = match archive.only_archive() {
            None => archive,
            Some(inner) => {
                self.note(format!("{}: {} in it is read", path.display(), inner.display()));
                let bytes = archive.read(&path.join(inner), MOST_BYTES)?;
                Archive::open(path, Opened::memory(bytes))?
            }
        };
        self.archive = Some(inner);
        Ok(())
    }

    /// The name of what is stored at a path.
    pub fn name_of(&self, path: &Path) -> String {
        name_of(self.shelf, path)
    }

    /// Whether the path is a folder; an error if it does not exist.
    pub fn is_folder(&self, path: &Path) -> Result<bool, DocumentError> {
        Ok(self.shelf().kind(path).map_err(files::io(path, "open"))? == Kind::Folder)
    }

    /// Whether the path is an ordinary file.
    pub fn is_file(&self, path: &Path) -> bool {
        self.shelf().is_file(path)
    }

    /// The names in a folder in order, and what each is; of a large folder a part.
    pub fn list(&self, folder: &Path) -> Result<Vec<(String, Kind)>, DocumentError> {
        Ok(self.shelf().list(folder).map_err(files::io(folder, "list"))?)
    }

    /// The first bytes of a file, at most 16; not part of the fingerprint.
    pub fn head(&self, path: &Path) -> Result<Vec<u8>, DocumentError> {
        Ok(self.shelf().start(path, HEAD).map_err(files::io(path, "read"))?)
    }

    /// Reads a whole file of at most `most` bytes.
    pub fn read(&mut self, path: &Path, most: u64) -> Result<Vec<u8>, DocumentError> {
        let bytes = self.shelf().read(path, most)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.take_in(&name, &bytes);
        self.read.push(path.to_path_buf());
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

    /// At the end, says which pictures lie beside those that were read.
    pub fn tell_unread(&mut self) {
        self.tells_unread = true;
    }

    /// Notes pictures that a document does not name, in the folders of what it does.
    fn note_unread(&mut self) {
        let folders: BTreeSet<&Path> = self.read.iter().filter_map(|path| path.parent()).collect();
        let beside = folders.into_iter().flat_map(|folder| {
            let names = self.list(folder).unwrap_or_default().into_iter();
            let pictures = names
                .filter(|(name, kind)| *kind != Kind::Folder && is_picture(name) && !name.starts_with('.'));
            pictures.map(|(name, _)| folder.join(name))
        });
        let unread = beside.filter(|path| !self.read.contains(path));
        let unread: Vec<String> =
            unread.map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
        if !unread.is_empty() {
            self.note(format!("not used, because the document does not name them: {}", list(&unread)));
        }
    }

    /// Returns the notes and the fingerprint.
    pub fn finish(mut self) -> (Vec<String>, String) {
        if self.tells_unread {
            self.note_unread();
        }
        let digest = self.hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        (self.notes, digest)
    }
}
