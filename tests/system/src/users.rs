//! Users and their processes: the program's own delivery and journal, on a folder of this computer.
//!
//! A process runs until it ends, is killed, or its user leaves, and the other user's beside it. A process
//! that is killed unwinds without a word; what it has on disk stays as it is. Whether a caller agrees to a
//! question and how long it waits is drawn: a terminal, a script and a queue differ in nothing else.

use crate::chance::{Draw, Kind};
use crate::pool;
use crate::promises::Promise;
use crate::world::{Killed, Shared, USERS};
use device::connection::transport::Transport;
use device::connection::{Address, OpenError};
use device::deliver::{self, Caller, Delivery, Failure, News, Question, store};
use device::printers::Printers;
use device::questions::query::{Query, QueryError};
use device::transit::Wish;
use device::transit::finish::Sheet;
use device::transit::journal::{Journal, fresh_number};
use device::transit::session::{Outcome, Phase};
use observe::{Observer, Silent};
use protocol::link::message::{JobState, PAST, PastJob};
use std::cell::{Cell, RefCell};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a bridge may take to answer.
const BRIDGE: Duration = Duration::from_secs(3);

/// The folders of a world: that which all users share.
pub fn furnish(folder: &Path) -> PathBuf {
    let shared = folder.join("shared");
    fs::create_dir(&shared).expect("a folder of our own");
    for user in 0..USERS {
        fs::create_dir(home(&shared, user)).expect("a folder of our own");
    }
    shared
}

fn home(shared: &Path, user: usize) -> PathBuf {
    shared.with_file_name(format!("jobs-{user}"))
}

fn address() -> Address {
    Address::Serial("bridge".into())
}

/// Whoever sits before a process.
struct Person<'w> {
    world: &'w Shared,
    user: usize,
    /// What the job prints that is queued next, and its last number.
    which: Cell<usize>,
    number: Cell<Option<u32>>,
    /// Times the bridge was away.
    waited: Cell<u32>,
    wish: Cell<Wish>,
    /// Nothing is refused any more, and nobody leaves.
    calm: bool,
    said: RefCell<Draw>,
}

impl Caller for Person<'_> {
    fn tell(&self, news: &News<'_>) {
        self.world.live(self.user);
        if let News::Queued { entry, .. } = news {
            self.number.set(Some(entry.record.job));
            self.world.look().meet(entry.record.job, self.which.get(), self.user, false);
        }
    }

    fn agrees(&self, _question: &Question<'_>) -> bool {
        self.calm || self.said.borrow_mut().one_in_1000(700)
    }

    fn waits(&self, _obstacle: &Failure, _begun: bool) -> bool {
        self.waited.set(self.waited.get() + 1);
        self.world.pause(self.user, Duration::from_secs(1));
        self.waited.get() < if self.calm { 30 } else { 10 }
    }

    fn wish(&self) -> Wish {
        let mut world = self.world.look();
        if self.wish.get() == Wish::GoOn {
            if world.chance.happens(Kind::Cancel).is_some() {
                self.wish.set(Wish::Cancel);
            } else if world.chance.happens(Kind::Leave).is_some() {
                self.wish.set(Wish::Leave);
            }
        }
        if self.wish.get() == Wish::Cancel
            && let Some(known) = self.number.get().and_then(|number| world.known.get_mut(&number))
        {
            known.cancelled = true;
        }
        self.wish.get()
    }

    fn observer(&self) -> &dyn Observer {
        &Silent
    }

    fn open(&self, address: &Address, _bridge: Option<u64>) -> Result<Box<dyn Transport>, OpenError> {
        self.world.open(self.user, address)
    }

    fn pause(&self, time: Duration) {
        self.world.pause(self.user, time);
    }
}

/// A process of a user from its beginning to its end: it does something, whatever the numbers say, or what is
/// open comes to its end.
pub fn run(world: &Shared, user: usize, mut draw: Draw, calm: bool) {
    let what = if calm { None } else { Some(draw.below(17)) };
    let shared = world.look().shared.clone();
    let ended = catch_unwind(AssertUnwindSafe(|| {
        let person = &Person {
            world,
            user,
            which: Cell::new(0),
            number: Cell::new(None),
            waited: Cell::new(0),
            wish: Cell::new(Wish::GoOn),
            calm,
            said: RefCell::new(draw),
        };
        let printers = Printers::at(&shared).expect("it is there");
        let journal = Journal::at(&home(&shared, user)).expect("it is there");
        let desk = Desk { printers: &printers, journal: &journal };
        match what {
            None => {
                let open = desk.unfinished(person);
                world.look().unfinished[user] = open.is_some();
                desk.resume(person, false);
            }
            Some(0..=4) => desk.send(person),
            Some(what @ 5..=7) => desk.resume(person, what == 7),
            Some(8..=10) => desk.store(person),
            Some(11..=14) => desk.print_stored(person),
            Some(15) => desk.delete_stored(person),
            Some(_) => desk.reset(person),
        }
    }));
    if let Err(payload) = ended
        && !payload.is::<Killed>()
    {
        let said = payload.downcast_ref::<String>().cloned();
        let said = said.or_else(|| payload.downcast_ref::<&str>().map(|said| (*said).into()));
        world.look().crashed = Some(said.unwrap_or_else(|| "a process failed".into()));
    }
}

/// When all is well again, the users go on by turns until none of their jobs is open: one may wait for
/// another's.
pub fn finish(world: &Shared) {
    for user in 0..USERS {
        await_end(world, user);
    }
    let known: Vec<u32> = world.look().known.keys().copied().collect();
    for number in known {
        let mut look = world.look();
        if look.known.get(&number).is_some_and(|known| !known.told) {
            look.endanger(Promise::EveryJobEnds, number);
        }
    }
    for _ in 0..40 {
        let mut open = false;
        for user in 0..USERS {
            world.begin(user, Draw::new(1), true);
            await_end(world, user);
            open |= world.look().unfinished[user];
        }
        if !open {
            return;
        }
    }
    let mut world = world.look();
    let found = format!("the users have resumed 40 times; {}; {}", world.last_failure, world.standing());
    world.fail(Promise::EveryJobEnds, found);
}

/// Lets time pass until this user's process has ended.
fn await_end(world: &Shared, user: usize) {
    while world.look().runs[user] {
        world.step(Duration::from_millis(20));
    }
}

/// What a user's processes share.
struct Desk<'d> {
    printers: &'d Printers,
    journal: &'d Journal,
}

impl Desk<'_> {
    fn send(&self, person: &Person<'_>) {
        let which = person.world.look().fresh();
        person.which.set(which);
        let delivery = Delivery::new(self.printers, person);
        let Ok(job) = delivery.queue(self.journal, pool::packed(which), &address()) else { return };
        let sent = delivery.send(self.journal, job, &address(), false, false);
        self.judge(person, &delivery, sent.ok().map(|ended| ended.outcome));
    }

    /// The job of this user that is open for the longest.
    fn unfinished(&self, person: &Person<'_>) -> Option<u32> {
        let world = person.world.look();
        let open: Vec<u32> = self
            .journal
            .entries()
            .unwrap_or_default()
            .into_iter()
            .filter(|entry| !matches!(entry.record.phase, Phase::Ended(_)))
            .map(|entry| entry.record.job)
            .collect();
        // The one that the bridge has open goes first: it takes no other.
        let at_bridge = world.open_job();
        let order =
            |number: &u32| (at_bridge != Some(*number), world.known.get(number).map(|known| known.order));
        open.into_iter().min_by_key(order)
    }

    fn resume(&self, person: &Person<'_>, cancel: bool) {
        let Some(number) = self.unfinished(person) else { return };
        let job = match self.journal.open(number) {
            Ok(job) => job,
            Err(error) => {
                let said = format!("user {}: {}", person.user, observe::with_causes(&error));
                person.world.look().last_failure = said;
                return;
            }
        };
        person.number.set(Some(number));
        {
            let mut world = person.world.look();
            let Some(known) = world.known.get_mut(&number) else { return };
            person.which.set(known.which);
            known.cancelled |= cancel;
            if known.begun > 0 {
                world.endanger(Promise::NothingTwice, number);
            }
        }
        let delivery = Delivery::new(self.printers, person);
        let sent = delivery.send(self.journal, job, &address(), false, cancel);
        if let Err(failure) = &sent {
            person.world.look().last_failure =
                format!("user {}: {}", person.user, observe::with_causes(failure));
        }
        self.judge(person, &delivery, sent.ok().map(|ended| ended.outcome));
    }

    /// What the program has told, beside what is so.
    fn judge(&self, person: &Person<'_>, delivery: &Delivery<'_>, outcome: Option<Outcome>) {
        let (Some(number), Some(outcome)) = (person.number.get(), outcome) else { return };
        told(person.world, number, outcome);
        if outcome == Outcome::Printed && person.said.borrow_mut().one_in_1000(300) {
            {
                let mut world = person.world.look();
                if world.known.get(&number).is_some_and(|known| known.out_at > world.now) {
                    world.endanger(Promise::OutIsOut, number);
                }
            }
            let sheet = delivery.await_sheet(number, &address(), &mut |_| {});
            let mut world = person.world.look();
            let (now, out_at) = (world.now, world.known.get(&number).map(|known| known.out_at));
            if sheet == Sheet::Out && out_at > Some(now) {
                let found = format!("job {number:08x} is said to be out at {now}, and is at {out_at:?}");
                world.fail(Promise::OutIsOut, found);
            }
        }
    }

    fn store(&self, person: &Person<'_>) {
        let which = person.world.look().fresh();
        person.world.look().numbered += 1;
        if let Ok(number) = store::store(pool::packed(which), &address(), person) {
            person.world.look().shelf.insert(number, which);
        }
    }

    /// Prints a stored job, and asks for it until it has ended. As long as the board has not started anew the
    /// order is said again each time: it is the same job.
    fn print_stored(&self, person: &Person<'_>) {
        let Some((boot, stored)) = self.choose_stored(person) else { return };
        let Some(&which) = person.world.look().shelf.get(&stored) else { return };
        let number = fresh_number(stored, &person.world.look().step.to_le_bytes());
        person.world.look().meet(number, which, person.user, true);
        for _ in 0..100 {
            let said = person.open(&address(), None).ok().and_then(|mut link| {
                let mut query = Query::new(&mut *link, BRIDGE).ok()?;
                let is_lost = |past: &&PastJob| past.job == number && past.state == JobState::Lost;
                if query.past().any(|past| is_lost(&past)) {
                    return Some(Ok(JobState::Lost));
                }
                let said = match query.bridge().boot == boot {
                    true => query.print_stored(number, stored, BRIDGE),
                    false => query.ask_progress(BRIDGE),
                };
                Some(said.map(|said| if said.job == number { said.state } else { JobState::None }))
            });
            match said {
                Some(Ok(JobState::Done)) => return told(person.world, number, Outcome::Printed),
                Some(Ok(JobState::Lost)) => return told(person.world, number, Outcome::Lost),
                Some(Ok(JobState::None | JobState::Broken(_) | JobState::Cancelled))
                | Some(Err(QueryError::NotStored(_) | QueryError::JobOpen(_))) => return,
                _ => person.pause(Duration::from_secs(2)),
            }
        }
    }

    /// A job in the flash, and the start of the board that has it.
    fn choose_stored(&self, person: &Person<'_>) -> Option<(u32, u32)> {
        let mut link = person.open(&address(), None).ok()?;
        let mut query = Query::new(&mut *link, BRIDGE).ok()?;
        let shelf = query.shelf(BRIDGE).ok()?;
        let stored = shelf.jobs.get(person.said.borrow_mut().below(shelf.jobs.len()))?;
        Some((query.bridge().boot, stored.job))
    }

    fn delete_stored(&self, person: &Person<'_>) {
        let Ok(mut link) = person.open(&address(), None) else { return };
        let Ok(mut query) = Query::new(&mut *link, BRIDGE) else { return };
        let Ok(shelf) = query.shelf(BRIDGE) else { return };
        if let Some(stored) = shelf.jobs.first() {
            let _ = query.delete_stored(stored.job, BRIDGE);
        }
    }

    fn reset(&self, person: &Person<'_>) {
        let Ok(mut link) = person.open(&address(), None) else { return };
        let Ok(mut query) = Query::new(&mut *link, BRIDGE) else { return };
        // Refused while a job is open, whoever has sent it.
        let _ = deliver::reset(&mut query);
    }
}

/// What somebody was told of a job, beside what is so.
fn told(world: &Shared, number: u32, outcome: Outcome) {
    let mut world = world.look();
    let Some(known) = world.known.get_mut(&number) else { return };
    known.told = true;
    let known = *known;
    if known.torn {
        world.endanger(Promise::LossIsTold, number);
    }
    if outcome == Outcome::Printed && known.touched {
        world.endanger(Promise::PrintedIsAtThePrinter, number);
    }
    let found = format!("job {number:08x} is told as {outcome:?}; {known:?}");
    // A bridge remembers so many jobs, and whoever asks only behind them cannot be told; its diary remembers
    // fewer, and those among them of which no byte came to cross.
    let is_long_ago = world.numbered - known.order > PAST;
    // Nor can one whose record in the flash has aged.
    let is_recent = world.begun.iter().rev().take(3).any(|&begun| begun == number);
    let harmed = known.harmed || known.stored && world.has_aged();
    let promise = match outcome {
        Outcome::Forgotten if is_long_ago => return,
        Outcome::Printed if known.whole != 1 => Promise::PrintedIsAtThePrinter,
        Outcome::Cancelled | Outcome::Broken if known.torn => Promise::LossIsTold,
        Outcome::Forgotten if known.torn && is_recent && !world.has_aged() => Promise::LossIsTold,
        Outcome::Lost | Outcome::Forgotten | Outcome::Broken if !harmed && !known.cancelled => {
            Promise::HarmlessCostsNothing
        }
        Outcome::Cancelled if !known.cancelled => Promise::HarmlessCostsNothing,
        _ => return,
    };
    world.fail(promise, found);
}
