//! Where the material is in a download.
//!
//! Problem: sites pack maps into a folder such as `textures`, beside scenes of other programs, or below a
//! folder of the material's name.
//! Method: level by level, at most three deep, a folder counts if it holds `material.toml`, or else a glTF,
//! MaterialX, USD or MTL file, which says what its maps mean, or else a base colour map by its name. The
//! first level with one such is taken; with several the choice is the user's.

use std::path::{Path, PathBuf};

use ::files::shelf::Kind;

use super::files::has_base_colour;
use super::settings::SETTINGS;
use crate::document::error::{DocumentError, list, way_out};
use crate::document::names::is_picture;
use crate::document::source::Source;

/// How many levels below the folder are searched: texture sets lie in one or two, and a home folder must not
/// be walked.
const DEPTH: usize = 3;

/// The most folders that are looked into, so that a wrong path ends with a message and not after minutes.
const MOST_FOLDERS: usize = 1000;

/// What there is to open.
pub enum Found {
    /// A folder of maps.
    Maps(PathBuf),
    /// Files of one folder, each of which says what the maps mean, the most telling first.
    Scenes(Vec<PathBuf>),
}

impl Found {
    /// The folder or the first file.
    fn path(&self) -> &Path {
        match self {
            Found::Maps(path) => path,
            Found::Scenes(paths) => paths.first().map_or(Path::new(""), PathBuf::as_path),
        }
    }
}

/// Finds the material in a folder or an archive. A folder without any is returned itself: its reader says
/// what is missing.
pub fn locate(folder: &Path, source: &mut Source<'_>) -> Result<Found, DocumentError> {
    let (mut foreign, mut pictures) = (None, false);
    let mut level = vec![folder.to_path_buf()];
    for depth in 0..=DEPTH {
        let (mut found, mut next) = (Vec::new(), Vec::new());
        for path in level.iter().take(MOST_FOLDERS) {
            let entries = source.list(path)?;
            let files =
                || entries.iter().filter(|(_, kind)| *kind != Kind::Folder).map(|(name, _)| &name[..]);
            let mut scenes: Vec<&str> = files().filter(|name| scene(name).is_some()).collect();
            scenes.sort_by_key(|name| scene(name));
            foreign =
                foreign.or_else(|| files().find(|name| way_out(name).is_some()).map(|name| path.join(name)));
            pictures |= files().any(is_picture);
            // What says what the maps mean wins over their names.
            if files().any(|name| name == SETTINGS) {
                found.push(Found::Maps(path.clone()));
            } else if !scenes.is_empty() {
                found.push(Found::Scenes(scenes.iter().map(|scene| path.join(scene)).collect()));
            } else if has_base_colour(files()) {
                found.push(Found::Maps(path.clone()));
            }
            let visible = |name: &String| !name.starts_with('.') && name != "__MACOSX";
            next.extend(
                entries
                    .iter()
                    .filter(|(name, kind)| *kind == Kind::Folder && visible(name))
                    .map(|e| path.join(&e.0)),
            );
        }
        match (found.len(), found.pop()) {
            (1, Some(found)) => {
                if depth > 0 || matches!(found, Found::Scenes(_)) {
                    source.note(format!("the material is read from {}", found.path().display()));
                }
                return Ok(found);
            }
            (0, _) => level = next,
            (_, last) => {
                found.extend(last);
                let names: Vec<String> = found
                    .iter()
                    .map(|found| {
                        found.path().strip_prefix(folder).unwrap_or(found.path()).display().to_string()
                    })
                    .collect();
                return Err(DocumentError::Field {
                    path: folder.to_path_buf(),
                    field: "folders".into(),
                    problem: format!("several hold a material; open one of them: {}", list(&names)),
                });
            }
        }
    }
    match foreign.filter(|_| !pictures) {
        Some(path) => Err(DocumentError::foreign(&path).unwrap_or(DocumentError::Kind { path })),
        None => Ok(Found::Maps(folder.to_path_buf())),
    }
}

/// Which of the files that say what maps mean a name belongs to, the most telling first; `None` for other
/// files.
fn scene(name: &str) -> Option<usize> {
    let (_, ending) = name.rsplit_once('.').filter(|_| !name.starts_with('.'))?;
    let endings = ["gltf", "glb", "mtlx", "usda", "usd", "mtl", "usdc"];
    endings.iter().position(|known| ending.eq_ignore_ascii_case(known))
}
