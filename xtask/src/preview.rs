//! `cargo xtask preview`: the preview's page, the display's and the report in a real browser.
//!
//! The sources of pages and scripts are checked, its pictures are compared with those of the renderer, and every control is used by
//! mouse, touch and keyboard. The browser is Debian's, drawing in software.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, bail};
use needs::Need;

use crate::runner::Runner;
use crate::tools::{self, Node};
use crate::{command, firmware, succeed};

const CHROMIUM: &str = "chromium";
const ESLINT: &str = "tests/browser/node_modules/eslint/bin/eslint.js";

/// The tests in a browser by themselves.
pub fn run(root: &Path) -> Result<()> {
    let mut runner = Runner::find(root, false);
    runner.name(bring(root)?);
    runner.only("browser").map(drop)
}

/// Checks the scripts and names what the tests need; nothing where browser or Node cannot be had, which has then been said.
pub fn bring(root: &Path) -> Result<Vec<(&'static str, OsString)>> {
    let folder = firmware::target(root);
    std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    let scripts = root.join("tests/browser");
    let node = match Node::find(&folder).and_then(|node| install().map(|()| node)) {
        Ok(node) => node,
        Err(missing) => return tools::skip(Need::Browser, &format!("{missing:#}")).map(|()| Vec::new()),
    };
    node.install(&scripts)?;
    succeed(node.command("npm", &["exec", "--", "tsc", "--project", "."]).current_dir(&scripts))?;
    let lint = [ESLINT, "--config", "tests/browser/eslint.config.js", "--max-warnings", "0", "host", "tests"];
    succeed(node.command("node", &lint).current_dir(root))?;
    Ok(vec![
        ("FOILPRESS_CHROMIUM", found()?.into()),
        ("FOILPRESS_NODE", node.program.into()),
        ("FOILPRESS_BROWSER", scripts.into()),
    ])
}

/// Where the browser is.
fn found() -> Result<PathBuf> {
    let path = env::var_os("PATH").unwrap_or_default();
    let mut programs = env::split_paths(&path).map(|folder| folder.join(CHROMIUM));
    programs.find(|program| program.is_file()).context("chromium is not on PATH")
}

/// Installs the browser where it is missing.
fn install() -> Result<()> {
    let has = || {
        let mut version = command(CHROMIUM, &["--version"]);
        version.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
    };
    if has() {
        return Ok(());
    }
    println!("{CHROMIUM} is not installed; apt fetches it");
    let apt = || {
        let mut install =
            command("apt-get", &["install", "--yes", "--quiet", "--no-install-recommends", CHROMIUM]);
        install.env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        install.status().is_ok_and(|status| status.success())
    };
    // The lists of a fresh machine are empty.
    if !apt() {
        let _ = command("apt-get", &["update", "--quiet"]).stdout(Stdio::null()).status();
        apt();
    }
    if !has() {
        bail!("{CHROMIUM} is not installed and cannot be (apt needs root)");
    }
    Ok(())
}
