//! A job's sheets at a bridge: each has a journal of its own, so a process that takes over goes on where the printer is.
//!
//! Waits without limit for the bridge and the operator, unless the queue belongs to a class.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use protocol::ink::Ink;
use protocol::link::message::{Ask, JobKind};
use protocol::status;

use super::{Delivery, Stopped};
use crate::queue::call::Exit;
use crate::queue::messages::{Messages, Reason};
use device::send::journal::{Entry, Journal, JournalError, NewJob, OpenJob};
use device::send::query::{Query, Reply, is_alps};
use device::send::session::{Outcome, Phase, Record, Session, SessionError};
use device::send::status::Status;
use device::send::{self, Address, Checked, Destination, Event, OpenError, RunError, Wish, find, words};

/// How long a cancelled job may take to come to its end; the print system kills after 30 s.
const LAST_WORDS: Duration = Duration::from_secs(20);
/// How long the bridge may take to answer a question.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long the printer behind it may take to say what it is.
const PRINTER_PATIENCE: Duration = Duration::from_secs(12);
/// Records of jobs that ended without success are forgotten after this.
const FORGET: Duration = Duration::from_secs(30 * 24 * 3600);

impl<W: Write + Send> Delivery<'_, W> {
    pub(super) fn bridge_prints(
        &mut self,
        data: &[u8],
        checked: &Checked,
        address: &Address,
        folder: &Path,
    ) -> Result<bool, Stopped> {
        let messages = self.messages;
        let stop = |error: JournalError| {
            messages.error(&error.to_string());
            Stopped(Exit::Stop)
        };
        let journal = Journal::at(folder).map_err(stop)?;
        let known = journal.entries().map_err(stop)?.pop();
        let mut open = match known {
            Some(Entry { record, .. }) if record.phase == Phase::Ended(Outcome::Printed) => return Ok(true),
            Some(Entry { record, .. }) if !matches!(record.phase, Phase::Ended(_)) => {
                self.messages.info("the job was interrupted; going on where the printer is");
                journal.open(record.job).map_err(stop)?
            }
            // Whoever started a job again whose sheet had ended badly wants another one.
            _ => self.queue(&journal, data, checked)?,
        };
        self.greet(address, open.entry.record.bridge, checked)?;
        loop {
            match self.bring(&mut open, address, false)? {
                Brought::Over(outcome) => return self.judge(outcome, &open.entry),
                Brought::NumberTaken => {
                    let record = Record { phase: Phase::Ended(Outcome::Cancelled), ..open.entry.record };
                    open.save(&record).map_err(stop)?;
                    open = self.queue(&journal, data, checked)?;
                }
                // Another bridge is an error, unless what was left behind is ended.
                Brought::Left | Brought::Elsewhere => return Ok(false),
            }
        }
    }

    fn queue(&self, journal: &Journal, data: &[u8], checked: &Checked) -> Result<OpenJob, Stopped> {
        let Destination::Bridge(address) = &self.call.to else {
            return Err(self.fail(Exit::Stop, &"only a bridge has a journal"));
        };
        let job = NewJob {
            name: &self.call.title,
            to: address.to_string(),
            kind: JobKind::Raw,
            data,
            port_bytes: data.len() as u64,
            passes: checked.passes.clone(),
        };
        journal.queue(job).map_err(|error| self.fail(Exit::Stop, &error))
    }

    fn judge(&self, outcome: Outcome, entry: &Entry) -> Result<bool, Stopped> {
        let text = words::outcome(outcome, entry, None);
        match outcome {
            Outcome::Printed => {
                self.messages.info(&text);
                Ok(true)
            }
            Outcome::Cancelled if self.stopped.is_some() => {
                self.messages.reasons(&[]);
                self.messages.info(&text);
                Ok(false)
            }
            // By somebody at the bridge, or by another process.
            Outcome::Cancelled => Err(self.fail(Exit::Cancel, &text)),
            Outcome::Broken => Err(self.fail(Exit::Cancel, &text)),
            Outcome::Lost | Outcome::Forgotten => Err(self.fail(
                Exit::Hold,
                &format!("{text}. The job is held; release it to print this sheet again, or cancel it"),
            )),
        }
    }

    /// What the caller of a session wants now.
    fn wish(stop: &dyn Fn() -> bool, stopped: &mut Option<Instant>) -> Wish {
        if !stop() {
            return Wish::GoOn;
        }
        match stopped.get_or_insert_with(Instant::now).elapsed() {
            time if time < LAST_WORDS => Wish::Cancel,
            _ => Wish::Leave,
        }
    }

    /// Sends a job, or with `cancel` ends it, until the bridge says how it ended. Waits for the bridge.
    fn bring(&mut self, job: &mut OpenJob, address: &Address, cancel: bool) -> Result<Brought, Stopped> {
        let data = std::mem::take(&mut job.data);
        let brought = self.bring_data(&data, job, address, cancel);
        job.data = data;
        brought
    }

    fn bring_data(
        &mut self,
        data: &[u8],
        job: &mut OpenJob,
        address: &Address,
        cancel: bool,
    ) -> Result<Brought, Stopped> {
        let messages = self.messages;
        loop {
            let mut session = Session::new(job.entry.record, data);
            if cancel || (self.stop)() {
                session.cancel();
                job.save(session.record()).map_err(|error| self.fail(Exit::Stop, &error))?;
            }
            if let Some(outcome) = session.outcome() {
                return Ok(Brought::Over(outcome));
            }
            let mut reporter = Reporter::new(&job.entry, messages);
            let (stop, stopped) = (self.stop, &mut self.stopped);
            let result = send::run_at(
                &mut session,
                address,
                &mut |record| job.save(record),
                &mut |event| reporter.tell(&event),
                &mut || Self::wish(stop, stopped),
            );
            // Also what came after the last save.
            job.entry.record = *session.record();
            let (reason, text) = match result {
                Ok(outcome) => return Ok(Brought::Over(outcome)),
                Err(RunError::Left) => return Ok(Brought::Left),
                Err(RunError::Save(error)) => return Err(self.fail(Exit::Stop, &error)),
                Err(RunError::Session(SessionError::NumberTaken(_))) => return Ok(Brought::NumberTaken),
                Err(RunError::Session(SessionError::OtherBridge { .. })) if cancel => {
                    return Ok(Brought::Elsewhere);
                }
                Err(RunError::Session(error @ SessionError::Busy(_))) => {
                    (Reason::Connecting, error.to_string())
                }
                Err(RunError::Session(error)) => return Err(self.fail(Exit::Stop, &error)),
                Err(RunError::Open(error @ (OpenError::Forbidden(_) | OpenError::Several(_)))) => {
                    return Err(self.fail(Exit::Stop, &error));
                }
                Err(RunError::Open(error @ OpenError::InUse(_))) => (Reason::Connecting, error.to_string()),
                Err(RunError::Open(error)) => (Reason::OffLine, error.to_string()),
                Err(error @ RunError::NoAnswer(_)) => (Reason::OffLine, error.to_string()),
            };
            if self.call.in_class && matches!(job.entry.record.phase, Phase::Queued) {
                return Err(self.fail(Exit::Failed, &text));
            }
            messages.reasons(&[Reason::Connecting, reason]);
            messages.info(&format!("{text}. Nothing is lost; the job goes on when the bridge is there"));
            if !self.pause() {
                return Ok(Brought::Left);
            }
        }
    }

    /// Asks the printer what it is and how it is before a job, where it can be asked. One of another maker gets no byte.
    /// What it complains of is told, and stops nothing: the printer itself asks for what it wants.
    fn greet(&self, address: &Address, bridge: Option<u64>, checked: &Checked) -> Result<(), Stopped> {
        let Ok(mut link) = find::open(address, bridge) else { return Ok(()) };
        let Ok(mut query) = Query::new(&mut *link, PATIENCE) else { return Ok(()) };
        if let Some(id) = query.device_id(PATIENCE, PRINTER_PATIENCE)
            && !is_alps(&id)
        {
            return Err(self.fail(
                Exit::Stop,
                &format!(
                    "not sent: the printer says it is no ALPS: {id}. Connect the right one to the bridge, then start the \
                     queue again (cupsenable)"
                ),
            ));
        }
        let Ok(Reply::Bytes(bytes)) = query.printer(Ask::Printer, PATIENCE) else { return Ok(()) };
        let (Ok(status), Ok(answer)) = (Status::read(&bytes), status::Status::parse(&bytes)) else {
            return Ok(());
        };
        self.messages.cassettes(&status);
        let mut reasons: Vec<Reason> =
            answer.complaints().map(|complaint| Reason::of_complaint(&complaint)).collect();
        status.errors.iter().for_each(|error| self.messages.info(error));
        let missing: Vec<Ink> =
            checked.inks.iter().copied().filter(|&ink| answer.has(ink) == Some(false)).collect();
        if !missing.is_empty() {
            reasons.push(Reason::SupplyMissing);
            let list: Vec<String> = missing
                .iter()
                .map(|ink| format!("{} ({}, barcode {})", ink.name(), ink.part(), ink.barcode()))
                .collect();
            self.messages.info(&format!(
                "not loaded: {}; put them in, the printer will ask for them",
                list.join(", ")
            ));
        }
        self.messages.reasons(&reasons);
        Ok(())
    }

    /// Ends at the bridge what other jobs of this queue have left open there, and forgets old records.
    pub(super) fn end_what_was_left(&mut self, own: &Path) -> Result<(), Stopped> {
        let Ok(listing) = fs::read_dir(&self.call.journal) else { return Ok(()) };
        for job in listing.filter_map(|item| Some(item.ok()?.path())).filter(|path| path != own) {
            let sheets = fs::read_dir(&job).into_iter().flatten().filter_map(|item| Some(item.ok()?.path()));
            let mut open = false;
            for folder in sheets.filter(|path| path.is_dir()) {
                let Ok(journal) = Journal::at(&folder) else { continue };
                for entry in journal.entries().unwrap_or_default() {
                    if matches!(entry.record.phase, Phase::Ended(_)) {
                        continue;
                    }
                    // Locked, damaged, or left where the queue led before: not ours to end.
                    let (Destination::Bridge(address), Ok(mut left)) =
                        (&self.call.to, journal.open(entry.record.job))
                    else {
                        open = true;
                        continue;
                    };
                    if entry.to != address.to_string() {
                        open = true;
                        continue;
                    }
                    self.messages.debug(&format!("ending job {:08x}, which was left open", entry.record.job));
                    match self.bring(&mut left, address, true)? {
                        Brought::Left => return Ok(()),
                        Brought::Elsewhere => open = true,
                        Brought::Over(_) | Brought::NumberTaken => {}
                    }
                }
            }
            let age =
                fs::metadata(&job).and_then(|data| data.modified()).ok().and_then(|time| time.elapsed().ok());
            if !open && age.is_some_and(|age| age > FORGET) {
                self.forget(&job);
            }
        }
        Ok(())
    }
}

/// What came of bringing a job to its end.
enum Brought {
    Over(Outcome),
    /// Its number is another job's at the bridge.
    NumberTaken,
    /// It was begun on another bridge than the one that is there.
    Elsewhere,
    /// The print system did not want to wait.
    Left,
}

/// Turns what happens at the bridge into messages.
struct Reporter<'a, W> {
    entry: Entry,
    messages: &'a Messages<W>,
    pass: usize,
    printed: u64,
    faulty: bool,
}

impl<'a, W: Write + Send> Reporter<'a, W> {
    fn new(entry: &Entry, messages: &'a Messages<W>) -> Reporter<'a, W> {
        Reporter {
            entry: entry.clone(),
            messages,
            pass: 0,
            printed: u64::from(entry.record.printed),
            faulty: false,
        }
    }

    fn tell(&mut self, event: &Event<'_>) {
        match event {
            Event::Connected(bridge) => {
                self.messages.debug(&format!("bridge {:016x}, firmware {}", bridge.serial, bridge.firmware));
                self.messages.lift(&[Reason::Connecting, Reason::OffLine]);
            }
            Event::Away(why) => {
                self.messages.reasons(&[Reason::Connecting, Reason::OffLine]);
                self.messages.info(&format!(
                    "the link to the bridge is gone ({why}); it prints what it holds, and the job goes on when it is back"
                ));
            }
            Event::Moved(progress) => {
                self.printed = u64::from(progress.printed);
                let Some((pass, ink)) = words::pass_at(&self.entry.passes, self.printed) else { return };
                if pass != self.pass {
                    self.pass = pass;
                    if !self.faulty {
                        // Whatever it was before the job; but a cassette may be wanted in a later pass.
                        self.messages.lift_all_but(Reason::SupplyMissing);
                    }
                    self.messages.info(&format!(
                        "pass {pass} of {}, {}",
                        self.entry.passes.len(),
                        ink.name()
                    ));
                }
                self.messages.percent(100 * self.printed / self.entry.port_bytes.max(1));
            }
            Event::Fault(Some(fault)) => {
                let ink = words::wanted(&self.entry.passes, self.printed);
                self.faulty = true;
                self.messages.reasons(&[Reason::of_fault(*fault)]);
                self.messages.info(&words::fault(*fault, ink));
            }
            Event::Fault(None) => {
                self.faulty = false;
                self.messages.reasons(&[]);
                self.messages.info("the printer goes on");
            }
        }
    }
}
