//! What the tests of print queues, of PDF art and of cameras' files need beside Rust, from Debian: a print server with its filters
//! and clients, Ghostscript and programs that develop RAW.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Result, bail};

use crate::command;
use crate::runner::Runner;

/// Programs the tests start, and the packages they are in.
const NEEDED: [(&str, &str); 10] = [
    ("/usr/sbin/cupsd", "cups-daemon"),
    ("/usr/lib/cups/daemon/cups-deviced", "cups"),
    ("/usr/bin/lp", "cups-client"),
    ("/usr/bin/ipptool", "cups-ipp-utils"),
    ("/usr/lib/cups/filter/pdftopdf", "cups-filters"),
    ("/usr/bin/gs", "ghostscript"),
    ("/usr/bin/man", "man-db"),
    ("/usr/bin/tesseract", "tesseract-ocr"),
    ("/usr/bin/dcraw_emu", "libraw-bin"),
    ("/usr/bin/dcraw", "dcraw"),
];

/// Installs what is missing.
pub fn install() -> Result<()> {
    let missing =
        || NEEDED.into_iter().filter(|(path, _)| !Path::new(path).exists()).map(|(_, package)| package);
    let packages: Vec<&str> = missing().collect();
    if packages.is_empty() {
        return Ok(());
    }
    println!("not installed, apt fetches: {}", packages.join(" "));
    let mut install = command("apt-get", &["install", "--yes", "--quiet", "--no-install-recommends"]);
    install.args(&packages).env("DEBIAN_FRONTEND", "noninteractive");
    // The lists of a fresh machine are empty.
    if !succeeds(&mut install) {
        succeeds(&mut command("apt-get", &["update", "--quiet"]));
        succeeds(&mut install);
    }
    let left: Vec<&str> = missing().collect();
    if !left.is_empty() {
        bail!("{} cannot be installed; as root: apt-get install {}", left.join(", "), left.join(" "));
    }
    Ok(())
}

/// The tests of print queues alone.
pub fn run(root: &Path) -> Result<()> {
    install()?;
    Runner::find(root, false).only("queue").map(drop)
}

fn succeeds(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}
