//! What a test needs beside Rust, and what happens where that is missing.
//!
//! A test that cannot run here says which [`Need`] is missing, and passes. So that nobody takes that for a success, each
//! such test adds a line to the file that `FOILPRESS_SKIPS` names, which `cargo xtask test` lists at its end. Where
//! `FOILPRESS_REQUIRED` names the need (`emulator,queue`, or `all`), the test fails instead.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Something that is not part of the project.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Need {
    /// Streams of the established driver, in the folder that `FOILPRESS_GOLDEN` names.
    Golden,
    /// Real textures and measured BRDFs, in the folder that `FOILPRESS_DATA` names.
    Data,
    /// An independent renderer: the script that `FOILPRESS_REFERENCE` names.
    Reference,
    /// Python with NumPy.
    Numpy,
    /// A print server and Ghostscript; for the server, root too.
    Queue,
    /// The firmware's image and Node, which `cargo xtask emulator` brings.
    Emulator,
    /// `umockdev`, which shows emulated devices on a program's USB.
    Usb,
    /// dpkg, man and root.
    Package,
    /// Chromium and Node, which `cargo xtask preview` brings.
    Browser,
    /// Tesseract, which reads printed text.
    Reading,
    /// Programs that develop cameras' RAW files: `dcraw_emu` and `dcraw`.
    Raw,
}

impl Need {
    /// Its name in `FOILPRESS_REQUIRED`.
    pub fn name(self) -> &'static str {
        match self {
            Need::Golden => "golden",
            Need::Data => "data",
            Need::Reference => "reference",
            Need::Numpy => "numpy",
            Need::Queue => "queue",
            Need::Emulator => "emulator",
            Need::Usb => "usb",
            Need::Package => "package",
            Need::Browser => "browser",
            Need::Reading => "reading",
            Need::Raw => "raw",
        }
    }

    /// Whether a test may not go without it.
    pub fn is_required(self) -> bool {
        std::env::var("FOILPRESS_REQUIRED")
            .is_ok_and(|names| names.split(',').any(|name| name == "all" || name == self.name()))
    }

    /// Says that the test running in this thread is left out, and why.
    ///
    /// # Panics
    /// Where the need is required.
    pub fn skip(self, why: &str) {
        let thread = std::thread::current();
        let test = thread.name().filter(|name| *name != "main").unwrap_or("a step");
        let line = format!("{test} needs `{}`: {why}", self.name());
        assert!(!self.is_required(), "{line}, and FOILPRESS_REQUIRED asks for it");
        println!("skipped: {line}");
        if let Some(list) = std::env::var_os("FOILPRESS_SKIPS") {
            if let Some(folder) = Path::new(&list).parent() {
                let _ = std::fs::create_dir_all(folder);
            }
            let list = OpenOptions::new().create(true).append(true).open(list);
            let written = list.and_then(|mut list| list.write_all(format!("{line}\n").as_bytes()));
            written.expect("FOILPRESS_SKIPS names a file that can be written");
        }
    }
}

/// What this variable names; without it the test is [left out](Need::skip).
///
/// # Panics
/// As [`Need::skip`].
pub fn path(need: Need, variable: &str) -> Option<PathBuf> {
    let path = std::env::var_os(variable).map(PathBuf::from);
    if path.is_none() {
        need.skip(&format!("{variable} is not set"));
    }
    path
}

/// Folder of the established driver's streams.
pub fn golden() -> Option<PathBuf> {
    path(Need::Golden, "FOILPRESS_GOLDEN")
}

/// Folder of real textures and measured BRDFs.
pub fn data() -> Option<PathBuf> {
    path(Need::Data, "FOILPRESS_DATA")
}

/// Whether Python can import NumPy.
pub fn numpy() -> bool {
    let import = std::process::Command::new("python3").args(["-c", "import numpy"]).output();
    let found = import.is_ok_and(|output| output.status.success());
    if !found {
        Need::Numpy.skip("there is no python3 with NumPy");
    }
    found
}

/// Whether this program starts when it is asked for its version.
pub fn starts(program: &str) -> bool {
    std::process::Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Whether Ghostscript has its own driver for these printers, to compare with. Distributions leave such drivers out of newer versions,
/// so no test needs it.
pub fn md5k() -> bool {
    let listed = std::process::Command::new("gs").arg("-h").output();
    let found = listed.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(" md5k"));
    if !found {
        println!("left out: this Ghostscript has no driver md5k to compare with");
    }
    found
}

/// Whether Ghostscript is there; if not, the test is left out.
pub fn ghostscript() -> bool {
    let found = starts("gs");
    if !found {
        Need::Queue.skip("Ghostscript is not installed; `cargo xtask queue` installs it");
    }
    found
}
