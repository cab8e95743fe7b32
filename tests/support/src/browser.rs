//! Scripts that drive a page in a real browser. `cargo xtask preview` brings browser and Node, and names them.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::needs::{self, Need};

/// Node, and the folder of scripts.
pub struct Browser {
    node: PathBuf,
    scripts: PathBuf,
}

impl Browser {
    /// What the environment names; `None` where a test is to be left out.
    pub fn find() -> Option<Browser> {
        needs::path(Need::Browser, "FOILPRESS_CHROMIUM")?;
        let node = needs::path(Need::Browser, "FOILPRESS_NODE")?;
        Some(Browser { node, scripts: needs::path(Need::Browser, "FOILPRESS_BROWSER")? })
    }

    /// Runs Node with these arguments for a page, for the pages in a folder, or for those at an address.
    ///
    /// # Panics
    /// When it fails.
    pub fn run(&self, args: &[&str], page: &Path) {
        let mut command = Command::new(&self.node);
        command.args(args).current_dir(&self.scripts).env("FOILPRESS_PAGE", page);
        let status = command.status().expect("node runs");
        assert!(status.success(), "{args:?}: {status}");
    }

    /// Runs those tests of a script whose names match a pattern.
    ///
    /// # Panics
    /// When one fails.
    pub fn test(&self, script: &str, pattern: &str, page: &Path) {
        let pattern = format!("--test-name-pattern={pattern}");
        self.run(&["--test", "--test-reporter=spec", "--test-concurrency=1", &pattern, script], page);
    }
}
