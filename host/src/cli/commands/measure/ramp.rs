//! `foilpress measure ramp`: scans of the ramp chart to the dots of inks in a library.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Result;
use inks::Library;
use measure::curves::library::quoted;
use measure::scans::ramp::{self, Dots, LINEAR, Owner, Ramp, RampSeries};
use observe::Observer;
use sheet::dots_in_words;

use crate::cli::commands::inks::place;
use crate::cli::console::show;

/// Arguments of `measure ramp`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress measure ramp k.png --chart k.rgl --by \"A. Owner\" --when 2026-11-02 -o mine/\n  \
    foilpress measure ramp k-1.tif k-2.tif --chart k.rgl       (without -o: only shown)\n\n\
    Make the job with `foilpress chart ramp K substrate --to file:k.rgl`, print it, and scan it at 600 dpi\n\
    with automatic tones turned off. Photographs will do where the sheet is flat and evenly lit. The\n\
    figures belong to the ink that only one of the two stacks has. docs/measuring-inks.md explains them.")]
pub struct Args {
    /// Scans or photographs of one ramp chart; several are averaged
    #[arg(value_name = "SCAN", required = true)]
    scans: Vec<PathBuf>,
    /// Job that the chart was printed from (.rgl), or the folder of its sheet
    #[arg(long, value_name = "JOB.rgl")]
    chart: PathBuf,
    /// Library to write to: its folder, which is created if it is not there [default: only show what was found]
    #[arg(short, long, value_name = "DIR", requires = "by", requires = "when")]
    output: Option<PathBuf>,
    /// Who measured
    #[arg(long, value_name = "NAME")]
    by: Option<String>,
    /// When, as YYYY-MM-DD or YYYY-MM
    #[arg(long, value_name = "DATE")]
    when: Option<String>,
    /// Scanner, paper, and anything else needed to measure it again
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    /// Whether values are proportional to light [default: those of 16 bits and OpenEXR are, those of 8 bits are not]
    #[arg(long, value_name = "BOOL")]
    linear: Option<bool>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `measure ramp`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let sheet = super::chart(&args.chart, observer)?;
    let ramp = ramp::measure(&args.scans, sheet.dots(), &Library::builtin(), args.linear, observer)?;
    let dots = ramp.dots();
    let mut written = String::new();
    if let (Some(output), Some(by), Some(when)) = (&args.output, &args.by, &args.when) {
        if dots.is_empty() {
            anyhow::bail!("nothing to write to {}: {}", output.display(), summary(&ramp));
        }
        let setup = setup(args, &ramp);
        let tables: String = dots.iter().map(|dots| table(dots, by, when, &setup)).collect();
        let library =
            place::dots(output, &tables, &dots.iter().map(|dots| dots.owner.name()).collect::<Vec<_>>())?;
        let dir = output.display();
        let _ =
            writeln!(written, "\nwritten to {dir} ({})\nNext: foilpress inks check {dir}", library.name());
    }
    if args.json {
        return show(&format!("{}\n", serde_json::to_string_pretty(&ramp)?));
    }
    show(&format!("{}{written}", summary(&ramp)))
}

/// How it was measured.
fn setup(args: &Args, ramp: &Ramp) -> String {
    let [a, b] = &ramp.series;
    let scans = match ramp.scans.len() {
        1 => "1 scan".to_owned(),
        n => format!("{n} scans"),
    };
    let chart = format!("ramp chart {} to {}, {scans}", a.stack, b.stack);
    args.note.as_ref().map_or(chart.clone(), |note| format!("{note}; {chart}"))
}

fn table(dots: &Dots, by: &str, when: &str, setup: &str) -> String {
    let mut text = format!(
        "\n[[dots]]\nink = {}\nminimum_cluster = {}\n",
        quoted(dots.owner.name()),
        dots.minimum_cluster
    );
    if let Some(gain) = dots.dot_gain_um {
        let _ = writeln!(text, "dot_gain_um = {gain:.2}");
    }
    for (key, value) in [("by", by), ("when", when), ("setup", setup)] {
        let _ = writeln!(text, "{key} = {}", quoted(value));
    }
    text
}

fn summary(ramp: &Ramp) -> String {
    let mut text = format!("{:<22} {:>16} {:>18}\n", "clusters", "smallest to hold", "dot gain");
    for series in &ramp.series {
        let least = series.minimum_cluster.map_or("none".to_owned(), |dots| dots_in_words(dots.into()));
        let gain = series.minimum_cluster.map_or("unknown".to_owned(), |_| {
            format!("{:.1} um +- {:.1}", series.dot_gain_um, 2.0 * series.dot_gain_error_um)
        });
        let _ =
            writeln!(text, "{:<22} {least:>16} {gain:>18}", format!("{} in {}", series.stack, series.ground));
    }
    let _ = writeln!(
        text,
        "\nThe ramp: half of {} prints as {:.1} %; it is {} (off by {:.1} % at most).",
        ramp.series[0].stack,
        100.0 * (0.5 + ramp.gain_at_half),
        if ramp.off_linear <= LINEAR { "linear but for dot gain" } else { "not linear" },
        100.0 * ramp.off_linear
    );
    for (series, least) in ramp.series.iter().zip(ramp.ramp_clusters) {
        text.push_str(&advice(series, least));
    }
    text
}

/// What to make of a series. `least` is the smallest cluster of the ramp.
fn advice(series: &RampSeries, least: u32) -> String {
    let stack = &series.stack;
    match series.minimum_cluster {
        None => format!(
            "{stack}: clusters of 22 to 24 dots do not print alike; clean the sheet and the scanner, or print the chart again\n"
        ),
        Some(dots) if least > 0 && least < u32::from(dots) => {
            format!(
                "{stack}: the ramp has clusters of {}, and {dots} are needed; print with the library that is written\n",
                dots_in_words(least)
            )
        }
        Some(_) if series.owner.is_none() => {
            format!(
                "{stack}: differs in more than one ink from {}; its figures belong to none of them\n",
                series.ground
            )
        }
        Some(_) if series.owner == Some(Owner::Paper) => {
            "paper: the smallest gap between inks that stays open\n".to_owned()
        }
        Some(_) => String::new(),
    }
}
