//! What the page of the server asks for, as a browser sends it.

use std::time::{Duration, Instant};

use serve::body::Limits;
use testing::ipp::http;

use super::Running;
use super::limits::sheet;

/// A request of the server's own page: its code and its text.
fn ask(running: &Running, line: &str, body: &[u8]) -> (u16, String) {
    let to = running.address;
    let head = format!("{line} HTTP/1.1\r\nHost: {to}\r\nOrigin: http://{to}\r\n");
    let (code, bytes) = http(to, &head, body).unwrap();
    (code, String::from_utf8_lossy(&bytes).into_owned())
}

#[test]
fn a_file_is_looked_at_before_it_is_printed() {
    let running = Running::start(Limits::default(), true);
    for page in ["/", "/desk.js", "/desk.css", "/icon.png", "/desk.json"] {
        assert_eq!(ask(&running, &format!("GET {page}"), b"").0, 200, "{page}");
    }
    let (code, said) = ask(&running, "POST /desk/print?printer=standard&name=leaf.rgl", &sheet());
    assert!(code == 200 && said.starts_with(r#"{"job":1,"key":""#), "{said}");
    // It waits until somebody has seen what it takes.
    let (code, plan) = ask(&running, "POST /desk/plan?job=1", b"");
    assert_eq!(code, 200, "{plan}");
    assert!(plan.contains(r#""ink":"black""#) && plan.contains(r#""dots":160000"#), "{plan}");
    assert_eq!(ask(&running, "GET /desk/preview.png?job=1", b"").0, 200);
    assert!(!running.path("sheets").exists());
    assert!(ask(&running, "GET /desk.json", b"").1.contains(r#""state":"held""#));
    assert_eq!(ask(&running, "POST /desk/release?job=1", b"").0, 200);
    let start = Instant::now();
    while running.server.data().open() > 0 {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(20));
    }
    let [Ok(kept)] = &std::fs::read_dir(running.path("sheets")).unwrap().collect::<Vec<_>>()[..] else {
        panic!("more or less than one sheet")
    };
    assert_eq!(std::fs::read(kept.path()).unwrap(), sheet());
    // What is no document leaves no job, and a job that is over is not cancelled.
    assert_eq!(ask(&running, "POST /desk/print?printer=standard", b"hello").0, 422);
    assert_eq!(ask(&running, "POST /desk/print?printer=nobody", b"hello").0, 404);
    assert_eq!(ask(&running, "POST /desk/cancel?job=1", b"").0, 409);
    assert_eq!(running.server.data().jobs.len(), 1);
}

#[test]
fn the_loaded_sheet_is_what_dialogs_are_told() {
    let running = Running::start(Limits::default(), false);
    let load = |query: &str| ask(&running, &format!("POST /desk/load?{query}"), b"").0;
    assert_eq!(load("size=jpn_hagaki_100x148mm&kind=film"), 200);
    assert_eq!(
        (load("size=iso_a0_841x1189mm&kind=film"), load("size=iso_a4_210x297mm&kind=gold"), load("")),
        (409, 409, 409)
    );
    let about = ask(&running, "GET /desk.json", b"").1;
    assert!(about.contains(r#""kind":"film","revision":1,"size":"jpn_hagaki_100x148mm""#), "{about}");
    let uri = format!("ipp://{}/ipp/print", running.address);
    let (_, answer) = testing::ipp::ask(running.address, &testing::ipp::request(11, &uri, &[], &[])).unwrap();
    let text = String::from_utf8_lossy(&answer);
    assert!(text.contains("media-ready\0\u{14}jpn_hagaki_100x148mm"));
}
