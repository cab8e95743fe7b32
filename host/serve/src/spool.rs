//! Documents on their way to disk: what kind they are, unpacked, never more of one in memory than a piece.
//!
//! Method: pieces go through the inflater that the client has named into a file, up to a limit of what comes out; the first bytes of what
//! comes out say what it is. Cost: a piece and the window of the inflater. Limits: [`queue::filter::LARGEST`] bytes.
//! Source: RFC 1950 to 1952; RFC 8011, section 5.4.32. What IPP calls deflate is RFC 1951; some clients put the two bytes of
//! RFC 1950 before it, and both are read.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::budget::Exceeded;
use files::durable;
use flate2::write::{DeflateDecoder, MultiGzDecoder, ZlibDecoder};

/// How a document is packed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Packing {
    /// It is not.
    None,
    /// `deflate`.
    Deflate,
    /// `gzip`.
    Gzip,
}

/// What a document is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Kind {
    /// Its type.
    pub mime: &'static str,
    /// The end of its file's name.
    pub ending: &'static str,
    /// How it begins.
    begins: &'static [u8],
}

/// The type of finished jobs.
pub const JOB: &str = "application/vnd.foilpress.job";

/// The documents that are printed.
pub const KINDS: [Kind; 7] = [
    Kind { mime: "application/pdf", ending: "pdf", begins: b"%PDF" },
    Kind { mime: "image/pwg-raster", ending: "pwg", begins: &queue::raster::SYNC },
    Kind { mime: "image/urf", ending: "urf", begins: &queue::raster::APPLE },
    Kind { mime: "image/jpeg", ending: "jpg", begins: b"\xff\xd8\xff" },
    Kind { mime: "image/png", ending: "png", begins: b"\x89PNG" },
    Kind { mime: JOB, ending: "rgl", begins: b"\x1b%\x80A" },
    Kind { mime: JOB, ending: "rgl", begins: b"\x1be\x1b%\x80A" },
];

/// Bytes that are enough to know a kind.
const ENOUGH: usize = 8;

/// Why a document is not taken.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// It is larger than the limit.
    #[error("the document is larger than 1 GB")]
    TooLarge,
    /// It cannot be unpacked.
    #[error("the document is not packed as the request says")]
    Packing,
    /// No kind that is printed.
    #[error("the document is no PDF, PWG or Apple raster, JPEG, PNG or finished job")]
    Kind,
    /// Nothing came.
    #[error("the document is empty")]
    Empty,
    /// There is no room for it.
    #[error(transparent)]
    Share(Exceeded),
    /// The disk.
    #[error("the document cannot be kept")]
    Disk(#[source] io::Error),
}

/// A file that takes no more than the limit.
struct Limited {
    file: File,
    begins: Vec<u8>,
    length: u64,
    most: u64,
    /// What the disk said. The inflaters hand on no more than that something failed.
    failed: Option<io::Error>,
}

impl Write for Limited {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.length += bytes.len() as u64;
        if self.length > self.most {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let room = ENOUGH.saturating_sub(self.begins.len());
        self.begins.extend_from_slice(&bytes[..room.min(bytes.len())]);
        if let Err(error) = self.file.write_all(bytes) {
            let kind = error.kind();
            self.failed = Some(error);
            return Err(kind.into());
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

enum Inflater {
    Plain(Limited),
    /// Which of the two it is, the first bytes say.
    Deflate(Option<Limited>, Vec<u8>),
    Raw(DeflateDecoder<Limited>),
    Zlib(ZlibDecoder<Limited>),
    Gzip(MultiGzDecoder<Limited>),
}

/// A document that is being kept.
pub struct Spool {
    inflater: Inflater,
    path: PathBuf,
}

impl Spool {
    /// Begins a document in a folder.
    ///
    /// # Errors
    /// What the disk says.
    pub fn begin(folder: &Path, packing: Packing, most: u64) -> Result<Spool, SpoolError> {
        let path = folder.join("document.part");
        let file = File::create(&path).map_err(SpoolError::Disk)?;
        let out = Limited { file, begins: Vec::new(), length: 0, most, failed: None };
        let inflater = match packing {
            Packing::None => Inflater::Plain(out),
            Packing::Deflate => Inflater::Deflate(Some(out), Vec::new()),
            Packing::Gzip => Inflater::Gzip(MultiGzDecoder::new(out)),
        };
        Ok(Spool { inflater, path })
    }

    /// Takes the next piece.
    ///
    /// # Errors
    /// It cannot be unpacked or kept, or is too much.
    pub fn take(&mut self, bytes: &[u8]) -> Result<(), SpoolError> {
        if let Inflater::Deflate(out, first) = &mut self.inflater {
            first.extend_from_slice(bytes);
            if first.len() < 2 {
                return Ok(());
            }
            let (first, Some(out)) = (std::mem::take(first), out.take()) else { return Ok(()) };
            let check = u16::from_be_bytes([first[0], first[1]]);
            let is_zlib = first[0] & 0x0f == 8 && first[0] >> 4 <= 7 && check % 31 == 0;
            self.inflater = match is_zlib {
                true => Inflater::Zlib(ZlibDecoder::new(out)),
                false => Inflater::Raw(DeflateDecoder::new(out)),
            };
            return self.take(&first);
        }
        let written = match &mut self.inflater {
            Inflater::Plain(out) => out.write_all(bytes),
            Inflater::Raw(out) => out.write_all(bytes),
            Inflater::Zlib(out) => out.write_all(bytes),
            Inflater::Gzip(out) => out.write_all(bytes),
            Inflater::Deflate(..) => Ok(()),
        };
        written.map_err(|error| self.failed(&error))
    }

    /// Its file.
    fn out(&mut self) -> Option<&mut Limited> {
        match &mut self.inflater {
            Inflater::Plain(out) => Some(out),
            Inflater::Deflate(out, _) => out.as_mut(),
            Inflater::Raw(out) => Some(out.get_mut()),
            Inflater::Zlib(out) => Some(out.get_mut()),
            Inflater::Gzip(out) => Some(out.get_mut()),
        }
    }

    /// Bytes that have come out so far.
    pub fn length(&mut self) -> u64 {
        self.out().map_or(0, |out| out.length)
    }

    fn failed(&mut self, error: &io::Error) -> SpoolError {
        match self.out().and_then(|out| out.failed.take()) {
            Some(error) => SpoolError::Disk(error),
            None if error.kind() == io::ErrorKind::FileTooLarge => SpoolError::TooLarge,
            None => SpoolError::Packing,
        }
    }

    /// Ends the document: it is on disk, under its own name, whole. Says where, what it is, and its bytes.
    ///
    /// # Errors
    /// It ends too early, is none, or of no kind that is printed.
    pub fn end(mut self) -> Result<(PathBuf, Kind, u64), SpoolError> {
        let finished = match &mut self.inflater {
            Inflater::Plain(out) => out.flush(),
            Inflater::Deflate(..) => return Err(SpoolError::Empty),
            Inflater::Raw(out) => out.try_finish(),
            Inflater::Zlib(out) => out.try_finish(),
            Inflater::Gzip(out) => out.try_finish(),
        };
        if let Err(error) = finished {
            return Err(self.failed(&error));
        }
        let out = self.out().ok_or(SpoolError::Empty)?;
        if out.length == 0 {
            return Err(SpoolError::Empty);
        }
        let kind =
            KINDS.into_iter().find(|kind| out.begins.starts_with(kind.begins)).ok_or(SpoolError::Kind)?;
        let length = out.length;
        let to = self.path.with_file_name(format!("document.{}", kind.ending));
        durable::place(&self.path, &to).map_err(SpoolError::Disk)?;
        Ok((to, kind, length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};
    use proptest::prelude::*;

    fn kept(pieces: &[&[u8]], packing: Packing, most: u64) -> Result<(Vec<u8>, &'static str), SpoolError> {
        let folder = tempfile::tempdir().unwrap();
        let mut spool = Spool::begin(folder.path(), packing, most)?;
        for piece in pieces {
            spool.take(piece)?;
        }
        let (path, kind, length) = spool.end()?;
        let bytes = std::fs::read(path).unwrap();
        assert_eq!(bytes.len() as u64, length);
        Ok((bytes, kind.mime))
    }

    #[test]
    fn what_is_too_large_too_small_or_not_packed_is_refused() {
        let bomb = {
            let mut packed = GzEncoder::new(Vec::new(), Compression::best());
            packed.write_all(b"%PDF").unwrap();
            packed.write_all(&vec![0; 5_000_000]).unwrap();
            packed.finish().unwrap()
        };
        assert!(bomb.len() < 10_000);
        assert!(matches!(kept(&[&bomb], Packing::Gzip, 1_000_000), Err(SpoolError::TooLarge)));
        assert!(matches!(kept(&[&bomb[..2000]], Packing::Gzip, 1 << 30), Err(SpoolError::Packing)));
        assert!(matches!(kept(&[b"%PDF-1.4 ..."], Packing::Gzip, 99), Err(SpoolError::Packing)));
        assert!(matches!(kept(&[b"%PDF-1.4 ..."], Packing::None, 4), Err(SpoolError::TooLarge)));
        assert!(matches!(kept(&[b"hello"], Packing::None, 99), Err(SpoolError::Kind)));
        for packing in [Packing::None, Packing::Deflate] {
            assert!(matches!(kept(&[], packing, 99), Err(SpoolError::Empty)));
        }
    }

    proptest! {
        #[test]
        fn a_document_comes_out_as_it_went_in(
            bytes in prop::collection::vec(any::<u8>(), 0..3000), kind in 0..KINDS.len(), cut in 1usize..700, packed in 0usize..4
        ) {
            let document = [KINDS[kind].begins, &bytes].concat();
            let level = Compression::default();
            let (sent, packing) = match packed {
                0 => (document.clone(), Packing::None),
                1 => {
                    let mut out = GzEncoder::new(Vec::new(), level);
                    out.write_all(&document).unwrap();
                    (out.finish().unwrap(), Packing::Gzip)
                }
                2 => {
                    let mut out = ZlibEncoder::new(Vec::new(), level);
                    out.write_all(&document).unwrap();
                    (out.finish().unwrap(), Packing::Deflate)
                }
                _ => {
                    let mut out = DeflateEncoder::new(Vec::new(), level);
                    out.write_all(&document).unwrap();
                    (out.finish().unwrap(), Packing::Deflate)
                }
            };
            let pieces: Vec<&[u8]> = sent.chunks(cut).collect();
            let (found, mime) = kept(&pieces, packing, 1 << 20).unwrap();
            prop_assert_eq!(found, document);
            prop_assert_eq!(mime, KINDS[kind].mime);
        }
    }
}
