//! Paper: the codes of the printer's language and the printable area.
//!
//! Lengths are in dots of 1/600 inch. The printer itself enforces the left and top margins: a dot at (0, 0) lands at
//! (`left`, `top`) from the sheet's corner. Source: the established open driver's table, checked on hardware for all
//! papers but legal.

/// A sheet that the printer knows by a code. Dye-sub labels are left out because they need dye-sub media.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Paper {
    /// Any size up to the printer's width, given as the printable area in dots.
    Custom {
        /// Printable width.
        width: u16,
        /// Printable length.
        length: u16,
    },
    /// Executive.
    Executive,
    /// US letter.
    Letter,
    /// US legal (not tried on hardware).
    Legal,
    /// A4.
    A4,
    /// B5.
    B5,
    /// Postcard, 100 x 148 mm.
    Postcard,
}

struct PaperRow {
    paper: Paper,
    name: &'static str,
    code: u8,
    width: u16,
    length: u16,
    top: u16,
}

const TABLE: [PaperRow; 6] = [
    PaperRow { paper: Paper::Executive, name: "executive", code: 1, width: 4190, length: 5660, top: 284 },
    PaperRow { paper: Paper::Letter, name: "letter", code: 2, width: 4940, length: 5960, top: 284 },
    PaperRow { paper: Paper::Legal, name: "legal", code: 3, width: 4940, length: 7760, top: 284 },
    PaperRow { paper: Paper::A4, name: "a4", code: 4, width: 4800, length: 6372, top: 284 },
    PaperRow { paper: Paper::B5, name: "b5", code: 5, width: 4138, length: 5430, top: 284 },
    PaperRow { paper: Paper::Postcard, name: "postcard", code: 6, width: 2202, length: 3082, top: 71 },
];

/// Left margin of every paper, in dots.
pub const LEFT: u16 = 80;

/// The widest and longest printable area of the table; custom sheets stay within it.
pub const LARGEST: (u16, u16) = (4940, 7760);

impl Paper {
    /// The papers that have a name.
    pub fn named() -> impl Iterator<Item = Paper> {
        TABLE.iter().map(|row| row.paper)
    }

    fn row(self) -> Option<&'static PaperRow> {
        TABLE.iter().find(|row| row.paper == self)
    }

    /// The name for people and in files.
    pub fn name(self) -> &'static str {
        self.row().map_or("custom", |row| row.name)
    }

    /// The paper of that name, in upper or lower case.
    pub fn from_name(name: &str) -> Option<Paper> {
        TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name)).map(|row| row.paper)
    }

    /// The code in the job's setup.
    pub fn code(self) -> u8 {
        self.row().map_or(0, |row| row.code)
    }

    /// Printable width in dots.
    pub fn width(self) -> u16 {
        match self {
            Paper::Custom { width, .. } => width,
            _ => self.row().map_or(0, |row| row.width),
        }
    }

    /// Printable length in rows.
    pub fn length(self) -> u16 {
        match self {
            Paper::Custom { length, .. } => length,
            _ => self.row().map_or(0, |row| row.length),
        }
    }

    /// Top margin in rows.
    pub fn top(self) -> u16 {
        self.row().map_or(284, |row| row.top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a4_is_the_size_of_the_golden_streams() {
        assert_eq!((Paper::A4.code(), Paper::A4.width(), Paper::A4.length()), (4, 4800, 6372));
        assert_eq!((Paper::A4.width(), Paper::A4.length()), (0x12c0, 0x18e4));
    }

    #[test]
    fn names_lead_back_to_their_paper() {
        for paper in Paper::named() {
            assert_eq!(Paper::from_name(paper.name()), Some(paper));
            assert!(paper.width() <= LARGEST.0 && paper.length() <= LARGEST.1);
        }
    }
}
