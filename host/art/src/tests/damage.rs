//! Files that are damaged, by hand and by chance.

use super::plates::{channel, tiff_file};
use super::*;
use proptest::prelude::*;

#[test]
fn damaged_files_are_errors_that_name_the_file() {
    let bench = Bench::new();
    let good = fs::read(bench.grey("good.png", (40, 30), &[7; 1200])).unwrap();
    let (cmyk, none) =
        (tiff_file((20, 10), &[vec![9; 200], vec![9; 200], vec![9; 200], vec![9; 200]], 5, &[]), Vec::new());
    let svg = b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"><g id=\"white\"><rect"
        .to_vec();
    for (name, bytes) in [
        ("white.png", good[..good.len() / 2].to_vec()),
        ("gold.png", good[..20].to_vec()),
        ("photo.png", good[..60].to_vec()),
        ("plates.tif", cmyk[..300].to_vec()),
        ("cut.tif", cmyk[..cmyk.len() - 30].to_vec()),
        ("cut.svg", svg),
        ("empty.png", none),
        ("text.png", b"hello".to_vec()),
    ] {
        let text = refused(&[bench.write(name, bytes)]);
        assert!(text.contains(name), "{name}: {text}");
    }
    assert!(refused(&[bench.path("nowhere.png")]).contains("cannot open it"));
}

#[test]
fn a_jpeg_that_was_cut_short_is_refused_as_a_layer_as_colour_and_as_plates() {
    let bench = Bench::new();
    let noise = |x: u32, y: u32| image::Luma([(x.wrapping_mul(y * y + 7919) % 251) as u8]);
    let mut whole = std::io::Cursor::new(Vec::new());
    image::GrayImage::from_fn(64, 64, noise).write_to(&mut whole, image::ImageFormat::Jpeg).unwrap();
    for (name, bytes) in [
        ("white.jpg", whole.get_ref().as_slice()),
        ("photo.jpg", whole.get_ref()),
        ("plates.jpg", include_bytes!("../../../readers/src/cmyk.jpg")),
    ] {
        let options = Options { dpi: Some(600.0), ..Options::default() };
        read(&[bench.write(name, bytes)], &options);
        for cut in [bytes.len() / 2, bytes.len() - 30, bytes.len() - 2] {
            let text = refused(&[bench.write(name, &bytes[..cut])]);
            assert!(text.contains(name) && !text.contains("no resolution"), "{text}");
            assert!(cut < bytes.len() - 30 || text.contains("the file was cut short"), "{cut}: {text}");
        }
    }
}

#[test]
fn a_picture_of_any_format_that_was_cut_short_says_so() {
    use image::ImageFormat::{Bmp, Png, Pnm, Tiff};
    let bench = Bench::new();
    let noise = |x: u32, y: u32| image::Rgb([(x.wrapping_mul(y * y + 7919) % 251) as u8, x as u8, y as u8]);
    let picture = image::RgbImage::from_fn(64, 64, noise);
    for (format, name) in [(Bmp, "a.bmp"), (Png, "a.png"), (Pnm, "a.ppm"), (Tiff, "a.tif")] {
        let mut whole = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut whole, format).unwrap();
        let whole = whole.into_inner();
        let text = refused(&[bench.write(name, &whole[..whole.len() * 2 / 3])]);
        assert!(text.contains("ends before its last row: the file was cut short"), "{name}: {text}");
    }
}

#[test]
fn a_tiff_whose_data_are_there_was_not_cut_short() {
    // Half a tile of grey in LZW: codes of nine bits, begun anew before they get longer, without the code of the end.
    let codes = (0..500).flat_map(|at| [Some(256).filter(|_| at % 200 == 0), Some(90)]).flatten();
    let bits: Vec<u8> =
        codes.flat_map(|code: u16| (0..9).rev().map(move |bit| (code >> bit & 1) as u8)).collect();
    let data: Vec<u8> = bits.chunks(8).map(|bits| bits.iter().fold(0, |all, bit| all << 1 | bit)).collect();
    let fields: [(u16, u32); 11] = [
        (256, 20),
        (257, 20),
        (258, 8),
        (259, 5),
        (262, 1),
        (277, 1),
        (284, 1),
        (322, 32),
        (323, 32),
        (324, 8 + 2 + 11 * 12 + 4),
        (325, data.len() as u32),
    ];
    let mut whole = b"II*\0\x08\0\0\0\x0b\0".to_vec();
    for (tag, value) in fields {
        whole.extend([&tag.to_le_bytes()[..], &[3, 0, 1, 0, 0, 0], &value.to_le_bytes()].concat());
    }
    whole.extend([&[0; 4], &data[..]].concat());
    let bench = Bench::new();
    let text = refused(&[bench.write("white.tif", &whole)]);
    assert!(
        text.contains("its LZW data are all there but cannot be read to their end; save it as PNG"),
        "{text}"
    );
    let text = refused(&[bench.write("white.tif", &whole[..whole.len() - 99])]);
    assert!(text.contains("the file was cut short"), "{text}");
}

proptest! {
    #![proptest_config(testing::cases(200))]
    #[test]
    fn no_bytes_panic(kind in 0usize..4, at in 0usize..400, value: u8, cut in 0usize..500) {
        let bench = Bench::new();
        let mut bytes = match kind {
            0 => fs::read(bench.grey("a.png", (20, 10), &[7; 200])).unwrap(),
            1 => tiff_file((20, 10), &[channel(1, 1, 3, 3, false), vec![0; 200]], 5,
                &[(332, 3, vec![2, 0]), (333, 2, b"white\0gold\0".to_vec())]),
            2 => tiff_file((20, 10), &vec![vec![9; 200]; 5], 5, &[(338, 3, vec![0, 0]),
                (34377, 1, b"8BIM\x03\xee\0\0\0\0\0\x06\x05white".to_vec())]),
            _ => b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"><g id=\"white\"><rect width=\"2\" height=\"2\"/></g></svg>".to_vec(),
        };
        let length = bytes.len();
        bytes[at % length] = value;
        bytes.truncate(length - cut.min(length) / 4);
        let path = bench.write(["white.png", "a.tif", "b.tif", "c.svg"][kind], bytes);
        let _ = open(&[path], &Options { dpi: Some(600.0), ..Options::default() }, &Silent);
    }
}
