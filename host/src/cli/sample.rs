//! `foilpress sample`: documents made by the program itself.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Result, bail};

use super::output::Staged;
use crate::sample::{SAMPLES, Sample};

/// Documents made by the program itself.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  foilpress sample list\n  foilpress sample leaf -o leaf/")]
pub struct Args {
    /// `list`, or the sample to write as a folder of texture maps
    #[arg(value_name = "list|NAME")]
    name: String,
    /// Folder to write [default: NAME in the current folder]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// Runs `sample`.
pub fn run(args: Args) -> Result<()> {
    if args.name == "list" {
        if args.output.is_some() {
            bail!("`list` writes no folder; name a sample to write, such as `foilpress sample leaf -o DIR`");
        }
        let mut out = std::io::stdout().lock();
        for sample in SAMPLES {
            writeln!(out, "{:<8} {}", sample.name, sample.about)?;
        }
        return Ok(());
    }
    let sample = Sample::named(&args.name)?;
    let staged = Staged::new(&args.output.unwrap_or_else(|| sample.name.into()))?;
    sample.draw().write(sample.name, staged.folder()?)?;
    staged.commit()
}
