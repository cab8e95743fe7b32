//! The world: one clock, one step at a time, everything looked at behind each.
//!
//! Time is in µs. A step is a turn of every task of the board; it takes 2 ms while bytes flow, and up to 25 while nothing does.
//! Processes of users run inside it: whoever waits for the link lets steps pass, and in one of them the other user may begin and end
//! something (`users`).

use crate::ROUGH;
use crate::board::{Board, Retained};
use crate::chance::{Chance, Draw, Kind};
use crate::pool::{self, Prepared};
use crate::printer::Printer;
use crate::promises::{Broken, Promise};
use bridge::button::Press;
use bridge::engine::{LOCAL, Memory, Outcome as Done, Task};
use bridge::links::Way;
use bridge::printer_class::{End, Next};
use device::connection::transport::Transport;
use device::connection::{Address, OpenError};
use model::flash::ModelFlash;
use model::{is_a_whole_job, seeded};
use protocol::link::frame::MAX;
use protocol::link::message::{ALONE, Answer, Fault, JobState, Lines, Progress};
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Users who may open the bridge.
pub const USERS: usize = 2;
/// The way each of them takes.
const WAYS: [Way; USERS] = [Way::Serial, Way::Bulk];
/// Sectors of the flash.
const SECTORS: usize = 24;
const MS: u64 = 1000;
/// What is not over by then never is.
const LAST_STEP: u64 = 2_000_000;

/// A job as it was meant.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Its place among all.
    pub order: usize,
    /// What it prints.
    pub which: usize,
    /// Whose it is.
    pub user: usize,
    /// It is printed from the store.
    pub stored: bool,
    /// Sheets of it that were begun.
    pub begun: u32,
    /// Of them, those that came whole.
    pub whole: u32,
    /// When the last one is out of the printer.
    pub out_at: u64,
    /// It was asked to end early.
    pub cancelled: bool,
}

/// A burst on its way.
struct Burst {
    due: u64,
    user: usize,
    bytes: Vec<u8>,
}

/// How the board goes down.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Down {
    Watchdog,
    Run,
    Cut,
}

/// What a step asks its caller to do.
pub enum Todo {
    /// Nothing.
    Nothing,
    /// Let this user do something.
    Start(usize, Draw),
}

/// Everything.
pub struct World {
    /// The time in µs.
    pub now: u64,
    /// Steps until now.
    pub step: u64,
    /// What happens.
    pub chance: Chance,
    /// Jobs by their number.
    pub known: BTreeMap<u32, Known>,
    /// Jobs in the flash by their number there.
    pub shelf: BTreeMap<u32, usize>,
    /// The printer.
    pub printer: Printer,
    /// The first promise that was not kept.
    pub broken: Option<Broken>,
    /// Users whose process runs.
    pub runs: [bool; USERS],
    /// Processes that are to die.
    pub doomed: [bool; USERS],
    /// The folder of notes.
    pub notes: PathBuf,
    /// What of the pool was sent already.
    pub used: usize,
    /// Why the last job that was resumed did not end.
    pub last_failure: String,
    /// Something happened that may cost a sheet.
    pub harmed: bool,
    seed: u64,
    board: Option<Board>,
    memory: Option<Memory<'static>>,
    retained: Retained,
    flash: ModelFlash,
    starts: u32,
    /// The board is down until then, for this reason.
    down: Option<(u64, Down)>,
    /// The cable's data lines are pulled until then.
    pulled_until: u64,
    /// Connections so far, and the one that is open, by user.
    connections: [u64; USERS],
    to_board: Vec<Burst>,
    to_host: [VecDeque<(u64, Vec<u8>)>; USERS],
    /// What an operating system still has to print, and all of it.
    plain: Option<(usize, usize)>,
    before: Progress,
    /// The job of which bytes have crossed in this step.
    crossed: Option<u32>,
    speed: usize,
}

/// The world, for those who live in it.
#[derive(Clone)]
pub struct Shared(Arc<Mutex<World>>);

impl World {
    /// The world of a seed.
    pub fn new(seed: u64, chance: Chance, notes: PathBuf, memory: Memory<'static>) -> World {
        let mut random = seeded(seed);
        let mut draw = Draw::new(seed ^ 0xb0a2d);
        let lag = ((draw.below(8_000) as u64) * MS, (1_000 + draw.below(30_000) as u64) * MS);
        let mut world = World {
            now: 1_000_000,
            step: 0,
            chance,
            known: BTreeMap::new(),
            shelf: BTreeMap::new(),
            printer: Printer::new(lag),
            broken: None,
            runs: [false; USERS],
            doomed: [false; USERS],
            notes,
            used: draw.below(pool::SIZE),
            last_failure: String::new(),
            harmed: false,
            seed,
            board: None,
            memory: Some(memory),
            retained: Retained::new((draw.number() % 256) as u8),
            flash: ModelFlash::new(SECTORS, &mut random),
            starts: 0,
            down: None,
            pulled_until: 0,
            connections: [0; USERS],
            to_board: Vec::new(),
            to_host: [const { VecDeque::new() }; USERS],
            plain: None,
            before: NOTHING,
            crossed: None,
            speed: [40, 200, 800, 2000][draw.below(4)],
        };
        world.start(None);
        world
    }

    /// The world is over: the board's memory.
    pub fn end(mut self) -> Option<Memory<'static>> {
        self.memory.take().or_else(|| Some(self.board.take()?.stop()))
    }

    /// Notes a promise that was not kept, the first one only.
    pub fn fail(&mut self, promise: Promise, found: String) {
        let step = self.step;
        self.broken.get_or_insert(Broken { promise, step, found });
    }

    /// The next job nobody has sent yet.
    pub fn fresh(&mut self) -> usize {
        self.used += 1;
        self.used % pool::SIZE
    }

    /// A user sends this job under this number.
    pub fn meet(&mut self, number: u32, which: usize, user: usize, stored: bool) {
        let order = self.known.len();
        let known = Known { order, which, user, stored, begun: 0, whole: 0, out_at: 0, cancelled: false };
        self.known.entry(number).or_insert(known);
    }

    fn job(&self, number: u32) -> Option<&'static Prepared> {
        match number {
            LOCAL => self.plain.map(|(which, _)| pool::job(which)),
            _ => self.known.get(&number).map(|known| pool::job(known.which)),
        }
    }

    fn start(&mut self, after: Option<Down>) {
        let Some(memory) = self.memory.take() else { return };
        self.starts += 1;
        let boot = (Draw::new(self.seed ^ u64::from(self.starts)).number() as u32).max(1);
        self.flash.power_up();
        let known = matches!(after, Some(Down::Watchdog | Down::Run));
        let from_outside = after != Some(Down::Watchdog);
        let board = Board::start(memory, self.retained.clone(), &self.flash, boot, known, from_outside);
        self.before = board.engine.progress();
        self.board = Some(board);
    }

    /// The board goes down.
    fn stop(&mut self, how: Down, draw: &mut Draw) {
        let Some(board) = self.board.take() else { return };
        self.memory = Some(board.stop());
        if how == Down::Cut {
            // Its memory holds anything.
            self.retained = Retained::new((draw.number() % 256) as u8);
        }
        let away = 300 + draw.below(2_000) as u64;
        self.down = Some((self.now + away * MS, how));
        self.unplug();
        self.plain = None;
    }

    /// Every connection ends.
    fn unplug(&mut self) {
        self.to_board.clear();
        self.plain = None;
        for user in 0..USERS {
            self.connections[user] += 1;
            self.to_host[user].clear();
        }
        if let Some(board) = &mut self.board {
            for way in WAYS {
                board.links.lost(way, &mut board.engine);
            }
            board.intake.end(End::Gone, &mut board.engine, self.now);
        }
    }

    /// A step of at most this long.
    fn turn(&mut self, most: u64) -> Todo {
        self.step += 1;
        if self.step >= ROUGH {
            self.calm();
            self.release();
        }
        if self.step == LAST_STEP {
            self.fail(Promise::EveryJobEnds, format!("somebody still waits; {}", self.standing()));
        }
        if self.step >= LAST_STEP {
            self.doomed = self.runs;
        }
        self.chance.begin(self.step);
        let busy = !self.to_board.is_empty()
            || self.plain.is_some()
            || self.board.as_ref().is_some_and(|board| !board.engine.is_idle());
        self.now += if busy { 2 * MS } else { most.clamp(2 * MS, 25 * MS) };
        if let Some((until, how)) = self.down
            && self.now >= until
        {
            self.down = None;
            self.start(Some(how));
        }
        let (down, mut draw) = self.accidents();
        let mut todo = Todo::Nothing;
        let free = self.runs.iter().position(|runs| !runs);
        let kind = if self.runs.contains(&true) { Kind::ActToo } else { Kind::Act };
        if let Some(user) = free
            && let Some(mut draw) = self.chance.happens(kind)
        {
            let user = if self.runs.contains(&true) { user } else { draw.below(USERS) };
            todo = Todo::Start(user, draw);
        }
        self.deliver();
        self.work(down, &mut draw);
        todo
    }

    /// What goes wrong in this step.
    fn accidents(&mut self) -> (Option<Down>, Draw) {
        if let Some(mut draw) = self.chance.happens(Kind::Unplug) {
            self.pulled_until = self.now + draw.below(3_000) as u64 * MS;
            self.unplug();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Kill) {
            let user = draw.below(USERS);
            self.doomed[user] = self.runs[user];
        }
        if let Some(mut draw) = self.chance.happens(Kind::PaperOut) {
            self.printer.paper_out_until = self.now + draw.below(4_000) as u64 * MS;
        }
        // A printer that is off only while the board restarts is one that nobody has seen off.
        if self.board.is_some()
            && let Some(mut draw) = self.chance.happens(Kind::SwitchOff)
        {
            self.harmed = true;
            self.printer.off_until = self.now + (50 + draw.below(4_000) as u64) * MS;
            self.printer.reset();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Age) {
            self.harmed = true;
            let (mut byte, bit) = (draw.below(SECTORS * 4096), draw.below(8) as u8);
            if draw.one_in_1000(500) {
                // In the first page of a job, if this is the first of its sectors.
                byte = byte / 4096 * 4096 + 2 * 256 + byte % 256;
            }
            self.flash.flip(byte, bit);
        }
        if self.chance.happens(Kind::Forge).is_some() {
            self.forge();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Press)
            && let Some(board) = &mut self.board
        {
            self.harmed = true;
            let press = if draw.one_in_1000(300) { Press::Long } else { Press::Short };
            if press == Press::Long
                && let Some(known) = board.engine.open_job().and_then(|number| self.known.get_mut(&number))
            {
                known.cancelled = true;
            }
            board.engine.press(press);
        }
        if self.plain.is_none()
            && self.board.is_some()
            && self.pulled_until <= self.now
            && let Some(mut draw) = self.chance.happens(Kind::Plain)
        {
            self.plain = Some((draw.below(pool::SIZE), 0));
        }
        for (kind, how) in [(Kind::Watchdog, Down::Watchdog), (Kind::Run, Down::Run), (Kind::Cut, Down::Cut)]
        {
            if let Some(draw) = self.chance.happens(kind) {
                self.harmed |= how != Down::Watchdog;
                return (Some(how), draw);
            }
        }
        (None, Draw::new(self.seed ^ self.step))
    }

    /// A user who may not open the bridge writes that every job is closed.
    fn forge(&mut self) {
        let Ok(listing) = std::fs::read_dir(&self.notes) else { return };
        for name in listing.filter_map(|item| item.ok()?.file_name().into_string().ok()) {
            if let Some(rest) = name.strip_prefix("open.") {
                let path = self.notes.join(format!("closed.{rest}.1"));
                if std::fs::copy(self.notes.join(&name), &path).is_ok() {
                    crate::users::give_to_stranger(&path);
                }
            }
        }
    }

    /// Bursts that are due reach the board, and packets of an operating system.
    fn deliver(&mut self) {
        let Some(board) = &mut self.board else { return self.to_board.clear() };
        let mut left = Vec::new();
        for burst in std::mem::take(&mut self.to_board) {
            if burst.due > self.now {
                left.push(burst);
                continue;
            }
            for packet in burst.bytes.chunks(64) {
                board.links.receive(WAYS[burst.user], packet, &mut board.engine);
            }
        }
        self.to_board = left;
        for _ in 0..8 {
            match board.intake.next() {
                Next::Packet(_) if self.plain.is_some() && self.pulled_until <= self.now => {
                    let Some((which, at)) = &mut self.plain else { break };
                    let bytes = &pool::job(*which).bytes[*at..];
                    let count = bytes.len().min(64);
                    board.intake.buffer()[..count].copy_from_slice(&bytes[..count]);
                    *at += count;
                    if count == 0 {
                        // All of it has gone; whether the job is over is the intake's to find out.
                        self.plain = None;
                        break;
                    }
                    board.intake.receive(count, &mut board.engine, self.now);
                }
                Next::Packet(due) | Next::Time(due) => {
                    if due <= self.now {
                        board.intake.wake(&mut board.engine, self.now);
                    }
                    break;
                }
            }
        }
    }

    /// The board's tasks, and the printer. The board may go down in the middle of them.
    fn work(&mut self, down: Option<Down>, draw: &mut Draw) {
        let off = self.printer.off_until > self.now;
        let paper_out = self.printer.paper_out_until > self.now;
        let Some(board) = &mut self.board else { return };
        if down == Some(Down::Cut) && draw.one_in_1000(500) {
            self.flash.cut_after(0);
        }
        for _ in 0..4 + draw.below(30) {
            if !board.engine.work() {
                break;
            }
        }
        for _ in 0..1 + draw.below(3) {
            if !board.alone.poll(&mut board.engine) {
                break;
            }
        }
        if self.flash.is_off() {
            // The supply went while something was written: the board did nothing behind that.
            self.crossed = None;
            self.ended();
            return self.stop(Down::Cut, draw);
        }
        let task = board.engine.task();
        let mut violation = None;
        if let Some(task) = task {
            match task {
                Task::Initialise if off => board.engine.done(Done::Done),
                Task::Initialise => {
                    self.printer.reset();
                    board.engine.done(Done::Done);
                }
                Task::PrinterStatus if off => {
                    board.engine.done(Done::Answer(Answer::Stopped(Fault::PowerOff)))
                }
                Task::PrinterStatus => {
                    if self.printer.holds_a_part() {
                        violation = Some((
                            Promise::NoQuestionInASheet,
                            format!(
                                "asked behind {} bytes of job {:08x}",
                                self.printer.since.len(),
                                self.printer.owner
                            ),
                        ));
                    }
                    let answer = self.printer.status(self.now);
                    board.engine.done(Done::Answer(Answer::Bytes(&answer)));
                }
                Task::DeviceId => {
                    board.engine.done(Done::Answer(Answer::Bytes(b"\0\x18MANUFACTURER:ALPS;CLS:P;")))
                }
                _ => board.engine.done(Done::Done),
            }
        }
        let (lines, fault) = match (off, paper_out) {
            (true, _) => (Lines(0), Some(Fault::PowerOff)),
            (_, true) => (Lines(Lines::IDLE.0 | Lines::PAPER_OUT), Some(Fault::PaperOut)),
            _ => (Lines::IDLE, None),
        };
        board.engine.port(lines, fault);
        let mut crossed = Vec::new();
        let mut number = 0;
        if fault.is_none() {
            let most = 1 + draw.below(self.speed);
            let output = board.engine.output();
            crossed.extend_from_slice(&output[..output.len().min(most)]);
            number = board.engine.open_job().unwrap_or(0);
            // RUN is pressed while bytes flow: the strobe of the last one is over, and its mark is not made yet.
            let unmarked = usize::from(down == Some(Down::Run) && draw.one_in_1000(800));
            board.cross(crossed.len(), unmarked);
        }
        if down.is_none() {
            board.settle(crossed.len());
        }
        if let Some((promise, found)) = violation {
            self.fail(promise, found);
        }
        self.take(number, &crossed);
        if let Some(down) = down {
            self.ended();
            self.stop(down, draw);
            return;
        }
        self.answer();
        self.ended();
    }

    /// Bytes of this job reach the printer.
    fn take(&mut self, number: u32, bytes: &[u8]) {
        self.crossed = (!bytes.is_empty()).then_some(number);
        if bytes.is_empty() {
            return;
        }
        if self.printer.owner != number || self.printer.since.is_empty() {
            if self.printer.holds_a_part() {
                let found = format!(
                    "job {number:08x} behind {} bytes of job {:08x}",
                    self.printer.since.len(),
                    self.printer.owner
                );
                self.fail(Promise::NothingIntoAnotherSheet, found);
            }
            self.printer.since.clear();
            self.printer.owner = number;
            if let Some(known) = self.known.get_mut(&number) {
                known.begun += 1;
                if known.begun > 1 {
                    let found = format!("job {number:08x} begins for the second time: {known:?}");
                    self.fail(Promise::NothingTwice, found);
                }
            }
        }
        self.printer.since.extend_from_slice(bytes);
    }

    /// What the engine has to say.
    fn answer(&mut self) {
        let Some(board) = &mut self.board else { return };
        let mut frame = [0; MAX];
        let mut said = Vec::new();
        loop {
            let length = board.engine.transmit(&mut frame);
            if length == 0 {
                break;
            }
            said.push(frame[..length].to_vec());
        }
        let Some(way) = board.links.speaker() else { return };
        let user = way as usize;
        for frame in said {
            self.send_to_host(user, frame);
        }
    }

    fn send_to_host(&mut self, user: usize, frame: Vec<u8>) {
        for (due, bytes) in self.carry(frame) {
            self.to_host[user].push_back((due, bytes));
        }
    }

    /// What a wire makes of a burst.
    fn carry(&mut self, mut bytes: Vec<u8>) -> Vec<(u64, Vec<u8>)> {
        let mut due = self.now + MS;
        if self.chance.happens(Kind::Lose).is_some() {
            return Vec::new();
        }
        if let Some(mut draw) = self.chance.happens(Kind::Flip) {
            let at = draw.below(bytes.len());
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << draw.below(8);
            }
        }
        if let Some(mut draw) = self.chance.happens(Kind::Late) {
            due += draw.below(900) as u64 * MS;
        }
        if self.chance.happens(Kind::Double).is_some() {
            return vec![(due, bytes.clone()), (due, bytes)];
        }
        vec![(due, bytes)]
    }

    /// Judges a job that has ended in this step.
    fn ended(&mut self) {
        let Some(board) = &self.board else { return };
        let (after, owes) = (board.engine.progress(), board.engine.owes_reset());
        let before = std::mem::replace(&mut self.before, after);
        let ends = |progress: &Progress| {
            !matches!(
                progress.state,
                JobState::None
                    | JobState::Printing
                    | JobState::Stopped(_)
                    | JobState::Cancelling
                    | JobState::Storing
            )
        };
        let number = after.job;
        // A job as long as the one before it may begin and end in one step.
        if !ends(&after) || (before == after && self.crossed != Some(number)) || number == 0 {
            return;
        }
        if after.state == JobState::Stored {
            return;
        }
        let part = self.printer.owner == number && !self.printer.since.is_empty();
        let expected = self.job(number).map(|job| &job.bytes[..]);
        let since = &self.printer.since;
        let told = format!(
            "job {number:08x} {:?} with {} bytes, the printer has {}",
            after.state,
            after.printed,
            if part { since.len() } else { 0 }
        );
        match after.state {
            // What was printed from the store by the button or by an operating system has only to be whole.
            JobState::Done => {
                let right = part
                    && match expected {
                        Some(expected) if number != LOCAL => since == expected,
                        _ => is_a_whole_job(since),
                    };
                if !right {
                    let promise = match self.known.get(&number) {
                        Some(known) if known.stored => Promise::StoredIsWholeOrBroken,
                        _ if number == ALONE => Promise::StoredIsWholeOrBroken,
                        _ => Promise::PrintedIsAtThePrinter,
                    };
                    self.fail(promise, told);
                }
            }
            JobState::Cancelled | JobState::Broken(_) if part && !owes && !is_a_whole_job(since) => {
                self.fail(Promise::EndedSheetIsLegal, told);
            }
            _ => {}
        }
        if part && is_a_whole_job(&self.printer.since) {
            let out_at = self.printer.whole(self.now);
            if after.state == JobState::Done
                && let Some(known) = self.known.get_mut(&number)
            {
                known.whole += 1;
                known.out_at = out_at;
            }
        }
        if number == LOCAL && after.state != JobState::Done {
            // Whoever prints sees that, takes the rest back and resets the interface.
            self.plain = None;
            if let Some(board) = &mut self.board {
                board.intake.end(End::Reset, &mut board.engine, self.now);
            }
        }
    }

    /// Everything is well from now on.
    pub fn calm(&mut self) {
        self.chance.calm();
        (self.printer.off_until, self.printer.paper_out_until, self.pulled_until) = (0, 0, 0);
    }

    /// The job that the bridge has open.
    pub fn open_job(&self) -> Option<u32> {
        self.board.as_ref()?.engine.open_job()
    }

    /// Where the board stands, and what is known of its job.
    pub fn standing(&self) -> String {
        let progress = self.board.as_ref().map(|board| board.engine.progress());
        let notes = std::fs::read_dir(&self.notes).into_iter().flatten().filter_map(|item| {
            let path = item.ok()?.path();
            Some((path.file_name()?.to_owned(), std::fs::read_to_string(path).ok()?))
        });
        let notes: Vec<_> = notes.collect();
        let job = progress.and_then(|progress| self.known.get(&progress.job));
        format!("{progress:?} of {job:?}, start {}, notes {notes:?}", self.starts)
    }

    /// Whether the board is busy with something that ends by itself.
    pub fn is_busy(&self) -> bool {
        self.down.is_some()
            || self.plain.is_some()
            || self.board.as_ref().is_some_and(|board| !board.engine.is_idle())
    }

    /// Whether somebody holds the job with the button.
    pub fn release(&mut self) {
        if let Some(board) = &mut self.board
            && board.engine.progress().state == JobState::Stopped(Fault::Held)
        {
            board.engine.press(Press::Short);
        }
    }
}

const NOTHING: Progress =
    Progress { job: 0, state: JobState::None, accepted: 0, limit: 0, printed: 0, pass: 0, row: 0 };

impl Shared {
    /// The world.
    pub fn new(world: World) -> Shared {
        Shared(Arc::new(Mutex::new(world)))
    }

    /// A look at it.
    pub fn look(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The world alone again, when nobody lives in it any more.
    pub fn into_world(self) -> Option<World> {
        Arc::into_inner(self.0).map(|world| world.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// A step of at most this long.
    pub fn step(&self, most: Duration) {
        let todo = self.look().turn(most.as_micros() as u64);
        if let Todo::Start(user, draw) = todo {
            crate::users::run(self, user, draw);
        }
    }

    /// Opens the way of this user.
    pub fn open(&self, user: usize, address: &Address) -> Result<Box<dyn Transport>, OpenError> {
        self.step(Duration::from_millis(2));
        crate::users::live(self, user);
        let mut world = self.look();
        if world.board.is_none() || world.pulled_until > world.now {
            return Err(OpenError::Absent(address.clone()));
        }
        world.connections[user] += 1;
        world.to_host[user].clear();
        world.to_board.retain(|burst| burst.user != user);
        let connection = world.connections[user];
        Ok(Box::new(SimulatedLink { world: self.clone(), user, connection }))
    }

    /// Lets time pass in this user's process.
    pub fn pause(&self, user: usize, time: Duration) {
        let end = self.look().now + time.as_micros() as u64;
        loop {
            let now = self.look().now;
            if now >= end {
                return;
            }
            self.step(Duration::from_micros(end - now));
            crate::users::live(self, user);
        }
    }
}

/// A pipe to the board.
struct SimulatedLink {
    world: Shared,
    user: usize,
    connection: u64,
}

impl SimulatedLink {
    fn is_open(&self, world: &World) -> bool {
        world.connections[self.user] == self.connection && world.board.is_some()
    }
}

impl Transport for SimulatedLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut world = self.world.look();
        if !self.is_open(&world) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let count = bytes.len().min(1024);
        let user = self.user;
        for (due, bytes) in world.carry(bytes[..count].to_vec()) {
            world.to_board.push(Burst { due, user, bytes });
        }
        Ok(count)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        let end = self.world.look().now + patience.as_micros() as u64;
        loop {
            let left = end.saturating_sub(self.world.look().now);
            self.world.step(Duration::from_micros(left));
            crate::users::live(&self.world, self.user);
            let mut world = self.world.look();
            if !self.is_open(&world) {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            let (now, lane) = (world.now, &mut world.to_host[self.user]);
            let mut count = 0;
            while let Some(at) = lane.iter().position(|(due, _)| *due <= now) {
                let bytes = &mut lane[at].1;
                let part = bytes.len().min(buffer.len() - count);
                buffer[count..count + part].copy_from_slice(&bytes[..part]);
                bytes.drain(..part);
                count += part;
                if bytes.is_empty() {
                    lane.remove(at);
                }
                if count == buffer.len() {
                    break;
                }
            }
            if count > 0 || world.now >= end {
                return Ok(count);
            }
        }
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.world.look().now)
    }
}

impl Drop for SimulatedLink {
    fn drop(&mut self) {
        let mut guard = self.world.look();
        let world = &mut *guard;
        if world.connections[self.user] == self.connection {
            world.connections[self.user] += 1;
            if let Some(board) = &mut world.board {
                board.links.lost(WAYS[self.user], &mut board.engine);
            }
        }
    }
}
