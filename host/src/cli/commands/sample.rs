//! `foilpress sample`: built-in documents, to try the program with.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Result, bail};

use crate::cli::console::stdout;
use crate::cli::output::{Kind, Staged};
use appearance::document;
use appearance::sample::{SAMPLES, Sample};

/// The samples, or one of them as a folder of texture maps.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress sample list\n  \
    foilpress sample leaf -o my-leaf                     (writes an ordinary texture folder, to look at and to change)\n  \
    foilpress print sample:leaf                          (prints it without writing it)")]
pub struct Args {
    /// `list`, or the name of a sample
    name: String,
    /// Folder to write [default: the name of the sample]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// Lists the samples, or draws one and writes its maps.
pub fn run(args: Args) -> Result<()> {
    let mut out = stdout();
    if args.name == "list" {
        if args.output.is_some() {
            bail!("`sample list` writes no files; name a sample to use -o");
        }
        for sample in SAMPLES {
            writeln!(out, "{:<8} {}", sample.name, sample.about)?;
        }
        return Ok(());
    }
    let sample = Sample::named(&args.name)?;
    let target = args.output.unwrap_or_else(|| PathBuf::from(sample.name));
    let staged = Staged::folder(&target, Kind::Maps)?;
    document::write_sample(&sample, staged.create()?)?;
    staged.commit()?;
    writeln!(out, "{}", target.display())?;
    Ok(())
}
