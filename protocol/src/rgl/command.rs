//! The commands, by meaning. Values that exist in a few kinds only are types, so that a code this project must not send
//! (dye-sub media and paper, inks whose code is uncertain) cannot be expressed.
//!
//! The command table: `docs/rgl.md`, sections "Setup", "Passes", "Rows", "End of a job", "Resolution" and "Media".

use crate::ink::Ink;
use crate::paper::Paper;

/// Dots per inch across and along the sheet.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Resolution {
    /// 300 x 300.
    Dpi300,
    /// 600 x 600, the only one for inks other than cyan, magenta, yellow and black.
    #[default]
    Dpi600,
    /// 1200 across, 600 along.
    Dpi1200,
}

impl Resolution {
    /// The code in the stream.
    pub fn code(self) -> u8 {
        match self {
            Resolution::Dpi300 => 2,
            Resolution::Dpi600 => 3,
            Resolution::Dpi1200 => 4,
        }
    }

    /// The resolution with that code.
    pub fn from_code(code: u8) -> Option<Resolution> {
        [Resolution::Dpi300, Resolution::Dpi600, Resolution::Dpi1200].into_iter().find(|r| r.code() == code)
    }

    /// Dots per inch across and along.
    pub fn dpi(self) -> (u16, u16) {
        match self {
            Resolution::Dpi300 => (300, 300),
            Resolution::Dpi600 => (600, 600),
            Resolution::Dpi1200 => (1200, 600),
        }
    }

    /// Converts a distance across the sheet from 1/600 inch to dots of this resolution.
    pub fn across(self, at_600: u16) -> u16 {
        match self {
            Resolution::Dpi300 => at_600 / 2,
            Resolution::Dpi600 => at_600,
            Resolution::Dpi1200 => at_600.saturating_mul(2),
        }
    }

    /// Converts a distance along the sheet from 1/600 inch to rows of this resolution.
    pub fn along(self, at_600: u16) -> u16 {
        match self {
            Resolution::Dpi300 => at_600 / 2,
            Resolution::Dpi600 | Resolution::Dpi1200 => at_600,
        }
    }
}

/// What the sheet is made of. Sets the heat; for some kinds the printer prints everything twice. Dye-sub media and the
/// reserved codes have no value.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Media {
    /// Plain paper.
    #[default]
    Plain,
    /// Plain paper, everything printed twice.
    PlainTwice,
    /// Special transparency, everything printed twice.
    SpecialTransparencyTwice,
    /// Special transparency.
    SpecialTransparency,
    /// Special iron-on.
    SpecialIronOn,
    /// Iron-on sheet.
    IronOn,
    /// Labeca sheet.
    Labeca,
    /// Thermal paper.
    Thermal,
    /// CD master.
    CdMaster,
    /// Cardboard.
    Cardboard,
    /// Postcard.
    Postcard,
    /// Laser paper.
    LaserPaper,
    /// Transparency, everything printed twice.
    TransparencyTwice,
    /// Transparency.
    Transparency,
    /// Back-print film.
    BackPrintFilm,
    /// Back-print film, everything printed twice.
    BackPrintFilmTwice,
    /// Glossy label.
    GlossyLabel,
    /// Glossy paper.
    GlossyPaper,
    /// VPhoto film.
    VPhotoFilm,
    /// VPhoto card.
    VPhotoCard,
}

const MEDIA: [(Media, &str, [u8; 2]); 20] = [
    (Media::Plain, "plain", [0x00, 0x00]),
    (Media::PlainTwice, "plain-twice", [0x00, 0x02]),
    (Media::SpecialTransparencyTwice, "special-transparency-twice", [0x01, 0x00]),
    (Media::SpecialTransparency, "special-transparency", [0x01, 0x01]),
    (Media::SpecialIronOn, "special-iron-on", [0x02, 0x01]),
    (Media::IronOn, "iron-on", [0x02, 0x02]),
    (Media::Labeca, "labeca", [0x03, 0x00]),
    (Media::Thermal, "thermal", [0x04, 0x00]),
    (Media::CdMaster, "cd-master", [0x04, 0x01]),
    (Media::Cardboard, "cardboard", [0x05, 0x00]),
    (Media::Postcard, "postcard", [0x06, 0x00]),
    (Media::LaserPaper, "laser-paper", [0x07, 0x00]),
    (Media::TransparencyTwice, "transparency-twice", [0x08, 0x00]),
    (Media::Transparency, "transparency", [0x08, 0x01]),
    (Media::BackPrintFilm, "back-print-film", [0x09, 0x00]),
    (Media::BackPrintFilmTwice, "back-print-film-twice", [0x09, 0x02]),
    (Media::GlossyLabel, "glossy-label", [0x0e, 0x00]),
    (Media::GlossyPaper, "glossy-paper", [0x0f, 0x00]),
    (Media::VPhotoFilm, "vphoto-film", [0x10, 0x00]),
    (Media::VPhotoCard, "vphoto-card", [0x11, 0x00]),
];

impl Media {
    /// Every kind.
    pub fn all() -> impl Iterator<Item = Media> {
        MEDIA.iter().map(|row| row.0)
    }

    /// The name for people and in files.
    pub fn name(self) -> &'static str {
        MEDIA[self as usize].1
    }

    /// The kind of that name, in upper or lower case.
    pub fn from_name(name: &str) -> Option<Media> {
        MEDIA.iter().find(|row| row.1.eq_ignore_ascii_case(name)).map(|row| row.0)
    }

    /// The code in the stream.
    pub fn code(self) -> [u8; 2] {
        MEDIA[self as usize].2
    }

    /// The kind with that code.
    pub fn from_code(code: [u8; 2]) -> Option<Media> {
        MEDIA.iter().find(|row| row.2 == code).map(|row| row.0)
    }
}

/// The code of a paper. Separate commands declare its size. The dye-sub label has no value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PaperCode(u8);

impl PaperCode {
    /// The code of a paper.
    pub fn from_paper(paper: Paper) -> PaperCode {
        PaperCode(paper.code())
    }

    /// The paper code with this value in the stream, if there is one.
    pub fn from_code(code: u8) -> Option<PaperCode> {
        (code == 0 || Paper::named().any(|paper| paper.code() == code)).then_some(PaperCode(code))
    }

    /// The code in the stream.
    pub fn code(self) -> u8 {
        self.0
    }

    /// The paper with this code and a declared printable area in 1/600 inch. A named paper declared in another size than
    /// the table's counts as custom.
    pub fn paper(self, width: u16, length: u16) -> Paper {
        Paper::named()
            .find(|paper| paper.code() == self.0 && (paper.width(), paper.length()) == (width, length))
            .unwrap_or(Paper::Custom { width, length })
    }

    /// Rows of 1/600 inch between the sheet's upper edge and row 0.
    pub fn top(self) -> u16 {
        Paper::named()
            .find(|paper| paper.code() == self.0)
            .unwrap_or(Paper::Custom { width: 0, length: 0 })
            .top()
    }
}

/// How the planes follow each other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mode {
    /// One plane of black without ink-select.
    BlackRaster,
    /// One ink-select and its rows for each pass.
    ColourPlane,
    /// The same, with a cartridge list in the setup.
    MultiPlane,
}

impl Mode {
    /// The code in the stream.
    pub fn code(self) -> u8 {
        match self {
            Mode::BlackRaster => 0,
            Mode::ColourPlane => 4,
            Mode::MultiPlane => 8,
        }
    }

    /// The mode with that code.
    pub fn from_code(code: u8) -> Option<Mode> {
        [Mode::BlackRaster, Mode::ColourPlane, Mode::MultiPlane].into_iter().find(|mode| mode.code() == code)
    }
}

/// How the rows that follow are packed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Compression {
    /// Not at all.
    Plain,
    /// [`packbits`](crate::packbits).
    Packed,
}

/// The most cartridges the printer holds.
pub const MAX_CARTRIDGES: usize = 7;

/// The cartridge list of a setup: one to seven. An array with a count and not a `heapless::Vec`, which is not `Copy`: then
/// [`Command`] and [`Order`](super::Order) would not be either, and to clone an order for every row makes
/// [`JobWriter::row`](super::JobWriter::row) slower by 13 % for a short row (37 ns against 33).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cartridges {
    inks: [Ink; MAX_CARTRIDGES],
    count: u8,
}

impl Cartridges {
    /// A list, if it has one to seven entries.
    pub fn new(inks: &[Ink]) -> Option<Cartridges> {
        let mut list = [*inks.first()?; MAX_CARTRIDGES];
        list.get_mut(..inks.len())?.copy_from_slice(inks);
        let count = u8::try_from(inks.len()).ok()?;
        Some(Cartridges { inks: list, count })
    }

    /// The inks in the order of the list.
    pub fn inks(&self) -> &[Ink] {
        &self.inks[..usize::from(self.count)]
    }
}

/// One command. Numbers of dots and rows are at the job's own resolution.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command<'a> {
    /// Printer reset.
    Reset,
    /// Select RGL.
    SelectRgl,
    /// Resolution.
    Resolution(Resolution),
    /// Media type.
    Media(Media),
    /// Paper code.
    Paper(PaperCode),
    /// Page length in rows.
    Length(u16),
    /// Page width in dots.
    Width(u16),
    /// Line-feed adjustment. Read only: never tried on hardware.
    LineFeed(i8),
    /// Print-head drive adjustment, -50 to 50. Read only: never tried on hardware.
    HeadDrive(i8),
    /// Cartridge list.
    Cartridges(Cartridges),
    /// Shift to the right in dots.
    ShiftX(u16),
    /// Shift downwards in rows.
    ShiftY(u16),
    /// Built-in gloss over the print. Read only: never tried on hardware.
    BuiltInGloss,
    /// Whether the printer corrects the sheet's curl.
    CurlCorrection(bool),
    /// Transfer mode.
    Mode(Mode),
    /// Start of raster data.
    RasterStart,
    /// A pass begins.
    InkSelect {
        /// Its ink.
        ink: Ink,
        /// Whether it is the last pass.
        last: bool,
    },
    /// The sheet goes back for the next pass.
    BackFeed,
    /// How the rows that follow are packed.
    Compression(Compression),
    /// Blank rows.
    Skip(u16),
    /// One row.
    Row {
        /// Whether it is the last row of the image.
        last: bool,
        /// Its bytes, packed or plain, 1 to 65535.
        data: &'a [u8],
    },
    /// End of raster data.
    RasterEnd,
    /// The sheet is ejected.
    FormFeed,
    /// Leave RGL.
    LeaveRgl,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn media_stand_in_the_order_of_the_enum_and_none_is_dye_sub_or_reserved() {
        for (i, &(media, name, code)) in MEDIA.iter().enumerate() {
            assert_eq!(media as usize, i);
            assert_eq!((Media::from_name(name), Media::from_code(code)), (Some(media), Some(media)));
            assert!(!(0x0a..=0x0d).contains(&code[0]));
        }
    }

    #[test]
    fn the_dye_sub_label_is_no_paper() {
        assert!(PaperCode::from_code(7).is_none());
        assert!((0..7).all(|code| PaperCode::from_code(code).is_some_and(|paper| paper.code() == code)));
    }

    #[test]
    fn a_declared_size_of_its_own_makes_a_named_paper_custom() {
        let a4 = PaperCode::from_paper(Paper::A4);
        assert_eq!(a4.paper(4800, 6372), Paper::A4);
        assert_eq!(a4.paper(4800, 6381), Paper::Custom { width: 4800, length: 6381 });
        assert_eq!((a4.top(), PaperCode::from_paper(Paper::Postcard).top()), (284, 71));
    }
}
