//! Questions to a bridge, outside of any job: who it is, what it does, how the printer is.

use std::io;
use std::time::Duration;

use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, Fault, JobKind, JobState, Lines, PAST, PastJob, Progress, Refusal, SCHEMA, Standing,
    StoredJob, ToBridge, ToHost, Usage, VERSION,
};

use crate::connection::transport::Transport;
use crate::connection::{Bridge, other_version, printable, stranger};

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
    /// It is not known whether it stands between two jobs, and the question would be row data inside one.
    Unsure,
    /// It was not asked, since the user does not want it.
    NotAsked,
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
        "bridge {:016x}: its firmware {} speaks version {} of the link, this program version {VERSION}; {}",
        .0.serial, .0.firmware, .0.version, other_version(.0.version)
    )]
    Version(Bridge),
    /// A job is open, so this must wait.
    #[error(
        "the bridge has job {0:08x} open; wait until it is done, or end it with `foilpress cancel {0:08x}`, which needs the \
         bridge's address for the job of another user or computer"
    )]
    JobOpen(u32),
    /// The bridge has no such job in its flash.
    #[error("the bridge has no stored job {0:08x}; `foilpress bridge jobs` lists those it has")]
    NotStored(u32),
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

/// What a bridge has in its flash.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Shelf {
    /// Bytes of data that one more job may have.
    pub room: u32,
    /// Bytes of data that the only job might have; 0 if the bridge cannot store any.
    pub total: u32,
    /// The jobs, the oldest first.
    pub jobs: Vec<Stored>,
}

/// A job in a bridge's flash.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stored {
    /// The number it was stored under.
    pub job: u32,
    /// The kind of its data.
    pub kind: JobKind,
    /// Its number of data bytes.
    pub length: u32,
    /// What it was called.
    pub name: String,
}

/// A conversation of questions.
pub struct Query<'t> {
    link: &'t mut dyn Transport,
    reader: Reader,
    request: u16,
    said: Greeting,
}

/// What a bridge answers to a greeting.
struct Greeting {
    bridge: Bridge,
    past: [PastJob; PAST],
    progress: Progress,
    /// Where the printer stands, and the job of which it has or may have a part.
    standing: (Standing, u32),
}

/// A message of the bridge that answers something.
enum Heard {
    Hello(Bridge, u32),
    Progress(Progress),
    Standing(Standing, u32),
    Lines(u16, Lines, Option<Fault>),
    Answer(u16, Reply),
    Refused(Refusal, u32),
    Log(u16, LogPiece),
    Past(Box<[PastJob; PAST]>),
    Usage(u16, Usage),
    Stored(u16, u8, Shelf),
}

impl<'t> Query<'t> {
    /// Greets the bridge, which has to speak this program's messages. Changes nothing: a job under way goes on.
    pub fn new(link: &'t mut dyn Transport, patience: Duration) -> Result<Query<'t>, QueryError> {
        let query = Query::with_any(link, patience)?;
        if query.said.bridge.version == VERSION {
            Ok(query)
        } else {
            Err(QueryError::Version(query.said.bridge))
        }
    }

    /// The same whatever messages it speaks: to put other firmware on it.
    pub fn with_any(link: &'t mut dyn Transport, patience: Duration) -> Result<Query<'t>, QueryError> {
        let mut reader = Reader::new();
        let said = greet(link, &mut reader, patience)?;
        Ok(Query { link, reader, request: 0, said })
    }

    /// Who answers.
    pub fn bridge(&self) -> &Bridge {
        &self.said.bridge
    }

    /// What it does.
    pub fn progress(&self) -> &Progress {
        &self.said.progress
    }

    /// Where the printer stands, and the job of which it has a part, or may have; 0 if there is none.
    pub fn standing(&self) -> (Standing, u32) {
        self.said.standing
    }

    /// How the jobs before have ended, the last one first.
    pub fn past(&self) -> impl Iterator<Item = &PastJob> {
        self.said.past.iter().filter(|past| past.job != 0)
    }

    /// How much of its memory and time the firmware has used.
    pub fn usage(&mut self, patience: Duration) -> Result<Usage, QueryError> {
        let number = self.next();
        let question = ToBridge::Ask { request: number, what: Ask::Board };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Usage(request, usage) if request == number => Some(usage),
            _ => None,
        })
    }

    /// What the bridge has in its flash.
    pub fn shelf(&mut self, patience: Duration) -> Result<Shelf, QueryError> {
        let mut shelf = Shelf::default();
        for index in 0..=u8::MAX {
            let number = self.next();
            let question = ToBridge::ListStored { request: number, index };
            let (count, one) =
                exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
                    Heard::Stored(request, count, one) if request == number => Some((count, one)),
                    _ => None,
                })?;
            (shelf.room, shelf.total) = (one.room, one.total);
            let missing = one.jobs.is_empty();
            shelf.jobs.extend(one.jobs);
            if missing || index.saturating_add(1) >= count {
                break;
            }
        }
        Ok(shelf)
    }

    /// Has the job `stored` printed from the bridge's flash, as job `job`, a number that was never used; says where it stands.
    ///
    /// Errors: [`QueryError::NotStored`], and [`QueryError::JobOpen`] while another job is open, beside those of every question.
    pub fn print_stored(
        &mut self,
        job: u32,
        stored: u32,
        patience: Duration,
    ) -> Result<Progress, QueryError> {
        let messages = [ToBridge::PrintStored { job, stored }];
        let mut open = self.said.progress.job;
        exchange(self.link, &mut self.reader, &messages, patience, &mut |heard| match heard {
            Heard::Progress(progress) if progress.job == job => Some(Ok(progress)),
            Heard::Progress(progress) => {
                open = progress.job;
                None
            }
            Heard::Refused(Refusal::NoSuchJob, refused) if refused == stored => {
                Some(Err(QueryError::NotStored(stored)))
            }
            Heard::Refused(Refusal::JobOpen, refused) if refused == job => {
                Some(Err(QueryError::JobOpen(open)))
            }
            _ => None,
        })?
    }

    /// Deletes a job from the bridge's flash.
    ///
    /// Errors: [`QueryError::NotStored`], and [`QueryError::JobOpen`] while it is printed, beside those of every question.
    pub fn delete_stored(&mut self, stored: u32, patience: Duration) -> Result<(), QueryError> {
        let (number, open) = (self.next(), self.said.progress.job);
        let messages = [ToBridge::DeleteStored { request: number, stored }];
        exchange(self.link, &mut self.reader, &messages, patience, &mut |heard| match heard {
            Heard::Stored(request, ..) if request == number => Some(Ok(())),
            Heard::Refused(Refusal::NoSuchJob, refused) if refused == stored => {
                Some(Err(QueryError::NotStored(stored)))
            }
            Heard::Refused(Refusal::JobOpen, refused) if refused == stored => {
                Some(Err(QueryError::JobOpen(open)))
            }
            _ => None,
        })?
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

    /// Asks the printer for its status answer or its device ID. A bridge without an open job that has something of its own to do,
    /// such as a reset, is asked again until `patience` ends.
    pub fn printer(&mut self, what: Ask, patience: Duration) -> Result<Reply, QueryError> {
        let end = self.link.now() + patience;
        loop {
            let left = end.saturating_sub(self.link.now());
            let number = self.next();
            let question = ToBridge::Ask { request: number, what };
            let reply = exchange(self.link, &mut self.reader, &[question], left, &mut |heard| match heard {
                Heard::Answer(request, reply) if request == number => Some(reply),
                _ => None,
            })?;
            let left = end.saturating_sub(self.link.now());
            if reply != Reply::NotNow || left <= REPEAT || self.ask_progress(left)?.is_open() {
                return Ok(reply);
            }
            self.rest(REPEAT)?;
        }
    }

    /// Waits for so long. What comes meanwhile answers nothing that is still asked.
    fn rest(&mut self, time: Duration) -> Result<(), QueryError> {
        let end = self.link.now() + time;
        while self.link.now() < end {
            let left = end.saturating_sub(self.link.now());
            self.link.receive(&mut [0; 1024], left)?;
        }
        Ok(())
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
        let number = self.next();
        let open = Some(self.said.progress).filter(Progress::is_open).map(|progress| progress.job);
        let question = ToBridge::Probe { request: number, data, control };
        exchange(self.link, &mut self.reader, &[question], patience, &mut |heard| match heard {
            Heard::Lines(request, lines, _) if request == number => Some(Ok(lines)),
            // Without a job the board has something of its own to do, such as a reset: it is asked again.
            Heard::Answer(request, Reply::NotNow) if request == number => {
                open.map(|open| Err(QueryError::JobOpen(open)))
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

    /// Resets the printer by the port's nInit line. Refused while a job is open.
    pub fn initialise(&mut self, patience: Duration) -> Result<(), QueryError> {
        let number = self.next();
        let messages = [ToBridge::Initialise { request: number }];
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
                    JobState::Printing | JobState::Stopped(_) | JobState::Storing => None,
                    _ => Some(Ok(progress)),
                },
                Heard::Refused(Refusal::NoSuchJob, refused) if refused == job => {
                    Some(Err(QueryError::NoSuchJob(job)))
                }
                _ => None,
            },
        )?
    }

    /// Gives up a job wherever it stands, and has the printer reset; says what the bridge made of it.
    ///
    /// Errors: [`QueryError::NoSuchJob`] beside those of every question.
    pub fn abandon(&mut self, job: u32, patience: Duration) -> Result<Progress, QueryError> {
        let messages = [ToBridge::Abandon { job }];
        exchange(self.link, &mut self.reader, &messages, patience, &mut |heard| match heard {
            Heard::Progress(progress) if progress.job == job && !progress.is_open() => Some(Ok(progress)),
            Heard::Refused(Refusal::NoSuchJob, refused) if refused == job => {
                Some(Err(QueryError::NoSuchJob(job)))
            }
            _ => None,
        })?
    }

    /// Where the job stands now, and the printer.
    pub fn ask_progress(&mut self, patience: Duration) -> Result<Progress, QueryError> {
        self.said = greet(self.link, &mut self.reader, patience)?;
        Ok(self.said.progress)
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

/// Of a bridge that does not say.
const NO_PAST: [PastJob; PAST] = [PastJob::NONE; PAST];
const NOTHING: Progress =
    Progress { job: 0, state: JobState::None, accepted: 0, limit: 0, printed: 0, pass: 0, row: 0 };
const NOT_SAID: (Standing, u32) = (Standing::UNKNOWN, 0);

/// Greets a bridge, and waits for all that it says of itself.
fn greet(link: &mut dyn Transport, reader: &mut Reader, patience: Duration) -> Result<Greeting, QueryError> {
    let hello = ToBridge::Hello { version: VERSION, schema: SCHEMA };
    let (mut bridge, mut past, mut progress, mut standing) = (None, None, None, None);
    exchange(link, reader, &[hello], patience, &mut |heard| {
        match heard {
            // The other messages of another version may mean anything.
            Heard::Hello(bridge, _) if bridge.version != VERSION => {
                return Some(Greeting { bridge, past: NO_PAST, progress: NOTHING, standing: NOT_SAID });
            }
            Heard::Hello(found, schema) => {
                bridge = Some(found);
                // Firmware that does not know all messages may not know this one.
                (past, progress, standing) = (None, None, (schema != SCHEMA).then_some(NOT_SAID));
            }
            Heard::Past(found) => past = Some(*found),
            Heard::Progress(found) => progress = Some(found),
            Heard::Standing(found, job) => standing = Some((found, job)),
            _ => return None,
        }
        Some(Greeting { bridge: bridge.clone()?, past: past?, progress: progress?, standing: standing? })
    })
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
    let start = link.now();
    let (mut said, mut sent) = (None::<Duration>, out.len());
    let mut buffer = [0; 1024];
    loop {
        let now = link.now().saturating_sub(start);
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
    let Ok(decoded) = frame::decode(message) else {
        return stranger(message).map(|bridge| Heard::Hello(bridge, 0));
    };
    Some(match decoded {
        ToHost::Hello { version, schema, boot, serial, firmware } => {
            Heard::Hello(Bridge { version, boot, serial, firmware: printable(firmware) }, schema)
        }
        ToHost::Standing { standing, job } => Heard::Standing(standing, job),
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
                Answer::Unsure => Reply::Unsure,
            },
        ),
        ToHost::Refused { reason, job } => Heard::Refused(reason, job),
        ToHost::LogPart { request, at, end, bytes } => {
            Heard::Log(request, LogPiece { at, end, bytes: bytes.to_vec() })
        }
        ToHost::Past(past) => Heard::Past(Box::new(past)),
        ToHost::Board { request, usage } => Heard::Usage(request, usage),
        ToHost::Stored { request, count, room, total, job } => {
            let stored = |job: StoredJob<'_>| Stored {
                job: job.job,
                kind: job.kind,
                length: job.length,
                name: printable(job.name),
            };
            Heard::Stored(request, count, Shelf { room, total, jobs: job.map(stored).into_iter().collect() })
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a program says that greets a bridge which answers with these messages.
    fn greets(messages: &[&[u8]]) -> Result<u8, String> {
        use crate::connection::transport::pair;
        let (mut host, mut board) = pair();
        for message in messages {
            let sum = frame::checksum(message).to_le_bytes();
            let mut coded = vec![0; 2 * MAX];
            let length = cobs(&[message, &sum[..]].concat(), &mut coded);
            assert_eq!(board.send(&coded[..length]).unwrap(), length);
        }
        Query::new(&mut host, Duration::from_millis(900))
            .map(|query| query.bridge().version)
            .map_err(|error| error.to_string())
    }

    /// Frames bytes as the wire format has it, whatever they are.
    fn cobs(bytes: &[u8], out: &mut [u8]) -> usize {
        let (mut code, mut at) = (0, 1);
        for &byte in bytes {
            if byte == 0 {
                out[code] = (at - code) as u8;
                (code, at) = (at, at + 1);
            } else {
                (out[at], at) = (byte, at + 1);
            }
        }
        out[code] = (at - code) as u8;
        out[at] = 0;
        at + 1
    }

    #[test]
    fn a_bridge_of_another_version_is_refused_with_the_command_that_helps() {
        // Hello: version, schema, boot, serial, firmware; then no jobs, and no job.
        let hello = |version| [0, version, 1, 1, 0xab, 1, 3, b'9', b'.', b'9'];
        let past = [&[7][..], &[0; 3 * PAST]].concat();
        let progress = [1, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(greets(&[&hello(VERSION), &past, &progress]), Ok(VERSION));
        // Whatever else another version says, or does not say.
        let unknown: &[u8] = &[1, 7, 99, 1, 2, 3];
        for rest in [vec![&past[..], &progress[..]], vec![&progress[..]], vec![unknown], vec![]] {
            for version in [VERSION - 1, VERSION + 1] {
                let hello = hello(version);
                let said = greets(&[&[&hello[..]][..], &rest[..]].concat()).unwrap_err();
                assert!(said.contains("9.9") && said.contains("foilpress bridge flash"), "{said}");
                assert!(said.contains(&format!("version {version} of the link")), "{said}");
            }
        }
        // A Hello with more in it, or less, than any that is known.
        for hello in [&[0, VERSION + 1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11][..], &[0, VERSION + 1]] {
            let said = greets(&[hello]).unwrap_err();
            assert!(said.contains("speaks version") && said.contains("bridge flash"), "{said}");
        }
    }

    /// A bridge in its own time that is busy for the first few questions.
    struct Busy {
        now: Duration,
        reader: Reader,
        out: Vec<u8>,
        busy: usize,
        state: JobState,
        asked: Vec<Duration>,
    }

    impl Transport for Busy {
        fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut rest = bytes;
            loop {
                let (message, behind) = match self.reader.read(rest) {
                    Read::More => return Ok(bytes.len()),
                    Read::Damaged(_, behind) => {
                        rest = behind;
                        continue;
                    }
                    Read::Message(message, behind) => {
                        (frame::decode::<ToBridge<'_>>(message).unwrap(), behind)
                    }
                };
                rest = behind;
                let progress = Progress { state: self.state, ..NOTHING };
                let hello =
                    ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 1, firmware: "0" };
                let standing = ToHost::Standing { standing: Standing::AT_REST, job: 0 };
                let said = match message {
                    ToBridge::Ask { request, .. } => {
                        self.asked.push(self.now);
                        let is_busy = self.asked.len() <= self.busy;
                        let answer = if is_busy { Answer::NotNow } else { Answer::Bytes(b"well") };
                        vec![ToHost::Answer { request, answer }]
                    }
                    _ => vec![hello, ToHost::Past(NO_PAST), ToHost::Progress(progress), standing],
                };
                for message in said {
                    let mut room = [0; MAX];
                    let length = frame::write(&message, &mut room).unwrap();
                    self.out.extend_from_slice(&room[..length]);
                }
            }
        }

        fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
            if self.out.is_empty() {
                self.now += patience;
            }
            let count = self.out.len().min(buffer.len());
            buffer[..count].copy_from_slice(&self.out[..count]);
            self.out.drain(..count);
            Ok(count)
        }

        fn now(&self) -> Duration {
            self.now
        }
    }

    #[test]
    fn a_bridge_that_is_busy_without_a_job_is_asked_again_and_not_too_often() {
        let ask = |busy, state| {
            let mut link = Busy {
                now: Duration::ZERO,
                reader: Reader::new(),
                out: Vec::new(),
                busy,
                state,
                asked: Vec::new(),
            };
            let mut query = Query::new(&mut link, Duration::from_secs(1)).unwrap();
            let reply = query.printer(Ask::Printer, Duration::from_secs(3)).unwrap();
            (reply, link.asked)
        };
        let (reply, asked) = ask(3, JobState::None);
        assert_eq!((reply, asked.len()), (Reply::Bytes(b"well".to_vec()), 4));
        assert!(asked.windows(2).all(|two| two[1] - two[0] >= REPEAT), "{asked:?}");
        // It stays busy, and so does one that prints, which is not asked again.
        let (reply, asked) = ask(usize::MAX, JobState::None);
        assert!(reply == Reply::NotNow && asked.len() <= 8, "{asked:?}");
        let (reply, asked) = ask(usize::MAX, JobState::Printing);
        assert_eq!((reply, asked.len()), (Reply::NotNow, 1));
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
