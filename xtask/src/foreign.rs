//! The lints of the program for macOS and Windows, which need neither their linkers nor their C compilers.
//!
//! Problem: what is compiled for another system alone is seen by nobody here until its user builds it.
//! Method: Rust's own check for their standard libraries; a script stands for the C compiler of the one library that is in C, since
//! nothing is linked.
//! Limits: that it compiles says nothing about how it runs. [`release`](crate::release) builds and tries the program for Windows.

use std::path::Path;

use anyhow::Result;

use crate::{cargo, command, succeed};

/// What the compiler calls them.
const SYSTEMS: [&str; 2] = ["aarch64-apple-darwin", "x86_64-pc-windows-gnu"];

/// Lints the program for each.
pub fn lint(root: &Path) -> Result<()> {
    succeed(command("rustup", &["target", "add"]).args(SYSTEMS))?;
    let mut lint = cargo(&["clippy", "--package", "foilpress", "--all-features", "--locked"]);
    let script = root.join("xtask/no-compiler.sh");
    for system in SYSTEMS {
        lint.args(["--target", system]);
        for tool in ["CC", "CXX", "AR"] {
            lint.env(format!("{tool}_{}", system.replace('-', "_")), &script);
        }
    }
    // Where the compiler would look for the headers of macOS, if there were one.
    lint.env("SDKROOT", root);
    succeed(lint.args(["--", "-D", "warnings"]).current_dir(root))
}
