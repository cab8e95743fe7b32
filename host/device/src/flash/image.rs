//! The firmware in a file, checked before anything is erased: a damaged file or another program is refused.
//!
//! A program for the boards states its name in its *binary info*, which the tools of the board read too: a header in the
//! first sector points to a table of entries, some of which are strings with an identifier.
//! Source: RP2040 C/C++ SDK, `pico_binary_info`.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use uf2::{Chip, Image, Uf2Error};

/// The program's name in its binary info.
const NAME: &str = "foilpress-bridge";

const MARKERS: (u32, u32) = (0x7188_ebf2, 0xe71a_a390);
const STRING: u16 = 6;
const TAG: u16 = u16::from_le_bytes(*b"RP");
const PROGRAM_NAME: u32 = 0x0203_1c86;
const PROGRAM_VERSION: u32 = 0x11a9_bc3a;
/// Limits above what any program has, because the file is not to be trusted.
const MOST_ENTRIES: u32 = 1024;
const LONGEST_STRING: usize = 120;

/// Why a file is not flashed. Nothing was erased.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// The file is damaged, or made for another board.
    #[error("not flashed: the file is not a valid firmware image")]
    Damaged(#[from] Uf2Error),
    /// The file is a complete program for the board, but not the bridge's firmware.
    #[error(
        "not flashed: this is {}, not the bridge's firmware; to install it anyway, copy the file to the board's drive", named(.0)
    )]
    OtherProgram(Option<String>),
}

/// Why there is no firmware of a file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The file is not the bridge's firmware.
    #[error("{}", .path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: ImageError,
    },
}

fn named(program: &Option<String>) -> String {
    match program {
        Some(name) => format!("a program called `{name}`"),
        None => "a program without a name".into(),
    }
}

/// A complete image of the bridge's firmware.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Firmware {
    file: Vec<u8>,
    image: Image,
    version: String,
}

impl Firmware {
    /// Reads a UF2 file.
    pub fn read(file: &[u8]) -> Result<Firmware, ImageError> {
        let image = uf2::decode(file)?;
        image.check_boot()?;
        let name = entry(&image, PROGRAM_NAME);
        if name.as_deref() != Some(NAME) {
            return Err(ImageError::OtherProgram(name));
        }
        let version = entry(&image, PROGRAM_VERSION).unwrap_or_else(|| "of no version".into());
        Ok(Firmware { file: file.to_vec(), image, version })
    }

    /// Opens and reads a UF2 file.
    pub fn open(path: &Path) -> Result<Firmware, FileError> {
        let cannot = |source| FileError::Read { path: path.to_owned(), source };
        let mut file = Vec::new();
        // One byte more than the largest valid file, so that the reader refuses a larger one.
        let most = uf2::LARGEST_FILE as u64 + 1;
        File::open(path).map_err(cannot)?.take(most).read_to_end(&mut file).map_err(cannot)?;
        Firmware::read(&file).map_err(|source| FileError::Image { path: path.to_owned(), source })
    }

    /// The file it was read from.
    pub fn file(&self) -> &[u8] {
        &self.file
    }

    /// The chip it is for.
    pub fn chip(&self) -> Chip {
        self.image.chip()
    }

    /// The image for the flash.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Its version, as the bridge will report it.
    pub fn version(&self) -> &str {
        &self.version
    }
}

/// The chip of a bridge that reports this version: a Pico does not name itself.
pub(super) fn chip_of(version: &str) -> Chip {
    let named = |chip: &Chip| version.ends_with(&format!("({chip})"));
    Chip::ALL.into_iter().find(named).unwrap_or(Chip::Rp2040)
}

/// A string of the program's binary info.
fn entry(image: &Image, wanted: u32) -> Option<String> {
    let first = uf2::START;
    // Behind the vector table, wherever that ends; five words.
    let header = (first..first + uf2::SECTOR)
        .step_by(4)
        .find(|&at| image.word(at) == Some(MARKERS.0) && image.word(at + 16) == Some(MARKERS.1))?;
    let (start, end) = (image.word(header + 4)?, image.word(header + 8)?);
    let count = (end.checked_sub(start)? / 4).min(MOST_ENTRIES);
    (0..count).find_map(|i| {
        let at = image.word(start.checked_add(4 * i)?)?;
        let kind = image.word(at)?;
        let fits =
            kind == u32::from(TAG) << 16 | u32::from(STRING) && image.word(at.checked_add(4)?)? == wanted;
        if !fits {
            return None;
        }
        let bytes = image.read(image.word(at.checked_add(8)?)?, LONGEST_STRING);
        let length = bytes.iter().position(|&byte| byte == 0)?;
        let text = str::from_utf8(&bytes[..length]).ok()?;
        Some(text.chars().filter(|c| !c.is_control()).collect())
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A program that boots and says what it is: `length` bytes, laid out as the SDK does it.
    pub fn program(name: &str, version: &str, length: usize, seed: u32) -> Vec<u8> {
        let mut image: Vec<u8> = (0..length as u32).map(|i| (i.wrapping_mul(seed | 1) >> 13) as u8).collect();
        let mut word = |at: usize, value: u32| image[at..at + 4].copy_from_slice(&value.to_le_bytes());
        word(0x100, 0x2004_2000);
        word(0x104, 0x1000_0201);
        let at = |offset: u32| 0x1000_0000 + offset;
        for (i, value) in [MARKERS.0, at(0x400), at(0x408), at(0x500), MARKERS.1].into_iter().enumerate() {
            word(0x1c0 + 4 * i, value);
        }
        word(0x400, at(0x420));
        word(0x404, at(0x440));
        for (entry, id, text) in [(0x420, 0x0203_1c86, 0x600), (0x440, 0x11a9_bc3a, 0x700)] {
            word(entry, 0x5052_0006);
            word(entry + 4, id);
            word(entry + 8, at(text));
        }
        for (at, text) in [(0x600, name), (0x700, version)] {
            image[at..at + text.len()].copy_from_slice(text.as_bytes());
            image[at + text.len()] = 0;
        }
        let checksum = crc_mpeg_2(&image[..252]);
        image[252..256].copy_from_slice(&checksum.to_le_bytes());
        image
    }

    /// Bit by bit, as the data sheet defines it.
    pub fn crc_mpeg_2(bytes: &[u8]) -> u32 {
        bytes.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte) << 24, |crc, _| {
                if crc >> 31 == 1 { crc << 1 ^ 0x04c1_1db7 } else { crc << 1 }
            })
        })
    }

    pub fn file(name: &str, version: &str, length: usize, seed: u32) -> Vec<u8> {
        uf2::encode(Chip::Rp2040, &[(0x1000_0000, &program(name, version, length, seed))]).unwrap()
    }

    #[test]
    fn the_bridges_firmware_is_known_and_tells_its_version() {
        let firmware = Firmware::read(&file("foilpress-bridge", "1.2.3", 5000, 9)).unwrap();
        assert_eq!(firmware.version(), "1.2.3");
    }

    /// The same for a Pico 2: the vector table at the beginning, a block behind it.
    pub fn file_2350(version: &str, length: usize, seed: u32) -> Vec<u8> {
        let mut image = program("foilpress-bridge", version, length, seed);
        let words = [0xffff_ded3u32, 0x1021_0142, 0x0000_01ff, 0, 0xab12_3579];
        for (at, word) in
            [(0, 0x2008_0000), (4, 0x1000_0201)].into_iter().chain((0x124..).step_by(4).zip(words))
        {
            image[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        uf2::encode(Chip::Rp2350, &[(0x1000_0000, &image)]).unwrap()
    }

    #[test]
    fn the_firmware_of_each_board_is_told_by_what_a_bridge_reports() {
        assert_eq!(Firmware::read(&file_2350("1.2.3 (Pico 2)", 5000, 9)).unwrap().chip(), Chip::Rp2350);
        assert_eq!([chip_of("1.2.3"), chip_of("1.2.3 (Pico 2)")], Chip::ALL);
    }

    #[test]
    fn another_program_is_refused_by_its_name() {
        let error = Firmware::read(&file("MicroPython", "1.22", 5000, 9)).unwrap_err();
        assert_eq!(error, ImageError::OtherProgram(Some("MicroPython".into())));
        assert!(error.to_string().contains("MicroPython"));
        let mut nameless = program("x", "1", 5000, 9);
        nameless[0x1c0] ^= 1;
        let nameless = uf2::encode(Chip::Rp2040, &[(0x1000_0000, &nameless)]).unwrap();
        assert_eq!(Firmware::read(&nameless), Err(ImageError::OtherProgram(None)));
    }

    proptest! {
        /// Whatever the pointers of the table are.
        #[test]
        fn a_damaged_table_is_never_a_panic(
            edits in proptest::collection::vec((0x1c0usize..0x460, any::<u8>()), 1..40),
        ) {
            let mut image = program("foilpress-bridge", "1", 5000, 3);
            for (at, value) in edits {
                image[at] = value;
            }
            let _ = Firmware::read(&uf2::encode(Chip::Rp2040, &[(0x1000_0000, &image)]).unwrap());
        }
    }
}
