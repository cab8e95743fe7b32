//! The user's own inks: `inks.toml` beside presets and profiles.
//!
//! The print system runs filters as a user without a home, so `/etc/foilpress/inks.toml` is read as well, after the user's;
//! of two inks of one name the user's counts. Lists are written whole by the durable writer, and read once at the start.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use files::durable::{self, Access};
use inks::own::{self, Own};
use protocol::ink::Ink;

use crate::folders;

const FILE: &str = "inks.toml";

/// Where the inks of everyone on this computer are.
#[cfg(unix)]
const EVERYONE: Option<&str> = Some("/etc/foilpress/inks.toml");
#[cfg(not(unix))]
const EVERYONE: Option<&str> = None;

fn path() -> Result<PathBuf> {
    Ok(folders::config()?.join(FILE))
}

/// The list in a file; empty if there is none.
fn list(path: &Path) -> Result<Vec<Own>> {
    /// More than the longest list takes.
    const MOST_BYTES: u64 = 1 << 16;
    let cannot = || format!("your own inks cannot be read from {}", path.display());
    match std::fs::metadata(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(cannot),
        Ok(about) if !about.is_file() || about.len() > MOST_BYTES => {
            bail!("{}: no file of at most {MOST_BYTES} bytes", cannot())
        }
        Ok(_) => {}
    }
    let text = std::fs::read_to_string(path).with_context(cannot)?;
    own::read(&text).map_err(anyhow::Error::msg).with_context(cannot)
}

/// Hands the inks of this user and of everyone to the readers of names. A list that cannot be used is left out, and the
/// messages say why.
pub fn load() -> Vec<anyhow::Error> {
    let (mut all, mut problems): (Vec<Own>, Vec<anyhow::Error>) = (Vec::new(), Vec::new());
    // Without a folder of settings there are no inks of this user.
    let paths = path().into_iter().chain(EVERYONE.map(PathBuf::from));
    for path in paths {
        match list(&path) {
            Ok(list) => {
                for own in list {
                    if !all.iter().any(|other| other.name() == own.name()) {
                        all.push(own);
                    }
                }
            }
            Err(error) => problems.push(error),
        }
    }
    own::set(all);
    problems
}

fn save(path: &Path, list: &[Own]) -> Result<()> {
    let cannot = || format!("cannot write {}", path.display());
    let text = own::write(list).map_err(anyhow::Error::msg).with_context(cannot)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(cannot)?;
    }
    durable::write(path, text.as_bytes(), Access::Everyone).with_context(cannot)
}

/// Adds an ink. Returns it and the file it is in.
pub fn add(name: &str, colour: &str, poses_as: Ink) -> Result<(Own, PathBuf)> {
    let path = path()?;
    let mut all = list(&path)?;
    let own = Own::new(name, colour, poses_as).map_err(anyhow::Error::msg)?;
    own::add(&mut all, own.clone()).map_err(anyhow::Error::msg)?;
    save(&path, &all)?;
    Ok((own, path))
}

/// Removes an ink of this user; `None` if there is none of this name.
pub fn remove(name: &str) -> Result<Option<PathBuf>> {
    let path = path()?;
    let mut all = list(&path)?;
    let before = all.len();
    let wanted = own::named(name).map_or(name, Own::name);
    all.retain(|own| own.name() != wanted);
    if all.len() == before {
        return Ok(None);
    }
    save(&path, &all)?;
    Ok(Some(path))
}
