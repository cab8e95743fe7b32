//! What the words of a document let suspect, before anything of it is drawn.
//!
//! Problem: spot colours need plates, overprinting another way of mixing, and some gradients another
//! interpreter; to look for them by drawing costs as much as half of the page.
//! Method: the words that each of them needs are looked for in the document, and in its compressed streams
//! of objects.
//! Cost: a look at the bytes of the file. Limits: what cannot be looked into is suspected of all; words in
//! parts that nothing uses count.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use memchr::memmem;

use super::objects;

/// What a document may have.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Suspected {
    /// Spot colours; also if it is a program.
    pub spots: bool,
    /// Things that overprint.
    pub overprint: bool,
    /// Gradients that not every interpreter draws ([`interpreter`](super::interpreter)).
    pub gradients: bool,
}

/// The type of a stream of objects.
const PACKED: &[u8] = b"/ObjStm";
/// The names of colour spaces with spot colours. Source: ISO 32000-2, 8.6.6.4 and 8.6.6.5.
const SPOTS: [&[u8]; 3] = [b"/Separation", b"/DeviceN", b"/NChannel"];
const SHADING: &[u8] = b"/ShadingType";
/// What says of a graphics state whether it overprints. Source: ISO 32000-2, table 57.
const OVERPRINT: [&[u8]; 2] = [b"/OP", b"/op"];
/// Source: more than the words and the white space within them.
const LONGEST: usize = 64;
/// Bytes that are looked at together, so that they stay in the cache.
const PART: u64 = 1 << 20;

impl Suspected {
    /// Everything that there may be.
    const ALL: Suspected = Suspected { spots: true, overprint: true, gradients: true };

    /// Looks at a document.
    ///
    /// # Errors
    /// Those of reading it.
    pub fn of(path: &Path) -> io::Result<Suspected> {
        let mut found = Suspected::default();
        let mut file = File::open(path)?;
        let mut part = Vec::new();
        let mut is_packed = false;
        loop {
            // A word may lie across two parts.
            part.drain(..part.len().saturating_sub(LONGEST - 1));
            let before = part.len();
            (&mut file).take(PART).read_to_end(&mut part)?;
            if part.len() == before || found == Suspected::ALL {
                break;
            }
            if before == 0 && part.starts_with(b"%!") {
                // A program may be anything; whether it overprints it says in one word.
                found.spots = true;
            }
            found.overprint |= found.spots && memmem::find(&part, b"setoverprint").is_some();
            is_packed |= memmem::find(&part, PACKED).is_some();
            found.add(&part);
        }
        if is_packed {
            let bytes = objects::bytes(path)?;
            if objects::is_encrypted(&bytes) || objects::is_cut(&bytes) {
                return Ok(Suspected::ALL);
            }
            objects::objects(&bytes).values().for_each(|object| found.add(&object.text));
        }
        Ok(found)
    }

    /// Adds what some bytes let suspect.
    fn add(&mut self, bytes: &[u8]) {
        let follows = |word: &[u8], next: &[u8]| {
            memmem::find_iter(bytes, word)
                .any(|at| bytes[at + word.len()..].trim_ascii_start().starts_with(next))
        };
        self.spots |= SPOTS.iter().any(|word| memmem::find(bytes, word).is_some());
        self.overprint |= OVERPRINT.iter().any(|word| follows(word, b"true"));
        self.gradients |= follows(SHADING, b"1");
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn what_a_document_may_have_is_suspected_wherever_its_words_begin() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("document");
        let suspected = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let found = Suspected::of(&path).unwrap();
            (found.spots, found.overprint, found.gradients)
        };
        assert_eq!(suspected(b"%!PS"), (true, false, false));
        assert_eq!(suspected(b"%!PS true setoverprint"), (true, true, false));
        assert_eq!(
            suspected(b"%PDF-1.4 /DeviceRGB /DeviceCMYK /Separa tion /OPM 1 /OP false /ShadingType 2"),
            (false, false, false)
        );
        assert_eq!(suspected(b"%PDF-1.4 /ShadingType 3 /ShadingType\r\n1"), (false, false, true));
        assert_eq!(suspected(b"%PDF-1.4 /op\ntrue"), (false, true, false));
        // Before, across and after the border of two parts.
        for at in (1 << 20) - 20..(1 << 20) + 3 {
            let with = |word: &[u8]| {
                let mut bytes = vec![b' '; 3 << 20];
                bytes[at..at + word.len()].copy_from_slice(word);
                bytes
            };
            assert_eq!(suspected(&with(b"/Separation")), (true, false, false), "{at}");
            assert_eq!(suspected(&with(b"/ShadingType 1")), (false, false, true), "{at}");
            assert_eq!(suspected(&with(b"/OP true")), (false, true, false), "{at}");
        }
    }

    #[test]
    fn streams_of_objects_are_looked_into() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("document");
        for (object, wanted) in [
            ("<< /Type /Page >>", Suspected::default()),
            ("<< /OP true >>", Suspected { overprint: true, ..Suspected::default() }),
            ("[/Separation /Gold /DeviceCMYK 9 0 R]", Suspected { spots: true, ..Suspected::default() }),
        ] {
            let mut zipped = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
            zipped.write_all(format!("7 0 {object}").as_bytes()).unwrap();
            let mut file = b"%PDF-1.5 1 0 obj << /Type /ObjStm /N 1 /First 4 >> stream\n".to_vec();
            file.extend(zipped.finish().unwrap());
            file.extend(b"\nendstream endobj");
            std::fs::write(&path, &file).unwrap();
            assert_eq!(Suspected::of(&path).unwrap(), wanted, "{object}");
            file.extend(b" /Encrypt 3 0 R");
            std::fs::write(&path, &file).unwrap();
            assert_eq!(Suspected::of(&path).unwrap(), Suspected::ALL);
        }
    }
}
