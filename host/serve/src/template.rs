//! What a job may ask for: sheets, and the attributes of [`make::options::PAGE`].
//!
//! Problem: dialogs show size, type of sheet, quality, colour and copies, and nothing else; white, finish and spot colours are invisible
//! to them. Method: those are a preset's, and each preset is a printer of its own; what dialogs show changes the preset's choices.
//! A value that the table has no row for, such as `auto`, is the preset's own.
//! Limits: a sheet has one side and no finishings.
//! Source: RFC 8011, section 5.2; PWG 5100.3, 5100.7 and 5101.1.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use ipp::value::IppValue;
use protocol::ink::Ink;
use protocol::paper::Paper;
use serde::{Deserialize, Serialize};

use crate::values::{each, read_text};
use make::options::{Choices, PAGE, of_attribute};
use press::layout::fit::{Scaling, Wish};
use press::layout::paper::{custom_margins, custom_range, sheet_mm, table};
use press::layout::{Mm, Point};
use queue::ppd::paper_of;
use sheet::Turn;

/// The sheets that have a name in the printer's table, too.
const SHEETS: [(&str, Paper); 6] = [
    ("iso_a4_210x297mm", Paper::A4),
    ("na_letter_8.5x11in", Paper::Letter),
    ("na_legal_8.5x14in", Paper::Legal),
    ("na_executive_7.25x10.5in", Paper::Executive),
    ("jis_b5_182x257mm", Paper::B5),
    ("jpn_hagaki_100x148mm", Paper::Postcard),
];

/// The type of sheet that a preset has.
pub const AUTO: &str = "auto";

/// `print-quality`: drafts are drawn at half the resolution, the best halftone searches.
pub const QUALITIES: [i32; 3] = [3, 4, 5];
/// What each attribute of a keyword may also be, which leaves the preset as it is; first those of the preset,
/// then what the table has.
const OWN: [(&str, &[&str]); 4] = [
    ("print-content-optimize", &[AUTO]),
    ("print-rendering-intent", &[AUTO]),
    ("print-color-mode", &[AUTO, "color"]),
    ("media-type", &[]),
];

/// What an attribute may be, by keywords.
pub fn supported(attribute: &str) -> impl Iterator<Item = &'static str> {
    let own = OWN.into_iter().find(|(known, _)| *known == attribute).map_or(&[][..], |row| row.1);
    own.iter().copied().chain(of_attribute(attribute).map(|(keyword, _)| keyword))
}

/// The most ranges of pages that somebody types.
const MOST_RANGES: usize = 100;
/// Farther than any sheet reaches, in millimetres.
const MOST_MM: f64 = 10_000.0;

/// The most copies.
pub const MOST_COPIES: i32 = 99;
/// Resolutions of the drawing.
pub const RESOLUTIONS: [u16; 2] = [300, 600];
/// Attributes that have one possible value.
const FIXED: [(&str, &str); 5] = [
    ("sides", "one-sided"),
    ("output-bin", "face-up"),
    ("job-sheets", "none"),
    ("media-source", "main"),
    ("multiple-document-handling", "separate-documents-uncollated-copies"),
];

/// `orientation-requested`, with the turns that it means; without one the page lies as it fits.
pub const ORIENTATIONS: [(i32, Option<Turn>); 5] = [
    (3, Some(Turn::None)),
    (4, Some(Turn::Left)),
    (5, Some(Turn::Right)),
    (6, Some(Turn::Half)),
    (NO_ORIENTATION, None),
];
/// The one that means none.
pub const NO_ORIENTATION: i32 = 7;

/// `overrides-supported`: what an override may name. What it would change is not among it, so it changes nothing.
pub const OVERRIDES: [&str; 2] = ["document-number", "pages"];

/// Width and length of a sheet in hundredths of a millimetre, as IPP counts.
pub type Size = (i32, i32);

/// The sheet that is in the printer, as somebody has said.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Loaded {
    /// Its size.
    pub size: Size,
    /// What it is made of; [`AUTO`] for what the preset says.
    pub kind: String,
}

/// A length in millimetres, in hundredths of one.
pub(crate) fn hundredths(mm: f64) -> i32 {
    // Sheets are less than half a metre.
    #[expect(clippy::cast_possible_truncation, reason = "within the size of a sheet")]
    let number = (mm * 100.0).round() as i32;
    number
}

/// The sheets with a name, by the names of PWG 5101.1: those, and the most usual one of photographs.
pub fn sheets() -> impl Iterator<Item = (&'static str, Size)> {
    let photo = ("na_index-4x6_4x6in", (10160, 15240));
    SHEETS.into_iter().map(|(keyword, paper)| (keyword, size(paper))).chain([photo])
}

/// A length of hundredths of a millimetre.
fn mm(hundredths: i32) -> Mm {
    Mm(f64::from(hundredths) / 100.0)
}

/// The size of a paper.
pub fn size(paper: Paper) -> Size {
    let (width, length) = sheet_mm(paper);
    (hundredths(width), hundredths(length))
}

/// Margins of a paper: left, top, right, bottom.
pub fn margins(paper: Paper) -> [i32; 4] {
    match table().find(|known| known.name == paper.name()) {
        Some(known) => known.margins_mm.map(hundredths),
        None => custom_margins().map(|margin| hundredths(margin.0)),
    }
}

/// The smallest and the largest sheet without a name.
pub fn sizes() -> (Size, Size) {
    let (least, most) = custom_range();
    let size = |point: press::layout::Point| (hundredths(point.0.0), hundredths(point.1.0));
    (size(least), size(most))
}

/// The paper of a sheet of this size.
pub fn paper(size: Size) -> Option<Paper> {
    let mm = |side: i32| f64::from(side) / 100.0;
    paper_of(mm(size.0), mm(size.1), false).ok()
}

/// The keyword of a sheet of this size.
pub fn keyword_of(sheet: Size) -> String {
    match sheets().find(|(_, size)| *size == sheet) {
        Some((keyword, _)) => keyword.into(),
        None => {
            let mm = |side: i32| {
                let text = format!("{}.{:02}", side / 100, side % 100);
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            };
            format!("custom_{0}x{1}mm_{0}x{1}mm", mm(sheet.0), mm(sheet.1))
        }
    }
}

/// A sheet of this size, for people: its name, or its sides.
pub fn label(sheet: Size) -> String {
    match paper(sheet) {
        Some(paper) if !matches!(paper, Paper::Custom { .. }) => paper.name().into(),
        _ => format!("{} x {} mm", f64::from(sheet.0) / 100.0, f64::from(sheet.1) / 100.0),
    }
}

/// The size that a keyword names: one of [`sheets`], or the size at its end, such as `na_5x7_5x7in`.
pub fn size_of(keyword: &str) -> Option<Size> {
    if let Some((_, size)) = sheets().find(|(known, _)| *known == keyword) {
        return Some(size);
    }
    let last = keyword.rsplit('_').next()?;
    let (sides, unit) = match (last.strip_suffix("mm"), last.strip_suffix("in")) {
        (Some(sides), _) => (sides, 1.0),
        (None, Some(sides)) => (sides, 25.4),
        (None, None) => return None,
    };
    let (width, length) = sides.split_once('x')?;
    let side = |text: &str| text.parse::<f64>().ok().filter(|side| (0.0..1000.0).contains(side));
    Some((hundredths(side(width)? * unit), hundredths(side(length)? * unit)))
}

/// What a job asks for.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Ticket {
    /// Sheets of each page.
    pub copies: u32,
    /// The sheet.
    pub size: Option<Size>,
    /// What it is made of, by its keyword.
    pub kind: Option<String>,
    /// `print-quality`.
    pub quality: Option<i32>,
    /// `print-content-optimize`.
    pub content: Option<String>,
    /// `print-rendering-intent`.
    pub intent: Option<String>,
    /// `print-color-mode`.
    pub colour: Option<String>,
    /// `print-scaling`.
    pub scaling: Option<Scaling>,
    /// `orientation-requested`.
    pub orientation: Option<i32>,
    /// `ipp-attribute-fidelity`: whether a page smaller than the sheet is fitted, too.
    pub must_fit: bool,
    /// Pages to print, from 1.
    pub pages: Vec<(i32, i32)>,
    /// Whether it waits until it is released.
    pub held: bool,
    /// Where the page's corner goes, from that of the sheet, in hundredths of a millimetre.
    pub at: Option<(i32, i32)>,
    /// How wide it is as it lies, in hundredths of a millimetre.
    pub wide: Option<u32>,
    /// Passes of white.
    pub white_passes: Option<u8>,
    /// What no dialog shows, by the keywords of [`make::options::PAGE`] and their values.
    pub own: BTreeMap<String, String>,
}

impl Default for Ticket {
    fn default() -> Ticket {
        Ticket {
            copies: 1,
            size: None,
            kind: None,
            quality: None,
            content: None,
            intent: None,
            colour: None,
            scaling: None,
            orientation: None,
            must_fit: false,
            pages: Vec::new(),
            held: false,
            at: None,
            wide: None,
            white_passes: None,
            own: BTreeMap::new(),
        }
    }
}

impl Ticket {
    /// Takes an attribute whose values are words, or an enum whose number is written as one; false if it or
    /// its value is not possible here.
    pub fn ask(&mut self, attribute: &str, word: &str) -> bool {
        if attribute == "print-quality" {
            let found = word.parse().ok().filter(|quality| QUALITIES.contains(quality));
            self.quality = found.or(self.quality);
            return found.is_some();
        }
        if attribute == "print-scaling" {
            let found = Scaling::ALL.into_iter().find(|scaling| scaling.name() == word);
            self.scaling = found.or(self.scaling);
            return found.is_some();
        }
        let place = match attribute {
            "media-type" => &mut self.kind,
            "print-content-optimize" => &mut self.content,
            "print-rendering-intent" => &mut self.intent,
            "print-color-mode" => &mut self.colour,
            _ => return false,
        };
        let fits = word == AUTO || supported(attribute).any(|known| known == word);
        if fits {
            *place = Some(word.into());
        }
        fits
    }

    /// Takes one attribute of a job; false if it or its value is not possible here.
    pub fn take(&mut self, name: &str, value: &IppValue) -> bool {
        let word = || read_text(value);
        match (name, value) {
            ("copies", IppValue::Integer(copies)) => match u32::try_from(*copies) {
                Ok(number @ 1..) if *copies <= MOST_COPIES => {
                    self.copies = number;
                    true
                }
                _ => false,
            },
            ("media", _) => match word().as_deref().and_then(size_of).filter(|&size| paper(size).is_some()) {
                Some(size) => {
                    self.size = Some(size);
                    true
                }
                None => false,
            },
            ("media-col", IppValue::Collection(members)) => members.iter().all(|(member, value)| {
                match (member.as_str(), value) {
                    ("media-size", IppValue::Collection(sides)) => {
                        let side = |name: &str| {
                            sides.iter().find_map(|(member, value)| match value {
                                IppValue::Integer(side) if member.as_str() == name => Some(*side),
                                _ => None,
                            })
                        };
                        let found = side("x-dimension").zip(side("y-dimension"));
                        let found = found.filter(|&size| paper(size).is_some());
                        self.size = found.or(self.size);
                        found.is_some()
                    }
                    ("media-size-name", value) => self.take("media", value),
                    ("media-type", value) => self.take("media-type", value),
                    // What the printer itself decides, and what no sheet is told apart by.
                    _ => true,
                }
            }),
            (
                "media-type"
                | "print-content-optimize"
                | "print-rendering-intent"
                | "print-color-mode"
                | "print-scaling",
                _,
            ) => word().is_some_and(|word| self.ask(name, &word)),
            ("orientation-requested", IppValue::Enum(asked)) => {
                let found = ORIENTATIONS.iter().any(|(known, _)| known == asked);
                if found {
                    self.orientation = Some(*asked);
                }
                found
            }
            ("print-quality", IppValue::Enum(quality)) => self.ask(name, &quality.to_string()),
            ("page-ranges", _) => each(value).iter().all(|range| match range {
                IppValue::RangeOfInteger { min, max } if 1 <= *min && min <= max => {
                    self.pages.push((*min, *max));
                    true
                }
                _ => false,
            }),
            ("job-hold-until", _) => match word().as_deref() {
                Some("no-hold") => true,
                Some("indefinite") => {
                    self.held = true;
                    true
                }
                _ => false,
            },
            ("finishings", value) => *value == IppValue::Enum(3),
            ("number-up", value) => *value == IppValue::Integer(1),
            ("job-priority", value) => matches!(value, IppValue::Integer(1..=100)),
            ("printer-resolution", IppValue::Resolution { cross_feed, feed, units: 3 }) => {
                cross_feed == feed && RESOLUTIONS.iter().any(|&known| i32::from(known) == *feed)
            }
            // Pages can be named, and nothing be asked of them.
            ("overrides", value) => each(value).iter().all(|one| match one {
                IppValue::Collection(members) => {
                    members.iter().all(|(member, _)| OVERRIDES.contains(&member.as_str()))
                }
                _ => false,
            }),
            _ => FIXED.iter().any(|&(known, only)| known == name && word().as_deref() == Some(only)),
        }
    }

    /// The same where what is not asked for is the loaded sheet's, as the printer's attributes promise.
    #[must_use]
    pub fn on(self, loaded: &Loaded) -> Ticket {
        let kind = self.kind.or_else(|| Some(loaded.kind.clone()));
        Ticket { size: self.size.or(Some(loaded.size)), kind, ..self }
    }

    /// Pages to print, from 1; all if none is named.
    pub fn pages(&self) -> Vec<RangeInclusive<usize>> {
        let page = |number: i32| usize::try_from(number).unwrap_or(usize::MAX);
        self.pages.iter().map(|&(from, to)| page(from)..=page(to)).collect()
    }

    /// Somebody changes one thing at the desk, by its name there; nothing for the value that is usual.
    ///
    /// # Errors
    /// In words: no such thing, or a value that it cannot have.
    pub fn change(&mut self, name: &str, value: &str) -> Result<(), String> {
        let wrong = |expected: &str| format!("{name}: expected {expected}, not `{value}`");
        let hundredths_of = |text: &str| {
            let number = text.trim().parse::<f64>().ok().filter(|mm| mm.abs() <= MOST_MM);
            number.map(hundredths)
        };
        match name {
            "scaling" => {
                let known = self.ask("print-scaling", value);
                self.wide = None;
                if !known {
                    return Err(wrong("auto, fit, fill or none"));
                }
            }
            "wide" => {
                let wide = hundredths_of(value).and_then(|wide| u32::try_from(wide).ok());
                self.wide = Some(wide.filter(|wide| *wide > 0).ok_or_else(|| wrong("millimetres"))?);
            }
            "at" if value.is_empty() => self.at = None,
            "at" => {
                let two = value.split_once(',');
                let at = two.and_then(|(x, y)| Some((hundredths_of(x)?, hundredths_of(y)?)));
                self.at = Some(at.ok_or_else(|| wrong("two numbers of millimetres, such as 20,35.5"))?);
            }
            "orientation" => {
                let known = value.parse().ok().filter(|asked| ORIENTATIONS.iter().any(|(o, _)| o == asked));
                self.orientation = Some(known.ok_or_else(|| wrong("a number from 3 to 7"))?);
            }
            "copies" => {
                let most = u32::try_from(MOST_COPIES).unwrap_or(u32::MAX);
                let copies = value.parse().ok().filter(|copies| (1..=most).contains(copies));
                self.copies = copies.ok_or_else(|| wrong(&format!("a number from 1 to {MOST_COPIES}")))?;
            }
            "pages" => {
                let range = |text: &str| {
                    let (from, to) = text.split_once('-').unwrap_or((text, text));
                    let (from, to) = (from.trim().parse().ok()?, to.trim().parse().ok()?);
                    (1 <= from && from <= to).then_some((from, to))
                };
                let pages = value.split(',').filter(|text| !text.trim().is_empty()).map(range);
                let pages: Option<Vec<(i32, i32)>> = pages.take(MOST_RANGES).collect();
                self.pages = pages.ok_or_else(|| wrong("pages, such as 1-3,7"))?;
            }
            "quality" if value.is_empty() => self.quality = None,
            "quality" if !self.ask("print-quality", value) => return Err(wrong("3, 4 or 5")),
            "quality" => {}
            "white-passes" if value.is_empty() => self.white_passes = None,
            "white-passes" => {
                let passes = value.parse().ok().filter(|passes| (1..=9).contains(passes));
                self.white_passes = Some(passes.ok_or_else(|| wrong("a number from 1 to 9"))?);
            }
            _ => {
                let option = PAGE.iter().find(|option| option.keyword == name);
                let option = option.ok_or_else(|| format!("there is no such option: {name}"))?;
                if value.is_empty() {
                    self.own.remove(name);
                } else {
                    option
                        .choose(value, &mut Choices::default())
                        .ok_or_else(|| wrong("one of its values"))?;
                    self.own.insert(name.into(), value.into());
                }
            }
        }
        Ok(())
    }

    /// What a preset's printer draws for this job.
    pub fn choices(&self, preset: &Choices) -> Choices {
        let mut choices = preset.clone();
        let quality = self.quality.map(|quality| quality.to_string());
        // The rendering intent has the last word on colours.
        let asked = [
            ("media-type", &self.kind),
            ("print-quality", &quality),
            ("print-content-optimize", &self.content),
            ("print-rendering-intent", &self.intent),
            ("print-color-mode", &self.colour),
        ];
        for (attribute, word) in asked {
            let word = word.as_deref();
            if let Some((_, value)) = of_attribute(attribute).find(|(keyword, _)| Some(*keyword) == word) {
                (value.set)(&mut choices);
            }
        }
        for (keyword, value) in &self.own {
            // What is not known any more is left as the preset has it.
            let _ =
                PAGE.iter().find(|option| option.keyword == keyword).map(|o| o.choose(value, &mut choices));
        }
        if let Some(passes) = self.white_passes {
            choices.more.passes.retain(|(ink, _)| *ink != Ink::White);
            choices.more.passes.push((Ink::White, passes));
        }
        let turn = |asked| ORIENTATIONS.iter().find(|(known, _)| *known == asked).and_then(|(_, turn)| *turn);
        let usual = preset.fit.unwrap_or_default();
        choices.fit = Some(Wish {
            scaling: self.wide.map_or(self.scaling.unwrap_or(usual.scaling), Scaling::Wide),
            corner: self.at.map(|(x, y)| Point(mm(x), mm(y))).or(usual.corner),
            turn: self.orientation.map_or(usual.turn, turn),
            must_fit: self.must_fit,
        });
        choices.pages = self.pages();
        if let Some(paper) = self.size.and_then(paper) {
            choices.paper = paper;
        }
        choices
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::{collection, keyword};
    use art::{Intent, White};
    use halftone::Method;
    use inks::InkSet;
    use protocol::rgl::Media;

    #[test]
    fn a_sheet_comes_back_from_its_keyword_and_has_the_margins_of_its_own() {
        for (keyword, paper) in SHEETS {
            assert_eq!(size_of(keyword).and_then(super::paper), Some(paper));
            assert_eq!(keyword_of(size(paper)), keyword);
            // The size in the name is the size of the sheet.
            let bare = format!("custom_x_{}", keyword.rsplit('_').next().unwrap());
            let named = size_of(&bare).unwrap();
            assert!(
                named.0.abs_diff(size(paper).0) <= 5 && named.1.abs_diff(size(paper).1) <= 5,
                "{keyword}"
            );
        }
        assert_eq!(margins(Paper::A4), [339, 1202, 341, 1523]);
        assert!(margins(Paper::Postcard)[1] < 310);
        let index = size_of("na_index-4x6_4x6in").unwrap();
        assert_eq!(index, (10160, 15240));
        assert_eq!(keyword_of(index), "na_index-4x6_4x6in");
        let photo = size_of("na_5x7_5x7in").unwrap();
        assert_eq!(keyword_of(photo), "custom_127x177.8mm_127x177.8mm");
        assert_eq!(size_of(&keyword_of(photo)), Some(photo));
        for wrong in ["", "a4", "x_1e9x2mm", "x_-1x2mm", "x_NaNx2mm"] {
            assert_eq!(size_of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn what_a_dialog_asks_changes_the_preset_and_nothing_else() {
        let preset = Choices { white: White::Under, ..Choices::default() };
        let mut ticket = Ticket::default();
        let given = Choices { fit: Some(Wish::default()), ..preset.clone() };
        assert_eq!(ticket.choices(&preset), given);
        let size = collection([
            ("x-dimension", IppValue::Integer(10000)),
            ("y-dimension", IppValue::Integer(14800)),
        ]);
        assert!(
            ticket.take("media-col", &collection([("media-size", size), ("media-type", keyword("film"))]))
        );
        assert!(ticket.take("print-quality", &IppValue::Enum(5)));
        assert!(ticket.take("print-color-mode", &keyword("monochrome")));
        assert!(ticket.take("print-content-optimize", &keyword("photo")));
        assert!(ticket.take("page-ranges", &IppValue::RangeOfInteger { min: 2, max: 3 }));
        assert!(ticket.take("print-scaling", &keyword("fill")));
        assert!(ticket.take("orientation-requested", &IppValue::Enum(5)));
        let asked = ticket.choices(&preset);
        let expected = Choices {
            media: Media::Plain,
            curl_correction: false,
            halftone: Method::Best,
            colours: InkSet::of([Ink::Black]),
            intent: Intent::Perceptual,
            pages: vec![2..=3],
            paper: Paper::Postcard,
            fit: Some(Wish { scaling: Scaling::Fill, turn: Some(Turn::Right), ..Wish::default() }),
            ..preset
        };
        assert_eq!(asked, expected);
    }

    #[test]
    fn what_is_changed_at_the_desk_is_drawn() {
        let mut ticket = Ticket::default();
        for (name, value) in [
            ("wide", "85.5"),
            ("at", "20, 35.25"),
            ("orientation", "4"),
            ("copies", "3"),
            ("pages", "1-2, 5"),
            ("white-passes", "2"),
            ("FoilpressWhite", "Under"),
            ("MirrorPrint", "True"),
        ] {
            ticket.change(name, value).unwrap();
        }
        let more = art::Settings { passes: vec![(Ink::White, 2)], ..Choices::default().more };
        let expected = Choices {
            white: White::Under,
            mirror: true,
            pages: vec![1..=2, 5..=5],
            fit: Some(Wish {
                scaling: Scaling::Wide(8550),
                turn: Some(Turn::Left),
                corner: Some(Point(Mm(20.0), Mm(35.25))),
                must_fit: false,
            }),
            more,
            ..Choices::default()
        };
        assert_eq!((ticket.copies, ticket.choices(&Choices::default())), (3, expected));
        for (name, value) in [
            ("scaling", "huge"),
            ("wide", "-3"),
            ("at", "20"),
            ("at", "1e9,0"),
            ("orientation", "9"),
            ("copies", "0"),
            ("pages", "3-2"),
            ("white-passes", "10"),
            ("FoilpressWhite", "Everywhere"),
            ("colour", "red"),
        ] {
            assert!(ticket.clone().change(name, value).is_err(), "{name} {value}");
        }
        for name in ["at", "white-passes", "FoilpressWhite", "MirrorPrint", "pages"] {
            ticket.change(name, "").unwrap();
        }
        ticket.change("scaling", "auto").unwrap();
        let plain =
            Ticket { copies: 3, orientation: Some(4), scaling: Some(Scaling::Auto), ..Ticket::default() };
        assert_eq!(ticket, plain);
    }

    #[test]
    fn what_is_not_possible_is_said_and_changes_nothing() {
        let mut ticket = Ticket::default();
        // An override of pages that changes nothing is possible, and one that changes anything is not.
        let pages = || ("pages", IppValue::RangeOfInteger { min: 1, max: 2 });
        assert!(ticket.take("overrides", &collection([pages()])));
        assert!(!ticket.take("overrides", &collection([pages(), ("media-type", keyword("film"))])));
        assert!(!ticket.take("overrides", &keyword("pages")));
        for (name, value) in [
            ("copies", IppValue::Integer(0)),
            ("copies", IppValue::Integer(100)),
            ("copies", keyword("two")),
            ("media", keyword("iso_a0_841x1189mm")),
            ("media-type", keyword("gold-leaf")),
            ("print-quality", IppValue::Enum(9)),
            ("sides", keyword("two-sided-long-edge")),
            ("page-ranges", IppValue::RangeOfInteger { min: 3, max: 2 }),
            ("orientation-requested", IppValue::Enum(8)),
            ("print-scaling", keyword("shrink")),
            ("wallpaper", keyword("yes")),
        ] {
            assert!(!ticket.take(name, &value), "{name}");
        }
        assert!(ticket.take("sides", &keyword("one-sided")));
        assert_eq!(ticket, Ticket::default());
    }
}
