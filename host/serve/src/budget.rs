//! What one client takes of the server: its share of connections, jobs, disk and drawing.
//!
//! Problem: whoever may print may also be slow, many or greedy, and must not hinder others. Method: a client
//! is an IPv4 address or an IPv6 network of 64 bits, for whoever has one address of that has all of them; it
//! has a share of everything, and the last connections are for clients that have none. This computer has no
//! limits, for its user could stop the server anyway.
//! Limits: addresses are cheap on some networks; many clients together take what there is, and the last
//! places.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// The most jobs that wait.
pub const MOST_JOBS: usize = 500;
/// The most jobs of one client that wait.
pub const MOST_OF_ONE: usize = 50;
/// Of the free disk at the start, documents take at most one of so many parts, and those of one client one of
/// so many of that.
const DISK: u64 = 2;
const DISK_OF_ONE: u64 = 4;

/// Who has a share.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Client {
    /// This computer.
    Here,
    /// An address.
    V4(u32),
    /// A network.
    V6(u64),
}

impl Client {
    /// Whoever is at this address.
    #[must_use]
    pub fn at(address: IpAddr) -> Client {
        match address.to_canonical() {
            address if address.is_loopback() => Client::Here,
            IpAddr::V4(address) => Client::V4(address.to_bits()),
            IpAddr::V6(address) => {
                let [a, b, c, d, e, f, g, h, ..] = address.octets();
                Client::V6(u64::from_be_bytes([a, b, c, d, e, f, g, h]))
            }
        }
    }

    /// Whether there is a limit for it at all.
    #[must_use]
    pub fn is_limited(self) -> bool {
        self != Client::Here
    }
}

/// How many connections there may be.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    /// Of all clients together.
    pub all: usize,
    /// Of one.
    pub of_one: usize,
    /// Of these, for clients that have none yet.
    pub for_new: usize,
}

/// The connections of each client.
#[derive(Default)]
pub struct Connections(Mutex<HashMap<Client, usize>>);

/// A connection that counts while it is there.
pub struct Connection {
    all: Arc<Connections>,
    client: Client,
}

impl Connections {
    /// Lets a connection in, if its client has not got its share.
    pub fn enter(self: &Arc<Self>, client: Client, places: &Places) -> Option<Connection> {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let total: usize =
            counts.iter().filter(|(client, _)| client.is_limited()).map(|(_, count)| count).sum();
        let own = counts.get(&client).copied().unwrap_or(0);
        let has_room = match own {
            0 => total < places.all,
            _ => own < places.of_one && total + places.for_new < places.all,
        };
        if client.is_limited() && !has_room {
            return None;
        }
        counts.insert(client, own + 1);
        Some(Connection { all: self.clone(), client })
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let mut counts = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = counts.get_mut(&self.client) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.client);
            }
        }
    }
}

/// What a client cannot have any more.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Exceeded {
    /// Jobs of all.
    #[error("{MOST_JOBS} jobs wait already; try again later")]
    Jobs,
    /// Its own jobs.
    #[error("{MOST_OF_ONE} jobs of yours wait already; print or cancel some of them first")]
    OwnJobs,
    /// Disk of all.
    #[error("the documents that wait have filled the space there is for them; try again later")]
    Disk,
    /// Its own disk.
    #[error(
        "your documents that wait have filled your share of the space; print or cancel some of them first"
    )]
    OwnDisk,
}

/// Whether another job of a client may wait beside these many of all and of its own.
///
/// # Errors
/// It has its share.
pub fn job(client: Client, all: usize, own: usize) -> Result<(), Exceeded> {
    match () {
        () if all >= MOST_JOBS => Err(Exceeded::Jobs),
        () if client.is_limited() && own >= MOST_OF_ONE => Err(Exceeded::OwnJobs),
        () => Ok(()),
    }
}

/// The disk that documents may take.
#[derive(Clone, Copy, Debug)]
pub struct Disk(Option<u64>);

impl Disk {
    /// Of what is free at the start; nothing is known where the system does not tell.
    #[must_use]
    pub fn of_free(bytes: Option<u64>) -> Disk {
        Disk(bytes.map(|bytes| bytes / DISK))
    }

    /// What documents may take that were printed already.
    #[must_use]
    pub fn printed(self) -> u64 {
        self.0.map_or(u64::MAX, |most| most / DISK_OF_ONE)
    }

    /// Whether a client's documents may take so many bytes, and all together so many.
    ///
    /// # Errors
    /// It has its share.
    pub fn holds(self, client: Client, own: u64, all: u64) -> Result<(), Exceeded> {
        match self.0 {
            Some(most) if all > most => Err(Exceeded::Disk),
            Some(most) if client.is_limited() && own > most / DISK_OF_ONE => Err(Exceeded::OwnDisk),
            _ => Ok(()),
        }
    }
}

/// What is drawn for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Purpose {
    /// To be printed.
    Print,
    /// To be looked at.
    Look,
}

/// Whose turn it is to draw: a page is 100 MB, so there is one at a time, and what is printed goes first.
#[derive(Default)]
pub struct Turns {
    now: Mutex<Drawing>,
    free: Condvar,
}

#[derive(Default)]
struct Drawing {
    is_busy: bool,
    /// How many wait to draw what is printed.
    waiting: usize,
}

/// A turn, until it is dropped.
pub struct Turn<'a> {
    turns: &'a Turns,
    purpose: Purpose,
}

impl Turns {
    /// Waits for a turn.
    pub fn take(&self, purpose: Purpose) -> Turn<'_> {
        self.wait(self.now.lock().unwrap_or_else(PoisonError::into_inner), purpose);
        Turn { turns: self, purpose }
    }

    fn wait(&self, mut now: MutexGuard<'_, Drawing>, purpose: Purpose) {
        let is_print = purpose == Purpose::Print;
        now.waiting += usize::from(is_print);
        while now.is_busy || !is_print && now.waiting > 0 {
            now = self.free.wait(now).unwrap_or_else(PoisonError::into_inner);
        }
        now.waiting -= usize::from(is_print);
        now.is_busy = true;
    }
}

impl Turn<'_> {
    /// Between two pages: lets go first what is to be printed. Whether anything did.
    pub fn give_way(&self) -> bool {
        let mut now = self.turns.now.lock().unwrap_or_else(PoisonError::into_inner);
        if self.purpose == Purpose::Print || now.waiting == 0 {
            return false;
        }
        now.is_busy = false;
        self.turns.free.notify_all();
        self.turns.wait(now, self.purpose);
        true
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.turns.now.lock().unwrap_or_else(PoisonError::into_inner).is_busy = false;
        self.turns.free.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const PLACES: Places = Places { all: 256, of_one: 32, for_new: 64 };

    fn client(address: &str) -> Client {
        Client::at(address.parse().unwrap())
    }

    #[test]
    fn a_client_is_an_address_or_a_network_and_this_computer_is_one_by_itself() {
        assert_eq!(client("2001:db8:1:2::5"), client("2001:db8:1:2:ffff::1"));
        assert_ne!(client("2001:db8:1:2::5"), client("2001:db8:1:3::5"));
        assert_ne!(client("10.0.0.1"), client("10.0.0.2"));
        assert_eq!(client("::ffff:10.0.0.1"), client("10.0.0.1"));
        for own in ["127.0.0.1", "127.4.5.6", "::1", "::ffff:127.0.0.1"] {
            assert_eq!(client(own), Client::Here);
        }
    }

    #[test]
    fn five_addresses_and_a_whole_network_leave_places_for_others() {
        let all = Arc::new(Connections::default());
        let mut held = Vec::new();
        let mut take = |address: &str, times: usize| {
            let before = held.len();
            held.extend((0..times).filter_map(|_| all.enter(client(address), &PLACES)));
            held.len() - before
        };
        for last in 1..=5 {
            assert_eq!(take(&format!("10.0.0.{last}"), 120), 32);
        }
        assert_eq!((1..=200).map(|at| take(&format!("2001:db8::{at:x}"), 1)).sum::<usize>(), 32);
        // The rest is for clients that have no connection, one each.
        for last in 10..=73 {
            assert_eq!(take(&format!("10.0.1.{last}"), 9), 1, "{last}");
        }
        assert_eq!(take("10.0.2.1", 1), 0);
        assert_eq!(take("127.0.0.1", 400), 400);
        held.truncate(255);
        assert!(all.enter(client("10.0.2.1"), &PLACES).is_some());
    }

    #[test]
    fn jobs_and_disk_have_shares_but_for_this_computer() {
        let guest = client("10.0.0.1");
        assert_eq!((job(guest, 60, 49), job(guest, 60, 50)), (Ok(()), Err(Exceeded::OwnJobs)));
        assert_eq!((job(Client::Here, 499, 499), job(Client::Here, 500, 0)), (Ok(()), Err(Exceeded::Jobs)));
        let disk = Disk::of_free(Some(8000));
        assert_eq!(
            (disk.holds(guest, 1000, 4000), disk.holds(guest, 1001, 1001)),
            (Ok(()), Err(Exceeded::OwnDisk))
        );
        assert_eq!(disk.holds(Client::Here, 4000, 4000), Ok(()));
        assert_eq!(disk.holds(Client::Here, 1, 4001), Err(Exceeded::Disk));
        assert_eq!(Disk::of_free(None).holds(guest, u64::MAX, u64::MAX), Ok(()));
    }

    #[test]
    fn what_is_printed_goes_before_what_is_looked_at() {
        let turns = Turns::default();
        let order = Mutex::new(Vec::new());
        let wrote = |what: &'static str| order.lock().unwrap().push(what);
        std::thread::scope(|scope| {
            let look = turns.take(Purpose::Look);
            assert!(!look.give_way());
            scope.spawn(|| {
                let turn = turns.take(Purpose::Look);
                wrote("second look");
                drop(turn);
            });
            scope.spawn(|| {
                let turn = turns.take(Purpose::Print);
                assert!(!turn.give_way());
                wrote("print");
                drop(turn);
            });
            while turns.now.lock().unwrap().waiting == 0 {
                std::thread::sleep(Duration::from_millis(1));
            }
            assert!(look.give_way());
            wrote("first look");
        });
        let order = order.into_inner().unwrap();
        assert_eq!((order[0], order.len()), ("print", 3));
    }
}
