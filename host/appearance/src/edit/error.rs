//! Why an edit is refused.

use std::path::PathBuf;

use crate::document::DocumentError;
use crate::gamut::GamutError;

/// Why a document could not be edited.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// One of several steps is refused.
    #[error("step {number}")]
    Step {
        /// Which, from 1.
        number: usize,
        /// Why.
        source: Box<EditError>,
    },
    /// A number is out of range, or none.
    #[error("{what} = {found}: expected {expected}")]
    Value {
        /// What the number is.
        what: &'static str,
        /// The number.
        found: f64,
        /// The range.
        expected: String,
    },
    /// There is no such basis.
    #[error("there is no basis {found}: {}", numbered(*bases))]
    Basis {
        /// The number given.
        found: usize,
        /// Number of bases at that step.
        bases: usize,
    },
    /// A step names one basis twice.
    #[error("both bases are {basis}: expected two different ones")]
    Same {
        /// The basis.
        basis: usize,
    },
    /// A painted mask has another shape.
    #[error("the mask {name} has {} x {} pixels, and the document {} x {}: paint it in the document's size", found.0, found.1, expected.0, expected.1)]
    Shape {
        /// The mask's name.
        name: String,
        /// Its pixels across and down.
        found: (usize, usize),
        /// Those of the document.
        expected: (usize, usize),
    },
    /// A mask names a pixel outside the document.
    #[error("there is no pixel ({}, {}): the document has {} x {}, counted from 0", found.0, found.1, size.0, size.1)]
    Pixel {
        /// Column and row.
        found: (usize, usize),
        /// Pixels across and down.
        size: (usize, usize),
    },
    /// Masked edits split bases, and there are too many now.
    #[error(
        "the masked edit needs a further basis, and {bases} is the limit for {pixels} pixels; edit without a mask, or factor into fewer bases"
    )]
    Many {
        /// The limit.
        bases: usize,
        /// Pixels of the document.
        pixels: usize,
    },
    /// The text of a mask or of a replacement is not understood.
    #[error("`{text}`: expected {expected}")]
    Text {
        /// What was given.
        text: String,
        /// What may be given.
        expected: &'static str,
    },
    /// A document cannot stand for a basis.
    #[error("{name} cannot replace a basis: {problem}")]
    Replacement {
        /// The document.
        name: String,
        /// What to do.
        problem: String,
    },
    /// A curve is no reflectance.
    #[error("basis {basis}: {problem}")]
    Reflectance {
        /// The basis.
        basis: usize,
        /// What is wrong.
        problem: String,
    },
    /// The document has no curves over the half angle.
    #[error("only documents with curves of the half angle can be edited")]
    Tabulation,
    /// A step file is wrong.
    #[error("{}: {problem}", path.display())]
    Steps {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A step file was written for another document.
    #[error(
        "{}: these steps are for the document `{document}` with the fingerprint {}…, and this one has {}…; open that document, or delete the \
         line `fingerprint` to apply the steps to this one", path.display(), short(expected), short(found)
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// The document's name.
        document: String,
        /// Its fingerprint.
        expected: String,
        /// The fingerprint of the document at hand.
        found: String,
    },
    /// A file could not be read or written.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The gamut.
    #[error(transparent)]
    Gamut(#[from] GamutError),
}

fn numbered(bases: usize) -> String {
    match bases {
        1 => "the document has one, basis 0".into(),
        n => format!("the document has bases 0 to {}", n.saturating_sub(1)),
    }
}

fn short(fingerprint: &str) -> String {
    fingerprint.chars().filter(char::is_ascii_alphanumeric).take(12).collect()
}
