//! The program, as its user types it, against the firmware's real image: the emulated bridge's serial port is opened by
//! the serial transport, and what crosses its parallel port makes a sheet in the simulated printer.
//!
//! Run by `cargo xtask emulator`, which builds the image and the program and names them.
#![cfg(unix)]

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use foilpress::observe::Silent;
use foilpress::separate;
use foilpress::simulate::{Carousel, Cassette, Lever, Printer, Stock, Trouble, difference, print, wanted};
use foilpress_tests::emulated::Emulated;
use protocol::ink::Ink;
use protocol::paper::Paper;

/// Nothing here takes longer, unless it never ends.
const PATIENCE: Duration = Duration::from_secs(120);

/// The image and the program, if they have been named.
fn parts() -> Option<(PathBuf, PathBuf)> {
    let parts =
        std::env::var_os("FOILPRESS_IMAGE").zip(std::env::var_os("FOILPRESS_PROGRAM"));
    if parts.is_none() {
        println!("skipped: `cargo xtask emulator` builds what this needs, and runs it");
    }
    parts.map(|(image, program)| (image.into(), program.into()))
}

struct Bench {
    folder: tempfile::TempDir,
    program: PathBuf,
    bridge: Emulated,
}

impl Bench {
    /// A bridge and a printer with these cassettes, a sheet in its tray. `None`: there is no image to run.
    fn new(cassettes: &[Cassette]) -> Option<Bench> {
        let (image, program) = parts()?;
        let folder = tempfile::tempdir().unwrap();
        let printer = Printer::new(Carousel::new(cassettes).unwrap(), Lever::Auto);
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("emulator");
        let ends = folder.path().join("bridge");
        fs::create_dir(&ends).unwrap();
        let bridge = Emulated::start(&image, &scripts, &ends, printer, Stock::of(Paper::Postcard)).unwrap();
        Some(Bench { folder, program, bridge })
    }

    fn to(&self) -> String {
        format!("serial:{}", self.bridge.port().display())
    }

    fn foilpress(&self, args: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(args).current_dir(self.folder.path()).env("FOILPRESS_JOBS", self.folder.path().join("jobs"));
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

    fn printed(&self) -> usize {
        self.bridge.desk().printed.len()
    }

    /// What crossed the port was legal in every respect.
    fn check(&mut self) {
        let figures = self.bridge.figures().unwrap();
        assert_eq!(figures["wrong"], serde_json::json!([]), "{figures}");
        assert_eq!(figures["complaints"], serde_json::json!([]), "{figures}");
        for time in ["setup", "strobe", "hold"] {
            // 800 ns, less a clock cycle of what an edge may be late.
            assert!(figures["shortest"][time].as_f64().unwrap() >= 792.0, "{figures}");
        }
        assert_eq!(self.bridge.desk().refused, None);
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
fn a_printed_document_is_the_very_sheet_although_every_cassette_has_to_be_put_in() {
    let Some(mut bench) = Bench::new(&[]) else { return };
    let mut child = bench.spawn(&[
        "print", "sample:leaf", "--size", "12x9mm", "--paper", "postcard", "-o", "leaf", "--to", &bench.to(),
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
    {
        let desk = bench.bridge.desk();
        assert!(desk.printed == file, "other bytes at the port");
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
