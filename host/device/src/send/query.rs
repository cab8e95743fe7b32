//! Questions to a bridge, outside of any job: who it is, what it does, how the printer is.

use std::io;
use std::time::{Duration, Instant};

use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, Fault, JobState, Lines, Progress, Refusal, SCHEMA, ToBridge, ToHost, VERSION,
};

use super::session::{Bridge, printable};
use super::transport::Transport;

/// A question is repeated after this long: frames may be lost.
const REPEAT: Duration = Duration::from_millis(400);

/// What came of a question to the printer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Reply {
    /// The printer's bytes.
    Bytes(Vec<u8>),
    /// A job is open, and the question would be row data.
    NotNow,
    /// The printer's port does not talk back.
    OneWay,
    /// It does, but did not answer in time.
    Silent,
    /// It takes no bytes at the moment.
    Stopped(Fault),
}

impl Reply {
    /// A device ID as text: what follows the two bytes of its length.
    pub fn device_id(&self) -> Option<String> {
        let Reply::Bytes(bytes) = self else { return None };
        let printable = |byte: &&u8| byte.is_ascii_graphic() || **byte == b' ';
        Some(bytes.get(2..)?.iter().filter(printable).map(|&byte| char::from(byte)).collect())
    }
}

/// Whether a device ID names the maker of these printers.
pub fn is_alps(id: &str) -> bool {
    id.split(';').filter_map(|field| field.split_once(':')).any(|(key, value)| {
        (key.trim().ends_with("MANUFACTURER") || key.trim().ends_with("MFG")) && value.trim() == "ALPS"
    })
}

/// Why a question got no answer.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    /// The link went.
    #[error("the link to the bridge was lost")]
    Link(#[from] io::Error),
    /// Nothing that can be understood came in time.
    #[error(
        "no bridge answers there; is it the right port (`foilpress bridge list`), and does it run this program's firmware?"
    )]
    NoAnswer,
    /// Other messages than ours.
    #[error(
        "bridge {:016x}: its firmware {} speaks version {} of the link, this program version {VERSION}; `foilpress bridge \
         flash` puts the firmware that came with this program on it",
        .0.serial, .0.firmware, .0.version
    )]
    Version(Bridge),
    /// A job is open, so this must wait.
    #[error(
        "the bridge is printing job {0:08x}; wait until it is done, or end it with `foilpress cancel {0:08x}`"
    )]
    JobOpen(u32),
    /// The bridge has no such job.
    #[error("the bridge has no job {0:08x}, and nothing of it to end")]
    NoSuchJob(u32),
    /// The firmware does not know the question.
    #[error(
        "the bridge's firmware is older than this question; `foilpress bridge flash` puts the present one on it"
    )]
    TooOld,
}

/// A piece of the firmware's log.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LogPiece {
    /// Place of the first byte, counted since the log began.
    pub at: u32,
    /// Bytes logged so far.
    pub end: u32,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A conversation of questions.
pub struct Query<'t> {
    link: &'t mut dyn Transport,
    reader: Reader,
    request: u16,
    bridge: Bridge,
    progress: Progress,
}

/// A message of the bridge that answers something.
enum Heard {
    Hello(Bridge),
    Progress(Progress),
    Lines(u16, Lines, Option<Fault>),
    Answer(u16, Reply),
    Refused(Refusal, u32),
    Log(u16, LogPiece),
}

impl<'t> Query<'t> {
    /// Greets the bridge, which has to speak this program's messages. Changes nothing: a job under way goes on.
    pub fn new(link: &'t mut dyn Transport, patience: Duration) -> Result<Query<'t>, QueryError> {
        let query = Query::with_any(link, patience)?;
        if query.bridge.version == VERSION { Ok(query) } else { Err(QueryError::Version(query.bridge)) }
    }

    /// The same whatever messages it speaks: to put other firmware on it.
    pub fn with_any(link: &'t mut dyn Transport, patience: Duration) -> Result<Query<'t>, QueryError> {
        let mut reader = Reader::new();
        let hello = ToBridge::Hello { version: VERSION, schema: SCHEMA };
        let mut bridge = None;
        let (bridge, progress) = exchange(link, &mut reader, &[hello], patience, &mut |heard| {
            match heard {
                Heard::Hello(found) => bridge = Some(found),
                Heard::Progress(progress) => return Some((bridge.clone()?, progress)),
                _ => {}
            }
            None
        })?;
        Ok(Query { link, reader, request: 0, bridge, progress })
    }

    /// Who answers.
    pub fn bridge(&self) -> &Bridge {
        &self.bridge
    }

    /// What it does.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The port's lines, and the fault they mean.
    pub fn lines(&mut self, patience: Duration) -> Result<(Lines, Option<Fault>), QueryError> {
        let number = self.next();
        let question = ToBridge::Ask { request: number, what: Ask::Lines };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Lines(request, lines, fault) if request == number => Some((lines, fault)),
            _ => None,
        })
    }

    /// Asks the printer for its status answer or its device ID.
    pub fn printer(&mut self, what: Ask, patience: Duration) -> Result<Reply, QueryError> {
        let number = self.next();
        // Asked once only: the bridge may be waiting for the printer, and a second question would wait behind.
        let question = ToBridge::Ask { request: number, what };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Answer(request, reply) if request == number => Some(reply),
            _ => None,
        })
    }

    /// What the printer says it is. Nothing if it cannot be asked now: one that takes no bytes is not, nor one at work.
    pub fn device_id(&mut self, patience: Duration, printer: Duration) -> Option<String> {
        match self.lines(patience) {
            Ok((_, None)) => self.printer(Ask::DeviceId, printer).ok()?.device_id(),
            _ => None,
        }
    }

    /// Sets the port's outputs (Data1..Data8; nStrobe, nAutoFd, nInit, nSelectIn from bit 0) and reads the inputs when they
    /// have settled. **Never with a printer connected**: to it this is printing.
    ///
    /// Errors: [`QueryError::JobOpen`] while a job is open, beside those of every question.
    pub fn probe(&mut self, data: u8, control: u8, patience: Duration) -> Result<Lines, QueryError> {
        let (number, open) = (self.next(), self.progress.job);
        let question = ToBridge::Probe { request: number, data, control };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Lines(request, lines, _) if request == number => Some(Ok(lines)),
            Heard::Answer(request, Reply::NotNow) if request == number => {
                Some(Err(QueryError::JobOpen(open)))
            }
            Heard::Refused(Refusal::Unknown, _) => Some(Err(QueryError::TooOld)),
            _ => None,
        })?
    }

    /// A piece of the firmware's log from byte `from` on, 0 being the oldest.
    pub fn log(&mut self, from: u32, patience: Duration) -> Result<LogPiece, QueryError> {
        let number = self.next();
        let question = ToBridge::ReadLog { request: number, from };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Log(request, piece) if request == number => Some(Ok(piece)),
            Heard::Refused(Refusal::Unknown, _) => Some(Err(QueryError::TooOld)),
            _ => None,
        })?
    }

    /// Resets the printer by the port's nInit line. Refused while a job is open; a job that was open when the bridge
    /// itself was reset, and whose data nobody has sent again, is given up by it.
    pub fn initialise(&mut self, patience: Duration) -> Result<(), QueryError> {
        let number = self.next();
        // A reset is not answered, but a refusal would come before the answer to the question behind it.
        let messages = [ToBridge::Initialise, ToBridge::Ask { request: number, what: Ask::Lines }];
        exchange(self.link, &mut self.reader, &messages, patience, &mut |heard| match heard {
            Heard::Refused(Refusal::JobOpen, job) if job != 0 => Some(Err(QueryError::JobOpen(job))),
            Heard::Lines(request, ..) if request == number => Some(Ok(())),
            _ => None,
        })?
    }

    /// Ends the job of another sender early, as far as a legal end allows; says what the bridge made of it. One that is over
    /// already stays as it is.
    ///
    /// Errors: [`QueryError::NoSuchJob`] beside those of every question.
    pub fn cancel(&mut self, job: u32, patience: Duration) -> Result<Progress, QueryError> {
        exchange(
            self.link,
            &mut self.reader,
            &[ToBridge::Cancel { job }],
            patience,
            &mut |heard| match heard {
                Heard::Progress(progress) if progress.job == job => match progress.state {
                    // From before it was told.
                    JobState::Printing | JobState::Stopped(_) => None,
                    _ => Some(Ok(progress)),
                },
                Heard::Refused(Refusal::NoSuchJob, refused) if refused == job => {
                    Some(Err(QueryError::NoSuchJob(job)))
                }
                _ => None,
            },
        )?
    }

    /// Where the job stands now.
    pub fn ask_progress(&mut self, patience: Duration) -> Result<Progress, QueryError> {
        let hello = ToBridge::Hello { version: VERSION, schema: SCHEMA };
        let mut greeted = false;
        self.progress =
            exchange(self.link, &mut self.reader, &[hello], patience, &mut |heard| match heard {
                Heard::Hello(_) => {
                    greeted = true;
                    None
                }
                Heard::Progress(progress) if greeted => Some(progress),
                _ => None,
            })?;
        Ok(self.progress)
    }

    /// Sends the bridge to its boot loader, which ends the link.
    pub fn bootloader(&mut self, patience: Duration) -> Result<(), QueryError> {
        let refused = exchange(
            self.link,
            &mut self.reader,
            &[ToBridge::Bootloader],
            patience,
            &mut |heard| match heard {
                Heard::Refused(Refusal::JobOpen, job) => Some(QueryError::JobOpen(job)),
                _ => None,
            },
        );
        match refused {
            Ok(error) => Err(error),
            // Where the end of a link is not noticed there is silence.
            Err(QueryError::Link(_) | QueryError::NoAnswer) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn next(&mut self) -> u16 {
        self.request = self.request.wrapping_add(1);
        self.request
    }
}

/// Says `messages`, again and again, until `judge` is content with what is heard.
fn exchange<T>(
    link: &mut dyn Transport,
    reader: &mut Reader,
    messages: &[ToBridge<'_>],
    patience: Duration,
    judge: &mut dyn FnMut(Heard) -> Option<T>,
) -> Result<T, QueryError> {
    // A zero ends whatever stands in the bridge's reader; questions are far shorter than a frame.
    let (mut out, mut room) = (vec![0], [0; MAX]);
    for message in messages {
        let length = frame::write(message, &mut room).unwrap_or(0);
        out.extend_from_slice(&room[..length]);
    }
    let start = Instant::now();
    let (mut said, mut sent) = (None::<Duration>, out.len());
    let mut buffer = [0; 1024];
    loop {
        let now = start.elapsed();
        if now >= patience {
            return Err(QueryError::NoAnswer);
        }
        if sent == out.len() && said.is_none_or(|at| now - at >= REPEAT) {
            (said, sent) = (Some(now), 0);
        }
        if sent < out.len() {
            sent += link.send(&out[sent..])?;
        }
        let count = link.receive(&mut buffer, Duration::from_millis(20))?;
        let mut bytes = &buffer[..count];
        loop {
            match reader.read(bytes) {
                Read::More => break,
                Read::Damaged(_, rest) => bytes = rest,
                Read::Message(message, rest) => {
                    bytes = rest;
                    if let Some(found) = heard(message).and_then(&mut *judge) {
                        return Ok(found);
                    }
                }
            }
        }
    }
}

fn heard(message: &[u8]) -> Option<Heard> {
    Some(match frame::decode(message).ok()? {
        ToHost::Hello { version, boot, serial, firmware, .. } => {
            Heard::Hello(Bridge { version, boot, serial, firmware: printable(firmware) })
        }
        ToHost::Progress(progress) => Heard::Progress(progress),
        ToHost::Lines { request, lines, fault } => Heard::Lines(request, lines, fault),
        ToHost::Answer { request, answer } => Heard::Answer(
            request,
            match answer {
                Answer::Bytes(bytes) => Reply::Bytes(bytes.to_vec()),
                Answer::NotNow => Reply::NotNow,
                Answer::OneWay => Reply::OneWay,
                Answer::Silent => Reply::Silent,
                Answer::Stopped(fault) => Reply::Stopped(fault),
            },
        ),
        ToHost::Refused { reason, job } => Heard::Refused(reason, job),
        ToHost::LogPart { request, at, end, bytes } => {
            Heard::Log(request, LogPiece { at, end, bytes: bytes.to_vec() })
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bridge_of_other_messages_is_refused_with_the_command_that_helps() {
        use crate::send::transport::pair;
        use protocol::link::message::JobState;
        for (version, fits) in [(VERSION, true), (VERSION + 1, false), (VERSION - 1, false)] {
            let (mut host, mut board) = pair();
            let progress = Progress {
                job: 0,
                state: JobState::None,
                accepted: 0,
                limit: 0,
                printed: 0,
                pass: 0,
                row: 0,
            };
            let hello = ToHost::Hello { version, schema: SCHEMA, boot: 1, serial: 0xab, firmware: "9.9" };
            for message in [hello, ToHost::Progress(progress)] {
                let mut bytes = [0; frame::MAX];
                let length = frame::write(&message, &mut bytes).unwrap();
                assert_eq!(board.send(&bytes[..length]).unwrap(), length);
            }
            match Query::new(&mut host, Duration::from_secs(1)) {
                Ok(query) => assert!(fits && query.bridge().version == version),
                Err(error) => {
                    let said = error.to_string();
                    assert!(
                        !fits && said.contains("9.9") && said.contains("foilpress bridge flash"),
                        "{said}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_printers_own_device_id_is_known_and_anothers_is_not() {
        assert!(is_alps("MANUFACTURER:ALPS   ;COMMAND SET:RGL;MODEL:MD-5500_T-03   ;CLASS:PRINTER"));
        assert!(!is_alps("MFG:Hewlett-Packard;MDL:LaserJet;COMMENT:not ALPS"));
    }

    #[test]
    fn the_length_of_a_device_id_is_no_part_of_its_text() {
        // 75 bytes: the second byte of the length is a letter.
        let id = "MANUFACTURER:ALPS   ;COMMAND SET:RGL;MODEL:MD-5500_T-03   ;CLASS:PRINTER;";
        let reply = Reply::Bytes([&[0, b'K'], id.as_bytes()].concat());
        assert_eq!(reply.device_id().as_deref(), Some(id));
        assert_eq!(Reply::Bytes(vec![0]).device_id(), None);
        assert_eq!(Reply::Silent.device_id(), None);
    }
}
