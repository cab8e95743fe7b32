//! Choosing the reader of a document.

use std::path::{Path, PathBuf};

use files::shelf::Shelf;
use inks::Curve;
use observe::{Observer, Silent};

use super::content::MOST_BYTES;
use super::content::{Document, Options, name_of};
use super::error::DocumentError;
use super::source::Source;
use super::{curve, foil, folder, gltf, gonio, materialx, merl, mtl, rgl, sample, usd};
use crate::brdf::Space;
use crate::materials::{Materials, Metallic, Nearest};

/// Opens a document: a path, or `sample:NAME`.
///
/// A folder with `document.toml` is a factored document, any other folder a set of texture maps; a zip
/// archive is read as the folder that it holds, and so is USDZ. The format of a file is recognised by its
/// first bytes, then by its extension.
pub fn open(spec: &str, options: &Options, observer: &dyn Observer) -> Result<Document, DocumentError> {
    if options.samples == 0 || options.samples > 4096 {
        return Err(DocumentError::Samples { found: options.samples });
    }
    let space = Space::half_angle(options.samples);
    let path = Path::new(spec);
    let mut source = Source::new(&*options.shelf, observer);
    if let Some(name) = spec.strip_prefix("sample:") {
        note_unused_choices(options, &mut source);
        return sample::open(name, space, source);
    }
    let archive = !source.is_folder(path)? && source.head(path)?.starts_with(b"PK\x03\x04");
    if archive {
        source.mount(path)?;
    }
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
            folder::Found::Scenes(scenes) => {
                return agreeing(&scenes, archive.then_some(path), options, &space, source);
            }
        }
    }
    let head = source.head(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if let Some(read) = scene(&head, &extension) {
        return read(path, options, space, source);
    }
    note_unused_choices(options, &mut source);
    if head.starts_with(b"tensor_file\0") || extension == "bsdf" {
        return rgl::open(path, space, source);
    }
    match extension.as_str() {
        "binary" => merl::open(path, space, source),
        "brdf" => gonio::open(path, space, source),
        "csv" => curve::open(path, space, source),
        _ => Err(DocumentError::foreign(path).unwrap_or(DocumentError::Kind { path: path.to_path_buf() })),
    }
}

/// Reads a file that says what its maps mean.
type Scene = fn(&Path, &Options, Space, Source<'_>) -> Result<Document, DocumentError>;

/// The reader of such a file, if it is one.
fn scene(head: &[u8], extension: &str) -> Option<Scene> {
    match extension {
        "gltf" | "glb" => Some(gltf::open),
        _ if head.starts_with(b"glTF") => Some(gltf::open),
        "mtlx" => Some(materialx::open),
        "mtl" => Some(mtl::open),
        "usda" | "usd" | "usdc" => Some(usd::open),
        _ if head.starts_with(b"#usda") || usd::is_binary(head) => Some(usd::open),
        _ => None,
    }
}

/// The document of the first of some files in one folder, which all say what the same maps mean: those that
/// can be read must agree.
fn agreeing(
    scenes: &[PathBuf],
    archive: Option<&Path>,
    options: &Options,
    space: &Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let read = |path: &Path, source: Source<'_>| {
        let head = source.head(path)?;
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        match scene(&head, &extension) {
            Some(read) => read(path, options, space.clone(), source),
            None => Err(DocumentError::Kind { path: path.to_path_buf() }),
        }
    };
    let Some((first, others)) = scenes.split_first() else {
        return Err(DocumentError::Kind { path: PathBuf::new() });
    };
    source.tell_unread();
    let mut notes = Vec::new();
    let observer = source.observer;
    let document = read(first, source)?;
    for other in others {
        let mut again = Source::new(&*options.shelf, &Silent);
        if let Some(archive) = archive {
            again.mount(archive)?;
        }
        let name = other.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match read(other, again) {
            Err(error) => notes.push(format!("{name} is not compared with it: {error}")),
            Ok(found) => match disagreement(&document, &found) {
                Some([own, others]) => {
                    return Err(DocumentError::Field {
                        path: other.clone(),
                        field: "material".into(),
                        problem: format!(
                            "it says {others}, and {} beside it says {own}; open the one that is right",
                            first.file_name().unwrap_or_default().to_string_lossy()
                        ),
                    });
                }
                None => notes.push(format!("{name} says the same")),
            },
        }
    }
    notes.iter().for_each(|note| observer.note(note));
    Ok(Document { notes: document.notes.iter().cloned().chain(notes).collect(), ..document })
}

/// What two documents say where they differ most, if that is seen.
fn disagreement(a: &Document, b: &Document) -> Option<[String; 2]> {
    /// Places across and down that are compared. Source: what covers a sixty-fourth of the picture is met.
    const PLACES: usize = 8;
    /// Source: a distance that is plainly seen; maps of other sizes differ by less.
    const SEEN: f64 = 0.03;
    let (a, b) = (a.materials(), b.materials());
    let space = a.space();
    let row = |of: &dyn Materials, place: usize| -> Vec<f64> {
        let at = |i: usize, side: usize| (2 * i + 1) * side / (2 * PLACES);
        let pixel = at(place / PLACES, of.height()) * of.width() + at(place % PLACES, of.width());
        let mut row = vec![0f32; space.columns()];
        of.reflectance(pixel, &mut row);
        row.iter().map(|&f| f64::from(f)).collect()
    };
    let pairs = (0..PLACES * PLACES).map(|place| [row(a, place), row(b, place)]);
    let far = pairs.map(|[a, b]| (space.distance(&a, &b), [a, b])).max_by(|a, b| a.0.total_cmp(&b.0));
    let words = |row: Vec<f64>| {
        let nearest = Nearest::to(space, &row);
        let Metallic { base: [r, g, b], metallic } = nearest.metallic();
        format!(
            "base colour {r:.2} {g:.2} {b:.2}, metallic {metallic:.2}, roughness {:.2}",
            nearest.alpha.sqrt()
        )
    };
    far.filter(|(d, _)| *d > SEEN).map(|(_, rows)| rows.map(words))
}

/// The curve of a measured BRDF, as its file has it: MERL `.binary`, RGL `.bsdf`, a goniometer's `.brdf`,
/// or a curve's `.csv`.
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
            "the choice of material `{material}` has no effect: only a glTF, MaterialX, USD or MTL file can hold several materials"
        ));
    }
}
