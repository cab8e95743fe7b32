//! `foilpress bridge`: list, flash, test and reset bridges, and show the status and log of one.

mod flash;
mod found;
mod jobs;
mod list;
mod log;
mod reset;
mod status;
mod test;
mod watch;

pub use found::{Found, PATIENCE, ask, doing, named_or_only, shelf_text};

use anyhow::Result;
use clap::{Args as ClapArgs, Subcommand};

use observe::Observer;

/// Arguments of `bridge`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge list\n  \
    foilpress bridge status                              (the only bridge)\n  \
    foilpress bridge status --to serial:/dev/ttyACM0 --json\n  \
    foilpress bridge status --watch                      (refreshed until Ctrl-C)\n  \
    foilpress bridge jobs                                (the jobs stored in it)\n  \
    foilpress bridge test                                (the wiring, with a loop-back plug)\n  \
    foilpress bridge log                                 (the log of the firmware)\n  \
    foilpress bridge flash                               (new firmware, or the first one on a new board)\n  \
    foilpress bridge reset                               (after a sheet has been lost)")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// List the bridges on USB with their firmware and printer
    List(list::Args),
    /// Install firmware on a bridge or on a new board
    Flash(flash::Args),
    /// Show a bridge, its job, the lines of its port, and the printer's own status
    ///
    /// The printer is asked only while no job is open.
    Status(status::Args),
    /// List the jobs stored in a bridge, print one, or delete one
    Jobs(jobs::Args),
    /// Test the wiring with a loop-back plug, or step through the lines for a meter
    Test(test::Args),
    /// Show the log of the firmware, including entries from before its last restart
    Log(log::Args),
    /// Reset the printer through the bridge, after the bridge has lost its memory in the middle of a sheet
    Reset(reset::Args),
}

/// Runs `bridge`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match &args.command {
        Command::List(args) => list::run(args),
        Command::Flash(args) => flash::run(args, observer),
        Command::Status(args) => status::run(args),
        Command::Jobs(args) => jobs::run(args),
        Command::Test(args) => test::run(args),
        Command::Log(args) => log::run(args),
        Command::Reset(args) => reset::run(args),
    }
}
