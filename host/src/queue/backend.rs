//! The backend: what the print system starts to bring a job to the printer.
//!
//! Problem: the print system starts jobs again after a crash of its own, retries what failed, and knows nothing of
//! ribbons; a sheet must not be printed twice, and a job that is cancelled must leave a printer that is ready.
//! Method: a job's sheets go one after the other through a [session](crate::send::session). Each has a journal of its own
//! under the job's identity, so a process that takes over knows what was printed and goes on where the printer is. A
//! sheet that was lost is printed again only when somebody releases the job. SIGTERM ends the sheet at the bridge.
//! What an earlier job has left open at the bridge is ended first.
//! Limits: a raw device tells nothing, so a job that was interrupted there is held. Waits without limit for the bridge
//! and the operator, unless the queue belongs to a class, where another printer may do it.
//! Source: backend(7).

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use protocol::ink::Ink;
use protocol::link::message::{Ask, JobKind};
use protocol::status;

use super::messages::{Messages, Reason};
use super::uri;
use crate::inspect::sheets;
use crate::observe::Silent;
use crate::send::journal::{Entry, Journal, JournalError, NewJob, OpenJob};
use crate::send::query::{Query, Reply};
use crate::send::raw::{self, RawError};
use crate::send::session::{Outcome, Phase, Record, Session, SessionError};
use crate::send::status::Status;
use crate::send::{self, Address, Checked, Destination, Event, OpenError, RunError, Wish, words};

/// The most bytes of a job: dozens of pages.
const LARGEST: u64 = 1 << 30;
/// Between two attempts to reach the bridge.
const RETRY: Duration = Duration::from_secs(2);
/// How long a cancelled job may take to come to its end; the print system kills after 30 s.
const LAST_WORDS: Duration = Duration::from_secs(20);
/// How long the bridge and the printer may take to answer a question.
const PATIENCE: Duration = Duration::from_secs(3);
/// Records of jobs that ended without success are forgotten after this.
const FORGET: Duration = Duration::from_secs(30 * 24 * 3600);

/// What the print system is to do next. The numbers are its own.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Exit {
    /// The job is printed.
    Ok = 0,
    /// It failed; the queue's own policy decides.
    Failed = 1,
    /// It is held until somebody releases it.
    Hold = 3,
    /// The queue stops until the administrator has acted.
    Stop = 4,
    /// The job makes no sense and is cancelled.
    Cancel = 5,
}

/// A call of the print system: `URI job user title copies options [file]`.
#[derive(Clone, Debug)]
pub struct Call {
    /// What the user calls the job.
    pub title: String,
    /// The job's identity, the same when it is started again.
    pub identity: String,
    /// How often it is printed; 1 when filters have seen to it.
    pub copies: u32,
    /// The file; standard input without one.
    pub file: Option<PathBuf>,
    /// Where the queue leads.
    pub to: Destination,
    /// Folder for what has to outlive the process.
    pub journal: PathBuf,
    /// Whether another printer of a class may do the job.
    pub in_class: bool,
}

/// Why a call cannot be understood.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// Too few or too many arguments.
    #[error(
        "expected job-id user title copies options [file], found {0} arguments; this is for the print system to call"
    )]
    Arguments(usize),
    /// No URI.
    #[error("DEVICE_URI is not set; this is for the print system to call")]
    NoUri,
    /// No destination.
    #[error(transparent)]
    Uri(#[from] uri::UriError),
    /// No folder for the journal.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// A name that is safe as one of a file.
fn file_name(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').take(64).collect()
}

impl Call {
    /// Reads a call from its arguments (without the program's name) and the environment.
    pub fn read(arguments: &[OsString], var: &dyn Fn(&str) -> Option<OsString>) -> Result<Call, CallError> {
        let (job, title, copies, options, file) = match arguments {
            [job, _user, title, copies, options] => (job, title, copies, options, None),
            [job, _user, title, copies, options, file] => {
                (job, title, copies, options, Some(PathBuf::from(file)))
            }
            other => return Err(CallError::Arguments(other.len())),
        };
        let text = |name: &str| var(name).map(|value| value.to_string_lossy().into_owned());
        let to = uri::parse(&text("DEVICE_URI").ok_or(CallError::NoUri)?)?;
        let options = super::options::parse(&options.to_string_lossy());
        let uuid = options.iter().find(|(name, _)| name == "job-uuid").map(|(_, value)| value.as_str());
        // Without an identity of its own the job's number and title have to do.
        let identity = match uuid.map(|uuid| file_name(uuid.strip_prefix("urn:uuid:").unwrap_or(uuid))) {
            Some(uuid) if !uuid.is_empty() => uuid,
            _ => format!("job-{}-{}", file_name(&job.to_string_lossy()), file_name(&title.to_string_lossy())),
        };
        let queue = file_name(&text("PRINTER").unwrap_or_default());
        let folder = match (var("FOILPRESS_JOBS"), var("CUPS_CACHEDIR")) {
            (Some(jobs), _) => PathBuf::from(jobs),
            (None, Some(cache)) => Path::new(&cache).join("foilpress"),
            (None, None) => Journal::of_user()?.folder().join("queues"),
        };
        Ok(Call {
            title: title.to_string_lossy().into_owned(),
            identity,
            copies: match file {
                Some(_) => copies.to_string_lossy().parse().unwrap_or(1).clamp(1, 1000),
                None => 1,
            },
            file,
            to,
            journal: folder.join(if queue.is_empty() { "queue" } else { &queue }),
            in_class: var("CLASS").is_some_and(|class| !class.is_empty()),
        })
    }
}

/// The line of a device in the print system's list of them.
pub fn device(address: &str, model: &str, about: &str, id: &str) -> Result<String, uri::UriError> {
    let plain = |text: &str| text.replace(['"', '\n'], " ");
    Ok(format!("direct {} \"{}\" \"{}\" \"{}\"", uri::of(address)?, plain(model), plain(about), plain(id)))
}

/// What is said when no device is there, so that the backend is known to be.
pub const NO_DEVICE: &str = "network foilpress \"Unknown\" \"ALPS MD-5500 through a Foilpress bridge\"";

/// How the backend stops before all is printed.
struct Stopped(Exit);

/// A job on its way.
struct Delivery<'a, W> {
    call: &'a Call,
    messages: &'a Messages<W>,
    /// Whether the print system wants the job ended.
    stop: &'a (dyn Fn() -> bool + Sync),
    stopped: Option<Instant>,
}

/// Prints a job. `input` is standard input; `stop` says whether the print system has asked to end.
pub fn run<W: Write + Send>(
    call: &Call,
    input: &mut dyn Read,
    messages: &Messages<W>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Exit {
    let mut delivery = Delivery { call, messages, stop, stopped: None };
    match delivery.deliver(input) {
        Ok(()) => {
            messages.reasons(&[]);
            Exit::Ok
        }
        Err(Stopped(exit)) => exit,
    }
}

impl<W: Write + Send> Delivery<'_, W> {
    fn fail(&self, exit: Exit, error: &dyn std::fmt::Display) -> Stopped {
        self.messages.error(&error.to_string());
        Stopped(exit)
    }

    fn deliver(&mut self, input: &mut dyn Read) -> Result<(), Stopped> {
        let job = self.read(input)?;
        if (self.stop)() {
            return Ok(());
        }
        let places = sheets(&job);
        // All are judged before the first byte leaves.
        let checked: Vec<Checked> = (1..)
            .zip(&places)
            .map(|(number, place)| {
                send::check(&job[place.clone()], &Silent).map_err(|error| {
                    self.fail(Exit::Cancel, &format!("sheet {number} of {}: {error}", places.len()))
                })
            })
            .collect::<Result<_, _>>()?;
        if checked.iter().any(|sheet| sheet.dialect.is_some()) {
            self.messages.info("the job is in another driver's dialect; it is sent as it is");
        }
        let folder = self.call.journal.join(&self.call.identity);
        self.end_what_was_left(&folder)?;
        let mut number = 0;
        for _ in 0..self.call.copies {
            for (place, checked) in places.iter().zip(&checked) {
                number += 1;
                if (self.stop)() {
                    return Ok(());
                }
                if !self.sheet(&job, place, checked, &folder.join(format!("{number:04}")), number)? {
                    return Ok(());
                }
            }
        }
        // Printed whole: should somebody want it again, it is another print.
        self.forget(&folder);
        Ok(())
    }

    fn read(&self, input: &mut dyn Read) -> Result<Vec<u8>, Stopped> {
        let mut job = Vec::new();
        let read = match &self.call.file {
            Some(path) => File::open(path).and_then(|file| file.take(LARGEST + 1).read_to_end(&mut job)),
            None => input.take(LARGEST + 1).read_to_end(&mut job),
        };
        match read {
            Ok(_) if job.is_empty() && !(self.stop)() => {
                Err(self.fail(Exit::Cancel, &"there is nothing to print: the job has no bytes"))
            }
            Ok(_) if job.len() as u64 > LARGEST => {
                Err(self.fail(Exit::Cancel, &"the job is larger than 1 GB; print fewer pages at once"))
            }
            Ok(_) => Ok(job),
            Err(error) => Err(self.fail(Exit::Failed, &format!("cannot read the job: {error}"))),
        }
    }

    /// Prints one sheet, unless it is already. False when it was ended early.
    fn sheet(
        &mut self,
        job: &[u8],
        place: &Range<usize>,
        checked: &Checked,
        folder: &Path,
        number: usize,
    ) -> Result<bool, Stopped> {
        let data = &job[place.clone()];
        let whole = match &self.call.to {
            Destination::Bridge(address) => self.bridge_prints(data, checked, address, folder)?,
            Destination::Raw(device) => self.device_prints(data, checked, device, folder)?,
            // A URI never leads to a file.
            Destination::File(_) => return Err(self.fail(Exit::Stop, &uri::UriError::File)),
        };
        if whole {
            self.messages.page(number);
        }
        Ok(whole)
    }

    fn bridge_prints(
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
        self.greet(address, checked);
        loop {
            match self.bring(&mut open, address, false)? {
                Brought::Over(outcome) => return self.judge(outcome, &open.entry),
                Brought::NumberTaken => {
                    let record = Record { phase: Phase::Ended(Outcome::Cancelled), ..open.entry.record };
                    open.save(&record).map_err(stop)?;
                    open = self.queue(&journal, data, checked)?;
                }
                Brought::Left => return Ok(false),
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
            let result = send::run_while(
                &mut session,
                &mut || address.open(),
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

    /// Waits a little; false when the print system wants the job ended.
    fn pause(&self) -> bool {
        let start = Instant::now();
        while start.elapsed() < RETRY {
            if (self.stop)() {
                return false;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        true
    }

    /// Asks the printer how it is before a job, where it can be asked. What it answers is told, and stops nothing: the
    /// printer itself asks for what it wants.
    fn greet(&self, address: &Address, checked: &Checked) {
        let Ok(mut link) = address.open() else { return };
        let Ok(mut query) = Query::new(&mut *link, PATIENCE) else { return };
        let Ok(Reply::Bytes(bytes)) = query.printer(Ask::Printer, PATIENCE) else { return };
        let (Ok(status), Ok(answer)) = (Status::read(&bytes), status::Status::parse(&bytes)) else { return };
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
    }

    /// Ends at the bridge what other jobs of this queue have left open there, and forgets old records.
    fn end_what_was_left(&mut self, own: &Path) -> Result<(), Stopped> {
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
                    // Locked or damaged: not ours to end.
                    let (Ok(mut left), Ok(address)) =
                        (journal.open(entry.record.job), entry.to.parse::<Address>())
                    else {
                        open = true;
                        continue;
                    };
                    self.messages.debug(&format!("ending job {:08x}, which was left open", entry.record.job));
                    if matches!(self.bring(&mut left, &address, true)?, Brought::Left) {
                        return Ok(());
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

    fn forget(&self, folder: &Path) {
        if let Err(error) = fs::remove_dir_all(folder)
            && error.kind() != io::ErrorKind::NotFound
        {
            // The sheets are printed all the same; that they stay on record costs a reprint of this very job.
            self.messages.debug(&format!("cannot remove {}: {error}", folder.display()));
        }
    }

    /// A device that tells nothing: what it may have got of an interrupted job is not known.
    fn device_prints(
        &mut self,
        data: &[u8],
        checked: &Checked,
        device: &Path,
        folder: &Path,
    ) -> Result<bool, Stopped> {
        let (begun, done) = (folder.join("begun"), folder.join("done"));
        if done.exists() {
            return Ok(true);
        }
        let mark = |path: &Path| {
            fs::create_dir_all(folder)
                .and_then(|()| File::create(path))
                .and_then(|file| file.sync_all())
                .map_err(|error| {
                    self.fail(
                        Exit::Stop,
                        &format!("cannot keep the job's record in {}: {error}", folder.display()),
                    )
                })
        };
        if begun.exists() {
            // Said once; who releases the job wants the sheet.
            let _ = fs::remove_file(&begun);
            return Err(self.fail(
                Exit::Hold,
                &"the job was interrupted, and this device does not tell what it has printed. Switch the printer off and \
                  on, then release the job to print this sheet again, or cancel it",
            ));
        }
        while let Err(error) = fs::OpenOptions::new().write(true).open(device) {
            match error.kind() {
                io::ErrorKind::PermissionDenied => {
                    return Err(self.fail(
                        Exit::Stop,
                        &format!(
                            "{}: permission denied; the package's udev rule lets the print system in",
                            device.display()
                        ),
                    ));
                }
                _ if self.call.in_class => return Err(self.fail(Exit::Failed, &error)),
                _ => {}
            }
            self.messages.reasons(&[Reason::Connecting, Reason::OffLine]);
            self.messages.info(&format!("{}: {error}; waiting for it", device.display()));
            if !self.pause() {
                return Ok(false);
            }
        }
        mark(&begun)?;
        self.messages.reasons(&[]);
        let names: Vec<&str> = checked.inks.iter().map(|ink| ink.name()).collect();
        self.messages.info(&format!("sending; cassettes in this order: {}", names.join(", ")));
        match raw::send_while(data, device, self.messages, self.stop) {
            Ok(true) => {
                mark(&done)?;
                Ok(true)
            }
            Ok(false) => {
                self.messages.info(
                    "cancelled; the sheet comes out unfinished and the printer is ready for the next job",
                );
                let _ = fs::remove_file(&begun);
                Ok(false)
            }
            Err(error @ RawError::Open { .. }) => {
                let _ = fs::remove_file(&begun);
                Err(self.fail(Exit::Stop, &error))
            }
            Err(error @ RawError::Write { .. }) => {
                let _ = fs::remove_file(&begun);
                Err(self.fail(
                    Exit::Hold,
                    &format!("{error}. The job is held; release it to print this sheet again"),
                ))
            }
        }
    }
}

/// What came of bringing a job to its end.
enum Brought {
    Over(Outcome),
    /// Its number is another job's at the bridge.
    NumberTaken,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::inspect;
    use crate::job::stream::write_job;
    use crate::separate::{Pass, Plane};
    use protocol::paper::Paper;
    use protocol::rgl::Page;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn job(ink: Ink, rows: usize) -> Vec<u8> {
        let paper = Paper::Custom { width: 800, length: 400 };
        let bits: Vec<u8> = (0..100 * rows).map(|i| (i * 37 % 255) as u8 | 1).collect();
        let bits = [bits, vec![0; 100 * (400 - rows)]].concat();
        let pass = Pass { ink, plane: Plane { width: 800, length: 400, stride: 100, bits } };
        let mut bytes = Vec::new();
        write_job(Page::plain(paper), None, &[pass], &mut bytes, &Silent).unwrap();
        bytes
    }

    /// A queue that leads to a device which is a file, so that what it got can be looked at.
    struct Rig {
        folder: tempfile::TempDir,
        call: Call,
    }

    impl Rig {
        fn new() -> Rig {
            let folder = tempfile::tempdir().unwrap();
            let device = folder.path().join("lp0");
            File::create(&device).unwrap();
            let call = Call {
                title: "leaf".into(),
                identity: "one".into(),
                copies: 1,
                file: None,
                to: Destination::Raw(device),
                journal: folder.path().join("jobs"),
                in_class: false,
            };
            Rig { folder, call }
        }

        fn run(&self, job: &[u8], stop: &(dyn Fn() -> bool + Sync)) -> (Exit, String) {
            let mut said = Vec::new();
            let exit = run(&self.call, &mut &*job, &Messages::new(&mut said), stop);
            (exit, String::from_utf8(said).unwrap())
        }

        fn got(&self) -> Vec<u8> {
            fs::read(self.folder.path().join("lp0")).unwrap()
        }
    }

    #[test]
    fn sheets_go_to_a_device_one_after_the_other_and_are_counted() {
        let rig = Rig::new();
        let both = [job(Ink::Cyan, 30), job(Ink::Black, 20)].concat();
        let (exit, said) = rig.run(&both, &|| false);
        assert_eq!(exit, Exit::Ok, "{said}");
        // Each opens the device anew, and a file is then written from its start.
        assert!(rig.got().starts_with(&job(Ink::Black, 20)));
        assert!(said.contains("PAGE: 1 1\n") && said.contains("PAGE: 2 1\n"), "{said}");
        assert_eq!(
            fs::read_dir(&rig.call.journal).unwrap().count(),
            0,
            "nothing is kept of a job that is printed"
        );
    }

    #[test]
    fn a_job_that_was_interrupted_at_a_device_is_held_and_printed_again_only_when_released() {
        let rig = Rig::new();
        let bytes = job(Ink::Cyan, 30);
        let folder = rig.call.journal.join("one/0001");
        fs::create_dir_all(&folder).unwrap();
        File::create(folder.join("begun")).unwrap();
        let (exit, said) = rig.run(&bytes, &|| false);
        assert_eq!(exit, Exit::Hold);
        assert!(said.contains("ERROR: the job was interrupted") && rig.got().is_empty(), "{said}");
        assert_eq!(rig.run(&bytes, &|| false).0, Exit::Ok);
        assert!(rig.got() == bytes);
    }

    #[test]
    fn a_job_cancelled_at_a_device_becomes_a_shorter_whole_job() {
        let rig = Rig::new();
        let bytes = job(Ink::Cyan, 400);
        // Asked before each piece; cancelled after some.
        let asked = AtomicUsize::new(0);
        let (exit, said) = rig.run(&bytes, &|| asked.fetch_add(1, Ordering::SeqCst) > 8);
        assert_eq!(exit, Exit::Ok, "{said}");
        let got = rig.got();
        assert!(!got.is_empty() && got.len() < bytes.len());
        assert!(inspect(&got, &Silent).inspection.complete);
        assert!(!said.contains("PAGE:"), "{said}");
    }

    #[test]
    fn what_is_no_whole_job_is_cancelled_before_the_first_byte() {
        let rig = Rig::new();
        let good = job(Ink::Cyan, 30);
        for wrong in [&[][..], b"Hello", &good[..good.len() - 5], &[&good[..], b"x"].concat()] {
            let (exit, said) = rig.run(wrong, &|| false);
            assert_eq!(exit, Exit::Cancel, "{said}");
            assert!(rig.got().is_empty() && said.contains("ERROR: "), "{said}");
        }
    }

    #[test]
    fn a_device_that_is_not_there_is_waited_for_unless_another_printer_may_do_it() {
        let mut rig = Rig::new();
        rig.call.to = Destination::Raw(rig.folder.path().join("no/such/device"));
        let asked = AtomicUsize::new(0);
        let (exit, said) = rig.run(&job(Ink::Cyan, 3), &|| asked.fetch_add(1, Ordering::SeqCst) > 5);
        assert_eq!(exit, Exit::Ok, "ended by the print system: {said}");
        assert!(said.contains("STATE: +connecting-to-device,offline-report"), "{said}");
        rig.call.in_class = true;
        assert_eq!(rig.run(&job(Ink::Cyan, 3), &|| false).0, Exit::Failed);
    }

    #[test]
    fn a_call_is_read_as_the_print_system_makes_it() {
        let arguments = |list: &[&str]| list.iter().map(OsString::from).collect::<Vec<_>>();
        let environment = |name: &str| -> Option<OsString> {
            Some(match name {
                "DEVICE_URI" => "foilpress:/serial/dev/ttyACM0".into(),
                "PRINTER" => "Alps".into(),
                "CUPS_CACHEDIR" => "/var/cache/cups".into(),
                _ => return None,
            })
        };
        let options = "media=A4 job-uuid=urn:uuid:0f0e-/../x copies=3";
        let call = Call::read(&arguments(&["7", "me", "My title", "3", options, "/spool/d7"]), &environment)
            .unwrap();
        assert_eq!((call.identity.as_str(), call.copies, call.in_class), ("0f0e-x", 3, false));
        assert_eq!(call.journal, Path::new("/var/cache/cups/foilpress/Alps"));
        // On standard input the filters have made the copies.
        let call = Call::read(&arguments(&["7", "me", "../t", "3", ""]), &environment).unwrap();
        assert_eq!((call.identity.as_str(), call.copies), ("job-7-t", 1));
        assert!(matches!(Call::read(&arguments(&["7"]), &environment), Err(CallError::Arguments(1))));
        assert!(matches!(Call::read(&arguments(&["7", "", "", "", ""]), &|_| None), Err(CallError::NoUri)));
    }
}
