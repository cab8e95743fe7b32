//! The options of the print dialog: one table for the printer description that declares them and the filter that applies them.
//!
//! Option strings of the print system are pairs `name=value`, separated by blanks; a value with blanks is quoted or has
//! backslashes; a bare `name` means true and `noname` false.

use std::ops::RangeInclusive;

use inks::InkSet;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Media;

use art::{Finish, GAMMAS, Intent, White};
use halftone::Method;
use press::layout::{Point, Profile};

/// Keywords for the calibration profile of the queue's printer in its description.
pub const OFFSET: &str = "FoilpressOffset";
/// See [`OFFSET`].
pub const FEED: &str = "FoilpressFeed";

/// One option of the dialog.
pub struct DialogOption {
    /// Its keyword.
    pub keyword: &'static str,
    /// The text in the dialog.
    pub text: &'static str,
    /// Keywords and texts of the choices; the first is the default.
    pub choices: Vec<(String, String)>,
    /// A value that is not one of the choices, if the option takes one.
    pub custom: Option<Custom>,
}

/// A value that the user types.
#[derive(Clone, Copy)]
pub struct Custom {
    /// Its name in the printer description.
    pub name: &'static str,
    /// The text in the dialog.
    pub text: &'static str,
    /// What it is, in the middle of a sentence.
    pub is: &'static str,
}

/// Which colours print in inks of their own.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Spots {
    /// Spot colours of the document that name inks.
    Named,
    /// The vendor's reserved colours, too.
    Reserved,
    /// None: everything becomes process inks.
    None,
}

/// Where the drawing goes on its sheet.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Place {
    /// Where the page has it.
    Page,
    /// In the middle of the printable area.
    Centre,
    /// With its top left corner this far from the corner of the sheet.
    At(Point),
}

/// What the user chose.
#[derive(Clone, PartialEq, Debug)]
pub struct Choices {
    /// What the paper is made of.
    pub media: Media,
    /// Whether the printer corrects the sheet's curl.
    pub curl_correction: bool,
    /// The inks of pictures' colours.
    pub colours: InkSet,
    /// Which colours are inks of their own.
    pub spots: Spots,
    /// Colours of the page that stand for inks besides: sRGB as drawn.
    pub inks_of: Vec<(Ink, [u8; 3])>,
    /// Largest difference of red, green and blue from a colour that stands for an ink, if not the usual one.
    pub tolerance: Option<u8>,
    /// Whether foils may be printed.
    pub foils: bool,
    /// Where white is printed.
    pub white: White,
    /// Where finish is printed.
    pub finish: Finish,
    /// Resolution at which the page is rendered, in pixels per inch.
    pub dpi: u16,
    /// How colours that the inks do not reach are replaced.
    pub intent: Intent,
    /// Exponent that brightens colours.
    pub gamma: f64,
    /// How tones become dots.
    pub halftone: Method,
    /// Where the drawing goes on its sheet.
    pub place: Place,
    /// Whether pages are mirrored left to right.
    pub mirror: bool,
    /// Whether the sheet has a custom size, rather than that of the paper nearest to it.
    pub custom_paper: bool,
    /// Calibration profile of the queue's printer.
    pub profile: Profile,
    /// Pages to print, from 1; all if none is named.
    pub pages: Vec<RangeInclusive<usize>>,
    /// The sheet, for documents that have none of their own, such as pictures.
    pub paper: Paper,
    /// What no dialog shows: how often inks are printed, their order, and the like.
    pub more: art::Settings,
}

/// Whether a page, from 1, is among those to print.
pub fn is_chosen(pages: &[RangeInclusive<usize>], page: usize) -> bool {
    pages.is_empty() || pages.iter().any(|range| range.contains(&page))
}

const INKS: [(&str, &str); 3] = [
    ("Colour", "Cyan, magenta, yellow, black"),
    ("Black", "Black only"),
    ("NoBlack", "Cyan, magenta, yellow"),
];

const SPOTS: [(&str, &str, Spots); 3] = [
    ("Named", "Spot colours named after inks", Spots::Named),
    ("Reserved", "Spot colours named after inks, and the vendor's reserved colours", Spots::Reserved),
    ("Off", "None (everything in process inks)", Spots::None),
];

const FOILS: [(&str, &str, bool); 2] =
    [("Off", "Never", false), ("On", "Where the page names them (untested)", true)];

const PLACE: [(&str, &str, Place); 2] =
    [("Page", "As on the page", Place::Page), ("Centre", "Drawing centred on the sheet", Place::Centre)];

const WHITE: [(&str, &str, White); 5] = [
    ("None", "Only where the page names it", White::None),
    ("Under", "Under every ink", White::Under),
    ("Reserved", "Where the page has the reserved white 230,230,230", White::Reserved),
    ("Opaque", "Where the page is not pure white", White::Opaque),
    ("Silhouette", "Everything inside the outline", White::Silhouette),
];

const FINISH: [(&str, &str, Finish); 3] = [
    ("None", "Only where the page names it", Finish::None),
    ("Artwork", "On everything drawn", Finish::Artwork),
    ("All", "On the whole page", Finish::All),
];

const QUALITY: [(&str, &str, u16); 2] =
    [("Normal", "Normal (600 dpi)", 600), ("Draft", "Draft (rendered at 300 dpi)", 300)];

const HALFTONE: [(&str, &str, Method); 4] = [
    ("Fine", "Small clusters, dot by dot", Method::Fine),
    ("Cells", "Compact clusters", Method::Cells),
    ("Best", "Compact clusters, searched (slower)", Method::Best),
    ("Walk", "Runs along a curve", Method::Walk),
];

const INTENT: [(&str, &str, Intent); 3] = [
    ("Auto", "Perceptual for pictures, colorimetric for drawings", Intent::Auto),
    ("Perceptual", "Perceptual (differences survive)", Intent::Perceptual),
    ("Colorimetric", "Colorimetric (printable colours are exact)", Intent::Colorimetric),
];

const GAMMA: [(&str, &str, f64); 3] =
    [("Normal", "Normal (1)", 1.0), ("Lighter", "Lighter (1.3)", 1.3), ("Darker", "Darker (0.8)", 0.8)];

const CURL: [(&str, &str, bool); 2] = [("On", "On (paper)", true), ("Off", "Off (decal film)", false)];

const COLOUR: (&str, &str) = ("None", "None");

const TOLERANCE: (&str, &str) = ("Usual", "As usual (8 for white and black, 12 for others)");

/// `glossy-paper` as a keyword of a printer description: `GlossyPaper`.
fn camel(name: &str) -> String {
    name.split('-').map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect()
}

/// `glossy-paper` as people read it.
fn spaced(name: &str) -> String {
    let text = name.replace('-', " ");
    text[..1].to_ascii_uppercase() + &text[1..]
}

fn texts<'a>(rows: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<(String, String)> {
    rows.map(|(keyword, text)| (keyword.into(), text.into())).collect()
}

/// All options, in the order of the dialog.
pub fn all() -> Vec<DialogOption> {
    let option = |keyword, text, choices| DialogOption { keyword, text, choices, custom: None };
    let mut place = option("FoilpressPosition", "Position", texts(PLACE.iter().map(|row| (row.0, row.1))));
    place.custom = Some(Custom {
        name: "Corner",
        text: "Top left corner of the drawing, such as 20x30mm",
        is: "the top left corner of the drawing, such as 20x30mm",
    });
    let mut gamma = option("FoilpressGamma", "Brightness", texts(GAMMA.iter().map(|row| (row.0, row.1))));
    gamma.custom = Some(Custom {
        name: "Exponent",
        text: "Gamma, 0.2 to 5, such as 1.2",
        is: "a number from 0.2 to 5, such as 1.2",
    });
    let mut colour = option("FoilpressColour", "A colour as an ink", texts([COLOUR].into_iter()));
    colour.custom = Some(Custom {
        name: "Colour",
        text: "Colour and ink, such as #ff0000=gold",
        is: "colours and their inks, such as #ff0000=gold",
    });
    let mut tolerance =
        option("FoilpressTolerance", "Difference from such a colour", texts([TOLERANCE].into_iter()));
    tolerance.custom = Some(Custom {
        name: "Steps",
        text: "Steps of red, green and blue, 0 to 60",
        is: "a number of steps from 0 to 60, such as 12",
    });
    vec![
        option("MediaType", "Media", Media::all().map(|m| (camel(m.name()), spaced(m.name()))).collect()),
        option("FoilpressInks", "Inks for colours", texts(INKS.into_iter())),
        option("FoilpressSpots", "Spot inks", texts(SPOTS.iter().map(|row| (row.0, row.1)))),
        option("FoilpressFoils", "Foils", texts(FOILS.iter().map(|row| (row.0, row.1)))),
        option("FoilpressWhite", "White", texts(WHITE.iter().map(|row| (row.0, row.1)))),
        option("FoilpressFinish", "Glossy finish", texts(FINISH.iter().map(|row| (row.0, row.1)))),
        option("FoilpressQuality", "Quality", texts(QUALITY.iter().map(|row| (row.0, row.1)))),
        option("FoilpressCurl", "Curl correction", texts(CURL.iter().map(|row| (row.0, row.1)))),
        option("FoilpressIntent", "Colours out of reach", texts(INTENT.iter().map(|row| (row.0, row.1)))),
        gamma,
        option("FoilpressHalftone", "Halftone", texts(HALFTONE.iter().map(|row| (row.0, row.1)))),
        place,
        colour,
        tolerance,
    ]
}

/// An option with a value that is not one of its choices.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{option}={found} is not possible; choose {known}")]
pub struct NoChoice {
    /// The option.
    pub option: &'static str,
    /// What was asked for.
    pub found: String,
    /// The choices, in words.
    pub known: String,
}

impl Choices {
    /// The choices of a job: its options override the defaults of the printer description, which override the first choices.
    ///
    /// # Errors
    /// A value in the job's options that is not a choice. Such a value among the defaults is ignored.
    pub fn read(options: &[(String, String)], description: Option<&str>) -> Result<Choices, NoChoice> {
        // The last one wins, as in the print system.
        let asked = |keyword: &str| {
            options.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(keyword)).map(|(_, value)| value)
        };
        let mut numbers = [0; 14];
        let (mut corner, mut exponent, mut inks_of, mut tolerance) = (None, None, Vec::new(), None);
        for (number, option) in numbers.iter_mut().zip(all()) {
            let find = |value: &str| option.choices.iter().position(|c| c.0.eq_ignore_ascii_case(value));
            let usual =
                description.and_then(|text| default_of(text, option.keyword)).and_then(find).unwrap_or(0);
            let Some(value) = asked(option.keyword) else {
                *number = usual;
                continue;
            };
            match find(value) {
                Some(choice) => *number = choice,
                None if option.keyword == "FoilpressPosition" => corner = Some(read_corner(&option, value)?),
                None if option.keyword == "FoilpressGamma" => exponent = Some(read_gamma(&option, value)?),
                None if option.keyword == "FoilpressColour" => inks_of = read_colours(&option, value)?,
                None if option.keyword == "FoilpressTolerance" => {
                    tolerance = Some(read_steps(&option, value)?)
                }
                None => return Err(option.no_choice(value)),
            }
        }
        let [media, inks, spots, foils, white, finish, quality, curl, intent, gamma, halftone, place, ..] =
            numbers;
        let process = InkSet::of([Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black]);
        let is_custom = |keyword: &str| {
            asked(keyword).is_some_and(|value| value.to_ascii_lowercase().starts_with("custom."))
        };
        Ok(Choices {
            media: Media::all().nth(media).unwrap_or_default(),
            curl_correction: CURL[curl].2,
            colours: match inks {
                0 => process,
                1 => InkSet::of([Ink::Black]),
                _ => InkSet::of([Ink::Cyan, Ink::Magenta, Ink::Yellow]),
            },
            spots: SPOTS[spots].2,
            inks_of,
            tolerance,
            foils: FOILS[foils].2,
            white: WHITE[white].2,
            finish: FINISH[finish].2,
            dpi: QUALITY[quality].2,
            intent: INTENT[intent].2,
            gamma: exponent.unwrap_or(GAMMA[gamma].2),
            halftone: HALFTONE[halftone].2,
            place: corner.map_or(PLACE[place].2, Place::At),
            mirror: ["MirrorPrint", "mirror"]
                .into_iter()
                .any(|keyword| asked(keyword).is_some_and(|value| value.eq_ignore_ascii_case("true"))),
            custom_paper: ["PageSize", "media"].into_iter().any(is_custom),
            profile: description.map_or_else(Profile::default, profile_in),
            pages: Vec::new(),
            paper: Paper::A4,
            more: art::Settings { inks: InkSet::of(Ink::ALL), ..art::Settings::default() },
        })
    }
}

impl DialogOption {
    fn no_choice(&self, found: &str) -> NoChoice {
        let mut known: Vec<&str> = self.choices.iter().map(|choice| choice.0.as_str()).collect();
        known.extend(self.custom.map(|custom| custom.is));
        let last = known.pop().unwrap_or_default();
        let known = if known.is_empty() { last.into() } else { format!("{} or {last}", known.join(", ")) };
        NoChoice { option: self.keyword, found: found.into(), known }
    }
}

/// A value as dialogs write it, `Custom.20x30mm`, or as people do, `20x30mm`.
fn bare(value: &str) -> &str {
    match value.get(..7) {
        Some(head) if head.eq_ignore_ascii_case("custom.") => &value[7..],
        _ => value,
    }
}

fn read_corner(option: &DialogOption, value: &str) -> Result<Point, NoChoice> {
    bare(value).parse().map_err(|_| option.no_choice(value))
}

fn read_gamma(option: &DialogOption, value: &str) -> Result<f64, NoChoice> {
    bare(value).parse().ok().filter(|gamma| GAMMAS.contains(gamma)).ok_or_else(|| option.no_choice(value))
}

/// Colours and their inks, by the rules of `foilpress layers --colour`.
fn read_colours(option: &DialogOption, value: &str) -> Result<Vec<(Ink, [u8; 3])>, NoChoice> {
    let read = bare(value).split(',').map(art::names::colour).collect::<Result<Vec<_>, _>>();
    read.ok().filter(|read| art::names::wrong_colours(read).is_none()).ok_or_else(|| option.no_choice(value))
}

fn read_steps(option: &DialogOption, value: &str) -> Result<u8, NoChoice> {
    bare(value)
        .parse()
        .ok()
        .filter(|steps| art::TOLERANCES.contains(steps))
        .ok_or_else(|| option.no_choice(value))
}

/// `*DefaultKEYWORD: value` in a printer description.
fn default_of<'a>(description: &'a str, keyword: &str) -> Option<&'a str> {
    description.lines().find_map(|line| {
        Some(line.strip_prefix("*Default")?.strip_prefix(keyword)?.strip_prefix(':')?.trim())
    })
}

/// The calibration profile in a printer description; values out of range are ignored.
pub fn profile_in(description: &str) -> Profile {
    let numbers = |keyword: &str| -> Option<Vec<f64>> {
        let value = description
            .lines()
            .find_map(|line| line.strip_prefix('*')?.strip_prefix(keyword)?.strip_prefix(':'))?;
        value.trim().trim_matches('"').split_whitespace().map(|number| number.parse().ok()).collect()
    };
    let mut profile = Profile::default();
    if let Some(&[x, y]) = numbers(OFFSET).as_deref() {
        profile.offset_mm = [x, y];
    }
    if let Some(&[feed]) = numbers(FEED).as_deref() {
        profile.feed = feed;
    }
    if profile.problem().is_some() { Profile::default() } else { profile }
}

/// Reads an option string of the print system.
pub fn parse(text: &str) -> Vec<(String, String)> {
    let mut options = Vec::new();
    let mut rest = text.chars().peekable();
    loop {
        while rest.next_if(|c| c.is_whitespace()).is_some() {}
        let mut name = String::new();
        while let Some(c) = rest.next_if(|&c| c != '=' && !c.is_whitespace()) {
            name.push(c);
        }
        if name.is_empty() && rest.next_if_eq(&'=').is_none() {
            return options;
        }
        if rest.next_if_eq(&'=').is_none() {
            options.push(match name.strip_prefix("no") {
                Some(negated) if !negated.is_empty() => (negated.into(), "false".into()),
                _ => (name, "true".into()),
            });
            continue;
        }
        let (mut value, mut quote) = (String::new(), None);
        while let Some(c) = rest.next_if(|&c| quote.is_some() || !c.is_whitespace()) {
            match (c, quote) {
                ('\\', _) => value.extend(rest.next()),
                (c, Some(open)) if c == open => quote = None,
                ('"' | '\'', None) => quote = Some(c),
                (c, _) => value.push(c),
            }
        }
        options.push((name, value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pair(name: &str, value: &str) -> (String, String) {
        (name.into(), value.into())
    }

    #[test]
    fn an_option_string_is_read_as_the_print_system_writes_it() {
        let read = parse(
            r#"media=A4 job-uuid=urn:uuid:1-2 title='a "b" c' path=x\ y\\z nocollate fit-to-page k="v w""#,
        );
        assert_eq!(
            read,
            [
                pair("media", "A4"),
                pair("job-uuid", "urn:uuid:1-2"),
                pair("title", r#"a "b" c"#),
                pair("path", r"x y\z"),
                pair("collate", "false"),
                pair("fit-to-page", "true"),
                pair("k", "v w"),
            ]
        );
        assert!(parse("  ").is_empty());
    }

    #[test]
    fn the_job_overrides_the_queue_and_the_queue_overrides_the_defaults() {
        let usual = Choices::read(&[], None).unwrap();
        assert_eq!(
            (usual.media, usual.white, usual.dpi, usual.spots),
            (Media::Plain, White::None, 600, Spots::Named)
        );
        let description =
            "*DefaultMediaType: GlossyPaper\n*DefaultFoilpressWhite: Under\n*DefaultFoilpressCurl: Nonsense";
        let queue = Choices::read(&[], Some(description)).unwrap();
        assert_eq!(
            (queue.media, queue.white, queue.curl_correction),
            (Media::GlossyPaper, White::Under, true)
        );
        let job =
            [pair("FoilpressWhite", "Opaque"), pair("mediatype", "cardboard"), pair("FoilpressCurl", "off")];
        let job = Choices::read(&job, Some(description)).unwrap();
        assert_eq!((job.media, job.white, job.curl_correction), (Media::Cardboard, White::Opaque, false));
    }

    #[test]
    fn a_position_is_read_as_dialogs_and_as_people_write_it() {
        let place = |value: &str| Choices::read(&[pair("FoilpressPosition", value)], None).map(|c| c.place);
        let at = Ok(Place::At("20x30mm".parse().unwrap()));
        assert_eq!(place("Custom.20x30mm"), at);
        assert_eq!(place("20x30mm"), at);
        assert_eq!(place("centre"), Ok(Place::Centre));
        assert_eq!(Choices::read(&[], None).unwrap().place, Place::Page);
        let error = place("left").unwrap_err().to_string();
        assert!(error.contains("Centre") && error.contains("20x30mm"), "{error}");
    }

    #[test]
    fn a_gamma_is_a_word_or_a_number_in_its_range() {
        let gamma = |value: &str| Choices::read(&[pair("FoilpressGamma", value)], None).map(|c| c.gamma);
        assert_eq!((gamma("Lighter"), gamma("1.7"), gamma("Custom.0.5")), (Ok(1.3), Ok(1.7), Ok(0.5)));
        for wrong in ["0", "NaN", "-1", "inf", "9"] {
            let said = gamma(wrong).unwrap_err().to_string();
            let end = "choose Normal, Lighter, Darker or a number from 0.2 to 5, such as 1.2";
            assert!(said.starts_with(&format!("FoilpressGamma={wrong} ")) && said.ends_with(end), "{said}");
        }
    }

    #[test]
    fn a_value_that_is_not_a_choice_is_answered_with_the_choices() {
        let error = Choices::read(&[pair("FoilpressWhite", "Beneath")], None).unwrap_err().to_string();
        assert!(
            error.contains("FoilpressWhite") && error.contains("Beneath") && error.contains("Silhouette"),
            "{error}"
        );
    }

    #[test]
    fn colours_and_steps_that_cannot_be_are_answered_with_what_can() {
        for wrong in ["red=gold", "#ff0000", "#ff0000=jam", "#ffffff=gold", "#ff0000=gold,#ff0000=white"] {
            let error = Choices::read(&[pair("FoilpressColour", wrong)], None).unwrap_err().to_string();
            assert!(
                error.ends_with("choose None or colours and their inks, such as #ff0000=gold"),
                "{error}"
            );
        }
        for wrong in ["61", "-1", "many"] {
            assert!(Choices::read(&[pair("FoilpressTolerance", wrong)], None).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_choice_can_be_asked_for_and_keywords_differ() {
        for option in all() {
            for (i, (keyword, text)) in option.choices.iter().enumerate() {
                assert!(keyword.bytes().all(|b| b.is_ascii_alphanumeric()) && !text.is_empty());
                assert!(option.choices[..i].iter().all(|other| !other.0.eq_ignore_ascii_case(keyword)));
                Choices::read(&[pair(option.keyword, keyword)], None).unwrap();
            }
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_to_its_end(text in ".{0,80}") {
            parse(&text);
        }

        #[test]
        fn a_quoted_value_comes_back(value in "[ -~]{0,20}") {
            let quoted: String = value.chars().flat_map(|c| match c {
                '\\' | '"' => vec!['\\', c],
                c => vec![c],
            }).collect();
            prop_assert_eq!(parse(&format!("a=\"{quoted}\" b=1")), [pair("a", &value), pair("b", "1")]);
        }
    }
}
