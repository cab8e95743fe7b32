//! The advertisement as another program hears it: questions and answers of multicast DNS, byte by byte.
//!
//! Source: RFC 1035, section 4; RFC 6762, section 6.7, for a question from a port of one's own, whose answer comes there. Written without
//! a look at the responder's own reader and writer.

use std::collections::BTreeMap;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

use serve::advert::Advert;
use serve::body::Limits;
use serve::printer::title;
use testing::ipp;

use super::Running;

const PTR: u16 = 12;
const TXT: u16 = 16;
const SRV: u16 = 33;
/// Longer than probing and announcing take.
const PATIENCE: Duration = Duration::from_secs(20);

/// A record: its name, type, and data; of a pointer and of a service the name it leads to, behind its port.
type Record = (String, u16, Vec<u8>, String);

fn question(name: &str, kind: u16) -> Vec<u8> {
    let mut bytes = vec![0, 9, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0];
    for label in name.split('.') {
        bytes.push(label.len() as u8);
        bytes.extend(label.as_bytes());
    }
    bytes.push(0);
    bytes.extend(kind.to_be_bytes());
    bytes.extend([0, 1]);
    bytes
}

/// The name at a place, and where it ends.
fn name(bytes: &[u8], mut at: usize) -> Option<(String, usize)> {
    let (mut labels, mut end) = (Vec::new(), None);
    for _ in 0..100 {
        match usize::from(*bytes.get(at)?) {
            0 => return Some((labels.join("."), end.unwrap_or(at + 1))),
            length @ 0xc0.. => {
                end = end.or(Some(at + 2));
                at = (length & 0x3f) << 8 | usize::from(*bytes.get(at + 1)?);
            }
            length => {
                labels.push(String::from_utf8_lossy(bytes.get(at + 1..at + 1 + length)?).into_owned());
                at += 1 + length;
            }
        }
    }
    None
}

fn records(bytes: &[u8]) -> Option<Vec<Record>> {
    let number = |at: usize| Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    let mut at = 12;
    for _ in 0..number(4)? {
        at = name(bytes, at)?.1 + 4;
    }
    let mut records = Vec::new();
    for _ in 0..number(6)? + number(8)? + number(10)? {
        let (called, end) = name(bytes, at)?;
        let (kind, length) = (number(end)?, usize::from(number(end + 8)?));
        let data = bytes.get(end + 10..end + 10 + length)?.to_vec();
        let leads = match kind {
            PTR => name(bytes, end + 10)?.0,
            SRV => name(bytes, end + 16)?.0,
            _ => String::new(),
        };
        records.push((called, kind, data, leads));
        at = end + 10 + length;
    }
    Some(records)
}

/// Asks through the interface of this address until there is an answer that is wanted.
fn ask<T>(socket: &UdpSocket, asked: &str, kind: u16, wanted: impl Fn(&[Record]) -> Option<T>) -> Option<T> {
    let (start, mut bytes) = (Instant::now(), [0; 9000]);
    while start.elapsed() < PATIENCE {
        socket.send_to(&question(asked, kind), "224.0.0.251:5353").ok()?;
        let asked_at = Instant::now();
        while asked_at.elapsed() < Duration::from_secs(1) {
            let Ok(length) = socket.recv(&mut bytes) else { continue };
            if let Some(found) = records(&bytes[..length]).and_then(|records| wanted(&records)) {
                return Some(found);
            }
        }
    }
    None
}

/// The values of an attribute of words in an answer, one after the other.
fn values(answer: &[u8], attribute: &str) -> Vec<String> {
    let wanted = [&(attribute.len() as u16).to_be_bytes()[..], attribute.as_bytes()].concat();
    let mut at = answer.windows(wanted.len()).position(|part| part == wanted).unwrap() + wanted.len();
    let (mut all, mut tag) = (Vec::new(), answer[at - wanted.len() - 1]);
    loop {
        let length = usize::from(u16::from_be_bytes([answer[at], answer[at + 1]]));
        all.push(String::from_utf8_lossy(&answer[at + 2..at + 2 + length]).into_owned());
        at += 2 + length;
        // Further values have the same tag and no name.
        if answer[at] != tag || answer[at + 1..at + 3] != [0, 0] {
            return all;
        }
        tag = answer[at];
        at += 3;
    }
}

/// What is announced is what the printer says of itself; each subtype leads there; and it is gone with the server.
#[test]
fn what_is_announced_is_what_the_printer_says_of_itself() {
    let running = Running::start(Limits::default(), false);
    let server = &running.server;
    let printer = server.printer("").unwrap().clone();
    let uuid = server.uuid("printer standard");
    let computer = format!("foilpress-test-{}", std::process::id());
    let port = running.address.port();
    // Through the loopback, so that nothing of a test is heard outside.
    let advert =
        Advert::begin(&[(printer, uuid)], (&computer, &computer), port, |name| name == "lo" || name == "lo0")
            .unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    let called = title("standard", &computer);
    for kind in ["_ipp", "_ipps"] {
        let full = format!("{called}.{kind}._tcp.local");
        for asked in ["", "_print._sub.", "_universal._sub."] {
            let asked = format!("{asked}{kind}._tcp.local");
            let leads = |found: &[Record]| {
                found.iter().any(|record| record.1 == PTR && record.3 == full).then_some(())
            };
            assert!(ask(&socket, &asked, PTR, leads).is_some(), "{asked} does not lead to {full}");
        }
        let service = |found: &[Record]| {
            found.iter().find(|record| record.1 == SRV && record.0 == full).map(|record| record.2.clone())
        };
        let service = ask(&socket, &full, SRV, service).expect("a service");
        assert_eq!(service[4..6], port.to_be_bytes());
        let text = |found: &[Record]| {
            found.iter().find(|record| record.1 == TXT && record.0 == full).map(|record| record.2.clone())
        };
        let text = ask(&socket, &full, TXT, text).expect("a text");
        let mut keys = BTreeMap::new();
        let mut rest = &text[..];
        while let [length, more @ ..] = rest {
            let (pair, after) = more.split_at(usize::from(*length));
            let pair = String::from_utf8_lossy(pair).into_owned();
            let (key, value) = pair.split_once('=').expect("a key with a value");
            keys.insert(key.to_owned(), value.to_owned());
            rest = after;
        }
        let uri = format!("ipp://{}/ipp/print/standard", running.address);
        let (status, answer) = ipp::ask(running.address, &ipp::request(0x0b, &uri, &[], &[])).unwrap();
        assert_eq!(status, 0);
        let one = |attribute: &str| values(&answer, attribute).remove(0);
        assert_eq!(keys["UUID"], one("printer-uuid")["urn:uuid:".len()..]);
        assert_eq!(format!("ipp://{}/{}", running.address, keys["rp"]), one("printer-uri-supported"));
        assert_eq!(keys["ty"], one("printer-make-and-model"));
        assert_eq!(keys["URF"], values(&answer, "urf-supported").join(","));
        let formats = values(&answer, "document-format-supported");
        assert_eq!(
            keys["pdl"],
            formats.into_iter().filter(|f| f != "application/octet-stream").collect::<Vec<_>>().join(",")
        );
        assert_eq!(keys["mopria-certified"], one("mopria-certified"));
        assert_eq!(keys["Color"] == "T", one("color-supported") == "\u{1}");
        assert_eq!(keys["kind"], values(&answer, "printer-kind").join(","));
    }
    drop(advert);
    let full = format!("{called}._ipp._tcp.local");
    socket.send_to(&question(&full, SRV), "224.0.0.251:5353").unwrap();
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        let mut bytes = [0; 9000];
        let Ok(length) = socket.recv(&mut bytes) else { continue };
        let found = records(&bytes[..length]).unwrap_or_default();
        assert!(!found.iter().any(|record| record.1 == SRV && record.0 == full), "it is still there");
    }
}
