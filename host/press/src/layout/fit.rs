//! A page on the sheet that is loaded: which way up, how large, and where.
//!
//! Problem: a sheet is given, and pages of any size and shape come from anywhere: documents whose edges are
//! mostly bare, photographs that are drawn up to theirs, slides on their side.
//! Method: the turn is decided first, then the scale, then the corner. Everybody who lays a page on a sheet
//! asks this one function, and applies what it says where the drawing is still sharp.
//! Limits: whole quarter turns; a page that would be printed at less than a hundredth of its size is refused.
//! Source: `print-scaling` of PWG 5100.13, `orientation-requested` of RFC 8011, section 5.2.10. A page of the
//! sheet's own size is not scaled whatever is asked, for clients that draw for this printer have left its
//! margins free already (apple/cups#6012).

use std::fmt;

use protocol::paper::{LEFT, Paper};
use serde::{Deserialize, Serialize};
use sheet::Turn;

use super::length::{Mm, Point};
use super::paper::sheet_mm;

/// How large a page is printed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// As it is; one that is too large is fitted.
    #[default]
    Auto,
    /// Alike here: margins are never 0.
    AutoFit,
    /// As large as it goes into what can be printed.
    Fit,
    /// As small as it covers the whole sheet; the rest is cut.
    Fill,
    /// As it is, whatever of it is cut.
    None,
    /// So wide as it lies then, in hundredths of a millimetre.
    Wide(u32),
}

impl Scaling {
    /// All that have a name of their own.
    pub const ALL: [Scaling; 5] =
        [Scaling::Auto, Scaling::AutoFit, Scaling::Fit, Scaling::Fill, Scaling::None];

    /// The name in `print-scaling`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Scaling::Auto => "auto",
            Scaling::AutoFit => "auto-fit",
            Scaling::Fit => "fit",
            Scaling::Fill => "fill",
            Scaling::None | Scaling::Wide(_) => "none",
        }
    }
}

/// What is asked for.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Wish {
    /// How large.
    pub scaling: Scaling,
    /// Which way up; without it the way that it fits larger, and as it comes if that is the same.
    pub turn: Option<Turn>,
    /// Where the page's corner goes, from that of the sheet; without it the page is in the middle.
    pub corner: Option<Point>,
    /// Whether a page that is smaller than the sheet is fitted, too.
    pub must_fit: bool,
}

/// What is at the edges of a page.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// Mostly nothing, as of a document.
    Margin,
    /// What is drawn reaches them, as in a photograph.
    Content,
}

/// How a page is laid on its sheet.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fit {
    /// Turned first,
    pub turn: Turn,
    /// then made so many times as large,
    pub scale: f64,
    /// and laid with its corner so far from that of the sheet.
    pub corner: Point,
}

/// Why a page cannot be laid on a sheet.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// It has no size.
    #[error("a page of {0} x {1} mm has no size; give it one, such as 210 x 297 mm")]
    Size(f64, f64),
    /// It would be too small to see.
    #[error(
        "a page of {width:.0} x {length:.0} mm would be printed at {:.2} % on a sheet of {} x {} mm; \
         make it smaller: nothing is printed at less than {} %",
        100.0 * .scale, .sheet.0, .sheet.1, 100.0 * LEAST
    )]
    Small {
        /// Width of the page in mm.
        width: f64,
        /// Its length.
        length: f64,
        /// The scale it would need.
        scale: f64,
        /// Width and length of the sheet.
        sheet: (f64, f64),
    },
    /// Its place leaves nothing of it.
    #[error(
        "with its corner at {x:.1} x {y:.1} mm the page of {width:.1} x {length:.1} mm lies off the sheet of \
         {} x {} mm; choose another place",
        .sheet.0, .sheet.1
    )]
    Off {
        /// The corner from the left in mm.
        x: f64,
        /// And from the top.
        y: f64,
        /// Width of the page as it would be printed.
        width: f64,
        /// Its length.
        length: f64,
        /// Width and length of the sheet.
        sheet: (f64, f64),
    },
}

/// The smallest scale: a page of 20 m is none that is meant.
const LEAST: f64 = 0.01;

/// A page whose sides differ from the sheet's by at most so many millimetres has its size: Letter and A4
/// differ by 6, and programs round to points and whole millimetres.
const SAME: f64 = 1.0;

/// Half a dot: what a size computed from dots may be too large by.
const GRACE: f64 = 0.5 * 25.4 / 600.0;

/// A sheet, and what can be printed of it, in millimetres.
struct Room {
    sheet: (f64, f64),
    corner: (f64, f64),
    printable: (f64, f64),
}

impl Room {
    fn of(paper: Paper) -> Room {
        let mm = |x: u16, y: u16| (Mm::of_dots(x.into()).0, Mm::of_dots(y.into()).0);
        Room {
            sheet: sheet_mm(paper),
            corner: mm(LEFT, paper.top()),
            printable: mm(paper.width(), paper.length()),
        }
    }

    /// The scale by which a page fills what can be printed in one direction, and nothing is cut.
    fn fit(&self, page: (f64, f64)) -> f64 {
        (self.printable.0 / page.0).min(self.printable.1 / page.1)
    }

    /// The scale of a page that lies this way up, and whether that fits it into what can be printed.
    fn scale(&self, page: (f64, f64), edge: Edge, wish: &Wish) -> (f64, bool) {
        let within = |room: (f64, f64), more: f64| page.0 <= room.0 + more && page.1 <= room.1 + more;
        match (wish.scaling, edge) {
            (Scaling::None, _) => (1.0, false),
            (Scaling::Wide(width), _) => (f64::from(width) / 100.0 / page.0, false),
            (Scaling::Fit, _) => (self.fit(page), true),
            (Scaling::Fill, _) => ((self.sheet.0 / page.0).max(self.sheet.1 / page.1), false),
            (_, Edge::Margin) if self.is_size_of(page) => (1.0, false),
            (_, Edge::Margin) if within(self.sheet, SAME) && !wish.must_fit => (1.0, false),
            (_, Edge::Content) if within(self.printable, GRACE) && !wish.must_fit => (1.0, false),
            _ => (self.fit(page), true),
        }
    }

    fn is_size_of(&self, page: (f64, f64)) -> bool {
        (page.0 - self.sheet.0).abs() <= SAME && (page.1 - self.sheet.1).abs() <= SAME
    }

    /// How large a page gets that lies this way up, for whoever chooses the way. At 100 % nothing is won by
    /// more room.
    fn gain(&self, page: (f64, f64), edge: Edge, wish: &Wish) -> f64 {
        match wish.scaling {
            Scaling::Fit | Scaling::Fill => self.fit(page),
            _ => self.scale(page, edge, &Wish { scaling: Scaling::Auto, ..*wish }).0,
        }
    }

    /// The corner in one direction: in the middle of the sheet, and off its margins if there is room.
    fn middle(sheet: f64, (corner, printable): (f64, f64), side: f64) -> f64 {
        let middle = (sheet - side) / 2.0;
        match side <= printable + GRACE {
            true => middle.min(corner + printable - side).max(corner),
            false => middle,
        }
    }
}

/// Lays a page of this width and length in millimetres, as it is seen, on a sheet.
///
/// # Errors
/// A page without a size, one that would be printed far too small, or a place off the sheet.
pub fn fit(page: (f64, f64), edge: Edge, paper: Paper, wish: &Wish) -> Result<Fit, FitError> {
    let is_side = |side: f64| side.is_finite() && side > 0.0;
    if !(is_side(page.0) && is_side(page.1)) {
        return Err(FitError::Size(page.0, page.1));
    }
    let room = Room::of(paper);
    let turn = wish.turn.unwrap_or_else(|| {
        let [upright, turned] = [Turn::None, Turn::Left].map(|turn| room.gain(turn.sides(page), edge, wish));
        // What sides are rounded by is no reason to turn.
        if turned > upright * 1.001 { Turn::Left } else { Turn::None }
    });
    let lying = turn.sides(page);
    let (scale, is_fitted) = room.scale(lying, edge, wish);
    // Less than a dot is no reason to draw a page at another resolution.
    let is_same = (scale - 1.0).abs() * page.0.max(page.1) < 2.0 * GRACE;
    let scale = if is_same { 1.0 } else { scale };
    if scale < LEAST {
        return Err(FitError::Small { width: page.0, length: page.1, scale, sheet: room.sheet });
    }
    let (width, length) = (lying.0 * scale, lying.1 * scale);
    let corner = wish.corner.unwrap_or_else(|| {
        let middle = |sheet: f64, corner: f64, printable: f64, side: f64| match is_fitted {
            true => Mm(corner + (printable - side) / 2.0),
            false => Mm(Room::middle(sheet, (corner, printable), side)),
        };
        let Room { sheet, corner, printable } = room;
        Point(middle(sheet.0, corner.0, printable.0, width), middle(sheet.1, corner.1, printable.1, length))
    });
    let meets = |at: f64, side: f64, from: f64, room: f64| at < from + room && at + side > from;
    let Point(Mm(x), Mm(y)) = corner;
    let is_on =
        meets(x, width, room.corner.0, room.printable.0) && meets(y, length, room.corner.1, room.printable.1);
    match is_on {
        true => Ok(Fit { turn, scale, corner }),
        false => Err(FitError::Off { x, y, width, length, sheet: room.sheet }),
    }
}

impl Fit {
    /// A page that has the sheet's own size, as it comes.
    pub const AS_IT_COMES: Fit = Fit { turn: Turn::None, scale: 1.0, corner: Point(Mm(0.0), Mm(0.0)) };

    /// Whether the page is scaled, as far as anybody can see.
    #[must_use]
    pub fn is_scaled(&self) -> bool {
        (self.scale - 1.0).abs() >= 0.0005
    }
}

impl fmt::Display for Fit {
    /// What was done to the page, in words; none if it lies as it comes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let turn = match self.turn {
            Turn::None => "",
            Turn::Left => "turned by 90° anticlockwise",
            Turn::Half => "turned by 180°",
            Turn::Right => "turned by 90° clockwise",
        };
        f.write_str(turn)?;
        if self.is_scaled() {
            let and = if turn.is_empty() { "" } else { " and " };
            write!(f, "{and}printed at {:.1} %", 100.0 * self.scale)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn on(paper: Paper, page: (f64, f64), edge: Edge, scaling: Scaling) -> Fit {
        fit(page, edge, paper, &Wish { scaling, ..Wish::default() }).unwrap()
    }

    fn auto(page: (f64, f64), edge: Edge) -> (Turn, f64) {
        let Fit { turn, scale, .. } = on(Paper::A4, page, edge, Scaling::Auto);
        (turn, (1e4 * scale).round() / 1e4)
    }

    #[test]
    fn ordinary_pages_lie_on_a4_as_people_expect() {
        use Edge::{Content, Margin};
        assert_eq!(auto((210.0, 297.0), Margin), (Turn::None, 1.0));
        assert_eq!(auto((297.0, 210.0), Margin), (Turn::Left, 1.0));
        assert_eq!(auto((297.0, 420.0), Margin), (Turn::None, 0.6423));
        assert_eq!(auto((215.9, 279.4), Margin), (Turn::None, 0.9412));
        assert_eq!(auto((254.0, 143.0), Margin), (Turn::Left, 1.0));
        assert_eq!(auto((85.0, 54.0), Margin), (Turn::None, 1.0));
        assert_eq!(auto((297.0, 210.0), Content), (Turn::Left, 0.9082));
        assert_eq!(auto((85.0, 54.0), Content), (Turn::None, 1.0));
        // 3000 x 2000 pixels at 72 dpi: 4248 x 6372 dots.
        let photo = on(Paper::A4, (3000.0 / 72.0 * 25.4, 2000.0 / 72.0 * 25.4), Content, Scaling::Auto);
        let dots = (2000.0 / 72.0 * 600.0 * photo.scale, 3000.0 / 72.0 * 600.0 * photo.scale);
        assert_eq!((photo.turn, dots.0.round(), dots.1.round()), (Turn::Left, 4248.0, 6372.0));
        // A whole A4 picture on a postcard: its length is the printable length.
        let card = on(Paper::Postcard, (210.0, 297.0), Content, Scaling::Auto);
        assert_eq!((card.turn, (297.0 * card.scale * 600.0 / 25.4).round()), (Turn::None, 3082.0));
    }

    #[test]
    fn a_page_is_as_wide_as_it_is_wished_to_be_the_way_it_lies() {
        let wide = |turn| Wish { scaling: Scaling::Wide(5000), turn: Some(turn), ..Wish::default() };
        for (turn, scale) in [(Turn::None, 50.0 / 85.0), (Turn::Left, 50.0 / 54.0)] {
            let found = fit((85.0, 54.0), Edge::Content, Paper::A4, &wide(turn)).unwrap();
            assert!((found.scale - scale).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn what_was_done_is_said_once() {
        let said = |turn, scale| Fit { turn, scale, ..Fit::AS_IT_COMES }.to_string();
        assert_eq!(said(Turn::None, 1.0002), "");
        assert_eq!(said(Turn::None, 0.9082), "printed at 90.8 %");
        assert_eq!(said(Turn::Left, 1.0), "turned by 90° anticlockwise");
        assert_eq!(said(Turn::Right, 0.5), "turned by 90° clockwise and printed at 50.0 %");
    }

    #[test]
    fn pages_that_are_none_and_places_off_the_sheet_are_refused() {
        let wish = Wish::default();
        for page in [(0.0, 10.0), (10.0, -1.0), (f64::NAN, 10.0), (10.0, f64::INFINITY)] {
            assert!(matches!(fit(page, Edge::Margin, Paper::A4, &wish), Err(FitError::Size(..))), "{page:?}");
        }
        let long = fit((1e6, 1e6), Edge::Margin, Paper::A4, &wish).unwrap_err().to_string();
        assert!(long.contains("1000000 x 1000000 mm") && long.contains("210 x 297 mm"), "{long}");
        let at = |x, y| Wish { corner: Some(Point(Mm(x), Mm(y))), ..wish };
        for (x, y) in [(210.0, 10.0), (-90.0, 10.0), (10.0, 290.0)] {
            let off = fit((80.0, 50.0), Edge::Content, Paper::A4, &at(x, y));
            assert!(matches!(off, Err(FitError::Off { .. })), "{x} {y}");
        }
        assert!(fit((80.0, 50.0), Edge::Content, Paper::A4, &at(-70.0, 10.0)).is_ok());
    }

    fn papers() -> impl Strategy<Value = Paper> {
        prop_oneof![
            Just(Paper::A4),
            Just(Paper::Letter),
            Just(Paper::Postcard),
            (300u16..4900, 300u16..7700).prop_map(|(width, length)| Paper::Custom { width, length })
        ]
    }

    fn turns() -> impl Strategy<Value = Option<Turn>> {
        let turns = [Turn::None, Turn::Left, Turn::Half, Turn::Right].map(Some);
        prop_oneof![Just(None), prop::sample::select(turns.to_vec())]
    }

    fn edges() -> impl Strategy<Value = Edge> {
        prop_oneof![Just(Edge::Margin), Just(Edge::Content)]
    }

    proptest! {
        #[test]
        fn what_is_fitted_lies_within_what_is_printed_and_touches_two_sides(
            page in (5.0..900f64, 5.0..900f64), paper in papers(), turn in turns(), edge in edges()
        ) {
            let wish = Wish { scaling: Scaling::Fit, turn, ..Wish::default() };
            let found = fit(page, edge, paper, &wish).unwrap();
            let room = Room::of(paper);
            let (width, length) = found.turn.sides((page.0 * found.scale, page.1 * found.scale));
            let left = found.corner.0.0 - room.corner.0;
            let top = found.corner.1.0 - room.corner.1;
            prop_assert!(left >= -GRACE && top >= -GRACE);
            let right = room.printable.0 - left - width;
            let below = room.printable.1 - top - length;
            prop_assert!((left - right).abs() < 1e-9 && (top - below).abs() < 1e-9);
            prop_assert!(left.min(top) < GRACE);
        }

        #[test]
        fn what_is_to_fill_covers_the_sheet_and_no_more_than_it_must(
            page in (5.0..900f64, 5.0..900f64), paper in papers(), turn in turns(), edge in edges()
        ) {
            let wish = Wish { scaling: Scaling::Fill, turn, ..Wish::default() };
            let found = fit(page, edge, paper, &wish).unwrap();
            let sheet = sheet_mm(paper);
            let (width, length) = found.turn.sides((page.0 * found.scale, page.1 * found.scale));
            let Point(Mm(x), Mm(y)) = found.corner;
            let covers = |at: f64, side: f64, sheet: f64| at <= GRACE && at + side >= sheet - GRACE;
            prop_assert!(covers(x, width, sheet.0) && covers(y, length, sheet.1));
            prop_assert!((width - sheet.0).min(length - sheet.1) < 2.0 * GRACE);
        }

        #[test]
        fn a_page_of_the_sheets_size_is_never_scaled_and_never_shrinks_to_what_it_need_not(
            paper in papers(), off in (-0.99..0.99f64, -0.99..0.99f64), must_fit: bool, across: bool
        ) {
            let sheet = sheet_mm(paper);
            let page = (sheet.0 + off.0, sheet.1 + off.1);
            let page = if across { (page.1, page.0) } else { page };
            let found = fit(page, Edge::Margin, paper, &Wish { must_fit, ..Wish::default() }).unwrap();
            prop_assert_eq!(found.scale, 1.0);
            let lying = found.turn.sides(page);
            prop_assert!((lying.0 - sheet.0).abs() <= 1.0 || (lying.1 - sheet.1).abs() <= 1.0);
        }

        #[test]
        fn what_is_small_enough_for_the_printer_loses_nothing(
            part in (0.05..1.0f64, 0.05..1.0f64), paper in papers(), edge in edges()
        ) {
            let room = Room::of(paper);
            let page = (part.0 * room.printable.0, part.1 * room.printable.1);
            for scaling in [Scaling::Auto, Scaling::AutoFit, Scaling::None] {
                let found = on(paper, page, edge, scaling);
                prop_assert_eq!((found.turn, found.scale), (Turn::None, 1.0));
                let (x, y) = (found.corner.0.0 - room.corner.0, found.corner.1.0 - room.corner.1);
                prop_assert!(x >= -1e-9 && y >= -1e-9);
                prop_assert!(x + page.0 <= room.printable.0 + 1e-9 && y + page.1 <= room.printable.1 + 1e-9);
            }
        }

        #[test]
        fn a_page_on_its_side_is_the_same_page(
            page in (5.0..900f64, 5.0..900f64), paper in papers(), edge in edges(), which in 0..5usize
        ) {
            let (upright, lying) = (page, (page.1, page.0));
            let printable = Room::of(paper).printable;
            let is_square = |sides: (f64, f64)| (sides.0 / sides.1 - 1.0).abs() < 0.01;
            prop_assume!(!is_square(page) && !is_square(printable));
            let scaling = Scaling::ALL[which];
            let [a, b] = [upright, lying].map(|page| on(paper, page, edge, scaling));
            // Only one that fits either way stays as it comes.
            if a.scale != 1.0 || b.scale != 1.0 {
                prop_assert!((a.scale - b.scale).abs() < 1e-9);
                prop_assert!(a.turn != b.turn);
                prop_assert!((a.corner.0.0 - b.corner.0.0).abs() < 1e-9);
            }
        }
    }
}
