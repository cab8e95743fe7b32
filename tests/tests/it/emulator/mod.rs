//! The program, as its user types it, against the firmware's real image: the emulated bridge's serial port is opened by
//! the serial transport, and what crosses its parallel port makes a sheet in the simulated printer.
//!
//! Run by `cargo xtask emulator`, which builds the image and the program and names them.

mod care;
mod flash;
mod found;
mod image;
mod rig;
mod served;

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use device::transit::journal::Journal;
use foilpress_tests::emulated::{Desk, Emulated};
use observe::Silent;
use press::job::stream::write_job;
use press::separate::{self, Pass};
use press::simulate::{Carousel, Cartridge, Lever, Printer, Stock, Trouble, difference, print};
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use sheet::Plane;
use testing::needs::Need;

/// Nothing here takes longer, unless it never ends.
const PATIENCE: Duration = Duration::from_secs(120);

/// The image and the program, if they have been named.
fn parts() -> Option<(PathBuf, PathBuf)> {
    let parts = std::env::var_os("FOILPRESS_IMAGE").zip(std::env::var_os("FOILPRESS_PROGRAM"));
    if parts.is_none() {
        Need::Emulator.skip("`cargo xtask emulator` builds it and runs this test");
    }
    parts.map(|(image, program)| (image.into(), program.into()))
}

struct Bench {
    folder: tempfile::TempDir,
    program: PathBuf,
    bridge: Emulated,
    /// Shows the bridge on the program's USB.
    usbfs: Option<PathBuf>,
}

impl Bench {
    /// A bridge and a printer with these cartridges, a sheet in its tray. `None`: there is no image to run.
    fn new(cartridges: &[Cartridge]) -> Option<Bench> {
        let (image, program) = parts()?;
        let folder = tempfile::tempdir().unwrap();
        let printer = Printer::new(Carousel::new(cartridges).unwrap(), Lever::Auto).lagging(1, 1);
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("emulator");
        let ends = folder.path().join("bridge");
        fs::create_dir(&ends).unwrap();
        let bridge = Emulated::start(&image, &scripts, &ends, printer, Stock::of(Paper::Postcard)).unwrap();
        Some(Bench { folder, program, bridge, usbfs: None })
    }

    /// The same, on USB, where the program finds it by itself.
    fn on_usb(cartridges: &[Cartridge]) -> Option<Bench> {
        let mut bench = Bench::new(cartridges)?;
        bench.usbfs = std::env::var_os("FOILPRESS_USBFS").map(PathBuf::from);
        if bench.usbfs.is_none() {
            Need::Usb.skip("`cargo xtask emulator` found no umockdev");
            return None;
        }
        Some(bench)
    }

    /// Where the ends of the bridge's cables are.
    fn ends(&self) -> PathBuf {
        self.folder.path().join("bridge")
    }

    fn to(&self) -> String {
        format!("serial:{}", self.bridge.port().display())
    }

    fn foilpress(&self, args: &[&str]) -> Command {
        let mut command = match &self.usbfs {
            Some(usbfs) => {
                let mut command = Command::new(usbfs);
                command.arg(self.ends()).arg("--").arg(&self.program);
                command
            }
            None => Command::new(&self.program),
        };
        command
            .args(args)
            .current_dir(self.folder.path())
            .env("FOILPRESS_JOBS", self.folder.path().join("jobs"))
            .env("FOILPRESS_PRINTERS", self.folder.path().join("printers"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.foilpress(args).output().unwrap()
    }

    /// Runs it to its good end and gives what it said, both ways.
    fn well(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let text = text(&output);
        assert!(output.status.success(), "{args:?}: {text}");
        text
    }

    fn spawn(&self, args: &[&str]) -> Child {
        self.foilpress(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Waits until this holds.
    fn until(&self, what: &str, mut holds: impl FnMut(&Bench) -> bool) {
        let start = Instant::now();
        while !holds(self) {
            assert!(start.elapsed() < PATIENCE, "{what}: not after {PATIENCE:?}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// The board's clock, in seconds.
    fn clock(&mut self) -> f64 {
        self.bridge.figures().unwrap()["now"].as_f64().unwrap() / 1e9
    }

    /// Waits until nothing has crossed the port for a fifth of a second of the board's time, in which it
    /// sends kilobytes; how much has crossed until then.
    fn rests(&mut self) -> usize {
        let start = Instant::now();
        let (mut since, mut printed) = (self.clock(), self.printed());
        while self.clock() < since + 0.2 {
            assert!(start.elapsed() < PATIENCE, "it never rests");
            std::thread::sleep(Duration::from_millis(2));
            if self.printed() != printed {
                (since, printed) = (self.clock(), self.printed());
            }
        }
        printed
    }

    fn printed(&self) -> usize {
        self.bridge.desk().printed.len()
    }

    /// From `from` on, exactly these bytes crossed the port, before and after them nothing but questions how the printer
    /// is, and so many sheets have come out.
    fn came_out(&self, from: usize, job: &[u8], sheets: usize) {
        let asked =
            |desk: &Desk| 2 * desk.printed[from..].chunks(2).take_while(|pair| *pair == [0x05, 0x01]).count();
        // The bridge knows of a byte a little before it is on the desk.
        self.until("the job's bytes come", |bench| {
            let desk = bench.bridge.desk();
            desk.printed.len() >= from + asked(&desk) + job.len()
        });
        let desk = self.bridge.desk();
        let (printed, after) = desk.printed[from + asked(&desk)..].split_at(job.len());
        let same = printed.iter().zip(job).take_while(|(a, b)| a == b).count();
        assert!(printed == job, "the same up to byte {same} of {}", job.len());
        assert!(after.chunks(2).all(|question| [0x05, 0x01].starts_with(question)), "{after:02x?}");
        drop(desk);
        self.until("the sheet comes out", |bench| {
            let desk = bench.bridge.desk();
            assert_eq!(desk.refused, None);
            assert!(desk.sheets.len() <= sheets, "{} sheets", desk.sheets.len());
            desk.sheets.len() == sheets
        });
    }

    /// What crossed the port was legal in every respect: edges and language.
    fn check(&mut self) {
        self.check_waveform();
        assert_eq!(self.bridge.desk().refused, None);
    }

    fn check_waveform(&mut self) {
        let figures = self.bridge.figures().unwrap();
        assert_eq!(figures["wrong"], serde_json::json!([]), "{figures}");
        assert_eq!(figures["complaints"], serde_json::json!([]), "{figures}");
        for time in ["setup", "strobe", "hold"] {
            // 800 ns, less a clock cycle of what an edge may be late.
            assert!(figures["shortest"][time].as_f64().unwrap() >= 792.0, "{figures}");
        }
    }
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn said(mut child: Child) -> String {
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    let status = child.wait().unwrap();
    assert!(status.success(), "{status}: {text}");
    text
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_printed_document_is_the_very_sheet_although_every_cartridge_has_to_be_put_in() {
    let Some(mut bench) = Bench::new(&[]) else { return };
    let mut child = bench.spawn(&[
        "print",
        "sample:leaf",
        "--size",
        "12x9mm",
        "--paper",
        "postcard",
        "-o",
        "leaf",
        "--yes",
        "--to",
        &bench.to(),
    ]);
    let mut asked = Vec::new();
    bench.until("the sheet comes out", |bench| {
        let mut desk = bench.bridge.desk();
        if let Some(Trouble::RibbonMismatch { wanted }) = desk.printer.trouble() {
            let ink = Ink::from_barcode(wanted).unwrap();
            asked.push(ink);
            desk.printer.insert(ink.into()).unwrap();
        }
        assert!(child.try_wait().unwrap().is_none_or(|status| status.success()));
        !desk.sheets.is_empty()
    });
    said(child);
    let folder = bench.folder.path().join("leaf");
    let file = fs::read(folder.join("job.rgl")).unwrap();
    bench.came_out(0, &file, 1);
    {
        let desk = bench.bridge.desk();
        let sheet = desk.sheets[0].sheet().unwrap();
        // Two ways to the same sheet: the file that was kept, and the planes that were kept.
        let simulated = print(&file, &Default::default(), &Silent).unwrap().sheet().unwrap();
        assert_eq!(difference(&sheet, &simulated), None);
        let planes = separate::files::load(&folder.join("passes")).unwrap().passes;
        assert!(desk.sheets[0].passes == planes, "the planes differ");
        assert_eq!(asked, planes.iter().map(|pass| pass.ink).collect::<Vec<_>>());
    }
    bench.check();
}

const INKS: [Ink; 3] = [Ink::White, Ink::Cyan, Ink::Black];

/// A job of three inks in the middle of a postcard, about 60 kB.
fn job() -> Vec<u8> {
    let (width, length) = (usize::from(Paper::Postcard.width()), usize::from(Paper::Postcard.length()));
    let stride = width.div_ceil(8);
    let passes: Vec<Pass> = (5..)
        .zip(INKS)
        .map(|(pitch, ink)| {
            let mut bits = vec![0; stride * length];
            for (y, row) in bits.chunks_exact_mut(stride).enumerate().skip(1000).take(300) {
                for x in (600..1500).filter(|x| (x / pitch + y / (pitch + 1)) % 3 == 0) {
                    row[x / 8] |= 0x80 >> (x % 8);
                }
            }
            Pass { ink, plane: Plane { width, length, stride, bits } }
        })
        .collect();
    let mut file = Vec::new();
    write_job(Page::plain(Paper::Postcard), None, &passes, &mut file, &Silent).unwrap();
    file
}

/// A bridge, a printer with what the job needs, and the job in a file.
fn with_job() -> Option<(Bench, Vec<u8>)> {
    let bench = Bench::new(&INKS.map(Cartridge::from))?;
    let job = job();
    fs::write(bench.folder.path().join("job.rgl"), &job).unwrap();
    Some((bench, job))
}

#[test]
fn bridge_and_printer_are_found_and_asked_how_they_are() {
    let Some(mut bench) = Bench::new(&INKS.map(Cartridge::from)) else { return };
    let words = bench.well(&["bridge", "status", "--to", &bench.to()]);
    for fact in ["no job since it was switched on", "MODEL:MD-5500", "white", "cyan", "black", "idle"] {
        assert!(words.contains(fact), "no `{fact}` in: {words}");
    }
    let json = bench.run(&["bridge", "status", "--json", "--to", &bench.to()]);
    let status: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(status["fault"], serde_json::Value::Null);
    assert!(bench.well(&["doctor", "--to", &bench.to()]).contains("all is well"));
    bench.bridge.desk().printer.strike(Trouble::CoverOpen);
    bench.until("the lines show the open cover", |bench| {
        let output = bench.run(&["doctor", "--to", &bench.to()]);
        !output.status.success() && text(&output).contains("off line")
    });
    bench.bridge.desk().printer.close_cover();
    bench.check_waveform();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sender_killed_again_and_again_prints_the_same_sheet() {
    let Some((mut bench, job)) = with_job() else { return };
    let mut child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    for sixth in 1..6 {
        bench.until("it prints", |bench| bench.printed() > job.len() * sixth / 6);
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        let before = bench.well(&["bridge", "status", "--to", &bench.to()]);
        // On a slow machine the bridge may be through with what it holds by now, which can be all of the job.
        let open = before.contains("printing job") || before.contains("waits");
        assert!(
            if open { before.contains("a job is open") } else { before.contains("was printed") },
            "{before}"
        );
        child = bench.spawn(&["resume"]);
    }
    said(child);
    bench.came_out(0, &job, 1);
    assert!(bench.well(&["bridge", "status", "--to", &bench.to()]).contains("was printed"));
    bench.check();
}

#[test]
fn a_cable_pulled_again_and_again_costs_nothing() {
    let Some((mut bench, job)) = with_job() else { return };
    let child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    for fifth in 1..5 {
        bench.until("it prints", |bench| bench.printed() > job.len() * fifth / 5);
        bench.bridge.replug().unwrap();
    }
    said(child);
    bench.came_out(0, &job, 1);
    bench.check();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn an_open_cover_stops_the_job_and_a_closed_one_lets_it_go_on() {
    let Some((mut bench, job)) = with_job() else { return };
    let child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    bench.until("it prints", |bench| bench.printed() > job.len() / 2);
    bench.bridge.desk().printer.strike(Trouble::CoverOpen);
    // What the printer's buffer still has room for may follow, and no more.
    let struck = bench.printed();
    let stopped = bench.rests();
    assert!(stopped < struck + 6000, "{} bytes were sent to an open printer", stopped - struck);
    bench.bridge.desk().printer.close_cover();
    let text = said(child);
    assert!(text.contains("the printer has stopped") && text.contains("the printer continues"), "{text}");
    bench.came_out(0, &job, 1);
    bench.check();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_printer_switched_off_in_a_job_costs_the_sheet_and_the_next_one_is_printed_whole() {
    let Some((mut bench, job)) = with_job() else { return };
    let mut child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    bench.until("it prints", |bench| bench.printed() > job.len() / 2);
    bench.bridge.desk().switch(false);
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(text.contains("the sheet is lost, in pass") && text.contains("switched off"), "{text}");
    assert!(bench.well(&["bridge", "status", "--to", &bench.to()]).contains("+5 V absent"));
    let (lost, resets) = (bench.printed(), bench.bridge.desk().resets);
    assert!(lost < job.len(), "the whole job had crossed the port");
    // Sent before the printer is back: it waits, and the printer is reset before its first byte.
    let mut next = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    let mut lines = BufReader::new(next.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("nothing is printed yet")));
    assert!(lines.any(|line| line.contains("+5 V absent")));
    assert_eq!(bench.printed(), lost, "bytes for a printer that is off");
    bench.bridge.desk().switch(true);
    let text: Vec<String> = lines.collect();
    assert!(
        next.wait().unwrap().success() && text.iter().any(|line| line.contains("the printer continues")),
        "{text:?}"
    );
    // The printer has put out what there was of the first.
    bench.came_out(lost, &job, 2);
    assert_eq!(bench.bridge.desk().resets, resets + 1);
    bench.check();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_cancelled_sheet_comes_out_and_the_next_job_prints() {
    let Some((mut bench, job)) = with_job() else { return };
    let mut child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    bench.until("it prints", |bench| bench.printed() > job.len() / 3);
    // The bridge may hold all that is left of so small a job: the printer waits until the cancel is there.
    bench.bridge.desk().printer.strike(Trouble::CoverOpen);
    child.kill().unwrap();
    child.wait().unwrap();
    let cancel = bench.spawn(&["cancel"]);
    // On disk as soon as it is wanted; a second of the board's time later the bridge has heard of it.
    let jobs = Journal::at(&bench.folder.path().join("jobs")).unwrap();
    bench.until("the cancel is noted", |_| jobs.entries().unwrap().iter().any(|job| job.record.cancel));
    let noted = bench.clock();
    while bench.clock() < noted + 1.0 {
        std::thread::sleep(Duration::from_millis(2));
    }
    bench.bridge.desk().printer.close_cover();
    said(cancel);
    bench.until("the sheet comes out", |bench| bench.bridge.desk().sheets.len() == 1);
    // The last question may still be on its way.
    let cancelled = bench.rests();
    assert!(cancelled < job.len(), "nothing was saved");
    bench.well(&["send", "job.rgl", "--to", &bench.to()]);
    bench.came_out(cancelled, &job, 2);
    bench.check();
}

#[test]
fn a_bridge_on_usb_is_found_by_itself_under_both_its_addresses() {
    let Some(mut bench) = Bench::on_usb(&INKS.map(Cartridge::from)) else { return };
    let list = bench.well(&["bridge", "list"]);
    for fact in ["serial:/dev/ttyACM0", "usb:0000000000000000", "MODEL:MD-5500"] {
        assert!(list.contains(fact), "no `{fact}` in: {list}");
    }
    assert!(bench.well(&["bridge", "status"]).contains("white"));
    assert!(bench.well(&["doctor"]).contains("all is well"));
    bench.check_waveform();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_job_goes_over_bulk_endpoints_and_survives_pulled_cables_and_a_killed_sender() {
    let Some(mut bench) = Bench::on_usb(&INKS.map(Cartridge::from)) else { return };
    let job = job();
    fs::write(bench.folder.path().join("job.rgl"), &job).unwrap();
    let mut child = bench.spawn(&["send", "job.rgl", "--to", "usb:"]);
    for fifth in 1..5 {
        bench.until("it prints", |bench| bench.printed() > job.len() * fifth / 5);
        if fifth % 2 == 1 {
            bench.bridge.replug().unwrap();
        } else {
            // The program that shows it the device passes the signal on.
            kill(&child);
            assert!(!child.wait().unwrap().success());
            child = bench.spawn(&["resume"]);
        }
    }
    said(child);
    bench.came_out(0, &job, 1);
    bench.check();
}

/// What a sender costs its machine: processor time against the time the job takes at the port.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn sending_takes_little_of_a_processor() {
    let Some((mut bench, job)) = with_job() else { return };
    let before = bench.bridge.figures().unwrap()["now"].as_f64().unwrap();
    let child = bench.spawn(&["send", "job.rgl", "--to", &bench.to()]);
    let mut used = Duration::ZERO;
    bench.until("the job's bytes come", |bench| {
        used = processor_time(&child).unwrap_or(used);
        bench.printed() >= job.len()
    });
    said(child);
    let took = (bench.bridge.figures().unwrap()["now"].as_f64().unwrap() - before) / 1e9;
    let share = used.as_secs_f64() / took;
    println!(
        "{} bytes: {used:?} of a processor in {took:.2} s of the board's time: {:.1} %",
        job.len(),
        100.0 * share
    );
    assert!(share <= 0.05);
    bench.check();
}

/// What a process has used of a processor until now, as Linux counts it.
fn processor_time(child: &Child) -> Option<Duration> {
    let text = fs::read_to_string(format!("/proc/{}/schedstat", child.id())).ok()?;
    text.split_whitespace().next()?.parse().ok().map(Duration::from_nanos)
}

/// Ends a program as SIGKILL does, through the one that shows it its devices.
fn kill(child: &Child) {
    assert!(Command::new("kill").arg("-TERM").arg(child.id().to_string()).status().unwrap().success());
}
