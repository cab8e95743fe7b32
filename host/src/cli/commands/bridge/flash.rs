//! `foilpress bridge flash`: new firmware.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args as ClapArgs;

use crate::cli::console::show;
use crate::cli::output;
use device::connection::Address;
use device::flash::image::Firmware;
use device::flash::{self, FlashError, ThisComputer, installed};
use observe::Observer;

/// Arguments of `bridge flash`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress bridge flash                               (the firmware that came with this program)\n  \
    foilpress bridge flash --from foilpress-bridge.uf2   (the file that `cargo xtask firmware` writes)\n  \
    foilpress bridge flash --to usb:E6614103E7453D2A     (one of several bridges)\n\n\
    A running bridge enters its boot loader by itself. For a new board, or one whose firmware does not answer, hold the \
    BOOTSEL button while plugging it in. A file that is damaged, or made for another board or program, is refused before \
    anything is erased. After an interruption, run the same command again.")]
pub struct Args {
    /// Firmware file to install [default: the one that came with this program]
    #[arg(long, value_name = "FILE.uf2")]
    from: Option<PathBuf>,
    /// Bridge to flash [default: the only one, or the board in its boot loader]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
}

/// Runs `bridge flash`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let images = match &args.from {
        Some(path) => vec![Firmware::open(path)?],
        None => installed::images()?.into_iter().map(|installed| installed.firmware).collect(),
    };
    if images.is_empty() {
        let folders: Vec<String> =
            installed::folders().iter().map(|folder| folder.display().to_string()).collect();
        let (board, file, target) = match flash::chip_there(args.to.as_ref(), &mut ThisComputer) {
            Some(chip) => (format!("This board is a {}: take", chip.board()), chip.image().0, chip.image().1),
            None => (
                "Take".into(),
                "foilpress-bridge.uf2 for a Pico, foilpress-bridge-pico2.uf2 for a Pico 2",
                "TARGET",
            ),
        };
        bail!(
            "no firmware came with this program (looked in {}). {board} {file} from a release, or build it in the project's folder with \
             `rustup target add {target}` and `cargo xtask firmware`; then `foilpress bridge flash --from FILE.uf2`",
            folders.join(", ")
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
