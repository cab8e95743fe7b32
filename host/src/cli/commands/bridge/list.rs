//! `foilpress bridge list`: each bridge once, with all its addresses.

use std::io::Write as _;

use anyhow::{Result, bail};
use clap::Args as ClapArgs;
use serde_json::json;

use super::found::{Found, ask, doing, newer_firmware};
use crate::cli::console::permission;
use crate::cli::console::{chain, stdout};
use device::connection::find::{self, Candidate};
use device::flash::{drive, usb};
use device::questions::query::is_alps;
use device::transit::words;

/// Arguments of `bridge list`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  foilpress bridge list\n  foilpress bridge list --json\n\n\
    Each bridge is listed once with all its addresses; --to takes any of them. Serial ports of other devices are listed, \
    but nothing is sent to them.")]
pub struct Args {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `bridge list`. Fails if there is nothing to list.
pub fn run(args: &Args) -> Result<()> {
    let survey = find::survey();
    let asked: Vec<(Candidate, Result<Found>)> = survey
        .bridges
        .into_iter()
        .map(|candidate| {
            let found = ask(&candidate);
            (candidate, found)
        })
        .collect();
    let boards = usb::boards().map_or(0, |boards| boards.len()).max(drive::find().len());
    let mut out = stdout();
    if args.json {
        let bridges: Vec<_> = asked.iter().map(|(candidate, found)| as_json(candidate, found)).collect();
        let others: Vec<_> = survey
            .others
            .iter()
            .map(|port| json!({ "address": port.address.to_string(), "product": port.product }))
            .collect();
        let all = json!({ "bridges": bridges, "boards_in_boot_loader": boards, "other_ports": others });
        writeln!(out, "{}", serde_json::to_string_pretty(&all)?)?;
    } else {
        for (candidate, found) in &asked {
            write(&mut out, candidate, found)?;
        }
        if boards > 0 {
            writeln!(
                out,
                "{boards} in the boot loader, without firmware; `foilpress bridge flash` installs it"
            )?;
        }
        for port in &survey.others {
            writeln!(out, "{}: {} (another device, not asked)", port.address, port.product)?;
        }
        if asked.iter().any(|(_, found)| found.as_ref().is_err_and(permission::is_missing)) {
            write!(out, "\n{}", permission::how_to_give())?;
        }
    }
    if asked.is_empty() && boards == 0 {
        bail!("no bridge found on USB; plug it in, or run `foilpress doctor`");
    }
    Ok(())
}

/// The addresses of a bridge.
fn ways(candidate: &Candidate) -> String {
    let ways: Vec<String> = candidate.addresses.iter().map(ToString::to_string).collect();
    ways.join("  ")
}

fn write(out: &mut impl std::io::Write, candidate: &Candidate, found: &Result<Found>) -> Result<()> {
    match found {
        Err(error) => {
            writeln!(
                out,
                "bridge {}",
                candidate.serial_number.as_deref().unwrap_or("without a serial number")
            )?;
            writeln!(out, "    {}\n    {}", ways(candidate), chain(error))?;
        }
        Ok(found) => {
            writeln!(
                out,
                "bridge {:016x}, firmware {}, {}",
                found.bridge.serial,
                found.bridge.firmware,
                doing(&found.progress)
            )?;
            writeln!(out, "    {}", ways(candidate))?;
            match (found.device_id(), found.fault) {
                (Some(id), _) if is_alps(&id) => writeln!(out, "    printer: {id}")?,
                (Some(id), _) => writeln!(out, "    printer: {id} (not an ALPS printer)")?,
                (None, Some(fault)) => writeln!(out, "    {}", words::fault(fault, None))?,
                (None, None) => writeln!(out, "    printer: {}", found.unanswered(&found.device_id))?,
            }
            if let Some(newer) = newer_firmware(&found.bridge) {
                writeln!(out, "    {newer}")?;
            }
        }
    }
    Ok(())
}

fn as_json(candidate: &Candidate, found: &Result<Found>) -> serde_json::Value {
    let addresses: Vec<String> = candidate.addresses.iter().map(ToString::to_string).collect();
    let mut value = match found {
        Ok(found) => found.json(),
        Err(error) => json!({ "error": chain(error) }),
    };
    value["serial_number"] = json!(candidate.serial_number);
    value["addresses"] = json!(addresses);
    value
}
