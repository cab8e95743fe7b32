//! Steps as TOML, beside the files that they name.
//!
//! ```toml
//! format = 1
//! document = "leaf"            # for people
//! fingerprint = "9b0c…"        # of the document that the steps are for; without it they suit any document
//!
//! [[step]]
//! basis = 2                    # without it: every basis
//! rougher = 1.5                # or glossier
//! tint = "#c08040"
//! mask = "rim.png"             # or "basis:3", "basis:3,0.5", "region:120,80"
//!
//! [[step]]
//! basis = 3
//! replace = "chrome.binary"    # or "other.foil:2"
//!
//! [[step]]
//! swap = [1, 4]
//!
//! [[step]]
//! basis = 1
//! mix = 4
//! share = 0.3
//! ```
//!
//! Files lie in the folder of the step file or below it; nothing else is read. Written steps stand by themselves: painted masks
//! and curves lie beside them, as 16-bit pictures and CSV, and give the same document bit by bit.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use files::FileError;
use files::shelf::{Shelf, inside};
use observe::Observer;
use serde::{Deserialize, Serialize};

use super::apply::{Change, Step};
use super::error::EditError;
use super::mask::{Mask, Painted};
use super::replacement::Replacement;
use super::surface::{Surface, Tint};
use crate::brdf::Space;
use crate::document::DocumentError;
use crate::document::source::Source;
use crate::weights::grey::to_grey;

/// The name under which an edited document has its steps.
pub const FILE_NAME: &str = "steps.toml";

/// The version that is written, and the only one that is read: a number so that a later program can tell.
const FORMAT: u32 = 1;

/// The most steps in a file: more than anybody makes by hand, few enough for hostile files.
const MOST_STEPS: usize = 1000;

/// The most pixels of all painted masks, for memory's sake: sixteen masks of the largest document.
const MOST_PAINTED: usize = 1 << 30;

/// The steps of a document.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// The name of the document that they are for.
    pub document: String,
    /// Its [fingerprint](super::fingerprint), unless they suit any document.
    pub fingerprint: Option<String>,
    /// The fingerprint of the document that they made.
    pub result: Option<String>,
    /// The steps.
    pub steps: Vec<Step>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    #[serde(default)]
    document: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    fingerprint: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<String>,
    #[serde(default)]
    step: Vec<Entry>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    #[serde(skip_serializing_if = "Option::is_none")]
    basis: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rougher: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    glossier: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tint: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    albedo: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    replace: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    swap: Option<[usize; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mix: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    share: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<String>,
}

impl Steps {
    /// Reads a step file with the masks and curves that it names. `space` is that of the document to edit.
    ///
    /// # Errors
    /// A file that cannot be read or is not understood, with the step; names outside its folder.
    pub fn read(
        shelf: &Arc<dyn Shelf>,
        path: &Path,
        space: &Space,
        observer: &dyn Observer,
    ) -> Result<Steps, EditError> {
        let wrong = |problem: String| EditError::Steps { path: path.to_path_buf(), problem };
        let mut source = Source::new(&**shelf, observer);
        let text = source.read_text(path)?;
        let file: File = toml::from_str(&text).map_err(|error| {
            // The message quotes the file.
            wrong(error.to_string().chars().filter(|c| !c.is_control() || *c == '\n').collect())
        })?;
        if file.format != FORMAT {
            return Err(wrong(format!("format = {}: expected {FORMAT}", file.format)));
        }
        if file.step.is_empty() || file.step.len() > MOST_STEPS {
            return Err(wrong(format!("{} steps: expected 1 to {MOST_STEPS}", file.step.len())));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let (mut steps, mut painted) = (Vec::new(), 0);
        for (number, entry) in file.step.into_iter().enumerate() {
            let refused = |source| EditError::Step { number: number + 1, source: Box::new(source) };
            let change = change(&entry, (shelf, folder), space, observer, &wrong).map_err(refused)?;
            let mask = entry.mask.map(|text| match Mask::of_maps(&text)? {
                Some(mask) => Ok(mask),
                None => {
                    Ok(Mask::Painted(Painted::read(&beside(folder, &text).map_err(wrong)?, &mut source)?))
                }
            });
            let mask = mask.transpose().map_err(refused)?;
            if let Some(Mask::Painted(mask)) = &mask {
                painted += mask.values.len();
            }
            if painted > MOST_PAINTED {
                return Err(wrong(format!(
                    "the masks have more than {MOST_PAINTED} pixels in all; replay the steps in several files"
                )));
            }
            steps.push(Step { change, mask });
        }
        // The name is shown on terminals.
        let document = file.document.chars().filter(|c| !c.is_control()).take(200).collect();
        Ok(Steps { document, fingerprint: file.fingerprint, result: file.result, steps })
    }

    /// Checks that the steps, read from `path`, are for the document with this fingerprint.
    ///
    /// # Errors
    /// Another document's steps.
    pub fn check(&self, path: &Path, fingerprint: &str) -> Result<(), EditError> {
        match &self.fingerprint {
            Some(expected) if expected != fingerprint => Err(EditError::Other {
                path: path.to_path_buf(),
                document: self.document.clone(),
                expected: expected.clone(),
                found: fingerprint.into(),
            }),
            _ => Ok(()),
        }
    }

    /// Writes the steps as [`FILE_NAME`] into a folder, with their masks (`mask-00.png`, …) and curves (`curve-00.csv`, …).
    /// `space` is that of the document.
    ///
    /// # Errors
    /// Files that exist or cannot be written.
    pub fn write(&self, folder: &Path, space: &Space) -> Result<(), EditError> {
        let mut entries = Vec::new();
        for (number, step) in self.steps.iter().enumerate() {
            let mut entry = Entry::default();
            match &step.change {
                Change::Surface { basis, surface } => {
                    let some = |v: f64| (v != 1.0).then_some(v);
                    entry.basis = *basis;
                    // A step that changes nothing is still one.
                    entry.rougher = some(surface.rougher);
                    entry.albedo = some(surface.albedo);
                    entry.tint = (surface.tint != Tint::WHITE).then(|| surface.tint.to_string());
                    if *surface == Surface::default() {
                        entry.rougher = Some(1.0);
                    }
                }
                Change::Replace { basis, by } => {
                    let name = format!("curve-{number:02}.csv");
                    let curve = space.curve(&by.row);
                    files::write(&folder.join(&name), |out| Ok(curve.to_csv(out)?)).map_err(written)?;
                    (entry.basis, entry.replace) = (Some(*basis), Some(name));
                }
                &Change::Swap(a, b) => entry.swap = Some([a, b]),
                &Change::Mix { basis, into, share } => {
                    (entry.basis, entry.mix, entry.share) = (Some(basis), Some(into), Some(share));
                }
            }
            entry.mask = match &step.mask {
                Some(Mask::Painted(painted)) => {
                    let name = format!("mask-{number:02}.png");
                    write_mask(painted, &folder.join(&name)).map_err(written)?;
                    Some(name)
                }
                Some(mask) => Some(mask.to_string()),
                None => None,
            };
            entries.push(entry);
        }
        let file = File {
            format: FORMAT,
            document: self.document.clone(),
            fingerprint: self.fingerprint.clone(),
            result: self.result.clone(),
            step: entries,
        };
        files::write_toml(&folder.join(FILE_NAME), &file).map_err(written)
    }
}

fn written(error: FileError) -> EditError {
    DocumentError::from(error).into()
}

fn write_mask(painted: &Painted, at: &Path) -> Result<(), FileError> {
    let greys: Vec<u8> = painted.values.iter().flat_map(|&w| to_grey(w).to_ne_bytes()).collect();
    let size = (painted.width as u32, painted.height as u32);
    let picture = readers::png(&greys, size, readers::Pixel::Grey16).map_err(files::io(at, "write"))?;
    files::write(at, |out| out.write_all(&picture))
}

/// A file in the folder or below it.
fn beside(folder: &Path, name: &str) -> Result<PathBuf, String> {
    let shown: String = name.chars().filter(|c| !c.is_control()).collect();
    inside(folder, name)
        .filter(|_| shown == name)
        .ok_or_else(|| format!("`{shown}` must be a file in the folder of the step file, or below it"))
}

/// What an entry changes: exactly one of the kinds of edits.
fn change(
    entry: &Entry,
    (shelf, folder): (&Arc<dyn Shelf>, &Path),
    space: &Space,
    observer: &dyn Observer,
    wrong: &dyn Fn(String) -> EditError,
) -> Result<Change, EditError> {
    let surface =
        entry.rougher.is_some() || entry.glossier.is_some() || entry.tint.is_some() || entry.albedo.is_some();
    let kinds = [surface, entry.replace.is_some(), entry.swap.is_some(), entry.mix.is_some()];
    if kinds.iter().filter(|kind| **kind).count() != 1 {
        return Err(wrong(
            "a step is one of: rougher, glossier, tint and albedo together; replace; swap; mix".into(),
        ));
    }
    if entry.rougher.is_some() && entry.glossier.is_some() {
        return Err(wrong("a step is rougher or glossier, not both".into()));
    }
    if entry.share.is_some() != entry.mix.is_some() {
        return Err(wrong(
            "mix needs share, the part of the basis that becomes the other one, and share mix".into(),
        ));
    }
    let basis = || {
        let name = if entry.mix.is_some() { "mix" } else { "replace" };
        entry.basis.ok_or_else(|| wrong(format!("{name} needs basis, the number of the basis to change")))
    };
    if let Some([a, b]) = entry.swap {
        if entry.basis.is_some() {
            return Err(wrong("swap names both bases itself; delete basis".into()));
        }
        return Ok(Change::Swap(a, b));
    }
    if let (Some(into), Some(share)) = (entry.mix, entry.share) {
        return Ok(Change::Mix { basis: basis()?, into, share });
    }
    if let Some(text) = &entry.replace {
        let path = beside(folder, text).map_err(wrong)?;
        let by = Replacement::open(shelf, &path.to_string_lossy(), space, observer)?;
        return Ok(Change::Replace { basis: basis()?, by });
    }
    let tint = entry.tint.as_deref().map_or(Ok(Tint::WHITE), str::parse)?;
    let rougher = match (entry.rougher, entry.glossier) {
        (_, Some(glossier)) => Surface::glossier(glossier)?,
        (rougher, None) => rougher.unwrap_or(1.0),
    };
    let surface = Surface { rougher, tint, albedo: entry.albedo.unwrap_or(1.0) };
    Ok(Change::Surface { basis: entry.basis, surface })
}
