//! `foilpress bridge`: the bridges there are, how one of them and its printer are, and new firmware for it.

mod flash;
mod list;
mod log;
mod reset;
mod test;
mod watch;

pub use list::ask;

use std::io::{self, Write as _};
use std::time::Duration;

use anyhow::{Result, anyhow};
use clap::{Args as ClapArgs, Subcommand};
use protocol::link::message::{Ask, Fault, JobState, Lines, Progress};
use serde_json::json;

use device::deliver::Failure;
use device::flash::FlashError;
use device::flash::image::Firmware;
use device::send::find;
use device::send::query::{Query, Reply, is_alps};
use device::send::session::Bridge;
use device::send::status::Status;
use device::send::transport::Transport;
use device::send::usb::UDEV_RULES;
use device::send::{Address, OpenError, words};
use observe::Observer;

/// How long to wait for a bridge to answer.
pub(super) const PATIENCE: Duration = Duration::from_secs(3);
/// How long to wait for the printer behind it.
const PRINTER_PATIENCE: Duration = Duration::from_secs(12);

/// Arguments of `bridge`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge list\n  \
    foilpress bridge status                              (the only bridge there is)\n  \
    foilpress bridge status --to serial:/dev/ttyACM0 --json\n  \
    foilpress bridge status --watch                      (until Ctrl-C)\n  \
    foilpress bridge test                                (the wiring, with a loop-back plug)\n  \
    foilpress bridge log                                 (what the firmware has noted)\n  \
    foilpress bridge flash                               (new firmware, or the first one on a new board)\n  \
    foilpress bridge reset                               (after a sheet was lost)")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// The bridges on USB, with firmware and printer
    List(list::Args),
    /// Put firmware on a bridge, or on a new board
    Flash(flash::Args),
    /// The bridge, its job, the port's lines, and the printer's own answer when no job is open
    Status(StatusArgs),
    /// Try the wiring with a loop-back plug, or walk through the lines for a meter
    Test(test::Args),
    /// What the firmware has noted, also before its last restart
    Log(log::Args),
    /// Reset the printer through the bridge, after a bridge has lost its memory in the middle of a sheet
    Reset(reset::Args),
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
    /// Again and again, in place; with --json an object on a line whenever something has changed
    #[arg(long)]
    watch: bool,
}

/// Runs `bridge`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match &args.command {
        Command::List(args) => list::run(args),
        Command::Flash(args) => flash::run(args, observer),
        Command::Status(args) => status(args),
        Command::Test(args) => test::run(args),
        Command::Log(args) => log::run(args),
        Command::Reset(args) => reset::run(args),
    }
}

/// The only bridge there is.
pub(super) fn only() -> Result<Address> {
    let bridge =
        find::only().map_err(|error| anyhow!("{error}; name one with --to, or see `foilpress doctor`"))?;
    let (address, _) = bridge.open()?;
    Ok(address.clone())
}

/// Whether something was not allowed that a rule for the system would allow.
pub fn is_forbidden(error: &anyhow::Error) -> bool {
    let refused = |open: &OpenError| matches!(open, OpenError::Forbidden(_));
    error.chain().any(|cause| {
        cause.downcast_ref().is_some_and(refused)
            || match cause.downcast_ref() {
                Some(Failure::Open(open)) => refused(open),
                _ => false,
            }
            || match cause.downcast_ref() {
                Some(FlashError::Open(open)) => refused(open),
                Some(FlashError::Closed(error)) => error.kind() == io::ErrorKind::PermissionDenied,
                _ => false,
            }
    })
}

/// What gives the permission.
pub fn permission() -> String {
    if !cfg!(target_os = "linux") {
        return "close other programs that may use it, and unplug it and plug it in again\n".into();
    }
    let rules: String = UDEV_RULES.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).fold(
        String::new(),
        |mut rules, line| {
            rules += line;
            rules.push('\n');
            rules
        },
    );
    format!(
        "Allow it once, and plug the bridge in again:\n\n\
         sudo tee /etc/udev/rules.d/70-foilpress.rules <<'END'\n{rules}END\n\
         sudo udevadm control --reload && sudo udevadm trigger\n"
    )
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
            format!("idle; job {job:08x} was lost; the bridge resets the printer before the next one")
        }
    }
}

/// Whether a job is under way.
fn is_open(progress: &Progress) -> bool {
    matches!(progress.state, JobState::Printing | JobState::Stopped(_) | JobState::Cancelling)
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

/// What to say of a bridge that works but does not have the firmware that came with this program.
pub fn newer_firmware(bridge: &Bridge) -> Option<String> {
    let ours = Firmware::embedded()?.ok()?;
    (ours.version() != bridge.firmware).then(|| {
        format!(
            "this program came with firmware {}; `foilpress bridge flash` puts it on the bridge",
            ours.version()
        )
    })
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
        Found::ask_on(&mut *address.open()?)
    }

    /// The same on a link that is open.
    pub fn ask_on(link: &mut dyn Transport) -> Result<Found> {
        let mut query = Query::new(link, PATIENCE)?;
        let (lines, fault) = query.lines(PATIENCE)?;
        let mut printer = |what| match fault {
            Some(fault) => Ok(Reply::Stopped(fault)),
            None => query.printer(what, PRINTER_PATIENCE),
        };
        let device_id = printer(Ask::DeviceId)?;
        let mut status = printer(Ask::Printer)?;
        // A job may have ended meanwhile, between two of these answers.
        let progress = query.ask_progress(PATIENCE)?;
        if status == Reply::NotNow && !is_open(&progress) {
            status = query.printer(Ask::Printer, PRINTER_PATIENCE)?;
        }
        Ok(Found { bridge: query.bridge().clone(), progress, lines, fault, device_id, status })
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "bridge": self.bridge,
            "serial_number": format!("{:016X}", self.bridge.serial),
            "job": { "number": self.progress.job, "doing": doing(&self.progress),
                     "accepted": self.progress.accepted, "printed": self.progress.printed },
            "lines_high": levels(self.lines),
            "fault": self.fault.map(|fault| words::fault(fault, None)),
            "device_id": self.device_id.device_id(),
            "printer": match &self.status {
                Reply::Bytes(bytes) => Status::read(bytes).ok(),
                _ => None,
            },
        })
    }

    /// The printer's device ID, if it told it.
    pub fn device_id(&self) -> Option<String> {
        self.device_id.device_id()
    }

    /// In words.
    pub fn write(&self, out: &mut impl std::io::Write) -> Result<()> {
        writeln!(out, "bridge {:016x}, firmware {}", self.bridge.serial, self.bridge.firmware)?;
        if let Some(newer) = newer_firmware(&self.bridge) {
            writeln!(out, "    {newer}")?;
        }
        writeln!(out, "job: {}", doing(&self.progress))?;
        writeln!(out, "lines high: {}", levels(self.lines).join(" "))?;
        if let Some(fault) = self.fault {
            writeln!(out, "{}", words::fault(fault, None))?;
        }
        if let Some(id) = self.device_id() {
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

fn status(args: &StatusArgs) -> Result<()> {
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
