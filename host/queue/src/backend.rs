//! The backend: what the print system starts to bring a job to the printer.
//!
//! Problem: the print system starts jobs again after a crash of its own, retries what failed, and knows
//! nothing of ribbons; a sheet must not be printed twice, and a job that is cancelled must leave a printer
//! that is ready.
//! Method: a job's sheets go one after the other to the [delivery](device::deliver), as every command's do.
//! Each has a journal of its own under the job's identity, so a process that takes over knows what was sent
//! and continues where the printer is. A sheet whose outcome is unknown, and a printer that has to be reset,
//! hold the job: nobody can be asked here. Whoever releases a held job agrees to the reset and to printing
//! the sheet again. SIGTERM ends the sheet at the bridge, also one that an earlier process has begun.
//! What an earlier job has left open at the bridge is ended first; a server of its own sees to it that no
//! other job of its is among those.
//! For the print system the backend ends when the last sheet is *sent*: while the printer prints from its own
//! memory the next job may come. A server of its own waits until each sheet is out.
//! Limits: jobs of up to 1 GB. A raw device tells nothing, so a job that was interrupted there is held.
//! Source: backend(7).

mod system;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::call::{Call, Exit};
use super::messages::{Reason, Report};
use art::process::Process;
use device::connection::{Address, Destination};
use device::deliver::{Delivery, Ended, Failure, Job, Packed};
use device::encodings::{self, Checked, Content};
use device::printers::{Printer, Printers};
use device::transit::finish::Sheet;
use device::transit::journal::{Entry, Journal, OpenJob};
use device::transit::raw::RawError;
use device::transit::session::{Outcome, Phase, SessionError};
use files::durable::{self, Access, is_full};
use observe::Silent;
use press::inspect::sheets;
use system::System;

/// The most bytes of a job: dozens of pages.
const LARGEST: u64 = 1 << 30;
/// Records of jobs that ended without success are forgotten after this.
const FORGET: Duration = Duration::from_secs(30 * 24 * 3600);

/// How long the print system may take to list its jobs, of the half minute until it kills.
const ANSWER: Duration = Duration::from_secs(3);
/// The most bytes of such a list.
const LONGEST_LIST: u64 = 1 << 20;

/// How the backend stops before all is printed.
struct Stopped(Exit);

/// A job on its way.
struct Backend<'a> {
    call: &'a Call,
    messages: &'a dyn Report,
    system: &'a System<'a>,
    delivery: &'a Delivery<'a>,
    given_up: &'a dyn Fn() -> bool,
}

/// The sheets of a job, each one whole job in the printer's language. They may still be made.
pub trait Sheets {
    /// How many there are so far.
    fn count(&self) -> usize;

    /// The bytes of one, from 0, as soon as it is made; none behind the last one.
    ///
    /// # Errors
    /// What the system says.
    fn sheet(&self, index: usize) -> io::Result<Option<Cow<'_, [u8]>>>;
}

/// Sheets behind each other.
struct Row {
    bytes: Vec<u8>,
    places: Vec<Range<usize>>,
}

impl Sheets for Row {
    fn count(&self) -> usize {
        self.places.len()
    }

    fn sheet(&self, index: usize) -> io::Result<Option<Cow<'_, [u8]>>> {
        Ok(self.places.get(index).map(|place| Cow::Borrowed(&self.bytes[place.clone()])))
    }
}

/// Prints a job of the print system. `input` is standard input; `stop` says whether the print system has
/// asked to end.
pub fn run(
    call: &Call,
    printers: &Printers,
    input: &mut dyn Read,
    messages: &dyn Report,
    stop: &(dyn Fn() -> bool + Sync),
) -> Exit {
    let bytes = match read(call, input) {
        // A filter that made nothing has said why, and the print system shows the last error.
        Ok(job) if job.is_empty() && !stop() => {
            messages.debug("there is nothing to print: the job has no bytes");
            return Exit::Cancel;
        }
        Ok(job) if job.len() as u64 > LARGEST => {
            messages.error("the job is larger than 1 GB; print fewer pages at once");
            return Exit::Cancel;
        }
        Ok(job) => job,
        Err(error) => {
            messages.error(&format!("cannot read the job: {error}"));
            return Exit::Failed;
        }
    };
    let places = sheets(&bytes);
    let (exit, whole) =
        deliver(call, printers, &Row { bytes, places }, messages, stop, &|| is_given_up(call));
    if whole {
        // Sent whole: should somebody want it again, it is another print.
        forget(call, messages);
    }
    exit
}

/// Forgets what is known of a job whose end is on record elsewhere.
pub fn forget(call: &Call, messages: &dyn Report) {
    forget_folder(&call.journal.join(&call.identity), messages);
}

fn forget_folder(folder: &Path, messages: &dyn Report) {
    if let Err(error) = fs::remove_dir_all(folder)
        && error.kind() != io::ErrorKind::NotFound
    {
        // The sheets are sent all the same; that they stay on record costs a reprint of this very job.
        messages.debug(&format!("cannot remove {}: {error}", folder.display()));
    }
}

/// Whether a sheet of a job may be open at the bridge: it was begun there, and its end is not on record.
pub fn is_open(to: &Destination, job: &Path) -> bool {
    let open = |sheet: PathBuf| {
        let entries = Journal::at(&sheet).and_then(|journal| journal.entries()).unwrap_or_default();
        entries.iter().any(|entry| !matches!(entry.record.phase, Phase::Queued | Phase::Ended(_)))
    };
    matches!(to, Destination::Bridge(_)) && folders(job).any(open)
}

/// The folders of a job's sheets.
fn folders(job: &Path) -> impl Iterator<Item = PathBuf> {
    let found = fs::read_dir(job).into_iter().flatten().filter_map(|item| Some(item.ok()?.path()));
    found.filter(|path| path.is_dir())
}

/// Prints sheets, one after the other, as they are made; says whether all of them were sent. What is known of
/// them stays until [`forget`], so that it outlives whoever keeps the job. `given_up` says whether a job that
/// was stopped is not to go on later.
pub fn deliver(
    call: &Call,
    printers: &Printers,
    sheets: &dyn Sheets,
    messages: &dyn Report,
    stop: &(dyn Fn() -> bool + Sync),
    given_up: &dyn Fn() -> bool,
) -> (Exit, bool) {
    let system = System::new(messages, stop, call.in_class);
    let delivery = Delivery::new(printers, &system);
    match (Backend { call, messages, system: &system, delivery: &delivery, given_up }).deliver(sheets) {
        Ok(whole) => {
            messages.reasons(&[]);
            (Exit::Ok, whole)
        }
        Err(Stopped(exit)) => (exit, false),
    }
}

fn read(call: &Call, input: &mut dyn Read) -> io::Result<Vec<u8>> {
    let mut job = Vec::new();
    match &call.file {
        Some(path) => File::open(path)?.take(LARGEST + 1).read_to_end(&mut job)?,
        None => input.take(LARGEST + 1).read_to_end(&mut job)?,
    };
    Ok(job)
}

/// Whether the print system has given the job up for good: it lists its jobs, but not this one. When it ends
/// itself, it stops jobs in the same way, but then it lists none.
fn is_given_up(call: &Call) -> bool {
    let (queue, job) = &call.listed;
    let mut command = Command::new(&call.lister);
    command.args(["-W", "not-completed", "-o", queue]).stdout(Stdio::piped());
    let Ok(mut process) = Process::start(&mut command, ANSWER) else { return false };
    let mut list = String::new();
    let read = process.output().map(|output| output.take(LONGEST_LIST).read_to_string(&mut list));
    matches!(read, Some(Ok(_)))
        && process.end(|| false).is_ok()
        && !list.lines().any(|line| line.split_whitespace().next() == Some(job))
}

impl Backend<'_> {
    fn fail(&self, exit: Exit, error: &dyn std::fmt::Display) -> Stopped {
        self.messages.error(&error.to_string());
        Stopped(exit)
    }

    fn bytes<'s>(&self, sheets: &'s dyn Sheets, index: usize) -> Result<Option<Cow<'s, [u8]>>, Stopped> {
        sheets
            .sheet(index)
            .map_err(|error| self.fail(Exit::Failed, &format!("cannot read sheet {}: {error}", index + 1)))
    }

    /// Judges a sheet, from 0.
    fn check(&self, bytes: &[u8], index: usize) -> Result<Checked, Stopped> {
        encodings::check(bytes, &Silent).map_err(|error| {
            self.fail(Exit::Cancel, &format!("sheet {}: {}", index + 1, observe::with_causes(&error)))
        })
    }

    fn deliver(&self, sheets: &dyn Sheets) -> Result<bool, Stopped> {
        let folder = self.call.journal.join(&self.call.identity);
        // What an earlier process has begun of a job that is stopped is ended, and nothing more is begun.
        let ends = self.system.stops();
        if ends && !is_open(&self.call.to, &folder) {
            return Ok(false);
        }
        // All that are made are judged before the first byte leaves.
        let mut checked = Vec::new();
        for index in 0..sheets.count() {
            if let Some(bytes) = self.bytes(sheets, index)? {
                checked.push(self.check(&bytes, index)?);
            }
        }
        if let (Destination::Bridge(address), false) = (&self.call.to, ends) {
            self.end_what_was_left(address, &folder)?;
        }
        let (mut number, mut is_foreign) = (0, false);
        for _ in 0..self.call.copies {
            for index in 0.. {
                let Some(bytes) = self.bytes(sheets, index)? else { break };
                if index == checked.len() {
                    checked.push(self.check(&bytes, index)?);
                }
                if checked[index].dialect.is_some() && !std::mem::replace(&mut is_foreign, true) {
                    self.messages.info("the job is in another driver's dialect; it is sent unchanged");
                }
                number += 1;
                let own = folder.join(format!("{number:04}"));
                let goes = if ends { own.is_dir() } else { !self.system.stops() };
                let sent = goes && self.sheet(&bytes, &checked[index], &own, number)?;
                if !sent {
                    // Of a job without a printed sheet there is nothing to remember: if it is started again,
                    // it begins anew.
                    // One that was only stopped goes on after its printed sheets.
                    if self.has_ended(&own) && (number == 1 || (self.given_up)()) {
                        forget_folder(&folder, self.messages);
                    }
                    return Ok(false);
                }
                self.messages.page(number);
            }
        }
        Ok(true)
    }

    /// Sends one sheet, unless it is sent already. False when it was ended early.
    fn sheet(&self, bytes: &[u8], checked: &Checked, folder: &Path, number: usize) -> Result<bool, Stopped> {
        let content = Content::Bytes(bytes);
        let job = Job { name: &self.call.title, content, checked };
        // Whoever releases a job that was held agrees to what it was held for.
        self.system.released(fs::remove_file(folder.join(HELD)).is_ok());
        match &self.call.to {
            Destination::Bridge(address) => self.to_bridge(job, address, folder),
            Destination::Raw(device) => self.to_device(job, device, folder),
            Destination::File(to) => self.to_file(bytes, to, number),
        }
    }

    fn to_bridge(&self, job: Job<'_>, address: &Address, folder: &Path) -> Result<bool, Stopped> {
        let failed = |failure: Failure| self.failed(failure, folder);
        // Nobody kills a server of its own while it waits.
        self.system.is_patient(self.call.awaits_sheets);
        let journal = Journal::at(folder).map_err(|error| failed(error.into()))?;
        let known = journal.entries().map_err(|error| failed(error.into()))?.pop();
        let sent = match known {
            Some(Entry { record, .. }) if record.phase == Phase::Ended(Outcome::Printed) => return Ok(true),
            Some(Entry { record, .. }) if !matches!(record.phase, Phase::Ended(_)) => {
                if !self.system.stops() {
                    self.messages.info("the job was interrupted; it continues where the printer is");
                }
                journal.open(record.job).map_err(Failure::from)
            }
            // Whoever started a job again whose sheet had ended badly wants another one.
            _ => {
                let packed = Packed::new(job, &Silent);
                self.delivery.queue(&journal, &packed, address)
            }
        }
        .and_then(|queued: OpenJob| self.delivery.send(&journal, queued, address, false, false));
        match sent {
            Ok(ended) => {
                let sent = self.judge(&ended, folder)?;
                if sent && self.call.awaits_sheets {
                    self.await_sheet(ended.entry.record.job, address);
                }
                Ok(sent)
            }
            Err(Failure::Left) => Ok(false),
            Err(_) if self.system.stops() => Ok(false),
            Err(failure) => Err(failed(failure)),
        }
    }

    /// Keeps a sheet as a file in a folder. Its name says which it is, so a sheet that is there is not
    /// written again.
    fn to_file(&self, bytes: &[u8], to: &Path, number: usize) -> Result<bool, Stopped> {
        let path = to.join(format!("{}-{number:04}.rgl", self.call.identity));
        let kept = || {
            durable::make_folder(to, Access::Everyone)?;
            if path.exists() { Ok(()) } else { durable::write(&path, bytes, Access::Private) }
        };
        match kept() {
            Ok(()) => Ok(true),
            Err(error) => {
                self.lacks_space(&error);
                Err(self.fail(Exit::Stop, &format!("cannot write {}: {error}", path.display())))
            }
        }
    }

    /// Waits until the printer says that the sheet is out, and tells what it complains of meanwhile.
    fn await_sheet(&self, job: u32, address: &Address) {
        self.messages.info("sent; the printer prints the sheet");
        let mut watch = |troubles: &[String]| match troubles {
            [] => self.messages.reasons(&[]),
            troubles => {
                self.messages.reasons(&[Reason::Other]);
                self.messages.info(&troubles.join("; "));
            }
        };
        match self.delivery.await_sheet(job, address, &mut watch) {
            Sheet::Out => self.messages.info("the sheet is out"),
            Sheet::Unknown(why) => self.messages.info(&format!("sent; {why}")),
        }
    }

    /// Sends a sheet to a device that tells nothing. Beside it stands whether it was begun and whether it was
    /// sent.
    fn to_device(&self, job: Job<'_>, device: &Path, folder: &Path) -> Result<bool, Stopped> {
        let (begun, done) = (folder.join("begun"), folder.join("done"));
        if done.exists() {
            return Ok(true);
        }
        if begun.exists() && !self.system.agreed() {
            let printer = Printer::Device(device.to_path_buf());
            return Err(self.hold(
                folder,
                &format!("the job was interrupted, and {printer} does not tell what it has printed"),
                SWITCH,
            ));
        }
        let names: Vec<&str> = job.checked.inks.iter().map(|ink| ink.name()).collect();
        self.messages.info(&format!("cartridges needed, in this order: {}", names.join(", ")));
        self.system.notes_its_begin_in(&begun);
        let sent = self.delivery.send_raw(job, device);
        let cannot = |error: io::Error| {
            self.lacks_space(&error);
            let folder = folder.display();
            self.fail(Exit::Stop, &format!("cannot keep the job's record in {folder}: {error}"))
        };
        if let Some(error) = self.system.could_not_note() {
            return Err(cannot(error));
        }
        match sent {
            Ok(true) => {
                system::put(&done).map_err(cannot)?;
                Ok(true)
            }
            Ok(false) => {
                self.messages.info(
                    "cancelled; the sheet comes out unfinished and the printer is ready for the next job",
                );
                let _ = fs::remove_file(&begun);
                Ok(false)
            }
            Err(_) if self.system.stops() => Ok(false),
            Err(failure) => Err(self.failed(failure, folder)),
        }
    }

    /// Tells that the disk is full, if that is why something failed.
    fn lacks_space(&self, error: &(dyn std::error::Error + 'static)) {
        if is_full(error) {
            self.messages.reasons(&[Reason::SpoolAreaFull]);
        }
    }

    /// What the print system is to do about a failure.
    fn failed(&self, failure: Failure, folder: &Path) -> Stopped {
        let text = observe::with_causes(&failure);
        self.lacks_space(&failure);
        match failure {
            failure
                if self.call.in_class && (failure.may_pass() || matches!(failure, Failure::ResetOwed(_))) =>
            {
                self.fail(Exit::Failed, &text)
            }
            Failure::ResetOwed(owed) => {
                let what = if matches!(owed.printer, Printer::Device(_)) { SWITCH } else { RESET };
                self.hold(folder, &text, what)
            }
            Failure::Raw(RawError::Write { .. }) => self.hold(folder, &text, SWITCH),
            Failure::NotAlps(_) => self.fail(
                Exit::Stop,
                &format!("not sent: {text}. Connect the right one, then start the queue again (cupsenable)"),
            ),
            _ => self.fail(Exit::Stop, &text),
        }
    }

    /// Holds the job, and notes that it was, so that a release is known for one.
    fn hold(&self, folder: &Path, why: &str, what: &str) -> Stopped {
        if let Err(error) = system::put(&folder.join(HELD)) {
            // Then it is held again when it is released; `foilpress bridge reset` helps.
            self.messages.debug(&format!("cannot write in {}: {error}", folder.display()));
        }
        self.fail(Exit::Hold, &format!("{why}. The job is held: {what}, or cancel it"))
    }

    /// What the print system is to do about a sheet that ended so.
    fn judge(&self, ended: &Ended, folder: &Path) -> Result<bool, Stopped> {
        let text = ended.in_words();
        match ended.outcome {
            Outcome::Printed => {
                self.messages.info(&text);
                Ok(true)
            }
            Outcome::Cancelled if self.system.stops() => {
                self.messages.reasons(&[]);
                self.messages.info(&text);
                Ok(false)
            }
            // By somebody at the bridge, or by another process.
            Outcome::Cancelled | Outcome::Broken | Outcome::Stored => Err(self.fail(Exit::Cancel, &text)),
            Outcome::Lost => Err(self.hold(folder, &text, "release it to print this sheet again")),
            Outcome::Forgotten => Err(self.hold(folder, &text, RESET)),
        }
    }

    /// Ends at the bridge what other jobs of this queue have left open there, and forgets old records.
    fn end_what_was_left(&self, address: &Address, own: &Path) -> Result<(), Stopped> {
        let Ok(listing) = fs::read_dir(&self.call.journal) else { return Ok(()) };
        for job in listing.filter_map(|item| Some(item.ok()?.path())).filter(|path| path != own) {
            let mut open = false;
            for folder in folders(&job) {
                open |= !self.end_sheet(address, &folder)?;
            }
            let age =
                fs::metadata(&job).and_then(|data| data.modified()).ok().and_then(|time| time.elapsed().ok());
            if !open && age.is_some_and(|age| age > FORGET) {
                forget_folder(&job, self.messages);
            }
        }
        Ok(())
    }

    /// Ends the jobs of one sheet's journal; whether all have ended.
    fn end_sheet(&self, address: &Address, folder: &Path) -> Result<bool, Stopped> {
        let Ok(journal) = Journal::at(folder) else { return Ok(true) };
        let mut all = true;
        for entry in journal.entries().unwrap_or_default() {
            if matches!(entry.record.phase, Phase::Ended(_)) {
                continue;
            }
            // Locked, damaged, or left where the queue led before: not ours to end.
            let (true, Ok(left)) = (entry.to == address.to_string(), journal.open(entry.record.job)) else {
                all = false;
                continue;
            };
            self.messages.debug(&format!("ending job {:08x}, which was left open", entry.record.job));
            match self.delivery.send(&journal, left, address, false, true) {
                Ok(_) => {}
                Err(Failure::Left | Failure::Session(SessionError::OtherBridge { .. })) => all = false,
                Err(_) if self.system.stops() => all = false,
                Err(failure) => return Err(self.failed(failure, folder)),
            }
        }
        Ok(all)
    }

    /// Whether nothing of a sheet can still be at a bridge or in a printer.
    fn has_ended(&self, folder: &Path) -> bool {
        let ended = |journal: Journal| {
            let entries = journal.entries().ok()?;
            Some(entries.iter().all(|entry| entry.record.phase == Phase::Ended(Outcome::Cancelled)))
        };
        !folder.join("begun").exists()
            && (!folder.exists() || Journal::at(folder).ok().and_then(ended).unwrap_or(false))
    }
}

/// Name of the file in a sheet's folder that says that its job was held.
const HELD: &str = "held";
/// What is to be done about a printer at a bridge.
const RESET: &str = "release it to reset the printer through the bridge and print this sheet";
/// What is to be done about a printer at a device that tells nothing.
const SWITCH: &str = "switch the printer off and on, then release the job to print this sheet";
