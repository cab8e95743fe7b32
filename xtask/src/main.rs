//! The project's chores, so that a person and the gate run the same commands.
//!
//! `cargo xtask test` is the whole gate ([`gate`]); the other tasks are its steps and what people do by hand.

#[cfg(test)]
mod documents;
mod elf;
mod emulator;
mod firmware;
mod foreign;
mod gate;
mod package;
mod preview;
mod queue;
mod release;
mod runner;
mod tidy;
mod tools;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, ensure};
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Build, test and package the project")]
struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run everything that has to pass before a change lands: format, lints, documents, tests, emulator,
    /// browser
    Test {
        /// Run also what takes real time, print queues, package and the lints for macOS and Windows,
        /// documents' commands as they stand, 32 times as many cases of each property, and the whole system
        /// under one seed after another: some three hours
        #[arg(long)]
        full: bool,
    },
    /// Run the benchmarks
    Bench,
    /// Build the firmware that the installed targets allow as UF2 and check its size against
    /// xtask/budgets.toml
    Firmware,
    /// Change each decision of the bridge once, and say which of the changes no test notices: some hours
    Mutants {
        /// Numbers of mutants, or `--part` for a tenth of them
        #[arg(allow_hyphen_values = true)]
        which: Vec<String>,
    },
    /// Test the firmware's image on an emulated board
    Emulator {
        /// Serve a bridge with a simulated printer on a serial port instead, until standard input ends
        #[arg(long)]
        serve: bool,
    },
    /// Test the preview's page in a real browser; installs Chromium if it is missing (apt needs root)
    Preview,
    /// Test print queues on a private print server; installs CUPS if it is missing (needs root)
    Queue,
    /// Check the order of modules, folders, lines and numbers against xtask/tidy.list, and dependencies
    /// against deny.toml; count lines without tests
    Tidy {
        /// Write the list anew, where it became shorter
        #[arg(long)]
        shrink: bool,
    },
    /// Build the Debian package, try it in a root of its own and, as root, on this computer
    Package {
        /// Package a build like that of the tests: slower, but ready sooner
        #[arg(long)]
        dev: bool,
    },
    /// Build what people download, for every system that this one can build for, try it, and write dist/
    Release {
        /// Only say what is missing, and how to get it
        #[arg(long)]
        dry_run: bool,
        /// Only these systems [default: all]
        #[arg(long, value_delimiter = ',', value_parser = release::names())]
        only: Vec<String>,
    },
}

/// Names the program to the tests, where it is built already.
const PROGRAM: &str = "FOILPRESS_PROGRAM";

fn main() -> ExitCode {
    // The workspace, wherever this was started from: it is the folder above this package.
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    if let Some(folder) = std::env::var_os(runner::RUSTDOC_FOR) {
        return finish(runner::rustdoc(Path::new(&folder)));
    }
    match Args::parse().task {
        Task::Test { full } => gate::run(root, full),
        Task::Bench => finish(succeed(&mut cargo(&["bench", "--workspace", "--locked"]))),
        Task::Firmware => finish(firmware::build_possible(root)),
        Task::Mutants { which } => finish(succeed(&mut mutants(&which))),
        Task::Emulator { serve: true } => finish(emulator::serve(root)),
        Task::Emulator { serve: false } => finish(emulator::alone(root)),
        Task::Preview => finish(preview::run(root)),
        Task::Queue => finish(queue::run(root)),
        Task::Tidy { shrink } => finish(tidy::run(root, shrink).and_then(|()| deny(root))),
        Task::Package { dev: false } => finish(package::build(root, package::Profile::Release)),
        Task::Package { dev: true } => finish(package::build(root, package::Profile::Dev)),
        Task::Release { dry_run, only } => finish(release::run(root, &only, dry_run)),
    }
}

/// Tries the mutants of these numbers, or all.
fn mutants(which: &[impl AsRef<std::ffi::OsStr>]) -> Command {
    let mut run = cargo(&["run", "--locked", "--release", "--package", "foilpress-mutants", "--"]);
    run.args(which);
    run
}

/// Checks licences, advisories, bans and sources of dependencies by `deny.toml`.
fn deny(root: &Path) -> anyhow::Result<()> {
    let is_there = cargo(&["deny", "--version"]).output().is_ok_and(|output| output.status.success());
    if !is_there {
        println!("dependencies are not checked: there is no cargo-deny");
        return Ok(());
    }
    succeed(cargo(&["deny", "check"]).current_dir(root))
}

fn finish(result: anyhow::Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("failed: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn cargo(args: &[&str]) -> Command {
    command(&std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()), args)
}

/// Where cargo keeps the sources of libraries.
fn cargo_home() -> PathBuf {
    let own = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    own.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cargo"))).unwrap_or_default()
}

fn succeed(command: &mut Command) -> anyhow::Result<()> {
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(status.success(), "{command:?}: {status}");
    Ok(())
}

fn command(program: &str, args: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(args);
    command
}

/// The files in this folder and below.
fn all_files(folder: &Path, files: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    for item in std::fs::read_dir(folder)? {
        let path = item?.path();
        if path.is_dir() { all_files(&path, files)? } else { files.push(path) }
    }
    Ok(())
}
