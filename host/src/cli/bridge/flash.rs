//! `foilpress bridge flash`: new firmware.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use crate::cli::output;
use crate::cli::stdio::show;
use device::flash::image::Firmware;
use device::flash::{self, FlashError, ThisComputer};
use device::send::Address;
use observe::Observer;

/// Arguments of `bridge flash`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge flash                               (the firmware included in this program)\n  \
    foilpress bridge flash --from foilpress-bridge.uf2   (the file that `cargo xtask firmware` writes)\n  \
    foilpress bridge flash --to usb:E6614103E7453D2A     (one of several bridges)\n\n\
    A running bridge enters its boot loader by itself. For a new board, or one whose firmware does not answer, hold the \
    BOOTSEL button while plugging it in. A file that is damaged, or made for another board or program, is refused before \
    anything is erased. After an interruption, run the same command again.")]
pub struct Args {
    /// Firmware file to install [default: the firmware included in this program]
    #[arg(long, value_name = "FILE.uf2")]
    from: Option<PathBuf>,
    /// Bridge to flash [default: the only one, or the board in its boot loader]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
}

/// Runs `bridge flash`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let images = match &args.from {
        Some(path) => vec![Firmware::read(&read(path)?).with_context(|| path.display().to_string())?],
        None => Firmware::embedded().context("the firmware in this program")?,
    };
    if images.is_empty() {
        bail!(
            "this program was built without firmware; build it with `cargo xtask firmware` in the project's folder, then run \
             `foilpress bridge flash --from FILE.uf2`"
        );
    }
    for firmware in &images {
        observer.note(&format!("firmware {} for a {}", firmware.version(), firmware.chip()));
    }
    output::say_on_interrupt(
        "the board is unchanged or waits in its boot loader; run the same command again, and if the board is not found, hold its \
         BOOTSEL button while plugging it in",
    );
    let bridge = flash::run(&images, args.to.as_ref(), &mut ThisComputer, observer).map_err(|error| {
        let which = matches!(error, FlashError::SeveralBridges(_));
        let error = anyhow::Error::from(error);
        if which { error.context("choose a bridge with --to") } else { error }
    })?;
    show(&format!("bridge {:016x} runs firmware {}\n", bridge.serial, bridge.firmware))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    let cannot = || format!("cannot read {}", path.display());
    let mut file = Vec::new();
    // One byte more than the largest valid file, so that the reader refuses a larger one.
    let most = uf2::LARGEST_FILE as u64 + 1;
    File::open(path).with_context(cannot)?.take(most).read_to_end(&mut file).with_context(cannot)?;
    Ok(file)
}
