//! The pages of a TIFF file.
//!
//! Problem: a TIFF may hold several pictures, one behind another. The decoders read the first, and the others would be lost
//! in silence.
//! Method: the directories are followed from the header, without those that say they are a small copy or a mask. To
//! read another page than the first, the header in memory is pointed at its directory. Cost: none to speak of.
//! Limits: [`MOST_PAGES`]; pages are not looked at, so a blank one counts.
//! Source: TIFF 6.0, sections 2 and 8; the BigTIFF proposal for places of eight bytes.

use std::ops::Range;
use std::path::Path;

use observe::Diagnosis;

/// The most pages that are looked for.
const MOST_PAGES: usize = 1000;

const NEW_SUBFILE_TYPE: u16 = 254;
const SUBFILE_TYPE: u16 = 255;

/// Whether these are the first bytes of a TIFF, or of one with places of eight bytes (BigTIFF).
pub fn is_tiff(start: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| start.starts_with(*magic))
}

/// The numbers of a TIFF in its own byte order, and the form of its directories.
struct Numbers<'a> {
    bytes: &'a [u8],
    little: bool,
    /// Whether places and counts have eight bytes.
    big: bool,
}

impl Numbers<'_> {
    fn of(bytes: &[u8]) -> Numbers<'_> {
        let big = bytes.get(2..4).is_some_and(|magic| magic.contains(&b'+'));
        Numbers { bytes, little: bytes.starts_with(b"II"), big }
    }

    fn short(&self, at: usize) -> Option<u16> {
        let two = *self.bytes.get(at..)?.first_chunk::<2>()?;
        Some(if self.little { u16::from_le_bytes(two) } else { u16::from_be_bytes(two) })
    }

    fn long(&self, at: usize) -> Option<u32> {
        let four = *self.bytes.get(at..)?.first_chunk::<4>()?;
        Some(if self.little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
    }

    /// A place or a count.
    fn place(&self, at: usize) -> Option<usize> {
        if !self.big {
            return Some(self.long(at)? as usize);
        }
        let eight = *self.bytes.get(at..)?.first_chunk::<8>()?;
        let place = if self.little { u64::from_le_bytes(eight) } else { u64::from_be_bytes(eight) };
        usize::try_from(place).ok()
    }

    /// Where the place of the first directory is.
    fn first(&self) -> usize {
        if self.big { 8 } else { 4 }
    }

    /// Where the entries of a directory are, and where the place of the next directory is.
    fn entries(&self, directory: usize) -> Option<(impl Iterator<Item = usize>, usize)> {
        let (count, head, size) = match self.big {
            true => (self.place(directory)?, 8, 20),
            false => (self.short(directory)?.into(), 2, 12),
        };
        let begin = directory.checked_add(head)?;
        let end = count.checked_mul(size)?.checked_add(begin)?;
        Some(((begin..end.min(self.bytes.len())).step_by(size), end))
    }

    /// Where an entry has its value, or the place of it.
    fn value(&self, entry: usize) -> usize {
        if self.big { entry + 12 } else { entry + 8 }
    }

    /// Whether a directory is that of a small copy or a mask of another picture.
    fn is_copy(&self, mut entries: impl Iterator<Item = usize>) -> bool {
        entries.any(|at| match self.short(at) {
            // Bit 0 means a copy, bit 2 a mask.
            Some(NEW_SUBFILE_TYPE) => self.long(self.value(at)).is_some_and(|kind| kind & 0b101 != 0),
            Some(SUBFILE_TYPE) => self.short(self.value(at)) == Some(2),
            _ => false,
        })
    }
}

/// The place of a tag's value in the first picture, for values of bytes and 16-bit numbers.
pub(crate) fn field(bytes: &[u8], tag: u16) -> Option<Range<usize>> {
    let numbers = Numbers::of(bytes);
    let (mut entries, _) = numbers.entries(numbers.place(numbers.first())?)?;
    let entry = entries.find(|&at| numbers.short(at) == Some(tag))?;
    let each = if numbers.short(entry + 2)? == 3 { 2 } else { 1 };
    let length = numbers.place(entry + 4)?.checked_mul(each)?;
    let own = numbers.value(entry);
    let at = if length <= (if numbers.big { 8 } else { 4 }) { own } else { numbers.place(own)? };
    Some(at..at.checked_add(length)?)
}

/// Places of the directories of the pages. Empty if the file is damaged, which the decoder says better.
fn directories(bytes: &[u8]) -> Vec<usize> {
    let numbers = Numbers::of(bytes);
    let (mut pages, mut copies) = (Vec::new(), Vec::new());
    let mut next = numbers.place(numbers.first());
    while let Some(directory) = next.filter(|&at| at != 0) {
        // A ring of directories ends where it began.
        if pages.contains(&directory) || copies.contains(&directory) {
            break;
        }
        let Some((entries, after)) = numbers.entries(directory) else { break };
        if numbers.is_copy(entries) {
            copies.push(directory);
        } else {
            pages.push(directory);
        }
        if pages.len() + copies.len() > MOST_PAGES {
            break;
        }
        next = numbers.place(after);
    }
    if pages.is_empty() { copies } else { pages }
}

/// How many pages a TIFF has; none in a damaged file.
pub fn count(bytes: &[u8]) -> usize {
    directories(bytes).len()
}

/// Makes a page the first picture of the file in memory: the one of this number, else the first that is no
/// copy.
///
/// # Errors
/// No page of this number.
pub(crate) fn choose(name: &Path, bytes: &mut [u8], page: Option<u32>) -> Result<(), Diagnosis> {
    let pages = directories(bytes);
    if pages.is_empty() {
        return Ok(());
    }
    let at = match page {
        None => 0,
        Some(number) => number.checked_sub(1).map_or(usize::MAX, |at| at as usize),
    };
    let Some(&directory) = pages.get(at) else {
        let (number, pages) = (page.unwrap_or_default(), pages.len());
        return Err(Diagnosis::of_file(name, format!("there is no page {number}; the file has {pages}")));
    };
    // Every place was read as a number of so many bytes.
    let Numbers { little, big, .. } = Numbers::of(bytes);
    let (low, high) = ((directory as u32).to_le_bytes(), (directory as u64).to_le_bytes());
    let mut place = if big { high.to_vec() } else { low.to_vec() };
    if !little {
        place.reverse();
    }
    let first = Numbers::of(bytes).first();
    bytes[first..first + place.len()].copy_from_slice(&place);
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

    #[test]
    fn places_of_eight_bytes_are_followed_too() {
        let mut bytes = b"II+\0\x08\0\0\0\x10\0\0\0\0\0\0\0".to_vec();
        for (tag, next) in [(254u16, 52u64), (262, 0)] {
            bytes.extend(1u64.to_le_bytes());
            bytes.extend(tag.to_le_bytes());
            bytes.extend([3, 0]);
            bytes.extend(1u64.to_le_bytes());
            bytes.extend(1u64.to_le_bytes());
            bytes.extend(next.to_le_bytes());
        }
        // The first is a copy of the second.
        assert_eq!(directories(&bytes), [52]);
        choose(Path::new("a.tif"), &mut bytes, None).unwrap();
        assert_eq!((bytes[8], field(&bytes, 262)), (52, Some(72..74)));
    }

    proptest! {
        #[test]
        fn any_bytes_have_pages_or_none(bytes in prop::collection::vec(any::<u8>(), 8..200), page in prop::option::of(any::<u32>())) {
            for magic in [b"II*\0", b"MM\0+"] {
                let mut bytes = [magic, &bytes[..]].concat();
                let length = bytes.len();
                let _ = choose(Path::new("a.tif"), &mut bytes, page);
                let _ = field(&bytes, 262);
                prop_assert_eq!(bytes.len(), length);
            }
        }
    }
}
