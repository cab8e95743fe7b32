//! UF2, the format in which a board's boot loader takes an image: made, read, and checked before anything is erased.
//!
//! A file is a row of 512-byte blocks, each with 256 bytes of the image, its own address and its own number, so that
//! they may arrive in any order. The boot loader restarts the board when it has seen all of them, whatever was in
//! them; so a reader that wants to be sure has to look first. [`decode`] takes one whole image for an RP2040 with the
//! flash of a Pico and nothing else; [`Image::check_boot`] says whether the boot ROM would start it.
//!
//! The format has no checksum. [`encode`] writes one of each block behind its page, into bytes that boot loaders do not look
//! at, and [`decode`] holds a file that has any to all of them.
//!
//! Cost: two passes over the file, a copy of its pages. Limits: no other chips, no files of several chips, none of the
//! format's extensions; the linker and the usual tools write none of these for the RP2040.
//! Source: Microsoft's description of UF2; RP2040 data sheet, 2.8.1.3.1 (checksum) and 2.8.4 (UF2).

#![forbid(unsafe_code)]

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crc::{CRC_32_ISO_HDLC, CRC_32_MPEG_2, Crc};

/// Bytes of the image in one block, which is a page of the flash.
pub const PAGE: usize = 256;
/// Bytes of one block in the file.
pub const BLOCK: usize = 512;
/// Bytes of flash that are erased at once.
pub const SECTOR: u32 = 4096;
/// The flash of a Pico, 2 MiB, as the processor sees it.
pub const FLASH: Range<u32> = 0x1000_0000..0x1020_0000;
/// The longest file there can be: every page of the flash once.
pub const LARGEST_FILE: usize = (FLASH.end - FLASH.start) as usize / PAGE * BLOCK;

const MAGIC: [u32; 3] = [0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30];
/// Stands behind the page, before the checksum of everything in front of it.
const CHECKED: u32 = 0x4352_4331;
/// Where.
const CHECK: usize = 32 + PAGE;
const FAMILY_PRESENT: u32 = 0x2000;
const RP2040: u32 = 0xE48B_FF56;
/// The chips of the Pico 2.
const RP2350: Range<u32> = 0xE48B_FF57..0xE48B_FF5C;
const MEMORY: Range<u32> = 0x2000_0000..0x2004_2000;
/// Where the vector table is: behind the second-stage boot loader.
const VECTORS: u32 = FLASH.start + PAGE as u32;

/// What is wrong with an image or a file. Blocks are counted from 0 as they stand in the file.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Uf2Error {
    /// Bytes that are not to be in flash.
    #[error(
        "the image has {length} bytes at {address:#010x}, which is not all in the Pico's flash (0x10000000 to 0x10200000)"
    )]
    NotFlash {
        /// Where they begin.
        address: u64,
        /// How many.
        length: usize,
    },
    /// Two values for one byte.
    #[error("two parts of the image overlap at {0:#010x}")]
    Overlap(u32),
    /// Nothing.
    #[error("the file is empty")]
    Empty,
    /// More than fits the flash.
    #[error("the file has {0} bytes; the largest image for a Pico has {LARGEST_FILE}")]
    TooLarge(usize),
    /// Cut off, or not made of blocks.
    #[error("the file has {0} bytes, which is no whole number of 512-byte blocks; was it copied to its end?")]
    Length(usize),
    /// Not a block.
    #[error("block {0} does not begin and end as UF2 blocks do: no UF2 file, or a damaged one")]
    Magic(usize),
    /// For another chip.
    #[error("block {at} is for {}, not for the Pico's RP2040", chip(*.family))]
    Family {
        /// Which block.
        at: usize,
        /// Its chip, 0 if it names none.
        family: u32,
    },
    /// Changed since it was made.
    #[error("block {0} is damaged: its checksum is not that of its bytes; get the file anew")]
    Checksum(usize),
    /// Something the boot ROM would not write.
    #[error(
        "block {at} is of a kind a Pico does not take (flags {flags:#x}, {size} bytes; 0x2000 and 256 are usual)"
    )]
    Kind {
        /// Which block.
        at: usize,
        /// Its flags.
        flags: u32,
        /// Bytes of the image in it.
        size: u32,
    },
    /// Not a page of the flash.
    #[error(
        "block {at} is for {address:#010x}, which is no page of the Pico's flash (0x10000000 to 0x10200000)"
    )]
    Address {
        /// Which block.
        at: usize,
        /// Where it is to go.
        address: u32,
    },
    /// Blocks are missing, or there are too many.
    #[error(
        "block {at} says that there are {total} blocks, but the file has {blocks}; was it copied to its end?"
    )]
    Total {
        /// Which block.
        at: usize,
        /// How many it says.
        total: u32,
        /// How many there are.
        blocks: usize,
    },
    /// A number twice, or one beyond the last.
    #[error("block {at} has the number {number}, which {}", if *.twice { "another one has too" } else { "is beyond the last" })]
    Number {
        /// Which block.
        at: usize,
        /// Its number.
        number: u32,
        /// Another block has it.
        twice: bool,
    },
    /// A page twice.
    #[error("block {at} is for {address:#010x}, as another one is")]
    Twice {
        /// Which block.
        at: usize,
        /// The page.
        address: u32,
    },
    /// The first page is missing.
    #[error("the image has nothing at 0x10000000, where the board starts")]
    NoBoot,
    /// The boot ROM would not start it.
    #[error(
        "the first 256 bytes have the checksum {found:#010x} where the boot ROM asks for {expected:#010x}: the board would not start"
    )]
    BootChecksum {
        /// Of the first 252 bytes.
        expected: u32,
        /// In the last four.
        found: u32,
    },
    /// The first page would start nothing.
    #[error("the image has no program behind its first page (stack {stack:#010x}, start {start:#010x})")]
    NoProgram {
        /// The first word of the vector table.
        stack: u32,
        /// The second.
        start: u32,
    },
}

fn chip(family: u32) -> String {
    match family {
        0 => "no chip in particular".into(),
        family if RP2350.contains(&family) => "the RP2350 of a Pico 2".into(),
        family => format!("another chip (family {family:#010x})"),
    }
}

/// What is to be in flash: pages of 256 bytes and where they go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    pages: BTreeMap<u32, [u8; PAGE]>,
}

impl Image {
    /// The pages in ascending order, each with its address, a multiple of 256.
    pub fn pages(&self) -> impl ExactSizeIterator<Item = (u32, &[u8; PAGE])> {
        self.pages.iter().map(|(&address, page)| (address, page))
    }

    /// The sectors it touches, in ascending order: addresses, multiples of 4096.
    pub fn sectors(&self) -> BTreeSet<u32> {
        self.pages.keys().map(|page| page & !(SECTOR - 1)).collect()
    }

    /// Its bytes from `address` on, at most `length` of them: those up to the first that is not part of it.
    pub fn read(&self, address: u32, length: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        while bytes.len() < length {
            // Cannot overflow: the last page ends below 0x1020_0000.
            let at = address.wrapping_add(bytes.len() as u32);
            let Some(page) = self.pages.get(&(at & !(PAGE as u32 - 1))) else { break };
            let rest = &page[at as usize % PAGE..];
            bytes.extend_from_slice(&rest[..rest.len().min(length - bytes.len())]);
        }
        bytes
    }

    /// A little-endian word of it.
    pub fn word(&self, address: u32) -> Option<u32> {
        Some(u32::from_le_bytes(self.read(address, 4).try_into().ok()?))
    }

    /// Whether the boot ROM would start it, and find a program: the checksum of the first page, and a vector table behind it.
    pub fn check_boot(&self) -> Result<(), Uf2Error> {
        let first = self.pages.get(&FLASH.start).ok_or(Uf2Error::NoBoot)?;
        let expected = Crc::<u32>::new(&CRC_32_MPEG_2).checksum(&first[..PAGE - 4]);
        let found = word(first, PAGE - 4);
        if expected != found {
            return Err(Uf2Error::BootChecksum { expected, found });
        }
        let (stack, start) = (self.word(VECTORS).unwrap_or(0), self.word(VECTORS + 4).unwrap_or(0));
        // The stack grows downwards from its word; an odd address means Thumb code.
        let sound = stack > MEMORY.start
            && stack <= MEMORY.end
            && stack.is_multiple_of(4)
            && start % 2 == 1
            && self.word(start & !3).is_some();
        if sound { Ok(()) } else { Err(Uf2Error::NoProgram { stack, start }) }
    }
}

/// The file for an image given as pieces of flash. Gaps inside a sector are filled with ff, so that nothing depends
/// on what the ROM does with pages it is not given.
pub fn encode(pieces: &[(u64, &[u8])]) -> Result<Vec<u8>, Uf2Error> {
    let mut pages = BTreeMap::<u32, ([u8; PAGE], [bool; PAGE])>::new();
    for &(address, bytes) in pieces {
        let end = address.saturating_add(bytes.len() as u64);
        if address < FLASH.start.into() || end > FLASH.end.into() {
            return Err(Uf2Error::NotFlash { address, length: bytes.len() });
        }
        for (at, &byte) in (address as u32..).zip(bytes) {
            let page = pages.entry(at & !(PAGE as u32 - 1)).or_insert(([0xff; PAGE], [false; PAGE]));
            let offset = at as usize % PAGE;
            if std::mem::replace(&mut page.1[offset], true) {
                return Err(Uf2Error::Overlap(at));
            }
            page.0[offset] = byte;
        }
    }
    let sectors: BTreeSet<u32> = pages.keys().map(|page| page & !(SECTOR - 1)).collect();
    for sector in sectors {
        for page in (sector..sector + SECTOR).step_by(PAGE) {
            pages.entry(page).or_insert(([0xff; PAGE], [false; PAGE]));
        }
    }
    let total = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * BLOCK);
    for (number, (address, (bytes, _))) in pages.into_iter().enumerate() {
        let words = [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAGE as u32, number as u32, total, RP2040];
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(bytes);
        let checksum = checksum(&file[number * BLOCK..]);
        file.extend(CHECKED.to_le_bytes());
        file.extend(checksum.to_le_bytes());
        file.resize((number + 1) * BLOCK - 4, 0);
        file.extend(MAGIC[2].to_le_bytes());
    }
    Ok(file)
}

/// The image in a file. Refuses anything that is not one whole image for a Pico: every block once, every page once,
/// all of them inside the flash; and damaged ones, if [`encode`] made them.
pub fn decode(file: &[u8]) -> Result<Image, Uf2Error> {
    if file.is_empty() {
        return Err(Uf2Error::Empty);
    }
    if file.len() > LARGEST_FILE {
        return Err(Uf2Error::TooLarge(file.len()));
    }
    // A file that is something else is told so, whatever its length.
    if file.len() >= 8 && [word(file, 0), word(file, 4)] != MAGIC[..2] {
        return Err(Uf2Error::Magic(0));
    }
    if !file.len().is_multiple_of(BLOCK) {
        return Err(Uf2Error::Length(file.len()));
    }
    let blocks = file.len() / BLOCK;
    let mut pages = BTreeMap::new();
    let mut numbers = vec![false; blocks];
    for (at, block) in file.chunks_exact(BLOCK).enumerate() {
        if [word(block, 0), word(block, 4), word(block, 508)] != MAGIC {
            return Err(Uf2Error::Magic(at));
        }
        let [flags, address, size, number, total] = [8, 12, 16, 20, 24].map(|offset| word(block, offset));
        // Without its flag the field means something else.
        let family = if flags & FAMILY_PRESENT == 0 { 0 } else { word(block, 28) };
        if family != RP2040 {
            return Err(Uf2Error::Family { at, family });
        }
        if flags != FAMILY_PRESENT || size != PAGE as u32 {
            return Err(Uf2Error::Kind { at, flags, size });
        }
        if !FLASH.contains(&address) || !address.is_multiple_of(PAGE as u32) {
            return Err(Uf2Error::Address { at, address });
        }
        if total as usize != blocks {
            return Err(Uf2Error::Total { at, total, blocks });
        }
        match numbers.get_mut(number as usize) {
            Some(seen @ false) => *seen = true,
            seen => return Err(Uf2Error::Number { at, number, twice: seen.is_some() }),
        }
        let mut page = [0; PAGE];
        page.copy_from_slice(&block[32..32 + PAGE]);
        if pages.insert(address, page).is_some() {
            return Err(Uf2Error::Twice { at, address });
        }
    }
    // Last, so that what is wrong with a block is said more exactly if it can be.
    let is_sound =
        |block: &[u8]| (word(block, CHECK), word(block, CHECK + 4)) == (CHECKED, checksum(&block[..CHECK]));
    if file.chunks_exact(BLOCK).any(|block| word(block, CHECK) == CHECKED)
        && let Some(at) = file.chunks_exact(BLOCK).position(|block| !is_sound(block))
    {
        return Err(Uf2Error::Checksum(at));
    }
    Ok(Image { pages })
}

fn checksum(bytes: &[u8]) -> u32 {
    Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}

/// The little-endian word at `offset`, which is inside `bytes`.
fn word(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes([bytes[offset], bytes[offset + 1], bytes[offset + 2], bytes[offset + 3]])
}

#[cfg(test)]
mod tests;
