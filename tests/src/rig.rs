//! Scenarios of `tests/rig.toml` at a bridge with the rig at its cable, emulated or real.
//!
//! The program sends a job to the bridge while the rig, told over its own serial port, plays a printer that stops, fails or is
//! switched off at a given byte. Afterwards the rig says what it took, how many strobes and resets it saw, and shows the
//! waveform of the first millisecond; all of it is compared with the job. Nothing here knows whether the boards are emulated.

use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use bridge::port::Timing;
use observe::Silent;
use press::job::stream::write_job;
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use rig::{Order, ROOM, Report, SAMPLE_NS, Shortest, Status, WORDS, checksum, samples, shortest};
use serde::Deserialize;
use serialport::SerialPort;
use sheet::Plane;

/// A scenario takes a second or two; an emulated one on a busy machine some more.
const PATIENCE: Duration = Duration::from_secs(120);

/// What is tried: `tests/rig.toml`.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub struct Scenarios {
    /// In this order.
    pub scenario: Vec<Scenario>,
}

/// One of them.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// What a person calls it.
    pub name: String,
    /// How long the printer works on each byte, in ns.
    work_ns: u32,
    /// Where it stops, in the order of their bytes.
    #[serde(default)]
    stops: Vec<Stop>,
    ends: End,
    /// Pulses on nInit there have to be. One before the first byte may be in any case: the bridge may owe it.
    #[serde(default)]
    resets: u32,
    /// What the printer says that it is. Without this it does not negotiate.
    #[serde(default)]
    id: String,
}

/// A byte at which something happens.
#[derive(Deserialize, Clone, Copy, Debug)]
#[serde(deny_unknown_fields)]
struct Stop {
    byte: u32,
    lines: Trouble,
    ms: u64,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "kebab-case")]
enum Trouble {
    Busy,
    #[serde(rename = "paper out")]
    PaperOut,
    #[serde(rename = "off line")]
    OffLine,
    Error,
    Off,
    Killed,
}

impl Trouble {
    fn status(self) -> Status {
        match self {
            Trouble::Busy | Trouble::Off | Trouble::Killed => Status::READY,
            Trouble::PaperOut => Status { paper_out: true, ..Status::READY },
            Trouble::OffLine => Status { select: false, ..Status::READY },
            Trouble::Error => Status { fault: false, ..Status::READY },
        }
    }
}

/// What is to come of the job.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "kebab-case")]
enum End {
    /// All of it was printed.
    Printed,
    /// The printer has the beginning of it.
    Lost,
    /// Nothing is sent: `bridge status` shows the printer's device ID.
    Asked,
}

/// What a scenario showed.
pub struct Shown {
    /// What the rig says.
    pub report: Report,
    /// The shortest times of the waveform.
    pub shortest: Shortest,
    /// The samples.
    pub words: Vec<u32>,
}

/// The rig's serial port.
pub struct Rig {
    port: Box<dyn SerialPort>,
}

impl Rig {
    /// Opens it.
    ///
    /// # Errors
    /// There is no such port, another program has it, or what is there is no rig.
    pub fn open(path: &Path) -> io::Result<Rig> {
        let path = path.to_str().ok_or_else(|| io::Error::other("the rig's port has no name in UTF-8"))?;
        let port = serialport::new(path, 115_200).timeout(PATIENCE).open()?;
        let mut rig = Rig { port };
        rig.report().map_err(|error| {
            io::Error::new(error.kind(), format!("{path} is no rig that answers: {error}"))
        })?;
        Ok(rig)
    }

    fn ask(&mut self, order: &Order) -> io::Result<String> {
        self.port.write_all(format!("{order}\n").as_bytes())?;
        let (mut line, mut byte) = (Vec::new(), [0]);
        loop {
            self.port.read_exact(&mut byte)?;
            match byte[0] {
                b'\n' => break,
                _ if line.len() == rig::LINE_MAX => return Err(io::Error::other("a line without an end")),
                byte => line.push(byte),
            }
        }
        String::from_utf8(line).map_err(io::Error::other)
    }

    fn tell(&mut self, order: &Order) -> io::Result<()> {
        match self.ask(order)?.as_str() {
            "ok" => Ok(()),
            other => Err(io::Error::other(format!("`{order}` was answered by `{other}`"))),
        }
    }

    fn report(&mut self) -> io::Result<Report> {
        let line = self.ask(&Order::Report)?;
        Report::parse(&line).ok_or_else(|| io::Error::other(format!("no report: `{line}`")))
    }

    fn wave(&mut self) -> io::Result<Vec<u32>> {
        let mut words = Vec::new();
        while words.len() < WORDS {
            let line = self.ask(&Order::Wave(words.len() as u32))?;
            let digits = line.strip_prefix("wave ").unwrap_or_default().as_bytes();
            let before = words.len();
            for word in digits.chunks_exact(8) {
                let word = std::str::from_utf8(word).map_err(io::Error::other)?;
                words.push(u32::from_str_radix(word, 16).map_err(io::Error::other)?);
            }
            if words.len() == before {
                break;
            }
        }
        Ok(words)
    }
}

/// The bridge and how to reach it.
pub struct Bridge<'a> {
    /// The program.
    pub program: &'a Path,
    /// What stands behind its `--to`.
    pub address: &'a str,
    /// A folder for the job, and for what the program remembers.
    pub folder: &'a Path,
}

impl Bridge<'_> {
    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(self.program);
        command
            .args(args)
            .current_dir(self.folder)
            .env("FOILPRESS_JOBS", self.folder.join("jobs"))
            .env("FOILPRESS_PRINTERS", self.folder.join("printers"))
            .stdin(Stdio::null());
        command
    }

    fn start(&self, args: &[&str]) -> io::Result<Child> {
        self.command(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn()
    }
}

/// A job of one ink in the middle of a postcard: some 14 kB.
fn job() -> io::Result<Vec<u8>> {
    let (width, length) = (usize::from(Paper::Postcard.width()), usize::from(Paper::Postcard.length()));
    let stride = width.div_ceil(8);
    let mut bits = vec![0; stride * length];
    for (y, row) in bits.chunks_exact_mut(stride).enumerate().skip(1000).take(150) {
        for x in (600..1300).filter(|x| (x / 7 + y / 5) % 3 == 0) {
            row[x / 8] |= 0x80 >> (x % 8);
        }
    }
    let pass = Pass { ink: Ink::Black, plane: Plane { width, length, stride, bits } };
    let mut file = Vec::new();
    write_job(Page::plain(Paper::Postcard), None, &[pass], &mut file, &Silent).map_err(io::Error::other)?;
    Ok(file)
}

/// Plays a scenario.
///
/// # Errors
/// What went otherwise than it should, or cannot be done: the ports, the program.
pub fn play(scenario: &Scenario, rig: &mut Rig, bridge: &Bridge<'_>) -> io::Result<Shown> {
    let wrong = |what: String| io::Error::other(format!("{}: {what}", scenario.name));
    let job = job()?;
    fs::write(bridge.folder.join("rig.rgl"), &job)?;
    let room = ROOM as u32;
    let first = scenario.stops.first().map_or(room, |stop| stop.byte);
    rig.tell(&Order::Lines(Status::READY))?;
    rig.tell(&Order::Id(scenario.id.as_str().try_into().unwrap_or_default()))?;
    if !scenario.id.is_empty() {
        // A printer that did not negotiate before is asked again only when it has been switched off.
        rig.tell(&Order::Power(false))?;
        let start = Instant::now();
        loop {
            let output = bridge.command(&["bridge", "status", "--to", bridge.address]).output()?;
            if String::from_utf8_lossy(&output.stdout).contains("+5 V absent") {
                break;
            }
            if start.elapsed() > PATIENCE {
                return Err(wrong("the bridge does not see that the printer is off".into()));
            }
        }
    }
    rig.tell(&Order::Begin { work_ns: scenario.work_ns, bytes: first })?;
    if scenario.ends == End::Asked {
        // A printer that has been off may be another one, of which nobody knows where it stands.
        let reset = bridge.command(&["bridge", "reset", "--to", bridge.address]).output()?;
        if !reset.status.success() {
            return Err(wrong(format!(
                "the bridge is not reset: {}",
                String::from_utf8_lossy(&reset.stderr)
            )));
        }
        let start = Instant::now();
        loop {
            let output = bridge.command(&["bridge", "status", "--to", bridge.address]).output()?;
            let text = String::from_utf8_lossy(&output.stdout);
            if text.contains(scenario.id.trim_end_matches(';')) {
                let report = rig.report()?;
                return Ok(Shown { report, shortest: Shortest::default(), words: Vec::new() });
            }
            // The bridge itself asks a printer that has been switched on, and says so as long as that takes.
            if start.elapsed() > Duration::from_secs(20) {
                return Err(wrong(format!("its device ID is not in what `bridge status` says: {text}")));
            }
        }
    }

    let mut child = bridge.start(&["send", "rig.rgl", "--to", bridge.address])?;
    for (number, stop) in scenario.stops.iter().enumerate() {
        let start = Instant::now();
        while rig.report()?.taken < stop.byte {
            if child.try_wait()?.is_some() {
                let text = said(child)?.1;
                return Err(wrong(format!("the program ended before byte {}: {text}", stop.byte)));
            }
            if start.elapsed() > PATIENCE {
                return Err(wrong(format!("byte {} did not come: {:?}", stop.byte, rig.report()?)));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        match stop.lines {
            Trouble::Off => rig.tell(&Order::Power(false))?,
            trouble => rig.tell(&Order::Lines(trouble.status()))?,
        }
        if stop.lines == Trouble::Killed {
            child.kill()?;
            child.wait()?;
        }
        std::thread::sleep(Duration::from_millis(stop.ms));
        let stopped = rig.report()?;
        if stopped.taken != stop.byte {
            return Err(wrong(format!(
                "{} bytes came to a printer that stopped at byte {}",
                stopped.taken, stop.byte
            )));
        }
        if stop.lines == Trouble::Killed {
            child = bridge.start(&["resume"])?;
        }
        rig.tell(&Order::Lines(Status::READY))?;
        if stop.lines == Trouble::Off {
            rig.tell(&Order::Power(true))?;
        }
        let next = scenario.stops.get(number + 1).map_or(room, |next| next.byte);
        rig.tell(&Order::More(next.saturating_sub(stop.byte)))?;
    }
    let (status, text) = said(child)?;
    let report = rig.report()?;
    let words = rig.wave()?;
    let shortest = shortest(samples(&words));
    let taken = report.taken as usize;
    if scenario.ends == End::Printed {
        if !status.success() {
            return Err(wrong(format!("the program says: {text}")));
        }
        if taken != job.len() {
            return Err(wrong(format!("{taken} bytes of {} came", job.len())));
        }
    } else if status.success() || taken >= job.len() {
        return Err(wrong(format!("{taken} bytes of {} came, and the program says: {text}", job.len())));
    }
    if report.checksum != checksum(&job[..taken]) {
        return Err(wrong(format!("{taken} bytes came, and they are not those of the job")));
    }
    if report.strobes != report.taken {
        return Err(wrong(format!(
            "{} strobes for {taken} bytes: some came while the printer was not ready",
            report.strobes
        )));
    }
    let between = report.reset_at == 0 || (scenario.ends == End::Lost && report.reset_at == report.taken);
    if report.resets < scenario.resets || !between {
        let Report { resets, reset_at, .. } = report;
        return Err(wrong(format!("{resets} resets, the last one behind byte {reset_at}")));
    }
    check_times(&shortest).map_err(wrong)?;
    Ok(Shown { report, shortest, words })
}

/// The times of the standard settings, less two samples: an edge falls anywhere between two.
fn check_times(shortest: &Shortest) -> Result<(), String> {
    let Timing { setup, strobe, hold, .. } = Timing::DEFAULT;
    for (name, asked, seen) in
        [("setup", setup, shortest.setup), ("strobe", strobe, shortest.strobe), ("hold", hold, shortest.hold)]
    {
        match seen {
            None => return Err(format!("the samples show no {name} time: is the lines' wiring whole?")),
            Some(seen) if seen + 2 * SAMPLE_NS < asked => {
                return Err(format!("{name} of {seen} ns, asked for {asked}"));
            }
            Some(_) => {}
        }
    }
    match shortest.wrong {
        0 => Ok(()),
        wrong => Err(format!("{wrong} strobes while busy, or data that changed under a strobe")),
    }
}

fn said(mut child: Child) -> io::Result<(ExitStatus, String)> {
    let mut text = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        stderr.read_to_string(&mut text)?;
    }
    Ok((child.wait()?, text))
}

/// Samples as a value change dump (IEEE 1364), which logic analysers' programs read.
pub fn dump(words: &[u32]) -> String {
    const LINES: [(&str, char); 8] = [
        ("nStrobe", 's'),
        ("nAutoFd", 'f'),
        ("nInit", 'i'),
        ("nSelectIn", 'l'),
        ("nAck", 'a'),
        ("Busy", 'b'),
        ("PError", 'p'),
        ("Select", 'o'),
    ];
    let mut text = String::from("$timescale 1 ns $end\n$scope module port $end\n$var wire 8 d Data $end\n");
    for (name, sign) in LINES {
        let _ = writeln!(text, "$var wire 1 {sign} {name} $end");
    }
    text.push_str("$upscope $end\n$enddefinitions $end\n");
    let mut before = None;
    for (at, now) in samples(words).enumerate() {
        let changed = before.map_or(0xffff, |before: u16| before ^ now);
        before = Some(now);
        if changed == 0 {
            continue;
        }
        let _ = writeln!(text, "#{}", at as u64 * u64::from(SAMPLE_NS));
        if changed & 0xff != 0 {
            let _ = writeln!(text, "b{:b} d", now & 0xff);
        }
        for (bit, (_, sign)) in (8..).zip(LINES) {
            if changed >> bit & 1 == 1 {
                let _ = writeln!(text, "{}{sign}", now >> bit & 1);
            }
        }
    }
    text
}

/// Reads the scenarios of a file.
///
/// # Errors
/// The file cannot be read, or says something else; the message names the file and the line.
pub fn read(path: &Path) -> io::Result<Scenarios> {
    let named = |error: String| io::Error::other(format!("{}: {error}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| named(error.to_string()))?;
    let scenarios: Scenarios = toml::from_str(&text).map_err(|error| named(error.to_string()))?;
    for scenario in &scenarios.scenario {
        let bytes: Vec<u32> = scenario.stops.iter().map(|stop| stop.byte).collect();
        if bytes.first() == Some(&0) || !bytes.is_sorted_by(|a, b| a < b) {
            return Err(named(format!(
                "{}: stops are at bytes from 1, each behind the one before",
                scenario.name
            )));
        }
        if scenario.id.len() > rig::ID_MAX || !scenario.id.is_ascii() {
            return Err(named(format!("{}: an id is ASCII of at most {} bytes", scenario.name, rig::ID_MAX)));
        }
    }
    Ok(scenarios)
}

/// Where the scenarios are.
pub fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("rig.toml")
}
