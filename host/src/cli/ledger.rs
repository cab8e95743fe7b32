//! `foilpress ledger`: what has gone of each ribbon.

use std::fmt::Write as _;

use anyhow::Result;
use clap::{Args as ClapArgs, Subcommand};
use protocol::ink::Ink;

use device::ledger::{Event, Ledger, PassUse, totals};
use device::send::Checked;
use device::send::journal::Journal;
use observe::Observer;
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
    let ledger = Ledger::in_folder(journal.folder());
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
        writeln!(text, "Lengths are estimates, rather too low; `foilpress ledger new INK` begins anew.")?;
    }
    if damaged > 0 {
        writeln!(text, "{damaged} lines of {} cannot be read", ledger.path().display())?;
    }
    super::show(&text)
}

/// The user's ledger; without a place for it nothing is noted, which is no reason not to print.
fn of_user() -> Option<Ledger> {
    Journal::of_user().ok().map(|journal| Ledger::in_folder(journal.folder()))
}

fn note(event: Event, observer: &dyn Observer) {
    if let Some(ledger) = of_user()
        && let Err(error) = ledger.append(event)
    {
        observer.note(&format!("{error}; this job is not counted there"));
    }
}

/// Notes a job that is about to be sent.
pub fn begun(job: &str, name: &str, checked: &Checked, length: u64, observer: &dyn Observer) {
    let ends = checked.passes.iter().skip(1).map(|pass| pass.offset).chain([length]);
    let passes = checked
        .passes
        .iter()
        .zip(ends)
        .zip(&checked.ribbon_mm)
        .filter_map(|((pass, end), &ribbon_mm)| {
            let ink = Ink::from_code(pass.ink)?.name().into();
            Some(PassUse { ink, begin: pass.offset, end, ribbon_mm })
        })
        .collect();
    note(Event::Job { job: job.into(), name: name.into(), passes }, observer);
}

/// Notes how much of a job was printed.
pub fn printed(job: &str, bytes: u64, whole: bool, observer: &dyn Observer) {
    note(Event::Printed { job: job.into(), bytes, whole }, observer);
}
