//! A job's conversation with the bridge: bytes in, bytes out, no clock and no input or output of its own.
//!
//! Problem: the link may lose, repeat, reorder and damage frames and may vanish at any byte; this process may
//! be killed between any two instructions; the bridge may restart. The bytes at the printer must be those of
//! an undisturbed run, once, or the user must be told that the sheet is lost: never printed twice.
//! Method: positions. Every piece of data carries its offset, the bridge says what comes next, and repeating
//! is harmless. What must be known after a crash is in the [`Record`], which is made durable *before* the
//! step it speaks of: [`Session::speak`] saves the record before the first Begin and before the first Data
//! leave. So a job in [`Phase::Queued`] or [`Phase::Begun`] has certainly not reached the printer and may be
//! begun (again), and one in [`Phase::Sending`] goes on only if the bridge itself still shows it; if it does
//! not, it is never begun anew. How it has ended since, the bridge remembers, also behind other jobs.
//! Cost: one pass over the data for framing; nothing is copied but into the outgoing buffer.
//! Limits: one job at a time. The credit the bridge gives is never exceeded, so the bridge always reads.
//! Source: `docs/wire-format.md`, section 3.

use std::time::Duration;

use protocol::link::frame::{self, MAX, Read, Reader};
#[cfg(doc)]
use protocol::link::message::NAME_MAX;
use protocol::link::message::{
    DATA_MAX, Fault, JobState, PastJob, Progress, Refusal, SCHEMA, ToBridge, ToHost, VERSION,
};

pub use super::record::{Outcome, Phase, Record};
use crate::connection::{Bridge, other_version, printable, stranger};

/// A question that is not answered is repeated after this long.
const REPEAT: Duration = Duration::from_millis(300);
/// A bridge that has said nothing for this long is asked whether it is there.
const QUIET: Duration = Duration::from_secs(1);
/// A link on which nothing comes for this long, though it was asked, is dead.
const DEAD: Duration = Duration::from_secs(5);
/// Statements that contradict what is known are believed when they have been made this often, a question
/// apart: a single one may be a late repetition.
const CONVINCED: u8 = 3;
/// Bytes to give out at once; what comes back is looked at in between.
const BURST: usize = 8 * MAX;

/// Why a job cannot go on over this link. The job itself stays as it is, to be resumed.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SessionError {
    /// Other messages than ours.
    #[error(
        "the bridge's firmware {firmware} speaks version {found} of the link, this program version {VERSION}; {}",
        other_version(*found)
    )]
    Version {
        /// The bridge's version.
        found: u8,
        /// Its firmware.
        firmware: String,
    },
    /// Another board than the job was begun on.
    #[error(
        "this is bridge {found:016x}, but the job was begun on bridge {expected:016x}; connect that one, \
         it may hold a part of the sheet"
    )]
    OtherBridge {
        /// Serial number of the bridge the job was begun on.
        expected: u64,
        /// Serial number of this one.
        found: u64,
    },
    /// Somebody else's job is being printed.
    #[error(
        "the bridge is printing another job ({0:08x}); wait until it is done, or end it with `foilpress cancel {0:08x}`, which \
         needs the bridge's address for the job of another user or computer"
    )]
    Busy(u32),
    /// Somebody else's job is being stored.
    #[error(
        "the bridge is storing another job ({0:08x}), and drops it when nothing of it has come for 30 s; wait until it is stored, or \
         end that with `foilpress cancel {0:08x}`, which needs the bridge's address for the job of another user or computer"
    )]
    Storing(u32),
    /// The number was used for another job.
    #[error("the bridge has had another job with the number {0:08x}; send this one again")]
    NumberTaken(u32),
    /// The bridge's flash has no room for the job.
    #[error(
        "the bridge has no room for the job; `foilpress bridge jobs` lists what is stored there, and deletes it"
    )]
    NoRoom,
    /// The bridge takes no job at all.
    #[error("the bridge has no memory for a job; flash the firmware that came with this program")]
    NoMemory,
}

/// One job's conversation.
pub struct Session<'d> {
    record: Record,
    /// What the job is called, if it is to be stored and not printed.
    store: Option<&'d str>,
    saved: Option<Record>,
    data: &'d [u8],
    reader: Reader,
    bridge: Option<Bridge>,
    /// The link is new: nothing heard on it counts until the bridge has introduced itself.
    greeted: bool,
    /// The bridge has told on this link how the jobs before have ended.
    recalled: bool,
    /// What the bridge last said of this job since it last restarted.
    progress: Option<Progress>,
    /// The next byte to send.
    next: u32,
    /// Position that was gone back to, so that one loss is not repaired many times over.
    rewound: Option<u32>,
    heard: Duration,
    asked: Option<Duration>,
    /// When data last left, or were last accepted.
    moved: Duration,
    /// Ask at once, whatever the clock says.
    doubt: bool,
    contradictions: u8,
    contradicted: Option<Duration>,
}

impl<'d> Session<'d> {
    /// A conversation about `data`, whose record is new or was kept from another process.
    pub fn new(record: Record, data: &'d [u8]) -> Session<'d> {
        let cancel = record.cancel;
        let mut session = Session {
            record,
            store: None,
            saved: None,
            data,
            reader: Reader::new(),
            bridge: None,
            greeted: false,
            recalled: false,
            progress: None,
            next: 0,
            rewound: None,
            heard: Duration::ZERO,
            asked: None,
            moved: Duration::ZERO,
            doubt: false,
            contradictions: 0,
            contradicted: None,
        };
        if cancel {
            session.cancel();
        }
        session
    }

    /// A conversation about a new job that is to be stored under this name, of at most [`NAME_MAX`] bytes,
    /// and not printed.
    pub fn storing(record: Record, data: &'d [u8], name: &'d str) -> Session<'d> {
        Session { store: Some(name), ..Session::new(record, data) }
    }

    /// The record as it is now.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// What the bridge last said of this job.
    pub fn progress(&self) -> Option<&Progress> {
        self.progress.as_ref()
    }

    /// The bridge, once it has introduced itself.
    pub fn bridge(&self) -> Option<&Bridge> {
        self.bridge.as_ref()
    }

    /// What keeps the printer from taking bytes.
    pub fn fault(&self) -> Option<Fault> {
        match self.progress?.state {
            JobState::Stopped(fault) => Some(fault),
            _ => None,
        }
    }

    /// How the job ended, once it has.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.record.phase {
            Phase::Ended(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// Ends the job early. One that no bridge has heard of is over at once.
    pub fn cancel(&mut self) {
        self.record.cancel = true;
        if self.record.phase == Phase::Queued {
            self.record.phase = Phase::Ended(Outcome::Cancelled);
        }
        self.doubt = true;
    }

    /// A new link is there, or the old one came back.
    pub fn connected(&mut self, now: Duration) {
        self.reader.reset();
        (self.greeted, self.recalled) = (false, false);
        (self.asked, self.heard, self.moved) = (None, now, now);
        self.doubt = false;
        (self.contradictions, self.contradicted) = (0, None);
        self.rewound = None;
    }

    /// Whether the bridge has introduced itself on this link.
    pub fn greeted(&self) -> bool {
        self.greeted
    }

    /// Whether the link has been silent for so long that it should be opened anew.
    pub fn is_dead(&self, now: Duration) -> bool {
        now.saturating_sub(self.heard) >= DEAD
    }

    /// Whether [`Session::speak`] would have data to give out at once.
    pub fn has_more(&self) -> bool {
        self.greeted
            && self.outcome().is_none()
            && self.progress.is_some_and(|progress| self.gives(&progress))
    }

    /// Whether there are data to give. A cancelled job of which nothing has left goes no further: whether the
    /// printer is ready for it was never asked.
    fn gives(&self, progress: &Progress) -> bool {
        self.next < progress.limit && !(self.record.cancel && self.record.phase == Phase::Begun)
    }

    /// Bytes from the link, in any portions.
    pub fn hear(&mut self, now: Duration, mut bytes: &[u8]) -> Result<(), SessionError> {
        // The reader is moved out for the loop: the messages borrow from it.
        let mut reader = std::mem::take(&mut self.reader);
        let result = loop {
            match reader.read(bytes) {
                Read::More => break Ok(()),
                // What was lost is said again, by us or by the bridge.
                Read::Damaged(_, rest) => bytes = rest,
                Read::Message(message, rest) => {
                    bytes = rest;
                    let followed = match frame::decode(message) {
                        Ok(message) => self.follow(now, message),
                        // A message of a later version is not for us; only that there is one.
                        Err(frame::Unknown) => stranger(message).map_or(Ok(()), |bridge| self.meet(bridge)),
                    };
                    if let Err(error) = followed {
                        break Err(error);
                    }
                }
            }
        };
        self.reader = reader;
        result
    }

    fn follow(&mut self, now: Duration, message: ToHost<'_>) -> Result<(), SessionError> {
        if self.outcome().is_some() {
            return Ok(());
        }
        self.heard = now;
        match message {
            ToHost::Hello { version, boot, serial, firmware, .. } => {
                self.meet(Bridge { version, boot, serial, firmware: printable(firmware) })
            }
            ToHost::Progress(progress) if self.greeted => self.place(now, progress),
            ToHost::Past(past) if self.greeted => self.recall(&past),
            ToHost::Refused { reason, job } if self.greeted && job == self.record.job => {
                self.refused(now, reason)
            }
            _ => Ok(()),
        }
    }

    fn meet(&mut self, bridge: Bridge) -> Result<(), SessionError> {
        if bridge.version != VERSION {
            return Err(SessionError::Version { found: bridge.version, firmware: bridge.firmware });
        }
        if let Some(expected) = self.record.bridge
            && self.record.phase != Phase::Queued
            && expected != bridge.serial
        {
            return Err(SessionError::OtherBridge { expected, found: bridge.serial });
        }
        self.record.bridge = Some(bridge.serial);
        if self.bridge.as_ref().is_some_and(|known| known.boot != bridge.boot) {
            // It has restarted and its positions begin anew.
            self.progress = None;
            self.next = 0;
            self.rewound = None;
        }
        self.greeted = true;
        self.bridge = Some(bridge);
        Ok(())
    }

    fn place(&mut self, now: Duration, progress: Progress) -> Result<(), SessionError> {
        // The bridge's figures are not trusted with our memory.
        let length = self.record.length;
        let progress = Progress {
            accepted: progress.accepted.min(length),
            limit: progress.limit.min(length),
            ..progress
        };
        if progress.job != self.record.job {
            return self.place_other(now, progress);
        }
        if self.record.phase == Phase::Queued {
            return Err(SessionError::NumberTaken(progress.job));
        }
        if self.ends(progress.state, progress.printed) {
            self.progress = Some(progress);
            return Ok(());
        }
        if let Some(before) = self.progress {
            if progress.accepted < before.accepted || progress.printed < before.printed {
                // Late, or the bridge has restarted and its greeting was lost.
                if !self.convinced(now) {
                    self.doubt = true;
                    return Ok(());
                }
                self.next = progress.accepted;
            }
            if progress.accepted > before.accepted {
                self.moved = now;
                self.rewound = None;
            } else if progress == before
                && self.next > progress.accepted
                && self.rewound != Some(progress.accepted)
            {
                // Said again without news: the answer to data that were not what comes next.
                self.next = progress.accepted;
                self.rewound = Some(progress.accepted);
            }
        } else {
            self.next = progress.accepted;
            self.moved = now;
        }
        (self.contradictions, self.contradicted) = (0, None);
        self.next = self.next.max(progress.accepted);
        self.record.printed = progress.printed;
        self.progress = Some(progress);
        Ok(())
    }

    /// The job is over, if this state says so.
    fn ends(&mut self, state: JobState, printed: u32) -> bool {
        let Some(outcome) = outcome(state) else { return false };
        self.record.phase = Phase::Ended(outcome);
        // A bridge that has lost its memory does not know how much of a lost sheet was printed.
        let before = if outcome == Outcome::Lost { self.record.printed } else { 0 };
        self.record.printed = printed.max(before);
        true
    }

    /// The bridge tells how earlier jobs have ended.
    fn recall(&mut self, past: &[PastJob]) -> Result<(), SessionError> {
        self.recalled = true;
        let Some(past) = past.iter().find(|past| past.job == self.record.job) else { return Ok(()) };
        if self.record.phase == Phase::Queued {
            return Err(SessionError::NumberTaken(past.job));
        }
        self.ends(past.state, past.printed);
        Ok(())
    }

    /// The bridge tells of another job.
    fn place_other(&mut self, now: Duration, progress: Progress) -> Result<(), SessionError> {
        let open = progress.is_open();
        match self.record.phase {
            // Nothing of it has ever left, and the bridge does not have it.
            Phase::Begun if self.record.cancel => {
                if self.convinced(now) && self.recalled {
                    self.record.phase = Phase::Ended(Outcome::Cancelled);
                }
            }
            Phase::Queued | Phase::Begun if open => {
                if self.convinced(now) {
                    return Err(match progress.state {
                        JobState::Storing => SessionError::Storing(progress.job),
                        _ => SessionError::Busy(progress.job),
                    });
                }
            }
            Phase::Sending => {
                if self.convinced(now) && self.recalled {
                    // To begin it anew could print it twice.
                    self.record.phase = Phase::Ended(Outcome::Forgotten);
                }
            }
            Phase::Queued | Phase::Begun | Phase::Ended(_) => {}
        }
        Ok(())
    }

    fn refused(&mut self, now: Duration, reason: Refusal) -> Result<(), SessionError> {
        match reason {
            Refusal::Empty => return Err(SessionError::NoMemory),
            Refusal::NoRoom => return Err(SessionError::NoRoom),
            Refusal::OtherJob => {
                if self.convinced(now) {
                    return Err(SessionError::NumberTaken(self.record.job));
                }
            }
            Refusal::NoSuchJob => self.doubt = true,
            Refusal::BeyondLimit => {
                if let Some(progress) = self.progress {
                    self.next = progress.accepted;
                }
            }
            // Another job is open: its progress comes too and is looked at.
            Refusal::JobOpen | Refusal::Unknown | Refusal::Settings => {}
        }
        Ok(())
    }

    /// Counts a contradiction, one for each question, and asks again; true when there were enough.
    fn convinced(&mut self, now: Duration) -> bool {
        if self.contradicted.is_none_or(|at| now.saturating_sub(at) >= REPEAT) {
            self.contradicted = Some(now);
            if self.contradictions < CONVINCED {
                // A list from before may be one from before the job's end.
                self.recalled = false;
            }
            self.contradictions = self.contradictions.saturating_add(1);
        }
        self.contradictions >= CONVINCED
    }

    /// Appends what is to be said now to `out`: some kilobytes at most. Calls `save` before anything leaves
    /// that the record has to know of; if that fails nothing leaves.
    pub fn speak<E>(
        &mut self,
        now: Duration,
        out: &mut Vec<u8>,
        save: &mut dyn FnMut(&Record) -> Result<(), E>,
    ) -> Result<(), E> {
        if self.outcome().is_some() {
            return self.keep(save);
        }
        let since = |at: Option<Duration>| at.map_or(Duration::MAX, |at| now.saturating_sub(at));
        let quiet = now.saturating_sub(self.heard) >= QUIET;
        let unsettled = !self.greeted
            || self.doubt
            || self.record.cancel
            || self.contradictions > 0
            || self.progress.is_none_or(|progress| progress.limit == 0);
        if since(self.asked) >= REPEAT && (unsettled || quiet) {
            self.asked = Some(now);
            self.doubt = false;
            self.ask(out, save)?;
        }
        let Some(progress) = self.progress.filter(|_| self.greeted) else { return Ok(()) };
        if self.next > progress.accepted && now.saturating_sub(self.moved) >= REPEAT {
            // Nothing was accepted for a while: something was lost, and the bridge does not know of it.
            self.next = progress.accepted;
        }
        while self.gives(&progress) && out.len() < BURST {
            if self.record.phase == Phase::Begun {
                self.record.phase = Phase::Sending;
                self.keep(save)?;
            }
            let end = (self.next as usize + DATA_MAX).min(progress.limit as usize).min(self.data.len());
            let bytes = &self.data[(self.next as usize).min(end)..end];
            if bytes.is_empty() {
                break;
            }
            push(&ToBridge::Data { job: self.record.job, offset: self.next, bytes }, out);
            self.next = end as u32;
            self.moved = now;
        }
        Ok(())
    }

    /// Greets; opens the job where that is safe; asks for its end where that is wanted.
    fn ask<E>(&mut self, out: &mut Vec<u8>, save: &mut dyn FnMut(&Record) -> Result<(), E>) -> Result<(), E> {
        let Record { job, kind, length, .. } = self.record;
        // A zero ends whatever stands in the bridge's reader.
        out.push(0);
        push(&ToBridge::Hello { version: VERSION, schema: SCHEMA }, out);
        if !self.greeted {
            return Ok(());
        }
        let begin = match (self.record.phase, self.progress) {
            // The bridge shows it but does not know any more what it was.
            (Phase::Begun | Phase::Sending, Some(progress)) => progress.limit == 0,
            // Not even its number is known there; so a cancelled one is not made known.
            (Phase::Queued | Phase::Begun, None) => !self.record.cancel,
            // Data have left once. Only a bridge that shows the job can go on with it.
            (Phase::Sending, None) | (Phase::Queued | Phase::Ended(_), _) => false,
        };
        if begin {
            if self.record.phase == Phase::Queued {
                self.record.phase = Phase::Begun;
            }
            self.keep(save)?;
            push(
                &match self.store {
                    Some(name) => ToBridge::Store { job, kind, length, name },
                    None => ToBridge::Begin { job, kind, length },
                },
                out,
            );
        }
        if self.record.cancel {
            self.keep(save)?;
            push(&ToBridge::Cancel { job }, out);
        }
        Ok(())
    }

    /// Makes the record durable if it says anything new that matters.
    fn keep<E>(&mut self, save: &mut dyn FnMut(&Record) -> Result<(), E>) -> Result<(), E> {
        let matters = |record: &Record| (record.phase, record.cancel, record.bridge);
        if self.saved.as_ref().map(matters) != Some(matters(&self.record)) {
            save(&self.record)?;
            self.saved = Some(self.record);
        }
        Ok(())
    }
}

/// How a job has ended whose state is this, if it has.
fn outcome(state: JobState) -> Option<Outcome> {
    match state {
        JobState::Done => Some(Outcome::Printed),
        JobState::Cancelled => Some(Outcome::Cancelled),
        JobState::Broken(_) => Some(Outcome::Broken),
        JobState::Lost => Some(Outcome::Lost),
        JobState::Stored => Some(Outcome::Stored),
        JobState::None
        | JobState::Printing
        | JobState::Stopped(_)
        | JobState::Cancelling
        | JobState::Storing => None,
    }
}

fn push(message: &ToBridge<'_>, out: &mut Vec<u8>) {
    let mut buffer = [0; MAX];
    // Every message of ours fits a frame: pieces are at most DATA_MAX.
    if let Ok(length) = frame::write(message, &mut buffer) {
        out.extend_from_slice(&buffer[..length]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::link::message::{JobKind, PAST};

    fn said(message: &ToHost<'_>) -> Vec<u8> {
        let mut buffer = [0; MAX];
        let length = frame::write(message, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    /// A printed job, whose list of ended jobs is late, behind another job's progress.
    #[test]
    fn a_list_from_before_a_jobs_end_does_not_make_it_forgotten() {
        let record = Record { phase: Phase::Sending, ..Record::new(7, JobKind::Raw, 3) };
        let mut session = Session::new(record, b"abc");
        session.connected(Duration::ZERO);
        let other = Progress {
            job: 8,
            state: JobState::Printing,
            accepted: 1,
            limit: 1,
            printed: 0,
            pass: 0,
            row: 0,
        };
        let mut past = [PastJob::NONE; PAST];
        let hello = ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 1, firmware: "0" };
        session.hear(Duration::ZERO, &said(&hello)).unwrap();
        session.hear(Duration::ZERO, &said(&ToHost::Past(past))).unwrap();
        let mut now = Duration::ZERO;
        for _ in 0..9 {
            now += REPEAT;
            session.hear(now, &said(&ToHost::Progress(other))).unwrap();
            assert_eq!(session.outcome(), None);
        }
        past[0] = PastJob { job: 7, state: JobState::Done, printed: 3 };
        session.hear(now, &said(&ToHost::Past(past))).unwrap();
        assert_eq!(session.outcome(), Some(Outcome::Printed));
    }

    #[test]
    fn a_job_that_is_on_no_later_list_either_is_forgotten() {
        let record = Record { phase: Phase::Sending, ..Record::new(7, JobKind::Raw, 3) };
        let mut session = Session::new(record, b"abc");
        session.connected(Duration::ZERO);
        let hello = ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 1, firmware: "0" };
        session.hear(Duration::ZERO, &said(&hello)).unwrap();
        let none =
            Progress { job: 0, state: JobState::None, accepted: 0, limit: 0, printed: 0, pass: 0, row: 0 };
        for answer in 1..9 {
            session.hear(answer * REPEAT, &said(&ToHost::Past([PastJob::NONE; PAST]))).unwrap();
            session.hear(answer * REPEAT, &said(&ToHost::Progress(none))).unwrap();
        }
        assert_eq!(session.outcome(), Some(Outcome::Forgotten));
    }
}
