//! A job at a bridge: the questions before its first byte, the session, and what is noted when it ends.

use std::cell::Cell;
use std::time::Duration;

use protocol::ink::Ink;
use protocol::link::message::{Ask, Fault, JobKind, Progress};

use super::ask::{self, Negotiate};
use super::{Cartridges, Delivery, Ended, Failure, Job, News, Packed, Question, ResetOwed, number};
use crate::connection::Address;
use crate::connection::Bridge;
use crate::encodings::{self, Content, streams};
use crate::printers::{Printer, Printers, PrintersError, Standing};
use crate::questions::query::{Query, Reply, is_alps};
use crate::transit::finish::{Sheet, await_sheet};
use crate::transit::journal::{Journal, JournalError, OpenJob};
use crate::transit::session::{Outcome, Phase, Record, Session, SessionError};
use crate::transit::{self, Event, RunError, Wish};
use observe::with_causes;

/// How long a bridge may take to answer.
const BRIDGE: Duration = Duration::from_secs(3);
/// How long it may take to ask the printer behind it.
const PRINTER: Duration = Duration::from_secs(12);

/// That the printer is ready for a job, as far as can be known, for as long as the bridge does not restart.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    boot: u32,
}

/// Resets the printer behind a bridge by the port's nInit line, and notes for everybody that it was. Refused while a job is
/// open.
pub fn reset(query: &mut Query<'_>, printers: &Printers) -> Result<(), Failure> {
    if let (_, Some(Fault::PowerOff)) = query.lines(BRIDGE)? {
        return Err(Failure::PrinterOff);
    }
    let noted = printers.noted(Some(&Printer::Bridge(query.bridge().serial)))?;
    query.initialise(BRIDGE)?;
    Ok(printers.reset(&noted, Some(query.bridge().boot))?)
}

/// Gives up the job that is open at a bridge, whoever has sent it, and has the printer reset; notes for everybody that it was.
/// Says what the bridge made of it.
pub fn give_up(query: &mut Query<'_>, job: u32, printers: &Printers) -> Result<Progress, Failure> {
    let printer = Printer::Bridge(query.bridge().serial);
    let noted = printers.noted(Some(&printer))?;
    let ended = query.abandon(job, BRIDGE)?;
    // A printer that is off is reset by the bridge when it is back, so the notes stay until then.
    if !matches!(query.lines(BRIDGE)?, (_, Some(Fault::PowerOff))) {
        printers.close(&printer, &format!("{job:08x}"))?;
        printers.reset(&noted, Some(query.bridge().boot))?;
    }
    Ok(ended)
}

/// Asks the printer at `address` for the cartridges of these inks. A bridge that does not answer is a reason why they are not
/// known.
pub fn find_cartridges(address: &Address, inks: &[Ink], printers: &Printers) -> Cartridges {
    let ask = || -> Result<Reply, Failure> {
        let mut link = address.open()?;
        let mut query = Query::new(&mut *link, BRIDGE)?;
        match query.lines(BRIDGE)? {
            (_, Some(fault)) => Ok(Reply::Stopped(fault)),
            (_, None) => Ok(ask::status(&mut query, printers, Negotiate::Known, PRINTER)?),
        }
    };
    match ask() {
        Ok(reply) => Cartridges::read(reply, inks),
        Err(failure) => Cartridges::Unknown(with_causes(&failure)),
    }
}

/// Why the record of a job was not made durable, so that nothing left.
#[derive(Debug, thiserror::Error)]
enum NotSaved {
    #[error(transparent)]
    Journal(#[from] JournalError),
    #[error(transparent)]
    Printers(#[from] PrintersError),
    #[error("the bridge has restarted")]
    Restarted,
}

/// How an attempt to send ended.
enum Attempt {
    Ended(Outcome, Option<Progress>),
    /// The bridge restarted before the first byte, so the printer has to be judged again.
    Again,
    /// The bridge has had another job with this number.
    NumberTaken,
}

impl Delivery<'_> {
    /// Makes sure that there is a bridge at `address` whose printer is ready for a job with these inks, as far as that can be
    /// known: that it holds no part of another job, and is one of ALPS as far as it says what it is. `bridge` is the serial
    /// number of the one that is meant, which is then found at any port.
    pub fn meet(&self, address: &Address, bridge: Option<u64>, inks: &[Ink]) -> Result<Met, Failure> {
        let mut link = self.caller.open(address, bridge)?;
        let mut query = Query::new(&mut *link, BRIDGE)?;
        self.settle_earlier_jobs(&mut query)?;
        let fault = query.lines(BRIDGE)?.1;
        // One that takes no bytes takes no question either.
        let id = match fault {
            Some(fault) => Reply::Stopped(fault),
            None => ask::device_id(&mut query, self.printers, Negotiate::Known, PRINTER)?,
        };
        if let Some(id) = id.device_id()
            && !is_alps(&id)
            && !self.caller.agrees(&Question::NotAlps { id: &id })
        {
            return Err(Failure::NotAlps(id));
        }
        let status = match fault {
            Some(fault) => Reply::Stopped(fault),
            None => ask::status(&mut query, self.printers, Negotiate::Known, PRINTER)?,
        };
        self.caller.tell(&News::Printer(&Cartridges::read(status, inks)));
        Ok(Met { boot: query.bridge().boot })
    }

    /// Judges the jobs of which the printer may hold a part by what the bridge says of them. If it has forgotten one, the
    /// printer is reset, should the caller agree.
    fn settle_earlier_jobs(&self, query: &mut Query<'_>) -> Result<(), Failure> {
        let (printer, boot) = (Printer::Bridge(query.bridge().serial), query.bridge().boot);
        let progress = *query.progress();
        let (mut owed, mut forgotten) = (None, Vec::new());
        for unfinished in self.printers.unfinished(&printer)? {
            match unfinished.standing(boot, &progress, query.past()) {
                Standing::Ended { printed, whole } => {
                    // Whoever sent it was gone before it heard so.
                    self.counted(&unfinished.job, printed.into(), whole);
                    self.close(&printer, &unfinished.job);
                }
                Standing::WithBridge => {}
                Standing::ResetOwed => {
                    owed = Some(ResetOwed { printer: printer.clone(), job: unfinished.job.clone() });
                    if !unfinished.is_of(Some(boot)) {
                        forgotten.push(unfinished.job);
                    }
                }
            }
        }
        let Some(owed) = owed else { return Ok(()) };
        if self.is_between_jobs(query, &printer)? {
            // Another user has had it reset, or has switched it off and on.
            forgotten.iter().for_each(|job| self.close(&printer, job));
            return Ok(());
        }
        if !self.caller.agrees(&Question::Reset(&owed)) {
            return Err(Failure::ResetOwed(owed));
        }
        reset(query, self.printers)?;
        self.caller.tell(&News::Reset);
        Ok(())
    }

    /// Whether the bridge itself knows that the printer stands between two jobs. It says so by asking it for its status. A printer
    /// that is disturbed by that is left alone, and then nobody knows.
    fn is_between_jobs(&self, query: &mut Query<'_>, printer: &Printer) -> Result<bool, Failure> {
        if self.printers.is_one_way(printer) {
            return Ok(false);
        }
        let reply = query.printer(Ask::Printer, PRINTER)?;
        Ok(matches!(reply, Reply::Bytes(_) | Reply::OneWay | Reply::Silent | Reply::Stopped(_)))
    }

    /// Sends a job of the journal, or with `cancel` brings it to its end, until the bridge says how it ended. Jobs of which no
    /// byte has left meet the printer first, unless that was just done: then `met` says so.
    ///
    /// A job the bridge refuses as pass streams is sent byte for byte, under another number.
    pub fn send(
        &self,
        journal: &Journal,
        mut job: OpenJob,
        address: &Address,
        mut met: Option<Met>,
        cancel: bool,
    ) -> Result<Ended, Failure> {
        let data = std::mem::take(&mut job.data);
        loop {
            match self.attempt(&mut job, &data, address, met.take(), cancel) {
                Ok(Attempt::Again) => {}
                Ok(Attempt::NumberTaken) if cancel => {
                    // Its number is another job's: no bridge has anything of this one.
                    self.forget(&mut job)?;
                    return Ok(Ended {
                        entry: job.entry.clone(),
                        outcome: Outcome::Cancelled,
                        progress: None,
                    });
                }
                Ok(Attempt::NumberTaken) => {
                    self.forget(&mut job)?;
                    let job = self.queue_again(journal, &job, &data, job.entry.record.kind)?;
                    return self.send(journal, job, address, None, false);
                }
                Ok(Attempt::Ended(outcome, progress)) => {
                    let record = &job.entry.record;
                    self.counted(&number(&job.entry), record.printed.into(), outcome == Outcome::Printed);
                    let refused = outcome == Outcome::Broken
                        && record.kind == JobKind::Streams
                        && record.printed == 0
                        && !record.cancel;
                    if refused {
                        self.caller.tell(&News::ByteForByte);
                        let job = self.queue_again(journal, &job, &data, JobKind::Raw)?;
                        return self.send(journal, job, address, None, false);
                    }
                    return Ok(Ended { entry: job.entry.clone(), outcome, progress });
                }
                Err(failure) => {
                    let begun = !matches!(job.entry.record.phase, Phase::Queued);
                    if !failure.may_pass() || !self.caller.waits(&failure, begun) {
                        self.counted(&number(&job.entry), job.entry.record.printed.into(), false);
                        return Err(failure);
                    }
                }
            }
        }
    }

    /// Ends in the journal a job of which no bridge has a byte.
    fn forget(&self, job: &mut OpenJob) -> Result<(), Failure> {
        let record = Record { phase: Phase::Ended(Outcome::Cancelled), ..job.entry.record };
        Ok(job.save(&record)?)
    }

    /// The same job under a new number; with another `kind` in the form a bridge takes whatever its memory is.
    fn queue_again(
        &self,
        journal: &Journal,
        old: &OpenJob,
        data: &[u8],
        kind: JobKind,
    ) -> Result<OpenJob, Failure> {
        let mut bytes = Vec::new();
        let expanded = match old.entry.record.kind {
            JobKind::Raw => {
                bytes.extend_from_slice(data);
                Ok(())
            }
            JobKind::Streams => streams::expand(data, &mut |piece| {
                bytes.extend_from_slice(piece);
                true
            }),
        };
        let checked = expanded.map_err(|error| error.to_string()).and_then(|()| {
            encodings::check(&bytes, self.caller.observer()).map_err(|error| error.to_string())
        });
        let (name, to) = (&old.entry.name, old.entry.to.parse());
        let (Ok(checked), Ok(to)) = (checked, to) else {
            // It was checked when it was queued, and its checksum has been compared.
            return Err(JournalError::NoSuchJob(old.entry.record.job).into());
        };
        let job = Job { name, content: Content::Bytes(&bytes), checked: &checked };
        let packed =
            if kind == JobKind::Raw { Packed::raw(job) } else { Packed { job, kind, data: data.into() } };
        self.queue(journal, &packed, &to)
    }

    /// One attempt: until the job has ended, or something keeps it from going on.
    fn attempt(
        &self,
        job: &mut OpenJob,
        data: &[u8],
        address: &Address,
        met: Option<Met>,
        cancel: bool,
    ) -> Result<Attempt, Failure> {
        let wish = self.caller.wish();
        if wish == Wish::Leave {
            return Err(Failure::Left);
        }
        let mut session = Session::new(job.entry.record, data);
        if (cancel || wish == Wish::Cancel) && !session.record().cancel {
            session.cancel();
            // Whatever happens now: the next process that opens the job cancels it too.
            job.save(session.record())?;
        }
        if let Some(outcome) = session.outcome() {
            return Ok(Attempt::Ended(outcome, None));
        }
        let Record { phase, bridge, .. } = *session.record();
        let unsent = matches!(phase, Phase::Queued | Phase::Begun) && !session.record().cancel;
        let met = match met {
            None if unsent => {
                let inks: Vec<Ink> =
                    job.entry.passes.iter().filter_map(|pass| Ink::from_code(pass.ink)).collect();
                Some(self.meet(address, bridge, &inks)?)
            }
            met => met.filter(|_| unsent),
        };
        self.caller.tell(&News::Sending(&job.entry));
        let watcher = Watcher { delivery: self, job: number(&job.entry), ..Watcher::new(self) };
        watcher.serial.set(bridge);
        let result = transit::run_at(
            &mut session,
            &mut |bridge| self.caller.open(address, bridge),
            &mut |time| self.caller.pause(time),
            &mut |record| {
                watcher.before_saving(record, met)?;
                Ok(job.save(record)?)
            },
            &mut |event| watcher.see(&event),
            &mut || self.caller.wish(),
        );
        if !matches!(result, Err(RunError::Save(_))) {
            // Also what came after the last save.
            job.entry.record = *session.record();
        }
        match result {
            Ok(outcome) => {
                watcher.ended(outcome, session.followed());
                Ok(Attempt::Ended(outcome, session.progress().copied()))
            }
            Err(RunError::Left) => Err(Failure::Left),
            Err(RunError::Save(NotSaved::Restarted)) => Ok(Attempt::Again),
            Err(RunError::Save(NotSaved::Journal(error))) => Err(error.into()),
            Err(RunError::Save(NotSaved::Printers(error))) => Err(error.into()),
            Err(RunError::Session(SessionError::NumberTaken(_))) => Ok(Attempt::NumberTaken),
            Err(RunError::Session(error)) => Err(error.into()),
            Err(RunError::Open(error)) => Err(error.into()),
            Err(error @ RunError::NoAnswer(_)) => Err(Failure::NoAnswer(error.to_string())),
        }
    }

    /// Waits, as long as the caller does, until the printer says that the sheet of this job is done; `watch` is told what is the matter with it,
    /// once for each change. Nothing that happens here changes that the job was sent.
    pub fn await_sheet(&self, job: u32, address: &Address, watch: &mut dyn FnMut(&[String])) -> Sheet {
        let mut open = || self.caller.open(address, None);
        let mut pause = |time| {
            self.caller.pause(time);
            self.caller.watches()
        };
        await_sheet(job, &mut open, &mut pause, watch)
            .unwrap_or_else(|error| Sheet::Unknown(with_causes(&error)))
    }
}

/// Keeps what is known of the printer true while a job is sent.
struct Watcher<'d, 'a> {
    delivery: &'d Delivery<'a>,
    job: String,
    /// The bridge at the other end, and its start.
    serial: Cell<Option<u64>>,
    boot: Cell<Option<u32>>,
    /// The start of the bridge that is noted with this job; none before it is noted.
    noted: Cell<Option<u32>>,
    /// Whether a byte of this job has crossed the port.
    moved: Cell<bool>,
}

impl<'d, 'a> Watcher<'d, 'a> {
    fn new(delivery: &'d Delivery<'a>) -> Self {
        Watcher {
            delivery,
            job: String::new(),
            serial: Cell::new(None),
            boot: Cell::new(None),
            noted: Cell::new(None),
            moved: Cell::new(false),
        }
    }

    fn printer(&self) -> Option<Printer> {
        self.serial.get().map(Printer::Bridge)
    }

    /// Before data leave it is on disk that the printer may hold a part of this job.
    fn before_saving(&self, record: &Record, met: Option<Met>) -> Result<(), NotSaved> {
        let (Phase::Sending, Some(printer)) = (record.phase, self.printer()) else { return Ok(()) };
        if self.noted.get().is_some() {
            return Ok(());
        }
        match met {
            // What was found out before holds for one start of the bridge.
            Some(met) if self.boot.get() != Some(met.boot) => return Err(NotSaved::Restarted),
            Some(_) => self.delivery.printers.begin(&printer, &self.job, self.boot.get())?,
            // It was noted when its first byte left. If the note is gone, the worst is assumed.
            None if !self.delivery.printers.knows(&printer, &self.job) => {
                self.delivery.printers.begin(&printer, &self.job, None)?;
            }
            None => return Ok(()),
        }
        self.noted.set(self.boot.get());
        Ok(())
    }

    fn see(&self, event: &Event<'_>) {
        match event {
            Event::Connected(Bridge { serial, boot, .. }) => {
                self.serial.set(Some(*serial));
                self.boot.set(Some(*boot));
            }
            Event::Moved(progress) => self.see_progress(progress),
            Event::Away(_) | Event::Fault(_) => {}
        }
        self.delivery.caller.tell(&News::Link(event));
    }

    fn see_progress(&self, progress: &Progress) {
        let (Some(printer), printers) = (self.printer(), self.delivery.printers) else { return };
        let shown = self.boot.get();
        if self.noted.get().is_some() && self.noted.get() != shown {
            // It has restarted and still has the job. Should this not be written, the next job asks for a needless reset.
            let _ = printers.begin(&printer, &self.job, shown);
            self.noted.set(shown);
        }
        if progress.printed > 0 && !self.moved.replace(true) {
            // What crosses the port now comes behind whatever reset was owed.
            for earlier in printers.unfinished(&printer).unwrap_or_default() {
                if earlier.job != self.job && !earlier.is_of(shown) {
                    self.delivery.close(&printer, &earlier.job);
                }
            }
        }
    }

    /// What is known of the printer once the job has ended. A bridge that says a job is lost resets the printer by itself, as
    /// long as it does not lose its memory too; so that job stays noted, as one of no start that is known, until bytes of another
    /// one have crossed the port.
    /// `followed` says that the bridge has printed another job since: then this one had ended, or was reset away, before it.
    fn ended(&self, outcome: Outcome, followed: bool) {
        let Some(printer) = self.printer() else { return };
        match outcome {
            Outcome::Printed | Outcome::Cancelled | Outcome::Broken | Outcome::Stored => {
                self.delivery.close(&printer, &self.job);
            }
            Outcome::Forgotten if followed || self.delivery.printers.knows(&printer, &self.job) => {}
            Outcome::Lost | Outcome::Forgotten => {
                if let Err(error) = self.delivery.printers.begin(&printer, &self.job, None) {
                    self.delivery.note(&with_causes(&error));
                }
            }
        }
    }
}
