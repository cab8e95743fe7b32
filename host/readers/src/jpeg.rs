//! What the markers of a JPEG file tell: its size, its channels, and whether it is whole.
//!
//! Problem: decoders of JPEG fill what is missing at the end of a file with grey, for browsers.
//! Method: segments have lengths, and are stepped over; within a scan only the end of the picture is FF D9,
//! because scans write FF as FF 00. A thumbnail, which has an end of its own, lies within a segment. Cost:
//! one pass over the bytes. Limits: damage within a scan is not seen.
//! Source: ITU-T T.81, annex B.

/// Whether the file has the marker of its end, outside of the segments with data of their own.
pub fn is_whole(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    while let Some(at) = memchr::memchr(0xff, rest) {
        rest = &rest[at + 1..];
        match rest.first() {
            Some(0xd9) => return true,
            // An FF among the data of a scan, a restart, a start, or one more FF.
            Some(0 | 1 | 0xd0..=0xd8 | 0xff) => {}
            _ => {
                let Some(&[_, high, low]) = rest.first_chunk() else { return false };
                rest = rest.get(1 + usize::from(u16::from_be_bytes([high, low]))..).unwrap_or_default();
            }
        }
    }
    false
}

/// Channels, height and width, from the first of its frame headers.
fn frame(bytes: &[u8]) -> Option<(u8, u16, u16)> {
    let mut rest = bytes.strip_prefix(b"\xff\xd8")?;
    loop {
        let (&[0xff, marker, high, low], body) = rest.split_first_chunk::<4>()? else { return None };
        // C4, C8 and CC are tables, all others of this row are frames.
        if (0xc0..=0xcf).contains(&marker) && ![0xc4, 0xc8, 0xcc].contains(&marker) {
            let &[_, h, e, w, i, channels] = body.first_chunk()?;
            return Some((channels, u16::from_be_bytes([h, e]), u16::from_be_bytes([w, i])));
        }
        rest = body.get(usize::from(u16::from_be_bytes([high, low])).checked_sub(2)?..)?;
    }
}

/// How many channels it has.
pub fn channels(bytes: &[u8]) -> Option<u8> {
    frame(bytes).map(|(channels, ..)| channels)
}

/// Pixels across and down.
pub fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    frame(bytes).map(|(_, height, width)| (width.into(), height.into()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use image::ImageFormat;
    use image::codecs::jpeg::JpegEncoder;

    use super::*;
    use crate::{Bounds, format, open};

    /// A picture with detail, so that its scan is long.
    fn jpeg() -> Vec<u8> {
        let pixels: Vec<u8> =
            (0..96 * 64 * 3u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let mut bytes = Vec::new();
        JpegEncoder::new(&mut bytes).encode(&pixels, 96, 64, image::ExtendedColorType::Rgb8).unwrap();
        bytes
    }

    #[test]
    fn a_file_that_ends_within_its_picture_is_refused_wherever_it_ends() {
        let whole = jpeg();
        let bounds = Bounds { side: None, bytes: 1 << 30 };
        let decoded = |bytes: &[u8]| {
            let format = format(bytes, Path::new("a.jpg")).unwrap();
            assert_eq!(format, ImageFormat::Jpeg);
            open(bytes, format, bounds).and_then(|opened| opened.decode())
        };
        assert!(decoded(&whole).is_ok());
        for end in (4..whole.len() - 1).step_by(97).chain([whole.len() - 1]) {
            assert!(decoded(&whole[..end]).is_err(), "{end} of {} bytes", whole.len());
        }
    }

    #[test]
    fn ends_of_thumbnails_do_not_count_and_what_follows_the_end_does_not_matter() {
        let whole = jpeg();
        let thumbnail = [&b"\xff\xe1\0\x08\xff\xd8\xff\xd9\0\0"[..], &whole[2..]].concat();
        let with_thumbnail = [&whole[..2], &thumbnail].concat();
        assert!(is_whole(&with_thumbnail));
        assert!(!is_whole(&with_thumbnail[..with_thumbnail.len() / 2]));
        assert!(is_whole(&[&whole[..], b"of a phone"].concat()));
    }

    #[test]
    fn the_end_is_found_behind_the_scans_and_not_in_the_segments() {
        let whole = [
            &b"\xff\xd8\xff\xe1\0\x06\xff\xd9xx"[..],
            b"\xff\xda\0\x04ab scan \xff\0\xff\xd0 scan",
            b"\xff\xff\xc4\0\x03a\xff\xda\0\x02more\xff\xd9rest",
        ];
        let bytes = whole.concat();
        assert!(is_whole(&bytes));
        let end = bytes.windows(6).position(|six| six == b"more\xff\xd9").unwrap() + 6;
        for cut in 0..bytes.len() {
            assert_eq!(is_whole(&bytes[..cut]), cut >= end, "{cut}");
        }
    }
}
