//! The command line: one file for each subcommand.
//!
//! Arguments are typed here and in the subcommands' files; the stages see only settings. Exit codes: 0 done,
//! 1 failed, 2 wrong usage, 130 interrupted. Results go to standard output, everything else to standard error; a
//! closed pipe is success.

mod args;
mod bridge;
mod chain;
mod chart;
mod choice;
mod deliver;
mod doctor;
mod generate;
mod inks;
mod inspect;
mod layers;
mod layout;
mod ledger;
mod output;
mod piece;
mod plan;
mod preset;
mod print;
mod progress;
mod queue;
mod resume;
mod sample;
mod send;
mod terminal;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};

use device::deliver::Failure;
use device::flash::FlashError;
use device::send::OpenError;
use device::send::query::QueryError;
use progress::Progress;

/// The largest stream that is read: several times a page of noise in seven passes.
const LARGEST_JOB: u64 = 256 << 20;

/// Print materials instead of colours on the ALPS MD-5500 (Oki DP-5000).
#[derive(Parser)]
#[command(
    name = "foilpress",
    version,
    after_help = "Examples:\n  \
        foilpress print sample:leaf\n  \
        foilpress print my-material/ --size 120x90mm --bases 8 --to file:job.rgl\n  \
        foilpress layers white.png gold.png black.png --finish artwork\n  \
        foilpress inks show MS+C\n  \
        foilpress inspect job.rgl --passes passes/\n  \
        foilpress send job.rgl --to serial:/dev/ttyACM0\n\n\
        The chain, step by step: factor, map, halftone, separate, encode, simulate.\n\
        Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted."
)]
struct Args {
    /// No progress on standard error, only notes and errors
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Print a document: the job, the simulated sheet, and everything to look at, in one folder
    Print(Box<print::Args>),
    /// Print spot-colour art: a picture for each ink, reserved colours, or named layers
    Layers(Box<layers::Args>),
    /// What a job or a document needs: cartridges, passes, ribbon, time, cautions. Nothing is sent
    Plan(Box<plan::Args>),
    /// Sheets to look at, to measure inks and to measure the machine
    Chart(Box<chart::Args>),
    /// Options under a name: save, list, use
    Preset(preset::Args),
    /// How much of each ribbon has gone
    Ledger(ledger::Args),
    /// The papers, their printable areas and margins, and how well they are known
    Papers(layout::PapersArgs),
    /// Machines as measured: offset and feed
    Profile(layout::ProfileArgs),
    /// Take a document apart into a few basis materials and their weight maps
    Factor(chain::Factor),
    /// Fit basis materials (or every pixel) to mixtures of printable stacks
    Map(chain::Map),
    /// Choose one stack for every dot of the page
    Halftone(chain::Halftone),
    /// Split a sheet into one-bit passes, one ink each
    Separate(chain::Separate),
    /// Write passes as a job in the printer's language
    Encode(chain::Encode),
    /// Feed a job to the simulated printer and keep its sheet
    Simulate(chain::Simulate),
    /// Tell what is in a job, with byte offsets where something is wrong
    Inspect(inspect::Args),
    /// Send a job to a printer, through a bridge or as it is
    Send(send::Args),
    /// Go on with a job that was interrupted
    Resume(resume::Resume),
    /// End a job early, leaving the printer ready for the next one
    Cancel(resume::Cancel),
    /// The bridges there are, and how one of them and its printer are
    Bridge(bridge::Args),
    /// Find out what stands in the way of printing
    Doctor(doctor::Args),
    /// The ink library: list, show, check
    Inks(inks::Args),
    /// Print queues of the system: make, remove, list
    Queue(queue::Args),
    /// What the print system starts to bring a job to the printer
    #[command(hide = true)]
    CupsBackend(queue::Conventional),
    /// What the print system starts to make jobs of pages
    #[command(hide = true)]
    CupsFilter(queue::Conventional),
    /// What a package needs beside the program
    #[command(hide = true)]
    Generate(generate::Args),
    /// Documents made by the program itself: list them or write one as a texture folder
    Sample(sample::Args),
}

/// Runs the program with the arguments it was started with.
pub fn main() -> ExitCode {
    let args = match preset::expand(std::env::args_os().collect()) {
        Ok(args) => Args::parse_from(args),
        Err(error) => {
            let _ = writeln!(io::stderr(), "foilpress: {}", chain(&error));
            return ExitCode::FAILURE;
        }
    };
    match &args.command {
        // They speak the print system's language, signals and exit codes included.
        Command::CupsBackend(args) => return queue::backend(args),
        Command::CupsFilter(args) => return queue::filter(args),
        _ => {}
    }
    match output::remove_on_interrupt().and_then(|()| run(args)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            output::yield_to_interrupt();
            let _ = writeln!(io::stderr(), "foilpress: {}", chain(&error));
            if bridge::is_forbidden(&error) {
                let _ = write!(io::stderr(), "\n{}", bridge::permission());
            }
            ExitCode::FAILURE
        }
    }
}

fn run(args: Args) -> Result<()> {
    let observer = &Progress::new(args.quiet);
    match args.command {
        Command::Print(args) => print::run(&args, observer),
        Command::Layers(args) => layers::run(&args, observer),
        Command::Plan(args) => plan::run(&args, observer),
        Command::Chart(args) => chart::run(&args, observer),
        Command::Preset(args) => preset::run(&args),
        Command::Ledger(args) => ledger::run(&args),
        Command::Papers(args) => layout::papers(&args),
        Command::Profile(args) => layout::profile_command(&args),
        Command::Factor(args) => args.run(observer),
        Command::Map(args) => args.run(observer),
        Command::Halftone(args) => args.run(observer),
        Command::Separate(args) => args.run(observer),
        Command::Encode(args) => args.run(observer),
        Command::Simulate(args) => args.run(observer),
        Command::Inspect(args) => inspect::run(&args, observer),
        Command::Send(args) => send::run(&args, observer),
        Command::Resume(args) => resume::resume(&args, observer),
        Command::Cancel(args) => resume::cancel(&args, observer),
        Command::Bridge(args) => bridge::run(&args, observer),
        Command::Doctor(args) => doctor::run(&args),
        Command::Inks(args) => inks::run(args),
        Command::Generate(args) => generate::run(&args),
        Command::Queue(args) => queue::run(&args, observer),
        Command::Sample(args) => sample::run(args),
        // Done before anything else; see `main`.
        Command::CupsBackend(_) | Command::CupsFilter(_) => Ok(()),
    }
}

/// An error with its causes. Many name their cause in their own words; it is not said again.
fn chain(error: &anyhow::Error) -> String {
    let mut said = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if said.is_empty() {
            said = cause;
        } else if !said.contains(cause.trim_end()) {
            said = format!("{said}: {cause}");
        }
    }
    said.trim_end().to_owned()
}

/// Writes to standard output, where results go.
fn show(text: &str) -> Result<()> {
    io::stdout().lock().write_all(text.as_bytes()).context("cannot write to standard output")
}

/// Reads a job whole.
fn read_job(path: &Path) -> Result<Vec<u8>> {
    let cannot = || format!("cannot read {}", path.display());
    let file = File::open(path).with_context(cannot)?;
    let mut job = Vec::new();
    file.take(LARGEST_JOB + 1).read_to_end(&mut job).with_context(cannot)?;
    if job.len() as u64 > LARGEST_JOB {
        bail!("{} is larger than {} MB: no job for this printer", path.display(), LARGEST_JOB >> 20);
    }
    Ok(job)
}

/// Whether the reader of our output went away, as in `foilpress inspect job.rgl | head`. A printer or a bridge that went
/// away is something else.
fn closed_pipe(error: &anyhow::Error) -> bool {
    let device = error.chain().any(|cause| {
        cause.is::<Failure>()
            || cause.is::<QueryError>()
            || cause.is::<OpenError>()
            || cause.is::<FlashError>()
    });
    !device
        && error.chain().any(|cause| {
            cause.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
        })
}
