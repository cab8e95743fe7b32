//! The resolution that a picture's file states.
//!
//! TIFF has it in its first directory, where EXIF readers look; PNG in `pHYs`; JPEG in the JFIF header, or in EXIF. Limits: cameras and
//! programs that do not know it write 72 or 96, so whoever uses it has to check it.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use exif::{In, Tag};

use crate::MeasureError;

/// How much of a file is looked at, in bytes: scanners write a profile before the resolution.
const HEAD: u64 = 4 << 20;
const MM_PER_INCH: f64 = 25.4;

/// Pixels per inch across and down as the file states them.
///
/// # Errors
/// A file that cannot be read.
pub fn dpi(path: &Path) -> Result<Option<[f64; 2]>, MeasureError> {
    let io = |source| MeasureError::Io { path: path.to_path_buf(), source };
    let mut head = Vec::new();
    File::open(path).map_err(io)?.take(HEAD).read_to_end(&mut head).map_err(io)?;
    let stated = png(&head).or_else(|| jfif(&head));
    let stated = match stated {
        Some(stated) => Some(stated),
        None => directory(path).map_err(io)?,
    };
    Ok(stated.filter(|dpi| dpi.iter().all(|v| (1.0..=100_000.0).contains(v))))
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

/// The chunk `pHYs` stands before the picture's data.
fn png(bytes: &[u8]) -> Option<[f64; 2]> {
    if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return None;
    }
    let mut at = 8;
    loop {
        let length = number(bytes, at)? as usize;
        match bytes.get(at + 4..at + 8)? {
            b"pHYs" => {
                let metre = *bytes.get(at + 16)? == 1;
                let side = |from| Some(f64::from(number(bytes, from)?) * MM_PER_INCH / 1000.0);
                return metre.then_some([side(at + 8)?, side(at + 12)?]);
            }
            b"IDAT" | b"IEND" => return None,
            _ => at = at.checked_add(length)?.checked_add(12)?,
        }
    }
}

fn jfif(bytes: &[u8]) -> Option<[f64; 2]> {
    if !bytes.starts_with(&[0xff, 0xd8, 0xff, 0xe0]) || bytes.get(6..11)? != b"JFIF\0" {
        return None;
    }
    let unit = match bytes.get(13)? {
        1 => 1.0,
        2 => MM_PER_INCH / 10.0,
        _ => return None,
    };
    let side = |at: usize| Some(f64::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])) * unit);
    Some([side(14)?, side(16)?])
}

fn directory(path: &Path) -> std::io::Result<Option<[f64; 2]>> {
    let Ok(fields) = exif::Reader::new().read_from_container(&mut BufReader::new(File::open(path)?)) else {
        return Ok(None);
    };
    let unit =
        match fields.get_field(Tag::ResolutionUnit, In::PRIMARY).and_then(|field| field.value.get_uint(0)) {
            Some(3) => MM_PER_INCH / 10.0,
            Some(1) => return Ok(None),
            _ => 1.0,
        };
    let side = |tag| {
        let field = fields.get_field(tag, In::PRIMARY)?;
        let exif::Value::Rational(values) = &field.value else { return None };
        Some(values.first()?.to_f64() * unit)
    };
    Ok(side(Tag::XResolution).zip(side(Tag::YResolution)).map(|(x, y)| [x, y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, bytes: &[u8]) -> Option<[f64; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        dpi(&path).unwrap()
    }

    #[test]
    fn each_format_states_it_in_its_own_way() {
        let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, data) in [(b"IHDR", vec![0; 13]), (b"pHYs", vec![0, 0, 0x5c, 0x46, 0, 0, 0x5c, 0x46, 1])] {
            png.extend((data.len() as u32).to_be_bytes());
            png.extend(kind);
            png.extend(data);
            png.extend([0; 4]);
        }
        let found = of("a.png", &png).unwrap();
        assert!(found.iter().all(|v| (v - 600.0).abs() < 0.02), "{found:?}");
        let jpeg = [&[0xff, 0xd8, 0xff, 0xe0, 0, 16][..], b"JFIF\0", &[1, 1, 1, 1, 44, 2, 88, 0, 0]].concat();
        assert_eq!(of("a.jpg", &jpeg), Some([300.0, 600.0]));
        // Little-endian TIFF: x and y as fractions, in dots per centimetre.
        let mut tiff = b"II*\0\x08\0\0\0\x03\0".to_vec();
        for (tag, kind, value) in [(282u16, 5u16, 50u32), (283, 5, 58), (296, 3, 3)] {
            tiff.extend(tag.to_le_bytes());
            tiff.extend(kind.to_le_bytes());
            tiff.extend(1u32.to_le_bytes());
            tiff.extend(value.to_le_bytes());
        }
        tiff.extend([0; 4]);
        [2362u32, 10, 1181, 10].iter().for_each(|v| tiff.extend(v.to_le_bytes()));
        let found = of("a.tif", &tiff).unwrap();
        assert!((found[0] - 599.95).abs() < 0.01 && (found[1] - 299.97).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn what_is_damaged_or_silent_states_nothing() {
        for bytes in [
            &b""[..],
            b"\x89PNG\r\n\x1a\n\xff\xff\xff\xffabcd",
            b"\x89PNG\r\n\x1a\n\0\0\0\x09pHYs\0",
            &[0xff, 0xd8, 0xff, 0xe0, 0, 16, b'J'],
            b"II*\0\xff\xff\xff\xff",
        ] {
            assert_eq!(of("a", bytes), None, "{bytes:?}");
        }
    }
}
