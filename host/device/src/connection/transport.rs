//! Byte pipes to a bridge: a serial port, a socket, memory.
//!
//! They promise nothing but order within one connection: bytes may be lost or damaged, and the pipe may end at any
//! time. Everything else is the [session](crate::transit::session)'s business. Neither direction ever waits long, so that one
//! thread can serve both.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A pipe that takes nothing for this long gives control back.
pub(super) const WRITE_PATIENCE: Duration = Duration::from_millis(50);

/// A pipe to a bridge.
pub trait Transport: Send {
    /// Sends the first of these bytes and returns how many; 0 when the pipe is full for now. An error is the end of
    /// the connection.
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Receives what has come, waiting for it at most `patience`; 0 when nothing has. An error is the end of the
    /// connection.
    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// The time by which everything at this pipe waits, since any moment before the first pipe was opened.
    fn now(&self) -> Duration {
        static START: LazyLock<Instant> = LazyLock::new(Instant::now);
        START.elapsed()
    }
}

/// What a read or write with a time limit means here.
fn now_or_later(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
            ) =>
        {
            Ok(0)
        }
        other => other,
    }
}

/// The end of a stream is the end of the connection.
fn not_over(result: io::Result<usize>, asked: usize) -> io::Result<usize> {
    match result {
        Ok(0) if asked > 0 => {
            Err(io::Error::new(ErrorKind::UnexpectedEof, "the other end closed the connection"))
        }
        other => now_or_later(other),
    }
}

/// A serial port, such as the one a bridge shows on USB.
pub struct Serial(Box<dyn serialport::SerialPort>);

impl Serial {
    /// Opens a port for this program alone. The speed matters only to bridges behind a real serial line.
    pub fn open(path: &str) -> serialport::Result<Serial> {
        let port = serialport::new(path, 115_200).timeout(WRITE_PATIENCE).open()?;
        // What an earlier conversation left is nobody's; if it cannot be thrown away, the frames' checksums do it.
        let _ = port.clear(serialport::ClearBuffer::All);
        Ok(Serial(port))
    }
}

impl Transport for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.set_timeout(WRITE_PATIENCE)?;
        now_or_later(self.0.write(bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.0.set_timeout(patience)?;
        not_over(self.0.read(buffer), buffer.len())
    }
}

/// A socket.
pub struct Socket<S>(S);

/// What a socket can do beside reading and writing.
pub trait Timed: Read + Write + Send {
    /// Limits the next reads and writes.
    fn limit(&self, read: Option<Duration>, write: Option<Duration>) -> io::Result<()>;
}

impl Timed for TcpStream {
    fn limit(&self, read: Option<Duration>, write: Option<Duration>) -> io::Result<()> {
        self.set_read_timeout(read)?;
        self.set_write_timeout(write)
    }
}

#[cfg(unix)]
impl Timed for std::os::unix::net::UnixStream {
    fn limit(&self, read: Option<Duration>, write: Option<Duration>) -> io::Result<()> {
        self.set_read_timeout(read)?;
        self.set_write_timeout(write)
    }
}

impl<S: Timed> Socket<S> {
    /// A pipe of this socket.
    pub fn new(socket: S) -> Socket<S> {
        Socket(socket)
    }
}

impl<S: Timed> Transport for Socket<S> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.limit(None, Some(WRITE_PATIENCE))?;
        now_or_later(self.0.write(bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        // A limit of zero means none.
        self.0.limit(Some(patience.max(Duration::from_millis(1))), None)?;
        not_over(self.0.read(buffer), buffer.len())
    }
}

/// One direction of a pipe in memory.
#[derive(Default)]
struct Lane {
    bytes: Mutex<(VecDeque<u8>, bool)>,
    changed: Condvar,
}

impl Lane {
    fn lock(&self) -> MutexGuard<'_, (VecDeque<u8>, bool)> {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An end of a pipe in memory. Dropping it ends the connection.
pub struct Memory {
    inward: Arc<Lane>,
    outward: Arc<Lane>,
}

/// Bytes a pipe in memory holds in each direction, as much as a kernel's terminal buffer.
const MEMORY_ROOM: usize = 4096;

/// A pipe in memory: both ends.
pub fn pair() -> (Memory, Memory) {
    let (there, back) = (Arc::<Lane>::default(), Arc::<Lane>::default());
    (Memory { inward: back.clone(), outward: there.clone() }, Memory { inward: there, outward: back })
}

impl Transport for Memory {
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut lane = self.outward.lock();
        if lane.1 {
            return Err(ErrorKind::BrokenPipe.into());
        }
        let count = bytes.len().min(MEMORY_ROOM - lane.0.len());
        lane.0.extend(&bytes[..count]);
        self.outward.changed.notify_all();
        Ok(count)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        let lane = self.inward.lock();
        let (mut lane, _) = self
            .inward
            .changed
            .wait_timeout_while(lane, patience, |(bytes, closed)| bytes.is_empty() && !*closed)
            .unwrap_or_else(PoisonError::into_inner);
        let count = lane.0.len().min(buffer.len());
        if count == 0 && lane.1 {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        buffer.iter_mut().zip(lane.0.drain(..count)).for_each(|(to, from)| *to = from);
        Ok(count)
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        for lane in [&self.inward, &self.outward] {
            lane.lock().1 = true;
            lane.changed.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends more than any buffer holds, both ways at once, and compares.
    fn carries_both_ways(mut a: impl Transport, mut b: impl Transport) {
        let data: Vec<u8> = (0..100_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let (mut to_b, mut to_a) = (0, 0);
        let (mut at_a, mut at_b) = (Vec::new(), Vec::new());
        let mut buffer = [0; 700];
        while at_a.len() < data.len() || at_b.len() < data.len() {
            to_b += a.send(&data[to_b..]).unwrap();
            to_a += b.send(&data[to_a..]).unwrap();
            let count = a.receive(&mut buffer, Duration::from_millis(1)).unwrap();
            at_a.extend_from_slice(&buffer[..count]);
            let count = b.receive(&mut buffer, Duration::from_millis(1)).unwrap();
            at_b.extend_from_slice(&buffer[..count]);
        }
        assert!(at_a == data && at_b == data);
        drop(b);
        assert!(a.receive(&mut buffer, Duration::from_secs(1)).is_err(), "the end is noticed");
    }

    #[test]
    fn memory_carries_both_ways_and_its_end_is_noticed() {
        let (a, b) = pair();
        carries_both_ways(a, b);
    }

    #[test]
    fn a_tcp_connection_carries_both_ways_and_its_end_is_noticed() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let a = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        carries_both_ways(Socket::new(a), Socket::new(listener.accept().unwrap().0));
    }

    #[cfg(unix)]
    #[test]
    fn a_local_socket_carries_both_ways_and_its_end_is_noticed() {
        let (a, b) = std::os::unix::net::UnixStream::pair().unwrap();
        carries_both_ways(Socket::new(a), Socket::new(b));
    }

    #[cfg(unix)]
    #[test]
    fn the_serial_port_is_a_transport_on_a_pseudo_terminal() {
        use serialport::SerialPort as _;
        let (a, b) = serialport::TTYPort::pair().unwrap();
        let name = b.name().unwrap();
        drop(b);
        // Opened by its name, as a user would; not while somebody else has it.
        let mut b = Serial::open(&name).unwrap();
        assert!(Serial::open(&name).is_err());
        let mut a = Serial(Box::new(a));
        let bytes: Vec<u8> = (0..=255).collect();
        assert_eq!(a.send(&bytes).unwrap(), 256);
        let (mut got, mut buffer) = (Vec::new(), [0; 300]);
        while got.len() < 256 {
            let count = b.receive(&mut buffer, Duration::from_secs(1)).unwrap();
            assert!(count > 0, "only {} bytes came", got.len());
            got.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(got, bytes, "control characters pass unchanged");
        assert_eq!(b.receive(&mut buffer, Duration::from_millis(1)).unwrap(), 0);
    }

    #[test]
    fn nothing_to_receive_is_no_error() {
        let (mut a, _b) = pair();
        assert_eq!(a.receive(&mut [0; 8], Duration::from_millis(1)).unwrap(), 0);
    }
}
