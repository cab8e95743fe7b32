//! The files of a folder and their roles.

use std::path::{Path, PathBuf};

use super::settings::{FolderSettings, SETTINGS};
use crate::document::error::{DocumentError, list};
use crate::document::names::{self, Role};
use crate::document::source::Source;

/// The most directory entries that are examined.
const MOST_FILES: usize = 10_000;

/// The files of a folder by role, and all image files for error messages.
pub(super) struct Files {
    pub(super) folder: PathBuf,
    seen: Vec<String>,
    pub(super) by_role: Vec<(Role, String)>,
}

impl Files {
    pub(super) fn find(
        folder: &Path,
        settings: &FolderSettings,
        source: &mut Source<'_>,
    ) -> Result<Files, DocumentError> {
        let io = |source| DocumentError::Io { path: folder.to_path_buf(), attempt: "list", source };
        let (mut seen, mut foreign) = (Vec::new(), Vec::new());
        for entry in std::fs::read_dir(folder).map_err(io)?.take(MOST_FILES) {
            let name = entry.map_err(io)?.file_name().to_string_lossy().into_owned();
            if name.starts_with('.') {
                continue;
            }
            if is_picture(&name) {
                seen.push(name);
            } else if is_foreign_picture(&name) {
                foreign.push(name);
            }
        }
        seen.sort();
        if !foreign.is_empty() {
            foreign.sort();
            source.note(format!(
                "not read: {}; save maps as PNG, JPEG, TIFF, OpenEXR or Radiance HDR",
                list(&foreign)
            ));
        }
        let stems: Vec<&str> =
            seen.iter().map(|name| name.rsplit_once('.').map_or(&name[..], |(s, _)| s)).collect();
        let roles = names::roles(&stems);
        let mut files = Files { folder: folder.to_path_buf(), seen: seen.clone(), by_role: Vec::new() };
        for (role, name) in settings.maps.named() {
            if Path::new(name).components().count() != 1 || name.contains(['/', '\\']) || name == ".." {
                return Err(DocumentError::Settings {
                    path: folder.join(SETTINGS),
                    problem: format!("maps: `{name}` must be the name of a file in the same folder"),
                });
            }
            files.by_role.push((role, name.to_string()));
        }
        for (name, role) in seen.iter().zip(roles) {
            if let Some(role) = role
                && settings.maps.named().all(|(named, _)| named != role)
            {
                files.by_role.push((role, name.clone()));
            }
        }
        files.choose_normal(source);
        Ok(files)
    }

    /// If a folder holds one normal map in both conventions (DirectX and OpenGL), keeps the OpenGL one.
    fn choose_normal(&mut self, source: &mut Source<'_>) {
        let normals = self.all(Role::Normal);
        if normals.len() == 2 {
            let direct = |name: &str| {
                let name = name.to_ascii_lowercase();
                name.contains("dx") || name.contains("directx")
            };
            let drop = match (direct(&normals[0]), direct(&normals[1])) {
                (true, false) => normals[0].clone(),
                (false, true) => normals[1].clone(),
                _ => return,
            };
            self.by_role.retain(|(_, name)| *name != drop);
            source.note(format!(
                "{drop}: not read, because the same normals are there in the other convention"
            ));
        }
    }

    pub(super) fn all(&self, role: Role) -> Vec<String> {
        self.by_role.iter().filter(|(r, _)| *r == role).map(|(_, name)| name.clone()).collect()
    }

    pub(super) fn error(&self, problem: String) -> DocumentError {
        DocumentError::Maps { folder: self.folder.clone(), problem, seen: self.seen.clone() }
    }

    /// The file with a role, if there is one; an error if there are several.
    pub(super) fn one(&self, role: Role) -> Result<Option<String>, DocumentError> {
        match &self.all(role)[..] {
            [] => Ok(None),
            [name] => Ok(Some(name.clone())),
            several => Err(self.error(format!(
                "{} could each be the {} map; name one of them under [maps] in {SETTINGS}",
                several.join(" and "),
                role.name()
            ))),
        }
    }
}

fn is_picture(name: &str) -> bool {
    has_extension(name, &["png", "jpg", "jpeg", "tif", "tiff", "exr", "hdr", "rgbe"])
}

/// Whether a file is, by its name, an image that cannot be decoded here.
fn is_foreign_picture(name: &str) -> bool {
    has_extension(
        name,
        &["tga", "webp", "bmp", "gif", "dds", "psd", "ktx2", "avif", "heic", "jxl", "jp2", "svg", "tx"],
    )
}

fn has_extension(name: &str, kinds: &[&str]) -> bool {
    name.rsplit_once('.').is_some_and(|(_, kind)| kinds.contains(&kind.to_ascii_lowercase().as_str()))
}
