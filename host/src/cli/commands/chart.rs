//! `foilpress chart`: sheets made to look at, to measure inks and to calibrate the printer.

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use inks::{InkSet, Library, Stack};
use protocol::ink::Ink;

use crate::cli::arguments::layout::MediaArgs;
use crate::cli::arguments::{HalftoneArg, InkArgs};
use crate::cli::commands::preview::figure::mirroring;
use crate::cli::output::Staged;
use crate::cli::printing::deliver::DeliverArgs;
use crate::cli::printing::{self, JobArgs, ResultArgs, print_dots};
use art::names::typed;
use device::connection::Destination;
use device::deliver::{Cartridges, find_cartridges};
use device::questions::status::Status;
use observe::Observer;
use press::chart;
use press::layout::{Layout, paper};
use press::separate::MOST_CARTRIDGES;
use sheet::DotMap;

/// Arguments of `chart`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress chart first --to serial:/dev/ttyACM0       (a printer's first sheet: 5 mm of black)\n  \
    foilpress chart heads --inks black,white             (a narrow strip for each cartridge)\n  \
    foilpress chart ramp silver-foil metallic-silver     (figure 2 of the paper)\n  \
    foilpress chart ladder                               (figure 5: four levels of gloss, MS+F to MS)\n  \
    foilpress chart ladder C+M+Y+F C+M+Y\n  \
    foilpress chart halftone                             (black on paper by each halftone)\n  \
    foilpress chart stacks --inks process,MS,F           (a labelled patch of each stack, to measure)\n  \
    foilpress chart stacks --inks MS,C,F --strips        (strips to wrap round a can of 50 mm radius)\n  \
    foilpress chart stacks --inks K,F --strips 33x95     (round a drink can)\n  \
    foilpress chart registration --inks black,cyan,white\n  \
    foilpress chart calibration --to serial:/dev/ttyACM0")]
pub struct Args {
    #[command(subcommand)]
    chart: Chart,
}

#[derive(Subcommand, Debug)]
enum Chart {
    /// Print four bars with 5 mm of one cartridge on plain paper, and say what a ruler must find: the first sheet of a printer
    First(First),
    /// Print a narrow strip for each ink, and say what to look for: the state of the head and of each cartridge
    Heads(Heads),
    /// Print a halftoned ramp from one stack to another, clusters of 1 to 24 dots of both for `measure ramp`, and a checkerboard
    /// to hold so that the ramp reflects it
    Ramp(Ramp),
    /// Print four levels of gloss between a glossy and a dull stack, both clamped and with their differences kept
    Ladder(Ladder),
    /// Print a ramp, flat patches and small text by each halftone side by side, to see which the printer holds
    Halftone(Halftone),
    /// Print a labelled patch of every stack that the chosen inks can make
    Stacks(Stacks),
    /// Print verniers between the first ink and each other ink, to see how far apart passes land, with marks for
    /// `measure registration`
    Registration(Registration),
    /// Print two crosses to measure with a ruler, for `foilpress profile set`: where this printer prints and how far it
    /// feeds
    Calibration(Calibration),
}

#[derive(ClapArgs, Debug)]
struct First {
    /// Ink to print with
    #[arg(long, default_value = "black", value_parser = typed)]
    ink: Ink,
    #[command(flatten)]
    whole: WholePage,
}

#[derive(ClapArgs, Debug)]
struct Heads {
    /// Inks of the strips, separated by commas [default: the cartridges that the printer at --to says are loaded; without a
    /// bridge there black,cyan,magenta,yellow]
    #[arg(long, value_name = "INKS", value_delimiter = ',', value_parser = typed)]
    inks: Vec<Ink>,
    #[command(flatten)]
    whole: WholePage,
}

#[derive(ClapArgs, Debug)]
struct Ramp {
    /// Stack on the left: short or long names of inks joined by +, from the bottom, such as MS or MS+C
    first: Stack,
    /// Stack on the right
    second: Stack,
    /// Draw the ramp before a checkerboard that it mirrors, too: figure 2 of the 2009 paper (.png)
    #[arg(long, value_name = "FILE.png", value_parser = png)]
    figure: Option<std::path::PathBuf>,
    #[command(flatten)]
    halftone: HalftoneArg,
    #[command(flatten)]
    step: StepArgs,
}

/// What charts between two stacks share.
#[derive(ClapArgs, Debug)]
struct StepArgs {
    /// Your own ink library: its folder, or the name it was added under [default: the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    library: Option<std::path::PathBuf>,
    #[command(flatten)]
    job: JobArgs,
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
    halftone: HalftoneArg,
    #[command(flatten)]
    step: StepArgs,
}

#[derive(ClapArgs, Debug)]
struct Halftone {
    /// First stack: short or long names of inks joined by +, from the bottom
    #[arg(default_value = "K", requires = "second")]
    first: Stack,
    /// Second stack; substrate is the bare paper
    #[arg(default_value = "substrate")]
    second: Stack,
    #[command(flatten)]
    step: StepArgs,
}

#[derive(ClapArgs, Debug)]
struct Stacks {
    #[command(flatten)]
    inks: InkArgs,
    /// Print strips, one below the other, to wrap round a can: its radius, or radius and height in mm, such as 33x95
    #[arg(long, value_name = "CAN", num_args = 0..=1, default_missing_value = "50")]
    strips: Option<chart::Can>,
    #[command(flatten)]
    job: JobArgs,
}

#[derive(ClapArgs, Debug)]
struct Registration {
    /// Inks, separated by commas; the first is compared with each of the others
    #[arg(long, value_name = "INKS", value_delimiter = ',', default_value = "black,cyan,magenta,yellow", value_parser = typed)]
    inks: Vec<Ink>,
    #[command(flatten)]
    whole: WholePage,
}

#[derive(ClapArgs, Debug)]
struct Calibration {
    /// Ink to print with
    #[arg(long, default_value = "black", value_parser = typed)]
    ink: Ink,
    #[command(flatten)]
    whole: WholePage,
}

/// Charts of the whole printable area have no layout but their paper, and measure the printer as it is.
#[derive(ClapArgs, Debug)]
struct WholePage {
    /// Paper size: a4, letter, legal, executive, b5, postcard, or the size of the sheet such as 120x180mm
    #[arg(long, default_value = "a4", value_parser = paper::read)]
    paper: protocol::paper::Paper,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Inks of `chart stacks` when none are named: as many as the printer holds.
const USUAL: &str = "process,metallic-silver,metallic-gold,finish";

/// Runs `chart`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match &args.chart {
        Chart::Ramp(Ramp { first, second, figure, halftone, step }) => {
            let make = |library: &Library| {
                let dots =
                    chart::ramp(first, second, halftone.halftone.unwrap_or_default(), library, observer)?;
                if let Some(path) = figure {
                    let (staged, ramp) = (Staged::file(path)?, chart::ramp::parts().ramp);
                    let name = format!("{first} to {second}");
                    let picture = mirroring(&name, &dots, ramp, library, observer)?;
                    std::fs::write(staged.path(), picture.png()?)
                        .with_context(|| format!("cannot write {}", path.display()))?;
                    staged.commit()?;
                }
                Ok(dots)
            };
            step.run("ramp", chart::ramp::parts().size, make, [first, second], observer)
        }
        Chart::Ladder(Ladder { glossy, dull, halftone, step }) => {
            let make = |library: &Library| {
                Ok(chart::ladder(glossy, dull, halftone.halftone.unwrap_or_default(), library, observer)?)
            };
            step.run("ladder", chart::size_of_ladder(), make, [glossy, dull], observer)
        }
        Chart::Halftone(Halftone { first, second, step }) => {
            let make = |library: &Library| Ok(chart::halftones(first, second, library, observer)?);
            step.run("halftone", chart::size_of_halftones(first, second), make, [first, second], observer)
        }
        Chart::Stacks(stacks) => {
            let usual = InkArgs { inks: Some(USUAL.into()), ..stacks.inks.clone() };
            let (set, library) = if stacks.inks.inks.is_some() { &stacks.inks } else { &usual }.at_hand()?;
            if set.len() > MOST_CARTRIDGES {
                bail!(
                    "--inks: {} inks, but the printer holds {MOST_CARTRIDGES} cartridges; print several charts, each of some \
                     inks, such as --inks {USUAL}",
                    set.len()
                );
            }
            let all: Vec<Stack> = library.at_hand(&set).iter().map(|entry| entry.stack.clone()).collect();
            let dots = chart::stacks(&all, stacks.job.layout.paper, stacks.strips)?;
            let layout = layout(&stacks.job, observer)?;
            chart::check_room("stacks", (dots.width(), dots.length()), &layout)?;
            print(("stacks", &dots), (set, &library), layout, &stacks.job, observer)
        }
        Chart::Registration(registration) => {
            let inks = once_each(&registration.inks)?;
            let dots = chart::registration(inks, registration.whole.paper)?;
            registration.whole.print("registration", &dots, (inks, ""), true, observer)
        }
        Chart::Calibration(calibration) => {
            let ink = calibration.ink;
            let dots = chart::calibration(ink, calibration.whole.paper, &NEXT)?;
            calibration.whole.print("calibration", &dots, (&[ink], ""), false, observer)
        }
        Chart::First(First { ink, whole }) => {
            let dots = chart::first(*ink, whole.paper)?;
            whole.print("first", &dots, (&[*ink], &on_first()), false, observer)
        }
        Chart::Heads(Heads { inks, whole }) => {
            let inks = if inks.is_empty() { &whole.loaded(observer)? } else { inks };
            let dots = chart::heads(once_each(inks)?, whole.paper)?;
            whole.print("heads", &dots, (inks, ON_HEADS), false, observer)
        }
    }
}

/// The name of a picture.
fn png(name: &str) -> Result<std::path::PathBuf, String> {
    let ends = name.to_ascii_lowercase().ends_with(".png");
    if ends { Ok(name.into()) } else { Err("a figure is a picture; name a .png".into()) }
}

/// Inks of the strips if nobody says more.
const PROCESS: [Ink; 4] = [Ink::Black, Ink::Cyan, Ink::Magenta, Ink::Yellow];

/// The inks of the cartridges that can print, each once; none if the answer is that of before an error.
fn loaded(status: &Status) -> Vec<Ink> {
    let mut inks = Vec::new();
    for cartridge in
        status.cartridges.iter().filter(|cartridge| cartridge.condition == "loaded" && !status.stale)
    {
        match Ink::from_barcode(cartridge.barcode) {
            Some(ink) if !inks.contains(&ink) => inks.push(ink),
            _ => {}
        }
    }
    inks
}

/// Inks none of which is given twice.
fn once_each(inks: &[Ink]) -> Result<&[Ink]> {
    match inks.iter().enumerate().find(|(i, ink)| inks[..*i].contains(ink)) {
        Some((_, twice)) => bail!("--inks: {} is given twice", twice.name()),
        None => Ok(inks),
    }
}

/// What a ruler must find on the first sheet.
fn on_first() -> String {
    use chart::first::{APART, BARS, PLACE, WIDE};
    format!(
        "\nA ruler must find: {BARS} bars, {WIDE:.1} mm wide, {APART:.1} mm from bar to bar; the first {:.1} mm from the left edge of the \
         sheet and {:.1} mm from the top edge.\nUp to 2 mm beside is how printers differ: `foilpress chart calibration` measures it. After a \
         long rest the first sheets are faint.\n",
        PLACE.0, PLACE.1
    )
}

/// What to look for on the strips.
const ON_HEADS: &str = "\nLook for: an area without streaks across the sheet (a streak in every ink is the head, in one ink its ribbon); steps of \
    lines without a gap (a line that is missing in every ink is a dead place of the head); a chequer that is even (grey or torn: a \
    ribbon that does not run, or paper that is too rough).\n";

/// What to do with what was measured on the calibration chart, printed on it.
const NEXT: [&str; 2] = ["3. foilpress profile set default --cross X,Ymm \\", "       --distance Dmm"];

/// The page. Charts are there to be photographed.
fn layout(args: &JobArgs, observer: &dyn Observer) -> Result<Layout> {
    Ok(Layout { camera_marks: true, ..args.layout.layout(observer)? })
}

fn print(
    (name, dots): (&str, &DotMap),
    inks: (InkSet, &Library),
    layout: Layout,
    args: &JobArgs,
    observer: &dyn Observer,
) -> Result<()> {
    print_dots((name, dots, ""), inks, &args.page(layout), &args.result, &args.deliver, observer)
}

impl StepArgs {
    fn run(
        &self,
        name: &'static str,
        size: (usize, usize),
        make: impl FnOnce(&Library) -> Result<DotMap>,
        [first, second]: [&Stack; 2],
        observer: &dyn Observer,
    ) -> Result<()> {
        let library = InkArgs::of(None, self.library.clone()).library()?;
        let layout = layout(&self.job, observer)?;
        chart::check_room(name, size, &layout)?;
        let dots = make(&library)?;
        let name = format!("{name} {first} {second}");
        // Who names a foil wants it.
        print((&name, &dots), (InkSet::ALL, &library), layout, &self.job, observer)
            .with_context(|| name.clone())
    }
}

impl WholePage {
    /// The inks that the printer at the destination says are loaded; the process inks if there is no printer to ask.
    fn loaded(&self, observer: &dyn Observer) -> Result<Vec<Ink>> {
        let Some(Destination::Bridge(address)) = &self.deliver.to else { return Ok(PROCESS.to_vec()) };
        let why = match find_cartridges(address, &[]) {
            Cartridges::Unknown(why) => why,
            Cartridges::Known { status, .. } => match loaded(&status) {
                inks if inks.is_empty() => "it reports none that it could print with".into(),
                inks => return Ok(inks),
            },
        };
        let usual = PROCESS.map(Ink::name).join(", ");
        observer.note(&format!(
            "which cartridges are in the printer is not known ({why}): the strips are in {usual}; --inks names others"
        ));
        Ok(PROCESS.to_vec())
    }

    fn print(
        &self,
        name: &str,
        dots: &DotMap,
        (inks, advice): (&[Ink], &str),
        camera_marks: bool,
        observer: &dyn Observer,
    ) -> Result<()> {
        let library = Library::builtin();
        let allowed = InkSet::of(inks.iter().copied());
        let layout = Layout { camera_marks, ..Layout::centred(self.paper) };
        let page = printing::page(layout, &self.media, &self.result);
        let inks = (allowed, &library);
        print_dots((name, dots, advice), inks, &page, &self.result, &self.deliver, observer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use press::simulate::{Carousel, Cartridge, Condition, Lever, Printer, Trouble};

    #[test]
    fn strips_are_of_the_cartridges_that_the_printer_says_can_print() {
        let spent = Cartridge { condition: Condition::Backwards, ..Ink::Finish.into() };
        let cartridges = [Ink::White.into(), spent, Ink::Cyan.into(), Ink::White.into()];
        let mut printer = Printer::new(Carousel::new(&cartridges).unwrap(), Lever::Auto);
        let answer = |printer: &Printer| loaded(&Status::read(&printer.status()).unwrap());
        let mut found = answer(&printer);
        found.sort();
        assert_eq!(found, [Ink::Cyan, Ink::White]);
        printer.strike(Trouble::CoverOpen);
        assert_eq!(answer(&printer), [], "what was true before an error decides nothing");
    }
}
