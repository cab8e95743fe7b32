//! A bridge and its printer: where they are, and what they answer.

use std::time::Duration;

use anyhow::{Result, anyhow};
use indicatif::HumanBytes;
use protocol::link::message::{Ask, Fault, JobState, Lines, PastJob, Progress, Standing, Usage};
use serde_json::json;

use device::connection::Address;
use device::connection::Bridge;
use device::connection::find::{self, Candidate};
use device::connection::transport::Transport;
use device::flash::installed;
use device::questions::query::{Query, Reply, Shelf, is_alps};
use device::questions::status::Status;
use device::transit::words;
use observe::with_causes;

/// How long to wait for a bridge to answer.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// How long to wait for the printer behind it.
pub const PRINTER_PATIENCE: Duration = Duration::from_secs(12);

/// The address that was named, or that of the only bridge.
pub fn named_or_only(named: Option<&Address>) -> Result<Address> {
    if let Some(address) = named {
        return Ok(address.clone());
    }
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
        JobState::Storing => format!("storing job {job:08x}, {} bytes received", progress.accepted),
        JobState::Stored => format!("idle; job {job:08x} was stored"),
        JobState::Done => format!("idle; job {job:08x} was printed"),
        JobState::Cancelled => format!("idle; job {job:08x} was cancelled"),
        JobState::Broken(_) => format!("idle; job {job:08x} could not be read"),
        JobState::Lost => {
            format!("idle; job {job:08x} was lost; the bridge resets the printer before the next one")
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

/// A hint about a bridge that works but runs other firmware than came with this program.
pub fn newer_firmware(bridge: &Bridge) -> Option<String> {
    let ours = installed::image_for(&bridge.firmware)?.firmware;
    (ours.version() != bridge.firmware).then(|| {
        format!(
            "firmware {} came with this program; `foilpress bridge flash` installs it on the bridge",
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
    /// Where the printer stands, and the job of which it has or may have a part.
    pub standing: (Standing, u32),
    /// The lines of its port.
    pub lines: Lines,
    /// The fault that the lines show.
    pub fault: Option<Fault>,
    /// The printer's device ID.
    pub device_id: Reply,
    /// The printer's own status.
    pub status: Reply,
    /// How the jobs before have ended, the last one first.
    pub past: Vec<PastJob>,
    /// The firmware's use of memory and time.
    pub usage: Usage,
    /// What is stored in it.
    pub shelf: Shelf,
}

impl Found {
    /// Asks bridge and, unless `quiet`, the printer. It is asked only while no job is open; a bridge that
    /// prints says so instead.
    pub fn ask(address: &Address, quiet: bool) -> Result<Found> {
        Found::ask_on(&mut *address.open()?, quiet)
    }

    /// The same on a link that is open.
    pub fn ask_on(link: &mut dyn Transport, quiet: bool) -> Result<Found> {
        let mut query = Query::new(link, PATIENCE)?;
        let mut found = Found::of_bridge(&mut query)?;
        found.device_id = found.printer(&mut query, Ask::DeviceId, quiet)?;
        found.status = found.printer(&mut query, Ask::Printer, quiet)?;
        found.progress = query.ask_progress(PATIENCE)?;
        found.standing = query.standing();
        Ok(found)
    }

    /// Asks the printer something, if it takes bytes.
    pub fn printer(&self, query: &mut Query<'_>, what: Ask, quiet: bool) -> Result<Reply> {
        Ok(match self.fault {
            Some(fault) => Reply::Stopped(fault),
            None if quiet => Reply::NotAsked,
            None => query.printer(what, PRINTER_PATIENCE)?,
        })
    }

    /// What the bridge itself knows, before the printer is asked.
    pub fn of_bridge(query: &mut Query<'_>) -> Result<Found> {
        let (lines, fault) = query.lines(PATIENCE)?;
        Ok(Found {
            bridge: query.bridge().clone(),
            progress: *query.progress(),
            standing: query.standing(),
            lines,
            fault,
            device_id: Reply::NotNow,
            status: Reply::NotNow,
            past: query.past().copied().collect(),
            usage: query.usage(PATIENCE)?,
            shelf: query.shelf(PATIENCE)?,
        })
    }

    /// As JSON.
    pub fn json(&self) -> serde_json::Value {
        json!({
            "bridge": self.bridge,
            "serial_number": format!("{:016X}", self.bridge.serial),
            "job": { "number": self.progress.job, "doing": doing(&self.progress),
                     "accepted": self.progress.accepted, "printed": self.progress.printed },
            "earlier_jobs": self.earlier().map(|past| json!({
                "number": past.job, "ended": ended(past.state), "printed": past.printed,
            })).collect::<Vec<_>>(),
            "firmware": { "memory": self.usage.fixed, "stack": self.usage.stack, "stack_used": self.usage.stack_used,
                          "longest_us": self.usage.longest_us },
            "stored": { "jobs": self.shelf.jobs.len(), "room": self.shelf.room, "total": self.shelf.total },
            "printer_stands": { "where": match self.standing.0 {
                Standing::AT_REST => "between jobs",
                Standing::IN_SHEET => "in a sheet",
                _ => "unknown",
            }, "job": self.standing.1 },
            "lines_high": levels(self.lines),
            "fault": self.fault.map(|fault| words::fault(fault, None)),
            "device_id": self.device_id.device_id(),
            "printer": match &self.status {
                Reply::Bytes(bytes) => Status::read(bytes).ok(),
                _ => None,
            },
        })
    }

    /// The jobs before the last one.
    fn earlier(&self) -> impl Iterator<Item = &PastJob> {
        self.past.iter().filter(|past| past.job != self.progress.job)
    }

    /// The printer's device ID, if it sent one.
    pub fn device_id(&self) -> Option<String> {
        self.device_id.device_id()
    }

    /// Why the printer has told nothing.
    pub fn unanswered(&self, reply: &Reply) -> String {
        match reply {
            Reply::NotNow if self.progress.is_open() => "not asked, because a job is open".into(),
            Reply::NotNow => "not asked, because the bridge is busy with it".into(),
            Reply::Unsure => format!("not asked, because {}", unsure(self.standing.1)),
            Reply::NotAsked => "not asked".into(),
            Reply::OneWay => "its port is one-way, so it cannot be asked".into(),
            Reply::Bytes(_) => "its answer cannot be read".into(),
            Reply::Silent => "did not answer in time".into(),
            Reply::Stopped(_) => "cannot be asked at the moment".into(),
        }
    }

    /// Writes it in words.
    pub fn write(&self, out: &mut impl std::io::Write) -> Result<()> {
        writeln!(out, "bridge {:016x}, firmware {}", self.bridge.serial, self.bridge.firmware)?;
        if let Some(newer) = newer_firmware(&self.bridge) {
            writeln!(out, "    {newer}")?;
        }
        writeln!(out, "job: {}", doing(&self.progress))?;
        let earlier: Vec<String> =
            self.earlier().take(4).map(|past| format!("{:08x} {}", past.job, ended(past.state))).collect();
        if !earlier.is_empty() {
            writeln!(out, "before: {}", earlier.join(", "))?;
        }
        if let Some(stored) = shelf_text(&self.shelf) {
            writeln!(out, "stored: {stored}")?;
        }
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
            other => writeln!(out, "printer: {}", self.unanswered(other))?,
        }
        let Usage { fixed, stack, stack_used, longest_us } = self.usage;
        writeln!(
            out,
            "firmware: {} of {} KiB of stack used, {} KiB of other memory, no task ran longer than {:.1} ms",
            stack_used.div_ceil(1024),
            stack / 1024,
            fixed.div_ceil(1024),
            f64::from(longest_us) / 1000.0
        )?;
        Ok(())
    }
}

/// Why a printer of which its bridge does not know where it stands is not asked.
fn unsure(job: u32) -> String {
    match job {
        0 => "the bridge has not seen what it did before; it is reset before the next job, or by `foilpress bridge reset`, and then \
              it can be asked"
            .into(),
        job => format!(
            "it may hold part of job {job:08x}; take the sheet out, and `foilpress bridge reset` makes it ready"
        ),
    }
}

/// What a bridge has stored and has room for; nothing if it cannot store any job.
pub fn shelf_text(shelf: &Shelf) -> Option<String> {
    let jobs = match shelf.jobs.len() {
        0 => "no jobs".into(),
        1 => "1 job".into(),
        many => format!("{many} jobs"),
    };
    let (room, total) = (HumanBytes(shelf.room.into()), HumanBytes(shelf.total.into()));
    (shelf.total > 0).then(|| format!("{jobs}, room for {room} of {total}"))
}

/// How an earlier job has ended, in a word or two.
fn ended(state: JobState) -> &'static str {
    match state {
        JobState::Done => "printed",
        JobState::Cancelled => "cancelled",
        JobState::Broken(_) => "not readable",
        JobState::Lost => "lost",
        JobState::Stored => "stored",
        JobState::None
        | JobState::Printing
        | JobState::Stopped(_)
        | JobState::Cancelling
        | JobState::Storing => "open",
    }
}

/// What a bridge answers on the first of its addresses that can be opened.
pub fn ask(candidate: &Candidate) -> Result<Found> {
    let (_, mut link) = candidate.open()?;
    Found::ask_on(&mut *link, false)
}
