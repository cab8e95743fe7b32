//! `foilpress inks from`: a curve from an instrument other than a camera, into a library.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Result;
use appearance::document;
use files::shelf::{Disk, Shelf as _};
use inks::{Curve, Stack, archive};
use measure::curves::library::{curve_name, quoted};
use measure::curves::readings;
use observe::Observer;

use super::page::file_name_of;
use super::place;

/// The largest curve file that is copied, in bytes.
const MOST_BYTES: u64 = 16 << 20;

/// Arguments of `inks from`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks from p-sf.brdf --stack P+SF --by \"A. Owner\" --when 2026-11 -o mine/\n  \
    foilpress inks from k.toml --stack K --by \"A. Owner\" --when 2026-11-02 --note Rhopoint -o mine/\n\n\
    Readings of gloss and colour are a file such as\n  \
    format = 1\n  \
    lab = [16, 0, 0]      # CIELAB under D50, 45 degrees to the normal\n  \
    gloss_20 = 1.5        # gloss units; at least one of 20, 60 and 85 degrees\n  \
    gloss_60 = 9.0\n  \
    f0 = 0.04             # reflectance of the surface; for metals such as [0.85, 0.66, 0.31]\n\
    Their curve counts as predicted from measurements, since its shape is assumed.")]
pub struct Args {
    /// What the instrument gave: a goniometer's table (.brdf), a MERL .binary, an RGL .bsdf, a curve (.csv), or readings of
    /// gloss and colour (.toml)
    source: PathBuf,
    /// Stack that was measured: inks from the bottom up, such as `P+SF` or `substrate`
    #[arg(long, value_name = "STACK")]
    stack: Stack,
    /// Who measured
    #[arg(long, value_name = "NAME")]
    by: String,
    /// When, as YYYY-MM-DD or YYYY-MM
    #[arg(long, value_name = "DATE")]
    when: String,
    /// Instrument, paper, and anything else needed to measure it again
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    /// Library to add the curve to: its folder, which is created if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// What a source says about a stack.
struct Taken {
    /// The table of `library.toml` that it belongs into.
    table: &'static str,
    csv: Vec<u8>,
    /// What it is, for the provenance.
    setup: String,
}

/// Runs `inks from`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<String> {
    let taken = read(args, observer)?;
    let name = curve_name(&args.stack.to_string());
    let setup = args.note.as_ref().map_or(taken.setup.clone(), |note| format!("{note}; {}", taken.setup));
    let mut table = format!("\n[[{}]]\n", taken.table);
    for (key, value) in [
        ("stack", args.stack.to_string()),
        ("curve", name.clone()),
        ("by", args.by.clone()),
        ("when", args.when.clone()),
        ("setup", setup),
    ] {
        writeln!(table, "{key} = {}", quoted(&value))?;
    }
    let added = archive::Member { name: name.clone(), bytes: taken.csv };
    let library = place::curve(&args.output, &table, added, &args.stack)?;
    let word = library.entry(&args.stack).map_or("", |entry| entry.provenance.word());
    let dir = args.output.display();
    Ok(format!(
        "{}: {word}, in {}\n{dir}: {}\nNext: foilpress inks check {dir}; foilpress inks show {} --library {dir}\n",
        args.stack,
        args.output.join(&name).display(),
        library.origins(),
        args.stack
    ))
}

fn read(args: &Args, observer: &dyn Observer) -> Result<Taken> {
    let path = &args.source;
    let named = file_name_of(path);
    let ending =
        path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if ending == "toml" {
        let from = readings::read(path)?;
        let mut csv = "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma,kind\n".to_owned();
        super::predict::rows(&mut csv, &from.curve, &from.sigma)?;
        return Ok(Taken {
            table: "predicted",
            csv: csv.into_bytes(),
            setup: format!("from {named}: {}", from.words),
        });
    }
    let curve = document::measured(&Disk, path, observer)?;
    let csv = if ending == "csv" {
        // The file itself, with its standard deviations.
        Disk.read(path, MOST_BYTES)?
    } else {
        text_of(&curve)?
    };
    let what = match &*ending {
        "csv" => format!("curve {named}"),
        "binary" => format!("MERL table {named}, averaged over the difference angle"),
        "brdf" => format!("goniometer table {named}, averaged over the difference angle"),
        _ => format!("RGL measurement {named}, averaged over the difference angle"),
    };
    Ok(Taken { table: "measured", csv, setup: what })
}

fn text_of(curve: &Curve) -> Result<Vec<u8>> {
    let mut csv = Vec::new();
    curve.to_csv(&mut csv)?;
    Ok(csv)
}
