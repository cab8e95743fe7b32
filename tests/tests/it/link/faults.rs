//! Faults against callers: what each user sees, and what the printer gets, whoever has the job sent.
//!
//! Every cell is a story with the program itself as processes, a bridge on a socket and a printer behind it. It is told in
//! steps; each says how the run ended and what had crossed the printer's port by then:
//!
//! | word | the user sees |
//! |---|---|
//! | sent | the job was sent whole |
//! | lost | the sheet is lost |
//! | held | the queue holds the job until it is released |
//! | refused | nothing is sent before the printer was reset |
//! | busy | the bridge has another job; this one is kept |
//! | killed | the process died by SIGKILL |
//! | cancelled | the sheet was ended early |
//!
//! | at the port | |
//! |---|---|
//! | 0 | nothing |
//! | 1 | one whole job, byte for byte |
//! | c | a shorter job, whole to the printer |
//! | ½ | the beginning of a job |
//! | R | a reset |
//! | TEXT | anything else, which the printer would print as text |
//!
//! After the fault is mended the user goes on: with the next job, after a SIGKILL with the same one, after `refused` with
//! `foilpress bridge reset`, after `held` by releasing the job; until a job was sent. `½` is then always followed by `R`.
//! Where `|` stands, a quick bridge has ended the first job before the second user comes, and a slow one has not; or it has
//! reset a printer that was switched on again before the first story was told.

use super::process::random_job;
use device::transit::journal::{Journal, NewJob};
use foilpress_tests::served::{Bridge, Port};
use observe::Silent;
use press::inspect::{inspect, sheets};
use protocol::ink::Ink;
use protocol::link::message::{JobKind, JobState};
use std::fs::{self, File};
use std::os::unix::fs::{PermissionsExt as _, chown};
use std::os::unix::process::CommandExt as _;
use std::panic::catch_unwind;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use testing::program::{path as program, small_document};

/// Who has a job sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Caller {
    /// `foilpress send`.
    Send,
    /// `foilpress print --to`.
    Print,
    /// `foilpress resume`, of a job that waits on disk.
    Resume,
    /// The print system.
    Queue,
    /// The fault meets one user's `send`; it is another user who goes on, at the same bridge.
    TwoUsers,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fault {
    BridgeForgets,
    RestartBetweenSheets,
    KilledBeforeTheFirstByte,
    KilledInARow,
    KilledAtTheEnd,
    KilledAndForgotten,
    LinkLostAndBack,
    PaperOut,
    SwitchedOff,
    Cancelled,
    ResetOwedByAnother,
    Garbage,
}

use Caller::{Print, Queue, Resume, Send, TwoUsers};
use Fault::*;

const CALLERS: [Caller; 5] = [Send, Print, Resume, Queue, TwoUsers];

#[rustfmt::skip]
const TABLE: [(Fault, [&str; 5]); 12] = [
    //                          send                               print --to                         resume                             queue                          two users
    (BridgeForgets,            ["lost ½, refused ½, sent ½R1",  "lost ½, refused ½, sent ½R1",  "lost ½, refused ½, sent ½R1",  "held ½, held ½, sent ½R1",    "lost ½, refused ½, sent ½R1"]),
    (RestartBetweenSheets,     ["sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",             "sent 1, sent 11"]),
    (KilledBeforeTheFirstByte, ["killed 0, sent 1",                "killed 0, sent 1",                "killed 0, sent 1",                "killed 0, sent 1",            "killed 0, busy 0, sent 11 | killed 0, sent 11"]),
    (KilledInARow,             ["killed ½, sent 1",                "killed ½, sent 1",                "killed ½, sent 1",                "killed ½, sent 1",            "killed ½, busy ½, sent 11 | killed ½, sent 11"]),
    (KilledAtTheEnd,           ["killed 1, sent 1",                "killed 1, sent 1",                "killed 1, sent 1",                "killed 1, sent 1",            "killed 1, sent 11"]),
    (KilledAndForgotten,       ["killed ½, lost ½, refused ½, sent ½R1", "killed ½, lost ½, refused ½, sent ½R1", "killed ½, lost ½, refused ½, sent ½R1", "killed ½, held ½, sent ½R1", "killed ½, refused ½, sent ½R1"]),
    (LinkLostAndBack,          ["sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",             "sent 1, sent 11"]),
    (PaperOut,                 ["sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",             "sent 1, sent 11"]),
    (SwitchedOff,              ["lost ½, sent ½R1 | lost ½R, sent ½R1", "lost ½, sent ½R1 | lost ½R, sent ½R1", "lost ½, sent ½R1 | lost ½R, sent ½R1", "held ½, sent ½R1 | held ½R, sent ½R1", "lost ½, sent ½R1 | lost ½R, sent ½R1"]),
    (Cancelled,                ["cancelled c, sent c1",            "cancelled c, sent c1",            "cancelled c, sent c1",            "cancelled c, sent c1",        "cancelled c, sent c1"]),
    (ResetOwedByAnother,       ["refused 0, sent R1",              "refused 0, sent R1",              "refused 0, sent R1",              "held 0, held 0, sent R1",     "refused 0, refused 0, sent R1"]),
    (Garbage,                  ["sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",                 "sent 1, sent 11",             "sent 1, sent 11"]),
];

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn every_caller_meets_every_fault_and_the_printer_never_gets_half_a_job_and_then_another() {
    // Built before the clock of any run starts.
    program();
    let stories: Vec<(Fault, Caller, &str, String)> = std::thread::scope(|scope| {
        let rows: Vec<_> = TABLE
            .iter()
            .map(|(fault, cells)| {
                scope.spawn(move || {
                    let tell = |(&caller, &cell)| {
                        // A story that breaks off hides no other.
                        let told = catch_unwind(|| Bench::new(caller).story(*fault));
                        (*fault, caller, cell, told.unwrap_or_else(|_| "broke off".to_owned()))
                    };
                    CALLERS.iter().zip(cells).map(tell).collect::<Vec<_>>()
                })
            })
            .collect();
        rows.into_iter().flat_map(|row| row.join().expect("a story that ends")).collect()
    });
    let mut wrong = Vec::new();
    for (fault, caller, expected, told) in stories {
        println!("{fault:?}, {caller:?}: {told}");
        if expected.split(" | ").all(|allowed| told != allowed) {
            wrong.push(format!("{fault:?}, {caller:?}: {told}; expected {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The user the second one of two is, where the tests may choose.
const NOBODY: u32 = 65534;

/// Enough for the slowest run on a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

struct Bench {
    folder: tempfile::TempDir,
    bridge: Bridge,
    caller: Caller,
    /// Users and jobs so far: what makes names differ.
    user: usize,
    jobs: usize,
    /// The number of the job under way, where it has one before it is sent.
    waiting: Option<u32>,
}

/// A process of the program.
struct Run {
    child: Child,
    log: PathBuf,
    killed: bool,
}

impl Bench {
    fn new(caller: Caller) -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        fs::create_dir(path("printers")).unwrap();
        fs::set_permissions(path("printers"), fs::Permissions::from_mode(0o1777)).unwrap();
        for user in ["user-0", "user-1"] {
            fs::create_dir(path(user)).unwrap();
        }
        // Only root may do so; otherwise both users are the same, with journals of their own.
        let _ = chown(path("user-1"), Some(NOBODY), None);
        fs::write(path("job.rgl"), random_job(8)).unwrap();
        small_document(&path("tile"));
        let port = Port::new(&[Ink::White], 700);
        port.one_way.store(true, Ordering::Relaxed);
        let bridge = Bridge::on_unix(&path("bridge"), port).unwrap();
        fs::set_permissions(path("bridge"), fs::Permissions::from_mode(0o777)).unwrap();
        Bench { folder, bridge, caller, user: 0, jobs: 0, waiting: None }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn to(&self) -> String {
        format!("unix:{}", self.path("bridge").display())
    }

    fn set(&self, flag: impl Fn(&Port) -> &AtomicBool, value: bool) {
        flag(&self.bridge.port).store(value, Ordering::Relaxed);
    }

    /// Starts the program with these arguments as the present user.
    fn start(&self, arguments: &[&str]) -> Run {
        let home = self.path(&format!("user-{}", self.user));
        let (file, log) = tempfile::NamedTempFile::new_in(self.folder.path()).unwrap().keep().unwrap();
        let mut command = Command::new(program());
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env("HOME", &home)
            .env("FOILPRESS_JOBS", home.join("jobs"))
            .env("FOILPRESS_CONFIG", home.join("config"))
            .env("FOILPRESS_PRINTERS", self.path("printers"))
            .env("DEVICE_URI", format!("foilpress:/unix{}", self.path("bridge").display()))
            .env("PRINTER", "Alps")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(file.try_clone().unwrap());
        if self.user == 1
            && fs::metadata("/proc/self").is_ok_and(|data| std::os::unix::fs::MetadataExt::uid(&data) == 0)
        {
            command.uid(NOBODY).gid(NOBODY);
        }
        let child = command.spawn().or_else(|_| {
            // A program in a folder of root's own, which nobody else may enter.
            let mut again = Command::new(program());
            again.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null()).stdout(Stdio::null());
            for (name, value) in command.get_envs() {
                again.env(name, value.unwrap_or_default());
            }
            again.stderr(file).spawn()
        });
        Run { child: child.unwrap(), log, killed: false }
    }

    /// Starts the next job, or with `again` the one before once more.
    fn send(&mut self, again: bool) -> Run {
        if !again {
            self.jobs += 1;
        }
        let to = self.to();
        match self.caller {
            Send | TwoUsers => self.start(&["send", "job.rgl", "--to", &to]),
            Print => {
                let place = ["--size", "12x9mm", "--paper", "postcard", "-o", "out.print"];
                let arguments = [&["print", "tile"], &place[..], &["--yes", "--to", &to]].concat();
                self.start(&arguments)
            }
            Resume => {
                if !again || self.waiting.is_none() {
                    self.waiting = Some(self.wait_on_disk());
                }
                self.resume()
            }
            Queue => {
                let identity = format!("job-uuid=urn:uuid:job-{}", self.jobs);
                self.start(&["cups-backend", "7", "me", "leaf", "1", &identity, "job.rgl"])
            }
        }
    }

    fn resume(&self) -> Run {
        match self.waiting {
            Some(number) => self.start(&["resume", &format!("{number:08x}")]),
            None => self.start(&["resume"]),
        }
    }

    /// Puts a job into the journal, as a `send` does that is interrupted right behind it.
    fn wait_on_disk(&self) -> u32 {
        let job = fs::read(self.path("job.rgl")).unwrap();
        let checked = device::encodings::check(&job, &Silent).unwrap();
        let streams = device::encodings::streams::of_bytes(&job, &Silent).unwrap();
        let journal = Journal::at(&self.path("user-0/jobs")).unwrap();
        let queued = journal.queue(NewJob {
            name: "leaf",
            to: self.to(),
            kind: JobKind::Streams,
            data: &streams,
            port_bytes: job.len() as u64,
            passes: checked.passes,
        });
        queued.unwrap().entry.record.job
    }

    /// The job of this caller, as it is to be at the port.
    fn job(&self) -> Vec<u8> {
        let place = if self.caller == Print { "out.print/job.rgl" } else { "job.rgl" };
        fs::read(self.path(place)).unwrap_or_default()
    }

    /// What has crossed the port, judged by the checker, which knows nothing of how it came there.
    fn port(&self) -> String {
        let (printed, job) = (self.bridge.printed(), self.job());
        let mut story = String::new();
        let (mut at, resets) = (0, self.bridge.port.reset_at.lock().unwrap().clone());
        for end in resets.iter().copied().chain([printed.len()]) {
            let part = &printed[at..end];
            for place in sheets(part).into_iter().filter(|place| !place.is_empty()) {
                let sheet = &part[place];
                let inspection = inspect(sheet, &Silent).inspection;
                story += match (inspection.error.is_none() && inspection.complete, sheet == job) {
                    (true, true) => "1",
                    (true, false) => "c",
                    (false, _) if job.starts_with(sheet) => "½",
                    (false, _) => " TEXT ",
                };
            }
            at = end;
            story += "R";
        }
        // The end of all is no reset.
        story.pop();
        if story.is_empty() { "0".into() } else { story }
    }

    fn until(&self, what: &str, run: &mut Run, is: impl Fn(&Bench, &Run) -> bool) {
        let start = Instant::now();
        while !is(self, run) {
            let ended = run.child.try_wait().unwrap();
            assert!(
                ended.is_none() && start.elapsed() < PATIENCE,
                "{what}: in vain for {:?}, {ended:?}: {}",
                self.caller,
                run.said()
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn until_it_prints(&self, run: &mut Run) {
        self.until("something printed", run, |bench, _| !bench.bridge.printed().is_empty());
    }

    /// The first run with the fault in it, mended at its end.
    fn meet(&mut self, fault: Fault) -> Run {
        match fault {
            RestartBetweenSheets => {}
            ResetOwedByAnother => {
                self.bridge.port.tear(0xdead_beef);
                self.bridge.strike(|port| &port.forget);
            }
            PaperOut | KilledBeforeTheFirstByte => self.set(|port| &port.paper, false),
            _ => self.set(|port| &port.busy, true),
        }
        let mut run = self.send(false);
        match fault {
            RestartBetweenSheets | ResetOwedByAnother => {}
            PaperOut | KilledBeforeTheFirstByte => {
                self.until("no paper", &mut run, |_, run| run.is_out_of_paper());
            }
            _ => self.until_it_prints(&mut run),
        }
        match fault {
            RestartBetweenSheets | ResetOwedByAnother => run.wait(),
            PaperOut => {}
            KilledBeforeTheFirstByte | KilledInARow => run.kill(),
            KilledAtTheEnd => {
                // The bridge takes all of a job this small, and finishes the sheet by itself.
                // The queue keeps a journal for each of its jobs elsewhere.
                let journal = Journal::at(&self.path("user-0/jobs")).unwrap();
                let all = journal.entries().unwrap().last().map_or_else(
                    || device::encodings::streams::of_bytes(&self.job(), &Silent).unwrap().len() as u32,
                    |entry| entry.record.length,
                );
                self.until("the bridge has all of it", &mut run, |bench, _| {
                    bench.bridge.port.progress().is_some_and(|progress| progress.accepted == all)
                });
                run.kill();
                self.set(|port| &port.busy, false);
                let start = Instant::now();
                while self.bridge.printed().len() < self.job().len() && start.elapsed() < PATIENCE {
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
            KilledAndForgotten => {
                run.kill();
                self.bridge.strike(|port| &port.forget);
            }
            BridgeForgets => {
                self.set(|port| &port.forget, true);
                run.wait();
            }
            LinkLostAndBack => self.set(|port| &port.cut, true),
            Garbage => self.set(|port| &port.garbage, true),
            SwitchedOff => {
                self.set(|port| &port.off, true);
                run.wait();
            }
            Cancelled => run = self.cancel(run),
        }
        if fault == RestartBetweenSheets {
            self.bridge.strike(|port| &port.forget);
        }
        self.set(|port| &port.busy, false);
        self.set(|port| &port.off, false);
        self.set(|port| &port.paper, true);
        run.wait();
        run
    }

    /// Cancels a job in the middle of a pass, as this caller's users do.
    fn cancel(&self, mut run: Run) -> Run {
        if self.caller == Queue {
            let ended = Command::new("kill").args(["-TERM", &run.child.id().to_string()]).status();
            assert!(ended.unwrap().success());
        } else {
            run.kill();
            run = self.start(&["cancel"]);
        }
        // Before the printer goes on.
        self.until("the bridge hears of it", &mut run, |bench, _| {
            matches!(bench.bridge.state(), JobState::Cancelling | JobState::Cancelled)
        });
        run
    }

    fn story(&mut self, fault: Fault) -> String {
        let mut run = self.meet(fault);
        let mut steps = Vec::new();
        loop {
            let word = run.word(self.caller);
            steps.push(format!("{word} {}", self.port()));
            let first = steps.len() == 1;
            if first && self.caller == TwoUsers {
                self.user = 1;
            }
            if word == "sent" && !first || steps.len() > 5 {
                return steps.join(", ");
            }
            run = match (word, self.caller) {
                ("killed", Send | Print) => self.start(&["resume"]),
                ("killed", Resume) => self.resume(),
                ("killed", Queue) => self.send(true),
                // Also where nothing was sent for a reset that another user's job needs: the first thing both try is to send.
                ("refused", TwoUsers) if first => self.send(false),
                ("refused", _) => {
                    let mut reset = self.start(&["bridge", "reset", "--to", &self.to()]);
                    reset.wait();
                    assert!(reset.said().is_empty(), "{}", reset.said());
                    self.send(true)
                }
                // The next job, and only then is one released.
                ("held", _) => self.send(!first && fault != SwitchedOff),
                ("busy", _) => {
                    // The other one goes on with theirs, then this one.
                    self.user = 0;
                    let mut other = self.start(&["resume"]);
                    other.wait();
                    assert_eq!(other.word(Send), "sent", "{}", other.said());
                    self.user = 1;
                    self.start(&["resume"])
                }
                _ => self.send(false),
            };
            run.wait();
        }
    }
}

impl Run {
    fn said(&self) -> String {
        let mut text = Vec::new();
        let _ = File::open(&self.log).and_then(|mut file| std::io::Read::read_to_end(&mut file, &mut text));
        String::from_utf8_lossy(&text).into_owned()
    }

    /// Whether the user was told of the job that the paper is out. Before the job the same words say why the loaded cartridges
    /// are not known; then nothing is queued yet.
    fn is_out_of_paper(&self) -> bool {
        let said = self.said();
        said.lines().any(|line| line.contains("the printer is out of paper") && !line.contains("not known"))
    }

    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.killed = true;
        self.wait();
    }

    fn wait(&mut self) {
        let start = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            if start.elapsed() > PATIENCE {
                let _ = self.child.kill();
                panic!("it does not end: {}", self.said());
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// How it ended, as its user is told.
    fn word(&mut self, caller: Caller) -> &'static str {
        let (code, said) = (self.child.wait().unwrap().code(), self.said());
        let has = |text: &str| said.contains(text);
        match (caller, code) {
            _ if self.killed => "killed",
            (Queue, Some(0)) if has("PAGE: 1 1") => "sent",
            (Queue, Some(0)) if has("cancelled; the sheet comes out unfinished") => "cancelled",
            (Queue, Some(3)) if has("The job is held: ") && has("release it") => "held",
            (_, Some(0)) if has(": cancelled; the sheet comes out unfinished") => "cancelled",
            (Send | Print | Resume | TwoUsers, Some(0)) if has("the printer has taken all") => "sent",
            (_, Some(1)) if has("bridge reset --to unix:") && has("may hold part of job") => "refused",
            (_, Some(1)) if has("the sheet is lost") => "lost",
            (_, Some(1)) if has("is kept") && has("is printing another job") => "busy",
            _ => panic!("{caller:?} ended with {code:?}: {said}"),
        }
    }
}
