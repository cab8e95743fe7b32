//! `foilpress bridge reset`: make a printer that may hold part of a job ready for the next one.
//!
//! A printer that has received half a job takes the next one for the rest of it and prints it as text. A bridge that knows
//! about the half resets the printer by itself; one that has lost its memory does not. Then the bridge pulls the port's nInit
//! line when asked to, or the user switches the printer off and on. The reset is recorded for every user and queue of this
//! computer ([`device::printers`]).

use anyhow::Result;
use clap::Args as ClapArgs;

use super::found::{PATIENCE, only};
use device::deliver;
use device::printers::Printers;
use device::send::Address;
use device::send::query::Query;

/// Arguments of `bridge reset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge reset                        (the only bridge)\n  \
    foilpress bridge reset --to serial:/dev/ttyACM0\n  \
    foilpress bridge reset --by-hand              (the printer has been switched off and on)\n\n\
    A bridge that has lost its memory in the middle of a sheet does not reset the printer by itself. The command is refused \
    while a job is open. It is not known for certain what a printer does with a sheet it holds; if the sheet does not come \
    out, switch the printer off and on.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Reset nothing; only record that every printer has been switched off and on
    #[arg(long, conflicts_with = "to")]
    by_hand: bool,
}

/// Runs `bridge reset`.
pub fn run(args: &Args) -> Result<()> {
    let printers = Printers::of_system()?;
    if args.by_hand {
        return Ok(printers.reset(None)?);
    }
    let address = match &args.to {
        Some(address) => address.clone(),
        None => only()?,
    };
    let mut link = address.open()?;
    deliver::reset(&mut Query::new(&mut *link, PATIENCE)?, &printers)?;
    crate::cli::stdio::show("the printer has been reset; if a sheet is still in it, take it out\n")
}
