//! `foilpress bridge log`: the log of the firmware, decoded.
//!
//! The decoder is behind the feature `log`: those who change the firmware need it, and it takes as long to build as a crate of ours.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args as ClapArgs;

use device::connection::Address;

/// Arguments of `bridge log`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  foilpress bridge log\n  \
    foilpress bridge log --elf target/firmware/foilpress-bridge.elf\n\n\
    The bridge keeps the last few thousand bytes of its log, even across a restart, so the log shows what led to one. Times \
    are in seconds since the start. The log can be read while a job prints.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    pub to: Option<Address>,
    /// ELF file of the firmware on the bridge [default: the one that came with this program]
    #[arg(long, value_name = "FILE")]
    pub elf: Option<PathBuf>,
    /// Print JSON, one object on a line for each entry
    #[arg(long)]
    pub json: bool,
}

/// Runs `bridge log`.
#[cfg(not(feature = "log"))]
pub fn run(_args: &Args) -> Result<()> {
    anyhow::bail!(
        "this program was built without what reads the log; packages have it, and so does `cargo run --release --features log -- bridge log`"
    )
}

#[cfg(feature = "log")]
pub use with_decoder::run;

#[cfg(feature = "log")]
mod with_decoder {
    use std::io::Write as _;

    use anyhow::{Context as _, bail};
    use device::flash::installed;
    use device::questions::log;
    use device::questions::query::Query;
    use serde_json::json;

    use super::super::found::{PATIENCE, named_or_only};
    use super::*;
    use crate::cli::console::stdout;

    /// The ELF file of the firmware has a few megabytes.
    const LARGEST: u64 = 64 << 20;

    /// Runs `bridge log`.
    pub fn run(args: &Args) -> Result<()> {
        let address = named_or_only(args.to.as_ref())?;
        let mut link = address.open()?;
        let mut query = Query::new(&mut *link, PATIENCE)?;
        let came_with_us = || installed::image_for(&query.bridge().firmware).map(|installed| installed.elf());
        let path = args.elf.clone().or_else(came_with_us).context(
            "no firmware for this bridge came with this program; name the ELF file of the bridge's firmware with --elf (`cargo xtask \
             firmware` writes foilpress-bridge.elf)",
        )?;
        let what = || format!("cannot read {}", path.display());
        if std::fs::metadata(&path).with_context(what)?.len() > LARGEST {
            bail!("{} is larger than {} MB, so it is not firmware", path.display(), LARGEST >> 20);
        }
        let program = std::fs::read(&path).with_context(what)?;
        let raw = log::read(&mut query, PATIENCE)?;
        let log = log::decode(&raw, &program)?;
        let mut out = stdout();
        if args.json {
            for entry in &log.entries {
                writeln!(out, "{}", serde_json::to_string(entry)?)?;
            }
            writeln!(out, "{}", json!({ "lost_bytes": raw.lost, "unreadable": log.unreadable }))?;
            return Ok(());
        }
        if raw.lost > 0 {
            writeln!(out, "({} earlier bytes are gone: newer entries have overwritten them)", raw.lost)?;
        }
        for entry in &log.entries {
            write!(out, "{:>12}  {:<5}  {}", entry.time, entry.level.unwrap_or(""), entry.text)?;
            match &entry.place {
                // The place in the source helps only with warnings and errors.
                Some(place) if matches!(entry.level, Some("error" | "warn")) => writeln!(out, "  ({place})")?,
                _ => writeln!(out)?,
            }
        }
        if log.unreadable > 0 {
            writeln!(
                out,
                "({} entries cannot be decoded: is this the firmware on the bridge?)",
                log.unreadable
            )?;
        }
        Ok(())
    }
}
