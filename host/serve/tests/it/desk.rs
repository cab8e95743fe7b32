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
    let scripts = ["/desk/desk.js", "/desk/ask.js", "/desk/sheet.js", "/desk/ticket.js", "/desk/lists.js"];
    for page in ["/", "/desk.css", "/icon.png", "/desk.json"].into_iter().chain(scripts) {
        assert_eq!(ask(&running, &format!("GET {page}"), b"").0, 200, "{page}");
    }
    let (code, said) = ask(&running, "POST /desk/print?printer=standard&name=leaf.rgl", &sheet());
    assert!(code == 200 && said.starts_with(r#"{"job":1,"key":""#), "{said}");
    // It waits until somebody has seen what it takes.
    let (code, plan) = ask(&running, "POST /desk/plan?job=1", b"");
    assert_eq!(code, 200, "{plan}");
    assert!(plan.contains(r#""ink":"black""#) && plan.contains(r#""dots":160000"#), "{plan}");
    assert_eq!(ask(&running, "GET /desk/preview.png?job=1", b"").0, 200);
    // Dots of finished jobs are placed already.
    assert!(plan.contains(r#""is_drawn":false"#) && plan.contains(r#""lies_mm":null"#), "{plan}");
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

/// A page with a black mark of 30 x 10 mm in the middle.
fn picture() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mark = |x: u32, y: u32| (100..200).contains(&x) && (80..120).contains(&y);
    image::RgbImage::from_fn(300, 200, |x, y| image::Rgb([if mark(x, y) { 0 } else { 255 }; 3]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

#[test]
fn what_is_changed_at_the_desk_is_seen_there_and_printed() {
    let running = Running::start(Limits::default(), true);
    ask(&running, "POST /desk/print?printer=standard&name=mark.png", &picture());
    let plan = |page: &str| {
        let (code, text) = ask(&running, &format!("POST /desk/plan?job=1{page}"), b"");
        assert_eq!(code, 200, "{text}");
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let first = plan("");
    // As large as fits, for it states no resolution.
    assert!(first["lies_mm"][2].as_f64().unwrap() > 150.0, "{first}");
    let change = |query: &str| ask(&running, &format!("POST /desk/change?job=1&{query}"), b"");
    assert_eq!(change("wide=90&at=20,30&orientation=3&FoilpressWhite=Under&white-passes=2&copies=2").0, 200);
    let second = plan("");
    let lies = [0, 1, 2, 3].map(|side| second["lies_mm"][side].as_f64().unwrap());
    // Whole dots.
    assert!(lies.iter().zip([20.0, 30.0, 90.0, 60.0]).all(|(a, b)| (a - b).abs() < 0.04), "{lies:?}");
    let inks: Vec<&str> =
        second["passes"].as_array().unwrap().iter().map(|pass| pass["ink"].as_str().unwrap()).collect();
    assert_eq!(inks, ["white", "white", "black"]);
    assert_eq!(
        (&second["ticket"]["wide"], &second["ticket"]["copies"]),
        (&serde_json::Value::Null, &"2".into())
    );
    // A view of the mark alone, dot for dot, without white and on black; the mark is 30 mm from the page's
    // edge.
    let dots = |mm: f64, corner: f64| ((mm - corner) * 600.0 / 25.4).round() as u32;
    let (x, y) = (dots(50.0, 3.387), dots(54.0, 12.023));
    let view = |without: &str| {
        let query = format!(
            "job=1&ground=%23ffffff&without={without}&left={}&top={}&width=20&length=20",
            x - 10,
            y - 10
        );
        let to = running.address;
        let head = format!("GET /desk/preview.png?{query} HTTP/1.1\r\nHost: {to}\r\n");
        image::load_from_memory(&http(to, &head, b"").unwrap().1).unwrap().into_rgb8()
    };
    let seen = view("white");
    assert_eq!((seen.dimensions(), seen.get_pixel(3, 3).0), ((20, 20), [255; 3]));
    assert!(seen.get_pixel(16, 16).0.iter().all(|&v| v < 60), "{:?}", seen.get_pixel(16, 16));
    assert_eq!(view("white,black").get_pixel(16, 16).0, [255; 3]);
    // What cannot be is told, and changes nothing.
    for wrong in ["copies=0", "printer=nobody", "FoilpressWhite=Everywhere", "colour=red", "at=1"] {
        let (code, said) = change(wrong);
        assert_eq!(code, 409, "{wrong}: {said}");
    }
    assert_eq!(plan("&page=9")["page"], 1);
    assert_eq!(ask(&running, "POST /desk/release?job=1", b"").0, 200);
    let over = |job: u32| running.server.data().jobs[&job].state.is_over();
    let start = Instant::now();
    while !over(1) {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(20));
    }
    let job = running.server.data().jobs[&1].clone();
    let [one, two] = &running.sheets_of(&job)[..] else { panic!("not two sheets") };
    assert_eq!(one, two);
    let found = press::inspect::inspect(one, &observe::Silent).inspection;
    let black = found.passes.last().unwrap().bounds.unwrap();
    assert!(black.x.abs_diff(x as usize) <= 1 && black.y.abs_diff(y as usize) <= 1, "{black:?}");
    // It is not changed any more, but printed again, and its picture stays.
    assert_eq!(change("copies=1").0, 409);
    assert_eq!(ask(&running, "GET /desk/picture.png?job=1", b"").0, 200);
    let (code, said) = ask(&running, "POST /desk/again?job=1", b"");
    assert!(code == 200 && said.starts_with(r#"{"job":2"#), "{said}");
    let again = running.server.data().jobs[&2].clone();
    assert_eq!((again.state, again.ticket.at), (serve::jobs::State::Held, Some((2000, 3000))));
    assert_eq!(ask(&running, "POST /desk/plan?job=2", b"").0, 200);
    // Without its document it is not.
    running.server.store.clear(1, false).unwrap();
    assert_eq!(ask(&running, "POST /desk/again?job=1", b"").0, 422);
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
