//! `cargo xtask test`: everything that has to pass before anything lands.
//!
//! Problem: everybody waits for it, and whole programs in real time take longer than all else together.
//! Method: every step runs, whatever failed before, and has its time said. What the tests need is fetched and
//! built beside the lints, for much of that is waiting; the tests then run together, those on the emulator
//! and in the browser beside the others. Tests that take real time are marked `#[ignore]` with the reason
//! `real time`: they are built like the others, and `--full` runs them, too, with the lints for other
//! systems, the Debian package and a drawn tenth of the mutants. At the end stand the seconds of each step,
//! the slowest tests, the tests that were left out because something is missing on this computer
//! ([`needs`]), and the steps that failed.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, Result};

use crate::firmware::BARE_METAL;
use crate::runner::Runner;
use crate::{cargo, command, emulator, foreign, mutants, package, preview, queue, succeed};

/// Names the list of tests that were left out; `.cargo/config.toml` sets it.
const SKIPS: &str = "FOILPRESS_SKIPS";

/// What is built for itself, besides the workspace of all others.
const WORKSPACES: [&str; 3] = ["bridge/firmware", "tests/rig/firmware", "fuzz"];

/// The machine of browsers.
const BROWSER: &str = "wasm32-unknown-unknown";

/// Tests whose times are shown.
const SLOWEST: usize = 10;

/// The steps so far: their names, seconds, and whether they passed.
#[derive(Default)]
struct Gate {
    steps: Mutex<Vec<(&'static str, f64, bool)>>,
}

impl Gate {
    fn step<T>(&self, name: &'static str, run: impl FnOnce() -> Result<T>) -> Option<T> {
        eprintln!("== {name}");
        let start = Instant::now();
        let result = run();
        let seconds = start.elapsed().as_secs_f64();
        match &result {
            Ok(_) => eprintln!("== {name}: passed in {seconds:.0} s"),
            Err(error) => eprintln!("== {name}: FAILED after {seconds:.0} s: {error:#}"),
        }
        self.lock().push((name, seconds, result.is_ok()));
        result.ok()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<(&'static str, f64, bool)>> {
        self.steps.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn failed(&self) -> Vec<&'static str> {
        self.lock().iter().filter(|(_, _, passed)| !passed).map(|(name, _, _)| *name).collect()
    }
}

/// Runs every step.
pub fn run(root: &Path, is_full: bool) -> ExitCode {
    let start = Instant::now();
    let gate = Gate::default();
    gate.step("list of skipped tests", clear_skips);
    let found = gate.step("tools", || Runner::find(root, is_full).with_lints());
    let Some(mut runner) = found else { return ExitCode::FAILURE };
    let repeat = runner.draw();
    eprintln!("{repeat}");
    let brought = std::thread::scope(|scope| {
        let brought = scope.spawn(|| bring(root, &gate));
        gate.step("format", || {
            std::iter::once("").chain(WORKSPACES).try_for_each(|workspace| {
                succeed(cargo(&["fmt", "--all", "--check"]).current_dir(root.join(workspace)))
            })
        });
        // Every step builds for the same packages, so that nothing is built twice with other features.
        gate.step("building the tests, with lints", || runner.build());
        // From a document's bytes to a job's bytes nothing needs a system: `make` and all that it uses.
        gate.step("library for browsers", || {
            succeed(&mut cargo(&["check", "--locked", "--package", "foilpress-make", "--target", BROWSER]))
        });
        if is_full {
            gate.step("lints for macOS and Windows", || foreign::lint(root));
            gate.step("documentation of programs", || {
                let mut doc = cargo(&["doc", "--workspace", "--no-deps", "--locked"]);
                succeed(doc.env("RUSTDOCFLAGS", "-D warnings"))
            });
        }
        brought.join().unwrap_or_default()
    });
    runner.name(brought);
    let summary = std::thread::scope(|scope| {
        scope.spawn(|| gate.step("documentation and its examples", || runner.documentation()));
        gate.step("tests", || runner.all())
    });
    if is_full && gate.failed().is_empty() {
        gate.step("a tenth of the mutants", || succeed(runner.seeded(&mut mutants(&["--part"]))));
    }
    // The package is tried with the tests of print queues: where they fail, it would.
    if is_full && gate.failed().is_empty() {
        gate.step("package", || package::run_where_possible(root, &runner.program()));
    }
    report(&gate, &runner.slowest(), summary.as_deref(), &repeat);
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    let failed = gate.failed();
    if failed.is_empty() {
        eprintln!("all steps passed in {minutes:.1} minutes");
        ExitCode::SUCCESS
    } else {
        eprintln!("failed after {minutes:.1} minutes: {}", failed.join(", "));
        ExitCode::FAILURE
    }
}

/// Fetches and builds what tests need beside Rust; returns what is to be named to them.
fn bring(root: &Path, gate: &Gate) -> Vec<(&'static str, std::ffi::OsString)> {
    // Where this fails, the tests that need it are skipped, or fail where they are required.
    if let Err(error) = queue::install() {
        eprintln!("print queues and PDF: {error:#}");
    }
    gate.step("targets of boards and browsers", || {
        succeed(&mut command("rustup", &[&["target", "add", BROWSER][..], &BARE_METAL].concat()))
    });
    let browser = gate.step("browser and its scripts", || preview::bring(root));
    let emulator = gate.step("firmware with its lints, and emulator", || emulator::bring(root));
    [browser, emulator].into_iter().flatten().flatten().collect()
}

/// Says what took how long, what was left out, and how to repeat the run.
fn report(gate: &Gate, slowest: &[(f64, String)], summary: Option<&str>, repeat: &str) {
    eprintln!("== seconds of each step:");
    for (name, seconds, passed) in gate.lock().iter() {
        eprintln!("   {seconds:>6.0}  {name}{}", if *passed { "" } else { "  FAILED" });
    }
    if !slowest.is_empty() {
        eprintln!("== the slowest tests, in seconds:");
    }
    for (seconds, name) in slowest.iter().take(SLOWEST) {
        eprintln!("   {seconds:>6.1}  {name}");
    }
    match skips() {
        Ok(list) if list.is_empty() => eprintln!("== no test was skipped"),
        Ok(list) => {
            eprintln!("== {} tests were skipped:", list.len());
            list.iter().for_each(|line| eprintln!("   {line}"));
        }
        Err(error) => eprintln!("== {error:#}"),
    }
    eprintln!("{repeat}");
    if let Some(summary) = summary {
        eprintln!("{summary}");
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
