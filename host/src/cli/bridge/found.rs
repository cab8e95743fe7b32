//! A bridge and its printer: where they are, and what they answer.

use std::time::Duration;

use anyhow::{Result, anyhow};
use protocol::link::message::{Ask, Fault, JobState, Lines, Progress};
use serde_json::json;

use device::flash::image::Firmware;
use device::send::find::{self, Candidate};
use device::send::query::{Query, Reply, is_alps};
use device::send::session::Bridge;
use device::send::status::Status;
use device::send::transport::Transport;
use device::send::{Address, words};
use observe::with_causes;

/// How long to wait for a bridge to answer.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// How long to wait for the printer behind it.
pub const PRINTER_PATIENCE: Duration = Duration::from_secs(12);

/// The address of the only bridge.
pub fn only() -> Result<Address> {
    let bridge =
        find::only().map_err(|error| anyhow!("{error}; name one with --to, or see `foilpress doctor`"))?;
    let (address, _) = bridge.open()?;
    Ok(address.clone())
}

/// What a bridge is doing, in words.
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

/// Whether a job is open.
pub fn is_open(progress: &Progress) -> bool {
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

/// A hint about a bridge that works but runs other firmware than this program includes.
pub fn newer_firmware(bridge: &Bridge) -> Option<String> {
    let ours = Firmware::embedded()?.ok()?;
    (ours.version() != bridge.firmware).then(|| {
        format!(
            "this program includes firmware {}; `foilpress bridge flash` installs it on the bridge",
            ours.version()
        )
    })
}

/// What a bridge and its printer answer.
pub struct Found {
    /// The bridge as it introduced itself.
    pub bridge: Bridge,
    /// Its job.
    pub progress: Progress,
    /// The lines of its port.
    pub lines: Lines,
    /// The fault that the lines show.
    pub fault: Option<Fault>,
    /// The printer's device ID.
    pub device_id: Reply,
    /// The printer's own status.
    pub status: Reply,
}

impl Found {
    /// Asks bridge and printer. The printer is asked only while no job is open; a bridge that prints says so instead.
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

    /// As JSON.
    pub fn json(&self) -> serde_json::Value {
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

    /// The printer's device ID, if it sent one.
    pub fn device_id(&self) -> Option<String> {
        self.device_id.device_id()
    }

    /// Writes it in words.
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
                writeln!(out, "    it does not identify itself as an ALPS printer")?;
            }
        }
        match &self.status {
            Reply::Bytes(bytes) => match Status::read(bytes) {
                Ok(status) => write!(out, "{status}")?,
                Err(error) => writeln!(out, "{}", with_causes(&error))?,
            },
            Reply::NotNow => writeln!(out, "printer: not asked, because a job is open")?,
            Reply::OneWay => writeln!(out, "printer: its port is one-way, so it cannot be asked")?,
            Reply::Silent => writeln!(out, "printer: did not answer in time")?,
            Reply::Stopped(_) => writeln!(out, "printer: cannot be asked at the moment")?,
        }
        Ok(())
    }
}

/// What a bridge answers on the first of its addresses that can be opened.
pub fn ask(candidate: &Candidate) -> Result<Found> {
    let (_, mut link) = candidate.open()?;
    Found::ask_on(&mut *link)
}
