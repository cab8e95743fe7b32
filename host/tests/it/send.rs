//! Sending as its users meet it, as far as it goes without a bridge.

use std::fs;
use std::process::{Command, Output, Stdio};

use device::printers::Printers;
use device::transit::journal::{Journal, NewJob};
use observe::Silent;
use press::job::stream::write_job;
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::link::message::JobKind;
use protocol::paper::Paper;
use protocol::rgl::Page;
use sheet::Plane;
use tempfile::TempDir;
use testing::device::Device;

/// A folder with a small job, and a journal of its own.
struct Bench {
    folder: TempDir,
    job: Vec<u8>,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let paper = Paper::Custom { width: 64, length: 20 };
        let plane = Plane { width: 64, length: 20, stride: 8, bits: vec![0x5a; 160] };
        let mut job = Vec::new();
        write_job(Page::plain(paper), None, &[Pass { ink: Ink::White, plane }], &mut job, &Silent)
            .expect("a legal job");
        fs::write(folder.path().join("job.rgl"), &job).expect("the job is written");
        Bench { folder, job }
    }

    /// A device beside the job, called `port`.
    fn device(&self) -> Device {
        Device::at(&self.folder.path().join("port"))
    }

    fn run(&self, args: &str) -> Output {
        Command::new(testing::program::path())
            .args(args.split_whitespace())
            .current_dir(self.folder.path())
            .env("FOILPRESS_JOBS", self.folder.path().join("jobs"))
            .env("FOILPRESS_PRINTERS", self.folder.path().join("printers"))
            .env("FOILPRESS_CONFIG", self.folder.path().join("config"))
            .stdin(Stdio::null())
            .output()
            .expect("the program starts")
    }

    fn says(&self, code: i32, args: &str) -> String {
        let output = self.run(args);
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        said
    }
}

#[test]
fn the_folder_of_a_print_stands_for_its_job_and_another_folder_for_none() {
    let bench = Bench::new();
    let path = |name: &str| bench.folder.path().join(name);
    fs::create_dir(path("leaf.print")).unwrap();
    fs::create_dir(path("empty")).unwrap();
    fs::write(path("leaf.print/job.rgl"), &bench.job).unwrap();
    bench.says(0, "send leaf.print --to file:out.rgl");
    assert!(fs::read(path("out.rgl")).unwrap() == bench.job);
    for command in ["inspect", "plan", "simulate -q -o sheet", "preview -q -o page.html"] {
        bench.says(0, &format!("{command} leaf.print"));
    }
    for command in ["send --to file:other.rgl", "inspect", "simulate -o other.sheet"] {
        let said = bench.says(1, &format!("{command} empty"));
        assert!(
            said.contains("empty: a folder without a job.rgl; expected a job (.rgl), or a folder"),
            "{said}"
        );
    }
    assert!(!path("other.rgl").exists() && !path("other.sheet").exists());
}

#[test]
fn what_is_not_one_whole_job_is_refused_before_the_first_byte() {
    let bench = Bench::new();
    let mut port = bench.device();
    let mut twice = bench.job.clone();
    twice.extend_from_slice(&bench.job);
    for wrong in [&bench.job[..bench.job.len() - 1], &twice, b"hello, printer\n", b""] {
        fs::write(bench.folder.path().join("wrong.rgl"), wrong).unwrap();
        for to in ["raw:port", "file:out.rgl", "serial:/dev/no-such-port"] {
            let said = bench.says(1, &format!("send wrong.rgl --to {to}"));
            assert!(said.contains("not sent") && said.contains("byte"), "{said}");
        }
    }
    assert!(port.taken().is_empty(), "something was sent");
    assert!(!bench.folder.path().join("out.rgl").exists());
    assert!(!bench.folder.path().join("jobs").exists(), "something was queued");
}

#[test]
fn a_file_and_a_raw_device_get_the_job_byte_for_byte() {
    let bench = Bench::new();
    bench.says(0, "send job.rgl --to file:copy.rgl");
    let mut port = bench.device();
    let said = bench.says(0, "send job.rgl --to raw:port");
    assert!(said.contains("white (MDC-SCWH)"), "the cartridge is named: {said}");
    assert!(
        said.contains("whether they are printed, only the printer shows"),
        "queued is not printed: {said}"
    );
    assert!(
        fs::read(bench.folder.path().join("copy.rgl")).unwrap() == bench.job && port.taken() == bench.job
    );
    // A file is no device, and stays as it is.
    let said = bench.says(1, "send job.rgl --to raw:copy.rgl");
    assert!(said.contains("is a file and no device") && said.contains("file:copy.rgl"), "{said}");
}

#[test]
fn nothing_is_queued_for_a_bridge_that_is_not_there() {
    let bench = Bench::new();
    let said = bench.says(1, "send job.rgl --to serial:/dev/no-such-port");
    assert!(said.contains("not sent") && said.contains("nothing is there"), "{said}");
    assert!(bench.says(0, "resume --list").contains("no job"));
}

#[test]
fn a_job_whose_bridge_is_gone_waits_and_can_be_cancelled_without_it() {
    let bench = Bench::new();
    let journal = Journal::at(&bench.folder.path().join("jobs")).unwrap();
    let queued = journal.queue(NewJob {
        name: "job.rgl",
        to: "serial:/dev/no-such-port".into(),
        kind: JobKind::Raw,
        data: &bench.job,
        port_bytes: bench.job.len() as u64,
        passes: Vec::new(),
    });
    let number = format!("{:08x}", queued.unwrap().entry.record.job);
    let listed = bench.says(0, "resume --list");
    assert!(listed.starts_with(&number) && listed.contains("job.rgl: queued, nothing printed"), "{listed}");
    let said = bench.says(1, "resume");
    assert!(said.contains("nothing is there"), "{said}");
    let said = bench.says(0, &format!("cancel {number}"));
    assert!(said.contains("has not received any of it"), "{said}");
    assert!(bench.says(1, "resume").contains("no job waits"));
    assert!(bench.says(1, &format!("resume {number}")).contains("has ended"));
    assert!(bench.says(1, "cancel 12345678").contains("no job 12345678"));
}

/// A job whose record is damaged may be half printed: nobody may say that nothing waits.
#[test]
fn a_damaged_record_is_told_by_everything_that_lists_jobs() {
    let bench = Bench::new();
    let folder = bench.folder.path().join("jobs/5f3a9c01");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("job.json"), "junk").unwrap();
    assert!(bench.says(0, "resume --list").contains("job 5f3a9c01:"));
    let listed: serde_json::Value = serde_json::from_str(&bench.says(0, "-q resume --list --json")).unwrap();
    assert_eq!(listed[0]["job"], "5f3a9c01");
    assert!(listed[0]["error"].as_str().is_some_and(|error| error.contains("job.json")), "{listed}");
    let said = bench.says(1, "resume");
    assert!(said.contains("job 5f3a9c01 cannot be read") && !said.contains("all have ended"), "{said}");
    assert!(bench.says(1, "doctor").contains("job 5f3a9c01 cannot be read"));
}

#[test]
fn a_wrong_destination_is_wrong_usage_and_the_right_ones_are_shown() {
    let bench = Bench::new();
    for args in ["send job.rgl", "send job.rgl --to lpt1:", "cancel 123456789", "bridge status --to file:x"] {
        bench.says(2, args);
    }
    assert!(bench.says(2, "send job.rgl --to paper").contains("serial:/dev/ttyACM0"));
}

#[test]
fn a_device_that_may_hold_part_of_a_job_gets_nothing_until_its_switch_was_used() {
    let bench = Bench::new();
    let (path, mut port) = (bench.folder.path().join("port"), bench.device());
    let printers = Printers::at(&bench.folder.path().join("printers")).unwrap();
    // As it is left by a process that was killed.
    printers.begin(&path, "raw-1-1").unwrap();
    let said = bench.says(1, "send job.rgl --to raw:port");
    assert!(said.contains("not sent") && said.contains("bridge reset --by-hand"), "{said}");
    assert!(port.taken().is_empty(), "something was sent");
    bench.says(0, "bridge reset --by-hand");
    bench.says(0, "send job.rgl --to raw:port");
    assert!(port.taken() == bench.job);
    bench.says(0, "send job.rgl --to raw:port");
}
