//! Whether a JPEG file is whole.
//!
//! Problem: decoders of JPEG fill what is missing at the end of a file with grey, for browsers.
//! Method: the segments before the first scan have lengths; behind it, only the end of the picture is FF D9, because scans write FF as
//! FF 00. A thumbnail, which has an end of its own, lies within a segment. Cost: one pass over the bytes.
//! Limits: damage within a scan is not seen.
//! Source: ITU-T T.81, annex B.

use memchr::memmem;

/// Marker of a scan.
const SCAN: u8 = 0xda;

/// Whether the file has a scan and no end.
pub fn is_cut_short(bytes: &[u8]) -> bool {
    scans(bytes).is_some_and(|scans| memmem::find(scans, b"\xff\xd9").is_none())
}

/// What follows the marker of the first scan; nothing if there is none.
fn scans(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = bytes.strip_prefix(b"\xff\xd8")?;
    loop {
        let [0xff, after @ ..] = rest else { return None };
        // Before a marker there may be any number of FF.
        rest = &after[after.iter().position(|&byte| byte != 0xff)?..];
        let (&marker, after) = rest.split_first()?;
        if marker == SCAN {
            return Some(after);
        }
        let length = u16::from_be_bytes(*after.first_chunk()?);
        rest = after.get(usize::from(length)..)?;
    }
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
        assert!(!is_cut_short(&with_thumbnail));
        assert!(is_cut_short(&with_thumbnail[..with_thumbnail.len() / 2]));
        assert!(!is_cut_short(&[&whole[..], b"of a phone"].concat()));
    }
}
