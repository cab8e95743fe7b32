//! A job at a bridge: the questions before its first byte, the session, and what is noted when it ends.

use std::time::Duration;

use protocol::ink::Ink;
use protocol::link::message::{Ask, Fault, JobKind, Progress, Standing};

use super::{Cartridges, Delivery, Ended, Failure, Job, News, Packed, Question, ResetOwed, number};
use crate::connection::Address;
use crate::encodings::{self, Content, streams};
use crate::printers::Printer;
use crate::questions::query::{Query, QueryError, Reply, is_alps};
use crate::transit::finish::{Sheet, await_sheet};
use crate::transit::journal::{Journal, JournalError, OpenJob};
use crate::transit::session::{Outcome, Phase, Record, Session, SessionError};
use crate::transit::{self, RunError, Wish};
use observe::with_causes;

/// How long a bridge may take to answer.
const BRIDGE: Duration = Duration::from_secs(3);
/// How long it may take to ask the printer behind it.
const PRINTER: Duration = Duration::from_secs(12);

/// Resets the printer behind a bridge by the port's nInit line. Refused while a job is open.
pub fn reset(query: &mut Query<'_>) -> Result<(), Failure> {
    if let (_, Some(Fault::PowerOff)) = query.lines(BRIDGE)? {
        return Err(Failure::PrinterOff);
    }
    Ok(query.initialise(BRIDGE)?)
}

/// Gives up the job that is open at a bridge, whoever has sent it, and has the printer reset. Says what the bridge made of it.
pub fn give_up(query: &mut Query<'_>, job: u32) -> Result<Progress, Failure> {
    Ok(query.abandon(job, BRIDGE)?)
}

/// Asks the printer at `address` for the cartridges of these inks. A bridge that does not answer is a reason why they are not
/// known.
pub fn find_cartridges(address: &Address, inks: &[Ink]) -> Cartridges {
    let ask = || -> Result<Reply, Failure> {
        let mut link = address.open()?;
        let mut query = Query::new(&mut *link, BRIDGE)?;
        let fault = query.lines(BRIDGE)?.1;
        Ok(ask_printer(&mut query, fault, Ask::Printer)?)
    };
    match ask() {
        Ok(reply) => Cartridges::read(reply, inks),
        Err(failure) => Cartridges::Unknown(with_causes(&failure)),
    }
}

/// Asks the printer something. One that takes no bytes takes no question either.
fn ask_printer(query: &mut Query<'_>, fault: Option<Fault>, what: Ask) -> Result<Reply, QueryError> {
    match fault {
        Some(fault) => Ok(Reply::Stopped(fault)),
        None => query.printer(what, PRINTER),
    }
}

/// How an attempt to send ended.
enum Attempt {
    Ended(Outcome, Option<Progress>),
    /// The bridge has had another job with this number.
    NumberTaken,
}

impl Delivery<'_> {
    /// Makes sure that there is a bridge at `address` whose printer is ready for a job with these inks, as far as that can be
    /// known: that nobody has to take a torn sheet out of it, and that it is one of ALPS as far as it says what it is. `bridge` is the
    /// serial number of the one that is meant, which is then found at any port. Behind an open job nothing is asked.
    pub fn meet(&self, address: &Address, bridge: Option<u64>, inks: &[Ink]) -> Result<(), Failure> {
        let mut link = self.caller.open(address, bridge)?;
        let mut query = Query::new(&mut *link, BRIDGE)?;
        if query.progress().is_open() {
            let unknown = Cartridges::Unknown("the bridge has an open job".into());
            self.caller.tell(&News::Printer(&unknown));
            return Ok(());
        }
        let fault = query.lines(BRIDGE)?.1;
        self.settle(&mut query, fault)?;
        if let Some(id) = ask_printer(&mut query, fault, Ask::DeviceId)?.device_id()
            && !is_alps(&id)
            && !self.caller.agrees(&Question::NotAlps { id: &id })
        {
            return Err(Failure::NotAlps(id));
        }
        let status = ask_printer(&mut query, fault, Ask::Printer)?;
        self.caller.tell(&News::Printer(&Cartridges::read(status, inks)));
        Ok(())
    }

    /// Has a printer reset of which its bridge does not know where it stands. If it may have a part of a job, somebody has to
    /// agree, since the sheet has to be taken out. Otherwise the bridge would do it by itself, before the first byte; but only behind
    /// it the printer can be asked something.
    fn settle(&self, query: &mut Query<'_>, fault: Option<Fault>) -> Result<(), Failure> {
        match query.standing() {
            (Standing::AT_REST, _) => return Ok(()),
            (_, 0) if fault.is_some() => return Ok(()),
            // Whoever switches it on stands before it, and the bridge resets it then.
            _ if fault == Some(Fault::PowerOff) => return Ok(()),
            (_, 0) => {}
            (_, job) => {
                let owed = ResetOwed { printer: Printer::Bridge(query.bridge().serial), job };
                if !self.caller.agrees(&Question::Reset(&owed)) {
                    return Err(Failure::ResetOwed(owed));
                }
            }
        }
        reset(query)?;
        self.caller.tell(&News::Reset);
        Ok(())
    }

    /// Sends a job of the journal, or with `cancel` brings it to its end, until the bridge says how it ended. Jobs of which no
    /// byte has left meet the printer first, unless that was just done: `met` says so.
    ///
    /// A job the bridge refuses as pass streams is sent byte for byte, under another number.
    pub fn send(
        &self,
        journal: &Journal,
        mut job: OpenJob,
        address: &Address,
        mut met: bool,
        cancel: bool,
    ) -> Result<Ended, Failure> {
        let data = std::mem::take(&mut job.data);
        loop {
            match self.attempt(&mut job, &data, address, std::mem::take(&mut met), cancel) {
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
                    return self.send(journal, job, address, false, false);
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
                        return self.send(journal, job, address, false, false);
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
        met: bool,
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
        if unsent && !met {
            let inks: Vec<Ink> =
                job.entry.passes.iter().filter_map(|pass| Ink::from_code(pass.ink)).collect();
            self.meet(address, bridge, &inks)?;
        }
        self.caller.tell(&News::Sending(&job.entry));
        let result = transit::run_at(
            &mut session,
            &mut |bridge| self.caller.open(address, bridge),
            &mut |time| self.caller.pause(time),
            &mut |record| job.save(record),
            &mut |event| self.caller.tell(&News::Link(&event)),
            &mut || self.caller.wish(),
        );
        if !matches!(result, Err(RunError::Save(_))) {
            // Also what came after the last save.
            job.entry.record = *session.record();
        }
        match result {
            Ok(outcome) => Ok(Attempt::Ended(outcome, session.progress().copied())),
            Err(RunError::Left) => Err(Failure::Left),
            Err(RunError::Save(error)) => Err(error.into()),
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
