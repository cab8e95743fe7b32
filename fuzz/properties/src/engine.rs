//! The bridge's engine: no garbage and no order of calls makes it fail, and what crosses the port is the job.
//!
//! The input is a script: the jobs' data, then what happens. Its host repeats itself, forgets, resets the bridge and
//! talks rubbish, but it never lies about a job's data; so a job that is done has printed what an undisturbed engine
//! makes of them, and one that ended early has left the printer at the end of a whole job, or reset it. A
//! printer of which nothing is known yet, and one that was without its supply, are reset before any byte.

use super::frame::framed;
use arbitrary::{Result, Unstructured};
use bridge::engine::{Checkpoint, Engine, Identity, LOCAL, Memory, Outcome, Task};
use protocol::ink::Ink;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, Fault, Handshake, JobKind, JobState, Lines, PortSettings, Progress, ToBridge, ToHost,
};
use protocol::paper::Paper;
use protocol::rgl::{Order, Page, Step, parse};
use protocol::runs::{Decoder, Header, MAX_HEADER};
use protocol::walk::Frame;

/// Lives of the bridge in a script.
const LIVES: usize = 4;

/// A script.
pub fn check(bytes: &[u8]) {
    let mut script = Unstructured::new(bytes);
    let Ok(jobs) = (1..=2).map(|id| Job::new(id, &mut script)).collect::<Result<Vec<Job>>>() else { return };
    let mut boards: Vec<Board> = (0..LIVES).map(|_| Board::new()).collect();
    let mut boards = boards.iter_mut();
    let Some(board) = boards.next() else { return };
    let mut bench = Bench {
        engine: Engine::new(board.memory(), identity(1)),
        reader: Reader::new(),
        jobs: &jobs,
        open: None,
        printed: Vec::new(),
        offered: Vec::new(),
        must_reset: true,
    };
    while !script.is_empty() {
        if step(&mut bench, &mut boards, &mut script).is_err() {
            return;
        }
        bench.look();
    }
}

/// Memory of one life; small, so that everything runs full.
struct Board {
    data: [u8; 2100],
    output: [u8; 2048],
    band: [u8; 2048],
    decoder: Decoder,
}

impl Board {
    fn new() -> Board {
        Board { data: [0; 2100], output: [0; 2048], band: [0; 2048], decoder: Decoder::default() }
    }

    fn memory(&mut self) -> Memory<'_> {
        Memory {
            data: &mut self.data,
            output: &mut self.output,
            band: &mut self.band,
            decoder: &mut self.decoder,
        }
    }
}

fn identity(boot: u32) -> Identity {
    Identity { boot, serial: 2, firmware: "fuzzed" }
}

struct Job {
    id: u32,
    kind: JobKind,
    data: Vec<u8>,
    /// What an undisturbed engine makes of it.
    expected: Vec<u8>,
    state: JobState,
}

impl Job {
    fn new(id: u32, script: &mut Unstructured<'_>) -> Result<Job> {
        let (kind, start) = match script.int_in_range(0..=3)? {
            0 => (JobKind::Raw, Vec::new()),
            1 => (JobKind::Raw, setup()),
            2 => (JobKind::Streams, Vec::new()),
            _ => (JobKind::Streams, header(script)?),
        };
        let length = script.int_in_range(1..=3000)?;
        let mut data = start;
        data.extend_from_slice(script.bytes(script.len().min(length))?);
        if data.is_empty() {
            data.push(0);
        }
        let (expected, state) = undisturbed(kind, &data);
        Ok(Job { id, kind, data, expected, state })
    }

    fn begin(&self) -> ToBridge<'static> {
        ToBridge::Begin { job: self.id, kind: self.kind, length: self.data.len() as u32 }
    }
}

/// A legal setup with the beginning of a white pass and two rows in it.
fn setup() -> Vec<u8> {
    b"\x1b%\x80A\x1b*t\x03R\0\x1b&l\0\0M\x1b&l\x04\0A\x1b&l\xe4\x18P\x1b&a\xc0\x12M\x1b\x1a\0\0C\x1b*r\x04U\x1b*r\0A\
      \x1b\x1a\x0b\0r\x1b*b\0\0M\x1b*b\x02\0W\x01\x02\x1b*b\x03\0Y\x1b*b\x01\0W\x80"
        .to_vec()
}

/// The header of a small page of two passes.
fn header(script: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let (columns, rows) = (script.int_in_range(1..=300)?, script.int_in_range(1..=200)?);
    let header = Header::new(Page::plain(Paper::A4), &[Ink::White, Ink::Cyan], None, columns, rows);
    let mut out = [0; MAX_HEADER];
    let header = header.expect("a page with room for it");
    let (x, y) = (script.int_in_range(0..=columns - 1)?, script.int_in_range(0..=rows - 1)?);
    let (width, height) = (script.int_in_range(1..=columns - x)?, script.int_in_range(1..=rows - y)?);
    let header = header.framed(Frame { x, y, width, height }).expect("a picture within it");
    let length = header.write(&mut out);
    Ok(out[..length].to_vec())
}

/// Everything at once on a link that takes it.
fn undisturbed(kind: JobKind, data: &[u8]) -> (Vec<u8>, JobState) {
    let mut board = Board::new();
    let mut engine = Engine::new(board.memory(), identity(1));
    engine.wake(true, 0);
    let (mut reader, mut printed) = (Reader::new(), Vec::new());
    tell(&mut engine, &mut reader, &ToBridge::Begin { job: 9, kind, length: data.len() as u32 });
    loop {
        let before = engine.progress();
        if is_final(before.state) {
            return (printed, before.state);
        }
        let end = before.limit.min(before.accepted + 900);
        if before.accepted < end {
            let bytes = &data[before.accepted as usize..end as usize];
            tell(&mut engine, &mut reader, &ToBridge::Data { job: 9, offset: before.accepted, bytes });
        }
        let worked = engine.work();
        let bytes = engine.output();
        printed.extend_from_slice(bytes);
        let count = bytes.len();
        engine.consumed(count);
        let after = engine.progress();
        assert!(
            worked || count > 0 || before != after,
            "nothing moves at {} of {} bytes",
            after.accepted,
            data.len()
        );
    }
}

fn tell(engine: &mut Engine<'_>, reader: &mut Reader, message: &ToBridge<'_>) {
    let mut buffer = [0; MAX];
    let length = frame::write(message, &mut buffer).expect("a frame");
    engine.receive(reader, &buffer[..length]);
}

fn is_final(state: JobState) -> bool {
    !matches!(state, JobState::Printing | JobState::Stopped(_) | JobState::Cancelling)
}

struct Bench<'m, 'j> {
    engine: Engine<'m>,
    reader: Reader,
    jobs: &'j [Job],
    /// The job under way, when last looked.
    open: Option<u32>,
    /// What has crossed the port of it.
    printed: Vec<u8>,
    /// What has been taken of it, if it came through the plain interface.
    offered: Vec<u8>,
    /// The printer stands inside a job, or nobody knows where: the next thing it gets must be a reset.
    must_reset: bool,
}

impl Bench<'_, '_> {
    fn tell(&mut self, message: &ToBridge<'_>) {
        tell(&mut self.engine, &mut self.reader, message);
    }

    /// Takes what has happened to the job into account.
    fn look(&mut self) {
        let now = self.engine.progress();
        assert!(now.accepted <= now.limit);
        if !is_final(now.state) {
            self.open = Some(now.job);
        } else if let Some(job) = self.open.take() {
            assert_eq!(now.job, job);
            self.ended(&now);
            self.printed.clear();
            self.offered.clear();
        }
    }

    fn ended(&mut self, now: &Progress) {
        assert_eq!(now.printed as usize, self.printed.len());
        match (now.state, self.jobs.iter().find(|job| job.id == now.job)) {
            (JobState::Done, Some(job)) => {
                assert_eq!(job.state, JobState::Done);
                assert!(self.printed == job.expected, "other bytes at the port");
            }
            (JobState::Done, None) => {
                assert_eq!(now.job, LOCAL);
                assert!(self.printed == self.offered, "other bytes at the port");
            }
            (JobState::Cancelled | JobState::Broken(_), job) => {
                let proper = match job {
                    Some(Job { kind: JobKind::Streams, .. }) => true,
                    Some(job) => grammar(&job.data) != Grammar::Broken,
                    None => grammar(&self.offered) != Grammar::Broken,
                };
                // What was broken when it came is passed through as it is.
                self.must_reset =
                    proper && !self.printed.is_empty() && grammar(&self.printed) != Grammar::Whole;
            }
            (JobState::Lost, _) => self.must_reset = !self.printed.is_empty(),
            (state, _) => panic!("a job has ended {state:?}"),
        }
    }

    fn consume(&mut self, most: usize) {
        let bytes = self.engine.output();
        let count = bytes.len().min(most);
        if count > 0 {
            assert!(!self.must_reset, "bytes for a printer that stands inside a job");
        }
        self.printed.extend_from_slice(&bytes[..count]);
        self.engine.consumed(count);
    }

    fn answer(&mut self, script: &mut Unstructured<'_>) -> Result<()> {
        let Some(task) = self.engine.task() else { return Ok(()) };
        let outcome = match task {
            Task::PrinterStatus | Task::DeviceId => Outcome::Answer(match script.int_in_range(0..=2)? {
                0 => Answer::Silent,
                1 => Answer::Stopped(Fault::OffLine),
                _ => Answer::Bytes(b"an answer"),
            }),
            Task::Configure(_) if script.ratio(1u8, 2u8)? => Outcome::BadSettings,
            _ => Outcome::Done,
        };
        self.engine.done(outcome);
        // A job that was given up has ended with its reset.
        self.look();
        self.must_reset &= task != Task::Initialise;
        Ok(())
    }

    /// Everything it has to say are messages.
    fn hear(&mut self) {
        let (mut reader, mut buffer) = (Reader::new(), [0; MAX]);
        for _ in 0..20 {
            let length = self.engine.transmit(&mut buffer);
            if length == 0 {
                return;
            }
            let Read::Message(message, []) = reader.read(&buffer[..length]) else { panic!("not a frame") };
            assert!(frame::decode::<ToHost<'_>>(message).is_ok(), "not a message");
        }
        panic!("it does not stop talking");
    }
}

fn step<'m>(
    bench: &mut Bench<'m, '_>,
    boards: &mut dyn Iterator<Item = &'m mut Board>,
    script: &mut Unstructured<'_>,
) -> Result<()> {
    let jobs = bench.jobs;
    let job = &jobs[usize::from(script.ratio(1u8, 4u8)?)];
    match script.int_in_range(0..=19)? {
        0 => bench.tell(&ToBridge::Hello { version: script.arbitrary()?, schema: 0 }),
        1 => bench.tell(&job.begin()),
        2..=5 => {
            let accepted = bench.engine.progress().accepted as usize;
            // Mostly what comes next; otherwise something before or behind it.
            let from = match script.int_in_range(0..=3)? {
                0 => script.int_in_range(0..=job.data.len())?,
                _ => accepted.min(job.data.len()),
            };
            let end = (from + script.int_in_range(0..=900)?).min(job.data.len());
            bench.tell(&ToBridge::Data { job: job.id, offset: from as u32, bytes: &job.data[from..end] });
        }
        6 => bench.tell(&ToBridge::Cancel { job: job.id }),
        7 => {
            let what = *script.choose(&[Ask::Lines, Ask::Printer, Ask::DeviceId])?;
            bench.tell(&ToBridge::Ask { request: script.arbitrary()?, what });
        }
        8 => bench.tell(&match script.int_in_range(0..=4)? {
            0 => ToBridge::Initialise { request: script.arbitrary()? },
            4 => ToBridge::Abandon { job: job.id },
            1 => ToBridge::Bootloader,
            2 => ToBridge::Drive { data: script.arbitrary()?, control: script.arbitrary()? },
            _ => ToBridge::Configure(PortSettings {
                setup_ns: script.arbitrary()?,
                strobe_ns: 0,
                hold_ns: 0,
                settle_ns: 0,
                handshake: Handshake::Busy,
                patience_s: script.arbitrary()?,
                heed: Lines(script.arbitrary()?),
            }),
        }),
        9 => {
            let rubbish = script.bytes(script.len().min(40))?;
            bench.engine.receive(&mut bench.reader, rubbish);
        }
        10 => {
            let body = script.bytes(script.len().min(12))?;
            // Not what would be another host's lie about a job.
            if !matches!(
                frame::decode::<ToBridge<'_>>(body),
                Ok(ToBridge::Data { .. } | ToBridge::Begin { .. } | ToBridge::Bootloader)
            ) {
                bench.engine.receive(&mut bench.reader, &framed(body));
            }
        }
        11 | 12 => {
            for _ in 0..script.int_in_range(1..=60)? {
                bench.engine.work();
                bench.look();
            }
        }
        13 | 14 => bench.consume(script.int_in_range(0..=2048)?),
        15 => {
            let power = if script.ratio(7u8, 8u8)? { Lines::POWER } else { 0 };
            let lines = Lines(script.arbitrary::<u8>()? & !Lines::POWER | power);
            bench.engine.port(lines, lines.fault());
            bench.must_reset |= power == 0;
        }
        16 => bench.answer(script)?,
        17 => match script.int_in_range(0..=2)? {
            0 => {
                bench.engine.link_lost();
                bench.reader.reset();
            }
            1 => bench.hear(),
            _ => {
                if let Some(board) = boards.next() {
                    let kept: Checkpoint = bench.engine.checkpoint();
                    bench.engine = Engine::resume(board.memory(), identity(2), kept);
                    bench.reader.reset();
                }
            }
        },
        18 => {
            let bytes = script.bytes(script.len().min(200))?;
            let taken = bench.engine.local(bytes);
            if taken > 0 && bench.open.is_none() {
                bench.look();
            }
            bench.offered.extend_from_slice(&bytes[..taken]);
        }
        _ => bench.engine.local_end(),
    }
    Ok(())
}

#[derive(PartialEq, Eq)]
enum Grammar {
    /// Exactly one job.
    Whole,
    /// The beginning of one.
    Beginning,
    Broken,
}

/// What these bytes are by the strict grammar.
fn grammar(mut bytes: &[u8]) -> Grammar {
    let mut order = Order::new();
    while !bytes.is_empty() {
        match parse(bytes) {
            Ok(Step::Command(command, length)) if order.accept(&command).is_ok() => bytes = &bytes[length..],
            Ok(Step::More(_)) => return Grammar::Beginning,
            _ => return Grammar::Broken,
        }
    }
    if order.is_complete() { Grammar::Whole } else { Grammar::Beginning }
}
