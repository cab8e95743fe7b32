//! The command line: `commands` has a module for each subcommand, beside it is what they share.
//!
//! Arguments are defined here and in those modules; the stages see only settings. Exit codes: 0 success,
//! 1 failure, 2 usage error, 130 interrupted. Results go to standard output, everything else to standard error; a
//! closed pipe is success.

mod arguments;
mod commands;
mod console;
mod help;
mod output;
mod printing;

use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, FromArgMatches as _, Parser};

use commands::{Command, preset, queue};
use console::progress::Progress;
use console::{advice, closed_pipe, permission, say, stderr};
use observe::visible_line;

/// Print materials instead of colours on the ALPS MD-5500 (Oki DP-5000).
#[derive(Parser)]
#[command(
    name = "foilpress",
    version,
    after_help = "Examples:\n  \
        foilpress print sample:leaf\n  \
        foilpress layers white.png gold.png black.png --finish artwork\n\n\
        Steps of `print`: factor, map, halftone, layout, separate, encode, simulate",
    after_long_help = "Examples:\n  \
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
    #[arg(short, long, global = true, display_order = 900, help_heading = help::GENERAL)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

/// Runs the program with the arguments it was started with.
pub fn main() -> ExitCode {
    // The renderer of drawings may fail on hostile ones; the reader of art tells that as an error.
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(art::DRAWING) {
            usual(panic);
        }
    }));
    // Before arguments are read: they name inks.
    for problem in crate::own_inks::load() {
        say(&format!("foilpress: note: {}; none of them is known", console::chain(&problem)));
    }
    let typed: Vec<OsString> = std::env::args_os().collect();
    let mut program = program(typed.iter().any(|word| word == "-h"));
    let args = match preset::expand(typed, &program) {
        Ok(args) => {
            let parsed = match parsed(&mut program, args.clone()) {
                Err(error) if error.kind() == ErrorKind::UnknownArgument => {
                    parsed(&mut program, negative_values(args))
                }
                parsed => parsed,
            };
            match parsed {
                Ok(args) => args,
                Err(error) => return not_parsed(&error),
            }
        }
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

/// The command line; with `short` as `-h` shows it.
fn program(short: bool) -> clap::Command {
    help::arranged(Args::command(), short)
}

/// The arguments as they are meant.
fn parsed(program: &mut clap::Command, args: Vec<OsString>) -> Result<Args, clap::Error> {
    let matches = program.try_get_matches_from_mut(args)?;
    Args::from_arg_matches(&matches).map_err(|error| error.format(program))
}

/// Says what is wrong with the arguments, or shows the help that was asked for.
fn not_parsed(error: &clap::Error) -> ExitCode {
    // So it looks where a file was dropped on the program.
    let first = std::env::args_os().nth(1).map(PathBuf::from);
    if let Some(file) = first.filter(|file| error.kind() == ErrorKind::InvalidSubcommand && file.exists()) {
        return failed(&console::usage(format!(
            "{}: expected a command before a file or folder: `foilpress layers FILE` prints spot-colour artwork, `foilpress print FILE` a \
             document of materials, `foilpress plan FILE` shows what a print needs; `foilpress --help` shows the rest",
            file.display()
        )));
    }
    let acts = |argument: OsString| {
        let text = argument.to_string_lossy().into_owned();
        visible_line(&text) != text
    };
    // Clap quotes arguments as they are; only without its colours can they be told from its own text. A closed pipe is
    // success.
    let _ = match std::env::args_os().any(acts) {
        true => write!(stderr(), "{}", error.render()),
        false => error.print(),
    };
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(USAGE))
}

/// Exit code for wrong arguments.
const USAGE: u8 = 2;

/// Says why the program fails.
fn failed(error: &anyhow::Error) -> ExitCode {
    if let Some(usage) = error.downcast_ref::<clap::Error>() {
        // Standard error is all there is to say it on.
        let _ = usage.print();
        return ExitCode::from(USAGE);
    }
    let (text, hints) = advice::explained(error);
    say(&format!("foilpress: {text}"));
    hints.iter().for_each(|hint| say(&format!("  hint: {hint}")));
    if permission::is_missing(error) {
        say("");
        permission::how_to_give().lines().for_each(say);
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
    args.command.run(&program(false), observer)
}
