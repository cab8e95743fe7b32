//! The engine: frames in, printer bytes out, frames out. A state machine without input, output, clock or allocation;
//! everything that can go wrong on a cable is a sequence of calls to it.
//!
//! The board's loop passes on
//!
//! * bytes of the link to [`Engine::receive`], and [`Engine::link_lost`] when the link goes; bytes of a plain printer
//!   interface to [`Engine::local`];
//! * [`Engine::work`] while it returns true, a slice at a time, between other things;
//! * [`Engine::output`] to the port, [`Engine::consumed`] for what has crossed it, [`Engine::port`] for the state of the
//!   lines;
//! * [`Engine::task`] for what only the board can do, [`Engine::done`] for its outcome;
//! * a piece of the log to [`Engine::log`] when [`Engine::log_wanted`], its own use to [`Engine::usage`] when
//!   [`Engine::usage_wanted`]; [`Engine::transmit`] to the link until it returns nothing;
//! * what is to be stored, or printed from the store, and which job's sheet is to be noted, between this and a store
//!   ([`crate::alone`]);
//! * [`Engine::checkpoint`] to memory that outlives a reset, whenever bytes were consumed.
//!
//! **One byte, once.** Data carry their offset, and only the byte that comes next is taken. The bytes made from them
//! depend on nothing but the data, so the bytes at the port are the same however the link behaved. After a reset with a
//! [`Checkpoint`] the host sends the data again from the beginning. The engine works through them again and leaves out
//! as many bytes as had crossed the port.
//!
//! **Where the printer stands** ([`Standing`]) is asked at one gate: [`Engine::output`] gives bytes of a job in its own sheet only, and
//! `step_in` leads there. Nothing is given out while the printer's supply is absent.
//!
//! **Two queues.** Accepted data wait in one, printer bytes in the other, so the port has work while a band is being
//! decoded, and the link has credit while the printer is busy.

mod alone;
mod job;
mod link;
mod work;

pub use self::alone::Request;
pub use protocol::link::message::LOCAL;

use self::job::{Cancel, Job, Marks, Phase, Way, positions};
use crate::ring::Ring;
use crate::standing::{QUESTION, Standing};
use crate::streams::{Streams, WRITE_ROOM};
use heapless::Vec;
use protocol::link::frame::MAX;
use protocol::link::message::{
    ALONE, Answer, Fault, JobKind, JobState, Lines, PAST, PastJob, PortSettings, Progress, Refusal, ToHost,
};
use protocol::rgl::Track;
use protocol::runs::Decoder;

/// The memory of an engine.
pub struct Memory<'m> {
    /// Accepted data: the window of the link. At least 2 KiB; 8 to 16 KiB keep the link busy.
    pub data: &'m mut [u8],
    /// Printer bytes on their way to the port. At least 2 KiB; a band's worth (38 KB) keeps the port busy while
    /// the next band is decoded.
    pub output: &'m mut [u8],
    /// One band: 38,400 bytes for 4800 dots, 79,040 for the widest page at 1200 dpi. Jobs that need more are
    /// refused.
    pub band: &'m mut [u8],
    /// Eleven kilobytes of tables and counters; any, whatever it has decoded.
    pub decoder: &'m mut Decoder,
}

/// Least size of [`Memory::data`] and [`Memory::output`]. With less, the engine takes no job.
pub const LEAST_MEMORY: usize = 2048;

/// Who the bridge is, for the host.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Differs after every restart.
    pub boot: u32,
    /// The board's own number.
    pub serial: u64,
    /// Version of the firmware.
    pub firmware: &'static str,
}

/// What only the board can do. Until [`Engine::done`] nothing else uses the port.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Task {
    /// Give the port new settings.
    Configure(PortSettings),
    /// Put the status question to the printer and read the answer.
    PrinterStatus,
    /// Read the device ID.
    DeviceId,
    /// Reset the printer by nInit.
    Initialise,
    /// Restart in the boot loader.
    Bootloader,
    /// Set the port's outputs by hand.
    Drive {
        /// Data1..Data8.
        data: u8,
        /// nStrobe, nAutoFd, nInit, nSelectIn.
        control: u8,
    },
    /// The same, and read the inputs once they have settled.
    Probe {
        /// Data1..Data8.
        data: u8,
        /// nStrobe, nAutoFd, nInit, nSelectIn.
        control: u8,
    },
}

/// The outcome of a task.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome<'a> {
    /// Done, with nothing to report.
    Done,
    /// Done, and the printer cannot have noticed: it was without its supply.
    Unnoticed,
    /// The port cannot work with these settings.
    BadSettings,
    /// The answer to a question.
    Answer(Answer<'a>),
    /// The inputs.
    Lines(Lines),
}

/// What must outlive a reset of the bridge so that a job can continue after it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Checkpoint {
    /// Where the job stands.
    pub progress: Progress,
    /// Where its early end begins, in bytes at the port, once that is decided.
    pub ends_at: Option<u32>,
    /// Where the printer stands.
    pub standing: Standing,
    /// Whether the printer has shown that it does not negotiate.
    pub one_way: bool,
    /// Whether bytes were on their way to a printer that takes them.
    pub flowing: bool,
    /// Whether the job's data come from the board's flash.
    pub from_store: bool,
    /// The jobs of the link that have ended, the last one first.
    pub past: [PastJob; PAST],
}

impl Checkpoint {
    /// What is left when the board was reset from outside, which may have come between a strobe and its mark: then nobody knows
    /// whether the printer has that byte, and a job whose bytes were on their way is lost. Its own watchdog acts only when nothing
    /// has moved for seconds.
    #[must_use]
    pub fn reset_from_outside(mut self) -> Checkpoint {
        let Progress { job, printed, .. } = self.progress;
        if self.flowing && self.progress.is_open() && self.past.iter().all(|past| past.job != job) {
            self.progress.state = JobState::Lost;
            self.standing.tear(job);
            if job != LOCAL && job != ALONE {
                self.past.rotate_right(1);
                self.past[0] = PastJob { job, state: JobState::Lost, printed };
            }
        }
        self
    }
}

/// A task, and the number of the host's question if it answers one.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Assignment {
    task: Task,
    request: Option<u16>,
}

/// What the board has to do.
#[derive(Clone, Copy)]
enum Board {
    /// Nothing.
    Free,
    /// A task it has not been given yet.
    Assigned(Assignment),
    /// A task it is working on.
    Working(Assignment),
}

/// What is due to be sent to the host.
#[derive(Default)]
struct Due {
    hello: bool,
    progress: bool,
    lines: Option<u16>,
    past: bool,
    standing: bool,
    refused: Option<(Refusal, u32)>,
    /// Number of a question that needs no board, and the answer.
    answer: Option<(u16, Answer<'static>)>,
    /// Number of a question for the log, and from which byte on.
    log: Option<(u16, u32)>,
    /// Number of a question for the firmware's own use.
    usage: Option<u16>,
}

/// The engine. Some 13 KB beside the [`Memory`] it is given.
pub struct Engine<'m> {
    identity: Identity,
    data: Ring<'m>,
    output: Ring<'m>,
    streams: Streams<'m>,
    /// Follows raw data as they are accepted.
    ahead: Track,
    /// Follows raw data as they go to the output.
    sent: Track,
    marks: Marks,
    scratch: [u8; WRITE_ROOM],
    job: Option<Job>,
    /// How the job before ended.
    last: Progress,
    /// Its kind and length, if known.
    last_shape: Option<(JobKind, u32)>,
    /// The jobs of the link that have ended, the last one first.
    past: [PastJob; PAST],
    due: Due,
    /// The progress last sent to the host.
    reported: Progress,
    /// A frame for the host that cannot wait in its own form.
    frame: Vec<u8, MAX>,
    lines: Lines,
    fault: Option<Fault>,
    board: Board,
    /// Where the printer stands.
    standing: Standing,
    /// Somebody notes which sheet the printer is in before its first byte leaves ([`Engine::begin_sheet`]).
    keeps_diary: bool,
    /// The host gives up this job: it ends once the board has nothing in flight, with the printer's reset.
    abandoned: Option<u32>,
    /// The printer has shown that it does not negotiate, and was not switched off or reset since.
    one_way: bool,
    /// Somebody holds the job with the button: the printer gets nothing.
    held: bool,
    /// What the store has to do.
    request: Option<Request>,
    /// Jobs in the store.
    stored: usize,
    /// How often the host has spoken of a job that is being stored.
    words_of_store: u32,
}

const NOTHING: Progress =
    Progress { job: 0, state: JobState::None, accepted: 0, limit: 0, printed: 0, pass: 0, row: 0 };

impl<'m> Engine<'m> {
    /// An engine without a job.
    // Inlined into both of its callers it takes 0.9 KB more flash.
    #[inline(never)]
    pub fn new(memory: Memory<'m>, identity: Identity) -> Self {
        Engine {
            identity,
            data: Ring::new(memory.data),
            output: Ring::new(memory.output),
            streams: Streams::new(memory.band, memory.decoder),
            ahead: Track::new(),
            sent: Track::new(),
            marks: Marks::new(),
            scratch: [0; WRITE_ROOM],
            job: None,
            last: NOTHING,
            last_shape: None,
            past: [PastJob::NONE; PAST],
            due: Due::default(),
            reported: NOTHING,
            frame: Vec::new(),
            lines: Lines::IDLE,
            fault: None,
            board: Board::Free,
            standing: Standing::UNKNOWN,
            keeps_diary: false,
            abandoned: None,
            one_way: false,
            held: false,
            request: None,
            stored: 0,
            words_of_store: 0,
        }
    }

    /// An engine that continues where another one was when it was reset.
    pub fn resume(memory: Memory<'m>, identity: Identity, checkpoint: Checkpoint) -> Self {
        let mut engine = Self::new(memory, identity);
        let Checkpoint { standing, one_way, past, .. } = checkpoint;
        (engine.standing, engine.one_way, engine.past) = (standing, one_way, past);
        engine.resume_job(&checkpoint);
        if engine.job.as_ref().map(|job| job.id) != Some(engine.standing.job()) {
            // What it was in goes on no more: a plain job, a question, or a job that ended as the board was reset.
            engine.standing.tear(engine.standing.job());
        }
        engine
    }

    /// Opens the job that was open at a reset, as far as it can go on.
    fn resume_job(&mut self, checkpoint: &Checkpoint) {
        let Checkpoint { progress, ends_at, from_store, .. } = *checkpoint;
        let ended = |state| Progress { state, limit: progress.accepted, ..progress };
        if progress.job == 0 || !progress.is_open() {
            self.last = progress;
        } else if progress.job == LOCAL {
            // An operating system does not send again what it has sent to a plain printer.
            self.last = ended(JobState::Lost);
        } else if let Some(PastJob { state, printed, .. }) = self.remembered(progress.job) {
            // The reset came between the job's end and this checkpoint.
            self.last = Progress { printed, ..ended(state) };
        } else if progress.state == JobState::Storing {
            // What is stored of it does not count.
            self.last = ended(JobState::Cancelled);
            self.remember(PastJob { job: progress.job, state: JobState::Cancelled, printed: 0 });
        } else {
            self.job = Some(Job {
                printed: progress.printed,
                phase: Phase::Unknown,
                // The host repeats a cancel whose place was not decided.
                cancel: ends_at.map_or(Cancel::None, Cancel::Decided),
                pass: progress.pass,
                row: progress.row,
                ..Job::new(
                    progress.job,
                    JobKind::Raw,
                    0,
                    if from_store { Way::FromStore } else { Way::ToPort },
                )
            });
        }
    }

    /// Its memory, for the engine after a reset of a simulated board.
    #[cfg(any(test, feature = "simulation"))]
    pub fn into_memory(self) -> Memory<'m> {
        let (band, decoder) = self.streams.into_memory();
        Memory { data: self.data.into_memory(), output: self.output.into_memory(), band, decoder }
    }

    /// What must be kept so that [`Engine::resume`] can continue.
    pub fn checkpoint(&self) -> Checkpoint {
        let mut progress = self.progress();
        if self.job.as_ref().is_some_and(|job| job.way == Way::ToStore) {
            progress.state = JobState::Storing;
        }
        Checkpoint {
            progress,
            ends_at: self.job.as_ref().and_then(Job::ends_at),
            standing: self.standing,
            one_way: self.one_way,
            flowing: self.is_ready() && !self.output().is_empty(),
            from_store: self.job.as_ref().is_some_and(|job| job.way == Way::FromStore),
            past: self.past,
        }
    }

    /// Whether the printer takes bytes.
    pub(crate) fn is_ready(&self) -> bool {
        self.fault.is_none()
    }

    /// How an earlier job of the link has ended, if that is remembered.
    fn remembered(&self, job: u32) -> Option<PastJob> {
        self.past.iter().copied().find(|past| job != 0 && past.job == job)
    }

    /// Where the job stands.
    pub fn progress(&self) -> Progress {
        let Some(job) = &self.job else { return self.last };
        let state = match self.fault {
            _ if job.cancel != Cancel::None => JobState::Cancelling,
            _ if job.way == Way::ToStore => JobState::Storing,
            _ if self.held => JobState::Stopped(Fault::Held),
            Some(fault) => JobState::Stopped(fault),
            None => JobState::Printing,
        };
        let limit = match job.phase {
            Phase::Running => job.accepted.saturating_add(positions(self.data.free())).min(job.length),
            Phase::Unknown | Phase::Ending { .. } => job.accepted,
        };
        Progress {
            job: job.id,
            state,
            accepted: job.accepted,
            limit,
            printed: job.printed,
            pass: job.pass,
            row: job.row,
        }
    }

    /// Bytes for the port. They stay the same until [`Engine::consumed`]; more may come behind them.
    pub fn output(&self) -> &[u8] {
        self.output_behind(0)
    }

    /// Bytes for the port after the next `skip`, which are already on their way.
    pub fn output_behind(&self, skip: usize) -> &[u8] {
        // Nothing else uses the port during a task.
        match (&self.job, self.board) {
            (Some(job), Board::Free) if !self.is_off() && !self.held => match self.standing {
                Standing::InSheet(sheet) if sheet == job.id => self.output.behind(skip),
                _ => &[],
            },
            _ => &[],
        }
    }

    /// `count` bytes of [`Engine::output`] have crossed the port.
    pub fn consumed(&mut self, count: usize) {
        let count = count.min(self.output.len());
        self.output.pop(count);
        if let Some(job) = &mut self.job {
            job.printed += positions(count);
            if let Some((pass, row)) = self.marks.reach(job.printed) {
                (job.pass, job.row) = (pass, row);
            }
        }
        self.settle();
    }

    /// The state of the port: the levels of its lines, and the fault that keeps the printer from taking bytes, if there is
    /// one.
    pub fn port(&mut self, lines: Lines, fault: Option<Fault>) {
        (self.lines, self.fault) = (lines, fault);
        if self.is_off() {
            // Another one may be behind the cable when it is on again; or the same, which has forgotten what it had if it was
            // switched off, and has it still if only the cable was pulled.
            self.one_way = false;
            let crossed = self.job.as_ref().is_some_and(|job| job.printed > 0);
            self.standing.lose_supply(crossed);
            if crossed {
                self.end(JobState::Lost);
            }
        }
        self.step_in();
    }

    /// Whether the printer's supply is absent.
    fn is_off(&self) -> bool {
        self.fault == Some(Fault::PowerOff)
    }

    /// The levels of the port's lines when they were last told.
    pub fn lines(&self) -> Lines {
        self.lines
    }

    /// Whether no job is open and the board has nothing to do: the printer may be asked something.
    pub fn is_idle(&self) -> bool {
        self.job.is_none() && matches!(self.board, Board::Free)
    }

    /// Whether the printer may be asked who it is: it is known to stand between two jobs, and has not shown that it does not negotiate.
    pub fn may_negotiate(&self) -> bool {
        self.is_idle() && self.standing == Standing::AtRest && !self.one_way
    }

    /// The printer has not answered a negotiation. It is not tried again before it was switched off or reset.
    pub fn shown_one_way(&mut self) {
        self.one_way = true;
    }

    /// What the board has to do. Each task is given once.
    pub fn task(&mut self) -> Option<Task> {
        let Board::Assigned(assignment) = self.board else { return None };
        self.board = Board::Working(assignment);
        Some(assignment.task)
    }

    /// The task has this outcome.
    pub fn done(&mut self, outcome: Outcome<'_>) {
        let board = core::mem::replace(&mut self.board, Board::Free);
        let (Board::Assigned(done) | Board::Working(done)) = board else { return };
        match done.task {
            Task::Initialise => self.initialised(outcome != Outcome::Unnoticed),
            // The printer has half of the question.
            Task::PrinterStatus => self.standing.tear(QUESTION),
            Task::Drive { .. } | Task::Probe { .. } => self.standing.disturb(),
            Task::Configure(_) | Task::DeviceId | Task::Bootloader => {}
        }
        match (outcome, done.request) {
            (Outcome::BadSettings, _) => self.refuse(Refusal::Settings, 0),
            (Outcome::Answer(answer), Some(request)) => self.prepare(&ToHost::Answer { request, answer }),
            (Outcome::Lines(lines), Some(request)) => {
                self.prepare(&ToHost::Lines { request, lines, fault: lines.fault() });
            }
            (Outcome::Done | Outcome::Unnoticed, Some(request)) => self.due.lines = Some(request),
            (Outcome::Done | Outcome::Unnoticed | Outcome::Answer(_) | Outcome::Lines(_), _) => {}
        }
        self.step_in();
    }

    /// The status question is about to be put: a job of two bytes.
    pub fn begin_question(&mut self) {
        self.standing.enter(QUESTION);
    }

    /// The printer has taken none of the question's bytes, or all of them.
    pub fn end_question(&mut self) {
        self.standing.end(QUESTION);
    }

    /// The printer was reset, with nothing in flight. One without its supply has not noticed.
    fn initialised(&mut self, noticed: bool) {
        let noticed = noticed && !self.is_off();
        let abandoned = self.abandoned.take();
        if let Some(job) = &self.job
            && abandoned == Some(job.id)
        {
            let begun = job.printed > 0;
            if begun {
                self.standing.tear(job.id);
            } else {
                self.standing.end(job.id);
            }
            self.end(if begun { JobState::Lost } else { JobState::Cancelled });
        }
        if noticed {
            self.standing.reset();
            self.one_way = false;
        }
    }

    /// Where the printer stands.
    pub fn standing(&self) -> Standing {
        self.standing
    }

    /// From now on no first byte of a job leaves before [`Engine::begin_sheet`].
    pub fn keep_diary(&mut self) {
        self.keeps_diary = true;
    }

    /// What the diary says to a board without memory: whether the printer stands between two jobs, and the job that was lost, or 0. If it
    /// does not stand there, it may have a part of that job.
    pub fn wake(&mut self, at_rest: bool, lost: u32) {
        self.standing = if at_rest { Standing::AtRest } else { Standing::Unknown { job: lost, due: false } };
        if lost != QUESTION {
            self.last = Progress { job: lost, state: JobState::Lost, ..NOTHING };
            self.was_lost(lost);
        }
    }

    /// The diary has a job whose sheet was lost.
    pub fn was_lost(&mut self, job: u32) {
        self.remember(PastJob { job, state: JobState::Lost, printed: 0 });
    }

    /// Whether this job is known to be lost.
    pub fn has_lost(&self, job: u32) -> bool {
        let last = self.last.job == job && self.last.state == JobState::Lost;
        last || self.remembered(job).is_some_and(|past| past.state == JobState::Lost)
    }

    /// The job whose first byte would leave now, were its sheet noted.
    pub fn waits_to_begin(&self) -> Option<u32> {
        let free = matches!(self.board, Board::Free) && self.standing == Standing::AtRest;
        self.job.as_ref().filter(|_| free && self.has_bytes()).map(|job| job.id)
    }

    /// It is noted that the printer is in this job's sheet: its bytes may leave.
    pub fn begin_sheet(&mut self, job: u32) {
        if self.waits_to_begin() == Some(job) {
            self.standing.enter(job);
        }
    }

    /// Whether there are bytes for a printer that takes them.
    fn has_bytes(&self) -> bool {
        self.is_ready() && !self.held && !self.output.is_empty()
    }

    /// Takes the next step towards the sheet of the open job: a reset of a printer of which nothing is known, then the sheet itself. A
    /// printer with a fault waits for its end, since its supply may be gone for too short a time to count yet.
    pub(super) fn step_in(&mut self) {
        if let Standing::Unknown { due, .. } = self.standing
            && (due && self.is_ready() || self.job.is_some() && self.has_bytes())
        {
            self.assign(Task::Initialise, None);
        }
        self.begin_unnoted();
    }

    /// Begins the sheet that waits, where nobody notes that.
    pub(super) fn begin_unnoted(&mut self) {
        if !self.keeps_diary
            && let Some(job) = self.waits_to_begin()
        {
            self.standing.enter(job);
        }
    }

    /// Assigns a task to the board; false if it has another.
    fn assign(&mut self, task: Task, request: Option<u16>) -> bool {
        let wanted = Assignment { task, request };
        if matches!(self.board, Board::Free) {
            self.board = Board::Assigned(wanted);
        }
        self.is_at(wanted)
    }

    /// Whether the board has this very task: a question that the host repeats, since frames may be lost, is
    /// answered once.
    fn is_at(&self, wanted: Assignment) -> bool {
        matches!(self.board, Board::Assigned(own) | Board::Working(own) if own == wanted)
    }
}
