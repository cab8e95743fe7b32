//! Copies and the question for cassettes, with the program itself and the bridge's own engine on a socket.
#![cfg(unix)]

use std::fs;
use std::io::Write as _;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use bridge::engine::{Engine, Identity, Memory, Outcome, Task};
use foilpress::job::stream::write_job;
use foilpress::observe::Silent;
use foilpress::send::transport::{Socket, Transport};
use foilpress::separate::{Pass, Plane};
use foilpress::simulate::{Carousel, Lever, Printer};
use protocol::ink::Ink;
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::{Answer, Lines};
use protocol::paper::Paper;
use protocol::rgl::Page;
use tempfile::TempDir;

/// A bridge whose printer has the cyan cassette and no other, and takes whatever comes.
fn bridge_at(path: &Path, printed: &Mutex<Vec<u8>>, stop: &AtomicBool) {
    let listener = UnixListener::bind(path).unwrap();
    listener.set_nonblocking(true).unwrap();
    let (mut data, mut output, mut band) = (vec![0; 8192], vec![0; 4096], vec![0; 40_000]);
    let memory = Memory { data: &mut data, output: &mut output, band: &mut band };
    let mut engine = Engine::new(memory, Identity { boot: 1, serial: 7, firmware: "test" });
    let (mut reader, mut buffer) = (Reader::new(), [0; 4096]);
    let mut link: Option<Socket<_>> = None;
    let status = Printer::new(Carousel::new(&[Ink::Cyan.into()]).unwrap(), Lever::Auto).status();
    while !stop.load(Ordering::Relaxed) {
        if let Ok((socket, _)) = listener.accept() {
            socket.set_nonblocking(false).unwrap();
            engine.link_lost();
            reader.reset();
            link = Some(Socket::new(socket));
        }
        match link.as_mut().map(|link| link.receive(&mut buffer, Duration::from_millis(1))) {
            Some(Ok(count)) => engine.receive(&mut reader, &buffer[..count]),
            Some(Err(_)) => link = None,
            None => std::thread::sleep(Duration::from_millis(1)),
        }
        if let Some(task) = engine.task() {
            engine.done(match task {
                Task::PrinterStatus => Outcome::Answer(Answer::Bytes(&status)),
                Task::DeviceId => Outcome::Answer(Answer::OneWay),
                _ => Outcome::Done,
            });
        }
        for _ in 0..50 {
            engine.work();
        }
        engine.port(Lines::IDLE, None);
        let count = engine.output().len();
        printed.lock().unwrap().extend_from_slice(engine.output());
        engine.consumed(count);
        let mut frame = [0; MAX];
        loop {
            let length = engine.transmit(&mut frame);
            let mut rest = &frame[..length];
            while let (Some(open), false) = (&mut link, rest.is_empty()) {
                match open.send(rest) {
                    Ok(count) => rest = &rest[count..],
                    Err(_) => link = None,
                }
            }
            if length == 0 {
                break;
            }
        }
    }
}

struct Bench {
    folder: TempDir,
    job: Vec<u8>,
    printed: Arc<Mutex<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    bridge: Option<JoinHandle<()>>,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let plane = Plane { width: 64, length: 20, stride: 8, bits: vec![0x5a; 160] };
        let passes = [Ink::White, Ink::Cyan].map(|ink| Pass { ink, plane: plane.clone() });
        let mut job = Vec::new();
        write_job(Page::plain(Paper::Custom { width: 64, length: 20 }), None, &passes, &mut job, &Silent)
            .unwrap();
        fs::write(folder.path().join("job.rgl"), &job).unwrap();
        let (printed, stop) = (Arc::<Mutex<Vec<u8>>>::default(), Arc::<AtomicBool>::default());
        let socket: PathBuf = folder.path().join("bridge");
        let bridge = {
            let (printed, stop) = (printed.clone(), stop.clone());
            std::thread::spawn(move || bridge_at(&socket, &printed, &stop))
        };
        while !folder.path().join("bridge").exists() {
            std::thread::sleep(Duration::from_millis(1));
        }
        Bench { folder, job, printed, stop, bridge: Some(bridge) }
    }

    /// Exit code and everything that was said.
    fn run(&self, args: &str, answers: &str) -> (Option<i32>, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_foilpress"))
            .args(args.split_whitespace())
            .current_dir(self.folder.path())
            .env("FOILPRESS_JOBS", self.folder.path().join("jobs"))
            .env("FOILPRESS_CONFIG", self.folder.path().join("config"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(answers.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        (output.status.code(), said)
    }

    /// How many whole sheets the printer has taken; nothing else may have come.
    fn sheets(&self) -> usize {
        let printed = self.printed.lock().unwrap();
        assert!(printed.chunks(self.job.len()).all(|sheet| sheet == self.job));
        printed.len() / self.job.len()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.bridge.take().map(JoinHandle::join);
    }
}

#[test]
fn copies_are_printed_one_by_one_and_what_is_not_loaded_is_named_first() {
    let bench = Bench::new();
    let (code, said) = bench.run("send job.rgl --to unix:bridge --copies 2", "\n");
    assert_eq!((code, bench.sheets()), (Some(0), 2), "{said}");
    assert!(said.contains("Not in the printer: white (MDC-SCWH, barcode 16)."), "{said}");
    assert!(said.contains("Sheet 1 of 2 is sent"), "{said}");
}

#[test]
fn a_copy_nobody_pressed_enter_for_waits_on_disk_and_is_counted_when_it_is_printed() {
    let bench = Bench::new();
    let (code, said) = bench.run("send job.rgl --to unix:bridge --copies 3", "");
    assert_eq!((code, bench.sheets()), (Some(1), 1), "{said}");
    assert!(said.contains("1 of 3 sheets are sent"), "{said}");
    let passes = |count: usize| {
        let (_, said) = bench.run("ledger", "");
        let word = if count == 1 { "1 pass".to_owned() } else { format!("{count} passes") };
        assert!(
            said.lines().any(|line| line.starts_with("white") && line.contains(&word)),
            "{count}: {said}"
        );
    };
    passes(1);
    for sheet in 2..=3 {
        let (code, said) = bench.run("resume", "");
        assert_eq!((code, bench.sheets()), (Some(0), sheet), "{said}");
        passes(sheet);
    }
    assert!(bench.run("resume", "").1.contains("no job waits"));
}
