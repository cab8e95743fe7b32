//! The files that make this program part of the print system, and where they go.
//!
//! CUPS finds backends and filters in its own folders, runs them as its own user, and refuses files that others than root can
//! change. So two short shell scripts go there that start this program. The program itself must also be changeable only by
//! root; if it is not, a copy is installed that is.
//! Limits: Unix.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::ppd;
use files::durable::{self, Access};
use press::layout::Profile;

/// Where a print system keeps its things.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Places {
    /// Folder of `backend/` and `filter/`.
    pub programs: PathBuf,
    /// Folder of `*.types` files.
    pub types: PathBuf,
    /// Folder of printer descriptions.
    pub descriptions: PathBuf,
    /// Where the program is copied to if others than root can change it.
    pub program: PathBuf,
}

/// A file to install.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Wanted {
    /// Its path.
    pub path: PathBuf,
    /// Its contents.
    pub text: String,
    /// Whether it is executable.
    pub executable: bool,
}

/// Name of the printer description's file.
pub const DESCRIPTION: &str = "foilpress-md5500.ppd";

impl Places {
    /// Where Debian and its derivatives keep them, below `root`.
    pub fn usual(root: &Path) -> Places {
        Places {
            programs: root.join("usr/lib/cups"),
            types: root.join("usr/share/cups/mime"),
            descriptions: root.join("usr/share/ppd/foilpress"),
            program: root.join("usr/local/lib/foilpress/foilpress"),
        }
    }

    /// The files that make `program` a backend and a filter.
    pub fn files(&self, program: &Path) -> Vec<Wanted> {
        let start = |command: &str| {
            format!(
                "#!/bin/sh\nexec '{}' {command} \"$@\"\n",
                program.display().to_string().replace('\'', "'\\''")
            )
        };
        let file = |path: PathBuf, text, executable| Wanted { path, text, executable };
        vec![
            file(self.programs.join("backend/foilpress"), start("cups-backend"), true),
            file(self.programs.join("filter/foilpress"), start("cups-filter"), true),
            file(self.types.join("foilpress.types"), ppd::TYPES.into(), false),
            file(self.descriptions.join(DESCRIPTION), ppd::description(&Profile::default()), false),
        ]
    }

    /// Removes the files of [`files`](Places::files) and the copy of the program; returns those that existed.
    pub fn remove(&self) -> io::Result<Vec<PathBuf>> {
        let mut removed = Vec::new();
        let files = self.files(&self.program).into_iter().map(|file| file.path);
        for path in files.chain([self.program.clone()]) {
            match fs::remove_file(&path) {
                Ok(()) => removed.push(path),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        // Only folders of this program, and only if they are empty.
        for folder in [Some(self.descriptions.as_path()), self.program.parent()].into_iter().flatten() {
            let _ = fs::remove_dir(folder);
        }
        Ok(removed)
    }
}

/// Whether only root can change a program: root owns it and every folder above it, and nobody else may write to them.
#[cfg(unix)]
pub fn is_roots(program: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt as _;
    let real = program.canonicalize()?;
    for path in real.ancestors() {
        let found = fs::metadata(path)?;
        // A folder such as /tmp, where others may write but not change files of others, does not count as safe either.
        if found.uid() != 0 || found.mode() & 0o022 != 0 {
            return Ok(false);
        }
    }
    Ok(true)
}

/// On other systems there is no print system of this kind.
#[cfg(not(unix))]
pub fn is_roots(_program: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Writes a file whole or not at all, unless it already has these contents. True if it was written.
pub fn put(wanted: &Wanted) -> io::Result<bool> {
    if fs::read_to_string(&wanted.path).is_ok_and(|text| text == wanted.text) {
        return Ok(false);
    }
    durable::make_folder(wanted.path.parent().unwrap_or(Path::new("/")), Access::Everyone)?;
    let access = if wanted.executable { Access::Program } else { Access::Everyone };
    durable::write(&wanted.path, wanted.text.as_bytes(), access)?;
    Ok(true)
}

/// Copies the program to a folder that only root can change.
pub fn copy_program(from: &Path, to: &Path) -> io::Result<()> {
    durable::make_folder(to.parent().unwrap_or(Path::new("/")), Access::Everyone)?;
    durable::write(to, &fs::read(from)?, Access::Program)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn what_others_can_change_is_not_roots() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("foilpress");
        fs::write(&program, "x").unwrap();
        assert!(!is_roots(&program).unwrap(), "below /tmp everybody can put things");
        assert!(is_roots(Path::new("/no/such/program")).is_err());
    }

    #[test]
    fn files_are_written_once_and_their_shell_lines_start_the_program_whatever_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let places = Places::usual(folder.path());
        let program = folder.path().join("it's a program");
        fs::write(&program, "#!/bin/sh\nprintf '%s|' \"$@\"\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let files = places.files(&program);
        assert!(files.iter().all(|file| put(file).unwrap()));
        assert!(files.iter().all(|file| !put(file).unwrap()));
        let said = std::process::Command::new(&files[0].path).args(["1", "a b"]).output().unwrap();
        assert_eq!(String::from_utf8(said.stdout).unwrap(), "cups-backend|1|a b|");
        let gone = places.remove().unwrap();
        assert_eq!(gone, files.iter().map(|file| file.path.clone()).collect::<Vec<_>>());
        assert!(places.programs.join("backend").is_dir(), "folders of the print system stay");
        assert!(!places.descriptions.exists() && places.remove().unwrap().is_empty());
    }
}
