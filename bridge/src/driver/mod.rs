//! The port's driver: it alone touches the printer, and decides who may use the port and when.
//!
//! Problem: one port serves the bytes of jobs, the engine's tasks, and a question of the driver's own; no byte may be lost
//! or doubled where one ends and the next begins. Method: a state machine that is polled. Each poll reports to the
//! engine what has been sent and what the lines show, and moves what can be moved. Whoever gets the port gets it with
//! nothing in flight. The precedence is
//!
//! 1. a conversation with the printer or a status question under way, which take many polls;
//! 2. a task of the engine; meanwhile the engine gives no bytes;
//! 3. the question for the device ID, between jobs only;
//! 4. the bytes of a job, which also end a wiring test.
//!
//! Bytes go out through the board's [`Sender`] with the default handshake, and through the [`Port`] on plain pins, by the
//! processor, with another handshake or when some status lines are not heeded. The port on pins also does everything between
//! jobs: device ID, status, reset, wiring test.
//!
//! When the board first drives the cable, it leads the printer out of a conversation that it may be in.
//! While the printer's +5 V is absent nothing is strobed: the engine gives no bytes, the sender gets none and strobes none of
//! those it has, and they are taken back when the supply counts as gone. From then on the output buffers let go of the cable,
//! so that the inputs of a printer that is off are not fed, until the supply is back or the processor has work at the pins.
//!
//! Cost: a poll takes well below a millisecond, whatever the printer does.

mod board;
mod introduction;
mod question;
mod supply;

pub use board::{Board, Clock, Event, Retained, Sender, TwoBuffers};
#[cfg(any(test, feature = "simulation"))]
pub(crate) use question::STATUS;

use self::introduction::{Action, Introduction};
use self::question::{Outcome as Ended, StatusQuestion, Step};
use self::supply::Supply;
use crate::engine::{Engine, Outcome, Task};
use crate::port::{AckPin, BadSettings, Conversation, DataBus, Port, Reverse, ReverseError, Stop, Timing};
use crate::printer_class::DeviceId;
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use heapless::Vec;
use protocol::link::message::{AT_REST, Answer, Fault, Handshake, JobState, Lines, PortSettings};

/// What a printer has sent. Device IDs are some hundred bytes long.
type Text = Vec<u8, 512>;

/// Between two looks at the lines.
const TICK_US: u32 = 1000;

/// How long to leave alone a printer that is at work on a byte, when the processor sends.
const BUSY_US: u32 = 100;

/// Bytes the processor sends in one poll, and for how long at most it begins another.
const HANDFUL: usize = 32;
const HANDFUL_US: u64 = 300;

/// Who works the pins.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Owner {
    /// The board's sender.
    Sender,
    /// The processor.
    Processor,
    /// The processor, which has set levels for a wiring test. They stand until there is something to send.
    WiringTest,
}

/// For whom the printer is read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Purpose {
    /// The driver itself, which asks a printer that was switched on who it is.
    Introduction,
    /// The engine's task.
    DeviceId,
    /// The status question.
    Answer,
    /// Nobody: a printer that may be in a conversation is led out of it.
    WayBack,
}

/// The printer being read.
struct Talk {
    purpose: Purpose,
    conversation: Conversation,
    text: Text,
    /// Bytes of the text that came before this conversation.
    before: usize,
}

/// The driver of a board `B` and of the port on its pins.
pub struct Driver<B, D, O, I, A, T> {
    board: B,
    port: Port<D, O, I, A, T>,
    owner: Owner,
    handshake: Handshake,
    heed: Lines,
    patience_us: u64,
    /// When a byte was last sent, or nothing was waiting to be.
    moved_us: u64,
    supply: Supply,
    /// The output buffers drive the cable.
    driving: bool,
    /// The printer was led out of what an earlier start of the board may have begun.
    met: bool,
    /// Why the processor could not send.
    stop: Option<Fault>,
    introduction: Introduction,
    question: Option<StatusQuestion>,
    talk: Option<Talk>,
    /// The printer has negotiated since it was switched on.
    talks: bool,
    /// The lines as they were last read outside of a conversation, which has other uses for them.
    lines: Lines,
    /// Job and state that were last written to the log.
    logged: Option<(u32, JobState)>,
}

impl<B, D, O, I, A, T> Driver<B, D, O, I, A, T>
where
    B: Board,
    D: DataBus,
    O: OutputPin<Error = Infallible>,
    I: InputPin<Error = Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// A driver with the default settings and the lines at rest.
    pub fn new(board: B, port: Port<D, O, I, A, T>) -> Self {
        let now_us = board.now_us();
        let mut driver = Driver {
            board,
            port,
            owner: Owner::Processor,
            handshake: Handshake::Busy,
            heed: Lines::ALL,
            patience_us: u64::from(Timing::PATIENCE_MS) * 1000,
            moved_us: now_us,
            supply: Supply::new(now_us),
            driving: false,
            met: false,
            stop: None,
            introduction: Introduction::Waiting,
            question: None,
            talk: None,
            talks: false,
            lines: Lines::IDLE,
            logged: None,
        };
        driver.release_pins();
        driver
    }

    /// Does what is due. Returns for how many µs there is nothing to do unless the engine gets something for the
    /// port or the sender has emptied a buffer; 0 asks for the next poll at once.
    pub fn poll(&mut self, engine: &mut Engine<'_>, id: &mut DeviceId) -> u32 {
        self.count(engine);
        if self.talk.is_some() {
            self.go_on_talking(engine, id);
        } else if self.question.is_some() {
            self.go_on_asking(engine);
        } else if let Some(task) = engine.task() {
            self.perform(task, engine);
        }
        let now_us = self.board.now_us();
        self.look(engine, now_us);
        self.introduce(engine, id, now_us);
        if self.owner == Owner::WiringTest && !engine.output().is_empty() {
            self.release_pins();
        }
        if self.board.in_flight() == 0 && !engine.output().is_empty() {
            // That bytes flow is kept before the first of them does.
            self.keep(engine);
        }
        let pause_us = match self.owner {
            _ if self.talk.is_some() => BUSY_US,
            Owner::Sender => self.feed(engine),
            Owner::Processor => self.send(engine),
            Owner::WiringTest => TICK_US,
        };
        self.keep(engine);
        match &self.question {
            Some(question) if self.talk.is_none() => pause_us.min(question.pause_us(self.board.now_us())),
            _ => pause_us,
        }
    }

    /// Reports to the engine what the sender has sent.
    fn count(&mut self, engine: &mut Engine<'_>) {
        let sent = self.board.sent();
        self.consumed(sent, engine);
        if self.owner == Owner::Sender && self.board.in_flight() == 0 {
            self.moved_us = self.board.now_us();
        }
    }

    fn consumed(&mut self, count: usize, engine: &mut Engine<'_>) {
        if count > 0 {
            self.moved_us = self.board.now_us();
            engine.consumed(count);
        }
    }

    /// Keeps where the job stands for the time after a reset, and writes to the log what has changed.
    fn keep(&mut self, engine: &Engine<'_>) {
        let mut checkpoint = engine.checkpoint();
        // Of a job that is held what was given to the sender goes on.
        checkpoint.flowing |= engine.is_ready() && self.board.in_flight() > 0;
        self.board.store(checkpoint);
        let state = (checkpoint.progress.job, checkpoint.progress.state);
        if self.logged.replace(state) != Some(state) && state.0 != 0 {
            self.board.log(Event::Job(checkpoint.progress));
        }
    }

    /// Hands bytes to the sender until it is full.
    fn feed(&mut self, engine: &Engine<'_>) -> u32 {
        // Without the printer's supply not even for a dropout that costs no sheet.
        while self.lines.high(Lines::POWER) && self.board.has_room() {
            // The oldest bytes of the output are those in flight already.
            let fresh = engine.output_behind(self.board.in_flight());
            if fresh.is_empty() || self.board.give(fresh) == 0 {
                break;
            }
        }
        TICK_US
    }

    /// Sends some bytes by the processor.
    fn send(&mut self, engine: &mut Engine<'_>) -> u32 {
        let start_us = self.board.now_us();
        let now_ms = wrapping_ms(start_us);
        let output = engine.output();
        let (mut count, mut stop) = (0, None);
        for byte in &output[..output.len().min(HANDFUL)] {
            if self.board.now_us() - start_us >= HANDFUL_US {
                break;
            }
            let written = self.port.write(core::slice::from_ref(byte), now_ms);
            if written.count == 0 {
                stop = written.stop;
                break;
            }
            self.board.mark();
            count += 1;
        }
        self.consumed(count, engine);
        self.stop = match stop {
            Some(Stop::Fault(fault)) => Some(fault),
            Some(Stop::Busy) => self.stop.filter(|_| count == 0),
            None => None,
        };
        match stop {
            None if count > 0 => 0,
            Some(Stop::Busy) => BUSY_US,
            _ => TICK_US,
        }
    }

    /// Reads the lines and tells the engine. If the printer's supply is gone, what is in flight is taken back before, and what
    /// has crossed of it counts.
    fn look(&mut self, engine: &mut Engine<'_>, now_us: u64) {
        let lines = self.board.lines();
        self.lines = match self.talk {
            None | Some(Talk { purpose: Purpose::WayBack, .. }) => lines,
            Some(_) => Lines(self.lines.0 & !Lines::POWER | lines.0 & Lines::POWER),
        };
        let heeded = self.lines.heeding(self.heed);
        let fault = match self.supply.fault(heeded, now_us) {
            None if heeded.high(Lines::BUSY) && now_us - self.moved_us >= self.patience_us => {
                Some(Fault::BusyTooLong)
            }
            None => self.stop,
            fault => fault,
        };
        if fault == Some(Fault::PowerOff) {
            self.talks = false;
            if self.board.in_flight() > 0 {
                let sent = self.board.stop();
                self.consumed(sent, engine);
            }
            if self.is_free() {
                self.drive(false);
            }
        } else if heeded.high(Lines::POWER) && !self.met && self.is_free() {
            // A board that went down may have been in a conversation, and a printer that is in one still
            // takes no bytes, whatever its lines show.
            self.met = true;
            self.take_pins(engine);
            let (conversation, text) = (Conversation::way_back(self.board.now_us()), Text::new());
            self.talk = Some(Talk { purpose: Purpose::WayBack, conversation, text, before: 0 });
        } else if heeded.high(Lines::POWER) {
            self.drive(true);
        }
        engine.port(self.lines, fault);
    }

    /// Whether the pins are nobody's: no wiring test, no conversation, no question.
    fn is_free(&self) -> bool {
        self.owner != Owner::WiringTest && self.talk.is_none() && self.question.is_none()
    }

    /// Asks a printer that has been switched on for its device ID, when it is time and known to do no harm.
    fn introduce(&mut self, engine: &mut Engine<'_>, id: &mut DeviceId, now_us: u64) {
        let lines = self.lines.heeding(self.heed);
        let free = self.owner != Owner::WiringTest && self.talk.is_none() && engine.may_negotiate();
        match self.introduction.look(lines, free, now_us) {
            Action::Nothing => {}
            Action::Forget => id.forget(),
            Action::Ask => {
                self.take_pins(engine);
                self.read(Purpose::Introduction, &[]);
            }
        }
    }

    /// Lets the output buffers drive the cable, or not.
    fn drive(&mut self, on: bool) {
        if self.driving != on {
            self.driving = on;
            self.board.enable(on);
        }
    }

    /// Gives the pins to the processor, with nothing in flight and the cable driven.
    fn take_pins(&mut self, engine: &mut Engine<'_>) {
        let sent = self.board.stop();
        self.consumed(sent, engine);
        match self.owner {
            Owner::Sender => self.board.disconnect(),
            Owner::Processor => {}
            Owner::WiringTest => self.port.rest(),
        }
        self.owner = Owner::Processor;
        self.drive(true);
    }

    /// Puts the lines to rest and gives the pins to whom the settings name.
    fn release_pins(&mut self) {
        self.port.rest();
        self.owner = if self.handshake == Handshake::Busy && self.heed == Lines::ALL {
            self.board.connect();
            Owner::Sender
        } else {
            Owner::Processor
        };
        self.stop = None;
        self.moved_us = self.board.now_us();
    }

    /// Performs a task of the engine, or begins to.
    fn perform(&mut self, task: Task, engine: &mut Engine<'_>) {
        self.take_pins(engine);
        let outcome = match task {
            Task::Configure(settings) => match self.configure(&settings) {
                Ok(()) => Outcome::Done,
                Err(BadSettings) => Outcome::BadSettings,
            },
            Task::DeviceId => return self.read(Purpose::DeviceId, &[]),
            Task::PrinterStatus => {
                self.question = Some(StatusQuestion::new(self.board.now_us(), self.talks));
                return self.go_on_asking(engine);
            }
            Task::Initialise => {
                let before = self.is_powered();
                self.port.initialise();
                self.talks = false;
                if before && self.is_powered() { Outcome::Done } else { Outcome::Unnoticed }
            }
            Task::Bootloader => {
                self.board.start_boot_loader();
                Outcome::Done
            }
            Task::Drive { data, control } => {
                self.port.drive(data, control);
                Outcome::Done
            }
            Task::Probe { data, control } => {
                self.port.drive(data, control);
                Outcome::Lines(self.board.lines())
            }
        };
        engine.done(outcome);
        match task {
            Task::Drive { data, control } | Task::Probe { data, control } if (data, control) != AT_REST => {
                self.owner = Owner::WiringTest;
            }
            _ => self.release_pins(),
        }
    }

    /// Whether the printer has its supply at this moment.
    fn is_powered(&mut self) -> bool {
        self.board.lines().heeding(self.heed).high(Lines::POWER)
    }

    fn configure(&mut self, settings: &PortSettings) -> Result<(), BadSettings> {
        self.port.configure(settings)?;
        self.board.set_timing(&Timing::from_settings(settings)?);
        (self.handshake, self.heed) = (settings.handshake, settings.heed);
        self.patience_us = u64::from(settings.patience_s) * 1_000_000;
        Ok(())
    }

    /// Takes the next step of the status question, if it is due.
    fn go_on_asking(&mut self, engine: &mut Engine<'_>) {
        let Some(mut question) = self.question.take() else { return };
        let now_us = self.board.now_us();
        let fault = self.board.lines().heeding(self.heed).fault();
        let ended = match (question.step(now_us), fault) {
            // One that takes no bytes takes no question. What it has to say does not outlive its supply.
            (_, Some(fault)) if fault == Fault::PowerOff || !question.is_put() => Some(Ended::Stopped(fault)),
            (Step::Write(bytes), _) => {
                engine.begin_question();
                self.keep(engine);
                let written = self.port.write(bytes, wrapping_ms(now_us));
                let ended = question.written(written, self.board.now_us());
                if !question.is_half_put() {
                    engine.end_question();
                }
                ended
            }
            (Step::Read, _) => {
                self.read(Purpose::Answer, question.so_far());
                None
            }
            (Step::Wait, _) => None,
            (Step::Over(ended), _) => Some(ended),
        };
        match ended {
            None => self.question = Some(question),
            Some(ended) => self.answer(ended, &[], engine),
        }
    }

    /// The status question has ended, with this text if it was answered.
    fn answer(&mut self, ended: Ended, text: &[u8], engine: &mut Engine<'_>) {
        let answer = match ended {
            Ended::Answered => Answer::Bytes(text),
            Ended::Failed(error) => self.reply(&[], Some(error)),
            Ended::Stopped(fault) => Answer::Stopped(fault),
            Ended::Silent => Answer::Silent,
        };
        engine.done(Outcome::Answer(answer));
        self.release_pins();
    }

    /// Begins to read what the printer sends, behind what has come before.
    fn read(&mut self, purpose: Purpose, so_far: &[u8]) {
        let what = if purpose == Purpose::Answer { Reverse::Answer } else { Reverse::DeviceId };
        let mut text = Text::new();
        // Shorter than the text may be.
        let _ = text.extend_from_slice(so_far);
        let before = text.len();
        // To its capacity, which always succeeds.
        let _ = text.resize(text.capacity(), 0);
        self.talk = Some(Talk { purpose, conversation: Conversation::new(what), text, before });
    }

    /// Goes on with reading, and at its end passes on what has come.
    fn go_on_talking(&mut self, engine: &mut Engine<'_>, id: &mut DeviceId) {
        let Some(talk) = &mut self.talk else { return };
        let room = &mut talk.text[talk.before..];
        let Some(result) = self.port.converse(&mut talk.conversation, room, self.board.now_us()) else {
            return;
        };
        let Some(Talk { purpose, mut text, before, .. }) = self.talk.take() else { return };
        let (fresh, error) = match result {
            Ok(fresh) => (fresh, None),
            Err(ReverseError::Silent(fresh)) => (fresh, result.err()),
            Err(error) => (0, Some(error)),
        };
        text.truncate(before + fresh);
        match error {
            None | Some(ReverseError::Silent(_) | ReverseError::Refused) => self.talks = true,
            Some(ReverseError::OneWay) => engine.shown_one_way(),
            Some(ReverseError::NotIdle) => {}
        }
        // An ID that breaks off is of use all the same.
        let whole = matches!(error, None | Some(ReverseError::Silent(_)));
        match purpose {
            Purpose::WayBack => self.release_pins(),
            Purpose::Introduction => {
                let told = whole && id.learn(&text);
                self.board.log(if told { Event::DeviceId(text.len()) } else { Event::NoDeviceId });
                self.release_pins();
            }
            Purpose::DeviceId => {
                if error.is_none() {
                    id.learn(&text);
                }
                let answer = self.reply(&text, error);
                engine.done(Outcome::Answer(answer));
                self.release_pins();
            }
            Purpose::Answer => {
                let now_us = self.board.now_us();
                let ended = self.question.as_mut().and_then(|question| question.read(&text, error, now_us));
                if let Some(ended) = ended {
                    self.question = None;
                    self.answer(ended, &text, engine);
                }
            }
        }
    }

    /// What to tell the engine of what was read.
    fn reply<'t>(&mut self, text: &'t [u8], error: Option<ReverseError>) -> Answer<'t> {
        match error {
            None | Some(ReverseError::Silent(_)) if text.is_empty() => Answer::Silent,
            // Device IDs that break off are of use all the same.
            None | Some(ReverseError::Silent(_)) => Answer::Bytes(text),
            Some(ReverseError::OneWay | ReverseError::Refused) => Answer::OneWay,
            Some(ReverseError::NotIdle) => match self.board.lines().heeding(self.heed).fault() {
                Some(fault) => Answer::Stopped(fault),
                None => Answer::Silent,
            },
        }
    }
}

/// The port's clock in milliseconds, which may wrap.
#[expect(clippy::cast_possible_truncation, reason = "the clock wraps after 49 days")]
fn wrapping_ms(now_us: u64) -> u32 {
    (now_us / 1000) as u32
}
