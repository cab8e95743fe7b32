//! `foilpress send`: a job in a file to a printer.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args as ClapArgs;

use crate::cli::arguments::choice::whole;
use crate::cli::console::read_job;
use crate::cli::printing::deliver::{Order, deliver, store};
use device::connection::Destination;
use device::deliver::Job;
use device::encodings::{self, Content};
use observe::Observer;

/// Arguments of `send`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress send job.rgl --to usb:                     (the only bridge on USB)\n  \
    foilpress send job.rgl --to serial:/dev/ttyACM0      (a bridge; `foilpress bridge list` finds it)\n  \
    foilpress send job.rgl --to usb: --store             (into the bridge, for its button)\n  \
    foilpress send job.rgl --to raw:/dev/usb/lp0         (a printer on a USB-to-parallel cable)\n\n\
    A job sent to a bridge is kept on disk until it is printed. If the link is lost it continues by itself; after any \
    other interruption `foilpress resume` continues it. A raw device cannot report what it has printed, so a job sent to \
    one cannot be resumed.")]
pub struct Args {
    /// Complete job in the printer's language, or the folder that `print` or `layers` wrote
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Destination: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    #[arg(long, value_name = "WHERE")]
    to: Destination,
    /// Send even if the device does not identify itself as an ALPS printer
    #[arg(long)]
    force: bool,
    /// Number of sheets to print; the program waits for Enter between them
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1..=99u16))]
    copies: u16,
    /// Store the job in the bridge, whose button prints it without a computer
    #[arg(long, conflicts_with_all = ["copies", "force"])]
    store: bool,
}

/// Runs `send`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let bytes = read_job(&args.job)?;
    let name = args.job.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    let checked = encodings::check(&bytes, observer)?;
    let job = Job { name: &name, content: Content::Bytes(&bytes), checked: &checked };
    if args.store {
        return store(job, &args.to, observer);
    }
    let order = Order { copies: args.copies, force: args.force, cartridges_shown: false };
    deliver(job, &args.to, order, observer)
}
