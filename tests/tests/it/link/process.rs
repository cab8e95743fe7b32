//! Real processes, a real socket, a real journal: the sender is killed with SIGKILL again and again.

use device::connection::Address;
use device::connection::transport::{Transport, pair};
use device::encodings::{self, streams};
use device::questions::query::{Query, QueryError, Reply};
use device::questions::status::Status;
use device::transit;
use device::transit::journal::{Journal, NewJob};
use device::transit::session::{Outcome, Phase, Session};
use foilpress_tests::served::{Bridge, Port};
use model::{Planes, is_a_whole_job, seeded};
use observe::Silent;
use press::job::stream::write_job;
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::link::message::{Ask, JobKind, JobState, Lines};
use protocol::paper::Paper;
use protocol::rgl::Page;
use rand::RngExt;
use sheet::Plane;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use testing::program::path as program;

/// Says in the child what it is to send.
const ROLE: &str = "FOILPRESS_TEST_SENDER";

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
    transit::run(&mut session, &mut || address.open(), &mut |record| job.save(record), &mut |_| {}).unwrap()
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
        .args(["--exact", "link::process::sender"])
        .env(ROLE, folder)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

/// The largest of some.
pub fn random_job(seed: u64) -> Vec<u8> {
    let mut random = seeded(seed);
    (0..20).map(|_| Planes::random(&mut random).printed()).max_by_key(Vec::len).unwrap()
}

/// A bridge, and a folder with a journal.
pub struct Bench {
    folder: tempfile::TempDir,
    pub bridge: Bridge,
    pub job: Vec<u8>,
}

impl Bench {
    /// A random job, and a printer that takes so many bytes a millisecond.
    pub fn new(seed: u64, rate: usize) -> Bench {
        Bench::with(random_job(seed), Port::new(&[Ink::White], rate))
    }

    fn with(job: Vec<u8>, port: Port) -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let bridge = Bridge::on_unix(&folder.path().join("bridge"), port).unwrap();
        Bench { folder, bridge, job }
    }

    /// Puts the job into the journal.
    fn queue(self, kind: JobKind) -> Bench {
        let checked = encodings::check(&self.job, &Silent).unwrap();
        let streams = streams::of_bytes(&self.job, &Silent).unwrap();
        Journal::at(&self.jobs())
            .unwrap()
            .queue(NewJob {
                name: "leaf",
                to: self.address().to_string(),
                kind,
                data: if kind == JobKind::Raw { &self.job } else { &streams },
                port_bytes: self.job.len() as u64,
                passes: checked.passes,
            })
            .unwrap();
        self
    }

    fn jobs(&self) -> PathBuf {
        self.folder.path().join("jobs")
    }

    pub fn address(&self) -> Address {
        Address::Unix(self.folder.path().join("bridge"))
    }

    pub fn printed(&self) -> Vec<u8> {
        self.bridge.printed()
    }

    pub fn until_it_prints(&self) {
        while self.printed().is_empty() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// A sender that is killed once something has been printed; the printer is busy from then on.
    fn begun(&self) {
        self.keep_busy(true);
        let mut child = spawn(&self.jobs());
        self.until_it_prints();
        child.kill().unwrap();
        child.wait().unwrap();
    }

    pub fn keep_busy(&self, busy: bool) {
        self.bridge.port.busy.store(busy, Ordering::Relaxed);
    }

    /// The program itself, with the job in a file beside the journal.
    fn program(&self, args: &str) -> Command {
        std::fs::write(self.folder.path().join("job.rgl"), &self.job).unwrap();
        let mut command = Command::new(program());
        command
            .args(args.replace("BRIDGE", &self.address().to_string()).split_whitespace())
            .current_dir(self.folder.path())
            .env("FOILPRESS_JOBS", self.jobs())
            .env("FOILPRESS_PRINTERS", self.folder.path().join("printers"))
            .env("FOILPRESS_CONFIG", self.folder.path().join("config"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
    }

    /// Runs with this typed; exit code and everything that was said.
    pub fn answered(&self, args: &str, typed: &str) -> (Option<i32>, String) {
        let mut command = self.program(args);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(typed.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        (output.status.code(), said)
    }

    /// How many whole sheets the printer has taken; nothing else may have come.
    pub fn sheets(&self) -> usize {
        let printed = self.printed();
        assert!(printed.chunks(self.job.len()).all(|sheet| sheet == self.job), "other bytes at the port");
        printed.len() / self.job.len()
    }

    pub fn says(&self, code: i32, args: &str) -> String {
        let output = self.program(args).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        said
    }
}

#[test]
fn the_program_sends_pass_streams_and_waits_for_the_sheet() {
    let bench = Bench::new(8, 100);
    bench.bridge.port.open_cover.store(true, Ordering::Relaxed);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let mut heard = |word: &str| {
        assert!(lines.any(|line| line.contains(word)), "never {word:?}");
    };
    heard("as pass streams, 1/");
    heard("the printer has taken all");
    heard("the cover is open");
    bench.bridge.port.open_cover.store(false, Ordering::Relaxed);
    heard("the sheet is out");
    assert!(child.wait().unwrap().success());
    assert!(bench.printed() == bench.job, "other bytes at the port");
    let entry = Journal::at(&bench.jobs()).unwrap().entries().unwrap().remove(0);
    assert_eq!(entry.record.kind, JobKind::Streams);
    assert!((entry.record.length as usize) < bench.job.len() / 2);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sheet_is_out_when_the_printer_was_seen_printing_and_has_ended() {
    let bench = Bench::new(8, 1000);
    // It says idle where it is asked first, prints where it is asked next, and is idle again.
    bench.bridge.port.lag.store(3600, Ordering::Relaxed);
    let start = Instant::now();
    let said = bench.says(0, "send job.rgl --to BRIDGE");
    assert!(said.contains("the sheet is out"), "{said}");
    assert!(start.elapsed() >= Duration::from_millis(4600), "before it was: {said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_bridge_without_memory_for_the_page_gets_the_job_as_it_is() {
    let bench = Bench::with(random_job(8), Port::new(&[Ink::White], 1000).with_band(100));
    let said = bench.says(0, "send job.rgl --to BRIDGE");
    assert!(said.contains("byte for byte") && said.contains("the sheet is out"), "{said}");
    assert!(bench.printed() == bench.job, "other bytes at the port");
}

#[test]
fn after_a_bridge_has_forgotten_nothing_is_sent_before_the_printer_was_reset() {
    let bench = Bench::new(8, 100);
    bench.keep_busy(true);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    bench.until_it_prints();
    bench.bridge.port.forget.store(true, Ordering::Relaxed);
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(said.contains("the sheet is lost") && said.contains("Take out the sheet"), "{said}");
    let printed = bench.printed();
    assert!(printed.len() < bench.job.len() && bench.job.starts_with(&printed), "printed twice");
    let said = bench.says(1, "send job.rgl --to BRIDGE");
    assert!(said.contains("not sent") && said.contains("bridge reset --to unix:"), "{said}");
    assert_eq!(bench.printed(), printed, "something was sent all the same");
    bench.says(0, "bridge reset --to BRIDGE");
    assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 1);
    bench.keep_busy(false);
    bench.says(0, "send job.rgl --to BRIDGE");
    assert!(bench.printed()[printed.len()..] == bench.job, "other bytes at the port");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn pulled_data_lines_cost_nothing_and_a_pulled_supply_costs_the_sheet_and_says_so() {
    for all in [false, true] {
        let bench = Bench::new(8, 100);
        bench.keep_busy(true);
        let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
        bench.until_it_prints();
        if all {
            bench.bridge.strike(|port| &port.forget);
        }
        bench.bridge.strike(|port| &port.cut);
        bench.keep_busy(false);
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        let code = child.wait().unwrap().code();
        let printed = bench.printed();
        if all {
            assert!(code == Some(1) && said.contains("the sheet is lost"), "{said}");
            assert!(printed.len() < bench.job.len() && bench.job.starts_with(&printed), "printed twice");
        } else {
            assert!(code == Some(0) && printed == bench.job, "{said}");
        }
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_job_whose_folder_somebody_removes_is_told_as_lost_and_can_be_ended() {
    let bench = Bench::new(8, 100);
    bench.keep_busy(true);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    bench.until_it_prints();
    let number = Journal::at(&bench.jobs()).unwrap().entries().unwrap()[0].record.job;
    std::fs::remove_dir_all(bench.jobs()).unwrap();
    bench.keep_busy(false);
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "{said}");
    assert!(said.contains("is lost: somebody has removed") && !said.contains("is kept"), "{said}");
    assert!(said.contains(&format!("foilpress cancel {number:08x} --to unix:")), "{said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_printer_switched_off_in_a_job_costs_the_sheet_and_is_reset_before_the_next_one() {
    let bench = Bench::new(8, 100);
    bench.keep_busy(true);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    bench.until_it_prints();
    bench.bridge.port.off.store(true, Ordering::Relaxed);
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(said.contains("the sheet is lost") && said.contains("switched off"), "{said}");
    let printed = bench.printed();
    assert!(printed.len() < bench.job.len() && bench.job.starts_with(&printed), "printed twice");
    // The next one is queued while it is off, and waits.
    bench.keep_busy(false);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("+5 V absent")));
    assert_eq!(bench.printed(), printed, "bytes for a printer that is off");
    assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 0);
    bench.bridge.port.off.store(false, Ordering::Relaxed);
    let rest: Vec<String> = lines.collect();
    assert!(child.wait().unwrap().success(), "{rest:?}");
    assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 1);
    assert!(bench.printed()[printed.len()..] == bench.job, "other bytes at the port");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_reset_while_a_job_is_open_is_asked_about_first() {
    let bench = Bench::new(8, 20).queue(JobKind::Streams);
    bench.begun();
    let said = bench.says(1, "bridge reset --to BRIDGE");
    assert!(said.contains("printing job") && said.contains("--yes"), "{said}");
    bench.keep_busy(false);
    assert_eq!(resume(&bench.jobs(), false), Outcome::Printed);
    assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 0);
    assert!(bench.printed() == bench.job, "other bytes at the port");
}

/// A job at the bridge that no journal knows: its sender and all it had on disk are gone.
fn orphan() -> (Bench, u32) {
    let bench = Bench::new(8, 20).queue(JobKind::Streams);
    bench.begun();
    let number = Journal::at(&bench.jobs()).unwrap().entries().unwrap()[0].record.job;
    std::fs::remove_dir_all(bench.jobs()).unwrap();
    let _ = std::fs::remove_dir_all(bench.folder.path().join("printers"));
    (bench, number)
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn an_orphan_is_cancelled_after_a_question_by_its_number_or_as_what_the_bridge_has_open() {
    for named in [false, true] {
        let (bench, number) = orphan();
        let job = if named { format!("{number:08x} ") } else { String::new() };
        let said = bench.says(1, &format!("cancel {job}--to BRIDGE"));
        assert!(said.contains("not in this user's journal") && said.contains("--yes"), "{said}");
        let said = bench.says(1, &format!("cancel {:08x} --to BRIDGE --yes", number ^ 1));
        assert!(said.contains("does not have this job"), "{said}");
        bench.keep_busy(false);
        let (code, said) = bench.answered(&format!("cancel {job}--to BRIDGE --yes"), "");
        assert!(code == Some(0) && said.contains(&format!("job {number:08x} was cancelled")), "{said}");
        let printed = bench.printed();
        assert!(printed.len() < bench.job.len() && is_a_whole_job(&printed), "{} bytes", printed.len());
        bench.says(0, "send job.rgl --to BRIDGE");
        assert!(bench.printed()[printed.len()..] == bench.job, "other bytes at the port");
        assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 0);
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn an_orphan_at_a_printer_that_takes_nothing_more_is_given_up_by_a_reset() {
    for restarted in [false, true] {
        let (bench, number) = orphan();
        if restarted {
            // Nobody has the data any more.
            bench.bridge.strike(|port| &port.restart);
            let said = bench.says(1, "cancel --to BRIDGE --yes");
            assert!(said.contains("bridge reset --to unix:"), "{said}");
        }
        let (code, said) = bench.answered("bridge reset --to BRIDGE --yes", "");
        assert!(code == Some(0) && said.contains(&format!("job {number:08x} is given up")), "{said}");
        assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 1);
        let printed = bench.printed();
        bench.keep_busy(false);
        bench.says(0, "send job.rgl --to BRIDGE");
        assert!(bench.printed()[printed.len()..] == bench.job, "other bytes at the port");
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sheet_that_the_bridge_finished_alone_is_told_behind_others_and_a_restart() {
    for restarted in [false, true] {
        let bench = Bench::new(8, 100).queue(JobKind::Streams);
        bench.begun();
        // All of it is with the bridge, or the next sender would find it busy.
        bench.keep_busy(false);
        let start = std::time::Instant::now();
        while bench.printed().len() < bench.job.len() && start.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(20));
        }
        if bench.printed().len() < bench.job.len() {
            assert_eq!(resume(&bench.jobs(), false), Outcome::Printed);
        }
        // Another user, with a journal of their own, prints at the same bridge.
        let mut other = bench.program("send job.rgl --to BRIDGE");
        let other = other.env("FOILPRESS_JOBS", bench.folder.path().join("others")).output().unwrap();
        assert!(other.status.success(), "{}", String::from_utf8_lossy(&other.stderr));
        if restarted {
            bench.bridge.strike(|port| &port.restart);
        }
        let entry = Journal::at(&bench.jobs()).unwrap().entries().unwrap().remove(0);
        if !matches!(entry.record.phase, Phase::Ended(_)) {
            let said = bench.says(0, "resume");
            assert!(said.contains("the printer has taken all"), "{said}");
        }
        let entry = Journal::at(&bench.jobs()).unwrap().entries().unwrap().remove(0);
        assert_eq!(entry.record.phase, Phase::Ended(Outcome::Printed));
        assert_eq!(entry.record.printed as usize, bench.job.len());
        // Nothing is owed, and nothing was printed twice.
        bench.says(0, "send job.rgl --to BRIDGE");
        assert_eq!((bench.sheets(), bench.bridge.port.resets.load(Ordering::Relaxed)), (3, 0));
        let (_, status) = bench.answered("bridge status --to BRIDGE", "");
        assert!(status.contains(" printed, ") || status.matches(" printed").count() >= 2, "{status}");
    }
}

#[test]
fn a_printer_is_asked_only_where_it_can_do_no_harm() {
    let asked = |bench: &Bench| bench.bridge.port.asked.load(Ordering::Relaxed);
    // A bridge that has just got its supply, and nothing noted: the computer knows that its printer holds no part of a job.
    let bench = Bench::new(8, 100);
    let (_, said) = bench.answered("bridge status --no-negotiate --to BRIDGE", "");
    assert!(said.contains("printer: not asked\n") && asked(&bench) == 0, "{said}");
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("white") && asked(&bench) == 1, "{said}");
    assert!(said.contains("KiB of stack used"), "{said}");
    // In the middle of a row the bridge loses its memory: the question would be row data.
    bench.keep_busy(true);
    let mut child = bench.program("send job.rgl --to BRIDGE").spawn().unwrap();
    bench.until_it_prints();
    child.kill().unwrap();
    child.wait().unwrap();
    bench.bridge.strike(|port| &port.forget);
    let before = asked(&bench);
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("may hold part of job"), "{said}");
    assert_eq!(asked(&bench), before);
    bench.says(0, "bridge reset --to BRIDGE");
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("white") && asked(&bench) == before + 1, "{said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sender_that_is_killed_again_and_again_costs_nothing() {
    killed_again_and_again(JobKind::Raw);
    killed_again_and_again(JobKind::Streams);
}

fn killed_again_and_again(kind: JobKind) {
    let bench = Bench::new(5, 30).queue(kind);
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
    println!("{kills} kills over {} bytes of {kind:?}", bench.job.len());
    assert!(kills > 2);
    assert!(bench.printed() == bench.job, "other bytes at the port");
    let entry = Journal::at(&bench.jobs()).unwrap().entries().unwrap().remove(0);
    assert_eq!(entry.record.phase, Phase::Ended(Outcome::Printed));
}

#[test]
fn another_process_cancels_what_a_killed_one_has_begun() {
    let bench = Bench::new(8, 20).queue(JobKind::Streams);
    bench.begun();
    bench.keep_busy(false);
    assert_eq!(resume(&bench.jobs(), true), Outcome::Cancelled);
    let printed = bench.printed();
    assert!(printed.len() < bench.job.len() && is_a_whole_job(&printed));
}

const PATIENCE: Duration = Duration::from_secs(20);

#[test]
fn between_jobs_the_printer_itself_is_asked() {
    let bench = Bench::new(1, 100);
    bench.bridge.port.open_cover.store(true, Ordering::Relaxed);
    let mut link = bench.address().open().unwrap();
    let mut query = Query::new(&mut *link, PATIENCE).unwrap();
    assert_eq!((query.bridge().serial, query.bridge().firmware.as_str()), (7, "test"));
    assert_eq!(query.progress().state, JobState::None);
    assert_eq!(query.lines(PATIENCE).unwrap(), (Lines::IDLE, None));
    assert_eq!(query.printer(Ask::DeviceId, PATIENCE).unwrap(), Reply::OneWay);
    let Reply::Bytes(bytes) = query.printer(Ask::Printer, PATIENCE).unwrap() else { panic!("no answer") };
    let status = Status::read(&bytes).unwrap();
    assert_eq!(status.errors, ["the cover is open; close it"]);
    assert_eq!(status.cartridges[0].ink, Some("white"));
}

#[test]
fn while_a_job_is_open_the_lines_are_told_and_the_printer_is_left_alone() {
    let bench = Bench::new(8, 20).queue(JobKind::Streams);
    bench.begun();
    let before = bench.printed();
    let mut link = bench.address().open().unwrap();
    let mut query = Query::new(&mut *link, PATIENCE).unwrap();
    assert_eq!(query.printer(Ask::Printer, PATIENCE).unwrap(), Reply::NotNow);
    assert_eq!(query.lines(PATIENCE).unwrap(), (Lines::IDLE, None));
    drop(link);
    bench.keep_busy(false);
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

/// White and cyan, at a printer that has the cyan cartridge and no other.
fn two_passes() -> Bench {
    let plane = Plane { width: 64, length: 20, stride: 8, bits: vec![0x5a; 160] };
    let passes = [Ink::White, Ink::Cyan].map(|ink| Pass { ink, plane: plane.clone() });
    let page = Page::plain(Paper::Custom { width: 64, length: 20 });
    let mut job = Vec::new();
    write_job(page, None, &passes, &mut job, &Silent).unwrap();
    Bench::with(job, Port::new(&[Ink::Cyan], usize::MAX))
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn copies_are_printed_one_by_one_and_what_is_not_loaded_is_named_first() {
    let bench = two_passes();
    let (code, said) = bench.answered("send job.rgl --to BRIDGE --copies 2", "\n");
    assert_eq!((code, bench.sheets()), (Some(0), 2), "{said}");
    assert!(said.contains("Not in the printer: white (MDC-SCWH, barcode 16)."), "{said}");
    assert!(said.contains("Sheet 1 of 2 is sent"), "{said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_copy_nobody_pressed_enter_for_waits_on_disk_and_is_counted_when_it_is_printed() {
    let bench = two_passes();
    let (code, said) = bench.answered("send job.rgl --to BRIDGE --copies 3", "");
    assert_eq!((code, bench.sheets()), (Some(1), 1), "{said}");
    assert!(said.contains("1 of 3 sheets are sent"), "{said}");
    let passes = |count: usize| {
        let (_, said) = bench.answered("ledger", "");
        let word = if count == 1 { "1 pass".to_owned() } else { format!("{count} passes") };
        assert!(
            said.lines().any(|line| line.starts_with("white") && line.contains(&word)),
            "{count}: {said}"
        );
    };
    passes(1);
    for sheet in 2..=3 {
        let (code, said) = bench.answered("resume", "");
        assert_eq!((code, bench.sheets()), (Some(0), sheet), "{said}");
        passes(sheet);
    }
    assert!(bench.answered("resume", "").1.contains("no job waits"));
}
