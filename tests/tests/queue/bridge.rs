//! A bridge on a socket: the engine that runs on the board, with a port whose speed and paper the test decides.

use crate::model::Board;
use bridge::engine::{Engine, Identity, Outcome, Task};
use foilpress::send::transport::{Socket, Transport};
use foilpress::simulate::{Carousel, Cassette, Lever, Printer, STATUS_LENGTH};
use protocol::ink::Ink;
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::{Answer, Fault, Lines};
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// What the test can do at the printer.
pub struct Port {
    /// Bytes it takes in a millisecond at most.
    pub rate: AtomicUsize,
    pub paper: AtomicBool,
    /// The maker its device ID names; none for a port that does not talk back.
    pub maker: Mutex<Option<&'static str>>,
    /// Everything that crossed it.
    pub printed: Mutex<Vec<u8>>,
    stop: AtomicBool,
}

pub struct Bridge {
    pub address: SocketAddr,
    pub port: Arc<Port>,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    /// A bridge at a free place.
    pub fn start(rate: usize) -> Bridge {
        Bridge::at("127.0.0.1:0".parse().unwrap(), rate)
    }

    pub fn at(address: SocketAddr, rate: usize) -> Bridge {
        let listener = TcpListener::bind(address).unwrap();
        let address = listener.local_addr().unwrap();
        let port = Arc::new(Port {
            rate: rate.into(),
            paper: true.into(),
            maker: Mutex::default(),
            printed: Mutex::default(),
            stop: false.into(),
        });
        let thread = std::thread::spawn({
            let port = port.clone();
            move || serve(&listener, &port)
        });
        Bridge { address, port, thread: Some(thread) }
    }

    pub fn uri(&self) -> String {
        format!("foilpress:/tcp/{}", self.address)
    }

    pub fn printed(&self) -> Vec<u8> {
        self.port.printed.lock().unwrap().clone()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.port.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || ended.is_some_and(|ended| ended.is_ok()));
    }
}

/// What a printer with the process inks in it answers.
fn status() -> [u8; STATUS_LENGTH] {
    let cassettes = [Ink::Black, Ink::Cyan, Ink::Magenta, Ink::Yellow].map(Cassette::from);
    Printer::new(Carousel::new(&cassettes).unwrap(), Lever::Auto).status()
}

/// A device ID as IEEE 1284 has it: its length, itself counted, then keys and values.
fn device_id(maker: &str) -> Vec<u8> {
    let text = format!("MFG:{maker};MDL:Test;CLS:PRINTER;");
    [&[0, (text.len() + 2) as u8], text.as_bytes()].concat()
}

fn serve(listener: &TcpListener, port: &Port) {
    listener.set_nonblocking(true).unwrap();
    let mut board = Board::new(16_384, 8192);
    let mut engine = Engine::new(board.memory(), Identity { boot: 1, serial: 7, firmware: "test" });
    let mut reader = Reader::new();
    let mut link: Option<Socket<_>> = None;
    let mut buffer = [0; 4096];
    while !port.stop.load(Ordering::Relaxed) {
        if let Ok((socket, _)) = listener.accept() {
            socket.set_nonblocking(false).unwrap();
            engine.link_lost();
            reader.reset();
            link = Some(Socket::new(socket));
        }
        let received = match &mut link {
            Some(link) => link.receive(&mut buffer, Duration::from_millis(1)),
            None => {
                std::thread::sleep(Duration::from_millis(1));
                Ok(0)
            }
        };
        match received {
            Ok(count) => engine.receive(&mut reader, &buffer[..count]),
            Err(_) => link = None,
        }
        if let Some(task) = engine.task() {
            let status = status();
            let id = port.maker.lock().unwrap().map(device_id);
            engine.done(match (task, &id) {
                (Task::PrinterStatus, _) => Outcome::Answer(Answer::Bytes(&status)),
                (Task::DeviceId, Some(id)) => Outcome::Answer(Answer::Bytes(id)),
                (Task::DeviceId, None) => Outcome::Answer(Answer::OneWay),
                _ => Outcome::Done,
            });
        }
        for _ in 0..50 {
            engine.work();
        }
        let paper = port.paper.load(Ordering::Relaxed);
        engine.port(Lines::IDLE, (!paper).then_some(Fault::PaperOut));
        let bytes = engine.output();
        let count = if paper { bytes.len().min(port.rate.load(Ordering::Relaxed)) } else { 0 };
        port.printed.lock().unwrap().extend_from_slice(&bytes[..count]);
        engine.consumed(count);
        let mut frame = [0; MAX];
        loop {
            let length = engine.transmit(&mut frame);
            if length == 0 {
                break;
            }
            let mut sent = 0;
            while let Some(open) = &mut link
                && sent < length
            {
                match open.send(&frame[sent..length]) {
                    Ok(count) => sent += count,
                    Err(_) => link = None,
                }
            }
        }
    }
}
