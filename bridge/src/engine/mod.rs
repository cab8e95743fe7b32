//! The bridge's mind: frames in, printer bytes out, frames out. No input or output of its own, no clock, no
//! allocation; everything that can go wrong on a cable is a sequence of calls to it.
//!
//! The board's loop is:
//!
//! * bytes of the link to [`Engine::receive`], [`Engine::link_lost`] when it goes; bytes of a plain printer interface
//!   to [`Engine::local`];
//! * [`Engine::work`] while it returns true, a slice at a time, between other things;
//! * [`Engine::output`] to the port, [`Engine::consumed`] for what has crossed it, [`Engine::port`] for what the
//!   lines say;
//! * [`Engine::task`] for what only the board can do, [`Engine::done`] for what came of it;
//! * a piece of the log to [`Engine::log`] when [`Engine::log_wanted`]; [`Engine::transmit`] to the link until it gives
//!   nothing;
//! * [`Engine::checkpoint`] to memory that outlives a reset, whenever bytes were consumed.
//!
//! **One byte, once.** Data carry their offset, and only the byte that comes next is taken. What is made of them
//! depends on nothing but the data, so the bytes at the port are the same however the link behaved. After a reset
//! with a [`Checkpoint`] the host sends the data again from the beginning; they are worked through again, and as
//! many bytes as had crossed the port are left out.
//!
//! **Two queues.** Accepted data wait in one, printer bytes in the other, so the port has work while a band is
//! being decoded and the link has credit while the printer is busy.

mod job;
mod link;
mod work;

use self::job::{Job, Marks, Phase};
use crate::ring::Ring;
use crate::streams::{Streams, WRITE_ROOM};
use crate::track::Track;
use protocol::link::frame::MAX;
use protocol::link::message::{
    Answer, Fault, JobKind, JobState, Lines, PortSettings, Progress, Refusal, ToHost,
};

/// The memory of an engine.
pub struct Memory<'m> {
    /// Accepted data: the window of the link. At least 2 KiB, 8 to 16 keep it busy.
    pub data: &'m mut [u8],
    /// Printer bytes on their way to the port. At least 2 KiB; a band's worth (38 KB) keeps the port busy while
    /// the next band is decoded.
    pub output: &'m mut [u8],
    /// One band: 38,400 bytes for 4800 dots, 79,040 for the widest page at 1200 dpi. Jobs that need more are
    /// refused.
    pub band: &'m mut [u8],
}

/// Least size of [`Memory::data`] and [`Memory::output`]; with less, no job is taken.
pub const LEAST_MEMORY: usize = 2048;

/// Number of a job that came through [`Engine::local`] and not through the link.
pub const LOCAL: u32 = u32::MAX;

/// What the bridge says about itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Differs after every restart.
    pub boot: u32,
    /// The board's own number.
    pub serial: u64,
    /// Version of the firmware.
    pub firmware: &'static str,
}

/// What only the board can do. The port is the task's alone until [`Engine::done`].
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
    /// The same, and look at the inputs when they have settled.
    Probe {
        /// Data1..Data8.
        data: u8,
        /// nStrobe, nAutoFd, nInit, nSelectIn.
        control: u8,
    },
}

/// What came of a task.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome<'a> {
    /// It is done and there is nothing to say.
    Done,
    /// The port cannot work with these settings.
    BadSettings,
    /// The answer to a question.
    Answer(Answer<'a>),
    /// The inputs.
    Lines(Lines),
}

/// What has to outlive a reset of the bridge for a job to go on after it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Checkpoint {
    /// Where the job stands.
    pub progress: Progress,
    /// Where its early end begins, in bytes at the port, once that is decided.
    pub ends_at: Option<u32>,
    /// Whether the printer still has to be reset, behind this job or, if one is open, before its first byte.
    pub needs_reset: bool,
}

/// What is to be said to the host.
#[derive(Default)]
struct Due {
    hello: bool,
    progress: bool,
    lines: Option<u16>,
    refused: Option<(Refusal, u32)>,
    not_now: Option<u16>,
    /// Number of a question for the log, and from where on.
    log: Option<(u16, u32)>,
}

/// The engine. Some 13 KB beside the [`Memory`] it is given.
pub struct Engine<'m> {
    identity: Identity,
    data: Ring<'m>,
    output: Ring<'m>,
    streams: Streams<'m>,
    /// Follows the accepted data, to find whole commands.
    ahead: Track,
    /// Follows what goes to the output.
    sent: Track,
    marks: Marks,
    scratch: [u8; WRITE_ROOM],
    job: Option<Job>,
    /// The last job that ended, or nothing.
    last: Progress,
    /// Kind and length of that job, as far as known.
    last_shape: Option<(JobKind, u32)>,
    /// Jobs that ended before it.
    older: [u32; 8],
    due: Due,
    /// What the host was last told.
    told: Progress,
    /// A frame that is ready to go.
    frame: [u8; MAX],
    frame_length: usize,
    lines: Lines,
    fault: Option<Fault>,
    task: Option<Task>,
    task_given: bool,
    /// The number of the question the task is for.
    request: u16,
    /// The open job ends where the printer's state is not known.
    needs_reset: bool,
    /// A job has ended so: the printer gets no byte before it was reset, whatever is open now.
    owes_reset: bool,
}

const NOTHING: Progress =
    Progress { job: 0, state: JobState::None, accepted: 0, limit: 0, printed: 0, pass: 0, row: 0 };

impl<'m> Engine<'m> {
    /// An engine without a job.
    pub fn new(memory: Memory<'m>, identity: Identity) -> Self {
        Engine {
            identity,
            data: Ring::new(memory.data),
            output: Ring::new(memory.output),
            streams: Streams::new(memory.band),
            ahead: Track::new(),
            sent: Track::new(),
            marks: Marks::new(),
            scratch: [0; WRITE_ROOM],
            job: None,
            last: NOTHING,
            last_shape: None,
            older: [0; 8],
            due: Due::default(),
            told: NOTHING,
            frame: [0; MAX],
            frame_length: 0,
            lines: Lines::IDLE,
            fault: None,
            task: None,
            task_given: false,
            request: 0,
            needs_reset: false,
            owes_reset: false,
        }
    }

    /// An engine that goes on where another one was when it was reset.
    pub fn resume(memory: Memory<'m>, identity: Identity, checkpoint: Checkpoint) -> Self {
        let mut engine = Self::new(memory, identity);
        let Checkpoint { progress, ends_at, needs_reset } = checkpoint;
        engine.owes_reset = needs_reset;
        if progress.job == 0 || is_final(progress.state) {
            engine.last = progress;
            return engine;
        }
        if progress.job == LOCAL {
            // What an operating system has sent to a plain printer it does not send again.
            engine.last = Progress { state: JobState::Lost, ..progress };
            engine.owes_reset = true;
            engine.assign(Task::Initialise);
            return engine;
        }
        engine.job = Some(Job {
            id: progress.job,
            kind: JobKind::Raw,
            length: 0,
            accepted: 0,
            used: 0,
            made: 0,
            printed: progress.printed,
            phase: Phase::Unknown,
            // A cancel that had not been decided upon is the host's to repeat.
            cancelled: ends_at.is_some(),
            ends_at,
            settled: 0,
            closed: 0,
            pass: progress.pass,
            row: progress.row,
        });
        engine
    }

    /// What has to be kept so that [`Engine::resume`] can go on.
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            progress: self.progress(),
            ends_at: self.job.as_ref().and_then(|job| job.ends_at),
            // What an open job needs behind it comes out again when it is worked through again.
            needs_reset: self.owes_reset,
        }
    }

    /// Where the job stands.
    pub fn progress(&self) -> Progress {
        let Some(job) = &self.job else { return self.last };
        let state = match (self.fault, job.phase) {
            _ if job.cancelled => JobState::Cancelling,
            (Some(fault), _) => JobState::Stopped(fault),
            (None, _) => JobState::Printing,
        };
        let limit = match job.phase {
            Phase::Running => job.accepted.saturating_add(self.data.free() as u32).min(job.length),
            Phase::Unknown | Phase::Ending(_) => job.accepted,
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

    /// Bytes for the port. The same bytes until [`Engine::consumed`]; more may come behind them.
    pub fn output(&self) -> &[u8] {
        self.output_behind(0)
    }

    /// Bytes for the port behind the next `skip`, which are on their way already.
    pub fn output_behind(&self, skip: usize) -> &[u8] {
        // A task has the port for itself, and a printer that has to be reset gets nothing before that.
        if self.task.is_some() || self.owes_reset { &[] } else { self.output.behind(skip) }
    }

    /// So many bytes of [`Engine::output`] have crossed the port.
    pub fn consumed(&mut self, count: usize) {
        let count = count.min(self.output.len());
        self.output.pop(count);
        if let Some(job) = &mut self.job {
            job.printed += count as u32;
            if let Some((pass, row)) = self.marks.reach(job.printed) {
                (job.pass, job.row) = (pass, row);
            }
        }
        self.settle();
    }

    /// What the port's lines say: the levels, and the fault that keeps the printer from taking bytes, or that
    /// there is none.
    pub fn port(&mut self, lines: Lines, fault: Option<Fault>) {
        (self.lines, self.fault) = (lines, fault);
        if fault == Some(Fault::PowerOff) && self.job.as_ref().is_some_and(|job| job.printed > 0) {
            // Switched on again the printer is a new one, and the rest of a row would be text to it. If only the cable
            // was pulled it is not, and the next job would be.
            self.end(JobState::Lost);
            self.owes_reset = true;
        } else if self.owes_reset && fault.is_none() {
            self.assign(Task::Initialise);
        }
    }

    /// Whether no job is open and nothing is to be done: the printer may be asked something.
    pub fn is_idle(&self) -> bool {
        self.job.is_none() && self.task.is_none()
    }

    /// What the board is to do, once.
    pub fn task(&mut self) -> Option<Task> {
        if core::mem::replace(&mut self.task_given, true) { None } else { self.task }
    }

    /// What came of the task.
    pub fn done(&mut self, outcome: Outcome<'_>) {
        if self.task.take() == Some(Task::Initialise) {
            // A printer that was not there has felt nothing of it.
            self.owes_reset &= self.fault == Some(Fault::PowerOff);
        }
        match outcome {
            Outcome::Done => {}
            Outcome::BadSettings => self.refuse(Refusal::Settings, 0),
            Outcome::Answer(answer) => self.prepare(&ToHost::Answer { request: self.request, answer }),
            Outcome::Lines(lines) => {
                self.prepare(&ToHost::Lines { request: self.request, lines, fault: lines.fault() });
            }
        }
        if self.owes_reset && self.fault != Some(Fault::PowerOff) {
            self.assign(Task::Initialise);
        }
    }
}

fn is_final(state: JobState) -> bool {
    match state {
        JobState::None | JobState::Done | JobState::Cancelled | JobState::Broken(_) | JobState::Lost => true,
        JobState::Printing | JobState::Stopped(_) | JobState::Cancelling => false,
    }
}
