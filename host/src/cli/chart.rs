//! `foilpress chart`: sheets made to look at, to measure inks and to measure the machine.

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use inks::{InkSet, Library, Stack};
use protocol::ink::Ink;

use super::args::InkArgs;
use super::deliver::DeliverArgs;
use super::layout::{MediaArgs, ink};
use super::piece::{self, Job, PieceArgs, ResultArgs};
use observe::Observer;
use press::chart;
use press::layout::{self, Layout};
use press::separate::MOST_CARTRIDGES;
use press::sheet::Piece;

/// Arguments of `chart`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress chart ramp silver-foil metallic-silver     (figure 2 of the paper)\n  \
    foilpress chart ladder                               (figure 5: four levels of gloss, MS+F to MS)\n  \
    foilpress chart ladder C+M+Y+F C+M+Y\n  \
    foilpress chart stacks --inks process,MS,F           (a labelled patch of each stack, to measure)\n  \
    foilpress chart registration --inks black,cyan,white\n  \
    foilpress chart calibration --to serial:/dev/ttyACM0")]
pub struct Args {
    #[command(subcommand)]
    chart: Chart,
}

#[derive(Subcommand, Debug)]
enum Chart {
    /// Print a halftoned ramp from one stack to another, with a checkerboard to hold so that the ramp reflects it
    Ramp(Ramp),
    /// Print four levels of gloss between a glossy and a dull stack, both clamped and with their differences kept
    Ladder(Ladder),
    /// Print a labelled patch of every stack that the chosen inks can make
    Stacks(Stacks),
    /// Print verniers between the first ink and each other ink, to measure how far apart passes land
    Registration(Registration),
    /// Print two crosses to measure with a ruler, for `foilpress profile set`: where this printer prints and how far it
    /// feeds
    Calibration(Calibration),
}

#[derive(ClapArgs, Debug)]
struct Ramp {
    /// Stack on the left: short or long names of inks joined by +, from the bottom, such as MS or MS+C
    first: Stack,
    /// Stack on the right
    second: Stack,
    #[command(flatten)]
    step: StepArgs,
}

/// What charts between two stacks share.
#[derive(ClapArgs, Debug)]
struct StepArgs {
    /// Folder of your own ink library [default: the built-in library]
    #[arg(long, value_name = "DIR")]
    library: Option<std::path::PathBuf>,
    #[command(flatten)]
    piece: PieceArgs,
}

#[derive(ClapArgs, Debug)]
struct Ladder {
    /// Glossier stack: short or long names of inks joined by +, from the bottom
    #[arg(default_value = "MS+F", requires = "dull")]
    glossy: Stack,
    /// Duller stack
    #[arg(default_value = "MS")]
    dull: Stack,
    #[command(flatten)]
    step: StepArgs,
}

#[derive(ClapArgs, Debug)]
struct Stacks {
    #[command(flatten)]
    inks: InkArgs,
    #[command(flatten)]
    piece: PieceArgs,
}

#[derive(ClapArgs, Debug)]
struct Registration {
    /// Inks, separated by commas; the first is compared with each of the others
    #[arg(long, value_name = "INKS", value_delimiter = ',', default_value = "black,cyan,magenta,yellow", value_parser = ink)]
    inks: Vec<Ink>,
    #[command(flatten)]
    whole: WholePage,
}

#[derive(ClapArgs, Debug)]
struct Calibration {
    /// Ink to print with
    #[arg(long, default_value = "black", value_parser = ink)]
    ink: Ink,
    #[command(flatten)]
    whole: WholePage,
}

/// Charts of the whole printable area have no layout but their paper, and measure the machine as it is.
#[derive(ClapArgs, Debug)]
struct WholePage {
    /// Paper size: a4, letter, legal, executive, b5, postcard, or the size of the sheet such as 120x180mm
    #[arg(long, default_value = "a4", value_parser = layout::paper::read)]
    paper: protocol::paper::Paper,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Inks of `chart stacks` when none are named: as many as go in.
const USUAL: &str = "process,metallic-silver,metallic-gold,finish";

/// Runs `chart`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match &args.chart {
        Chart::Ramp(Ramp { first, second, step }) => step.run("ramp", chart::ramp, [first, second], observer),
        Chart::Ladder(Ladder { glossy, dull, step }) => {
            step.run("ladder", chart::ladder, [glossy, dull], observer)
        }
        Chart::Stacks(stacks) => {
            let usual = InkArgs { inks: Some(USUAL.into()), library: stacks.inks.library.clone() };
            let (set, library) = if stacks.inks.inks.is_some() { &stacks.inks } else { &usual }.at_hand()?;
            if set.len() > MOST_CARTRIDGES {
                bail!(
                    "--inks: {} inks, but the machine holds {MOST_CARTRIDGES} cartridges; print a chart for some at a time, \
                     such as --inks {USUAL}",
                    set.len()
                );
            }
            let all: Vec<Stack> = library.at_hand(&set).iter().map(|entry| entry.stack.clone()).collect();
            let piece = chart::stacks(&all, stacks.piece.layout.paper)?;
            let job = Job {
                name: "stacks",
                piece: &piece,
                allowed: set,
                library: &library,
                report: None,
                advice: String::new(),
            };
            piece::print(&job, &stacks.piece, observer)
        }
        Chart::Registration(registration) => {
            let inks = &registration.inks;
            if let Some(twice) = inks.iter().enumerate().find(|(i, ink)| inks[..*i].contains(ink)) {
                bail!("--inks: {} comes twice", twice.1.name());
            }
            let piece = chart::registration(inks, registration.whole.paper)?;
            registration.whole.print("registration", &piece, inks, observer)
        }
        Chart::Calibration(calibration) => {
            let ink = calibration.ink;
            let piece = chart::calibration(ink, calibration.whole.paper)?;
            calibration.whole.print("calibration", &piece, &[ink], observer)
        }
    }
}

type Make = fn(&Stack, &Stack, &Library, &dyn Observer) -> Result<Piece, chart::ChartError>;

impl StepArgs {
    fn run(
        &self,
        name: &str,
        make: Make,
        [first, second]: [&Stack; 2],
        observer: &dyn Observer,
    ) -> Result<()> {
        let library = InkArgs { inks: None, library: self.library.clone() }.library()?;
        let piece = make(first, second, &library, observer)?;
        // Who names a foil wants it.
        let allowed = InkSet::ALL;
        let name = format!("{name} {first} {second}");
        let job = Job {
            name: &name,
            piece: &piece,
            allowed,
            library: &library,
            report: None,
            advice: String::new(),
        };
        piece::print(&job, &self.piece, observer).with_context(|| name.clone())
    }
}

impl WholePage {
    fn print(&self, name: &str, piece: &Piece, inks: &[Ink], observer: &dyn Observer) -> Result<()> {
        let library = Library::builtin();
        let allowed = InkSet::of(inks.iter().copied());
        let job = Job { name, piece, allowed, library: &library, report: None, advice: String::new() };
        let layout = Layout::centred(self.paper);
        piece::print_on(&job, &layout, &self.media, &self.result, &self.deliver, observer)
    }
}
