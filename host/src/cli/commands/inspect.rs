//! `foilpress inspect`: what is in a stream.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args as ClapArgs;

use serde::Serialize;

use crate::cli::console::{read_job, stdout};
use crate::cli::output::{Kind, Staged};
use device::encodings::streams;
use observe::Observer;
use press::inspect::{Inspected, Inspection, inspect, sheets};
use press::separate::files::{self, save_plane};

/// Arguments of `inspect`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Examples:\n  foilpress inspect job.rgl\n  foilpress inspect job.rgl --passes passes/ --json\n\n\
    A stream of several sheets, as drivers write the pages of a document, is described sheet by sheet, in JSON as a list. \
    Streams of Ghostscript's drivers for these printers are understood as well."
)]
pub struct Args {
    /// Stream in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
    /// Also write the dots of each pass as a one-bit picture to this folder
    #[arg(long, value_name = "DIR")]
    passes: Option<PathBuf>,
}

/// What is said of a sheet.
#[derive(Serialize)]
struct Summary {
    #[serde(flatten)]
    inspection: Inspection,
    /// Bytes that cross the cable to a bridge, which makes the job of them; absent if a bridge gets it byte for byte.
    pass_streams: Option<usize>,
}

/// Runs `inspect`. What could be read is shown even when the stream is no legal job; the exit code then is 1, and no passes
/// are written.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let job = read_job(&args.job)?;
    let places = sheets(&job);
    let several = places.len() > 1;
    let mut out = stdout();
    let staged = args.passes.as_deref().map(|folder| Staged::folder(folder, Kind::Pictures)).transpose()?;
    let inside = staged.as_ref().map(Staged::create).transpose()?;
    let mut summaries = Vec::new();
    let mut written = 0;
    for (number, place) in (1..).zip(&places) {
        let sheet = &job[place.clone()];
        let Inspected { inspection, passes } = inspect(sheet, observer);
        let streams = if inspection.complete { streams::of_bytes(sheet, observer) } else { None };
        let pass_streams = streams.map(|streams| streams.len()).filter(|&bytes| bytes < sheet.len());
        let summary = Summary { inspection, pass_streams };
        if let Some(inside) = inside {
            for pass in &passes {
                // There is no pass before a resolution.
                let dpi = summary.inspection.setup.resolution.unwrap_or_default();
                save_plane(&pass.plane, dpi, &inside.join(files::name(written, pass.ink)))?;
                written += 1;
            }
        }
        if !args.json {
            if several {
                writeln!(out, "sheet {number} of {}, from byte {}:", places.len(), place.start)?;
            }
            write_words(&summary, &mut out)?;
        }
        summaries.push(summary);
    }
    if args.json {
        let text = match &summaries[..] {
            [one] => serde_json::to_string_pretty(one)?,
            all => serde_json::to_string_pretty(all)?,
        };
        writeln!(out, "{text}")?;
    }
    let faulty = (1..)
        .zip(&summaries)
        .find_map(|(number, summary)| Some((number, summary.inspection.error.as_ref()?)));
    // The passes of a stream that is no job are no result: with an error nothing appears.
    let unwritten = if staged.is_some() { "; no passes are written" } else { "" };
    match faulty {
        Some((number, error)) if several => {
            bail!("{}: sheet {number}: {error}{unwritten}", args.job.display())
        }
        Some((_, error)) => bail!("{}: {error}{unwritten}", args.job.display()),
        None => staged.map_or(Ok(()), Staged::commit),
    }
}

fn write_words(summary: &Summary, out: &mut impl std::io::Write) -> Result<()> {
    let Summary { inspection: summary, pass_streams } = summary;
    let setup = &summary.setup;
    let unknown = "not declared";
    let (across, along) = setup.resolution.unwrap_or_default();
    writeln!(
        out,
        "{} bytes, {}{}",
        summary.bytes,
        if summary.complete { "a complete job" } else { "not a complete job" },
        summary.dialect.map_or(String::new(), |driver| format!(", in the dialect of {driver}'s drivers"))
    )?;
    if let Some(bytes) = pass_streams {
        let share = summary.bytes as f64 / *bytes as f64;
        writeln!(out, "{bytes} bytes as pass streams, which a bridge makes the job of (1/{share:.1})")?;
    }
    if setup.resolution.is_none() {
        return Ok(writeln!(out, "no page is declared")?);
    }
    writeln!(
        out,
        "{across} x {along} dpi, {} paper ({}), {} media, {} mode, curl correction {}",
        setup.paper.unwrap_or(unknown),
        match setup.width {
            0 => format!("{} rows, no width declared", setup.length),
            width => format!("{width} x {} dots", setup.length),
        },
        setup.media.unwrap_or(unknown),
        setup.mode.map_or(unknown, |mode| match mode {
            "blackRaster" => "black raster",
            "colourPlane" => "colour plane",
            _ => "multi-plane",
        }),
        setup.curl_correction.map_or(unknown, |on| if on { "on" } else { "off" }),
    )?;
    if (setup.shift_x, setup.shift_y) != (0, 0) {
        writeln!(out, "shifted by {} dots and {} rows", setup.shift_x, setup.shift_y)?;
    }
    if let Some(cartridges) = &setup.cartridges {
        writeln!(out, "cartridge list: {}", cartridges.join(", "))?;
    }
    for pass in &summary.passes {
        write!(
            out,
            "pass {} at byte {}: {} (ink {:02x}, barcode {}, {}), {} dots, {} rows ({} packed), {} bytes",
            pass.number,
            pass.offset,
            pass.ink,
            pass.code,
            pass.barcode,
            pass.cartridge,
            pass.dots,
            pass.rows,
            pass.packed_rows,
            pass.bytes
        )?;
        match &pass.bounds {
            Some(bounds) => writeln!(
                out,
                "\n    from ({}, {}), {} x {} dots; {:.1} x {:.1} mm at {:.1}, {:.1} mm in the printable area",
                bounds.x,
                bounds.y,
                bounds.width,
                bounds.height,
                bounds.mm[2],
                bounds.mm[3],
                bounds.mm[0],
                bounds.mm[1]
            )?,
            None => writeln!(out, "; blank")?,
        }
    }
    Ok(())
}
