//! The bounding box of EPS: what of the page it is.
//!
//! Problem: an EPS file is as large as its bounding box. It may be stated at the end of the file, where Ghostscript does not look for it.
//! Method: the comments at the beginning and at the end. Cost: two reads. Limits: a box at the end is not looked for in files with a
//! preview for DOS.
//! Source: Encapsulated PostScript File Format Specification 3.0; Document Structuring Conventions 3.0, `(atend)`.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// What the first bytes of an EPS file are that has a preview for DOS beside its PostScript, which Ghostscript finds.
pub(super) const WITH_PREVIEW: &[u8] = b"\xc5\xd0\xd3\xc6";
/// How far from the beginning the comments of the header are looked for, and those of the trailer from the end.
const HEADER: u64 = 1 << 14;
const TRAILER: u64 = 1 << 16;
/// How the comment begins.
const COMMENT: &[u8] = b"%%BoundingBox:";

/// Where the bounding box of an EPS file is stated.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Bounds {
    /// In the header, or nowhere.
    InHeader,
    /// At the end: left, bottom, right and top in points.
    AtEnd([f64; 4]),
}

/// The bounding box of an EPS file; `None` for another document.
///
/// # Errors
/// Those of reading.
pub(super) fn bounds(path: &Path) -> io::Result<Option<Bounds>> {
    let mut file = File::open(path)?;
    let mut start = Vec::new();
    (&mut file).take(HEADER).read_to_end(&mut start)?;
    if start.starts_with(WITH_PREVIEW)
        && let Some(place) = start.get(4..).and_then(|rest| rest.first_chunk())
    {
        file.seek(SeekFrom::Start(u32::from_le_bytes(*place).into()))?;
        start.clear();
        (&mut file).take(64).read_to_end(&mut start)?;
    }
    let first = lines(&start).next().unwrap_or_default();
    if !first.starts_with(b"%!PS-Adobe-") || !first.windows(4).any(|word| word == b"EPSF") {
        return Ok(None);
    }
    let stated = lines(&start).find_map(|line| line.strip_prefix(COMMENT));
    if stated.is_none_or(|value| value.trim_ascii() != b"(atend)") {
        return Ok(Some(Bounds::InHeader));
    }
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(TRAILER)))?;
    let mut end = Vec::new();
    file.take(TRAILER).read_to_end(&mut end)?;
    let last = lines(&end).filter_map(|line| line.strip_prefix(COMMENT)).filter_map(four).last();
    Ok(Some(last.map_or(Bounds::InHeader, Bounds::AtEnd)))
}

fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&byte| matches!(byte, b'\r' | b'\n'))
}

/// Four numbers that are a box with an area.
fn four(text: &[u8]) -> Option<[f64; 4]> {
    let numbers = str::from_utf8(text).ok()?.split_ascii_whitespace().map(|word| word.parse().ok());
    let numbers: [f64; 4] = numbers.collect::<Option<Vec<_>>>()?.try_into().ok()?;
    let [left, bottom, right, top] = numbers;
    (numbers.iter().all(|v| v.abs() < 1e5) && left < right && bottom < top).then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use files::scratch::Scratch;

    #[test]
    fn the_box_is_found_at_the_end_if_the_header_says_so() {
        let folder = Scratch::new().unwrap();
        let path = folder.path().join("a.eps");
        let of = |text: &str| {
            std::fs::write(&path, text).unwrap();
            bounds(&path).unwrap()
        };
        let eps = |header: &str, trailer: &str| {
            of(&format!(
                "%!PS-Adobe-3.0 EPSF-3.0\r\n{header}\r\n%%EndComments\r\n0 0 9 9 rectfill\r\n{trailer}"
            ))
        };
        let at_end = "%%Trailer\n%%BoundingBox: 1 2 3 4\n%%BoundingBox: -10 5.5 90 80\n%%EOF\n";
        assert_eq!(eps("%%BoundingBox: (atend)", at_end), Some(Bounds::AtEnd([-10.0, 5.5, 90.0, 80.0])));
        assert_eq!(eps("%%BoundingBox: 0 0 9 9", at_end), Some(Bounds::InHeader));
        for wrong in ["", "%%BoundingBox: 1 2 3", "%%BoundingBox: 1 2 1 4", "%%BoundingBox: 0 0 1 nan"] {
            assert_eq!(eps("%%BoundingBox: (atend)", wrong), Some(Bounds::InHeader), "{wrong}");
        }
        assert_eq!(of("%!PS-Adobe-3.0\n%%BoundingBox: (atend)\n"), None);
        assert_eq!(of(""), None);
    }
}
