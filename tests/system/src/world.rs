//! The world: one clock, one step at a time, everything looked at behind each.
//!
//! Time is in µs. A step is a turn of every task of the board; it takes 2 ms while bytes flow, and up to 25 while nothing does. Processes
//! of users act between steps ([`Shared`]).

mod accidents;
mod shared;
mod tasks;
mod verdict;

use crate::ROUGH;
use crate::board::{Board, Retained};
use crate::chance::{Chance, Draw, Kind};
use crate::pool::{self, Prepared};
use crate::printer::Printer;
use crate::promises::{Broken, Door, Promise, State, Table};
use bridge::button::Press;
use bridge::engine::{LOCAL, Memory};
use bridge::links::Way;
use bridge::printer_class::End;
use bridge::simulation::{Peripheral, SimulatedPort};
use bridge::standing::{QUESTION, Standing};
use model::flash::ModelFlash;
use model::seeded;
use protocol::link::frame::Reader;
use protocol::link::message::{ALONE, Fault, JobState, Progress};
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::time::Duration;

pub use shared::{Killed, Shared};

/// Users who may open the bridge.
pub const USERS: usize = 2;
/// The way each of them takes.
const WAYS: [Way; USERS] = [Way::Serial, Way::Bulk];
/// Sectors of the flash.
const SECTORS: usize = 24;
const MS: u64 = 1000;
/// Half a question that was put so shortly before the supply goes no bridge can know of
/// (`docs/decisions/where-the-printer-stands.md`).
const UNNOTED: u64 = 10 * MS;
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
    /// The printer has lost a part of it.
    pub torn: bool,
    /// Something happened to it that may cost a sheet, and anything at all.
    pub harmed: bool,
    /// Something happened while it was open.
    pub touched: bool,
    /// Its owner was told how it has ended.
    pub told: bool,
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
    /// Jobs that the board may have had, printed or stored.
    pub numbered: usize,
    /// Jobs by their number.
    pub known: BTreeMap<u32, Known>,
    /// Jobs in the flash by their number there.
    pub shelf: BTreeMap<u32, usize>,
    /// The printer.
    pub printer: Printer,
    /// The first promise that was not kept.
    pub broken: Option<Broken>,
    /// How often each was endangered.
    pub endangered: Table,
    /// What a process said when it failed as no process should.
    pub crashed: Option<String>,
    /// Users whose process runs.
    pub runs: [bool; USERS],
    /// Processes that are to die.
    pub doomed: [bool; USERS],
    /// For how long each process that waits would wait.
    pub wants: [Option<Duration>; USERS],
    /// Whether a user has a job that is open.
    pub unfinished: [bool; USERS],
    /// The folder of what all users share.
    pub shared: PathBuf,
    /// What of the pool was sent already.
    pub used: usize,
    /// Why the last job that was resumed did not end.
    pub last_failure: String,
    /// The jobs whose sheets were begun, in this order.
    pub begun: Vec<u32>,
    seed: u64,
    cable: SimulatedPort,
    resets: usize,
    /// For how long the driver has nothing to do.
    pause_us: u64,
    /// The printer's +5 V are absent.
    is_off: bool,
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
    /// A bit of the flash has changed.
    aged: bool,
    readers: [Reader; USERS],
    /// The job that was last seen to ask for bytes while the printer had a part of another one.
    asked_into: Option<u32>,
    /// When a byte of a question last crossed.
    asked_at: u64,
    before: Progress,
}

impl World {
    /// The world of a seed.
    pub fn new(seed: u64, chance: Chance, shared: PathBuf, memory: Memory<'static>) -> World {
        let mut random = seeded(seed);
        let mut draw = Draw::new(seed ^ 0xb0a2d);
        let lag = ((draw.below(8_000) as u64) * MS, (1_000 + draw.below(30_000) as u64) * MS);
        let work = 2_000_000 / [40, 200, 800, 2000][draw.below(4)];
        let id = b"\0\x1cMANUFACTURER:ALPS;CLS:P;...".to_vec();
        let cable = SimulatedPort::new(Peripheral { work, device_id: Some(id), ..Peripheral::default() });
        // One world in ten has every edge of every line.
        if draw.below(10) > 0 {
            cable.quick();
        }
        let mut world = World {
            now: 1_000_000,
            step: 0,
            chance,
            numbered: 0,
            known: BTreeMap::new(),
            shelf: BTreeMap::new(),
            printer: Printer::new(lag),
            broken: None,
            endangered: Table::default(),
            crashed: None,
            runs: [false; USERS],
            doomed: [false; USERS],
            wants: [None; USERS],
            unfinished: [false; USERS],
            shared,
            used: draw.below(pool::SIZE),
            last_failure: String::new(),
            begun: Vec::new(),
            seed,
            cable,
            resets: 0,
            pause_us: 0,
            is_off: false,
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
            aged: false,
            readers: [const { Reader::new() }; USERS],
            asked_into: None,
            asked_at: 0,
            before: NOTHING,
        };
        world.start(None);
        world
    }

    /// The world is over: the board's memory.
    pub fn end(mut self) -> Option<Memory<'static>> {
        self.memory.take().or_else(|| Some(self.board.take()?.stop(0)))
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
        if self.known.contains_key(&number) {
            return;
        }
        let order = self.numbered;
        self.numbered += 1;
        let known = Known {
            order,
            which,
            user,
            stored,
            begun: 0,
            whole: 0,
            out_at: 0,
            cancelled: false,
            torn: false,
            harmed: false,
            touched: false,
            told: false,
        };
        self.known.insert(number, known);
    }

    /// A promise could break now, by the door of this job.
    pub fn endanger(&mut self, promise: Promise, number: u32) {
        let (door, state) = (self.door(number), self.state());
        self.endangered.note(promise, door, state);
    }

    /// By which door this job asks for bytes.
    pub fn door(&self, number: u32) -> Door {
        match number {
            QUESTION => Door::Question,
            LOCAL => Door::Plain,
            ALONE => Door::Button,
            _ if self.known.get(&number).is_some_and(|known| known.stored) => Door::Stored,
            _ => Door::Link,
        }
    }

    /// Where the board takes the printer to stand.
    pub fn state(&self) -> State {
        match self.board.as_ref().map(|board| board.engine.standing()) {
            None => State::Down,
            Some(Standing::Unknown { .. }) => State::Unknown,
            Some(Standing::AtRest) => State::AtRest,
            Some(Standing::InSheet(_)) => State::InSheet,
        }
    }

    /// Something happens to the job that is open, or was when the board went down; `harms` if it may cost the
    /// sheet.
    fn touch(&mut self, harms: bool) {
        let open = if self.board.is_none() { Some(self.before.job) } else { self.open_job() };
        if let Some(known) = open.and_then(|number| self.known.get_mut(&number)) {
            known.touched = true;
            known.harmed |= harms;
        }
    }

    /// The printer has lost what it had.
    fn lose_part(&mut self) {
        if let Some(number) = self.printer.reset()
            && let Some(known) = self.known.get_mut(&number)
        {
            known.torn = true;
        }
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
        self.printer.settle();
        let known = matches!(after, Some(Down::Watchdog | Down::Run));
        let from_outside = after != Some(Down::Watchdog);
        let retained = self.retained.clone();
        let board = Board::start(memory, &self.cable, retained, &self.flash, boot, known, from_outside);
        self.before = board.engine.progress();
        self.board = Some(board);
    }

    /// The board goes down, with its last marks unmade.
    fn stop(&mut self, how: Down, unmarked: u32, draw: &mut Draw) {
        let Some(board) = self.board.take() else { return };
        self.memory = Some(board.stop(unmarked));
        if how == Down::Cut {
            if self.printer.owner == QUESTION && self.now - self.asked_at <= UNNOTED {
                self.lose_part();
            }
            // Its memory holds anything.
            self.retained = Retained::new((draw.number() % 256) as u8);
            for known in self.known.values_mut().filter(|known| !known.told) {
                known.harmed = true;
            }
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
        let before = self.now;
        self.chance.begin(self.step);
        let busy = !self.to_board.is_empty()
            || self.plain.is_some()
            || self.board.as_ref().is_some_and(|board| !board.engine.is_idle());
        self.now += if busy { 2 * MS } else { most.clamp(2 * MS, 25 * MS) };
        let off = self.printer.off_until > self.now;
        self.supply(off);
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
        self.work(down, self.now - before, &mut draw);
        todo
    }

    /// Nothing happens any more; a printer that is off stays so until its time.
    pub fn calm(&mut self) {
        self.chance.calm();
        self.pulled_until = 0;
    }

    /// Whether a bit of the flash has changed.
    pub fn has_aged(&self) -> bool {
        self.aged
    }

    /// The job that the bridge has open.
    pub fn open_job(&self) -> Option<u32> {
        self.board.as_ref()?.engine.open_job()
    }

    /// Where the board stands, and what is known of its job.
    pub fn standing(&self) -> String {
        let progress = self.board.as_ref().map(|board| board.engine.progress());
        let job = progress.and_then(|progress| self.known.get(&progress.job));
        let standing = self.board.as_ref().map(|board| board.engine.standing());
        format!("{progress:?} of {job:?}, {standing:?}, start {}", self.starts)
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
