//! `cargo xtask emulator`: the real image on an emulated board, and the program at its cables.
//!
//! What the tests of `emulator::` need, and a bridge to play with. Three kinds of tests: the image with a model printer at its pins, in
//! the board's own time (JavaScript, rp2040js); the program against that board, over a serial port, with the simulated printer at
//! its pins (Rust); the same over USB as libusb meets it (umockdev).

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needs::Need;

use crate::runner::Runner;
use crate::tools::{self, Node};
use crate::{cargo, firmware, succeed};

/// What every use of the emulator needs.
struct Bench {
    image: PathBuf,
    rig: PathBuf,
    scripts: PathBuf,
    /// Where what is made for it goes.
    folder: PathBuf,
    node: Node,
}

impl Bench {
    /// `None` if there is no Node, which has then been said.
    fn new(root: &Path) -> Result<Option<Bench>> {
        let folder = firmware::target(root);
        fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let image = firmware::build(root)?;
        let rig = firmware::build_rig(root)?;
        let node = match Node::find(&folder) {
            Ok(node) => node,
            Err(missing) => return tools::skip(Need::Emulator, &format!("{missing:#}")).map(|()| None),
        };
        let scripts = root.join("tests/emulator");
        node.install(&scripts)?;
        Ok(Some(Bench { image, rig, scripts, folder, node }))
    }
}

/// Builds what the tests need and names it; nothing where it cannot be had, which has then been said.
pub fn bring(root: &Path) -> Result<Vec<(&'static str, OsString)>> {
    let Some(bench) = Bench::new(root)? else { return Ok(Vec::new()) };
    let mut named = vec![
        ("FOILPRESS_IMAGE", bench.image.into()),
        ("FOILPRESS_RIG", bench.rig.into()),
        ("FOILPRESS_NODE", bench.node.program.into()),
    ];
    let usbfs = bench.folder.join("usbfs");
    match tools::usbfs(&bench.scripts.join("usbfs.c"), &usbfs) {
        Ok(()) => named.push(("FOILPRESS_USBFS", usbfs.into())),
        Err(missing) => tools::skip(Need::Usb, &format!("{missing:#}"))?,
    }
    Ok(named)
}

/// The tests of the emulator by themselves.
pub fn alone(root: &Path) -> Result<()> {
    let mut runner = Runner::find(root, false);
    runner.name(bring(root)?);
    runner.only("emulator").map(drop)
}

/// A bridge to play with, until standard input ends.
pub fn serve(root: &Path) -> Result<()> {
    let Some(bench) = Bench::new(root)? else { return Ok(()) };
    let usbfs = bench.folder.join("usbfs");
    let devices = bench.folder.join("bridge");
    match tools::usbfs(&bench.scripts.join("usbfs.c"), &usbfs) {
        Ok(()) => println!("on a program's USB: {} {} -- foilpress ...", usbfs.display(), devices.display()),
        Err(missing) => println!("not on USB: {missing:#}"),
    }
    let mut bridge = cargo(&[
        "run",
        "--quiet",
        "--package",
        "foilpress-tests",
        "--bin",
        "emulated-bridge",
        "--locked",
        "--",
    ]);
    bridge
        .current_dir(root)
        .args([&bench.image, &bench.scripts, &devices])
        .env("FOILPRESS_NODE", &bench.node.program);
    succeed(&mut bridge)
}
