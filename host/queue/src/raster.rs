//! Pages of PWG raster and Apple raster, the formats in which print systems and phones pass on pictures of pages.
//!
//! Method: header and rows are read as they come; a row is unpacked into red, green and blue. Grey and black-and-white
//! pages become colours of equal parts, and cyan, magenta, yellow and black those that PDF says ink leaves: (1 - c)(1 - k). The two
//! formats pack rows alike and differ in their headers.
//! Cost: one row of memory. Limits: sRGB, sGrey, CMYK and black, 8 bits (sRGB also 16, black also 1), the [`RESOLUTIONS`], whole sheets.
//! Source: PWG 5102.4; ISO 32000-1, 10.3.5; for Apple raster, which has no public text, the readers of CUPS and of `print_raster`.

use std::io::{self, Read};

/// How a stream of PWG raster begins.
pub const SYNC: [u8; 4] = *b"RaS2";
/// How a stream of Apple raster begins; a zero and the number of pages follow.
pub const APPLE: [u8; 8] = *b"UNIRAST\0";
/// Pixels per inch that pages are read at.
pub const RESOLUTIONS: [u16; 6] = [150, 180, 300, 360, 600, 720];
const HEADER: usize = 1796;
const APPLE_HEADER: usize = 32;

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
    /// 16 bits, the high byte first. Eight are more than dots show.
    Rgb16,
    Grey,
    /// More is darker.
    Cmyk,
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
    is_apple: bool,
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
        Reader { input, is_apple: false, number: 0, page: None, row: 0, repeat: 0, line: Vec::new() }
    }

    /// A reader of Apple raster whose first bytes, [`APPLE`], have been read.
    ///
    /// # Errors
    /// The stream ends there.
    pub fn behind_apple(mut input: R) -> Result<Reader<R>, RasterError> {
        // The number of pages, which is 0 where the writer did not know it.
        input.read_exact(&mut [0; 4])?;
        Ok(Reader { is_apple: true, ..Reader::behind_sync(input) })
    }

    /// The next page; `None` at the end. Unread rows of the page before are skipped.
    pub fn next_page(&mut self) -> Result<Option<Page>, RasterError> {
        let mut scratch = Vec::new();
        while self.page.is_some_and(|page| self.row < page.height) {
            self.row(&mut scratch)?;
        }
        let mut header = [0; HEADER];
        let header = if self.is_apple { &mut header[..APPLE_HEADER] } else { &mut header[..] };
        if self.input.read(&mut header[..1])? == 0 {
            return Ok(None);
        }
        self.input.read_exact(&mut header[1..])?;
        self.number += 1;
        let page = self.check(header)?;
        (self.page, self.row, self.repeat) = (Some(page), 0, 0);
        Ok(Some(page))
    }

    fn check(&self, header: &[u8]) -> Result<Page, RasterError> {
        let number =
            |at: usize| u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        let wrong =
            |field, found: String, expected| RasterError::Field { page: self.number, field, found, expected };
        let (x, y, width, height) = match self.is_apple {
            true => (number(20), number(20), number(12), number(16)),
            false => (number(276), number(280), number(372), number(376)),
        };
        let dpi = RESOLUTIONS.into_iter().find(|&dpi| x == u32::from(dpi) && x == y).ok_or_else(|| {
            wrong("HWResolution", format!("{x} x {y}"), "150, 180, 300, 360, 600 or 720 in both directions")
        })?;
        // The longest sheet is 14 inches, and no sheet is wider than long.
        let most = 15 * u32::from(dpi);
        if width == 0 || height == 0 || width > most || height > most {
            return Err(wrong(
                "cupsWidth x cupsHeight",
                format!("{width} x {height}"),
                "the pixel size of a sheet",
            ));
        }
        let (pixel, colours, copies) = match self.is_apple {
            true => {
                let (pixel, space) = (u32::from(header[0]), header[1]);
                let colours = match (space, pixel) {
                    (1 | 5, 24) => Colours::Rgb,
                    (0 | 4, 8) => Colours::Grey,
                    (6, 32) => Colours::Cmyk,
                    _ => {
                        let found = format!("{space} with {pixel} bits a pixel");
                        return Err(wrong(
                            "colour space",
                            found,
                            "0 (grey), 1 (sRGB) or 6 (CMYK) with 8 bits",
                        ));
                    }
                };
                (pixel, colours, 1)
            }
            false => {
                let (bits, pixel, space, order) = (number(384), number(388), number(400), number(396));
                let colours = match (space, bits, pixel) {
                    (19 | 1, 8, 24) => Colours::Rgb,
                    (19 | 1, 16, 48) => Colours::Rgb16,
                    (18 | 0, 8, 8) => Colours::Grey,
                    (6, 8, 32) => Colours::Cmyk,
                    (3, 8, 8) => Colours::Black,
                    (3, 1, 1) => Colours::Bits,
                    _ => {
                        return Err(wrong(
                            "cupsColorSpace",
                            format!("{space} with {bits} bits a colour"),
                            "19 (sRGB) with 8 or 16 bits, 18 (sGrey) or 6 (CMYK) with 8, or 3 (black)",
                        ));
                    }
                };
                if order != 0 {
                    return Err(wrong("cupsColorOrder", order.to_string(), "0 (chunky)"));
                }
                (pixel, colours, number(340).clamp(1, 1000))
            }
        };
        let line = (width * pixel).div_ceil(8);
        if !self.is_apple && number(392) != line {
            return Err(wrong("cupsBytesPerLine", number(392).to_string(), "the bytes of one row of pixels"));
        }
        let (width, height, line) = (width as usize, height as usize, line as usize);
        Ok(Page { width, height, dpi, copies, colours, line })
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
            Colours::Rgb16 => rgb.extend(self.line.iter().step_by(2)),
            Colours::Grey => rgb.extend(self.line.iter().flat_map(|&v| [v; 3])),
            Colours::Cmyk => rgb.extend(self.line.as_chunks::<4>().0.iter().flat_map(|&[c, m, y, k]| {
                [c, m, y].map(|ink| {
                    let light = u32::from(255 - ink) * u32::from(255 - k);
                    u8::try_from((light + 127) / 255).unwrap_or(255)
                })
            })),
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
        let (pixel, paper) = match page.colours {
            Colours::Rgb => (3, 255),
            Colours::Rgb16 => (6, 255),
            Colours::Grey => (1, 255),
            Colours::Cmyk => (4, 0),
            Colours::Black | Colours::Bits => (1, 0),
        };
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
    fn cyan_magenta_yellow_and_black_leave_what_they_do_not_take() {
        let mut stream = header(4, 1, 6, 8, 32);
        // Cyan, black, half black over half yellow, and paper to the end.
        stream.extend([0, 254, 255, 0, 0, 0, 0, 0, 0, 255, 0, 0, 128, 128, 128]);
        let [row] = &rows(&stream).unwrap()[0][..] else { panic!("one row") };
        assert_eq!(row, &[0, 255, 255, 0, 0, 0, 127, 127, 63, 255, 255, 255]);
        // Of sixteen bits the first eight count.
        let mut stream = header(2, 1, 19, 16, 48);
        stream.extend([0, 0, 1, 99, 2, 99, 3, 99, 128]);
        assert_eq!(rows(&stream).unwrap()[0][0], [1, 2, 3, 255, 255, 255]);
    }

    #[test]
    fn apple_raster_is_read_as_the_same_rows_behind_another_header() {
        let mut pages = Vec::new();
        for (bits, space, row) in [(24u8, 1u8, &[1u8, 1, 10, 20, 30, 128][..]), (8, 0, &[0, 254, 7, 8, 9])] {
            let mut stream = APPLE.to_vec();
            stream.extend(1u32.to_be_bytes());
            let mut header = [0; APPLE_HEADER];
            (header[0], header[1]) = (bits, space);
            for (at, value) in [(12, 3u32), (16, if bits == 24 { 2 } else { 1 }), (20, 300)] {
                header[at..at + 4].copy_from_slice(&value.to_be_bytes());
            }
            stream.extend(header);
            stream.extend(row);
            let mut reader = Reader::behind_apple(&stream[APPLE.len()..]).unwrap();
            let page = reader.next_page().unwrap().unwrap();
            assert_eq!((page.dpi, page.copies), (300, 1));
            let (mut all, mut row) = (Vec::new(), Vec::new());
            for _ in 0..page.height {
                reader.row(&mut row).unwrap();
                all.extend_from_slice(&row);
            }
            assert!(reader.next_page().unwrap().is_none());
            pages.push(all);
        }
        let line = [10, 20, 30, 10, 20, 30, 255, 255, 255];
        assert_eq!(pages[0], [line, line].concat());
        assert_eq!(pages[1], [7, 7, 7, 8, 8, 8, 9, 9, 9]);
    }

    #[test]
    fn what_is_not_taken_is_named_with_page_and_field() {
        let field = |stream: &[u8]| match rows(stream) {
            Err(RasterError::Field { page: 1, field, .. }) => field,
            other => panic!("{other:?}"),
        };
        assert_eq!(field(&header(0, 3, 19, 8, 24)), "cupsWidth x cupsHeight");
        assert_eq!(field(&header(u32::MAX, 3, 19, 8, 24)[..]), "cupsWidth x cupsHeight");
        assert_eq!(field(&header(5, 3, 6, 8, 24)), "cupsColorSpace");
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
