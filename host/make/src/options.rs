//! What can be chosen for a page: one table for the command line, the description of a print queue and the
//! print server.
//!
//! Problem: the same wish is typed on a command line, picked in a dialog, and sent as an attribute over the
//! network, and has to mean the same. Method: [`PAGE`] has a row for each option: its name on each door, its
//! words, and its values. A value has its names on each door and sets what it means in the [`Choices`]. A
//! door shows the values that have a name there, and looks them up by it; the first that a dialog shows is
//! the dialog's default. Limits: what is typed freely (a colour, a length) is read by one function for all
//! doors. Source: of the attributes, RFC 8011 section 5.2, PWG 5100.3, 5100.7 and 5101.1.

use std::ops::RangeInclusive;

use art::{Finish, GAMMAS, Intent, TOLERANCES, White};
use halftone::Method;
use inks::InkSet;
use press::layout::fit::Wish;
use press::layout::{Point, Profile};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;
use protocol::rgl::Media;

/// An option of a page.
pub struct PageOption {
    /// The long option of the command line; empty if it has none.
    pub name: &'static str,
    /// Its help there.
    pub help: &'static str,
    /// What `--help` says beside it; may be empty.
    pub more: &'static str,
    /// The keyword in the description of a queue.
    pub keyword: &'static str,
    /// The text in its dialog.
    pub text: &'static str,
    /// Its values.
    pub values: &'static [Value],
    /// What can be typed beside them.
    pub custom: Option<Custom>,
}

/// A value of an option.
pub struct Value {
    /// Its name on the command line; empty if it cannot be typed there.
    pub name: &'static str,
    /// Its help there; may be empty.
    pub help: &'static str,
    /// Its keyword in the description of a queue and the text in the dialog; empty if it is not in one.
    pub dialog: (&'static str, &'static str),
    /// Attributes of a print server's job, and their values, that ask for it.
    pub attributes: &'static [(&'static str, &'static str)],
    /// Chooses it.
    pub set: fn(&mut Choices),
}

/// A value that the user types.
#[derive(Clone, Copy)]
pub struct Custom {
    /// Its name in the description of a queue.
    pub name: &'static str,
    /// The text in the dialog.
    pub text: &'static str,
    /// What it is, in the middle of a sentence.
    pub is: &'static str,
    /// Chooses it, if it can be read.
    pub set: fn(&mut Choices, &str) -> Option<()>,
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

/// What was chosen for a page.
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
    /// How pages are laid on [`paper`](Self::paper), the sheet that is given; without it each page has a
    /// sheet of its own size.
    pub fit: Option<Wish>,
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

impl Default for Choices {
    /// What is printed if nobody chooses anything.
    fn default() -> Choices {
        let more = art::Settings { inks: InkSet::of(Ink::ALL), ..art::Settings::default() };
        Choices {
            media: Media::Plain,
            curl_correction: true,
            colours: process(),
            spots: Spots::Named,
            inks_of: Vec::new(),
            tolerance: None,
            foils: false,
            white: White::None,
            finish: Finish::None,
            dpi: 600,
            intent: more.intent,
            gamma: more.gamma,
            halftone: more.halftone,
            place: Place::Page,
            fit: None,
            mirror: false,
            custom_paper: false,
            profile: Profile::default(),
            pages: Vec::new(),
            paper: Paper::A4,
            more,
        }
    }
}

const fn both(
    name: &'static str,
    help: &'static str,
    keyword: &'static str,
    text: &'static str,
    set: fn(&mut Choices),
) -> Value {
    Value { name, help, dialog: (keyword, text), attributes: &[], set }
}

/// A value of the command line alone.
const fn typed(name: &'static str, help: &'static str, set: fn(&mut Choices)) -> Value {
    both(name, help, "", "", set)
}

/// A value of dialogs alone.
const fn shown(keyword: &'static str, text: &'static str, set: fn(&mut Choices)) -> Value {
    both("", "", keyword, text, set)
}

fn sheet(choices: &mut Choices, media: Media, curl_correction: bool) {
    (choices.media, choices.curl_correction) = (media, curl_correction);
}

/// The inks that mix colours.
fn process() -> InkSet {
    InkSet::of(Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Process))
}

/// Whether a page, from 1, is among those to print.
#[must_use]
pub fn is_chosen(pages: &[RangeInclusive<usize>], page: usize) -> bool {
    pages.is_empty() || pages.iter().any(|range| range.contains(&page))
}

/// Media.
pub static MEDIA: PageOption = PageOption {
    name: "media",
    help: "Material of the sheet: paper, thick (card) or film (decal film)",
    more: "film turns curl correction off. The printer's own media types, such as plain, cardboard, glossy-paper, are known, too.",
    keyword: "MediaType",
    text: "Media",
    values: &[
        typed("paper", "Paper", |c| sheet(c, Media::Plain, true)).asked(&[("media-type", "stationery")]),
        typed("thick", "Card", |c| sheet(c, Media::Cardboard, true)).asked(&[("media-type", "cardstock")]),
        typed("film", "Decal film", |c| sheet(c, Media::Plain, false)).asked(&[("media-type", "film")]),
        typed("", "Glossy paper", |c| sheet(c, Media::GlossyPaper, true))
            .asked(&[("media-type", "photographic-glossy")]),
        typed("", "Transparency", |c| sheet(c, Media::Transparency, true))
            .asked(&[("media-type", "transparency")]),
        typed("", "Glossy labels", |c| sheet(c, Media::GlossyLabel, true)).asked(&[("media-type", "labels")]),
        both("plain", "", "Plain", "Plain", |c| sheet(c, Media::Plain, true)),
        both("plain-twice", "", "PlainTwice", "Plain twice", |c| sheet(c, Media::PlainTwice, true)),
        both(
            "special-transparency-twice",
            "",
            "SpecialTransparencyTwice",
            "Special transparency twice",
            |c| sheet(c, Media::SpecialTransparencyTwice, true),
        ),
        both("special-transparency", "", "SpecialTransparency", "Special transparency", |c| {
            sheet(c, Media::SpecialTransparency, true)
        }),
        both("special-iron-on", "", "SpecialIronOn", "Special iron on", |c| {
            sheet(c, Media::SpecialIronOn, true)
        }),
        both("iron-on", "", "IronOn", "Iron on", |c| sheet(c, Media::IronOn, true)),
        both("labeca", "", "Labeca", "Labeca", |c| sheet(c, Media::Labeca, true)),
        both("thermal", "", "Thermal", "Thermal", |c| sheet(c, Media::Thermal, true)),
        both("cd-master", "", "CdMaster", "Cd master", |c| sheet(c, Media::CdMaster, true)),
        both("cardboard", "", "Cardboard", "Cardboard", |c| sheet(c, Media::Cardboard, true)),
        both("postcard", "", "Postcard", "Postcard", |c| sheet(c, Media::Postcard, true)),
        both("laser-paper", "", "LaserPaper", "Laser paper", |c| sheet(c, Media::LaserPaper, true)),
        both("transparency-twice", "", "TransparencyTwice", "Transparency twice", |c| {
            sheet(c, Media::TransparencyTwice, true)
        }),
        both("transparency", "", "Transparency", "Transparency", |c| sheet(c, Media::Transparency, true)),
        both("back-print-film", "", "BackPrintFilm", "Back print film", |c| {
            sheet(c, Media::BackPrintFilm, true)
        }),
        both("back-print-film-twice", "", "BackPrintFilmTwice", "Back print film twice", |c| {
            sheet(c, Media::BackPrintFilmTwice, true)
        }),
        both("glossy-label", "", "GlossyLabel", "Glossy label", |c| sheet(c, Media::GlossyLabel, true)),
        both("glossy-paper", "", "GlossyPaper", "Glossy paper", |c| sheet(c, Media::GlossyPaper, true)),
        both("vphoto-film", "", "VphotoFilm", "Vphoto film", |c| sheet(c, Media::VPhotoFilm, true)),
        both("vphoto-card", "", "VphotoCard", "Vphoto card", |c| sheet(c, Media::VPhotoCard, true)),
    ],
    custom: None,
};

/// Inks for colours.
pub static INKS: PageOption = PageOption {
    name: "inks",
    help: "Inks that may be used: names and the groups process, metallic, clear, foil, all, separated by commas; + and - change the default [default: all but the foils]",
    more: "",
    keyword: "FoilpressInks",
    text: "Inks for colours",
    values: &[
        shown("Colour", "Cyan, magenta, yellow, black", |c| c.colours = process()),
        shown("Black", "Black only", |c| c.colours = InkSet::of([Ink::Black]))
            .asked(&[("print-color-mode", "monochrome")]),
        shown("NoBlack", "Cyan, magenta, yellow", |c| {
            c.colours = InkSet::of([Ink::Cyan, Ink::Magenta, Ink::Yellow])
        }),
    ],
    custom: None,
};

/// Spot inks.
pub static SPOTS: PageOption = PageOption {
    name: "reserved",
    help: "Print the vendor's reserved colours in their inks: white 230,230,230, gold 225,160,0, silver 189,193,197, metallic red 163,36,115, metallic blue 0,176,201, black 0,0,0",
    more: "",
    keyword: "FoilpressSpots",
    text: "Spot inks",
    values: &[
        shown("Named", "Spot colours named after inks", |c| c.spots = Spots::Named),
        shown("Reserved", "Spot colours named after inks, and the vendor's reserved colours", |c| {
            c.spots = Spots::Reserved
        }),
        shown("Off", "None (everything in process inks)", |c| c.spots = Spots::None),
    ],
    custom: None,
};

/// Foils.
pub static FOILS: PageOption = PageOption {
    name: "",
    help: "",
    more: "",
    keyword: "FoilpressFoils",
    text: "Foils",
    values: &[
        shown("Off", "Never", |c| c.foils = false),
        shown("On", "Where the page names them (untested)", |c| c.foils = true),
    ],
    custom: None,
};

/// White.
pub static WHITE: PageOption = PageOption {
    name: "white",
    help: "Where white is printed [default: where the artwork draws it]",
    more: "",
    keyword: "FoilpressWhite",
    text: "White",
    values: &[
        both(
            "none",
            "No white at all, not even where the art draws it",
            "None",
            "Only where the page names it",
            |c| c.white = White::None,
        ),
        both("under", "Under every dot of every ink", "Under", "Under every ink", |c| c.white = White::Under),
        both(
            "reserved",
            "Where the picture has the vendor's reserved white, 230,230,230",
            "Reserved",
            "Where the page has the reserved white 230,230,230",
            |c| c.white = White::Reserved,
        ),
        both(
            "opaque",
            "Where the picture is neither pure white nor transparent",
            "Opaque",
            "Where the page is not pure white",
            |c| c.white = White::Opaque,
        ),
        both(
            "silhouette",
            "Everything inside the outline, including holes and white areas",
            "Silhouette",
            "Everything inside the outline",
            |c| c.white = White::Silhouette,
        ),
        typed("alpha", "Where the picture is not transparent, including pure white", |c| {
            c.white = White::Alpha
        }),
    ],
    custom: None,
};

/// Glossy finish.
pub static FINISH: PageOption = PageOption {
    name: "finish",
    help: "Where glossy finish is printed [default: where the artwork draws it]",
    more: "",
    keyword: "FoilpressFinish",
    text: "Glossy finish",
    values: &[
        shown("None", "Only where the page names it", |c| c.finish = Finish::None),
        both("artwork", "On everything that is drawn", "Artwork", "On everything drawn", |c| {
            c.finish = Finish::Artwork
        }),
        both("all", "On the whole rectangle of the artwork", "All", "On the whole page", |c| {
            c.finish = Finish::All
        }),
        typed("none", "Nowhere, not even where the artwork draws it", |c| c.finish = Finish::None),
    ],
    custom: None,
};

/// Quality.
pub static QUALITY: PageOption = PageOption {
    name: "",
    help: "",
    more: "",
    keyword: "FoilpressQuality",
    text: "Quality",
    values: &[
        shown("Normal", "Normal (600 dpi)", |c| c.dpi = 600),
        shown("Draft", "Draft (rendered at 300 dpi)", |c| c.dpi = 300).asked(&[("print-quality", "3")]),
    ],
    custom: None,
};

/// Curl correction.
pub static CURL: PageOption = PageOption {
    name: "curl",
    help: "Curl correction of the printer [default: off for film, on for everything else]",
    more: "",
    keyword: "FoilpressCurl",
    text: "Curl correction",
    values: &[
        both("on", "The printer corrects the curl of the sheet", "On", "On (paper)", |c| {
            c.curl_correction = true
        }),
        both(
            "off",
            "The printer leaves the sheet as it is, so that decals stay on their film",
            "Off",
            "Off (decal film)",
            |c| c.curl_correction = false,
        ),
    ],
    custom: None,
};

/// Colours out of reach.
pub static INTENT: PageOption = PageOption {
    name: "intent",
    help: "Which mixtures of inks stand for colours: those of photographs, or those of drawings",
    more: "It decides for every colour of the art, not only for those that the inks do not reach.",
    keyword: "FoilpressIntent",
    text: "Colours out of reach",
    values: &[
        both(
            "auto",
            "Perceptual for pictures, colorimetric for text and drawings; tints of cyan, magenta, yellow, red, green and blue keep those inks there",
            "Auto",
            "Perceptual for pictures, colorimetric for drawings",
            |c| c.intent = Intent::Auto,
        ),
        both(
            "perceptual",
            "Saturated colours move closer together, and differences between them survive",
            "Perceptual",
            "Perceptual (differences survive)",
            |c| c.intent = Intent::Perceptual,
        )
        .asked(&[("print-content-optimize", "photo"), ("print-rendering-intent", "perceptual")]),
        both(
            "colorimetric",
            "Printable colours are kept; others become the nearest printable colour of their hue",
            "Colorimetric",
            "Colorimetric (printable colours are exact)",
            |c| c.intent = Intent::Colorimetric,
        )
        .asked(&[
            ("print-content-optimize", "graphic"),
            ("print-content-optimize", "text"),
            ("print-content-optimize", "text-and-graphic"),
            ("print-rendering-intent", "relative"),
        ]),
    ],
    custom: None,
};

/// Brightness.
pub static GAMMA: PageOption = PageOption {
    name: "gamma",
    help: "Brighten the colours of pictures by this exponent, 0.2 to 5; below 1 darkens them",
    more: "",
    keyword: "FoilpressGamma",
    text: "Brightness",
    values: &[
        shown("Normal", "Normal (1)", |c| c.gamma = 1.0),
        shown("Lighter", "Lighter (1.3)", |c| c.gamma = 1.3),
        shown("Darker", "Darker (0.8)", |c| c.gamma = 0.8),
    ],
    custom: Some(Custom {
        name: "Exponent",
        text: "Gamma, 0.2 to 5, such as 1.2",
        is: "a number from 0.2 to 5, such as 1.2",
        set: |c, text| {
            c.gamma = text.parse().ok().filter(|gamma| GAMMAS.contains(gamma))?;
            Some(())
        },
    }),
};

/// Halftone.
pub static HALFTONE: PageOption = PageOption {
    name: "halftone",
    help: "How the stack of each dot is chosen where the art has tones; solid dots are printed as they are [default: fine for the process inks of flat art, else cells]",
    more: "",
    keyword: "FoilpressHalftone",
    text: "Halftone",
    values: &[
        shown("Fine", "Small clusters, dot by dot", |c| c.halftone = Method::Fine),
        typed("walk", "Runs along a space-filling curve: the paper's rule", |c| c.halftone = Method::Walk),
        both(
            "cells",
            "Compact clusters, no part thinner than its ink holds",
            "Cells",
            "Compact clusters",
            |c| c.halftone = Method::Cells,
        ),
        both(
            "best",
            "Cells, rearranged to lessen the error the eye sees; slower",
            "Best",
            "Compact clusters, searched (slower)",
            |c| c.halftone = Method::Best,
        )
        .asked(&[("print-quality", "5")]),
        shown("Walk", "Runs along a curve", |c| c.halftone = Method::Walk),
        typed("blue", "Single scattered dots (blue noise); for process inks alone", |c| {
            c.halftone = Method::Blue
        }),
        typed("fine", "Small clusters that each dot picks from a table; for process inks alone", |c| {
            c.halftone = Method::Fine
        }),
    ],
    custom: None,
};

/// Position.
pub static POSITION: PageOption = PageOption {
    name: "at",
    help: "Position of the top left corner, across and down, such as 20x30mm; sheets lie up to 1 mm off sideways [default: centred]",
    more: "",
    keyword: "FoilpressPosition",
    text: "Position",
    values: &[
        shown("Page", "As on the page", |c| c.place = Place::Page),
        shown("Centre", "Drawing centred on the sheet", |c| c.place = Place::Centre),
    ],
    custom: Some(Custom {
        name: "Corner",
        text: "Top left corner of the drawing, such as 20x30mm",
        is: "the top left corner of the drawing, such as 20x30mm",
        set: |c, text| {
            c.place = Place::At(text.parse().ok()?);
            Some(())
        },
    }),
};

/// A colour as an ink.
pub static COLOUR: PageOption = PageOption {
    name: "colour",
    help: "Print colours of the art in inks, such as \"#ff0000=gold,808080=silver\"; may be repeated",
    more: "",
    keyword: "FoilpressColour",
    text: "A colour as an ink",
    values: &[shown("None", "None", |c| c.inks_of = Vec::new())],
    custom: Some(Custom {
        name: "Colour",
        text: "Colour and ink, such as #ff0000=gold",
        is: "colours and their inks, such as #ff0000=gold",
        set: colours,
    }),
};

/// Difference from such a colour.
pub static TOLERANCE: PageOption = PageOption {
    name: "tolerance",
    help: "Largest difference from a colour that stands for an ink, in steps of red, green and blue (each 0 to 255): 0 to 60 [default: 8 for the vendor's white and black, 12 for others]",
    more: "",
    keyword: "FoilpressTolerance",
    text: "Difference from such a colour",
    values: &[shown("Usual", "As usual (8 for white and black, 12 for others)", |c| c.tolerance = None)],
    custom: Some(Custom {
        name: "Steps",
        text: "Steps of red, green and blue, 0 to 60",
        is: "a number of steps from 0 to 60, such as 12",
        set: |c, text| {
            c.tolerance = Some(text.parse().ok().filter(|steps| TOLERANCES.contains(steps))?);
            Some(())
        },
    }),
};

/// Mirror (for prints seen from behind).
pub static MIRROR: PageOption = PageOption {
    name: "mirror",
    help: "Mirror the print left to right",
    more: "For water-slide decals applied face down, or window decals seen from inside.",
    keyword: "MirrorPrint",
    text: "Mirror (for prints seen from behind)",
    values: &[shown("False", "No", |c| c.mirror = false), shown("True", "Yes", |c| c.mirror = true)],
    custom: None,
};

/// All options, in the order of the dialog.
pub static PAGE: [&PageOption; 15] = [
    &MEDIA, &INKS, &SPOTS, &FOILS, &WHITE, &FINISH, &QUALITY, &CURL, &INTENT, &GAMMA, &HALFTONE, &POSITION,
    &COLOUR, &TOLERANCE, &MIRROR,
];

/// Colours and their inks, by the rules of `foilpress layers --colour`.
fn colours(choices: &mut Choices, text: &str) -> Option<()> {
    let read: Vec<(Ink, [u8; 3])> = text.split(',').map(art::names::colour).collect::<Result<_, _>>().ok()?;
    if art::names::wrong_colours(&read).is_some() {
        return None;
    }
    choices.inks_of = read;
    Some(())
}

impl PageOption {
    /// The help and what `--help` says beside it.
    #[must_use]
    pub fn long_help(&self) -> String {
        format!("{}\n\n{}", self.help, self.more)
    }

    /// The values that a dialog shows; the first is its default.
    pub fn in_dialog(&self) -> impl Iterator<Item = &'static Value> {
        self.values.iter().filter(|value| !value.dialog.0.is_empty())
    }

    /// The values that can be typed on the command line.
    pub fn typed(&self) -> impl Iterator<Item = &'static Value> {
        self.values.iter().filter(|value| !value.name.is_empty())
    }

    /// The name on the command line of the value that chooses this.
    pub fn name_of(&self, is: impl Fn(&Choices) -> bool) -> &'static str {
        self.typed().find(|value| value.of(|choices| is(&choices))).map_or("", |value| value.name)
    }

    /// Chooses a value by its keyword in a dialog, or one that was typed there, as `Custom.20x30mm` or
    /// `20x30mm`.
    #[must_use]
    pub fn choose(&self, text: &str, choices: &mut Choices) -> Option<()> {
        if let Some(value) = self.in_dialog().find(|value| value.dialog.0.eq_ignore_ascii_case(text)) {
            (value.set)(choices);
            return Some(());
        }
        let bare = match text.get(..7) {
            Some(head) if head.eq_ignore_ascii_case("custom.") => &text[7..],
            _ => text,
        };
        (self.custom?.set)(choices, bare)
    }
}

impl Value {
    /// The same where attributes of a print server's job ask for it, too.
    const fn asked(mut self, attributes: &'static [(&'static str, &'static str)]) -> Value {
        self.attributes = attributes;
        self
    }

    /// What it chooses, read from where it is put.
    pub fn of<T>(&self, get: impl FnOnce(Choices) -> T) -> T {
        let mut choices = Choices::default();
        (self.set)(&mut choices);
        get(choices)
    }
}

/// The values that an attribute of a print server's job may ask for, by their keywords there.
pub fn of_attribute(attribute: &str) -> impl Iterator<Item = (&'static str, &'static Value)> {
    let values = PAGE.iter().flat_map(|option| option.values);
    values.flat_map(move |value| {
        let names = value.attributes.iter().filter(move |(known, _)| *known == attribute);
        names.map(move |(_, keyword)| (*keyword, value))
    })
}
