//! The world: one clock, one step at a time, everything looked at behind each.
//!
//! Time is in µs. A step is a turn of every task of the board; it takes 2 ms while bytes flow, and up to 25 while nothing does.
//! Processes of users run inside it: whoever waits for the link lets steps pass, and in one of them the other user may begin and end
//! something (`users`).

mod accidents;
mod shared;
mod tasks;
mod verdict;

use crate::ROUGH;
use crate::board::{Board, Retained};
use crate::chance::{Chance, Draw, Kind};
use crate::pool::{self, Prepared};
use crate::printer::Printer;
use crate::promises::{Broken, Promise};
use bridge::button::Press;
use bridge::engine::{LOCAL, Memory};
use bridge::links::Way;
use bridge::printer_class::End;
use model::flash::ModelFlash;
use model::seeded;
use protocol::link::message::{Fault, JobState, Progress};
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;

pub use shared::{Killed, Shared};

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
