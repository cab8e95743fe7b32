//! Arguments of the page: paper, position, repeats, marks, the printer's profile, and what the sheet is made of.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use inks::InkSet;
use protocol::paper::Paper;
use protocol::rgl::{Media, Resolution};

use super::stdio::{chain, show, usage};
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
    /// Position of the top left corner, across and down, such as 20x30mm [default: centred]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
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
    /// Mirror the print left to right, for water-slide decals applied face down or window decals seen from inside
    #[arg(long)]
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
    /// Material of the sheet: paper, thick (card), film (decal film; curl correction off), or one of the printer's own
    /// media types such as plain, cardboard, glossy-paper
    #[arg(long, default_value = "paper", value_parser = handling)]
    pub media: Handling,
    /// Curl correction of the printer [default: off for film, on for everything else]
    #[arg(long, value_name = "on|off")]
    pub curl: Option<Curl>,
}

/// Curl correction.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Curl {
    /// The printer corrects the curl of the sheet
    On,
    /// The printer leaves the sheet as it is, so that decals stay on their film
    Off,
}

impl MediaArgs {
    /// How the printer is to treat the sheet.
    pub fn handling(&self) -> Handling {
        let curl_correction = self.curl.map_or(self.media.curl_correction, |curl| curl == Curl::On);
        Handling { curl_correction, ..self.media }
    }
}

/// What owners print on, by their own words: decals come off film that went through curl correction.
const STOCKS: [(&str, Handling); 3] = [
    ("paper", Handling { media: Media::Plain, curl_correction: true }),
    ("thick", Handling { media: Media::Cardboard, curl_correction: true }),
    ("film", Handling { media: Media::Plain, curl_correction: false }),
];

/// One of [`STOCKS`] or a media type by its name.
fn handling(name: &str) -> Result<Handling, String> {
    if let Some((_, handling)) = STOCKS.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)) {
        return Ok(*handling);
    }
    Media::from_name(name).map(|media| Handling { media, curl_correction: true }).ok_or_else(|| {
        let names: Vec<&str> =
            STOCKS.iter().map(|(name, _)| *name).chain(Media::all().map(Media::name)).collect();
        format!("expected one of the media {}", names.join(", "))
    })
}

/// Arguments of `papers`.
#[derive(Args, Debug)]
pub struct PapersArgs {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `papers`.
pub fn papers(args: &PapersArgs) -> Result<()> {
    use std::fmt::Write as _;
    let table: Vec<_> = layout::paper::table().collect();
    if args.json {
        return show(&format!("{}\n", serde_json::to_string_pretty(&table)?));
    }
    let mut text =
        String::from("            sheet, mm        printable, mm    margins: left, top, right, bottom\n");
    for paper in table {
        let ((width, length), (across, along)) = (paper.sheet_mm, paper.printable_mm);
        let [left, top, right, bottom] = paper.margins_mm;
        writeln!(
            text,
            "{:<10} {width:>6.1} x {length:<6.1}  {across:>6.1} x {along:<6.1}  {left:>4.1} {top:>5.1} {right:>4.1} \
             {bottom:>5.1}  {}",
            paper.name, paper.known
        )?;
    }
    text.push_str("Any other size: --paper 120x180mm, for example, with the margins of a4.\n");
    show(&text)
}

/// Arguments of `profile`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress chart calibration --to serial:/dev/ttyACM0     (print it, then measure with a ruler)\n  \
    foilpress profile set default --cross 20.4x29.7mm --distance 200.3mm\n  \
    foilpress measure registration scan.png --chart registration.rgl --profile default\n  \
    foilpress profile list\n  \
    foilpress print sample:leaf --profile default")]
pub struct ProfileArgs {
    #[command(subcommand)]
    command: ProfileCommand,
}

#[derive(clap::Subcommand, Debug)]
enum ProfileCommand {
    /// List the profiles
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Save measurements of the calibration chart as a profile; the profile `default` is used whenever none is named
    Set(SetProfile),
}

#[derive(Args, Debug)]
struct SetProfile {
    /// Name of the profile
    name: String,
    /// Centre of the first cross, measured from the left and top edges of the sheet
    #[arg(long, value_name = "X,Y")]
    cross: Point,
    /// Distance from the first cross to the one below it [default: not measured; the feed is taken as exact]
    #[arg(long, value_name = "LENGTH")]
    distance: Option<Mm>,
}

/// Runs `profile`.
pub fn profile_command(args: &ProfileArgs) -> Result<()> {
    match &args.command {
        ProfileCommand::List { json } => list_profiles(*json),
        ProfileCommand::Set(set) => {
            let profile = press::chart::calibration::profile(set.cross, set.distance);
            if let Some(problem) = profile.problem() {
                return Err(usage(format!("--cross and --distance make {problem}; measure them again")));
            }
            let path = save_profile(&set.name, &profile)?;
            show(&format!("{}: {}\n", path.display(), in_words(&profile)))
        }
    }
}

/// Lists the profiles, a line each. One that cannot be used says so.
fn list_profiles(json: bool) -> Result<()> {
    let folder = profiles()?;
    let names = folders::names(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let load = |name: &str| anyhow::Ok(Profile::load(&folders::file(&folder, name)?)?);
    let profiles = names.iter().map(|name| (name, load(name)));
    if json {
        let row = |(name, profile): (&String, Result<Profile>)| {
            let mut row = match profile {
                Ok(profile) => serde_json::to_value(profile)?,
                Err(error) => serde_json::json!({ "error": chain(&error) }),
            };
            row["name"] = name.as_str().into();
            anyhow::Ok(row)
        };
        let rows = profiles.map(row).collect::<Result<Vec<_>>>()?;
        return show(&format!("{}\n", serde_json::to_string_pretty(&rows)?));
    }
    let line = |(name, profile): (&String, Result<Profile>)| {
        let words = profile.map_or_else(|error| chain(&error), |profile| in_words(&profile));
        format!("{name:<16} {words}\n")
    };
    let text: String = profiles.map(line).collect();
    if text.is_empty() {
        return show(&format!(
            "no profiles in {}; print `foilpress chart calibration` to make one\n",
            folder.display()
        ));
    }
    show(&text)
}

/// Saves a profile under a name; nothing is written if it is none of a printer.
pub fn save_profile(name: &str, profile: &Profile) -> Result<PathBuf> {
    if let Some(problem) = profile.problem() {
        bail!("{problem}; measure again");
    }
    let folder = profiles()?;
    let path = folders::file(&folder, name)?;
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    profile.save(&path)?;
    Ok(path)
}

/// A profile in a line.
pub fn in_words(profile: &Profile) -> String {
    let Profile { offset_mm: [x, y], feed, skew_deg } = profile;
    let skew = if *skew_deg == 0.0 { String::new() } else { format!(", skew {skew_deg:.2} degrees") };
    format!("offset {x:.2}, {y:.2} mm, feed {feed:.4}{skew}")
}
