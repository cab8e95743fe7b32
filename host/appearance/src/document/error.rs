//! Why a document could not be read, with the file, the field and what was expected.

use std::path::PathBuf;

use inks::curve::CurveError;

use crate::weights::WeightError;

/// Why a document could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The system could not read or write a file.
    #[error("{}: cannot {attempt}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        attempt: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The path is not a kind of document.
    #[error(
        "{}: not a document this program knows; it reads folders of texture maps or of a factored document, \
         .gltf, .glb, MERL .binary, RGL .bsdf, curve .csv and `sample:NAME`",
        path.display()
    )]
    Kind {
        /// The file.
        path: PathBuf,
    },
    /// No sample has that name.
    #[error("there is no sample `{name}`; there are {}", known.join(", "))]
    Sample {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<&'static str>,
    },
    /// The number of half angles is out of range.
    #[error("{found} samples of the half angle: 1 to 4096 can be used, 32 serve well")]
    Samples {
        /// The number asked for.
        found: usize,
    },
    /// A file or what it declares is larger than can be meant.
    #[error("{}: {field} is {found}, at most {most} can be read", path.display())]
    Large {
        /// The file.
        path: PathBuf,
        /// What is too large, with its unit.
        field: String,
        /// How large it says it is.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// A picture cannot be decoded or has the wrong channels for its purpose.
    #[error("{}: {problem}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what was expected.
        problem: String,
    },
    /// A folder's maps do not make a material.
    #[error("{}: {problem}; images in the folder: {}", folder.display(), list(seen))]
    Maps {
        /// The folder.
        folder: PathBuf,
        /// What is missing or ambiguous, and what to do.
        problem: String,
        /// The image files seen.
        seen: Vec<String>,
    },
    /// A settings file is wrong.
    #[error("{}: {problem}", path.display())]
    Settings {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with its line where known.
        problem: String,
    },
    /// A field of a file is not what the format asks for.
    #[error("{}: {field}: {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field, or where in the file.
        field: String,
        /// What was expected and found.
        problem: String,
    },
    /// A file with several materials needs a choice.
    #[error("{}: {problem}; choose one with --material: {}", path.display(), list(materials))]
    Choice {
        /// The file.
        path: PathBuf,
        /// Why there is none chosen.
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

/// Names in a row, not endlessly many.
pub(super) fn list(names: &[String]) -> String {
    const SHOWN: usize = 24;
    match names.len() {
        0 => "none".into(),
        n if n <= SHOWN => names.join(", "),
        n => format!("{} and {} more", names[..SHOWN].join(", "), n - SHOWN),
    }
}
