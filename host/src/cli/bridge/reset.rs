//! `foilpress bridge reset`: a printer that may hold part of a job is made ready for the next one.
//!
//! The bridge pulls the port's nInit line; or the user has used the printer's own switch. That the printer was reset is noted
//! for every user and queue of this computer ([`device::printers`]).

use anyhow::Result;
use clap::Args as ClapArgs;

use super::PATIENCE;
use device::deliver;
use device::printers::Printers;
use device::send::Address;
use device::send::query::Query;

/// Arguments of `bridge reset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge reset                        (the only bridge there is)\n  \
    foilpress bridge reset --to serial:/dev/ttyACM0\n  \
    foilpress bridge reset --by-hand              (the printer has been switched off and on)\n\n\
    A bridge that has lost its memory in the middle of a sheet cannot do this by itself. The reset is refused while a job is open. \
    If a sheet is in the printer and does not come out, switch the printer off and on.")]
pub struct Args {
    /// Where the bridge is [default: the only one there is]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Only note that every printer has been switched off and on
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
        None => super::only()?,
    };
    let mut link = address.open()?;
    deliver::reset(&mut Query::new(&mut *link, PATIENCE)?, &printers)?;
    crate::cli::show("the printer has been reset; if a sheet is still in it, take it out\n")
}
