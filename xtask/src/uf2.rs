//! UF2, the format in which the board's boot loader takes an image from a drive.
//!
//! A file is a row of 512-byte blocks, each with its own address, so that a drive may write them in any order. The
//! boot loader restarts the board when it has seen all of them. Source: Microsoft's description of UF2, the RP2040
//! data sheet, section 2.8.4.

/// Bytes of the image in one block; what the boot ROM asks for.
pub const PAYLOAD: usize = 256;
const BLOCK: usize = 512;
const MAGIC: [u32; 3] = [0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30];
const FAMILY_PRESENT: u32 = 0x2000;
/// RP2040.
pub const FAMILY: u32 = 0xE48B_FF56;

/// Flash as the processor sees it.
const FLASH: std::ops::Range<u64> = 0x1000_0000..0x1100_0000;
/// The boot ROM erases whole sectors.
const SECTOR: u32 = 4096;

/// What is wrong with an image or a file.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Uf2Error {
    #[error(
        "the image has {length} bytes at {address:#010x}, which is not all flash (0x10000000 to 0x11000000)"
    )]
    NotFlash { address: u64, length: usize },
    #[error("two parts of the image overlap at {0:#010x}")]
    Overlap(u32),
    #[error("the file has {0} bytes, which is no whole number of 512-byte blocks")]
    Length(usize),
    #[error("block {0} is not UF2 for RP2040 flash with 256 bytes a block")]
    Block(usize),
    #[error("block {at} says it is block {number} of {total}, in a file of {blocks}")]
    Order { at: usize, number: u32, total: u32, blocks: usize },
}

/// The file for an image given as pieces of flash. Gaps inside a sector are filled with ff, so that nothing depends
/// on what the ROM does with pages it is not given.
pub fn encode(pieces: &[(u64, &[u8])]) -> Result<Vec<u8>, Uf2Error> {
    let mut pages = std::collections::BTreeMap::<u32, ([u8; PAYLOAD], [bool; PAYLOAD])>::new();
    for &(address, bytes) in pieces {
        let end = address.saturating_add(bytes.len() as u64);
        if !FLASH.contains(&address) || end > FLASH.end {
            return Err(Uf2Error::NotFlash { address, length: bytes.len() });
        }
        for (at, &byte) in (address as u32..).zip(bytes) {
            let page = pages.entry(at & !(PAYLOAD as u32 - 1)).or_insert(([0xff; PAYLOAD], [false; PAYLOAD]));
            let offset = at as usize % PAYLOAD;
            if std::mem::replace(&mut page.1[offset], true) {
                return Err(Uf2Error::Overlap(at));
            }
            page.0[offset] = byte;
        }
    }
    let sectors: std::collections::BTreeSet<u32> = pages.keys().map(|page| page & !(SECTOR - 1)).collect();
    for sector in sectors {
        for page in (sector..sector + SECTOR).step_by(PAYLOAD) {
            pages.entry(page).or_insert(([0xff; PAYLOAD], [false; PAYLOAD]));
        }
    }
    let total = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * BLOCK);
    for (number, (address, (bytes, _))) in pages.into_iter().enumerate() {
        let words =
            [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAYLOAD as u32, number as u32, total, FAMILY];
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(bytes);
        file.resize(file.len() + BLOCK - 4 - 32 - PAYLOAD, 0);
        file.extend(MAGIC[2].to_le_bytes());
    }
    Ok(file)
}

/// The pages in a file, with their addresses. Refuses anything that is not one whole image for this board.
pub fn decode(file: &[u8]) -> Result<Vec<(u32, &[u8])>, Uf2Error> {
    if file.is_empty() || !file.len().is_multiple_of(BLOCK) {
        return Err(Uf2Error::Length(file.len()));
    }
    let blocks = file.len() / BLOCK;
    let mut pages = Vec::with_capacity(blocks);
    for (at, block) in file.chunks_exact(BLOCK).enumerate() {
        let word = |offset: usize| {
            u32::from_le_bytes([block[offset], block[offset + 1], block[offset + 2], block[offset + 3]])
        };
        let whole = [word(0), word(4), word(508)] == MAGIC
            && word(8) == FAMILY_PRESENT
            && word(16) == PAYLOAD as u32
            && word(28) == FAMILY
            && FLASH.contains(&word(12).into())
            && word(12).is_multiple_of(PAYLOAD as u32);
        if !whole {
            return Err(Uf2Error::Block(at));
        }
        if (word(20), word(24)) != (at as u32, blocks as u32) {
            return Err(Uf2Error::Order { at, number: word(20), total: word(24), blocks });
        }
        pages.push((word(12), &block[32..32 + PAYLOAD]));
    }
    Ok(pages)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn what_was_encoded_is_decoded_and_the_rest_of_the_sector_is_blank() {
        let long: Vec<u8> = (0..9000u32).map(|i| ((i * 7) >> 3) as u8).collect();
        let file = encode(&[(0x1000_0100, &long), (0x1000_0000, &[1, 2, 3])]).unwrap();
        let mut flash = vec![0u8; 3 * 4096];
        for (address, page) in decode(&file).unwrap() {
            let at = address as usize - 0x1000_0000;
            flash[at..at + PAYLOAD].copy_from_slice(page);
        }
        let mut expected = vec![0xff; 3 * 4096];
        expected[..3].copy_from_slice(&[1, 2, 3]);
        expected[256..9256].copy_from_slice(&long);
        assert_eq!(flash, expected);
    }

    #[test]
    fn images_outside_flash_and_overlaps_are_refused() {
        let error = encode(&[(0x2000_0000, &[0])]).unwrap_err();
        assert_eq!(error, Uf2Error::NotFlash { address: 0x2000_0000, length: 1 });
        assert!(encode(&[(0x10ff_ffff, &[0, 0])]).is_err());
        let overlap = encode(&[(0x1000_0000, &[0; 10]), (0x1000_0009, &[0])]).unwrap_err();
        assert_eq!(overlap, Uf2Error::Overlap(0x1000_0009));
    }

    #[test]
    fn a_file_with_any_header_bit_flipped_is_refused() {
        let file = encode(&[(0x1000_0000, &[7; 300])]).unwrap();
        for byte in (0..32).chain(508..512) {
            for bit in 0..8 {
                let mut broken = file.clone();
                broken[byte] ^= 1 << bit;
                // An address may still be a good one; the flash would then hold another image.
                let moved = (12..16).contains(&byte) && decode(&broken).is_ok();
                assert!(moved || decode(&broken).is_err(), "byte {byte} bit {bit}");
            }
        }
        assert_eq!(
            decode(&file[..file.len() - 512]).unwrap_err(),
            Uf2Error::Order { at: 0, number: 0, total: 16, blocks: 15 }
        );
        assert_eq!(decode(&file[1..]).unwrap_err(), Uf2Error::Length(file.len() - 1));
        assert_eq!(decode(&[]).unwrap_err(), Uf2Error::Length(0));
    }
}
