//! `foilpress bridge`: the bridges there are, and how one of them and its printer are.

use std::io::Write as _;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use protocol::link::message::{Ask, Fault, JobState, Lines, Progress, VERSION};
use serde_json::json;
use serialport::{SerialPortInfo, SerialPortType};

use crate::send::query::{Query, Reply};
use crate::send::session::Bridge;
use crate::send::status::Status;
use crate::send::{Address, words};

/// How long to wait for a bridge to answer.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long to wait for the printer behind it.
const PRINTER_PATIENCE: Duration = Duration::from_secs(12);

/// Arguments of `bridge`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge list\n  \
    foilpress bridge status                              (the only bridge there is)\n  \
    foilpress bridge status --to serial:/dev/ttyACM0 --json")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Serial ports on USB, and which of them are bridges
    List,
    /// The bridge, its job, the port's lines, and the printer's own answer when no job is open
    Status(StatusArgs),
}

/// Arguments of `bridge status`.
#[derive(ClapArgs, Debug)]
struct StatusArgs {
    /// Where the bridge is [default: the only one there is]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Runs `bridge`.
pub fn run(args: &Args) -> Result<()> {
    match &args.command {
        Command::List => list(),
        Command::Status(args) => status(args),
    }
}

/// A serial port on USB.
pub struct Port {
    /// Where it is.
    pub address: Address,
    /// What it says it is.
    pub product: String,
    /// Whether it may be a bridge, so that it may be spoken to.
    pub candidate: bool,
}

/// The serial ports on USB. Ports of other devices are not spoken to: a greeting may mean something to them.
pub fn ports() -> Vec<Port> {
    // Systems that cannot list their ports have none to offer; a port can still be named.
    let found: Vec<SerialPortInfo> = serialport::available_ports().unwrap_or_default();
    found
        .into_iter()
        .filter_map(|port| {
            let SerialPortType::UsbPort(usb) = port.port_type else { return None };
            let product = usb.product.unwrap_or_else(|| format!("{:04x}:{:04x}", usb.vid, usb.pid));
            let ours = |text: &str| text.to_ascii_lowercase().contains("foilpress");
            let candidate = ours(&product) || usb.manufacturer.as_deref().is_some_and(ours);
            Some(Port { address: Address::Serial(port.port_name), product, candidate })
        })
        .collect()
}

/// Who answers there.
pub fn greet(address: &Address) -> Result<(Bridge, Progress)> {
    let mut link = address.open()?;
    let query = Query::new(&mut *link, PATIENCE)?;
    Ok((query.bridge().clone(), *query.progress()))
}

fn list() -> Result<()> {
    let mut out = std::io::stdout().lock();
    let ports = ports();
    if ports.is_empty() {
        bail!("no serial port on USB; plug the bridge in, or see `foilpress doctor`");
    }
    for port in &ports {
        write!(out, "{}  {}", port.address, port.product)?;
        match port.candidate.then(|| greet(&port.address)) {
            None => writeln!(out, ": another device, not asked")?,
            Some(Ok((bridge, progress))) => {
                writeln!(
                    out,
                    ": bridge {:016x}, firmware {}, {}",
                    bridge.serial,
                    bridge.firmware,
                    doing(&progress)
                )?;
            }
            Some(Err(error)) => writeln!(out, ": {error:#}")?,
        }
    }
    Ok(())
}

/// The only bridge there is.
fn only() -> Result<Address> {
    let mut candidates: Vec<Port> = ports().into_iter().filter(|port| port.candidate).collect();
    match (candidates.pop(), candidates.is_empty()) {
        (Some(one), true) => Ok(one.address),
        (None, _) => bail!("no bridge found; name its port with --to, or see `foilpress doctor`"),
        (Some(last), false) => {
            candidates.push(last);
            let names: Vec<String> = candidates.iter().map(|port| port.address.to_string()).collect();
            bail!("several bridges: choose one with --to: {}", names.join(", "))
        }
    }
}

/// What a bridge does, in words.
pub fn doing(progress: &Progress) -> String {
    let job = progress.job;
    match progress.state {
        JobState::None => "no job since it was switched on".into(),
        JobState::Printing => format!("printing job {job:08x}, {} bytes printed", progress.printed),
        JobState::Stopped(fault) => format!("job {job:08x} waits: {}", words::fault(fault, None)),
        JobState::Cancelling => format!("ending job {job:08x} early"),
        JobState::Done => format!("idle; job {job:08x} was printed"),
        JobState::Cancelled => format!("idle; job {job:08x} was cancelled"),
        JobState::Broken(_) => format!("idle; job {job:08x} could not be read"),
        JobState::Lost => {
            format!("idle; job {job:08x} was lost. Switch the printer off and on before the next one")
        }
    }
}

/// The lines by their names.
fn levels(lines: Lines) -> Vec<&'static str> {
    [
        (Lines::ACK, "nAck"),
        (Lines::BUSY, "Busy"),
        (Lines::PAPER_OUT, "PError"),
        (Lines::SELECT, "Select"),
        (Lines::FAULT, "nFault"),
        (Lines::POWER, "+5V"),
    ]
    .into_iter()
    .filter(|&(line, _)| lines.high(line))
    .map(|(_, name)| name)
    .collect()
}

/// What a bridge and its printer answer.
pub struct Found {
    bridge: Bridge,
    progress: Progress,
    lines: Lines,
    /// What the lines mean.
    pub fault: Option<Fault>,
    device_id: Reply,
    status: Reply,
}

impl Found {
    /// Asks all there is to ask. The printer itself is asked only while no job is open; a bridge that prints says so
    /// instead.
    pub fn ask(address: &Address) -> Result<Found> {
        let mut link = address.open()?;
        let mut query = Query::new(&mut *link, PATIENCE)?;
        if query.bridge().version != VERSION {
            bail!(
                "firmware {} speaks version {} of the link, this program version {VERSION}: flash the firmware that \
                 came with this program",
                query.bridge().firmware,
                query.bridge().version
            );
        }
        let (lines, fault) = query.lines(PATIENCE)?;
        let mut printer = |what| match fault {
            Some(fault) => Ok(Reply::Stopped(fault)),
            None => query.printer(what, PRINTER_PATIENCE),
        };
        let device_id = printer(Ask::DeviceId)?;
        let status = printer(Ask::Printer)?;
        Ok(Found {
            bridge: query.bridge().clone(),
            progress: *query.progress(),
            lines,
            fault,
            device_id,
            status,
        })
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "bridge": self.bridge,
            "job": { "number": self.progress.job, "doing": doing(&self.progress),
                     "accepted": self.progress.accepted, "printed": self.progress.printed },
            "lines_high": levels(self.lines),
            "fault": self.fault.map(|fault| words::fault(fault, None)),
            "device_id": text(&self.device_id),
            "printer": match &self.status {
                Reply::Bytes(bytes) => Status::read(bytes).ok(),
                _ => None,
            },
        })
    }

    /// In words.
    pub fn write(&self, out: &mut impl std::io::Write) -> Result<()> {
        writeln!(out, "bridge {:016x}, firmware {}", self.bridge.serial, self.bridge.firmware)?;
        writeln!(out, "job: {}", doing(&self.progress))?;
        writeln!(out, "lines high: {}", levels(self.lines).join(" "))?;
        if let Some(fault) = self.fault {
            writeln!(out, "{}", words::fault(fault, None))?;
        }
        if let Some(id) = text(&self.device_id) {
            writeln!(out, "device ID: {id}")?;
            if !is_alps(&id) {
                writeln!(out, "    this is no ALPS printer")?;
            }
        }
        match &self.status {
            Reply::Bytes(bytes) => match Status::read(bytes) {
                Ok(status) => write!(out, "{status}")?,
                Err(error) => writeln!(out, "{error}")?,
            },
            Reply::NotNow => writeln!(out, "printer: not asked, a job is open")?,
            Reply::OneWay => writeln!(out, "printer: its port is one-way, so it cannot be asked")?,
            Reply::Silent => writeln!(out, "printer: did not answer in time")?,
            Reply::Stopped(_) => writeln!(out, "printer: takes no question at the moment")?,
        }
        Ok(())
    }
}

/// The device ID as text, without the two bytes of its length.
fn text(reply: &Reply) -> Option<String> {
    let Reply::Bytes(bytes) = reply else { return None };
    let printable = |byte: &&u8| byte.is_ascii_graphic() || **byte == b' ';
    Some(bytes.iter().filter(printable).map(|&byte| char::from(byte)).collect())
}

/// Whether a device ID names the maker of these printers.
pub fn is_alps(id: &str) -> bool {
    id.split(';').filter_map(|field| field.split_once(':')).any(|(key, value)| {
        (key.trim().ends_with("MANUFACTURER") || key.trim().ends_with("MFG")) && value.trim() == "ALPS"
    })
}

fn status(args: &StatusArgs) -> Result<()> {
    let address = match &args.to {
        Some(address) => address.clone(),
        None => only()?,
    };
    let found = Found::ask(&address)?;
    let mut out = std::io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&found.json())?)?;
    } else {
        found.write(&mut out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printers_own_device_id_is_known_and_anothers_is_not() {
        assert!(is_alps("MANUFACTURER:ALPS   ;COMMAND SET:RGL;MODEL:MD-5500_T-03   ;CLASS:PRINTER"));
        assert!(!is_alps("MFG:Hewlett-Packard;MDL:LaserJet;COMMENT:not ALPS"));
    }
}
