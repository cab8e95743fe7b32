//! `foilpress ledger`: how much ribbon each cartridge has used.

use std::fmt::Write as _;

use anyhow::Result;
use clap::{Args as ClapArgs, Subcommand};
use protocol::ink::Ink;

use device::ledger::{Event, Ledger, totals};
use device::printers::Printers;
use device::send::journal::Journal;
use press::job::ribbon;

/// Arguments of `ledger`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress ledger                   (ribbon used so far, including failed jobs)\n  \
    foilpress ledger new white         (a new white cartridge is loaded)\n  \
    foilpress ledger --json")]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Record a new cartridge of an ink and restart its count
    New {
        /// Ink of the cartridge
        #[arg(value_parser = super::layout::ink)]
        ink: Ink,
    },
}

/// Runs `ledger`.
pub fn run(args: &Args) -> Result<()> {
    let journal = Journal::of_user()?;
    let ledger = Ledger::in_folder(Printers::of_system()?.folder());
    if let Some(Command::New { ink }) = &args.command {
        ledger.append(Event::New { ink: ink.name().into() })?;
        return super::show(&format!("{}: a new cartridge, counted from now on\n", ink.name()));
    }
    let (lines, damaged) = ledger.lines()?;
    let entries = journal.entries()?;
    let known = |job: &str| {
        let number = u32::from_str_radix(job, 16).ok()?;
        entries.iter().find(|entry| entry.record.job == number).map(|entry| entry.record.printed.into())
    };
    let totals = totals(&lines, known);
    if args.json {
        let json = serde_json::json!({ "ribbons": totals, "lines_damaged": damaged });
        return super::show(&format!("{}\n", serde_json::to_string_pretty(&json)?));
    }
    let mut text = String::new();
    for total in &totals {
        write!(
            text,
            "{:<18} {:>9}  {} pass{}",
            total.ink,
            ribbon::length(total.ribbon_mm),
            total.passes,
            if total.passes == 1 { "" } else { "es" }
        )?;
        if total.failed > 0 {
            write!(text, ", {} of them in jobs that failed", total.failed)?;
        }
        writeln!(text, "{}", if total.since.is_some() { ", since it was new" } else { "" })?;
    }
    if totals.is_empty() {
        text = "no job was sent yet\n".into();
    } else {
        writeln!(text, "Lengths are estimates, rather too low; `foilpress ledger new INK` starts again.")?;
    }
    if damaged > 0 {
        writeln!(text, "{damaged} lines beside {} cannot be read", ledger.path().display())?;
    }
    super::show(&text)
}
