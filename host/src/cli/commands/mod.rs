//! A module for each subcommand: its arguments, and the function that turns them into settings of the library crates and
//! results into words. `inks`, `bridge`, `measure` and `preview` have a folder for theirs. What commands share is beside this
//! folder: `arguments`, `console`, `printing`, `output`.

pub mod bridge;
pub mod chart;
pub mod compare;
pub mod display;
pub mod doctor;
pub mod edit;
pub mod generate;
pub mod inks;
pub mod inspect;
pub mod layers;
pub mod ledger;
pub mod measure;
pub mod papers;
pub mod plan;
pub mod preset;
pub mod preview;
pub mod print;
pub mod profile;
pub mod queue;
pub mod resume;
pub mod sample;
pub mod send;
pub mod serve;
pub mod steps;

use anyhow::Result;
use clap::Subcommand;
use observe::Observer;

/// What the program can do.
#[derive(Subcommand)]
pub enum Command {
    /// Print a document of materials
    ///
    /// Writes one folder with the job, the plan, the sheet as the simulated printer prints it, and previews. With --to the
    /// job is also sent to a printer.
    Print(Box<print::Args>),
    /// Print spot-colour artwork
    ///
    /// It is a picture for each ink, one picture with reserved colours, or a drawing or document with named layers.
    ///
    /// Writes one folder with the job, the plan, the sheet as the simulated printer prints it, and previews. With --to the
    /// job is also sent to a printer.
    Layers(Box<layers::Args>),
    /// Show what a print needs: cartridges, passes, ribbon, time, cautions
    ///
    /// Sends nothing, and writes nothing unless --html names a file.
    Plan(Box<plan::Args>),
    /// Show a document or a sheet under any light, as a page or a picture
    ///
    /// The page is for a browser: the sheet is turned, bent and lit by hand.
    Preview(Box<preview::Args>),
    /// Compare photographs of a printed sheet with its prediction
    ///
    /// Shows figures, and writes a page with sliders.
    Compare(Box<compare::Args>),
    /// Make a display: a printed grid of stacks under a screen
    ///
    /// Writes one folder with the job of the grid, a mask for each image and one to align by, pictures of what is seen, and a
    /// page that shows it all. With --to the job is also sent to a printer.
    Display(Box<display::Args>),
    /// Print a chart to judge stacks, measure inks or calibrate the printer
    Chart(Box<chart::Args>),
    /// Save, list and use named sets of options
    Preset(preset::Args),
    /// Show how much ribbon each cartridge has used
    Ledger(ledger::Args),
    /// List paper sizes with their printable areas and margins
    ///
    /// Says how well each is known.
    Papers(papers::Args),
    /// Manage printer calibration profiles (offset, feed)
    Profile(profile::Args),
    /// Factor a document into a few basis materials and their weight maps
    Factor(steps::Factor),
    /// Edit the basis materials of a document
    ///
    /// They become rougher or glossier, are tinted, replaced, mixed or swapped, everywhere or under a mask. The document itself
    /// stays as it is. The edited document keeps its steps, which can be changed and replayed.
    Edit(edit::Args),
    /// Map basis materials (or every pixel) to mixtures of printable stacks
    Map(steps::Map),
    /// Choose one stack for every dot of a document
    Halftone(steps::Halftone),
    /// Lay dots on a page: position, copies, marks, mirror, profile
    Layout(steps::Layout),
    /// Split a page into one-bit passes, one ink each
    Separate(steps::Separate),
    /// Encode passes as a job in the printer's language
    Encode(steps::Encode),
    /// Print a job on the simulated printer and keep the sheet
    Simulate(steps::Simulate),
    /// Describe a job and report errors with their byte offset
    Inspect(inspect::Args),
    /// Send a job to a printer, through a bridge or directly to a device
    Send(send::Args),
    /// Resume an interrupted job
    Resume(resume::Resume),
    /// Cancel a job and leave the printer ready for the next one
    Cancel(resume::Cancel),
    /// List bridges and show their status; flash, test or reset a bridge
    Bridge(bridge::Args),
    /// Find out what prevents printing and how to fix it
    Doctor(doctor::Args),
    /// Manage ink libraries, and choose cartridges
    Inks(inks::Args),
    /// Measure printed stacks from photographs
    ///
    /// Turns series of exposures of a print round a can, with a grey card in the picture, into an ink library with curves,
    /// their uncertainty and their provenance.
    Measure(measure::Args),
    /// Be a printer for every device of the house, without drivers
    ///
    /// Phones, tablets, Windows, macOS and Linux print to it as to any other printer on the network (IPP Everywhere).
    Serve(serve::Args),
    /// Install, remove and list print queues of the system
    Queue(queue::Args),
    /// Deliver a job to the printer (called by the print system)
    #[command(hide = true)]
    CupsBackend(queue::Conventional),
    /// Turn pages into jobs (called by the print system)
    #[command(hide = true)]
    CupsFilter(queue::Conventional),
    /// Write the files that a package needs besides the program
    #[command(hide = true)]
    Generate(generate::Args),
    /// List the built-in sample documents or write one as a texture folder
    Sample(sample::Args),
}

impl Command {
    /// Runs the subcommand of the command line `program`.
    pub fn run(self, program: &clap::Command, observer: &dyn Observer) -> Result<()> {
        match self {
            Command::Print(args) => print::run(&args, observer),
            Command::Layers(args) => layers::run(&args, observer),
            Command::Plan(args) => plan::run(&args, observer),
            Command::Preview(args) => preview::run(&args, observer),
            Command::Compare(args) => compare::run(&args, observer),
            Command::Display(args) => display::run(&args, observer),
            Command::Chart(args) => chart::run(&args, observer),
            Command::Preset(args) => preset::run(&args, program),
            Command::Ledger(args) => ledger::run(&args),
            Command::Papers(args) => papers::run(&args),
            Command::Profile(args) => profile::run(&args),
            Command::Factor(args) => args.run(observer),
            Command::Edit(args) => edit::run(&args, observer),
            Command::Map(args) => args.run(observer),
            Command::Halftone(args) => args.run(observer),
            Command::Layout(args) => args.run(observer),
            Command::Separate(args) => args.run(observer),
            Command::Encode(args) => args.run(observer),
            Command::Simulate(args) => args.run(observer),
            Command::Inspect(args) => inspect::run(&args, observer),
            Command::Send(args) => send::run(&args, observer),
            Command::Resume(args) => resume::resume(&args, observer),
            Command::Cancel(args) => resume::cancel(&args, observer),
            Command::Bridge(args) => bridge::run(&args, observer),
            Command::Doctor(args) => doctor::run(&args),
            Command::Inks(args) => inks::run(args, observer),
            Command::Measure(args) => measure::run(&args, observer),
            Command::Generate(args) => generate::run(&args, program),
            Command::Serve(args) => serve::run(&args, program),
            Command::Queue(args) => queue::run(&args, observer),
            Command::Sample(args) => sample::run(args),
            // `main` has run these already.
            Command::CupsBackend(_) | Command::CupsFilter(_) => Ok(()),
        }
    }
}
