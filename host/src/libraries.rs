//! The user's own ink libraries: folders by name, beside presets and profiles.
//!
//! Wherever a library is asked for, a folder, the name of a library that was added, or `builtin` will do; a folder comes first.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use files::durable;
use files::scratch::{self, Scratch};
use files::shelf::Disk;
use inks::archive::{self, Member};
use inks::{FILE_NAME, Library};

use crate::folders;

/// Names of the library that comes with the program.
const BUILT_IN: [&str; 2] = ["builtin", "built-in"];

fn home() -> Result<PathBuf> {
    Ok(folders::config()?.join("libraries"))
}

/// The names of the libraries that were added, sorted.
pub fn names() -> Vec<String> {
    let Ok(entries) = home().and_then(|home| Ok(fs::read_dir(home)?)) else { return Vec::new() };
    let folders = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let with_library = folders.filter(|folder| folder.join(FILE_NAME).is_file());
    let mut names: Vec<String> =
        with_library.filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned())).collect();
    names.sort();
    names
}

/// Whether this means the library that comes with the program.
pub fn is_built_in(spec: &Path) -> bool {
    BUILT_IN.iter().any(|name| spec.as_os_str() == *name) && !spec.is_dir()
}

/// The folder of a library, given as a folder or by its name.
pub fn folder(spec: &Path) -> Result<PathBuf> {
    if spec.exists() || spec.components().count() != 1 {
        return Ok(spec.to_path_buf());
    }
    let name = spec.to_string_lossy();
    if let Some(added) = added(&name) {
        return Ok(added);
    }
    bail!(
        "there is no ink library `{name}`: no folder has this name, and {}; `foilpress inks add` adds one",
        known()
    )
}

/// The folder of a library that was added under this name.
pub fn added(name: &str) -> Option<PathBuf> {
    home().ok().and_then(|home| folders::folder(&home, name).ok()).filter(|added| added.is_dir())
}

/// The libraries that were added, in words.
fn known() -> String {
    match names() {
        names if names.is_empty() => "none was added".to_owned(),
        names => format!("those added are {}", names.join(", ")),
    }
}

/// A library, given as a folder, by its name, or as `builtin`.
pub fn open(spec: &Path) -> Result<Library> {
    if is_built_in(spec) {
        return Ok(Library::builtin());
    }
    let folder = folder(spec)?;
    Library::open(&Disk, &folder).with_context(|| format!("{} is not a usable ink library", folder.display()))
}

/// The library asked for; without one, that of the program.
pub fn given(spec: Option<&Path>) -> Result<Library> {
    spec.map_or_else(|| Ok(Library::builtin()), open)
}

/// Makes files a library of the user under this name, whole or not at all.
pub fn install(name: &str, members: &[Member]) -> Result<(PathBuf, Library)> {
    let home = home()?;
    let target = folders::folder(&home, name)?;
    if BUILT_IN.contains(&name) {
        bail!("`{name}` is the library that comes with the program; choose another name (--name)");
    }
    if fs::symlink_metadata(&target).is_ok() {
        bail!(
            "there is a library `{name}` already, in {}; choose another name (--name), or remove that folder first",
            target.display()
        );
    }
    let cannot = || format!("cannot write {}", target.display());
    fs::create_dir_all(&home).with_context(cannot)?;
    let staging = Scratch::beside(&home).with_context(cannot)?;
    let inside = staging.path().join(name);
    fs::create_dir(&inside).with_context(cannot)?;
    archive::place(members, &inside).with_context(cannot)?;
    let library = Library::open(&Disk, &inside).map_err(|error| {
        // The staging folder means nothing to the user.
        let said =
            error.to_string().replace(&format!("{}{}", inside.display(), std::path::MAIN_SEPARATOR), "");
        anyhow::anyhow!("not a usable ink library: {said}")
    })?;
    // Held until the folder has its name, so that an interruption finds either all of it or nothing.
    let folders = scratch::folders();
    durable::place(&inside, &target).with_context(cannot)?;
    drop(folders);
    Ok((target, library))
}

/// Removes the library that was added under this name, at once or not at all. Returns where it was.
pub fn remove(name: &str) -> Result<PathBuf> {
    if BUILT_IN.contains(&name) {
        bail!("`{name}` is the library that comes with the program; it cannot be removed");
    }
    let Some(target) = added(name) else {
        bail!("no library was added under the name `{name}`; {}", known());
    };
    let cannot = || format!("cannot remove {}", target.display());
    let staging = Scratch::beside(&home()?).with_context(cannot)?;
    let folders = scratch::folders();
    fs::rename(&target, staging.path().join(name)).with_context(cannot)?;
    drop(folders);
    Ok(target)
}
