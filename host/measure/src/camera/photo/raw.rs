//! RAW files, written here as the specification of DNG has them, through the developer programs.

use super::*;
use needs::Need;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
const BLACK: u16 = 512;
const WHITE: u16 = 15_000;

/// What the sensor sees at a place in red, green and blue, from 0 to `most`.
fn scene(x: usize, y: usize, most: f64) -> [f64; 3] {
    [x as f64 / WIDTH as f64 * most, 0.4 * most, y as f64 / HEIGHT as f64 * most / 2.0]
}

/// An uncompressed DNG of a sensor with a filter of red, green, green and blue.
fn dng(most: f64, orientation: u16) -> Vec<u8> {
    let sensor = (0..HEIGHT).flat_map(|y| {
        (0..WIDTH).flat_map(move |x| {
            let value = scene(x, y, most)[x % 2 + y % 2];
            ((f64::from(BLACK) + value * f64::from(WHITE - BLACK)).round() as u16).to_le_bytes()
        })
    });
    let sensor: Vec<u8> = sensor.collect();
    let one = |numbers: &[u32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let short = |number: u16| number.to_le_bytes().to_vec();
    let long = |number: usize| (number as u32).to_le_bytes().to_vec();
    let unit = [1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1];
    // Tag, kind (1 byte, 2 text, 3 short, 4 long, 5 fraction, 10 signed fraction), content.
    let exif: Vec<(u16, u16, Vec<u8>)> =
        vec![(33434, 5, one(&[1, 250])), (33437, 5, one(&[8, 1])), (34855, 3, short(200))];
    let main = |exif: usize, strip: usize| -> Vec<(u16, u16, Vec<u8>)> {
        vec![
            (254, 4, long(0)),
            (256, 4, long(WIDTH)),
            (257, 4, long(HEIGHT)),
            (258, 3, short(16)),
            (259, 3, short(1)),
            (262, 3, short(32803)),
            (271, 2, b"Maker\0".to_vec()),
            (272, 2, b"Model\0".to_vec()),
            (273, 4, long(strip)),
            (274, 3, short(orientation)),
            (277, 3, short(1)),
            (278, 4, long(HEIGHT)),
            (279, 4, long(2 * WIDTH * HEIGHT)),
            (284, 3, short(1)),
            (33421, 3, [short(2), short(2)].concat()),
            (33422, 1, vec![0, 1, 1, 2]),
            (34665, 4, long(exif)),
            (50706, 1, vec![1, 4, 0, 0]),
            (50708, 2, b"Maker Model\0".to_vec()),
            (50714, 3, short(BLACK)),
            (50717, 3, short(WHITE)),
            (50721, 10, one(&unit)),
            (50728, 5, one(&[1; 6])),
            (50778, 3, short(21)),
        ]
    };
    let at = 8 + directory(&main(0, 0), 8).len();
    let strip = at + directory(&exif, at).len();
    [b"II*\0\x08\0\0\0".to_vec(), directory(&main(at, strip), 8), directory(&exif, at), sensor].concat()
}

/// A directory that begins at `at`, with its longer contents behind it.
fn directory(entries: &[(u16, u16, Vec<u8>)], at: usize) -> Vec<u8> {
    let behind = at + 2 + 12 * entries.len() + 4;
    let (mut head, mut tail) = ((entries.len() as u16).to_le_bytes().to_vec(), Vec::new());
    for (tag, kind, content) in entries {
        let size = [1, 1, 2, 4, 8, 0, 0, 0, 0, 8][usize::from(kind - 1)];
        head.extend(tag.to_le_bytes());
        head.extend(kind.to_le_bytes());
        head.extend(((content.len() / size) as u32).to_le_bytes());
        if content.len() <= 4 {
            head.extend(content);
            head.resize(head.len() + 4 - content.len(), 0);
        } else {
            head.extend(((behind + tail.len()) as u32).to_le_bytes());
            tail.extend(content);
            tail.resize(tail.len().next_multiple_of(2), 0);
        }
    }
    [head, vec![0; 4], tail].concat()
}

#[test]
fn what_the_sensor_sees_comes_out_whatever_the_brightest_value_is() {
    let folder = tempfile::tempdir().unwrap();
    for developer in DEVELOPERS {
        let installed =
            Command::new(developer.0).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
        if !installed {
            Need::Raw.skip(&format!("there is no {} (Debian: libraw-bin, dcraw)", developer.0));
            continue;
        }
        for most in [1.0, 0.8, 0.2] {
            let path = folder.path().join("a.dng");
            std::fs::write(&path, dng(most, 1)).unwrap();
            let photo = decode(&develop(&[developer], &path).unwrap(), &path, false).unwrap();
            assert_eq!((photo.width, photo.height), (WIDTH, HEIGHT), "{}", developer.0);
            // Slopes are interpolated between dots of a colour without error; at the edges programs differ.
            for (x, y) in (8..HEIGHT - 8).flat_map(|y| (8..WIDTH - 8).map(move |x| (x, y))) {
                for (channel, wanted) in scene(x, y, most).into_iter().enumerate() {
                    let found = f64::from(photo.at(3 * (y * WIDTH + x) + channel)) / 65_535.0;
                    assert!(
                        (found - wanted).abs() < 3e-4,
                        "{} at {x}, {y}: {found} for {wanted}",
                        developer.0
                    );
                }
            }
        }
    }
}

#[test]
fn raw_files_stand_upright_and_tell_their_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turned.dng");
    std::fs::write(&path, dng(0.8, 6)).unwrap();
    let exif = exif(&path).unwrap();
    assert_eq!((exif.seconds, exif.aperture, exif.iso), (Some(0.004), Some(8.0), Some(200.0)));
    if Command::new("dcraw_emu").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        return Need::Raw.skip("there is no dcraw_emu (Debian: libraw-bin)");
    }
    let photo = read(&path).unwrap();
    assert_eq!((photo.width, photo.height), (HEIGHT, WIDTH));
    // The sensor's left edge, where red is dark, is at the top; its upper edge, without blue, at the right.
    let at = |x: usize, y: usize, channel: usize| photo.at(3 * (y * HEIGHT + x) + channel);
    assert!(at(30, 10, 0) < at(30, WIDTH - 10, 0) && at(10, 40, 2) > at(HEIGHT - 10, 40, 2));
}
