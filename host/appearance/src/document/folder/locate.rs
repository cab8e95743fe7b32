//! Where the material is in a download.
//!
//! Problem: sites pack maps into a folder such as `textures`, beside scenes of other programs, or below a folder of the
//! material's name.
//! Method: level by level, at most three deep, a folder counts if it holds a base colour map by its name, or else exactly one glTF or
//! MaterialX file. The first level with one such folder is taken; with several the choice is the user's.

use std::path::{Path, PathBuf};

use ::files::shelf::Kind;

use super::files::has_base_colour;
use super::settings::SETTINGS;
use crate::document::error::{DocumentError, list};
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
    /// A glTF or MaterialX file.
    File(PathBuf),
}

/// Finds the material in a folder or an archive. A folder without any is returned itself: its reader says what is missing.
pub fn locate(folder: &Path, source: &mut Source<'_>) -> Result<Found, DocumentError> {
    let mut level = vec![folder.to_path_buf()];
    for depth in 0..=DEPTH {
        let (mut found, mut next) = (Vec::new(), Vec::new());
        for path in level.iter().take(MOST_FOLDERS) {
            let entries = source.list(path)?;
            let files =
                || entries.iter().filter(|(_, kind)| *kind != Kind::Folder).map(|(name, _)| &name[..]);
            let scenes: Vec<&str> = files().filter(|name| is_scene(name)).collect();
            if has_base_colour(files()) || files().any(|name| name == SETTINGS) {
                found.push(Found::Maps(path.clone()));
            } else if let [scene] = scenes[..] {
                found.push(Found::File(path.join(scene)));
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
                let (Found::Maps(path) | Found::File(path)) = &found;
                if depth > 0 || matches!(found, Found::File(_)) {
                    source.note(format!("the material is read from {}", path.display()));
                }
                return Ok(found);
            }
            (0, _) => level = next,
            (_, last) => {
                found.extend(last);
                let names: Vec<String> = found
                    .iter()
                    .map(|(Found::Maps(path) | Found::File(path))| {
                        path.strip_prefix(folder).unwrap_or(path).display().to_string()
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
    Ok(Found::Maps(folder.to_path_buf()))
}

fn is_scene(name: &str) -> bool {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    !name.starts_with('.') && matches!(ending.as_deref(), Some("gltf" | "glb" | "mtlx"))
}
