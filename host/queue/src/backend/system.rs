//! The print system as the caller of a delivery: what it is told, and its rules where a terminal would ask.
//!
//! Waits without limit for the bridge and the operator, unless the queue belongs to a class and another printer may do the job.

use std::cell::{Cell, RefCell};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use protocol::status;

use crate::messages::{Reason, Report};
use device::deliver::{Caller, Cartridges, Failure, News, Question};
use device::encodings::PassPlace;
use device::questions::cartridges::Found;
use device::transit::{Event, Wish, words};
use files::durable::{self, Access};
use observe::Observer;

/// How long a cancelled job may take to come to its end; the print system kills after 30 s.
const LAST_WORDS: Duration = Duration::from_secs(20);
/// Between two attempts to reach the printer.
const RETRY: Duration = Duration::from_secs(2);

/// The caller of a delivery for a print queue.
pub(super) struct System<'a> {
    messages: &'a dyn Report,
    /// Whether the print system wants the job ended, and since when this is known.
    stop: &'a (dyn Fn() -> bool + Sync),
    stopped: Cell<Option<Instant>>,
    in_class: bool,
    /// Whether a sheet that was begun is waited for until it has ended, also once the job is to end.
    patient: Cell<bool>,
    /// Whether somebody has released the job after it was held.
    released: Cell<bool>,
    /// Where it is to be noted that a device gets the first byte, and why that could not be done.
    begun: RefCell<Option<PathBuf>>,
    not_noted: RefCell<Option<io::Error>>,
    job: RefCell<Position>,
}

/// What is told of a job under way.
#[derive(Default)]
struct Position {
    passes: Vec<PassPlace>,
    total: u64,
    pass: usize,
    printed: u64,
    faulty: bool,
}

impl<'a> System<'a> {
    pub(super) fn new(
        messages: &'a dyn Report,
        stop: &'a (dyn Fn() -> bool + Sync),
        in_class: bool,
    ) -> System<'a> {
        System {
            messages,
            stop,
            stopped: Cell::new(None),
            in_class,
            patient: Cell::new(false),
            released: Cell::new(false),
            begun: RefCell::default(),
            not_noted: RefCell::default(),
            job: RefCell::default(),
        }
    }

    /// Whether the print system wants the job ended.
    pub(super) fn stops(&self) -> bool {
        (self.stop)()
    }

    /// Whether the sheet that follows is waited for until it has ended, if it has begun.
    pub(super) fn is_patient(&self, patient: bool) {
        self.patient.set(patient);
    }

    /// Whether the sheet that follows belongs to a job somebody has released.
    pub(super) fn released(&self, released: bool) {
        self.released.set(released);
    }

    /// Whether somebody has agreed to what the job was held for.
    pub(super) fn agreed(&self) -> bool {
        self.released.get()
    }

    /// From now on the first byte for a device is noted here before it leaves.
    pub(super) fn notes_its_begin_in(&self, path: &Path) {
        *self.begun.borrow_mut() = Some(path.to_path_buf());
    }

    /// Why that could not be noted. Nothing left then.
    pub(super) fn could_not_note(&self) -> Option<io::Error> {
        self.not_noted.take()
    }

    /// Waits a little; false when the print system wants the job ended.
    fn pause(&self) -> bool {
        let start = Instant::now();
        while start.elapsed() < RETRY {
            if self.stops() {
                return false;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        true
    }

    /// How the printer is before a job. What it complains of is told, and stops nothing: the printer itself asks for what it
    /// wants.
    fn printer(&self, cartridges: &Cartridges) {
        let Cartridges::Known { answer, status, found } = cartridges else { return };
        self.messages.cartridges(status);
        let mut reasons: Vec<Reason> = match status::Status::parse(answer) {
            Ok(answer) => answer.complaints().map(|complaint| Reason::of_complaint(&complaint)).collect(),
            Err(status::NotAStatus) => Vec::new(),
        };
        status.errors.iter().for_each(|error| self.messages.info(error));
        if let Found::Missing(missing) = found {
            reasons.push(Reason::SupplyMissing);
            let list: Vec<String> = missing.iter().map(ToString::to_string).collect();
            self.messages.info(&format!(
                "not loaded: {}; the printer pauses before that pass and continues once the cartridge is loaded",
                list.join(", ")
            ));
        }
        self.messages.reasons(&reasons);
    }

    fn link(&self, event: &Event<'_>) {
        let (mut job, messages) = (self.job.borrow_mut(), self.messages);
        match event {
            Event::Connected(bridge) => {
                messages.debug(&format!("bridge {:016x}, firmware {}", bridge.serial, bridge.firmware));
                messages.lift(&[Reason::Connecting, Reason::OffLine]);
            }
            Event::Away(why) => {
                messages.reasons(&[Reason::Connecting, Reason::OffLine]);
                messages.info(&format!(
                    "the link to the bridge is gone ({why}); the bridge prints what it has received, and the job continues when the link is back"
                ));
            }
            Event::Moved(progress) => {
                job.printed = u64::from(progress.printed);
                let Some((pass, ink)) = words::pass_at(&job.passes, job.printed) else { return };
                if pass != job.pass {
                    job.pass = pass;
                    if !job.faulty {
                        // Whatever it was before the job; but a cartridge may be wanted in a later pass.
                        messages.lift_all_but(Reason::SupplyMissing);
                    }
                    messages.info(&format!("pass {pass} of {}, {}", job.passes.len(), ink.name()));
                }
                messages.percent(100 * job.printed / job.total.max(1));
            }
            Event::Fault(Some(fault)) => {
                job.faulty = true;
                messages.reasons(&[Reason::of_fault(*fault)]);
                messages.info(&words::fault(*fault, words::wanted(&job.passes, job.printed)));
            }
            Event::Fault(None) => {
                job.faulty = false;
                messages.reasons(&[]);
                messages.info("the printer continues");
            }
        }
    }
}

impl Caller for System<'_> {
    fn tell(&self, news: &News<'_>) {
        match news {
            News::Printer(cartridges) => self.printer(cartridges),
            News::Reset => self.messages.info("the printer has been reset"),
            News::Queued { entry, .. } => {
                self.messages.debug(&format!("queued as job {:08x}", entry.record.job));
            }
            News::Sending(entry) => {
                *self.job.borrow_mut() = Position {
                    passes: entry.passes.clone(),
                    total: entry.port_bytes,
                    printed: entry.record.printed.into(),
                    ..Position::default()
                };
            }
            News::Link(event) => self.link(event),
            News::ByteForByte => {
                self.messages.debug(
                    "the bridge cannot take this page as pass streams, so the same job is sent byte for byte",
                );
            }
            News::SendingRaw => {
                self.messages.reasons(&[]);
                if let Some(path) = self.begun.take()
                    && let Err(error) = put(&path)
                {
                    *self.not_noted.borrow_mut() = Some(error);
                }
            }
            News::Note(text) => self.messages.info(text),
        }
    }

    /// Nobody can be asked; but whoever has released a held job has agreed.
    fn agrees(&self, question: &Question<'_>) -> bool {
        match question {
            Question::Reset(_) => self.released.get(),
            Question::NotAlps { .. } => false,
        }
    }

    fn waits(&self, obstacle: &Failure, begun: bool) -> bool {
        if self.in_class && !begun {
            return false;
        }
        let reason = if obstacle.is_in_use() { Reason::Connecting } else { Reason::OffLine };
        self.messages.reasons(&[Reason::Connecting, reason]);
        let then = if self.stops() { "The sheet is ended" } else { "Nothing is lost; the job continues" };
        let why = observe::with_causes(obstacle);
        self.messages.info(&format!("{why}. {then} when the printer can be reached"));
        if self.pause() {
            return true;
        }
        let waits = begun && self.patient.get();
        if waits {
            // A job that is to end does not pause, and the next attempt would follow at once.
            std::thread::sleep(RETRY);
        }
        waits
    }

    fn wish(&self) -> Wish {
        if self.not_noted.borrow().is_some() {
            return Wish::Leave;
        }
        if !self.stops() {
            return Wish::GoOn;
        }
        let stopped = self.stopped.get().unwrap_or_else(Instant::now);
        self.stopped.set(Some(stopped));
        if self.patient.get() || stopped.elapsed() < LAST_WORDS { Wish::Cancel } else { Wish::Leave }
    }

    fn watches(&self) -> bool {
        !self.stops()
    }

    fn observer(&self) -> &dyn Observer {
        self.messages
    }
}

/// Makes an empty file, durably, for this user alone.
pub(super) fn put(path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        durable::make_folder(folder, Access::Private)?;
    }
    durable::write(path, &[], Access::Private)
}
