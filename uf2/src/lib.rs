//! UF2, the file format of boot loaders: writing, reading, and checking an image before anything is erased.
//!
//! A file is a sequence of 512-byte blocks. Each contains 256 bytes of the image, their address and the number of the block,
//! so blocks can arrive in any order. The boot loader restarts the board once it has received all blocks, whatever they
//! contain, so a file must be checked first. [`decode`] accepts exactly one complete image for the flash of a Pico or a Pico 2; [`Image::check_boot`] checks that the boot ROM would start it.
//!
//! The format has no checksum. [`encode`] adds one to each block after its page, in bytes that boot loaders ignore. If any
//! block of a file has a checksum, [`decode`] requires a correct one in every block.
//!
//! Cost: two passes over the file and a copy of its pages. Limits: no other chips, no files for several chips, no RISC-V, no
//! extensions of the format; the linker and the usual tools do not use these for the RP2040 and the RP2350.
//! Source: Microsoft's description of UF2; RP2040 data sheet, 2.8.1.3.1 (checksum) and 2.8.4 (UF2); RP2350 data sheet, 5.5.3
//! (families) and 5.9.5 (the block of a minimal image).
#![forbid(unsafe_code)]
#![warn(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss
)]

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crc::{CRC_32_ISO_HDLC, CRC_32_MPEG_2, Crc};

/// Bytes of the image in one block: a page of the flash.
pub const PAGE: usize = PAGE_BYTES as usize;
const PAGE_BYTES: u32 = 256;
/// Bytes of a block in the file.
pub const BLOCK: usize = 512;
/// Bytes of flash that are erased together.
pub const SECTOR: u32 = 4096;
/// Where the flash begins, as the processor sees it.
pub const START: u32 = 0x1000_0000;
/// The largest possible file: every page of the larger flash once.
pub const LARGEST_FILE: usize = (4 << 20) / PAGE * BLOCK;

/// The chips of the boards the bridge runs on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Chip {
    /// Of a Raspberry Pi Pico.
    Rp2040,
    /// Of a Raspberry Pi Pico 2, running on its Arm processors.
    Rp2350,
}

impl Chip {
    /// Both.
    pub const ALL: [Chip; 2] = [Chip::Rp2040, Chip::Rp2350];

    /// The board's name.
    pub fn board(self) -> &'static str {
        match self {
            Chip::Rp2040 => "Pico",
            Chip::Rp2350 => "Pico 2",
        }
    }

    /// What the bridge's image for it is called, and what a compiler makes it for.
    pub fn image(self) -> (&'static str, &'static str) {
        match self {
            Chip::Rp2040 => ("foilpress-bridge.uf2", "thumbv6m-none-eabi"),
            Chip::Rp2350 => ("foilpress-bridge-pico2.uf2", "thumbv8m.main-none-eabihf"),
        }
    }

    /// The board's flash, as the processor sees it: 2 or 4 MiB.
    pub fn flash(self) -> Range<u32> {
        match self {
            Chip::Rp2040 => START..START + (2 << 20),
            Chip::Rp2350 => START..START + (4 << 20),
        }
    }

    /// The number by which a file names it.
    pub fn family(self) -> u32 {
        match self {
            Chip::Rp2040 => 0xE48B_FF56,
            Chip::Rp2350 => 0xE48B_FF59,
        }
    }

    fn of_family(family: u32) -> Option<Chip> {
        Chip::ALL.into_iter().find(|chip| chip.family() == family)
    }

    fn memory(self) -> Range<u32> {
        match self {
            Chip::Rp2040 => 0x2000_0000..0x2004_2000,
            Chip::Rp2350 => 0x2000_0000..0x2008_2000,
        }
    }
}

impl std::fmt::Display for Chip {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.board())
    }
}

const MAGIC: [u32; 3] = [0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30];
/// Marks the checksum, which follows it and covers everything before the mark.
const CHECKED: u32 = 0x4352_4331;
/// Offset of the mark in a block.
const CHECK: usize = 32 + PAGE;
const FAMILY_PRESENT: u32 = 0x2000;
/// The RP2350's other families: any chip, data, Arm without security, RISC-V.
const RP2350: Range<u32> = 0xE48B_FF57..0xE48B_FF5C;
/// The block of an RP2350's image: its first and last word, and bytes in which the boot ROM looks for it.
const BLOCK_MARKS: (u32, u32) = (0xffff_ded3, 0xab12_3579);
const BLOCK_WITHIN: u32 = 4096;
/// Its only item, an image for the Arm processors of an RP2350 in their secure state, and the mark that no other follows.
const IMAGE_TYPE: [u32; 2] = [0x1021_0142, 0x0000_01ff];

/// What is wrong with an image or a file. Blocks are counted from 0 in the order of the file.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Uf2Error {
    /// Bytes outside the flash.
    #[error(
        "the image has {length} bytes at {address:#010x}, at least partly outside the {chip}'s flash (0x10000000 to {:#010x})", .chip.flash().end
    )]
    NotFlash {
        /// Whose flash.
        chip: Chip,
        /// Address of the first.
        address: u64,
        /// Number of bytes.
        length: usize,
    },
    /// Two parts of the image share a byte.
    #[error("two parts of the image overlap at {0:#010x}")]
    Overlap(u32),
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// More than fits in the flash.
    #[error("the file has {0} bytes; the largest file for a Pico 2 has {LARGEST_FILE}")]
    TooLarge(usize),
    /// The file is truncated, or not made of blocks.
    #[error("the file has {0} bytes, which is not a multiple of 512; was it copied completely?")]
    Length(usize),
    /// Not a block.
    #[error("block {0} is not a UF2 block: this is not a UF2 file, or it is damaged")]
    Magic(usize),
    /// The block is for another chip.
    #[error("block {at} is for {}, not for {}", chip(*.family), expected_words(*.expected))]
    Family {
        /// The chip of the blocks before it, if there are any.
        expected: Option<Chip>,
        /// The block.
        at: usize,
        /// Its family, 0 if it gives none.
        family: u32,
    },
    /// The block has changed since the file was written.
    #[error("block {0} is damaged: its checksum does not match; download or build the file again")]
    Checksum(usize),
    /// The boot ROM would not write the block.
    #[error(
        "block {at} has flags {flags:#x} and {size} bytes, which a Pico does not accept; expected 0x2000 and 256"
    )]
    Kind {
        /// The block.
        at: usize,
        /// Its flags.
        flags: u32,
        /// Bytes of the image in the block.
        size: u32,
    },
    /// The address is not a page of the flash.
    #[error(
        "block {at} has the address {address:#010x}, which is not a page of the {chip}'s flash (0x10000000 to {:#010x})", .chip.flash().end
    )]
    Address {
        /// Whose flash.
        chip: Chip,
        /// The block.
        at: usize,
        /// Its address.
        address: u32,
    },
    /// Blocks are missing, or there are too many.
    #[error(
        "block {at} gives a total of {total} blocks, but the file has {blocks}; was it copied completely?"
    )]
    Total {
        /// The block.
        at: usize,
        /// The total it gives.
        total: u32,
        /// The blocks in the file.
        blocks: usize,
    },
    /// The number of a block occurs twice, or exceeds the last.
    #[error("block {at} has the number {number}, which {}", if *.twice { "another block has too" } else { "exceeds the last number" })]
    Number {
        /// The block.
        at: usize,
        /// Its number.
        number: u32,
        /// Whether another block has it.
        twice: bool,
    },
    /// Two blocks are for the same page.
    #[error("block {at} has the address {address:#010x}, which another block has too")]
    Twice {
        /// The block.
        at: usize,
        /// The address.
        address: u32,
    },
    /// The first page is missing.
    #[error("the image has no data at 0x10000000, where the board starts")]
    NoBoot,
    /// The boot ROM would not start it.
    #[error(
        "the first 256 bytes have the checksum {found:#010x}, but the boot ROM expects {expected:#010x}: the board would not start"
    )]
    BootChecksum {
        /// The checksum of the first 252 bytes.
        expected: u32,
        /// The checksum in the last four bytes.
        found: u32,
    },
    /// The boot ROM would not find it.
    #[error(
        "the first 4096 bytes have no block that tells the boot ROM what the image is: the board would not start"
    )]
    NoBlock,
    /// There is no program where the boot ROM looks for it.
    #[error("the image has no program where the board starts it (stack {stack:#010x}, start {start:#010x})")]
    NoProgram {
        /// The first word of the vector table.
        stack: u32,
        /// The second.
        start: u32,
    },
}

fn chip(family: u32) -> String {
    match family {
        0 => "an unspecified chip".into(),
        0xE48B_FF56 => "the RP2040 of a Pico".into(),
        0xE48B_FF59 => "the RP2350 of a Pico 2".into(),
        family if RP2350.contains(&family) => {
            format!("an RP2350 used in another way (family {family:#010x})")
        }
        family => format!("another chip (family {family:#010x})"),
    }
}

fn expected_words(chip: Option<Chip>) -> String {
    match chip {
        None => "the RP2040 of a Pico or the Arm processors of a Pico 2".into(),
        Some(chip) => format!("{}, as those before it", self::chip(chip.family())),
    }
}

/// The contents of the flash: pages of 256 bytes and their addresses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    chip: Chip,
    pages: BTreeMap<u32, [u8; PAGE]>,
}

impl Image {
    /// The chip it is for.
    pub fn chip(&self) -> Chip {
        self.chip
    }

    /// The pages in ascending order, each with its address (a multiple of 256).
    pub fn pages(&self) -> impl ExactSizeIterator<Item = (u32, &[u8; PAGE])> {
        self.pages.iter().map(|(&address, page)| (address, page))
    }

    /// The addresses of its sectors (multiples of 4096), in ascending order.
    pub fn sectors(&self) -> BTreeSet<u32> {
        self.pages.keys().map(|page| page & !(SECTOR - 1)).collect()
    }

    /// Its bytes from `address` on: at most `length`, and only up to the first address outside the image.
    pub fn read(&self, address: u32, length: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut at = address;
        while bytes.len() < length {
            let start = page_of(at);
            let Some(page) = self.pages.get(&start) else { break };
            let rest = &page[(at - start) as usize..];
            bytes.extend_from_slice(&rest[..rest.len().min(length - bytes.len())]);
            // Cannot overflow: the last page ends at 0x1040_0000.
            at = start + PAGE_BYTES;
        }
        bytes
    }

    /// The little-endian word at `address`, if the image contains it.
    pub fn word(&self, address: u32) -> Option<u32> {
        Some(u32::from_le_bytes(self.read(address, 4).try_into().ok()?))
    }

    /// The page without which the boot ROM starts nothing: of an RP2040 the first, which has a checksum, of an RP2350 the one
    /// where its block begins.
    pub fn boot_page(&self) -> u32 {
        match self.chip {
            Chip::Rp2040 => START,
            Chip::Rp2350 => self.block().map_or(START, page_of),
        }
    }

    /// The address of an RP2350's block.
    fn block(&self) -> Option<u32> {
        (START..START + BLOCK_WITHIN).step_by(4).find(|&at| {
            self.word(at) == Some(BLOCK_MARKS.0)
                && [self.word(at + 4), self.word(at + 8)] == IMAGE_TYPE.map(Some)
                && self.word(at + 16) == Some(BLOCK_MARKS.1)
        })
    }

    /// Checks that the boot ROM would start it and find a program: of an RP2040 the checksum of the first page, of an RP2350 its
    /// block; and a vector table, which an RP2040 has behind its first page.
    pub fn check_boot(&self) -> Result<(), Uf2Error> {
        let first = self.pages.get(&START).ok_or(Uf2Error::NoBoot)?;
        let vectors = match self.chip {
            Chip::Rp2040 => {
                let expected = Crc::<u32>::new(&CRC_32_MPEG_2).checksum(&first[..PAGE - 4]);
                let found = word(first, PAGE - 4);
                if expected != found {
                    return Err(Uf2Error::BootChecksum { expected, found });
                }
                START + PAGE_BYTES
            }
            Chip::Rp2350 => {
                self.block().ok_or(Uf2Error::NoBlock)?;
                START
            }
        };
        let (stack, start) = (self.word(vectors).unwrap_or(0), self.word(vectors + 4).unwrap_or(0));
        let memory = self.chip.memory();
        // The stack grows downward from this address; an odd start address means Thumb code.
        let sound = stack > memory.start
            && stack <= memory.end
            && stack.is_multiple_of(4)
            && start % 2 == 1
            && self.word(start & !3).is_some();
        if sound { Ok(()) } else { Err(Uf2Error::NoProgram { stack, start }) }
    }
}

/// Writes a file from pieces of flash, each with its address. Gaps inside a sector are filled with ff, so that nothing
/// depends on what the ROM does with missing pages.
pub fn encode(chip: Chip, pieces: &[(u64, &[u8])]) -> Result<Vec<u8>, Uf2Error> {
    let flash = chip.flash();
    let mut pages = BTreeMap::<u32, ([u8; PAGE], [bool; PAGE])>::new();
    for &(address, bytes) in pieces {
        let end = address.saturating_add(bytes.len() as u64);
        let inside = |start: &u32| *start >= flash.start && end <= flash.end.into();
        let Some(start) = u32::try_from(address).ok().filter(inside) else {
            return Err(Uf2Error::NotFlash { chip, address, length: bytes.len() });
        };
        for (at, &byte) in (start..).zip(bytes) {
            let page = pages.entry(page_of(at)).or_insert(([0xff; PAGE], [false; PAGE]));
            let offset = (at - page_of(at)) as usize;
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
    // At most 16384 pages.
    let total = u32::try_from(pages.len()).unwrap_or(u32::MAX);
    let mut file = Vec::with_capacity(pages.len() * BLOCK);
    for (number, (address, (bytes, _))) in (0..).zip(pages) {
        let block = file.len();
        let words = [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAGE_BYTES, number, total, chip.family()];
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(bytes);
        let checksum = checksum(&file[block..]);
        file.extend(CHECKED.to_le_bytes());
        file.extend(checksum.to_le_bytes());
        file.resize(block + BLOCK - 4, 0);
        file.extend(MAGIC[2].to_le_bytes());
    }
    Ok(file)
}

/// Reads the image in a file. Fails unless it is one complete image for a Pico or a Pico 2: every block once, every page once, all of
/// them inside the flash. Detects damage if [`encode`] wrote the file.
pub fn decode(file: &[u8]) -> Result<Image, Uf2Error> {
    if file.is_empty() {
        return Err(Uf2Error::Empty);
    }
    if file.len() > LARGEST_FILE {
        return Err(Uf2Error::TooLarge(file.len()));
    }
    // Another format is recognised as such, whatever the length.
    if file.len() >= 8 && [word(file, 0), word(file, 4)] != MAGIC[..2] {
        return Err(Uf2Error::Magic(0));
    }
    if !file.len().is_multiple_of(BLOCK) {
        return Err(Uf2Error::Length(file.len()));
    }
    let blocks = file.len() / BLOCK;
    let mut chip = None;
    let mut pages = BTreeMap::new();
    let mut numbers = vec![false; blocks];
    for (at, block) in file.chunks_exact(BLOCK).enumerate() {
        if [word(block, 0), word(block, 4), word(block, 508)] != MAGIC {
            return Err(Uf2Error::Magic(at));
        }
        let [flags, address, size, number, total] = [8, 12, 16, 20, 24].map(|offset| word(block, offset));
        // Without this flag the field has another meaning.
        let family = if flags & FAMILY_PRESENT == 0 { 0 } else { word(block, 28) };
        let one = Chip::of_family(family).filter(|&one| chip.is_none_or(|chip| chip == one));
        let Some(one) = one else { return Err(Uf2Error::Family { expected: chip, at, family }) };
        chip = Some(one);
        if flags != FAMILY_PRESENT || size != PAGE_BYTES {
            return Err(Uf2Error::Kind { at, flags, size });
        }
        if !one.flash().contains(&address) || !address.is_multiple_of(PAGE_BYTES) {
            return Err(Uf2Error::Address { chip: one, at, address });
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
    // Last, because the checks above give more specific errors.
    let is_sound =
        |block: &[u8]| (word(block, CHECK), word(block, CHECK + 4)) == (CHECKED, checksum(&block[..CHECK]));
    if file.chunks_exact(BLOCK).any(|block| word(block, CHECK) == CHECKED)
        && let Some(at) = file.chunks_exact(BLOCK).position(|block| !is_sound(block))
    {
        return Err(Uf2Error::Checksum(at));
    }
    chip.map(|chip| Image { chip, pages }).ok_or(Uf2Error::Empty)
}

/// The address of the page that contains an address.
fn page_of(address: u32) -> u32 {
    address & !(PAGE_BYTES - 1)
}

fn checksum(bytes: &[u8]) -> u32 {
    Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}

/// The little-endian word at `offset`, which must be inside `bytes`.
fn word(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes([bytes[offset], bytes[offset + 1], bytes[offset + 2], bytes[offset + 3]])
}

#[cfg(test)]
mod tests;
