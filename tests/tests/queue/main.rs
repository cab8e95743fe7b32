//! A real print server, the program as its backend and filter, a bridge on a socket: what users of a queue do and see.
#![cfg(unix)]

#[path = "../../../bridge/tests/model/mod.rs"]
mod model;

mod bridge;
mod server;
mod system;

use bridge::Bridge;
use foilpress::inspect::{inspect, sheets};
use foilpress::job::stream::write_job;
use foilpress::observe::Silent;
use foilpress::separate::{Pass, Plane};
use foilpress::simulate::{Setup, print};
use model::{is_a_whole_job, seeded};
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use rand::Rng;
use server::Server;
use std::fs;
use std::sync::atomic::Ordering;

/// As fast as the test goes.
const FAST: usize = 1 << 20;

/// A job of random dots on A4, about `rows` x 300 bytes a pass.
fn job(seed: u64, inks: &[Ink], rows: usize) -> Vec<u8> {
    let mut random = seeded(seed);
    let passes: Vec<Pass> = inks
        .iter()
        .map(|&ink| {
            let mut bits = vec![0u8; 600 * 6372];
            for row in bits.chunks_exact_mut(600).skip(100).take(rows) {
                random.fill_bytes(&mut row[50..350]);
            }
            Pass { ink, plane: Plane { width: 4800, length: 6372, stride: 600, bits } }
        })
        .collect();
    let mut bytes = Vec::new();
    write_job(Page::plain(Paper::A4), None, &passes, &mut bytes, &Silent).unwrap();
    bytes
}

/// A document of one A4 page for each text of drawing commands, with their table of places as a PDF has it.
fn pdf(pages: &[&str]) -> Vec<u8> {
    let mut objects = vec!["<</Type/Catalog/Pages 2 0 R>>".to_owned()];
    let kids: Vec<String> = (0..pages.len()).map(|i| format!("{} 0 R", 3 + 2 * i)).collect();
    objects.push(format!("<</Type/Pages/Kids[{}]/Count {}>>", kids.join(" "), pages.len()));
    for (i, drawing) in pages.iter().enumerate() {
        objects.push(format!(
            "<</Type/Page/Parent 2 0 R/MediaBox[0 0 595 842]/Resources<<>>/Contents {} 0 R>>",
            4 + 2 * i
        ));
        objects.push(format!("<</Length {}>>\nstream\n{drawing}\nendstream", drawing.len()));
    }
    let mut text = String::from("%PDF-1.4\n");
    let mut places = String::new();
    for (i, object) in objects.iter().enumerate() {
        places.push_str(&format!("{:010} 00000 n \n", text.len()));
        text.push_str(&format!("{} 0 obj\n{object}\nendobj\n", i + 1));
    }
    let at = text.len();
    let count = objects.len() + 1;
    text.push_str(&format!(
        "xref\n0 {count}\n0000000000 65535 f \n{places}trailer\n<</Size {count}/Root 1 0 R>>\nstartxref\n{at}\n%%EOF\n"
    ));
    text.into_bytes()
}

/// The passes of what crossed the port, sheet by sheet, as the simulated printer printed them.
fn printed(bridge: &Bridge) -> Vec<Vec<Pass>> {
    let bytes = bridge.printed();
    sheets(&bytes)
        .into_iter()
        .map(|place| {
            print(&bytes[place.clone()], &Setup::default(), &Silent).unwrap();
            inspect(&bytes[place], &Silent).passes
        })
        .collect()
}

/// Columns and rows of the rectangle around the dots of an ink, ends excluded, and the number of dots.
fn extent(sheet: &[Pass], ink: Ink) -> ([usize; 4], u64) {
    let Some(pass) = sheet.iter().find(|pass| pass.ink == ink) else { return ([0; 4], 0) };
    let plane = &pass.plane;
    let mut sides = [usize::MAX, usize::MAX, 0, 0];
    for y in 0..plane.length {
        for x in (0..plane.width).filter(|x| plane.bits[y * plane.stride + x / 8] << (x % 8) & 0x80 != 0) {
            sides = [sides[0].min(x), sides[1].min(y), sides[2].max(x + 1), sides[3].max(y + 1)];
        }
    }
    (sides, plane.dots())
}

/// Whether two rectangles are alike within two dots at each end: the page is no whole number of dots long, and a dot that
/// is only touched is drawn.
fn near(found: [usize; 4], expected: [usize; 4]) -> bool {
    found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 2)
}

macro_rules! server {
    () => {
        match server::missing() {
            None => Server::start(),
            Some(why) => return println!("{why}"),
        }
    };
}

#[test]
fn a_pdf_comes_out_as_the_sheets_it_draws() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/art.pdf");
    // Black from (120, 240) to (360, 480) points; on the other page a square of pure magenta.
    fs::write(&file, pdf(&["0 g 120 240 240 240 re f", "1 0 1 rg 300 300 60 60 re f"])).unwrap();
    let job = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(job), "completed");
    let sheets = printed(&bridge);
    assert_eq!(sheets.len(), 2);
    // 600 / 72 dots a point; the machine's margins are 80 dots at the left and 284 at the top.
    let top = 842 * 600 / 72 - 284;
    let (sides, dots) = extent(&sheets[0], Ink::Black);
    assert!(near(sides, [1000 - 80, top - 4000, 3000 - 80, top - 2000]), "{sides:?}");
    // Solid, and nothing else on the page.
    assert_eq!(dots, ((sides[2] - sides[0]) * (sides[3] - sides[1])) as u64);
    assert_eq!(sheets[0].len(), 1);
    let (sides, dots) = extent(&sheets[1], Ink::Magenta);
    assert!(sides[0].abs_diff(2420) < 20 && sides[1].abs_diff(top - 3000) < 20, "{sides:?}");
    assert!((200_000..270_000).contains(&dots), "{dots} of 250000 dots");
    // The print system has counted them.
    assert_eq!(server.job(job, "job-media-sheets-completed"), "2");
    // Copies are sheets of their own.
    let before = bridge.printed().len();
    let job = server.print(&["-d", "Alps", "-n", "2", "-o", "page-ranges=2", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(job), "completed");
    let bytes = bridge.printed().split_off(before);
    let copies = foilpress::inspect::sheets(&bytes);
    assert_eq!(copies.len(), 2);
    assert!(bytes[copies[0].clone()] == bytes[copies[1].clone()]);
}

#[test]
fn a_picture_comes_out_in_its_colours_where_they_are() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/four.png");
    let picture = image::RgbImage::from_fn(300, 420, |x, y| {
        image::Rgb(match (x < 150, y < 210) {
            (true, true) => [0, 255, 255],
            (false, true) => [255, 0, 255],
            (true, false) => [255, 255, 0],
            (false, false) => [255, 255, 255],
        })
    });
    picture.save(&file).unwrap();
    let job = server.print(&[
        "-d",
        "Alps",
        "-o",
        "fit-to-page",
        "-o",
        "FoilpressWhite=Opaque",
        file.to_str().unwrap(),
    ]);
    assert_eq!(server.wait_for_job(job), "completed");
    let [sheet] = &printed(&bridge)[..] else { panic!("more or less than one sheet") };
    let inks: Vec<Ink> = sheet.iter().map(|pass| pass.ink).collect();
    assert_eq!(inks[0], Ink::White, "white lies beneath: {inks:?}");
    // Quarters of the rectangle around all dots of white, which lies where the picture is not white.
    let (sides, _) = extent(sheet, Ink::White);
    let middle = [(sides[0] + sides[2]) / 2, (sides[1] + sides[3]) / 2];
    let share = |ink: Ink, right: bool, below: bool| {
        let plane = &sheet.iter().find(|pass| pass.ink == ink).unwrap().plane;
        let (x0, x1) = if right { (middle[0] + 20, sides[2] - 20) } else { (sides[0] + 20, middle[0] - 20) };
        let (y0, y1) = if below { (middle[1] + 20, sides[3] - 20) } else { (sides[1] + 20, middle[1] - 20) };
        let dots = (y0..y1)
            .flat_map(|y| (x0..x1).map(move |x| (x, y)))
            .filter(|(x, y)| plane.bits[y * plane.stride + x / 8] << (x % 8) & 0x80 != 0)
            .count();
        dots as f64 / ((x1 - x0) * (y1 - y0)) as f64
    };
    for (ink, right, below) in
        [(Ink::Cyan, false, false), (Ink::Magenta, true, false), (Ink::Yellow, false, true)]
    {
        assert!(share(ink, right, below) > 0.6, "{}: {}", ink.name(), share(ink, right, below));
        assert!(share(Ink::White, right, below) > 0.999, "white beneath {}", ink.name());
        assert_eq!(share(ink, true, true), 0.0, "{} on bare paper", ink.name());
    }
    assert_eq!(share(Ink::White, true, true), 0.0);
}

#[test]
fn a_raw_job_is_printed_byte_for_byte_as_often_as_asked() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(1, &[Ink::White, Ink::Cyan], 200);
    fs::write(&file, &bytes).unwrap();
    // Known by its first bytes, and named as raw.
    let known = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(known), "completed");
    assert!(bridge.printed() == bytes);
    let raw = server.print(&["-d", "Alps", "-n", "2", "-o", "raw", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(raw), "completed");
    assert!(bridge.printed() == bytes.repeat(3));
    assert_eq!(server.job(raw, "job-media-sheets-completed"), "2");
    // White is not among the cassettes of this printer, which was said before; nothing is left of it.
    assert!(server.log().contains("not loaded: white (MDC-SCWH, barcode 16)"), "{}", server.log());
    assert!(server.state("Alps").contains("Alerts: none"), "{}", server.state("Alps"));
}

#[test]
fn a_stream_of_ghostscripts_driver_is_printed_as_it_is_page_by_page() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let (source, file) = (server.path("files/art.pdf"), server.path("files/art.md5k"));
    fs::write(&source, pdf(&["0 g 120 240 240 240 re f", "1 0 1 rg 300 300 60 60 re f"])).unwrap();
    let output = format!("-sOutputFile={}", file.display());
    server.say(
        "gs",
        &["-q", "-dBATCH", "-dNOPAUSE", "-sDEVICE=md5k", "-r600", &output, source.to_str().unwrap()],
    );
    let bytes = fs::read(&file).unwrap();
    // What is understood of it, against what was drawn.
    let places = sheets(&bytes);
    assert_eq!(places.len(), 2);
    let seen = inspect(&bytes[places[0].clone()], &Silent);
    assert_eq!((seen.inspection.dialect, seen.inspection.complete), (Some("Ghostscript"), true));
    let top = 842 * 600 / 72 - 284;
    let (sides, dots) = extent(&seen.passes, Ink::Black);
    assert!(near(sides, [1000 - 80, top - 4000, 3000 - 80, top - 2000]), "{sides:?}");
    assert!(dots.abs_diff(2000 * 2000) < 5000, "{dots}");

    let job = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes);
    assert_eq!(server.job(job, "job-media-sheets-completed"), "2");
}

#[test]
fn what_is_no_job_never_reaches_the_printer() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/cut.rgl");
    let mut bytes = job(2, &[Ink::Cyan], 50);
    bytes.truncate(bytes.len() - 20);
    fs::write(&file, &bytes).unwrap();
    let job = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(job), "canceled");
    assert!(bridge.printed().is_empty());
    assert!(server.log().contains("not one whole job"), "{}", server.log());
}

#[test]
fn a_cancelled_job_leaves_a_printer_that_is_ready_for_the_next() {
    let server = server!();
    let bridge = Bridge::start(100);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/long.rgl");
    let long = job(3, &[Ink::Cyan, Ink::Magenta], 3000);
    fs::write(&file, &long).unwrap();
    let cancelled = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    server.wait_for("some rows", |_| bridge.printed().len() > 20_000);
    server.say("cancel", &[&format!("Alps-{cancelled}")]);
    assert_eq!(server.wait_for_job(cancelled), "canceled");
    let next = job(4, &[Ink::Black], 20);
    fs::write(&file, &next).unwrap();
    bridge.port.rate.store(FAST, Ordering::Relaxed);
    let job = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    assert_eq!(server.wait_for_job(job), "completed");
    let bytes = bridge.printed();
    let (first, second) = bytes.split_at(bytes.len() - next.len());
    assert!(first.len() < long.len() / 2 && is_a_whole_job(first), "{} bytes", first.len());
    assert!(second == next);
}

#[test]
fn an_empty_tray_is_shown_and_the_job_goes_on_when_it_is_filled() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(5, &[Ink::Cyan], 300);
    fs::write(&file, &bytes).unwrap();
    bridge.port.paper.store(false, Ordering::Relaxed);
    let job = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    server.wait_for("the alert", |server| server.state("Alps").contains("media-empty-error"));
    let state = server.state("Alps");
    assert!(state.contains("the printer is out of paper: load a sheet"), "{state}");
    assert_eq!(server.job(job, "job-state"), "processing");
    bridge.port.paper.store(true, Ordering::Relaxed);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes);
    assert!(server.state("Alps").contains("Alerts: none"), "{}", server.state("Alps"));
}

#[test]
fn without_its_bridge_a_job_waits_and_says_so_until_it_is_plugged_in_or_the_job_cancelled() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    let address = bridge.address;
    server.queue("Alps", &bridge.uri());
    drop(bridge);
    let file = server.path("files/job.rgl");
    let bytes = job(6, &[Ink::Cyan], 30);
    fs::write(&file, &bytes).unwrap();
    let cancelled = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    server.wait_for("the alert", |server| server.state("Alps").contains("offline-report"));
    let state = server.state("Alps");
    assert!(state.contains("connecting-to-device") && state.contains("is the bridge plugged in?"), "{state}");
    assert!(state.contains("now printing"), "the queue does not stop: {state}");
    server.say("cancel", &[&format!("Alps-{cancelled}")]);
    assert_eq!(server.wait_for_job(cancelled), "canceled");

    let job = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    server.wait_for("the alert", |server| server.state("Alps").contains("offline-report"));
    let bridge = Bridge::at(address, FAST);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes, "the cancelled one is not printed");
    assert!(server.state("Alps").contains("Alerts: none"), "{}", server.state("Alps"));
}

#[test]
fn after_a_crash_of_the_print_system_a_job_goes_on_where_the_printer_is() {
    let mut server = server!();
    let bridge = Bridge::start(100);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(7, &[Ink::Cyan, Ink::Magenta], 1500);
    fs::write(&file, &bytes).unwrap();
    let job = server.print(&["-d", "Alps", "-n", "2", "-o", "raw", file.to_str().unwrap()]);
    // In the middle of the second sheet.
    bridge.port.rate.store(2000, Ordering::Relaxed);
    server.wait_for("the second sheet", |_| bridge.printed().len() > bytes.len() + 100_000);
    bridge.port.rate.store(100, Ordering::Relaxed);
    // The server writes what it knows with some delay; jobs it has forgotten cannot go on.
    server.wait_for("the server to save its jobs", |server| server.path("cache/job.cache").exists());
    server.kill();
    bridge.port.rate.store(FAST, Ordering::Relaxed);
    server.run();
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes.repeat(2), "{} of {} bytes", bridge.printed().len(), 2 * bytes.len());
}

#[test]
fn a_sheet_lost_with_its_bridge_is_held_and_printed_again_only_when_released() {
    let server = server!();
    let bridge = Bridge::start(100);
    let address = bridge.address;
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(9, &[Ink::Cyan], 1000);
    fs::write(&file, &bytes).unwrap();
    let job = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    server.wait_for("some rows", |_| bridge.printed().len() > 20_000);
    drop(bridge);
    let bridge = Bridge::at(address, FAST);
    server.wait_for("the job to be held", |server| server.job(job, "job-state") == "pending-held");
    assert!(bridge.printed().is_empty());
    assert!(server.log().contains("release it to print this sheet again"), "{}", server.log());
    server.say("lp", &["-i", &format!("Alps-{job}"), "-H", "resume"]);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes);
}

#[test]
fn a_stopped_queue_ends_its_sheet_and_begins_it_anew_when_it_is_started() {
    let server = server!();
    let bridge = Bridge::start(100);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(8, &[Ink::Cyan], 2000);
    fs::write(&file, &bytes).unwrap();
    let job = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    server.wait_for("some rows", |_| bridge.printed().len() > 20_000);
    server.say("cupsdisable", &["Alps"]);
    server.wait_for("the end of the sheet", |_| is_a_whole_job(&bridge.printed()));
    let first = bridge.printed().len();
    assert!(first < bytes.len());
    assert_eq!(server.job(job, "job-state"), "pending");
    bridge.port.rate.store(FAST, Ordering::Relaxed);
    server.say("cupsenable", &["Alps"]);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed()[first..] == bytes);
}

#[test]
fn the_print_system_finds_the_backend_and_takes_the_printer_description() {
    let server = server!();
    let found = server.say("lpinfo", &["-v"]);
    assert!(found.lines().any(|line| line.contains("foilpress")), "{found}");
    let description = server.path("files").join(foilpress::queue::install::DESCRIPTION);
    // The print system's own judge; the filters it looks for are not in the system's folders.
    let judged =
        server.command("cupstestppd", &["-I", "filters", "-W", "none", description.to_str().unwrap()]);
    assert!(judged.status.success(), "{}", String::from_utf8_lossy(&judged.stdout));
}
