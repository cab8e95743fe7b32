//! The firmware's image with a model printer at its pins, in the board's own time: scripts of `tests/emulator/` on rp2040js.
//!
//! The jobs they print are made here, by the encoders the workstation uses, so that what arrives at the emulated port is compared
//! with what a file would have held.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use protocol::rgl::{JobSetup, JobWriter, Page};
use protocol::runs::{self, Header, MAX_BAND, MAX_HEADER};
use protocol::walk::{EDGE, Frame, Placed, Walk};

macro_rules! scripts {
    ($($(#[$ignored:meta])? $name:ident),*) => {
        const SCRIPTS: &[&str] = &[$(stringify!($name)),*];
        $(
            #[test]
            $(#[$ignored])?
            fn $name() {
                run(stringify!($name));
            }
        )*
    };
}

scripts!(
    #[ignore = "real time: cargo xtask test --full"]
    alone,
    #[ignore = "real time: cargo xtask test --full"]
    control,
    #[ignore = "real time: cargo xtask test --full"]
    failure,
    #[ignore = "real time: cargo xtask test --full"]
    faults,
    firmware,
    #[ignore = "real time: cargo xtask test --full"]
    plain,
    restart,
    #[ignore = "real time: cargo xtask test --full"]
    speed,
    standing,
    #[ignore = "real time: cargo xtask test --full"]
    windows,
    #[ignore = "real time: cargo xtask test --full"]
    wiring
);

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("emulator")
}

#[test]
fn no_script_is_left_out() {
    let names =
        fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let found: BTreeSet<String> =
        names.filter_map(|name| name.strip_suffix(".test.mjs").map(str::to_owned)).collect();
    assert_eq!(found, SCRIPTS.iter().map(|name| (*name).to_owned()).collect());
}

/// Runs the tests of a script.
fn run(name: &str) {
    let Some((image, _)) = super::parts() else { return };
    let jobs = tempfile::tempdir().unwrap();
    write_jobs(jobs.path());
    let status = Command::new(std::env::var_os("FOILPRESS_NODE").unwrap_or_else(|| "node".into()))
        .args(["--test", "--test-reporter=spec", &format!("{name}.test.mjs")])
        .current_dir(folder())
        .env("FOILPRESS_IMAGE", image)
        .env("FOILPRESS_JOBS", jobs.path())
        .status()
        .expect("node runs");
    assert!(status.success(), "{name}: {status}");
}

fn write_jobs(jobs: &Path) {
    // A picture that lies as the halftone does not expect it: no tile begins with a byte.
    let placed = Frame { x: 101, y: 3, width: 4600, height: 256 };
    // 50 mm wide in the middle of the page: most of each row is blank, and one tile in ten is of another size.
    let small = Frame { x: 1811, y: 40, width: 1181, height: 300 };
    let made = [
        ("small", Placed::whole(500, 150), discs(500, 150)),
        ("page", Placed::whole(4800, 130), discs(4800, 130)),
        ("clusters", Placed::whole(4800, 256), clusters(4800, 256, Frame::whole(4800, 256))),
        ("placed", Placed::new(4800, 260, placed).expect("a picture within"), clusters(4800, 260, placed)),
        ("cells", Placed::whole(4800, 256), cells(4800, 256, Frame { x: 7, y: 4, width: 4793, height: 252 })),
        (
            "small-clusters",
            Placed::new(4800, 340, small).expect("a picture within"),
            clusters(4800, 340, small),
        ),
        ("small-cells", Placed::new(4800, 340, small).expect("a picture within"), cells(4800, 340, small)),
    ];
    for (name, walk, planes) in made {
        let (printed, streams) = job(&walk, &planes).expect("a test job");
        fs::write(jobs.join(format!("{name}.rgl")), printed).unwrap();
        fs::write(jobs.join(format!("{name}.streams")), streams).unwrap();
    }
}

/// The planes of two inks: discs of two sizes, denser towards the bottom.
fn discs(width: u16, rows: u16) -> [Vec<u8>; 2] {
    let stride = runs::stride(width);
    [12u32, 40].map(|pitch| {
        let mut plane = vec![0u8; stride * usize::from(rows)];
        for y in 0..u32::from(rows) {
            let radius = pitch / 6 + pitch * y / (3 * u32::from(rows));
            for x in 0..u32::from(width) {
                let (dx, dy) = (x % pitch, y % pitch);
                let square = dx.abs_diff(pitch / 2).pow(2) + dy.abs_diff(pitch / 2).pow(2);
                if square < radius * radius {
                    plane[y as usize * stride + x as usize / 8] |= 0x80 >> (x % 8);
                }
            }
        }
        plane
    })
}

/// Two of eight planes as the halftone makes them: clusters of eight dots or somewhat more along the walk, each of one
/// of eight inks or of bare paper.
fn clusters(width: u16, rows: u16, frame: Frame) -> [Vec<u8>; 2] {
    let stride = runs::stride(width);
    let mut planes = [(); 2].map(|()| vec![0u8; stride * usize::from(rows)]);
    let (mut random, mut left, mut ink) = (1u64, 0, 0);
    for tile in Walk::new(frame.width, frame.height).bands().flat_map(|band| band.tiles()) {
        let mut dots = vec![0; usize::from(tile.area())];
        tile.fill(&mut dots);
        for dot in dots {
            if left == 0 {
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ink = (random >> 40) as usize % 9;
                // Eight, and one more with a chance of a half each time.
                left = 8 + (random >> 50).trailing_ones();
            }
            left -= 1;
            if let Some(plane) = planes.get_mut(ink) {
                let (x, y) = (frame.x + tile.x + dot % EDGE, frame.y + tile.y + dot / EDGE);
                let (x, y) = (usize::from(x), usize::from(y));
                plane[y * stride + x / 8] |= 0x80 >> (x % 8);
            }
        }
    }
    planes
}

/// Two of eight planes of cells of 3 x 3 dots, each of one of eight inks or of bare paper, in a picture.
fn cells(width: u16, rows: u16, frame: Frame) -> [Vec<u8>; 2] {
    let stride = runs::stride(width);
    let mut planes = [(); 2].map(|()| vec![0u8; stride * usize::from(rows)]);
    let mut random = 1u64;
    let mut inks = vec![0; usize::from(frame.width).div_ceil(3)];
    for row in 0..usize::from(frame.height) {
        if row.is_multiple_of(3) {
            inks.fill_with(|| {
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 40) as usize % 9
            });
        }
        for column in 0..usize::from(frame.width) {
            if let Some(plane) = planes.get_mut(inks[column / 3]) {
                let (x, y) = (usize::from(frame.x) + column, usize::from(frame.y) + row);
                plane[y * stride + x / 8] |= 0x80 >> (x % 8);
            }
        }
    }
    planes
}

/// A job of two inks as the printer's language and as pass streams.
fn job(walk: &Placed, planes: &[Vec<u8>; 2]) -> Option<(Vec<u8>, Vec<u8>)> {
    let (width, rows) = (walk.width(), walk.height());
    let inks = [Ink::White, Ink::Black];
    let stride = runs::stride(width);
    let page = Page::plain(Paper::A4);
    let mut writer = JobWriter::new(JobSetup::new(page, &inks, None).ok()?, rows).ok()?;
    let mut out = vec![0; COMMAND_ROOM + ROW_ROOM + stride];
    let mut printed = Vec::new();
    let length = writer.begin(&mut out).ok()?;
    printed.extend_from_slice(&out[..length]);
    for plane in planes {
        let length = writer.next_pass(&mut out).ok()?;
        printed.extend_from_slice(&out[..length]);
        for row in plane.chunks_exact(stride) {
            let length = writer.row(row, &mut out).ok()?;
            printed.extend_from_slice(&out[..length]);
        }
    }
    let length = writer.end(&mut out).ok()?;
    printed.extend_from_slice(&out[..length]);

    let mut head = [0; MAX_HEADER];
    let length = Header::new(page, &inks, None, width, rows).ok()?.framed(walk.frame())?.write(&mut head);
    let mut streams = head[..length].to_vec();
    let mut buffer = vec![0; MAX_BAND];
    for plane in planes {
        runs::encode(walk, plane, &mut buffer, |band| streams.extend_from_slice(band)).ok()?;
    }
    Some((printed, streams))
}
