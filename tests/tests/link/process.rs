//! Real processes, a real socket, a real journal: the sender is killed with SIGKILL again and again.

use crate::model::{Board, Planes, is_a_whole_job, seeded};
use bridge::engine::{Engine, Identity, Outcome as Done, Task};
use foilpress::observe::Silent;
use foilpress::send::journal::{Journal, NewJob};
use foilpress::send::query::{Query, QueryError, Reply};
use foilpress::send::session::{Outcome, Phase, Session};
use foilpress::send::status::Status;
use foilpress::send::transport::{Socket, Transport, pair};
use foilpress::send::{self, Address};
use foilpress::simulate::{Carousel, Lever, Printer, STATUS_LENGTH, Trouble};
use protocol::ink::Ink;
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::{Answer, Ask, JobKind, JobState, Lines};
use rand::RngExt;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Says in the child what it is to send.
const ROLE: &str = "FOILPRESS_TEST_SENDER";

/// A bridge on a local socket that prints at most `rate` bytes a millisecond.
fn bridge_at(path: &Path, rate: usize, printed: Arc<Mutex<Vec<u8>>>, stop: Arc<AtomicBool>) {
    let listener = UnixListener::bind(path).unwrap();
    listener.set_nonblocking(true).unwrap();
    let mut board = Board::new(8192, 4096);
    let mut engine = Engine::new(board.memory(), Identity { boot: 1, serial: 7, firmware: "test" });
    let mut reader = Reader::new();
    let mut link: Option<Socket<_>> = None;
    let mut buffer = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
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
            // What the board would do at the port.
            let status = status();
            engine.done(match task {
                Task::PrinterStatus => Done::Answer(Answer::Bytes(&status)),
                Task::DeviceId => Done::Answer(Answer::OneWay),
                _ => Done::Done,
            });
        }
        for _ in 0..50 {
            engine.work();
        }
        engine.port(Lines::IDLE, None);
        let bytes = engine.output();
        let count = bytes.len().min(rate);
        printed.lock().unwrap().extend_from_slice(&bytes[..count]);
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

/// The answer of a printer with white in it and its cover open.
fn status() -> [u8; STATUS_LENGTH] {
    let mut printer = Printer::new(Carousel::new(&[Ink::White.into()]).unwrap(), Lever::Manual);
    printer.strike(Trouble::CoverOpen);
    printer.status()
}

/// Goes on with the only job in the journal.
fn resume(folder: &Path, cancel: bool) -> Outcome {
    let journal = Journal::at(folder).unwrap();
    let entry = journal.entries().unwrap().remove(0);
    let mut job = journal.open(entry.record.job).unwrap();
    let address: Address = job.entry.to.parse().unwrap();
    let data = std::mem::take(&mut job.data);
    let mut session = Session::new(job.entry.record, &data);
    if cancel {
        session.cancel();
    }
    send::run(&mut session, &mut || address.open(), &mut |record| job.save(record), &mut |_| {}).unwrap()
}

/// The sending process; in an ordinary run of the tests there is nothing for it to do.
#[test]
fn sender() {
    if let Some(folder) = std::env::var_os(ROLE) {
        resume(Path::new(&folder), false);
    }
}

fn spawn(folder: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "process::sender"])
        .env(ROLE, folder)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

struct Bench {
    folder: tempfile::TempDir,
    printed: Arc<Mutex<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    bridge: Option<std::thread::JoinHandle<()>>,
    job: Vec<u8>,
}

impl Bench {
    fn new(seed: u64, rate: usize) -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("bridge");
        let (printed, stop) = (Arc::<Mutex<Vec<u8>>>::default(), Arc::<AtomicBool>::default());
        let bridge = {
            let (socket, printed, stop) = (socket.clone(), printed.clone(), stop.clone());
            std::thread::spawn(move || bridge_at(&socket, rate, printed, stop))
        };
        while !socket.exists() {
            std::thread::sleep(Duration::from_millis(1));
        }
        // The largest of some random jobs.
        let mut random = seeded(seed);
        let job = (0..20).map(|_| Planes::random(&mut random).printed()).max_by_key(Vec::len).unwrap();
        let checked = send::check(&job, &Silent).unwrap();
        let journal = Journal::at(&folder.path().join("jobs")).unwrap();
        journal
            .queue(NewJob {
                name: "leaf",
                to: Address::Unix(socket).to_string(),
                kind: JobKind::Raw,
                data: &job,
                port_bytes: job.len() as u64,
                passes: checked.passes,
            })
            .unwrap();
        Bench { folder, printed, stop, bridge: Some(bridge), job }
    }

    fn jobs(&self) -> std::path::PathBuf {
        self.folder.path().join("jobs")
    }

    fn printed(&self) -> Vec<u8> {
        self.printed.lock().unwrap().clone()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(bridge) = self.bridge.take() {
            let _ = bridge.join();
        }
    }
}

#[test]
fn a_sender_that_is_killed_again_and_again_costs_nothing() {
    let bench = Bench::new(5, 60);
    let mut random = seeded(6);
    let mut kills = 0;
    while bench.printed().len() < bench.job.len() && kills < 12 {
        let mut child = spawn(&bench.jobs());
        std::thread::sleep(Duration::from_millis(random.random_range(5..250)));
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
    }
    let over = Journal::at(&bench.jobs()).unwrap().entries().unwrap()[0].record.phase;
    if !matches!(over, Phase::Ended(_)) {
        assert_eq!(resume(&bench.jobs(), false), Outcome::Printed);
    }
    println!("{kills} kills over {} bytes", bench.job.len());
    assert!(kills > 2);
    assert!(bench.printed() == bench.job, "other bytes at the port");
    let entry = Journal::at(&bench.jobs()).unwrap().entries().unwrap().remove(0);
    assert_eq!(entry.record.phase, Phase::Ended(Outcome::Printed));
}

#[test]
fn another_process_cancels_what_a_killed_one_has_begun() {
    let bench = Bench::new(8, 40);
    let mut child = spawn(&bench.jobs());
    while bench.printed().is_empty() {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(resume(&bench.jobs(), true), Outcome::Cancelled);
    let printed = bench.printed();
    assert!(printed.len() < bench.job.len() && is_a_whole_job(&printed));
}

const PATIENCE: Duration = Duration::from_secs(20);

fn address(bench: &Bench) -> Address {
    Journal::at(&bench.jobs()).unwrap().entries().unwrap()[0].to.parse().unwrap()
}

#[test]
fn between_jobs_the_printer_itself_is_asked() {
    let bench = Bench::new(1, 100);
    let mut link = address(&bench).open().unwrap();
    let mut query = Query::new(&mut *link, PATIENCE).unwrap();
    assert_eq!((query.bridge().serial, query.bridge().firmware.as_str()), (7, "test"));
    assert_eq!(query.progress().state, JobState::None);
    assert_eq!(query.lines(PATIENCE).unwrap(), (Lines::IDLE, None));
    assert_eq!(query.printer(Ask::DeviceId, PATIENCE).unwrap(), Reply::OneWay);
    let Reply::Bytes(bytes) = query.printer(Ask::Printer, PATIENCE).unwrap() else { panic!("no answer") };
    let status = Status::read(&bytes).unwrap();
    assert_eq!(status.errors, ["the cover is open; close it"]);
    assert_eq!(status.cassettes[0].ink, Some("white"));
}

#[test]
fn while_a_job_is_open_the_lines_are_told_and_the_printer_is_left_alone() {
    let bench = Bench::new(8, 40);
    let mut child = spawn(&bench.jobs());
    while bench.printed().is_empty() {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = bench.printed();
    let mut link = address(&bench).open().unwrap();
    let mut query = Query::new(&mut *link, PATIENCE).unwrap();
    assert_eq!(query.printer(Ask::Printer, PATIENCE).unwrap(), Reply::NotNow);
    assert_eq!(query.lines(PATIENCE).unwrap(), (Lines::IDLE, None));
    drop(link);
    assert_eq!(resume(&bench.jobs(), false), Outcome::Printed);
    assert!(bench.job.starts_with(&before) && bench.printed() == bench.job);
}

#[test]
fn silence_and_rubbish_are_no_bridge() {
    let (mut here, mut there) = pair();
    there.send(b"login: \0\x03abc\0").unwrap();
    let answer = Query::new(&mut here, Duration::from_millis(300)).map(|_| ());
    assert!(matches!(answer, Err(QueryError::NoAnswer)));
    drop(there);
    let answer = Query::new(&mut here, Duration::from_millis(300)).map(|_| ());
    assert!(matches!(answer, Err(QueryError::Link(_))));
}
