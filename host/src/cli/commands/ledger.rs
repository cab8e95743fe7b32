//! `foilpress ledger`: how much ribbon each cartridge has used.

use std::fmt::Write as _;

use anyhow::Result;
use clap::{Args as ClapArgs, Subcommand};
use protocol::ink::Ink;

use crate::cli::console::show;
use device::ledger::{self, Event, Ledger, Line, totals};
use device::printers::Printers;
use device::transit::journal::Journal;
use press::job::cost::Price;
use press::job::ribbon;
use press::layout::Mm;

/// Arguments of `ledger`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress ledger                   (ribbon used so far, including failed jobs)\n  \
    foilpress ledger new white         (a new white cartridge is loaded)\n  \
    foilpress ledger price white 12 EUR\n  \
    foilpress ledger price white 12 EUR --length 20m\n  \
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
        #[arg(value_parser = art::names::typed)]
        ink: Ink,
    },
    /// Record the price of a cartridge; plans and the ledger then say what the ribbon costs
    Price {
        /// Ink of the cartridge
        #[arg(value_parser = art::names::typed)]
        ink: Ink,
        /// Price of one cartridge
        #[arg(value_parser = amount)]
        price: f64,
        /// Currency, such as EUR
        #[arg(value_parser = currency)]
        currency: String,
        /// Ribbon in one cartridge, such as 20m [default: the length given last, or what earlier cartridges gave between two
        /// `ledger new`]
        #[arg(long, value_name = "LENGTH", value_parser = ribbon_length)]
        length: Option<f64>,
    },
}

fn amount(text: &str) -> Result<f64, String> {
    match text.replace(',', ".").parse() {
        Ok(amount) if (0.0..=1e6).contains(&amount) => Ok(amount),
        _ => Err("expected an amount from 0 to 1000000, such as 12 or 12.50".into()),
    }
}

fn currency(text: &str) -> Result<String, String> {
    let fits = (1..=8).contains(&text.chars().count())
        && !text.chars().any(|c| c.is_control() || c.is_ascii_digit());
    if fits { Ok(text.into()) } else { Err("expected a currency, such as EUR".into()) }
}

/// A length of ribbon in millimetres: metres are how ribbons are measured.
fn ribbon_length(text: &str) -> Result<f64, String> {
    let metres = text.strip_suffix('m').filter(|number| !number.ends_with(['m', 'c']));
    let mm = match metres {
        Some(number) => number.trim().parse::<f64>().map(|metres| 1000.0 * metres).ok(),
        None => text.parse::<Mm>().map(|length| length.0).ok(),
    };
    mm.filter(|mm| (100.0..=1e6).contains(mm))
        .ok_or_else(|| "expected a length from 0.1m to 1000m, such as 20m".into())
}

/// The prices in the ledger; none if it cannot be read, for a plan does not depend on them.
pub fn prices() -> Vec<Price> {
    let read = || anyhow::Ok(Ledger::of(&Printers::of_system()?).lines()?.0);
    // Jobs that never ended count by what their journals know only where ribbon is reported.
    read().map_or_else(|_| Vec::new(), |lines| ledger::prices(&lines, |_| None))
}

/// Runs `ledger`.
pub fn run(args: &Args) -> Result<()> {
    let journal = Journal::of_user()?;
    let ledger = Ledger::of(&Printers::of_system()?);
    if let Some(Command::New { ink }) = &args.command {
        ledger.append(Event::New { ink: ink.name().into() })?;
        return show(&format!("{}: a new cartridge, counted from now on\n", ink.name()));
    }
    if let Some(Command::Price { ink, price, currency, length }) = &args.command {
        let (ink, amount) = (ink.name().to_owned(), *price);
        let lines = ledger.lines()?.0;
        let given = |line: &Line| match &line.event {
            Event::Price { ink: priced, ribbon_mm, .. } if *priced == ink => *ribbon_mm,
            _ => None,
        };
        let ribbon_mm = length.or_else(|| lines.iter().rev().find_map(given));
        let length = ribbon_mm.map_or_else(String::new, |mm| format!(" of {}", ribbon::length(mm)));
        let said = format!("{ink}: {amount:.2} {currency} a cartridge{length}, from now on\n");
        ledger.append(Event::Price { ink, amount, currency: currency.clone(), ribbon_mm })?;
        return show(&said);
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
        return show(&format!("{}\n", serde_json::to_string_pretty(&json)?));
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
        text.push_str(if total.since.is_some() { ", since it was new" } else { "" });
        match (&total.cost, &total.price) {
            (Some(cost), _) => write!(text, ", about {cost}")?,
            (None, Some(price)) => {
                write!(
                    text,
                    ", {} a cartridge (how much ribbon one gives is not known yet)",
                    price.cartridge
                )?;
            }
            (None, None) => {}
        }
        text.push('\n');
    }
    if totals.is_empty() {
        text = "no job was sent yet\n".into();
    } else {
        writeln!(text, "Lengths are estimates, rather too low; `foilpress ledger new INK` starts again.")?;
    }
    if damaged > 0 {
        let lines = if damaged == 1 {
            "1 line cannot be read".into()
        } else {
            format!("{damaged} lines cannot be read")
        };
        let folder = ledger.path().parent().unwrap_or(ledger.path());
        writeln!(text, "{lines} in {}", folder.display())?;
    }
    show(&text)
}
