//! A bridge on a socket for a program that runs elsewhere or under an emulator: `served-bridge JOB`.
//!
//! Says its address, and once standard input ends whether the very bytes of the job have crossed the printer's port. The printer does not
//! talk back, so that any job may come.

use std::io::{Read as _, Write as _};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use foilpress_tests::served::{Bridge, Port};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("failed: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("usage: served-bridge JOB")?;
    let job = std::fs::read(&path)?;
    let port = Port::new(&[], 4000);
    port.one_way.store(true, Ordering::Relaxed);
    let (bridge, address) = Bridge::on_tcp(([127, 0, 0, 1], 0).into(), port)?;
    println!("{address}");
    #[expect(clippy::disallowed_methods, reason = "the words are our own")]
    std::io::stdout().flush()?;
    std::io::stdin().read_to_end(&mut Vec::new())?;
    let printed = bridge.printed();
    if printed == job {
        Ok(())
    } else {
        Err(format!("{} bytes crossed the port, other than the job's {}", printed.len(), job.len()).into())
    }
}
