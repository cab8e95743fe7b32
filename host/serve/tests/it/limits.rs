//! Clients that are slow, many, foreign or hostile: none of them hinders another one, and nothing fails.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serve::body::Limits;
use serve::jobs::State;
use testing::ipp::{self, CANCEL, PRINT, http, print, request};

use super::Running;

const GET_PRINTER: u16 = 11;

/// A finished job of one sheet.
pub fn sheet() -> Vec<u8> {
    row(0x55)
}

/// A finished job of one sheet whose bytes of dots are these.
pub fn row(dots: u8) -> Vec<u8> {
    use press::job::stream::write_job;
    use protocol::{ink::Ink, paper::Paper, rgl::Page};
    let plane = sheet::Plane { width: 800, length: 400, stride: 100, bits: vec![dots; 100 * 400] };
    let pass = press::separate::Pass { ink: Ink::Black, plane };
    let mut bytes = Vec::new();
    let page = Page::plain(Paper::Custom { width: 800, length: 400 });
    write_job(page, None, &[pass], &mut bytes, &observe::Silent).unwrap();
    bytes
}

fn quick() -> Limits {
    let second = Duration::from_secs(1);
    Limits {
        head: second,
        piece: second,
        body: second,
        pace: 1 << 20,
        document: 100_000,
        ..Limits::default()
    }
}

#[test]
fn foreign_hosts_and_pages_are_refused_whatever_they_ask() {
    let running = Running::start(Limits::default(), false);
    let to = running.address;
    let code = |host: &str, origin: &str, line: &str| {
        let origin = if origin.is_empty() { String::new() } else { format!("Origin: {origin}\r\n") };
        http(to, &format!("{line} HTTP/1.1\r\nHost: {host}\r\n{origin}"), b"").unwrap().0
    };
    let own = to.to_string();
    assert_eq!(code(&own, "", "GET /"), 200);
    assert_eq!(code("workshop.local:8631", "http://workshop.local:8631", "GET /"), 200);
    for (host, origin) in [
        ("evil.example", ""),
        (&own, "http://evil.example"),
        ("evil.example", "http://evil.example"),
        (&own, "null"),
    ] {
        for line in ["GET /", "POST /ipp/print", "POST /desk/load", "GET /desk.json"] {
            assert_eq!(code(host, origin, line), 403, "{line} {host} {origin}");
        }
    }
}

#[test]
fn a_slow_client_loses_its_connection_and_others_do_not_wait() {
    let running = Running::start(quick(), true);
    let to = running.address;
    // One begins a head, one a body, and neither goes on; one sends a body letter by letter.
    let mut lazy: Vec<TcpStream> = (0..3).map(|_| TcpStream::connect(to).unwrap()).collect();
    lazy[0].write_all(b"POST /ipp/pr").unwrap();
    let head = format!(
        "POST /ipp/print HTTP/1.1\r\nHost: {to}\r\nContent-Type: application/ipp\r\nContent-Length: 90000\r\n\r\n"
    );
    let uri = format!("ipp://{to}/ipp/print");
    for stream in &mut lazy[1..] {
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&request(PRINT, &uri, &[], &[])).unwrap();
    }
    let start = Instant::now();
    let job = print(to, "standard", "quick", &sheet()).unwrap();
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    for _ in 0..40 {
        if lazy[2].write_all(b"x").is_err() {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    for mut stream in lazy {
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let mut answer = Vec::new();
        let closed = stream.read_to_end(&mut answer);
        let timed_out = closed.is_err_and(|error| error.kind() == std::io::ErrorKind::WouldBlock);
        assert!(!timed_out, "still open after ten seconds");
    }
    // Of what did not come nothing is left but a record, at most.
    let waits = || {
        running.server.data().jobs.values().any(|job| !job.state.is_over() && job.state != State::Incoming)
    };
    let start = Instant::now();
    while waits() {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(ipp::state(to, job).unwrap(), 9);
}

#[test]
fn what_is_too_large_or_no_ipp_is_refused_and_leaves_no_job() {
    let running = Running::start(Limits { document: 5000, ..Limits::default() }, false);
    let to = running.address;
    let uri = format!("ipp://{to}/ipp/print");
    let ask = |bytes: &[u8]| ipp::ask(to, bytes);
    let with = |document: &[u8]| [request(PRINT, &uri, &[], &[]), document.to_vec()].concat();
    assert_eq!(ask(&with(&[b"%PDF".to_vec(), vec![0; 9000]].concat())).unwrap().0, 0x0408);
    assert_eq!(ask(&with(b"hello")).unwrap().0, 0x040a);
    assert_eq!(ask(&with(b"")).unwrap().0, 0x0400);
    let other = request(PRINT, &uri, &[(0x49, "document-format", b"text/html")], &[]);
    assert_eq!(ask(&other).unwrap().0, 0x040a);
    let strict = request(
        PRINT,
        &uri,
        &[(0x22, "ipp-attribute-fidelity", &[1])],
        &[(0x44, "sides", b"two-sided-long-edge")],
    );
    assert_eq!(ask(&strict).unwrap().0, 0x040b);
    let nobody = request(PRINT, &format!("ipp://{to}/ipp/print/nobody"), &[], &[]);
    assert_eq!(ask(&nobody).unwrap().0, 0x0406);
    assert_eq!(ask(&request(0x4001, &uri, &[], &[])).unwrap().0, 0x0501);
    // No IPP at all; a message cut off; a collection without an end.
    for wrong in
        [&b"hello, is this a printer?"[..], &with(b"")[..40], &[&with(b"")[..80], &[0x34; 400][..]].concat()]
    {
        assert!(ask(wrong).is_err());
    }
    let many = vec![(0x44, "requested-attributes", &[b'x'; 200][..]); 2000];
    assert!(ask(&request(GET_PRINTER, &uri, &many, &[])).is_err());
    assert_eq!(ask(&request(GET_PRINTER, &uri, &[], &[])).unwrap().0, 0);
    assert_eq!(running.server.data().jobs.len(), 0);
    assert_eq!(std::fs::read_dir(running.path("serve/jobs")).unwrap().count(), 0);
}

#[test]
fn sixty_four_clients_at_once_are_all_served() {
    let running = Running::start(Limits::default(), true);
    let to = running.address;
    let document = sheet();
    let gate = std::sync::Barrier::new(64);
    let mut jobs: Vec<i32> = std::thread::scope(|scope| {
        let client = |number: usize| {
            let (gate, document) = (&gate, &document);
            scope.spawn(move || {
                gate.wait();
                print(to, "standard", &format!("client {number}"), document).unwrap()
            })
        };
        let clients: Vec<_> = (0..64).map(client).collect();
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    jobs.sort_unstable();
    jobs.dedup();
    assert_eq!(jobs.len(), 64);
    let start = Instant::now();
    while running.server.data().open() > 0 {
        assert!(start.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(50));
    }
    let sheets = std::fs::read_dir(running.path("sheets")).unwrap();
    let whole = sheets.filter(|entry| std::fs::read(entry.as_ref().unwrap().path()).unwrap() == document);
    assert_eq!(whole.count(), 64);
}

#[test]
fn a_job_is_cancelled_held_and_released_in_every_state_before_it_is_printed() {
    let running = Running::start(Limits::default(), false);
    let to = running.address;
    let uri = format!("ipp://{to}/ipp/print");
    let on = |operation: u16, job: i32| {
        ipp::ask(to, &request(operation, &uri, &[(0x21, "job-id", &job.to_be_bytes())], &[])).unwrap().0
    };
    let (hold, release) = (12, 13);
    let job = print(to, "standard", "one", &sheet()).unwrap();
    assert_eq!(ipp::state(to, job).unwrap(), 3);
    assert_eq!((on(hold, job), ipp::state(to, job).unwrap()), (0, 4));
    assert_eq!((on(release, job), ipp::state(to, job).unwrap()), (0, 3));
    assert_eq!((on(CANCEL, job), ipp::state(to, job).unwrap()), (0, 7));
    assert_eq!((on(CANCEL, job), on(hold, job), on(release, job)), (0x0404, 0x0404, 0x0404));
    // Its document is gone, its record is not.
    let folder = running.path(&format!("serve/jobs/{job}"));
    assert_eq!(testing::program::entries(&folder), ["job.json"]);
    // One whose document has not come.
    let (status, answer) = ipp::ask(to, &request(5, &uri, &[], &[])).unwrap();
    let empty = ipp::number(&answer, "job-id").unwrap();
    assert_eq!((status, ipp::state(to, empty).unwrap()), (0, 4));
    assert_eq!((on(CANCEL, empty), ipp::state(to, empty).unwrap()), (0, 7));
    assert_eq!(on(CANCEL, 4711), 0x0406);
}
