//! The command line: one file for each subcommand.
//!
//! Arguments are defined here and in the subcommands' files; the stages see only settings. Exit codes: 0 success,
//! 1 failure, 2 usage error, 130 interrupted. Results go to standard output, everything else to standard error; a
//! closed pipe is success.

mod advice;
mod args;
mod bridge;
mod chain;
mod chart;
mod choice;
mod compare;
mod deliver;
mod display;
mod doctor;
mod edit;
mod generate;
mod inks;
mod inspect;
mod job;
mod laid;
mod layers;
mod layout;
mod ledger;
mod measure;
mod output;
mod permission;
mod plan;
mod preset;
mod preview;
mod print;
mod progress;
mod queue;
mod report;
mod resume;
mod sample;
mod send;
mod shown;
mod stdio;
mod terminal;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

use anyhow::Result;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser, Subcommand};

use progress::Progress;
use stdio::{chain, closed_pipe, read_job, show};

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
        The steps of `print`, one command each: factor, map, halftone, layout, separate, encode, simulate.\n\
        Exit codes: 0 success, 1 failure, 2 usage error, 130 interrupted."
)]
struct Args {
    /// Show no progress on standard error, only notes and errors
    #[arg(short, long, global = true, display_order = 900)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Print a document of materials
    ///
    /// Writes one folder with the job, the plan, the sheet as the simulated printer prints it, and previews. With --to the
    /// job is also sent to a printer.
    Print(Box<print::Args>),
    /// Print spot-colour artwork: a picture for each ink, reserved colours, or named layers
    ///
    /// Writes one folder with the job, the plan, the sheet as the simulated printer prints it, and previews. With --to the
    /// job is also sent to a printer.
    Layers(Box<layers::Args>),
    /// Show what a job or a document needs: cartridges, passes, ribbon, time and cautions
    ///
    /// Sends nothing, and writes nothing unless --html names a file.
    Plan(Box<plan::Args>),
    /// Show a document or a sheet under any light: a page to handle it in a browser, or a picture
    Preview(Box<preview::Args>),
    /// Compare photographs of a printed sheet with its prediction: figures, and a page with sliders
    Compare(Box<compare::Args>),
    /// Make a display of materials: print a grid of stacks, and write what a screen over it has to show
    ///
    /// Writes one folder with the job of the grid, a mask for each image and one to align by, pictures of what is seen, and a
    /// page that shows it all. With --to the job is also sent to a printer.
    Display(Box<display::Args>),
    /// Print a chart: to judge stacks by eye, to measure inks, or to calibrate the printer
    Chart(Box<chart::Args>),
    /// Save, list and use named sets of options
    Preset(preset::Args),
    /// Show how much ribbon each cartridge has used
    Ledger(ledger::Args),
    /// List paper sizes with their printable areas and margins, and how well each is known
    Papers(layout::PapersArgs),
    /// Manage printer calibration profiles (offset, feed)
    Profile(layout::ProfileArgs),
    /// Factor a document into a few basis materials and their weight maps
    Factor(chain::Factor),
    /// Edit the basis materials of a document: rougher, tinted, replaced, swapped, everywhere or under a mask
    ///
    /// The document itself stays as it is. The edited document keeps its steps, which can be changed and replayed.
    Edit(edit::Args),
    /// Map basis materials (or every pixel) to mixtures of printable stacks
    Map(chain::Map),
    /// Choose one stack for every dot of a document
    Halftone(chain::Halftone),
    /// Lay dots on a page: position, copies, marks, mirror, profile
    Layout(chain::Layout),
    /// Split a page into one-bit passes, one ink each
    Separate(chain::Separate),
    /// Encode passes as a job in the printer's language
    Encode(chain::Encode),
    /// Print a job on the simulated printer and keep the sheet
    Simulate(chain::Simulate),
    /// Describe the contents of a job and report errors with their byte offset
    Inspect(inspect::Args),
    /// Send a job to a printer, through a bridge or directly to a device
    Send(send::Args),
    /// Resume an interrupted job
    Resume(resume::Resume),
    /// Cancel a job and leave the printer ready for the next one
    Cancel(resume::Cancel),
    /// List bridges and show their status; flash, test or reset a bridge
    Bridge(bridge::Args),
    /// Find out what prevents printing and how to fix it
    Doctor(doctor::Args),
    /// Manage ink libraries: list, show, check, compare, share; choose cartridges
    Inks(inks::Args),
    /// Measure printed stacks from photographs
    ///
    /// Turns series of exposures of a print round a can, with a grey card in the picture, into an ink library with curves,
    /// their uncertainty and their provenance.
    Measure(measure::Args),
    /// Install, remove and list print queues of the system
    Queue(queue::Args),
    /// Deliver a job to the printer (called by the print system)
    #[command(hide = true)]
    CupsBackend(queue::Conventional),
    /// Turn pages into jobs (called by the print system)
    #[command(hide = true)]
    CupsFilter(queue::Conventional),
    /// Write the files that a package needs besides the program
    #[command(hide = true)]
    Generate(generate::Args),
    /// List the built-in sample documents or write one as a texture folder
    Sample(sample::Args),
}

/// Runs the program with the arguments it was started with.
pub fn main() -> ExitCode {
    // The renderer of drawings may fail on hostile ones; the reader of art tells that as an error.
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(press::layers::DRAWING) {
            usual(panic);
        }
    }));
    let args = match preset::expand(std::env::args_os().collect(), &Args::command()) {
        Ok(args) => match Args::try_parse_from(&args) {
            Err(error) if error.kind() == ErrorKind::UnknownArgument => {
                Args::parse_from(negative_values(args))
            }
            parsed => parsed.unwrap_or_else(|error| error.exit()),
        },
        Err(error) => return failed(&error),
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
            failed(&error)
        }
    }
}

/// Says why the program fails.
fn failed(error: &anyhow::Error) -> ExitCode {
    const USAGE: u8 = 2;
    if let Some(usage) = error.downcast_ref::<clap::Error>() {
        // Standard error is all there is to say it on.
        let _ = usage.print();
        return ExitCode::from(USAGE);
    }
    let advice = advice::of(error).map_or_else(String::new, |advice| format!("; {advice}"));
    let _ = writeln!(io::stderr(), "foilpress: {}{advice}", chain(error));
    if permission::is_missing(error) {
        let _ = write!(io::stderr(), "\n{}", permission::how_to_give());
    }
    ExitCode::FAILURE
}

/// The arguments with each negative number joined to the option before it, so that the option says what it expects instead.
/// Clap's own way knows plain numbers, and lengths have units.
fn negative_values(args: Vec<OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::with_capacity(args.len());
    for arg in args {
        let is_number = |text: &str| {
            text.strip_prefix('-')
                .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
        };
        let is_option = |text: &str| text.starts_with("--") && text.len() > 2 && !text.contains('=');
        match joined.last_mut() {
            Some(option) if arg.to_str().is_some_and(is_number) && option.to_str().is_some_and(is_option) => {
                option.push("=");
                option.push(arg);
            }
            _ => joined.push(arg),
        }
    }
    joined
}

fn run(args: Args) -> Result<()> {
    let observer = &Progress::new(args.quiet);
    match args.command {
        Command::Print(args) => print::run(&args, observer),
        Command::Layers(args) => layers::run(&args, observer),
        Command::Plan(args) => plan::run(&args, observer),
        Command::Preview(args) => preview::run(&args, observer),
        Command::Compare(args) => compare::run(&args, observer),
        Command::Display(args) => display::run(&args, observer),
        Command::Chart(args) => chart::run(&args, observer),
        Command::Preset(args) => preset::run(&args, &Args::command()),
        Command::Ledger(args) => ledger::run(&args),
        Command::Papers(args) => layout::papers(&args),
        Command::Profile(args) => layout::profile_command(&args),
        Command::Factor(args) => args.run(observer),
        Command::Edit(args) => edit::run(&args, observer),
        Command::Map(args) => args.run(observer),
        Command::Halftone(args) => args.run(observer),
        Command::Layout(args) => args.run(observer),
        Command::Separate(args) => args.run(observer),
        Command::Encode(args) => args.run(observer),
        Command::Simulate(args) => args.run(observer),
        Command::Inspect(args) => inspect::run(&args, observer),
        Command::Send(args) => send::run(&args, observer),
        Command::Resume(args) => resume::resume(&args, observer),
        Command::Cancel(args) => resume::cancel(&args, observer),
        Command::Bridge(args) => bridge::run(&args, observer),
        Command::Doctor(args) => doctor::run(&args),
        Command::Inks(args) => inks::run(args, observer),
        Command::Measure(args) => measure::run(&args, observer),
        Command::Generate(args) => generate::run(&args, &Args::command()),
        Command::Queue(args) => queue::run(&args, observer),
        Command::Sample(args) => sample::run(args),
        // `main` has run these already.
        Command::CupsBackend(_) | Command::CupsFilter(_) => Ok(()),
    }
}
