//! Firmware images: no file makes the reader fail, what it takes it gives back, and only that.

use arbitrary::{Result, Unstructured};
use uf2::{BLOCK, Image, PAGE, SECTOR, decode, encode};

/// A file as it is; and a script for a file that is nearly right.
pub fn check(bytes: &[u8]) {
    if let Ok(image) = decode(bytes) {
        taken(bytes, &image);
    }
    if let Ok(file) = nearly(&mut Unstructured::new(bytes))
        && let Ok(image) = decode(&file)
    {
        taken(&file, &image);
    }
}

fn taken(file: &[u8], image: &Image) {
    assert_eq!(image.pages().len() * BLOCK, file.len());
    for block in file.chunks(BLOCK) {
        let address = u32::from_le_bytes([block[12], block[13], block[14], block[15]]);
        assert_eq!(image.read(address, PAGE), block[32..32 + PAGE], "the page at {address:#010x}");
    }
    let _ = image.check_boot();
    let pieces: Vec<(u64, &[u8])> = image.pages().map(|(at, page)| (at.into(), &page[..])).collect();
    let again =
        decode(&encode(image.chip(), &pieces).expect("pages of flash, each once")).expect("what was encoded");
    assert!(image.pages().all(|(at, page)| again.read(at, PAGE) == page));
    // Whole sectors, the rest of them blank.
    assert_eq!(again.sectors(), image.sectors());
    assert_eq!(again.pages().len(), image.sectors().len() * (SECTOR as usize / PAGE));
    let blank = |at: u32| image.read(at, 1).is_empty();
    assert!(again.pages().filter(|&(at, _)| blank(at)).all(|(_, page)| *page == [0xff; PAGE]));
}

/// Some blocks in some order, most fields as they should be.
fn nearly(script: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let blocks: u32 = script.int_in_range(1..=6)?;
    let mut file = Vec::new();
    for number in 0..blocks {
        let page = number + u32::from(script.arbitrary::<u8>()?);
        let mut words = [
            0x0A32_4655,
            0x9E5D_5157,
            0x2000,
            0x1000_0000 + page * PAGE as u32,
            PAGE as u32,
            number,
            blocks,
            0xE48B_FF56,
        ];
        if script.ratio(1u8, 16u8)? {
            words[script.choose_index(words.len())?] = script.arbitrary()?;
        }
        let at = file.len();
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        let length = script.int_in_range(0..=PAGE)?.min(script.len());
        file.extend_from_slice(script.bytes(length)?);
        file.resize(at + BLOCK - 4, 0);
        file.extend(0x0AB1_6F30u32.to_le_bytes());
    }
    if script.ratio(1u8, 16u8)? {
        file.truncate(script.int_in_range(0..=file.len())?);
    }
    Ok(file)
}
