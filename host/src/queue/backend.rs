//! The backend: what the print system starts to bring a job to the printer.
//!
//! Problem: the print system starts jobs again after a crash of its own, retries what failed, and knows nothing of
//! ribbons; a sheet must not be printed twice, and a job that is cancelled must leave a printer that is ready.
//! Method: a job's sheets go one after the other through a [session](device::send::session). Each has a journal of its own
//! under the job's identity, so a process that takes over knows what was printed and goes on where the printer is. A
//! sheet that was lost is printed again only when somebody releases the job. SIGTERM ends the sheet at the bridge.
//! What an earlier job has left open at the bridge is ended first.
//! Limits: jobs of up to 1 GB. A raw device tells nothing, so a job that was interrupted there is held.
//! Source: backend(7).

mod bridge;
mod raw;

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};

use super::call::{Call, Exit};
use super::messages::Messages;
use super::uri;
use device::send::{self, Checked, Destination};
use observe::Silent;
use press::inspect::sheets;

/// The most bytes of a job: dozens of pages.
const LARGEST: u64 = 1 << 30;
/// Between two attempts to reach the printer.
const RETRY: Duration = Duration::from_secs(2);

/// How the backend stops before all is printed.
struct Stopped(Exit);

/// A job on its way.
struct Delivery<'a, W> {
    call: &'a Call,
    messages: &'a Messages<W>,
    /// Whether the print system wants the job ended.
    stop: &'a (dyn Fn() -> bool + Sync),
    stopped: Option<Instant>,
}

/// Prints a job. `input` is standard input; `stop` says whether the print system has asked to end.
pub fn run<W: Write + Send>(
    call: &Call,
    input: &mut dyn Read,
    messages: &Messages<W>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Exit {
    let mut delivery = Delivery { call, messages, stop, stopped: None };
    match delivery.deliver(input) {
        Ok(()) => {
            messages.reasons(&[]);
            Exit::Ok
        }
        Err(Stopped(exit)) => exit,
    }
}

impl<W: Write + Send> Delivery<'_, W> {
    fn fail(&self, exit: Exit, error: &dyn std::fmt::Display) -> Stopped {
        self.messages.error(&error.to_string());
        Stopped(exit)
    }

    fn deliver(&mut self, input: &mut dyn Read) -> Result<(), Stopped> {
        let job = self.read(input)?;
        if (self.stop)() {
            return Ok(());
        }
        let places = sheets(&job);
        // All are judged before the first byte leaves.
        let checked: Vec<Checked> = (1..)
            .zip(&places)
            .map(|(number, place)| {
                send::check(&job[place.clone()], &Silent).map_err(|error| {
                    self.fail(
                        Exit::Cancel,
                        &format!("sheet {number} of {}: {}", places.len(), observe::with_causes(&error)),
                    )
                })
            })
            .collect::<Result<_, _>>()?;
        if checked.iter().any(|sheet| sheet.dialect.is_some()) {
            self.messages.info("the job is in another driver's dialect; it is sent as it is");
        }
        let folder = self.call.journal.join(&self.call.identity);
        self.end_what_was_left(&folder)?;
        let mut number = 0;
        for _ in 0..self.call.copies {
            for (place, checked) in places.iter().zip(&checked) {
                number += 1;
                if (self.stop)() {
                    return Ok(());
                }
                if !self.sheet(&job, place, checked, &folder.join(format!("{number:04}")), number)? {
                    return Ok(());
                }
            }
        }
        // Printed whole: should somebody want it again, it is another print.
        self.forget(&folder);
        Ok(())
    }

    fn read(&self, input: &mut dyn Read) -> Result<Vec<u8>, Stopped> {
        let mut job = Vec::new();
        let read = match &self.call.file {
            Some(path) => File::open(path).and_then(|file| file.take(LARGEST + 1).read_to_end(&mut job)),
            None => input.take(LARGEST + 1).read_to_end(&mut job),
        };
        match read {
            Ok(_) if job.is_empty() && !(self.stop)() => {
                Err(self.fail(Exit::Cancel, &"there is nothing to print: the job has no bytes"))
            }
            Ok(_) if job.len() as u64 > LARGEST => {
                Err(self.fail(Exit::Cancel, &"the job is larger than 1 GB; print fewer pages at once"))
            }
            Ok(_) => Ok(job),
            Err(error) => Err(self.fail(Exit::Failed, &format!("cannot read the job: {error}"))),
        }
    }

    /// Prints one sheet, unless it is already. False when it was ended early.
    fn sheet(
        &mut self,
        job: &[u8],
        place: &Range<usize>,
        checked: &Checked,
        folder: &Path,
        number: usize,
    ) -> Result<bool, Stopped> {
        let data = &job[place.clone()];
        let whole = match &self.call.to {
            Destination::Bridge(address) => self.bridge_prints(data, checked, address, folder)?,
            Destination::Raw(device) => self.raw_prints(data, checked, device, folder)?,
            // A URI never leads to a file.
            Destination::File(_) => return Err(self.fail(Exit::Stop, &uri::UriError::File)),
        };
        if whole {
            self.messages.page(number);
        }
        Ok(whole)
    }

    /// Waits a little; false when the print system wants the job ended.
    fn pause(&self) -> bool {
        let start = Instant::now();
        while start.elapsed() < RETRY {
            if (self.stop)() {
                return false;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        true
    }

    fn forget(&self, folder: &Path) {
        if let Err(error) = fs::remove_dir_all(folder)
            && error.kind() != io::ErrorKind::NotFound
        {
            // The sheets are printed all the same; that they stay on record costs a reprint of this very job.
            self.messages.debug(&format!("cannot remove {}: {error}", folder.display()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use press::inspect::inspect;
    use press::job::stream::write_job;
    use press::separate::{Pass, Plane};
    use protocol::ink::Ink;
    use protocol::paper::Paper;
    use protocol::rgl::Page;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn job(ink: Ink, rows: usize) -> Vec<u8> {
        let paper = Paper::Custom { width: 800, length: 400 };
        let bits: Vec<u8> = (0..100 * rows).map(|i| (i * 37 % 255) as u8 | 1).collect();
        let bits = [bits, vec![0; 100 * (400 - rows)]].concat();
        let pass = Pass { ink, plane: Plane { width: 800, length: 400, stride: 100, bits } };
        let mut bytes = Vec::new();
        write_job(Page::plain(paper), None, &[pass], &mut bytes, &Silent).unwrap();
        bytes
    }

    /// A queue that leads to a device which is a file, so that what it got can be looked at.
    struct Rig {
        folder: tempfile::TempDir,
        call: Call,
    }

    impl Rig {
        fn new() -> Rig {
            let folder = tempfile::tempdir().unwrap();
            let device = folder.path().join("lp0");
            File::create(&device).unwrap();
            let call = Call {
                title: "leaf".into(),
                identity: "one".into(),
                copies: 1,
                file: None,
                to: Destination::Raw(device),
                journal: folder.path().join("jobs"),
                in_class: false,
            };
            Rig { folder, call }
        }

        fn run(&self, job: &[u8], stop: &(dyn Fn() -> bool + Sync)) -> (Exit, String) {
            let mut said = Vec::new();
            let exit = run(&self.call, &mut &*job, &Messages::new(&mut said), stop);
            (exit, String::from_utf8(said).unwrap())
        }

        fn got(&self) -> Vec<u8> {
            fs::read(self.folder.path().join("lp0")).unwrap()
        }
    }

    #[test]
    fn sheets_go_to_a_device_one_after_the_other_and_are_counted() {
        let rig = Rig::new();
        let both = [job(Ink::Cyan, 30), job(Ink::Black, 20)].concat();
        let (exit, said) = rig.run(&both, &|| false);
        assert_eq!(exit, Exit::Ok, "{said}");
        // Each opens the device anew, and a file is then written from its start.
        assert!(rig.got().starts_with(&job(Ink::Black, 20)));
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
    }

    #[test]
    fn what_is_no_whole_job_is_cancelled_before_the_first_byte() {
        let rig = Rig::new();
        let good = job(Ink::Cyan, 30);
        for wrong in [&[][..], b"Hello", &good[..good.len() - 5], &[&good[..], b"x"].concat()] {
            let (exit, said) = rig.run(wrong, &|| false);
            assert_eq!(exit, Exit::Cancel, "{said}");
            assert!(rig.got().is_empty() && said.contains("ERROR: "), "{said}");
        }
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
}
