//! The firmware that came with the program, as files that lie where the program was installed.
//!
//! Problem: `bridge flash` needs an image for each board and `bridge log` the ELF file it was made from, without being told where.
//! Method: the first of a few folders that holds an image, beside the program or where packages put it; [`folders`] lists them.
//! Cost: a few reads of files of some hundred kilobytes, when asked.
//! Limits: what is found is checked as any file is ([`Firmware`]); nothing of it is part of the program.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::{env, fs};

use super::image::{FileError, Firmware, chip_of};

/// The files that `cargo xtask firmware` writes, one for each board. The ELF file of each has its name with another ending.
const FILES: [&str; 2] = ["foilpress-bridge.uf2", "foilpress-bridge-pico2.uf2"];

/// Names the folder to use instead.
pub const VARIABLE: &str = "FOILPRESS_FIRMWARE";

/// An image that came with the program, and its file.
#[derive(Clone, Debug)]
pub struct Installed {
    /// The image.
    pub firmware: Firmware,
    path: PathBuf,
}

impl Installed {
    /// The ELF file that the image was made from, which is needed to decode the firmware's log.
    pub fn elf(&self) -> PathBuf {
        self.path.with_extension("elf")
    }
}

/// Where firmware is looked for: in the folder that [`VARIABLE`] names; else beside the program, in a folder there as in the archives that
/// are downloaded, where the build leaves it, and where packages put it.
pub fn folders() -> Vec<PathBuf> {
    let program = env::current_exe();
    // On Unix a link to the program says nothing of where it was installed; Windows' canonical paths are not what people read.
    let program = if cfg!(unix) { program.and_then(fs::canonicalize) } else { program };
    let program = program.unwrap_or_default();
    folders_of(&program, env::var_os(VARIABLE))
}

fn folders_of(program: &Path, named: Option<OsString>) -> Vec<PathBuf> {
    if let Some(named) = named.filter(|named| !named.is_empty()) {
        return vec![named.into()];
    }
    let Some(beside) = program.parent() else { return Vec::new() };
    let above = beside.parent().unwrap_or(beside);
    let packaged = above.join("share").join("foilpress").join("firmware");
    vec![beside.to_owned(), beside.join("firmware"), above.join("firmware"), packaged]
}

/// The images that came with the program, for each board or for none.
///
/// # Errors
/// Where a file cannot be read or is not the bridge's firmware.
pub fn images() -> Result<Vec<Installed>, FileError> {
    images_in(&folders())
}

fn images_in(folders: &[PathBuf]) -> Result<Vec<Installed>, FileError> {
    let files = |folder: &PathBuf| -> Vec<PathBuf> {
        FILES.iter().map(|name| folder.join(name)).filter(|path| path.exists()).collect()
    };
    let found = folders.iter().map(files).find(|files| !files.is_empty()).unwrap_or_default();
    found.into_iter().map(|path| Ok(Installed { firmware: Firmware::open(&path)?, path })).collect()
}

/// The image that came with the program for the board of a bridge that reports this version.
pub fn image_for(version: &str) -> Option<Installed> {
    images().ok()?.into_iter().find(|installed| installed.firmware.chip() == chip_of(version))
}

#[cfg(test)]
mod tests {
    use super::super::image::tests::{file, file_2350};
    use super::*;
    use uf2::Chip;

    #[test]
    fn firmware_is_found_beside_the_program_where_builds_leave_it_and_where_packages_put_it() {
        for (place, program) in [
            ("downloads", "downloads/foilpress"),
            ("foilpress-0.1.0/firmware", "foilpress-0.1.0/foilpress.exe"),
            ("target/firmware", "target/release/foilpress"),
            ("usr/share/foilpress/firmware", "usr/bin/foilpress"),
        ] {
            let root = tempfile::tempdir().unwrap();
            let folder = root.path().join(place);
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join(FILES[0]), file("foilpress-bridge", "1.2.3", 5000, 9)).unwrap();
            fs::write(folder.join(FILES[1]), file_2350("1.2.3 (Pico 2)", 5000, 9)).unwrap();
            let found = images_in(&folders_of(&root.path().join(program), None)).unwrap();
            let chips: Vec<Chip> = found.iter().map(|installed| installed.firmware.chip()).collect();
            assert_eq!(chips, Chip::ALL, "{place}");
            assert_eq!(found[0].elf(), folder.join("foilpress-bridge.elf"));
        }
    }

    #[test]
    fn a_folder_that_is_named_is_the_only_one() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join(FILES[0]), file("foilpress-bridge", "1.2.3", 5000, 9)).unwrap();
        let program = root.path().join("foilpress");
        let count = |named: &str| images_in(&folders_of(&program, Some(named.into()))).unwrap().len();
        assert_eq!(count("nowhere"), 0);
        assert_eq!(count(""), 1, "an empty name names nothing");
    }

    #[test]
    fn a_damaged_file_is_named_and_no_other_is_taken_for_it() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join(FILES[0]), "cut short").unwrap();
        fs::create_dir(root.path().join("share")).unwrap();
        let error = images_in(&[root.path().into(), root.path().join("share")]).unwrap_err();
        assert!(error.to_string().contains(FILES[0]), "{error}");
    }
}
