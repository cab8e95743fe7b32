//! Both ends of the link in memory: a small host, a wire that misbehaves, a port with an absent-minded operator.
#![forbid(unsafe_code)]
#![allow(missing_docs, reason = "a model for tests, read beside them")]

pub mod bench;
pub mod flash;

use bridge::engine::{Checkpoint, Engine, Identity, Memory, Outcome, Task};
use protocol::ink::Ink;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{Answer, Fault, JobKind, JobState, Lines, Progress, ToBridge, ToHost, VERSION};
use protocol::paper::Paper;
use protocol::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use protocol::rgl::{self, JobSetup, JobWriter, Order, Page, Step};
use protocol::runs::{Decoder, Header, MAX_BAND, MAX_HEADER, encode, stride};
use protocol::walk::{Frame, Placed};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub const IDENTITY: Identity = Identity { boot: 1, serial: 2, firmware: "test" };

/// Memory for an engine; leaked, because tests have plenty and an engine borrows it for good.
pub fn memory(data: usize, output: usize, band: usize) -> Memory<'static> {
    let leak = |size| Box::leak(vec![0; size].into_boxed_slice());
    let decoder = Box::leak(Box::default());
    Memory { data: leak(data), output: leak(output), band: leak(band), decoder }
}

/// An engine whose diary says that the printer stands between two jobs.
pub fn rested<'m>(memory: Memory<'m>, identity: Identity) -> Engine<'m> {
    let mut engine = Engine::new(memory, identity);
    engine.wake(true, 0);
    engine
}

/// The memory of one engine after the other.
pub struct Board {
    data: Vec<u8>,
    output: Vec<u8>,
    band: Vec<u8>,
    decoder: Box<Decoder>,
}

impl Board {
    pub fn new(data: usize, output: usize) -> Self {
        Board { data: vec![0; data], output: vec![0; output], band: vec![0; 40_000], decoder: Box::default() }
    }

    pub fn memory(&mut self) -> Memory<'_> {
        Memory {
            data: &mut self.data,
            output: &mut self.output,
            band: &mut self.band,
            decoder: &mut self.decoder,
        }
    }
}

pub struct Job {
    pub id: u32,
    pub kind: JobKind,
    pub data: Vec<u8>,
    /// What is to be at the port, made another way.
    pub expected: Vec<u8>,
}

/// Random planes and the job the host's own encoder makes of them.
pub struct Planes {
    pub inks: Vec<Ink>,
    pub width: u16,
    pub rows: u16,
    pub bits: Vec<Vec<u8>>,
    /// Where the walk goes.
    pub walk: Placed,
}

impl Planes {
    pub fn random(random: &mut ChaCha8Rng) -> Planes {
        let width = random.random_range(1..500u16);
        let rows = random.random_range(1..260u16);
        let count = random.random_range(1..4usize);
        let inks = (0..count).map(|_| Ink::ALL[random.random_range(0..8)]).collect();
        let bits = (0..count)
            .map(|_| {
                let mut plane = vec![0u8; stride(width) * usize::from(rows)];
                for _ in 0..random.random_range(0..60) {
                    let (x0, y0) = (random.random_range(0..width), random.random_range(0..rows));
                    let (dx, dy) = (random.random_range(1..40u16), random.random_range(1..40u16));
                    for y in y0..(y0 + dy).min(rows) {
                        for x in x0..(x0 + dx).min(width) {
                            plane[usize::from(y) * stride(width) + usize::from(x) / 8] ^= 0x80 >> (x % 8);
                        }
                    }
                }
                plane
            })
            .collect();
        let (x, y) = (random.random_range(0..width), random.random_range(0..rows));
        let size = (random.random_range(1..=width - x), random.random_range(1..=rows - y));
        let walk = Placed::new(width, rows, Frame { x, y, width: size.0, height: size.1 }).unwrap();
        Planes { inks, width, rows, bits, walk }
    }

    fn page() -> Page {
        Page::plain(Paper::A4)
    }

    /// By the encoder that writes files.
    pub fn printed(&self) -> Vec<u8> {
        let mut writer =
            JobWriter::new(JobSetup::new(Self::page(), &self.inks, None).unwrap(), self.rows).unwrap();
        let mut out = vec![0; COMMAND_ROOM + ROW_ROOM + stride(self.width)];
        let mut bytes = Vec::new();
        let length = writer.begin(&mut out).unwrap();
        bytes.extend_from_slice(&out[..length]);
        for plane in &self.bits {
            let length = writer.next_pass(&mut out).unwrap();
            bytes.extend_from_slice(&out[..length]);
            for row in plane.chunks_exact(stride(self.width)) {
                let length = writer.row(row, &mut out).unwrap();
                bytes.extend_from_slice(&out[..length]);
            }
        }
        let length = writer.end(&mut out).unwrap();
        bytes.extend_from_slice(&out[..length]);
        bytes
    }

    pub fn streams(&self) -> Vec<u8> {
        let header = Header::new(Self::page(), &self.inks, None, self.width, self.rows).unwrap();
        let mut out = [0; MAX_HEADER];
        let length = header.framed(self.walk.frame()).unwrap().write(&mut out);
        let mut bytes = out[..length].to_vec();
        let mut buffer = vec![0; MAX_BAND];
        for plane in &self.bits {
            encode(&self.walk, plane, &mut buffer, |band| bytes.extend_from_slice(band)).unwrap();
        }
        bytes
    }
}

impl Job {
    pub fn random(id: u32, random: &mut ChaCha8Rng) -> Job {
        let planes = Planes::random(random);
        let expected = planes.printed();
        if random.random_bool(0.5) {
            Job { id, kind: JobKind::Streams, data: planes.streams(), expected }
        } else {
            Job { id, kind: JobKind::Raw, data: expected.clone(), expected }
        }
    }
}

/// Whether these bytes are exactly one job by the strict grammar.
pub fn is_a_whole_job(mut bytes: &[u8]) -> bool {
    let mut order = Order::new();
    while !bytes.is_empty() {
        let Ok(Step::Command(command, length)) = rgl::parse(bytes) else { return false };
        if order.accept(&command).is_err() {
            return false;
        }
        bytes = &bytes[length..];
    }
    order.is_complete()
}

pub fn framed(message: &ToBridge<'_>) -> Vec<u8> {
    let mut buffer = [0; MAX];
    let length = frame::write(message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

/// A host that knows its job and nothing else: what a journal would give back after a crash.
pub struct Host<'j> {
    job: &'j Job,
    reader: Reader,
    next: u32,
    progress: Option<Progress>,
    silence: u32,
    pub cancel: bool,
    pub finished: Option<JobState>,
    /// The largest piece of data in a frame.
    pub piece: usize,
}

impl<'j> Host<'j> {
    pub fn new(job: &'j Job) -> Self {
        Host {
            job,
            reader: Reader::new(),
            next: 0,
            progress: None,
            silence: 100,
            cancel: false,
            finished: None,
            piece: 300,
        }
    }

    pub fn link_lost(&mut self) {
        self.reader.reset();
        self.progress = None;
        self.silence = 100;
    }

    /// What it has to say now: frames.
    pub fn speak(&mut self) -> Vec<Vec<u8>> {
        let Job { id, kind, ref data, .. } = *self.job;
        let mut frames = Vec::new();
        self.silence += 1;
        if self.cancel && self.silence % 4 == 1 {
            frames.push(framed(&ToBridge::Cancel { job: id }));
        }
        if self.silence > 20 {
            self.silence = 0;
            // A zero ends whatever stands in the bridge's reader.
            frames.push(vec![0]);
            frames.push(framed(&ToBridge::Hello { version: VERSION, schema: 0 }));
            frames.push(framed(&ToBridge::Begin { job: id, kind, length: data.len() as u32 }));
            self.next = self.progress.map_or(0, |progress| progress.accepted);
        }
        let Some(progress) = self.progress else { return frames };
        for _ in 0..3 {
            if self.next >= progress.limit {
                break;
            }
            let end = (self.next + self.piece as u32).min(progress.limit);
            let bytes = &data[self.next as usize..end as usize];
            frames.push(framed(&ToBridge::Data { job: id, offset: self.next, bytes }));
            self.next = end;
        }
        frames
    }

    pub fn hear(&mut self, mut bytes: &[u8]) {
        loop {
            match self.reader.read(bytes) {
                Read::More => break,
                Read::Damaged(_, rest) => bytes = rest,
                Read::Message(message, rest) => {
                    bytes = rest;
                    if let Ok(ToHost::Progress(progress)) = frame::decode(message) {
                        let job = self.job;
                        if progress.job != job.id {
                            continue;
                        }
                        match progress.state {
                            JobState::Printing | JobState::Stopped(_) | JobState::Cancelling => {}
                            state => self.finished = Some(state),
                        }
                        let stalled =
                            self.progress.is_some_and(|before| before.accepted == progress.accepted);
                        // The bridge does not come on, or has begun again: so does the host.
                        if stalled || progress.accepted > self.next || self.next > progress.limit {
                            self.next = progress.accepted;
                        }
                        if !stalled {
                            self.silence = 0;
                        }
                        self.progress = Some(progress);
                    }
                }
            }
        }
    }
}

/// How often things go wrong, in 1000 each.
#[derive(Clone, Copy)]
pub struct Mischief {
    pub drop: u32,
    pub duplicate: u32,
    pub swap: u32,
    pub flip: u32,
    pub cut: u32,
    pub stall: u32,
    pub kill: u32,
    pub reset: u32,
    pub fault: u32,
}

pub const NONE: Mischief =
    Mischief { drop: 0, duplicate: 0, swap: 0, flip: 0, cut: 0, stall: 0, kill: 0, reset: 0, fault: 0 };
pub const ALL: Mischief = Mischief {
    drop: 40,
    duplicate: 40,
    swap: 40,
    flip: 40,
    cut: 30,
    stall: 30,
    kill: 20,
    reset: 25,
    fault: 20,
};

/// How often a wire did what.
#[derive(Default, Debug)]
pub struct Damages {
    pub drops: usize,
    pub duplicates: usize,
    pub swaps: usize,
    pub flips: usize,
}

/// What a wire makes of frames.
pub fn damage<'f>(
    frames: impl Iterator<Item = &'f [u8]>,
    mischief: &Mischief,
    random: &mut ChaCha8Rng,
    done: &mut Damages,
) -> Vec<u8> {
    let mut out: Vec<&[u8]> = Vec::new();
    for frame in frames {
        if chance(mischief.drop, random) {
            done.drops += 1;
            continue;
        }
        if chance(mischief.duplicate, random) {
            done.duplicates += 1;
            out.push(frame);
        }
        out.push(frame);
        if out.len() > 1 && chance(mischief.swap, random) {
            done.swaps += 1;
            let last = out.len() - 1;
            let other = random.random_range(0..last);
            out.swap(last, other);
        }
    }
    let mut bytes = out.concat();
    for byte in &mut bytes {
        if mischief.flip > 0 && random.next_u32() % 50_000 < mischief.flip {
            done.flips += 1;
            *byte ^= 1 << random.random_range(0..8);
        }
    }
    bytes
}

pub fn chance(in_1000: u32, random: &mut ChaCha8Rng) -> bool {
    in_1000 > 0 && random.next_u32() % 1000 < in_1000
}

pub struct Run {
    /// What crossed the port.
    pub printed: Vec<u8>,
    pub state: JobState,
    /// Of them: how often the link was cut, the host killed, the bridge reset.
    pub accidents: [usize; 3],
    /// Whether the printer was reset by nInit.
    pub initialised: bool,
}

/// Sends a job over a bad link to a bad printer. Cancels it when so many bytes have crossed the port.
pub fn run(job: &Job, mischief: &Mischief, cancel_at: Option<usize>, random: &mut ChaCha8Rng) -> Run {
    let mut boards: Vec<Board> = Vec::new();
    let sizes = (random.random_range(2048..6000), random.random_range(2048..6000));
    boards.push(Board::new(sizes.0, sizes.1));
    let mut result =
        Run { printed: Vec::new(), state: JobState::None, accidents: [0; 3], initialised: false };
    let mut checkpoint: Option<Checkpoint> = None;
    let mut damages = Damages::default();
    let mut host = Host::new(job);
    'powered: loop {
        let mut board = Board::new(sizes.0, sizes.1);
        let mut engine = match checkpoint {
            Some(checkpoint) => Engine::resume(board.memory(), IDENTITY, checkpoint),
            None => rested(board.memory(), IDENTITY),
        };
        let mut reader = Reader::new();
        let mut faulty = 0u32;
        for tick in 0.. {
            assert!(tick < 200_000, "the job does not come to an end");
            if let Some(state) = host.finished {
                result.state = state;
                return result;
            }
            host.cancel |= cancel_at.is_some_and(|at| result.printed.len() >= at);
            host.piece = random.random_range(1..960);
            if chance(mischief.kill, random) {
                result.accidents[1] += 1;
                let cancel = host.cancel;
                host = Host::new(job);
                host.cancel = cancel;
                engine.link_lost();
                reader.reset();
            }
            // To the bridge.
            let said = host.speak();
            let mut there = damage(said.iter().map(|frame| &frame[..]), mischief, random, &mut damages);
            let cut = chance(mischief.cut, random);
            if cut {
                there.truncate(random.random_range(0..=there.len()));
            }
            let mut left = &there[..];
            while !left.is_empty() {
                let (portion, rest) = left.split_at(random.random_range(1..=64).min(left.len()));
                engine.receive(&mut reader, portion);
                left = rest;
            }
            // In the bridge.
            for _ in 0..random.random_range(0..60) {
                if !engine.work() {
                    break;
                }
            }
            if let Some(task) = engine.task() {
                result.initialised |= task == Task::Initialise;
                engine.done(match task {
                    Task::PrinterStatus | Task::DeviceId => Outcome::Answer(Answer::OneWay),
                    _ => Outcome::Done,
                });
            }
            // At the port.
            if chance(mischief.fault, random) {
                faulty = random.random_range(1..50);
            }
            faulty = faulty.saturating_sub(1);
            let fault = (faulty > 0).then_some(Fault::PaperOut);
            engine.port(Lines::IDLE, fault);
            if fault.is_none() {
                let most = random.random_range(0..400);
                let bytes = engine.output();
                let count = bytes.len().min(most);
                result.printed.extend_from_slice(&bytes[..count]);
                engine.consumed(count);
            }
            checkpoint = Some(engine.checkpoint());
            if chance(mischief.reset, random) {
                result.accidents[2] += 1;
                host.link_lost();
                continue 'powered;
            }
            // To the host.
            let mut back = Vec::new();
            let mut frame = [0; MAX];
            loop {
                let length = engine.transmit(&mut frame);
                if length == 0 {
                    break;
                }
                back.push(frame[..length].to_vec());
            }
            let mut back = damage(back.iter().map(|frame| &frame[..]), mischief, random, &mut damages);
            if cut {
                result.accidents[0] += 1;
                back.truncate(random.random_range(0..=back.len()));
            }
            if !chance(mischief.stall, random) {
                host.hear(&back);
            }
            if cut {
                host.link_lost();
                engine.link_lost();
                reader.reset();
            }
        }
    }
}

pub fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}
