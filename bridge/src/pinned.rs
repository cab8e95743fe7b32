//! The bridge on plain pins: engine and port, turn by turn.
//!
//! A board with a faster port (PIO, DMA) has its own loop around the [`Engine`]; this one runs on anything with pins
//! and is what such a loop is held against. A turn takes well under a millisecond, except while the printer is
//! being asked something, which happens between jobs only.

use crate::engine::{Engine, Outcome, Task};
use crate::port::{AckPin, DataBus, Port, ReverseError, Stop};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use protocol::link::message::{Answer, Fault};

/// What the caller has to do after a turn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turn {
    /// There is more to do at once.
    Again,
    /// Nothing moves until the link speaks or the printer is ready: look again in a millisecond or so.
    Rest,
    /// The host wants the boot loader.
    Bootloader,
}

/// Longest device ID that is passed on; it has to fit a frame.
const LONGEST: usize = 900;

/// How long the printer may take to accept the status question, and then to answer, in ms.
const ANSWER_MS: u32 = 10_000;

/// Between two looks for an answer, in ms: negotiating is not free for the printer.
const LOOK_MS: u32 = 20;

/// The status question.
const STATUS: [u8; 2] = [0x05, 0x01];

/// A status question under way.
struct Question {
    /// Bytes of it that have crossed the port.
    put: usize,
    /// When the present step began, and when to look next.
    since_ms: u32,
    look_ms: u32,
    answer: [u8; 64],
    length: usize,
}

/// Engine and port together.
pub struct Pinned<'m, D, O, I, A, T> {
    /// The engine, for the link's side.
    pub engine: Engine<'m>,
    port: Port<D, O, I, A, T>,
    question: Option<Question>,
}

impl<'m, D, O, I, A, T> Pinned<'m, D, O, I, A, T>
where
    D: DataBus,
    O: OutputPin<Error = Infallible>,
    I: InputPin<Error = Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// A bridge of these.
    pub fn new(engine: Engine<'m>, port: Port<D, O, I, A, T>) -> Self {
        Pinned { engine, port, question: None }
    }

    /// Moves what can be moved. `now_ms` may wrap.
    pub fn turn(&mut self, now_ms: u32) -> Turn {
        let worked = self.engine.work();
        // There is no log here.
        self.engine.log(0, 0, &[]);
        if let Some(task) = self.engine.task() {
            return self.begin(task, now_ms);
        }
        if self.question.is_some() {
            self.ask(now_ms);
            return Turn::Rest;
        }
        // At most some milliseconds of a fast printer, so that the link is served in between.
        let bytes = self.engine.output();
        let written = self.port.write(&bytes[..bytes.len().min(256)], now_ms);
        self.engine.consumed(written.count);
        let fault = match written.stop {
            Some(Stop::Fault(fault)) => Some(fault),
            Some(Stop::Busy) | None => self.port.fault(),
        };
        self.engine.port(self.port.lines(), fault);
        if worked || written.count > 0 { Turn::Again } else { Turn::Rest }
    }

    fn begin(&mut self, task: Task, now_ms: u32) -> Turn {
        let outcome = match task {
            Task::Configure(settings) => match self.port.configure(&settings) {
                Ok(()) => Outcome::Done,
                Err(_) => Outcome::BadSettings,
            },
            Task::PrinterStatus => {
                self.port.rest();
                self.question =
                    Some(Question { put: 0, since_ms: now_ms, look_ms: now_ms, answer: [0; 64], length: 0 });
                return Turn::Again;
            }
            Task::DeviceId => {
                self.port.rest();
                let mut id = [0; LONGEST];
                let found = self.port.device_id(&mut id);
                let answer = match found {
                    Ok(length) => Answer::Bytes(&id[..length]),
                    // What came before it fell silent is usually all there is: its length was wrong.
                    Err(ReverseError::Silent(length)) if length > 0 => Answer::Bytes(&id[..length]),
                    Err(error) => self.why(error),
                };
                self.engine.done(Outcome::Answer(answer));
                return Turn::Again;
            }
            Task::Initialise => {
                self.port.rest();
                self.port.initialise();
                Outcome::Done
            }
            Task::Drive { data, control } => {
                self.port.drive(data, control);
                self.engine.port(self.port.lines(), self.port.fault());
                Outcome::Done
            }
            Task::Probe { data, control } => {
                self.port.drive(data, control);
                Outcome::Lines(self.port.lines())
            }
            Task::Bootloader => {
                self.engine.done(Outcome::Done);
                return Turn::Bootloader;
            }
        };
        self.engine.done(outcome);
        Turn::Again
    }

    /// A step of the status question.
    fn ask(&mut self, now_ms: u32) {
        let Some(question) = &mut self.question else { return };
        let late = now_ms.wrapping_sub(question.since_ms) >= ANSWER_MS;
        if question.put < STATUS.len() {
            let written = self.port.write(&STATUS[question.put..], now_ms);
            question.put += written.count;
            match written.stop {
                None => (question.since_ms, question.look_ms) = (now_ms, now_ms),
                // A printer that has taken half a question is given up all the same; the next one begins anew.
                Some(stop) if late => {
                    let fault = if let Stop::Fault(fault) = stop { fault } else { Fault::BusyTooLong };
                    self.answered(Answer::Stopped(fault));
                }
                Some(_) => {}
            }
            return;
        }
        if now_ms.wrapping_sub(question.look_ms) < LOOK_MS
            && question.length == 0
            && now_ms != question.look_ms
        {
            return;
        }
        question.look_ms = now_ms;
        let read = self.port.read(&mut question.answer[question.length..]);
        match read {
            Ok(length) | Err(ReverseError::Silent(length)) => question.length += length,
            Err(ReverseError::NotIdle) => {}
            Err(error) => {
                let answer = self.why(error);
                return self.answered(answer);
            }
        }
        let (answer, length) = (question.answer, question.length);
        if is_whole(&answer[..length]) {
            self.answered(Answer::Bytes(&answer[..length]));
        } else if late || length == answer.len() {
            self.answered(Answer::Silent);
        }
    }

    fn answered(&mut self, answer: Answer<'_>) {
        self.question = None;
        self.engine.done(Outcome::Answer(answer));
    }

    fn why(&mut self, error: ReverseError) -> Answer<'static> {
        match (error, self.port.fault()) {
            (ReverseError::OneWay | ReverseError::NotIdle, Some(fault)) => Answer::Stopped(fault),
            (ReverseError::NotIdle, None) => Answer::Stopped(Fault::BusyTooLong),
            (ReverseError::OneWay | ReverseError::Refused, _) => Answer::OneWay,
            (ReverseError::Silent(_), _) => Answer::Silent,
        }
    }
}

/// Whether these bytes are a whole answer: 02, a type, the length of what follows, that, 03; or a single byte,
/// which is what the printer says when it cannot answer.
fn is_whole(answer: &[u8]) -> bool {
    match *answer {
        [0x02, _, low, high, ref rest @ ..] => rest.len() > usize::from(u16::from_le_bytes([low, high])),
        [0x02, ..] | [] => false,
        _ => true,
    }
}
