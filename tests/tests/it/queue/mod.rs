//! A real print server, the program as its backend and filter, a bridge on a socket: what users of a queue do and see.

mod bridge;
pub(crate) mod server;
mod system;

use bridge::Bridge;
use model::{is_a_whole_job, seeded};
use observe::Silent;
use press::inspect::{inspect, sheets};
use press::job::stream::write_job;
use press::layout::Profile;
use press::separate::Pass;
use press::simulate::{Setup, print};
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use rand::Rng;
use server::Server;
use sheet::Plane;
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

/// A document of one A4 page for each text of drawing commands.
fn pdf(pages: &[&str]) -> Vec<u8> {
    document((595, 842), "", pages)
}

/// A document of pages of a size in points, with what they draw with, and the table of places a PDF has.
pub(crate) fn document((width, length): (u32, u32), resources: &str, pages: &[&str]) -> Vec<u8> {
    let mut objects = vec!["<</Type/Catalog/Pages 2 0 R>>".to_owned()];
    let kids: Vec<String> = (0..pages.len()).map(|i| format!("{} 0 R", 3 + 2 * i)).collect();
    objects.push(format!("<</Type/Pages/Kids[{}]/Count {}>>", kids.join(" "), pages.len()));
    for (i, drawing) in pages.iter().enumerate() {
        objects.push(format!(
            "<</Type/Page/Parent 2 0 R/MediaBox[0 0 {width} {length}]/Resources<<{resources}>>/Contents {} 0 R>>",
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
pub(crate) fn extent(sheet: &[Pass], ink: Ink) -> ([usize; 4], u64) {
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
        if server::available() { Server::start() } else { return }
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
    let copies = press::inspect::sheets(&bytes);
    assert_eq!(copies.len(), 2);
    assert!(bytes[copies[0].clone()] == bytes[copies[1].clone()]);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
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
        // A picture keeps its hues: the magenta of a screen is bluer than the ink, and takes cyan too.
        assert!(share(ink, right, below) > 0.5, "{}: {}", ink.name(), share(ink, right, below));
        assert!(share(Ink::White, right, below) > 0.999, "white beneath {}", ink.name());
        assert_eq!(share(ink, true, true), 0.0, "{} on bare paper", ink.name());
    }
    assert_eq!(share(Ink::White, true, true), 0.0);
}

/// A sheet of 4 x 4 inches in points, and as the print system is asked for it.
const CARD: (u32, u32) = (288, 288);
const CARD_MEDIA: &str = "media=Custom.4x4in";

/// Where a rectangle of a page lies on its sheet: from points, counted from the lower left, to dots from the corner of
/// the printable area.
fn on_card([left, bottom, right, top]: [i64; 4]) -> [usize; 4] {
    let dots = |points: i64| points * 600 / 72;
    [
        dots(left) - 80,
        dots(i64::from(CARD.1) - top) - 284,
        dots(right) - 80,
        dots(i64::from(CARD.1) - bottom) - 284,
    ]
    .map(|side| side as usize)
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn spot_colours_that_name_inks_are_printed_in_them_and_others_in_process_inks() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let tint = |cmyk: &str| format!("<</FunctionType 2/Domain[0 1]/C0[0 0 0 0]/C1[{cmyk}]/N 1>>");
    let spaces = format!(
        "/ColorSpace<</Au[/Separation/Gold/DeviceCMYK {}]/Wh[/Separation/Spot#20White/DeviceCMYK {}]\
         /Pa[/Separation/PANTONE#20Red#20032/DeviceCMYK {}]>>",
        tint("0 .2 .8 .1"),
        tint(".1 0 0 0"),
        tint("0 1 0 0")
    );
    let art =
        "/Wh cs 1 scn 40 100 120 60 re f /Au cs 1 scn 60 110 40 40 re f /Pa cs 1 scn 170 100 30 60 re f";
    let file = server.path("files/spots.pdf");
    // The second page has none, and the third one of a foil, which is never printed unasked.
    let foil = spaces.replace("/Gold/", "/Gold#20Foil/");
    fs::write(&file, document(CARD, &spaces, &[art, "0 g 60 110 40 40 re f"])).unwrap();
    let file = file.to_str().unwrap();
    let job = server.print(&["-d", "Alps", "-o", CARD_MEDIA, file]);
    assert_eq!(server.wait_for_job(job), "completed");
    let sheets = printed(&bridge);
    assert_eq!(sheets.len(), 2);
    let inks: Vec<Ink> = sheets[0].iter().map(|pass| pass.ink).collect();
    assert_eq!(inks.len(), 3, "{inks:?}");
    for (ink, place) in [(Ink::MetallicGold, [60, 110, 100, 150]), (Ink::Magenta, [170, 100, 200, 160])] {
        let (sides, dots) = extent(&sheets[0], ink);
        assert!(near(sides, on_card(place)), "{}: {sides:?}, not {:?}", ink.name(), on_card(place));
        assert_eq!(dots, ((sides[2] - sides[0]) * (sides[3] - sides[1])) as u64, "{} is solid", ink.name());
    }
    // Gold is drawn over white, which a page knocks out.
    let (sides, _) = extent(&sheets[0], Ink::White);
    assert!(near(sides, on_card([40, 100, 160, 160])), "{sides:?}");
    assert_eq!(sheets[1].iter().map(|pass| pass.ink).collect::<Vec<_>>(), [Ink::Black]);

    let wanted = server.path("files/foil.pdf");
    fs::write(&wanted, document(CARD, &foil, &[art])).unwrap();
    let before = bridge.printed().len();
    let wanted = wanted.to_str().unwrap();
    let refused = server.print(&["-d", "Alps", "-o", CARD_MEDIA, wanted]);
    assert_ne!(server.wait_for_job(refused), "completed");
    assert!(server.log().contains("FoilpressFoils=On"), "{}", server.log());
    assert_eq!(bridge.printed().len(), before);
    server.say("cupsenable", &["Alps"]);
    let asked = server.print(&["-d", "Alps", "-o", CARD_MEDIA, "-o", "FoilpressFoils=On", wanted]);
    assert_eq!(server.wait_for_job(asked), "completed");
    let bytes = bridge.printed().split_off(before);
    let foil = inspect(&bytes, &Silent).passes;
    assert!(foil.iter().any(|pass| pass.ink == Ink::GoldFoil));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_sheet_of_any_size_is_printed_where_the_user_wants_it_by_a_machine_that_is_not_exact() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let machine = Profile { offset_mm: [0.508, -0.254], ..Profile::default() };
    server.queue_of("Off", &bridge.uri(), &machine);
    let file = server.path("files/mark.pdf");
    let mark = [60, 110, 100, 180];
    fs::write(&file, document(CARD, "", &["0 g 60 110 40 70 re f"])).unwrap();
    let mut seen = 0;
    let mut extent_with = |queue: &str, options: &[&str]| {
        let mut arguments = vec!["-d", queue, "-o", CARD_MEDIA];
        options.iter().for_each(|option| arguments.extend(["-o", option]));
        arguments.push(file.to_str().unwrap());
        let job = server.print(&arguments);
        assert_eq!(server.wait_for_job(job), "completed", "{}", server.log());
        let bytes = bridge.printed().split_off(seen);
        seen += bytes.len();
        let sheet = inspect(&bytes, &Silent);
        assert_eq!(sheet.inspection.setup.paper, Some("custom"));
        let plane = &sheet.passes[0].plane;
        // 4 inches less the margins.
        assert_eq!((plane.width, plane.length), (2400 - 160, 2400 - 644));
        extent(&sheet.passes, Ink::Black).0
    };
    let place = on_card(mark);
    let found = extent_with("Alps", &[]);
    assert!(near(found, place), "{found:?}, not {place:?}");

    let found = extent_with("Alps", &["MirrorPrint=True"]);
    let mirrored = on_card([i64::from(CARD.0) - mark[2], mark[1], i64::from(CARD.0) - mark[0], mark[3]]);
    assert!(near(found, mirrored), "{found:?}, not {mirrored:?}");

    // 10 x 25 mm from the corner of the sheet.
    let found = extent_with("Alps", &["FoilpressPosition=Custom.10x25mm"]);
    let (left, top) = (236 - 80, 591 - 284);
    let moved = [left, top, left + place[2] - place[0], top + place[3] - place[1]];
    assert!(near(found, moved), "{found:?}, not {moved:?}");

    // This machine prints half a millimetre too far right and a quarter too high: 12 and 6 dots.
    let found = extent_with("Off", &[]);
    let corrected = [place[0] - 12, place[1] + 6, place[2] - 12, place[3] + 6];
    assert!(near(found, corrected), "{found:?}, not {corrected:?}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_printer_of_another_maker_gets_no_byte_and_stops_the_queue() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    *bridge.port.maker.lock().unwrap() = Some("Hewlett-Packard");
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/job.rgl");
    let bytes = job(11, &[Ink::Cyan], 30);
    fs::write(&file, &bytes).unwrap();
    let job = server.print(&["-d", "Alps", file.to_str().unwrap()]);
    server.wait_for("the queue to stop", |server| server.state("Alps").contains("disabled"));
    assert!(
        server.state("Alps").contains("identify itself as an ALPS printer: MFG:Hewlett-Packard"),
        "{}",
        server.state("Alps")
    );
    assert!(bridge.printed().is_empty());
    *bridge.port.maker.lock().unwrap() = Some("ALPS");
    server.say("cupsenable", &["Alps"]);
    assert_eq!(server.wait_for_job(job), "completed");
    assert!(bridge.printed() == bytes);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
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
    // White is not among the cartridges of this printer, which was said before; nothing is left of it.
    assert!(server.log().contains("not loaded: white (MDC-SCWH, barcode 16)"), "{}", server.log());
    assert!(server.state("Alps").contains("Alerts: none"), "{}", server.state("Alps"));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_stream_of_ghostscripts_driver_is_printed_as_it_is_page_by_page() {
    let server = server!();
    if !testing::needs::md5k() {
        return;
    }
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
#[ignore = "real time: cargo xtask test --full"]
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
    assert!(server.log().contains("not one complete job"), "{}", server.log());
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn why_a_page_is_not_printed_is_said_with_the_job() {
    let server = server!();
    let bridge = Bridge::start(FAST);
    server.queue("Alps", &bridge.uri());
    let file = server.path("files/page.pdf");
    fs::write(&file, pdf(&["0 g 120 240 240 240 re f"])).unwrap();
    let file = file.to_str().unwrap();
    for (option, words) in [
        ("FoilpressWhite=Beneath", "Silhouette"),
        ("FoilpressPosition=left", "20x30mm"),
        ("MediaType=Tin", "MediaType"),
    ] {
        let job = server.print(&["-d", "Alps", "-o", option, file]);
        assert_ne!(server.wait_for_job(job), "completed");
        let said = server.job(job, "job-printer-state-message");
        assert!(said.contains(words), "{option}: {said}");
    }
    assert!(bridge.printed().is_empty());
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
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
#[ignore = "real time: cargo xtask test --full"]
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
#[ignore = "real time: cargo xtask test --full"]
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
#[ignore = "real time: cargo xtask test --full"]
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
#[ignore = "real time: cargo xtask test --full"]
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
    let lost = bridge.port.progress().unwrap().job;
    drop(bridge);
    let bridge = Bridge::torn(address, FAST, lost);
    server.wait_for("the job to be held", |server| server.job(job, "job-state") == "pending-held");
    assert!(bridge.printed().is_empty());
    // The next one is not sent to a printer that waits for the rest of a row.
    let next = server.print(&["-d", "Alps", "-o", "raw", file.to_str().unwrap()]);
    server.wait_for("the next job to be held", |server| server.job(next, "job-state") == "pending-held");
    assert!(bridge.printed().is_empty());
    assert_eq!(bridge.port.resets.load(Ordering::Relaxed), 0);
    assert!(
        server.log().contains("release it to reset the printer through the bridge and print this sheet"),
        "{}",
        server.log()
    );
    server.say("lp", &["-i", &format!("Alps-{job}"), "-H", "resume"]);
    assert_eq!(server.wait_for_job(job), "completed");
    assert_eq!(bridge.port.resets.load(Ordering::Relaxed), 1);
    assert!(bridge.printed() == bytes);
    server.say("lp", &["-i", &format!("Alps-{next}"), "-H", "resume"]);
    assert_eq!(server.wait_for_job(next), "completed");
    assert_eq!(bridge.port.resets.load(Ordering::Relaxed), 1);
    assert!(bridge.printed() == bytes.repeat(2));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
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
    let description = server.path("files").join(queue::install::DESCRIPTION);
    // The print system's own judge; the filters it looks for are not in the system's folders.
    let judged =
        server.command("cupstestppd", &["-I", "filters", "-W", "none", description.to_str().unwrap()]);
    assert!(judged.status.success(), "{}", String::from_utf8_lossy(&judged.stdout));
}
