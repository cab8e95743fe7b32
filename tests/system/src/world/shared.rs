//! The world for those who live in it: each process is a thread, and of all of them and the world one acts at
//! a time.
//!
//! A process acts until it waits for something; then the world goes on by a step, and each process that waits
//! looks again. So a step of one may fall anywhere in another, and the same seed does the same again.

use super::{Burst, Todo, USERS, WAYS, World};
use crate::chance::Draw;
use device::connection::transport::Transport;
use device::connection::{Address, OpenError};
use std::io;
use std::panic::resume_unwind;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// The world, for those who live in it.
#[derive(Clone)]
pub struct Shared(Arc<Inner>);

struct Inner {
    world: Mutex<World>,
    /// The user whose process acts; none while the world does.
    acts: Mutex<Option<usize>>,
    passed: Condvar,
    threads: Mutex<[Option<JoinHandle<()>>; USERS]>,
    /// What a process does.
    start: Start,
}

/// What a user's process does: by chance, or to bring what is open to its end.
pub type Start = fn(&Shared, usize, Draw, bool);

/// A process was killed.
pub struct Killed;

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// The world, and what those do who live in it.
    pub fn new(world: World, start: Start) -> Shared {
        Shared(Arc::new(Inner {
            world: Mutex::new(world),
            acts: Mutex::new(None),
            passed: Condvar::new(),
            threads: Mutex::default(),
            start,
        }))
    }

    /// A look at it, for whoever acts.
    pub fn look(&self) -> MutexGuard<'_, World> {
        locked(&self.0.world)
    }

    /// The world alone again, when nobody lives in it any more.
    pub fn into_world(self) -> Option<World> {
        Arc::into_inner(self.0).map(|inner| inner.world.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// A step of at most this long, and what everybody does then.
    pub fn step(&self, most: Duration) {
        let (todo, first) = {
            let mut world = self.look();
            let most = world.wants.iter().flatten().copied().min().unwrap_or(most);
            (world.turn(most.as_micros() as u64), world.step as usize)
        };
        if let Todo::Start(user, draw) = todo {
            self.begin(user, draw, false);
        }
        for user in (0..USERS).map(|at| (first + at) % USERS) {
            self.act(user);
        }
    }

    /// A process of this user begins.
    pub fn begin(&self, user: usize, draw: Draw, calm: bool) {
        {
            let mut world = self.look();
            (world.runs[user], world.doomed[user]) = (true, false);
        }
        let shared = self.clone();
        let thread = std::thread::spawn(move || {
            shared.await_turn(user);
            (shared.0.start)(&shared, user, draw, calm);
            {
                let mut world = shared.look();
                (world.runs[user], world.doomed[user], world.wants[user]) = (false, false, None);
            }
            shared.pass(None);
        });
        locked(&self.0.threads)[user] = Some(thread);
    }

    /// Lets a process act until it waits or ends.
    fn act(&self, user: usize) {
        if !self.look().runs[user] {
            return;
        }
        self.pass(Some(user));
        let acts = locked(&self.0.acts);
        drop(
            self.0
                .passed
                .wait_while(acts, |acts| *acts == Some(user))
                .unwrap_or_else(PoisonError::into_inner),
        );
        if !self.look().runs[user]
            && let Some(thread) = locked(&self.0.threads)[user].take()
        {
            let _ = thread.join();
        }
    }

    /// Everybody leaves: the world ends.
    pub fn leave(&self) {
        self.look().doomed = [true; USERS];
        (0..USERS).for_each(|user| self.act(user));
    }

    /// Somebody else acts from now on.
    fn pass(&self, to: Option<usize>) {
        *locked(&self.0.acts) = to;
        self.0.passed.notify_all();
    }

    fn await_turn(&self, user: usize) {
        let acts = locked(&self.0.acts);
        drop(
            self.0
                .passed
                .wait_while(acts, |acts| *acts != Some(user))
                .unwrap_or_else(PoisonError::into_inner),
        );
    }

    /// In a user's process: lets a step of at most this long pass.
    fn wait(&self, user: usize, most: Duration) {
        self.look().wants[user] = Some(most);
        self.pass(None);
        self.await_turn(user);
        self.live(user);
    }

    /// Ends this user's process if it was killed.
    pub fn live(&self, user: usize) {
        if self.look().doomed[user] {
            resume_unwind(Box::new(Killed));
        }
    }

    /// Opens the way of this user.
    pub fn open(&self, user: usize, address: &Address) -> Result<Box<dyn Transport>, OpenError> {
        self.wait(user, Duration::from_millis(2));
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
            self.wait(user, Duration::from_micros(end - now));
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
            self.world.wait(self.user, Duration::from_micros(left));
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
