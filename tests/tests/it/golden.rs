//! The established driver's streams: read, written back, and made again from their images.
//!
//! The streams and images are in the folder that `FOILPRESS_GOLDEN` names; without it the tests are left out. The folder's
//! README says what each stream was made of.

use observe::Silent;
use press::inspect::inspect;
use press::simulate::{self, Setup};
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::encode::encode_into;
use protocol::rgl::{JobSetup, JobWriter, Order, Page, Resolution, Step, parse};
use testing::needs::golden as folder;

/// Which plane of the image a pass prints.
#[derive(Clone, Copy)]
enum From {
    Cyan,
    Magenta,
    Yellow,
    Black,
}

/// A stream: its name, its image, how it was made.
struct Golden {
    stream: &'static str,
    image: &'static str,
    removal: bool,
    passes: &'static [(Ink, From)],
    page: Page,
    black_raster: bool,
}

const CMYK: &[(Ink, From)] = &[
    (Ink::Cyan, From::Cyan),
    (Ink::Magenta, From::Magenta),
    (Ink::Yellow, From::Yellow),
    (Ink::Black, From::Black),
];

fn goldens() -> Vec<Golden> {
    let plain = |stream, image, passes| Golden {
        stream,
        image,
        removal: true,
        passes,
        page: Page::plain(Paper::A4),
        black_raster: false,
    };
    let (c1, c5, c6) = ("c1_black_120x120.ppm", "c5_metallic4_240x120.ppm", "c6_fullcolour_240x120.ppm");
    let mut all = vec![
        plain("g1_c1_black_md5000_600", c1, CMYK),
        plain("g2_c2_blackcyan_md5000_600", "c2_blackcyan_240x120.ppm", CMYK),
        plain("g3_c3_white_md5000_600", c1, &[(Ink::White, From::Black)]),
        plain("g5_c1_black_md5500_600", c1, CMYK),
        plain("g6_c4_square_md5000_600", "c4_square_on_white_120x120.ppm", CMYK),
        plain(
            "g7_c5_metallic4_md5000_600",
            c5,
            &[
                (Ink::MetallicCyan, From::Cyan),
                (Ink::MetallicMagenta, From::Magenta),
                (Ink::MetallicGold, From::Yellow),
                (Ink::MetallicSilver, From::Black),
            ],
        ),
        plain(
            "g10_c5_white_multilayer_md5000_600",
            c5,
            &[
                (Ink::White, From::Cyan),
                (Ink::MetallicGold, From::Magenta),
                (Ink::MetallicSilver, From::Yellow),
                (Ink::Black, From::Black),
            ],
        ),
        plain("g12_c6_fullcolour_md5000_600", c6, CMYK),
        plain(
            "g25_c6_five_inks_md5000_600",
            c6,
            &[
                (Ink::Cyan, From::Cyan),
                (Ink::Magenta, From::Magenta),
                (Ink::Yellow, From::Yellow),
                (Ink::Black, From::Black),
                (Ink::Finish, From::Black),
            ],
        ),
    ];
    let a4 = Page::plain(Paper::A4);
    all.push(Golden {
        page: Page { resolution: Resolution::Dpi1200, ..a4 },
        ..plain("g4_c1_black_md5000_1200", c1, CMYK)
    });
    all.push(Golden {
        page: Page { shift_x: 100, shift_y: 200, ..a4 },
        ..plain("g8_c1_shift_md5000_600", c1, CMYK)
    });
    all.push(Golden {
        black_raster: true,
        ..plain("g16_c1_blackraster_md5000_600", c1, &[(Ink::Black, From::Black)])
    });
    all.push(Golden {
        removal: false,
        ..plain("g21_c1_white_twice_md5000_600", c1, &[(Ink::White, From::Cyan), (Ink::White, From::Magenta)])
    });
    all
}

/// The rows of one plane: a dot where the value is 128 or more.
fn plane(image: &image::RgbImage, from: From, removal: bool) -> Vec<Vec<u8>> {
    let dot = |pixel: &image::Rgb<u8>| {
        let [c, m, y] = pixel.0.map(|v| 255 - v);
        let k = if removal { c.min(m).min(y) } else { 0 };
        128 <= match from {
            From::Cyan => c - k,
            From::Magenta => m - k,
            From::Yellow => y - k,
            From::Black => k,
        }
    };
    image
        .rows()
        .map(|row| {
            let mut bits = vec![0; (image.width() as usize).div_ceil(8)];
            for (x, pixel) in row.enumerate() {
                bits[x / 8] |= u8::from(dot(pixel)) << (7 - x % 8);
            }
            bits
        })
        .collect()
}

/// The stream of these planes.
fn write(setup: JobSetup, rows: u16, planes: &[Vec<Vec<u8>>]) -> Vec<u8> {
    let mut writer = JobWriter::new(setup, rows).unwrap();
    let (mut out, mut bytes) = ([0; 4096], vec![]);
    let mut length = writer.begin(&mut out).unwrap();
    bytes.extend_from_slice(&out[..length]);
    for plane in planes {
        length = writer.next_pass(&mut out).unwrap();
        bytes.extend_from_slice(&out[..length]);
        for row in plane {
            length = writer.row(row, &mut out).unwrap();
            bytes.extend_from_slice(&out[..length]);
        }
    }
    length = writer.end(&mut out).unwrap();
    bytes.extend_from_slice(&out[..length]);
    bytes
}

fn streams(folder: &std::path::Path) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "bin"))
        .map(|path| (path.file_stem().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()))
        .collect();
    all.sort();
    assert_eq!(all.len(), 14, "streams in {}", folder.display());
    all
}

#[test]
fn every_stream_is_read_as_a_legal_job_and_written_back_to_the_same_bytes() {
    let Some(folder) = folder() else { return };
    for (name, bytes) in streams(&folder) {
        let (mut order, mut again, mut at) = (Order::new(), vec![], 0);
        let mut out = vec![0; 70_000];
        while at < bytes.len() {
            let step = parse(&bytes[at..]).unwrap_or_else(|refusal| panic!("{name} at {at}: {refusal:?}"));
            let Step::Command(command, length) = step else { panic!("{name} ends inside a command") };
            order.accept(&command).unwrap_or_else(|refusal| panic!("{name} at {at}: {refusal:?}"));
            let written = encode_into(&command, &mut out).unwrap();
            again.extend_from_slice(&out[..written]);
            at += length;
        }
        assert!(order.is_over(), "{name}");
        assert!(again == bytes, "{name}");
    }
}

#[test]
fn every_stream_whose_screen_is_known_is_made_again_from_its_image() {
    let Some(folder) = folder() else { return };
    let all = goldens();
    assert_eq!(all.len(), 13);
    for golden in all {
        let image = image::open(folder.join(golden.image)).unwrap().into_rgb8();
        let planes: Vec<_> =
            golden.passes.iter().map(|&(_, from)| plane(&image, from, golden.removal)).collect();
        let inks: Vec<Ink> = golden.passes.iter().map(|&(ink, _)| ink).collect();
        let setup = if golden.black_raster {
            JobSetup::black_raster(golden.page)
        } else {
            JobSetup::new(golden.page, &inks, None)
        };
        let bytes = write(setup.unwrap(), image.height() as u16, &planes);
        let want = std::fs::read(folder.join(golden.stream).with_extension("bin")).unwrap();
        assert!(bytes == want, "{}: {} bytes instead of {}", golden.stream, bytes.len(), want.len());
    }
}

#[test]
fn the_halftoned_stream_is_made_again_from_its_decoded_planes() {
    let Some(folder) = folder() else { return };
    let want = std::fs::read(folder.join("g14_c6_coarsehalftone_md5000_600.bin")).unwrap();
    let decoded = inspect(&want, &Silent);
    assert_eq!(decoded.inspection.error, None);
    let inks: Vec<Ink> = decoded.passes.iter().map(|pass| pass.ink).collect();
    let planes: Vec<Vec<Vec<u8>>> = decoded
        .passes
        .iter()
        .map(|pass| pass.plane.bits.chunks(pass.plane.stride).take(120).map(<[u8]>::to_vec).collect())
        .collect();
    let setup = JobSetup::new(Page::plain(Paper::A4), &inks, None).unwrap();
    assert!(write(setup, 120, &planes) == want);
    let kinds: Vec<_> =
        decoded.inspection.passes.iter().map(|p| (p.plain_rows > 0, p.packed_rows > 0)).collect();
    assert!(
        kinds.contains(&(true, true)),
        "it was chosen for its switching of compression inside a pass: {kinds:?}"
    );
}

#[test]
fn the_simulated_printer_prints_every_stream_dot_for_dot() {
    let Some(folder) = folder() else { return };
    for (name, bytes) in streams(&folder) {
        let printout = simulate::print(&bytes, &Setup::default(), &Silent)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let Some(golden) = goldens().into_iter().find(|golden| golden.stream == name) else { continue };
        let image = image::open(folder.join(golden.image)).unwrap().into_rgb8();
        assert_eq!(printout.passes.len(), golden.passes.len(), "{name}");
        for (pass, &(ink, from)) in printout.passes.iter().zip(golden.passes) {
            assert_eq!(pass.ink, ink, "{name}");
            let rows = plane(&image, from, golden.removal);
            let (left, top) = if name.starts_with("g8_") { (100, 200) } else { (0, 0) };
            let dot = |x: usize, y: usize| pass.plane.bits[y * pass.plane.stride + x / 8] >> (7 - x % 8) & 1;
            for (y, row) in rows.iter().enumerate() {
                for x in 0..image.width() as usize {
                    assert_eq!(dot(left + x, top + y), row[x / 8] >> (7 - x % 8) & 1, "{name} at ({x}, {y})");
                }
            }
            let dots = |bits: &[u8]| bits.iter().map(|b| u64::from(b.count_ones())).sum::<u64>();
            assert_eq!(dots(&pass.plane.bits), rows.iter().map(|row| dots(row)).sum::<u64>(), "{name}");
        }
    }
}
