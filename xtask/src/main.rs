//! The project's own chores, so that a person and the gate type the same words.
//!
//! `cargo xtask test` is the whole gate: formatting, lints, documents, every test, the bare-metal build of `protocol`
//! and `bridge`, the firmware's image in its emulator, for which it fetches what is missing, and the Debian package where
//! print queues can be tried. It runs every step, then says which failed.

mod elf;
mod emulator;
mod firmware;
mod package;
mod queue;
mod tools;

use std::path::Path;
use std::process::{Command, ExitCode};

use clap::{Parser, Subcommand};

/// Where the microcontroller's code is built for: Cortex-M0+, no atomics with compare-and-swap.
const BARE_METAL: &str = "thumbv6m-none-eabi";

/// What the property tests' cases are drawn from.
const PROPERTY_SEED: &str = "PROPTEST_RNG_SEED";

#[derive(Parser)]
#[command(name = "cargo xtask", about = "The project's own chores")]
struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Format check, clippy, documents, all tests, bare-metal build, emulator: what has to pass before anything lands
    Test,
    /// The benchmarks (results are ratios to read, not tests that pass)
    Bench,
    /// The bridge's image as UF2, its size against bridge/firmware/budget.toml
    Firmware,
    /// The bridge's image on an emulated board: its tests, or with --serve a bridge for other programs
    Emulator {
        /// Shows the bridge on a serial port with a simulated printer behind it, until standard input ends
        #[arg(long)]
        serve: bool,
    },
    /// Print queues on a print server of their own, which is installed if need be (needs root)
    Queue,
    /// The Debian package, tried in a root of its own, and as root on this machine, which is then as before
    Package {
        /// Of the build that the tests make: slower, and ready sooner
        #[arg(long)]
        dev: bool,
    },
}

fn main() -> ExitCode {
    // The workspace, wherever this was started from: it is the folder above this package.
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let task = Args::parse().task;
    let steps: Vec<(&str, Command)> = match task {
        Task::Firmware => return finish(firmware::build(root).map(drop)),
        Task::Emulator { serve: true } => return finish(emulator::serve(root)),
        Task::Emulator { serve: false } => return finish(emulator::run(root)),
        Task::Queue => return finish(queue::run()),
        Task::Package { dev: false } => return finish(package::run(root, package::Profile::Release)),
        Task::Package { dev: true } => return finish(package::run(root, package::Profile::Dev)),
        Task::Test => vec![
            ("bare-metal target", command("rustup", &["target", "add", BARE_METAL])),
            ("formatting", cargo(&["fmt", "--all", "--check"])),
            ("lints", cargo(&["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"])),
            ("documents", {
                let mut doc = cargo(&["doc", "--workspace", "--no-deps", "--locked"]);
                doc.env("RUSTDOCFLAGS", "-D warnings");
                doc
            }),
            (
                "bare-metal build",
                cargo(&[
                    "build",
                    "--package",
                    "foilpress-protocol",
                    "--package",
                    "foilpress-bridge",
                    "--target",
                    BARE_METAL,
                    "--locked",
                ]),
            ),
            ("tests", {
                let mut test = cargo(&["test", "--workspace", "--locked", "--no-fail-fast"]);
                // The gate answers the same for the same tree; `cargo test` by itself goes on looking at new cases.
                if std::env::var_os(PROPERTY_SEED).is_none() {
                    test.env(PROPERTY_SEED, "1");
                }
                test
            }),
        ],
        Task::Bench => vec![("benchmarks", cargo(&["bench", "--workspace", "--locked"]))],
    };

    let mut failed = Vec::new();
    if matches!(task, Task::Test)
        && let Err(error) = queue::install()
    {
        // The tests then say that they are skipped, or fail where they have to run.
        eprintln!("print queues and PDF: {error:#}");
    }
    for (name, mut step) in steps {
        eprintln!("== {name}: {step:?}");
        match step.status() {
            Ok(status) if status.success() => {}
            Ok(status) => failed.push(format!("{name} ({status})")),
            Err(error) => failed.push(format!("{name} (cannot start: {error})")),
        }
    }
    if matches!(task, Task::Test) {
        eprintln!("== emulator");
        if let Err(error) = emulator::run(root) {
            failed.push(format!("emulator ({error:#})"));
        }
    }
    // Its tests are those of the print queues: where they fail, the package would.
    if matches!(task, Task::Test) && failed.is_empty() {
        eprintln!("== package");
        if let Err(error) = package::run_where_possible(root) {
            failed.push(format!("package ({error:#})"));
        }
    }
    if failed.is_empty() {
        eprintln!("all steps passed");
        ExitCode::SUCCESS
    } else {
        eprintln!("failed: {}", failed.join(", "));
        ExitCode::FAILURE
    }
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

fn command(program: &str, args: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(args);
    command
}
