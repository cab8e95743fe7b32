//! Sheets of paper: their size, and how near to each edge the printer prints.
//!
//! The printer itself keeps the left and the top margin; the others are what the printable area leaves of the sheet.
//! Source: sizes are the standards'; printable areas the established open driver's; which margins were measured on
//! hardware is said with each. Custom sheets get the margins measured on A4.

use protocol::paper::{LARGEST, LEFT, Paper};

use super::length::{Mm, Point};

/// Right and bottom margin of a sheet of a size of its own, in dots: those measured on A4.
const RIGHT: i64 = 80;
const BOTTOM: i64 = 360;

/// The smallest printable side of a custom sheet, in dots: 10 mm, so that a typing error is noticed.
const LEAST: i64 = 236;

/// A sheet and its margins, all in millimetres.
#[derive(Clone, Copy, PartialEq, Debug, serde::Serialize)]
pub struct Known {
    /// Name on the command line.
    pub name: &'static str,
    /// Width and length of the sheet.
    pub sheet_mm: (f64, f64),
    /// Width and length of what can be printed.
    pub printable_mm: (f64, f64),
    /// Margins: left, top, right, bottom.
    pub margins_mm: [f64; 4],
    /// How well the margins are known.
    pub known: &'static str,
}

const TABLE: [(Paper, (f64, f64), &str); 6] = [
    (Paper::A4, (210.0, 297.0), "all four margins measured: 3.39, 12.03, 3.41, 15.23"),
    (Paper::Letter, (215.9, 279.4), "printed, margins not measured"),
    (Paper::Legal, (215.9, 355.6), "never tried"),
    (Paper::Executive, (184.15, 266.7), "printed, margins not measured"),
    (Paper::B5, (182.0, 257.0), "printed, margins not measured"),
    (Paper::Postcard, (100.0, 148.0), "top and right measured; a mark 21 mm above the lower edge printed"),
];

/// The size of a sheet of paper, in 1/600 inch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stock {
    /// From its left to its right edge.
    pub width: u16,
    /// From its top to its bottom edge.
    pub length: u16,
}

impl Stock {
    /// The sheet sold under that name; for a custom size one with the usual margins around the printable area.
    pub fn of(paper: Paper) -> Stock {
        let (width, length) = sheet_mm(paper);
        // Saturates: a stream may declare a page larger than any sheet.
        let dots = |mm: f64| Mm(mm).dots().clamp(0, u16::MAX.into()) as u16;
        Stock { width: dots(width), length: dots(length) }
    }
}

/// Every paper with a name.
pub fn table() -> impl Iterator<Item = Known> {
    TABLE.iter().map(|&(paper, (width, length), known)| {
        let printable = (Mm::of_dots(paper.width().into()).0, Mm::of_dots(paper.length().into()).0);
        let (left, top) = (Mm::of_dots(LEFT.into()).0, Mm::of_dots(paper.top().into()).0);
        Known {
            name: paper.name(),
            sheet_mm: (width, length),
            printable_mm: printable,
            margins_mm: [left, top, width - left - printable.0, length - top - printable.1],
            known,
        }
    })
}

/// The size of the sheet of this paper in millimetres.
pub fn sheet_mm(paper: Paper) -> (f64, f64) {
    match TABLE.iter().find(|row| row.0 == paper) {
        Some(row) => row.1,
        None => (
            Mm::of_dots(i64::from(LEFT) + i64::from(paper.width()) + RIGHT).0,
            Mm::of_dots(i64::from(paper.top()) + i64::from(paper.length()) + BOTTOM).0,
        ),
    }
}

/// The paper meant by a name, or by the size of a sheet such as `120x180mm`.
///
/// # Errors
/// In words: neither, or a sheet that the printer cannot take.
pub fn read(text: &str) -> Result<Paper, String> {
    if let Some(paper) = Paper::from_name(text) {
        return Ok(paper);
    }
    let Ok(Point(width, length)) = text.parse() else {
        let names: Vec<&str> = TABLE.iter().map(|(paper, ..)| paper.name()).collect();
        let ((most, _), (_, longest)) = (sheet_mm(Paper::Letter), sheet_mm(Paper::Legal));
        return Err(format!(
            "`{text}` is not a paper that the printer takes; write {}, or the size of a sheet such as 120x180mm, at most \
             {most} x {longest} mm",
            names.join(", ")
        ));
    };
    custom(width, length)
}

/// A sheet of a size of its own.
///
/// # Errors
/// In words: one that the printer cannot take.
pub fn custom(width: Mm, length: Mm) -> Result<Paper, String> {
    let inner = |top: i64| (width.dots() - i64::from(LEFT) - RIGHT, length.dots() - top - BOTTOM);
    let (across, along) = inner(Paper::Custom { width: 0, length: 0 }.top().into());
    let (most, longest) = (i64::from(LARGEST.0), i64::from(LARGEST.1));
    if across < LEAST || along < LEAST {
        return Err(format!(
            "a sheet of {:.1} x {:.1} mm leaves {:.1} x {:.1} mm to print, with margins of 3.4 mm at the sides, 12.0 mm \
             at the top and 15.2 mm at the bottom; at least 10 x 10 mm are needed",
            width.0,
            length.0,
            Mm::of_dots(across.max(0)).0,
            Mm::of_dots(along.max(0)).0
        ));
    }
    if across > most || along > longest {
        let (width_mm, length_mm) = (sheet_mm(Paper::Letter).0, sheet_mm(Paper::Legal).1);
        return Err(format!(
            "a sheet of {:.1} x {:.1} mm is too large; the printer takes {width_mm} x {length_mm} mm at most",
            width.0, length.0
        ));
    }
    // Within `LARGEST`, which is u16.
    Ok(Paper::Custom { width: across as u16, length: along as u16 })
}

/// Margins of a custom sheet: left, top, right, bottom.
pub fn custom_margins() -> [Mm; 4] {
    let top = i64::from(Paper::Custom { width: 0, length: 0 }.top());
    [i64::from(LEFT), top, RIGHT, BOTTOM].map(Mm::of_dots)
}

/// The smallest and the largest custom sheet.
pub fn custom_range() -> (Point, Point) {
    let [left, top, right, bottom] = custom_margins();
    let (across, down) = (left.0 + right.0, top.0 + bottom.0);
    let sheet =
        |width: i64, length: i64| Point(Mm(Mm::of_dots(width).0 + across), Mm(Mm::of_dots(length).0 + down));
    (sheet(LEAST, LEAST), sheet(LARGEST.0.into(), LARGEST.1.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_come_out_as_they_were_measured() {
        let a4 = table().find(|known| known.name == "a4").unwrap();
        for (margin, measured) in a4.margins_mm.into_iter().zip([3.39, 12.03, 3.41, 15.23]) {
            assert!((margin - measured).abs() < 0.05, "{margin} {measured}");
        }
        assert!(table().all(|known| known.margins_mm.iter().all(|&margin| margin > 2.9)));
        assert_eq!(table().count(), Paper::named().count());
    }

    #[test]
    fn stock_is_the_whole_sheet_in_dots() {
        let size = |paper| {
            let Stock { width, length } = Stock::of(paper);
            (width, length)
        };
        assert_eq!(size(Paper::A4), (4961, 7016));
        assert_eq!(size(Paper::Legal), (5100, 8400));
        assert_eq!(size(Paper::B5), (4299, 6071));
        assert_eq!(size(Paper::Postcard), (2362, 3496));
        assert_eq!(size(Paper::Custom { width: 1000, length: 2000 }), (1160, 2000 + 284 + 360));
        assert_eq!(size(Paper::Custom { width: u16::MAX, length: u16::MAX }), (u16::MAX, u16::MAX));
    }

    #[test]
    fn a_custom_sheet_has_the_margins_of_a4() {
        let a4 = read("210x297mm").unwrap();
        assert!(a4.width().abs_diff(Paper::A4.width()) <= 1 && a4.length().abs_diff(Paper::A4.length()) <= 1);
        assert_eq!((a4.name(), a4.code()), ("custom", 0));
        let (width, length) = sheet_mm(a4);
        assert!((width - 210.0).abs() < 0.05 && (length - 297.0).abs() < 0.05);
        assert_eq!(read("A4"), Ok(Paper::A4));
    }

    #[test]
    fn sheets_that_do_not_go_in_are_refused_with_figures() {
        assert!(read("300x200mm").unwrap_err().contains("215.9 x 355.6"));
        assert!(read("15x30mm").unwrap_err().contains("at least 10 x 10"));
        assert!(read("-5x30mm").is_err() && read("0x0mm").is_err());
        let named = read("a3").unwrap_err();
        assert!(
            named.starts_with("`a3` is not a paper that the printer takes; write a4, letter,"),
            "{named}"
        );
        assert!(named.ends_with("such as 120x180mm, at most 215.9 x 355.6 mm"), "{named}");
        // The largest that goes in does.
        assert!(read("215.9x355.6mm").is_ok());
    }
}
