//! `foilpress bridge reset`: make a printer that may hold part of a job ready for the next one.
//!
//! A printer that has received half a job takes the next one for the rest of it and prints it as text. Its
//! bridge knows, and resets it before anything else goes to it; but the sheet has to be taken out, and
//! whoever has done that says so by this command. A job that is open at the bridge is given up, whoever has
//! sent it, after a question: nothing else may help when its sender is gone and the printer takes no bytes. A
//! printer without a bridge is reset by its switch, which is noted for every user and queue of this computer
//! ([`device::printers`]).

use anyhow::{Result, bail};
use clap::Args as ClapArgs;
use protocol::link::message::{Fault, JobState};

use super::found::{PATIENCE, doing, named_or_only};
use crate::cli::console::show;
use crate::cli::console::terminal::agreed;
use device::connection::Address;
use device::deliver;
use device::printers::Printers;
use device::questions::query::Query;

/// Arguments of `bridge reset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge reset                        (the only bridge)\n  \
    foilpress bridge reset --to serial:/dev/ttyACM0\n  \
    foilpress bridge reset --yes                  (also if a job is open: its sheet is lost)\n  \
    foilpress bridge reset --by-hand              (a printer without a bridge was switched off and on)\n\n\
    The bridge resets a printer by itself before anything goes into a torn sheet, but the sheet has to be taken out first: this command \
    says that it is. If a job is open, whoever has sent it, the command asks first: the job is given up, and its sheet is lost. It is not \
    known for certain what a printer does with a sheet it holds; if the sheet does not come out, switch the printer off and on.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Reset nothing; only record that every printer without a bridge has been switched off and on
    #[arg(long, conflicts_with = "to")]
    by_hand: bool,
    /// Give up an open job without asking
    #[arg(short, long, conflicts_with = "by_hand")]
    yes: bool,
}

/// Runs `bridge reset`.
pub fn run(args: &Args) -> Result<()> {
    if args.by_hand {
        let printers = Printers::of_system()?;
        return Ok(printers.close(&printers.noted(None)?)?);
    }
    let address = named_or_only(args.to.as_ref())?;
    let mut link = address.open()?;
    let mut query = Query::new(&mut *link, PATIENCE)?;
    let open = *query.progress();
    if !open.is_open() {
        deliver::reset(&mut query)?;
        return show("the printer has been reset; if a sheet is still in it, take it out\n");
    }
    let job = open.job;
    let what = format!("{}. A reset gives the job up, and its sheet is lost", doing(&open));
    if !args.yes && !agreed(&format!("{what}. Reset the printer?")) {
        bail!(
            "{what}, so the printer was not reset; pass --yes to reset it, or `foilpress cancel {job:08x} --to {address}` ends the job \
             properly"
        );
    }
    let ended = deliver::give_up(&mut query, job)?;
    show(&match ended.state {
        JobState::Cancelled => format!("job {job:08x} is ended; the printer has not received any of it\n"),
        _ if query.lines(PATIENCE)?.1 == Some(Fault::PowerOff) => {
            format!("job {job:08x} is given up; the bridge resets the printer when it is switched on\n")
        }
        _ => format!(
            "job {job:08x} is given up and the printer has been reset; if a sheet is still in it, take it out\n"
        ),
    })
}
