//! The command line: one file for each subcommand.
//!
//! Arguments are typed here and in the subcommands' files; the stages see only settings. Exit codes: 0 done,
//! 1 failed, 2 wrong usage, 130 interrupted. Results go to standard output, everything else to standard error; a
//! closed pipe is success.

pub mod output;
pub mod progress;

use std::io;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use progress::Progress;

/// Print materials instead of colours on the ALPS MD-5500 (Oki DP-5000).
#[derive(Parser)]
#[command(
    name = "foilpress",
    version,
    after_help = "Examples:\n  \
        foilpress print sample:leaf\n  \
        foilpress print my-material/ --size 120x90mm --bases 8 --to file:job.rgl\n  \
        foilpress inks show MS+C\n  \
        foilpress inspect job.rgl --passes passes/"
)]
struct Args {
    /// No progress on standard error, only notes and errors
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {}

/// Runs the program with the arguments it was started with.
pub fn main() -> ExitCode {
    let args = Args::parse();
    let progress = Progress::new(args.quiet);
    let result = output::remove_on_interrupt().and_then(|()| match args.command {});
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("foilpress: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the reader of our output went away, as in `foilpress inspect job.rgl | head`.
fn closed_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    })
}
