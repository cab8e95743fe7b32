//! Arguments of the page: paper, position, repeats, marks, the printer's profile, and what the sheet is made of.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use inks::InkSet;
use make::options::{CURL, Choices, MEDIA, MIRROR, POSITION};
use protocol::paper::Paper;
use protocol::rgl::Resolution;

use crate::cli::arguments::choice::of_page;
use crate::folders;
use observe::Observer;
use press::job::Handling;
use press::layout::{self, Layout, Mm, Point, Position, Profile, Repeat};

/// The profile that is used when none is named.
pub const DEFAULT_PROFILE: &str = "default";

/// How things lie on the page.
#[derive(Args, Debug)]
pub struct LayoutArgs {
    /// Paper size: a4, letter, legal, executive, b5, postcard, or the size of the sheet such as 120x180mm
    #[arg(long, default_value = "a4", value_parser = layout::paper::read)]
    pub paper: Paper,
    #[arg(long, value_name = "X,Y", help = POSITION.help, allow_hyphen_values = true)]
    pub at: Option<Point>,
    /// Edge that --at is measured from
    #[arg(long, value_name = "WHERE", default_value = "edge", requires = "at")]
    pub from: From,
    /// Print several copies on the sheet in a grid, such as 3x4; fill prints as many as fit
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "1x1", value_parser = repeat)]
    pub repeat: Repeat,
    /// Space between repeats, such as 2mm, or across and down, such as 2x5mm
    #[arg(long, value_name = "LENGTH", default_value = "0", value_parser = gap)]
    pub gap: Point,
    #[arg(long, help = MIRROR.help, long_help = MIRROR.long_help())]
    pub mirror: bool,
    /// Print crop marks: ticks that show where to cut
    #[arg(long)]
    pub crop_marks: bool,
    /// Print a cross in every pass at each side, to see whether the passes line up
    #[arg(long)]
    pub registration_marks: bool,
    /// Print a pattern at each corner that tells a camera which sheet it sees, for `foilpress compare`
    #[arg(long)]
    pub camera_marks: bool,
    /// Inks of the marks, separated by commas [default: of the inks in use, the one that shows best for ticks, all of them
    /// for crosses, a dark one for camera marks]
    #[arg(long, value_name = "INKS")]
    pub mark_ink: Option<InkSet>,
    /// Cut off what lies beyond the printable area [default: an error]
    #[arg(long)]
    pub crop: bool,
    /// Calibration profile of the printer (`foilpress profile`) [default: the profile named `default`, if it exists]
    #[arg(long, value_name = "NAME")]
    pub profile: Option<String>,
}

/// What a position is measured from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum From {
    /// The edge of the sheet of paper
    Edge,
    /// The edge of the printable area
    Printable,
}

fn repeat(text: &str) -> Result<Repeat, String> {
    if text.eq_ignore_ascii_case("fill") {
        return Ok(Repeat::Fill);
    }
    let grid = text.split_once('x').and_then(|(columns, rows)| {
        let count = |text: &str| {
            text.trim().parse::<u16>().ok().filter(|count| (1..=layout::MOST_REPEATS).contains(count))
        };
        Some(Repeat::Grid(count(columns)?, count(rows)?))
    });
    grid.ok_or_else(|| {
        format!("expected columns and rows from 1 to {}, such as 3x4, or fill", layout::MOST_REPEATS)
    })
}

fn gap(text: &str) -> Result<Point, String> {
    let point: Point = match text.parse::<Mm>() {
        Ok(both) => Point(both, both),
        Err(error) => text.parse().map_err(|_| error.to_string())?,
    };
    if point.0.0 < 0.0 || point.1.0 < 0.0 {
        return Err("expected a gap of 0 or more, such as 2mm, because copies cannot overlap".into());
    }
    Ok(point)
}

impl LayoutArgs {
    /// The layout meant. Notes to the observer when a profile is used without being named.
    pub fn layout(&self, observer: &dyn Observer) -> Result<Layout> {
        let position = match (self.at, self.from) {
            (None, _) => Position::Centred,
            (Some(at), From::Edge) => Position::FromEdge(at),
            (Some(at), From::Printable) => Position::FromPrintable(at),
        };
        Ok(Layout {
            paper: self.paper,
            resolution: Resolution::Dpi600,
            position,
            repeat: self.repeat,
            gap: self.gap,
            mirror: self.mirror,
            crop_marks: self.crop_marks,
            registration_marks: self.registration_marks,
            camera_marks: self.camera_marks,
            mark_inks: self.mark_ink.map_or_else(Vec::new, |set| set.iter().collect()),
            cut: self.crop,
            profile: profile(self.profile.as_deref(), observer)?,
        })
    }
}

/// The folder of profiles.
pub fn profiles() -> Result<PathBuf> {
    Ok(folders::config()?.join("profiles"))
}

/// The profile of this name, or the default one if there is one.
pub fn profile(name: Option<&str>, observer: &dyn Observer) -> Result<Profile> {
    let folder = match (profiles(), name) {
        (Ok(folder), _) => folder,
        // Without a place for settings there are none.
        (Err(_), None) => return Ok(Profile::default()),
        (Err(error), Some(_)) => return Err(error),
    };
    let path = folders::file(&folder, name.unwrap_or(DEFAULT_PROFILE))?;
    match (name, path.is_file()) {
        (None, false) => Ok(Profile::default()),
        (Some(name), false) => {
            let known = folders::names(&folder).unwrap_or_default();
            bail!(
                "there is no profile `{name}` in {}{}; make it with `foilpress profile set {name}`",
                folder.display(),
                if known.is_empty() { String::new() } else { format!(" (there are: {})", known.join(", ")) }
            )
        }
        (name, true) => {
            let profile = Profile::load(&path)?;
            if name.is_none() && profile != Profile::default() {
                let [x, y] = profile.offset_mm;
                observer.note(&format!(
                    "using the printer's profile {}: offset {x}, {y} mm, feed {}",
                    path.display(),
                    profile.feed
                ));
            }
            Ok(profile)
        }
    }
}

/// What the sheet is made of.
#[derive(Args, Debug)]
pub struct MediaArgs {
    #[arg(long, help = MEDIA.help, long_help = MEDIA.long_help(), default_value = "paper", value_parser = handling)]
    pub media: Handling,
    #[arg(long, value_name = "on|off", help = CURL.help, value_parser = of_page(&CURL, |choices| choices.curl_correction))]
    pub curl: Option<bool>,
}

impl MediaArgs {
    /// How the printer is to treat the sheet.
    pub fn handling(&self) -> Handling {
        let curl_correction = self.curl.unwrap_or(self.media.curl_correction);
        Handling { curl_correction, ..self.media }
    }
}

/// What a sheet is made of by its name: in the words of owners, whose decals come off film that went through
/// curl correction, or one of the printer's own media types.
fn handling(name: &str) -> Result<Handling, String> {
    let found = MEDIA.typed().find(|value| value.name.eq_ignore_ascii_case(name));
    let handling =
        |choices: Choices| Handling { media: choices.media, curl_correction: choices.curl_correction };
    found.map(|value| value.of(handling)).ok_or_else(|| {
        let names: Vec<&str> = MEDIA.typed().map(|value| value.name).collect();
        format!("expected one of the media {}", names.join(", "))
    })
}
