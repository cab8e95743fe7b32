//! `foilpress measure`: photographs of printed stacks to an ink library with measured curves; scans of charts to the dots of inks and the
//! printer's profile.

mod ramp;
mod registration;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use files::shelf::Disk;
use inks::Library;

use crate::cli::console::{print_job, show};
use crate::cli::output::{Kind, Staged};
use measure::Measurement;
use measure::curves::reduce::SampleOrigin;
use measure::setup::Setup;
use observe::Observer;
use sheet::Sheet;

/// Arguments of `measure`.
#[derive(ClapArgs, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  \
    foilpress measure photos/ --setup can.toml --check   (what to mend, after the first photographs)\n  \
    foilpress measure photos/ --setup can.toml -o mine/\n  \
    foilpress measure report mine/                       (one page with every curve)\n  \
    foilpress measure ramp k.png --chart k.rgl --by \"A. Owner\" --when 2026-11-02 -o mine/\n  \
    foilpress measure registration scan.png --chart registration.rgl --profile default\n\n\
    The folder is an ink library: check it with `inks check`, then print with --library.\n\
    docs/measuring-inks.md explains what to photograph and what the setup file says."
)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// Folder of photographs: TIFF, PNG, OpenEXR, JPEG, or camera RAW where LibRaw's tools are installed
    #[arg(required = true)]
    photos: Option<PathBuf>,
    /// Setup file: where camera, lamp, sample and grey card stood, and which stack is where
    #[arg(long, value_name = "FILE.toml", required = true)]
    setup: Option<PathBuf>,
    /// Folder to write: an ink library with the measured curves, measurement.json and pictures
    #[arg(short, long, value_name = "DIR", required_unless_present = "check")]
    output: Option<PathBuf>,
    /// Only say what to mend before more photographs are taken; one photograph is enough, and nothing is written
    #[arg(long, conflicts_with = "output")]
    check: bool,
}

#[derive(Subcommand, Debug)]
enum What {
    /// Read dot gain and the smallest cluster that holds from scans of the ramp chart, and write them to a library
    Ramp(ramp::Args),
    /// Read where the printer starts, how far it feeds and how askew sheets go in from scans of the registration chart, and save
    /// them as a profile
    Registration(registration::Args),
    /// Write a measurement as one self-contained HTML page: masks, residuals, exposures, curves, what to photograph again
    Report {
        /// Folder that `foilpress measure` wrote
        dir: PathBuf,
        /// Page to write [default: report.html in that folder]
        #[arg(short, long, value_name = "FILE.html")]
        output: Option<PathBuf>,
    },
}

/// Runs `measure`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match (&args.what, &args.photos, &args.setup, &args.output) {
        (Some(What::Ramp(args)), ..) => ramp::run(args, observer),
        (Some(What::Registration(args)), ..) => registration::run(args, observer),
        (Some(What::Report { dir, output }), ..) => report(dir, output.as_deref()),
        (None, Some(photos), Some(setup), Some(output)) => curves(photos, setup, output, observer),
        (None, Some(photos), Some(setup), None) => check(photos, setup, observer),
        // The parser asks for them.
        _ => Ok(()),
    }
}

fn curves(photos: &Path, setup: &Path, output: &Path, observer: &dyn Observer) -> Result<()> {
    let setup = Setup::read(setup)?;
    if let Some(added) = measure::curves::library::added(output) {
        bail!(
            "{}: holds {added}, which this would delete; measure into another folder (-o), and copy those tables and curves over",
            output.display()
        );
    }
    let staged = Staged::folder(output, Kind::Measured)?;
    let sheet = setup.sample.chart.as_deref().map(|path| chart(path, observer)).transpose()?;
    let taken = measure::measure(photos, &setup, sheet.as_ref().map(Sheet::dots), observer)?;
    let folder = staged.create()?;
    measure::curves::library::write(&taken, folder)?;
    Library::open(&Disk, folder).context("the measured curves cannot be used as an ink library")?;
    staged.commit()?;
    show(&summary(&taken.measurement, output))
}

/// Says what is right and what to mend.
fn check(photos: &Path, setup: &Path, observer: &dyn Observer) -> Result<()> {
    let setup = Setup::read(setup)?;
    let sheet = setup.sample.chart.as_deref().map(|path| chart(path, observer)).transpose()?;
    let found = measure::check(photos, &setup, sheet.as_ref().map(Sheet::dots), observer)?;
    let mut text = String::new();
    for (word, lines) in [("good", &found.good), ("mend", &found.mend)] {
        for line in lines {
            let _ = writeln!(text, "{word}  {line}");
        }
    }
    show(&text)?;
    match found.mend.len() {
        0 => Ok(()),
        1 => bail!("one thing to mend before the series is taken"),
        n => bail!("{n} things to mend before the series is taken"),
    }
}

fn report(dir: &Path, output: Option<&Path>) -> Result<()> {
    let page = measure::curves::report::html(dir)?;
    let target = output.map_or_else(|| dir.join("report.html"), Path::to_path_buf);
    let staged = Staged::file(&target)?;
    std::fs::write(staged.path(), page).with_context(|| format!("cannot write {}", target.display()))?;
    staged.commit()?;
    show(&format!("{}\n", target.display()))
}

/// What was measured, in a line for each stack.
fn summary(measurement: &Measurement, output: &Path) -> String {
    let mut text =
        format!("{:<12} {:>9} {:>9} {:>15}  uncertain by\n", "stack", "f(2)", "f(30)", "half angles");
    for stack in &measurement.stacks {
        let near = |degrees: f64| {
            let off = |row: &&measure::curves::reduce::CurveRow| (row.theta_deg - degrees).abs();
            stack.rows.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let at = |degrees: f64| near(degrees).map_or(0.0, |row| row.rgb[1]);
        let seen = || {
            stack.rows.iter().filter(|row| row.kind != SampleOrigin::Extrapolated).map(|row| row.theta_deg)
        };
        let (first, last) = (seen().fold(90.0, f64::min), seen().fold(0.0, f64::max));
        let doubt = near(30.0).map_or(0.0, |row| 200.0 * row.sigma[1] / row.rgb[1].max(1e-12));
        let angles = format!("{first:.1} to {last:.0}");
        let _ = writeln!(
            text,
            "{:<12} {:>9.4} {:>9.4} {angles:>15}  {doubt:.1} %",
            stack.stack,
            at(2.0),
            at(30.0)
        );
    }
    let dir = output.display();
    let _ = writeln!(
        text,
        "\nf is the green reflectance in 1/sr at that half angle; the uncertainty is two standard deviations at 30 degrees.\n\
         Next: foilpress measure report {dir}; foilpress inks check {dir}"
    );
    text
}

/// The sheet that a chart was printed from: a job, or the folder of a sheet.
fn chart(path: &Path, observer: &dyn Observer) -> Result<Sheet> {
    if path.join("sheet.toml").is_file() {
        return Ok(Sheet::load(path)?);
    }
    print_job(path, observer)
}
