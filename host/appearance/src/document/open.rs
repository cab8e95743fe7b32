//! Choosing the reader of a document.

use std::path::Path;

use inks::Curve;
use observe::Observer;

use super::content::{Document, Options};
use super::error::DocumentError;
use super::source::{MOST_BYTES, Source};
use super::{curve, foil, folder, gltf, gonio, merl, rgl, sample};
use crate::brdf::Space;

/// Opens a document: a path, or `sample:NAME`.
///
/// A folder with `document.toml` is a factored document, any other folder a set of texture maps. The format of a file is
/// recognised by its first bytes, then by its extension.
pub fn open(spec: &str, options: &Options, observer: &dyn Observer) -> Result<Document, DocumentError> {
    if options.samples == 0 || options.samples > 4096 {
        return Err(DocumentError::Samples { found: options.samples });
    }
    let space = Space::half_angle(options.samples);
    if let Some(name) = spec.strip_prefix("sample:") {
        return sample::open(name, space, observer);
    }
    let path = Path::new(spec);
    let mut source = Source::new(observer);
    if source.is_folder(path)? {
        if path.join(foil::INDEX).is_file() {
            return foil::open(path, source);
        }
        note_unused_choice(options, &mut source);
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
    note_unused_choice(options, &mut source);
    match extension.as_str() {
        "binary" => merl::open(path, space, source),
        "brdf" => gonio::open(path, space, source),
        "csv" => curve::open(path, space, source),
        _ => Err(DocumentError::Kind { path: path.to_path_buf() }),
    }
}

/// The curve of a measured BRDF, as its file has it: MERL `.binary`, RGL `.bsdf`, a goniometer's `.brdf`, or a curve's `.csv`.
///
/// # Errors
/// Files of another kind, and damage, with its place.
pub fn measured(path: &Path, observer: &dyn Observer) -> Result<Curve, DocumentError> {
    let mut source = Source::new(observer);
    let head = source.head(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let kind = if head.starts_with(b"tensor_file\0") { "bsdf" } else { &extension };
    let (most, parse): (u64, Parser) = match kind {
        "bsdf" => (MOST_BYTES, rgl::parse),
        "binary" => (merl::MOST_BYTES, merl::parse),
        "brdf" => (gonio::MOST_BYTES, gonio::parse),
        "csv" => (curve::MOST_BYTES, |bytes, path| Ok(Curve::from_csv(bytes, path)?)),
        _ => return Err(DocumentError::NotMeasured { path: path.to_path_buf() }),
    };
    parse(&source.read(path, most)?, path)
}

/// Reads a curve from a file's bytes.
type Parser = fn(&[u8], &Path) -> Result<Curve, DocumentError>;

/// Notes that the choice of a material has no effect.
fn note_unused_choice(options: &Options, source: &mut Source<'_>) {
    if let Some(material) = &options.material {
        source.note(format!(
            "the choice of material `{material}` has no effect: only a glTF file can hold several materials"
        ));
    }
}
