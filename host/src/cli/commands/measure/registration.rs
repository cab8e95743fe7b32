//! `foilpress measure registration`: scans of the registration chart to a profile of the printer.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Result;
use inks::Library;
use measure::scans::registration::{self, Registration};
use observe::Observer;

use crate::cli::commands::profile::{in_words, save_profile};
use crate::cli::console::show;

/// A skew that is worth a word, in degrees: 1.5 mm along an A4 sheet.
const ASKEW: f64 = 0.3;
/// Sheets that are farther apart than this, in mm, are not corrected by one profile.
const APART: f64 = 0.3;

/// Arguments of `measure registration`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress measure registration scan.png --chart registration.rgl --profile default\n  \
    foilpress measure registration a.tif b.tif --chart registration.rgl --dpi 600\n\n\
    Make the job with `foilpress chart registration --to file:registration.rgl`, print it, lay something\n\
    black behind the sheet, and scan all of it with its left and top edges inside the picture. The profile\n\
    is used as one that `profile set` saves.")]
pub struct Args {
    /// Scans of the registration chart; several sheets are averaged
    #[arg(value_name = "SCAN", required = true)]
    scans: Vec<PathBuf>,
    /// Job that the chart was printed from (.rgl), or the folder of its sheet
    #[arg(long, value_name = "JOB.rgl")]
    chart: PathBuf,
    /// Profile to save; `default` is used whenever none is named [default: only show what was found]
    #[arg(long, value_name = "NAME")]
    profile: Option<String>,
    /// Resolution of the scans [default: as their files state]
    #[arg(long, value_name = "DPI")]
    dpi: Option<f64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `measure registration`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let sheet = super::chart(&args.chart, observer)?;
    let found = registration::measure(&args.scans, &sheet, &Library::builtin(), args.dpi, observer)?;
    let mut text = summary(&found);
    if let Some(name) = &args.profile {
        let path = save_profile(name, &found.profile)?;
        let _ = writeln!(text, "\n{}: {}", path.display(), in_words(&found.profile));
    }
    if args.json {
        return show(&format!("{}\n", serde_json::to_string_pretty(&found)?));
    }
    show(&text)
}

fn summary(found: &Registration) -> String {
    let mut text =
        format!("{:<20} {:>18} {:>9} {:>12} {:>10}\n", "scan", "offset in mm", "feed", "skew", "residual");
    for placed in &found.scans {
        let [x, y] = placed.offset_mm;
        let _ = writeln!(
            text,
            "{:<20} {:>18} {:>9.5} {:>8.3} deg {:>7.3} mm",
            placed.scan,
            format!("{x:.3}, {y:.3}"),
            placed.feed,
            placed.skew_deg,
            placed.residual_mm
        );
    }
    if let Some(apart) = found.apart_mm.filter(|apart| *apart > APART) {
        let _ = writeln!(
            text,
            "\nThe sheets are up to {apart:.1} mm apart; set the paper guides, then print and scan again."
        );
    }
    if found.profile.skew_deg.abs() > ASKEW {
        text.push_str("\nSheets go in askew, which a profile does not correct; set the paper guides.\n");
    }
    text
}
