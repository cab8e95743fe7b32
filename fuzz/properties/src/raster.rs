//! Pages of PWG and Apple raster: no bytes make the reader fail, and how they come changes nothing.

use std::io::{self, Read};

use queue::raster::Reader;

/// Rows that are read of each page, and pages.
const ROWS: usize = 64;
const PAGES: usize = 8;

/// The first byte says which of the formats; the rest are headers and rows. With an odd first byte the first header is one of a
/// small page, for chance makes none.
pub fn check(bytes: &[u8]) {
    let Some((&kind, bytes)) = bytes.split_first() else { return };
    let is_apple = kind & 2 != 0;
    let mut stream = Vec::new();
    if kind & 1 != 0 {
        let (width, height) = (u32::from(kind >> 4) + 1, 40);
        let pixel = [8, 24, 32][usize::from(kind >> 2 & 3).min(2)];
        let space: u32 = [18, 19, 6][usize::from(kind >> 2 & 3).min(2)];
        let mut header = vec![0; if is_apple { 32 } else { 1796 }];
        let fields = match is_apple {
            true => vec![(12, width), (16, height), (20, 300)],
            false => vec![
                (276, 300),
                (280, 300),
                (372, width),
                (376, height),
                (384, 8),
                (388, pixel),
                (392, (width * pixel).div_ceil(8)),
                (400, space),
            ],
        };
        for (at, value) in fields {
            header[at..at + 4].copy_from_slice(&value.to_be_bytes());
        }
        if is_apple {
            header[0] = u8::try_from(pixel).unwrap_or(8);
            header[1] = [0, 1, 6][usize::from(kind >> 2 & 3).min(2)];
            stream.extend([0; 4]);
        }
        stream.extend(header);
    }
    stream.extend(bytes);
    let whole = outcome(&stream[..], is_apple);
    assert_eq!(outcome(Slow(&stream), is_apple), whole, "byte by byte");
}

/// Gives one byte at a time.
struct Slow<'a>(&'a [u8]);

impl Read for Slow<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = out.len().min(1);
        self.0.read(&mut out[..count])
    }
}

/// The size of each page with the sum of its bytes, and how the stream ended.
fn outcome(input: impl Read, is_apple: bool) -> (Vec<(usize, usize, u64)>, String) {
    let mut pages = Vec::new();
    let opened = match is_apple {
        true => Reader::behind_apple(input),
        false => Ok(Reader::behind_sync(input)),
    };
    let mut reader = match opened {
        Ok(reader) => reader,
        Err(error) => return (pages, error.to_string()),
    };
    let mut row = Vec::new();
    while pages.len() < PAGES {
        let page = match reader.next_page() {
            Ok(Some(page)) => page,
            Ok(None) => return (pages, String::new()),
            Err(error) => return (pages, error.to_string()),
        };
        let mut sum = 0;
        for _ in 0..page.height.min(ROWS) {
            if let Err(error) = reader.row(&mut row) {
                return (pages, error.to_string());
            }
            assert_eq!(row.len(), 3 * page.width);
            sum += row.iter().map(|&byte| u64::from(byte)).sum::<u64>();
        }
        pages.push((page.width, page.height, sum));
        if page.height > ROWS {
            break;
        }
    }
    (pages, "enough".into())
}
