//! `foilpress layers`: spot-colour art in, the job and everything to look at out.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args as ClapArgs;
use inks::{InkSet, InkSetError, Library};
use make::PageSettings;
use make::fitted::Fitted;
use make::layers::{Layers, Settings};
use make::options::{COLOUR, FINISH, GAMMA, INKS, INTENT, SPOTS, TOLERANCE, WHITE};
#[cfg(feature = "serve")]
use make::options::{Choices, Place, Spots};
use protocol::ink::Ink;
use protocol::rgl::Resolution;
use serde_json::{Value, json};

use crate::cli::arguments::HalftoneArg;
use crate::cli::arguments::choice::{choice, of_page, whole};
use crate::cli::arguments::layout::{LayoutArgs, MediaArgs};
use crate::cli::commands::preset::PresetArg;
use crate::cli::console::advice;
use crate::cli::console::usage;
use crate::cli::output::{Staged, write};
use crate::cli::printing::cut_lines;
use crate::cli::printing::deliver::DeliverArgs;
use crate::cli::printing::plan_output::PlanOutputArgs;
use crate::cli::printing::{self, Places, ResultArgs};
use art::{Accept, Composed, Finish, GAMMAS, Intent, MOST_CHOKE_MM, Order, Pages, TOLERANCES, White, names};
use observe::Observer;
use press::job::plan::grouped;
use press::layout::fit::{Scaling, Wish};
use press::layout::{Layout, Mm, NoLength, Position};
use readers::resolution::RESOLUTIONS;
use sheet::DOTS_PER_MM;
use sheet::Size;

/// What to read and how it becomes layers of ink.
#[derive(ClapArgs, Debug)]
pub struct LayersArgs {
    /// Artwork: pictures named after their inks (white.png, 02-gold.png), a folder of them, a TIFF with
    /// named spot channels, an SVG or OpenRaster file with named layers, a PDF or PostScript file, or one
    /// picture
    #[arg(value_name = "ART", required = true)]
    pub art: Vec<PathBuf>,
    #[arg(long, help = SPOTS.help)]
    pub reserved: bool,
    #[arg(long, value_name = "RRGGBB=INK", help = COLOUR.help, value_delimiter = ',', value_parser = names::colour)]
    pub colour: Vec<(Ink, [u8; 3])>,
    #[arg(long, value_name = "STEPS", help = TOLERANCE.help, value_parser = whole(TOLERANCES))]
    pub tolerance: Option<u8>,
    /// Resolution of the pictures in pixels per inch, if a file states none or a wrong one; of a drawing
    /// that states no size on paper, its units per inch
    #[arg(long, value_name = "DPI", value_parser = dpi)]
    pub dpi: Option<f64>,
    /// Page of a PDF, PostScript or TIFF file [default: the only page with art; several are an error]
    #[arg(long, value_name = "N", value_parser = page)]
    pub page: Option<u32>,
    /// Read one page per ink from a PDF, PostScript or TIFF file: the ink of each page, such as
    /// white,gold,black
    #[arg(long, value_name = "INKS", value_delimiter = ',', value_parser = names::typed, conflicts_with = "page")]
    pub pages: Vec<Ink>,
    /// Layers that keep their tones, and are halftoned; other layers are solid where they are darker than
    /// half
    #[arg(long, value_name = "INKS")]
    pub tones: Option<String>,
    #[command(flatten)]
    pub halftone: HalftoneArg,
    /// How text in colours between the inks is printed
    #[arg(long, value_name = "HOW", value_parser = choice::<art::Text>(), default_value = "mixed")]
    pub text: art::Text,
    #[arg(long, value_name = "LIST", help = INKS.help, allow_hyphen_values = true)]
    pub inks: Option<String>,
    /// Order from the paper up: rules, given, or a list of inks such as white,black,white
    /// [default: the numbers in the file names, else the ink library's rules]
    ///
    /// rules follows the ink library; given follows the order of the files or layers.
    #[arg(long, value_name = "ORDER", value_parser = order)]
    pub order: Option<Order>,
    /// Number of passes of an ink, such as white=3,primer=2 [default: 1 each]
    #[arg(long, value_name = "INK=N", value_delimiter = ',', value_parser = passes)]
    pub passes: Vec<(Ink, u8)>,
    /// Inks that knock out the process inks beneath them, and the white that a page draws there; or none
    /// [default: metallic]
    #[arg(long, value_name = "INKS")]
    pub knockout: Option<String>,
    #[arg(long, value_name = "MODE", help = WHITE.help, value_parser = of_page(&WHITE, |choices| choices.white))]
    pub white: Option<White>,
    /// Shrink the white by this length, such as 0.1mm, so that it does not show beside the colours
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with = "spread")]
    pub choke: Option<f64>,
    /// Spread the white by this length, such as 0.1mm
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub spread: Option<f64>,
    #[arg(long, value_name = "WHERE", help = FINISH.help, value_parser = of_page(&FINISH, |choices| choices.finish))]
    pub finish: Option<Finish>,
    #[arg(
        long,
        value_name = "INTENT",
        help = INTENT.help,
        long_help = INTENT.long_help(),
        value_parser = of_page(&INTENT, |choices| choices.intent),
        default_value = "auto"
    )]
    pub intent: Intent,
    #[arg(long, value_name = "EXPONENT", help = GAMMA.help, value_parser = gamma, default_value_t = 1.0)]
    pub gamma: f64,
    /// Suggestions of the plan to accept, separated by commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = choice::<Accept>())]
    pub accept: Vec<Accept>,
    /// Your own ink library: its folder, or the name it was added under; its order rules and minimum
    /// clusters apply [default: the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    pub library: Option<PathBuf>,
}

fn dpi(text: &str) -> Result<f64, String> {
    let dpi = text.parse().ok().filter(|dpi| RESOLUTIONS.contains(dpi));
    let (least, most) = RESOLUTIONS.into_inner();
    dpi.ok_or_else(|| format!("expected pixels per inch from {least} to {most}, such as 600"))
}

fn resolution(text: &str) -> Result<Resolution, String> {
    match text {
        "600" => Ok(Resolution::Dpi600),
        "1200" => Ok(Resolution::Dpi1200),
        _ => Err("expected 600 or 1200 dpi, as the printer prints; --dpi states the resolution of a picture"
            .into()),
    }
}

fn gamma(text: &str) -> Result<f64, String> {
    let gamma = text.parse().ok().filter(|gamma| GAMMAS.contains(gamma));
    gamma.ok_or_else(|| format!("expected a number from {} to {}, such as 1.2", GAMMAS.start(), GAMMAS.end()))
}

fn page(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(page @ 1..) => Ok(page),
        _ if text.ends_with(".html") => {
            Err("expected the number of a page of the art; --html FILE writes the plan as a page".into())
        }
        _ => Err("expected the number of a page, such as 1".into()),
    }
}

/// How far white may grow or shrink, in dots of 600 dpi.
fn length(text: &str) -> Result<f64, String> {
    let length: Mm = text.parse().map_err(|error: NoLength| error.to_string())?;
    if (0.0..=MOST_CHOKE_MM).contains(&length.0) {
        Ok(length.0 * DOTS_PER_MM)
    } else {
        Err(format!("expected a length from 0 to {MOST_CHOKE_MM} mm, such as 0.1mm"))
    }
}

fn passes(text: &str) -> Result<(Ink, u8), String> {
    let (ink, times) = text.split_once('=').ok_or("expected INK=N, such as white=3")?;
    match times.trim().parse() {
        Ok(times @ 1..=9) => Ok((names::typed(ink)?, times)),
        _ => Err(format!("expected 1 to 9 passes, such as white=3, found `{times}`")),
    }
}

fn order(text: &str) -> Result<Order, String> {
    match text {
        "rules" => Ok(Order::Rules),
        "given" => Ok(Order::Given),
        list => list.split(',').map(names::typed).collect::<Result<_, _>>().map(Order::Inks),
    }
}

/// Inks as typed: any of their names, or groups.
fn set(option: &str, text: &str) -> Result<InkSet> {
    text.parse().map_err(|error: InkSetError| usage(format!("{option}: {error}")))
}

impl LayersArgs {
    /// The library.
    pub fn library(&self) -> Result<Library> {
        crate::libraries::given(self.library.as_deref())
    }

    /// The inks that may be used: white is among the usual ones here.
    pub fn inks(&self) -> Result<InkSet> {
        let text = match self.inks.as_deref().map(str::trim) {
            None => "default,white".into(),
            Some(change) if change.starts_with(['+', '-']) => format!("default,white,{change}"),
            Some(list) => list.to_owned(),
        };
        let mut inks = set("--inks", &text)?;
        if self.inks.is_none() {
            inks = self.colour.iter().fold(inks, |inks, &(ink, _)| inks.with(ink));
        }
        if inks.is_empty() {
            return Err(usage("--inks leaves no ink to print with"));
        }
        Ok(inks)
    }

    /// The colours that stand for inks.
    fn colours(&self) -> Result<Vec<(Ink, [u8; 3])>> {
        let inks = self.inks()?;
        if let Some((ink, _)) = self.colour.iter().find(|(ink, _)| !inks.contains(*ink)) {
            return Err(usage(format!("--colour names {}, which is not among --inks", ink.name())));
        }
        if self.tolerance.is_some()
            && !self.reserved
            && self.white != Some(White::Reserved)
            && self.colour.is_empty()
        {
            return Err(usage(
                "--tolerance says how near a colour must be to that of an ink; add --reserved or --colour",
            ));
        }
        if let Some(wrong) = names::wrong_colours(&self.colour) {
            return Err(usage(format!("--colour {wrong}")));
        }
        Ok(self.colour.clone())
    }

    /// How the art is read.
    fn options(&self, size: Option<Size>, cut_lines: bool) -> Result<art::Options> {
        Ok(art::Options {
            size,
            dpi: self.dpi,
            reserved: self.reserved || self.white == Some(White::Reserved),
            colours: self.colours()?,
            tolerance: self.tolerance,
            pages: match (self.page, &self.pages[..]) {
                (Some(page), _) => Pages::Number(page),
                (None, []) => Pages::Only,
                (None, inks) => Pages::Inks(inks.to_vec()),
            },
            tones: self.tones.as_deref().map_or(Ok(InkSet::EMPTY), |text| set("--tones", text))?,
            inks: self.inks()?,
            cut_lines,
            ..art::Options::default()
        })
    }

    /// How layers become stacks.
    pub fn settings(&self) -> Result<art::Settings> {
        Ok(art::Settings {
            inks: self.inks()?,
            order: self.order.clone().unwrap_or_default(),
            passes: self.passes.clone(),
            knockout: match self.knockout.as_deref() {
                None => art::Settings::default().knockout,
                Some("none") => InkSet::EMPTY,
                Some(text) => set("--knockout", text)?,
            },
            white: self.white,
            choke: self.choke.unwrap_or(0.0) - self.spread.unwrap_or(0.0),
            finish: self.finish,
            intent: self.intent,
            gamma: self.gamma,
            halftone: self.halftone.halftone.unwrap_or(art::Settings::default().halftone),
            text: self.text,
            accept: self.accept.clone(),
        })
    }

    /// Notes on options that have no effect on this art.
    fn idle(
        &self,
        art: &art::Artwork,
        Settings { read, compose: settings, .. }: &Settings,
        composed: &Composed,
    ) -> Vec<String> {
        let mut notes = Vec::new();
        let mut lacks = |option: &str, value: &Option<String>, idle: bool| {
            if let Some(value) = value.as_deref().filter(|_| idle) {
                notes.push(format!("the art has no layer of {value}, so {option} has no effect"));
            }
        };
        let tones = art.layers.iter().any(|layer| read.tones.contains(layer.ink));
        lacks("--tones", &self.tones, !tones);
        let laid = &composed.report.laid;
        let knocks = laid.iter().any(|laid| settings.knockout.iter().any(|ink| ink.name() == laid.ink));
        lacks("--knockout", &self.knockout, !knocks && !settings.knockout.is_empty());
        if art.colour.is_none() {
            let mut plain = |option: &str| {
                notes.push(format!("the art has layers alone and no colours, so {option} has no effect"));
            };
            if settings.gamma != art::Settings::default().gamma {
                plain("--gamma");
            }
            if settings.intent != art::Settings::default().intent {
                plain("--intent");
            }
            if settings.text != art::Settings::default().text {
                plain("--text");
            }
        }
        notes
    }
}

/// Art and everything that decides what comes of it on paper.
#[derive(ClapArgs, Debug)]
pub struct Work {
    #[command(flatten)]
    layers: LayersArgs,
    /// Size on paper, such as 120x90mm, 12cm or 5x4in
    ///
    /// The artwork keeps its proportions. [default: the size stated in the files, else 600 dpi for layers
    /// and as large as the page allows for a plain picture]
    #[arg(long)]
    size: Option<Size>,
    /// Lay one page, picture or drawing on the sheet as print servers do: turned if it fits larger so, in the
    /// middle, and as large as this says; --at moves its corner
    #[arg(long, value_name = "HOW", value_parser = choice::<Scaling>())]
    #[arg(conflicts_with_all = ["size", "repeat", "resolution"])]
    fit: Option<Scaling>,
    /// Resolution of the print across the sheet: 600, or 1200 for art in cyan, magenta, yellow and black
    /// only
    ///
    /// Along the sheet it is always 600 dpi. The printer prints every other ink wrong at 1200 dpi, so such
    /// a job is refused.
    #[arg(long, value_name = "DPI", default_value = "600", value_parser = resolution)]
    resolution: Resolution,
    /// Write the lines for a cutter, with the registration marks, to this SVG in millimetres of the sheet
    ///
    /// They are what the art has in a spot colour or layer named CutContour, KissCut, ThruCut, PerfCut,
    /// Crease, Dieline and the like. Never printed, with this option or without.
    #[arg(long, value_name = "FILE.svg")]
    cut_lines: Option<PathBuf>,
    #[command(flatten)]
    layout: LayoutArgs,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    preset: PresetArg,
}

/// Arguments of `layers`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress layers white.png gold.png black.png\n  \
    foilpress layers decal/ --passes white=3 --finish artwork --mirror --media film\n  \
    foilpress layers art.png --reserved --inks white,gold,black\n  \
    foilpress layers art.png --colour \"#e1a000=gold,e6e6e6=white\"\n  \
    foilpress layers art.svg --white silhouette --choke 0.1mm --repeat 2x4 --gap 3mm --crop-marks\n  \
    foilpress layers decal.pdf --page 1 --white alpha\n  \
    foilpress layers plates.pdf --pages white,gold,black    (one page per ink)\n  \
    foilpress layers photo.png --size 120mm --to serial:/dev/ttyACM0\n  \
    foilpress layers photo.png --fit auto --paper postcard  (turned, as large as fits)\n  \
    foilpress plan layers white.png gold.png black.png      (only the plan; nothing is written or sent)\n\n\
    In a layer, dark pixels are ink; on a transparent background, everything drawn is ink. Artwork drawn at 600 dpi is \
    printed dot for dot."
)]
pub struct Args {
    #[command(flatten)]
    work: Work,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Arguments of `plan layers`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress plan layers white.png gold.png black.png --passes white=3\n  \
    foilpress plan layers decal/ --repeat 3x4 --gap 2mm --html plan.html     (one page to keep beside the printer)\n  \
    foilpress plan layers art.svg --json\n\n\
    Takes the options of `foilpress layers` that decide what is printed, but not those that decide where it goes."
)]
pub struct PlanArgs {
    #[command(flatten)]
    work: Work,
    #[command(flatten)]
    output: PlanOutputArgs,
}

impl Args {
    /// The same choices as a print dialog makes them, for documents that come from elsewhere.
    #[cfg(feature = "serve")]
    pub fn choices(&self, observer: &dyn Observer) -> Result<Choices> {
        let Work { layers, layout, media, .. } = &self.work;
        let (settings, layout, handling) = (layers.settings()?, layout.layout(observer)?, media.handling());
        let process = InkSet::of([Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black]);
        Ok(Choices {
            media: handling.media,
            curl_correction: handling.curl_correction,
            colours: InkSet::of(settings.inks.iter().filter(|&ink| process.contains(ink))),
            spots: if layers.reserved { Spots::Reserved } else { Spots::Named },
            inks_of: layers.colours()?,
            tolerance: layers.tolerance,
            foils: settings.inks.iter().any(|ink| ink.kind() == protocol::ink::Kind::Foil),
            white: settings.white.unwrap_or(White::None),
            finish: settings.finish.unwrap_or(Finish::None),
            dpi: 600,
            intent: settings.intent,
            gamma: settings.gamma,
            halftone: settings.halftone,
            place: match layout.position {
                Position::FromEdge(corner) => Place::At(corner),
                Position::FromPrintable(_) | Position::Centred => Place::Page,
            },
            fit: self.work.wish(&layout),
            mirror: layout.mirror,
            custom_paper: false,
            profile: layout.profile,
            pages: Vec::new(),
            paper: layout.paper,
            more: settings,
        })
    }
}

impl Work {
    /// How the art is laid on the sheet, if that was asked for.
    fn wish(&self, layout: &Layout) -> Option<Wish> {
        let corner = if let Position::FromEdge(corner) = layout.position { Some(corner) } else { None };
        Some(Wish { scaling: self.fit?, corner, ..Wish::default() })
    }

    /// Reads the art, composes it, and hands what is to be printed to `then`. `page` makes the page of a
    /// layout.
    fn with<T>(
        &self,
        page: impl FnOnce(Layout) -> PageSettings,
        observer: &dyn Observer,
        then: impl FnOnce(&str, Layers<'_>) -> Result<T>,
    ) -> Result<T> {
        let library = self.layers.library()?;
        let layout = Layout { resolution: self.resolution, ..self.layout.layout(observer)? };
        let lines = self.cut_lines.as_deref().map(Staged::file).transpose()?;
        let mut settings = Settings {
            read: self.layers.options(self.size, lines.is_some())?,
            compose: self.layers.settings()?,
            library,
            page: page(layout),
            how: advice::options_of,
        };
        if let Some(wish) = self.wish(&settings.page.layout) {
            let paper = settings.page.layout.paper;
            let fitted = Fitted::of(&self.layers.art, &settings.read, paper, &wish)?;
            settings = fitted.settings(settings);
            Some(fitted.to_string())
                .filter(|said| !said.is_empty())
                .iter()
                .for_each(|said| observer.note(said));
        }
        let art = Layers::open(&self.layers.art, &settings, observer)?;
        let lines = match (lines, &self.cut_lines) {
            (Some(staged), Some(to)) => Some((staged, cut_lines::drawing(&art, &settings.page.layout, to)?)),
            _ => None,
        };
        let mut layers = Layers::compose(&art, &settings, observer)?;
        for note in self.layers.idle(&art, &settings, &layers.composed) {
            observer.note(&note);
            layers.composed.report.notes.push(note);
        }
        let done = then(&art.name, layers)?;
        if let Some((staged, drawing)) = lines {
            write(staged.path(), drawing.as_bytes())?;
            staged.commit()?;
        }
        Ok(done)
    }
}

/// Runs `layers`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let Args { work, result, deliver } = args;
    let page = |layout| printing::page(layout, &work.media, result);
    work.with(page, observer, |name, layers| {
        let places = Places::new(name, result, deliver)?;
        let advice = words(&layers.composed);
        let made = layers.made(observer)?;
        places.write(&made, observer)?;
        places.finish(&made, Value::Null, (&advice, "preview.png"), result, deliver, observer)
    })
}

/// Runs `plan layers`.
pub fn plan(args: &PlanArgs, observer: &dyn Observer) -> Result<()> {
    let staged = args.output.stage()?;
    let handling = args.work.media.handling();
    let page = |layout| PageSettings { layout, handling, ..PageSettings::default() };
    args.work.with(page, observer, |_, layers| {
        let draft = layers.draft(observer)?;
        let report = json!({ "art": { "composed": layers.composed.report } });
        args.output.show(staged, draft.into(), &report, &words(&layers.composed))
    })
}

/// What was laid, in words.
fn words(composed: &Composed) -> String {
    let mut text = String::from("\nFrom the art, lowest first:\n");
    for laid in &composed.report.laid {
        let times = if laid.passes > 1 { format!(", {} times", laid.passes) } else { String::new() };
        text.push_str(&format!(
            "    {:<18} {:>13} dots  {}{times}\n",
            laid.ink,
            grouped(laid.dots),
            laid.from
        ));
    }
    text
}

#[cfg(all(test, feature = "serve"))]
mod tests {
    use super::*;
    use clap::Parser;
    use make::options::PAGE;
    use observe::Silent;
    use queue::options::read;
    use serve::template::Ticket;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    /// What the command line chooses; what no dialog shows is left out.
    fn typed(words: &[&str]) -> Choices {
        let words = ["layers", "art.png"].iter().chain(words);
        let choices = Command::parse_from(words).args.choices(&Silent).unwrap();
        Choices { more: art::Settings::default(), ..choices }
    }

    fn picked(keyword: &str, value: &str) -> Choices {
        read(&[(keyword.into(), value.into())], None).unwrap()
    }

    #[test]
    fn every_option_means_the_same_through_every_door() {
        let (bare, usual) = (typed(&[]), Choices::default());
        let mut doors = [0; 3];
        for (option, value) in PAGE.iter().flat_map(|option| option.values.iter().map(move |v| (option, v))) {
            let wish = |choices: &Choices| {
                let mut choices = choices.clone();
                (value.set)(&mut choices);
                choices
            };
            if !value.name.is_empty() {
                let option = format!("--{}", option.name);
                let halftone_alone = ["fine", "blue"].contains(&value.name);
                assert_eq!(typed(&[&option, value.name]), wish(&bare), "{option} {}", value.name);
                doors[0] += usize::from(!halftone_alone);
            }
            if !value.dialog.0.is_empty() {
                assert_eq!(picked(option.keyword, value.dialog.0), wish(&usual), "{:?}", value.dialog);
                doors[1] += 1;
            }
            for (attribute, word) in value.attributes {
                let mut ticket = Ticket::default();
                assert!(ticket.ask(attribute, word), "{attribute}={word}");
                // A server's sheet is given.
                let asked = Choices { fit: None, ..ticket.choices(&bare) };
                assert_eq!(asked, wish(&bare), "{attribute}={word}");
                doors[2] += 1;
            }
        }
        // Sheets alone are twenty-three on the command line.
        assert!(doors[0] > 30 && doors[1] > 40 && doors[2] > 10, "{doors:?}");
    }

    #[test]
    fn what_is_typed_freely_is_read_alike() {
        for (words, keyword, value) in [
            (&["--gamma", "1.7"][..], "FoilpressGamma", "1.7"),
            (&["--at", "20x30mm"], "FoilpressPosition", "Custom.20x30mm"),
            (&["--colour", "#ff0000=gold,00ff00=white"], "FoilpressColour", "#ff0000=gold,00ff00=white"),
            (&["--reserved", "--tolerance", "20"], "FoilpressTolerance", "20"),
            (&["--reserved"], "FoilpressSpots", "Reserved"),
            (&["--mirror"], "MirrorPrint", "True"),
        ] {
            let (typed, picked) = (typed(words), picked(keyword, value));
            let of = |c: Choices| (c.gamma, c.place, c.inks_of, c.tolerance, c.mirror);
            let both = (typed.spots == picked.spots, keyword == "FoilpressTolerance");
            assert!(both != (false, false), "{words:?}");
            assert_eq!(of(typed), of(picked), "{words:?}");
        }
    }

    #[test]
    fn a_picture_is_laid_as_a_print_server_lays_it_byte_for_byte() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let picture = readers::Pixels::from_fn(90, 60, |x, y| [(2 * x) as u8, 90, (4 * y) as u8]);
        std::fs::write(&path, picture.png().unwrap()).unwrap();
        for how in ["auto", "fill"] {
            let typed = ["layers", path.to_str().unwrap(), "--fit", how, "--paper", "postcard"];
            let Args { work, .. } = Command::parse_from(typed).args;
            let page = |layout| PageSettings { layout, ..PageSettings::default() };
            let laid = work.with(page, &Silent, |_, layers| Ok(layers.made(&Silent)?.job.bytes)).unwrap();
            let choices = Command::parse_from(typed).args.choices(&Silent).unwrap();
            let (mut served, library) = (Vec::new(), Library::builtin());
            let file = std::fs::File::open(&path).unwrap();
            queue::filter::run(file, Some(&path), &choices, &library, &mut served, &Silent).unwrap();
            assert!(laid == served, "{how}");
        }
    }
}
