//! `foilpress bridge reset`, and the check whether a printer still waits for the rest of a sheet that was lost.
//!
//! A printer that has received half a job takes the next one for the rest of it and prints it as text. A bridge that knows
//! about the half resets the printer by itself. One that has lost its memory does not; then nothing is sent until the printer
//! has been reset: by the bridge, which pulls the port's nInit line, or with its own power switch.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};

use anyhow::{Result, bail};
use clap::Args as ClapArgs;

use super::found::{PATIENCE, only};
use device::send::Address;
use device::send::journal::{Entry, Journal};
use device::send::query::Query;
use observe::Observer;

/// Arguments of `bridge reset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge reset                        (the only bridge)\n  \
    foilpress bridge reset --to serial:/dev/ttyACM0\n  \
    foilpress bridge reset --by-hand              (the printer has been switched off and on)\n\n\
    A bridge that has lost its memory in the middle of a sheet does not reset the printer by itself. The command is refused \
    while the bridge prints. It is not known for certain what a printer does with a sheet it holds; if the sheet does not come \
    out, switch the printer off and on.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Reset nothing; only record that the printer has been switched off and on
    #[arg(long, conflicts_with = "to")]
    by_hand: bool,
}

/// Runs `bridge reset`.
pub fn run(args: &Args) -> Result<()> {
    let journal = Journal::of_user()?;
    if args.by_hand {
        return Ok(journal.settle(None)?);
    }
    let address = match &args.to {
        Some(address) => address.clone(),
        None => only()?,
    };
    let mut link = address.open()?;
    reset(&mut Query::new(&mut *link, PATIENCE)?, &journal)?;
    crate::cli::stdio::show("the printer has been reset; if a sheet is still in it, take it out\n")
}

fn reset(query: &mut Query<'_>, journal: &Journal) -> Result<()> {
    query.initialise(PATIENCE)?;
    Ok(journal.settle(Some(query.bridge().serial))?)
}

/// Makes sure that the printer at `address` does not wait for the rest of a lost job: resets it if the user agrees, and
/// fails if it may still wait.
pub fn before_sending(journal: &Journal, address: &Address, observer: &dyn Observer) -> Result<()> {
    let lost: Vec<Entry> = journal.entries()?.into_iter().filter(Entry::left_open).collect();
    if lost.is_empty() {
        return Ok(());
    }
    let mut link = address.open()?;
    let mut query = Query::new(&mut *link, PATIENCE)?;
    let serial = query.bridge().serial;
    let Some(entry) =
        lost.iter().rev().find(|entry| entry.record.bridge.is_none_or(|bridge| bridge == serial))
    else {
        return Ok(());
    };
    let (name, job) = (&entry.name, entry.record.job);
    let why = format!(
        "what became of {name} (job {job:08x}) is not known, and the printer may still wait for the rest of it"
    );
    if !agreed(&format!("{why}. Reset the printer through the bridge now?"))? {
        bail!(
            "not sent: {why}, so that anything else would be printed as text. `foilpress bridge reset --to {address}` \
             resets it through the bridge; if you have switched it off and on: `foilpress bridge reset --by-hand`"
        );
    }
    reset(&mut query, journal)?;
    observer.note("the printer has been reset");
    Ok(())
}

/// Asks the user; without a terminal the answer is no.
fn agreed(question: &str) -> Result<bool> {
    if !io::stdin().is_terminal() || !io::stderr().is_terminal() {
        return Ok(false);
    }
    write!(io::stderr(), "{question} [y/N] ")?;
    let mut answer = String::new();
    io::stdin().lock().read_line(&mut answer)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
