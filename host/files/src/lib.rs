//! Small files that appear whole or not at all, and settings and descriptions in TOML.
//!
//! A file is written beside its final place and renamed, so nobody ever reads half of one. A text is read up
//! to 4 MB, so a file that is not one of ours cannot fill the memory. [`durable`] is for what has to outlive
//! a crash, [`shelf`] is what readers of documents see of a disk.
#![deny(unsafe_code)]

pub mod durable;
pub mod scratch;
pub mod shelf;

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use shelf::{Disk, Kind, Shelf};

/// The most bytes of a text: a mix of 128 inks' stacks has some 2 MB.
const MOST_TEXT: u64 = 4 << 20;

/// Why a file cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refused; it says why.
    #[error("{}: cannot {attempt}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was attempted: open, read, list, write.
        attempt: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A folder of ours was expected, and this is none.
    #[error("{} is no {name}: {why}; `foilpress {command}` makes one", folder.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// What it should have been.
        name: &'static str,
        /// Why it is none.
        why: String,
        /// The command that makes one.
        command: &'static str,
    },
    /// The file is longer than anything of its kind.
    #[error("{}: size in bytes is {found}; the limit is {most}", path.display())]
    Large {
        /// The file.
        path: PathBuf,
        /// Its size, or more than the limit.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// A text file does not say what it should.
    #[error("{}: {problem}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field.
        problem: String,
    },
    /// A picture is no PNG, or damaged.
    #[error("{}: the picture is damaged; write it again from its source", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: std::io::Error,
    },
    /// A picture is of another kind or size than the text beside it says.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Size and kind expected.
        expected: String,
        /// Size and kind found.
        found: String,
    },
}

/// What the system said of a file, as an error: what was attempted, such as `open`, `read` or `write`.
pub fn io<'a>(path: &'a Path, attempt: &'static str) -> impl Fn(std::io::Error) -> FileError + 'a {
    move |source| FileError::Io { path: path.to_path_buf(), attempt, source }
}

/// Writes a file beside its final place and renames it, so that no half-written file is ever seen.
pub fn write(
    path: &Path,
    with: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> std::io::Result<()>,
) -> Result<(), FileError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".foilpress-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The user's umask decides, as for any other file; temporary files are private otherwise.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(io(folder, "write in"))?;
    let mut buffer = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    with(&mut buffer).and_then(|()| buffer.flush()).map_err(io(path, "write"))?;
    drop(buffer);
    file.persist(path).map_err(|error| io(path, "write")(error.error))?;
    Ok(())
}

/// Makes a folder that does not exist yet.
pub fn new_folder(path: &Path) -> Result<(), FileError> {
    std::fs::create_dir(path).map_err(io(path, "write"))
}

/// Writes a value as TOML.
pub fn write_toml(path: &Path, value: &impl serde::Serialize) -> Result<(), FileError> {
    let text = toml::to_string(value)
        .map_err(|error| FileError::Text { path: path.to_path_buf(), problem: error.to_string() })?;
    write(path, |out| out.write_all(text.as_bytes()))
}

/// Reads TOML of at most 4 MB; unknown fields are the type's own business.
pub fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    let wrong = |problem: String| FileError::Text { path: path.to_path_buf(), problem };
    let text = String::from_utf8(Disk.read(path, MOST_TEXT)?)
        .map_err(|error| wrong(format!("not UTF-8 text (byte {})", error.utf8_error().valid_up_to())))?;
    toml::from_str(&text).map_err(|error| wrong(error.to_string().trim_end().to_string()))
}

/// A kind of folder that this program writes.
pub struct FolderKind {
    /// What it is called.
    pub name: &'static str,
    /// The text in it that describes the rest.
    pub text: &'static str,
    /// The command that makes it.
    pub command: &'static str,
}

impl FolderKind {
    /// Reads the text of such a folder.
    pub fn read<T: serde::de::DeserializeOwned>(&self, folder: &Path) -> Result<T, FileError> {
        read_toml(&folder.join(self.text)).map_err(|error| self.unless_missing(&Disk, folder, error))
    }

    /// The error of a text that cannot be read, or, if there is none, what the folder should have been.
    pub fn unless_missing(&self, shelf: &dyn Shelf, folder: &Path, error: FileError) -> FileError {
        use std::io::ErrorKind;
        match &error {
            FileError::Io { source, .. }
                if matches!(source.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
            {
                let why = match shelf.kind(folder) {
                    Ok(Kind::Folder) => format!("it has no {}", self.text),
                    Ok(_) => "it is a file".into(),
                    Err(_) => "there is no such folder".into(),
                };
                let FolderKind { name, command, .. } = *self;
                FileError::Missing { folder: folder.to_path_buf(), name, why, command }
            }
            _ => error,
        }
    }
}
