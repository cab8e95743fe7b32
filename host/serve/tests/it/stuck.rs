//! Nothing is stuck, and nothing is lost: full disks, damaged records, documents that break off, printers
//! that were off.

use std::fs;
use std::time::{Duration, Instant};

use observe::Silent;
use serve::body::Limits;
use serve::jobs::State;
use serve::server::Server;
use serve::template::size;
use testing::ipp::{self, http};
use testing::{namespace, needs::ghostscript};

use super::limits::{row, sheet};
use super::{Running, settings};

impl Running {
    /// Waits until something is so.
    fn until(&self, what: &str, mut is_so: impl FnMut(&Running) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < Duration::from_secs(60), "{what}: {:?}", self.server.data().jobs);
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// A PDF of A4 pages with a black mark, but for those numbered here, which are 300 m long.
fn pages(count: usize, endless: &[usize]) -> Vec<u8> {
    let mut objects = vec!["<</Type/Catalog/Pages 2 0 R>>".to_owned()];
    let kids: String = (0..count).map(|page| format!("{} 0 R ", page + 4)).collect();
    objects.push(format!("<</Type/Pages/Kids[{kids}]/Count {count}>>"));
    objects.push("<</Length 19>>\nstream\n0 g 90 500 17 9 re f\nendstream".to_owned());
    objects.extend((1..=count).map(|page| {
        let length = if endless.contains(&page) { 850_000 } else { 842 };
        format!("<</Type/Page/Parent 2 0 R/MediaBox[0 0 595 {length}]/Contents 3 0 R>>")
    }));
    super::fitted::pdf(&objects)
}

#[test]
fn sheets_are_sent_as_they_are_drawn() {
    if !ghostscript() {
        return;
    }
    let running = Running::start(Limits::default(), true);
    let job = running.print(&[], &pages(4, &[3]), State::Aborted);
    assert!(job.message.starts_with("2 of 4 sheets are printed; the document"), "{}", job.message);
    assert_eq!(running.sheets_of(&job).len(), 2);
    // Of the first page nothing is printed, and there is nothing to count.
    let job = running.print(&[], &pages(2, &[1]), State::Aborted);
    assert!(job.message.starts_with("the document"), "{}", job.message);
    let job = running.print(&[], &pages(5, &[]), State::Completed);
    assert_eq!((running.sheets_of(&job).len(), job.sheets, job.done), (5, Some(5), 5));
}

#[test]
fn a_restart_goes_on_behind_the_last_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let document: Vec<u8> = (1..=7).flat_map(row).collect();
    for sent in 0..=7 {
        let device = folder.path().join(format!("lp{sent}"));
        // A process has drawn one sheet more than it has sent, and is gone.
        let running = Running::start_to(&format!("raw:{}", device.display()), Limits::default());
        let mut port = testing::device::Device::at(&device);
        let job = ipp::print(running.address, "standard", "seven", &document).unwrap() as u32;
        let job = running.server.data().jobs[&job].clone();
        let mut kept = job.clone();
        kept.ticket = kept.ticket.on(running.server.data().loaded());
        let drawn = running.server.store.sheets(&kept);
        fs::create_dir_all(&drawn).unwrap();
        for number in 1..=(sent + 1).min(7) {
            fs::write(drawn.join(format!("{number:05}.rgl")), row(number)).unwrap();
        }
        for number in 1..=sent {
            let own = running.server.sent().join(job.identity()).join(format!("{number:04}"));
            fs::create_dir_all(&own).unwrap();
            fs::write(own.join("begun"), "").unwrap();
            fs::write(own.join("done"), "").unwrap();
        }
        let printing = running.server.clone();
        std::thread::spawn(move || serve::worker::work(&printing));
        running.until("printed", |running| running.server.data().jobs[&job.id].state.is_over());
        assert_eq!(running.server.data().jobs[&job.id].state, State::Completed);
        let expected: Vec<u8> = (sent + 1..=7).flat_map(row).collect();
        assert!(port.taken() == expected, "behind {sent}");
    }
}

#[test]
fn one_answer_releases_all_jobs_that_wait_for_the_printer_to_be_switched() {
    // A device that takes nothing: its printer has to be switched off and on.
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("lp0");
    std::os::unix::fs::symlink("/dev/full", &device).unwrap();
    let running = Running::start_to(&format!("raw:{}", device.display()), Limits::default());
    let printing = running.server.clone();
    std::thread::spawn(move || serve::worker::work(&printing));
    let jobs: Vec<u32> =
        (0..5).map(|_| ipp::print(running.address, "standard", "leaf", &sheet()).unwrap() as u32).collect();
    let waits = |running: &Running| running.server.data().await_switch().count();
    running.until("held", |running| waits(running) == jobs.len());
    // One that its owner holds is not among them.
    let own = Running::start(Limits::default(), false);
    let held = own.print(&[], &sheet(), State::Pending);
    own.server.hold(held.id).unwrap();
    own.server.switched().unwrap();
    assert_eq!(own.server.data().jobs[&held.id].state, State::Held);
    // Now it takes what comes.
    fs::remove_file(&device).unwrap();
    std::os::unix::fs::symlink("/dev/null", &device).unwrap();
    let to = running.address;
    let told = http(to, &format!("POST /desk/switched HTTP/1.1\r\nHost: {to}\r\n"), b"").unwrap();
    assert_eq!(told.0, 200);
    running.until("printed", |running| {
        let data = running.server.data();
        jobs.iter().all(|job| data.jobs[job].state == State::Completed)
    });
}

/// A finished job of one sheet whose dots cannot be told in fewer bytes than they are.
fn noise(seed: u32) -> Vec<u8> {
    use press::job::stream::write_job;
    use protocol::{ink::Ink, paper::Paper, rgl::Page};
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    let bits = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    });
    let plane = sheet::Plane { width: 800, length: 400, stride: 100, bits: bits.take(100 * 400).collect() };
    let page = Page::plain(Paper::Custom { width: 800, length: 400 });
    let mut bytes = Vec::new();
    let pass = press::separate::Pass { ink: Ink::Black, plane };
    write_job(page, None, &[pass], &mut bytes, &Silent).unwrap();
    bytes
}

#[test]
fn a_full_disk_stops_nothing_for_ever() {
    let name = "stuck::a_full_disk_stops_nothing_for_ever";
    let mounts = "mount -t tmpfs -o size=12m tmpfs";
    let Some(small) = namespace::inside(name, "-rm", mounts) else { return };
    let kept = tempfile::tempdir().unwrap();
    let to = format!("file:{}", kept.path().join("sheets").display());
    let running = Running::begin_in(small.clone(), &to, Limits::default(), true);
    let document: Vec<u8> = (0..60).flat_map(noise).collect();
    let ballast = small.join("ballast");
    // Room for the document and a few of its sheets.
    let fill = |room: u64| {
        let free = files::durable::free(&small).unwrap();
        fs::write(&ballast, vec![7; (free - room) as usize]).unwrap();
    };
    let words = |running: &Running| running.server.data().keywords().join(" ");
    fill(document.len() as u64 + 400_000);
    let job = ipp::print(running.address, "standard", "sixty", &document).unwrap() as u32;
    running.until("full", |running| words(running).contains("spool-area-full"));
    {
        let data = running.server.data();
        assert_eq!(data.jobs[&job].state, State::Pending);
        assert!(
            data.jobs[&job].message.contains("disk of the print server is full"),
            "{:?}",
            data.jobs[&job]
        );
    }
    // Another document is answered for.
    let uri = format!("ipp://{}/ipp/print", running.address);
    let bytes = [ipp::request(ipp::PRINT, &uri, &[], &[]), document.clone()].concat();
    let (status, answer) = ipp::ask(running.address, &bytes).unwrap();
    let text = String::from_utf8_lossy(&answer);
    assert!(status == 0x0505 || status == 0x0507, "{status:04x}: {text}");
    assert!(!text.contains(&*small.to_string_lossy()), "{text}");
    // When there is room it goes on.
    fs::remove_file(&ballast).unwrap();
    running.until("printed", |running| running.server.data().jobs[&job].state == State::Completed);
    assert_eq!(fs::read_dir(kept.path().join("sheets")).unwrap().count(), 60);
    assert_eq!(words(&running), "");
    // What was printed makes room first, and then cancelling.
    running.server.store.clear(job, false).unwrap();
    fill(document.len() as u64 + 400_000);
    let job = ipp::print(running.address, "standard", "sixty", &document).unwrap() as u32;
    running.until("full", |running| words(running).contains("spool-area-full"));
    let free = files::durable::free(&small).unwrap() as usize;
    let _ = fs::write(small.join("rest"), vec![7; free]);
    running.server.cancel(job).unwrap();
    running.until("cancelled", |running| running.server.data().jobs[&job].state == State::Canceled);
    let record = fs::read_to_string(running.server.store.folder(job).join("job.json")).unwrap();
    assert!(record.contains("canceled"), "{record}");
}

#[test]
fn what_is_known_of_the_printer_outlives_a_damaged_file() {
    let folder = tempfile::tempdir().unwrap();
    let begin = || Server::begin(settings(folder.path(), "raw:/dev/null"), Box::new(Silent)).unwrap();
    let postcard = size(protocol::paper::Paper::Postcard);
    let code = {
        let server = begin();
        server.load((Some(postcard), None), None).unwrap();
        server.load((None, Some("film".into())), None).unwrap();
        server.code()
    };
    let kept = folder.path().join("serve");
    fs::write(kept.join("server.json"), "{").unwrap();
    let server = begin();
    assert_eq!(server.code(), code);
    let data = server.data();
    // All but the last change, and that is said.
    assert_eq!((data.loaded().size, data.loaded().kind.as_str()), (postcard, "auto"));
    assert!(data.aside[0].contains("look whether the right sheet is set"), "{:?}", data.aside);
    assert_eq!(fs::read_to_string(kept.join("aside/server.json")).unwrap(), "{");
}

#[test]
fn a_stale_tab_changes_nothing() {
    let running = Running::start(Limits::default(), false);
    let to = running.address;
    let set =
        |query: &str| http(to, &format!("POST /desk/load?{query} HTTP/1.1\r\nHost: {to}\r\n"), b"").unwrap();
    let kind = || running.server.data().loaded().kind.clone();
    assert_eq!(set("kind=film&revision=0").0, 200);
    // Another tab has seen the sheet as it was before, and sets its size.
    let (code, said) = set("size=jpn_hagaki_100x148mm&revision=0");
    assert_eq!(code, 409, "{}", String::from_utf8_lossy(&said));
    assert_eq!(set("size=jpn_hagaki_100x148mm&revision=1").0, 200);
    assert_eq!(kind(), "film");
}

#[test]
fn a_document_that_is_too_large_is_answered() {
    let limits = Limits { document: 100_000, ..Limits::default() };
    let running = Running::start(limits, false);
    let uri = format!("ipp://{}/ipp/print", running.address);
    let document = [b"%PDF-1.4\n".to_vec(), vec![b' '; 150_000]].concat();
    let bytes = [ipp::request(ipp::PRINT, &uri, &[], &[]), document].concat();
    assert_eq!(ipp::ask(running.address, &bytes).unwrap().0, 0x0408);
    assert!(running.server.data().jobs.is_empty());
}

#[test]
fn a_request_says_everything_once() {
    let running = Running::start(Limits::default(), false);
    let to = running.address;
    let two = format!("GET / HTTP/1.1\r\nHost: {to}\r\nHost: evil.example\r\n");
    assert_eq!(http(to, &two, b"").unwrap().0, 400);
    let uri = format!("ipp://{to}/ipp/print");
    let twice = [(0x42, "job-name", &b"one"[..]), (0x42, "job-name", &b"two"[..])];
    let bytes = [ipp::request(ipp::PRINT, &uri, &twice, &[]), sheet()].concat();
    assert_eq!(ipp::ask(to, &bytes).unwrap().0, 0x0400);
}
