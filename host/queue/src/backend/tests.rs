//! The backend at a device that keeps what it gets.

use super::*;
use crate::messages::Messages;
use press::inspect::inspect;
use press::job::stream::write_job;
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use sheet::Plane;
use std::sync::atomic::{AtomicUsize, Ordering};
use testing::device::Device;

fn job(ink: Ink, rows: usize) -> Vec<u8> {
    let paper = Paper::Custom { width: 800, length: 400 };
    let bits: Vec<u8> = (0..100 * rows).map(|i| (i * 37 % 255) as u8 | 1).collect();
    let bits = [bits, vec![0; 100 * (400 - rows)]].concat();
    let pass = Pass { ink, plane: Plane { width: 800, length: 400, stride: 100, bits } };
    let mut bytes = Vec::new();
    write_job(Page::plain(paper), None, &[pass], &mut bytes, &Silent).unwrap();
    bytes
}

/// A queue that leads to a device which keeps what it gets.
struct Rig {
    folder: tempfile::TempDir,
    port: std::cell::RefCell<Device>,
    call: Call,
    printers: Printers,
}

impl Rig {
    fn new() -> Rig {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("lp0");
        let port = Device::at(&device).into();
        let call = Call {
            title: "leaf".into(),
            identity: "one".into(),
            copies: 1,
            file: None,
            to: Destination::Raw(device),
            journal: folder.path().join("jobs"),
            in_class: false,
            awaits_sheets: false,
            listed: ("queue".into(), "queue-7".into()),
            lister: folder.path().join("lister"),
        };
        let printers = Printers::at(&folder.path().join("printers")).unwrap();
        Rig { folder, port, call, printers }
    }

    fn run(&self, job: &[u8], stop: &(dyn Fn() -> bool + Sync)) -> (Exit, String) {
        let mut said = Vec::new();
        let exit = run(&self.call, &self.printers, &mut &*job, &Messages::new(&mut said), stop);
        (exit, String::from_utf8(said).unwrap())
    }

    fn got(&self) -> Vec<u8> {
        self.port.borrow_mut().taken()
    }
}

#[test]
fn sheets_go_to_a_device_one_after_the_other_and_are_counted() {
    let rig = Rig::new();
    let both = [job(Ink::Cyan, 30), job(Ink::Black, 20)].concat();
    let (exit, said) = rig.run(&both, &|| false);
    assert_eq!(exit, Exit::Ok, "{said}");
    assert!(rig.got() == both);
    assert!(said.contains("PAGE: 1 1\n") && said.contains("PAGE: 2 1\n"), "{said}");
    assert_eq!(
        fs::read_dir(&rig.call.journal).unwrap().count(),
        0,
        "nothing is kept of a job that is printed"
    );
}

#[test]
fn a_job_that_was_interrupted_at_a_device_is_held_and_printed_again_only_when_released() {
    let rig = Rig::new();
    let bytes = job(Ink::Cyan, 30);
    let folder = rig.call.journal.join("one/0001");
    fs::create_dir_all(&folder).unwrap();
    File::create(folder.join("begun")).unwrap();
    let (exit, said) = rig.run(&bytes, &|| false);
    assert_eq!(exit, Exit::Hold);
    assert!(said.contains("ERROR: the job was interrupted") && rig.got().is_empty(), "{said}");
    assert_eq!(rig.run(&bytes, &|| false).0, Exit::Ok);
    assert!(rig.got() == bytes);
}

#[test]
fn what_another_user_left_in_the_printer_holds_every_job_until_it_is_released_or_the_printer_was_reset() {
    let mut rig = Rig::new();
    let bytes = job(Ink::Cyan, 30);
    let Destination::Raw(device) = rig.call.to.clone() else { unreachable!() };
    rig.printers.begin(&device, "raw-1-1").unwrap();
    for identity in ["one", "two"] {
        rig.call.identity = identity.into();
        let (exit, said) = rig.run(&bytes, &|| false);
        assert_eq!(exit, Exit::Hold, "{said}");
        assert!(said.contains("may hold part of an interrupted job") && said.contains("held"), "{said}");
    }
    assert!(rig.got().is_empty());
    assert_eq!(rig.run(&bytes, &|| false).0, Exit::Ok, "released");
    assert!(rig.got() == bytes);
    assert_eq!(rig.printers.noted(Some(&device)).unwrap(), []);
    // So the other one is not asked again.
    rig.call.identity = "one".into();
    assert_eq!(rig.run(&bytes, &|| false).0, Exit::Ok);
    rig.printers.begin(&device, "raw-1-2").unwrap();
    rig.printers.close(&rig.printers.noted(None).unwrap()).unwrap();
    rig.call.identity = "three".into();
    assert_eq!(rig.run(&bytes, &|| false).0, Exit::Ok);
}

#[test]
fn ribbon_is_counted_for_every_sheet() {
    let rig = Rig::new();
    rig.run(&[job(Ink::Cyan, 30), job(Ink::Cyan, 30)].concat(), &|| false);
    let (lines, damaged) = device::ledger::Ledger::in_folder(rig.printers.folder()).lines().unwrap();
    let totals = device::ledger::totals(&lines, |_| None);
    assert_eq!((damaged, totals.len()), (0, 1));
    assert_eq!((totals[0].ink.as_str(), totals[0].passes, totals[0].failed), ("cyan", 2, 0));
    assert!(totals[0].ribbon_mm > 0.0);
}

#[test]
fn a_job_cancelled_at_a_device_becomes_a_shorter_whole_job() {
    let rig = Rig::new();
    let bytes = job(Ink::Cyan, 400);
    // Asked before each piece; cancelled after some.
    let asked = AtomicUsize::new(0);
    let (exit, said) = rig.run(&bytes, &|| asked.fetch_add(1, Ordering::SeqCst) > 8);
    assert_eq!(exit, Exit::Ok, "{said}");
    let got = rig.got();
    assert!(!got.is_empty() && got.len() < bytes.len());
    assert!(inspect(&got, &Silent).inspection.complete);
    assert!(!said.contains("PAGE:"), "{said}");
    assert_eq!(fs::read_dir(&rig.call.journal).unwrap().count(), 0, "nothing is kept of a cancelled job");
    // What was printed before is remembered, in case the job is started again.
    let two = [job(Ink::Cyan, 3), job(Ink::Cyan, 400)].concat();
    let pages = AtomicUsize::new(0);
    let (_, said) = rig.run(&two, &|| pages.fetch_add(1, Ordering::SeqCst) > 16);
    assert!(said.contains("PAGE: 1 1") && !said.contains("PAGE: 2 1"), "{said}");
    assert!(rig.call.journal.join("one/0001/done").exists());
}

#[test]
#[cfg(unix)]
fn of_a_cancelled_job_nothing_is_kept_and_of_a_stopped_one_its_printed_sheets_are() {
    use std::os::unix::fs::PermissionsExt;
    let rig = Rig::new();
    let two = [job(Ink::Cyan, 3), job(Ink::Cyan, 400)].concat();
    let done = rig.call.journal.join("one/0001/done");
    // The print system lists the job; it has ended itself; it lists others only.
    for (answer, kept) in [
        ("[ \"$*\" = '-W not-completed -o queue' ] && echo 'queue-7  me  1024  today'", true),
        ("exit 1", true),
        ("echo 'queue-70  me  1024  today'", false),
    ] {
        fs::write(&rig.call.lister, format!("#!/bin/sh\n{answer}\n")).unwrap();
        fs::set_permissions(&rig.call.lister, fs::Permissions::from_mode(0o755)).unwrap();
        let asked = AtomicUsize::new(0);
        let (exit, said) = rig.run(&two, &|| asked.fetch_add(1, Ordering::SeqCst) > 16);
        assert_eq!(exit, Exit::Ok, "{said}");
        assert_eq!(done.exists(), kept, "{answer}: {said}");
        let _ = fs::remove_dir_all(&rig.call.journal);
    }
}

#[test]
fn what_is_no_whole_job_is_cancelled_before_the_first_byte() {
    let rig = Rig::new();
    let good = job(Ink::Cyan, 30);
    for wrong in [&b"Hello"[..], &good[..good.len() - 5], &[&good[..], b"x"].concat()] {
        let (exit, said) = rig.run(wrong, &|| false);
        assert_eq!(exit, Exit::Cancel, "{said}");
        assert!(rig.got().is_empty() && said.contains("ERROR: "), "{said}");
    }
    // What made no bytes has given its reason, and that has to stay the last error.
    let (exit, said) = rig.run(&[], &|| false);
    assert_eq!(exit, Exit::Cancel, "{said}");
    assert!(rig.got().is_empty() && !said.contains("ERROR: "), "{said}");
}

#[test]
fn a_device_that_is_not_there_is_waited_for_unless_another_printer_may_do_it() {
    let mut rig = Rig::new();
    rig.call.to = Destination::Raw(rig.folder.path().join("no/such/device"));
    let asked = AtomicUsize::new(0);
    let (exit, said) = rig.run(&job(Ink::Cyan, 3), &|| asked.fetch_add(1, Ordering::SeqCst) > 5);
    assert_eq!(exit, Exit::Ok, "ended by the print system: {said}");
    assert!(said.contains("STATE: +connecting-to-device,offline-report"), "{said}");
    rig.call.in_class = true;
    assert_eq!(rig.run(&job(Ink::Cyan, 3), &|| false).0, Exit::Failed);
}
