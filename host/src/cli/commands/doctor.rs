//! `foilpress doctor`: what printing needs, what is missing, and what to do next.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, TcpStream};
use std::path::Path;
use std::time::Duration;

use anyhow::{Error, Result, bail};
use clap::Args as ClapArgs;
use serde_json::{Value, json};

use crate::cli::commands::bridge::{Found, ask};
use crate::cli::commands::resume::{as_json, line};
use crate::cli::commands::serve::{self, Running};
use crate::cli::console::{chain, permission, show, stdout};
use device::connection::find::{self, Candidate};
use device::connection::{Address, OpenError};
use device::flash::{drive, usb};
use device::questions::query::is_alps;
use device::transit::journal::Journal;
use device::transit::session::Phase;
use device::transit::words;
use observe::with_causes;

/// Arguments of `doctor`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Examples:\n  foilpress doctor\n  foilpress doctor --to serial:/dev/ttyACM0\n  foilpress doctor --json"
)]
pub struct Args {
    /// Address of the bridge [default: every bridge found]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Where the operating system itself shows a bridge.
const LISTED: &str = if cfg!(windows) {
    "Windows shows one in its Device Manager as \"Foilpress bridge\" under \"Universal Serial Bus devices\", and its port under \
     \"Ports (COM & LPT)\"; with a yellow mark there, plug it into another socket once. "
} else if cfg!(target_os = "macos") {
    "macOS lists one in its System Information under USB. "
} else {
    ""
};

/// What was found so far.
struct Visit<W> {
    out: W,
    /// Problems that prevent printing.
    troubles: Vec<String>,
    /// Everything that was found, for programs to read.
    found: Value,
    /// Whether a permission is missing.
    forbidden: bool,
}

/// Runs `doctor`. Fails if something prevents printing.
pub fn run(args: &Args) -> Result<()> {
    let out: Box<dyn std::io::Write> = if args.json { Box::new(std::io::sink()) } else { Box::new(stdout()) };
    let found = json!({ "jobs_folder": null, "unfinished_jobs": [], "boards_in_boot_loader": 0, "bridges": [], "print_servers": [] });
    let mut visit = Visit { out, troubles: Vec::new(), found, forbidden: false };
    visit.journal()?;
    let bridges = match &args.to {
        Some(address) => vec![Candidate { serial_number: None, addresses: vec![address.clone()] }],
        None => find::survey().bridges,
    };
    let boards = if args.to.is_none() { visit.boards()? } else { 0 };
    visit.found["boards_in_boot_loader"] = boards.into();
    if bridges.is_empty() && boards == 0 {
        visit.trouble(&format!(
            "no bridge found on USB: plug it in. If it is plugged in, its cable may carry no data, or it has no firmware yet: hold \
             its BOOTSEL button while plugging it in, then run `foilpress bridge flash`. {LISTED}Name a bridge elsewhere with --to",
        ))?;
    }
    for bridge in &bridges {
        visit.bridge(bridge)?;
    }
    visit.raw_device()?;
    visit.server()?;
    visit.end(args.json)
}

/// Adds to a list.
fn push(list: &mut Value, item: Value) {
    if let Value::Array(items) = list {
        items.push(item);
    }
}

impl<W: std::io::Write> Visit<W> {
    fn trouble(&mut self, text: &str) -> Result<()> {
        self.troubles.push(text.trim().to_owned());
        Ok(writeln!(self.out, "{text}")?)
    }

    fn failure(&mut self, error: &Error) -> Result<()> {
        self.forbidden |= permission::is_missing(error);
        self.trouble(&chain(error))
    }

    fn journal(&mut self) -> Result<()> {
        match Journal::of_user() {
            Err(error) => self.trouble(&format!("cannot keep jobs: {}", with_causes(&error))),
            Ok(journal) => {
                writeln!(self.out, "jobs are kept in {}", journal.folder().display())?;
                self.found["jobs_folder"] = journal.folder().display().to_string().into();
                for entry in journal.entries()? {
                    if !matches!(entry.record.phase, Phase::Ended(_)) {
                        writeln!(
                            self.out,
                            "    unfinished (`foilpress resume` continues it): {}",
                            line(&entry)
                        )?;
                        push(&mut self.found["unfinished_jobs"], as_json(&entry));
                    }
                }
                for (job, error) in journal.damaged()? {
                    self.trouble(&format!("job {job:08x} cannot be read: {error}"))?;
                }
                Ok(())
            }
        }
    }

    /// Reports boards in their boot loader; returns how many there are.
    fn boards(&mut self) -> Result<usize> {
        let found = match usb::boards() {
            Ok(found) => found,
            Err(error) => {
                self.trouble(&format!("cannot search USB: {error}"))?;
                Vec::new()
            }
        };
        let drives = drive::find();
        for (_, board) in &found {
            self.trouble(
                "\na board is in its boot loader, without firmware: `foilpress bridge flash` installs it; to leave the boot loader, \
                 unplug the board and plug it in again",
            )?;
            let Some(closed) = board.closed.filter(|_| drives.is_empty()) else { continue };
            self.forbidden |= board.is_forbidden();
            self.trouble(&format!(
                "    it cannot be opened ({closed}), and its drive (RPI-RP2 or RP2350) is not mounted"
            ))?;
        }
        for (_, drive) in drives.iter().skip(found.len()) {
            self.trouble(&format!(
                "\na board's drive is mounted at {}: `foilpress bridge flash` installs firmware on it",
                drive.display()
            ))?;
        }
        Ok(found.len().max(drives.len()))
    }

    fn bridge(&mut self, bridge: &Candidate) -> Result<()> {
        let ways: Vec<String> = bridge.addresses.iter().map(ToString::to_string).collect();
        writeln!(self.out, "\n{}", ways.join("  "))?;
        let asked = ask(bridge);
        let mut about = asked.as_ref().map_or_else(|error| json!({ "error": chain(error) }), Found::json);
        about["addresses"] = ways.into();
        push(&mut self.found["bridges"], about);
        match asked {
            Err(error) => return self.failure(&error),
            Ok(found) => self.answers(&found)?,
        }
        // The bridge answers on one address; the user may want to use another.
        for address in bridge.addresses.iter().filter(|_| bridge.addresses.len() > 1) {
            if let Err(error @ OpenError::Forbidden(_)) = address.open() {
                self.failure(&error.into())?;
            }
        }
        Ok(())
    }

    fn answers(&mut self, found: &Found) -> Result<()> {
        found.write(&mut self.out)?;
        self.troubles.extend(found.fault.map(|fault| words::fault(fault, None)));
        match found.device_id() {
            Some(id) if !is_alps(&id) => self.trouble(
                "the device does not identify itself as an ALPS printer, so jobs are not sent to it; `--force` with send or print \
                 sends them anyway",
            ),
            _ => Ok(()),
        }
    }

    fn raw_device(&mut self) -> Result<()> {
        let raw = Path::new("/dev/usb/lp0");
        if raw.exists() {
            let (place, out) = (raw.display(), &mut self.out);
            let opened = std::fs::OpenOptions::new().write(true).open(raw);
            let error = opened.as_ref().err().map(ToString::to_string);
            self.found["raw_device"] = json!({ "path": raw, "error": error });
            match opened {
                Ok(_) => writeln!(out, "\n{place} can be written: `--to raw:{place}` sends to it")?,
                Err(error) => {
                    self.forbidden |= error.kind() == std::io::ErrorKind::PermissionDenied;
                    writeln!(out, "\n{place} cannot be opened: {error}")?;
                }
            }
        }
        Ok(())
    }

    /// The print server of this user, and the one of the system.
    fn server(&mut self) -> Result<()> {
        const PATIENCE: Duration = Duration::from_secs(2);
        for folder in serve::folders()? {
            let running = match Running::find(&folder) {
                Ok(None) => continue,
                Ok(Some(running)) => running,
                Err(error) => {
                    writeln!(self.out, "\nprint server with its jobs in {}: {error}", folder.display())?;
                    continue;
                }
            };
            let Running { desk, listens, printers, announced, code } = &running;
            let who = running.who();
            // Where it listens on all addresses, this computer is one of them.
            let ip = match listens.ip() {
                IpAddr::V6(ip) if ip.is_unspecified() => IpAddr::V6(Ipv6Addr::LOCALHOST),
                IpAddr::V4(ip) if ip.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
                ip => ip,
            };
            let answers = TcpStream::connect_timeout(&(ip, listens.port()).into(), PATIENCE);
            writeln!(
                self.out,
                "\nprint server at {desk}\n    printers: {}\n    may print: {who}\n    in print dialogs: {announced}\n    \
                 code for changes from other devices: {code}\n    encrypted: with the certificate {}",
                printers.join(" "),
                folder.join("certificate.pem").display(),
            )?;
            push(
                &mut self.found["print_servers"],
                json!({ "desk": desk, "printers": printers, "may_print": who, "announced": announced, "answers": answers.is_ok() }),
            );
            if let Err(error) = answers {
                self.trouble(&format!("    it does not answer: {error}"))?;
            }
        }
        Ok(())
    }

    fn end(mut self, json: bool) -> Result<()> {
        if json {
            self.found["problems"] = json!(self.troubles);
            self.found["permission_missing"] = self.forbidden.into();
            show(&format!("{}\n", serde_json::to_string_pretty(&self.found)?))?;
        }
        if self.forbidden {
            write!(self.out, "\n{}", permission::how_to_give())?;
        }
        if !self.troubles.is_empty() {
            bail!("problems that prevent printing: {}", self.troubles.len());
        }
        Ok(writeln!(self.out, "\nall is well")?)
    }
}
