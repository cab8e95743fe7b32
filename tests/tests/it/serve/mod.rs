//! The server as a program: beside the other ways to print, and killed at every step.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::queue::server::{self, Server};
use crate::queue::{document, extent};
use foilpress_tests::served::{Bridge, Port};
use model::{is_a_whole_job, seeded};
use observe::Silent;
use press::inspect::{inspect, sheets};
use press::job::stream::write_job;
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use rand::{Rng, RngExt as _};
use sheet::Plane;
use testing::ipp;
use testing::program::Bench;

/// Longer than anything here takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// The program as a server.
pub(crate) struct Serving {
    child: Child,
    pub(crate) address: SocketAddr,
}

impl Serving {
    fn start(bench: &Bench, to: &str) -> Serving {
        Serving::of(bench.command(&format!("serve --listen 127.0.0.1:0 --to {to}")))
    }

    pub(crate) fn of(mut command: Command) -> Serving {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let said = BufReader::new(child.stdout.take().unwrap()).lines();
        // `ipp://127.0.0.1:40001/ipp/print/standard  ALPS MD-5500`
        let first =
            said.map(|line| line.unwrap()).find(|line| line.starts_with("ipp://")).expect("an address");
        let address = first["ipp://".len()..].split('/').next().unwrap().parse().unwrap();
        Serving { child, address }
    }

    /// As a crash would end it.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    fn release(&self, job: i32) {
        const RELEASE: u16 = 0x0d;
        let uri = format!("ipp://{}/ipp/print", self.address);
        let released = ipp::request(RELEASE, &uri, &[(0x21, "job-id", &job.to_be_bytes())], &[]);
        assert_eq!(ipp::ask(self.address, &released).unwrap().0, 0);
    }

    /// Says at the desk which sheet is in the printer.
    pub(crate) fn load(&self, size: &str) {
        let to = self.address;
        let load = format!("POST /desk/load?size={size}&kind=auto HTTP/1.1\r\nHost: {to}\r\n");
        assert_eq!(ipp::http(to, &load, b"").unwrap().0, 200);
    }

    pub(crate) fn wait_for(&self, job: i32) -> i32 {
        let start = Instant::now();
        loop {
            match ipp::state(self.address, job) {
                Ok(state) if state > 6 => return state,
                _ => assert!(start.elapsed() < PATIENCE, "job {job} does not end"),
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// A job of one small sheet, no two alike.
fn job(seed: u64) -> Vec<u8> {
    drawn(seed, 40)
}

/// A job of one sheet with so many rows of dots, no two alike.
fn drawn(seed: u64, rows: usize) -> Vec<u8> {
    let mut bits = vec![0; 100 * 400];
    seeded(seed).fill_bytes(&mut bits[..100 * rows]);
    let pass = Pass { ink: Ink::Black, plane: Plane { width: 800, length: 400, stride: 100, bits } };
    let mut bytes = Vec::new();
    let page = Page::plain(Paper::Custom { width: 800, length: 400 });
    write_job(page, None, &[pass], &mut bytes, &Silent).unwrap();
    bytes
}

/// A server that was killed while the printer had a part of a sheet; the bridge holds a part of its rest at most.
struct Interrupted {
    bench: Bench,
    bridge: Bridge,
    to: String,
    sheet: Vec<u8>,
    job: i32,
}

impl Interrupted {
    /// With `before` a job that came before and was held is released meanwhile.
    fn new(before: bool) -> Interrupted {
        let (bench, sheet) = (Bench::new(), drawn(2, 400));
        let port = Port::new(&[Ink::Black], 64);
        port.one_way.store(true, Ordering::Relaxed);
        port.busy.store(true, Ordering::Relaxed);
        let (bridge, address) = Bridge::on_tcp("127.0.0.1:0".parse().unwrap(), port).unwrap();
        let to = format!("tcp:{address} --jobs serve");
        let serving = Serving::start(&bench, &to);
        if before {
            let uri = format!("ipp://{}/ipp/print", serving.address);
            let held = [(0x44, "job-hold-until", &b"indefinite"[..])];
            let request = [ipp::request(ipp::PRINT, &uri, &[], &held), job(1)].concat();
            assert_eq!(ipp::ask(serving.address, &request).unwrap().0, 0);
        }
        let job = ipp::print(serving.address, "standard", "interrupted", &sheet).unwrap();
        let start = Instant::now();
        while bridge.printed().is_empty() {
            assert!(start.elapsed() < PATIENCE, "nothing is printed");
            std::thread::sleep(Duration::from_millis(20));
        }
        if before {
            serving.release(1);
        }
        serving.kill();
        bridge.port.busy.store(false, Ordering::Relaxed);
        Interrupted { bench, bridge, to, sheet, job }
    }

    fn again(&self) -> Serving {
        Serving::start(&self.bench, &self.to)
    }

    /// Changes the record of the job.
    fn set(&self, what: &str, to: serde_json::Value) {
        let record = self.bench.path(&format!("serve/jobs/{}/job.json", self.job));
        let mut kept: serde_json::Value = serde_json::from_slice(&fs::read(&record).unwrap()).unwrap();
        assert_eq!(kept["state"], "processing");
        kept[what] = to;
        fs::write(&record, kept.to_string()).unwrap();
    }

    /// Everything that was printed, sheet by sheet.
    fn sheets(&self) -> Vec<Vec<u8>> {
        let printed = self.bridge.printed();
        sheets(&printed).into_iter().map(|place| printed[place].to_vec()).collect()
    }
}

#[test]
fn after_a_restart_the_sheet_at_the_bridge_goes_on_before_an_earlier_job() {
    let interrupted = Interrupted::new(true);
    let serving = interrupted.again();
    assert_eq!((serving.wait_for(interrupted.job), serving.wait_for(1)), (9, 9));
    serving.kill();
    assert!(interrupted.sheets() == [interrupted.sheet.clone(), job(1)]);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_job_cancelled_before_a_restart_is_ended_at_the_bridge_first() {
    let interrupted = Interrupted::new(false);
    // As where the server was killed between the answer to the owner and its next word to the bridge.
    interrupted.set("cancel", true.into());
    let serving = interrupted.again();
    assert_eq!(serving.wait_for(interrupted.job), 7);
    let [cut] = &interrupted.sheets()[..] else { panic!("not one sheet") };
    assert!(is_a_whole_job(cut) && cut.len() < interrupted.sheet.len());
    let next = ipp::print(serving.address, "standard", "next", &job(3)).unwrap();
    assert_eq!(serving.wait_for(next), 9);
    serving.kill();
    assert!(interrupted.sheets()[1..] == [job(3)]);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sheet_whose_job_is_held_is_ended_for_no_other_job() {
    let interrupted = Interrupted::new(false);
    // As where the disk was full in the middle of the sheet.
    interrupted.set("state", "held".into());
    let serving = interrupted.again();
    let next = ipp::print(serving.address, "standard", "next", &job(3)).unwrap();
    // The printing thread looks for work as soon as a job is there; fifty answers later it would have begun
    // this one.
    for _ in 0..50 {
        assert_eq!(ipp::state(serving.address, next).unwrap(), 3);
    }
    serving.release(interrupted.job);
    assert_eq!((serving.wait_for(interrupted.job), serving.wait_for(next)), (9, 9));
    serving.kill();
    assert!(interrupted.sheets() == [interrupted.sheet.clone(), job(3)]);
}

/// One document through `layers`, through the filter of a print queue and through the server: the same bytes for the printer.
#[test]
fn three_ways_to_print_a_document_make_the_same_job() {
    let bench = Bench::new();
    let options = "--paper 101.6x152.4mm --white under --media film";
    bench.done(&format!("preset save placed {options}"));
    for (name, drawing) in [
        ("solid.pdf", "0 g 60 110 140 70 re f 0 1 1 rg 60 200 90 50 re f 1 1 0 rg 100 300 90 50 re f"),
        ("tones.pdf", "0 0.4 0.9 rg 60 110 140 70 re f 0.8 0.5 0.1 rg 90 120 40 200 re f"),
    ] {
        // A page of whole dots, printed where it has its drawing.
        fs::write(bench.path(name), document((288, 432), "", &[drawing])).unwrap();
        bench.done(&format!("layers {name} {options} --fit auto -q -o {name}.print"));
        let layers = fs::read(bench.path(&format!("{name}.print/job.rgl"))).unwrap();

        let dialog = "FoilpressWhite=Under FoilpressCurl=Off";
        let filter =
            bench.command_of(["cups-filter", "1", "me", "title", "1", dialog, name]).output().unwrap();
        assert!(filter.status.success(), "{}", String::from_utf8_lossy(&filter.stderr));

        let serving = Serving::start(&bench, &format!("file:{name}.sheets"));
        serving.load("custom_x_101.6x152.4mm");
        let job = ipp::print(serving.address, "placed", name, &fs::read(bench.path(name)).unwrap()).unwrap();
        assert_eq!(serving.wait_for(job), 9);
        serving.kill();
        let kept: Vec<_> = fs::read_dir(bench.path(&format!("{name}.sheets"))).unwrap().collect();
        let [Ok(sheet)] = &kept[..] else { panic!("{} sheets", kept.len()) };
        let served = fs::read(sheet.path()).unwrap();
        assert!(served == filter.stdout, "{name}: the server's job differs from the queue's");
        assert!(served == layers, "{name}: the server's job differs from that of layers");
    }
}

/// `doctor` finds a server that runs, and none that has ended; a server that is told to end does so, and says it.
#[cfg(unix)]
#[test]
fn doctor_knows_the_server() {
    let bench = Bench::new();
    let servers = || {
        // Without a bridge all is not well, which is not what is asked here.
        let output = bench.command("doctor --json").output().unwrap();
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        found["print_servers"].as_array().unwrap().clone()
    };
    let mut serving = Serving::start(&bench, "file:sheets");
    let [server] = &servers()[..] else { panic!("not one server") };
    assert_eq!(server["printers"][0], format!("ipp://{}/ipp/print/standard", serving.address));
    assert_eq!(server["answers"], true);
    assert!(server["may_print"].as_str().unwrap().starts_with("this computer only"), "{server}");
    assert!(server["announced"].as_str().unwrap().starts_with("no, "), "{server}");
    let id = serving.child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    assert!(serving.child.wait().unwrap().success());
    assert!(servers().is_empty());
    // One that was killed leaves its word behind, which nobody believes.
    Serving::start(&bench, "file:sheets").kill();
    assert!(servers().is_empty());
}

/// The queue that CUPS makes of the server by itself, without a driver.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_driverless_queue_prints_what_is_drawn() {
    if !server::available() {
        return;
    }
    let cups = Server::start();
    let bench = Bench::new();
    let serving = Serving::start(&bench, "file:sheets");
    let uri = format!("ipp://localhost:{}/ipp/print/standard", serving.address.port());
    cups.say("lpadmin", &["-p", "Driverless", "-m", "everywhere", "-v", &uri, "-E"]);
    // Size, type of sheet, quality and colour are what its dialog shows.
    // On a busy machine the description is there a little later than the queue.
    cups.wait_for("the options of the dialog", |cups| {
        let options = cups.say("lpoptions", &["-p", "Driverless", "-l"]);
        ["PageSize", "A4", "MediaType", "cupsPrintQuality"].iter().all(|expected| options.contains(expected))
    });
    let file = cups.path("files/art.pdf");
    fs::write(&file, document((595, 842), "", &["0 g 120 240 240 240 re f"])).unwrap();
    let job = cups.print(&["-d", "Driverless", file.to_str().unwrap()]);
    assert_eq!(cups.wait_for_job(job), "completed", "{}", cups.log());
    let kept: Vec<_> = fs::read_dir(bench.path("sheets")).unwrap().collect();
    let [Ok(sheet)] = &kept[..] else { panic!("{} sheets", kept.len()) };
    let found = inspect(&fs::read(sheet.path()).unwrap(), &Silent);
    assert_eq!(found.inspection.setup.paper, Some("a4"));
    // 600 / 72 dots a point, less the margins of 80 and 284 dots.
    let (sides, _) = extent(&found.passes, Ink::Black);
    let top = 842 * 600 / 72 - 284;
    let expected = [1000 - 80, top - 4000, 3000 - 80, top - 2000];
    assert!(sides.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 12), "{sides:?}, not {expected:?}");
    serving.kill();
}

/// A hundred jobs and a server that is killed again and again: each job that it has accepted is printed once, and as it was.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_server_killed_at_every_step_prints_each_job_once() {
    const JOBS: u64 = 100;
    let bench = Bench::new();
    let port = Port::new(&[Ink::Black], 1 << 12);
    // The printer does not say when a sheet is out, so nobody waits for that.
    port.one_way.store(true, Ordering::Relaxed);
    let (bridge, address) = Bridge::on_tcp("127.0.0.1:0".parse().unwrap(), port).unwrap();
    let to = format!("tcp:{address}");
    let seed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    eprintln!("seed {seed}");
    let mut chance = seeded(seed);
    let (mut accepted, mut unknown, mut kills, mut next) = (Vec::new(), Vec::new(), 0, 0);
    while next < JOBS {
        let serving = Serving::start(&bench, &to);
        let end = Instant::now() + Duration::from_millis(chance.random_range(5..400));
        while Instant::now() < end && next < JOBS {
            // Whether a job without an answer was taken nobody knows; its owner would look.
            match ipp::print(serving.address, "standard", &format!("job {next}"), &job(next)) {
                Ok(id) => accepted.push((id, next)),
                Err(_) => unknown.push(next),
            }
            next += 1;
            if chance.random_range(0..3) == 0 {
                std::thread::sleep(Duration::from_millis(chance.random_range(0..60)));
            }
        }
        serving.kill();
        kills += 1;
    }
    // And while only printing goes on.
    for _ in 0..30 {
        let serving = Serving::start(&bench, &to);
        std::thread::sleep(Duration::from_millis(chance.random_range(1..300)));
        serving.kill();
        kills += 1;
    }
    let serving = Serving::start(&bench, &to);
    for (id, number) in &accepted {
        assert_eq!(serving.wait_for(*id), 9, "job {id}, number {number}");
    }
    serving.kill();
    let printed = bridge.printed();
    let found: Vec<&[u8]> = sheets(&printed).into_iter().map(|place| &printed[place]).collect();
    let mut times = vec![0; JOBS as usize];
    for sheet in &found {
        assert!(is_a_whole_job(sheet), "a sheet of {} bytes is no whole job", sheet.len());
        let number = (0..JOBS).find(|&number| job(number) == *sheet).expect("a job that was sent");
        times[number as usize] += 1;
    }
    for (_, number) in &accepted {
        assert_eq!(times[*number as usize], 1, "job {number} after {kills} kills");
    }
    for number in &unknown {
        assert!(times[*number as usize] <= 1, "job {number} after {kills} kills");
    }
    assert!(accepted.len() > 50, "{} of {JOBS} jobs were accepted", accepted.len());
}
