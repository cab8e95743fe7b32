//! `foilpress bridge flash`: new firmware.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use crate::cli::output;
use device::flash::image::Firmware;
use device::flash::{self, ThisComputer};
use device::send::Address;
use observe::Observer;

/// Arguments of `bridge flash`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge flash                               (the firmware that came with this program)\n  \
    foilpress bridge flash --from foilpress-bridge.uf2   (the file that `cargo xtask firmware` writes)\n  \
    foilpress bridge flash --to usb:E6614103E7453D2A     (one of several bridges)\n\n\
    A bridge that runs goes to its boot loader by itself. A new board, or one whose firmware does not answer: hold its \
    BOOTSEL button while plugging it in. Damaged files and other boards' or programs' are refused before anything is \
    erased; after an interruption the same command does it again.")]
pub struct Args {
    /// Firmware to write [default: what this program was built with]
    #[arg(long, value_name = "FILE.uf2")]
    from: Option<PathBuf>,
    /// The bridge to flash [default: the only one there is, or the board in its boot loader]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
}

/// Runs `bridge flash`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let file = match (&args.from, Firmware::embedded_file()) {
        (Some(path), _) => read(path)?,
        (None, Some(file)) => file.to_vec(),
        (None, None) => bail!(
            "this program was built without firmware; in the project's folder `cargo xtask firmware` makes it, then \
             `foilpress bridge flash --from FILE.uf2`"
        ),
    };
    let firmware = Firmware::read(&file).with_context(|| match &args.from {
        Some(path) => path.display().to_string(),
        None => "the firmware in this program".into(),
    })?;
    observer.note(&format!("firmware {}", firmware.version()));
    output::say_on_interrupt(
        "the board is as it was, or waits in its boot loader; run the same command again, the BOOTSEL button held while \
         plugging it in if it is not found",
    );
    let bridge = flash::run(&firmware, &file, args.to.as_ref(), &mut ThisComputer, observer)?;
    super::super::show(&format!("bridge {:016x} runs firmware {}\n", bridge.serial, bridge.firmware))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    let cannot = || format!("cannot read {}", path.display());
    let mut file = Vec::new();
    // One more than can be right, which the reader then refuses.
    let most = uf2::LARGEST_FILE as u64 + 1;
    File::open(path).with_context(cannot)?.take(most).read_to_end(&mut file).with_context(cannot)?;
    Ok(file)
}
