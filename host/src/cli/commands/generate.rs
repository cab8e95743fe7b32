//! `foilpress generate`: the files a package needs besides the program, as a tree. For packaging only, so help hides it.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args as ClapArgs;
use clap_complete::Shell;

use queue::install::{Places, put};

/// Where a package puts the program.
const PROGRAM: &str = "/usr/bin/foilpress";

/// Arguments of `generate`.
#[derive(ClapArgs, Debug)]
pub struct Args {
    /// Folder that takes the place of the root of the file system
    #[arg(value_name = "DIR")]
    root: PathBuf,
}

/// Runs `generate` for the command line `command`.
pub fn run(args: &Args, command: &clap::Command) -> Result<()> {
    let folder = |path: &str| -> Result<PathBuf> {
        let folder = args.root.join(path);
        fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
        Ok(folder)
    };
    clap_mangen::generate_to(command.clone(), folder("usr/share/man/man1")?)
        .context("cannot write man pages")?;
    for (shell, path, name) in [
        (Shell::Bash, "usr/share/bash-completion/completions", "foilpress"),
        (Shell::Zsh, "usr/share/zsh/vendor-completions", "_foilpress"),
        (Shell::Fish, "usr/share/fish/vendor_completions.d", "foilpress.fish"),
    ] {
        let mut text = Vec::new();
        clap_complete::generate(shell, &mut command.clone(), "foilpress", &mut text);
        let path = folder(path)?.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    for file in Places::usual(&args.root).files(Path::new(PROGRAM)) {
        put(&file).with_context(|| format!("cannot write {}", file.path.display()))?;
    }
    Ok(())
}
