//! Damage to good files, for the tests of readers.
//!
//! Files are cut short, bytes are changed, pieces left out or said twice, numbers in text replaced by impossible ones.
//! Checksums of PNG files are mended afterwards, or nothing would get past them.

use std::path::Path;

use proptest::prelude::*;
use proptest::sample::Index;

/// One thing that happens to the bytes of a file.
#[derive(Clone, Debug)]
pub enum Damage {
    /// This byte is set to this value.
    Set(Index, u8),
    /// The file ends here.
    Cut(Index),
    /// What lies between is left out.
    LeaveOut(Index, Index),
    /// What lies between stands twice.
    Repeat(Index, Index),
    /// Another number in the place of one written in text.
    Number(Index, &'static str),
}

const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1",
    "2",
    "1e999",
    "-1e999",
    "nan",
    "inf",
    "1e-320",
    "65536",
    "4294967295",
    "18446744073709551615",
    "99999999999999999999999",
    "",
];

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        4 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Set(at, byte)),
        1 => any::<Index>().prop_map(Damage::Cut),
        1 => (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Damage::LeaveOut(a, b)),
        1 => (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Damage::Repeat(a, b)),
        6 => (any::<Index>(), prop::sample::select(&NUMBERS[..])).prop_map(|(at, n)| Damage::Number(at, n)),
    ]
}

/// Where numbers stand in a text.
fn numbers(text: &[u8]) -> Vec<std::ops::Range<usize>> {
    let part = |byte: &u8| byte.is_ascii_digit() || b".-".contains(byte);
    let mut found = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let length = text[at..].iter().take_while(|byte| part(byte)).count();
        if length > 0 {
            found.push(at..at + length);
        }
        at += length.max(1);
    }
    found
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>, reach: usize, is_text: bool) {
        let reach = bytes.len().min(reach);
        if reach == 0 {
            return;
        }
        let range = |a: &Index, b: &Index| {
            let (a, b) = (a.index(reach), b.index(reach));
            a.min(b)..a.max(b)
        };
        match self {
            Damage::Set(at, byte) => bytes[at.index(reach)] = *byte,
            Damage::Cut(at) => bytes.truncate(at.index(reach)),
            Damage::LeaveOut(a, b) => drop(bytes.drain(range(a, b))),
            Damage::Repeat(a, b) => {
                let range = range(a, b);
                let piece = bytes[range.clone()].to_vec();
                bytes.splice(range.end..range.end, piece);
            }
            Damage::Number(at, number) => {
                let places = if is_text { numbers(bytes) } else { Vec::new() };
                if !places.is_empty() {
                    bytes.splice(places[at.index(places.len())].clone(), number.bytes());
                }
            }
        }
    }
}

/// Mends the checksums of a PNG file's chunks, as far as they still are chunks.
fn mended(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]])) {
        let end = at + 8 + length as usize;
        let Some(chunk) = bytes.get(at + 4..end) else { break };
        let crc = !chunk.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
        });
        let Some(sum) = bytes.get_mut(end..end + 4) else { break };
        sum.copy_from_slice(&crc.to_be_bytes());
        at = end + 4;
    }
    bytes
}

/// Some damages, and how far from the start of the file they lie: headers hold the sizes, so half of them are there.
pub type Damages = (Vec<Damage>, usize);

/// Any of them.
pub fn damages() -> impl Strategy<Value = Damages> {
    (prop::collection::vec(damage(), 1..6), prop_oneof![Just(64), Just(usize::MAX)])
}

/// A file's bytes with damages.
pub fn spoilt(name: &str, bytes: &[u8], (damages, reach): &Damages) -> Vec<u8> {
    let is_text = [".toml", ".csv", ".gltf"].iter().any(|ending| name.ends_with(ending));
    let mut bytes = bytes.to_vec();
    for damage in damages {
        damage.apply(&mut bytes, *reach, is_text);
    }
    if bytes.starts_with(b"\x89PNG") { mended(bytes) } else { bytes }
}

/// Damages one file of a folder, reads the folder, and puts the file back. What `read` says of an error must name the
/// folder; a panic or an endless loop fails the test.
pub fn survives<T, E: std::fmt::Display>(
    folder: &Path,
    which: Index,
    damages: &Damages,
    read: impl Fn(&Path) -> Result<T, E>,
) {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let name = &names[which.index(names.len())];
    let path = folder.join(name);
    let good = std::fs::read(&path).unwrap();
    std::fs::write(&path, spoilt(name, &good, damages)).unwrap();
    if let Err(error) = read(folder) {
        let text = error.to_string();
        assert!(text.contains(&*folder.to_string_lossy()), "{name}: {text}");
    }
    std::fs::write(&path, good).unwrap();
    assert!(read(folder).is_ok(), "the good folder is not good");
}
