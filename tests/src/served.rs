//! A bridge on a socket: the engine and the store that run on the board, and a printer whose pace and troubles a test decides.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bridge::alone::Alone;
use bridge::button::Press;
use bridge::engine::{Checkpoint, Engine, Identity, Memory, Outcome, Task};
use bridge::store::{End, Flash, SECTOR, Store};
use device::connection::transport::{Socket, Transport};
use press::simulate::{Carousel, Cartridge, Lever, Printer, STATUS_LENGTH, Trouble};
use protocol::ink::Ink;
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::{Answer, Fault, JobState, Lines, Progress, Usage};
use protocol::runs::Decoder;

/// Enough for anything the bridge does at once, on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// How long the printer prints behind the last byte.
const PRINTS: Duration = Duration::from_secs(1);

/// The bits of the status byte that say so.
const PRINTING: u8 = 0x09;

/// What a test sees of the printer and does to it and the bridge.
pub struct Port {
    /// Everything that crossed it.
    pub printed: Mutex<Vec<u8>>,
    /// Bytes the printer takes in a millisecond at most.
    pub rate: AtomicUsize,
    /// The printer is busy once it has taken something: the job stays open for as long as a test needs.
    pub busy: AtomicBool,
    /// There is paper.
    pub paper: AtomicBool,
    /// The printer is switched off.
    pub off: AtomicBool,
    /// The printer's cover is open.
    pub open_cover: AtomicBool,
    /// The maker its device ID names; none for a port that does not talk back.
    pub maker: Mutex<Option<&'static str>>,
    /// The printer does not say how it is.
    pub one_way: AtomicBool,
    /// For so many milliseconds behind the last byte the printer says idle, and then for a second that it prints.
    pub lag: AtomicUsize,
    /// When the last byte came.
    last: Mutex<Option<Instant>>,
    /// How often the printer was asked how it is.
    pub asked: AtomicUsize,
    /// How often the printer was reset.
    pub resets: AtomicUsize,
    /// How many bytes had crossed the port at each reset.
    pub reset_at: Mutex<Vec<usize>>,
    /// Where the bridge's job stands.
    progress: Mutex<Option<Progress>>,
    /// The link is cut.
    pub cut: AtomicBool,
    /// Something that is no message comes out of the link at both ends.
    pub garbage: AtomicBool,
    /// The bridge's power goes, and its memory with it.
    pub forget: AtomicBool,
    /// The bridge restarts, and keeps its memory.
    pub restart: AtomicBool,
    /// The bridge's button was pressed for a moment.
    pub press: AtomicBool,
    /// The bridge's flash, which outlives everything.
    flash: Mutex<Vec<u8>>,
    /// The cartridges that are in.
    cartridges: Vec<Cartridge>,
    /// Bytes of memory for bands.
    band: usize,
    stop: AtomicBool,
}

impl Port {
    /// A printer with these cartridges that takes so many bytes a millisecond.
    pub fn new(cartridges: &[Ink], rate: usize) -> Port {
        Port {
            printed: Mutex::default(),
            rate: rate.into(),
            busy: false.into(),
            paper: true.into(),
            off: false.into(),
            open_cover: false.into(),
            maker: Mutex::default(),
            one_way: false.into(),
            lag: 0.into(),
            last: Mutex::default(),
            asked: 0.into(),
            resets: 0.into(),
            reset_at: Mutex::default(),
            progress: Mutex::default(),
            cut: false.into(),
            garbage: false.into(),
            forget: false.into(),
            restart: false.into(),
            press: false.into(),
            flash: Mutex::new(flash()),
            cartridges: cartridges.iter().copied().map(Cartridge::from).collect(),
            band: 40_000,
            stop: false.into(),
        }
    }

    /// The same at a bridge with so much memory for bands.
    pub fn with_band(self, band: usize) -> Port {
        Port { band, ..self }
    }

    /// Where the bridge's job stands; none before the bridge is up.
    pub fn progress(&self) -> Option<Progress> {
        *self.progress.lock().expect("no test panicked with it")
    }

    /// Bytes of the flash that are written.
    pub fn written(&self) -> usize {
        self.flash.lock().expect("no test panicked with it").iter().filter(|&&byte| byte != 0xff).count()
    }

    /// Notes that the supply went in the middle of this job, for a bridge that forgets then.
    pub fn tear(&self, job: u32) {
        Store::open(Area(&self.flash)).note_begin(job, 0);
    }

    fn status(&self) -> [u8; STATUS_LENGTH] {
        let carousel = Carousel::new(&self.cartridges).expect("at most seven cartridges");
        let mut printer = Printer::new(carousel, Lever::Auto);
        if is(&self.open_cover) {
            printer.strike(Trouble::CoverOpen);
        }
        let mut status = printer.status();
        let last = *self.last.lock().expect("no test panicked with it");
        let from = Duration::from_millis(self.lag.load(Ordering::Relaxed) as u64);
        if last.is_some_and(|last| (from..from + PRINTS).contains(&last.elapsed())) {
            status[4] |= PRINTING;
        }
        status
    }
}

/// A flash whose diary says that the printer stands between two jobs.
fn flash() -> Vec<u8> {
    let flash = Mutex::new(vec![0xff; 480 * SECTOR as usize]);
    let mut store = Store::open(Area(&flash));
    store.note_begin(1, 0);
    store.note_end(End::Legal);
    drop(store);
    flash.into_inner().expect("nobody else has it")
}

/// The area of the flash, in memory.
struct Area<'p>(&'p Mutex<Vec<u8>>);

impl Area<'_> {
    fn bytes<R>(&self, from: u32, count: usize, act: impl FnOnce(&mut [u8]) -> R) -> R {
        act(&mut self.0.lock().expect("no test panicked with it")[from as usize..][..count])
    }
}

impl Flash for Area<'_> {
    fn size(&self) -> u32 {
        self.0.lock().expect("no test panicked with it").len() as u32
    }

    fn read(&self, at: u32, out: &mut [u8]) {
        self.bytes(at, out.len(), |bytes| out.copy_from_slice(bytes));
    }

    fn program(&mut self, at: u32, bytes: &[u8]) {
        self.bytes(at, bytes.len(), |old| old.iter_mut().zip(bytes).for_each(|(old, new)| *old &= new));
    }

    fn erase(&mut self, sector: u32) {
        self.bytes(sector * SECTOR, SECTOR as usize, |bytes| bytes.fill(0xff));
    }
}

/// A bridge at work until it is dropped.
pub struct Bridge {
    /// Its printer.
    pub port: Arc<Port>,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    /// At a local socket of this name.
    #[cfg(unix)]
    pub fn on_unix(path: &Path, port: Port) -> io::Result<Bridge> {
        let listener = std::os::unix::net::UnixListener::bind(path)?;
        listener.set_nonblocking(true)?;
        Ok(Bridge::start(port, move || {
            let (socket, _) = listener.accept().ok()?;
            socket.set_nonblocking(false).ok()?;
            Some(Box::new(Socket::new(socket)))
        }))
    }

    /// At a place on the network; says which, if any will do (`127.0.0.1:0`).
    pub fn on_tcp(address: SocketAddr, port: Port) -> io::Result<(Bridge, SocketAddr)> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        listener.set_nonblocking(true)?;
        let bridge = Bridge::start(port, move || {
            let (socket, _) = listener.accept().ok()?;
            socket.set_nonblocking(false).ok()?;
            Some(Box::new(Socket::new(socket)))
        });
        Ok((bridge, address))
    }

    fn start(port: Port, mut accept: impl FnMut() -> Option<Box<dyn Transport>> + Send + 'static) -> Bridge {
        let port = Arc::new(port);
        let thread = std::thread::spawn({
            let port = port.clone();
            move || {
                let (mut data, mut output, mut band) = (vec![0; 8192], vec![0; 4096], vec![0; port.band]);
                let mut decoder = Box::<Decoder>::default();
                let mut kept = None;
                for boot in 1.. {
                    let memory = Memory {
                        data: &mut data,
                        output: &mut output,
                        band: &mut band,
                        decoder: &mut decoder,
                    };
                    let identity = Identity { boot, serial: 7, firmware: "test" };
                    let remembers = kept.is_some();
                    let engine = match kept {
                        Some(checkpoint) => Engine::resume(memory, identity, checkpoint),
                        None => Engine::new(memory, identity),
                    };
                    kept = serve(engine, remembers, &mut accept, &port);
                    if is(&port.stop) {
                        break;
                    }
                }
            }
        });
        Bridge { port, thread: Some(thread) }
    }

    /// Does one of the things that happen once, such as a restart, and waits until it has happened.
    ///
    /// # Panics
    /// If it never does.
    pub fn strike(&self, flag: impl Fn(&Port) -> &AtomicBool) {
        flag(&self.port).store(true, Ordering::Relaxed);
        let start = Instant::now();
        while is(flag(&self.port)) {
            assert!(start.elapsed() < PATIENCE, "the bridge takes no notice");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// The state of its job.
    pub fn state(&self) -> JobState {
        self.port.progress().map_or(JobState::None, |progress| progress.state)
    }

    /// Everything that has crossed the port.
    pub fn printed(&self) -> Vec<u8> {
        self.port.printed.lock().expect("no test panicked with it").clone()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.port.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || ended.is_some_and(|ended| ended.is_ok()), "the bridge panicked");
    }
}

fn is(flag: &AtomicBool) -> bool {
    flag.load(Ordering::Relaxed)
}

/// One life of the bridge; what it leaves to the next one.
fn serve(
    mut engine: Engine<'_>,
    remembers: bool,
    accept: &mut dyn FnMut() -> Option<Box<dyn Transport>>,
    port: &Port,
) -> Option<Checkpoint> {
    let (mut reader, mut buffer) = (Reader::new(), [0; 4096]);
    let mut link: Option<Box<dyn Transport>> = None;
    let mut alone = Alone::open(Area(&port.flash), &mut engine, remembers);
    let started = Instant::now();
    while !is(&port.stop) && !port.forget.swap(false, Ordering::Relaxed) {
        if port.restart.swap(false, Ordering::Relaxed) {
            return Some(engine.checkpoint());
        }
        if let Some(opened) = accept() {
            engine.link_lost();
            reader.reset();
            link = Some(opened);
        }
        if port.cut.swap(false, Ordering::Relaxed) {
            link = None;
        }
        if port.garbage.swap(false, Ordering::Relaxed) {
            let garbage: Vec<u8> =
                (0..3000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            engine.receive(&mut reader, &garbage);
            if let Some(open) = &mut link {
                // What does not go at once is lost, as on a cable.
                let _ = open.send(&garbage);
            }
        }
        match link.as_mut().map(|link| link.receive(&mut buffer, Duration::from_millis(1))) {
            Some(Ok(count)) => {
                engine.receive(&mut reader, &buffer[..count]);
            }
            Some(Err(_)) => link = None,
            None => std::thread::sleep(Duration::from_millis(1)),
        }
        if let Some(task) = engine.task() {
            // What the board would do at the port.
            let status = port.status();
            if task == Task::Initialise {
                port.resets.fetch_add(1, Ordering::Relaxed);
                let printed = port.printed.lock().expect("no test panicked with it").len();
                port.reset_at.lock().expect("no test panicked with it").push(printed);
            }
            if task == Task::PrinterStatus {
                port.asked.fetch_add(1, Ordering::Relaxed);
            }
            let id = port.maker.lock().ok().and_then(|maker| maker.map(device_id));
            engine.done(match (task, &id) {
                (Task::PrinterStatus, _) if is(&port.one_way) => Outcome::Answer(Answer::OneWay),
                (Task::PrinterStatus, _) => Outcome::Answer(Answer::Bytes(&status)),
                (Task::DeviceId, Some(id)) => Outcome::Answer(Answer::Bytes(id)),
                (Task::DeviceId, None) => Outcome::Answer(Answer::OneWay),
                _ => Outcome::Done,
            });
        }
        if port.press.swap(false, Ordering::Relaxed) {
            engine.press(Press::Short);
        }
        for _ in 0..50 {
            alone.poll(&mut engine, started.elapsed().as_micros() as u64);
            engine.work();
        }
        let (lines, fault) = match (is(&port.off), is(&port.paper)) {
            (true, _) => (Lines(0), Some(Fault::PowerOff)),
            (false, false) => (Lines::IDLE, Some(Fault::PaperOut)),
            (false, true) => (Lines::IDLE, None),
        };
        engine.port(lines, fault);
        *port.progress.lock().expect("no test panicked with it") = Some(engine.progress());
        let bytes = engine.output();
        let mut printed = port.printed.lock().expect("no test panicked with it");
        let waits = fault.is_some() || is(&port.busy) && !printed.is_empty();
        let count = if waits { 0 } else { bytes.len().min(port.rate.load(Ordering::Relaxed)) };
        printed.extend_from_slice(&bytes[..count]);
        drop(printed);
        if count > 0 {
            *port.last.lock().expect("no test panicked with it") = Some(Instant::now());
        }
        engine.consumed(count);
        if engine.usage_wanted() {
            engine.usage(Usage { fixed: 100_000, stack: 32_768, stack_used: 2_000, longest_us: 300 });
        }
        let mut frame = [0; MAX];
        loop {
            let length = engine.transmit(&mut frame);
            if length == 0 {
                break;
            }
            let mut rest = &frame[..length];
            while let (Some(open), false) = (&mut link, rest.is_empty()) {
                match open.send(rest) {
                    Ok(count) => rest = &rest[count..],
                    Err(_) => link = None,
                }
            }
        }
    }
    None
}

/// A device ID as IEEE 1284 has it: its length, itself counted, then keys and values.
fn device_id(maker: &str) -> Vec<u8> {
    let text = format!("MFG:{maker};MDL:Test;CLS:PRINTER;");
    [&[0, (text.len() + 2) as u8], text.as_bytes()].concat()
}
