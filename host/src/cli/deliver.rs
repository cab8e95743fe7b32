//! From a plan to the printer: which cassettes are in, the word of the person who looked at the plan, and copies.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::path::Path;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::Args;
use protocol::ink::Ink;
use protocol::link::message::Ask;

use super::send;
use device::send::cassettes::{self, Found};
use device::send::query::{Query, Reply};
use device::send::status::Status;
use device::send::{Address, Destination};
use observe::Observer;

/// How long to wait for a bridge, and for the printer behind it.
const BRIDGE: Duration = Duration::from_secs(3);
const PRINTER: Duration = Duration::from_secs(8);

/// Where a job goes, how often, and whether it was asked for.
#[derive(Args, Debug)]
pub struct DeliverArgs {
    /// Also send the job to: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    ///
    /// The plan is shown first, and the job is sent after you confirm it (see --yes). A file is written without asking.
    /// Without --to nothing is sent.
    #[arg(long, value_name = "WHERE")]
    pub to: Option<Destination>,
    /// Number of sheets to print; the program waits for Enter between them
    #[arg(long, value_name = "N", default_value_t = 1, requires = "to", value_parser = clap::value_parser!(u16).range(1..=99))]
    pub copies: u16,
    /// Send even if the device does not identify itself as an ALPS printer
    #[arg(long, requires = "to")]
    pub force: bool,
    /// Send without asking for confirmation
    ///
    /// Needed where there is no terminal to confirm the plan on.
    #[arg(short, long)]
    pub yes: bool,
}

impl DeliverArgs {
    /// The file the job is to be written to, if it goes to a file.
    pub fn file(&self) -> Option<&Path> {
        match &self.to {
            Some(Destination::File(path)) => Some(path),
            _ => None,
        }
    }

    /// Sends a job whose plan was shown. A job for a file was written with everything else.
    pub fn send(&self, name: &str, job: &[u8], observer: &dyn Observer) -> Result<()> {
        let to = match &self.to {
            None | Some(Destination::File(_)) => return Ok(()),
            Some(to) => to,
        };
        let checked = device::send::check(job, observer)?;
        if let Destination::Bridge(address) = to {
            super::show(&format!("{}\n", loaded(address, &checked.inks)))?;
        }
        if !self.yes {
            confirm(name)?;
        }
        send::deliver(name, job, &checked, to, self.copies, self.force, observer)
    }
}

/// What the printer says of the cassettes, in words. The bridge may not answer; then the job will not go either.
pub fn loaded(address: &Address, inks: &[Ink]) -> String {
    let unknown = |why: &str| format!("Which cassettes are in is not known: {why}");
    let ask = || -> Result<Reply> {
        let mut link = address.open()?;
        let mut query = Query::new(&mut *link, BRIDGE)?;
        let (_, fault) = query.lines(BRIDGE)?;
        match fault {
            Some(fault) => Ok(Reply::Stopped(fault)),
            None => Ok(query.printer(Ask::Printer, PRINTER)?),
        }
    };
    match ask() {
        Err(error) => unknown(&format!("{error:#}")),
        Ok(Reply::NotNow) => unknown("the bridge has a job under way"),
        Ok(Reply::OneWay) => unknown("the printer's port is one-way"),
        Ok(Reply::Silent) => unknown("the printer did not answer"),
        Ok(Reply::Stopped(fault)) => unknown(&device::send::words::fault(fault, None)),
        Ok(Reply::Bytes(bytes)) => match Status::read(&bytes) {
            Err(error) => unknown(&error.to_string()),
            Ok(status) => match cassettes::find(&status, inks) {
                Found::All => "All cassettes of the job are in the printer.".into(),
                Found::Stale => unknown("the printer reports an error; `foilpress bridge status` shows it"),
                Found::Missing(missing) => {
                    let names: Vec<String> = missing.iter().map(ToString::to_string).collect();
                    format!(
                        "Not in the printer: {}.\nPut in what is missing now, or wait until the machine stops and asks for it.",
                        names.join(", ")
                    )
                }
            },
        },
    }
}

/// Asks the person at the terminal. Where there is none, nobody has seen the plan.
fn confirm(name: &str) -> Result<()> {
    if !io::stdin().is_terminal() {
        bail!("{name} is not sent: nobody is there to say yes to the plan; look at it and give --yes");
    }
    write!(io::stderr(), "Send it? [y/N] ")?;
    let mut answer = String::new();
    io::stdin().lock().read_line(&mut answer)?;
    match answer.trim().to_ascii_lowercase().as_str() {
        "y" | "yes" => Ok(()),
        _ => bail!("{name} is not sent"),
    }
}

/// Waits for Enter between two sheets; `false` when nobody is there to press it.
pub fn next_sheet(done: u16, copies: u16) -> Result<bool> {
    write!(io::stderr(), "Sheet {done} of {copies} is sent. Load the next one and press Enter: ")?;
    let mut answer = String::new();
    Ok(io::stdin().lock().read_line(&mut answer)? > 0)
}
