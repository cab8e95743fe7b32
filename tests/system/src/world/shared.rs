//! The world for those who live in it: time passes where they wait, and their links are pipes to the board.

use super::{Burst, Todo, WAYS, World};
use crate::chance::Draw;
use device::connection::transport::Transport;
use device::connection::{Address, OpenError};
use std::io;
use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The world, for those who live in it.
#[derive(Clone)]
pub struct Shared {
    world: Arc<Mutex<World>>,
    /// Begins what one of them does next.
    start: Start,
}

/// What a user does next, by chance.
pub type Start = fn(&Shared, usize, Draw);

/// A process was killed.
pub struct Killed;

impl Shared {
    /// The world, and how those who live in it begin what they do.
    pub fn new(world: World, start: Start) -> Shared {
        Shared { world: Arc::new(Mutex::new(world)), start }
    }

    /// A look at it.
    pub fn look(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The world alone again, when nobody lives in it any more.
    pub fn into_world(self) -> Option<World> {
        Arc::into_inner(self.world).map(|world| world.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// A step of at most this long.
    pub fn step(&self, most: Duration) {
        let todo = self.look().turn(most.as_micros() as u64);
        if let Todo::Start(user, draw) = todo {
            (self.start)(self, user, draw);
        }
    }

    /// Ends this user's process if it was killed.
    pub fn live(&self, user: usize) {
        if self.look().doomed[user] {
            resume_unwind(Box::new(Killed));
        }
    }

    /// Opens the way of this user.
    pub fn open(&self, user: usize, address: &Address) -> Result<Box<dyn Transport>, OpenError> {
        self.step(Duration::from_millis(2));
        self.live(user);
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
            self.live(user);
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
            self.world.live(self.user);
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
