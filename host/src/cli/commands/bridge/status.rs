//! `foilpress bridge status`: a bridge, its job and its printer.

use std::io::Write as _;

use anyhow::Result;
use clap::Args as ClapArgs;

use super::found::{Found, named_or_only};
use super::watch;
use crate::cli::console::stdout;
use device::connection::Address;

/// Arguments of `bridge status`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Examples:\n  foilpress bridge status\n  foilpress bridge status --no-negotiate   (an old printer)\n\n\
    To ask the printer, the bridge negotiates with it as IEEE 1284 describes, which may take a printer of before 1994 off line. A \
    printer that has not answered a negotiation is not asked again before it was switched off or reset."
)]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Refresh until interrupted; with --json, print one object on a line whenever something changes
    #[arg(long)]
    watch: bool,
    /// Do not ask the printer anything, only the bridge
    #[arg(long)]
    no_negotiate: bool,
}

/// Runs `bridge status`.
pub fn run(args: &Args) -> Result<()> {
    let address = named_or_only(args.to.as_ref())?;
    if args.watch {
        return watch::run(&address, args.json, args.no_negotiate);
    }
    let found = Found::ask(&address, args.no_negotiate)?;
    let mut out = stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&found.json())?)?;
    } else {
        found.write(&mut out)?;
    }
    Ok(())
}
