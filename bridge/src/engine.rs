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
//! * [`Engine::transmit`] to the link until it gives nothing;
//! * [`Engine::checkpoint`] to memory that outlives a reset, whenever bytes were consumed.
//!
//! **One byte, once.** Data carry their offset, and only the byte that comes next is taken. What is made of them
//! depends on nothing but the data, so the bytes at the port are the same however the link behaved. After a reset
//! with a [`Checkpoint`] the host sends the data again from the beginning; they are worked through again, and as
//! many bytes as had crossed the port are left out.
//!
//! **Two queues.** Accepted data wait in one, printer bytes in the other, so the port has work while a band is
//! being decoded and the link has credit while the printer is busy.

use crate::ring::Ring;
use crate::streams::{Streams, WRITE_ROOM};
use crate::track::{ENDING_ROOM, Track};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, Defect, DefectKind, Fault, JobKind, JobState, Lines, PortSettings, Progress, Refusal,
    SCHEMA, ToBridge, ToHost, VERSION,
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
}

/// What has to outlive a reset of the bridge for a job to go on after it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Checkpoint {
    /// Where the job stands.
    pub progress: Progress,
    /// Where its early end begins, in bytes at the port, once that is decided.
    pub ends_at: Option<u32>,
}

/// How the job under way ends when the output is empty.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// After a reset: the host has to say again what the job is.
    Unknown,
    /// Data come and bytes go.
    Running,
    /// Everything is in the output; then the job is this.
    Ending(JobState),
}

struct Job {
    id: u32,
    kind: JobKind,
    length: u32,
    accepted: u32,
    /// Data taken out of the queue again.
    used: u32,
    /// Bytes made for the port, those left out after a reset among them.
    made: u32,
    /// Bytes that crossed it.
    printed: u32,
    phase: Phase,
    /// Cancelled by the host.
    cancelled: bool,
    ends_at: Option<u32>,
    /// For raw jobs: the data up to here are whole commands.
    settled: u32,
    /// For raw jobs: up to here the job could be ended, of the data that have gone to the output.
    closed: u32,
    pass: u8,
    row: u16,
}

impl Job {
    /// Whether nothing more of the data is to go to the port, because the host has said so. What had crossed the
    /// port before a reset is gone through first, so that the end comes where it came, or behind it.
    fn must_stop(&self) -> bool {
        match self.ends_at {
            Some(at) => self.made >= at,
            None => self.cancelled && self.made >= self.printed,
        }
    }
}

/// Positions on the sheet of bytes in the output, to say what crossed the port.
struct Marks {
    marks: [(u32, u8, u16); 16],
    first: usize,
    count: usize,
}

impl Marks {
    const fn new() -> Self {
        Marks { marks: [(0, 0, 0); 16], first: 0, count: 0 }
    }

    /// Notes that what comes after byte `at` belongs there. With all places taken the note is left out.
    fn push(&mut self, at: u32, (pass, row): (u8, u16)) {
        if self.count < self.marks.len() {
            self.marks[(self.first + self.count) % self.marks.len()] = (at, pass, row);
            self.count += 1;
        }
    }

    /// The last position not beyond byte `at`, if there is one; it is removed.
    fn reach(&mut self, at: u32) -> Option<(u8, u16)> {
        let mut reached = None;
        while self.count > 0 && self.marks[self.first].0 <= at {
            reached = Some((self.marks[self.first].1, self.marks[self.first].2));
            self.first = (self.first + 1) % self.marks.len();
            self.count -= 1;
        }
        reached
    }
}

/// What is to be said to the host.
#[derive(Default)]
struct Due {
    hello: bool,
    progress: bool,
    lines: Option<u16>,
    refused: Option<(Refusal, u32)>,
    not_now: Option<u16>,
}

/// The engine. Some 11 KB beside the [`Memory`] it is given.
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
    /// A job was ended where the printer's state is not known: it has to be reset before anything else.
    needs_reset: bool,
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
        }
    }

    /// An engine that goes on where another one was when it was reset.
    pub fn resume(memory: Memory<'m>, identity: Identity, checkpoint: Checkpoint) -> Self {
        let mut engine = Self::new(memory, identity);
        let Checkpoint { progress, ends_at } = checkpoint;
        if progress.job == 0 || is_final(progress.state) {
            engine.last = progress;
            return engine;
        }
        if progress.job == LOCAL {
            // What an operating system has sent to a plain printer it does not send again.
            engine.last = Progress { state: JobState::Lost, ..progress };
            engine.needs_reset = true;
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
        Checkpoint { progress: self.progress(), ends_at: self.job.as_ref().and_then(|job| job.ends_at) }
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

    // ---- link, inwards ----

    /// The link was cut: answers that were due would meet another conversation. The job goes on. The link's reader
    /// is to be [reset](Reader::reset) too.
    pub fn link_lost(&mut self) {
        self.frame_length = 0;
        self.due = Due::default();
    }

    /// Bytes from a link, in any portions. Every link has its own reader; a board with two of them (a serial
    /// port and bulk endpoints, say) may serve both, the answers going to the one that spoke last.
    pub fn receive(&mut self, reader: &mut Reader, mut bytes: &[u8]) {
        loop {
            match reader.read(bytes) {
                Read::More => return,
                // Damage needs no answer: what was lost is sent again.
                Read::Damaged(_, rest) => bytes = rest,
                Read::Message(message, rest) => {
                    bytes = rest;
                    match frame::decode(message) {
                        Ok(message) => self.follow(message),
                        Err(frame::Unknown) => self.refuse(Refusal::Unknown, 0),
                    }
                }
            }
        }
    }

    fn refuse(&mut self, reason: Refusal, job: u32) {
        self.due.refused = Some((reason, job));
    }

    fn follow(&mut self, message: ToBridge<'_>) {
        match message {
            ToBridge::Hello { .. } => (self.due.hello, self.due.progress) = (true, true),
            ToBridge::Begin { job, kind, length } => self.begin(job, kind, length),
            ToBridge::Data { job, offset, bytes } => self.take(job, offset, bytes),
            ToBridge::Cancel { job } => self.cancel(job),
            ToBridge::Ask { request, what: Ask::Lines } => self.due.lines = Some(request),
            ToBridge::Ask { request, what: Ask::Printer } => self.ask(request, Task::PrinterStatus),
            ToBridge::Ask { request, what: Ask::DeviceId } => self.ask(request, Task::DeviceId),
            ToBridge::Configure(settings) => {
                // Harmless at any time, and wanted most when a job is stuck.
                if !self.assign(Task::Configure(settings)) {
                    self.refuse(Refusal::Settings, 0);
                }
            }
            ToBridge::Initialise => {
                // A job from before a reset whose data nobody has any more can only be given up.
                if self.job.as_ref().is_some_and(|job| job.phase == Phase::Unknown) {
                    self.end(JobState::Lost);
                }
                self.between_jobs(Task::Initialise);
            }
            ToBridge::Bootloader => self.between_jobs(Task::Bootloader),
            ToBridge::Drive { data, control } => self.between_jobs(Task::Drive { data, control }),
        }
    }

    fn begin(&mut self, id: u32, kind: JobKind, length: u32) {
        if id == 0 || id == LOCAL || length == 0 {
            return self.refuse(Refusal::Empty, id);
        }
        self.due.progress = true;
        if let Some(job) = &mut self.job {
            if job.id != id {
                self.refuse(Refusal::JobOpen, id);
            } else if job.phase == Phase::Unknown {
                (job.kind, job.length, job.phase) = (kind, length, Phase::Running);
            } else if (job.kind, job.length) != (kind, length) {
                self.refuse(Refusal::OtherJob, id);
            }
            return;
        }
        if self.last.job == id {
            if self.last_shape.is_some_and(|shape| shape != (kind, length)) {
                self.refuse(Refusal::OtherJob, id);
            }
            return;
        }
        if self.older.contains(&id) {
            return self.refuse(Refusal::OtherJob, id);
        }
        if !self.open(id, kind, length) {
            self.refuse(Refusal::Empty, id);
        }
    }

    /// Opens a job, if there is memory to speak of.
    fn open(&mut self, id: u32, kind: JobKind, length: u32) -> bool {
        if self.data.capacity() < LEAST_MEMORY || self.output.capacity() < LEAST_MEMORY {
            return false;
        }
        if self.last.job != 0 && self.last.job != LOCAL {
            self.older.rotate_right(1);
            self.older[0] = self.last.job;
        }
        self.job = Some(Job {
            id,
            kind,
            length,
            accepted: 0,
            used: 0,
            made: 0,
            printed: 0,
            phase: Phase::Running,
            cancelled: false,
            ends_at: None,
            settled: 0,
            closed: 0,
            pass: 0,
            row: 0,
        });
        self.clear();
        true
    }

    /// Bytes from an interface that knows nothing of jobs: the printer class, for whatever an operating system
    /// sends. Gives the number of bytes taken; the rest is to be offered again, which on USB is a NAK. Nothing is
    /// taken while a job of the link is open or the end of the last one has not crossed the port.
    ///
    /// A job ends with the reset behind its rows, and otherwise with [`Engine::local_end`].
    pub fn local(&mut self, bytes: &[u8]) -> usize {
        if bytes.is_empty() || self.job.is_none() && !self.open(LOCAL, JobKind::Raw, u32::MAX) {
            return 0;
        }
        let Some(job) = &mut self.job else { return 0 };
        if job.id != LOCAL || job.phase != Phase::Running || job.length != u32::MAX {
            return 0;
        }
        // A job of 4 GB is over when it is that long.
        let room = self.data.free().min((u32::MAX - 1 - job.accepted) as usize);
        let mut taken = &bytes[..bytes.len().min(room)];
        let settled = self.ahead.follow(taken);
        if let Some(over) = self.ahead.over() {
            // The track has looked beyond the end, but that is where it is thrown away.
            taken = &taken[..over];
            job.length = job.accepted + over as u32;
        }
        self.data.push(taken);
        let before = job.accepted;
        job.accepted += taken.len() as u32;
        if let Some(count) = settled {
            job.settled = (before + count as u32).min(job.accepted);
        }
        taken.len()
    }

    /// No more bytes of a job come through [`Engine::local`]: the interface was reset, or has been silent for
    /// longer than anything that prints is.
    pub fn local_end(&mut self) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == LOCAL && job.phase == Phase::Running) {
            job.length = job.accepted;
        }
    }

    /// Empties everything that belongs to a job.
    fn clear(&mut self) {
        self.data.clear();
        self.output.clear();
        self.streams.restart();
        (self.ahead, self.sent) = (Track::new(), Track::new());
        self.marks = Marks::new();
    }

    fn take(&mut self, id: u32, offset: u32, bytes: &[u8]) {
        let Some(job) = self.job.as_mut().filter(|job| job.id == id) else {
            if self.last.job == id {
                // It has ended; the host has not heard of it.
                self.due.progress = true;
            } else {
                self.refuse(Refusal::NoSuchJob, id);
            }
            return;
        };
        let end = u64::from(offset) + bytes.len() as u64;
        if job.phase != Phase::Running || offset > job.accepted || end <= u64::from(job.accepted) {
            self.due.progress = true;
            return;
        }
        // Below the accepted position, and so below `bytes.len()`.
        let fresh = &bytes[(job.accepted - offset) as usize..];
        if end > u64::from(job.length) || fresh.len() > self.data.free() {
            self.due.progress = true;
            return self.refuse(Refusal::BeyondLimit, id);
        }
        self.data.push(fresh);
        job.accepted += fresh.len() as u32;
        if job.kind == JobKind::Raw
            && let Some(count) = self.ahead.follow(fresh)
        {
            job.settled = job.accepted - (fresh.len() - count) as u32;
        }
        if job.accepted == job.length || end > u64::from(job.accepted) {
            self.due.progress = true;
        }
    }

    fn cancel(&mut self, id: u32) {
        self.due.progress = true;
        match &mut self.job {
            Some(job) if job.id == id => {
                if !matches!(job.phase, Phase::Ending(_)) {
                    // After a reset the data are needed even for this: only they tell what the printer waits for.
                    job.cancelled = true;
                }
            }
            _ if self.last.job == id => {}
            _ => self.refuse(Refusal::NoSuchJob, id),
        }
    }

    fn ask(&mut self, request: u16, task: Task) {
        if self.job.is_some() || !self.assign(task) {
            self.due.not_now = Some(request);
        } else {
            self.request = request;
        }
    }

    fn between_jobs(&mut self, task: Task) {
        if self.job.is_some() || !self.assign(task) {
            self.refuse(Refusal::JobOpen, self.job.as_ref().map_or(0, |job| job.id));
        }
    }

    fn assign(&mut self, task: Task) -> bool {
        if self.task.is_some() {
            return false;
        }
        (self.task, self.task_given) = (Some(task), false);
        true
    }

    // ---- link, outwards ----

    /// The next frame for the link, or 0 if there is nothing to say.
    pub fn transmit(&mut self, out: &mut [u8; MAX]) -> usize {
        let wrote = |message: ToHost<'_>, out: &mut [u8; MAX]| frame::write(&message, out).unwrap_or(0);
        if core::mem::take(&mut self.due.hello) {
            let Identity { boot, serial, firmware } = self.identity;
            return wrote(ToHost::Hello { version: VERSION, schema: SCHEMA, boot, serial, firmware }, out);
        }
        if let Some((reason, job)) = self.due.refused.take() {
            return wrote(ToHost::Refused { reason, job }, out);
        }
        let now = self.progress();
        if self.due.progress || self.worth_telling(&now) {
            self.due.progress = false;
            self.told = now;
            return wrote(ToHost::Progress(now), out);
        }
        if let Some(request) = self.due.lines.take() {
            return wrote(ToHost::Lines { request, lines: self.lines, fault: self.fault }, out);
        }
        if let Some(request) = self.due.not_now.take() {
            return wrote(ToHost::Answer { request, answer: Answer::NotNow }, out);
        }
        let length = core::mem::take(&mut self.frame_length);
        out[..length].copy_from_slice(&self.frame[..length]);
        length
    }

    fn worth_telling(&self, now: &Progress) -> bool {
        let eighth = (self.data.capacity() / 8).max(1) as u32;
        now.job != self.told.job
            || now.state != self.told.state
            || now.limit.wrapping_sub(self.told.limit) >= eighth && now.limit != self.told.limit
            || now.accepted.wrapping_sub(self.told.accepted) >= eighth
            || now.printed.wrapping_sub(self.told.printed) >= 4096
    }

    /// A piece of the firmware's log for the host; false if the last one has not gone yet.
    pub fn log(&mut self, bytes: &[u8]) -> bool {
        self.frame_length == 0 && {
            self.frame_length = frame::write(&ToHost::Log(bytes), &mut self.frame).unwrap_or(0);
            true
        }
    }

    // ---- port ----

    /// Bytes for the port. The same bytes until [`Engine::consumed`]; more may come behind them.
    pub fn output(&self) -> &[u8] {
        // A task has the port for itself, and a printer that has to be reset gets nothing before that.
        if self.task.is_some() { &[] } else { self.output.front() }
    }

    /// So many bytes of [`Engine::output`] have crossed the port.
    pub fn consumed(&mut self, count: usize) {
        let count = count.min(self.output.front().len());
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
            // Switched on again the printer is a new one, and the rest of a row would be text to it.
            self.end(JobState::Lost);
        }
    }

    /// What the board is to do, once.
    pub fn task(&mut self) -> Option<Task> {
        if core::mem::replace(&mut self.task_given, true) { None } else { self.task }
    }

    /// What came of the task.
    pub fn done(&mut self, outcome: Outcome<'_>) {
        if self.task.take() == Some(Task::Initialise) {
            self.needs_reset = false;
        }
        match outcome {
            Outcome::Done => {}
            Outcome::BadSettings => self.refuse(Refusal::Settings, 0),
            Outcome::Answer(answer) => {
                let message = ToHost::Answer { request: self.request, answer };
                self.frame_length = frame::write(&message, &mut self.frame).unwrap_or(0);
            }
        }
        if self.needs_reset {
            self.assign(Task::Initialise);
        }
    }

    // ---- work ----

    /// Does a slice of work, if there is some; true if there may be more.
    pub fn work(&mut self) -> bool {
        let Some(job) = &self.job else { return false };
        if job.phase != Phase::Running || self.output.free() < WRITE_ROOM {
            return false;
        }
        let worked = match job.kind {
            JobKind::Raw => self.work_raw(),
            JobKind::Streams => self.work_streams(),
        };
        self.settle();
        worked
    }

    fn work_raw(&mut self) -> bool {
        let Some(job) = &mut self.job else { return false };
        if job.must_stop() {
            if job.used > job.closed && job.used < job.settled && job.ends_at.is_none() {
                self.pass_command();
            } else {
                self.end_raw();
            }
            return true;
        }
        // Whole commands only, and none before the first row, so that wherever the job ends the printer is not
        // inside one. A command longer than the queue has to go in pieces all the same.
        let complete = job.accepted == job.length;
        let held = !complete && !self.ahead.has_rows();
        let stuck = self.data.free() == 0 && (held || job.settled <= job.used);
        let until = if stuck || self.ahead.is_foreign() {
            job.accepted
        } else if held {
            job.used
        } else {
            job.settled.max(job.used)
        };
        let until = job.ends_at.map_or(until, |at| at.min(until));
        if job.used < until {
            let count = (until - job.used) as usize;
            self.pass(count);
            return true;
        }
        if complete {
            self.end_raw();
        }
        complete
    }

    /// Moves at most so many bytes of a raw job to the output.
    fn pass(&mut self, count: usize) {
        let Some(job) = &mut self.job else { return };
        let front = self.data.front();
        let count = front.len().min(count).min(WRITE_ROOM);
        self.scratch[..count].copy_from_slice(&front[..count]);
        self.data.pop(count);
        if let Some(closed) = self.sent.follow(&self.scratch[..count]) {
            job.closed = job.used + closed as u32;
        }
        job.used += count as u32;
        let position = self.sent.position();
        self.emit(count, Some(position));
    }

    /// Moves the rest of the command under way, which has been accepted whole, to the output.
    fn pass_command(&mut self) {
        for _ in 0..WRITE_ROOM {
            self.pass(1);
            if self.job.as_ref().is_none_or(|job| job.used == job.closed) || self.output.free() == 0 {
                return;
            }
        }
    }

    /// Everything that will go to the port of a raw job has gone, but for its ending.
    fn end_raw(&mut self) {
        let Some(job) = &mut self.job else { return };
        let foreign = self.sent.is_foreign();
        let whole = job.used == job.length;
        let open = job.used > 0 && self.sent.is_open() && !foreign;
        let state = match (whole && !open, job.cancelled) {
            // Even if cancelled: all of it was on its way.
            (true, _) => JobState::Done,
            (false, true) => JobState::Cancelled,
            (false, false) => JobState::Broken(Defect { at: job.accepted, what: DefectKind::Truncated }),
        };
        if job.cancelled {
            job.ends_at = Some(job.used);
        }
        if job.used > 0 && state != JobState::Done && (foreign || job.used != job.closed) {
            self.needs_reset = true;
        } else if open {
            let mut ending = [0; ENDING_ROOM];
            let length = self.sent.ending(&mut ending);
            self.scratch[..length].copy_from_slice(&ending[..length]);
            self.emit(length, None);
        }
        self.finish(state);
    }

    fn work_streams(&mut self) -> bool {
        let Some(job) = &mut self.job else { return false };
        if job.must_stop() {
            job.ends_at = Some(job.made);
            return self.end_streams(JobState::Cancelled);
        }
        let before = self.streams.position();
        match self.streams.work(self.data.front(), &mut self.scratch) {
            Ok(worked) => {
                self.data.pop(worked.used);
                job.used += worked.used as u32;
                let (used, accepted, length) = (job.used, job.accepted, job.length);
                let after = self.streams.position();
                // A note every sixteen rows is enough to say where the sheet is.
                if worked.written > 0 {
                    let noted = before.0 != after.0 || after.1.is_multiple_of(16);
                    self.emit(worked.written, noted.then_some(after));
                }
                if self.streams.ended() {
                    let excess = Defect { at: used, what: DefectKind::Excess };
                    let state = if used < length { JobState::Broken(excess) } else { JobState::Done };
                    self.finish(state);
                    return true;
                }
                if !worked.progress && accepted == length && self.data.is_empty() {
                    let defect = Defect { at: length, what: DefectKind::Truncated };
                    return self.end_streams(JobState::Broken(defect));
                }
                worked.progress
            }
            Err(what) => {
                let defect = Defect { at: job.used, what };
                self.end_streams(JobState::Broken(defect))
            }
        }
    }

    fn end_streams(&mut self, state: JobState) -> bool {
        let length = self.streams.cancel(&mut self.scratch);
        self.emit(length, None);
        self.finish(state);
        true
    }

    /// Puts bytes of the scratch memory in the output, but for those that crossed the port before a reset.
    fn emit(&mut self, count: usize, position: Option<(u8, u16)>) {
        let Some(job) = &mut self.job else { return };
        // What is made lies behind what was printed and what waits; the difference was printed before a reset.
        let missing = (job.printed + self.output.len() as u32).saturating_sub(job.made);
        let skip = (missing as usize).min(count);
        job.made += count as u32;
        self.output.push(&self.scratch[skip..count]);
        if let Some(position) = position
            && job.made > job.printed
        {
            self.marks.push(job.made, position);
        }
    }

    /// All is in the output: the rest of the data is of no interest.
    fn finish(&mut self, state: JobState) {
        if let Some(job) = &mut self.job {
            job.phase = Phase::Ending(state);
        }
        self.data.clear();
        self.due.progress = true;
        self.settle();
    }

    /// Ends the job if its last byte has crossed the port.
    fn settle(&mut self) {
        let Some(job) = &self.job else { return };
        if let Phase::Ending(state) = job.phase
            && self.output.is_empty()
        {
            self.end(state);
            if self.needs_reset {
                self.assign(Task::Initialise);
            }
        }
    }

    fn end(&mut self, state: JobState) {
        let progress = self.progress();
        if let Some(job) = self.job.take() {
            self.last = Progress { state, limit: progress.accepted, ..progress };
            self.last_shape = (job.length > 0).then_some((job.kind, job.length));
        }
        self.clear();
        self.due.progress = true;
    }
}

fn is_final(state: JobState) -> bool {
    match state {
        JobState::None | JobState::Done | JobState::Cancelled | JobState::Broken(_) | JobState::Lost => true,
        JobState::Printing | JobState::Stopped(_) | JobState::Cancelling => false,
    }
}
