//! A library as one archive, to hand to others: the library, its licence, and where its curves come from.
//!
//! Problem: a library is a folder of many files, and who gets it must know what may be done with it, who measured what and how,
//! and that nothing was lost on the way. Archives come from strangers, so nothing in them is believed.
//! Method: a zip file with `library.toml`, the curves it names, the figures of the measurement and texts of a licence, if there
//! are any, and `provenance.json`: the origin of each curve, and the size and SHA-256 of each file. Reading accepts these files and no
//! others. Each name must be plain, so no file can lie outside the folder; names that differ in case alone are one name; no
//! entry may be a link, encrypted, or share its bytes with another. Counts and sizes have limits, which hold for the bytes
//! that come out, whatever the archive says. Cost: the archive and its contents in memory, at most 192 MB.
//! Limits: stored or deflated entries only. The hashes find damage; they do not say who made the archive.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::{Cursor, Read as _, Write as _};
use std::path::{Component, Path};

use files::FileError;
use files::durable::{self, Access};
use files::shelf::{Disk, Shelf};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::format::{FILE_NAME, File, MOST_BYTES};
use crate::library::Library;
use crate::provenance::Provenance;
use crate::read::fields::MOST_CURVE_BYTES;
use crate::read::{MOST_STACKS, is_licence};

/// The file with the origin of the curves and the hashes of the files.
pub const PROVENANCE: &str = "provenance.json";
/// The file with the figures behind predicted curves.
pub const PREDICTION: &str = "prediction.json";
/// The largest archive, in bytes.
pub const MOST_ARCHIVE: u64 = 64 << 20;
/// The most that its files can hold together, in bytes.
const MOST_TOTAL: u64 = 128 << 20;
/// Files beside library and curves that belong to a library if they are there.
pub const BESIDE: [&str; 6] =
    ["measurement.json", PREDICTION, "LICENSE", "LICENSE.txt", "LICENCE.txt", "README.md"];
/// The most files: a curve for each stack, and the others.
const MOST_FILES: usize = MOST_STACKS + BESIDE.len() + 2;
const FORMAT: u32 = 1;

/// A file of a library: its name inside the folder, with `/` between folders, and its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Why there is no archive, or no library in it.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// A file of the library's folder cannot be read.
    #[error("{name}: cannot be read")]
    Io {
        /// The file.
        name: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// A file does not belong into an archive, or cannot be trusted.
    #[error("{name}: {problem}")]
    Member {
        /// The file.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// The whole is not an archive of a library.
    #[error("{0}")]
    Whole(String),
}

fn member(name: &str, problem: impl Into<String>) -> ArchiveError {
    // Names come from strangers and are shown on terminals.
    let name = name.chars().map(|c| if c.is_control() { '?' } else { c }).take(200).collect();
    ArchiveError::Member { name, problem: problem.into() }
}

fn whole(problem: impl Into<String>) -> ArchiveError {
    ArchiveError::Whole(problem.into())
}

#[derive(Serialize, Deserialize)]
struct Origins {
    format: u32,
    name: String,
    licence: String,
    /// The curves; a stack that is not listed is modelled by the program.
    #[serde(default)]
    curves: Vec<Origin>,
    files: Vec<Listed>,
}

#[derive(Serialize, Deserialize)]
struct Origin {
    stack: String,
    /// `measured` or `predicted`.
    #[serde(default)]
    curve: String,
    by: String,
    when: String,
    setup: String,
}

#[derive(Serialize, Deserialize)]
struct Listed {
    name: String,
    bytes: u64,
    sha256: String,
}

/// The files that belong to the library in a folder: others in it stay where they are.
///
/// # Errors
/// Files that are missing, too large, or have names that not every system can store.
pub fn gather(shelf: &dyn Shelf, folder: &Path) -> Result<Vec<Member>, ArchiveError> {
    let library = bytes_of(shelf, folder, FILE_NAME)?;
    let text = std::str::from_utf8(&library).map_err(|error| member(FILE_NAME, error.to_string()))?;
    let parsed: File = toml::from_str(text).map_err(|error| member(FILE_NAME, error.message()))?;
    let mut names: BTreeSet<String> = BTreeSet::new();
    for table in parsed.measured.iter().chain(&parsed.predicted) {
        names.insert(plain(table.get_ref().curve.get_ref())?);
    }
    names.extend(BESIDE.iter().filter(|name| shelf.is_file(&folder.join(name))).map(|&name| name.to_owned()));
    let mut members = vec![Member { name: FILE_NAME.into(), bytes: library }];
    for name in names {
        let bytes = bytes_of(shelf, folder, &name)?;
        members.push(Member { name, bytes });
    }
    limits(&members)?;
    Ok(members)
}

fn bytes_of(shelf: &dyn Shelf, folder: &Path, name: &str) -> Result<Vec<u8>, ArchiveError> {
    let most = most_bytes(name);
    shelf.read(&folder.join(name), most).map_err(|error| match error {
        FileError::Io { source, .. } => ArchiveError::Io { name: name.into(), source },
        _ => member(name, format!("is longer than {most} bytes")),
    })
}

fn most_bytes(name: &str) -> u64 {
    if name == FILE_NAME { MOST_BYTES } else { MOST_CURVE_BYTES }
}

fn limits(members: &[Member]) -> Result<(), ArchiveError> {
    let total: u64 = members.iter().map(|member| member.bytes.len() as u64).sum();
    if members.len() > MOST_FILES || total > MOST_TOTAL {
        let most = MOST_TOTAL >> 20;
        return Err(whole(format!("more than {MOST_FILES} files or {most} MB; a library needs less")));
    }
    let mut seen = BTreeSet::new();
    match members.iter().find(|member| !seen.insert(member.name.to_ascii_lowercase())) {
        Some(twice) => Err(member(&twice.name, "is there twice; many systems ignore case in names")),
        None => Ok(()),
    }
}

/// A name that every system can store, inside the folder.
fn plain(name: &str) -> Result<String, ArchiveError> {
    let letter = |c: char| c.is_ascii_alphanumeric() || "-_.+ ".contains(c);
    let device = |part: &str| {
        let stem = part.split('.').next().unwrap_or_default().to_ascii_lowercase();
        let numbered = stem.len() == 4 && ["com", "lpt"].iter().any(|start| stem.starts_with(start));
        numbered || ["con", "prn", "aux", "nul"].contains(&stem.as_str())
    };
    let usual = |part: &str| {
        !part.is_empty()
            && part.chars().all(letter)
            && !part.starts_with(['.', ' ', '-'])
            && !part.ends_with(['.', ' '])
            && !device(part)
    };
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    if name.len() <= 120 && name.split('/').count() <= 4 && inside && name.split('/').all(usual) {
        return Ok(name.to_owned());
    }
    let problem =
        "is not a plain name inside the folder; use letters, digits, - _ . + and at most three folders";
    Err(member(name, problem))
}

/// The archive of a library: the files that [`gather`] found, and their origin. `licence` is used if the library names none.
///
/// # Errors
/// No licence, or two different ones.
pub fn pack(members: &[Member], library: &Library, licence: Option<&str>) -> Result<Vec<u8>, ArchiveError> {
    let mut members = members.to_vec();
    let licence = match (library.licence(), licence) {
        (None, None) => {
            return Err(whole(
                "the library has no licence, so nobody may use it; choose one, such as CC0-1.0 or CC-BY-4.0",
            ));
        }
        (Some(own), Some(other)) if own != other => {
            return Err(whole(format!(
                "the library has the licence {own}, not {other}; change `licence` in {FILE_NAME}"
            )));
        }
        (Some(own), _) => own.to_owned(),
        (None, Some(given)) if is_licence(given) => {
            // Keys of the top level come before all tables.
            let line = format!("licence = {}\n", toml::Value::String(given.to_owned()));
            if let Some(file) = members.iter_mut().find(|member| member.name == FILE_NAME) {
                file.bytes.splice(0..0, line.bytes());
            }
            given.to_owned()
        }
        (None, Some(_)) => return Err(whole("the name of a licence is one line of text, such as CC0-1.0")),
    };
    let curves = library.entries().iter().filter_map(|entry| match &entry.provenance {
        Provenance::Measured { by, when, setup } | Provenance::Predicted { by, when, setup } => {
            Some(Origin {
                stack: entry.stack.to_string(),
                curve: entry.provenance.word().into(),
                by: by.clone(),
                when: when.clone(),
                setup: setup.clone(),
            })
        }
        Provenance::Modelled { .. } => None,
    });
    let listed = |member: &Member| Listed {
        name: member.name.clone(),
        bytes: member.bytes.len() as u64,
        sha256: hash(&member.bytes),
    };
    let origins = Origins {
        format: FORMAT,
        name: library.name().to_owned(),
        licence,
        curves: curves.collect(),
        files: members.iter().map(listed).collect(),
    };
    let bytes = serde_json::to_vec_pretty(&origins).map_err(|error| member(PROVENANCE, error.to_string()))?;
    members.push(Member { name: PROVENANCE.into(), bytes });
    limits(&members)?;
    zipped(&members).map_err(|error| whole(format!("the archive cannot be made: {error}")))
}

/// The same bytes for the same files: no times, no owners.
fn zipped(members: &[Member]) -> zip::result::ZipResult<Vec<u8>> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for member in members {
        writer.start_file(member.name.as_str(), options)?;
        writer.write_all(&member.bytes)?;
    }
    Ok(writer.finish()?.into_inner())
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The files of an archive, its provenance too, without those that are no part of a library. Everything that they promise
/// was checked but the library itself.
///
/// # Errors
/// Archives that [`pack`] would not make.
pub fn unpack(archive: &[u8]) -> Result<Vec<Member>, ArchiveError> {
    if archive.len() as u64 > MOST_ARCHIVE {
        return Err(whole(format!("the archive is longer than {} MB", MOST_ARCHIVE >> 20)));
    }
    let broken = |error: zip::result::ZipError| whole(format!("not a zip archive that can be read: {error}"));
    let mut zip = ZipArchive::new(Cursor::new(archive)).map_err(broken)?;
    if zip.has_duplicate_names() {
        return Err(whole("the archive has two files of one name"));
    }
    if zip.len() > MOST_FILES {
        return Err(whole(format!("{} files; a library has at most {MOST_FILES}", zip.len())));
    }
    if zip.has_overlapping_entries().map_err(broken)? {
        return Err(whole("files of the archive share their bytes; no honest archive does that"));
    }
    let mut members: Vec<Member> = Vec::new();
    let mut left = MOST_TOTAL;
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).map_err(broken)?;
        let name = entry.name().map_err(broken)?.into_owned();
        let name = plain(&name)?;
        // The kind of a file is in the upper bits of its mode; none at all is a plain file, too.
        let kind = entry.unix_mode().unwrap_or(0) & 0o170_000;
        if entry.is_symlink() || entry.is_dir() || !(kind == 0 || kind == 0o100_000) {
            return Err(member(&name, "is a link, a folder or a device; a library has plain files only"));
        }
        if entry.encrypted() {
            return Err(member(&name, "is encrypted"));
        }
        let usual = name == FILE_NAME || name == PROVENANCE || BESIDE.contains(&name.as_str());
        if !usual && !name.to_ascii_lowercase().ends_with(".csv") {
            return Err(member(&name, "is no part of a library"));
        }
        // What the archive says about sizes is not believed.
        let most = most_bytes(&name).min(left);
        let mut bytes = Vec::new();
        let read = entry.by_ref().take(most + 1).read_to_end(&mut bytes);
        read.map_err(|error| member(&name, format!("is damaged: {error}")))?;
        if bytes.len() as u64 > most {
            return Err(member(&name, format!("holds more than {most} bytes; a library needs less")));
        }
        left -= bytes.len() as u64;
        members.push(Member { name, bytes });
    }
    limits(&members)?;
    verify(&members)?;
    Ok(members)
}

/// Compares the files with those that the provenance lists.
fn verify(members: &[Member]) -> Result<(), ArchiveError> {
    let find = |name: &str| members.iter().find(|member| member.name == name);
    let Some(origins) = find(PROVENANCE) else {
        return Err(whole(format!("the archive has no {PROVENANCE}; export the library again")));
    };
    let origins: Origins = serde_json::from_slice(&origins.bytes)
        .map_err(|error| member(PROVENANCE, format!("is not the provenance of a library: {error}")))?;
    if origins.format != FORMAT {
        return Err(member(PROVENANCE, format!("version {}; expected version {FORMAT}", origins.format)));
    }
    if origins.files.len() + 1 != members.len() || find(FILE_NAME).is_none() {
        return Err(member(PROVENANCE, "lists other files than the archive has"));
    }
    for member_ in members.iter().filter(|member| member.name != PROVENANCE) {
        let listed = origins.files.iter().find(|listed| listed.name == member_.name);
        if listed.is_none_or(|listed| listed.sha256 != hash(&member_.bytes)) {
            return Err(member(&member_.name, format!("is not the file that {PROVENANCE} lists")));
        }
    }
    Ok(())
}

/// Writes files into a folder that exists and holds none of them.
///
/// # Errors
/// Files that cannot be written.
pub fn place(members: &[Member], folder: &Path) -> Result<(), ArchiveError> {
    for member in members {
        let path = folder.join(plain(&member.name)?);
        if let Some(parent) = path.parent() {
            let io = |source| ArchiveError::Io { name: member.name.clone(), source };
            durable::make_folder(parent, Access::Everyone).map_err(io)?;
        }
        if Disk.kind(&path).is_ok() {
            return Err(ArchiveError::Io {
                name: member.name.clone(),
                source: std::io::ErrorKind::AlreadyExists.into(),
            });
        }
        files::write(&path, |out| out.write_all(&member.bytes))?;
    }
    Ok(())
}
