//! The files of a folder and their roles.

use std::path::{Path, PathBuf};

use ::files::shelf::Kind;

use super::settings::{FolderSettings, SETTINGS};
use crate::document::error::{DocumentError, list};
use crate::document::names::{self, Role, has_extension, is_picture, stem};
use crate::document::source::Source;

/// The files of a folder by role, and all image files for error messages.
pub(super) struct Files {
    pub(super) folder: PathBuf,
    seen: Vec<String>,
    pub(super) by_role: Vec<(Role, String)>,
    /// The channel of a map that the settings name.
    channels: Vec<(Role, usize)>,
}

impl Files {
    pub(super) fn find(
        folder: &Path,
        settings: &FolderSettings,
        source: &mut Source<'_>,
    ) -> Result<Files, DocumentError> {
        let (mut seen, mut foreign) = (Vec::new(), Vec::new());
        for (name, kind) in source.list(folder)? {
            if name.starts_with('.') || kind == Kind::Folder {
                continue;
            }
            if is_picture(&name) {
                seen.push(name);
            } else if is_foreign_picture(&name) {
                foreign.push(name);
            }
        }
        let all: Vec<&String> = seen.iter().chain(&foreign).collect();
        let stems: Vec<&str> = all.iter().map(|name| stem(name)).collect();
        let roles = names::roles(&stems);
        let mut files = Files {
            folder: folder.to_path_buf(),
            seen: seen.clone(),
            by_role: Vec::new(),
            channels: Vec::new(),
        };
        for (role, named) in settings.maps.named() {
            let (name, channel) = channel_of(named, role).map_err(|problem| DocumentError::Settings {
                path: folder.join(SETTINGS),
                problem: format!("maps: {problem}"),
            })?;
            files.channels.extend(channel.map(|channel| (role, channel)));
            if Path::new(name).components().count() != 1 || name.contains(['/', '\\']) || name == ".." {
                return Err(DocumentError::Settings {
                    path: folder.join(SETTINGS),
                    problem: format!("maps: `{name}` must be the name of a file in the same folder"),
                });
            }
            files.by_role.push((role, name.to_string()));
        }
        for (name, role) in seen.iter().zip(&roles) {
            if let Some(role) = *role
                && settings.maps.named().all(|(named, _)| named != role)
            {
                files.by_role.push((role, name.clone()));
            }
        }
        let own = |named| channel_of(named, Role::Roughness).map_or(named, |(name, _)| name);
        let named = |name: &str| settings.maps.named().any(|(_, named)| own(named) == name);
        let unused = |role: &Option<Role>| matches!(role, None | Some(Role::Ignored));
        let unused: Vec<String> = seen
            .iter()
            .zip(&roles)
            .filter(|(name, role)| unused(role) && !named(name))
            .map(|(name, _)| name.clone())
            .collect();
        if !unused.is_empty() {
            source.note(format!(
                "not used: {}; by their names they are no maps of reflectance ([maps] in {SETTINGS} can name them)",
                list(&unused)
            ));
        }
        files.choose_normal(source);
        files.without_foreign(&foreign, &roles[seen.len()..], source)?;
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

    /// Refuses a folder in which a map is there, by its name, in a format that is not read; what is not needed is noted.
    fn without_foreign(
        &self,
        foreign: &[String],
        roles: &[Option<Role>],
        source: &mut Source<'_>,
    ) -> Result<(), DocumentError> {
        const WAY: &str = "save maps as PNG, JPEG, TIFF, WebP, OpenEXR or Radiance HDR";
        for (name, role) in foreign.iter().zip(roles) {
            let needed = |role: &Role| !matches!(role, Role::Ignored | Role::Unprintable);
            if let Some(role) = role.filter(needed)
                && self.all(role).is_empty()
            {
                return Err(self.error(format!(
                    "{name} is the {} map by its name, but its format is not read; {WAY}, or rename it if it is no map",
                    role.name()
                )));
            }
        }
        if !foreign.is_empty() {
            source.note(format!("not read: {}; {WAY}", list(foreign)));
        }
        let unprintable = self.all(Role::Unprintable);
        if !unprintable.is_empty() {
            source.note(format!(
                "not printed: {}; they describe what ink on paper cannot show",
                list(&unprintable)
            ));
        }
        Ok(())
    }

    pub(super) fn all(&self, role: Role) -> Vec<String> {
        self.by_role.iter().filter(|(r, _)| *r == role).map(|(_, name)| name.clone()).collect()
    }

    /// The channel that the settings name for a role.
    pub(super) fn channel(&self, role: Role) -> Option<usize> {
        self.channels.iter().find(|(own, _)| *own == role).map(|(_, channel)| *channel)
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

/// The name of a file, and the channel that follows it behind a colon, as in `T_Thing_RMA.png:r`.
fn channel_of(named: &str, role: Role) -> Result<(&str, Option<usize>), String> {
    let Some((name, letter)) = named.rsplit_once(':') else { return Ok((named, None)) };
    let Some(channel) = ["r", "g", "b", "a"].iter().position(|known| *known == letter) else {
        return Err(format!("`{named}`: `{letter}` is no channel; expected one of r, g, b, a"));
    };
    match role {
        Role::Roughness | Role::Metallic | Role::Glossiness | Role::Coat | Role::CoatRoughness => {
            Ok((name, Some(channel)))
        }
        other => Err(format!("`{named}`: the {} map has all channels of its file", other.name())),
    }
}

/// Whether these names of files hold a base colour map.
pub(super) fn has_base_colour<'n>(names: impl Iterator<Item = &'n str>) -> bool {
    let stems: Vec<&str> =
        names.filter(|name| is_picture(name) && !name.starts_with('.')).map(stem).collect();
    names::roles(&stems).contains(&Some(Role::BaseColor))
}

/// Whether a file is, by its name, an image that cannot be decoded here.
fn is_foreign_picture(name: &str) -> bool {
    has_extension(
        name,
        &["gif", "dds", "psd", "ktx2", "ktx", "avif", "heic", "jxl", "jp2", "svg", "tx", "pic"],
    )
}
