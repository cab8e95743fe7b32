//! Choosing the reader of a document.

use std::path::Path;

use files::shelf::Shelf;
use inks::Curve;
use observe::Observer;

use super::content::MOST_BYTES;
use super::content::{Document, Options, name_of};
use super::error::DocumentError;
use super::source::Source;
use super::{curve, foil, folder, gltf, gonio, materialx, merl, rgl, sample};
use crate::brdf::Space;

/// Opens a document: a path, or `sample:NAME`.
///
/// A folder with `document.toml` is a factored document, any other folder a set of texture maps; a zip archive is read as the
/// folder that it holds. The format of a file is recognised by its first bytes, then by its extension.
pub fn open(spec: &str, options: &Options, observer: &dyn Observer) -> Result<Document, DocumentError> {
    if options.samples == 0 || options.samples > 4096 {
        return Err(DocumentError::Samples { found: options.samples });
    }
    let space = Space::half_angle(options.samples);
    let mut path = Path::new(spec);
    let mut source = Source::new(&*options.shelf, observer);
    if let Some(name) = spec.strip_prefix("sample:") {
        note_unused_choices(options, &mut source);
        return sample::open(name, space, source);
    }
    let archive = !source.is_folder(path)? && source.head(path)?.starts_with(b"PK\x03\x04");
    if archive {
        source.mount(path)?;
    }
    let found;
    if source.is_folder(path)? {
        if source.is_file(&path.join(foil::FOIL.text)) {
            note_unused_choices(options, &mut source);
            return foil::open(path, source);
        }
        match folder::locate(path, &mut source)? {
            folder::Found::Maps(folder) => {
                note_unused_material(options, &mut source);
                let name = source.name_of(&folder);
                let mut document = folder::open(&folder, options, space, source)?;
                // The folder is named after what it holds, `textures`, the download after the material.
                if folder != path && document.name == name {
                    document.name = name_of(&*options.shelf, path);
                }
                return Ok(document);
            }
            folder::Found::File(file) => {
                found = file;
                path = &found;
            }
        }
    }
    let head = source.head(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if head.starts_with(b"glTF") || extension == "gltf" || extension == "glb" {
        return gltf::open(path, options, space, source);
    }
    if extension == "mtlx" {
        return materialx::open(path, options, space, source);
    }
    note_unused_choices(options, &mut source);
    if head.starts_with(b"tensor_file\0") || extension == "bsdf" {
        return rgl::open(path, space, source);
    }
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
pub fn measured(shelf: &dyn Shelf, path: &Path, observer: &dyn Observer) -> Result<Curve, DocumentError> {
    let mut source = Source::new(shelf, observer);
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

/// Notes that choices have no effect on a document without maps of colours.
fn note_unused_choices(options: &Options, source: &mut Source<'_>) {
    note_unused_material(options, source);
    if options.colour_space.is_some() {
        source.note(
            "the choice of a colour space has no effect: the document has no pictures of colours".into(),
        );
    }
}

/// Notes that the choice of a material has no effect.
fn note_unused_material(options: &Options, source: &mut Source<'_>) {
    if let Some(material) = &options.material {
        source.note(format!(
            "the choice of material `{material}` has no effect: only a glTF or MaterialX file can hold several materials"
        ));
    }
}
