//! `foilpress doctor`: what is needed to print, what of it is there, and what to do next.

use std::io::Write as _;
use std::path::Path;

use anyhow::{Result, bail};
use clap::Args as ClapArgs;

use super::bridge::{Found, ports};
use super::resume::line;
use crate::send::journal::Journal;
use crate::send::session::Phase;
use crate::send::{Address, OpenError};

/// Arguments of `doctor`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  foilpress doctor\n  foilpress doctor --to serial:/dev/ttyACM0")]
pub struct Args {
    /// Where the bridge is [default: every port that may be one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
}

/// What lets users other than root open a bridge on Linux.
const UDEV_RULE: &str = "\
    sudo tee /etc/udev/rules.d/70-foilpress.rules <<'END'
    SUBSYSTEM==\"tty\", ATTRS{manufacturer}==\"Foilpress\", TAG+=\"uaccess\"
    KERNEL==\"lp[0-9]*\", SUBSYSTEM==\"usbmisc\", TAG+=\"uaccess\"
    END
    sudo udevadm control --reload && sudo udevadm trigger";

/// Runs `doctor`. Fails if something stands in the way of printing.
pub fn run(args: &Args) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let mut troubles = 0;
    match Journal::of_user() {
        Ok(journal) => {
            writeln!(out, "jobs are kept in {}", journal.folder().display())?;
            for entry in journal.entries()? {
                if !matches!(entry.record.phase, Phase::Ended(_)) {
                    writeln!(out, "    waits for `foilpress resume`: {}", line(&entry))?;
                }
            }
        }
        Err(error) => {
            troubles += 1;
            writeln!(out, "jobs cannot be kept: {error}")?;
        }
    }
    let addresses: Vec<Address> = match &args.to {
        Some(address) => vec![address.clone()],
        None => ports().into_iter().filter(|port| port.candidate).map(|port| port.address).collect(),
    };
    if addresses.is_empty() {
        troubles += 1;
        writeln!(
            out,
            "no bridge on USB: plug it in. If it is, its cable may carry no data, or it has no firmware yet; a bridge \
             elsewhere can be named with --to"
        )?;
    }
    for address in &addresses {
        writeln!(out, "\n{address}")?;
        match Found::ask(address) {
            Ok(found) => {
                found.write(&mut out)?;
                troubles += usize::from(found.fault.is_some());
            }
            Err(error) => {
                troubles += 1;
                writeln!(out, "{error:#}")?;
                if matches!(error.downcast_ref(), Some(OpenError::Forbidden(_))) && cfg!(target_os = "linux")
                {
                    writeln!(out, "allow it once, as root, and plug the bridge in again:\n\n{UDEV_RULE}\n")?;
                }
            }
        }
    }
    let raw = Path::new("/dev/usb/lp0");
    if raw.exists() {
        match std::fs::OpenOptions::new().write(true).open(raw) {
            Ok(_) => writeln!(out, "\n{} is there: `--to raw:{}` sends to it", raw.display(), raw.display())?,
            Err(error) => writeln!(out, "\n{} is there but: {error}", raw.display())?,
        }
    }
    if troubles > 0 {
        bail!("things that stand in the way of printing: {troubles}");
    }
    writeln!(out, "\nall is well")?;
    Ok(())
}
