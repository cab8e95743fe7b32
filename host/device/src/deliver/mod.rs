//! The one way to a printer, for every command, the print queue, and whatever comes.
//!
//! Problem: a job has to be printed once, as a whole, at a printer that is ready for it, and counted; whoever sends it, and
//! whatever crashes meanwhile. The steps are the same for all senders: [journal](crate::transit::journal), the reset the printer
//! may [need](crate::printers), what the device says it is, pass streams where the bridge makes the same bytes of them,
//! the [session](crate::transit::session), the [`ledger`], waiting for the sheet.
//! Method: a [`Delivery`] does these steps. A [`Caller`] is told what happens, and decides what only a person or a rule can: a
//! terminal asks, a queue holds the job, a script fails. A job passes through three states that are never mixed:
//! *queued* (on disk, [`Delivery::queue`]), *sent* (every byte has crossed the port, [`Delivery::send`]) and *printed* (the
//! printer itself says that it is done, [`Delivery::await_sheet`]).
//! Where the printer stands its bridge knows, and gives it no byte otherwise; the delivery asks the bridge, and its caller where a sheet
//! has to be taken out. A device without a bridge is asked about by [notes](crate::printers).
//! Cost: the bytes of a job are parsed once to [check](crate::encodings::check) that they are one whole legal
//! job, because anything else wastes a sheet. Then [`streams`] codes its planes, which it reads back from
//! bytes that come from elsewhere, and expands the code once, because a bridge must make exactly these bytes.
//! Nothing is parsed again when a job is resumed: its checksum is compared. Only a job that a bridge refuses
//! as pass streams is checked once more, as the ledger needs its passes. Limits: a raw device tells nothing,
//! so nothing can be resumed there. The bridge knows how the last sixteen jobs have ended. Source: `docs/wire-format.md`,
//! section 3; `docs/decisions/journal-before-deed.md`, `docs/decisions/where-the-printer-stands.md`.

mod bridge;
mod raw;
pub mod store;

use std::borrow::Cow;
use std::time::Duration;

use protocol::ink::Ink;
use protocol::link::message::{ALONE, JobKind, LOCAL, Progress};

use crate::connection::transport::Transport;
use crate::connection::{Address, OpenError, find};
use crate::encodings::{Checked, Content, streams};
use crate::ledger::{self, Ledger, PassUse};
use crate::printers::{Note, Printer, Printers, PrintersError};
use crate::questions::cartridges::{self, Found};
use crate::questions::query::{QueryError, Reply};
use crate::questions::status::Status;
use crate::transit::journal::{Entry, Journal, JournalError, NewJob, OpenJob};
use crate::transit::raw::RawError;
use crate::transit::session::{Outcome, SessionError};
use crate::transit::{Event, Wish, words};
use observe::{Observer, with_causes};

pub use bridge::{find_cartridges, give_up, reset};

/// Whoever has something sent: hears what happens, and decides what the delivery cannot.
pub trait Caller {
    /// Something happened.
    fn tell(&self, news: &News<'_>);

    /// Whether to go on. Without agreement nothing is sent, and the delivery fails with what the question was about.
    fn agrees(&self, question: &Question<'_>) -> bool;

    /// Whether to try again after an obstacle that may pass by itself, such as a bridge that is not there. May take its time.
    /// `begun` says whether a bridge already knows the job.
    fn waits(&self, obstacle: &Failure, begun: bool) -> bool {
        let _ = (obstacle, begun);
        false
    }

    /// What the caller wants now; asked again and again.
    fn wish(&self) -> Wish {
        Wish::GoOn
    }

    /// Whether to wait on for a sheet that was sent.
    fn watches(&self) -> bool {
        true
    }

    /// Watches the stages in which a job is prepared.
    fn observer(&self) -> &dyn Observer;

    /// Opens a way to the bridge at this address; with its serial number, wherever it is now.
    fn open(&self, address: &Address, bridge: Option<u64>) -> Result<Box<dyn Transport>, OpenError> {
        find::open(address, bridge)
    }

    /// Waits.
    fn pause(&self, time: Duration) {
        std::thread::sleep(time);
    }
}

/// What happens to a job.
#[derive(Debug)]
pub enum News<'a> {
    /// What the printer said of itself and of the cartridges the job needs, before the job.
    Printer(&'a Cartridges),
    /// The printer was reset.
    Reset,
    /// A job is queued: on disk, and nothing of it printed.
    Queued {
        /// The job.
        entry: &'a Entry,
        /// Bytes that will cross the cable to the bridge.
        data: u64,
    },
    /// A job, new or interrupted, is about to be sent.
    Sending(&'a Entry),
    /// The link, the position, the printer's faults.
    Link(&'a Event<'a>),
    /// The bridge does not take this page as pass streams; the same job follows byte for byte.
    ByteForByte,
    /// A device without a bridge is about to get a job.
    SendingRaw,
    /// Something the user should know.
    Note(&'a str),
}

/// What only the caller can decide.
#[derive(Debug)]
pub enum Question<'a> {
    /// May the printer be reset, since it may hold part of another job?
    Reset(&'a ResetOwed),
    /// May the job go to a device that does not identify itself as an ALPS printer?
    NotAlps {
        /// Its device ID.
        id: &'a str,
    },
}

/// A printer that may hold part of a job.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ResetOwed {
    /// The printer.
    pub printer: Printer,
    /// The job's number, if it is at a bridge.
    pub job: u32,
}

impl std::fmt::Display for ResetOwed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ResetOwed { printer, job } = self;
        let part = match (printer, *job) {
            (Printer::Device(_), _) => {
                return write!(
                    f,
                    "{printer} may hold part of an interrupted job, and would print anything else as text until it has been \
                     switched off and on"
                );
            }
            (_, ALONE) => "a job that its button has started".into(),
            (_, LOCAL) => "a job that was printed without this program".into(),
            (_, job) => format!("job {job:08x}"),
        };
        write!(
            f,
            "{printer} may hold part of {part}, of which it will not get the rest. Take the sheet out; the bridge resets the printer \
             before anything else goes to it"
        )
    }
}

/// Why a delivery stopped. Unless a sheet is named as lost, none is.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The bridge's port cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// What answers is no bridge, or nothing answers.
    #[error("{0}")]
    NoAnswer(String),
    /// A question to the bridge got no answer.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// The conversation cannot go on.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The journal cannot be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// What is known of printers cannot be read or written.
    #[error(transparent)]
    Printers(#[from] PrintersError),
    /// The caller did not agree to a reset.
    #[error("{0}")]
    ResetOwed(ResetOwed),
    /// A reset through the bridge would not reach the printer.
    #[error("the printer is switched off or its cable is loose, so it cannot be reset; switch it on")]
    PrinterOff,
    /// The caller did not agree to send to this device.
    #[error("the device does not identify itself as an ALPS printer: {0}")]
    NotAlps(String),
    /// A device without a bridge failed.
    #[error(transparent)]
    Raw(#[from] RawError),
    /// The bridge has no flash for jobs.
    #[error("this bridge cannot store jobs; send the job without --store")]
    NoStore,
    /// The job is too large for what is free.
    #[error(
        "the job needs {needs} bytes in the bridge, which has room for {room} of {total}; {}",
        if *needs > *total as usize { "send it without --store" } else { "`foilpress bridge jobs` lists the jobs there, and deletes them" }
    )]
    NoRoom {
        /// Bytes of its data.
        needs: usize,
        /// Bytes that are free.
        room: u32,
        /// Bytes there are.
        total: u32,
    },
    /// The job did not arrive as a whole.
    #[error("the job is not stored: {}; store it again", match .0 {
        Outcome::Cancelled => "somebody has cancelled it, nothing of it came for 30 s, or the bridge has restarted",
        Outcome::Broken => "the bridge's flash does not keep what is written; such a board is worn out",
        _ => "the bridge has restarted or lost its supply",
    })]
    NotStored(Outcome),
    /// The caller stopped waiting.
    #[error("stopped before the job ended")]
    Left,
}

impl Failure {
    /// Whether it may pass by itself: what is away may come back, and what is in use is free again one day.
    pub fn may_pass(&self) -> bool {
        match self {
            Failure::Open(error) => {
                !matches!(error, OpenError::Forbidden(_) | OpenError::Several(_) | OpenError::Twins(_))
            }
            Failure::Query(error) => {
                matches!(error, QueryError::Link(_) | QueryError::NoAnswer | QueryError::JobOpen(_))
            }
            Failure::Session(error) => matches!(error, SessionError::Busy(_) | SessionError::Storing(_)),
            Failure::Raw(RawError::Open { source, .. }) => {
                source.kind() != std::io::ErrorKind::PermissionDenied
            }
            Failure::NoAnswer(_) | Failure::PrinterOff => true,
            _ => false,
        }
    }

    /// Whether somebody else is using the bridge, rather than the bridge being away.
    pub fn is_in_use(&self) -> bool {
        matches!(
            self,
            Failure::Open(OpenError::InUse(_))
                | Failure::Session(SessionError::Busy(_) | SessionError::Storing(_))
                | Failure::Query(QueryError::JobOpen(_))
        )
    }
}

/// What the printer says of the cartridges a job needs.
#[derive(Debug)]
pub enum Cartridges {
    /// Its status answer, and what that means for the job.
    Known {
        /// The bytes of the answer, for whoever wants other facts of it.
        answer: Vec<u8>,
        /// The answer in words.
        status: Status,
        /// The cartridges.
        found: Found,
    },
    /// It cannot be asked, for this reason.
    Unknown(String),
}

impl Cartridges {
    /// Reads an answer, with the inks of the job.
    fn read(reply: Reply, inks: &[Ink]) -> Cartridges {
        match reply {
            Reply::NotNow => Cartridges::Unknown("the bridge is busy with the printer".into()),
            Reply::OneWay => Cartridges::Unknown("the printer's port is one-way".into()),
            Reply::Silent => Cartridges::Unknown("the printer did not answer".into()),
            Reply::Unsure => Cartridges::Unknown(
                "the bridge does not know whether the printer is inside a job, where a question would be printed".into(),
            ),
            Reply::NotAsked => Cartridges::Unknown("the printer was not asked".into()),
            Reply::Stopped(fault) => Cartridges::Unknown(words::fault(fault, None)),
            Reply::Bytes(answer) => match Status::read(&answer) {
                Err(error) => Cartridges::Unknown(with_causes(&error)),
                Ok(status) => {
                    let found = cartridges::find(&status, inks);
                    Cartridges::Known { answer, status, found }
                }
            },
        }
    }
}

/// A job that was checked.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// What people call it.
    pub name: &'a str,
    /// What is sent.
    pub content: Content<'a>,
    /// What the [check](crate::encodings::check) found.
    pub checked: &'a Checked,
}

/// A job in the form in which it crosses the cable: pass streams where a bridge makes exactly its bytes of them.
pub struct Packed<'a> {
    job: Job<'a>,
    kind: JobKind,
    data: Cow<'a, [u8]>,
}

impl<'a> Packed<'a> {
    /// Codes the job, if that gains anything.
    pub fn new(job: Job<'a>, observer: &dyn Observer) -> Packed<'a> {
        let (content, bytes) = (job.content, job.content.bytes());
        match streams::of(content, observer).filter(|streams| streams.len() < bytes.len()) {
            Some(streams) => Packed { job, kind: JobKind::Streams, data: streams.into() },
            None => Packed::raw(job),
        }
    }

    /// The job byte for byte.
    pub fn raw(job: Job<'a>) -> Packed<'a> {
        Packed { job, kind: JobKind::Raw, data: job.content.bytes().into() }
    }

    /// What people call it.
    pub fn name(&self) -> &str {
        self.job.name
    }

    /// The kind of its data.
    pub fn kind(&self) -> JobKind {
        self.kind
    }

    /// The data that cross the cable.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The same under another name, such as that of a copy.
    pub fn named<'b>(&'b self, name: &'b str) -> Packed<'b> {
        Packed { job: Job { name, ..self.job }, kind: self.kind, data: Cow::Borrowed(&self.data) }
    }
}

/// How a job at a bridge ended.
#[derive(Debug)]
pub struct Ended {
    /// The job as the journal has it. Another number than was sent, if the bridge took it only byte for byte.
    pub entry: Entry,
    /// How it ended.
    pub outcome: Outcome,
    /// What the bridge last said of it.
    pub progress: Option<Progress>,
}

impl Ended {
    /// The same in a sentence that says what to do next.
    pub fn in_words(&self) -> String {
        words::outcome(self.outcome, &self.entry, self.progress.as_ref())
    }
}

/// The way to a printer.
pub struct Delivery<'a> {
    printers: &'a Printers,
    ledger: Ledger,
    caller: &'a dyn Caller,
}

impl<'a> Delivery<'a> {
    /// A way for this caller.
    pub fn new(printers: &'a Printers, caller: &'a dyn Caller) -> Delivery<'a> {
        Delivery { printers, ledger: Ledger::of(printers), caller }
    }

    /// Queues a job for the bridge at `to` under a new number. When this returns it is on disk, and nothing of it is printed.
    pub fn queue(&self, journal: &Journal, packed: &Packed<'_>, to: &Address) -> Result<OpenJob, Failure> {
        let Packed { job, kind, data } = packed;
        let queued = journal.queue(NewJob {
            name: job.name,
            to: to.to_string(),
            kind: *kind,
            data,
            port_bytes: job.content.bytes().len() as u64,
            passes: job.checked.passes.clone(),
        })?;
        self.count(&number(&queued.entry), job.checked, job.content.bytes().len() as u64);
        self.caller.tell(&News::Queued { entry: &queued.entry, data: data.len() as u64 });
        Ok(queued)
    }

    /// Notes in the ledger that a job is about to be sent.
    fn count(&self, job: &str, checked: &Checked, length: u64) {
        let ends = checked.passes.iter().skip(1).map(|pass| pass.offset).chain([length]);
        let passes = checked
            .passes
            .iter()
            .zip(ends)
            .zip(&checked.ribbon_mm)
            .filter_map(|((pass, end), &ribbon_mm)| {
                let ink = Ink::from_code(pass.ink)?.name().into();
                Some(PassUse { ink, begin: pass.offset, end, ribbon_mm })
            })
            .collect();
        self.note_in_ledger(ledger::Event::Job { job: job.into(), passes });
    }

    /// Notes in the ledger how much of a job was printed.
    fn counted(&self, job: &str, bytes: u64, whole: bool) {
        self.note_in_ledger(ledger::Event::Printed { job: job.into(), bytes, whole });
    }

    /// Without a ledger a job is printed all the same, and that it is not counted is told.
    fn note_in_ledger(&self, event: ledger::Event) {
        if let Err(error) = self.ledger.append(event) {
            self.note(&format!("{}; this job is not counted there", with_causes(&error)));
        }
    }

    /// The printer holds nothing of this job any more. If that cannot be written down, somebody is asked a needless question.
    fn close(&self, note: Note) {
        if let Err(error) = self.printers.close(&[note]) {
            self.note(&with_causes(&error));
        }
    }

    fn note(&self, text: &str) {
        self.caller.tell(&News::Note(text));
    }
}

/// A job's number as people see it.
fn number(entry: &Entry) -> String {
    format!("{:08x}", entry.record.job)
}
