//! The pages of a TIFF file.
//!
//! Problem: a TIFF may hold several pictures, one behind another. The decoders read the first, and the others would be lost
//! in silence.
//! Method: the directories are followed from the header, without those that say they are a small copy or a mask. To
//! read another page than the first, the header in memory is pointed at its directory. Cost: none to speak of.
//! Limits: [`MOST_PAGES`]; pages are not looked at, so a blank one counts.
//! Source: TIFF 6.0, sections 2 and 8.

use std::path::Path;

use super::error::{several_pages, wrong};
use crate::process::MOST_PAGES;
use observe::Diagnosis;

const NEW_SUBFILE_TYPE: u16 = 254;
const SUBFILE_TYPE: u16 = 255;

/// Numbers of a TIFF in its own byte order.
struct Numbers<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl Numbers<'_> {
    fn short(&self, at: usize) -> Option<u16> {
        let two = *self.bytes.get(at..)?.first_chunk::<2>()?;
        Some(if self.little { u16::from_le_bytes(two) } else { u16::from_be_bytes(two) })
    }

    fn long(&self, at: usize) -> Option<u32> {
        let four = *self.bytes.get(at..)?.first_chunk::<4>()?;
        Some(if self.little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
    }

    /// Whether a directory is that of a small copy or a mask of another picture.
    fn is_copy(&self, directory: usize, entries: usize) -> bool {
        (0..entries).map(|entry| directory + 2 + 12 * entry).any(|at| match self.short(at) {
            // Bit 0 means a copy, bit 2 a mask.
            Some(NEW_SUBFILE_TYPE) => self.long(at + 8).is_some_and(|kind| kind & 0b101 != 0),
            Some(SUBFILE_TYPE) => self.short(at + 8) == Some(2),
            _ => false,
        })
    }
}

/// Places of the directories of the pages. Empty if the file is damaged, which the decoder says better.
fn directories(bytes: &[u8]) -> Vec<usize> {
    let numbers = Numbers { bytes, little: bytes.starts_with(b"II") };
    let (mut pages, mut copies) = (Vec::new(), Vec::new());
    let mut next = numbers.long(4);
    while let Some(directory) = next.map(|at| at as usize).filter(|&at| at != 0) {
        // A ring of directories ends where it began.
        if pages.contains(&directory) || copies.contains(&directory) {
            break;
        }
        let Some(entries) = numbers.short(directory).map(usize::from) else { break };
        if numbers.is_copy(directory, entries) {
            copies.push(directory);
        } else {
            pages.push(directory);
        }
        if pages.len() + copies.len() > MOST_PAGES as usize {
            break;
        }
        next = numbers.long(directory + 2 + 12 * entries);
    }
    if pages.is_empty() { copies } else { pages }
}

/// How many pages there are; none in a damaged file.
pub(super) fn count(bytes: &[u8]) -> usize {
    directories(bytes).len()
}

/// Makes a page the first picture of the file in memory: the one of this number, or the only one.
///
/// # Errors
/// Several pages and no number, or no page of this number.
pub(super) fn choose(path: &Path, bytes: &mut [u8], page: Option<u32>) -> Result<(), Diagnosis> {
    let pages = directories(bytes);
    if pages.is_empty() {
        return Ok(());
    }
    let at = match page {
        None if pages.len() == 1 => 0,
        None => {
            let pages: Vec<u32> = (1..).take(pages.len()).collect();
            return Err(several_pages(path, &pages));
        }
        Some(number) => number.checked_sub(1).map_or(usize::MAX, |at| at as usize),
    };
    let Some(&directory) = pages.get(at) else {
        let (number, pages) = (page.unwrap_or_default(), pages.len());
        return Err(wrong(path, format!("there is no page {number}; the file has {pages}")));
    };
    // Every place was read as a number of four bytes.
    let place = directory as u32;
    let place = if bytes.starts_with(b"II") { place.to_le_bytes() } else { place.to_be_bytes() };
    bytes[4..8].copy_from_slice(&place);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Directories with the kind of each picture, one behind another.
    fn file(kinds: &[u32]) -> Vec<u8> {
        let mut bytes = b"MM\0*\0\0\0\x08".to_vec();
        for (at, kind) in kinds.iter().enumerate() {
            let next = if at + 1 < kinds.len() { bytes.len() as u32 + 18 } else { 0 };
            bytes.extend([0, 1, 0, 254, 0, 4, 0, 0, 0, 1]);
            bytes.extend(kind.to_be_bytes());
            bytes.extend(next.to_be_bytes());
        }
        bytes
    }

    #[test]
    fn copies_and_masks_are_no_pages_and_a_ring_ends() {
        assert_eq!(directories(&file(&[0, 1, 2, 4])), [8, 44]);
        assert_eq!(directories(&file(&[1])), [8]);
        let mut ring = file(&[0, 0]);
        let end = ring.len();
        ring[end - 4..].copy_from_slice(&[0, 0, 0, 8]);
        assert_eq!(directories(&ring), [8, 26]);
        assert_eq!(count(b"II*\0\x08"), 0);
        // The picture itself may come behind its copy.
        let mut bytes = file(&[1, 0]);
        choose(Path::new("a.tif"), &mut bytes, None).unwrap();
        assert_eq!(bytes[4..8], [0, 0, 0, 26]);
    }

    proptest! {
        #[test]
        fn any_bytes_have_pages_or_none(bytes in prop::collection::vec(any::<u8>(), 8..200), page in prop::option::of(any::<u32>())) {
            let mut bytes = [b"II*\0", &bytes[..]].concat();
            let length = bytes.len();
            let _ = choose(Path::new("a.tif"), &mut bytes, page);
            prop_assert_eq!(bytes.len(), length);
        }
    }
}
