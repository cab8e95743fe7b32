//! Everything the fuzzer has found worth keeping, tried again: the same checks without the fuzzer.

use std::path::Path;
use std::time::{Duration, Instant};

use model::seeded;
use rand::{Rng as _, RngExt as _};
use testing::pwg::{self, Kind};

fn replay(target: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    let mut inputs = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        println!("{}", path.display());
        check(&std::fs::read(&path).unwrap());
        inputs += 1;
    }
    assert!(inputs > 1, "{} is empty", folder.display());
}

#[test]
fn frames_hold() {
    replay("frame", properties::frame::check);
}

#[test]
fn pass_streams_hold() {
    replay("runs", properties::runs::check);
}

#[test]
fn the_printers_language_holds() {
    replay("rgl", properties::rgl::check);
}

#[test]
fn the_engine_holds() {
    replay("engine", properties::engine::check);
}

#[test]
fn firmware_images_hold() {
    replay("uf2", properties::uf2::check);
}

#[test]
fn the_workstations_session_holds() {
    replay("host", properties::host::check);
}

#[test]
fn what_is_kept_over_restarts_holds() {
    replay("kept", properties::kept::check);
}

#[test]
fn a_boot_loaders_replies_hold() {
    replay("picoboot", properties::picoboot::check);
}

#[test]
fn art_holds() {
    replay("art", properties::art::check);
}

#[test]
fn a_negotiations_answers_hold() {
    replay("talk", properties::talk::check);
}

/// Seeds that a program makes, changed here and there: a thousand times in the gate, for a minute in the full profile. With
/// `FOILPRESS_SEEDS` they are written into that folder, for the fuzzer to begin with.
fn vary(target: &str, seeds: &[Vec<u8>], check: fn(&[u8])) {
    if let Some(folder) = std::env::var_os("FOILPRESS_SEEDS") {
        let folder = Path::new(&folder).join(target);
        std::fs::create_dir_all(&folder).unwrap();
        for (number, seed) in seeds.iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{number}")), seed).unwrap();
        }
    }
    let is_full = std::env::var_os("FOILPRESS_FULL").is_some();
    let (start, mut chance) = (Instant::now(), seeded(46));
    for round in 0.. {
        let enough = if is_full { start.elapsed() > Duration::from_secs(60) } else { round >= 1000 };
        if enough {
            break;
        }
        let mut input = seeds[round % seeds.len()].clone();
        // The seeds themselves come first.
        for _ in 0..(round / seeds.len()).min(8) {
            let at = chance.random_range(0..input.len());
            match chance.random_range(0..4) {
                0 => input[at] = chance.random_range(0..=255),
                1 => input.truncate(at + 1),
                2 => input[at] ^= 1 << chance.random_range(0..8),
                _ => {
                    let mut more = vec![0; chance.random_range(1..40)];
                    chance.fill_bytes(&mut more);
                    input.splice(at..at, more);
                }
            }
        }
        check(&input);
    }
}

#[test]
fn requests_of_print_clients_hold() {
    let copies = 3i32.to_be_bytes();
    let side = 12000i32.to_be_bytes();
    let job: [testing::ipp::Attribute<'_>; 12] = [
        (0x21, "copies", &copies),
        (0x44, "media", b"iso_a4_210x297mm"),
        (0x34, "media-col", b""),
        (0x4a, "", b"media-size"),
        (0x34, "", b""),
        (0x4a, "", b"x-dimension"),
        (0x21, "", &side),
        (0x4a, "", b"y-dimension"),
        (0x21, "", &side),
        (0x37, "", b""),
        (0x37, "", b""),
        (0x33, "page-ranges", &[0, 0, 0, 1, 0, 0, 0, 4]),
    ];
    let named: testing::ipp::Attribute<'_> = (0x36, "job-name", b"\x00\x02en\x00\x04leaf");
    let seeds = [2, 4, 0x0b].map(|code| testing::ipp::request(code, "ipp://host/ipp/print", &[named], &job));
    vary("ipp", &seeds, properties::ipp::check);
}

#[test]
fn pages_of_raster_hold() {
    let field = |x: u32, y: u32| [(x * 9) as u8, (y * 5) as u8, (x * y) as u8];
    // Behind the first four bytes, for those say the format; the byte before chooses it.
    let whole = Kind::ALL.iter().map(|(kind, _)| pwg::document(*kind, 300, (24, 30), 3, &[&field, &field]));
    let mut seeds: Vec<Vec<u8>> = whole.map(|bytes| [&[0], &bytes[4..]].concat()).collect();
    // Rows alone, behind the header of a small page of either format.
    let rows = pwg::document(Kind::Srgb8, 300, (3, 40), 2, &[&field]).split_off(4 + 1796);
    seeds.extend([0x25, 0x27].map(|first| [&[first], &rows[..]].concat()));
    vary("raster", &seeds, properties::raster::check);
}
