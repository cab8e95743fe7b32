//! Host, link, board, flash and printer in one process and one virtual time, under one seed.
//!
//! Problem: what goes wrong between the parts needs three accidents in one order, and no test of one part has them. Method: the
//! program's own delivery with its journal, the bridge's own engine, driver, store, checkpoints and printer interface, and models of
//! what is not code: a wire, a flash, a cable, a printer and two users. All that happens is drawn from a seed
//! ([`chance`]), everything is looked at behind each step, and what must hold has a name ([`promises`]). A seed that breaks a promise
//! is the report: it is cut down to the shortest script that breaks the same one.
//! Cost: some tens of µs a step. Limits: nine worlds in ten have the levels of the printer's lines and none of a strobe's edges; notes of
//! printers without a bridge are tested beside them.
//! Source: the simulator of TigerBeetle (VOPR), for the idea.
#![forbid(unsafe_code)]

pub mod board;
pub mod chance;
pub mod pool;
pub mod printer;
pub mod promises;
mod users;
pub mod world;

use bridge::engine::Memory;
use chance::{Chance, Key, Kind};
use promises::{Broken, Promise, Table};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use world::{Shared, World};

/// Steps in which things go wrong, and then those in which all that is open has to end.
pub(crate) const ROUGH: u64 = 6_000;
const CALM: u64 = 60_000;

/// For how long a script is made shorter.
const SHRINKING: Duration = Duration::from_secs(30);

thread_local! {
    static MEMORY: RefCell<Option<Memory<'static>>> = const { RefCell::new(None) };
}

/// What came of a seed.
#[derive(Debug)]
pub struct Run {
    /// The first promise that was not kept.
    pub broken: Option<Broken>,
    /// What has happened.
    pub happened: Vec<Key>,
    /// Steps.
    pub steps: u64,
    /// Sheets of users that came whole.
    pub sheets: usize,
    /// How often each promise was endangered.
    pub endangered: Table,
}

/// Lives through a world; with a script only what it says happens.
pub fn run(seed: u64, script: Option<BTreeSet<Key>>) -> Run {
    let place = std::path::Path::new("/dev/shm");
    let folder = if place.is_dir() { tempfile::tempdir_in(place) } else { tempfile::tempdir() };
    let folder = folder.expect("a folder for the journal");
    let shared = users::furnish(folder.path());
    let memory = MEMORY.take().unwrap_or_else(|| board::memory(4096, 4096));
    let world = Shared::new(World::new(seed, Chance::new(seed, script), shared, memory), users::run);
    let whole = |world: &Shared| world.look().broken.is_none();
    while whole(&world) && world.look().step < ROUGH {
        world.step(Duration::from_millis(20));
    }
    if whole(&world) {
        settle(&world);
    }
    let crashed = world.look().crashed.take();
    assert!(crashed.is_none(), "seed {seed}: {crashed:?}");
    world.leave();
    let Some(mut world) = world.into_world() else { unreachable!("nobody lives in it any more") };
    let run = Run {
        broken: world.broken.take(),
        happened: world.chance.happened().to_vec(),
        steps: world.step,
        sheets: world.known.values().filter(|known| known.whole > 0).count(),
        endangered: std::mem::take(&mut world.endangered),
    };
    MEMORY.set(world.end());
    run
}

/// All is well again, and what is open has to end.
fn settle(world: &Shared) {
    let last = world.look().step + CALM;
    users::finish(world);
    while world.look().is_busy() {
        world.step(Duration::from_millis(20));
        if world.look().step > last {
            let found = format!("the bridge is still busy; {}", world.look().standing());
            world.look().fail(Promise::EveryJobEnds, found);
            return;
        }
    }
}

/// The shortest part of what has happened that still breaks the same promise; some hundred runs, or half a minute, at most.
pub fn shrink(seed: u64, found: &Run) -> Vec<Key> {
    let Some(broken) = &found.broken else { return Vec::new() };
    let breaks = |keys: &[Key]| {
        let again = run(seed, Some(keys.iter().copied().collect())).broken;
        again.is_some_and(|again| again.promise == broken.promise)
    };
    let mut keys = found.happened.clone();
    let mut piece = keys.len().div_ceil(2);
    let (mut runs, start) = (0, Instant::now());
    while piece > 0 {
        let mut at = 0;
        while at < keys.len() && runs < 400 && start.elapsed() < SHRINKING {
            let mut fewer = keys.clone();
            fewer.drain(at..(at + piece).min(keys.len()));
            runs += 1;
            if breaks(&fewer) {
                keys = fewer;
            } else {
                at += piece;
            }
        }
        piece /= 2;
    }
    keys
}

/// A broken seed in words: the promise, what was found, and the shortest script.
pub fn report(seed: u64, found: &Run) -> String {
    let Some(broken) = &found.broken else { return String::new() };
    let keys = shrink(seed, found);
    let script: String =
        keys.iter().map(|key| format!("    step {:>6}: {:?}\n", key.step, key.kind)).collect();
    let shorter = run(seed, Some(keys.into_iter().collect())).broken;
    format!(
        "seed {seed}: {broken:?}\n  of {} occasions these are enough:\n{script}  for {shorter:?}",
        found.happened.len()
    )
}

/// How often each kind has happened.
pub fn count(happened: &[Key], kind: Kind) -> usize {
    happened.iter().filter(|key| key.kind == kind).count()
}
