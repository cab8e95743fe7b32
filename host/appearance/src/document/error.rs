//! Errors in reading and writing documents: the file, the field, and what was expected.

use std::path::{Path, PathBuf};

use files::FileError;
use inks::CurveError;

use super::names::has_extension;
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
        "{}: unknown kind of document; expected a folder of texture maps or its .zip, a factored \
         document, a .gltf, .glb, .mtlx, .usda, .usdz, .mtl, MERL .binary, RGL .bsdf, goniometer .brdf or \
         curve .csv file, or `sample:NAME`",
        path.display()
    )]
    Kind {
        /// The file.
        path: PathBuf,
    },
    /// A kind of document that is known and not read.
    #[error("{}: {way}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is, and what to open in its place.
        way: &'static str,
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

impl DocumentError {
    /// The error for a file whose name says that it is of a kind that is known and not read.
    pub(super) fn foreign(path: &Path) -> Option<DocumentError> {
        let way = way_out(&path.file_name()?.to_string_lossy())?;
        Some(DocumentError::Foreign { path: path.to_path_buf(), way })
    }
}

/// What a file is that is not read, by the ending of its name, and what to do.
pub(super) fn way_out(name: &str) -> Option<&'static str> {
    const WAYS: [(&[&str], &str); 7] = [
        (
            &["axf"],
            "AxF is a closed format; export its maps as pictures (diffuse, specular, roughness, \
             normal) and open their folder",
        ),
        (
            &["sbsar", "sbs"],
            "a Substance file draws its maps when it is asked; export base colour, roughness and \
             metallic as pictures, and open their folder",
        ),
        (
            &["mdl"],
            "MDL is a program and not a set of maps; bake it to a glTF or MaterialX file with \
             pictures",
        ),
        (
            &["fbx", "blend", "obj", "max", "ma", "mb", "c4d", "3ds", "dae"],
            "a scene of another program; export its material as glTF, MaterialX or text USD, or open \
             the folder of its maps",
        ),
        (
            &["dds", "ktx", "ktx2"],
            "a texture packed for a graphics card; save it as PNG, and open the folder of all maps",
        ),
        (
            &["btf"],
            "a BTF has a measurement for every pixel and direction; fit maps of base colour, \
             roughness and metallic to it first",
        ),
        (
            &["bin"],
            "numbers without their meaning: of a glTF file, open the .gltf; of a UTIA measurement, \
             average it over the half angle to a curve .csv",
        ),
    ];
    WAYS.iter().find(|(endings, _)| has_extension(name, endings)).map(|(_, way)| *way)
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
