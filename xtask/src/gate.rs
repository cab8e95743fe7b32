//! `cargo xtask test`: everything that has to pass before anything lands.
//!
//! Every step runs, whatever failed before, and has its time said. At the end stand the tests that were left out because
//! something is missing on this computer ([`needs`]), and the steps that failed.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context, Result};

use crate::firmware::{self, BARE_METAL};
use crate::{PROGRAM, cargo, command, emulator, package, preview, queue, succeed};

/// What the property tests' cases are drawn from.
const PROPERTY_SEED: &str = "PROPTEST_RNG_SEED";

/// Names the list of tests that were left out; `.cargo/config.toml` sets it.
const SKIPS: &str = "FOILPRESS_SKIPS";

/// What is built for itself, besides the workspace of all others.
const WORKSPACES: [&str; 3] = ["bridge/firmware", "tests/rig/firmware", "fuzz"];

/// The steps that failed.
#[derive(Default)]
struct Gate {
    failed: Vec<&'static str>,
}

impl Gate {
    fn step(&mut self, name: &'static str, run: impl FnOnce() -> Result<()>) {
        eprintln!("== {name}");
        let start = Instant::now();
        let result = run();
        let seconds = start.elapsed().as_secs();
        match result {
            Ok(()) => eprintln!("== {name}: passed in {seconds} s"),
            Err(error) => {
                eprintln!("== {name}: FAILED after {seconds} s: {error:#}");
                self.failed.push(name);
            }
        }
    }

    fn command(&mut self, name: &'static str, mut command: Command) {
        self.step(name, || succeed(&mut command));
    }
}

/// Runs every step.
pub fn run(root: &Path) -> ExitCode {
    let start = Instant::now();
    let mut gate = Gate::default();
    gate.step("list of skipped tests", clear_skips);
    // Where this fails, the tests that need it are skipped, or fail where they are required.
    if let Err(error) = queue::install() {
        eprintln!("print queues and PDF: {error:#}");
    }
    gate.command("bare-metal targets", command("rustup", &[&["target", "add"][..], &BARE_METAL].concat()));
    gate.step("format", || {
        std::iter::once(Path::new("")).chain(WORKSPACES.map(Path::new)).try_for_each(|workspace| {
            succeed(cargo(&["fmt", "--all", "--check"]).current_dir(root.join(workspace)))
        })
    });
    gate.command(
        "lints",
        cargo(&["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"]),
    );
    gate.step("lints of the firmware", || firmware::lint(root));
    let mut doc = cargo(&["doc", "--workspace", "--no-deps", "--locked"]);
    doc.env("RUSTDOCFLAGS", "-D warnings");
    gate.command("documentation", doc);
    // Every later step builds for the same packages, so that nothing is built twice with other features.
    let program = firmware::workspace_target(root).join("debug/foilpress");
    let mut test = cargo(&["test", "--workspace", "--locked", "--no-fail-fast"]);
    test.env(PROGRAM, &program);
    // The gate answers the same for the same tree; `cargo test` by itself goes on looking at new cases.
    if std::env::var_os(PROPERTY_SEED).is_none() {
        test.env(PROPERTY_SEED, "1");
    }
    gate.command("tests", test);
    gate.step("emulator", || emulator::run(root, &program));
    gate.step("preview", || preview::run(root));
    // The package is tried with the tests of print queues: where they fail, it would.
    if gate.failed.is_empty() {
        gate.step("package", || package::run_where_possible(root, &program));
    }

    match skips() {
        Ok(list) if list.is_empty() => eprintln!("== no test was skipped"),
        Ok(list) => {
            eprintln!("== {} tests were skipped:", list.len());
            list.iter().for_each(|line| eprintln!("   {line}"));
        }
        Err(error) => eprintln!("== {error:#}"),
    }
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    if gate.failed.is_empty() {
        eprintln!("all steps passed in {minutes:.1} minutes");
        ExitCode::SUCCESS
    } else {
        eprintln!("failed: {}", gate.failed.join(", "));
        ExitCode::FAILURE
    }
}

fn clear_skips() -> Result<()> {
    let list =
        std::env::var_os(SKIPS).with_context(|| format!("{SKIPS} is not set; run `cargo xtask test`"))?;
    match fs::remove_file(&list) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).context("the old list cannot be removed")
        }
        _ => Ok(()),
    }
}

/// The tests that were left out, in order of their names.
fn skips() -> Result<Vec<String>> {
    let list = std::env::var_os(SKIPS).with_context(|| format!("{SKIPS} is not set"))?;
    match fs::read_to_string(&list) {
        Ok(text) => {
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            lines.sort();
            lines.dedup();
            Ok(lines)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error).context("the list of skipped tests cannot be read"),
    }
}
