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
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What the boot ROM makes of a file that arrives block by block: a second reading of the data sheet. The flash
    /// afterwards, and whether the board restarts.
    fn rom(file: &[u8], flash: &mut [u8]) -> bool {
        let (mut erased, mut seen) = (BTreeSet::new(), BTreeSet::new());
        let mut total = 0;
        for block in file.chunks(512) {
            let field = |i: usize| u32::from_le_bytes(block[4 * i..4 * i + 4].try_into().unwrap());
            if block.len() < 512
                || field(0) != 0x0A324655
                || field(1) != 0x9E5D5157
                || field(127) != 0x0AB16F30
            {
                continue;
            }
            if field(2) & 0x2001 != 0x2000 || field(7) != 0xe48bff56 || field(4) != 256 {
                continue;
            }
            let at = field(3).wrapping_sub(0x1000_0000) as usize;
            if at + 256 > flash.len() || !at.is_multiple_of(256) {
                continue;
            }
            if erased.insert(at / 4096) {
                flash[at / 4096 * 4096..][..4096].fill(0xff);
            }
            flash[at..at + 256].copy_from_slice(&block[32..288]);
            seen.insert(field(5));
            total = field(6);
        }
        seen.len() as u32 == total
    }

    /// An image that boots: a first page with its checksum, computed bit by bit, and a vector table.
    fn bootable() -> Vec<u8> {
        let mut image: Vec<u8> = (0..1000u32).map(|i| ((i * i) >> 3) as u8).collect();
        let mut crc = 0xffff_ffffu32;
        for &byte in &image[..252] {
            crc ^= u32::from(byte) << 24;
            for _ in 0..8 {
                crc = if crc >> 31 == 1 { crc << 1 ^ 0x04c1_1db7 } else { crc << 1 };
            }
        }
        image[252..256].copy_from_slice(&crc.to_le_bytes());
        image[256..260].copy_from_slice(&0x2004_2000u32.to_le_bytes());
        image[260..264].copy_from_slice(&0x1000_0201u32.to_le_bytes());
        image
    }

    fn file() -> Vec<u8> {
        encode(&[(0x1000_0000, &bootable())]).unwrap()
    }

    #[test]
    fn the_first_block_is_what_the_format_says() {
        let file = encode(&[(0x1000_0000, b"boot")]).unwrap();
        let mut expected = b"UF2\n\x57\x51\x5d\x9e\x00\x20\x00\x00\x00\x00\x00\x10\x00\x01\x00\x00".to_vec();
        expected.extend(b"\x00\x00\x00\x00\x10\x00\x00\x00\x56\xff\x8b\xe4boot\xff");
        assert_eq!(file[..expected.len()], expected);
        assert_eq!(file[508..512], [0x30, 0x6f, 0xb1, 0x0a]);
        // A whole sector.
        assert_eq!(file.len(), 16 * 512);
    }

    #[test]
    fn images_outside_flash_and_overlaps_are_refused() {
        let error = encode(&[(0x2000_0000, &[0])]).unwrap_err();
        assert_eq!(error, Uf2Error::NotFlash { address: 0x2000_0000, length: 1 });
        assert!(encode(&[(0x101f_ffff, &[0])]).is_ok());
        assert!(encode(&[(0x101f_ffff, &[0, 0])]).is_err());
        assert!(encode(&[(u64::MAX, &[0])]).is_err());
        let overlap = encode(&[(0x1000_0000, &[0; 10]), (0x1000_0009, &[0])]).unwrap_err();
        assert_eq!(overlap, Uf2Error::Overlap(0x1000_0009));
    }

    #[test]
    fn an_image_that_the_boot_rom_starts_passes_and_a_damaged_first_page_does_not() {
        decode(&file()).unwrap().check_boot().unwrap();
        for byte in [0, 100, 251, 252, 255] {
            let mut damaged = bootable();
            damaged[byte] ^= 0x10;
            let image = decode(&encode(&[(0x1000_0000, &damaged)]).unwrap()).unwrap();
            assert!(matches!(image.check_boot(), Err(Uf2Error::BootChecksum { .. })), "byte {byte}");
        }
        let later = decode(&encode(&[(0x1000_1000, &bootable())]).unwrap()).unwrap();
        assert_eq!(later.check_boot(), Err(Uf2Error::NoBoot));
    }

    #[test]
    fn an_image_without_a_program_is_refused() {
        // No vector table at all, a stack outside memory, a start that is no code, a start outside the image.
        for (stack, start) in [
            (0xffff_ffffu32, 0xffff_ffffu32),
            (0x3000_0000, 0x1000_0201),
            (0x2004_2000, 0x1000_0200),
            (0x2004_2000, 0x1010_0001),
        ] {
            let mut image = bootable();
            image[256..260].copy_from_slice(&stack.to_le_bytes());
            image[260..264].copy_from_slice(&start.to_le_bytes());
            let image = decode(&encode(&[(0x1000_0000, &image)]).unwrap()).unwrap();
            assert_eq!(image.check_boot(), Err(Uf2Error::NoProgram { stack, start }));
        }
    }

    #[test]
    fn a_file_with_any_bit_flipped_is_refused() {
        let file = file();
        for block in [0, 7, 15] {
            // But for the zeros that mean nothing.
            for byte in (0..CHECK + 8).chain(508..512) {
                for bit in 0..8 {
                    let mut broken = file.clone();
                    broken[block * BLOCK + byte] ^= 1 << bit;
                    assert!(decode(&broken).is_err(), "block {block} byte {byte} bit {bit}");
                }
            }
        }
        let mut broken = file.clone();
        broken[7 * BLOCK + 32] ^= 1;
        assert_eq!(decode(&broken), Err(Uf2Error::Checksum(7)));
    }

    #[test]
    fn files_of_other_tools_have_no_checksums_and_are_taken() {
        let mut file = file();
        file.chunks_exact_mut(BLOCK).for_each(|block| block[32 + PAGE..508].fill(0));
        decode(&file).unwrap().check_boot().unwrap();
    }

    #[test]
    fn every_fault_is_told_by_name() {
        let file = file();
        let edited = |at: usize, field: usize, value: u32| {
            let mut file = file.clone();
            file[at * BLOCK + 4 * field..][..4].copy_from_slice(&value.to_le_bytes());
            decode(&file).unwrap_err()
        };
        assert_eq!(decode(&[]), Err(Uf2Error::Empty));
        assert_eq!(decode(b"UF2"), Err(Uf2Error::Length(3)));
        assert_eq!(decode(&file[..file.len() - 1]), Err(Uf2Error::Length(file.len() - 1)));
        assert_eq!(decode(b"\x7fELF\x01\x01\x01 and so on"), Err(Uf2Error::Magic(0)));
        assert_eq!(decode(&vec![0; LARGEST_FILE + 512]), Err(Uf2Error::TooLarge(LARGEST_FILE + 512)));
        assert_eq!(edited(3, 1, 0), Uf2Error::Magic(3));
        assert_eq!(edited(3, 7, 0xE48B_FF59), Uf2Error::Family { at: 3, family: 0xE48B_FF59 });
        assert!(edited(3, 7, 0xE48B_FF59).to_string().contains("Pico 2"));
        assert_eq!(edited(3, 2, 0), Uf2Error::Family { at: 3, family: 0 });
        assert_eq!(edited(3, 2, 0x2001), Uf2Error::Kind { at: 3, flags: 0x2001, size: 256 });
        assert_eq!(edited(3, 4, 476), Uf2Error::Kind { at: 3, flags: 0x2000, size: 476 });
        for address in [0x1000_0380, 0x1020_0000, 0x0fff_ff00, 0x2000_0000] {
            assert_eq!(edited(3, 3, address), Uf2Error::Address { at: 3, address });
        }
        assert_eq!(edited(3, 3, 0x1000_0000), Uf2Error::Twice { at: 3, address: 0x1000_0000 });
        assert_eq!(edited(3, 5, 2), Uf2Error::Number { at: 3, number: 2, twice: true });
        assert_eq!(edited(3, 5, 16), Uf2Error::Number { at: 3, number: 16, twice: false });
        assert_eq!(edited(3, 6, 17), Uf2Error::Total { at: 3, total: 17, blocks: 16 });
        assert_eq!(decode(&file[512..]), Err(Uf2Error::Total { at: 0, total: 16, blocks: 15 }));
        let doubled = [&file[..], &file[..]].concat();
        assert_eq!(decode(&doubled), Err(Uf2Error::Total { at: 0, total: 16, blocks: 32 }));
    }

    proptest! {
        #[test]
        fn what_was_encoded_is_decoded_and_what_the_boot_rom_would_write(
            start in 0u32..20_000,
            bytes in proptest::collection::vec(any::<u8>(), 1..9000),
            gap in 1u32..9000,
            more in proptest::collection::vec(any::<u8>(), 0..600),
        ) {
            let second = start + bytes.len() as u32 + gap;
            let at = |offset: u32| u64::from(FLASH.start + offset);
            let file = encode(&[(at(second), &more), (at(start), &bytes)]).unwrap();
            let mut expected = vec![0xff; 64 * 1024];
            expected[start as usize..][..bytes.len()].copy_from_slice(&bytes);
            expected[second as usize..][..more.len()].copy_from_slice(&more);
            let mut flash = vec![0xff; 64 * 1024];
            for (address, page) in decode(&file).unwrap().pages() {
                flash[(address - FLASH.start) as usize..][..PAGE].copy_from_slice(page);
            }
            prop_assert!(flash == expected);
            let mut written = vec![0xff; 64 * 1024];
            prop_assert!(rom(&file, &mut written));
            prop_assert!(written == expected);
        }

        #[test]
        fn the_order_of_the_blocks_does_not_matter(
            order in Just((0..48).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            let bytes: Vec<u8> = (0..3 * 4096u32).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8).collect();
            let file = encode(&[(0x1000_0000, &bytes)]).unwrap();
            let shuffled: Vec<u8> = order.iter().flat_map(|&i| file[i * BLOCK..][..BLOCK].to_vec()).collect();
            prop_assert_eq!(decode(&shuffled), decode(&file));
        }

        #[test]
        fn what_is_accepted_is_what_the_boot_rom_would_write_whole(
            edits in proptest::collection::vec((0usize..16 * 512, any::<u8>()), 0..4),
        ) {
            let mut file = file();
            for (at, value) in edits {
                file[at] = value;
            }
            if let Ok(image) = decode(&file) {
                // Larger than any address three bytes of the header can make of a page in the first sector.
                let mut flash = vec![0xff; 0x20_0000];
                prop_assert!(rom(&file, &mut flash));
                for (address, page) in image.pages() {
                    prop_assert_eq!(&flash[(address - FLASH.start) as usize..][..PAGE], page);
                }
            }
        }

        #[test]
        fn garbage_is_refused_and_never_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
            prop_assert!(decode(&bytes).is_err());
        }

        #[test]
        fn reading_stops_where_the_image_does(address in any::<u32>(), length in 0usize..10_000) {
            let image = decode(&file()).unwrap();
            let inside = (0x1000_0000..0x1000_1000u32).contains(&address);
            let expected = if inside { length.min((0x1000_1000 - address) as usize) } else { 0 };
            prop_assert_eq!(image.read(address, length).len(), expected);
        }
    }
}
