//! `foilpress bridge`: list, flash, test and reset bridges, and show the status and log of one.

mod flash;
mod found;
mod list;
mod log;
mod reset;
mod status;
mod test;
mod watch;

pub use found::{Found, PATIENCE, ask, doing, only};
pub use reset::before_sending;

use anyhow::{Context as _, Result, bail};
use clap::{Args as ClapArgs, Subcommand};

use device::send::Address;
use device::send::query::{Query, is_alps};
use found::PRINTER_PATIENCE;
use observe::Observer;

/// Arguments of `bridge`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge list\n  \
    foilpress bridge status                              (the only bridge)\n  \
    foilpress bridge status --to serial:/dev/ttyACM0 --json\n  \
    foilpress bridge status --watch                      (refreshed until Ctrl-C)\n  \
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
        Command::Test(args) => test::run(args),
        Command::Log(args) => log::run(args),
        Command::Reset(args) => reset::run(args),
    }
}

/// Makes sure that a bridge is there and that its printer identifies itself as an ALPS printer, if it identifies itself at
/// all; with `force` another printer is only noted. So a mistyped address or a missing permission leaves no waiting job behind.
pub fn expect_alps(address: &Address, force: bool, observer: &dyn Observer) -> Result<()> {
    let mut link = address.open().context("not sent")?;
    let mut query = Query::new(&mut *link, PATIENCE).context("not sent")?;
    match query.device_id(PATIENCE, PRINTER_PATIENCE) {
        Some(id) if !is_alps(&id) && force => {
            observer.note(&format!("the device does not identify itself as an ALPS printer: {id}"));
            Ok(())
        }
        Some(id) if !is_alps(&id) => {
            bail!(
                "not sent: the device does not identify itself as an ALPS printer: {id}; check where the cable leads, or pass \
                 --force to send anyway"
            )
        }
        _ => Ok(()),
    }
}
