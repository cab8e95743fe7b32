//! The conversation with the host, and with a plain printer interface.

use super::job::{Cancel, Job, Marks, Phase, Way, positions};
use super::{ALONE, Assignment, Due, Engine, Identity, LEAST_MEMORY, LOCAL, Request, Task};
use crate::standing::Standing;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, DATA_MAX, Fault, JobKind, Progress, Refusal, SCHEMA, ToBridge, ToHost, Usage, VERSION,
    hello_version,
};
use protocol::rgl::Track;

impl Engine<'_> {
    /// The link was cut: answers that are due would reach another conversation, so they are dropped. The job continues.
    /// The link's reader must be [reset](Reader::reset) too.
    pub fn link_lost(&mut self) {
        self.frame.clear();
        self.due = Due::default();
    }

    /// Bytes from a link, in any portions. Every link has its own reader. A board with two links (a serial port and bulk
    /// endpoints, say) may serve both; the answers go to the one that spoke last. Returns whether a message was complete, so
    /// that there may be something to do.
    pub fn receive(&mut self, reader: &mut Reader, mut bytes: &[u8]) -> bool {
        let mut heard = false;
        loop {
            match reader.read(bytes) {
                Read::More => return heard,
                // Damage needs no answer: the host sends again what was lost.
                Read::Damaged(_, rest) => bytes = rest,
                Read::Message(message, rest) => {
                    heard = true;
                    bytes = rest;
                    match frame::decode(message) {
                        Ok(message) => self.follow(message),
                        // A host of another version learns by the answer that it is one.
                        Err(frame::Unknown) if hello_version(message).is_some() => self.greet(),
                        Err(frame::Unknown) => self.refuse(Refusal::Unknown, 0),
                    }
                }
            }
        }
    }

    pub(super) fn refuse(&mut self, reason: Refusal, job: u32) {
        self.due.refused = Some((reason, job));
    }

    fn follow(&mut self, message: ToBridge<'_>) {
        match message {
            ToBridge::Hello { .. } => self.greet(),
            ToBridge::Begin { job, kind, length } => {
                if self.may_begin(job, kind, length) && !self.open(job, kind, length, Way::ToPort) {
                    self.refuse(Refusal::Empty, job);
                }
            }
            ToBridge::Data { job, offset, bytes } => self.take(job, offset, bytes),
            ToBridge::Cancel { job } => self.cancel(job),
            ToBridge::Ask { request, what: Ask::Lines } => self.due.lines = Some(request),
            ToBridge::Ask { request, what: Ask::Printer | Ask::Vouched } => {
                self.negotiate(request, Task::PrinterStatus);
            }
            ToBridge::Ask { request, what: Ask::DeviceId } => self.negotiate(request, Task::DeviceId),
            ToBridge::Ask { request, what: Ask::Board } => self.due.usage = Some(request),
            ToBridge::Configure(settings) => {
                // Harmless at any time, and needed most when a job is stuck.
                self.unless_busy(Task::Configure(settings), None);
            }
            ToBridge::Initialise { request } => self.between_jobs(Task::Initialise, Some(request)),
            ToBridge::Bootloader => self.between_jobs(Task::Bootloader, None),
            ToBridge::Drive { data, control } => self.between_jobs(Task::Drive { data, control }, None),
            ToBridge::Probe { request, data, control } => self.ask(request, Task::Probe { data, control }),
            ToBridge::ReadLog { request, from } => self.due.log = Some((request, from)),
            ToBridge::Abandon { job } => self.abandon(job),
            ToBridge::Store { job, kind, length, name } => {
                if self.may_begin(job, kind, length) {
                    self.have_stored(job, kind, length, name);
                }
            }
            ToBridge::ListStored { request, index } => self.ask_store(Request::List { request, index }),
            ToBridge::PrintStored { job, stored } => {
                if self.may_print(job) {
                    self.ask_store(Request::Print { job, stored });
                }
            }
            ToBridge::DeleteStored { request, stored } => self.ask_store(Request::Delete { request, stored }),
        }
    }

    fn greet(&mut self) {
        (self.due.hello, self.due.past, self.due.progress, self.due.standing) = (true, true, true, true);
    }

    /// Whether a host may open this job now. If not, or if it is open already, the host is told where it stands.
    fn may_begin(&mut self, id: u32, kind: JobKind, length: u32) -> bool {
        if id == 0 || id >= ALONE || length == 0 {
            self.refuse(Refusal::Empty, id);
            return false;
        }
        self.due.progress = true;
        if let Some(job) = &mut self.job {
            if job.id == id && job.way == Way::ToStore {
                self.words_of_store = self.words_of_store.wrapping_add(1);
            }
            if job.id != id {
                self.refuse(Refusal::JobOpen, id);
            } else if job.phase == Phase::Unknown {
                (job.kind, job.length, job.phase) = (kind, length, Phase::Running);
            } else if (job.kind, job.length) != (kind, length) {
                self.refuse(Refusal::OtherJob, id);
            }
            return false;
        }
        if self.last.job == id {
            if self.last_shape.is_some_and(|shape| shape != (kind, length)) {
                self.refuse(Refusal::OtherJob, id);
            }
            return false;
        }
        if self.remembered(id).is_some() {
            self.due.past = true;
            self.refuse(Refusal::OtherJob, id);
            return false;
        }
        true
    }

    /// Opens a job; false if there is too little memory for any.
    pub(super) fn open(&mut self, id: u32, kind: JobKind, length: u32, way: Way) -> bool {
        if self.data.capacity() < LEAST_MEMORY || self.output.capacity() < LEAST_MEMORY {
            return false;
        }
        self.job = Some(Job::new(id, kind, length, way));
        self.clear();
        true
    }

    /// Bytes from an interface that has no notion of jobs: the printer class, for whatever an operating system sends.
    /// Returns the number of bytes taken. The rest must be offered again, which on USB is a NAK. The engine takes nothing
    /// while a job of the link is open or the end of the last one has not crossed the port.
    ///
    /// A job ends with the reset after its rows, or else with [`Engine::local_end`].
    pub fn local(&mut self, bytes: &[u8]) -> usize {
        if bytes.is_empty() {
            return 0;
        }
        if self.job.is_none() && !self.open(LOCAL, JobKind::Raw, u32::MAX, Way::ToPort) {
            return 0;
        }
        let Some(job) = &mut self.job else { return 0 };
        if job.id != LOCAL || job.phase != Phase::Running || job.length != u32::MAX {
            return 0;
        }
        // A job ends when it is 4 GB long.
        let room = self.data.free().min((u32::MAX - 1 - job.accepted) as usize);
        let mut taken = &bytes[..bytes.len().min(room)];
        let settled = self.ahead.follow(taken);
        if let Some(over) = self.ahead.over() {
            // The track has read beyond the end, but it is not used after that.
            taken = &taken[..over];
            job.length = job.accepted + positions(over);
        }
        self.data.push(taken);
        let before = job.accepted;
        job.accepted += positions(taken.len());
        if let Some(count) = settled {
            job.settled = (before + positions(count)).min(job.accepted);
        }
        taken.len()
    }

    /// The plain printer interface was reset: its job, if one is open, ends as if cancelled.
    pub fn local_reset(&mut self) {
        if self.job.as_ref().is_some_and(|job| job.id == LOCAL) {
            self.cancel(LOCAL);
        }
    }

    /// No more bytes of a job will come through [`Engine::local`]: the interface is gone, or has been silent for longer
    /// than any program that prints.
    pub fn local_end(&mut self) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == LOCAL && job.phase == Phase::Running) {
            job.length = job.accepted;
        }
    }

    /// If a job that comes through [`Engine::local`] waits for more, all it has sent having crossed the port: whether the
    /// printer is then inside a job of its language. `None` if it does not wait.
    pub fn local_waits(&self) -> Option<bool> {
        let job = self.job.as_ref().filter(|job| job.id == LOCAL && job.length == u32::MAX)?;
        let waits = self.output.is_empty() && self.fault.is_none() && job.phase == Phase::Running;
        waits.then(|| job.used > 0 && self.sent.is_open() && !self.sent.is_foreign())
    }

    /// Empties everything that belongs to a job.
    pub(super) fn clear(&mut self) {
        self.data.clear();
        self.output.clear();
        self.streams.restart();
        (self.ahead, self.sent) = (Track::new(), Track::new());
        self.marks = Marks::new();
    }

    fn take(&mut self, id: u32, offset: u32, bytes: &[u8]) {
        let Some(job) = self.job.as_mut().filter(|job| job.id == id) else {
            if self.last.job == id {
                // It has ended, and the host does not know.
                self.due.progress = true;
            } else if self.remembered(id).is_some() {
                self.due.past = true;
            } else {
                self.refuse(Refusal::NoSuchJob, id);
            }
            return;
        };
        if job.way == Way::ToStore {
            self.words_of_store = self.words_of_store.wrapping_add(1);
        }
        let end = u64::from(offset) + bytes.len() as u64;
        let of_host = job.phase == Phase::Running && job.way != Way::FromStore;
        if !of_host || offset > job.accepted || end <= u64::from(job.accepted) {
            self.due.progress = true;
            return;
        }
        // Below the accepted position, and so below `bytes.len()`.
        let fresh = &bytes[(job.accepted - offset) as usize..];
        if end > u64::from(job.length) || fresh.len() > self.data.free() {
            self.due.progress = true;
            return self.refuse(Refusal::BeyondLimit, id);
        }
        self.due.progress |= end == u64::from(job.length);
        self.accept(fresh);
    }

    /// Takes the next bytes of the open job, for which there is room.
    pub(super) fn accept(&mut self, fresh: &[u8]) {
        let Some(job) = &mut self.job else { return };
        self.data.push(fresh);
        job.accepted += positions(fresh.len());
        if job.kind == JobKind::Raw
            && job.way != Way::ToStore
            && let Some(count) = self.ahead.follow(fresh)
        {
            job.settled = job.accepted - positions(fresh.len() - count);
        }
    }

    pub(super) fn cancel(&mut self, id: u32) {
        self.due.progress = true;
        let remembered = self.remembered(id).is_some();
        match &mut self.job {
            Some(job) if job.id == id => {
                // The end has to go out.
                self.held = false;
                // After a reset the data are needed even for this: only they tell what the printer waits for.
                if job.cancel == Cancel::None && !matches!(job.phase, Phase::Ending { .. }) {
                    job.cancel = Cancel::Requested;
                }
            }
            _ if self.last.job == id => {}
            _ if remembered => self.due.past = true,
            _ => self.refuse(Refusal::NoSuchJob, id),
        }
    }

    /// Ends a job at once, wherever it stands. Only the board can say what has crossed the port by then, so the job ends with the
    /// reset behind it.
    fn abandon(&mut self, id: u32) {
        self.due.progress = true;
        match &self.job {
            // Nothing of it is at the printer.
            Some(job) if job.id == id && job.way == Way::ToStore => self.cancel(id),
            // The host repeats itself if the board has something else to do.
            Some(job) if job.id == id => {
                if self.assign(Task::Initialise, None) {
                    self.abandoned = Some(id);
                }
            }
            _ if self.last.job == id => {}
            _ if self.remembered(id).is_some() => self.due.past = true,
            _ => self.refuse(Refusal::NoSuchJob, id),
        }
    }

    /// A question that needs a negotiation with the printer, and so one that is known to stand between two jobs.
    fn negotiate(&mut self, request: u16, task: Task) {
        if self.is_at(Assignment { task, request: Some(request) }) {
            return;
        }
        let answer = match self.standing {
            _ if !self.is_idle() => Answer::NotNow,
            _ if self.is_off() => Answer::Stopped(Fault::PowerOff),
            Standing::AtRest if self.one_way => Answer::OneWay,
            Standing::AtRest => return self.ask(request, task),
            Standing::Unknown { .. } | Standing::InSheet(_) => Answer::Unsure,
        };
        self.due.answer = Some((request, answer));
    }

    fn ask(&mut self, request: u16, task: Task) {
        if self.job.is_some() || !self.assign(task, Some(request)) {
            self.due.answer = Some((request, Answer::NotNow));
        }
    }

    fn between_jobs(&mut self, task: Task, request: Option<u16>) {
        match &self.job {
            Some(job) => self.refuse(Refusal::JobOpen, job.id),
            None => self.unless_busy(task, request),
        }
    }

    /// Assigns a task. A board that has another refuses it as it would beside a job: the host may ask again later.
    fn unless_busy(&mut self, task: Task, request: Option<u16>) {
        if !self.assign(task, request) {
            self.refuse(Refusal::JobOpen, self.job.as_ref().map_or(0, |job| job.id));
        }
    }

    /// Writes the next frame for the link and returns its length, or 0 if nothing is due.
    pub fn transmit(&mut self, out: &mut [u8; MAX]) -> usize {
        let wrote = |message: ToHost<'_>, out: &mut [u8; MAX]| frame::write(&message, out).unwrap_or(0);
        if core::mem::take(&mut self.due.hello) {
            let Identity { boot, serial, firmware } = self.identity;
            return wrote(ToHost::Hello { version: VERSION, schema: SCHEMA, boot, serial, firmware }, out);
        }
        if let Some((reason, job)) = self.due.refused.take() {
            return wrote(ToHost::Refused { reason, job }, out);
        }
        if core::mem::take(&mut self.due.past) {
            return wrote(ToHost::Past(self.past), out);
        }
        let now = self.progress();
        if self.due.progress || self.worth_reporting(&now) {
            self.due.progress = false;
            self.reported = now;
            return wrote(ToHost::Progress(now), out);
        }
        if core::mem::take(&mut self.due.standing) {
            let (standing, job) = (self.standing.told(), self.standing.job());
            return wrote(ToHost::Standing { standing, job }, out);
        }
        if let Some(request) = self.due.lines.take() {
            return wrote(ToHost::Lines { request, lines: self.lines, fault: self.fault }, out);
        }
        if let Some((request, answer)) = self.due.answer.take() {
            return wrote(ToHost::Answer { request, answer }, out);
        }
        let length = self.frame.len();
        out[..length].copy_from_slice(&self.frame);
        self.frame.clear();
        length
    }

    fn worth_reporting(&self, now: &Progress) -> bool {
        let eighth = positions(self.data.capacity() / 8).max(1);
        now.job != self.reported.job
            || now.state != self.reported.state
            || now.limit.wrapping_sub(self.reported.limit) >= eighth && now.limit != self.reported.limit
            || now.accepted.wrapping_sub(self.reported.accepted) >= eighth
            || now.printed.wrapping_sub(self.reported.printed) >= 4096
    }

    /// Makes the frame of a message that borrows what will be gone when it is sent.
    pub(super) fn prepare(&mut self, message: &ToHost<'_>) {
        // As long as any frame, so there is room.
        let _ = self.frame.resize_default(MAX);
        let length = frame::write(message, &mut self.frame).unwrap_or(0);
        self.frame.truncate(length);
    }

    /// Whether the host wants to know the firmware's use of memory and time.
    pub fn usage_wanted(&self) -> bool {
        self.due.usage.is_some() && self.frame.is_empty()
    }

    /// The firmware's use of memory and time, for the host that asked for it.
    pub fn usage(&mut self, usage: Usage) {
        if self.usage_wanted()
            && let Some(request) = self.due.usage.take()
        {
            self.prepare(&ToHost::Board { request, usage });
        }
    }

    /// From which byte on the host wants the log, if it does.
    pub fn log_wanted(&self) -> Option<u32> {
        self.due.log.filter(|_| self.frame.is_empty()).map(|(_, from)| from)
    }

    /// A piece of the log for the host that asked for it: at most [`DATA_MAX`] bytes, beginning at byte `at` of `end`.
    pub fn log(&mut self, at: u32, end: u32, bytes: &[u8]) {
        if self.log_wanted().is_some()
            && let Some((request, _)) = self.due.log.take()
        {
            let bytes = &bytes[..bytes.len().min(DATA_MAX)];
            self.prepare(&ToHost::LogPart { request, at, end, bytes });
        }
    }
}
