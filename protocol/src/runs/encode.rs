//! A plane as a pass stream.

use super::bit_writer::BitWriter;
use super::encode_across::put_across;
use super::rice::{ESCAPE, Mean};
use super::{MAX_STRIDE, PLAIN_BITS, band_bytes, form, stride};
use crate::packbits;
use crate::walk::{EDGE, MOST, Placed, PlacedBand, Tile};
use heapless::Vec;

/// The most bytes one band can take, whatever its content, on the widest page (9880 dots at 1200 dpi): the size of the
/// buffer for [`encode`].
pub const MAX_BAND: usize = 1 + EDGE as usize * (2 + MAX_STRIDE);

/// How many times shorter than packed rows runs have to be.
const WORTH: usize = 2;

/// A buffer is too small, a page wider than 9880 dots, or `bits` shorter than the plane.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct NoRoom;

/// Encodes a plane: 8 dots to a byte, most significant bit left, 1 = ink, rows padded to whole bytes with zeros. `put`
/// receives the stream band by band. `buffer` needs [`MAX_BAND`] bytes.
pub fn encode(
    placed: &Placed,
    bits: &[u8],
    buffer: &mut [u8],
    mut put: impl FnMut(&[u8]),
) -> Result<(), NoRoom> {
    let width = placed.width();
    let stride = stride(width);
    if stride > MAX_STRIDE || buffer.len() < MAX_BAND || bits.len() < stride * usize::from(placed.height()) {
        return Err(NoRoom);
    }
    let mut blank = 0u8;
    let mut table = Table::new();
    let mut across = false;
    for band in placed.bands() {
        let from = usize::from(band.y) * stride;
        let rows = &bits[from..from + usize::from(band.height) * stride];
        if rows.iter().all(|&byte| byte == 0) {
            blank += 1;
            if blank == u8::MAX {
                put(&[form::BLANK, blank]);
                blank = 0;
            }
            continue;
        }
        if blank > 0 {
            put(&[form::BLANK, blank]);
            blank = 0;
        }
        // What was shorter last goes first, so that the other gives up early.
        let packed = rows_length(rows, stride);
        let limit = packed / WORTH + 1;
        let mut code = |across: bool, room: usize| {
            if across {
                put_across(rows, width, &mut buffer[..room])
            } else {
                put_runs(&band, rows, stride, &mut table, &mut buffer[..room])
            }
        };
        let first = code(across, limit - 1);
        let length = match (code(!across, first.unwrap_or(limit) - 1), first) {
            (Some(length), _) => {
                across = !across;
                length
            }
            (None, Some(length)) => code(across, length).ok_or(NoRoom)?,
            (None, None) => put_rows(rows, stride, &mut buffer[..packed]).ok_or(NoRoom)?,
        };
        put(&buffer[..length]);
    }
    if blank > 0 {
        put(&[form::BLANK, blank]);
    }
    debug_assert!(band_bytes(width) < MAX_BAND);
    Ok(())
}

/// The dots of the last tile's shape.
struct Table {
    shape: Option<Tile>,
    dots: [u16; MOST],
}

impl Table {
    fn new() -> Self {
        Table { shape: None, dots: [0; MOST] }
    }

    fn dots_of(&mut self, tile: &Tile) -> &[u16] {
        let shape = Tile { x: 0, y: 0, ..*tile };
        if self.shape != Some(shape) {
            tile.fill(&mut self.dots);
            self.shape = Some(shape);
        }
        &self.dots[..usize::from(tile.area())]
    }
}

/// Puts a tile's rows into words, the first column in the highest bit. Returns false if there is no dot in them. Dots to
/// the right of the tile may be in them too.
fn gather(tile: &Tile, rows: &[u8], stride: usize, words: &mut [u64; EDGE as usize]) -> bool {
    let (byte, shift) = (usize::from(tile.x) / 8, u32::from(tile.x % 8));
    let mut any = 0;
    for (word, row) in words.iter_mut().zip(rows.chunks_exact(stride)) {
        let bytes = &row[byte..row.len().min(byte + 9)];
        let mut wide = [0; 16];
        wide[..bytes.len()].copy_from_slice(bytes);
        *word = (u128::from_be_bytes(wide) << shift >> 64) as u64;
        any |= *word;
    }
    any != 0
}

/// Calls `run` with the length of every run of the band, off first, possibly 0.
fn for_each_run(
    band: &PlacedBand,
    rows: &[u8],
    stride: usize,
    table: &mut Table,
    mut run: impl FnMut(u32) -> Option<()>,
) -> Option<()> {
    let (mut on, mut length) = (0, 0);
    let mut columns = [0; EDGE as usize];
    for tile in band.tiles() {
        if !gather(&tile, rows, stride, &mut columns) {
            if on == 1 {
                run(length)?;
                (on, length) = (0, 0);
            }
            length += u32::from(tile.area());
            continue;
        }
        for &dot in table.dots_of(&tile) {
            let bit = columns[usize::from(dot / EDGE)] >> (EDGE - 1 - dot % EDGE) & 1;
            if bit != on {
                run(length)?;
                (on, length) = (bit, 0);
            }
            length += 1;
        }
    }
    run(length)
}

fn put_runs(
    band: &PlacedBand,
    rows: &[u8],
    stride: usize,
    table: &mut Table,
    out: &mut [u8],
) -> Option<usize> {
    // The band cuts the first and the last run, so they say nothing about the clusters.
    let (mut minimum, mut last, mut count) = (u32::from(u8::MAX), 0, 0u32);
    for_each_run(band, rows, stride, table, |length| {
        if count > 1 {
            minimum = minimum.min(last);
        }
        (last, count) = (length, count + 1);
        // Every run takes a bit at least.
        (count as usize <= 8 * out.len()).then_some(())
    })?;
    let [head, codes @ ..] = out else { return None };
    let [least, codes @ ..] = codes else { return None };
    (*head, *least) = (form::RUNS, u8::try_from(minimum).unwrap_or(u8::MAX));
    let mut bits = BitWriter::new(codes);
    let mut means = [Mean::START; 2];
    let mut index = 0;
    for_each_run(band, rows, stride, table, |length| {
        if index == 0 {
            bits.put(length, PLAIN_BITS)?;
        } else {
            let mean = &mut means[index % 2];
            let (value, k) = (length.saturating_sub(minimum), mean.parameter());
            let quotient = value >> k;
            if quotient < ESCAPE {
                bits.put((1 << (quotient + 1)) - 2, quotient + 1)?;
                bits.put(value & ((1 << k) - 1), k)?;
            } else {
                bits.put((1 << ESCAPE) - 1, ESCAPE)?;
                bits.put(value, PLAIN_BITS)?;
            }
            mean.add(value);
        }
        index += 1;
        Some(())
    })?;
    bits.end().map(|length| 2 + length)
}

/// How a row is written.
enum RowForm {
    Same,
    Packed(usize),
    Plain(usize),
}

/// Calls `row` for each row of a band with how it is written and its bytes. The caller counts equal rows.
fn for_each_row(rows: &[u8], stride: usize, mut row: impl FnMut(RowForm, &[u8]) -> Option<()>) -> Option<()> {
    let mut packed = [0; MAX_STRIDE];
    let mut above: &[u8] = &[];
    for bits in rows.chunks_exact(stride) {
        let trimmed = &bits[..bits.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1)];
        if trimmed == above {
            row(RowForm::Same, &[])?;
        } else if trimmed.is_empty() {
            row(RowForm::Packed(0), &[])?;
        } else {
            match packbits::pack_into(trimmed, &mut packed[..trimmed.len() - 1]) {
                Some(length) => row(RowForm::Packed(length), &packed[..length])?,
                None => row(RowForm::Plain(trimmed.len()), trimmed)?,
            }
        }
        above = trimmed;
    }
    Some(())
}

fn rows_length(rows: &[u8], stride: usize) -> usize {
    let (mut length, mut same) = (1, false);
    for_each_row(rows, stride, |row, _| {
        length += match row {
            RowForm::Same if same => 0,
            RowForm::Same => 2,
            RowForm::Packed(bytes) => varint(2 * bytes + 1).len() + bytes,
            RowForm::Plain(bytes) => varint(2 * bytes).len() + bytes,
        };
        same = matches!(row, RowForm::Same);
        Some(())
    });
    length
}

fn put_rows(rows: &[u8], stride: usize, out: &mut [u8]) -> Option<usize> {
    *out.first_mut()? = form::ROWS;
    let mut at = 1;
    let mut same = 0u8;
    for_each_row(rows, stride, |row, data| {
        let head = match row {
            RowForm::Same => {
                // At most 64 rows, so the count never overflows.
                if same == 0 {
                    *out.get_mut(at)? = 0;
                    at += 2;
                }
                same += 1;
                *out.get_mut(at - 1)? = same;
                return Some(());
            }
            RowForm::Packed(length) => varint(2 * length + 1),
            RowForm::Plain(length) => varint(2 * length),
        };
        same = 0;
        let end = at + head.len() + data.len();
        let place = out.get_mut(at..end)?;
        place[..head.len()].copy_from_slice(&head);
        place[head.len()..].copy_from_slice(data);
        at = end;
        Some(())
    })?;
    Some(at)
}

/// A number below 2^14 in one byte or two.
fn varint(number: usize) -> Vec<u8, 2, u8> {
    #[expect(clippy::cast_possible_truncation, reason = "seven bits each")]
    let (low, high) = ((number & 0x7f) as u8, (number >> 7 & 0x7f) as u8);
    if high == 0 { Vec::from_array([low]) } else { Vec::from_array([low | 0x80, high]) }
}
