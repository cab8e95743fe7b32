//! Pages of PWG raster, the format in which print systems pass on pictures of pages.
//!
//! Method: header and rows are read as they come; a row is unpacked into red, green and blue. Grey and black-and-white
//! pages become colours of equal parts.
//! Cost: one row of memory. Limits: sRGB, sGrey and black, 8 bits (black also 1), 300 or 600 dpi, whole sheets.
//! Source: PWG 5102.4.

use std::io::{self, Read};

/// How a stream begins.
pub const SYNC: [u8; 4] = *b"RaS2";
const HEADER: usize = 1796;

/// Why a stream cannot be printed.
#[derive(Debug, thiserror::Error)]
pub enum RasterError {
    /// It cannot be read, or ends too early.
    #[error("the raster stream ends in the middle of a page, or cannot be read")]
    Io(#[from] io::Error),
    /// A header field has a value that is not supported.
    #[error("page {page}: {field} is {found}; expected {expected}")]
    Field {
        /// Page, from 1.
        page: usize,
        /// Field of the header.
        field: &'static str,
        /// Its value.
        found: String,
        /// What is supported.
        expected: &'static str,
    },
    /// A row has more pixels than the page is wide, or a page more rows.
    #[error("page {page}, row {row}: the raster stream has more pixels or rows than its header declares")]
    Damaged {
        /// Page, from 1.
        page: usize,
        /// Row, from 0.
        row: usize,
    },
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Colours {
    Rgb,
    Grey,
    /// 8 bits, more is darker.
    Black,
    /// 1 bit, set is black.
    Bits,
}

/// The parts of a page's header that are used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Page {
    /// Pixels across.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixels per inch in both directions.
    pub dpi: u16,
    /// Number of copies, at least 1.
    pub copies: u32,
    colours: Colours,
    line: usize,
}

/// Reads pages one after the other.
pub struct Reader<R> {
    input: R,
    number: usize,
    page: Option<Page>,
    row: usize,
    /// How often the row in `line` is still to be repeated.
    repeat: usize,
    line: Vec<u8>,
}

impl<R: Read> Reader<R> {
    /// A reader of a stream whose first four bytes have been read and are [`SYNC`].
    pub fn behind_sync(input: R) -> Reader<R> {
        Reader { input, number: 0, page: None, row: 0, repeat: 0, line: Vec::new() }
    }

    /// The next page; `None` at the end. Unread rows of the page before are skipped.
    pub fn next_page(&mut self) -> Result<Option<Page>, RasterError> {
        let mut scratch = Vec::new();
        while self.page.is_some_and(|page| self.row < page.height) {
            self.row(&mut scratch)?;
        }
        let mut header = [0; HEADER];
        if self.input.read(&mut header[..1])? == 0 {
            return Ok(None);
        }
        self.input.read_exact(&mut header[1..])?;
        self.number += 1;
        let page = self.check(&header)?;
        (self.page, self.row, self.repeat) = (Some(page), 0, 0);
        Ok(Some(page))
    }

    fn check(&self, header: &[u8; HEADER]) -> Result<Page, RasterError> {
        let number =
            |at: usize| u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        let wrong =
            |field, found: String, expected| RasterError::Field { page: self.number, field, found, expected };
        let (x, y) = (number(276), number(280));
        let dpi = match (x, y) {
            (300, 300) => 300,
            (600, 600) => 600,
            _ => return Err(wrong("HWResolution", format!("{x} x {y}"), "600 x 600 or 300 x 300")),
        };
        let (width, height) = (number(372), number(376));
        // The longest sheet is 14 inches, and no sheet is wider than long.
        let most = 15 * u32::from(dpi);
        if width == 0 || height == 0 || width > most || height > most {
            return Err(wrong(
                "cupsWidth x cupsHeight",
                format!("{width} x {height}"),
                "the pixel size of a sheet",
            ));
        }
        let (bits, pixel, space, order) = (number(384), number(388), number(400), number(396));
        let colours = match (space, bits, pixel) {
            (19 | 1, 8, 24) => Colours::Rgb,
            (18 | 0, 8, 8) => Colours::Grey,
            (3, 8, 8) => Colours::Black,
            (3, 1, 1) => Colours::Bits,
            _ => {
                return Err(wrong(
                    "cupsColorSpace",
                    format!("{space} with {bits} bits a colour"),
                    "19 (sRGB) or 18 (sGrey) with 8 bits, or 3 (black)",
                ));
            }
        };
        if order != 0 {
            return Err(wrong("cupsColorOrder", order.to_string(), "0 (chunky)"));
        }
        let line = (width * pixel).div_ceil(8);
        if number(392) != line {
            return Err(wrong("cupsBytesPerLine", number(392).to_string(), "the bytes of one row of pixels"));
        }
        let (width, height, line) = (width as usize, height as usize, line as usize);
        Ok(Page { width, height, dpi, copies: number(340).clamp(1, 1000), colours, line })
    }

    /// The next row of the page, three bytes a pixel.
    pub fn row(&mut self, rgb: &mut Vec<u8>) -> Result<(), RasterError> {
        let Some(page) = self.page.filter(|page| self.row < page.height) else {
            return Err(RasterError::Damaged { page: self.number, row: self.row });
        };
        if self.repeat == 0 {
            self.repeat = usize::from(self.byte()?) + 1;
            self.unpack(&page)?;
        }
        self.repeat -= 1;
        self.row += 1;
        rgb.clear();
        match page.colours {
            Colours::Rgb => rgb.extend_from_slice(&self.line),
            Colours::Grey => rgb.extend(self.line.iter().flat_map(|&v| [v; 3])),
            Colours::Black => rgb.extend(self.line.iter().flat_map(|&v| [255 - v; 3])),
            Colours::Bits => rgb.extend((0..page.width).flat_map(|x| {
                let black = self.line[x / 8] << (x % 8) & 0x80 != 0;
                [if black { 0 } else { 255 }; 3]
            })),
        }
        Ok(())
    }

    fn byte(&mut self) -> Result<u8, RasterError> {
        let mut byte = [0];
        self.input.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    /// Unpacks runs of pixels: one pixel repeated, or several pixels as they are; 128 is paper to the end of the row.
    fn unpack(&mut self, page: &Page) -> Result<(), RasterError> {
        let pixel = if page.colours == Colours::Rgb { 3 } else { 1 };
        let paper = if matches!(page.colours, Colours::Black | Colours::Bits) { 0 } else { 255 };
        self.line.clear();
        while self.line.len() < page.line {
            let start = self.line.len();
            let count = self.byte()?;
            let end = match count {
                0..=127 => start + pixel * (usize::from(count) + 1),
                128 => page.line,
                129..=255 => start + pixel * (257 - usize::from(count)),
            };
            if end > page.line {
                return Err(RasterError::Damaged { page: self.number, row: self.row });
            }
            self.line.resize(end, paper);
            match count {
                0..=127 => {
                    let (first, rest) = self.line[start..].split_at_mut(pixel);
                    self.input.read_exact(first)?;
                    rest.chunks_exact_mut(pixel).for_each(|next| next.copy_from_slice(first));
                }
                128 => {}
                129..=255 => self.input.read_exact(&mut self.line[start..])?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A header by the offsets of the specification's table.
    fn header(width: u32, height: u32, space: u32, bits: u32, pixel: u32) -> Vec<u8> {
        let mut bytes = vec![0; HEADER];
        bytes[..9].copy_from_slice(b"PwgRaster");
        let fields = [
            (276, 600),
            (280, 600),
            (372, width),
            (376, height),
            (384, bits),
            (388, pixel),
            (392, width.wrapping_mul(pixel).div_ceil(8)),
            (400, space),
        ];
        for (at, value) in fields {
            bytes[at..at + 4].copy_from_slice(&value.to_be_bytes());
        }
        bytes
    }

    fn rows(stream: &[u8]) -> Result<Vec<Vec<Vec<u8>>>, RasterError> {
        let mut reader = Reader::behind_sync(stream);
        let mut pages = Vec::new();
        while let Some(page) = reader.next_page()? {
            let mut rows = Vec::new();
            for _ in 0..page.height {
                let mut row = Vec::new();
                reader.row(&mut row)?;
                rows.push(row);
            }
            pages.push(rows);
        }
        Ok(pages)
    }

    #[test]
    fn runs_literals_blank_ends_and_repeated_rows_are_what_the_specification_says() {
        let mut stream = header(5, 3, 19, 8, 24);
        // Two rows alike: red three times, then two pixels one by one.
        stream.extend([1, 2, 255, 0, 0, 255, 1, 2, 3, 4, 5, 6]);
        // One pixel, then paper to the end.
        stream.extend([0, 0, 9, 8, 7, 128]);
        // A second page of one bit a pixel.
        stream.extend(header(10, 1, 3, 1, 1));
        stream.extend([0, 255, 0b1010_0000, 0b0100_0000]);
        let pages = rows(&stream).unwrap();
        let coloured = vec![255, 0, 0, 255, 0, 0, 255, 0, 0, 1, 2, 3, 4, 5, 6];
        let mut lone = vec![255; 15];
        lone[..3].copy_from_slice(&[9, 8, 7]);
        assert_eq!(pages[0], [coloured.clone(), coloured, lone]);
        let dark: Vec<usize> = (0..10).filter(|x| pages[1][0][3 * x] == 0).collect();
        assert_eq!(dark, [0, 2, 9]);
    }

    #[test]
    fn what_is_not_taken_is_named_with_page_and_field() {
        let field = |stream: &[u8]| match rows(stream) {
            Err(RasterError::Field { page: 1, field, .. }) => field,
            other => panic!("{other:?}"),
        };
        assert_eq!(field(&header(0, 3, 19, 8, 24)), "cupsWidth x cupsHeight");
        assert_eq!(field(&header(u32::MAX, 3, 19, 8, 24)[..]), "cupsWidth x cupsHeight");
        assert_eq!(field(&header(5, 3, 6, 8, 32)), "cupsColorSpace");
        let mut other = header(5, 3, 19, 8, 24);
        other[279] = 100;
        assert_eq!(field(&other), "HWResolution");
    }

    #[test]
    fn a_row_beyond_the_page_and_a_stream_cut_off_are_damage() {
        let mut stream = header(2, 1, 18, 8, 8);
        stream.extend([0, 2, 77]);
        assert!(matches!(rows(&stream), Err(RasterError::Damaged { page: 1, row: 0 })));
        assert!(matches!(rows(&header(2, 1, 18, 8, 8)), Err(RasterError::Io(_))));
        assert!(matches!(rows(&[0; 30]), Err(RasterError::Io(_))));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_fail_or_loop(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut stream = header(7, 9, 19, 8, 24);
            stream.extend(bytes);
            let _ = rows(&stream);
        }
    }
}
