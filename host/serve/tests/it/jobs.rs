//! What becomes of jobs: on which sheet, which pages of them, and what is told of one that waits for somebody.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use observe::Silent;
use press::inspect::inspect;
use protocol::paper::Paper;
use serve::body::Limits;
use serve::jobs::{Job, State};
use serve::template::{AUTO, size};
use testing::ipp::{self, Attribute};

use super::Running;
use super::limits::{row, sheet};

const CREATE: u16 = 5;
const PRINTER: u16 = 11;

impl Running {
    fn job(&self, id: u32) -> Job {
        self.server.data().jobs[&id].clone()
    }

    /// Prints a document with these attributes of the job; the job once it is in this state.
    pub(super) fn print(&self, asked: &[Attribute<'_>], document: &[u8], until: State) -> Job {
        let uri = format!("ipp://{}/ipp/print", self.address);
        let bytes = [ipp::request(ipp::PRINT, &uri, &[], asked), document.to_vec()].concat();
        let (_, answer) = ipp::ask(self.address, &bytes).unwrap();
        self.wait(ipp::number(&answer, "job-id").unwrap() as u32, until)
    }

    fn wait(&self, id: u32, until: State) -> Job {
        let start = Instant::now();
        loop {
            let job = self.job(id);
            if job.state == until {
                return job;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "{job:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// What a request without a document is answered, as text.
    fn asked(&self, operation: u16, job: u32) -> String {
        let uri = format!("ipp://{}/ipp/print", self.address);
        let number = job.to_be_bytes();
        let about = [(0x21, "job-id", &number[..])];
        let bytes = ipp::request(operation, &uri, if job == 0 { &[] } else { &about }, &[]);
        String::from_utf8_lossy(&ipp::ask(self.address, &bytes).unwrap().1).into_owned()
    }

    pub(super) fn sheets_of(&self, job: &Job) -> Vec<Vec<u8>> {
        let begins = job.identity();
        let kept = fs::read_dir(self.path("sheets")).unwrap().map(|entry| entry.unwrap().path());
        let mut own: Vec<_> =
            kept.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(&begins)).collect();
        own.sort();
        own.iter().map(|path| fs::read(path).unwrap()).collect()
    }
}

#[test]
fn a_job_that_names_no_sheet_is_printed_on_the_loaded_one() {
    let running = Running::start(Limits::default(), true);
    let load = |paper: Paper, kind: &str| {
        running.server.load((Some(size(paper)), Some(kind.into())), None).unwrap();
    };
    let mut picture = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(40, 40, image::Rgb([0; 3]))
        .write_to(&mut picture, image::ImageFormat::Png)
        .unwrap();
    let printed = |asked: &[Attribute<'_>]| {
        let job = running.print(asked, picture.get_ref(), State::Completed);
        let [sheet] = &running.sheets_of(&job)[..] else { panic!("not one sheet") };
        let setup = inspect(sheet, &Silent).inspection.setup;
        (job.id, setup.paper.unwrap(), setup.curl_correction.unwrap())
    };
    load(Paper::Postcard, "film");
    let (job, paper, curl) = printed(&[]);
    assert_eq!((paper, curl), ("postcard", false));
    assert_eq!(printed(&[(0x44, "media-type", b"stationery")]).1, "postcard");
    // What a job names goes before what is loaded; what the preset says is a type, too.
    let (_, paper, curl) = printed(&[(0x44, "media", b"iso_a4_210x297mm"), (0x44, "media-type", b"auto")]);
    assert_eq!((paper, curl), ("a4", true));
    // Another sheet changes nothing of a job that is printed.
    load(Paper::A4, AUTO);
    assert!(running.asked(ipp::JOB, job).contains("media\0\u{14}jpn_hagaki_100x148mm"));
    assert_eq!(printed(&[]).1, "a4");
}

#[test]
fn of_finished_sheets_those_are_printed_that_were_chosen() {
    let running = Running::start(Limits::default(), true);
    let sheets = [row(1), row(2), row(3)];
    let range = |from: i32, to: i32| [from.to_be_bytes(), to.to_be_bytes()].concat();
    let job = running.print(&[(0x33, "page-ranges", &range(2, 9))], &sheets.concat(), State::Completed);
    assert!(running.sheets_of(&job) == sheets[1..]);
    let job = running.print(&[(0x33, "page-ranges", &range(7, 9))], &sheets.concat(), State::Aborted);
    assert!(job.message.contains("the pages of the document are 1 to 3"), "{}", job.message);
}

#[test]
fn a_job_that_waits_for_somebody_stops_the_printer_and_says_all_that_is_to_be_done() {
    let running = Running::start(Limits::default(), true);
    // No folder for sheets can be where a file is.
    fs::write(running.path("sheets"), "").unwrap();
    let job = running.print(&[], &sheet(), State::Held);
    assert!(job.message.starts_with("cannot write"), "{}", job.message);
    let words = format!("{} and so on, at length", "x".repeat(300));
    let said = running.server.change(job.id, |job| {
        job.message = words.clone();
        Ok(())
    });
    said.unwrap();
    let about = running.asked(ipp::JOB, job.id);
    assert!(about.contains(&words) && about.contains("resources-are-not-ready"), "{about}");
    let printer = running.asked(PRINTER, 0);
    assert!(printer.contains(&words) && printer.contains("other-error"), "{printer}");
    assert!(printer.contains("printer-state\0\u{4}\0\0\0\u{5}"), "{printer}");
    // Whoever holds a job of theirs is not told that something is the matter.
    let running = [running, Running::start(Limits::default(), false)];
    let own = running[1].print(&[], &sheet(), State::Pending);
    running[1].server.hold(own.id).unwrap();
    assert!(running[1].asked(ipp::JOB, own.id).contains("job-hold-until-specified"));
    assert!(running[1].asked(PRINTER, 0).contains("printer-state\0\u{4}\0\0\0\u{3}"));
    // Nothing is said any more of what was done.
    fs::remove_file(running[0].path("sheets")).unwrap();
    running[0].server.release(job.id).unwrap();
    assert!(!running[0].asked(ipp::JOB, job.id).contains(&words));
    running[0].wait(job.id, State::Completed);
    let printer = running[0].asked(PRINTER, 0);
    assert!(!printer.contains("other-") && !printer.contains(&words), "{printer}");
}

#[test]
fn a_document_may_take_longer_to_arrive_than_to_be_awaited() {
    let running = Running::start(Limits::default(), true);
    let uri = format!("ipp://{}/ipp/print", running.address);
    let message = [ipp::request(ipp::PRINT, &uri, &[], &[]), sheet()].concat();
    let mut stream = TcpStream::connect(running.address).unwrap();
    let head = format!(
        "POST /ipp/print HTTP/1.1\r\nHost: {}\r\nContent-Type: application/ipp\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        running.address,
        message.len()
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(&message[..message.len() - 100]).unwrap();
    // Another one's document does not begin to come.
    ipp::ask(running.address, &ipp::request(CREATE, &uri, &[], &[])).unwrap();
    let start = Instant::now();
    // A document that comes has a file.
    let comes = |id: &u32| running.server.store.folder(*id).join("document.part").exists();
    while !running.server.data().jobs.keys().any(comes) {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(20));
    }
    // All that had begun to wait by the end of time.
    running.server.time_out(Duration::ZERO, Duration::MAX);
    let mut states: Vec<State> = running.server.data().jobs.values().map(|job| job.state).collect();
    states.sort_by_key(|state| state.is_over());
    assert_eq!(states, [State::Incoming, State::Aborted]);
    stream.write_all(&message[message.len() - 100..]).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    running.wait(ipp::number(&answer, "job-id").unwrap() as u32, State::Completed);
}
