//! Requests as devices make them that cannot be had here: an iPhone, a computer with Windows 11, an Android
//! phone, a Chromebook; and as CUPS makes them. What is printed is judged by inks and by places.
//!
//! These are not recordings. They are written from what is public of each: the order of operations, the
//! attributes and their types, the format of documents, and how HTTP carries them. Source: for iOS the traces
//! in OpenPrinting/cups#126 and Apple's Bonjour Printing
//! Specification; for Windows michaelrsweet/lprint#93 and OpenPrinting/cups#859; for Android the open source
//! of its print service (`ipphelper.c`).

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use observe::Silent;
use press::inspect::inspect;
use protocol::ink::Ink;
use protocol::paper::{LEFT, Paper};
use serve::body::Limits;
use serve::jobs::State;
use testing::ipp::{self, Attribute};
use testing::needs::ghostscript;
use testing::pwg::{self, Kind};

use super::Running;

const VALIDATE: u16 = 4;
const CREATE: u16 = 5;
const SEND: u16 = 6;
const PRINTER: u16 = 0x0b;
/// Longer than a small sheet takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// How HTTP carries a document.
#[derive(Clone, Copy, PartialEq)]
enum Carried {
    /// In one piece whose length is known.
    Whole,
    /// In chunks, behind a question whether it is wanted.
    Asked,
    /// In chunks.
    Chunks,
}

struct Device {
    name: &'static str,
    agent: &'static str,
    carried: Carried,
    /// The version of IPP.
    version: [u8; 2],
    /// What it asks of the printer first.
    asks: &'static [&'static str],
    format: &'static str,
    document: Vec<u8>,
    /// What it wants of its job, and what of it is not possible here and said to be so.
    job: Vec<Attribute<'static>>,
    ignored: &'static [&'static str],
    is_colour: bool,
}

/// A page of 4 x 6 inches with a black field of an inch at 1, 1, and a red one of half an inch at 2.5, 3, at
/// a resolution. Of the latter a client without colours draws nothing here.
fn raster(kind: Kind, dpi: u32) -> Vec<u8> {
    let within = |at: u32, from: u32, side: u32| (from * dpi / 2..(from + side) * dpi / 2).contains(&at);
    let field = |x: u32, y: u32| match () {
        () if within(x, 2, 2) && within(y, 2, 2) => [0; 3],
        () if within(x, 5, 1) && within(y, 6, 1) => [255, 0, 0],
        () => [255; 3],
    };
    pwg::document(kind, dpi, (4 * dpi, 6 * dpi), 10, &[&field])
}

/// The same as PDF; lying on its side if it is to be turned, as a program writes it.
fn pdf(is_turned: bool) -> Vec<u8> {
    let (box_, turn) = if is_turned { ("0 0 432 288", "0 -1 1 0 0 288 cm") } else { ("0 0 288 432", "") };
    let drawing = format!("{turn} 0 g 72 288 72 72 re f 1 0 0 rg 180 180 36 36 re f");
    let objects = [
        "<</Type/Catalog/Pages 2 0 R>>".to_owned(),
        "<</Type/Pages/Kids[3 0 R]/Count 1>>".to_owned(),
        format!("<</Type/Page/Parent 2 0 R/MediaBox[{box_}]/Contents 4 0 R>>"),
        format!("<</Length {}>>\nstream\n{drawing}\nendstream", drawing.len()),
    ];
    super::fitted::pdf(&objects)
}

/// The same as Apple raster: rows are packed alike, and the header is shorter.
fn apple(dpi: u32) -> Vec<u8> {
    let mut bytes = b"UNIRAST\0\0\0\0\x01".to_vec();
    // Bits of a pixel, sRGB, one side, normal quality.
    bytes.extend([24, 1, 1, 4, 0, 0, 0, 0, 0, 0, 0, 0]);
    for number in [4 * dpi, 6 * dpi, dpi, 0, 0] {
        bytes.extend(number.to_be_bytes());
    }
    bytes.extend(&raster(Kind::Srgb8, dpi)[4 + 1796..]);
    bytes
}

/// A sheet of 4 x 6 inches as a collection: begin, members, end.
fn media(more: &[Attribute<'static>]) -> Vec<Attribute<'static>> {
    const X: &[u8] = &10160i32.to_be_bytes();
    const Y: &[u8] = &15240i32.to_be_bytes();
    let mut all: Vec<Attribute<'static>> = vec![
        (0x34, "media-col", b""),
        (0x4a, "", b"media-size"),
        (0x34, "", b""),
        (0x4a, "", b"x-dimension"),
        (0x21, "", X),
        (0x4a, "", b"y-dimension"),
        (0x21, "", Y),
        (0x37, "", b""),
    ];
    all.extend(more);
    all.push((0x37, "", b""));
    all
}

fn devices() -> [Device; 6] {
    const ZERO: &[u8] = &0i32.to_be_bytes();
    const ONE: &[u8] = &1i32.to_be_bytes();
    const UPRIGHT: &[u8] = &3i32.to_be_bytes();
    const NORMAL: &[u8] = &4i32.to_be_bytes();
    let margins: Vec<Attribute<'static>> =
        ["media-left-margin", "media-right-margin", "media-top-margin", "media-bottom-margin"]
            .into_iter()
            .flat_map(|side| [(0x4a, "", side.as_bytes()), (0x21, "", ZERO)])
            .collect();
    let auto: [Attribute<'static>; 2] = [(0x4a, "", b"media-source"), (0x44, "", b"auto")];
    [
        Device {
            name: "iOS",
            agent: "CUPS/2.4 (iOS 26.1; iPhone) IPP/2.0",
            carried: Carried::Asked,
            version: [2, 0],
            asks: &["all", "media-col-database"],
            format: "image/urf",
            document: apple(300),
            job: [
                media(&margins),
                vec![
                    (0x21, "copies", ONE),
                    (0x44, "sides", b"one-sided"),
                    (0x23, "print-quality", NORMAL),
                    (0x44, "print-color-mode", b"color"),
                    (0x44, "print-scaling", b"fit"),
                ],
            ]
            .concat(),
            ignored: &[],
            is_colour: true,
        },
        Device {
            name: "Windows",
            agent: "Windows-IPP/10.0.26200",
            carried: Carried::Chunks,
            version: [2, 0],
            asks: &["printer-description", "job-template", "media-col-database"],
            format: "image/pwg-raster",
            document: raster(Kind::Srgb8, 300),
            job: [
                media(&auto),
                vec![
                    (0x44, "output-bin", b"face-up"),
                    (0x23, "orientation-requested", UPRIGHT),
                    (0x32, "printer-resolution", b"\0\0\x01\x2c\0\0\x01\x2c\x03"),
                    (0x44, "multiple-document-handling", b"separate-documents-collated-copies"),
                ],
            ]
            .concat(),
            ignored: &["multiple-document-handling"],
            is_colour: true,
        },
        Device {
            name: "Android",
            agent: "wPrint/2.0 (Android 16)",
            carried: Carried::Whole,
            version: [1, 1],
            asks: &["media-supported", "urf-supported", "printer-state", "printer-state-reasons"],
            format: "image/pwg-raster",
            document: raster(Kind::Sgray8, 300),
            job: [
                media(&[&margins[..], &auto].concat()),
                vec![
                    (0x44, "sides", b"one-sided"),
                    (0x44, "print-color-mode", b"monochrome"),
                    (0x23, "print-quality", NORMAL),
                ],
            ]
            .concat(),
            ignored: &[],
            is_colour: false,
        },
        cups("CUPS", "CUPS/2.4.2 (Linux 6.1; x86_64) IPP/2.0", pdf(false), vec![]),
        // A page on its side is turned here.
        cups("CUPS, landscape", "CUPS/2.4.2 (Linux 6.1; x86_64) IPP/2.0", pdf(true), vec![]),
        cups(
            "ChromeOS",
            "CUPS/2.3.3 (CrOS 16093; x86_64) IPP/2.0",
            pdf(false),
            vec![
                (0x44, "print-color-mode", b"color"),
                (0x32, "printer-resolution", b"\0\0\x02\x58\0\0\x02\x58\x03"),
            ],
        ),
    ]
}

/// What CUPS asks for a document that it passes on as it is: all that its `ipp` backend makes of the options
/// of a job.
fn cups(name: &'static str, agent: &'static str, document: Vec<u8>, more: Vec<Attribute<'static>>) -> Device {
    const ONE: &[u8] = &1i32.to_be_bytes();
    const NORMAL: &[u8] = &4i32.to_be_bytes();
    let source: [Attribute<'static>; 4] = [
        (0x4a, "", b"media-source"),
        (0x44, "", b"auto"),
        (0x4a, "", b"media-type"),
        (0x44, "", b"stationery"),
    ];
    let job: Vec<Attribute<'static>> = vec![
        (0x21, "copies", ONE),
        (0x23, "print-quality", NORMAL),
        (0x44, "sides", b"one-sided"),
        (0x44, "multiple-document-handling", b"separate-documents-uncollated-copies"),
    ];
    Device {
        name,
        agent,
        carried: Carried::Chunks,
        version: [2, 0],
        asks: &["all", "media-col-database"],
        format: "application/pdf",
        document,
        job: [media(&source), job, more].concat(),
        ignored: &[],
        is_colour: true,
    }
}

/// Sends a request as a device does; the answer's status and bytes.
fn send(to: SocketAddr, device: &Device, request: &[u8], document: &[u8]) -> (u16, Vec<u8>) {
    let mut request = request.to_vec();
    request[..2].copy_from_slice(&device.version);
    let mut stream = TcpStream::connect(to).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let body = [&request, document].concat();
    let is_chunked = device.carried != Carried::Whole;
    let asks = device.carried == Carried::Asked;
    let length = match is_chunked {
        true => "Transfer-Encoding: chunked".to_owned(),
        false => format!("Content-Length: {}", body.len()),
    };
    let expects = if asks { "Expect: 100-continue\r\n" } else { "" };
    let head = format!(
        "POST /ipp/print/standard HTTP/1.1\r\nHost: {to}\r\nUser-Agent: {}\r\nContent-Type: application/ipp\r\n{expects}{length}\r\n\r\n",
        device.agent
    );
    stream.write_all(head.as_bytes()).unwrap();
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let mut line = || {
        let mut line = String::new();
        reader.read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    };
    if asks {
        assert!(line().starts_with("HTTP/1.1 100"), "{}", device.name);
        assert_eq!(line(), "");
    }
    if is_chunked {
        // The attributes and the document in pieces of their own, and no piece a round number.
        for piece in [&request[..], document].into_iter().flat_map(|part| part.chunks(3001)) {
            stream.write_all(format!("{:x}\r\n", piece.len()).as_bytes()).unwrap();
            stream.write_all(piece).unwrap();
            stream.write_all(b"\r\n").unwrap();
        }
        stream.write_all(b"0\r\n\r\n").unwrap();
    } else {
        stream.write_all(&body).unwrap();
    }
    assert!(line().starts_with("HTTP/1.1 200"), "{}", device.name);
    let mut length = 0;
    loop {
        let header = line().to_ascii_lowercase();
        if header.is_empty() {
            break;
        }
        if let Some(number) = header.strip_prefix("content-length:") {
            length = number.trim().parse().unwrap();
        }
    }
    let mut answer = vec![0; length];
    reader.read_exact(&mut answer).unwrap();
    (u16::from_be_bytes([answer[2], answer[3]]), answer)
}

#[test]
fn each_device_gets_what_it_asks_for_and_its_sheet_is_printed() {
    if !ghostscript() {
        return;
    }
    let running = Running::start(Limits::default(), true);
    let to = running.address;
    let uri = format!("ipp://{to}/ipp/print/standard");
    for (number, device) in (1..).zip(devices()) {
        let name = device.name;
        let ask = |operation: u16, attributes: &[Attribute<'_>], job: &[Attribute<'_>], document: &[u8]| {
            send(to, &device, &ipp::request(operation, &uri, attributes, job), document)
        };
        let user: Attribute<'_> = (0x42, "requesting-user-name", b"ada");
        let mut wanted = vec![user];
        for (at, attribute) in device.asks.iter().enumerate() {
            wanted.push((0x44, if at == 0 { "requested-attributes" } else { "" }, attribute.as_bytes()));
        }
        let (status, answer) = ask(PRINTER, &wanted, &[], &[]);
        assert_eq!((status, &answer[..2]), (0, &device.version[..]), "{name}");
        let says = |attribute: &str| answer.windows(attribute.len()).any(|part| part == attribute.as_bytes());
        assert!(says("image/urf") || name == "Android", "{name}");
        assert!(says("jpn_hagaki_100x148mm"), "{name}");
        let format: Attribute<'_> = (0x49, "document-format", device.format.as_bytes());
        let expected = u16::from(!device.ignored.is_empty());
        let (status, _) = ask(VALIDATE, &[user, format], &device.job, &[]);
        assert_eq!(status, expected, "{name}: Validate-Job");
        let (status, answer) = ask(CREATE, &[user, (0x42, "job-name", name.as_bytes())], &device.job, &[]);
        assert_eq!(status, expected, "{name}: Create-Job");
        // What is not possible is named behind the tag of what is unsupported, and nothing else is.
        let unsupported = answer.iter().position(|&byte| byte == 5).unwrap_or(answer.len());
        for ignored in device.ignored {
            let said = answer[unsupported..].windows(ignored.len()).any(|part| part == ignored.as_bytes());
            assert!(said, "{name}: {ignored}");
        }
        let id = ipp::number(&answer, "job-id").expect("a job");
        let id_bytes = id.to_be_bytes();
        let job: Attribute<'_> = (0x21, "job-id", &id_bytes);
        let (status, _) =
            ask(SEND, &[job, user, format, (0x22, "last-document", b"\x01")], &[], &device.document);
        assert_eq!(status, 0, "{name}: Send-Document");
        let start = Instant::now();
        loop {
            let state = running.server.data().jobs[&(id as u32)].state;
            if state.is_over() {
                assert_eq!(state, State::Completed, "{name}");
                break;
            }
            assert!(start.elapsed() < PATIENCE, "{name}");
            std::thread::sleep(Duration::from_millis(20));
        }
        // A device looks after its job to the end: completed.
        let (_, answer) = ask(ipp::JOB, &[job, user], &[], &[]);
        assert_eq!(ipp::number(&answer, "job-state"), Some(9), "{name}");
        let mut kept: Vec<_> =
            fs::read_dir(running.path("sheets")).unwrap().map(|entry| entry.unwrap()).collect();
        assert_eq!(kept.len(), number, "{name}");
        kept.sort_by_key(|entry| entry.metadata().unwrap().modified().unwrap());
        let found = inspect(&fs::read(kept[number - 1].path()).unwrap(), &Silent);
        let paper = Paper::Custom { width: 2240, length: 3140 };
        // Left, top, width and length of a field in dots of what can be printed, to two dots.
        let field = |[x, y, side]: [f64; 3]| {
            let dots = |inches: f64| (600.0 * inches) as usize;
            [dots(x) - usize::from(LEFT), dots(y) - usize::from(paper.top()), dots(side), dots(side)]
        };
        let (black, red) = (field([1.0, 1.0, 1.0]), field([2.5, 3.0, 0.5]));
        let mut inks: Vec<&str> = Vec::new();
        for pass in &found.passes {
            let bounds = found.inspection.passes[inks.len()].bounds.expect("dots");
            let at = [bounds.x, bounds.y, bounds.width, bounds.height];
            let is_at = |field: [usize; 4]| at.iter().zip(field).all(|(a, b)| a.abs_diff(b) <= 2);
            match pass.ink {
                Ink::Black => assert!(is_at(black), "{name}: {at:?}, not {black:?}"),
                _ => assert!(is_at(red), "{name}, {}: {at:?}, not {red:?}", pass.ink.name()),
            }
            inks.push(pass.ink.name());
        }
        inks.sort_unstable();
        let expected: &[&str] = if device.is_colour { &["black", "magenta", "yellow"] } else { &["black"] };
        assert_eq!(inks, expected, "{name}");
    }
}
