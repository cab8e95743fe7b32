//! The header before the pass streams of a job: the page, the planes' size, the inks.
//!
//! ```text
//! header = version (02) resolution media media paper width width length length curl
//!          shift-x shift-x shift-y shift-y columns columns rows rows consent passes
//!          x x y y across across down down { ink }
//! ```
//!
//! Resolution, media, paper and ink codes are those of the printer's language; two-byte numbers are
//! little-endian. `width` and `length` are the printable area in 1/600 inch of a custom sheet (code 0), and 0
//! for every other. `curl` is 1 if the printer corrects curl; `consent` is 1 if the user has agreed to foil. `columns`
//! and `rows` are the size of the planes in dots. `x`, `y`, `across` and `down` are the rectangle of the picture whose walk the streams
//! follow, which lies within the planes: all of them if there is no such picture. One stream follows for each pass.

use crate::ink::Ink;
use crate::paper::Paper;
use crate::rgl::command::PaperCode;
use crate::rgl::order::MAX_PASSES;
use crate::rgl::{Fault, FoilConsent, JobSetup, Media, Page, Resolution};
use crate::walk::{Frame, Placed};
use heapless::Vec;

/// Bytes before the inks.
const FIXED: usize = 28;

/// The longest header.
pub const MAX_HEADER: usize = FIXED + MAX_PASSES;

/// 1 had no frame.
const VERSION: u8 = 2;

/// A job's page, planes and inks. Making one proves that it can be printed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Header {
    setup: JobSetup,
    consent: bool,
    walk: Placed,
}

/// Why bytes are no header.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HeaderError {
    /// Not version 2, or an unknown code or flag.
    Unknown,
    /// The printer must not be sent this.
    Forbidden(Fault),
}

impl Header {
    /// A job of planes of `columns` by `rows` dots, with these inks in printing order.
    ///
    /// Errors: those of [`JobSetup::new`]; [`Fault::BeyondWidth`] and [`Fault::TooManyRows`] if the planes do not fit the
    /// page; [`Fault::PageSize`] for planes without a dot.
    pub fn new(
        page: Page,
        inks: &[Ink],
        consent: Option<FoilConsent>,
        columns: u16,
        rows: u16,
    ) -> Result<Header, Fault> {
        let setup = JobSetup::new(page, inks, consent)?;
        if columns == 0 || rows == 0 {
            return Err(Fault::PageSize);
        }
        if u32::from(columns) + u32::from(page.resolution.across(page.shift_x)) > u32::from(page.width()) {
            return Err(Fault::BeyondWidth);
        }
        if u32::from(rows) + u32::from(page.resolution.along(page.shift_y)) > u32::from(page.length()) {
            return Err(Fault::TooManyRows);
        }
        Ok(Header { setup, consent: consent.is_some(), walk: Placed::whole(columns, rows) })
    }

    /// The same job, whose planes are coded along the walk of a picture at `frame`. `None` if that has no dot or does not lie
    /// within the planes.
    pub fn framed(self, frame: Frame) -> Option<Header> {
        Placed::new(self.columns(), self.rows(), frame).map(|walk| Header { walk, ..self })
    }

    /// The walk along which the planes are coded.
    pub fn walk(&self) -> &Placed {
        &self.walk
    }

    /// Page and inks.
    pub fn setup(&self) -> &JobSetup {
        &self.setup
    }

    /// Dots across a plane.
    pub fn columns(&self) -> u16 {
        self.walk.width()
    }

    /// Rows of a plane.
    pub fn rows(&self) -> u16 {
        self.walk.height()
    }

    /// Writes the header to the beginning of `out` and returns its length.
    pub fn write(&self, out: &mut [u8; MAX_HEADER]) -> usize {
        let page = self.setup.page();
        let (width, length) = match page.paper {
            Paper::Custom { width, length } => (width, length),
            _ => (0, 0),
        };
        let [media, media2] = page.media.code();
        out[..5].copy_from_slice(&[
            VERSION,
            page.resolution.code(),
            media,
            media2,
            PaperCode::from_paper(page.paper).code(),
        ]);
        out[9] = u8::from(page.curl_correction);
        let frame = self.walk.frame();
        let words = [
            (5, width),
            (7, length),
            (10, page.shift_x),
            (12, page.shift_y),
            (14, self.columns()),
            (16, self.rows()),
            (20, frame.x),
            (22, frame.y),
            (24, frame.width),
            (26, frame.height),
        ];
        for (at, word) in words {
            out[at..at + 2].copy_from_slice(&word.to_le_bytes());
        }
        let inks = self.setup.passes();
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_PASSES, by JobSetup")]
        let passes = inks.len() as u8;
        (out[18], out[19]) = (u8::from(self.consent), passes);
        for (place, ink) in out[FIXED..].iter_mut().zip(inks) {
            *place = ink.code();
        }
        FIXED + inks.len()
    }

    /// The header at the beginning of `bytes` and its length; `None` if there are not enough of them yet.
    pub fn read(bytes: &[u8]) -> Result<Option<(Header, usize)>, HeaderError> {
        let Some((fixed, rest)) = bytes.split_first_chunk::<FIXED>() else {
            return Ok(None);
        };
        let word = |at: usize| u16::from_le_bytes([fixed[at], fixed[at + 1]]);
        let flag = |at: usize| match fixed[at] {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(HeaderError::Unknown),
        };
        if fixed[0] != VERSION {
            return Err(HeaderError::Unknown);
        }
        let resolution = Resolution::from_code(fixed[1]).ok_or(HeaderError::Unknown)?;
        let media = Media::from_code([fixed[2], fixed[3]]).ok_or(HeaderError::Unknown)?;
        let code = PaperCode::from_code(fixed[4]).ok_or(HeaderError::Unknown)?;
        let (width, length) = (word(5), word(7));
        let paper = match Paper::named().find(|paper| PaperCode::from_paper(*paper) == code) {
            Some(paper) if (width, length) == (0, 0) => paper,
            Some(_) => return Err(HeaderError::Unknown),
            None => Paper::Custom { width, length },
        };
        let (curl_correction, consent) = (flag(9)?, flag(18)?);
        let count = usize::from(fixed[19]);
        let too_many = HeaderError::Forbidden(Fault::TooManyPasses);
        if count > MAX_PASSES {
            return Err(too_many);
        }
        let Some(codes) = rest.get(..count) else {
            return Ok(None);
        };
        let mut inks = Vec::<Ink, MAX_PASSES>::new();
        for &code in codes {
            inks.push(Ink::from_code(code).ok_or(HeaderError::Unknown)?).map_err(|_| too_many)?;
        }
        let page = Page { paper, media, resolution, curl_correction, shift_x: word(10), shift_y: word(12) };
        let consent = consent.then(FoilConsent::given_by_the_user);
        let header = Header::new(page, &inks, consent, word(14), word(16)).map_err(HeaderError::Forbidden)?;
        let frame = Frame { x: word(20), y: word(22), width: word(24), height: word(26) };
        header.framed(frame).map(|header| Some((header, FIXED + count))).ok_or(HeaderError::Unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_header_that_can_be_read_is_written_alike(
            changes in prop::collection::vec((0..FIXED + 2, any::<u8>()), 0..4),
        ) {
            let mut bytes = [
                2, 3, 0, 0, 4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0xc0, 0x02, 0xe4, 0x08, 0, 2, 9, 1, 3, 0, 0x58, 0, 0x60, 0,
                0x0b, 0x00,
            ];
            for (at, value) in changes {
                bytes[at] = value;
            }
            if let Ok(Some((header, length))) = Header::read(&bytes) {
                let mut out = [0; MAX_HEADER];
                prop_assert_eq!(header.write(&mut out), length);
                prop_assert_eq!(&out[..length], &bytes[..length]);
            }
        }
    }

    #[test]
    fn every_paper_and_every_setting_comes_back() {
        let custom = Paper::Custom { width: 3336, length: 4320 };
        for paper in Paper::named().chain([custom]) {
            let page = Page {
                media: Media::from_name("cardboard").unwrap(),
                curl_correction: false,
                shift_x: 100,
                shift_y: 200,
                ..Page::plain(paper)
            };
            let foil = Some(FoilConsent::given_by_the_user());
            let inks = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black, Ink::GoldFoil];
            let header = Header::new(page, &inks, foil, 2000, 2500).unwrap();
            let header = header.framed(Frame { x: 100, y: 7, width: 1900, height: 2001 }).unwrap();
            let mut out = [0; MAX_HEADER];
            let length = header.write(&mut out);
            assert_eq!(Header::read(&out[..length]), Ok(Some((header, length))));
            assert_eq!(Header::read(&out[..length - 1]), Ok(None));
        }
    }

    #[test]
    fn a_small_header_is_these_bytes() {
        let header =
            Header::new(Page::plain(Paper::A4), &[Ink::White, Ink::Black], None, 4800, 6372).unwrap();
        let mut out = [0; MAX_HEADER];
        let length = header.write(&mut out);
        let expected = [
            2, 3, 0, 0, 4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0xc0, 0x12, 0xe4, 0x18, 0, 2, 0, 0, 0, 0, 0xc0, 0x12,
            0xe4, 0x18, 0x0b, 0x00,
        ];
        assert_eq!(out[..length], expected);
        let frame = Frame { x: 0x0302, y: 0x0504, width: 0x0706, height: 0x0908 };
        let length = header.framed(frame).unwrap().write(&mut out);
        assert_eq!(out[..20], expected[..20]);
        assert_eq!(out[20..length], [2, 3, 4, 5, 6, 7, 8, 9, 0x0b, 0x00]);
    }

    #[test]
    fn a_picture_that_does_not_lie_within_its_planes_has_no_header() {
        let header = Header::new(Page::plain(Paper::A4), &[Ink::White], None, 1000, 900).unwrap();
        let mut out = [0; MAX_HEADER];
        let length = header.write(&mut out);
        for (at, words) in [
            (20, [1u16, 0, 1000, 900]),
            (20, [0, 1, 1000, 900]),
            (20, [0, 0, 0, 900]),
            (20, [0, 0, 1000, 0]),
            (20, [u16::MAX, u16::MAX, 1, 1]),
            (20, [0, 0, u16::MAX, u16::MAX]),
        ] {
            for (place, word) in out[at..].chunks_exact_mut(2).zip(words) {
                place.copy_from_slice(&word.to_le_bytes());
            }
            assert_eq!(Header::read(&out[..length]), Err(HeaderError::Unknown), "{words:?}");
        }
    }

    #[test]
    fn what_must_not_be_printed_has_no_header() {
        let plain = Page::plain(Paper::A4);
        let fine = Page { resolution: Resolution::Dpi1200, ..plain };
        assert_eq!(Header::new(fine, &[Ink::White], None, 100, 100), Err(Fault::SpotResolution));
        assert_eq!(Header::new(plain, &[Ink::GoldFoil], None, 100, 100), Err(Fault::FoilWithoutConsent));
        assert_eq!(Header::new(plain, &[Ink::Black], None, 4801, 100), Err(Fault::BeyondWidth));
        assert_eq!(Header::new(plain, &[Ink::Black], None, 100, 6373), Err(Fault::TooManyRows));
    }
}
