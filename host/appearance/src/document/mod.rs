//! Reading documents of materials: textures, glTF, measured BRDFs, factored files.
//!
//! Whatever the file, what comes out is a [`Document`]: pixels, their materials, and how large it is on paper.
//! Files are hostile: every reader bounds what it allocates before it allocates, and answers damage with an
//! error that names the file and the field. Whatever a reader decided on the user's behalf (the colour space of
//! a map, a channel it left out, relief it turned into roughness) is one of [`Document::notes`].

pub mod average;
pub mod distinct;
pub mod error;
pub mod foil;
pub mod folder;
pub mod gltf;
#[cfg(test)]
mod hostile;
pub mod materials;
pub mod merl;
pub mod names;
pub mod picture;
pub mod relief;
pub mod rgl;
pub mod source;
pub mod surfaces;
pub mod tensor;
pub mod texture;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::brdf::Space;
use crate::factor::Factored;
use observe::Observer;

pub use distinct::Distinct;
pub use error::DocumentError;
pub use materials::{Materials, Surface};
pub use surfaces::{Surfaces, Uniform};

use source::Source;

/// Samples of the half angle in a document's rows unless the user says otherwise.
pub const SAMPLES: usize = 32;

/// Side of the square on paper that a single material fills unless the user says otherwise, in millimetres.
pub const SWATCH_MM: f64 = 50.0;

/// How the numbers of a colour map are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColourSpace {
    /// The transfer curve of IEC 61966-2-1.
    Srgb,
    /// Proportional to reflectance.
    Linear,
}

/// What the user may say about a document.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Which material of a file that holds several: its number, counted from 0, or its name.
    pub material: Option<String>,
    /// Encoding of the colour maps, where the file's own kind does not settle it rightly.
    pub colour_space: Option<ColourSpace>,
    /// Samples of the half angle, 1 to 4096.
    pub samples: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options { material: None, colour_space: None, samples: SAMPLES }
    }
}

/// What the pixels are.
#[derive(Debug)]
pub enum Content {
    /// A surface for every pixel.
    Surfaces(Surfaces),
    /// Bases and their weight maps, already factored.
    Factored(Factored),
    /// One material everywhere.
    Uniform(Uniform),
}

/// A document of materials. See the module text.
#[derive(Debug)]
pub struct Document {
    /// What to call it: the sample's, material's or file's name.
    pub name: String,
    /// Its materials.
    pub content: Content,
    /// Width and height on paper in millimetres, when the document says.
    pub size_mm: Option<(f64, f64)>,
    /// What was decided on the user's behalf, in sentences.
    pub notes: Vec<String>,
    /// SHA-256 over the files read (their names and bytes), in hexadecimal.
    pub digest: String,
}

impl Document {
    /// Its pixels.
    pub fn materials(&self) -> &dyn Materials {
        match &self.content {
            Content::Surfaces(surfaces) => surfaces,
            Content::Factored(factored) => factored,
            Content::Uniform(uniform) => uniform,
        }
    }

    /// Bases and maps, when the document came with them and needs no factoring.
    pub fn as_factored(&self) -> Option<&Factored> {
        match &self.content {
            Content::Factored(factored) => Some(factored),
            _ => None,
        }
    }
}

/// Opens a document: a path, or `sample:NAME`.
///
/// Kinds, told apart by what they are: a folder with `document.toml` is a factored document, any other folder is
/// one of texture maps; files go by their first bytes, then by their extension.
pub fn open(spec: &str, options: &Options, observer: &dyn Observer) -> Result<Document, DocumentError> {
    if options.samples == 0 || options.samples > 4096 {
        return Err(DocumentError::Samples { found: options.samples });
    }
    let space = Space::half_angle(options.samples);
    if let Some(name) = spec.strip_prefix("sample:") {
        return crate::sample::document(name, space, observer);
    }
    let path = Path::new(spec);
    let mut source = Source::new(observer);
    if source.is_folder(path)? {
        if path.join(foil::INDEX).is_file() {
            return foil::open(path, source);
        }
        unasked(options, &mut source);
        return folder::open(path, options, space, source);
    }
    let head = source.head(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if head.starts_with(b"tensor_file\0") || extension == "bsdf" {
        return rgl::open(path, space, source);
    }
    if head.starts_with(b"glTF") || extension == "gltf" || extension == "glb" {
        return gltf::open(path, options, space, source);
    }
    unasked(options, &mut source);
    match extension.as_str() {
        "binary" => merl::open(path, space, source),
        "csv" => surfaces::open_curve(path, space, source),
        _ => Err(DocumentError::Kind { path: path.to_path_buf() }),
    }
}

/// Says that a choice of material was not needed.
fn unasked(options: &Options, source: &mut Source<'_>) {
    if options.material.is_some() {
        source.note("there is only one material in this document; --material is for glTF files".into());
    }
}

/// The name a document gets from its path.
fn stem(path: &Path) -> String {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    whole.file_stem().map_or_else(|| "document".into(), |stem| stem.to_string_lossy().into_owned())
}
