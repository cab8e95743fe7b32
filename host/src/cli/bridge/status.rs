//! `foilpress bridge status`: a bridge, its job and its printer.

use std::io::Write as _;

use anyhow::Result;
use clap::Args as ClapArgs;

use super::found::{Found, only};
use super::watch;
use device::send::Address;

/// Arguments of `bridge status`.
#[derive(ClapArgs, Debug)]
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
}

/// Runs `bridge status`.
pub fn run(args: &Args) -> Result<()> {
    let address = match &args.to {
        Some(address) => address.clone(),
        None => only()?,
    };
    if args.watch {
        return watch::run(&address, args.json);
    }
    let found = Found::ask(&address)?;
    let mut out = std::io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&found.json())?)?;
    } else {
        found.write(&mut out)?;
    }
    Ok(())
}
