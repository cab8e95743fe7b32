//! Outputs appear whole or not at all.
//!
//! Everything is written to a hidden staging folder beside its destination and moved there at the end. If the
//! program fails the folder goes with it; if it is interrupted, [`remove_on_interrupt`] sees to that.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail};
use tempfile::TempDir;

static STAGED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// What the user is told when the program is interrupted.
static FAREWELL: Mutex<String> = Mutex::new(String::new());

/// From now on an interruption is not without consequences: says which.
pub fn say_on_interrupt(text: &str) {
    text.clone_into(&mut FAREWELL.lock().unwrap_or_else(PoisonError::into_inner));
}

/// What a folder of ours holds: only such a folder, or an empty one, is ever replaced.
const MARKERS: [&str; 5] = ["report.json", "document.toml", "mix.toml", "sheet.toml", "passes.toml"];

/// A place to write a file or a folder before it appears under its own name.
pub struct Staged {
    target: PathBuf,
    inside: PathBuf,
    folder: TempDir,
}

impl Staged {
    /// Prepares to write `target`. Fails early if it cannot be written or is a folder that is not ours.
    pub fn new(target: &Path) -> Result<Staged> {
        let name = target
            .file_name()
            .with_context(|| format!("{} names no file or folder to write", target.display()))?;
        if target.is_dir() && !replaceable(target)? {
            bail!(
                "{} exists and was not made by this program; choose another place with -o",
                target.display()
            );
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let folder = tempfile::Builder::new()
            .prefix(&format!(".{}.", name.to_string_lossy()))
            .tempdir_in(parent)
            .with_context(|| format!("cannot write in {}", parent.display()))?;
        staged().push(folder.path().to_path_buf());
        Ok(Staged { target: target.to_path_buf(), inside: folder.path().join(name), folder })
    }

    /// Where to write; nothing is there yet.
    pub fn path(&self) -> &Path {
        &self.inside
    }

    /// Where to write, as a folder that is there.
    pub fn folder(&self) -> Result<&Path> {
        fs::create_dir(&self.inside).with_context(|| format!("cannot write {}", self.target.display()))?;
        Ok(&self.inside)
    }

    /// Moves what was written to its own name, replacing what was there.
    pub fn commit(self) -> Result<()> {
        let old = self.folder.path().join("replaced");
        if self.target.is_dir() {
            fs::rename(&self.target, &old)
                .with_context(|| format!("cannot replace {}", self.target.display()))?;
        }
        if let Err(error) = fs::rename(&self.inside, &self.target) {
            if old.exists() {
                // The old folder goes back; if even that fails it is still in the staging folder, which stays.
                if fs::rename(&old, &self.target).is_err() {
                    let kept = self.folder.keep();
                    bail!(
                        "cannot write {}: {error}; what was there is in {}",
                        self.target.display(),
                        kept.display()
                    );
                }
            }
            return Err(error).with_context(|| format!("cannot write {}", self.target.display()));
        }
        staged().retain(|path| path != self.folder.path());
        Ok(())
    }
}

fn staged() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    STAGED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn replaceable(folder: &Path) -> Result<bool> {
    let mut entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    Ok(MARKERS.iter().any(|marker| folder.join(marker).is_file()) || entries.next().is_none())
}

/// Removes what is staged when the user interrupts the program, which then ends with exit code 130.
pub fn remove_on_interrupt() -> Result<()> {
    ctrlc::set_handler(|| {
        let paths = staged();
        for path in paths.iter() {
            // A stage may still be writing into the folder; a second try catches what it added meanwhile.
            for _ in 0..3 {
                match fs::remove_dir_all(path) {
                    Err(error) if error.kind() != io::ErrorKind::NotFound => {}
                    _ => break,
                }
            }
        }
        let farewell = FAREWELL.lock().unwrap_or_else(PoisonError::into_inner);
        let text = if farewell.is_empty() { "\ninterrupted; nothing was written" } else { &farewell };
        eprintln!("{text}");
        std::process::exit(130);
    })
    .context("cannot watch for Ctrl-C")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_left_when_the_work_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let staged = Staged::new(&folder.path().join("out.print")).unwrap();
        fs::create_dir(staged.path()).unwrap();
        fs::write(staged.path().join("half"), "x").unwrap();
        drop(staged);
        assert!(entries(folder.path()).is_empty());
    }

    #[test]
    fn our_own_folder_is_replaced_and_a_stranger_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.print");
        for round in ["one", "two"] {
            let staged = Staged::new(&target).unwrap();
            fs::create_dir(staged.path()).unwrap();
            fs::write(staged.path().join("report.json"), round).unwrap();
            staged.commit().unwrap();
            assert_eq!(fs::read_to_string(target.join("report.json")).unwrap(), round);
            assert_eq!(entries(folder.path()), ["out.print"]);
        }
        let stranger = folder.path().join("thesis");
        fs::create_dir(&stranger).unwrap();
        fs::write(stranger.join("chapter1"), "x").unwrap();
        assert!(Staged::new(&stranger).is_err());
        assert_eq!(entries(&stranger), ["chapter1"]);
    }

    #[test]
    fn a_file_is_replaced_in_one_step() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("job.rgl");
        fs::write(&target, "old").unwrap();
        let staged = Staged::new(&target).unwrap();
        fs::write(staged.path(), "new").unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
    }
}
