//! A job on its way to a bridge: how long a question takes meanwhile, and what the host computes.
//!
//! Run `cargo bench -p foilpress-tests --bench link`. The bridge is the real engine in a thread of its own, its port as
//! fast as the model printer's; on a microcontroller the same is measured by the emulator. A question is put every 20 ms
//! while the job runs, behind whatever data are on their way, and answered by the engine in its turn. Host computing is
//! the time this thread has spent on a processor (Linux only), the waiting for the link left out.

use bridge::engine::{Engine, Identity, Memory};
use device::connection::transport::{Socket, Transport, pair};
use device::transit::session::{Outcome, Record, Session};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{Ask, JobKind, Lines, ToBridge, ToHost};
use protocol::runs::Decoder;
use std::convert::Infallible;
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Bytes a second at the port: setup, strobe, hold and some microseconds of Busy for each byte.
const PORT: f64 = 150_000.0;
const LENGTH: usize = 600_000;
const EVERY: Duration = Duration::from_millis(20);

fn main() {
    println!(
        "{:<8} {:>10} {:>10} {:>10} {:>14} {:>12}",
        "link", "median", "95 %", "longest", "host, 1 core", "port"
    );
    let (here, there) = pair();
    run("memory", Box::new(here), Box::new(there));
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let here = TcpStream::connect(listener.local_addr().expect("its number")).expect("a connection");
    let (there, _) = listener.accept().expect("its other end");
    for end in [&here, &there] {
        end.set_nodelay(true).expect("small messages at once");
    }
    run("socket", Box::new(Socket::new(here)), Box::new(Socket::new(there)));
    #[cfg(unix)]
    terminal::run();
}

/// A pseudo-terminal, which is what a serial port on USB is to the host.
#[cfg(unix)]
mod terminal {
    use device::connection::transport::{Serial, Transport};
    use serialport::{SerialPort as _, TTYPort};
    use std::io::{ErrorKind, Read as _, Result, Write as _};
    use std::time::Duration;

    pub fn run() {
        let (there, here) = TTYPort::pair().expect("a pair of terminals");
        let name = here.name().expect("its name");
        drop(here);
        super::run("pty", Box::new(Serial::open(&name).expect("its other end")), Box::new(Bridge(there)));
    }

    /// The bridge's end.
    struct Bridge(TTYPort);

    impl Transport for Bridge {
        fn send(&mut self, bytes: &[u8]) -> Result<usize> {
            self.0.write(bytes)
        }

        fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> Result<usize> {
            self.0.set_timeout(patience)?;
            match self.0.read(buffer) {
                Err(error) if error.kind() == ErrorKind::TimedOut => Ok(0),
                other => other,
            }
        }
    }
}

fn run(name: &str, mut here: Box<dyn Transport>, there: Box<dyn Transport>) {
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| bridge(there, &stop));
        // Text, which the engine passes through as it is.
        let data = vec![b'x'; LENGTH];
        let mut session = Session::new(Record::new(1, JobKind::Raw, LENGTH as u32), &data);
        let start = Instant::now();
        let before = computed();
        let mut times = talk(&mut session, &mut *here, start);
        let (took, computed) = (start.elapsed(), computed() - before);
        stop.store(true, Ordering::Relaxed);
        times.sort();
        let at = |share: f64| {
            format!("{:.2} ms", 1e3 * times[((times.len() - 1) as f64 * share) as usize].as_secs_f64())
        };
        println!(
            "{name:<8} {:>10} {:>10} {:>10} {:>12.1} % {:>7.0} kB/s",
            at(0.5),
            at(0.95),
            at(1.0),
            100.0 * computed.as_secs_f64() / took.as_secs_f64(),
            LENGTH as f64 / took.as_secs_f64() / 1e3
        );
    });
}

/// Sends the job; how long each question took that was put meanwhile.
fn talk(session: &mut Session<'_>, link: &mut dyn Transport, start: Instant) -> Vec<Duration> {
    let (mut out, mut sent) = (Vec::new(), 0);
    let mut reader = Reader::new();
    let (mut asked, mut number, mut times) = (None::<Instant>, 0u16, Vec::new());
    let mut last = start;
    let mut buffer = [0; 4096];
    session.connected(start.elapsed());
    while session.outcome() != Some(Outcome::Printed) {
        if sent == out.len() {
            (sent, out) = (0, Vec::new());
            let Ok(()) = session.speak(start.elapsed(), &mut out, &mut |_| Ok::<(), Infallible>(()));
            if asked.is_none() && last.elapsed() >= EVERY && session.greeted() {
                number += 1;
                let mut frame = [0; MAX];
                let question = ToBridge::Ask { request: number, what: Ask::Lines };
                let length = frame::write(&question, &mut frame).expect("a frame");
                out.extend_from_slice(&frame[..length]);
                (asked, last) = (Some(Instant::now()), Instant::now());
            }
        }
        if sent < out.len() {
            sent += link.send(&out[sent..]).expect("the link stays");
        }
        let patience =
            if sent < out.len() || session.has_more() { Duration::ZERO } else { Duration::from_millis(5) };
        let count = link.receive(&mut buffer, patience).expect("the link stays");
        session.hear(start.elapsed(), &buffer[..count]).expect("a conversation");
        let mut bytes = &buffer[..count];
        while let Read::Message(message, rest) = reader.read(bytes) {
            bytes = rest;
            if let Ok(ToHost::Lines { request, .. }) = frame::decode(message)
                && request == number
                && let Some(asked) = asked.take()
            {
                times.push(asked.elapsed());
            }
        }
    }
    times
}

/// A bridge whose port takes [`PORT`] bytes a second.
fn bridge(mut link: Box<dyn Transport>, stop: &AtomicBool) {
    let (mut data, mut output, mut band) = (vec![0; 12 << 10], vec![0; 40 << 10], vec![0; 38_400]);
    let memory =
        Memory { data: &mut data, output: &mut output, band: &mut band, decoder: &mut Decoder::default() };
    let mut engine = Engine::new(memory, Identity { boot: 1, serial: 1, firmware: "bench" });
    let (mut reader, mut frame, mut buffer) = (Reader::new(), [0; MAX], [0; 1024]);
    let (mut then, mut allowed) = (Instant::now(), 0.0);
    while !stop.load(Ordering::Relaxed) {
        let Ok(count) = link.receive(&mut buffer, Duration::from_millis(1)) else { return };
        engine.receive(&mut reader, &buffer[..count]);
        for _ in 0..40 {
            engine.work();
        }
        allowed = (allowed + then.elapsed().as_secs_f64() * PORT).min(4096.0);
        then = Instant::now();
        let count = engine.output().len().min(allowed as usize);
        allowed -= count as f64;
        engine.consumed(count);
        engine.port(Lines::IDLE, None);
        loop {
            let length = engine.transmit(&mut frame);
            let mut sent = 0;
            while sent < length {
                let Ok(count) = link.send(&frame[sent..length]) else { return };
                sent += count;
            }
            if length == 0 {
                break;
            }
        }
    }
}

/// How long this thread has computed.
fn computed() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    Duration::from_nanos(text.split_whitespace().next().and_then(|field| field.parse().ok()).unwrap_or(0))
}
