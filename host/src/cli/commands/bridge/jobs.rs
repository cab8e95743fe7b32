//! `foilpress bridge jobs`: the jobs in a bridge's flash.

use std::io::Write as _;

use anyhow::{Result, anyhow};
use clap::Args as ClapArgs;
use indicatif::HumanBytes;
use protocol::link::message::JobKind;
use serde_json::json;

use super::found::{PATIENCE, named_or_only, shelf_text};
use crate::cli::console::{show, stdout};
use device::connection::Address;
use device::questions::query::{Query, Shelf, Stored};
use device::transit::journal::fresh_number;

/// Arguments of `bridge jobs`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge jobs\n  \
    foilpress bridge jobs --json\n  \
    foilpress bridge jobs --print 1a2b3c4d\n  \
    foilpress bridge jobs --delete 1a2b3c4d\n\n\
    `foilpress send job.rgl --to usb: --store` stores a job. A short press of the bridge's button prints the job that was stored last, \
    and holds it while it is printed; a press of three seconds cancels it. A job that is printed stays stored.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Print JSON
    #[arg(long, conflicts_with_all = ["print", "delete"])]
    json: bool,
    /// Print the job with this number; the bridge needs no computer for it
    #[arg(long, value_name = "ID", value_parser = number)]
    print: Option<u32>,
    /// Delete the job with this number
    #[arg(long, value_name = "ID", value_parser = number, conflicts_with = "print")]
    delete: Option<u32>,
}

/// A job's number as it is shown.
fn number(text: &str) -> Result<u32> {
    u32::from_str_radix(text, 16).map_err(|_| {
        anyhow!("a job has a number of eight digits, such as 1a2b3c4d; `foilpress bridge jobs` lists them")
    })
}

/// Runs `bridge jobs`.
pub fn run(args: &Args) -> Result<()> {
    let address = named_or_only(args.to.as_ref())?;
    let mut link = address.open()?;
    let mut query = Query::new(&mut *link, PATIENCE)?;
    if let Some(stored) = args.print {
        let job = fresh_number(stored, address.to_string().as_bytes());
        query.print_stored(job, stored, PATIENCE)?;
        return show(&format!(
            "the bridge prints {stored:08x} as job {job:08x}, also without this computer; `foilpress bridge status` shows how far it is, \
             `foilpress cancel {job:08x} --to {address}` ends it\n"
        ));
    }
    if let Some(stored) = args.delete {
        query.delete_stored(stored, PATIENCE)?;
        return show(&format!("job {stored:08x} is deleted from the bridge\n"));
    }
    let shelf = query.shelf(PATIENCE)?;
    let mut out = stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&as_json(&shelf))?)?;
    } else {
        writeln!(out, "{}", shelf_text(&shelf).unwrap_or_else(|| "this bridge cannot store jobs".into()))?;
        for Stored { job, kind, length, name } in &shelf.jobs {
            let form = match kind {
                JobKind::Streams => "pass streams",
                JobKind::Raw => "byte for byte",
            };
            writeln!(
                out,
                "    {job:08x}  {:>10}  {form:<13}  {name}",
                HumanBytes((*length).into()).to_string()
            )?;
        }
    }
    Ok(())
}

fn as_json(shelf: &Shelf) -> serde_json::Value {
    let jobs: Vec<_> = shelf
        .jobs
        .iter()
        .map(|stored| json!({ "number": stored.job, "name": stored.name, "bytes": stored.length }))
        .collect();
    json!({ "room": shelf.room, "total": shelf.total, "jobs": jobs })
}
