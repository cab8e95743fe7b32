//! What has to be known of a linked program: what goes where in flash, and how much memory it takes.
//!
//! Reads 32-bit little-endian ELF as the linker writes it; not a general reader.

use anyhow::{Context, Result, bail};

/// A part of the program.
pub struct Segment<'e> {
    /// Where it is stored: its *physical* address, since initialised variables live in flash until the start.
    pub address: u64,
    /// Its bytes.
    pub bytes: &'e [u8],
    /// Where it is when the program runs.
    pub running: u32,
    /// How large it is then.
    pub size: u32,
}

/// The program's parts.
pub fn segments(elf: &[u8]) -> Result<Vec<Segment<'_>>> {
    if elf.get(..7) != Some(&[0x7f, b'E', b'L', b'F', 1, 1, 1]) {
        bail!("not a 32-bit little-endian ELF file");
    }
    let half = |at: usize| elf.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let word = |at: usize| elf.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let header = || Some((word(28)? as usize, half(42)? as usize, half(44)? as usize));
    let (table, size, count) = header().context("the ELF header is cut short")?;
    let mut found = Vec::new();
    for at in (0..count).map(|i| table + i * size) {
        let field = |i: usize| word(at + 4 * i).context("the program headers are cut short");
        const LOAD: u32 = 1;
        if field(0)? != LOAD {
            continue;
        }
        let (offset, length) = (field(1)? as usize, field(4)? as usize);
        let bytes = elf.get(offset..offset + length).context("a segment lies outside the file")?;
        found.push(Segment { address: field(3)?.into(), bytes, running: field(2)?, size: field(5)? });
    }
    Ok(found)
}
