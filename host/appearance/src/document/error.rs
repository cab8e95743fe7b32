//! Errors in reading and writing documents: the file, the field, and what was expected.

use std::path::PathBuf;

use files::FileError;
use inks::CurveError;

use crate::sample::UnknownSample;
use crate::weights::WeightError;

/// Why a document could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// A file is missing, too large, or cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The path is not a kind of document.
    #[error(
        "{}: unknown kind of document; expected a folder of texture maps or its .zip, a factored document, a .gltf, .glb, .mtlx, \
         MERL .binary, RGL .bsdf, goniometer .brdf or curve .csv file, or `sample:NAME`",
        path.display()
    )]
    Kind {
        /// The file.
        path: PathBuf,
    },
    /// The file is not a measured BRDF.
    #[error(
        "{}: unknown kind of measurement; expected a MERL .binary, RGL .bsdf, goniometer .brdf or curve .csv file, or \
         readings of gloss and colour in a .toml file",
        path.display()
    )]
    NotMeasured {
        /// The file.
        path: PathBuf,
    },
    /// No sample has this name.
    #[error(transparent)]
    Sample(#[from] UnknownSample),
    /// The number of half angles is out of range.
    #[error("{found} samples of the half angle; expected 1 to 4096 (32 are enough for everything printable)")]
    Samples {
        /// The requested number.
        found: usize,
    },
    /// Something that a file declares is implausibly large.
    #[error("{}: {field} is {found}; the limit is {most}", path.display())]
    Large {
        /// The file.
        path: PathBuf,
        /// What is too large, with its unit.
        field: String,
        /// The declared size.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// An image cannot be decoded, or its channels do not suit its purpose.
    #[error("{}: {problem}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what was expected.
        problem: String,
    },
    /// The maps of a folder do not define a material.
    #[error("{}: {problem}; images in the folder: {}", folder.display(), list(seen))]
    Maps {
        /// The folder.
        folder: PathBuf,
        /// What is missing or ambiguous, and what to do.
        problem: String,
        /// The image files in the folder.
        seen: Vec<String>,
    },
    /// A settings file is wrong.
    #[error("{}: {problem}", path.display())]
    Settings {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its line if known.
        problem: String,
    },
    /// A field of a file does not conform to its format.
    #[error("{}: {field}: {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field, or the position in the file.
        field: String,
        /// What was expected and found.
        problem: String,
    },
    /// A file with several materials needs a choice.
    #[error("{}: {problem}; choose a material by number or name: {}", path.display(), list(materials))]
    Choice {
        /// The file.
        path: PathBuf,
        /// Why no material was chosen.
        problem: String,
        /// Number and name of each material.
        materials: Vec<String>,
    },
    /// A curve file is wrong.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// Weight maps are wrong.
    #[error("{}: the weight maps cannot be used", path.display())]
    Weights {
        /// The document.
        path: PathBuf,
        /// What is wrong.
        source: WeightError,
    },
}

/// The names as a list, cut off after 24.
pub(super) fn list(names: &[String]) -> String {
    /// Names that a message has room for: some three lines.
    const SHOWN: usize = 24;
    match names.len() {
        0 => "none".into(),
        n if n <= SHOWN => names.join(", "),
        n => format!("{} and {} more", names[..SHOWN].join(", "), n - SHOWN),
    }
}
