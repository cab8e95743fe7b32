//! Compared with an independent model of the boot ROM, written from the data sheet.
#![allow(clippy::cast_possible_truncation, reason = "test data is small")]

use super::*;
use proptest::prelude::*;

/// A model of the boot ROM that receives a file block by block: changes the flash, and returns whether the board
/// restarts.
fn rom(file: &[u8], flash: &mut [u8]) -> bool {
    let (mut erased, mut seen) = (BTreeSet::new(), BTreeSet::new());
    let mut total = 0;
    for block in file.chunks(512) {
        let field = |i: usize| u32::from_le_bytes(block[4 * i..4 * i + 4].try_into().unwrap());
        if block.len() < 512 || field(0) != 0x0A324655 || field(1) != 0x9E5D5157 || field(127) != 0x0AB16F30 {
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
    encode(Chip::Rp2040, &[(0x1000_0000, &bootable())]).unwrap()
}

#[test]
fn the_first_block_follows_the_format() {
    let file = encode(Chip::Rp2040, &[(0x1000_0000, b"boot")]).unwrap();
    let mut expected = b"UF2\n\x57\x51\x5d\x9e\x00\x20\x00\x00\x00\x00\x00\x10\x00\x01\x00\x00".to_vec();
    expected.extend(b"\x00\x00\x00\x00\x10\x00\x00\x00\x56\xff\x8b\xe4boot\xff");
    assert_eq!(file[..expected.len()], expected);
    assert_eq!(file[508..512], [0x30, 0x6f, 0xb1, 0x0a]);
    // A whole sector.
    assert_eq!(file.len(), 16 * 512);
}

#[test]
fn images_outside_flash_and_overlaps_are_refused() {
    let error = encode(Chip::Rp2040, &[(0x2000_0000, &[0])]).unwrap_err();
    assert_eq!(error, Uf2Error::NotFlash { chip: Chip::Rp2040, address: 0x2000_0000, length: 1 });
    assert!(encode(Chip::Rp2040, &[(0x101f_ffff, &[0])]).is_ok());
    assert!(encode(Chip::Rp2040, &[(0x101f_ffff, &[0, 0])]).is_err());
    assert!(encode(Chip::Rp2040, &[(u64::MAX, &[0])]).is_err());
    let overlap = encode(Chip::Rp2040, &[(0x1000_0000, &[0; 10]), (0x1000_0009, &[0])]).unwrap_err();
    assert_eq!(overlap, Uf2Error::Overlap(0x1000_0009));
}

#[test]
fn an_image_that_the_boot_rom_starts_passes_and_a_damaged_first_page_does_not() {
    decode(&file()).unwrap().check_boot().unwrap();
    for byte in [0, 100, 251, 252, 255] {
        let mut damaged = bootable();
        damaged[byte] ^= 0x10;
        let image = decode(&encode(Chip::Rp2040, &[(0x1000_0000, &damaged)]).unwrap()).unwrap();
        assert!(matches!(image.check_boot(), Err(Uf2Error::BootChecksum { .. })), "byte {byte}");
    }
    let later = decode(&encode(Chip::Rp2040, &[(0x1000_1000, &bootable())]).unwrap()).unwrap();
    assert_eq!(later.check_boot(), Err(Uf2Error::NoBoot));
}

#[test]
fn an_image_without_a_program_is_refused() {
    // No vector table, a stack outside memory, a start address that is not code, a start outside the image.
    for (stack, start) in [
        (0xffff_ffffu32, 0xffff_ffffu32),
        (0x3000_0000, 0x1000_0201),
        (0x2004_2000, 0x1000_0200),
        (0x2004_2000, 0x1010_0001),
    ] {
        let mut image = bootable();
        image[256..260].copy_from_slice(&stack.to_le_bytes());
        image[260..264].copy_from_slice(&start.to_le_bytes());
        let image = decode(&encode(Chip::Rp2040, &[(0x1000_0000, &image)]).unwrap()).unwrap();
        assert_eq!(image.check_boot(), Err(Uf2Error::NoProgram { stack, start }));
    }
}

#[test]
fn a_file_with_any_bit_flipped_is_refused() {
    let file = file();
    for block in [0, 7, 15] {
        // Except for unused zeros.
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
fn files_of_other_tools_without_checksums_are_accepted() {
    let mut file = file();
    file.chunks_exact_mut(BLOCK).for_each(|block| block[32 + PAGE..508].fill(0));
    decode(&file).unwrap().check_boot().unwrap();
}

#[test]
fn every_fault_has_its_error() {
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
    assert_eq!(
        edited(3, 7, 0xE48B_FF59),
        Uf2Error::Family { expected: Some(Chip::Rp2040), at: 3, family: 0xE48B_FF59 }
    );
    assert_eq!(edited(0, 7, 0xE48B_FF5A), Uf2Error::Family { expected: None, at: 0, family: 0xE48B_FF5A });
    assert!(edited(3, 7, 0xE48B_FF59).to_string().contains("Pico 2"));
    assert_eq!(edited(3, 2, 0), Uf2Error::Family { expected: Some(Chip::Rp2040), at: 3, family: 0 });
    assert_eq!(edited(3, 2, 0x2001), Uf2Error::Kind { at: 3, flags: 0x2001, size: 256 });
    assert_eq!(edited(3, 4, 476), Uf2Error::Kind { at: 3, flags: 0x2000, size: 476 });
    for address in [0x1000_0380, 0x1020_0000, 0x0fff_ff00, 0x2000_0000] {
        assert_eq!(edited(3, 3, address), Uf2Error::Address { chip: Chip::Rp2040, at: 3, address });
    }
    assert_eq!(edited(3, 3, 0x1000_0000), Uf2Error::Twice { at: 3, address: 0x1000_0000 });
    assert_eq!(edited(3, 5, 2), Uf2Error::Number { at: 3, number: 2, twice: true });
    assert_eq!(edited(3, 5, 16), Uf2Error::Number { at: 3, number: 16, twice: false });
    assert_eq!(edited(3, 6, 17), Uf2Error::Total { at: 3, total: 17, blocks: 16 });
    assert_eq!(decode(&file[512..]), Err(Uf2Error::Total { at: 0, total: 16, blocks: 15 }));
    let doubled = [&file[..], &file[..]].concat();
    assert_eq!(decode(&doubled), Err(Uf2Error::Total { at: 0, total: 16, blocks: 32 }));
}

/// An image for an RP2350: a vector table of 68 words, the block of the data sheet's minimal image behind it.
fn bootable_2350() -> Vec<u8> {
    let mut image: Vec<u8> = (0..5000u32).map(|i| ((i * i) >> 3) as u8).collect();
    image[..4].copy_from_slice(&0x2008_2000u32.to_le_bytes());
    image[4..8].copy_from_slice(&0x1000_0201u32.to_le_bytes());
    image[272..292].copy_from_slice(b"\xd3\xde\xff\xff\x42\x01\x21\x10\xff\x01\0\0\0\0\0\0\x79\x35\x12\xab");
    image
}

#[test]
fn an_image_for_a_pico_2_is_known_by_its_family_and_starts_by_its_block() {
    let encoded = |image: &[u8]| decode(&encode(Chip::Rp2350, &[(0x1000_0000, image)]).unwrap()).unwrap();
    let image = encoded(&bootable_2350());
    assert_eq!((image.chip(), image.boot_page(), image.check_boot()), (Chip::Rp2350, 0x1000_0100, Ok(())));
    for byte in 272..292 {
        let mut damaged = bootable_2350();
        damaged[byte] ^= 1;
        // The link to the next block is any number.
        let expected = if (284..288).contains(&byte) { Ok(()) } else { Err(Uf2Error::NoBlock) };
        assert_eq!(encoded(&damaged).check_boot(), expected, "byte {byte}");
    }
    let mut late = bootable_2350();
    late.resize(9000, 0);
    late.copy_within(272..292, 4096);
    late[272] = 0;
    assert_eq!(encoded(&late).check_boot(), Err(Uf2Error::NoBlock));
    // An RP2040 would not start it, and its flash is smaller.
    let other = decode(&encode(Chip::Rp2040, &[(0x1000_0000, &bootable_2350())]).unwrap()).unwrap();
    assert!(matches!(other.check_boot(), Err(Uf2Error::BootChecksum { .. })));
    assert!(encode(Chip::Rp2350, &[(0x103f_ffff, &[0])]).is_ok());
    assert!(encode(Chip::Rp2350, &[(0x103f_ffff, &[0, 0])]).is_err());
}

proptest! {
    #[test]
    fn decoding_restores_the_image_and_agrees_with_the_boot_rom(
        start in 0u32..20_000,
        bytes in proptest::collection::vec(any::<u8>(), 1..9000),
        gap in 1u32..9000,
        more in proptest::collection::vec(any::<u8>(), 0..600),
    ) {
        let second = start + bytes.len() as u32 + gap;
        let at = |offset: u32| u64::from(START + offset);
        let file = encode(Chip::Rp2040, &[(at(second), &more), (at(start), &bytes)]).unwrap();
        let mut expected = vec![0xff; 64 * 1024];
        expected[start as usize..][..bytes.len()].copy_from_slice(&bytes);
        expected[second as usize..][..more.len()].copy_from_slice(&more);
        let mut flash = vec![0xff; 64 * 1024];
        for (address, page) in decode(&file).unwrap().pages() {
            flash[(address - START) as usize..][..PAGE].copy_from_slice(page);
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
        let file = encode(Chip::Rp2040, &[(0x1000_0000, &bytes)]).unwrap();
        let shuffled: Vec<u8> = order.iter().flat_map(|&i| file[i * BLOCK..][..BLOCK].to_vec()).collect();
        prop_assert_eq!(decode(&shuffled), decode(&file));
    }

    #[test]
    fn accepted_files_are_written_completely_by_the_boot_rom(
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
                prop_assert_eq!(&flash[(address - START) as usize..][..PAGE], page);
            }
        }
    }

    #[test]
    fn garbage_is_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
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
