//! The host's real session and the bridge's real engine with a bad wire, a bad port and accidents between them, in
//! virtual time.

use bridge::engine::{Checkpoint, Engine, Identity, Outcome as Done, Task};
use device::transit::session::{Outcome, Record, Session, SessionError};
use model::{Board, Damages, Job, Mischief, chance, damage, rested};
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::{Answer, Fault, Lines};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;
use std::time::Duration;

/// Accidents the model of the bridge's own tests does not have, in 1000 each.
#[derive(Clone, Copy)]
pub struct Extra {
    /// A burst is held back, and overtaken by later ones.
    pub delay: u32,
    /// The host dies after it has made its record durable and before a byte has left.
    pub late_kill: u32,
    /// The link goes and cannot be opened again for a while: a cable, a sleeping computer, a bridge that is enumerated
    /// anew.
    pub away: u32,
    /// The bridge restarts and has forgotten everything.
    pub amnesia: u32,
}

/// How often what happened.
#[derive(Default, Debug)]
pub struct Accidents {
    pub wire: Damages,
    pub cuts: usize,
    pub kills: usize,
    pub resets: usize,
    pub aways: usize,
    pub delays: usize,
    pub stalls: usize,
    pub out_of_paper: usize,
    pub off_line: usize,
    pub in_error: usize,
    pub busy: usize,
    /// Of the last four, those that lasted for minutes.
    pub minutes: usize,
}

impl Accidents {
    fn counts(&mut self) -> [&mut usize; 15] {
        [
            &mut self.wire.drops,
            &mut self.wire.duplicates,
            &mut self.wire.swaps,
            &mut self.wire.flips,
            &mut self.cuts,
            &mut self.kills,
            &mut self.resets,
            &mut self.aways,
            &mut self.delays,
            &mut self.stalls,
            &mut self.out_of_paper,
            &mut self.off_line,
            &mut self.in_error,
            &mut self.busy,
            &mut self.minutes,
        ]
    }

    pub fn add(&mut self, mut other: Accidents) {
        self.counts().into_iter().zip(other.counts()).for_each(|(sum, count)| *sum += *count);
    }

    pub fn all_happened(&mut self) -> bool {
        self.counts().iter().all(|count| **count > 0)
    }
}

/// What keeps the printer from taking bytes, and until when.
#[derive(Clone, Copy)]
struct Trouble {
    /// None while it is only busy.
    fault: Option<Fault>,
    until: Duration,
}

/// A printer's end of the port: takes some of the bytes and says how many, and what keeps it from taking more.
pub type Port<'p> = Box<dyn FnMut(&[u8], &mut ChaCha8Rng) -> (usize, Option<Fault>) + 'p>;

pub struct World<'j> {
    job: &'j Job,
    mischief: Mischief,
    extra: Extra,
    /// The memory of one life of the bridge after the other.
    boards: std::slice::IterMut<'j, Board>,
    engine: Option<Engine<'j>>,
    reader: Reader,
    boot: u32,
    checkpoint: Option<Checkpoint>,
    session: Session<'j>,
    record: Record,
    now: Duration,
    trouble: Option<Trouble>,
    /// The link cannot be opened before this.
    away: Option<Duration>,
    /// Bursts on their way, with the time they arrive.
    to_bridge: Vec<(Duration, Vec<u8>)>,
    to_host: Vec<(Duration, Vec<u8>)>,
    port: Option<Port<'j>>,
    /// Bytes that crossed the port.
    pub printed: Vec<u8>,
    /// Bytes the host has said.
    pub sent: usize,
    pub initialised: bool,
    pub accidents: Accidents,
}

fn identity(boot: u32) -> Identity {
    Identity { boot, serial: 2, firmware: "test" }
}

/// Boards for the lives of a bridge, with as much memory as chance will have it.
pub fn boards(random: &mut ChaCha8Rng) -> Vec<Board> {
    let sizes = (random.random_range(2048..6000), random.random_range(2048..6000));
    (0..60).map(|_| Board::new(sizes.0, sizes.1)).collect()
}

impl<'j> World<'j> {
    pub fn new(job: &'j Job, boards: &'j mut [Board], mischief: Mischief, extra: Extra) -> World<'j> {
        let record = Record::new(job.id, job.kind, job.data.len() as u32);
        let mut session = Session::new(record, &job.data);
        session.connected(Duration::ZERO);
        let mut world = World {
            job,
            mischief,
            extra,
            boards: boards.iter_mut(),
            engine: None,
            reader: Reader::new(),
            boot: 0,
            checkpoint: None,
            session,
            record,
            now: Duration::ZERO,
            trouble: None,
            away: None,
            to_bridge: Vec::new(),
            to_host: Vec::new(),
            port: None,
            printed: Vec::new(),
            sent: 0,
            initialised: false,
            accidents: Accidents::default(),
        };
        world.power_up();
        world
    }

    /// Replaces the port that takes random portions by another one.
    pub fn with_port(mut self, port: Port<'j>) -> World<'j> {
        self.port = Some(port);
        self
    }

    pub fn record(&self) -> &Record {
        &self.record
    }

    fn power_up(&mut self) {
        let Some(board) = self.boards.next() else { return };
        let memory = board.memory();
        self.boot += 1;
        self.engine = Some(match self.checkpoint {
            Some(checkpoint) => Engine::resume(memory, identity(self.boot), checkpoint),
            None => rested(memory, identity(self.boot)),
        });
        self.reader.reset();
    }

    /// Until the host knows how the job ended. Cancels it when so many bytes have crossed the port.
    pub fn run(&mut self, cancel_at: Option<usize>, random: &mut ChaCha8Rng) -> Outcome {
        for _ in 0..300_000 {
            if cancel_at.is_some_and(|at| self.printed.len() >= at) && !self.session.record().cancel {
                self.session.cancel();
                self.record = Record { cancel: true, ..self.record };
            }
            self.step(random);
            if let Some(outcome) = self.session.outcome() {
                // The last record is saved as well.
                self.speak();
                assert_eq!(self.record.phase, self.session.record().phase);
                return outcome;
            }
        }
        panic!("the job does not come to an end: {:?} {:?}", self.session.record(), self.session.progress());
    }

    fn speak(&mut self) -> Vec<u8> {
        let mut out = Vec::new();
        let record = &mut self.record;
        let saved: Result<(), Infallible> = self.session.speak(self.now, &mut out, &mut |new| {
            *record = *new;
            Ok(())
        });
        let Ok(()) = saved;
        self.sent += out.len();
        out
    }

    /// The host's process is gone, and another one begins with what is on disk.
    fn kill(&mut self) {
        self.accidents.kills += 1;
        self.session = Session::new(self.record, &self.job.data);
        self.cut();
    }

    fn cut(&mut self) {
        self.to_bridge.clear();
        self.to_host.clear();
        self.session.connected(self.now);
        if let Some(engine) = &mut self.engine {
            engine.link_lost();
        }
        self.reader.reset();
    }

    pub fn step(&mut self, random: &mut ChaCha8Rng) {
        // While nothing moves time passes faster, for the sake of whoever runs these tests.
        let most = if self.trouble.is_some() || self.away.is_some() { 2000 } else { 40 };
        self.now += Duration::from_millis(random.random_range(1..most));
        if chance(self.mischief.stall, random) {
            self.accidents.stalls += 1;
            self.now += Duration::from_millis(random.random_range(0..7000));
        }
        if chance(self.mischief.kill, random) {
            self.kill();
        }
        if self.session.is_dead(self.now) {
            self.cut();
        }
        if chance(self.extra.away, random) {
            self.accidents.aways += 1;
            self.cut();
            self.away = Some(self.now + Duration::from_millis(random.random_range(0..20_000)));
        }
        if let Some(back) = self.away {
            self.bridge(random);
            // Nobody listens.
            self.answers(random, false);
            if self.now >= back {
                self.away = None;
                self.cut();
            }
            return;
        }
        let out = self.speak();
        if chance(self.extra.late_kill, random) {
            self.kill();
            return;
        }
        let burst = self.wire(&out, random);
        let cut = chance(self.mischief.cut, random);
        let burst = if cut { burst[..random.random_range(0..=burst.len())].to_vec() } else { burst };
        let at = self.arrival(random);
        self.to_bridge.push((at, burst));
        for burst in arrived(&mut self.to_bridge, self.now) {
            let mut left = &burst[..];
            while !left.is_empty() {
                let (portion, rest) = left.split_at(random.random_range(1..=64).min(left.len()));
                if let Some(engine) = &mut self.engine {
                    engine.receive(&mut self.reader, portion);
                }
                left = rest;
            }
        }
        self.bridge(random);
        if self.boards.len() > 0
            && (chance(self.mischief.reset, random) || chance(self.extra.amnesia, random))
        {
            self.accidents.resets += 1;
            if chance(self.extra.amnesia * 20, random) {
                self.checkpoint = None;
            }
            self.power_up();
            self.cut();
            return;
        }
        let back = self.answers(random, cut);
        let at = self.arrival(random);
        self.to_host.push((at, back));
        for burst in arrived(&mut self.to_host, self.now) {
            self.session.hear(self.now, &burst).unwrap();
        }
        if cut {
            self.accidents.cuts += 1;
            self.cut();
        }
    }

    fn arrival(&mut self, random: &mut ChaCha8Rng) -> Duration {
        if chance(self.extra.delay, random) {
            self.accidents.delays += 1;
            self.now + Duration::from_millis(random.random_range(0..300))
        } else {
            self.now
        }
    }

    /// What happens in the bridge and at its port.
    fn bridge(&mut self, random: &mut ChaCha8Rng) {
        let Some(engine) = &mut self.engine else { return };
        for _ in 0..random.random_range(0..60) {
            if !engine.work() {
                break;
            }
        }
        if let Some(task) = engine.task() {
            self.initialised |= task == Task::Initialise;
            engine.done(match task {
                Task::PrinterStatus | Task::DeviceId => Done::Answer(Answer::OneWay),
                _ => Done::Done,
            });
        }
        if chance(self.mischief.fault, random) {
            let happened = &mut self.accidents;
            let (count, fault) = match random.random_range(0..4) {
                0 => (&mut happened.out_of_paper, Some(Fault::PaperOut)),
                1 => (&mut happened.off_line, Some(Fault::OffLine)),
                2 => (&mut happened.in_error, Some(Fault::Error)),
                _ => (&mut happened.busy, None),
            };
            *count += 1;
            let long = chance(100, random);
            happened.minutes += usize::from(long);
            let most = if long { 600_000 } else { 1000 };
            self.trouble = Some(Trouble {
                fault,
                until: self.now + Duration::from_millis(random.random_range(1..most)),
            });
        }
        self.trouble = self.trouble.filter(|trouble| trouble.until > self.now);
        let mut fault = self.trouble.and_then(|trouble| trouble.fault);
        if self.trouble.is_none() {
            let bytes = engine.output();
            let count = match &mut self.port {
                Some(port) => {
                    let (count, trouble) = port(bytes, random);
                    fault = trouble;
                    count
                }
                None => bytes.len().min(random.random_range(0..400)),
            };
            self.printed.extend_from_slice(&bytes[..count]);
            engine.consumed(count);
        }
        engine.port(Lines::IDLE, fault);
        self.checkpoint = Some(engine.checkpoint());
    }

    fn answers(&mut self, random: &mut ChaCha8Rng, cut: bool) -> Vec<u8> {
        let Some(engine) = &mut self.engine else { return Vec::new() };
        let mut back = Vec::new();
        let mut frame = [0; MAX];
        loop {
            let length = engine.transmit(&mut frame);
            if length == 0 {
                break;
            }
            back.extend_from_slice(&frame[..length]);
        }
        let mut back = self.wire(&back, random);
        if cut {
            back.truncate(random.random_range(0..=back.len()));
        }
        back
    }

    fn wire(&mut self, bytes: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
        let frames = bytes.split_inclusive(|&byte| byte == 0);
        damage(frames, &self.mischief, random, &mut self.accidents.wire)
    }

    /// What the bridge answers to these bytes over the bad wire, and what of it comes back.
    pub fn overhear(&mut self, bytes: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
        let burst = self.wire(bytes, random);
        if let Some(engine) = &mut self.engine {
            engine.receive(&mut self.reader, &burst);
        }
        self.bridge(random);
        self.answers(random, false)
    }

    /// Another host on the same, good link, while the printer stands still.
    pub fn converse(&mut self, session: &mut Session<'_>, time: Duration) -> Result<(), SessionError> {
        let end = self.now + time;
        session.connected(self.now);
        while self.now < end {
            self.now += Duration::from_millis(10);
            let mut out = Vec::new();
            let Ok(()) = session.speak(self.now, &mut out, &mut |_| Ok::<(), Infallible>(()));
            let Some(engine) = &mut self.engine else { return Ok(()) };
            engine.receive(&mut self.reader, &out);
            let mut frame = [0; MAX];
            loop {
                let length = engine.transmit(&mut frame);
                if length == 0 {
                    break;
                }
                session.hear(self.now, &frame[..length])?;
            }
        }
        Ok(())
    }
}

/// The bursts whose time has come.
fn arrived(bursts: &mut Vec<(Duration, Vec<u8>)>, now: Duration) -> Vec<Vec<u8>> {
    let (come, still): (Vec<_>, Vec<_>) = std::mem::take(bursts).into_iter().partition(|(at, _)| *at <= now);
    *bursts = still;
    come.into_iter().map(|(_, burst)| burst).collect()
}
